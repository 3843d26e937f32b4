//! Finds frames in a stream of bytes that may be cut, damaged or noisy.

use std::fmt;
use std::sync::Arc;

use super::frame::{BufferStart, FrameError, Hex, Skip};
use super::table::{Board, Codec};

/// The bytes of one valid frame. [`Board::decode`] reads their meaning.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a>(&'a [u8]);

impl<'a> Frame<'a> {
    /// Checks that `bytes` are exactly one frame of this board.
    ///
    /// # Errors
    /// Why the bytes are not one frame.
    pub fn new(board: &Board, bytes: &'a [u8]) -> Result<Self, FrameError> {
        board.codec.check(bytes).map(|()| Frame(bytes))
    }

    /// All bytes of the frame.
    pub fn bytes(self) -> &'a [u8] {
        self.0
    }
}

impl fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

/// Upper-case hex digits separated by spaces, as in a listing.
impl fmt::Display for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Hex(self.0).fmt(f)
    }
}

/// The next item in the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Item<'a> {
    /// A complete frame with the right checksum.
    Frame(Frame<'a>),
    /// Bytes outside of any frame.
    Skipped {
        /// Position of the first byte in the stream, counted from 0.
        at: u64,
        /// The bytes.
        bytes: &'a [u8],
        /// Why they were skipped.
        why: Skip,
    },
}

/// An item with bytes of its own, for other threads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnedItem {
    bytes: Box<[u8]>,
    /// Where it was in the stream, and why it was skipped; `None` for a frame.
    skipped: Option<(u64, Skip)>,
}

impl From<Item<'_>> for OwnedItem {
    fn from(item: Item<'_>) -> Self {
        match item {
            Item::Frame(Frame(bytes)) => OwnedItem { bytes: bytes.into(), skipped: None },
            Item::Skipped { at, bytes, why } => OwnedItem { bytes: bytes.into(), skipped: Some((at, why)) },
        }
    }
}

impl OwnedItem {
    /// What the decoder found.
    pub fn item(&self) -> Item<'_> {
        match self.skipped {
            None => Item::Frame(Frame(&self.bytes)),
            Some((at, why)) => Item::Skipped { at, bytes: &self.bytes, why },
        }
    }
}

/// Finds frames in a stream, no matter how the stream is split into reads.
///
/// After noise, a truncated frame or a wrong checksum, the search continues with the next byte, so
/// the decoder finds every complete frame after the damage. A frame of an unknown function whose
/// length is far above that of any command is the rest of a truncated frame, and does not delay the
/// frames inside it. The decoder buffers at most the bytes of the longest frame.
#[derive(Debug)]
pub struct Decoder {
    codec: Arc<dyn Codec>,
    buffer: Vec<u8>,
    /// The position of the buffer's first byte in the stream.
    position: u64,
    /// Whether the last bytes were zeros, as a stop sends them. More zeros belong to the same run.
    in_zeros: bool,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new(board: &Board) -> Self {
        Decoder { codec: Arc::clone(&board.codec), buffer: Vec::new(), position: 0, in_zeros: false }
    }

    /// Reads the next bytes and passes each complete item to `sink`.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        for chunk in bytes.chunks(self.codec.longest()) {
            self.buffer.extend_from_slice(chunk);
            self.drain(false, &mut sink);
        }
    }

    /// Whether the buffer holds no part of a frame.
    pub fn is_between_frames(&self) -> bool {
        // Zeros belong to no frame if the family sends them after a flush.
        let takes_zeros = self.codec.resync(None) > 0;
        self.buffer.is_empty() || takes_zeros && self.buffer.iter().all(|byte| *byte == 0)
    }

    /// Ends the stream and passes the remaining bytes to `sink`.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        self.drain(true, &mut sink);
    }

    fn drain(&mut self, last: bool, sink: &mut impl FnMut(Item<'_>)) {
        let mut done = 0;
        while let Some(rest) = self.buffer.get(done..).filter(|rest| !rest.is_empty()) {
            let front = self.codec.front(rest, self.in_zeros);
            self.in_zeros = match front {
                BufferStart::Skip(_, why) => why == Skip::Zeros,
                BufferStart::Frame(_) => false,
                BufferStart::NeedMore => self.in_zeros,
            };
            let used = match front {
                BufferStart::NeedMore if !last => break,
                BufferStart::NeedMore => {
                    // No more bytes will come. A frame may still start after the truncated header.
                    let used = self.codec.next_start(rest);
                    let why = if rest.starts_with(&[0]) { Skip::Noise } else { Skip::Cut };
                    self.skip(done, used, why, sink);
                    used
                }
                BufferStart::Skip(used, why) => {
                    self.skip(done, used, why, sink);
                    used
                }
                BufferStart::Frame(used) => {
                    if let Some(frame) = rest.get(..used) {
                        sink(Item::Frame(Frame(frame)));
                    }
                    used
                }
            };
            done += used;
        }
        self.buffer.drain(..done);
        self.position += done as u64;
    }

    fn skip(&self, from: usize, used: usize, why: Skip, sink: &mut impl FnMut(Item<'_>)) {
        sink(Item::Skipped {
            at: self.position + from as u64,
            bytes: self.buffer.get(from..from + used).unwrap_or_default(),
            why,
        });
    }
}
