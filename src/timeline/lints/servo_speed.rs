//! A servo gets its next command before it can arrive.

use std::collections::{BTreeMap, BTreeSet};

use super::super::tween::{MoveTracker, StepRole};
use super::super::{Event, Timeline};
use crate::board::{Measure, ResourceId, Unit};
use crate::diagnostic::{Diagnostic, Diagnostics, diagnostic};
use crate::program::{MAX_SERVO_SPEED, TraceId};
use crate::source::Span;
use crate::units::Micros;

/// Positions are in millionths of the unit of the servo, so that they are exact.
const MILLION: i64 = 1_000_000;
/// The maximum number of attempts to find a sufficient speed.
const TRIES: usize = 16;

/// A servo counts as arrived if its remaining distance is below this, in its unit.
fn arrived(unit: Unit) -> u64 {
    if unit.measure == Measure::Degrees { 2 } else { 20 }
}

/// Suggested speeds are multiples of this, in the unit of the servo per second.
fn step(unit: Unit) -> u64 {
    arrived(unit) * 5
}

/// Reports servos that cannot reach their target before their next command, once each time that one
/// falls behind.
pub(in super::super) fn check(timeline: &Timeline, diagnostics: &mut Diagnostics) {
    let speeds: Vec<Option<u64>> = timeline.speeds.iter().map(|speed| speed.map(u64::from)).collect();
    let paced = paced(timeline, &speeds);
    if paced.iter().flatten().all(|servo| servo.late.is_empty()) {
        return;
    }
    let enough = enough_speeds(timeline, &paced);
    // One warning covers all servos of a command.
    let mut warnings: BTreeMap<Span, Vec<(ResourceId, &Late)>> = BTreeMap::new();
    for (resource, servo) in paced.iter().enumerate() {
        for late in servo.iter().flat_map(|servo| &servo.late) {
            warnings.entry(late.span).or_default().push((resource, late));
        }
    }
    for paced in warnings.values() {
        if let Some((resource, late)) = paced.first() {
            let name = |resource: ResourceId| timeline.board.resource(resource).map(|found| &*found.name);
            let limit = |(resource, late): &(ResourceId, &Late)| {
                let speed = enough.get(*resource).copied().flatten()?;
                Some(format!("`limit {} speed {speed}{}`", name(*resource)?, suffix(late.unit)))
            };
            let limits: Option<Vec<String>> = paced.iter().map(limit).collect();
            let diagnostic = too_fast(late, name(*resource).unwrap_or_default(), limits.as_deref());
            let diagnostic = timeline.traces.attach(diagnostic, late.trace);
            diagnostics.push(diagnostic.related(late.next, "its next command"));
        }
    }
}

/// The servos after the timeline was played at these speeds; `None` for other resources.
fn paced(timeline: &Timeline, speeds: &[Option<u64>]) -> Vec<Option<ServoModel>> {
    let board = &timeline.board;
    let mut paced: Vec<Option<ServoModel>> =
        speeds.iter().map(|speed| Some(ServoModel { speed: (*speed)?, ..ServoModel::default() })).collect();
    let mut tracker = MoveTracker::new(board, &timeline.tweens);
    for event in &timeline.events {
        let role = tracker.take(&event.command, event.kind);
        if board.verb(event.command.verb()).is_some_and(|verb| verb.forgets) {
            for resource in board.occupies(&event.command) {
                if let Some(servo) = paced.get_mut(*resource).and_then(Option::as_mut) {
                    (servo.going, servo.is_behind) = (None, false);
                }
            }
            continue;
        }
        board.each_part(&event.command, |resource, command| {
            let axis = board.verb(command.verb()).filter(|verb| verb.moves).and_then(|verb| verb.axes.last());
            let servo = paced.get_mut(resource).and_then(Option::as_mut);
            let value = command.len().checked_sub(1).and_then(|last| command.value(last));
            if let (Some(servo), Some(value), Some(axis)) = (servo, value, axis) {
                servo.unit = axis.unit;
                servo.take(event, i64::from(value) * MILLION / i64::from(axis.scale.max(1)), &role);
            }
        });
    }
    paced
}

