//! The envelope of every frame: header, function, length, payload, checksum.

use std::fmt;

/// The two bytes that every frame starts with.
pub const HEADER: [u8; 2] = [0xFF, 0xFE];
/// The longest payload in bytes: the length field is one byte.
pub const MAX_PAYLOAD: usize = 255;
/// The longest frame in bytes.
pub const MAX_FRAME: usize = OVERHEAD + MAX_PAYLOAD;
/// Header, function, length and checksum.
pub(super) const OVERHEAD: usize = 5;
/// A checked view of one frame's bytes: the header stands, the length fits and the checksum is right.
///
/// It says nothing about meaning; [`Command::decode`](super::Command::decode) does.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a>(&'a [u8]);

/// Why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// The bytes do not start with the header.
    #[error("no frame header")]
    NoHeader,
    /// More bytes are needed, or there are more than the length says.
    #[error("the frame is cut")]
    Length,
    /// The checksum does not fit.
    #[error("checksum {found:02X} instead of {expected:02X}")]
    Checksum {
        /// What the bytes add up to.
        expected: u8,
        /// What stands in the frame.
        found: u8,
    },
}

impl<'a> Frame<'a> {
    /// Checks that `bytes` are exactly one frame.
    pub fn new(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let Some(body) = bytes.strip_prefix(&HEADER) else {
            return Err(FrameError::NoHeader);
        };
        let Some((&found, summed)) = body.split_last() else {
            return Err(FrameError::Length);
        };
        match *summed {
            [_, length, ref payload @ ..] if payload.len() == usize::from(length) => {}
            _ => return Err(FrameError::Length),
        }
        let expected = checksum(summed);
        if expected == found { Ok(Frame(bytes)) } else { Err(FrameError::Checksum { expected, found }) }
    }

    /// All bytes, from header to checksum.
    pub fn bytes(self) -> &'a [u8] {
        self.0
    }

    /// The function byte.
    pub fn function(self) -> u8 {
        self.0.get(2).copied().unwrap_or_default()
    }

    /// The payload, without function and length.
    pub fn payload(self) -> &'a [u8] {
        self.0.get(4..self.0.len() - 1).unwrap_or_default()
    }
}

impl fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

/// Upper-case hex with blanks between, as the listing shows it.
impl fmt::Display for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Hex(self.0).fmt(f)
    }
}

/// Bytes as upper-case hex with blanks between.
#[derive(Clone, Copy, Debug)]
pub struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, byte) in self.0.iter().enumerate() {
            let blank = if at == 0 { "" } else { " " };
            write!(f, "{blank}{byte:02X}")?;
        }
        Ok(())
    }
}

/// A payload of at most [`MAX_PAYLOAD`] bytes. It is one pointer, so that a command, of which there may be millions, is no more
/// than two words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Payload(Box<Box<[u8]>>);

impl Payload {
    /// Checks the length; `None` for more than [`MAX_PAYLOAD`] bytes.
    pub fn new(bytes: impl Into<Box<[u8]>>) -> Option<Self> {
        let bytes = bytes.into();
        (bytes.len() <= MAX_PAYLOAD).then(|| Payload(Box::new(bytes)))
    }

    /// The payload of a frame.
    pub fn of(frame: Frame<'_>) -> Self {
        Payload(Box::new(frame.payload().into()))
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// Appends a whole frame to `out`: header, `function`, length, the payload's bytes, checksum.
///
/// The payload is at most [`MAX_PAYLOAD`] bytes: a fixed array or a [`Payload`].
pub(super) fn emit(out: &mut Vec<u8>, function: u8, payload: &[u8]) {
    let length = u8::try_from(payload.len()).unwrap_or(u8::MAX);
    out.extend_from_slice(&HEADER);
    let summed = out.len();
    out.extend_from_slice(&[function, length]);
    out.extend_from_slice(payload);
    let sum = checksum(out.get(summed..).unwrap_or_default());
    out.push(sum);
}

/// Low 8 bits of function + length + every payload byte; the header is not in the sum.
fn checksum(summed: &[u8]) -> u8 {
    summed.iter().fold(0, |sum, &byte| sum.wrapping_add(byte))
}
