//! Compiles a program to a [`Timeline`]: which frame is sent when, sorted, in whole microseconds.
//!
//! This stage converts moves to samples, adds refreshes and ends of holds, and closing frames for
//! what the script leaves running. Frames at the same time are ordered: commands and samples in
//! script order, then refreshes, then closing frames.

mod clashes;
mod clip;
mod gates;
mod greetings;
mod lints;
mod listing;
mod notes;
mod schedule;
mod servos;
mod snapshot;
pub(crate) mod tween;
pub mod wire;

use std::sync::Arc;

use crate::board::{Board, Command, ResourceId};
use crate::diagnostic::Diagnostics;
use crate::program::{Action, Expect, Limit, Program, SayText, Step, Tempo, TraceId, Traces};
use crate::source::{Lines, Sources, Span};
use crate::units::Micros;

pub use clip::{Clip, check_passes, clip, clips, passes, state_after};
pub use gates::{Cut, Gate, Position};
pub(crate) use listing::robot_of;
pub use listing::{Item, write_bin, write_hex, write_jsonl, write_listing, write_listings, write_robot};
pub use notes::{Note, NoteKind, gate_notes};
pub(crate) use snapshot::write_aborted;
pub use snapshot::{
    Moment, More, NamedBoard, Snapshot, SnapshotError, is_snapshot, read_snapshot, read_snapshots, write_snapshot,
};
pub use tween::Tween;

/// Everything that a script sends to a robot and shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The name of the robot, if the script names its robots.
    pub robot: Option<Arc<str>>,
    /// The board.
    pub board: Arc<Board>,
    /// Every frame, in the order of sending.
    pub events: Vec<Event>,
    /// The moves whose steps are events, in the order of their first steps.
    pub tweens: Vec<Tween>,
    /// Sent after the stop if something ends a run early; times count from the stop.
    pub abort: Vec<Event>,
    /// Lines to show, sorted by time.
    pub cues: Vec<Cue>,
    /// What the board is expected to report, sorted by time.
    pub expects: Vec<Expectation>,
    /// Named moments, sorted by time. All robots of a script have the same.
    pub marks: Arc<[Mark]>,
    /// Where the clock of the script stops, in order.
    pub gates: Vec<Gate>,
    /// Lines to show after something ended a run early.
    pub abort_cues: Vec<Cue>,
    /// The end of the script, from its start. Nothing is later.
    pub end: Micros,
    /// The speed of the line in bits per second.
    pub baud: u32,
    /// How long the servos take from where they are to their first positions, before time 0; `None`
    /// for no soft start.
    pub soft: Option<Micros>,
    /// How often the command of each resource is sent again while it holds, also at a closed gate;
    /// `None` for never.
    pub refresh: Vec<Option<Micros>>,
    /// The calls and passes that led to each event, of all robots.
    pub traces: Arc<Traces>,
    /// The limits that the script sets, and the default limits.
    pub limits: Vec<Limit>,
    /// The assumed speed of each resource, in the unit of its value per second; `None` for
    /// immediate changes.
    pub speeds: Vec<Option<u32>>,
    /// The bars of the script, if it counts in bars.
    pub bars: Option<Bars>,
}

/// A grid of equal bars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bars {
    /// The tempo and the meter at the top of the script.
    pub tempo: Tempo,
    /// The start of bar 1, in microseconds from the start; negative for a clip that starts later.
    pub first_us: i64,
}

/// One frame at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When it is due, from the start of the script.
    pub at: Micros,
    /// The command.
    pub command: Command,
    /// The origin of the frame.
    pub kind: Kind,
    /// Whether it is a command without duration: neither a step of a move nor the start or end of a
    /// `for`.
    pub is_instant: bool,
    /// The place of its command in the script.
    pub span: Span,
    /// The calls and passes that led to that command.
    pub trace: TraceId,
}

/// The origin of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// A command of the script, or the end of its `for`.
    Command,
    /// A step of a move.
    Sample,
    /// The last drive frame, repeated so that the board keeps driving.
    Refresh,
    /// Sent at the end if a script leaves something running.
    Closing,
    /// Sent if something ends a run early.
    Abort,
    /// Sent automatically: requests that start and stop reports, and the lead-in of a clip.
    Auto,
}

impl Kind {
    /// All kinds.
    pub const ALL: &[Kind] = &[Kind::Command, Kind::Sample, Kind::Refresh, Kind::Closing, Kind::Abort, Kind::Auto];

    /// The word in listings; `None` for a plain command.
    pub fn word(self) -> Option<&'static str> {
        match self {
            Kind::Command => None,
            Kind::Sample => Some("sample"),
            Kind::Refresh => Some("refresh"),
            Kind::Closing => Some("closing"),
            Kind::Abort => Some("abort"),
            Kind::Auto => Some("auto"),
        }
    }
}

/// What the board is expected to report, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// When it is evaluated, or from when on, from the start of the script.
    pub at: Micros,
    /// The last time of a matching report.
    pub until: Micros,
    /// The expectation.
    pub expect: Expect,
    /// Its place in the script.
    pub span: Span,
    /// The calls and passes that led to it.
    pub trace: TraceId,
}

/// A named moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Its name. A mark inside a `repeat` or a `def` occurs once per pass.
    pub name: String,
    /// The time from the start of the script.
    pub at: Micros,
    /// The number of gates before it.
    pub gates: usize,
    /// Its place in the script.
    pub span: Span,
}

