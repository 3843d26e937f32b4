//! What a script that is being written has said so far.

use super::curve::{Axes, Room};
use crate::board::{Command, Mode, PulseWidth, Speed, TiltPulseWidth, TurnRate};

/// How far a folded move of a servo may be from what it was held at, at any time, in microseconds of pulse width. A move has a sample every
/// 20 ms, and may be so much earlier or later than the program.
pub const SERVO_TOLERANCE: i32 = 5;
/// The same of the drive, in its unit.
pub const DRIVE_TOLERANCE: i32 = 1;

/// What the script has said so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    /// Pulse width of each servo.
    servos: [Option<Told<i32>>; 4],
    drive: Option<Told<Axes>>,
    /// When the drive was fed last, if it is on.
    pub(super) fed_us: Option<u64>,
    pub(super) buzzer: Option<bool>,
    pub(super) mode: Option<Mode>,
    /// A `raw` is in the script, so that it ends with a stop and a buzzer off of its own.
    pub(super) has_raw: bool,
}

/// A value that was told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told<V> {
    value: V,
    by: Thing,
    /// When the line that says it is due, and when it came last, perhaps again; in microseconds.
    said_us: u64,
    came_us: u64,
}

impl<V> Told<V> {
    /// From when on a move of this thing may begin here. Its own repeats are looked at, those of another command are not.
    fn since(&self, thing: Thing) -> u64 {
        if self.by == thing { self.said_us } else { self.came_us }
    }
}

impl Known {
    /// The value of a thing, and from when on a move may begin there.
    pub(super) fn value(&self, thing: Thing) -> Option<(u64, Axes)> {
        let [pan, tilt, ..] = self.servos;
        match thing {
            Thing::Servo(index) => {
                let index = usize::try_from(index).ok()?.checked_sub(1)?;
                self.servos.get(index).copied().flatten().map(|told| (told.since(thing), [told.value, 0, 0, 0]))
            }
            Thing::Servos => {
                let since_us = |told: Told<i32>| told.since(thing);
                pan.zip(tilt).map(|(pan, tilt)| (since_us(pan).max(since_us(tilt)), [pan.value, tilt.value, 0, 0]))
            }
            // A stop is zero for every drive command. Wheels or a yaw hold at zero are not a stop.
            _ => {
                let is_stop = |told: &Told<Axes>| told.by == Thing::Rocker && told.value == [0; 4];
                let told = self.drive.filter(|told| told.by == thing || is_stop(told))?;
                Some((told.since(thing), told.value))
            }
        }
    }

    /// Whether a value says nothing new. A yaw hold after a stop is new, also at zero.
    pub(super) fn repeats(&self, thing: Thing, axes: Axes) -> bool {
        let is_new = thing == Thing::YawHold && self.drive.is_none_or(|told| told.by != thing);
        !is_new && self.value(thing).is_some_and(|(_, said)| said == axes)
    }

    /// Takes in a value. What says nothing new is no line.
    pub(super) fn set(&mut self, at_us: u64, thing: Thing, axes: Axes) {
        if thing.is_drive() {
            self.fed_us = (thing == Thing::YawHold || axes != [0; 4]).then_some(at_us);
        }
        let repeats = self.repeats(thing, axes);
        let told = |old: Option<Told<_>>, value| match old {
            Some(old) if repeats => Some(Told { came_us: at_us, ..old }),
            _ => Some(Told { value, by: thing, said_us: at_us, came_us: at_us }),
        };
        let [pan, tilt, ..] = axes;
        let [first, second, third, fourth] = &mut self.servos;
        match thing {
            Thing::Servo(1) => *first = told(*first, pan),
            Thing::Servo(2) => *second = told(*second, pan),
            Thing::Servo(3) => *third = told(*third, pan),
            Thing::Servo(_) => *fourth = told(*fourth, pan),
            Thing::Servos => (*first, *second) = (told(*first, pan), told(*second, tilt)),
            _ => {
                self.drive = match self.drive {
                    Some(old) if repeats => Some(Told { came_us: at_us, ..old }),
                    _ => Some(Told { value: axes, by: thing, said_us: at_us, came_us: at_us }),
                }
            }
        }
    }

