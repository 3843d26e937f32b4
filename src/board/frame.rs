//! Terms that all framings share: how a frame ends, why bytes are not a frame, and how bytes are
//! displayed.

use std::fmt;

/// What the first bytes of the buffer are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BufferStart {
    /// A complete frame, with its length in bytes.
    Frame(usize),
    /// Bytes outside of any frame: their number, and why they are skipped.
    Skip(usize, Skip),
    /// The decision needs more bytes.
    NeedMore,
}

/// Why bytes were skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Skip {
    /// They do not start a frame.
    #[error("no frame starts here")]
    Noise,
    /// Zeros between frames. They are sent before a stop, so that a receiver that waits for the
    /// rest of a truncated frame is synchronized again when the stop arrives.
    #[error("zeros that resynchronize a receiver")]
    Zeros,
    /// A frame starts here, but its function cannot have this length.
    #[error("function 0x{function:02X} has no payload of {length} bytes")]
    Length {
        /// The function byte.
        function: u8,
        /// The length byte.
        length: u8,
    },
    /// A frame with a wrong checksum.
    #[error("checksum 0x{found:02X} instead of 0x{expected:02X}")]
    Checksum {
        /// The checksum of the bytes.
        expected: u8,
        /// The checksum in the frame.
        found: u8,
    },
    /// The stream ended inside a frame.
    #[error("the stream ends inside a frame")]
    Cut,
    /// A frame with a length that no command has, which contains a complete frame of a command.
    #[error("truncated frame: another frame starts inside it")]
    Torn,
}

impl Skip {
    /// Whether these bytes are a fault.
    pub fn is_wrong(self) -> bool {
        self != Skip::Zeros
    }
}

/// Displays bytes as upper-case hex digits separated by spaces.
#[derive(Clone, Copy, Debug)]
pub struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, byte) in self.0.iter().enumerate() {
            let separator = if at == 0 { "" } else { " " };
            write!(f, "{separator}{byte:02X}")?;
        }
        Ok(())
    }
}

/// Why bytes are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The bytes do not start with the header of a frame.
    #[error("no frame header")]
    NoHeader,
    /// The number of bytes does not match the length field.
    #[error("the frame is truncated")]
    Length,
    /// The checksum is wrong.
    #[error("checksum {found:02X} instead of {expected:02X}")]
    Checksum {
        /// The checksum of the bytes.
        expected: u8,
        /// The checksum in the frame.
        found: u8,
    },
}
