//! The lines of a script to a program: what words and numbers mean, and when each command starts.
//!
//! A program is flat: commands in the order of unrolling, each with its exact time and its place in the script. Ranges
//! and units are checked; what depends on the order in time (clashes, holding, refresh) belongs to the timeline.

mod arguments;
mod bounds;
mod calls;
mod cost;
mod duration;
mod ease;
mod evaluator;
mod every;
mod expect;
mod functions;
mod gate;
mod joint_setting;
mod joints;
mod limits;
mod lints;
mod motion;
mod names;
mod pending;
mod project_limits;
mod robots;
mod say;
mod scope;
mod settings;
mod suggest;
mod template;
mod tempo;
mod time;
mod trace;
mod unknown_words;
mod value;
mod verbs;
mod walker;
mod words;

pub use ease::{CURVES, Curve, Ease};
pub use expect::{Condition, Criterion, Expect, Measured};
pub use functions::{FUNCTIONS, Function};
pub use gate::{Awaited, Gate};
pub use limits::Limit;
pub(crate) use limits::{broken as broken_limit, of_pictures as limits_of_pictures};
pub(crate) use motion::{Motion, Move};
pub use project_limits::{ProjectLimit, limit_items};
pub use say::SayText;
pub use settings::SOFT_START;
pub use suggest::{list, suggest};
pub use tempo::Tempo;
pub use time::Time;
pub use trace::{TraceId, Traces};
pub use words::{COMMANDS, Row, SETTINGS, Signature, name_from, signatures};

use std::sync::Arc;

use joints::Joint;

use crate::board::{self, Board};
use crate::diagnostic::Diagnostics;
use crate::source::{Source, Sources, Span};
use crate::syntax::{self, Reading};
use crate::units::Micros;

/// The most lines and passes that are unrolled.
pub(crate) const MAX_STEPS: u64 = 100_000_000;

/// What a script is compiled with from outside.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// The most frames a robot.
    pub events: usize,
    /// Values that replace those of top-level `let`s of the main script: names and values, as a script would write them.
    pub set: Vec<(String, String)>,
    /// How fast it runs.
    pub speed: Speed,
    /// The board of a script that has no `board` line.
    pub board: Arc<Board>,
    /// Ranges that no command may leave, whatever the script says. They reject a script, and never change what it sends.
    pub limits: Vec<ProjectLimit>,
}

impl Options {
    /// The same with another board for scripts that have no `board` line.
    #[must_use]
    pub fn with_board(self, board: Arc<Board>) -> Self {
        Options { board, ..self }
    }

    /// The same with another limit of frames.
    #[must_use]
    pub fn with_events(self, events: usize) -> Self {
        Options { events, ..self }
    }

    /// The same with the limits of a project.
    #[must_use]
    pub fn with_limits(self, limits: Vec<ProjectLimit>) -> Self {
        Options { limits, ..self }
    }

    /// The same at another speed.
    #[must_use]
    pub fn with_speed(self, speed: Speed) -> Self {
        Options { speed, ..self }
    }

    /// The same with values that replace those of top-level `let`s: names and values, as a script would write them.
    #[must_use]
    pub fn with_set(self, set: Vec<(String, String)>) -> Self {
        Options { set, ..self }
    }
}

/// How fast a script runs, from a tenth to ten times as fast, in thousandths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Speed(u32);

impl Speed {
    /// As the script says.
    pub const NORMAL: Speed = Speed(1_000);

    /// Of a decimal number from 0.1 to 10 with at most three digits after its point.
    pub fn of(text: &str) -> Option<Speed> {
        let (whole, part) = text.split_once('.').unwrap_or((text, "0"));
        let is_number = |text: &str| (1..=3).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
        if !is_number(whole) || !is_number(part) {
            return None;
        }
        let thousandths = whole.parse::<u32>().ok()? * 1_000 + format!("{part:0<3}").parse::<u32>().ok()?;
        (100..=10_000).contains(&thousandths).then_some(Speed(thousandths))
    }

    /// A time of the script as it takes at this speed.
    pub fn time(self, time: Time) -> Time {
        if self == Speed::NORMAL { time } else { time.scaled(1_000, i64::from(self.0)).unwrap_or(time) }
    }
}

impl Speed {
    /// It as a number, from 0.1 to 10.
    pub fn factor(self) -> f64 {
        f64::from(self.0) / 1_000.0
    }

    /// A time of a run at this speed as the time of the script, cut off.
    pub fn of_script(self, at: Micros) -> Micros {
        Micros(u64::try_from(u128::from(at.0) * u128::from(self.0) / 1_000).unwrap_or(u64::MAX))
    }
}

impl Default for Options {
    fn default() -> Self {
        Options {
            events: 10_000_000,
            set: Vec::new(),
            speed: Speed::NORMAL,
            board: board::raspblock::board(),
            limits: Vec::new(),
        }
    }
}

/// What one robot does in a script with every word understood.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Program {
    /// The name of its robot, if the script names its robots.
    pub robot: Option<Arc<str>>,
    /// The board that it is for.
    pub board: Arc<Board>,
    /// Its settings.
    pub settings: Settings,
    /// Every command, in the order of unrolling; where times are equal, that order decides.
    pub steps: Vec<Step>,
    /// When the last statement has ended.
    pub end: Time,
    /// What is sent when something ends a run early.
    pub abort: Option<Abort>,
    /// Moments that have a name. All robots share those of the first.
    pub marks: Vec<Mark>,
    /// Whether any step is a gate.
    pub has_gates: bool,
    /// The calls and passes that led to each step. All robots share them.
    pub traces: Arc<Traces>,
    /// Whether all of these times are right, even if the script has other errors.
    pub times_known: bool,
}

