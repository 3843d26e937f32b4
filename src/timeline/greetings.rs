//! The frames that are the same on every run: the hello and the goodbye of a board, and the requests
//! that start and stop its reports.

use super::{Event, Expectation, Gate, Kind, Timeline};
use crate::board::{Board, Command};
use crate::program::TraceId;
use crate::source::Span;
use crate::units::Micros;

/// What is sent before everything else, and after it.
pub(super) struct Greetings {
    pub(super) first: Vec<Event>,
    pub(super) last: Vec<Event>,
}

impl Greetings {
    /// Those of a script with these expectations and gates, which ends at `end`.
    pub(super) fn of(board: &Board, expects: &[Expectation], gates: &[Gate], end: Micros) -> Self {
        let event = |at, command: &Command, (span, trace)| {
            let command = command.clone();
            Event { at, command, kind: Kind::Auto, is_instant: false, span, trace }
        };
        let nowhere = (Span::default(), TraceId::default());
        let gates = gates.iter().filter(|gate| gate.gate.criterion().is_some());
        let needs = gates.map(|gate| (gate.at, (gate.span, gate.trace)));
        let needs = expects.iter().map(|expect| (expect.at, (expect.span, expect.trace))).chain(needs);
        let first = needs.clone().min_by_key(|(at, _)| *at).map(|(_, place)| place);
        let last = needs.max_by_key(|(at, _)| *at).map(|(_, place)| place);
        let [start, stop] = board.reporting.as_ref().map_or([None; 2], |[start, stop]| [Some(start), Some(stop)]);
        let hello = board.hello.iter().map(|command| event(Micros::ZERO, command, nowhere));
        let goodbye = board.goodbye.iter().map(|command| event(end, command, nowhere));
        Greetings {
            first: hello.chain(start.zip(first).map(|(start, place)| event(Micros::ZERO, start, place))).collect(),
            last: last.and_then(|place| Some(event(end, stop?, place))).into_iter().chain(goodbye).collect(),
        }
    }
}

impl Timeline {
    /// The same for a pass after the first: without the hello of the board.
    #[must_use]
    pub fn without_hello(mut self) -> Self {
        let count = self.board.hello.len();
        self.events.drain(..count.min(self.events.len()));
        for gate in &mut self.gates {
            gate.next.events = gate.next.events.saturating_sub(count);
        }
        self
    }

    /// The same for a pass before the last: without the goodbye of the board.
    #[must_use]
    pub fn without_goodbye(mut self) -> Self {
        self.events.truncate(self.events.len().saturating_sub(self.board.goodbye.len()));
        self
    }
}
