//! Reads the bytes that another program sent, as a listing or as a script, despite any errors in
//! them.

mod curve;
mod hex_text;
mod layout;
mod listing;
mod move_search;
mod rows;
mod script_clock;
mod script_state;
mod script_writer;
mod socat;
mod stamps;
mod timed_decoder;
mod timing;

use std::io::{self, Read, Write};
use std::sync::Arc;

use crate::board::{self, Board, Decoder, Item};
use crate::units::{Micros, Nanos};
use hex_text::HexText;
pub use listing::{Listing, write_json};
pub use script_writer::ScriptWriter;
use socat::Direction;
use stamps::Stamped;
pub use timed_decoder::TimedDecoder;
pub use timing::{Timing, TimingError};

const CHUNK: usize = 64 * 1024;
/// The speeds that a script can set, in bits per second.
const BAUDS: std::ops::RangeInclusive<u32> = 1_200..=4_000_000;
/// The start of the header line of `script`.
const STARTED: &[u8] = b"Script started on ";

/// The totals of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Decoded {
    /// All bytes.
    pub bytes: u64,
    /// Whole frames.
    pub frames: u64,
    /// Frames that are not a command.
    pub unknown: u64,
    /// Bytes outside of frames.
    pub skipped: u64,
    /// Characters other than hex digits, in hex text.
    pub not_hex: u64,
    /// Whether hex text ends with half a byte.
    pub half_byte: bool,
    /// Frames of a command that can be read in two ways.
    pub ambiguous: u64,
    /// Frames of a snapshot that are sent only if something ends a run early. They are left out.
    pub aborts: u64,
    /// Whether the input contained times.
    pub is_timed: bool,
    /// Bytes of the other direction in a capture of both. They are left out.
    pub other_way: u64,
}

/// How to read a capture.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Reading {
    /// The times of the bytes, from a separate timing file.
    pub timing: Option<Timing>,
    /// The speed of the line in bits per second; by default that of a snapshot, or else that of the
    /// board.
    pub baud: Option<u32>,
    /// The time between two frames of a script, if the input has no times; by default the time that
    /// a frame takes on the line.
    pub every: Option<Micros>,
    /// The board.
    pub board: Arc<Board>,
}

impl Reading {
    /// The same with a timing file.
    #[must_use]
    pub fn with_timing(self, timing: Option<Timing>) -> Self {
        Reading { timing, ..self }
    }

    /// The same with another speed of the line, in bits per second.
    #[must_use]
    pub fn with_baud(self, baud: Option<u32>) -> Self {
        Reading { baud, ..self }
    }

    /// The same with a time between two frames of a script.
    #[must_use]
    pub fn with_every(self, every: Option<Micros>) -> Self {
        Reading { every, ..self }
    }

    /// The same for another board.
    #[must_use]
    pub fn with_board(self, board: Arc<Board>) -> Self {
        Reading { board, ..self }
    }
}

impl Default for Reading {
    fn default() -> Self {
        Reading { timing: None, baud: None, every: None, board: board::raspblock::board() }
    }
}

impl Decoded {
    fn count(&mut self, board: &Board, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                self.bytes += frame.bytes().len() as u64;
                self.frames += 1;
                let read = board.decode(frame.bytes());
                self.unknown += u64::from(read.is_err());
                self.ambiguous += u64::from(read.is_ok_and(|command| board.is_ambiguous(&command)));
            }
            Item::Skipped { bytes, .. } => {
                self.bytes += bytes.len() as u64;
                self.skipped += bytes.len() as u64;
            }
        }
    }
}

/// Why decoding failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The stream cannot be read.
    #[error(transparent)]
    Read(io::Error),
    /// The output cannot be written.
    #[error(transparent)]
    Write(io::Error),
    /// The input contains the frames of several robots, of which these are the first two.
    #[error(
        "the input has the frames of several robots, such as `{0}` and `{1}`; decode those of one: `motionseq render --robot {0}`"
    )]
    Robots(String, String),
}