/// A line to show at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cue {
    /// The time from the start of the script.
    pub at: Micros,
    /// The text to show.
    pub text: SayText,
    /// Its place in the script.
    pub span: Span,
}

impl Timeline {
    /// The name of the robot, if the script names its robots, and its board.
    pub fn named_board(&self) -> NamedBoard {
        (self.robot.clone(), Arc::clone(&self.board))
    }

    /// `left: `, with which lines about this robot begin; empty if the script names no robots.
    pub fn prefix(&self) -> String {
        self.robot.as_ref().map(|robot| format!("{robot}: ")).unwrap_or_default()
    }

    /// The frames of the run, or those that are sent if something ends it early.
    pub fn frames(&self, aborts: bool) -> &[Event] {
        if aborts { &self.abort } else { &self.events }
    }

    /// Describes a failed `expect`: what was expected, what was found, and the reason given in the
    /// script.
    pub fn verdict_words(&self, expect: usize, found: &str) -> String {
        let Some(Expectation { expect, .. }) = self.expects.get(expect) else { return found.to_owned() };
        failure(&format!("expect {expect}"), found, expect.why.as_deref())
    }

    /// Describes a gate that ended a run: what it waited for, what was found, and the reason given in
    /// the script.
    pub fn gate_words(&self, gate: usize, found: impl Fn(&str) -> String) -> String {
        let Some(Gate { gate, .. }) = self.gates.get(gate) else { return found("") };
        failure(&gate.without_text().to_string(), &found(gate.unit()), gate.text.as_deref())
    }

    /// Describes where an event comes from: `dance.motion:14, nod, pass 3`.
    pub fn origin(&self, event: &Event, sources: &Sources, lines: &Lines<'_>) -> String {
        let way = self.traces.chain(event.trace).take(SHOWN).map(|(span, pass)| match pass {
            0 => {
                let call = sources.file(span).slice(span);
                call.split('(').next().unwrap_or(call).trim().to_owned()
            }
            pass => format!("pass {pass}"),
        });
        std::iter::once(lines.place(event.span).to_string()).chain(way).collect::<Vec<_>>().join(", ")
    }
}

fn failure(line: &str, found: &str, why: Option<&str>) -> String {
    let why = why.map(|why| format!(" ({why})")).unwrap_or_default();
    format!("`{line}` failed: {found}{why}")
}

/// The maximum number of calls and passes in an origin, the innermost first.
const SHOWN: usize = 4;

impl Event {
    /// The rank of frames at the same time, after the hello of the board: the start of reports, commands
    /// and samples, refreshes, closing frames, the end of reports and the goodbye.
    pub fn rank(&self, board: &Board) -> u8 {
        match self.kind {
            Kind::Auto if board.reporting.as_ref().is_some_and(|[start, _]| self.command == *start) => 0,
            Kind::Command | Kind::Sample | Kind::Abort => 1,
            Kind::Refresh => 2,
            Kind::Closing => 3,
            Kind::Auto => 4,
        }
    }
}

/// Schedules programs that [`order`] has sorted, one for each robot, with at most `events` frames
/// each, and reports errors in the result.
pub(crate) fn timelines(programs: Vec<Program>, events: usize, diagnostics: &mut Diagnostics) -> Vec<Timeline> {
    let mut timelines: Vec<Timeline> = Vec::with_capacity(programs.len());
    for program in programs {
        diagnostics.about(program.robot.as_ref());
        let marks = timelines.first().map(|first| &first.marks);
        let timeline = schedule::schedule(program, marks, events, diagnostics);
        wire::check(&timeline, diagnostics);
        lints::servo_speed::check(&timeline, diagnostics);
        timelines.push(timeline);
    }
    diagnostics.about(None);
    timelines
}

/// Sorts a program by time and reports clashes. The program may have other errors, but its times
/// are right.
pub(crate) fn order(program: &mut Program, sources: &Sources, diagnostics: &mut Diagnostics) {
    diagnostics.about(program.robot.as_ref());
    // One step may have become several, for several parts.
    let index = |step: &Step| if let Action::Send(command) = &step.action { command.value(0) } else { None };
    let key = |step: &Step| (step.at.micros(), step.order, index(step));
    let sort = |steps: &mut [Step]| {
        // Most scripts are already in the order of time.
        if !steps.is_sorted_by_key(key) {
            steps.sort_unstable_by_key(key);
        }
    };
    sort(&mut program.steps);
    clashes::check(program, &program.steps, sources, diagnostics);
    if program.has_gates {
        gates::check(program, diagnostics);
    }
    if let Some(abort) = &mut program.abort {
        sort(&mut abort.steps);
    }
    if let Some(abort) = &program.abort {
        clashes::check(program, &abort.steps, sources, diagnostics);
    }
    diagnostics.about(None);
}

/// The resources that a step occupies.
#[inline]
fn occupied<'b>(board: &'b Board, action: &Action) -> &'b [ResourceId] {
    match action {
        Action::Say(_) | Action::Expect(_) | Action::Gate(_) => &[],
        Action::Send(command) => board.occupies(command),
        Action::Hold(held) => board.occupies(&held.0),
        Action::Go(going) => board.occupied(going.motion.verb, going.motion.index),
    }
}
