//! Reads snapshots strictly.

use std::sync::Arc;

use super::super::tween::{MoveTracker, StepRole};
use super::super::{Gate, Kind, Tween};
use super::{
    ABORT, END, FAMILY, FRAMES, GATE, MAGIC, MOVE, Moment, More, NamedBoard, ROBOT, STOP, Snapshot, SnapshotError,
    VERSION, bare, is_from_file, stop_of,
};
use crate::board::{Board, Command, Family, Frame};
use crate::program::{self, Ease};
use crate::units::{Micros, Nanos};

/// The latest time of a frame: a day, plus an hour for frames after the end.
const LATEST: Micros = Micros::DAY.saturating_add(Micros::SECOND.saturating_mul(3_600));

/// Reads the snapshot of a script that names no robots, like [`read_snapshots`].
///
/// # Errors
/// The first line that is wrong.
pub fn read_snapshot(board: &Arc<Board>, text: &[u8]) -> Result<Snapshot, SnapshotError> {
    let mut all = read_snapshots(&[(None, Arc::clone(board))], text)?;
    all.pop().ok_or_else(|| wrong(1, "it has no robot"))
}

/// Reads a snapshot, and returns what each robot does. `robots` are the robots of the script; the snapshot may have others, with
/// built-in families. Strict: frames and commands must match, times must not decrease, and nothing may be missing.
///
/// # Errors
/// The first line that is wrong.
pub fn read_snapshots(robots: &[NamedBoard], text: &[u8]) -> Result<Vec<Snapshot>, SnapshotError> {
    let named: Vec<&str> = Snapshot::robots(text).into_iter().filter_map(|(robot, _)| robot).collect();
    let text = std::str::from_utf8(text).map_err(|error| {
        let before = text.get(..error.valid_up_to()).unwrap_or_default();
        wrong(before.iter().filter(|&&byte| byte == b'\n').count() + 1, "not UTF-8 text")
    })?;
    let version = read_version(text)?;
    let named = if version >= 3 { named } else { Vec::new() };
    is_for(robots, &named).map_err(|why| wrong(1, &why))?;
    let section = if named.is_empty() { robots.first().map(|robot| Section::new(robot, version)) } else { None };
    let is_named = section.is_none();
    let mut reader = Reader { known: robots, is_named, robots: Vec::new(), done: Vec::new(), section };
    let mut last = 1;
    for (text, line) in text.lines().zip(1..).skip(1) {
        last = line;
        reader.line(text).map_err(|why| wrong(line, &why))?;
    }
    if !text.is_empty() && !text.ends_with('\n') {
        return Err(wrong(last, "the file ends inside this line"));
    }
    reader.finish().map_err(|why| wrong(last, &why))
}

fn wrong(line: usize, why: &str) -> SnapshotError {
    SnapshotError { line, why: why.to_owned(), is_newer: false }
}

/// Reads the version from the first line.
fn read_version(text: &str) -> Result<u32, SnapshotError> {
    let head = text.lines().next().unwrap_or_default();
    let version = head.strip_prefix(MAGIC).ok_or_else(|| wrong(1, &format!("expected `{MAGIC}{VERSION}`")))?;
    match version.trim().parse() {
        Ok(version @ 1..=VERSION) => Ok(version),
        Ok(newer) if newer > VERSION => {
            let why =
                format!("version {newer} is too new: this motionseq reads versions up to {VERSION}, so update it");
            Err(SnapshotError { line: 1, why, is_newer: true })
        }
        _ => Err(wrong(1, &format!("unknown version `{version}`"))),
    }
}

/// Checks that both the script and its snapshot name robots, or neither.
fn is_for(robots: &[NamedBoard], named: &[&str]) -> Result<(), String> {
    let of_script: Vec<&str> = robots.iter().filter_map(|(robot, _)| robot.as_deref()).collect();
    let list = |names: &[&str]| match names {
        [one] => format!("the robot `{one}`"),
        several => format!("the robots {}", program::list(several.iter().copied())),
    };
    match (named, of_script.as_slice()) {
        ([], []) | ([_, ..], [_, ..]) => Ok(()),
        (named, []) => Err(format!("this is a snapshot of {}, and the script names no robots", list(named))),
        ([], of_script) => {
            Err(format!("this is a snapshot of a script that names no robots, and the script has {}", list(of_script)))
        }
    }
}

