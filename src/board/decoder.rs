//! Frames out of a stream of bytes that may be cut, garbled or noisy.

use std::fmt;

use super::frame::{FrameError, Front, Hex, Skip};
use super::table::{Board, Codec};

/// A checked view of one frame's bytes. It says nothing about meaning; [`Board::decode`] does.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a>(&'a [u8]);

impl<'a> Frame<'a> {
    /// Checks that `bytes` are exactly one frame for this board.
    ///
    /// # Errors
    /// Says why the bytes are not one frame.
    pub fn new(board: &Board, bytes: &'a [u8]) -> Result<Self, FrameError> {
        (board.codec.check)(bytes).map(|()| Frame(bytes))
    }

    /// All bytes.
    pub fn bytes(self) -> &'a [u8] {
        self.0
    }
}

impl fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

/// Upper-case hex with spaces between, as the listing shows it.
impl fmt::Display for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Hex(self.0).fmt(f)
    }
}

/// What the decoder found next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Item<'a> {
    /// A whole frame with the right checksum.
    Frame(Frame<'a>),
    /// Bytes that belong to no frame.
    Skipped {
        /// Position of the first of them in the stream, counted from 0.
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

/// Finds frames in a stream, however it is cut into reads.
///
/// After noise, a cut frame or a bad checksum it goes on with the very next byte, so a whole frame behind the damage is
/// never lost. A frame of an unknown function that claims a length far beyond that of any command does not hold up those inside it:
/// it is what is left of a frame that was cut. So a decoder keeps at most the bytes of the longest frame, and the frames of commands do not wait.
#[derive(Debug)]
pub struct Decoder {
    codec: Codec,
    buffer: Vec<u8>,
    /// Position of the buffer's first byte in the stream.
    position: u64,
    /// Whether zeros came last, as a stop sends them: more of them are more of the same.
    in_zeros: bool,
}

impl Decoder {
    /// A decoder at the start of a stream for a board.
    pub fn new(board: &Board) -> Self {
        Decoder { codec: board.codec, buffer: Vec::new(), position: 0, in_zeros: false }
    }

    /// Takes the next bytes and hands every item that is complete to `sink`.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        for chunk in bytes.chunks(self.codec.longest) {
            self.buffer.extend_from_slice(chunk);
            self.drain(false, &mut sink);
        }
    }

    /// Whether no bytes wait for the rest of a frame.
    pub fn is_between_frames(&self) -> bool {
        self.buffer.iter().all(|byte| *byte == 0)
    }

    /// Ends the stream: what is left over is handed to `sink`.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        self.drain(true, &mut sink);
    }

    fn drain(&mut self, last: bool, sink: &mut impl FnMut(Item<'_>)) {
        let mut done = 0;
        while let Some(rest) = self.buffer.get(done..).filter(|rest| !rest.is_empty()) {
            let front = (self.codec.front)(rest, self.in_zeros);
            self.in_zeros = match front {
                Front::Skip(_, why) => why == Skip::Zeros,
                Front::Frame(_) => false,
                Front::NeedMore => self.in_zeros,
            };
            let used = match front {
                Front::NeedMore if !last => break,
                Front::NeedMore => {
                    // No more will come: a frame may still start behind the header that was cut.
                    let used = (self.codec.next_start)(rest);
                    let why = if rest.starts_with(&[0]) { Skip::Noise } else { Skip::Cut };
                    self.skip(done, used, why, sink);
                    used
                }
                Front::Skip(used, why) => {
                    self.skip(done, used, why, sink);
                    used
                }
                Front::Frame(used) => {
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
