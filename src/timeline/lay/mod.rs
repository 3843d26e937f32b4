//! Lays the steps of a program out in time: moves, ends of holds, refreshes, closing frames.

mod moves;

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, VecDeque};

use super::{
    BUZZER, Bars, Cue, DRIVE, Event, Expectation, Kind, Mark, REPORTS, THINGS, Timeline, Track, Tween, things,
};
use crate::board::{Command, State};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::program::{Abort, Action, Limit, MAX_STEPS, Program, Settings, Step, Time, TraceId, Traces};
use crate::source::Span;

pub(super) fn lay(program: Program, limit: usize, diagnostics: &mut Diagnostics) -> Timeline {
    let Program { settings, steps, end, abort, traces, marks, .. } = program;
    let mut marks: Vec<Mark> = marks.into_iter().map(|(name, at)| Mark { name, at_us: at.micros() }).collect();
    marks.sort_by_key(|mark| mark.at_us);
    let mut cues = Vec::new();
    let mut lay = Lay::new(&settings, &traces, limit, diagnostics);
    let steps = lay.run(steps, &mut cues);
    lay.close(end);
    lay.reports(end);
    let expects = std::mem::take(&mut lay.expects);
    let (events, tweens) = lay.finish(steps);
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
        bars: settings.has_tempo.then_some(Bars { tempo: settings.tempo, first_us: 0 }),
        limits: settings.limits,
        servo_speeds: settings.servo_speeds,
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
    let steps = lay.run(abort.steps, &mut cues);
    if let Some(from) = lay.raw {
        // Nobody knows what a raw frame left behind.
        lay.emit(abort.end, Command::STOP, Kind::Abort, From { order: u32::MAX - 1, ..from });
        lay.emit(abort.end, Command::Buzzer(false), Kind::Abort, From { order: u32::MAX, ..from });
    } else if lay.state.buzzer() == Some(true) {
        let from = From { order: u32::MAX, ..lay.last(BUZZER) };
        lay.emit(abort.end, Command::Buzzer(false), Kind::Abort, from);
    }
    let (mut events, _) = lay.finish(steps);
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
    order: u32,
    span: Span,
    trace: TraceId,
}

impl From {
    fn step(step: &Step) -> From {
        From { order: step.order, span: step.span, trace: step.trace }
    }

    fn event(self, at_us: u64, command: Command, kind: Kind) -> Event {
        Event { at_us, command, kind, is_instant: false, span: self.span, trace: self.trace }
    }
}

/// The end of a `for`. Ends are sorted by time, and at one time in script order.
struct End {
    at_us: u64,
    from: From,
    /// The exact time.
    at: Time,
    command: Command,
}

impl End {
    fn key(&self) -> (u64, u32) {
        (self.at_us, self.from.order)
    }
}

