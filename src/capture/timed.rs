//! When each frame of a stream began to come.

use std::collections::VecDeque;

use crate::board::{Board, Decoder, Item};

/// Bits that a byte takes on the line: start, eight data bits, stop.
const BITS_A_BYTE: u64 = 10;

/// A decoder that knows when each byte was on the line. Bytes that come at once, because a program wrote them so, stand one after
/// another there.
#[derive(Debug)]
pub struct TimedDecoder {
    decoder: Decoder,
    /// How long a byte takes, in nanoseconds.
    nanos_a_byte: u64,
    /// When the line has carried all that came, in nanoseconds.
    busy_until: u64,
    /// Where each piece begins in the stream, and when; those of which bytes are still in the decoder.
    pieces: VecDeque<(u64, u64)>,
    /// How many bytes have come, and how many have left the decoder.
    fed: u64,
    told: u64,
}

impl TimedDecoder {
    /// A decoder of a line of so many bits a second.
    pub fn new(board: &Board, baud: u32) -> Self {
        Self::with(board, BITS_A_BYTE * 1_000_000_000 / u64::from(baud.max(1)))
    }

    /// A decoder of bytes that come with the times at which each began, however fast the line was.
    pub fn of_times(board: &Board) -> Self {
        Self::with(board, 0)
    }

    fn with(board: &Board, nanos_a_byte: u64) -> Self {
        let decoder = Decoder::new(board);
        TimedDecoder { decoder, nanos_a_byte, busy_until: 0, pieces: VecDeque::new(), fed: 0, told: 0 }
    }

    /// Takes bytes that came at a time, in nanoseconds, and hands what is complete to `sink`, each with the time of its first byte, in
    /// microseconds.
    pub fn feed(&mut self, at: u64, bytes: &[u8], mut sink: impl FnMut(u64, Item<'_>)) {
        let begin = at.max(self.busy_until);
        self.pieces.push_back((self.fed, begin));
        self.fed += bytes.len() as u64;
        self.busy_until = begin.saturating_add((bytes.len() as u64).saturating_mul(self.nanos_a_byte));
        let TimedDecoder { decoder, pieces, told, nanos_a_byte, .. } = self;
        decoder.feed(bytes, |item| sink(time(pieces, told, *nanos_a_byte, item), item));
    }

    /// Ends the stream: what is left over is handed to `sink`.
    pub fn finish(&mut self, mut sink: impl FnMut(u64, Item<'_>)) {
        let TimedDecoder { decoder, pieces, told, nanos_a_byte, .. } = self;
        decoder.finish(|item| sink(time(pieces, told, *nanos_a_byte, item), item));
    }
}

/// When an item began to come, in microseconds; it counts as told then.
fn time(pieces: &mut VecDeque<(u64, u64)>, told: &mut u64, nanos_a_byte: u64, item: Item<'_>) -> u64 {
    while pieces.get(1).is_some_and(|(first, _)| first <= told) {
        pieces.pop_front();
    }
    let (first, begin) = pieces.front().copied().unwrap_or_default();
    let at = begin.saturating_add((*told - first).saturating_mul(nanos_a_byte)) / 1_000;
    *told += match item {
        Item::Frame(frame) => frame.bytes().len(),
        Item::Skipped { bytes, .. } => bytes.len(),
    } as u64;
    at
}
