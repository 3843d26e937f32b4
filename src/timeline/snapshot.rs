//! Snapshots: a timeline in a file next to its script. The format is the listing after three comment
//! lines: the version, the name of the script, and its board as a script writes it after `board`. If a file describes
//! the board, a fourth has the bytes of a stop. Reading is strict.
//!
//! A gate is a comment in the listing: `# gate`, its time, and its line. Before the first step of each move, a TAB-separated comment describes the move: `# move`, its
//! start, its end, its easing, and its number of steps. The frames that are sent if something ends
//! a run early follow `# on abort`, with times since the stop. The last line states the end of the
//! script, the number of frames and the speed of the line, so that a truncated file is detected.
//! A column after the kind of a frame is reserved for the name of a robot.
//!
//! Version 2 had no family and no gates; version 1 was the listing alone.

use std::fmt;
use std::io::{self, Write};
use std::sync::Arc;

use super::listing::{GATE, Item, write_gate, write_line, write_moment};
use super::tween::{MoveTracker, StepRole};
use super::{Cut, Event, Gate, Kind, Timeline, Tween};
use crate::board::{Board, Command, Frame, Hex};
use crate::program::{self, Ease, TraceId};
use crate::source::Span;
use crate::units::{Micros, Nanos};

/// The version that is written. Older versions stay readable.
const VERSION: u32 = 3;
/// The start of the first line.
const MAGIC: &str = "# motionseq frames ";
/// The latest time of a frame: a day, plus an hour for frames after the end.
const LATEST: Micros = Micros::DAY.saturating_add(Micros::SECOND.saturating_mul(3_600));
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

