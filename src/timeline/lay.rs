//! Lays the steps of a program out in time: moves, ends of holds, refreshes, closing frames.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{BUZZER, Cue, DRIVE, Event, Expectation, Kind, Mark, REPORTS, THINGS, Timeline, Track, Tween, things};
use crate::board::{Command, State, TiltPulseWidth};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::program::{
    Abort, Action, Limit, Motion, Move, Program, Settings, Shape, Step, Time, TraceId, Traces, broken, broken_limit,
};
use crate::source::Span;

pub(super) fn lay(program: Program, limit: usize, diagnostics: &mut Diagnostics) -> Timeline {
    let Program { settings, steps, end, abort, traces, marks, .. } = program;
    let mut marks: Vec<Mark> = marks.into_iter().map(|(name, at)| Mark { name, at_us: at.micros() }).collect();
    marks.sort_by_key(|mark| mark.at_us);
    let mut cues = Vec::new();
    let mut lay = Lay::new(&settings, &traces, limit, diagnostics);
    lay.run(steps, &mut cues);
    lay.close(end);
    lay.reports(end);
    let expects = std::mem::take(&mut lay.expects);
    let (events, tweens) = lay.finish();
    let (abort, abort_cues) =
        abort.map(|abort| lay_abort(abort, &settings, &traces, limit, diagnostics)).unwrap_or_default();
    Timeline {
        tracks: vec![Track { robot: None, events, tweens, abort }],
        cues,
        expects,
        marks,
        abort_cues,
        end_us: end.micros(),
        baud: settings.baud,
        traces,
    }
}

/// What is sent where something ends a run early. It starts with nothing known, and leaves no buzzer on.
fn lay_abort(
    abort: Abort,
    settings: &Settings,
    traces: &Traces,
    limit: usize,
    diagnostics: &mut Diagnostics,
) -> (Vec<Event>, Vec<Cue>) {
    let mut cues = Vec::new();
    let mut lay = Lay::new(settings, traces, limit, diagnostics);
    lay.run(abort.steps, &mut cues);
    if let Some(from) = lay.raw {
        // Nobody knows what a raw frame left behind.
        lay.emit(abort.end, Command::STOP, Kind::Abort, From { order: usize::MAX - 1, ..from });
        lay.emit(abort.end, Command::Buzzer(false), Kind::Abort, From { order: usize::MAX, ..from });
    } else if lay.state.buzzer() == Some(true) {
        let from = From { order: usize::MAX, ..lay.last(BUZZER) };
        lay.emit(abort.end, Command::Buzzer(false), Kind::Abort, from);
    }
    let (mut events, _) = lay.finish();
    for event in &mut events {
        event.kind = Kind::Abort;
    }
    (events, cues)
}

/// How many `expect`s with `within` may wait at the same time.
const MAX_WAITING: usize = 64;
/// A hold without `for` that lasts longer looks like a forgotten `stop`.
const LONG_HOLD: Time = Time::from_millis(10_000);

/// The step that a frame belongs to.
#[derive(Clone, Copy, Default)]
struct From {
    /// The place in script order.
    order: usize,
    span: Span,
    trace: TraceId,
}

/// Something that happens at one time.
struct Point {
    /// The exact time.
    at: Time,
    from: From,
    what: What,
}

enum What {
    /// A command, and whether it ends by itself.
    Send(Command, bool),
    Go(Box<Move>),
    /// The end of a `for`.
    End(Command),
}

struct Lay<'d> {
    period: Time,
    refresh: Option<Time>,
    limits: &'d [Limit],
    traces: &'d Traces,
    /// The most events.
    limit: usize,
    /// Commands and samples, with their place in script order.
    events: Vec<(Event, usize)>,
    /// The moves, each with the time and the place in script order of its first step.
    tweens: Vec<(Tween, (u64, usize))>,
    /// Refreshes, sorted by time.
    refreshes: Vec<Event>,
    expects: Vec<Expectation>,
    state: State,
    /// The drive command that holds, with the time it was sent.
    held: Option<(Time, Command, From)>,
    /// Whether it goes on until something ends it: it has no `for`.
    open_ended: bool,
    /// Of each thing, the last step that used it.
    last: [From; THINGS],
    /// When the last move of the drive ends.
    drive_until: Time,
    /// The first raw frame.
    raw: Option<From>,
    /// Whether the limit of events was reached.
    full: bool,
    diagnostics: &'d mut Diagnostics,
}

