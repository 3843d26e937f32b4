//! Decides what to send, as a pure function of time and inputs.
//!
//! A frame later than the limit is not sent, and the run ends. A sample or a refresh is dropped if a newer frame for the same
//! resource is due. Every early end and every pause is a [`Halt`].

use super::halt::{Halt, Outbox, Stops};
use super::judge::Judge;
use super::messages::{Cause, Input, Notice, Order, Outcome, SIGTSTP, Stop};
use crate::board::{Board, Report, State};
use crate::source::Span;
use crate::timeline::{Cue, Event, Kind, Mark, Timeline};
use crate::units::{Micros, Nanos};

/// Plays one timeline.
#[derive(Debug)]
pub struct Player<'t> {
    board: &'t Board,
    events: &'t [Event],
    stops: Stops,
    cues: &'t [Cue],
    marks: &'t [Mark],
    judge: Judge<'t>,
    /// The repeated pass of an endless run.
    again: Option<&'t Timeline>,
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
    /// When marks and `say` lines were reported last, and how many since then, for less than [`SAY_EVERY`].
    said: (Nanos, usize),
    out: Outbox,
    /// When the bytes in `out` were due, in the time of the script.
    due: Nanos,
    /// How many frames of the timeline are in `out`.
    pending: usize,
    /// The last event that was processed.
    last: Option<usize>,
    sent: usize,
    dropped: usize,
    extra: usize,
    worst_late: Nanos,
}

