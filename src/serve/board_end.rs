//! A virtual board at the far end, behind a line that takes its time.

use crate::clock;
use crate::faults::Faulty;
use crate::units::{Micros, Nanos, byte_time};

/// The most bytes taken at once; the line is then busy for as long as they need.
pub(super) const CHUNK: usize = 16;
/// How much may wait before the line counts as overrun.
const BEHIND: Micros = Micros::from_millis(50);

pub(super) struct BoardEnd {
    pub(super) board: Faulty,
    byte_time: Nanos,
    /// Until when the line carries what was taken, on the clock.
    pub(super) busy_until: Nanos,
    /// Whether bytes have waited for the line, and whether that was told to be too many.
    has_waited: bool,
    is_behind: bool,
    /// Whether the line takes no time any more: at the end, what was written counts as sent.
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

    /// Takes what comes from now on without waiting for the line.
    pub(super) fn hurry(&mut self) {
        self.is_hurried = true;
    }

    pub(super) fn give(&mut self, now: Nanos, time: Micros, bytes: &[u8], waiting: u64) -> (Nanos, Option<Micros>) {
        self.board.receive(time, bytes);
        // What has waited for the line is right behind what came before it, however late this thread woke up.
        let begin = if self.has_waited { self.busy_until } else { now.max(self.busy_until) };
        self.busy_until = begin + self.byte_time * bytes.len() as u64;
        let delay = (self.byte_time * waiting).micros();
        let is_news = delay > BEHIND && !self.is_behind;
        self.has_waited = waiting > 0;
        self.is_behind = self.has_waited && (self.is_behind || delay > BEHIND);
        // A line that is only just busy is waited for here, which no poll does as exactly.
        if !self.is_hurried {
            clock::sleep_until(self.busy_until);
        }
        (begin, is_news.then_some(delay))
    }
}