impl<'d> Lay<'d> {
    fn new(settings: &'d Settings, traces: &'d Traces, limit: usize, diagnostics: &'d mut Diagnostics) -> Self {
        Lay {
            period: settings.period,
            refresh: settings.refresh,
            limits: &settings.limits,
            traces,
            limit,
            events: Vec::new(),
            tweens: Vec::new(),
            refreshes: Vec::new(),
            expects: Vec::new(),
            state: State::default(),
            held: None,
            open_ended: false,
            last: [From::default(); THINGS],
            drive_until: Time::ZERO,
            raw: None,
            full: false,
            diagnostics,
        }
    }

    /// Lays every step; lines to show go to `cues`.
    fn run(&mut self, steps: Vec<Step>, cues: &mut Vec<Cue>) {
        let mut points = Vec::with_capacity(steps.len());
        for (order, step) in steps.into_iter().enumerate() {
            let from = From { order, span: step.span, trace: step.trace };
            let what = match step.action {
                Action::Say(text) => {
                    cues.push(Cue { at_us: step.at.micros(), text, span: step.span });
                    continue;
                }
                Action::Expect(expect) => {
                    let until = step.at.plus(expect.within.unwrap_or(Time::ZERO));
                    let (at_us, until_us) = (step.at.micros(), until.micros());
                    let (span, trace) = (step.span, step.trace);
                    self.expects.push(Expectation { at_us, until_us, expect: *expect, span, trace });
                    continue;
                }
                Action::Send(command, hold) => {
                    if let Some(hold) = hold {
                        let end = if command.is_drive() { Command::STOP } else { Command::Buzzer(false) };
                        points.push(Point { at: step.at.plus(hold), from, what: What::End(end) });
                    }
                    What::Send(command, hold.is_some())
                }
                Action::Go(going) => What::Go(going),
            };
            points.push(Point { at: step.at, from, what });
        }
        cues.sort_by_key(|cue| cue.at_us);
        self.expects.sort_by_key(|expect| expect.at_us);
        self.waiting_expects();
        // Stable, so that the start of a hold too short to see still comes before its end.
        points.sort_by_key(|point| (point.at.micros(), point.from.order, matches!(point.what, What::End(_))));
        self.events.reserve(points.len());
        for group in points.chunk_by(|left, right| left.at.micros() == right.at.micros()) {
            for point in group {
                match &point.what {
                    What::End(end) if superseded(end, point, group) => {}
                    What::End(command) => self.send(point.at, command, Kind::Command, point.from),
                    What::Send(command, ends) => {
                        self.send(point.at, command, Kind::Command, point.from);
                        self.open_ended &= !(*ends && command.is_drive());
                    }
                    What::Go(going) => self.go(point.at, going, point.from),
                }
            }
        }
    }

    fn last(&self, thing: usize) -> From {
        self.last.get(thing).copied().unwrap_or_default()
    }

    fn report(&mut self, diagnostic: Diagnostic, from: From) {
        self.diagnostics.push(self.traces.attach(diagnostic, from.trace));
    }

    /// Sends a command: the hold before it ends, and its own begins.
    fn send(&mut self, at: Time, command: &Command, kind: Kind, from: From) {
        // A raw frame in the middle of a move: the samples behind it, which are laid already, have the last word.
        if matches!(command, Command::Raw { .. }) && at < self.drive_until {
            self.raw = self.raw.or(Some(from));
            self.emit(at, command.clone(), kind, from);
            return;
        }
        if command.is_drive() {
            self.long_hold(at);
            self.release(at);
            self.held = command.keeps_driving().then(|| (at, command.clone(), from));
            self.open_ended = true;
        }
        for thing in things(command).into_iter().flatten() {
            if let Some(last) = self.last.get_mut(thing) {
                *last = from;
            }
        }
        if let Command::Raw { .. } = command {
            self.raw = self.raw.or(Some(from));
        }
        self.state.apply(command);
        self.emit(at, command.clone(), kind, from);
    }

    fn emit(&mut self, at: Time, command: Command, kind: Kind, from: From) {
        if self.has_room(1, from) {
            let event = Event { at_us: at.micros(), command, kind, span: from.span, trace: from.trace };
            self.events.push((event, from.order));
        }
    }

