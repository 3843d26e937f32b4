//! Snapshots: the timelines of a script in a file next to it. The format is the listing after comment
//! lines: the version, the name of the script, and its board as a script writes it after `board`. If a file describes
//! the board, another line has the bytes of a stop.
//!
//! A gate is a comment in the listing: `# gate`, its time, and its line. Before the first step of each move, a TAB-separated comment describes the move: `# move`, its
//! start, its end, its easing, and its number of steps. The frames that are sent if something ends
//! a run early follow `# on abort`, with times since the stop. The last line states the end of the
//! script, the number of frames and the speed of the line, so that a truncated file is detected.
//!
//! If the script names its robots, a line `# robot` for each has its name and its board, in place of the line with the board. All of
//! this follows once for each robot, after a line `# frames` with its name, which is also in the column after the kind of a frame.
//!
//! Version 2 had no family, no gates and no robots; version 1 was the listing alone.

mod read;
mod write;

use std::fmt;
use std::sync::Arc;

use super::listing::{GATE, ROBOT};
use super::{Cut, Event, Gate, Kind, Timeline, Tween};
use crate::board::{Board, Command, Hex};
use crate::program::{self, TraceId};
use crate::source::Span;
use crate::units::Micros;

pub use read::{read_snapshot, read_snapshots};
pub(crate) use write::write_aborted;
pub use write::write_snapshot;

/// The version that is written. Older versions stay readable.
const VERSION: u32 = 3;
/// The start of the first line.
const MAGIC: &str = "# motionseq frames ";
/// The start of the line with the board.
const FAMILY: &str = "# board\t";
/// The start of the line with the bytes of a stop, for a board that a file describes.
const STOP: &str = "# stop\t";
/// The start of the comment before a move.
const MOVE: &str = "# move\t";
/// The line before the frames that are sent if something ends a run early.
const ABORT: &str = "# on abort";
/// The start of the last line.
const END: &str = "# end\t";
/// The start of the line before everything that a robot does, if the script names its robots.
const FRAMES: &str = "# frames\t";

/// A robot of a script: its name, if the script names its robots, and its board.
pub type NamedBoard = (Option<Arc<str>>, Arc<Board>);

/// The frames of a robot, from a snapshot or from the script itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// The name of the robot, if the script names its robots.
    pub robot: Option<Arc<str>>,
    /// The board.
    pub board: Arc<Board>,
    /// Every frame, in the order of sending.
    pub moments: Vec<Moment>,
    /// What version 1 does not contain.
    pub more: Option<More>,
    /// The version of the format.
    pub version: u32,
}

/// The contents of a snapshot besides its frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct More {
    /// The moves, in the order of their first steps.
    pub tweens: Vec<Tween>,
    /// The gates, in order. They have no places in the script.
    pub gates: Vec<Gate>,
    /// Sent if something ends a run early; times count from the stop.
    pub abort: Vec<Moment>,
    /// The end of the script, from its start.
    pub end: Micros,
    /// The speed of the line in bits per second.
    pub baud: u32,
}

impl Snapshot {
    /// Whether the lines after this line of a snapshot are sent only if something ends a run early.
    pub(crate) fn begins_abort(line: &str) -> bool {
        line == ABORT
    }

    /// The speed of the line in bits per second, if a line of a snapshot states it.
    pub fn baud(line: &str) -> Option<u32> {
        read::end(line.strip_prefix(END)?).map(|(.., baud)| baud)
    }

    /// The robots that the head of a snapshot states: the name of each, and what a script writes after `board`. Without names, there is
    /// one, and if the head does not state its board, that is the default one.
    pub fn robots(text: &[u8]) -> Vec<(Option<&str>, Option<&str>)> {
        let lines = text.split(|byte| *byte == b'\n').filter(|_| is_snapshot(text));
        let head = lines.take_while(|line| line.starts_with(b"#") && !line.starts_with(FRAMES.as_bytes()));
        let head = head.filter_map(|line| std::str::from_utf8(line).ok()).map(str::trim_end);
        let named = head.clone().filter_map(|line| line.strip_prefix(ROBOT)?.split_once('\t'));
        let named: Vec<_> = named.map(|(name, board)| (Some(name), Some(board))).collect();
        let mut boards = head.filter_map(|line| line.strip_prefix(FAMILY));
        if named.is_empty() { vec![(None, boards.next())] } else { named }
    }

