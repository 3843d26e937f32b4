//! What a robot does, thing by thing.

use super::{Lane, Moment, Shows, Stretch};
use crate::board::{Command, PulseWidth, ServoIndex, Speed, TiltPulseWidth, TurnRate};
use crate::program::{Limit, Limited};
use crate::sim::Geometry;
use crate::timeline::{Event, Timeline};

/// Values over time, as they come.
#[derive(Default)]
struct Curve(Vec<(u64, Option<f64>)>);

impl Curve {
    fn set(&mut self, t_us: u64, value: Option<f64>) {
        match self.0.last_mut() {
            Some((_, last)) if *last == value => {}
            None if value.is_none() => {}
            // What is replaced at the same moment stays: it was sent.
            _ => self.0.push((t_us, value)),
        }
    }

    fn is_flat(&self) -> bool {
        self.0.iter().all(|(_, value)| value.is_none_or(|value| value == 0.0))
    }
}

/// Everything that a picture can have a lane for.
#[derive(Default)]
struct Things {
    servos: [Curve; 4],
    /// Sideways, forward and turning.
    body: [Curve; 3],
    wheels: [Curve; 4],
    yaw_hold: Vec<Stretch>,
    moves: Vec<Moment>,
    buzzer: Vec<Stretch>,
    rest: Vec<Moment>,
    geometry: Geometry,
}

/// The lanes of what is used.
pub(super) fn lanes(events: &[Event], timeline: &Timeline) -> Vec<Lane> {
    let mut things = Things::default();
    let mut state = [false; 2];
    for event in events {
        things.take(event.at_us, &event.command, &mut state);
    }
    let [holds, buzzes] = state;
    for (is_on, spans) in [(holds, &mut things.yaw_hold), (buzzes, &mut things.buzzer)] {
        if let (true, Some(last)) = (is_on, spans.last_mut()) {
            last.until_us = timeline.end_us.max(last.t_us);
        }
    }
    things.lanes(&timeline.limits)
}

impl Things {
    fn take(&mut self, t_us: u64, command: &Command, [holds, buzzes]: &mut [bool; 2]) {
        let mut servo = |place: usize, pulse: i32| {
            if let Some(curve) = self.servos.get_mut(place) {
                curve.set(t_us, Some(f64::from(pulse)));
            }
        };
        match command {
            Command::Servo { index, pulse } => {
                if let Ok(index) = usize::try_from(index.get()) {
                    servo(index - 1, pulse.get());
                }
            }
            Command::Servos { pan, tilt } => {
                servo(0, pan.get());
                servo(1, tilt.get());
            }
            Command::Buzzer(on) => switch(&mut self.buzzer, buzzes, *on, t_us, "on"),
            command if command.is_drive() => self.drive(t_us, command, holds),
            other => self.rest.push(Moment { t_us, text: other.to_string() }),
        }
    }

    fn drive(&mut self, t_us: u64, command: &Command, holds: &mut bool) {
        let is_hold = matches!(command, Command::YawHold { .. });
        switch(&mut self.yaw_hold, holds, is_hold, t_us, "the board keeps the heading");
        let twist = self.geometry.twist(command);
        // How fast a displacement is, the board decides.
        let body = twist.map_or([None; 3], |twist| [twist.x, twist.y, twist.z].map(Some));
        for (curve, value) in self.body.iter_mut().zip(body) {
            curve.set(t_us, value);
        }
        let wheels = match command {
            Command::Wheels(wheels) => wheels.map(|wheel| Some(f64::from(wheel.get()))),
            command if command.keeps_driving() || twist.is_none() => [None; 4],
            _ => [Some(0.0); 4],
        };
        for (curve, value) in self.wheels.iter_mut().zip(wheels) {
            curve.set(t_us, value);
        }
        if matches!(command, Command::Move { .. }) {
            self.moves.push(Moment { t_us, text: command.to_string() });
        }
    }