    /// Samples a move: at the start where it says so, then every period, then exactly the target. What would say the same
    /// as the last frame to the same thing is left out.
    fn go(&mut self, at: Time, going: &Move, from: From) {
        let Move { motion, over, ease, .. } = going;
        let Some(starts) = self.starts(motion, from) else {
            return;
        };
        let count = over.over(self.period).unwrap_or(0.0);
        if !self.has_room(frames(count), from) {
            return;
        }
        let before = self.events.len();
        let end = at.plus(*over);
        self.samples(at, end, going, &starts, from);
        let steps = self.events.get(before..).unwrap_or_default();
        if let Some((first, order)) = steps.first() {
            let tween = Tween { at_us: at.micros(), end_us: end.micros(), ease: *ease, steps: steps.len() };
            self.tweens.push((tween, (first.at_us, *order)));
        }
    }

    fn samples(&mut self, at: Time, end: Time, going: &Move, starts: &[f64], from: From) {
        let Move { motion, over, ease, .. } = going;
        if motion.has_start() {
            self.sample(at, going, starts, from);
        }
        for k in 1_u64.. {
            let passed = self.period.times(k);
            if passed >= *over || self.full {
                break;
            }
            let part = ease.at(passed.over(*over).unwrap_or(1.0));
            let values: Vec<f64> =
                starts.iter().zip(&motion.values).map(|(start, glide)| start + (glide.to - start) * part).collect();
            if !self.sample(at.plus(passed), going, &values, from) {
                return;
            }
        }
        if !matches!(motion.shape, Shape::Servo(_) | Shape::Servos) {
            self.drive_until = end;
        }
        let targets: Vec<f64> = motion.values.iter().map(|glide| glide.to).collect();
        self.sample(end, going, &targets, from);
    }

    /// Where each value of a move starts; `None` where one is not known, which is reported.
    fn starts(&mut self, motion: &Motion, from: From) -> Option<Vec<f64>> {
        let known = self.known(motion.shape);
        let names = motion.shape.names();
        let mut starts = Vec::new();
        for (at, glide) in motion.values.iter().enumerate() {
            let start = glide.from.or_else(|| known.as_ref()?.get(at).copied().flatten());
            let Some(start) = start else {
                let name = names.get(at).copied().unwrap_or("value");
                let help = match motion.shape {
                    Shape::Servo(_) | Shape::Servos => "send it somewhere first, or write where it starts".to_owned(),
                    _ => {
                        "put a `stop` before it, so that it starts from 0, or write where each value starts".to_owned()
                    }
                };
                let help = format!("{help}: `{}`", motion.with_starts());
                let message = format!("nobody knows where the {name} starts");
                self.report(Diagnostic::new(Code::UnknownStart, from.span, message, help), from);
                // From here on it is known, so that one mistake is one message.
                if let Some(target) = motion.target() {
                    self.state.apply(&target);
                    for thing in things(&target).into_iter().flatten() {
                        if let Some(last) = self.last.get_mut(thing) {
                            *last = from;
                        }
                    }
                }
                return None;
            };
            starts.push(start);
        }
        Some(starts)
    }

    /// The last values of this kind of command, as far as they are known.
    fn known(&self, shape: Shape) -> Option<Vec<Option<f64>>> {
        let servo = |index| self.state.servo(index).map(|pulse| f64::from(pulse.get()));
        let zero = self.state.drive() == Some(&Command::STOP);
        let zeros = || vec![Some(0.0); shape.names().len()];
        match (shape, self.state.drive()) {
            (Shape::Servo(index), _) => Some(vec![servo(index)]),
            (Shape::Servos, _) => {
                let indices = [1, 2].map(|index| crate::board::ServoIndex::new(index).ok());
                Some(indices.map(|index| index.and_then(servo)).to_vec())
            }
            (Shape::Rocker, Some(Command::Rocker { x, y, z })) => {
                Some([x.get(), y.get(), z.get()].map(|value| Some(f64::from(value))).to_vec())
            }
            (Shape::YawHold, Some(Command::YawHold { x, y })) => {
                Some([x.get(), y.get()].map(|value| Some(f64::from(value))).to_vec())
            }
            (Shape::Wheels, Some(Command::Wheels(wheels))) => {
                Some(wheels.map(|wheel| Some(f64::from(wheel.get()))).to_vec())
            }
            _ => zero.then(zeros),
        }
    }