/// A snapshot that is being read.
struct Reader<'r> {
    /// The robots of the script.
    known: &'r [NamedBoard],
    is_named: bool,
    /// The robots that the head names.
    robots: Vec<NamedBoard>,
    /// The robots that have been read.
    done: Vec<Snapshot>,
    /// The robot that is being read; `None` in a head that names robots.
    section: Option<Section>,
}

impl Reader<'_> {
    /// Reads the next line; returns why it is wrong.
    fn line(&mut self, text: &str) -> Result<(), String> {
        if let Some(name) = text.strip_prefix(FRAMES).filter(|_| self.is_named) {
            return self.begin(name);
        }
        match &mut self.section {
            Some(section) => section.line(text),
            None => self.head(text),
        }
    }

    /// Begins with the next robot.
    fn begin(&mut self, name: &str) -> Result<(), String> {
        self.done.extend(self.section.take().map(Section::finish).transpose()?);
        match self.robots.get(self.done.len()) {
            Some(robot) if robot.0.as_deref() == Some(name) => {
                self.section = Some(Section::new(robot, VERSION));
                Ok(())
            }
            Some((robot, _)) => {
                let next = robot.as_deref().unwrap_or_default();
                Err(format!("the frames of the robot `{next}` come next, not those of `{name}`"))
            }
            None => Err("there is a line after the end".into()),
        }
    }

    /// Reads a line of a head that names robots.
    fn head(&mut self, text: &str) -> Result<(), String> {
        if let Some(words) = text.strip_prefix(ROBOT) {
            let (name, line) = words.split_once('\t').ok_or("a robot needs its name and its board")?;
            if self.robots.iter().any(|(robot, _)| robot.as_deref() == Some(name)) {
                return Err(format!("the robot `{name}` is named twice"));
            }
            let board = self.board(name, line)?;
            self.robots.push((Some(name.into()), board));
        } else if let Some(stop) = text.strip_prefix(STOP) {
            self.robots.last().map_or(Ok(()), |(_, board)| check_stop(board, stop))?;
        } else if text.starts_with(FAMILY) {
            return Err("the board of a robot is in the line with its name".into());
        } else if !text.starts_with('#') {
            return Err("the line before the frames of a robot is missing".into());
        }
        Ok(())
    }

    /// The board of a robot: that of the script, or a built-in one for a robot that the script does not have.
    fn board(&self, name: &str, line: &str) -> Result<Arc<Board>, String> {
        let of_script = self.known.iter().find(|(robot, _)| robot.as_deref() == Some(name));
        match of_script {
            Some((_, board)) if *board.line == *line => return Ok(Arc::clone(board)),
            Some((_, board)) => {
                let own = &board.line;
                return Err(format!("this is a snapshot for the robot `{name}` with the board `{line}`, not `{own}`"));
            }
            None => {}
        }
        let same = self.known.iter().map(|(_, board)| board).find(|board| *board.line == *line);
        same.cloned().or_else(|| Family::board(line)).ok_or_else(|| {
            format!("the script has no robot `{name}`, and this motionseq does not know its board `{line}`")
        })
    }

    /// Ends with the last line.
    fn finish(mut self) -> Result<Vec<Snapshot>, String> {
        self.done.extend(self.section.take().map(Section::finish).transpose()?);
        match self.robots.get(self.done.len()) {
            Some((robot, _)) => {
                let robot = robot.as_deref().unwrap_or_default();
                Err(format!("the file is truncated: the frames of the robot `{robot}` are missing"))
            }
            None => Ok(self.done),
        }
    }
}

/// What one robot does, while it is being read.
struct Section {
    robot: Option<Arc<str>>,
    board: Arc<Board>,
    version: u32,
    moments: Vec<Moment>,
    more: More,
    /// The last line: the end of the script, the number of frames and the speed of the line.
    end: Option<(Micros, usize, u32)>,
    /// Whether the frames of `on abort` are being read.
    aborts: bool,
}

