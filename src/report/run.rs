//! How a run went, as text for other programs.

use serde::Serialize;

use super::Finding;
use crate::units::Micros;

/// How a run went. Fields may be added, and never change their meaning.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// The script.
    pub script: String,
    /// Why it ended: `finished`, `quit`, `signal`, `port`, `stalled`, `late`, `expect`, `guard` or `failed`.
    pub reason: &'static str,
    /// The same in words.
    pub cause: String,
    /// The exit code.
    pub exit: u8,
    /// When it began, as RFC 3339 writes it.
    pub started: String,
    /// The port; `None` for the virtual board.
    pub port: Option<String>,
    /// What part of the script was asked for, how fast, how often.
    pub asked: Asked,
    /// When it ended, in the time of the timeline, with all passes and without the pauses.
    #[serde(rename = "end_us")]
    pub end: Micros,
    /// How long it took, with the pauses and the stop.
    #[serde(rename = "elapsed_us")]
    pub elapsed: Micros,
    /// How often it stood, for a key or for Ctrl-Z.
    pub pauses: u64,
    /// Where in the script it ended early.
    pub file: Option<String>,
    /// Where in the script it ended early.
    pub line: Option<usize>,
    /// Whether the robot was stopped: `not needed`, `sent` or `not sent`.
    pub stop: &'static str,
    /// Which pass it was in at the end, counted from 1.
    pub passes: u64,
    /// How many frames.
    pub frames: Frames,
    /// All bytes that the port took, those of stops among them.
    pub bytes: u64,
    /// How late frames were, in microseconds.
    pub lateness_us: Lateness,
    /// Frames that were left out, because a newer one had overtaken them.
    pub dropped: Vec<Dropped>,
    /// What was expected, and what came.
    pub expects: Vec<Expected>,
    /// Warnings of the script.
    pub warnings: Vec<Finding>,
}

/// What part of the script was asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Asked {
    /// A time or a mark, as it was written.
    pub from: Option<String>,
    /// A time or a mark, as it was written.
    pub to: Option<String>,
    /// 1 is as the script says.
    pub speed: f64,
    /// How many passes; `None` for a run without end.
    pub passes: Option<u64>,
}

/// How many frames.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Frames {
    /// Of the script, that the port took.
    pub sent: usize,
    /// Of the script, that were left out.
    pub dropped: usize,
    /// Beside the script: of stops, of `on abort`, behind a pause.
    pub extra: usize,
    /// That are not in `lateness_us` and `dropped`, because nobody could write them down in time.
    pub not_noted: u64,
}

/// How late, in microseconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Lateness {
    /// Half of the frames were no later.
    pub p50: f64,
    /// 99 of 100 were no later.
    pub p99: f64,
    /// The latest.
    pub max: f64,
    /// How late a frame leaves at the worst on a line of the speed of the script, however punctual the computer is.
    pub line: f64,
}

/// A frame that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct Dropped {
    /// When it was due, in the time of the script.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// What it would have said.
    pub command: String,
    /// Where in the script.
    pub file: String,
    /// Where in the script.
    pub line: usize,
}

/// An `expect` that was judged.
#[derive(Clone, Debug, Serialize)]
pub struct Expected {
    /// When it was due, in the time of the script.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// What was wanted.
    pub expect: String,
    /// What the script says why.
    pub why: Option<String>,
    /// What came.
    pub found: String,
    /// Whether it holds.
    pub passed: bool,
    /// Where in the script.
    pub file: String,
    /// Where in the script.
    pub line: usize,
}
