//! Finds when each frame of a stream started.

use std::collections::VecDeque;

use crate::board::{Board, Decoder, Item};
use crate::units::{Micros, Nanos, byte_time};

/// A decoder that knows when each byte was on the line. Bytes of one write follow each other at the
/// speed of the line.
#[derive(Debug)]
pub struct TimedDecoder {
    decoder: Decoder,
    /// The time that a byte takes.
    byte_time: Nanos,
    /// When the line has sent everything so far.
    busy_until: Nanos,
    /// The position and start time of each piece that still has bytes in the decoder.
    pieces: VecDeque<(u64, Nanos)>,
    /// The numbers of bytes that entered and left the decoder.
    fed: u64,
    decoded: u64,
}

impl TimedDecoder {
    /// A decoder for a line of `baud` bits per second.
    pub fn new(board: &Board, baud: u32) -> Self {
        Self::with(board, byte_time(baud))
    }

    /// A decoder for bytes whose times are those of their start, whatever the speed of the line.
    pub fn of_times(board: &Board) -> Self {
        Self::with(board, Nanos::ZERO)
    }

    fn with(board: &Board, byte_time: Nanos) -> Self {
        let decoder = Decoder::new(board);
        TimedDecoder { decoder, byte_time, busy_until: Nanos::ZERO, pieces: VecDeque::new(), fed: 0, decoded: 0 }
    }

    /// Reads bytes that came at a time, and passes each complete item to `sink`, with the time of
    /// its first byte.
    pub fn feed(&mut self, at: Nanos, bytes: &[u8], mut sink: impl FnMut(Micros, Item<'_>)) {
        let begin = at.max(self.busy_until);
        self.pieces.push_back((self.fed, begin));
        self.fed += bytes.len() as u64;
        self.busy_until = begin + self.byte_time * bytes.len() as u64;
        let TimedDecoder { decoder, pieces, decoded, byte_time, .. } = self;
        decoder.feed(bytes, |item| sink(time(pieces, decoded, *byte_time, item), item));
    }

    /// Ends the stream and passes the remaining bytes to `sink`.
    pub fn finish(&mut self, mut sink: impl FnMut(Micros, Item<'_>)) {
        let TimedDecoder { decoder, pieces, decoded, byte_time, .. } = self;
        decoder.finish(|item| sink(time(pieces, decoded, *byte_time, item), item));
    }
}

/// The start time of an item, which then counts as decoded.
fn time(pieces: &mut VecDeque<(u64, Nanos)>, decoded: &mut u64, byte_time: Nanos, item: Item<'_>) -> Micros {
    while pieces.get(1).is_some_and(|(first, _)| first <= decoded) {
        pieces.pop_front();
    }
    let (first, begin) = pieces.front().copied().unwrap_or_default();
    let at = (begin + byte_time * (*decoded - first)).micros();
    *decoded += match item {
        Item::Frame(frame) => frame.bytes().len(),
        Item::Skipped { bytes, .. } => bytes.len(),
    } as u64;
    at
}
