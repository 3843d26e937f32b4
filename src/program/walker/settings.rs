//! Settings: where they are allowed, and what they change.

use std::sync::Arc;

use super::super::arguments::Arguments;
use super::super::value::not_yet;
use super::super::words::{self, Operation, Row, Setting, Word};
use super::super::{Settings, settings};
use super::{Frame, Walker};
use crate::board::Board;
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;
use crate::syntax::{Command, Line, Part, Statement, ValueKind};

/// The settings that may come before `board`.
const BEFORE_BOARD: [&str; 3] = ["language", "robots", "board"];

impl<'s> Walker<'s, '_> {
    /// Runs a line that has a setting in it; returns whether it has one.
    pub(super) fn setting(&mut self, line: &Line<'s>, frame: &mut Frame) -> bool {
        let found = line.parts.iter().find_map(|part| match &part.statement {
            // Verbs come first, as nearly every line has one.
            Statement::Command(command) if self.eval.board.find(command.head.text).is_none() => {
                Some((part, command, words::setting(command.head.text)?))
            }
            _ => None,
        });
        let Some((part, command, row)) = found else { return false };
        match (self.misplaced(line, part, (row, command.head.span), frame), row.does) {
            (Some(diagnostic), does) => {
                self.eval.push(diagnostic);
                // Errors about commands of the wrong board would be wrong.
                self.is_board_unknown |= does == Operation::Set(Setting::Board);
            }
            (None, Operation::Set(Setting::Board)) => self.choose_board(Word::Row(row), command, frame),
            (None, Operation::Set(setting)) => self.set(setting, Word::Row(row), command, frame),
            (None, _) => {}
        }
        true
    }

    /// What is wrong with the place of a setting.
    fn misplaced(
        &self,
        line: &Line<'s>,
        part: &Part<'s>,
        (row, span): (&Row, Span),
        frame: &Frame,
    ) -> Option<Diagnostic> {
        let name = row.name;
        let in_block = row.in_block && !frame.top;
        let wrong = |message, help| Some(diagnostic!(SettingPlace, span, "{message}"; help: "{help}"));
        if row.does == Operation::Later {
            return Some(not_yet(span, &format!("the setting `{name}`")));
        }
        if line.parts.len() > 1 || line.start.is_some() || !part.robots.is_empty() {
            let message = format!("the setting `{name}` cannot have a start time, a robot or a `;`");
            return wrong(message, "write it on a line of its own, before the first command");
        }
        if in_block && frame.begun {
            return wrong(format!("`{name}` comes after a command"), "move it to the start of its block");
        }
        if !in_block && (frame.begun || !frame.top || !self.eval.scope.main) {
            let place = if frame.top { "after a command" } else { "inside a block" };
            let help = "move it before the first command of the script, outside of all blocks";
            return wrong(format!("the setting `{name}` is {place}"), help);
        }
        if row.does == Operation::Set(Setting::Board)
            && let Some((first, _)) = frame.given.iter().find(|(given, _)| !BEFORE_BOARD.contains(given))
        {
            return wrong(format!("`{name}` comes after `{first}`"), "write it first: the other settings depend on it");
        }
        let (_, first) = frame.given.iter().find(|(given, _)| *given == name && !row.repeats)?;
        let diagnostic = wrong(format!("`{name}` is set twice"), "keep one of the two")?;
        Some(diagnostic.label("again here").related(*first, "first set here"))
    }

    /// Chooses the board of the script, which everything after this line depends on.
    fn choose_board(&mut self, word: Word<'static>, command: &Command<'s>, frame: &mut Frame) {
        frame.given.push((word.signature().name, command.span));
        match self.board(word, command) {
            Some(board) => {
                let board = self.boards.push_get(Box::new(board));
                self.eval.board = board;
                self.program.board = Arc::clone(board);
                let tempo = self.program.settings.tempo;
                self.program.settings = Settings { tempo, ..Settings::of(self.options, board) };
            }
            // Errors about commands of an unknown board would be wrong.
            None => self.is_board_unknown = true,
        }
    }

    fn board(&mut self, word: Word<'static>, command: &Command<'s>) -> Option<Arc<Board>> {
        let mut args = Arguments::new(word, command, &mut self.eval)?;
        let value = args.next()?;
        if let ValueKind::Text(_) = value.kind {
            args.finish()?;
            return self.text_board(value);
        }
        let board = settings::family(value, &mut args)?;
        args.finish()?;
        Some(board)
    }

    fn set(&mut self, setting: Setting, word: Word<'static>, command: &Command<'s>, frame: &mut Frame) {
        frame.given.push((word.signature().name, command.span));
        let mut settings = Settings { tempo: self.eval.tempo, ..self.program.settings.clone() };
        if let Some(mut args) = Arguments::new(word, command, &mut self.eval) {
            // After a wrong value, the remaining arguments often belong to the same mistake.
            if settings::set(setting, &mut args, &mut settings).is_some() {
                args.finish();
            }
        }
        if setting == Setting::Joint
            && let Some(joint) = settings.joints.last()
            && let Some(verb) = self.eval.board.verb(joint.limited.verb).filter(|verb| !verb.uses_as.is_empty())
        {
            self.uses.entry(joint.resource).or_insert_with(|| (verb.uses_as.clone(), joint.span));
        }
        self.eval.tempo = settings.tempo;
        if frame.top {
            self.eval.random.0 = settings.seed;
            self.program.settings = settings;
        }
    }
}
