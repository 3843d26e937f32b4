//! A timeline in a file that is kept beside its script: the listing behind two comment lines, read back strictly.
//!
//! Before the first step of each move stands a comment that says how the move was meant, TAB-separated: `# move`, when it
//! starts, when it arrives, its easing, and how many steps it has. Version 1 had none of these.

use std::fmt;
use std::io::{self, Write};

use super::listing::write_line;
use super::tween::{Part, Walk};
use super::{Event, Kind, Seconds, Tween};
use crate::board::{Command, Frame};
use crate::program::Ease;

/// The version of the format that is written. Older ones stay readable.
const VERSION: u32 = 2;
/// How the first line begins.
const MAGIC: &str = "# motionseq frames ";
/// How the comment before a move begins.
const MOVE: &str = "# move\t";

/// What a script sends, as a snapshot or the script itself has it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Snapshot {
    /// Every frame, in the order of sending.
    pub moments: Vec<Moment>,
    /// The moves, in the order of their first steps; `None` where the format was too old to say.
    pub tweens: Option<Vec<Tween>>,
}

impl Snapshot {
    /// What frames and moves say.
    pub fn of(events: &[Event], tweens: &[Tween]) -> Self {
        Snapshot { moments: events.iter().map(Moment::from).collect(), tweens: Some(tweens.to_vec()) }
    }
}

/// One frame at its time, as a snapshot or a script has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moment {
    /// When it is due, in microseconds from the start of the script.
    pub at_us: u64,
    /// What it says.
    pub command: Command,
    /// Where it comes from.
    pub kind: Kind,
}

impl From<&Event> for Moment {
    fn from(event: &Event) -> Self {
        Moment { at_us: event.at_us, command: event.command.clone(), kind: event.kind }
    }
}

/// Why a file is no snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotError {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong with it, in words.
    pub why: String,
}

impl fmt::Display for SnapshotError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.why)
    }
}

/// Writes the snapshot of a script that is called `name`.
pub fn write_snapshot(name: &str, events: &[Event], tweens: &[Tween], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{MAGIC}{VERSION}\n# {}", name.replace(['\r', '\n'], " "))?;
    let mut walk = Walk::new(tweens);
    let mut bytes = Vec::new();
    for event in events {
        if let Part::First(Tween { at_us, end_us, ease, steps }) = walk.take(&event.command, event.kind) {
            writeln!(out, "{MOVE}{}\t{}\t{}\t{steps}", Seconds(*at_us), Seconds(*end_us), ease.name())?;
        }
        write_line(event, &mut bytes, out)?;
    }
    Ok(())
}

/// Whether a text says that it is a snapshot.
pub fn is_snapshot(text: &[u8]) -> bool {
    text.starts_with(MAGIC.as_bytes())
}

/// Reads a snapshot. Strict: frame and command must be the same, times must not go back.
pub fn read_snapshot(text: &[u8]) -> Result<Snapshot, SnapshotError> {
    let text = std::str::from_utf8(text).map_err(|error| {
        let before = text.get(..error.valid_up_to()).unwrap_or_default();
        SnapshotError {
            line: before.iter().filter(|&&byte| byte == b'\n').count() + 1,
            why: "it is not UTF-8 text".into(),
        }
    })?;
    let whole = text.is_empty() || text.ends_with('\n');
    let mut lines = text.lines().zip(1..);
    let (head, _) = lines.next().unwrap_or_default();
    let version = head
        .strip_prefix(MAGIC)
        .ok_or_else(|| SnapshotError { line: 1, why: format!("it does not begin with `{MAGIC}{VERSION}`") })?;
    let version = match version.trim().parse() {
        Ok(version @ 1..=VERSION) => version,
        Ok(newer) if newer > VERSION => {
            let why = format!("it is of version {newer}; this motionseq reads up to {VERSION}, so update it");
            return Err(SnapshotError { line: 1, why });
        }
        _ => return Err(SnapshotError { line: 1, why: format!("there is no version `{version}`") }),
    };
    let mut moments: Vec<Moment> = Vec::new();
    let mut tweens = Vec::new();
    let mut last = 1;
    for (text, line) in lines {
        last = line;
        if let Some(words) = text.strip_prefix(MOVE) {
            tweens.push(read_move(words).ok_or_else(|| {
                let why = "it does not say of a move its start, its end, its easing and its number of steps".to_owned();
                SnapshotError { line, why }
            })?);
        }
        if text.starts_with('#') {
            continue;
        }
        let moment = read_line(text).map_err(|why| SnapshotError { line, why })?;
        if moments.last().is_some_and(|before| before.at_us > moment.at_us) {
            return Err(SnapshotError { line, why: "its time is before that of the line above".into() });
        }
        moments.push(moment);
    }
    if !whole {
        return Err(SnapshotError { line: last, why: "the file ends inside this line".into() });
    }
    let tweens = (version > 1).then_some(tweens);
    if let Some(tweens) = &tweens {
        belong(&moments, tweens).map_err(|why| SnapshotError { line: last, why })?;
    }
    Ok(Snapshot { moments, tweens })
}

/// Whether every step has its move, and every move its steps.
fn belong(moments: &[Moment], tweens: &[Tween]) -> Result<(), String> {
    let mut walk = Walk::new(tweens);
    for Moment { at_us, command, kind } in moments {
        if let Part::Stray = walk.take(command, *kind) {
            return Err(format!("the step at {} s belongs to no move", Seconds(*at_us)));
        }
    }
    if walk.is_over() { Ok(()) } else { Err("there is a move whose steps are not all there".into()) }
}

fn read_move(words: &str) -> Option<Tween> {
    let mut words = words.split('\t');
    let (at_us, end_us) = (micros(words.next()?)?, micros(words.next()?)?);
    let (ease, steps) = (Ease::named(words.next()?)?, words.next()?.parse().ok()?);
    (at_us <= end_us && steps > 0 && words.next().is_none()).then_some(Tween { at_us, end_us, ease, steps })
}

fn read_line(text: &str) -> Result<Moment, String> {
    let mut columns = text.split('\t');
    let mut column = |what: &str| columns.next().ok_or_else(|| format!("{what} is missing"));
    let (time, frame, said) = (column("the time")?, column("the frame")?, column("the command")?);
    let (word, more) = (columns.next(), columns.next());
    let at_us = micros(time).ok_or_else(|| format!("`{time}` is no time with six decimals"))?;
    let bytes = frame.split(' ').map(|byte| u8::from_str_radix(byte, 16).ok()).collect::<Option<Vec<u8>>>();
    let bytes = bytes.ok_or_else(|| format!("`{frame}` is no frame in hex"))?;
    let frame = Frame::new(&bytes).map_err(|error| error.to_string())?;
    let command = Command::decode_or_raw(frame);
    if command.to_string() != said {
        return Err(format!("the frame is `{command}`, and not `{said}`"));
    }
    let kind = match word {
        None => Some(Kind::Command),
        Some(word) => Kind::ALL.iter().copied().find(|kind| kind.word() == Some(word)),
    };
    match (kind, more) {
        (Some(kind), None) => Ok(Moment { at_us, command, kind }),
        _ => Err(format!("`{}` is no kind of frame", word.unwrap_or_default())),
    }
}

/// Seconds with six decimals, as [`Seconds`] writes them.
fn micros(text: &str) -> Option<u64> {
    let (whole, part) = text.split_once('.')?;
    let micros = whole.parse::<u64>().ok()?.checked_mul(1_000_000)?.checked_add(part.parse().ok()?)?;
    (Seconds(micros).to_string() == text).then_some(micros)
}
