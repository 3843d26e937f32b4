//! Errors about unknown names: what comes further down in the file may explain them, so they are completed at its end.

use std::sync::Arc;

use super::calls::Calls;
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::Sources;
use crate::syntax::{Def, Line, Lost, Name, Statement};

/// What the end of the file that is run needs to know of it.
#[derive(Default)]
pub(super) struct Pending<'s> {
    /// The `def`s at its top level that were read so far.
    defs: Vec<Arc<Def<'s>>>,
    /// What could not be read of it so far.
    pub(super) lost: Lost<'s>,
    unknown: Vec<(Code, Unknown<'s>)>,
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
    }

    /// Adds a name that was reported as unknown with this code.
    pub(super) fn add(&mut self, code: Code, unknown: Unknown<'s>) {
        self.unknown.push((code, unknown));
    }

    /// Replaces the errors that more is known of at the end of the file.
    pub(super) fn complete(self, sources: &Sources, diagnostics: &mut Diagnostics) {
        if self.unknown.is_empty() {
            return;
        }
        let mut calls = Calls::of(&self.defs);
        for (reported, Unknown { name: Name { text, span }, used, may_exist }) in self.unknown {
            let def = calls.def(text).filter(|_| used != Used::Value);
            let is_lost = may_exist || self.lost.may_hold(text);
            let new = |code, message, help: &str| Some(Diagnostic::new(code, span, message, help));
            let by = match (def, used) {
                (None, _) if !is_lost => continue,
                (None, _) => None,
                (Some(def), Used::CallIn(caller)) => match calls.circle(caller, text) {
                    Some(circle) => {
                        let message = format!("`{caller}` ends up calling itself: {circle}");
                        new(Code::Recursion, message, "use `repeat`; a script always ends")
                    }
                    // One above was refused, and that was reported.
                    None if def.span.start < span.start => None,
                    None => {
                        let help = "move it above: a body sees only what stands above its `def`";
                        new(Code::UnknownName, format!("`{text}` stands below this `def`"), help)
                    }
                },
                (Some(def), _) if is_lost || def.span.start < span.start => None,
                (Some(def), _) => {
                    let place = sources.place(def.span);
                    let help = format!("move its `def` above this line; it stands at {place}");
                    new(Code::UnknownName, format!("`{text}` is defined further down"), &help)
                }
            };
            diagnostics.replace((reported, span), by);
        }
    }
}
