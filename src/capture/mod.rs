//! Bytes that another program sent, read back: as a listing, whatever is wrong with them.

mod listing;
mod text;

use std::io::{self, Read, Write};

use crate::board::{Decoder, Item};
pub use listing::{Listing, write_json};
use text::Text;

const CHUNK: usize = 64 * 1024;

/// What a stream held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Decoded {
    /// All bytes.
    pub bytes: u64,
    /// Whole frames.
    pub frames: u64,
    /// Those of them that are no command.
    pub unknown: u64,
    /// Bytes that belong to no frame.
    pub skipped: u64,
    /// Characters in a text of hex digits that are none.
    pub not_hex: u64,
    /// Whether such a text ends with half a byte.
    pub half_byte: bool,
}

/// Why a stream was not decoded to its end.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// It cannot be read on.
    #[error(transparent)]
    Read(io::Error),
    /// The listing cannot be written.
    #[error(transparent)]
    Write(io::Error),
}

/// Reads a stream of frames, or the same written down as hex digits (bare, in a listing, or in a dump), and writes a line for each frame and for each
/// run of bytes that belongs to none: the position of the first byte, counted from 0; the bytes in hex; what they are.
///
/// Nothing in the stream is fatal. Keeps one block of the input, and what the repeated rows of a dump stand for, at most 16 MiB.
pub fn decode(mut input: impl Read, out: &mut impl Write) -> Result<Decoded, DecodeError> {
    let mut listing = Listing::new(out);
    let take = |listing: &mut Listing<_>, item: Item<'_>| listing.take(listing.decoded.bytes, item);
    let mut decoder = Decoder::new();
    let mut buffer = vec![0; CHUNK];
    let mut text: Option<Text> = None;
    let mut bytes = Vec::new();
    let mut is_first = true;
    loop {
        let count = match input.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(DecodeError::Read(error)),
        };
        let block = buffer.get(..count).unwrap_or_default();
        if std::mem::take(&mut is_first) {
            text = Text::of(block);
        }
        match &mut text {
            Some(text) => {
                bytes.clear();
                text.feed(block, &mut bytes);
                decoder.feed(&bytes, |item| take(&mut listing, item));
            }
            None => decoder.feed(block, |item| take(&mut listing, item)),
        }
        listing.failure().map_err(DecodeError::Write)?;
    }
    if let Some(text) = &mut text {
        bytes.clear();
        text.finish(&mut bytes);
        decoder.feed(&bytes, |item| take(&mut listing, item));
    }
    decoder.finish(|item| take(&mut listing, item));
    listing.end_run();
    listing.failure().map_err(DecodeError::Write)?;
    let (not_hex, half_byte) = text.map_or((0, false), |text| (text.strangers(), text.is_half()));
    Ok(Decoded { not_hex, half_byte, ..listing.decoded })
}
