//! Decides what to send, as a pure function of time and inputs.
//!
//! A frame later than the limit is not sent, and the run ends. A sample or a refresh is dropped if a newer frame for the same
//! resource is due. Every early end and every pause is a [`Halt`]. At a gate, the clock of the script is stopped.

mod gates;
mod pauses;
mod reads;
mod said;
mod start;
mod together;
mod torque;

use super::gate::Closed;
use super::halt::{Halt, Stops};
use super::judge::Judge;
use super::messages::{Cause, Input, Notice, Order, Outcome, ServoFault, ServoFaultKind, Stop};
use super::outbox::Outbox;
use crate::board::{Board, Report, ServoSet, State};
use crate::source::Span;
use crate::timeline::{Cue, Cut, Event, Gate, Kind, Mark, Timeline};
use crate::units::{Micros, Nanos};
use reads::Reads;
use start::Start;
use together::Together;
use torque::{Enabling, Held};

/// Plays one timeline.
#[derive(Debug)]
pub struct Player<'t> {
    board: &'t Board,
    events: &'t [Event],
    stops: Stops,
    cues: &'t [Cue],
    marks: &'t [Mark],
    gates: &'t [Gate],
    judge: Judge<'t>,
    reads: Reads,
    start: Start<'t>,
    /// The servo whose torque is being switched on.
    enabling: Option<Enabling>,
    /// What a stop holds.
    held: Held,
    /// The command that switches torque on, until the port has accepted it.
    switching: Option<usize>,
    timeline: &'t Timeline,
    /// How often the command of each resource is sent again at a closed gate.
    refresh: &'t [Option<Micros>],
    /// The repeated pass of an endless run.
    again: Option<&'t Timeline>,
    together: Together,
    /// When all robots continue, on the clock of the run.
    release: Option<Nanos>,
    /// The time of the script at which a paused run continues, and when that is, on the clock of the run.
    resume: Option<(Nanos, Nanos)>,
    /// The commands sent to the board, in this pass and earlier ones.
    state: State,
    pass: u64,
    /// The duration of the earlier passes.
    passed: Nanos,
    end: Nanos,
    max_late: Nanos,
    phase: Phase,
    /// Time 0 of the script, in nanoseconds from the start, moved by the pauses; negative if steps of a pause were ahead of time.
    origin: i64,
    /// The next event.
    next: usize,
    next_cue: usize,
    next_mark: usize,
    next_gate: usize,
    /// What comes after the next gate, or the end of the pass.
    limit: Cut,
    /// The gate that is closed.
    closed: Option<Closed>,
    /// For each resource that must be refreshed, the last event that set it, and when its frame was sent last, on the clock of
    /// the run.
    driven: Vec<(usize, Nanos)>,
    /// When marks and `say` lines were reported last, and how many since then, in the last millisecond.
    said: (Nanos, usize),
    out: Outbox,
    /// When the bytes in `out` were due, on the clock of the run.
    due: Nanos,
    /// How many frames of the timeline are in `out`.
    pending: usize,
    /// The last event that was processed.
    last: Option<usize>,
    sent: usize,
    dropped: usize,
    extra: usize,
    /// Whether a servo got a command, or none is prepared.
    has_moved: bool,
    worst_late: Nanos,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Playing,
    /// Stopping the robot at the end of the run.
    Ending(Halt, Outcome),
    /// Stopping the robot for a pause, at a time of the script; how the run ends if that fails, and whether the process is
    /// suspended.
    Pausing(Halt, Nanos, Outcome, bool),
    /// Playing one step of a pause, up to a time of the script.
    Stepping(Nanos),
    /// Paused at a time of the script.
    Paused(Nanos),
    Done(Outcome),
}

