//! Errors about unknown names: later lines of the file may explain them, so they are completed at its end.

use std::sync::Arc;

use super::calls::Calls;
use crate::diagnostic::{Code, Diagnostic, Diagnostics, diagnostic};
use crate::source::Sources;
use crate::syntax::{Def, Line, Lost, Name, Statement};

/// What must be known at the end of the file that is run.
#[derive(Default)]
pub(super) struct Pending<'s> {
    /// The `def`s at its top level, up to the current line.
    defs: Vec<Arc<Def<'s>>>,
    /// What could not be read of it, up to the current line.
    pub(super) lost: Lost<'s>,
    unknown: Vec<(Code, Unknown<'s>)>,
    /// The values and marks of its top level that come after the first unknown name.
    later: Vec<(Name<'s>, &'static str)>,
}

/// A name that was reported as unknown.
#[derive(Clone, Copy)]
pub(super) struct Unknown<'s> {
    pub(super) name: Name<'s>,
    pub(super) used: Used<'s>,
    /// Whether the name may have been lost above.
    pub(super) may_exist: bool,
}

/// How an unknown name was used.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Used<'s> {
    Value,
    Call,
    /// A call in the body of this `def`.
    CallIn(&'s str),
}

impl<'s> Pending<'s> {
    /// Adds the `def`s of a line at the top level.
    pub(super) fn read(&mut self, line: &Line<'s>) {
        self.defs.extend(line.statements().filter_map(|statement| match statement {
            Statement::Def(def) => Some(Arc::clone(def)),
            _ => None,
        }));
        if !self.unknown.is_empty() {
            self.later.extend(line.statements().filter_map(|statement| match statement {
                Statement::Let(each) => Some((each.name, "defined")),
                Statement::Command(command) if command.head.text == "mark" => {
                    Some((command.arguments.first()?.bare_word()?, "marked"))
                }
                _ => None,
            }));
        }
    }

    /// Adds a name that was reported as unknown with this code.
    pub(super) fn add(&mut self, code: Code, unknown: Unknown<'s>) {
        self.unknown.push((code, unknown));
    }

    /// Replaces the errors that later lines explain.
    pub(super) fn complete(self, sources: &Sources, diagnostics: &mut Diagnostics) {
        if self.unknown.is_empty() {
            return;
        }
        let mut calls = Calls::of(&self.defs);
        for (reported, Unknown { name: Name { text, span }, used, may_exist }) in self.unknown {
            let def = calls.def(text).filter(|_| used != Used::Value);
            let is_lost = may_exist || self.lost.may_hold(text);
            let new = |code, message, help: &str| Some(Diagnostic::new(code, span, message, help));
            let later = self.later.iter().find(|(later, _)| later.text == text && used == Used::Value && !is_lost);
            if let Some((later, how)) = later {
                let line = sources.place(later.span).line;
                let by = diagnostic!(UnknownName, span, "`{text}` is {how} on line {line}, after this line";
                    help: "move this line below it, or move line {line} up");
                diagnostics.replace((reported, span), Some(by.related(later.span, format!("{how} here"))));
                continue;
            }
            let by = match (def, used) {
                (None, _) if !is_lost => continue,
                (None, _) => None,
                (Some(def), Used::CallIn(caller)) => match calls.circle(caller, text) {
                    Some(circle) => {
                        let message = format!("`{caller}` calls itself: {circle}");
                        new(Code::Recursion, message, "use `repeat`; a script always ends")
                    }
                    // A `def` above it has an error, which was reported.
                    None if def.span.start < span.start => None,
                    None => {
                        let help = "move it above this `def`: a body knows only the names above its `def`";
                        new(Code::UnknownName, format!("`{text}` is defined below this `def`"), help)
                    }
                },
                (Some(def), _) if is_lost || def.span.start < span.start => None,
                (Some(def), _) => {
                    let place = sources.place(def.span);
                    let help = format!("move its `def` above this line; it is at {place}");
                    new(Code::UnknownName, format!("`{text}` is defined further down"), &help)
                }
            };
            diagnostics.replace((reported, span), by);
        }
    }
}