/// Decodes a stream of frames, with or without the times of tio, or hex digits of one (bare, in a listing, in a log with times, in the
/// output of `socat -x`, or in a dump). Writes a line for each frame and for each run of bytes outside of frames: the position
/// of its first byte, counted from 0, or its time in seconds if there are times; the bytes in hex;
/// and the command.
///
/// No input is fatal. Buffers one block of the input, and at most 16 MiB for the repeated rows of a
/// dump; of the output of `socat -x`, all.
///
/// # Errors
/// If reading or writing fails.
pub fn decode(input: impl Read, reading: Reading, out: &mut impl Write) -> Result<Decoded, DecodeError> {
    let mut listing = Listing::new(out, Arc::clone(&reading.board));
    let mut decoder = Decoder::new(&reading.board);
    let mut timed: Option<TimedDecoder> = None;
    let read = pieces(input, reading.timing, &reading.board, |at, bytes| {
        match (&mut timed, at) {
            (None, None) => decoder.feed(bytes, |item| listing.take(listing.decoded.bytes, item)),
            (timed, at) => {
                // Use the times of the text, not those of the line.
                let timed = timed.get_or_insert_with(|| TimedDecoder::of_times(&reading.board));
                timed.feed(at.unwrap_or_default(), bytes, |at, item| listing.take(format_args!("{at:.6}"), item));
            }
        }
        listing.failure()
    })?;
    decoder.finish(|item| listing.take(listing.decoded.bytes, item));
    if let Some(timed) = &mut timed {
        timed.finish(|at, item| listing.take(format_args!("{at:.6}"), item));
    }
    listing.end_run();
    listing.failure().map_err(DecodeError::Write)?;
    Ok(Decoded { is_timed: timed.is_some(), ..read.joined(listing.decoded) })
}

/// Decodes the same input and writes it as a script. Frames without times count as sent without a
/// pause at the speed of the line, or at regular intervals; bytes that a timing file gives one time
/// count as sent without a pause. Times in hex text are used unchanged.
///
/// Buffers the whole script, because its first lines depend on all of it.
///
/// # Errors
/// If reading or writing fails.
pub fn to_script(
    input: impl Read,
    reading: Reading,
    exact: bool,
    out: &mut impl Write,
) -> Result<Decoded, DecodeError> {
    let Reading { timing, baud, every, board } = reading;
    let line = baud.unwrap_or(board.baud);
    let mut writer = ScriptWriter::new(Arc::clone(&board), exact, line);
    let has_timing_file = timing.is_some();
    let mut frames: Option<TimedDecoder> = None;
    let mut decoded = Decoded::default();
    let mut script = String::new();
    let mut now = Micros::ZERO;
    let mut take = |writer: &mut ScriptWriter, decoded: &mut Decoded, at: Micros, item: Item<'_>| {
        let at = match every.filter(|_| !decoded.is_timed) {
            Some(every) => every * decoded.frames,
            None => at,
        };
        decoded.count(&board, item);
        now = now.max(at);
        writer.settle(now);
        writer.take(now, item);
    };
    let read = pieces(input, timing, &board, |at, bytes| {
        decoded.is_timed |= at.is_some();
        let frames = frames.get_or_insert_with(|| {
            if at.is_none() || has_timing_file {
                return TimedDecoder::new(&board, line);
            }
            if baud.is_none() {
                writer.save_line();
            }
            TimedDecoder::of_times(&board)
        });
        frames.feed(at.unwrap_or_default(), bytes, |at, item| take(&mut writer, &mut decoded, at, item));
        script += &writer.settled();
        Ok(())
    })?;
    if let Some(frames) = &mut frames {
        frames.finish(|at, item| take(&mut writer, &mut decoded, at, item));
    }
    writer.finish(now);
    script += &writer.settled();
    if let Some((at, text)) = writer.amendment() {
        script.replace_range(at..at + text.len(), &text);
    }
    if let (None, Some(line)) = (baud, read.baud.filter(|line| *line != board.baud && BAUDS.contains(line))) {
        // After the first line, which is a comment, and the line with the board.
        let lines = script.split_inclusive('\n').enumerate();
        let head = lines.take_while(|(line, text)| *line == 0 || *line == 1 && text.starts_with(script_writer::BOARD));
        let at = head.map(|(_, text)| text.len()).sum();
        script.insert_str(at, &format!("baud {line}\n"));
    }
    out.write_all(script.as_bytes()).map_err(DecodeError::Write)?;
    Ok(read.joined(decoded))
}

