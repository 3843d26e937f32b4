//! Bytes that another program sent, read back: as a listing, whatever is wrong with them.

mod text;

use std::io::{self, Read, Write};

use crate::board::{Command, Decoder, Frame, Item, Skip};
use text::Text;

/// The most bytes of a run that are shown where they belong to no frame.
const SHOWN: usize = 16;
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
    let mut listing = Listing { out, position: 0, decoded: Decoded::default(), run: None, failed: None };
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
                decoder.feed(&bytes, |item| listing.take(item));
            }
            None => decoder.feed(block, |item| listing.take(item)),
        }
        listing.failure()?;
    }
    if let Some(text) = &mut text {
        bytes.clear();
        text.finish(&mut bytes);
        decoder.feed(&bytes, |item| listing.take(item));
    }
    decoder.finish(|item| listing.take(item));
    listing.end_run();
    listing.failure()?;
    let (not_hex, half_byte) = text.map_or((0, false), |text| (text.strangers(), text.is_half()));
    Ok(Decoded { not_hex, half_byte, ..listing.decoded })
}

/// Bytes in a row that belong to no frame.
struct Run {
    at: u64,
    shown: Vec<u8>,
    count: u64,
    why: Skip,
}

struct Listing<'o, W> {
    out: &'o mut W,
    position: u64,
    decoded: Decoded,
    run: Option<Run>,
    failed: Option<io::Error>,
}

impl<W: Write> Listing<'_, W> {
    fn take(&mut self, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                self.end_run();
                self.frame(frame);
                self.position += frame.bytes().len() as u64;
                self.decoded.bytes += frame.bytes().len() as u64;
            }
            Item::Skipped { at, bytes, why } => {
                self.position = at + bytes.len() as u64;
                self.decoded.bytes += bytes.len() as u64;
                self.decoded.skipped += bytes.len() as u64;
                match &mut self.run {
                    Some(run) if run.why == why => {
                        run.count += bytes.len() as u64;
                        let room = SHOWN.saturating_sub(run.shown.len());
                        run.shown.extend(bytes.iter().take(room));
                    }
                    _ => {
                        self.end_run();
                        let shown = bytes.iter().take(SHOWN).copied().collect();
                        self.run = Some(Run { at, shown, count: bytes.len() as u64, why });
                    }
                }
            }
        }
    }

    fn frame(&mut self, frame: Frame<'_>) {
        self.decoded.frames += 1;
        let position = self.position;
        let written = match Command::decode(frame) {
            Ok(command) => writeln!(self.out, "{position}\t{frame}\t{command}"),
            Err(why) => {
                self.decoded.unknown += 1;
                writeln!(self.out, "{position}\t{frame}\t{}\tunknown: {why}", Command::decode_or_raw(frame))
            }
        };
        self.keep(written);
    }

    fn end_run(&mut self) {
        let Some(Run { at, shown, count, why }) = self.run.take() else { return };
        let bytes: Vec<String> = shown.iter().map(|byte| format!("{byte:02X}")).collect();
        let more = if count > SHOWN as u64 { " …" } else { "" };
        let bytes = bytes.join(" ");
        let written = writeln!(self.out, "{at}\t{bytes}{more}\t\tskipped {count}: {why}");
        self.keep(written);
    }

    /// The first failure is kept: what follows it cannot be written either.
    fn keep(&mut self, written: io::Result<()>) {
        if let Err(error) = written {
            self.failed.get_or_insert(error);
        }
    }

    fn failure(&mut self) -> Result<(), DecodeError> {
        self.failed.take().map_or(Ok(()), |error| Err(DecodeError::Write(error)))
    }
}