    fn lanes(self, limits: &[Limit]) -> Vec<Lane> {
        let Things { servos, body, wheels, yaw_hold, moves, buzzer, rest, .. } = self;
        let mut lanes = Vec::new();
        let curve = |(name, about), unit, ends, range: (i32, i32), limited: &[Limited], Curve(points): Curve| {
            let limit = limits.iter().find(|limit| limit.span.is_some() && limited.contains(&limit.limited));
            let limits = limit.map(|limit| [limit.low, limit.high]);
            let range = [f64::from(range.0), f64::from(range.1)];
            Lane { name, about, shows: Shows::Curve { unit, ends, range, limits, points } }
        };
        let names = [("servo 1", "pan"), ("servo 2", "tilt"), ("servo 3", ""), ("servo 4", "")];
        for ((index, name), points) in (1..).zip(names).zip(servos) {
            let limited = ServoIndex::new(index).map(Limited::Servo);
            // The second one usually tilts, and is driven further only where the script says so.
            let is_wide = |limit: &Limit| Ok(limit.limited) == limited && limit.high > f64::from(TiltPulseWidth::MAX);
            let most = if index == 2 && !limits.iter().any(is_wide) { TiltPulseWidth::MAX } else { PulseWidth::MAX };
            let limited = limited.as_ref().map_or(&[][..], std::slice::from_ref);
            if !points.0.is_empty() {
                lanes.push(curve(name, "µs", ["", ""], (PulseWidth::MIN, most), limited, points));
            }
        }
        let speed = (Speed::MIN, Speed::MAX);
        let body_lanes = [
            ("sideways", "cm/s", ["left", "right"], speed, [Limited::Rocker(0), Limited::YawHold(0)]),
            ("forward", "cm/s", ["back", "forward"], speed, [Limited::Rocker(1), Limited::YawHold(1)]),
            ("turn", "°/s", ["left", "right"], (TurnRate::MIN, TurnRate::MAX), [Limited::Rocker(2); 2]),
        ];
        // What stands is not worth a lane, but a drive that was told to stand is worth one.
        let is_told = body.iter().any(|curve| !curve.0.is_empty());
        let stands =
            is_told && moves.is_empty() && body.iter().all(Curve::is_flat) && wheels.iter().all(Curve::is_flat);
        for ((name, unit, ends, range, limited), points) in body_lanes.into_iter().zip(body) {
            if !points.is_flat() || (stands && name == "forward") {
                lanes.push(curve((name, ""), unit, ends, range, &limited, points));
            }
        }
        if !wheels.iter().all(Curve::is_flat) {
            let names = [
                ("wheel A", "front right"),
                ("wheel B", "rear right"),
                ("wheel C", "rear left"),
                ("wheel D", "front left"),
            ];
            for (name, points) in names.into_iter().zip(wheels) {
                lanes.push(curve(name, "", ["", ""], speed, &[Limited::Wheels], points));
            }
        }
        let spans = [("yaw hold", yaw_hold), ("buzzer", buzzer)];
        let ticks = [("move", moves), ("other", rest)];
        let ticks = ticks.into_iter().filter(|(_, ticks)| !ticks.is_empty());
        lanes.extend(ticks.map(|(name, ticks)| Lane { name, about: "", shows: Shows::Ticks { ticks } }));
        let spans = spans.into_iter().filter(|(_, spans)| !spans.is_empty());
        lanes.extend(spans.map(|(name, spans)| Lane { name, about: "", shows: Shows::Spans { spans } }));
        lanes
    }
}

/// Something goes on or off.
fn switch(spans: &mut Vec<Stretch>, was_on: &mut bool, on: bool, t_us: u64, text: &str) {
    match (std::mem::replace(was_on, on), on) {
        (false, true) => spans.push(Stretch { t_us, until_us: t_us, text: text.to_owned() }),
        (true, false) => {
            if let Some(last) = spans.last_mut() {
                last.until_us = t_us;
            }
        }
        _ => {}
    }
}
