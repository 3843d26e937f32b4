//! A virtual board at the far end, behind a line that takes its time.

use crate::clock;
use crate::sim::{Received, VirtualBoard};

/// The most bytes taken at once; the line is then busy for as long as they need.
pub(super) const CHUNK: usize = 16;
/// Bits that a byte takes on the line: start, eight data bits, stop.
const BITS_A_BYTE: u64 = 10;
/// How much may wait before the line counts as overrun, in microseconds.
const BEHIND_US: u64 = 50_000;

pub(super) struct BoardEnd {
    board: VirtualBoard,
    nanos_a_byte: u64,
    /// Until when the line carries what was taken, on the clock.
    busy_until: u64,
    /// Whether bytes have waited for the line, and whether that was told to be too many.
    has_waited: bool,
    is_behind: bool,
    /// Whether the line takes no time any more: at the end, what was written counts as sent.
    is_hurried: bool,
    /// The newest time that the board knows, in microseconds.
    now_us: u64,
}

impl BoardEnd {
    pub(super) fn new(board: VirtualBoard, baud: u32) -> Self {
        BoardEnd {
            board,
            nanos_a_byte: BITS_A_BYTE * 1_000_000_000 / u64::from(baud.max(1)),
            busy_until: 0,
            has_waited: false,
            is_behind: false,
            is_hurried: false,
            now_us: 0,
        }
    }

    pub(super) fn board(&self) -> &VirtualBoard {
        &self.board
    }

    pub(super) fn finish(self) -> Received {
        self.board.finish()
    }

    pub(super) fn poll(&mut self, now_us: u64) {
        self.now_us = self.now_us.max(now_us);
        self.board.poll(self.now_us);
    }

    pub(super) fn is_unplugged(&self, now_us: u64) -> bool {
        self.board.unplugged_us().is_some_and(|us| us <= now_us)
    }

    pub(super) fn is_stalled(&self, now_us: u64) -> bool {
        self.board.stalled_us().is_some_and(|us| us <= now_us)
    }

    pub(super) fn next_due(&self) -> Option<u64> {
        let faults = [self.board.unplugged_us(), self.board.stalled_us()].into_iter().flatten();
        faults.filter(|us| *us > self.now_us).chain(self.board.next_due()).min()
    }

    pub(super) fn busy_until(&self) -> u64 {
        self.busy_until
    }

    /// Takes what comes from now on without waiting for the line.
    pub(super) fn hurry(&mut self) {
        self.is_hurried = true;
    }

    pub(super) fn said(&mut self) -> Vec<u8> {
        self.board.replies().collect()
    }

    pub(super) fn give(&mut self, now: u64, now_us: u64, bytes: &[u8], waiting: u64) -> (u64, Option<u64>) {
        self.now_us = self.now_us.max(now_us);
        self.board.receive(self.now_us, bytes);
        // What has waited for the line is right behind what came before it, however late this thread woke up.
        let begin = if self.has_waited { self.busy_until } else { now.max(self.busy_until) };
        self.busy_until = begin.saturating_add(self.nanos_a_byte.saturating_mul(bytes.len() as u64));
        let waiting_us = waiting.saturating_mul(self.nanos_a_byte) / 1_000;
        let is_news = waiting_us > BEHIND_US && !self.is_behind;
        self.has_waited = waiting > 0;
        self.is_behind = self.has_waited && (self.is_behind || waiting_us > BEHIND_US);
        // A line that is only just busy is waited for here, which no poll does as exactly.
        if !self.is_hurried {
            clock::sleep_until(self.busy_until);
        }
        (begin, is_news.then_some(waiting_us))
    }
}