/// A named moment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mark {
    /// Its name.
    pub name: String,
    /// The time from the start of the script.
    pub at: Time,
    /// Its place in the script.
    pub span: Span,
    /// Its place in the order of unrolling: that of the next step.
    pub order: u32,
}

/// `on abort`: a small program of its own, which starts with nothing known.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Abort {
    /// Its commands; none of them is for the drive.
    pub steps: Vec<Step>,
    /// When it has ended, from its own start; at most 2 s.
    pub end: Time,
}

/// One command at its time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Step {
    /// When it starts, from the start of the script.
    pub at: Time,
    /// Its place in the script.
    pub span: Span,
    /// The calls and passes that led to it.
    pub trace: TraceId,
    /// Its place in the order of unrolling, which decides where times are equal.
    pub order: u32,
    /// What it does.
    pub action: Action,
}

/// What a step does.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub(crate) enum Action {
    /// Sends a command.
    Send(board::Command),
    /// Sends a command that holds for this time, and then ends: the drive stops, the buzzer is turned off.
    Hold(Box<(board::Command, Time)>),
    /// Goes somewhere over a time.
    Go(Box<Move>),
    /// Shows a line of text.
    Say(Box<SayText>),
    /// Judges what the board reports.
    Expect(Box<Expect>),
    /// Stops the clock until something happens.
    Gate(Box<Gate>),
}

/// The settings of a script.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    /// Time between two samples of a move: 1/200 s to 1 s.
    pub period: Time,
    /// How often the command of each resource is sent again while it holds, 10 ms - 1 s; `None` for never.
    pub refresh: Vec<Option<Time>>,
    /// Speed of the line in bits a second.
    pub baud: u32,
    /// How long a beat and a bar are.
    pub tempo: Tempo,
    /// Whether the script sets it.
    pub has_tempo: bool,
    /// Which random numbers there are.
    pub seed: u64,
    /// How long a soft start takes; `None` for no soft start.
    pub soft: Option<Micros>,
    /// Ranges that the script limits, and those that are limited where it says nothing.
    pub limits: Vec<Limit>,
    /// Servos with names.
    pub joints: Vec<Joint>,
    /// Ranges that the project limits, and where.
    pub project_limits: Vec<(Limit, String)>,
    /// How fast each resource of the board is taken to go, in the unit of its value a second; `None` for at once.
    pub speeds: Vec<Option<u32>>,
}

/// The fastest that a script can say a servo is, in µs of pulse width a second.
pub const MAX_SERVO_SPEED: u64 = 100_000;

impl Settings {
    /// What holds where a script says nothing.
    pub(crate) fn of(options: &Options, board: &Board) -> Self {
        Settings {
            period: Time::from_millis(20),
            refresh: board.resources.iter().map(|resource| resource.refresh.map(Time::from_micros)).collect(),
            baud: board.baud,
            tempo: Tempo::default(),
            has_tempo: false,
            seed: 0,
            soft: board.feedback.as_ref().and_then(|feedback| Some(feedback.preparation.as_ref()?.soft)),
            limits: Limit::proper(board),
            joints: Vec::new(),
            project_limits: options.limits.iter().filter_map(|limit| limit.on(board)).collect(),
            speeds: board.resources.iter().map(|resource| resource.speed).collect(),
        }
    }
}

impl Program {
    /// The same at another speed: commands, moves and holds. Refreshes and the steps of moves stay in real time, and so
    /// does `on abort`.
    #[must_use]
    pub(crate) fn at_speed(mut self, speed: Speed) -> Self {
        if speed == Speed::NORMAL {
            return self;
        }
        for step in &mut self.steps {
            step.at = speed.time(step.at);
            match &mut step.action {
                Action::Hold(held) => held.1 = speed.time(held.1),
                Action::Go(going) => going.over = speed.time(going.over),
                Action::Expect(expect) => expect.within = expect.within.map(|within| speed.time(within)),
                // A gate waits in real time.
                Action::Send(_) | Action::Say(_) | Action::Gate(_) => {}
            }
        }
        for mark in &mut self.marks {
            mark.at = speed.time(mark.at);
        }
        self.end = speed.time(self.end);
        self.settings.tempo = self.settings.tempo.at_speed(speed);
        self
    }
}

/// Reads the file of a text board. `name` is its path as a script writes it. `None` if the file is wrong, which is reported.
pub fn text_board(source: &Source, name: &str, diagnostics: &mut Diagnostics) -> Option<Arc<Board>> {
    board::text::read(source, name, &words::is_of_language, diagnostics).map(Arc::new)
}

/// Gives every word its meaning and every command its time; returns one program for each robot. What is wrong is reported and left
/// out. The tree of each line is dropped as soon as it is run.
pub(crate) fn programs<'s>(
    script: Reading<'s>,
    sources: &'s Sources,
    options: &Options,
    diagnostics: &mut Diagnostics,
) -> Vec<Program> {
    syntax::read_ahead(script, |lines| {
        let mut programs = walker::walk(lines, sources, options, diagnostics);
        for program in &mut programs {
            every::expand(program, options.events, diagnostics);
        }
        programs
    })
}
