//! Settings: where they are allowed, and what they change.

use std::sync::Arc;

use super::super::arguments::Arguments;
use super::super::robots::{self, RobotSet};
use super::super::time::Time;
use super::super::words::{self, Operation, Row, Setting, Word};
use super::super::{Settings, settings};
use super::{Frame, Walker};
use crate::board::Board;
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;
use crate::syntax::{Command, Line, Part, Statement, ValueKind};

/// The settings that come before the others, which depend on the robots and their boards.
const FIRST: [&str; 3] = ["language", "robots", "board"];

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
        let is_board = row.does == Operation::Set(Setting::Board);
        let Some(outer) = self.name_robots(&part.robots, frame) else {
            self.is_board_unknown |= is_board;
            return true;
        };
        match (self.misplaced(line, part, (row, command.head.span), frame), row.does) {
            (Some(diagnostic), _) => {
                self.eval.push(diagnostic);
                // Errors about commands of the wrong board, and about lines for unknown robots, would be wrong.
                self.is_board_unknown |= is_board || row.does == Operation::Set(Setting::Robots);
            }
            (None, Operation::Set(setting)) => {
                frame.given.push((row.name, command.span, frame.robots));
                self.set(setting, Word::Row(row), command, frame);
            }
            (None, _) => {}
        }
        frame.robots = outer;
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
        let robots = frame.robots;
        let name = row.name;
        let in_block = row.in_block && !frame.top;
        let wrong = |message, help| Some(diagnostic!(SettingPlace, span, "{message}"; help: "{help}"));
        if let (Some(robot), Operation::Set(setting)) = (part.robots.first(), row.does)
            && setting.is_shared()
        {
            let names = self.eval.robot_names(robots);
            return Some(
                diagnostic!(Robots, robot.span, "`{name}` is the same for all robots"; help: "remove `{names}:`"),
            );
        }
        if line.parts.len() > 1 || line.start.is_some() {
            let message = format!("the setting `{name}` cannot have a start time or a `;`");
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
        if matches!(row.does, Operation::Set(Setting::Robots | Setting::Board))
            && let Some((first, ..)) =
                frame.given.iter().find(|(given, _, of)| of.meets(robots) && !FIRST.contains(given))
        {
            return wrong(format!("`{name}` comes after `{first}`"), "write it first: the other settings depend on it");
        }
        let is_again = |given: &str, of: RobotSet| given == name && !row.repeats && of.meets(robots);
        let (_, first, _) = frame.given.iter().find(|(given, _, of)| is_again(given, *of))?;
        let diagnostic = wrong(format!("`{name}` is set twice"), "keep one of the two")?;
        Some(diagnostic.label("again here").related(*first, "first set here"))
    }

    fn set(&mut self, setting: Setting, word: Word<'static>, command: &Command<'s>, frame: &Frame) {
        match setting {
            Setting::Board => self.choose_board(word, command, frame.robots),
            Setting::Robots => {
                let names = Arguments::new(word, command, &mut self.eval).and_then(|mut args| {
                    let first = args.next_argument()?;
                    robots::only_argument(first, command, args.eval)?;
                    let names = robots::names(first, args.eval)?;
                    args.finish().map(|()| names)
                });
                match names {
                    Some(names) => self.set_robots(names),
                    // Errors about lines for unknown robots would be wrong.
                    None => self.is_board_unknown = true,
                }
            }
            _ => {
                self.for_each(frame.robots, |walker| {
                    walker.set_for_robot(setting, word, command, frame.top);
                    Some(Time::ZERO)
                });
            }
        }
    }

    /// Chooses the board of some robots, which everything after this line depends on.
    fn choose_board(&mut self, word: Word<'static>, command: &Command<'s>, robots: RobotSet) {
        // Errors about commands of an unknown board would be wrong.
        let Some(board) = self.board(word, command) else {
            self.is_board_unknown = true;
            return;
        };
        let board = self.boards.push_get(Box::new(board));
        for robot in robots.among(self.count()) {
            self.switch(robot);
            self.eval.board = board;
            if let Some(place) = self.eval.boards.get_mut(robot) {
                *place = board;
            }
            let Settings { tempo, has_tempo, seed, .. } = self.robot.settings;
            self.robot.board = board;
            self.robot.settings = Settings { tempo, has_tempo, seed, ..Settings::of(self.options, board) };
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

    fn set_for_robot(&mut self, setting: Setting, word: Word<'static>, command: &Command<'s>, is_top: bool) {
        let mut settings = Settings { tempo: self.eval.tempo, ..self.robot.settings.clone() };
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
            self.robot.uses.entry(joint.resource).or_insert_with(|| (verb.uses_as.clone(), joint.span));
        }
        self.eval.tempo = settings.tempo;
        if is_top {
            self.eval.random.0 = settings.seed;
            self.robot.settings = settings;
        }
    }
}
