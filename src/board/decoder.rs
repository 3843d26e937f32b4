//! Frames out of a stream of bytes that may be cut, garbled or noisy.

use super::command::{ZEROS, known_lengths};
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
    /// Zeros between frames: whoever stops a robot sends them, so that a receiver that waits for the rest of a frame that was cut
    /// is back in step before the stop comes.
    #[error("zeros that bring a receiver back in step")]
    Zeros,
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
    /// A frame with a length that no command has, and a whole frame of a command inside it.
    #[error("a frame was cut here: another one starts inside it")]
    Torn,
}

impl Skip {
    /// Whether something went wrong with these bytes.
    pub fn is_wrong(self) -> bool {
        self != Skip::Zeros
    }
}

/// The longest payload of a frame of an unknown function that is waited for whatever is inside it. The longest one of a command has
/// 9 bytes.
const PLAUSIBLE: u8 = 32;

/// Finds frames in a stream, however it is cut into reads.
///
/// After noise, a cut frame or a bad checksum it goes on with the very next byte, so a whole frame behind the damage is
/// never lost. A frame of an unknown function that claims a length far beyond that of any command does not hold up those inside it:
/// it is what is left of a frame that was cut. So a decoder keeps at most [`MAX_FRAME`] bytes, and the frames of commands do not wait.
#[derive(Debug, Default)]
pub struct Decoder {
    buffer: Vec<u8>,
    /// Position of the buffer's first byte in the stream.
    position: u64,
    /// Whether zeros came last, as a stop sends them: more of them are more of the same.
    in_zeros: bool,
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
            let front = front(rest, self.in_zeros);
            self.in_zeros = match front {
                Front::Skip(_, why) => why == Skip::Zeros,
                Front::Frame(_) => false,
                Front::NeedMore => self.in_zeros,
            };
            let used = match front {
                Front::NeedMore if !last => break,
                Front::NeedMore => {
                    // No more will come: a frame may still start behind the header that was cut.
                    let used = next_start(rest);
                    let why = if rest.starts_with(&[0]) { Skip::Noise } else { Skip::Cut };
                    self.skip(done, used, why, sink);
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

fn front(rest: &[u8], in_zeros: bool) -> Front {
    let zeros = zeros_of(rest);
    let (function, length) = match *rest {
        [0, ..] if in_zeros || zeros >= ZEROS => return Front::Skip(zeros, Skip::Zeros),
        [0, ..] if zeros == rest.len() => return Front::NeedMore,
        [first, second, ..] if [first, second] != HEADER => {
            let noise = next_start(rest);
            // Zeros that are as many as those of a stop, or may become so, are no part of it.
            let is_stop = |at: &usize| {
                let rest = rest.get(*at..).unwrap_or_default();
                zeros_of(rest) >= ZEROS || zeros_of(rest) == rest.len()
            };
            return Front::Skip((zeros.max(1)..noise).find(is_stop).unwrap_or(noise), Skip::Noise);
        }
        [first] if first != HEADER[0] => return Front::Skip(1, Skip::Noise),
        [_, _, function, length, ..] => (function, length),
        _ => return Front::NeedMore,
    };
    if known_lengths(function).is_some_and(|lengths| !lengths.contains(&length)) {
        return Front::Skip(next_start(rest), Skip::Length { function, length });
    }
    let whole = OVERHEAD + usize::from(length);
    if length > PLAUSIBLE && known_lengths(function).is_none() {
        let inside = rest.get(..whole).unwrap_or(rest);
        if let Some(start) = command_inside(inside) {
            return Front::Skip(start, Skip::Torn);
        }
    }
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

/// How many zeros are at the front.
fn zeros_of(rest: &[u8]) -> usize {
    rest.iter().take_while(|byte| **byte == 0).count()
}

/// Where the frame of a command starts inside what claims to be a longer frame, if a whole one does: the one that ends first, so that it
/// is the same one however the stream is cut into reads.
fn command_inside(claimed: &[u8]) -> Option<usize> {
    let ends = (1..claimed.len()).filter_map(|at| {
        let rest = claimed.get(at..).unwrap_or_default();
        let [first, second, function, length, ..] = *rest else { return None };
        let whole = OVERHEAD + usize::from(length);
        let is_command = [first, second] == HEADER
            && known_lengths(function).is_some_and(|lengths| lengths.contains(&length))
            && rest.get(..whole).is_some_and(|frame| Frame::new(frame).is_ok());
        is_command.then_some((at + whole, at))
    });
    ends.min().map(|(_, at)| at)
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
