//! Settings: where they may stand, and what they change.

use super::super::Settings;
use super::super::arguments::Arguments;
use super::super::settings;
use super::super::value::not_yet;
use super::super::words::{self, Does, Word};
use super::{Frame, Unroll};
use crate::diagnostic::{Code, Diagnostic};
use crate::syntax::{Line, Part, Statement};

impl<'s> Unroll<'s, '_> {
    /// Whether this part is a setting: `Some(true)` if it stands where it may, `Some(false)` if not, which is reported.
    pub(super) fn setting_in(&mut self, line: &Line<'s>, part: &Part<'s>, frame: &Frame) -> Option<bool> {
        let Statement::Command(command) = &part.statement else {
            return None;
        };
        let row = words::setting(command.head.text)?;
        let name = row.name;
        let span = command.head.span;
        let in_block = row.in_block && !frame.top;
        let given = if in_block { &frame.given } else { &self.given };
        let twice = given.iter().find(|(given, _)| *given == name && !row.repeats).map(|(_, first)| *first);
        let diagnostic = if row.does == Does::Later {
            not_yet(span, &format!("the setting `{name}`"))
        } else if line.parts.len() > 1 || line.start.is_some() || !part.robots.is_empty() {
            let message = format!("the setting `{name}` has no time and is not joined to anything");
            Diagnostic::new(Code::SettingPlace, span, message, "give it a line of its own, before the first command")
        } else if frame.begun || !(in_block || frame.top && self.eval.scope.main) {
            let (message, help) = if in_block {
                (format!("`{name}` stands behind a command"), "put it first in its block")
            } else {
                let place = if frame.top { "behind a command" } else { "in a block" };
                (
                    format!("the setting `{name}` stands {place}"),
                    "put it before the first command of the script, outside of all blocks",
                )
            };
            Diagnostic::new(Code::SettingPlace, span, message, help)
        } else if let Some(first) = twice {
            let diagnostic =
                Diagnostic::new(Code::SettingPlace, span, format!("`{name}` is set twice"), "keep one of the two");
            diagnostic.label("again here").related(first, "first set here")
        } else {
            return Some(true);
        };
        self.eval.push(diagnostic);
        Some(false)
    }

    pub(super) fn set(&mut self, line: &Line<'s>, frame: &mut Frame) {
        let Some(Part { statement: Statement::Command(command), .. }) = line.parts.first() else {
            return;
        };
        let Some(row) = words::setting(command.head.text) else { return };
        let Does::Set(setting) = row.does else { return };
        let given = if frame.top { &mut self.given } else { &mut frame.given };
        given.push((row.name, command.span));
        let mut settings = Settings { tempo: self.eval.tempo, ..self.settings.clone() };
        if let Some(mut args) = Arguments::new(Word::Row(row), command, &mut self.eval) {
            // Behind a wrong value, what is left over often belongs to the same mistake.
            if settings::set(setting, &mut args, &mut settings).is_some() {
                args.finish();
            }
        }
        self.eval.tempo = settings.tempo;
        if frame.top {
            self.eval.random.0 = settings.seed;
            self.settings = settings;
        }
    }
}
