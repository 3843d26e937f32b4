//! [`Ast`] to [`Program`]: what words and numbers mean, and when each command starts.
//!
//! A program is flat: commands in the order of unrolling, each with its exact time and its place in the script. Ranges
//! and units are checked; what depends on the order in time (clashes, holding, refresh) belongs to the timeline.

mod arguments;
mod commands;
mod suggest;
mod time;
mod unroll;
mod value;

pub use commands::{COMMANDS, Row, SETTINGS};
pub use time::Time;
pub use value::{UNITS, Unit};

use crate::board;
use crate::diagnostic::Diagnostics;
use crate::source::Span;
use crate::syntax::Ast;

/// A script with every word understood.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// What stands before the commands.
    pub settings: Settings,
    /// Every command, in the order of unrolling; where times are equal, that order decides.
    pub steps: Vec<Step>,
    /// When the last statement has ended.
    pub end: Time,
    /// Whether all of these times are right, whatever else is wrong with the script.
    pub times_known: bool,
}

/// One command at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// When it starts, from the start of the script.
    pub at: Time,
    /// Where it stands in the script.
    pub span: Span,
    /// What it does.
    pub action: Action,
}

/// What a step does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Sends a command. With a time it holds for so long, and then ends: the drive stops, the buzzer goes off.
    Send(board::Command, Option<Time>),
    /// Shows a line of text.
    Say(String),
}

/// What stands before every command of a script.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Samples a second of a move, 1-200.
    pub rate: f64,
    /// How often a drive command is sent again while it holds, 10 ms - 1 s; `None` for never.
    pub refresh: Option<Time>,
    /// Speed of the line in bits a second.
    pub baud: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { rate: 50.0, refresh: Some(Time::from_millis(50)), baud: board::DEFAULT_BAUD }
    }
}

/// Gives every word its meaning and every command its time. What is wrong is reported and left out.
pub fn program(ast: &Ast<'_>, diagnostics: &mut Diagnostics) -> Program {
    unroll::unroll(ast, diagnostics)
}
