//! Schedules the steps of a program: moves, ends of holds, refreshes, closing frames, requests for
//! reports.

mod ends;
mod gates;
mod moves;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::sync::Arc;

use super::greetings::Greetings;
use super::lints;
use super::{Bars, Cue, Event, Expectation, Gate, Kind, Mark, Timeline, Tween};
use crate::board::{Board, Command, ResourceId, State};
use crate::diagnostic::{Diagnostic, Diagnostics, diagnostic};
use crate::program::{self, Action, MAX_STEPS, Program, Settings, Step, Time, TraceId, Traces};
use crate::source::Span;
use crate::units::Micros;
use ends::{End, Ends, Starts};

/// Schedules a program. `shared` are the marks of the first robot.
pub(super) fn schedule(
    program: Program,
    shared: Option<&Arc<[Mark]>>,
    limit: usize,
    diagnostics: &mut Diagnostics,
) -> Timeline {
    let Program { robot, board, settings, steps, end, abort, traces, mut marks, has_gates, .. } = program;
    marks.sort_by_key(|mark| (mark.at.micros(), mark.order));
    let mut script = Scheduler::new(&board, &settings, &traces, limit, diagnostics);
    if has_gates {
        script.gate_places = gates::places(&steps);
    }
    board.hello.iter().for_each(|command| script.state.apply(&board, command));
    let steps = script.run(steps);
    script.warn_of_running(end);
    script.close(end);
    script.greet(end);
    let (cues, expects) = (std::mem::take(&mut script.cues), std::mem::take(&mut script.expects));
    let places = std::mem::take(&mut script.gate_places);
    let mut gates = std::mem::take(&mut script.gates);
    let own = || marks.into_iter().map(|mark| mark_of(mark, &places)).collect();
    let marks = shared.map_or_else(own, Arc::clone);
    let (events, tweens) = script.finish(steps, &places, &mut gates);
    for (before, gate) in gates.iter_mut().enumerate() {
        gate.next.marks = marks.partition_point(|mark| mark.gates <= before);
    }
    // The state after an early end is unknown.
    let mut early = Scheduler::new(&board, &settings, &traces, limit, diagnostics);
    let (steps, early_end) = abort.map_or((Vec::new(), Time::ZERO), |abort| (abort.steps, abort.end));
    let steps = early.run(steps);
    early.close(early_end);
    let abort_cues = std::mem::take(&mut early.cues);
    let (mut abort, _) = early.finish(steps, &[], &mut []);
    for event in &mut abort {
        event.kind = Kind::Abort;
    }
    Timeline {
        robot,
        board,
        events,
        tweens,
        abort,
        cues,
        expects,
        marks,
        gates,
        abort_cues,
        end: end.micros(),
        baud: settings.baud,
        soft: settings.soft,
        refresh: settings.refresh.iter().map(|refresh| refresh.map(Time::micros)).collect(),
        traces,
        bars: settings.has_tempo.then_some(Bars { tempo: settings.tempo, first_us: 0 }),
        limits: program::limits_of_pictures(&settings),
        speeds: settings.speeds,
    }
}

/// A mark, after the gates at these places.
fn mark_of(mark: program::Mark, gates: &[(Micros, u32)]) -> Mark {
    let program::Mark { name, at, span, order } = mark;
    Mark { name, at: at.micros(), gates: gates::count_before(gates, at.micros(), order), span }
}

/// The maximum number of `expect`s with `within` that wait at the same time.
const MAX_WAITING: usize = 64;

/// The step that a frame belongs to.
#[derive(Clone, Copy, Default)]
struct Origin {
    /// Its index in script order.
    order: u32,
    span: Span,
    trace: TraceId,
}

impl Origin {
    fn step(step: &Step) -> Origin {
        Origin { order: step.order, span: step.span, trace: step.trace }
    }

    fn event(self, at: Micros, command: Command, kind: Kind) -> Event {
        Event { at, command, kind, is_instant: false, span: self.span, trace: self.trace }
    }
}

