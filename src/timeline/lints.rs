//! What compiles and is probably not meant, as far as it takes the whole timeline to see it.

use std::collections::{BTreeMap, BTreeSet};

use super::tween::{Part, Walk};
use super::{Event, Timeline};
use crate::board::ResourceId;
use crate::diagnostic::{Diagnostic, Diagnostics, diagnostic};
use crate::program::{MAX_SERVO_SPEED, TraceId};
use crate::source::Span;
use crate::units::Micros;

/// A servo that has less than this many µs of pulse width still to go counts as arrived.
const ARRIVED: u64 = 20;
const MICROS: u64 = 1_000_000;
/// A suggested speed is a multiple of this, in µs of pulse width a second.
const STEP: u64 = 100;
/// How many speeds are tried to find one that is enough.
const TRIES: usize = 16;

/// Reports servos that cannot get where they are sent before their next command, once for each time that one falls behind.
pub(super) fn servo_speed(timeline: &Timeline, diagnostics: &mut Diagnostics) {
    let speeds: Vec<Option<u64>> = timeline.speeds.iter().map(|speed| speed.map(u64::from)).collect();
    let paced = paced(timeline, &speeds);
    if paced.iter().flatten().all(|servo| servo.late.is_empty()) {
        return;
    }
    let enough = enough_speeds(timeline, &paced);
    // A command that several of its servos do not reach is one warning.
    let mut warnings: BTreeMap<Span, Vec<(ResourceId, &Late)>> = BTreeMap::new();
    for (resource, servo) in paced.iter().enumerate() {
        for late in servo.iter().flat_map(|servo| &servo.late) {
            warnings.entry(late.span).or_default().push((resource, late));
        }
    }
    for paced in warnings.values() {
        if let Some((resource, late)) = paced.first() {
            let name = |resource: ResourceId| timeline.board.resource(resource).map(|found| &*found.name);
            let limit = |(resource, _): &(ResourceId, _)| {
                Some(format!("`limit {} speed {}us`", name(*resource)?, enough.get(*resource).copied().flatten()?))
            };
            let limits: Option<Vec<String>> = paced.iter().map(limit).collect();
            let diagnostic = too_fast(late, name(*resource).unwrap_or_default(), limits.as_deref());
            let diagnostic = timeline.traces.attach(diagnostic, late.trace);
            diagnostics.push(diagnostic.related(late.next, "its next command"));
        }
    }
}

/// The servos as they were when the timeline has been played, with the speeds that they have; `None` for other resources.
fn paced(timeline: &Timeline, speeds: &[Option<u64>]) -> Vec<Option<Paced>> {
    let board = &timeline.board;
    let mut paced: Vec<Option<Paced>> =
        speeds.iter().map(|speed| Some(Paced { speed: (*speed)?, ..Paced::default() })).collect();
    let mut walk = Walk::new(board, &timeline.tweens);
    for event in &timeline.events {
        let part = walk.take(&event.command, event.kind);
        board.each_part(&event.command, |resource, command| {
            let servo = paced.get_mut(resource).and_then(Option::as_mut);
            let value = command.len().checked_sub(1).and_then(|last| command.value(last));
            if let (Some(servo), Some(pulse)) = (servo, value) {
                servo.take(event, pulse, &part);
            }
        });
    }
    paced
}

/// For each servo that is late, a speed at which it never is, if a script can set such a speed.
fn enough_speeds(timeline: &Timeline, late: &[Option<Paced>]) -> Vec<Option<u64>> {
    let is_late = |servo: &Paced| !servo.late.is_empty();
    let round_up = |servo: &Paced| servo.needed.max(servo.speed).div_ceil(STEP) * STEP;
    let faster = |servo: &Paced| if is_late(servo) { round_up(servo) } else { servo.speed };
    let mut speeds: Vec<Option<u64>> = late.iter().map(|servo| servo.as_ref().map(faster)).collect();
    for _ in 0..TRIES {
        let paced = paced(timeline, &speeds);
        if !paced.iter().flatten().any(is_late) {
            return speeds.into_iter().map(|speed| speed.filter(|speed| *speed <= MAX_SERVO_SPEED)).collect();
        }
        for (speed, servo) in speeds.iter_mut().zip(&paced) {
            if let Some(servo) = servo.as_ref().filter(|servo| is_late(servo)) {
                *speed = Some(round_up(servo));
            }
        }
    }
    vec![None; speeds.len()]
}