/// What hex text contained in addition to its bytes.
#[derive(Default)]
struct TextFindings {
    not_hex: u64,
    half_byte: bool,
    aborts: u64,
    baud: Option<u32>,
    other_way: u64,
}

impl TextFindings {
    fn joined(self, decoded: Decoded) -> Decoded {
        let TextFindings { not_hex, half_byte, aborts, other_way, .. } = self;
        Decoded { not_hex, half_byte, aborts, other_way, ..decoded }
    }
}

/// The direction with the frames, of a capture of both.
fn with_frames(board: &Board, [there, back]: [Direction; 2]) -> (Direction, Direction) {
    let frames = |direction: &Direction| {
        let (mut decoder, mut count) = (Decoder::new(board), 0_u64);
        for (_, bytes) in direction {
            decoder.feed(bytes, |item| count += u64::from(matches!(item, Item::Frame(_))));
        }
        count
    };
    if frames(&back) > frames(&there) { (back, there) } else { (there, back) }
}

/// How the bytes of a capture are written.
enum Form {
    /// As they are.
    Bytes,
    /// As they are, with times between them.
    Stamped(Stamped),
    Text(Box<HexText>),
}

/// Whether a block of text contains the frames of a board that sends text, and not their hex digits.
fn is_raw(board: &Board, block: &[u8]) -> bool {
    let commands = |bytes: &[u8]| {
        let (mut decoder, mut count) = (Decoder::new(board), 0_u64);
        let mut take = |item: Item<'_>| {
            count += u64::from(matches!(item, Item::Frame(frame) if board.decode(frame.bytes()).is_ok()));
        };
        decoder.feed(bytes, &mut take);
        decoder.finish(&mut take);
        count
    };
    let raw = commands(block);
    if raw == 0 {
        return false;
    }
    let (mut text, mut digits) = (HexText::default(), Vec::new());
    let mut keep = |_: Option<Nanos>, bytes: &[u8]| {
        digits.extend_from_slice(bytes);
        Ok(())
    };
    let read = text.feed(block, &mut keep).and_then(|()| text.finish(&mut keep));
    read.is_ok() && raw > commands(&digits)
}

