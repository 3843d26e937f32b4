//! A timeline in a file that is kept beside its script: the listing behind two comment lines, read back strictly.

use std::fmt;
use std::io::{self, Write};

use super::{Event, Kind, Seconds, write_listing};
use crate::board::{Command, Frame};

/// The version of the format that is written. Older ones stay readable.
const VERSION: u32 = 1;
/// How the first line begins.
const MAGIC: &str = "# motionseq frames ";

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
pub fn write_snapshot(name: &str, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{MAGIC}{VERSION}\n# {}", name.replace(['\r', '\n'], " "))?;
    write_listing(events, out)
}

/// Whether a text says that it is a snapshot.
pub fn is_snapshot(text: &[u8]) -> bool {
    text.starts_with(MAGIC.as_bytes())
}

/// Reads a snapshot. Strict: frame and command must be the same, times must not go back.
pub fn read_snapshot(text: &[u8]) -> Result<Vec<Moment>, SnapshotError> {
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
    match version.trim().parse() {
        Ok(VERSION) => {}
        Ok(newer) if newer > VERSION => {
            let why = format!("it is of version {newer}; this motionseq reads up to {VERSION}, so update it");
            return Err(SnapshotError { line: 1, why });
        }
        _ => return Err(SnapshotError { line: 1, why: format!("there is no version `{version}`") }),
    }
    let mut moments: Vec<Moment> = Vec::new();
    let mut last = 1;
    for (text, line) in lines {
        last = line;
        if text.starts_with('#') {
            continue;
        }
        let moment = read_line(text).map_err(|why| SnapshotError { line, why })?;
        if moments.last().is_some_and(|before| before.at_us > moment.at_us) {
            return Err(SnapshotError { line, why: "its time is before that of the line above".into() });
        }
        moments.push(moment);
    }
    if whole { Ok(moments) } else { Err(SnapshotError { line: last, why: "the file ends inside this line".into() }) }
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