impl Section {
    fn new((robot, board): &NamedBoard, version: u32) -> Self {
        let (robot, board) = (robot.clone(), Arc::clone(board));
        Section { robot, board, version, moments: Vec::new(), more: More::default(), end: None, aborts: false }
    }

    /// Ends after the last line; returns why something is missing.
    fn finish(self) -> Result<Snapshot, String> {
        let Section { robot, board, version, moments, more, end, .. } = self;
        if version == 1 {
            return Ok(Snapshot { robot, board, moments, more: None, version });
        }
        let (end, count, baud) = end.ok_or_else(|| match &robot {
            None => "the file is truncated: its last line is missing".to_owned(),
            Some(robot) => format!("the frames of the robot `{robot}` are truncated: their last line is missing"),
        })?;
        let found = moments.len() + more.abort.len();
        if count != found {
            return Err(format!("found {found} frames instead of {count}"));
        }
        belong(&board, &moments, &more.tweens)?;
        Ok(Snapshot { robot, board, moments, more: Some(More { end, baud, ..more }), version })
    }

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
            let gate = read_gate(&self.board, words, self.moments.len()).filter(|_| !self.aborts).ok_or(why)?;
            self.check_time(gate.at)?;
            self.more.gates.push(gate);
        } else if [ROBOT, FRAMES].iter().any(|start| text.starts_with(start)) && self.version >= 3 {
            return Err("robots are named before all frames".into());
        } else if let Some(family) = text.strip_prefix(FAMILY).filter(|_| self.version >= 3) {
            let own = &*self.board.line;
            if family != own {
                return Err(format!("this is a snapshot for the board `{family}`, not `{own}`"));
            }
        } else if let Some(stop) = text.strip_prefix(STOP) {
            check_stop(&self.board, stop)?;
        } else if let Some(words) = text.strip_prefix(END) {
            let why = "the last line needs the end of the script, the number of frames and the speed of the line";
            let end = self::end(words).ok_or(why)?;
            if self.more.gates.last().is_some_and(|gate| gate.at > end.0) {
                return Err("a gate is after the end of the script".into());
            }
            self.end = Some(end);
        } else if text == ABORT {
            self.aborts = true;
        } else if !text.starts_with('#') {
            let moment = read_line(&self.board, text, self.robot.as_deref()).map_err(|why| {
                let changed = format!("; perhaps {} has changed since", self.board.line);
                if is_from_file(&self.board) { why + &changed } else { why }
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

/// Checks the bytes of a stop, for a board that a file describes.
fn check_stop(board: &Board, stop: &str) -> Result<(), String> {
    let own = stop_of(board);
    if stop == own || !is_from_file(board) {
        return Ok(());
    }
    Err(format!("a stop sent `{stop}`, and sends `{own}` now: {} has changed", board.line))
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

/// Reads the last line, after its start.
pub(super) fn end(words: &str) -> Option<(Micros, usize, u32)> {
    match words.split('\t').collect::<Vec<_>>().as_slice() {
        [end, "frames", count, "baud", baud] => Some((micros(end)?, count.parse().ok()?, baud.parse().ok()?)),
        _ => None,
    }
}

fn read_line(board: &Board, text: &str, robot: Option<&str>) -> Result<Moment, String> {
    let mut columns = text.split('\t');
    let mut column = |what: &str| columns.next().ok_or_else(|| format!("{what} is missing"));
    let (time, frame, said) = (column("the time")?, column("the frame")?, column("the command")?);
    let word = columns.next();
    match (columns.next(), robot) {
        (Some(name), None) => return Err(format!("the frame is for the robot `{name}`, and the head names no robots")),
        (None, Some(_)) => return Err("the name of the robot is missing".into()),
        (Some(name), Some(robot)) if name != robot => {
            return Err(format!("the frame is for the robot `{name}`, among those of `{robot}`"));
        }
        (Some(_), Some(_)) if columns.next().is_some() => return Err("there is something after the robot".into()),
        _ => {}
    }
    // Before the column of the robot, that of a plain command is empty.
    let word = word.filter(|word| robot.is_none() || !word.is_empty());
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
