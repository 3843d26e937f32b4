//! The codec of a text board: a template for each verb.

use super::template::{Match, Template};
use crate::board::frame::{BufferStart, FrameError, Skip};
use crate::board::{Board, Codec, Command, NotACommand, ValueForm, VerbId};

/// The templates of a board, in the order of its verbs. No text of one is a text of another, or its
/// beginning.
#[derive(Debug)]
pub(super) struct Templates {
    pub(super) verbs: Vec<Template>,
    pub(super) longest: usize,
}

impl Templates {
    fn of(&self, verb: VerbId) -> Option<&Template> {
        self.verbs.get(verb.row())
    }

    /// How the first bytes match any template.
    fn matches(&self, bytes: &[u8]) -> Match {
        let mut found = Match::No;
        for template in &self.verbs {
            match template.matches(bytes) {
                Match::No => {}
                Match::Begun => found = Match::Begun,
                whole @ Match::Whole(..) => return whole,
            }
        }
        found
    }
}

impl Codec for Templates {
    fn encode(&self, _: &Board, command: &Command, out: &mut Vec<u8>) {
        if let Some(template) = self.of(command.verb()) {
            template.write(&command.values(), out);
        }
    }

    fn check(&self, bytes: &[u8]) -> Result<(), FrameError> {
        match self.matches(bytes) {
            Match::Whole(length, _) if length == bytes.len() => Ok(()),
            Match::Whole(..) | Match::Begun => Err(FrameError::Length),
            Match::No => Err(FrameError::NoHeader),
        }
    }

    fn decode(&self, board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
        decode(&self.verbs, board, frame)
    }

    fn front(&self, bytes: &[u8], _: bool) -> BufferStart {
        match self.matches(bytes) {
            Match::Whole(length, _) => BufferStart::Frame(length),
            Match::Begun => BufferStart::NeedMore,
            Match::No => BufferStart::Skip(self.next_start(bytes), Skip::Noise),
        }
    }

    /// At most up to the end of the line, so that each wrong line is shown by itself.
    fn next_start(&self, bytes: &[u8]) -> usize {
        let line = bytes.iter().position(|byte| matches!(byte, b'\r' | b'\n')).map_or(bytes.len(), |at| at + 1);
        let starts = |at: &usize| bytes.get(*at..).is_some_and(|rest| self.matches(rest) != Match::No);
        (1..line).find(starts).unwrap_or(line).max(1)
    }

    fn longest(&self) -> usize {
        self.longest
    }
}

/// The command that sends these bytes; the templates are in the order of the verbs.
pub(super) fn decode(templates: &[Template], board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
    for (verb, row) in board.verbs() {
        let Some(Match::Whole(length, values)) = templates.get(verb.row()).map(|template| template.matches(frame))
        else {
            continue;
        };
        if length != frame.len() {
            continue;
        }
        let is_word = |(axis, value): (&crate::board::Axis, &i32)| match &axis.takes {
            ValueForm::Word(words) => words.iter().any(|(_, of)| of == value),
            _ => true,
        };
        if !row.axes.iter().zip(&values).all(is_word) {
            return Err(NotACommand::Unknown);
        }
        return board.command(verb, &values);
    }
    Err(NotACommand::Unknown)
}
