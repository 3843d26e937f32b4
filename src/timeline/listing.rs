//! Writes a timeline as text or bytes. Columns are not aligned, so that a change affects only its
//! own lines.

use std::io::{self, Write};
use std::iter;

use serde::Serialize;

use super::{Event, Gate, Kind, Timeline};
use crate::board::{Board, Command, Frame};
use crate::source::Lines;
use crate::units::Micros;

/// The start of the line before the frames of a robot.
pub(super) const ROBOT: &str = "# robot\t";
/// The start of the line of a gate.
pub(super) const GATE: &str = "# gate\t";

/// A frame or a gate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Item<'t> {
    /// A frame.
    Event(&'t Event),
    /// A gate.
    Gate(&'t Gate),
}

impl Timeline {
    /// The frames and gates of the run, in order.
    pub fn items(&self) -> impl Iterator<Item = Item<'_>> {
        let mut gates = self.gates.iter().peekable();
        let mut events = self.events.iter().zip(0..).peekable();
        iter::from_fn(move || {
            let next = events.peek().map_or(usize::MAX, |(_, at)| *at);
            let gate = gates.next_if(|gate| gate.next.events <= next).map(Item::Gate);
            gate.or_else(|| events.next().map(|(event, _)| Item::Event(event)))
        })
    }
}

/// The line before the frames of a robot, if the script names its robots: `# robot`, TAB, its name.
pub fn write_robot(timeline: &Timeline, out: &mut impl Write) -> io::Result<()> {
    timeline.robot.as_ref().map_or(Ok(()), |robot| writeln!(out, "{ROBOT}{robot}"))
}

/// The robot that a line of a listing or a snapshot names, if it is such a line.
pub(crate) fn robot_of(line: &str) -> Option<&str> {
    line.strip_prefix(ROBOT)?.split('\t').next()
}

/// The listings of all robots, one after another, each with its [`write_robot`] line.
pub fn write_listings(timelines: &[Timeline], out: &mut impl Write) -> io::Result<()> {
    timelines.iter().try_for_each(|timeline| {
        write_robot(timeline, out)?;
        write_listing(timeline, timeline.items(), out)
    })
}

/// One TAB-separated line per frame: seconds, the frame in hex, the command, and the kind of frame
/// unless it is a plain command. If the script names its robots, a fifth column has the name; the
/// fourth may be empty then. The line of a gate is a comment with its time.
pub fn write_listing<'t>(
    timeline: &Timeline,
    mut items: impl Iterator<Item = Item<'t>>,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut bytes = Vec::new();
    items.try_for_each(|item| match item {
        Item::Event(event) => write_line(timeline, event, &mut bytes, out),
        Item::Gate(gate) => write_gate(gate, out),
    })
}

/// Writes the line of a gate.
pub(super) fn write_gate(gate: &Gate, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{GATE}{:.6}\t{}", gate.at, gate.gate)
}

/// Writes the line of one frame; `bytes` is a reusable buffer.
pub(super) fn write_line(
    timeline: &Timeline,
    event: &Event,
    bytes: &mut Vec<u8>,
    out: &mut impl Write,
) -> io::Result<()> {
    let moment = (event.at, &event.command, event.kind);
    write_moment(&timeline.board, moment, timeline.robot.as_deref(), bytes, out)
}

pub(super) fn write_moment(
    board: &Board,
    (at, command, kind): (Micros, &Command, Kind),
    robot: Option<&str>,
    bytes: &mut Vec<u8>,
    out: &mut impl Write,
) -> io::Result<()> {
    bytes.clear();
    board.encode(command, bytes);
    let frame = Frame::new(board, bytes).map_err(io::Error::other)?;
    write!(out, "{at:.6}\t{frame}\t{}", board.show(command))?;
    match (kind.word(), robot) {
        (word, Some(robot)) => writeln!(out, "\t{}\t{robot}", word.unwrap_or_default()),
        (Some(word), None) => writeln!(out, "\t{word}"),
        (None, None) => writeln!(out),
    }
}

/// One line per frame: seconds, TAB, the frame in hex.
pub fn write_hex<'t>(board: &Board, items: impl Iterator<Item = Item<'t>>, out: &mut impl Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    events(items).try_for_each(|event| writeln!(out, "{:.6}\t{}", event.at, encode(board, event, &mut bytes)?))
}

/// One JSON object per line, for each frame and each gate. The time is in microseconds; `file` and
/// `line` are the place in the script. A gate has no frame.
pub fn write_jsonl<'t>(
    timeline: &Timeline,
    mut items: impl Iterator<Item = Item<'t>>,
    lines: &Lines<'_>,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut bytes = Vec::new();
    let board = &timeline.board;
    let robot = timeline.robot.as_deref();
    items.try_for_each(|item| {
        let (at, frame, command, kind, span) = match item {
            Item::Event(event) => {
                let frame = encode(board, event, &mut bytes)?.to_string().replace(' ', "");
                let command = board.show(&event.command).to_string();
                (event.at, Some(frame), command, event.kind.word().unwrap_or("command"), event.span)
            }
            Item::Gate(gate) => (gate.at, None, gate.gate.to_string(), "gate", gate.span),
        };
        let place = lines.place(span);
        let object = Object { at, frame, command, kind, file: place.file, line: place.line, robot };
        serde_json::to_writer(&mut *out, &object)?;
        out.write_all(b"\n")
    })
}

/// One frame or gate in the format of `render --format jsonl`. Fields may be added; existing ones
/// never change their meaning.
#[derive(Serialize)]
struct Object<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    /// In hex; null for a gate.
    frame: Option<String>,
    command: String,
    kind: &'static str,
    file: &'a str,
    line: usize,
    /// Null if the script names no robots.
    robot: Option<&'a str>,
}

/// The bytes of all frames, exactly as the port gets them.
pub fn write_bin<'t>(board: &Board, items: impl Iterator<Item = Item<'t>>, out: &mut impl Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    events(items).try_for_each(|event| out.write_all(encode(board, event, &mut bytes)?.bytes()))
}

fn events<'t>(items: impl Iterator<Item = Item<'t>>) -> impl Iterator<Item = &'t Event> {
    items.filter_map(|item| if let Item::Event(event) = item { Some(event) } else { None })
}

fn encode<'b>(board: &Board, event: &Event, bytes: &'b mut Vec<u8>) -> io::Result<Frame<'b>> {
    bytes.clear();
    board.encode(&event.command, bytes);
    Frame::new(board, bytes).map_err(io::Error::other)
}