    /// Sends one sample, if it says anything new. `false` where it is out of range, which is reported.
    fn sample(&mut self, at: Time, going: &Move, values: &[f64], from: From) -> bool {
        let command = match going.motion.shape.command(values) {
            Ok(command) => command,
            Err(wrong) => {
                let name = going.motion.shape.names().get(wrong).copied().unwrap_or("value");
                let value = values.get(wrong).copied().unwrap_or(0.0);
                let diagnostic = Diagnostic::new(
                    Code::OutOfRange,
                    from.span,
                    format!("on the way the {name} gets to {value:.0}, which is out of range"),
                    "choose an easing that does not overshoot, or stay further inside the range",
                );
                self.report(diagnostic, from);
                return false;
            }
        };
        if let Some((limit, value)) = broken(self.limits, &command) {
            self.report(broken_limit(limit, value, from.span), from);
            return false;
        }
        self.tilt(&command, going, from);
        if !self.was_last(&command) {
            self.send(at, &command, Kind::Sample, from);
        }
        true
    }

    /// A move that only on its way gets further than a tilt servo survives.
    fn tilt(&mut self, command: &Command, going: &Move, from: From) {
        let Command::Servo { index, pulse } = command else {
            return;
        };
        let most = f64::from(TiltPulseWidth::MAX);
        let ends_inside = going.motion.values.iter().all(|glide| glide.to <= most && glide.from.unwrap_or(0.0) <= most);
        if index.get() == 2 && pulse.get() > TiltPulseWidth::MAX && ends_inside {
            let message =
                format!("servo 2 is the tilt servo, and on the way this gets to {pulse} µs, which it does not survive");
            let help = "choose an easing that does not overshoot, or stay further inside the range";
            self.report(Diagnostic::new(Code::TiltRange, from.span, message, help), from);
        }
    }

    /// Whether this is what was sent last to the same thing.
    fn was_last(&self, command: &Command) -> bool {
        match command {
            Command::Servo { index, pulse } => self.state.servo(*index) == Some(*pulse),
            Command::Servos { pan, tilt } => {
                let servo = |index| crate::board::ServoIndex::new(index).ok().and_then(|index| self.state.servo(index));
                servo(1) == Some(*pan) && servo(2).is_some_and(|pulse| pulse.get() == tilt.get())
            }
            drive => self.state.drive() == Some(drive),
        }
    }

    /// A hold that nothing in its own line ends, and that lasted long.
    fn long_hold(&mut self, until: Time) {
        let Some((start, command, from)) = self.held.as_ref().filter(|_| self.open_ended) else { return };
        let lasted = until.minus(*start);
        if lasted <= LONG_HOLD {
            return;
        }
        let seconds = lasted;
        let diagnostic = Diagnostic::new(
            Code::LongHold,
            from.span,
            format!("`{command}` drives on for {seconds}, until another line ends it"),
            format!("if that is meant, say so where it starts: `{command} for {seconds}`"),
        )
        .label("no `for`");
        let from = *from;
        self.report(diagnostic, from);
    }

    /// Ends a hold just before `until`, and sends its refreshes.
    fn release(&mut self, until: Time) {
        let (Some((start, command, from)), Some(interval)) = (self.held.take(), self.refresh) else {
            return;
        };
        // Counted before anything is laid, so that a day of refreshes costs nothing where it is too much.
        let count = until.minus(start).over(interval).unwrap_or(0.0);
        if !self.has_room(frames(count), from) {
            return;
        }
        let times = (1_u64..).map(|k| start.plus(interval.times(k)).micros());
        for at_us in times.take_while(|&at_us| at_us < until.micros()) {
            let event =
                Event { at_us, command: command.clone(), kind: Kind::Refresh, span: from.span, trace: from.trace };
            self.refreshes.push(event);
        }
    }