/// The frames of a script, from a snapshot or from the script itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
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
        read_end(line.strip_prefix(END)?).map(|(.., baud)| baud)
    }

    /// What a script writes after `board`, if the head of a snapshot states it; otherwise the board is
    /// the default one.
    pub fn family(text: &[u8]) -> Option<&str> {
        let lines = text.split(|byte| *byte == b'\n').filter(|_| is_snapshot(text));
        let mut head = lines.take_while(|line| line.starts_with(b"#"));
        head.find_map(|line| std::str::from_utf8(line).ok()?.strip_prefix(FAMILY)).map(str::trim_end)
    }

    /// A snapshot of some frames alone.
    pub fn of_moments(board: &Arc<Board>, moments: Vec<Moment>) -> Self {
        Snapshot { board: Arc::clone(board), moments, more: None, version: VERSION }
    }

    /// The snapshot of a timeline.
    pub fn of(timeline: &Timeline) -> Self {
        let moments = |events: &[Event]| events.iter().map(Moment::from).collect();
        let Timeline { end, baud, .. } = *timeline;
        let gates = timeline.gates.iter().map(|gate| bare(gate.at, gate.gate.clone(), gate.next.events)).collect();
        let more = More { tweens: timeline.tweens.clone(), gates, abort: moments(&timeline.abort), end, baud };
        Snapshot {
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
            robot: None,
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

/// Writes the snapshot of the script `name`.
pub fn write_snapshot(name: &str, timeline: &Timeline, out: &mut impl Write) -> io::Result<()> {
    write_head(&timeline.board, name, out)?;
    let mut tracker = MoveTracker::new(&timeline.board, &timeline.tweens);
    let mut bytes = Vec::new();
    for item in timeline.items() {
        let event = match item {
            Item::Event(event) => event,
            Item::Gate(gate) => {
                write_gate(gate, out)?;
                continue;
            }
        };
        if let StepRole::First(Tween { at, end, ease, steps }) = tracker.take(&event.command, event.kind) {
            writeln!(out, "{MOVE}{at:.6}\t{end:.6}\t{}\t{steps}", ease.name())?;
        }
        write_line(timeline, event, &mut bytes, out)?;
    }
    if !timeline.abort.is_empty() {
        writeln!(out, "{ABORT}")?;
    }
    for event in &timeline.abort {
        write_line(timeline, event, &mut bytes, out)?;
    }
    let count = timeline.events.len() + timeline.abort.len();
    writeln!(out, "{END}{:.6}\tframes\t{count}\tbaud\t{}", timeline.end, timeline.baud)
}

/// Writes a snapshot of the frames that are sent if something ends a run early.
pub(crate) fn write_aborted(
    board: &Board,
    name: &str,
    moments: &[Moment],
    baud: u32,
    out: &mut impl Write,
) -> io::Result<()> {
    write_head(board, name, out)?;
    let mut bytes = Vec::new();
    for moment in moments {
        write_moment(board, (moment.at, &moment.command, moment.kind), None, &mut bytes, out)?;
    }
    let end = moments.last().map_or(Micros::ZERO, |moment| moment.at);
    writeln!(out, "{END}{end:.6}\tframes\t{}\tbaud\t{baud}", moments.len())
}

/// Writes the lines before the listing.
fn write_head(board: &Board, name: &str, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{MAGIC}{VERSION}\n# {}\n{FAMILY}{}", name.replace(['\r', '\n'], " "), board.line)?;
    // The stop of a built-in family does not change with a file of the user.
    if is_from_file(board) { writeln!(out, "{STOP}{}", stop_of(board)) } else { Ok(()) }
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

/// Whether a text starts like a snapshot.
pub fn is_snapshot(text: &[u8]) -> bool {
    text.starts_with(MAGIC.as_bytes())
}

/// Reads a snapshot. Strict: frames and commands must match, times must not decrease, and nothing
/// may be missing.
///
/// # Errors
/// The first line that is wrong.
pub fn read_snapshot(board: &Arc<Board>, text: &[u8]) -> Result<Snapshot, SnapshotError> {
    let wrong = |line: usize, why: &str| SnapshotError { line, why: why.to_owned(), is_newer: false };
    let text = std::str::from_utf8(text).map_err(|error| {
        let before = text.get(..error.valid_up_to()).unwrap_or_default();
        wrong(before.iter().filter(|&&byte| byte == b'\n').count() + 1, "not UTF-8 text")
    })?;
    let whole = text.is_empty() || text.ends_with('\n');
    let mut lines = text.lines().zip(1..);
    let (head, _) = lines.next().unwrap_or_default();
    let version = head.strip_prefix(MAGIC).ok_or_else(|| wrong(1, &format!("expected `{MAGIC}{VERSION}`")))?;
    let version = match version.trim().parse() {
        Ok(version @ 1..=VERSION) => version,
        Ok(newer) if newer > VERSION => {
            let why =
                format!("version {newer} is too new: this motionseq reads versions up to {VERSION}, so update it");
            return Err(SnapshotError { line: 1, why, is_newer: true });
        }
        _ => return Err(wrong(1, &format!("unknown version `{version}`"))),
    };
    let mut reader = Reader { board, version, moments: Vec::new(), more: More::default(), end: None, aborts: false };
    let mut last = 1;
    for (text, line) in lines {
        last = line;
        reader.line(text).map_err(|why| wrong(line, &why))?;
    }
    if !whole {
        return Err(wrong(last, "the file ends inside this line"));
    }
    let Reader { moments, more, end, .. } = reader;
    if version == 1 {
        return Ok(Snapshot { board: Arc::clone(board), moments, more: None, version });
    }
    let (end, count, baud) = end.ok_or_else(|| wrong(last, "the file is truncated: its last line is missing"))?;
    if count != moments.len() + more.abort.len() {
        return Err(wrong(last, &format!("found {} frames instead of {count}", moments.len() + more.abort.len())));
    }
    belong(board, &moments, &more.tweens).map_err(|why| wrong(last, &why))?;
    Ok(Snapshot { board: Arc::clone(board), moments, more: Some(More { end, baud, ..more }), version })
}

/// A snapshot that is being read.
struct Reader<'b> {
    board: &'b Board,
    version: u32,
    moments: Vec<Moment>,
    more: More,
    /// The last line: the end of the script, the number of frames and the speed of the line.
    end: Option<(Micros, usize, u32)>,
    /// Whether the frames of `on abort` are being read.
    aborts: bool,
}

impl Reader<'_> {
    /// Reads the next line; returns why it is wrong.
    fn line(&mut self, text: &str) -> Result<(), String> {
        if self.end.is_some() {
            return Err("there is a line after the end".into());
        }
        if let Some(words) = text.strip_prefix(MOVE) {
            let why = "a move needs its start, its end, its easing and its number of steps";
            self.more.tweens.push(read_move(words).ok_or(why)?);
        } else if let Some(words) = text.strip_prefix(GATE).filter(|_| self.version >= 3) {
            let why = "a gate needs its time and its line as a script writes it";
            let gate = read_gate(self.board, words, self.moments.len()).filter(|_| !self.aborts).ok_or(why)?;
            self.check_time(gate.at)?;
            self.more.gates.push(gate);
        } else if let Some(family) = text.strip_prefix(FAMILY).filter(|_| self.version >= 3) {
            let own = &self.board.line;
            if family != own {
                return Err(format!("this is a snapshot for the board `{family}`, not `{own}`"));
            }
        } else if let Some(stop) = text.strip_prefix(STOP).filter(|_| is_from_file(self.board)) {
            let own = stop_of(self.board);
            if stop != own {
                return Err(format!("a stop sent `{stop}`, and sends `{own}` now: {} has changed", self.board.line));
            }
        } else if let Some(words) = text.strip_prefix(END) {
            let why = "the last line needs the end of the script, the number of frames and the speed of the line";
            let end = read_end(words).ok_or(why)?;
            if self.more.gates.last().is_some_and(|gate| gate.at > end.0) {
                return Err("a gate is after the end of the script".into());
            }
            self.end = Some(end);
        } else if text == ABORT {
            self.aborts = true;
        } else if !text.starts_with('#') {
            let moment = read_line(self.board, text).map_err(|why| {
                let changed = format!("; perhaps {} has changed since", self.board.line);
                if is_from_file(self.board) { why + &changed } else { why }
            })?;
            self.check_time(moment.at)?;
            (if self.aborts { &mut self.more.abort } else { &mut self.moments }).push(moment);
        }
        Ok(())
    }

    /// Checks that a time is not earlier than those above it.
    fn check_time(&self, at: Micros) -> Result<(), String> {
        let frame = if self.aborts { self.more.abort.last() } else { self.moments.last() };
        let gate = self.more.gates.last().filter(|_| !self.aborts).map(|gate| gate.at);
        match frame.map(|frame| frame.at).max(gate) {
            Some(before) if before > at => Err("its time is earlier than in the line above".into()),
            _ => Ok(()),
        }
    }
}

/// Checks that every step has its move, and every move its steps.
fn belong(board: &Board, moments: &[Moment], tweens: &[Tween]) -> Result<(), String> {
    let mut tracker = MoveTracker::new(board, tweens);
    for Moment { at, command, kind } in moments {
        match tracker.take(command, *kind) {
            StepRole::Stray => return Err(format!("the step at {at:.6} s belongs to no move")),
            StepRole::First(tween) if !(tween.at..=tween.end).contains(at) => {
                return Err(format!("the step at {at:.6} s is outside of its move"));
            }
            _ => {}
        }
    }
    if tracker.is_complete() { Ok(()) } else { Err("a move has too few steps".into()) }
}

fn read_move(words: &str) -> Option<Tween> {
    let mut words = words.split('\t');
    let (at, end) = (micros(words.next()?)?, micros(words.next()?)?);
    let (ease, steps) = (Ease::named(words.next()?)?, words.next()?.parse().ok()?);
    (at <= end && steps > 0 && words.next().is_none()).then_some(Tween { at, end, ease, steps })
}

fn read_gate(board: &Board, words: &str, events: usize) -> Option<Gate> {
    let (at, line) = words.split_once('\t')?;
    Some(bare(micros(at)?, program::Gate::parse(board, line)?, events))
}

fn read_end(words: &str) -> Option<(Micros, usize, u32)> {
    match words.split('\t').collect::<Vec<_>>().as_slice() {
        [end, "frames", count, "baud", baud] => Some((micros(end)?, count.parse().ok()?, baud.parse().ok()?)),
        _ => None,
    }
}

fn read_line(board: &Board, text: &str) -> Result<Moment, String> {
    let mut columns = text.split('\t');
    let mut column = |what: &str| columns.next().ok_or_else(|| format!("{what} is missing"));
    let (time, frame, said) = (column("the time")?, column("the frame")?, column("the command")?);
    let (word, robot) = (columns.next(), columns.next());
    if let Some(robot) = robot {
        return Err(format!("the frame is for the robot `{robot}`, and this motionseq knows only one robot"));
    }
    let at = micros(time).ok_or_else(|| format!("`{time}` is not a time with six decimals"))?;
    let hex = |byte: &str| u8::from_str_radix(byte, 16).ok().filter(|_| byte.len() == 2 && !byte.starts_with('+'));
    let bytes = frame.split(' ').map(hex).collect::<Option<Vec<u8>>>();
    let bytes = bytes.ok_or_else(|| format!("`{frame}` is not a frame in hex"))?;
    let frame = Frame::new(board, &bytes).map_err(|error| error.to_string())?;
    // Two commands may have the same frame.
    let is_said = |command: &Command| board.show(command).to_string() == said;
    let other = board.codec.other_reading(board, frame.bytes());
    let decoded = board.decode_or_raw(frame.bytes());
    let Some(command) = other.filter(is_said).or_else(|| decoded.clone().filter(is_said)) else {
        let is = decoded.map_or_else(|| "not a command".to_owned(), |command| format!("`{}`", board.show(&command)));
        return Err(format!("the frame is {is}, not `{said}`"));
    };
    let kind = match word {
        None => Some(Kind::Command),
        Some(word) => Kind::ALL.iter().copied().find(|kind| kind.word() == Some(word)),
    };
    let kind = kind.ok_or_else(|| format!("unknown kind of frame `{}`", word.unwrap_or_default()))?;
    Ok(Moment { at, command, kind })
}

/// Seconds with exactly six decimals.
fn micros(text: &str) -> Option<Micros> {
    let micros = Nanos::from_seconds(text)?.micros();
    (micros <= LATEST && format!("{micros:.6}") == text).then_some(micros)
}
