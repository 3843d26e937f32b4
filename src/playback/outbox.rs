//! The bytes on their way to the port.

use crate::board::{BufferStart, Codec};

/// The most bytes written to the port at once.
const BATCH: usize = 16 * 1024;

/// Bytes for the port, and how many of them it has accepted. Its capacity never grows.
#[derive(Debug)]
pub(crate) struct Outbox {
    bytes: Vec<u8>,
    taken: usize,
    /// How many zeros are sent after a flush.
    zeros: usize,
}

impl Outbox {
    /// An empty outbox, for frames of at most `longest` bytes. `zeros` bytes of zeros synchronize the receiver after a flush.
    pub(crate) fn new(zeros: usize, longest: usize) -> Self {
        Outbox { bytes: Vec::with_capacity(BATCH + longest), taken: 0, zeros }
    }

    /// Raises the number of zeros, for a receiver that needs more from now on.
    pub(super) fn needs_zeros(&mut self, zeros: usize) {
        self.zeros = self.zeros.max(zeros);
    }

    /// The bytes that the port has not accepted.
    pub(super) fn rest(&self) -> &[u8] {
        self.bytes.get(self.taken..).unwrap_or_default()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rest().is_empty()
    }

    /// Whether the port has accepted a part of the bytes.
    pub(super) fn has_begun(&self) -> bool {
        self.taken > 0 && !self.is_empty()
    }

    /// Whether no further frame should be added.
    pub(super) fn is_full(&self) -> bool {
        self.bytes.len() >= BATCH
    }

    /// Appends a frame, which `write` writes.
    pub(crate) fn push(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        write(&mut self.bytes);
    }

    pub(super) fn push_zeros(&mut self) {
        self.bytes.resize(self.bytes.len() + self.zeros.min(BATCH), 0);
    }

    /// The port accepted `count` bytes. Returns whether the outbox is empty now.
    pub(super) fn took(&mut self, count: usize) -> bool {
        self.taken = self.taken.saturating_add(count).min(self.bytes.len());
        let all = self.is_empty();
        if all {
            self.clear();
        }
        all
    }

    /// Writes everything again from the start.
    pub(super) fn rewind(&mut self) {
        self.taken = 0;
    }

    /// Keeps only the rest of the frame that the port has begun to accept.
    pub(super) fn keep_begun(&mut self, codec: &dyn Codec) {
        let mut end = 0;
        while end < self.taken {
            match codec.front(self.bytes.get(end..).unwrap_or_default(), false) {
                BufferStart::Frame(length) | BufferStart::Skip(length, _) => end += length.max(1),
                BufferStart::NeedMore => end = self.bytes.len(),
            }
        }
        self.bytes.truncate(end);
        self.took(0);
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.taken = 0;
    }
}