/// A command that is refreshed until another one ends it.
#[derive(Clone)]
struct Held {
    since: Time,
    command: Command,
    from: Origin,
    /// Whether it continues until something ends it, because it has no `for`.
    is_open_ended: bool,
}

struct Scheduler<'d> {
    board: &'d Board,
    settings: &'d Settings,
    traces: &'d Traces,
    /// The maximum number of events.
    limit: usize,
    /// The number of steps that are one event each.
    plain: usize,
    /// All other events except refreshes, with their indices in script order.
    events: Vec<(Event, u32)>,
    /// The moves, each with the time and script order of its first step.
    tweens: Vec<(Tween, (Micros, u32))>,
    /// Refreshes, sorted by time.
    refreshes: Vec<Event>,
    cues: Vec<Cue>,
    expects: Vec<Expectation>,
    gates: Vec<Gate>,
    /// The times and places of all gates, in order.
    gate_places: Vec<(Micros, u32)>,
    state: State,
    /// For each resource that must be refreshed, the command that it holds.
    held: Vec<Option<Held>>,
    /// For each resource, the last step that used it.
    last: Vec<Origin>,
    /// The remaining raw frames for a resource that must be refreshed, in the order of sending.
    raw_drives: VecDeque<(Time, Command, Origin)>,
    /// The remaining budget of samples, sent or not.
    samples_left: u64,
    /// The first raw frame.
    raw: Option<(Time, Origin)>,
    /// Whether the limit of events was reached.
    full: bool,
    diagnostics: &'d mut Diagnostics,
}

impl<'d> Scheduler<'d> {
    fn new(
        board: &'d Board,
        settings: &'d Settings,
        traces: &'d Traces,
        limit: usize,
        diagnostics: &'d mut Diagnostics,
    ) -> Self {
        Scheduler {
            board,
            settings,
            traces,
            limit,
            plain: 0,
            events: Vec::new(),
            tweens: Vec::new(),
            refreshes: Vec::new(),
            cues: Vec::new(),
            expects: Vec::new(),
            gates: Vec::new(),
            gate_places: Vec::new(),
            state: State::default(),
            held: vec![None; board.resources.len()],
            last: vec![Origin::default(); board.resources.len()],
            raw_drives: VecDeque::new(),
            samples_left: MAX_STEPS,
            raw: None,
            full: false,
            diagnostics,
        }
    }

    /// Schedules every step, sorted by time, and returns the steps. [`finish`](Self::finish)
    /// converts those that are one event each in place, because there may be millions of them.
    fn run(&mut self, mut steps: Vec<Step>) -> Vec<Step> {
        let mut ends = Ends::new();
        let mut ended: Vec<End> = Vec::new();
        let mut starts = Starts::default();
        self.raw_drives = steps.iter().filter_map(|step| raw_drive(self.board, step)).collect();
        let mut rest = steps.as_mut_slice();
        loop {
            let next = rest.first().map(|step| step.at.micros());
            let end = ends.first_key_value().map(|((due, _), _)| *due);
            let Some(now) = next.into_iter().chain(end).min() else { break };
            let (group, later) = rest.split_at_mut(gates::group_length(rest, now));
            rest = later;
            let ends_at_gate = group.last().is_some_and(gates::is_gate);
            for step in group.iter() {
                if let Action::Hold(held) = &step.action
                    && let Some(command) = self.rest_of(&held.0)
                {
                    let at = step.at.plus(held.1);
                    let from = self.before_gate(step.at, at, Origin::step(step));
                    ends.insert((at.micros(), step.order), End { from, at, command });
                }
            }
            // If a hold is too short to see, its start still comes before its end.
            ended.clear();
            let is_due = |ends: &Ends| ends.first_key_value().is_some_and(|((due, _), _)| *due == now);
            if is_due(&ends) {
                // What ends at the moment of a gate is always sent.
                starts.read(self.board, if ends_at_gate { &[] } else { group });
            }
            while is_due(&ends) {
                let end = ends.pop_first().map(|(_, end)| end);
                ended.extend(end.filter(|end| !starts.supersede(self.board, end)));
            }
            let mut ended = ended.iter().peekable();
            for step in group {
                // What ends at the moment of a gate comes before it.
                let is_gate = ends_at_gate && gates::is_gate(step);
                while let Some(end) = ended.next_if(|end| is_gate || end.from.order < step.order) {
                    self.send(end.at, &end.command, Kind::Command, end.from);
                }
                self.step(step);
            }
            for end in ended {
                self.send(end.at, &end.command, Kind::Command, end.from);
            }
        }
        self.waiting_expects();
        steps
    }

