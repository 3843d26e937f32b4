//! Commands that may go somewhere over a time: which values they have, and the frame for each set of values.

use smallvec::SmallVec;

use super::ease::Ease;
use super::time::Time;
use super::value::round;
use crate::board::{Command, Ranged, ServoIndex};

/// Which command it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// `servo N`: one value.
    Servo(ServoIndex),
    /// `servos`: pan and tilt.
    Servos,
    /// `rocker`: x, y and z.
    Rocker,
    /// `yawhold`: x and y.
    YawHold,
    /// `wheels`: A, B, C and D.
    Wheels,
}

/// One value of such a command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Glide {
    /// Where it starts, if the script says so with `A -> B`.
    pub from: Option<f64>,
    /// Where it goes. In range when rounded.
    pub to: f64,
}

/// A command with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Which command.
    pub shape: Shape,
    /// Its values, as many as the shape has; most moves are those of one servo, and there may be a million.
    glides: SmallVec<[Glide; 1]>,
}

/// A command that goes somewhere over a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Move {
    /// The command and its values.
    pub motion: Motion,
    /// How long it takes; above zero.
    pub over: Time,
    /// How it gets there.
    pub ease: Ease,
}

impl Shape {
    /// What its values are called.
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Shape::Servo(_) => &["pulse width"],
            Shape::Servos => &["pan pulse width", "tilt pulse width"],
            Shape::Rocker => &["speed x", "speed y", "turning speed z"],
            Shape::YawHold => &["speed x", "speed y"],
            Shape::Wheels => &["speed of wheel A", "speed of wheel B", "speed of wheel C", "speed of wheel D"],
        }
    }

    /// The command with these values, rounded; the index of the first one that is out of range where there is one.
    pub fn command(self, values: &[f64]) -> Result<Command, usize> {
        let value = |at: usize| values.get(at).copied().unwrap_or(0.0);
        Ok(match self {
            Shape::Servo(index) => Command::Servo { index, pulse: ranged(value(0), 0)? },
            Shape::Servos => Command::Servos { pan: ranged(value(0), 0)?, tilt: ranged(value(1), 1)? },
            Shape::Rocker => {
                Command::Rocker { x: ranged(value(0), 0)?, y: ranged(value(1), 1)?, z: ranged(value(2), 2)? }
            }
            Shape::YawHold => Command::YawHold { x: ranged(value(0), 0)?, y: ranged(value(1), 1)? },
            Shape::Wheels => Command::Wheels([
                ranged(value(0), 0)?,
                ranged(value(1), 1)?,
                ranged(value(2), 2)?,
                ranged(value(3), 3)?,
            ]),
        })
    }
}

fn ranged<const MIN: i32, const MAX: i32>(value: f64, at: usize) -> Result<Ranged<MIN, MAX>, usize> {
    round(value).and_then(|value| Ranged::new(value).ok()).ok_or(at)
}

impl Motion {
    /// A command with these values.
    pub(super) fn new<const N: usize>(shape: Shape, values: [Glide; N]) -> Self {
        Motion { shape, glides: values.into_iter().collect() }
    }

    /// Its values, as many as the shape has.
    pub fn values(&self) -> &[Glide] {
        &self.glides
    }

    /// The command as a script says it, with a start before each value; one that is not known is taken for a usual one.
    pub fn with_starts(&self) -> String {
        let value = |glide: &Glide| {
            let usual = match self.shape {
                Shape::Servo(_) | Shape::Servos if glide.to < 1_500.0 => 2_000.0,
                Shape::Servo(_) | Shape::Servos => 1_000.0,
                _ => 0.0,
            };
            format!("{} -> {}", glide.from.unwrap_or(usual), glide.to)
        };
        let (word, axes): (String, &[&str]) = match self.shape {
            Shape::Servo(index) => (format!("servo {index}"), &[]),
            Shape::Servos => ("servos".into(), &[]),
            Shape::Rocker => ("rocker".into(), &["x=", "y=", "z="]),
            Shape::YawHold => ("yawhold".into(), &["x=", "y="]),
            Shape::Wheels => ("wheels".into(), &[]),
        };
        let axes = axes.iter().copied().chain(std::iter::repeat(""));
        let values = self.values().iter().zip(axes).map(|(glide, axis)| format!(" {axis}{}", value(glide)));
        std::iter::once(word).chain(values).collect()
    }

    /// Whether any value says where it starts.
    pub fn has_start(&self) -> bool {
        self.values().iter().any(|glide| glide.from.is_some())
    }

    /// The command that it arrives at.
    pub fn target(&self) -> Option<Command> {
        let targets: SmallVec<[f64; 4]> = self.glides.iter().map(|glide| glide.to).collect();
        self.shape.command(&targets).ok()
    }
}