/// The most marks and `say` lines that are reported in a time, so that a script with thousands of them at one moment delays no frame
/// and leaves room for the notices of the frames. The others follow.
const SAY_MOST: usize = 32;
const SAY_EVERY: Nanos = Nanos::from_millis(1);

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
            stops: Stops::of(board, &timeline.abort),
            cues: &timeline.cues,
            marks: &timeline.marks,
            judge: Judge::new(&timeline.expects),
            again: None,
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
            said: (Nanos::ZERO, 0),
            out: Outbox::new(board.zeros_after_flush(commands), board.codec.longest),
            due: Nanos::ZERO,
            pending: 0,
            last: None,
            sent: 0,
            dropped: 0,
            extra: 0,
            worst_late: Nanos::ZERO,
        }
    }

    /// Repeats `again` forever after the timeline. A pass that takes no time is ignored.
    #[must_use]
    pub fn again_and_again(mut self, again: &'t Timeline) -> Self {
        self.judge.make_room(again.expects.len());
        let commands = again.events.iter().map(|event| &event.command);
        self.out.needs_zeros(self.board.zeros_after_flush(commands));
        self.again = Some(again).filter(|again| again.end > Micros::ZERO);
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
        self.judge.restart(&again.expects);
        self.end = again.end.nanos();
        (self.next, self.next_cue, self.next_mark, self.last) = (0, 0, 0, None);
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
            _ => self.since_origin(now),
        }
    }

    /// The time of the run at `now`: the time of the script and the earlier passes.
    pub fn run_time(&self, now: Nanos) -> Nanos {
        self.passed + self.script_time(now)
    }

    /// Takes a report of the board, received at `now` from the start.
    pub fn hear(&mut self, now: Nanos, report: Report, notices: &mut impl FnMut(Notice)) {
        notices(Notice::Report(report));
        let time = self.script_time(now);
        match self.phase {
            Phase::Playing => self.judge.hear(time, now, report, &mut |verdict| notices(Notice::Judged(verdict))),
            // After the end and during a pause, nothing is judged, but the newest report is kept.
            _ => self.judge.note(now, report),
        }
    }

    /// Whether an `expect` is due at `now`, so that received reports must be read first.
    pub fn judges_at(&self, now: Nanos) -> bool {
        let is_due = |due: Nanos| due <= self.since_origin(now);
        matches!(self.phase, Phase::Playing) && self.judge.next_due().is_some_and(is_due)
    }

    /// The time of a running script at `now`.
    fn since_origin(&self, now: Nanos) -> Nanos {
        Nanos(now.0.checked_add_signed(self.origin.saturating_neg()).unwrap_or(0))
    }

    /// Processes an input at `now` from the start, and returns the next order.
    pub fn poll(&mut self, now: Nanos, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        if input == Input::Help {
            notices(Notice::Help);
        }
        match &mut self.phase {
            Phase::Playing => self.play(now, input, notices),
            Phase::Ending(halt, outcome) => match halt.poll(now, input, &self.stops, &mut self.out) {
                Some(order) => order,
                None => {
                    let outcome =
                        Outcome { stop: halt.stop(&self.stops), extra: outcome.extra + halt.frames(), ..*outcome };
                    self.done(outcome)
                }
            },
            Phase::Pausing(halt, at, outcome, sleeps) => {
                if let Some(cause) = input.end() {
                    return self.end_early(cause, now);
                }
                let (at, outcome, sleeps) = (*at, *outcome, *sleeps);
                match (halt.poll(now, input, &self.stops, &mut self.out), halt.stop(&self.stops)) {
                    (Some(order), _) => order,
                    // End the run, because the robot may still be moving.
                    (None, Stop::NotSent) => self.done(outcome),
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
                self.stepping(at, now, input)
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
        let time = self.since_origin(now);
        if matches!(input, Input::Suspend | Input::Pause) {
            return self.pause(time, now, input == Input::Suspend);
        }
        if let Input::Wrote(count) = input
            && self.out.took(count)
        {
            self.sent += std::mem::take(&mut self.pending);
        }
        if !self.out.is_empty() {
            let give_up = self.due.saturating_add(self.max_late);
            return match input {
                _ if time > give_up => self.end_early(Cause::Stalled, now),
                Input::Blocked => self.wait(give_up + Nanos(1), true),
                _ => Order::Write,
            };
        }
        self.say(time, now, notices);
        // Judged before frames that are due at the same time are sent.
        if let Some(failed) = self.judge.poll(time, now, &mut |verdict| notices(Notice::Judged(verdict))) {
            return self.end_early(Cause::Expect(failed), now);
        }
        if let Some(late) = self.gather(time, notices) {
            return self.end_early(Cause::Late(late), now);
        }
        if !self.out.is_empty() {
            return Order::Write;
        }
        let next_event = self.events.get(self.next).map(due);
        // The next pass begins at its time.
        let next_said = self.next_said().filter(|_| time < self.end || self.again.is_none());
        match next_event.into_iter().chain(next_said).chain(self.judge.next_due()).min() {
            Some(until) => self.wait(until, false),
            None if time < self.end => self.wait(self.end, false),
            None if self.again.is_some() => {
                if let Some(again) = self.again {
                    self.next_pass(again, notices);
                }
                // The first frames of the next pass are due now.
                self.wait(Nanos::ZERO, false)
            }
            None => self.done(Outcome { stop: Stop::NotNeeded, ..self.outcome_at(Cause::Finished, time) }),
        }
    }

    /// An order to wait until a time of the script.
    fn wait(&self, until: Nanos, writable: bool) -> Order {
        Order::Wait { until: Nanos(until.0.saturating_add_signed(self.origin)), writable }
    }

    /// Reports the marks and the `say` lines up to a time, as many as are permitted `now`.
    fn say(&mut self, time: Nanos, now: Nanos, notices: &mut impl FnMut(Notice)) {
        if now - self.said.0 >= SAY_EVERY {
            self.said = (now, 0);
        }
        while self.said.1 < SAY_MOST && self.marks.get(self.next_mark).is_some_and(|mark| mark.at.nanos() <= time) {
            notices(Notice::Marked { mark: self.next_mark });
            self.next_mark += 1;
            self.said.1 += 1;
        }
        while self.said.1 < SAY_MOST && self.cues.get(self.next_cue).is_some_and(|cue| cue.at.nanos() <= time) {
            notices(Notice::Say { cue: self.next_cue });
            self.next_cue += 1;
            self.said.1 += 1;
        }
    }

    /// When the next mark or `say` line is reported, in the time of the script.
    fn next_said(&self) -> Option<Nanos> {
        let cue = self.cues.get(self.next_cue).map(|cue| cue.at.nanos());
        let mark = self.marks.get(self.next_mark).map(|mark| mark.at.nanos()).filter(|at| *at <= self.end);
        let (since, count) = self.said;
        let permitted = if count < SAY_MOST { Nanos::ZERO } else { self.since_origin(since.saturating_add(SAY_EVERY)) };
        cue.into_iter().chain(mark).min().map(|at| at.max(permitted))
    }

    /// Processes every event that is due. Returns the lateness of one that is too late.
    fn gather(&mut self, time: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Nanos> {
        let rest = self.events.get(self.next..).unwrap_or_default();
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
            if self.out.is_empty() {
                self.due = due(event);
            } else if self.out.is_full() {
                break;
            }
            self.out.push(|bytes| self.board.encode(&event.command, bytes));
            self.take(event);
            self.pending += 1;
            self.last = Some(index);
            self.worst_late = self.worst_late.max(late);
            notices(Notice::Sent { event: index, late });
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
            place: self.span(place),
            stop: Stop::NotSent,
            sent: self.sent,
            dropped: self.dropped,
            extra: self.extra,
            worst_late: self.worst_late,
        }
    }

    fn done(&mut self, outcome: Outcome) -> Order {
        self.phase = Phase::Done(outcome);
        Order::Done
    }

    fn end_early(&mut self, cause: Cause, now: Nanos) -> Order {
        let outcome = self.outcome_at(cause, self.script_time(now));
        self.halt(Phase::Ending(Halt::new(true, now), outcome))
    }

    /// Stops the robot for a pause, without `on abort`.
    fn pause(&mut self, time: Nanos, now: Nanos, sleeps: bool) -> Order {
        let cause = if sleeps { Cause::Signal(SIGTSTP) } else { Cause::Quit };
        let outcome = self.outcome_at(cause, time);
        self.halt(Phase::Pausing(Halt::new(false, now), time, outcome, sleeps))
    }

    fn halt(&mut self, phase: Phase) -> Order {
        self.phase = phase;
        self.out.clear();
        self.pending = 0;
        Order::Discard
    }

    fn stand(&mut self, at: Nanos, now: Nanos, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        match (input.end(), input) {
            (Some(cause), _) => self.end_early(cause, now),
            (None, Input::Suspend) => self.pause(at, now, true),
            (None, Input::Step) => self.step(now, notices),
            (None, Input::Resume) => {
                self.phase = Phase::Playing;
                self.origin = i64::try_from(now.0).unwrap_or(i64::MAX).saturating_sub_unsigned(at.0);
                self.restore(at);
                notices(Notice::Resumed { at: at.micros() });
                self.play(now, Input::Tick, notices)
            }
            _ => Order::Stay,
        }
    }

    /// Plays the next step: all commands of the next time that has any, except drive commands, which apply when the run continues.
    fn step(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Order {
        let rest = self.events.get(self.next..).unwrap_or_default();
        let Some(at) = rest.iter().find(|event| event.kind != Kind::Refresh).map(due) else { return Order::Stay };
        let count = rest.iter().take_while(|event| due(event) <= at).count();
        for event in rest.iter().take(count) {
            let index = self.next;
            self.take(event);
            if self.out.is_full() || self.board.is_drive(&event.command) {
                notices(Notice::Passed { event: index });
                continue;
            }
            self.out.push(|bytes| self.board.encode(&event.command, bytes));
            self.pending += 1;
            self.last = Some(index);
            notices(Notice::Sent { event: index, late: Nanos::ZERO });
        }
        self.say(at, now, notices);
        self.due = now;
        self.phase = Phase::Stepping(at);
        if self.out.is_empty() { self.stepping(at, now, Input::Tick) } else { Order::Write }
    }

    fn stepping(&mut self, at: Nanos, now: Nanos, input: Input) -> Order {
        if let Some(cause) = input.end() {
            return self.end_early(cause, now);
        }
        if let Input::Wrote(count) = input
            && self.out.took(count)
        {
            self.sent += std::mem::take(&mut self.pending);
        }
        let give_up = self.due.saturating_add(self.max_late);
        match input {
            _ if self.out.is_empty() => {
                self.phase = Phase::Paused(at);
                Order::Stay
            }
            _ if now > give_up => self.end_early(Cause::Stalled, now),
            Input::Blocked => Order::Wait { until: give_up + Nanos(1), writable: true },
            _ => Order::Write,
        }
    }

    /// Starts paused, at the start of the script.
    #[must_use]
    pub fn paused(mut self) -> Self {
        self.phase = Phase::Paused(Nanos::ZERO);
        self
    }

    /// Restores the state from before the pause. Commands that were queued then may not have reached the robot.
    fn restore(&mut self, at: Nanos) {
        for command in self.state.commands(self.board) {
            self.out.push(|bytes| self.board.encode(command, bytes));
            self.extra += 1;
        }
        self.due = at;
    }
}

/// When an event is due, from the start of the script.
fn due(event: &Event) -> Nanos {
    event.at.nanos()
}
