//! `limit`: ranges that a script narrows for itself.

use crate::board::{Command, PulseWidth, ServoIndex, Speed, TurnRate};
use crate::diagnostic::{Code, Diagnostic};
use crate::source::Span;

/// What is limited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limited {
    /// A servo's pulse width, alone or in `servos`.
    Servo(ServoIndex),
    /// An axis of `rocker`: 0 for x, 1 for y, 2 for z.
    Rocker(usize),
    /// An axis of `yawhold`: 0 for x, 1 for y.
    YawHold(usize),
    /// Every wheel.
    Wheels,
}

/// One narrowed range.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What is limited.
    pub limited: Limited,
    /// The smallest value allowed.
    pub low: f64,
    /// The largest value allowed.
    pub high: f64,
    /// Where the script says so.
    pub span: Span,
}

impl Limited {
    /// The range of the board, inside of which a limit lies.
    pub(super) fn board_range(self) -> (i32, i32) {
        match self {
            Limited::Servo(_) => (PulseWidth::MIN, PulseWidth::MAX),
            Limited::Rocker(2) => (TurnRate::MIN, TurnRate::MAX),
            _ => (Speed::MIN, Speed::MAX),
        }
    }

    /// The values of a command that are limited by this.
    fn values(self, command: &Command) -> [Option<i32>; 4] {
        let one = |value| [Some(value), None, None, None];
        match (self, command) {
            (Limited::Servo(limited), Command::Servo { index, pulse }) if limited == *index => one(pulse.get()),
            (Limited::Servo(limited), Command::Servos { pan, tilt }) => match limited.get() {
                1 => one(pan.get()),
                2 => one(tilt.get()),
                _ => [None; 4],
            },
            (Limited::Rocker(axis), Command::Rocker { x, y, z }) => {
                [x.get(), y.get(), z.get()].get(axis).map_or([None; 4], |value| one(*value))
            }
            (Limited::YawHold(axis), Command::YawHold { x, y }) => {
                [x.get(), y.get()].get(axis).map_or([None; 4], |value| one(*value))
            }
            (Limited::Wheels, Command::Wheels(wheels)) => wheels.map(|wheel| Some(wheel.get())),
            _ => [None; 4],
        }
    }
}

/// The first limit that a command breaks, with the value that does.
pub fn broken<'l>(limits: &'l [Limit], command: &Command) -> Option<(&'l Limit, i32)> {
    limits.iter().find_map(|limit| {
        let outside = |value: &i32| f64::from(*value) < limit.low || f64::from(*value) > limit.high;
        limit.limited.values(command).into_iter().flatten().find(outside).map(|value| (limit, value))
    })
}

/// Says that a command breaks a limit.
pub fn diagnostic(limit: &Limit, value: i32, span: Span) -> Diagnostic {
    let (low, high) = (limit.low, limit.high);
    Diagnostic::new(
        Code::Limit,
        span,
        format!("this sends {value}, and the script limits it to {low}..{high}"),
        "stay inside, or widen the limit",
    )
    .label("outside the limit")
    .related(limit.span, "limited here")
}