    /// What is still running at the end is ended.
    fn close(&mut self, end: Time) {
        self.release(end);
        let (drive, buzzer) = (self.last(DRIVE), self.last(BUZZER));
        let runs = self.state.drive().is_some_and(Command::keeps_driving);
        let sounds = self.state.buzzer() == Some(true);
        if runs {
            self.left_running(drive, "the drive is still running when the script ends", "stop");
        }
        if sounds {
            self.left_running(buzzer, "the buzzer is still on when the script ends", "buzzer off");
        }
        // Nobody knows what a raw frame left behind.
        if runs || self.raw.is_some() {
            self.emit(end, Command::STOP, Kind::Closing, self.raw.unwrap_or(drive));
        }
        if sounds || self.raw.is_some() {
            self.emit(end, Command::Buzzer(false), Kind::Closing, self.raw.unwrap_or(buzzer));
        }
    }

    /// Each report is held against every `expect` that waits, so not too many may wait together.
    fn waiting_expects(&mut self) {
        let mut waiting = BinaryHeap::new();
        let mut found = None;
        for expect in self.expects.iter().filter(|expect| expect.until_us > expect.at_us) {
            while waiting.peek().is_some_and(|Reverse(until_us)| *until_us <= expect.at_us) {
                waiting.pop();
            }
            waiting.push(Reverse(expect.until_us));
            if waiting.len() > MAX_WAITING {
                found = Some((expect.span, expect.trace));
                break;
            }
        }
        if let Some((span, trace)) = found {
            let message = format!("more than {MAX_WAITING} `expect`s wait for a report at the same time here");
            let diagnostic = Diagnostic::new(Code::TooManyEvents, span, message, "let fewer of them overlap");
            self.report(diagnostic, From { span, trace, ..From::default() });
        }
    }

    /// Where something is expected, the board reports from the start to the end.
    fn reports(&mut self, end: Time) {
        let [start, stop] = REPORTS;
        if let (Some(first), Some(last)) = (self.expects.first(), self.expects.last()) {
            let (first, last) = ((first.span, first.trace), (last.span, last.trace));
            self.emit(Time::ZERO, start, Kind::Auto, From { order: 0, span: first.0, trace: first.1 });
            self.emit(end, stop, Kind::Auto, From { order: usize::MAX, span: last.0, trace: last.1 });
        }
    }

    fn left_running(&mut self, from: From, message: &str, command: &str) {
        let help = format!("end the script with `{command}`; motionseq sends it at the end in any case");
        self.report(Diagnostic::new(Code::LeftRunning, from.span, message, help), from);
    }

    /// Whether so many more frames are allowed; where not, that is reported once.
    fn has_room(&mut self, more: usize, from: From) -> bool {
        let total = self.events.len().saturating_add(self.refreshes.len()).saturating_add(more);
        let room = total <= self.limit;
        if !room && !self.full {
            self.full = true;
            let message = format!("the script sends more than {} frames", self.limit);
            let help = "make it shorter or the refresh interval longer, or allow more with `--max-events`";
            self.report(Diagnostic::new(Code::TooManyEvents, from.span, message, help), from);
        }
        room
    }

    /// All events in the order of sending, and the moves in that of their first steps. The sort is stable: closing frames keep
    /// theirs.
    fn finish(mut self) -> (Vec<Event>, Vec<Tween>) {
        self.tweens.sort_by_key(|(_, first)| *first);
        let tweens = self.tweens.into_iter().map(|(tween, _)| tween).collect();
        self.events.sort_by_key(|(event, order)| {
            (event.at_us, event.rank(), if event.kind == Kind::Closing { 0 } else { *order })
        });
        let mut events: Vec<Event> = self.events.into_iter().map(|(event, _)| event).collect();
        if !self.refreshes.is_empty() {
            events.extend(self.refreshes);
            events.sort_by_key(|event| (event.at_us, event.rank()));
        }
        (events, tweens)
    }
}

/// A number of frames, held where it is far too large.
fn frames(count: f64) -> usize {
    const MANY: f64 = 1e12;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    if count.is_finite() { count.clamp(0.0, MANY) as usize } else { usize::MAX }
}

/// Whether the end of a `for` is left out, because another command for the same thing starts at that very moment. A move
/// replaces it only with its first sample, and a raw frame is not interpreted, so both leave it in.
fn superseded(end: &Command, point: &Point, group: &[Point]) -> bool {
    let [thing, _] = things(end);
    group.iter().any(|other| match &other.what {
        What::Send(command, _) => other.from.order != point.from.order && things(command)[0] == thing,
        What::Go(_) | What::End(_) => false,
    })
}
