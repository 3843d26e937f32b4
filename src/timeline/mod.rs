//! [`Program`] to [`Timeline`]: what is sent when, flat and sorted, in whole microseconds.
//!
//! Here a hold becomes refreshes and an end, and what the script leaves running becomes closing frames. The order at one
//! time: commands in script order, then refreshes, then closing frames.

mod lay;
mod listing;
mod order;

use crate::board::{self, Command};
use crate::diagnostic::Diagnostics;
use crate::program::Program;
use crate::source::Span;

pub use listing::{Seconds, write_bin, write_hex, write_listing};

/// Everything that a script sends and shows, for every robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// One track a robot. A script that names no robots has one track without a name.
    pub tracks: Vec<Track>,
    /// Lines to show, sorted by time.
    pub cues: Vec<Cue>,
    /// When the script ends, in microseconds from its start. Nothing is later.
    pub end_us: u64,
    /// Speed of the line in bits a second.
    pub baud: u32,
}

/// What one robot is sent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Track {
    /// The robot's name; `None` where the script names no robots.
    pub robot: Option<String>,
    /// Every frame, in the order of sending.
    pub events: Vec<Event>,
}

/// One frame at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When it is due, in microseconds from the start of the script.
    pub at_us: u64,
    /// What it says.
    pub command: Command,
    /// Where it comes from.
    pub kind: Kind,
    /// The command in the script that it belongs to.
    pub span: Span,
}

/// Where a frame comes from. The order is that of frames at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A command of the script, or the end of its `for`.
    Command,
    /// The last drive frame again, so that the board goes on driving.
    Refresh,
    /// Sent at the end for a script that leaves something running.
    Closing,
}

impl Kind {
    /// The word that listings show; `None` for a plain command.
    pub fn word(self) -> Option<&'static str> {
        match self {
            Kind::Command => None,
            Kind::Refresh => Some("refresh"),
            Kind::Closing => Some("closing"),
        }
    }
}

/// A line to show at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cue {
    /// When, in microseconds from the start of the script.
    pub at_us: u64,
    /// What is shown.
    pub text: String,
    /// Where it stands in the script.
    pub span: Span,
}

/// What a timeline may grow to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The most frames a robot.
    pub events: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { events: 10_000_000 }
    }
}

impl Timeline {
    /// The only track, while scripts have one.
    pub fn events(&self) -> &[Event] {
        self.tracks.first().map(|track| track.events.as_slice()).unwrap_or_default()
    }
}

impl Event {
    /// Appends the bytes of its frame.
    pub fn encode(&self, out: &mut Vec<u8>) {
        self.command.encode(out);
    }
}

/// Lays a program out in time. Clashes and what else is wrong in the order of time is reported.
pub fn timeline(program: Program, limits: Limits, diagnostics: &mut Diagnostics) -> Timeline {
    order::check(&program.steps, diagnostics);
    lay::lay(program, limits, diagnostics)
}

/// Only looks for what is wrong in the order of time, for a program that has other errors but whose times are right.
pub fn order(program: &Program, diagnostics: &mut Diagnostics) {
    order::check(&program.steps, diagnostics);
}

/// The things of a robot that do one thing at a time.
const THINGS: usize = 6;

/// The indices of the things that a command occupies: the drive, the buzzer, four servos. A raw frame occupies none.
fn things(command: &Command) -> impl Iterator<Item = usize> {
    let (first, second) = match command {
        Command::Raw { .. } | Command::Pid(..) | Command::Request(_) => (None, None),
        Command::Buzzer(_) => (Some(1), None),
        Command::Servo { index, .. } => (usize::try_from(index.get()).ok().map(|index| index + 1), None),
        Command::Servos { .. } => (Some(2), Some(3)),
        _ => (Some(0), None),
    };
    first.into_iter().chain(second)
}

/// What one of [`things`] is called.
fn thing_name(thing: usize) -> String {
    match thing {
        0 => "the drive".into(),
        1 => "the buzzer".into(),
        servo => format!("servo {}", servo - 1),
    }
}

/// What ends a hold of this command: the stop for the drive, off for the buzzer.
fn ending(command: &Command) -> Command {
    match command {
        Command::Buzzer(_) => Command::Buzzer(false),
        _ => board::Command::STOP,
    }
}