impl PartialEq for End {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for End {}

impl PartialOrd for End {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for End {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key().cmp(&other.key())
    }
}

struct Lay<'d> {
    period: Time,
    refresh: Option<Time>,
    limits: &'d [Limit],
    traces: &'d Traces,
    /// The most events.
    limit: usize,
    /// How many of the steps are one event each.
    plain: usize,
    /// All other events but refreshes, with their places in script order.
    events: Vec<(Event, u32)>,
    /// The moves, each with the time and the place in script order of its first step.
    tweens: Vec<(Tween, (u64, u32))>,
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
    /// Raw frames for the drive that are still to come, in the order of sending.
    raw_drives: VecDeque<(Time, Command, From)>,
    /// Samples that moves may still be asked for, sent or not.
    samples_left: u64,
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
            plain: 0,
            events: Vec::new(),
            tweens: Vec::new(),
            refreshes: Vec::new(),
            expects: Vec::new(),
            state: State::default(),
            held: None,
            open_ended: false,
            last: [From::default(); THINGS],
            raw_drives: VecDeque::new(),
            samples_left: MAX_STEPS,
            raw: None,
            full: false,
            diagnostics,
        }
    }

    /// Lays every step, sorted by time; lines to show go to `cues`. The steps are given back: those that are one event each become
    /// it where they stand, in [`finish`](Self::finish), because there may be millions of them.
    fn run(&mut self, mut steps: Vec<Step>, cues: &mut Vec<Cue>) -> Vec<Step> {
        let mut ends: BinaryHeap<Reverse<End>> = BinaryHeap::new();
        let mut ended: Vec<End> = Vec::new();
        self.raw_drives = steps.iter().filter_map(raw_drive).collect();
        let mut rest = steps.as_mut_slice();
        loop {
            let next = rest.first().map(|step| step.at.micros());
            let end = ends.peek().map(|Reverse(end)| end.at_us);
            let Some(now) = next.into_iter().chain(end).min() else { break };
            let count = rest.iter().take_while(|step| step.at.micros() == now).count();
            let (group, behind) = rest.split_at_mut(count);
            rest = behind;
            for step in group.iter() {
                if let Action::Hold(held) = &step.action {
                    let command = if held.0.is_drive() { Command::STOP } else { Command::Buzzer(false) };
                    let at = step.at.plus(held.1);
                    ends.push(Reverse(End { at_us: at.micros(), from: From::step(step), at, command }));
                }
            }
            // Of a hold too short to see, the start still comes before its end.
            ended.clear();
            let starts = Starts::of(group);
            while ends.peek().is_some_and(|Reverse(end)| end.at_us == now) {
                ended.extend(ends.pop().map(|Reverse(end)| end).filter(|end| !starts.supersede(end)));
            }
            let mut ended = ended.iter().peekable();
            for step in group {
                while let Some(end) = ended.next_if(|end| end.from.order < step.order) {
                    self.send(end.at, &end.command, Kind::Command, end.from);
                }
                self.step(step, cues);
            }
            for end in ended {
                self.send(end.at, &end.command, Kind::Command, end.from);
            }
        }
        self.waiting_expects();
        steps
    }

    fn step(&mut self, step: &mut Step, cues: &mut Vec<Cue>) {
        let from = From::step(step);
        match &mut step.action {
            Action::Send(command) => self.plain(step.at, command, from),
            Action::Hold(held) => {
                self.plain(step.at, &held.0, from);
                self.open_ended &= !held.0.is_drive();
            }
            Action::Go(going) => self.go(step.at, going, from),
            Action::Say(text) => {
                cues.push(Cue { at_us: step.at.micros(), text: std::mem::take(&mut **text).into(), span: step.span });
            }
            Action::Expect(expect) => {
                let until = step.at.plus(expect.within.unwrap_or(Time::ZERO));
                let (at_us, until_us) = (step.at.micros(), until.micros());
                let (expect, span, trace) = ((**expect).clone(), step.span, step.trace);
                self.expects.push(Expectation { at_us, until_us, expect, span, trace });
            }
        }
    }

    fn last(&self, thing: usize) -> From {
        self.last.get(thing).copied().unwrap_or_default()
    }

    fn report(&mut self, diagnostic: Diagnostic, from: From) {
        self.diagnostics.push(self.traces.attach(diagnostic, from.trace));
    }

    /// Sends a command that is a step.
    fn plain(&mut self, at: Time, command: &Command, from: From) {
        self.tell(at, command, from);
        if self.has_room(1, from) {
            self.plain += 1;
        }
    }

    /// Sends a command that is none.
    fn send(&mut self, at: Time, command: &Command, kind: Kind, from: From) {
        self.tell(at, command, from);
        self.emit(at, command.clone(), kind, from);
    }

    /// The hold before a command ends, and its own begins.
    fn tell(&mut self, at: Time, command: &Command, from: From) {
        if is_raw_drive(command) && self.raw_drives.pop_front_if(|(_, _, next)| next.order == from.order).is_none() {
            // The move that it is in the middle of has told it already, between two of its samples.
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
    }

    /// Tells the raw frames for the drive that are sent before what a move sends at `at`.
    fn tell_raw_drives(&mut self, at: Time, from: From) {
        let key = (at.micros(), from.order);
        while let Some((at, command, from)) =
            self.raw_drives.front().filter(|(at, _, raw)| (at.micros(), raw.order) < key).cloned()
        {
            self.tell(at, &command, from);
        }
    }

    fn emit(&mut self, at: Time, command: Command, kind: Kind, from: From) {
        if self.has_room(1, from) {
            self.events.push((from.event(at.micros(), command, kind), from.order));
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
        if start.plus(interval).micros() >= until.micros() {
            return;
        }
        // Counted before anything is laid, so that a day of refreshes costs nothing where it is too much.
        let at_us = |k| start.plus(interval.times(k)).micros();
        let passed = whole(until.minus(start).over(interval).unwrap_or(0.0));
        let count = passed.saturating_sub(u64::from(at_us(passed) >= until.micros()));
        if !self.has_room(usize::try_from(count).unwrap_or(usize::MAX), from) {
            return;
        }
        for at_us in (1..=count).map(at_us) {
            self.refreshes.push(from.event(at_us, command.clone(), Kind::Refresh));
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
            self.emit(end, stop, Kind::Auto, From { order: u32::MAX, span: last.0, trace: last.1 });
        }
    }

    fn left_running(&mut self, from: From, message: &str, command: &str) {
        let help = format!("end the script with `{command}`; motionseq sends it at the end in any case");
        self.report(Diagnostic::new(Code::LeftRunning, from.span, message, help), from);
    }

    /// Whether so many more frames are allowed; where not, that is reported once.
    fn has_room(&mut self, more: usize, from: From) -> bool {
        let total = (self.plain + self.events.len() + self.refreshes.len()).saturating_add(more);
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
    fn finish(mut self, steps: Vec<Step>) -> (Vec<Event>, Vec<Tween>) {
        self.tweens.sort_by_key(|(_, first)| *first);
        let tweens = self.tweens.into_iter().map(|(tween, _)| tween).collect();
        let key = |(event, order): &(Event, u32)| {
            (event.at_us, event.rank(), if event.kind == Kind::Closing { 0 } else { *order })
        };
        let mut plain: Vec<(Event, u32)> = steps.into_iter().filter_map(plain_event).collect();
        // The longer of the two stays where it is.
        let mut events = self.events;
        if plain.len() < events.len() {
            events.splice(0..0, plain);
        } else {
            plain.append(&mut events);
            events = plain;
        }
        if !events.is_sorted_by_key(key) {
            events.sort_by_key(key);
        }
        let mut events: Vec<Event> = events.into_iter().map(|(event, _)| event).collect();
        if !self.refreshes.is_empty() {
            events.extend(self.refreshes);
            events.sort_by_key(|event| (event.at_us, event.rank()));
        }
        (events, tweens)
    }
}

/// The event that a step is, if it is one, with its place in script order.
fn plain_event(step: Step) -> Option<(Event, u32)> {
    let from = From::step(&step);
    let (command, is_instant) = match step.action {
        Action::Send(command) => (command, true),
        Action::Hold(held) => (held.0, false),
        Action::Go(_) | Action::Say(_) | Action::Expect(_) => return None,
    };
    Some((Event { is_instant, ..from.event(step.at.micros(), command, Kind::Command) }, from.order))
}

/// The whole part of a number above zero, held where it is far too large.
fn whole(number: f64) -> u64 {
    const MANY: f64 = 1e12;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    if number.is_finite() { number.clamp(0.0, MANY) as u64 } else { 0 }
}

/// A step that is a raw frame for the drive: its time, its command and its place.
fn raw_drive(step: &Step) -> Option<(Time, Command, From)> {
    match &step.action {
        Action::Send(command) if is_raw_drive(command) => Some((step.at, command.clone(), From::step(step))),
        _ => None,
    }
}

/// Whether a command is a raw frame for the drive.
fn is_raw_drive(command: &Command) -> bool {
    matches!(command, Command::Raw { .. }) && command.is_drive()
}

/// The first two steps of one moment that start something else for the drive, and for the buzzer.
#[derive(Default)]
struct Starts([[Option<u32>; 2]; 2]);

impl Starts {
    fn of(group: &[Step]) -> Starts {
        let mut starts = Starts::default();
        for step in group {
            let command = match &step.action {
                Action::Send(command) => command,
                Action::Hold(held) => &held.0,
                Action::Go(_) | Action::Say(_) | Action::Expect(_) => continue,
            };
            if let [Some(thing), _] = things(command)
                && let Some([first, second]) = starts.0.get_mut(thing)
            {
                *second = first.and(second.or(Some(step.order)));
                first.get_or_insert(step.order);
            }
        }
        starts
    }

    /// Whether the end of a `for` is left out, because another command for the same thing starts at that very moment. A move
    /// replaces it only with its first sample, and a raw frame is not interpreted, so both leave it in.
    fn supersede(&self, end: &End) -> bool {
        let [thing, _] = things(&end.command);
        let starts = thing.and_then(|thing| self.0.get(thing));
        starts.is_some_and(|starts| starts.iter().flatten().any(|order| *order != end.from.order))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Move;

    /// A million of them are there at once, and the second becomes the third in the same memory.
    #[test]
    fn what_there_are_millions_of_is_small() {
        assert_eq!(size_of::<Command>(), 16);
        assert_eq!(size_of::<Step>(), 48);
        assert!(size_of::<Event>() <= 40 && size_of::<Move>() <= 88 && size_of::<Tween>() <= 32);
        assert!(size_of::<(Event, u32)>() <= size_of::<Step>() && align_of::<(Event, u32)>() == align_of::<Step>());
    }
}