/// Reads a capture and passes its bytes to `sink` in pieces, each with its time, if known.
fn pieces(
    mut input: impl Read,
    mut timing: Option<Timing>,
    board: &Board,
    mut sink: impl FnMut(Option<Nanos>, &[u8]) -> io::Result<()>,
) -> Result<TextFindings, DecodeError> {
    let mut buffer = vec![0; CHUNK];
    let head = head(&mut input, &mut buffer, timing.is_some())?;
    let mut block = captured(buffer.get(..head).unwrap_or_default(), timing.is_some()).unwrap_or_default();
    if timing.is_none() && socat::is_socat(block) {
        return both_ways(block, &mut input, board, sink);
    }
    let mut form = match HexText::of(block).filter(|_| !is_raw(board, block)) {
        Some(text) => Form::Text(Box::new(text)),
        None => Stamped::of(block).filter(|_| timing.is_none()).map_or(Form::Bytes, Form::Stamped),
    };
    loop {
        let mut failed = Ok(());
        let mut give = |at: Option<Nanos>, bytes: &[u8]| {
            if failed.is_ok() {
                failed = match &mut form {
                    Form::Text(text) => text.feed(bytes, |of_line, bytes| sink(of_line.or(at), bytes)),
                    Form::Stamped(stamped) => all(|sink| stamped.feed(bytes, sink), &mut sink),
                    Form::Bytes => sink(at, bytes),
                };
            }
        };
        match &mut timing {
            Some(timing) => timing.cut(block, |at, bytes| give(Some(at), bytes)),
            None => give(None, block),
        }
        failed.map_err(DecodeError::Write)?;
        if let Form::Text(text) = &form {
            of_one_robot(text)?;
        }
        let count = read(&mut input, &mut buffer)?;
        if count == 0 {
            break;
        }
        block = buffer.get(..count).unwrap_or_default();
    }
    let mut text = match form {
        Form::Bytes => return Ok(TextFindings::default()),
        Form::Stamped(stamped) => {
            all(|give| stamped.finish(give), &mut sink).map_err(DecodeError::Write)?;
            return Ok(TextFindings::default());
        }
        Form::Text(text) => text,
    };
    text.finish(&mut sink).map_err(DecodeError::Write)?;
    of_one_robot(&text)?;
    let (not_hex, half_byte) = (text.not_hex(), text.is_half());
    Ok(TextFindings { not_hex, half_byte, aborts: text.aborts(), baud: text.baud(), other_way: 0 })
}

/// Checks that no two robots have sent the bytes of a text.
fn of_one_robot(text: &HexText) -> Result<(), DecodeError> {
    text.robots().map_or(Ok(()), |[one, other]| Err(DecodeError::Robots(one.to_owned(), other.to_owned())))
}

/// Passes pieces with times to a sink up to its first error.
fn all(
    give: impl FnOnce(&mut dyn FnMut(Nanos, &[u8])),
    sink: &mut impl FnMut(Option<Nanos>, &[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let mut result = Ok(());
    give(&mut |at, bytes| {
        if result.is_ok() && !bytes.is_empty() {
            result = sink(Some(at), bytes);
        }
    });
    result
}

/// Reads a capture of both directions, and passes the bytes of the one with the frames to `sink`. Buffers the whole capture, because
/// only all of it shows which one that is.
fn both_ways(
    block: &[u8],
    input: &mut impl Read,
    board: &Board,
    mut sink: impl FnMut(Option<Nanos>, &[u8]) -> io::Result<()>,
) -> Result<TextFindings, DecodeError> {
    let mut text = block.to_vec();
    input.read_to_end(&mut text).map_err(DecodeError::Read)?;
    let (frames, other) = with_frames(board, socat::directions(&String::from_utf8_lossy(&text)));
    for (at, bytes) in frames {
        sink(Some(at), &bytes).map_err(DecodeError::Write)?;
    }
    let other_way = other.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    Ok(TextFindings { other_way, ..TextFindings::default() })
}

/// Reads until the format of the stream is known, and returns the number of bytes. The first read
/// of a pipe may be less than a line.
fn head(input: &mut impl Read, buffer: &mut [u8], is_timed: bool) -> Result<usize, DecodeError> {
    let mut count = 0;
    loop {
        let more = read(input, buffer.get_mut(count..).unwrap_or_default())?;
        count += more;
        let block = buffer.get(..count).unwrap_or_default();
        if more == 0 || captured(block, is_timed).is_some_and(HexText::is_decided) {
            return Ok(count);
        }
    }
}

/// The captured part of the first block. `script` writes a header line, which scriptreplay does not
/// count. `None` inside that line.
fn captured(block: &[u8], is_timed: bool) -> Option<&[u8]> {
    if is_timed && block.starts_with(STARTED) {
        return block.splitn(2, |byte| *byte == b'\n').nth(1);
    }
    (!is_timed || block.is_empty() || !STARTED.starts_with(block)).then_some(block)
}

/// Reads what is available; 0 bytes only at the end.
fn read(input: &mut impl Read, buffer: &mut [u8]) -> Result<usize, DecodeError> {
    loop {
        match input.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read.map_err(DecodeError::Read),
        }
    }
}
