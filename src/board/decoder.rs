//! Frames out of a stream of bytes that may be cut, garbled or noisy.

use super::command::known_lengths;
use super::frame::{Frame, FrameError, HEADER, MAX_FRAME, OVERHEAD};

/// What the decoder found next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// Why bytes were skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Skip {
    /// They do not start a frame.
    #[error("no frame starts here")]
    Noise,
    /// A frame starts here, but its length is not one that its function has.
    #[error("function 0x{function:02X} has no payload of {length} bytes")]
    Length {
        /// The function byte.
        function: u8,
        /// The length byte.
        length: u8,
    },
    /// A frame stood here, but its checksum is wrong.
    #[error("checksum 0x{found:02X} instead of 0x{expected:02X}")]
    Checksum {
        /// What the bytes add up to.
        expected: u8,
        /// What stands in the frame.
        found: u8,
    },
    /// The stream ended inside a frame.
    #[error("the stream ends inside a frame")]
    Cut,
}

/// Finds frames in a stream, however it is cut into reads.
///
/// After noise, a cut frame or a bad checksum it goes on with the very next byte, so a whole frame behind the damage is
/// never lost. It keeps at most [`MAX_FRAME`] bytes.
#[derive(Debug, Default)]
pub struct Decoder {
    buffer: Vec<u8>,
    /// Position of the buffer's first byte in the stream.
    position: u64,
}

/// What the bytes at the front of the buffer are.
enum Front {
    Frame(usize),
    Skip(usize, Skip),
    NeedMore,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next bytes and hands every item that is complete to `sink`.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        for chunk in bytes.chunks(MAX_FRAME) {
            self.buffer.extend_from_slice(chunk);
            self.drain(false, &mut sink);
        }
    }

    /// Ends the stream: what is left over is handed to `sink`.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        self.drain(true, &mut sink);
    }

    fn drain(&mut self, last: bool, sink: &mut impl FnMut(Item<'_>)) {
        let mut done = 0;
        while let Some(rest) = self.buffer.get(done..).filter(|rest| !rest.is_empty()) {
            let used = match front(rest) {
                Front::NeedMore if !last => break,
                Front::NeedMore => {
                    // No more will come: a frame may still start behind the header that was cut.
                    let used = next_start(rest);
                    self.skip(done, used, Skip::Cut, sink);
                    used
                }
                Front::Skip(used, why) => {
                    self.skip(done, used, why, sink);
                    used
                }
                Front::Frame(used) => {
                    if let Some(frame) = rest.get(..used).and_then(|rest| Frame::new(rest).ok()) {
                        sink(Item::Frame(frame));
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

fn front(rest: &[u8]) -> Front {
    let (function, length) = match *rest {
        [first, second, ..] if [first, second] != HEADER => {
            return Front::Skip(next_start(rest), Skip::Noise);
        }
        [first] if first != HEADER[0] => return Front::Skip(1, Skip::Noise),
        [_, _, function, length, ..] => (function, length),
        _ => return Front::NeedMore,
    };
    if known_lengths(function).is_some_and(|lengths| !lengths.contains(&length)) {
        return Front::Skip(next_start(rest), Skip::Length { function, length });
    }
    let whole = OVERHEAD + usize::from(length);
    let Some(frame) = rest.get(..whole) else {
        return Front::NeedMore;
    };
    match Frame::new(frame) {
        Ok(_) => Front::Frame(whole),
        Err(FrameError::Checksum { expected, found }) => {
            Front::Skip(next_start(frame), Skip::Checksum { expected, found })
        }
        Err(_) => Front::Skip(1, Skip::Noise),
    }
}

/// How many bytes to skip until the next one that can start a frame; at least one.
fn next_start(rest: &[u8]) -> usize {
    let starts = |at: &usize| match rest.get(*at..) {
        Some([first, second, ..]) => [*first, *second] == HEADER,
        Some([first]) => *first == HEADER[0],
        _ => false,
    };
    (1..rest.len()).find(starts).unwrap_or(rest.len())
}
