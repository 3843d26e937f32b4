//! A listing of frames and the bytes between them, one per line.

use std::fmt::Display;
use std::io::{self, Write};
use std::sync::Arc;

use serde::Serialize;

use super::Decoded;
use crate::board::{Board, Frame, Hex, Item, Skip};
use crate::units::Micros;

/// The most bytes shown of a run that belongs to no frame.
const SHOWN: usize = 16;

/// Writes one TAB-separated line for each frame and for each run of bytes outside of frames: its
/// position or time, the bytes in hex, the command, and the fault, if any.
#[derive(Debug)]
pub struct Listing<W> {
    out: W,
    /// The totals so far.
    pub decoded: Decoded,
    board: Arc<Board>,
    run: Option<Run>,
    failed: Option<io::Error>,
}

/// A run of bytes outside of frames.
#[derive(Debug)]
struct Run {
    at: String,
    shown: Vec<u8>,
    count: u64,
    why: Skip,
}

impl<W: Write> Listing<W> {
    /// A listing without lines.
    pub fn new(out: W, board: Arc<Board>) -> Self {
        Listing { out, decoded: Decoded::default(), board, run: None, failed: None }
    }

    /// Adds an item of a decoder; `at` is the first column of its line.
    pub fn take(&mut self, at: impl Display, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                self.end_run();
                self.frame(at, frame);
                self.decoded.bytes += frame.bytes().len() as u64;
            }
            Item::Skipped { bytes, why, .. } => {
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
                        self.run = Some(Run { at: at.to_string(), shown, count: bytes.len() as u64, why });
                    }
                }
            }
        }
    }

    fn frame(&mut self, at: impl Display, frame: Frame<'_>) {
        self.decoded.frames += 1;
        let written = match self.board.decode(frame.bytes()) {
            Ok(command) => {
                self.decoded.ambiguous += u64::from(self.board.is_ambiguous(&command));
                writeln!(self.out, "{at}\t{frame}\t{}", self.board.show(&command))
            }
            Err(why) => {
                self.decoded.unknown += 1;
                writeln!(self.out, "{at}\t{frame}\t{}\tunknown: {why}", said(&self.board, frame).unwrap_or_default())
            }
        };
        self.keep(written);
    }

    /// Writes the current run.
    pub fn end_run(&mut self) {
        let Some(Run { at, shown, count, why }) = self.run.take() else { return };
        let more = if count > SHOWN as u64 { " …" } else { "" };
        let bytes = Hex(&shown);
        let written = writeln!(self.out, "{at}\t{bytes}{more}\t\tskipped {count}: {why}");
        self.keep(written);
    }

    /// Flushes the output.
    pub fn flush(&mut self) {
        let flushed = self.out.flush();
        self.keep(flushed);
    }

    /// Keeps the first error: later lines cannot be written either.
    fn keep(&mut self, written: io::Result<()>) {
        if let Err(error) = written {
            self.failed.get_or_insert(error);
        }
    }

    /// The first error so far.
    pub fn failure(&mut self) -> io::Result<()> {
        self.failed.take().map_or(Ok(()), Err)
    }
}

/// Writes one JSON object: the time, and the frame with its command, or the skipped bytes; and the
/// fault, if any.
pub fn write_json(board: &Board, at: Micros, item: Item<'_>, out: &mut impl Write) -> io::Result<()> {
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().concat();
    let object = match item {
        Item::Frame(frame) => {
            let wrong = board.decode(frame.bytes()).err().map(|why| why.to_string());
            JsonLine { at, frame: Some(hex(frame.bytes())), command: said(board, frame), skipped: None, wrong }
        }
        Item::Skipped { bytes, why, .. } => {
            JsonLine { at, frame: None, command: None, skipped: Some(hex(bytes)), wrong: Some(why.to_string()) }
        }
    };
    serde_json::to_writer(&mut *out, &object)?;
    out.write_all(b"\n")
}

/// The command of a frame, or the raw frame that it is.
fn said(board: &Board, frame: Frame<'_>) -> Option<String> {
    board.decode_or_raw(frame.bytes()).map(|command| board.show(&command).to_string())
}

/// One line of JSON. Fields may be added; existing ones never change their meaning.
#[derive(Serialize)]
struct JsonLine {
    #[serde(rename = "t_us")]
    at: Micros,
    frame: Option<String>,
    command: Option<String>,
    skipped: Option<String>,
    wrong: Option<String>,
}
