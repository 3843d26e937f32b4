//! Writes a timeline as text or bytes. Columns are not aligned, so that a change affects only its
//! own lines.

use std::io::{self, Write};

use serde::Serialize;

use super::{Event, Kind};
use crate::board::{Board, Command, Frame};
use crate::source::Lines;
use crate::units::Micros;

/// One TAB-separated line per frame: seconds, the frame in hex, the command, and the kind of frame
/// unless it is a plain command.
pub fn write_listing(board: &Board, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    events.iter().try_for_each(|event| write_line(board, event, &mut bytes, out))
}

/// Writes the line of one frame; `bytes` is a reusable buffer.
pub(super) fn write_line(board: &Board, event: &Event, bytes: &mut Vec<u8>, out: &mut impl Write) -> io::Result<()> {
    write_moment(board, event.at, &event.command, event.kind, bytes, out)
}

#[expect(clippy::too_many_arguments, reason = "a line and what it is written with")]
pub(super) fn write_moment(
    board: &Board,
    at: Micros,
    command: &Command,
    kind: Kind,
    bytes: &mut Vec<u8>,
    out: &mut impl Write,
) -> io::Result<()> {
    bytes.clear();
    board.encode(command, bytes);
    let frame = Frame::new(board, bytes).map_err(io::Error::other)?;
    write!(out, "{at:.6}\t{frame}\t{}", board.show(command))?;
    match kind.word() {
        Some(word) => writeln!(out, "\t{word}"),
        None => writeln!(out),
    }
}

/// One line per frame: seconds, TAB, the frame in hex.
pub fn write_hex(board: &Board, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    each(board, events, |event, frame| writeln!(out, "{:.6}\t{frame}", event.at))
}

/// One JSON object per line. The time is in microseconds; `file` and `line` are the command's place
/// in the script.
pub fn write_jsonl(board: &Board, events: &[Event], lines: &Lines<'_>, out: &mut impl Write) -> io::Result<()> {
    each(board, events, |event, frame| {
        let place = lines.place(event.span);
        let object = Object {
            at: event.at,
            frame: frame.to_string().replace(' ', ""),
            command: board.show(&event.command).to_string(),
            kind: event.kind.word().unwrap_or("command"),
            file: place.file,
            line: place.line,
            robot: (),
        };
        serde_json::to_writer(&mut *out, &object)?;
        out.write_all(b"\n")
    })
}

/// One frame in the format of `render --format jsonl`. Fields may be added; existing ones never
/// change their meaning.
#[derive(Serialize)]
struct Object<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    frame: String,
    command: String,
    kind: &'static str,
    file: &'a str,
    line: usize,
    /// Always null. Reserved for the name of the robot.
    robot: (),
}

/// The bytes of all frames, exactly as the port gets them.
pub fn write_bin(board: &Board, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    each(board, events, |_, frame| out.write_all(frame.bytes()))
}

fn each(board: &Board, events: &[Event], mut write: impl FnMut(&Event, Frame<'_>) -> io::Result<()>) -> io::Result<()> {
    let mut bytes = Vec::new();
    events.iter().try_for_each(|event| write(event, encode(board, event, &mut bytes)?))
}

fn encode<'b>(board: &Board, event: &Event, bytes: &'b mut Vec<u8>) -> io::Result<Frame<'b>> {
    bytes.clear();
    board.encode(&event.command, bytes);
    Frame::new(board, bytes).map_err(io::Error::other)
}