    /// What is not interpreted may have changed anything.
    pub(super) fn raw(&mut self, raw: &Command) {
        self.has_raw = true;
        self.servos = [None; 4];
        self.buzzer = None;
        if raw.is_drive() {
            self.forget_drive();
        }
    }

    pub(super) fn forget_drive(&mut self) {
        (self.drive, self.fed_us) = (None, None);
    }
}

/// What can move, by the command that moves it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Thing {
    Servo(i32),
    Servos,
    Rocker,
    Wheels,
    YawHold,
}

impl Thing {
    /// What a command moves, and where to.
    pub(super) fn of(command: &Command) -> Option<(Thing, Axes)> {
        Some(match command {
            Command::Servo { index, pulse } => (Thing::Servo(index.get()), [pulse.get(), 0, 0, 0]),
            Command::Servos { pan, tilt } => (Thing::Servos, [pan.get(), tilt.get(), 0, 0]),
            Command::Rocker { x, y, z } => (Thing::Rocker, [x.get(), y.get(), z.get(), 0]),
            Command::Wheels(wheels) => (Thing::Wheels, wheels.map(Speed::get)),
            Command::YawHold { x, y } => (Thing::YawHold, [x.get(), y.get(), 0, 0]),
            _ => return None,
        })
    }

    /// What it may be given; servo 2 more where the script widens its limit.
    pub(super) fn room(self, is_tilt_wide: bool) -> Room {
        let (speed, still) = ((Speed::MIN, Speed::MAX), (0, 0));
        let pulse = (PulseWidth::MIN, PulseWidth::MAX);
        match self {
            Thing::Servo(2) if !is_tilt_wide => Room {
                ranges: [(TiltPulseWidth::MIN, TiltPulseWidth::MAX), still, still, still],
                tolerance: SERVO_TOLERANCE,
                is_scarce: false,
            },
            Thing::Servo(_) => {
                Room { ranges: [pulse, still, still, still], tolerance: SERVO_TOLERANCE, is_scarce: false }
            }
            Thing::Servos => Room {
                ranges: [pulse, (TiltPulseWidth::MIN, TiltPulseWidth::MAX), still, still],
                tolerance: SERVO_TOLERANCE,
                is_scarce: false,
            },
            Thing::Rocker => {
                let turn = (TurnRate::MIN, TurnRate::MAX);
                Room { ranges: [speed, speed, turn, still], tolerance: DRIVE_TOLERANCE, is_scarce: false }
            }
            Thing::Wheels => Room { ranges: [speed; 4], tolerance: DRIVE_TOLERANCE, is_scarce: false },
            Thing::YawHold => {
                Room { ranges: [speed, speed, still, still], tolerance: DRIVE_TOLERANCE, is_scarce: false }
            }
        }
    }

    pub(super) fn is_drive(self) -> bool {
        matches!(self, Thing::Rocker | Thing::Wheels | Thing::YawHold)
    }

    /// Whether both are moved by the same motors.
    pub(super) fn meets(self, other: Thing) -> bool {
        match (self, other) {
            (Thing::Servos, Thing::Servo(index)) | (Thing::Servo(index), Thing::Servos) => index <= 2,
            _ => self == other || self.is_drive() && other.is_drive(),
        }
    }

    /// The command that moves it from one value to another; `said` is the value that the script has given it before.
    pub(super) fn moved(self, said: Option<Axes>, from: Axes, to: Axes) -> String {
        let axis = |axis: usize| {
            let of = |axes: Axes| axes.get(axis).copied().unwrap_or_default();
            if said.is_some_and(|said| of(said) == of(from)) {
                of(to).to_string()
            } else {
                format!("{} -> {}", of(from), of(to))
            }
        };
        match self {
            Thing::Servo(index) => format!("servo {index} {}", axis(0)),
            Thing::Servos => format!("servos {} {}", axis(0), axis(1)),
            Thing::Rocker => format!("rocker x={} y={} z={}", axis(0), axis(1), axis(2)),
            Thing::Wheels => format!("wheels {} {} {} {}", axis(0), axis(1), axis(2), axis(3)),
            Thing::YawHold => format!("yawhold x={} y={}", axis(0), axis(1)),
        }
    }
}
