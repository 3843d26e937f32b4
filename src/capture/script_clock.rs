//! The times of a script: those of the stream from its first frame on, as a person would write them.

use std::sync::Arc;

use crate::board::{Board, Command};
use crate::units::{Micros, Nanos, byte_time};

/// How far the frames of one burst may be apart on the line. A program has sent them at once.
pub(super) const BURST: Micros = Micros::from_millis(3);
/// The most time between two frames of a burst that a machine may add.
const SLACK: Micros = Micros(200);
const MILLI: u64 = 1_000;

/// Converts the times of a stream to those of a script, which start at 0 and never decrease.
///
/// In exact mode they are unchanged. Otherwise they are rounded to a millisecond, and frames that
/// follow each other on the line without a pause have the same time: when played, they follow each
/// other again. A command never has the time of an earlier one for the same resource.
pub(super) struct ScriptClock {
    board: Arc<Board>,
    exact: bool,
    byte_time: Nanos,
    /// The time of the first frame.
    begin: Option<Micros>,
    /// The current time of the script, and the commands with that time.
    now: Micros,
    sent: Vec<Command>,
    /// When the current burst began on the line, and when its last frame has left.
    burst: Micros,
    free: Micros,
}

impl ScriptClock {
    pub(super) fn new(board: Arc<Board>, exact: bool, baud: u32) -> Self {
        let (now, burst, free) = (Micros::ZERO, Micros::ZERO, Micros::ZERO);
        ScriptClock { board, exact, byte_time: byte_time(baud), begin: None, now, sent: Vec::new(), burst, free }
    }

    /// The time of something that is not a frame.
    pub(super) fn time(&self, at: Micros) -> Micros {
        self.begin.map_or(Micros::ZERO, |begin| self.rounded(at - begin)).max(self.now)
    }

    /// The time of a command whose frame began on the line at a time, and has this length; 0 if it is part of the frame before.
    pub(super) fn frame(&mut self, at: Micros, command: Option<&Command>, length: usize) -> Micros {
        let exact = at - *self.begin.get_or_insert(at);
        let board = &self.board;
        let clashes = |one: &Command, other: &Command| board.supersedes(one, other) || board.supersedes(other, one);
        let is_busy = command.is_some_and(|command| self.sent.iter().any(|sent| clashes(sent, command)));
        let is_burst = exact <= self.free + SLACK && exact <= self.burst + BURST && !is_busy;
        let mut time = self.rounded(exact).max(self.now);
        if is_burst && !self.exact && !self.sent.is_empty() {
            time = self.now;
        } else {
            // Values of one resource that come faster keep their exact times.
            if is_busy && (time <= self.now || exact < self.burst + Micros(MILLI)) {
                time = exact.max(self.now + Micros(1));
            }
            self.burst = exact;
        }
        if time > self.now {
            self.sent.clear();
        }
        self.now = time;
        self.sent.extend(command.cloned());
        if length > 0 {
            self.free = (exact.nanos() + self.byte_time * u64::try_from(length).unwrap_or(u64::MAX)).micros();
        }
        time
    }

    fn rounded(&self, at: Micros) -> Micros {
        if self.exact { at } else { Micros::from_millis(at.saturating_add(Micros(MILLI / 2)).0 / MILLI) }
    }
}