    fn step(&mut self, step: &mut Step) {
        let from = Origin::step(step);
        match &mut step.action {
            Action::Send(command) => self.plain(step.at, command, from),
            Action::Hold(held) => {
                self.plain(step.at, &held.0, from);
                for resource in self.board.occupies(&held.0) {
                    if let Some(held) = self.held.get_mut(*resource).and_then(Option::as_mut) {
                        held.is_open_ended = false;
                    }
                }
            }
            Action::Go(going) => self.go(step.at, going, from),
            Action::Say(text) => {
                let text = std::mem::take(&mut **text);
                self.cues.push(Cue { at: step.at.micros(), text, span: step.span });
            }
            Action::Expect(expect) => {
                let until = step.at.plus(expect.within.unwrap_or(Time::ZERO));
                let (at, until) = (step.at.micros(), until.micros());
                let (expect, span, trace) = ((**expect).clone(), step.span, step.trace);
                self.expects.push(Expectation { at, until, expect, span, trace });
            }
            Action::Gate(gate) => self.gate(step.at, gate, from),
        }
    }

    /// The command that ends another.
    fn rest_of(&self, command: &Command) -> Option<Command> {
        self.board.occupies(command).iter().find_map(|resource| self.board.rest(*resource).cloned())
    }

    fn last(&self, resource: ResourceId) -> Origin {
        self.last.get(resource).copied().unwrap_or_default()
    }

    fn report(&mut self, diagnostic: Diagnostic, from: Origin) {
        self.diagnostics.push(self.traces.attach(diagnostic, from.trace));
    }

    /// Sends a command that is a step.
    fn plain(&mut self, at: Time, command: &Command, from: Origin) {
        self.apply(at, command, from);
        if self.has_room(1, from) {
            self.plain += 1;
        }
    }

    /// Sends a command that is not a step.
    fn send(&mut self, at: Time, command: &Command, kind: Kind, from: Origin) {
        self.apply(at, command, from);
        self.emit(at, command.clone(), kind, from);
    }

    /// Ends the previous hold and starts that of the command.
    fn apply(&mut self, at: Time, command: &Command, from: Origin) {
        let board = self.board;
        let is_opaque = board.is_opaque(command);
        let touched = board.touches(command);
        if is_raw_drive(board, command)
            && self.raw_drives.pop_front_if(|(_, _, next)| next.order == from.order).is_none()
        {
            // Already applied between two samples of the current move.
            return;
        }
        for resource in touched.iter().copied() {
            if board.needs_refresh(resource) {
                self.long_hold(resource, at);
                self.release(resource, at);
                let held = || Held { since: at, command: command.clone(), from, is_open_ended: true };
                if let Some(place) = self.held.get_mut(resource) {
                    *place = board.is_active(command).then(held);
                }
            }
            if let Some(last) = self.last.get_mut(resource).filter(|_| !is_opaque) {
                *last = from;
            }
        }
        // Raw frames between the samples of a move are applied early, so a later one may be the first in time.
        if is_opaque && self.raw.is_none_or(|(first, _)| at < first) {
            self.raw = Some((at, from));
        }
        self.state.apply(board, command);
    }

    /// Applies raw drive frames that are sent before a move's sample at `at`.
    fn apply_raw_drives(&mut self, at: Time, from: Origin) {
        let key = (at.micros(), from.order);
        while let Some((at, command, from)) =
            self.raw_drives.front().filter(|(at, _, raw)| (at.micros(), raw.order) < key).cloned()
        {
            self.apply(at, &command, from);
        }
    }

