//! A program to a [`Timeline`]: what is sent when, flat and sorted, in whole microseconds.
//!
//! Here a move becomes samples, a hold refreshes and an end, and what the script leaves running closing frames. The order at
//! one time: commands and samples in script order, then refreshes, then closing frames.

mod clashes;
mod lints;
mod listing;
mod part;
mod schedule;
mod snapshot;
pub(crate) mod tween;
pub mod wire;

use std::sync::Arc;

use crate::board::{Board, Command, ResourceId};
use crate::diagnostic::Diagnostics;
use crate::program::{Action, Expect, Limit, Program, Step, Tempo, TraceId, Traces};
use crate::source::{Lines, Sources, Span};
use crate::units::Micros;

pub use listing::{write_bin, write_hex, write_jsonl, write_listing};
pub use part::{Part, check_passes, part, passes, state_after};
pub(crate) use snapshot::write_aborted;
pub use snapshot::{Moment, More, Snapshot, SnapshotError, is_snapshot, read_snapshot, write_snapshot};
pub use tween::Tween;

/// Everything that a script sends to a robot, and shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The board that it is for.
    pub board: Arc<Board>,
    /// Every frame, in the order of sending.
    pub events: Vec<Event>,
    /// The moves whose steps are among the events, in the order of their first steps.
    pub tweens: Vec<Tween>,
    /// What is sent when something ends a run early, after the stop; times count from there.
    pub abort: Vec<Event>,
    /// Lines to show, sorted by time.
    pub cues: Vec<Cue>,
    /// What the board should report, sorted by time.
    pub expects: Vec<Expectation>,
    /// Moments that have a name, sorted by time.
    pub marks: Vec<Mark>,
    /// Lines to show where something ended a run early.
    pub abort_cues: Vec<Cue>,
    /// When the script ends, from its start. Nothing is later.
    pub end: Micros,
    /// Speed of the line in bits a second.
    pub baud: u32,
    /// The calls and passes that led to each event.
    pub traces: Traces,
    /// Ranges that the script limits, and those that are limited where it says nothing.
    pub limits: Vec<Limit>,
    /// How fast each resource of the board is taken to go, in the unit of its value a second; `None` for at once.
    pub speeds: Vec<Option<u32>>,
    /// How the script counts in bars, if it does.
    pub bars: Option<Bars>,
}

/// Bars of one length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bars {
    /// The tempo and the meter at the top of the script.
    pub tempo: Tempo,
    /// When bar 1 begins, in microseconds from the start; before it for a part of a script.
    pub first_us: i64,
}

/// One frame at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When it is due, from the start of the script.
    pub at: Micros,
    /// What it says.
    pub command: Command,
    /// Where it comes from.
    pub kind: Kind,
    /// Whether it is a command of the script that takes no time: neither a step of a move nor the start or the end of a `for`.
    pub is_instant: bool,
    /// The command in the script that it belongs to.
    pub span: Span,
    /// The calls and passes that led to that command.
    pub trace: TraceId,
}

/// Where a frame comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// A command of the script, or the end of its `for`.
    Command,
    /// A step of a move.
    Sample,
    /// The last drive frame again, so that the board goes on driving.
    Refresh,
    /// Sent at the end for a script that leaves something running.
    Closing,
    /// Sent where something ends a run early.
    Abort,
    /// Sent at the start and at the end of a script that expects something: the board reports in between.
    Auto,
}

impl Kind {
    /// Every kind there is.
    pub const ALL: &[Kind] = &[Kind::Command, Kind::Sample, Kind::Refresh, Kind::Closing, Kind::Abort, Kind::Auto];

    /// The word that listings show; `None` for a plain command.
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

/// What the board should report, at its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// When it is judged, or from when on, from the start of the script.
    pub at: Micros,
    /// Until when a report may fit.
    pub until: Micros,
    /// What is wanted.
    pub expect: Expect,
    /// Where it stands in the script.
    pub span: Span,
    /// The calls and passes that led to it.
    pub trace: TraceId,
}

/// A moment that has a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Its name. A mark inside a `repeat` or a `def` is there once a pass.
    pub name: String,
    /// When it is, from the start of the script.
    pub at: Micros,
}

/// A line to show at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cue {
    /// When, from the start of the script.
    pub at: Micros,
    /// What is shown.
    pub text: String,
    /// Where it stands in the script.
    pub span: Span,
}

impl Timeline {
    /// What is sent, or what is sent where something ends a run early.
    pub fn frames(&self, aborts: bool) -> &[Event] {
        if aborts { &self.abort } else { &self.events }
    }

    /// An `expect` that failed, in words: what was wanted, what was found instead, and what the script says why.
    pub fn verdict_words(&self, expect: usize, found: &str) -> String {
        let Some(Expectation { expect, .. }) = self.expects.get(expect) else { return found.to_owned() };
        let why = expect.why.as_ref().map(|why| format!(" ({why})")).unwrap_or_default();
        format!("`expect {expect}` failed: {found}{why}")
    }

    /// Where an event comes from, in words: `dance.motion:14, nod, pass 3`.
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

/// How many calls and passes an origin names, the innermost first.
const SHOWN: usize = 4;

impl Event {
    /// The order of frames at one time: the start of reports, commands and samples, refreshes, closing frames, the end of
    /// reports.
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

/// Schedules a program that is in [`order`], with at most `events` frames, and reports what is wrong with the result.
pub(crate) fn timeline(program: Program, events: usize, diagnostics: &mut Diagnostics) -> Timeline {
    let timeline = schedule::schedule(program, events, diagnostics);
    wire::check(&timeline, diagnostics);
    lints::servo_speed(&timeline, diagnostics);
    timeline
}

/// Sorts a program by time, and reports clashes. The program may have other errors, but its times are right.
pub(crate) fn order(program: &mut Program, sources: &Sources, diagnostics: &mut Diagnostics) {
    let key = |step: &Step| (step.at.micros(), step.order);
    let sort = |steps: &mut [Step]| {
        // Most scripts are written in the order of time.
        if !steps.is_sorted_by_key(key) {
            steps.sort_unstable_by_key(key);
        }
    };
    sort(&mut program.steps);
    clashes::check(program, &program.steps, sources, diagnostics);
    if let Some(abort) = &mut program.abort {
        sort(&mut abort.steps);
    }
    if let Some(abort) = &program.abort {
        clashes::check(program, &abort.steps, sources, diagnostics);
    }
}

/// The resources that a step occupies.
fn occupied<'b>(board: &'b Board, action: &Action) -> &'b [ResourceId] {
    match action {
        Action::Say(_) | Action::Expect(_) => &[],
        Action::Send(command) => board.occupies(command),
        Action::Hold(held) => board.occupies(&held.0),
        Action::Go(going) => board.occupied(going.motion.verb, going.motion.index),
    }
}
