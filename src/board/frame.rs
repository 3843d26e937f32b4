//! The terms that every framing shares: where a frame ends, why bytes are not a frame, and how bytes are shown.

use std::fmt;

/// What the bytes at the front of the buffer are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Front {
    /// A whole frame, with its length in bytes.
    Frame(usize),
    /// Bytes outside any frame: how many, and why they are skipped.
    Skip(usize, Skip),
    /// More bytes are needed to decide.
    NeedMore,
}

/// Why bytes were skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
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
        /// The checksum in the frame.
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

/// Why bytes are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The bytes do not start as a frame does.
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
        /// The checksum in the frame.
        found: u8,
    },
}