    fn emit(&mut self, at: Time, command: Command, kind: Kind, from: Origin) {
        self.add(from.event(at.micros(), command, kind), from.order);
    }

    fn add(&mut self, event: Event, order: u32) {
        if self.has_room(1, Origin { order, span: event.span, trace: event.trace }) {
            self.events.push((event, order));
        }
    }

    /// Reports a long hold that has no `for`.
    fn long_hold(&mut self, resource: ResourceId, until: Time) {
        let held = self.held.get(resource).and_then(Option::as_ref);
        let Some(Held { since, command, from, .. }) = held.filter(|held| held.is_open_ended) else { return };
        let said = self.board.show(command).to_string();
        if let Some(warning) = lints::long_hold::check(&said, until.minus(*since), from.span) {
            let from = *from;
            self.report(warning, from);
        }
    }

    /// Ends a hold just before `until`, and adds its refreshes.
    fn release(&mut self, resource: ResourceId, until: Time) {
        let held = self.held.get_mut(resource).and_then(Option::take);
        let interval = self.settings.refresh.get(resource).copied().flatten();
        let (Some(Held { since: start, command, from, .. }), Some(interval)) = (held, interval) else {
            return;
        };
        if start.plus(interval).micros() >= until.micros() {
            return;
        }
        // Count before adding, so that too many refreshes cost no memory.
        let at = |k| start.plus(interval.times(k)).micros();
        let passed = whole(until.minus(start).over(interval).unwrap_or(0.0));
        let count = passed.saturating_sub(u64::from(at(passed) >= until.micros()));
        if !self.has_room(usize::try_from(count).unwrap_or(usize::MAX), from) {
            return;
        }
        for at in (1..=count).map(at) {
            self.refreshes.push(from.event(at, command.clone(), Kind::Refresh));
        }
    }

    /// Ends every hold, and reports what is still running.
    fn warn_of_running(&mut self, end: Time) {
        let board = self.board;
        for resource in 0..board.resources.len() {
            self.release(resource, end);
        }
        for (id, resource, rest) in self.state.closing(board, false).collect::<Vec<_>>() {
            let from = self.last(id);
            self.report(lints::left_running::warning(resource, &board.show(rest).to_string(), from.span), from);
        }
    }

    /// Ends what is still running. The state after a raw frame is unknown.
    fn close(&mut self, end: Time) {
        for (id, _, rest) in self.state.closing(self.board, self.raw.is_some()).collect::<Vec<_>>() {
            self.emit(end, rest.clone(), Kind::Closing, self.raw.map_or(self.last(id), |(_, raw)| raw));
        }
    }

    /// Limits the `expect`s that wait together, because each report is compared with all of them.
    fn waiting_expects(&mut self) {
        let mut waiting = BinaryHeap::new();
        let mut found = None;
        for expect in self.expects.iter().filter(|expect| expect.until > expect.at) {
            while waiting.peek().is_some_and(|Reverse(until)| *until <= expect.at) {
                waiting.pop();
            }
            waiting.push(Reverse(expect.until));
            if waiting.len() > MAX_WAITING {
                found = Some((expect.span, expect.trace));
                break;
            }
        }
        if let Some((span, trace)) = found {
            let diagnostic = diagnostic!(TooManyEvents, span,
                "more than {MAX_WAITING} `expect`s wait for a report at the same time";
                help: "shorten their `within`, or start them one after another");
            self.report(diagnostic, Origin { span, trace, ..Origin::default() });
        }
    }

    fn greet(&mut self, end: Time) {
        let Greetings { first, last } = Greetings::of(self.board, &self.expects, &self.gates, end.micros());
        let first = first.into_iter().map(|event| (event, 0));
        for (event, order) in first.chain(last.into_iter().map(|event| (event, u32::MAX))) {
            self.add(event, order);
        }
    }