impl<'t> Player<'t> {
    /// A player for `timeline`. A frame later than `max_late` ends the run.
    pub fn new(timeline: &'t Timeline, max_late: Nanos) -> Self {
        let board = &*timeline.board;
        let commands = timeline.events.iter().map(|event| &event.command);
        Player {
            board,
            events: &timeline.events,
            stops: Stops::of(&timeline.board, &timeline.abort),
            cues: &timeline.cues,
            marks: &timeline.marks,
            gates: &timeline.gates,
            judge: Judge::new(&timeline.expects, board.quantities.len()),
            reads: Reads::of(timeline),
            start: Start::of(timeline, None),
            enabling: None,
            held: Held::default(),
            switching: None,
            timeline,
            refresh: &timeline.refresh,
            again: None,
            together: Together::Alone,
            release: None,
            resume: None,
            state: State::new(board),
            pass: 1,
            passed: Nanos::ZERO,
            end: timeline.end.nanos(),
            max_late,
            phase: Phase::Playing,
            origin: 0,
            next: 0,
            next_cue: 0,
            next_mark: 0,
            next_gate: 0,
            limit: first_limit(timeline),
            closed: None,
            driven: vec![(0, Nanos::ZERO); board.resources.len()],
            said: (Nanos::ZERO, 0),
            out: Outbox::new(board.zeros_after_flush(commands), board.codec.longest()),
            due: Nanos::ZERO,
            pending: 0,
            last: None,
            sent: 0,
            dropped: 0,
            extra: 0,
            has_moved: false,
            worst_late: Nanos::ZERO,
        }
    }

    /// Repeats `again` forever after the timeline. A pass that takes no time and has no gate is ignored.
    #[must_use]
    pub fn again_and_again(mut self, again: &'t Timeline) -> Self {
        self.judge.make_room(again.expects.len());
        let commands = again.events.iter().map(|event| &event.command);
        self.out.needs_zeros(self.board.zeros_after_flush(commands));
        self.start = Start::of(self.timeline, Some(again));
        self.again = Some(again).filter(|again| again.end > Micros::ZERO || !again.gates.is_empty());
        self
    }

    /// Starts the next pass exactly at the end of the last one. Marks that the last one had no time to report are left out.
    fn next_pass(&mut self, again: &'t Timeline, notices: &mut impl FnMut(Notice)) {
        self.origin = self.origin.saturating_add_unsigned(self.end.0);
        self.passed += self.end;
        self.pass += 1;
        self.events = &again.events;
        self.cues = &again.cues;
        self.marks = &again.marks;
        self.gates = &again.gates;
        self.limit = first_limit(again);
        self.judge.restart(&again.expects);
        self.end = again.end.nanos();
        (self.next, self.next_cue, self.next_mark, self.next_gate, self.last) = (0, 0, 0, 0, None);
        notices(Notice::Pass { pass: self.pass });
    }

