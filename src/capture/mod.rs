//! Bytes that another program sent, read back: as a listing or as a script, whatever is wrong with them.

mod curve;
mod fold;
mod known;
mod listing;
mod rows;
mod scribe;
mod text;
mod timed;
mod timing;

use std::io::{self, Read, Write};

use crate::board::{Command, DEFAULT_BAUD, Decoder, Item, MovePacking};
use crate::timeline::Seconds;
pub use known::{DRIVE_TOLERANCE, SERVO_TOLERANCE};
pub use listing::{Listing, write_json};
pub use scribe::Scribe;
use text::Text;
pub use timed::TimedDecoder;
pub use timing::{NoTiming, Timing};

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
    /// Displacements, of which the two ways to pack them cannot always be told apart.
    pub moves: u64,
    /// Whether there were times.
    pub is_timed: bool,
}

impl Decoded {
    fn count(&mut self, item: Item<'_>, packing: MovePacking) {
        match item {
            Item::Frame(frame) => {
                self.bytes += frame.bytes().len() as u64;
                self.frames += 1;
                let read = Command::decode_as(frame, packing);
                self.unknown += u64::from(read.is_err());
                self.moves += u64::from(matches!(read, Ok(Command::Move { .. })));
            }
            Item::Skipped { bytes, .. } => {
                self.bytes += bytes.len() as u64;
                self.skipped += bytes.len() as u64;
            }
        }
    }
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

/// Reads a stream of frames, or the same written down as hex digits (bare, in a listing, in a log with times, or in a dump), and writes a line
/// for each frame and for each run of bytes that belongs to none: the position of the first byte, counted from 0, or its time in seconds
/// where there are times; the bytes in hex; what they are.
///
/// Nothing in the stream is fatal. Keeps one block of the input, and what the repeated rows of a dump stand for, at most 16 MiB.
pub fn decode(
    input: impl Read,
    timing: Option<Timing>,
    packing: MovePacking,
    out: &mut impl Write,
) -> Result<Decoded, DecodeError> {
    let mut listing = Listing::new(out, packing);
    let mut decoder = Decoder::new();
    let mut timed: Option<TimedDecoder> = None;
    let read = pieces(input, timing, |at, bytes| {
        match (&mut timed, at) {
            (None, None) => decoder.feed(bytes, |item| listing.take(listing.decoded.bytes, item)),
            (timed, at) => {
                // The times that stand there, not those of the line.
                let timed = timed.get_or_insert_with(|| TimedDecoder::new(u32::MAX));
                timed.feed(at.unwrap_or_default(), bytes, |at_us, item| listing.take(Seconds(at_us), item));
            }
        }
        listing.failure()
    })?;
    decoder.finish(|item| listing.take(listing.decoded.bytes, item));
    if let Some(timed) = &mut timed {
        timed.finish(|at_us, item| listing.take(Seconds(at_us), item));
    }
    listing.end_run();
    listing.failure().map_err(DecodeError::Write)?;
    Ok(Decoded { is_timed: timed.is_some(), ..read.joined(listing.decoded) })
}

/// Reads the same, and writes it as a script. What has no times counts as sent without a pause, as fast as a line of 115,200 baud carries it.
///
/// Keeps the script until it is whole, because its first lines depend on all of it.
pub fn transcribe(
    input: impl Read,
    timing: Option<Timing>,
    exact: bool,
    packing: MovePacking,
    out: &mut impl Write,
) -> Result<Decoded, DecodeError> {
    let mut scribe = Scribe::new(exact, DEFAULT_BAUD, packing);
    let mut frames = TimedDecoder::new(DEFAULT_BAUD);
    let mut decoded = Decoded::default();
    let mut script = String::new();
    let mut now_us = 0;
    let mut take = |scribe: &mut Scribe, decoded: &mut Decoded, at_us: u64, item: Item<'_>| {
        decoded.count(item, packing);
        scribe.settle(at_us);
        scribe.take(at_us, item);
        now_us = at_us;
    };
    let read = pieces(input, timing, |at, bytes| {
        decoded.is_timed |= at.is_some();
        frames.feed(at.unwrap_or_default(), bytes, |at_us, item| take(&mut scribe, &mut decoded, at_us, item));
        script += &scribe.settled();
        Ok(())
    })?;
    frames.finish(|at_us, item| take(&mut scribe, &mut decoded, at_us, item));
    scribe.finish(now_us);
    script += &scribe.settled();
    if let Some((at, text)) = scribe.amendment() {
        script.replace_range(at..at + text.len(), text);
    }
    out.write_all(script.as_bytes()).map_err(DecodeError::Write)?;
    Ok(read.joined(decoded))
}

/// What was read beside the bytes of a stream.
struct Beside {
    not_hex: u64,
    half_byte: bool,
}

impl Beside {
    fn joined(self, decoded: Decoded) -> Decoded {
        Decoded { not_hex: self.not_hex, half_byte: self.half_byte, ..decoded }
    }
}

/// Reads a capture, and hands its bytes on in pieces, each with the time in nanoseconds at which it came, where that is known.
fn pieces(
    mut input: impl Read,
    mut timing: Option<Timing>,
    mut sink: impl FnMut(Option<u64>, &[u8]) -> io::Result<()>,
) -> Result<Beside, DecodeError> {
    let mut buffer = vec![0; CHUNK];
    let mut text: Option<Text> = None;
    let mut is_first = true;
    loop {
        let count = match input.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(DecodeError::Read(error)),
        };
        let mut block = buffer.get(..count).unwrap_or_default();
        if std::mem::take(&mut is_first) {
            if timing.is_some() && block.starts_with(b"Script started on ") {
                // scriptreplay does not count that line either.
                block = block.splitn(2, |byte| *byte == b'\n').nth(1).unwrap_or_default();
            }
            text = Text::of(block);
        }
        let mut failed = Ok(());
        let mut give = |at: Option<u64>, bytes: &[u8]| {
            if failed.is_ok() {
                failed = match &mut text {
                    Some(text) => text.feed(bytes, |of_line, bytes| sink(of_line.or(at), bytes)),
                    None => sink(at, bytes),
                };
            }
        };
        match &mut timing {
            Some(timing) => timing.cut(block, |at, bytes| give(Some(at), bytes)),
            None => give(None, block),
        }
        failed.map_err(DecodeError::Write)?;
    }
    let Some(mut text) = text else { return Ok(Beside { not_hex: 0, half_byte: false }) };
    text.finish(&mut sink).map_err(DecodeError::Write)?;
    Ok(Beside { not_hex: text.strangers(), half_byte: text.is_half() })
}
