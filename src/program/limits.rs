//! `limit`: ranges that a script sets for itself, and those that hold where it sets none.

use std::fmt;

use crate::board::{Command, PulseWidth, ServoIndex, Speed, TiltPulseWidth, TurnRate};
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

/// One limited range.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What is limited.
    pub limited: Limited,
    /// The smallest value allowed.
    pub low: f64,
    /// The largest value allowed.
    pub high: f64,
    /// Where the script says so; `None` for a limit that holds because the script sets no other.
    pub span: Option<Span>,
}

impl Limit {
    /// The limits of a script that sets none: servo 2 is usually the tilt servo, which a higher value damages.
    pub fn defaults() -> Vec<Limit> {
        let (low, high) = (f64::from(TiltPulseWidth::MIN), f64::from(TiltPulseWidth::MAX));
        let tilt = ServoIndex::new(2).ok().map(Limited::Servo);
        tilt.map(|limited| Limit { limited, low, high, span: None }).into_iter().collect()
    }
}

/// What a script calls it.
impl fmt::Display for Limited {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |axis: &usize| ["x", "y", "z"].get(*axis).copied().unwrap_or_default();
        match self {
            Limited::Servo(index) => write!(f, "servo {index}"),
            Limited::Rocker(at) => write!(f, "rocker {}", axis(at)),
            Limited::YawHold(at) => write!(f, "yawhold {}", axis(at)),
            Limited::Wheels => f.write_str("wheels"),
        }
    }
}

/// The line that sets it.
impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "limit {} {}..{}", self.limited, self.low, self.high)
    }
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

/// Says that a command breaks a limit, and how to widen it.
pub fn diagnostic(limit: &Limit, value: i32, span: Span) -> Diagnostic {
    let Limit { limited, low, high, .. } = *limit;
    let Some(set) = limit.span else {
        let (_, most) = limited.board_range();
        let wide = Limit { high: f64::from(most), ..limit.clone() };
        let message =
            format!("{limited} is limited to {low}..{high}, and this sends {value}: a tilt servo is damaged there");
        let help = format!("stay at or below {high}, or, if it is not a tilt servo, widen the limit: `{wide}`");
        return Diagnostic::new(Code::Limit, span, message, help).label("outside the limit");
    };
    let wide = Limit { low: low.min(value.into()), high: high.max(value.into()), ..limit.clone() };
    let message = format!("this sends {value}, and the script limits it to {low}..{high}");
    Diagnostic::new(Code::Limit, span, message, format!("stay inside, or widen the limit: `{wide}`"))
        .label("outside the limit")
        .related(set, "limited here")
}