    /// The board of the timeline.
    pub fn board(&self) -> &'t Board {
        self.board
    }

    /// The bytes that the port has not accepted.
    pub fn bytes(&self) -> &[u8] {
        self.out.rest()
    }

    /// How the run ended, once it has.
    pub fn outcome(&self) -> Option<Outcome> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// The position in the script of the last command that was processed.
    pub fn place(&self) -> Option<Span> {
        self.span(self.last)
    }

    /// The time of the script at `now`.
    pub fn script_time(&self, now: Nanos) -> Nanos {
        match self.phase {
            Phase::Pausing(_, at, ..) | Phase::Paused(at) | Phase::Stepping(at) => at,
            Phase::Playing if self.start.is_pending() || self.waits_for_others() => Nanos::ZERO,
            _ => self.gate_time().unwrap_or_else(|| self.since_origin(now)),
        }
    }

    /// The time of the run at `now`: the time of the script and the earlier passes.
    pub fn run_time(&self, now: Nanos) -> Nanos {
        self.passed + self.script_time(now)
    }

    /// Takes a report of the board, received at `now` from the start.
    pub fn hear(&mut self, now: Nanos, report: Report, mut notices: &mut dyn FnMut(Notice)) {
        let notices = &mut notices;
        notices(Notice::Report(report));
        let time = self.script_time(now);
        match self.phase {
            Phase::Playing => self.judge.hear(time, now, report, &mut |verdict| notices(Notice::Judged(verdict))),
            // After the end and during a pause, nothing is judged, but the newest report is kept.
            _ => self.judge.note(now, report),
        }
        self.hear_at_gate(now, report, notices);
    }

    /// Whether only the answer of the board is missing.
    fn is_over(&self) -> bool {
        matches!(self.phase, Phase::Playing) && self.next >= self.events.len()
    }

    /// Whether an `expect` or a gate is due at `now`, so that received reports must be read first.
    pub fn judges_at(&self, now: Nanos) -> bool {
        let time = self.since_origin(now);
        let judges = self.judge.next_due(self.limit.expects).is_some_and(|due| due <= time);
        let has_begun = !self.start.is_pending() && !self.waits_for_others();
        matches!(self.phase, Phase::Playing) && has_begun && (judges || self.closes_at(time))
    }

    /// The time of a running script at `now`.
    fn since_origin(&self, now: Nanos) -> Nanos {
        Nanos(now.0.checked_add_signed(self.origin.saturating_neg()).unwrap_or(0))
    }

    /// Processes an input at `now` from the start, and returns the next order.
    pub fn poll(&mut self, now: Nanos, input: Input, mut notices: &mut dyn FnMut(Notice)) -> Order {
        // One copy of the code for all callers.
        let notices = &mut notices;
        if input == Input::Help {
            notices(Notice::Help);
        }
        self.note_together(input);
        let order = self.act(now, input, notices);
        self.stop_at_gate(now, notices);
        order
    }

    fn act(&mut self, now: Nanos, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        let has_begun = !self.start.is_pending() && !self.waits_for_others();
        match &mut self.phase {
            Phase::Playing => self.play(now, input, notices),
            Phase::Ending(halt, outcome) => match halt.poll(now, input, &mut self.stops, &mut self.out) {
                Some(order) => order,
                None => {
                    let (stop, extra) = (halt.stop(&self.stops), outcome.extra + halt.frames());
                    let missing = self.stops.missing();
                    // What happens before the first command of a run needs no stop.
                    let stop = if has_begun || self.has_moved { stop } else { Stop::NotNeeded };
                    let outcome = Outcome { stop, missing, extra, aborted: halt.has_aborted(), ..*outcome };
                    self.done(outcome)
                }
            },
            Phase::Pausing(halt, at, outcome, sleeps) => {
                if let Some(cause) = input.end() {
                    return self.end_early(cause, now);
                }
                *sleeps |= input == Input::Suspend;
                let (at, outcome, sleeps) = (*at, *outcome, *sleeps);
                match (halt.poll(now, input, &mut self.stops, &mut self.out), halt.stop(&self.stops)) {
                    (Some(order), _) => order,
                    // End the run, because the robot may still be moving.
                    (None, Stop::NotSent) => self.done(Outcome { missing: self.stops.missing(), ..outcome }),
                    (None, Stop::NotHeld) => {
                        self.extra += halt.frames();
                        let servo = self.stops.missing().iter().next().unwrap_or_default();
                        self.end_early(Cause::Servo(ServoFault { servo, kind: ServoFaultKind::Silent }), now)
                    }
                    (None, _) => {
                        self.extra += halt.frames();
                        self.phase = Phase::Paused(at);
                        if sleeps { Order::Suspend } else { Order::Stay }
                    }
                }
            }
            Phase::Paused(at) => {
                let at = *at;
                self.stand(at, now, input, notices)
            }
            Phase::Stepping(at) => {
                let at = *at;
                self.stepping(at, now, input, notices)
            }
            Phase::Done(_) => Order::Done,
        }
    }

    /// Ends the run at once, for a session that cannot continue.
    pub fn give_up(&self, now: Nanos) -> Outcome {
        self.outcome_at(Cause::Panicked, self.script_time(now))
    }

    fn play(&mut self, now: Nanos, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        if let Some(cause) = input.end() {
            return self.end_early(cause, now);
        }
        let time = self.script_time(now);
        if matches!(input, Input::Suspend | Input::Pause) {
            return self.pause(time, now, input == Input::Suspend);
        }
        self.note_go(input);
        if let Some(order) = self.write(now, input) {
            return order;
        }
        if self.closed.is_some() {
            return self.wait_at_gate(now, notices);
        }
        if self.reads.holds_start() {
            return self.wait_for_first(now, notices);
        }
        if let Some(order) = self.prepare(now, notices).or_else(|| self.enable(now, notices)) {
            return order;
        }
        let time = match self.wait_for_others(now, notices) {
            Some(order) => return order,
            None => self.begin(self.script_time(now), now, notices),
        };
        self.say(time, now, notices);
        // Judged before frames that are due at the same time are sent.
        let mut judged = |verdict| notices(Notice::Judged(verdict));
        if let Some(failed) = self.judge.poll(self.limit.expects, (time, now), &mut judged) {
            return self.end_early(Cause::Expect(failed), now);
        }
        if let Some(late) = self.gather(time, now, notices) {
            return self.end_early(Cause::Late(late), now);
        }
        if !self.out.is_empty() {
            return Order::Write;
        }
        let next_event = self.coming().first().map(due);
        // The next pass begins at its time.
        let next_said = self.next_said().filter(|_| time < self.end || self.again.is_none());
        let next_expect = self.judge.next_due(self.limit.expects);
        if let Some(cause) = self.miss_answers(now, notices) {
            return self.end_early(cause, now);
        }
        if self.ask(now, next_event.map(|due| self.run_clock(due)), notices) {
            return Order::Write;
        }
        match next_event.into_iter().chain(next_said).chain(next_expect).min() {
            Some(until) => self.wait_or_ask(self.run_clock(until), now),
            None => self.go_on(time, now, notices),
        }
    }

    /// Everything before the next gate, or of the pass, has happened.
    fn go_on(&mut self, time: Nanos, now: Nanos, notices: &mut impl FnMut(Notice)) -> Order {
        let gate = self.gates.get(self.next_gate).map(|gate| gate.at.nanos());
        let until = gate.unwrap_or(self.end);
        match (gate, self.again) {
            _ if time < until => self.wait_or_ask(self.run_clock(until), now),
            (Some(_), _) => {
                self.close_gate(now, notices);
                self.wait_at_gate(now, notices)
            }
            (None, Some(again)) => {
                self.next_pass(again, notices);
                // The first frames of the next pass are due now.
                self.wait(Nanos::ZERO, false)
            }
            // The operator should know if the board did not answer.
            (None, None) if let Some(until) = self.reads.misses_first() => Order::Wait { until, writable: false },
            (None, None) => self.done(Outcome { stop: Stop::NotNeeded, ..self.outcome_at(Cause::Finished, time) }),
        }
    }

    /// What to do until the port has accepted all bytes; `None` once it has.
    fn write(&mut self, now: Nanos, input: Input) -> Option<Order> {
        if let Input::Wrote(count) = input
            && self.out.took(count)
        {
            self.sent += std::mem::take(&mut self.pending);
            self.held.accept();
            self.switching = None;
        }
        let give_up = self.due.saturating_add(self.max_late);
        match input {
            _ if self.out.is_empty() => None,
            _ if now > give_up => Some(self.end_early(Cause::Stalled, now)),
            Input::Blocked => Some(Order::Wait { until: give_up + Nanos(1), writable: true }),
            _ => Some(Order::Write),
        }
    }

    /// The events that come before the next gate.
    fn coming(&self) -> &'t [Event] {
        let end = if self.waits_for_others() { self.board.hello.len() } else { self.limit.events };
        self.events.get(self.next..end).unwrap_or_default()
    }

    /// Sets the clock of the script.
    fn set_clock(&mut self, time: Nanos, now: Nanos) {
        self.origin = i64::try_from(now.0).unwrap_or(i64::MAX).saturating_sub_unsigned(time.0);
    }

    /// A time of the script as a time of the run.
    fn run_clock(&self, time: Nanos) -> Nanos {
        Nanos(time.0.saturating_add_signed(self.origin))
    }

    /// An order to wait until a time of the script.
    fn wait(&self, until: Nanos, writable: bool) -> Order {
        Order::Wait { until: self.run_clock(until), writable }
    }

    /// Processes every event that is due. Returns the lateness of one that is too late.
    fn gather(&mut self, time: Nanos, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Nanos> {
        let rest = self.coming();
        let is_due = rest.iter().take_while(|event| due(event) <= time).count();
        let ready = rest.get(..is_due).unwrap_or_default();
        for (at, event) in ready.iter().enumerate() {
            let index = self.next;
            let late = time - due(event);
            // Also for a frame that would be dropped: the robot may have stopped already, and must not start again by itself.
            if late > self.max_late {
                return Some(late);
            }
            let may_drop = matches!(event.kind, Kind::Sample | Kind::Refresh);
            // A frame that is due at the same time does not replace it.
            let is_newer =
                |newer: &Event| due(newer) > due(event) && self.board.supersedes(&newer.command, &event.command);
            if may_drop && ready.iter().skip(at + 1).any(is_newer) {
                self.take(event);
                self.dropped += 1;
                notices(Notice::Dropped { event: index });
                continue;
            }
            if self.out.is_full() || self.must_wait_for_torque(&event.command, now, notices) {
                break;
            }
            if self.out.is_empty() {
                self.due = self.run_clock(due(event));
            }
            self.out.push(|bytes| self.board.encode(&event.command, bytes));
            self.take(event);
            self.note_drive(event, index, now);
            self.note_servo(event);
            if event.kind == Kind::Auto {
                self.reads.note_sent(&event.command, now);
            }
            self.pending += 1;
            if self.reads.holds_start() {
                notices(Notice::Sent { event: index, late });
                break;
            }
            self.last = Some(index);
            self.worst_late = self.worst_late.max(late);
            notices(Notice::Sent { event: index, late });
            if self.board.reads_first(&event.command) {
                self.switching = Some(index);
                break;
            }
        }
        None
    }

    /// Moves to the next event, and applies this one to the state.
    fn take(&mut self, event: &Event) {
        self.next += 1;
        self.state.apply(self.board, &event.command);
    }

    fn span(&self, event: Option<usize>) -> Option<Span> {
        Some(self.events.get(event?)?.span)
    }

    /// The outcome of a run that ends now, before the robot is stopped.
    fn outcome_at(&self, cause: Cause, time: Nanos) -> Outcome {
        let place = match cause {
            Cause::Late(_) => Some(self.next),
            _ => self.last,
        };
        Outcome {
            cause,
            at: (self.passed + time).micros(),
            place: self.closed_span().or(self.span(place)),
            stop: Stop::NotSent,
            missing: ServoSet::default(),
            sent: self.sent,
            dropped: self.dropped,
            extra: self.extra,
            aborted: false,
            worst_late: self.worst_late,
        }
    }

    fn done(&mut self, outcome: Outcome) -> Order {
        self.phase = Phase::Done(outcome);
        Order::Done
    }

    fn end_early(&mut self, cause: Cause, now: Nanos) -> Order {
        let outcome = self.outcome_at(cause, self.script_time(now));
        self.has_moved |= !self.start.is_pending() && !self.waits_for_others();
        self.halt(Phase::Ending(Halt::new(self.has_moved, now), outcome))
    }

    fn halt(&mut self, phase: Phase) -> Order {
        self.phase = phase;
        self.pending = 0;
        self.hold();
        if !self.board.flushes {
            // Bytes after a truncated frame would be an error of the board.
            self.out.keep_begun(&*self.board.codec);
            return Order::Halt { discards: false };
        }
        self.out.clear();
        Order::Halt { discards: true }
    }
}

/// What comes after the first gate of a timeline, or its end.
fn first_limit(timeline: &Timeline) -> Cut {
    timeline.gates.first().map_or_else(|| Cut::end(timeline), |gate| gate.next)
}

/// When an event is due, from the start of the script.
fn due(event: &Event) -> Nanos {
    event.at.nanos()
}
