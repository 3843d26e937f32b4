//! A virtual board at the far end of a line with a limited bit rate.

use crate::clock;
use crate::faults::Faulty;
use crate::units::{Micros, Nanos, byte_time};

/// The most bytes taken at once; the line is then busy while it carries them.
pub(super) const CHUNK: usize = 16;
/// How long the waiting bytes may keep the line busy before it counts as overrun.
const BEHIND: Micros = Micros::from_millis(50);

pub(super) struct BoardEnd {
    pub(super) board: Faulty,
    byte_time: Nanos,
    /// When the line has carried what was taken, on the clock.
    pub(super) busy_until: Nanos,
    /// Whether bytes have waited for the line, and whether an overrun was reported.
    has_waited: bool,
    is_behind: bool,
    /// Whether the line carries everything at once: at the end, what was written counts as sent.
    is_hurried: bool,
}

impl BoardEnd {
    pub(super) fn new(board: Faulty, baud: u32) -> Self {
        BoardEnd {
            board,
            byte_time: byte_time(baud),
            busy_until: Nanos::ZERO,
            has_waited: false,
            is_behind: false,
            is_hurried: false,
        }
    }

    /// From now on, takes bytes without waiting for the line.
    pub(super) fn hurry(&mut self) {
        self.is_hurried = true;
    }

    pub(super) fn give(&mut self, now: Nanos, time: Micros, bytes: &[u8], waiting: u64) -> (Nanos, Option<Micros>) {
        self.board.receive(time, bytes);
        // Bytes that waited for the line follow the previous ones at once, even if this thread woke up late.
        let begin = if self.has_waited { self.busy_until } else { now.max(self.busy_until) };
        self.busy_until = begin + self.byte_time * bytes.len() as u64;
        let delay = (self.byte_time * waiting).micros();
        let is_news = delay > BEHIND && !self.is_behind;
        self.has_waited = waiting > 0;
        self.is_behind = self.has_waited && (self.is_behind || delay > BEHIND);
        // Short waits are done here, because `poll` is less exact.
        if !self.is_hurried {
            clock::sleep_until(self.busy_until);
        }
        (begin, is_news.then_some(delay))
    }
}
