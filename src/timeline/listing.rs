//! A timeline as text or bytes. Nothing is aligned, so that a change touches only its own lines.

use std::io::{self, Write};

use serde::Serialize;

use super::{Event, Kind};
use crate::board::{Board, Command, Frame};
use crate::source::Lines;
use crate::units::Micros;

/// One line a frame, TAB-separated: seconds, the frame in hex, the command, and what it is where that is no plain command.
pub fn write_listing(board: &Board, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    events.iter().try_for_each(|event| write_line(board, event, &mut bytes, out))
}

/// The line of one frame; `bytes` is a buffer to use again.
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

/// One line a frame: seconds, TAB, the frame in hex.
pub fn write_hex(board: &Board, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    each(board, events, |event, frame| writeln!(out, "{:.6}\t{frame}", event.at))
}

/// One JSON object a line. The time is in microseconds, `file` and `line` say where in the script the command stands.
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

/// One frame, as `render --format jsonl` writes it. Fields may be added, and never change their meaning.
#[derive(Serialize)]
struct Object<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    frame: String,
    command: String,
    kind: &'static str,
    file: &'a str,
    line: usize,
    /// Always null: the name of the robot, once scripts can name robots.
    robot: (),
}

/// The bytes of the frames, one after another: exactly what the port is given.
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