/// A servo that turns at an even speed.
#[derive(Default)]
struct Paced {
    /// µs of pulse width a second.
    speed: u64,
    going: Option<Going>,
    /// Whether it has not caught up since it fell behind.
    is_behind: bool,
    /// Each command at which it fell behind, once however often it is run.
    late: Vec<Late>,
    seen: BTreeSet<Span>,
    /// The speed that would have been enough for what it did not reach.
    needed: u64,
}

/// Where it is, and where it goes. Pulse widths are in millionths of a µs, so that they stay exact.
struct Going {
    at: Micros,
    pulse: u64,
    target: u64,
    /// What began it: where it was then, when, and the place in the script.
    from: u64,
    since: Micros,
    span: Span,
    trace: TraceId,
    /// Whether a move has begun whose steps have not changed the target yet.
    begins: bool,
}

/// A command that a servo does not reach.
struct Late {
    span: Span,
    trace: TraceId,
    from: u64,
    target: u64,
    /// That of the servo.
    speed: u64,
    /// How long it has.
    time: Micros,
    /// The command that comes too early.
    next: Span,
}

impl Paced {
    fn take(&mut self, event: &Event, pulse: i32, part: &Part<'_>) {
        let target = u64::try_from(pulse).unwrap_or(0) * MICROS;
        let Some(going) = &mut self.going else {
            // Where it was is unknown.
            let (at, span, trace) = (event.at, event.span, event.trace);
            let from = target;
            self.going = Some(Going { at, pulse: target, target, from, since: at, span, trace, begins: false });
            return;
        };
        going.pass(self.speed, event.at);
        // What sets the value that it has already changes nothing.
        if target == going.target {
            going.begins |= matches!(part, Part::First(_));
            return;
        }
        // Of a part of a timeline, it is not known which steps begin a move.
        let begins = going.begins || !matches!(part, Part::Further | Part::Stray);
        // Two commands at one time are reported as a clash.
        if begins && event.at > going.since {
            let late = going.late(self.speed, event);
            if let Some(late) = &late {
                self.needed = self.needed.max(late.from.abs_diff(late.target).div_ceil(late.time.0));
            }
            let was_behind = std::mem::replace(&mut self.is_behind, late.is_some());
            self.late.extend(late.filter(|late| !was_behind && self.seen.insert(late.span)));
        }
        going.target = target;
        if begins {
            (going.from, going.since) = (going.pulse, event.at);
            (going.span, going.trace, going.begins) = (event.span, event.trace, false);
        }
    }
}

impl Going {
    /// Lets time pass.
    fn pass(&mut self, speed: u64, at: Micros) {
        let way = speed.saturating_mul((at - self.at).0);
        self.pulse = if self.pulse < self.target {
            self.target.min(self.pulse.saturating_add(way))
        } else {
            self.target.max(self.pulse.saturating_sub(way))
        };
        self.at = at;
    }

    /// What it did not reach before the next command. A move sends where to be all the time, and still has a step to go where its
    /// time ends, so it counts as a whole.
    fn late(&self, speed: u64, next: &Event) -> Option<Late> {
        let time = next.at - self.since;
        let is_late = self.from.abs_diff(self.target) > speed.saturating_mul(time.0)
            && self.pulse.abs_diff(self.target) > ARRIVED * MICROS;
        let Going { span, trace, from, target, .. } = *self;
        is_late.then_some(Late { span, trace, from, target, speed, time, next: next.span })
    }
}

/// `limits` are lines that silence it, if there are any.
fn too_fast(late: &Late, name: &str, limits: Option<&[String]>) -> Diagnostic {
    let Late { from, target, speed, .. } = *late;
    let (from, to) = (from / MICROS, target / MICROS);
    let needed = from.abs_diff(to) * 1_000 / speed.max(1);
    let left = late.time.in_millis();
    let message =
        format!("{name} needs about {needed} ms from {from} to {to} µs, and its next command comes after {left:.0} ms");
    let help = match limits {
        Some(limits) => {
            format!("give it more time; if it is faster than {speed} µs a second, say so: {}", limits.join(" and "))
        }
        None => format!("give it more time: at least {needed} ms"),
    };
    diagnostic!(ServoSpeed, late.span, "{message}"; help: "{help}").label("does not get there")
}