/// For each late servo, a speed at which it is never late, if a script can set such a speed.
fn enough_speeds(timeline: &Timeline, late: &[Option<ServoModel>]) -> Vec<Option<u64>> {
    let is_late = |servo: &ServoModel| !servo.late.is_empty();
    let round_up = |servo: &ServoModel| servo.needed.max(servo.speed).div_ceil(step(servo.unit)) * step(servo.unit);
    let faster = |servo: &ServoModel| if is_late(servo) { round_up(servo) } else { servo.speed };
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

/// A servo that turns at a constant speed.
#[derive(Default)]
struct ServoModel {
    /// The unit of its values.
    unit: Unit,
    /// The speed in this unit per second.
    speed: u64,
    going: Option<Travel>,
    /// Whether it has fallen behind and not caught up yet.
    is_behind: bool,
    /// Each command at which it fell behind, once per span.
    late: Vec<Late>,
    seen: BTreeSet<Span>,
    /// The speed that would have been sufficient for the targets that it missed.
    needed: u64,
}

/// The position and target of a servo.
struct Travel {
    at: Micros,
    position: i64,
    target: i64,
    /// The command that started the motion: the position then, its time, and its place in the
    /// script.
    from: i64,
    since: Micros,
    span: Span,
    trace: TraceId,
    /// Whether a move has begun whose steps have not changed the target yet.
    begins: bool,
}

/// A command whose target a servo does not reach.
struct Late {
    span: Span,
    trace: TraceId,
    from: i64,
    target: i64,
    /// The unit and the speed of the servo.
    unit: Unit,
    speed: u64,
    /// The time that it has.
    time: Micros,
    /// The next command, which comes too early.
    next: Span,
}

impl ServoModel {
    /// Takes a target.
    fn take(&mut self, event: &Event, target: i64, role: &StepRole<'_>) {
        let Some(going) = &mut self.going else {
            // The position before was unknown.
            let (at, span, trace) = (event.at, event.span, event.trace);
            let from = target;
            self.going = Some(Travel { at, position: target, target, from, since: at, span, trace, begins: false });
            return;
        };
        going.pass(self.speed, event.at);
        // A command that repeats the target changes nothing.
        if target == going.target {
            going.begins |= matches!(role, StepRole::First(_));
            return;
        }
        // In a clip, it is unknown which steps begin a move.
        let begins = going.begins || !matches!(role, StepRole::Further | StepRole::Stray);
        // Two commands at one time are reported as a clash.
        if begins && event.at > going.since {
            let late = going.late(self.unit, self.speed, event);
            if let Some(late) = &late {
                self.needed = self.needed.max(late.from.abs_diff(late.target).div_ceil(late.time.0));
            }
            let was_behind = std::mem::replace(&mut self.is_behind, late.is_some());
            self.late.extend(late.filter(|late| !was_behind && self.seen.insert(late.span)));
        }
        going.target = target;
        if begins {
            (going.from, going.since) = (going.position, event.at);
            (going.span, going.trace, going.begins) = (event.span, event.trace, false);
        }
    }
}

impl Travel {
    /// Advances the position to a time.
    fn pass(&mut self, speed: u64, at: Micros) {
        let way = i64::try_from(speed.saturating_mul((at - self.at).0)).unwrap_or(i64::MAX);
        self.position = if self.position < self.target {
            self.target.min(self.position.saturating_add(way))
        } else {
            self.target.max(self.position.saturating_sub(way))
        };
        self.at = at;
    }

    /// The target that is not reached before the next command. A move sends intermediate positions,
    /// and its last step is sent when its time ends, so it counts as a whole.
    fn late(&self, unit: Unit, speed: u64, next: &Event) -> Option<Late> {
        let time = next.at - self.since;
        let is_late = self.from.abs_diff(self.target) > speed.saturating_mul(time.0)
            && self.position.abs_diff(self.target) > arrived(unit) * MILLION.unsigned_abs();
        let Travel { span, trace, from, target, .. } = *self;
        is_late.then_some(Late { span, trace, from, target, unit, speed, time, next: next.span })
    }
}

/// The unit after a number in a script.
fn suffix(unit: Unit) -> &'static str {
    match unit.measure {
        Measure::Micros => "us",
        Measure::Degrees => "deg",
        _ => "",
    }
}

/// `limits` are lines that would silence the warning, if there are any.
fn too_fast(late: &Late, name: &str, limits: Option<&[String]>) -> Diagnostic {
    let Late { from, target, unit, speed, .. } = *late;
    let (from, to) = (from / MILLION, target / MILLION);
    let needed = from.abs_diff(to) * 1_000 / speed.max(1);
    let left = late.time.in_millis();
    let symbol = unit.symbol();
    // `1500 µs`, but `90°` and `2048`.
    let space = if unit.measure == Measure::Micros { " " } else { "" };
    let message = format!(
        "{name} needs about {needed} ms from {from} to {to}{space}{symbol}, but its next command comes after {left:.0} ms"
    );
    let help = match limits {
        Some(limits) => {
            format!(
                "allow at least {needed} ms, or, if the servo is faster than {speed}{space}{symbol} per second, set {}",
                limits.join(" and ")
            )
        }
        None => format!("allow at least {needed} ms"),
    };
    diagnostic!(ServoSpeed, late.span, "{message}"; help: "{help}").label("does not arrive in time")
}