    /// A snapshot of some frames alone.
    pub fn of_moments((robot, board): NamedBoard, moments: Vec<Moment>) -> Self {
        Snapshot { robot, board, moments, more: None, version: VERSION }
    }

    /// The snapshot of a timeline.
    pub fn of(timeline: &Timeline) -> Self {
        let moments = |events: &[Event]| events.iter().map(Moment::from).collect();
        let Timeline { end, baud, .. } = *timeline;
        let gates = timeline.gates.iter().map(|gate| bare(gate.at, gate.gate.clone(), gate.next.events)).collect();
        let more = More { tweens: timeline.tweens.clone(), gates, abort: moments(&timeline.abort), end, baud };
        Snapshot {
            robot: timeline.robot.clone(),
            board: Arc::clone(&timeline.board),
            moments: moments(&timeline.events),
            more: Some(more),
            version: VERSION,
        }
    }

    /// The timeline that it describes. A snapshot contains no places in the script, marks or limits.
    pub fn timeline(&self) -> Timeline {
        let events = |moments: &[Moment]| moments.iter().map(Event::from).collect();
        let (end, more) = (self.moments.last().map_or(Micros::ZERO, |last| last.at), self.more.as_ref());
        Timeline {
            robot: self.robot.clone(),
            board: Arc::clone(&self.board),
            events: events(&self.moments),
            tweens: more.map(|more| more.tweens.clone()).unwrap_or_default(),
            abort: more.map(|more| events(&more.abort)).unwrap_or_default(),
            cues: Vec::new(),
            expects: Vec::new(),
            marks: Arc::default(),
            gates: more.map(|more| more.gates.clone()).unwrap_or_default(),
            abort_cues: Vec::new(),
            end: more.map_or(end, |more| more.end),
            baud: more.map_or(self.board.baud, |more| more.baud),
            soft: None,
            refresh: Vec::new(),
            traces: Arc::default(),
            limits: Vec::new(),
            speeds: Vec::new(),
            bars: None,
        }
    }

    /// Whether the robot does the same, as far as both snapshots describe it. Moves with equal
    /// frames are equal.
    pub fn does_the_same(&self, other: &Snapshot) -> bool {
        let more = |more: &More| (more.end, more.baud);
        self.moments == other.moments
            && match (&self.more, &other.more) {
                (Some(one), Some(two)) => more(one) == more(two) && one.abort == two.abort && one.gates == two.gates,
                _ => true,
            }
    }
}

/// A gate without its place in a script.
fn bare(at: Micros, gate: program::Gate, events: usize) -> Gate {
    let next = Cut { events, ..Cut::default() };
    Gate { at, gate, next, span: Span::default(), trace: TraceId::default() }
}

/// One frame of a snapshot or a script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moment {
    /// When it is due, from the start of the script.
    pub at: Micros,
    /// The command.
    pub command: Command,
    /// The origin of the frame.
    pub kind: Kind,
}

impl From<&Event> for Moment {
    fn from(event: &Event) -> Self {
        Moment { at: event.at, command: event.command.clone(), kind: event.kind }
    }
}

impl From<&Moment> for Event {
    fn from(moment: &Moment) -> Self {
        Event {
            at: moment.at,
            command: moment.command.clone(),
            kind: moment.kind,
            is_instant: moment.kind == Kind::Command,
            span: Span::default(),
            trace: TraceId::default(),
        }
    }
}

/// Why a file is not a snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotError {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong in that line.
    pub why: String,
    /// Whether the only problem is that this program is too old.
    pub is_newer: bool,
}

impl fmt::Display for SnapshotError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.why)
    }
}

/// Whether a text starts like a snapshot.
pub fn is_snapshot(text: &[u8]) -> bool {
    text.starts_with(MAGIC.as_bytes())
}

/// Whether a file of the user describes the board.
fn is_from_file(board: &Board) -> bool {
    board.line.starts_with('"')
}

/// What a stop sends, in hex.
fn stop_of(board: &Board) -> String {
    let frames: Vec<u8> = board.stop.iter().flat_map(|command| board.to_frame(command)).collect();
    Hex(&frames).to_string()
}