    /// Whether this many more frames are allowed. Reports the first excess.
    fn has_room(&mut self, more: usize, from: Origin) -> bool {
        let total = self.plain + self.events.len() + self.refreshes.len() + self.gates.len();
        let total = total.saturating_add(more);
        let room = total <= self.limit;
        if !room && !self.full {
            self.full = true;
            let message = format!("the script sends more than {} frames", self.limit);
            let help = "shorten it, use a longer `refresh` interval, or allow more with `--max-events`";
            self.report(diagnostic!(TooManyEvents, from.span, "{message}"; help: "{help}"), from);
        }
        room
    }

    /// All events in the order of sending, and the moves in the order of their first steps. The
    /// sort is stable, so that refreshes and closing frames keep their order.
    fn finish(mut self, steps: Vec<Step>, places: &[(Micros, u32)], gates: &mut [Gate]) -> (Vec<Event>, Vec<Tween>) {
        self.tweens.sort_by_key(|(_, first)| *first);
        let tweens = self.tweens.into_iter().map(|(tween, _)| tween).collect();
        let board = self.board;
        let is_closing = |event: &Event| event.kind == Kind::Closing;
        let before = |(event, order): &(Event, u32)| {
            gates::count_before(places, event.at, if is_closing(event) { u32::MAX } else { *order })
        };
        let key = |item: &(Event, u32)| {
            let (event, order) = item;
            // The hello comes before everything else.
            let rank = if (event.kind, *order) == (Kind::Auto, 0) { 0 } else { event.rank(board) };
            (event.at, before(item), rank, if is_closing(event) { 0 } else { *order })
        };
        let mut plain: Vec<(Event, u32)> = steps.into_iter().filter_map(plain_event).collect();
        // Move the shorter of the two vectors.
        let mut events = self.events;
        if plain.len() < events.len() {
            events.splice(0..0, plain);
        } else {
            plain.append(&mut events);
            events = plain;
        }
        // A refresh belongs to a command that came earlier.
        events.extend(self.refreshes.into_iter().map(|event| (event, 0)));
        if !events.is_sorted_by_key(key) {
            events.sort_by_key(key);
        }
        for (gate, at) in gates.iter_mut().zip(0..) {
            gate.next.events = events.partition_point(|event| before(event) <= at);
        }
        (events.into_iter().map(|(event, _)| event).collect(), tweens)
    }
}

/// The event of a step with its index in script order, if the step is one event.
fn plain_event(step: Step) -> Option<(Event, u32)> {
    let from = Origin::step(&step);
    let (command, is_instant) = match step.action {
        Action::Send(command) => (command, true),
        Action::Hold(held) => (held.0, false),
        Action::Go(_) | Action::Say(_) | Action::Expect(_) | Action::Gate(_) => return None,
    };
    Some((Event { is_instant, ..from.event(step.at.micros(), command, Kind::Command) }, from.order))
}

/// The integer part of a positive number, limited to a large maximum.
fn whole(number: f64) -> u64 {
    const MANY: f64 = 1e12;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    if number.is_finite() { number.clamp(0.0, MANY) as u64 } else { 0 }
}

/// The time, command and origin of a step that is a raw frame for a resource that must be
/// refreshed.
fn raw_drive(board: &Board, step: &Step) -> Option<(Time, Command, Origin)> {
    match &step.action {
        Action::Send(command) if is_raw_drive(board, command) => Some((step.at, command.clone(), Origin::step(step))),
        _ => None,
    }
}

/// Whether a command is a raw frame for a resource that must be refreshed.
fn is_raw_drive(board: &Board, command: &Command) -> bool {
    board.is_opaque(command) && board.is_drive(command)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Move;

    /// Millions of them are in memory at once, and a `Step` becomes an `(Event, u32)` in place.
    #[test]
    fn frequent_types_are_small() {
        assert_eq!(size_of::<Command>(), 16);
        assert_eq!(size_of::<Step>(), 48);
        assert!(size_of::<Event>() <= 40 && size_of::<Move>() <= 88 && size_of::<Tween>() <= 32);
        assert!(size_of::<(Event, u32)>() <= size_of::<Step>() && align_of::<(Event, u32)>() == align_of::<Step>());
    }
}
