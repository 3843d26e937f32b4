//! Gates: the clock of the script is stopped, the drive is refreshed, and what happens next depends on reports and on the operator.

use super::super::gate::{Closed, GateEnd, HOUR, Passage};
use super::super::messages::{Cause, Input, Notice, Order};
use super::together::Together;
use super::{Phase, Player};
use crate::board::{Hundredths, Report};
use crate::source::Span;
use crate::timeline::{Cut, Event, Gate};
use crate::units::Nanos;

impl<'t> Player<'t> {
    /// The index of the gate that is closed, if one is.
    pub fn closed_gate(&self) -> Option<usize> {
        self.closed.map(|closed| closed.gate)
    }

    /// Whether a gate waits for the operator, and the run is not paused.
    pub fn waits_for_go(&self) -> bool {
        let closed = self.closed_gate().and_then(|gate| self.gates.get(gate));
        matches!(self.phase, Phase::Playing) && closed.is_some_and(|gate| gate.gate.is_go())
    }

    /// Whether something has happened that ends the closed gate.
    pub fn is_gate_ending(&self) -> bool {
        matches!(self.phase, Phase::Playing) && self.closed.is_some_and(|closed| closed.is_ending())
    }

    /// In a rehearsal: from now on, reports have this value at the closed gate instead of their own; `None` for no value.
    pub fn answer(&mut self, value: Option<Hundredths>) {
        if let Some(closed) = &mut self.closed {
            closed.answer(value);
        }
    }

    /// The position in the script of the closed gate.
    pub(super) fn closed_span(&self) -> Option<Span> {
        self.closed_parts().map(|(_, gate)| gate.span)
    }

    /// The time of the script at which its clock is stopped.
    pub(super) fn gate_time(&self) -> Option<Nanos> {
        let gate = self.closed_gate()?;
        self.gates.get(gate).map(|gate| gate.at.nanos())
    }

    pub(super) fn hear_at_gate(&mut self, now: Nanos, report: Report, notices: &mut impl FnMut(Notice)) {
        let Some(closed) = &mut self.closed else { return };
        let Some(gate) = self.gates.get(closed.gate) else { return };
        if let Some(value) = closed.hear(now, gate, &report) {
            notices(Notice::Measured { gate: closed.gate, value });
        }
    }

    /// Stops the clock of the script at the next gate.
    pub(super) fn close_gate(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) {
        let Some(gate) = self.gates.get(self.next_gate) else { return };
        let criterion = gate.gate.criterion();
        let meter = criterion.map(|criterion| self.judge.meter(&criterion.measured, now)).unwrap_or_default();
        self.closed = Some(Closed::new(self.next_gate, now, meter, self.together != Together::Alone));
        notices(Notice::Waiting { gate: self.next_gate });
    }

    /// The operator says go, or cannot any more.
    pub(super) fn note_go(&mut self, input: Input) {
        let Some(closed) = &mut self.closed else { return };
        match (input, self.gates.get(closed.gate)) {
            (Input::Go, Some(gate)) => closed.go(gate),
            (Input::GoEnded, _) => closed.end_of_input(),
            _ => {}
        }
    }

    pub(super) fn wait_at_gate(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Order {
        // Also if something opens the gate: the robot may have stopped already, and must not start again by itself.
        if let Some(late) = self.refresh_due().map(|due| now.saturating_sub(due)).filter(|late| *late > self.max_late) {
            return self.end_early(Cause::Late(late), now);
        }
        self.release_gate(now);
        let drives = self.state.drives(self.board);
        self.closed.iter_mut().for_each(Closed::forget_news);
        match self.end_gate(now, drives, notices) {
            None => {}
            Some(passage) if passage.end.is_open() => {
                let at = self.gate_time().unwrap_or_default();
                self.leave_gate();
                let since = self.release.take().unwrap_or(now);
                self.set_clock(at, since);
                // The last frame of the drive may be too old for what comes next.
                self.refresh_drive(now, notices, |player, resource, due| player.next_frame(resource) > due);
                return self.play(now, Input::Tick, notices);
            }
            Some(passage) => {
                let order = self.end_early(Cause::Gate(passage), now);
                self.closed = None;
                return order;
            }
        }
        self.refresh_drive(now, notices, |_, _, due| now >= due);
        if let Some(cause) = self.miss_answers(now, notices) {
            return self.end_early(cause, now);
        }
        if !self.out.is_empty() || self.ask(now, self.refresh_due(), notices) {
            return Order::Write;
        }
        let ends = self.closed_parts().and_then(|(closed, gate)| closed.due(now, gate, drives));
        let until = ends.into_iter().chain(self.refresh_due()).chain(self.release).min();
        self.wait_or_ask(until.unwrap_or_else(|| now.saturating_add(HOUR)), now)
    }

    pub(super) fn closed_parts(&self) -> Option<(&Closed, &'t Gate)> {
        let closed = self.closed.as_ref()?;
        Some((closed, self.gates.get(closed.gate)?))
    }

    /// How the closed gate ends now, if it does.
    fn end_gate(&self, now: Nanos, drives: bool, notices: &mut impl FnMut(Notice)) -> Option<Passage> {
        let (closed, gate) = self.closed_parts()?;
        // All robots continue soon.
        if self.release.is_some_and(|at| now < at) {
            return None;
        }
        let passage = Passage { gate: closed.gate, took: closed.took(now), end: closed.end(now, gate, drives)? };
        notices(Notice::Passed(passage));
        Some(passage)
    }

    /// The closed gate is a step: the operator opens it, whatever it waits for.
    pub(super) fn step_through_gate(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Order> {
        let closed = self.closed.as_ref()?;
        notices(Notice::Passed(Passage { gate: closed.gate, took: closed.took(now), end: GateEnd::Go }));
        self.release = None;
        self.leave_gate();
        Some(Order::Stay)
    }

    /// Reports a gate that is closed at the end of the run.
    pub(super) fn stop_at_gate(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) {
        if matches!(self.phase, Phase::Ending(..) | Phase::Done(_))
            && let Some(closed) = self.closed.take()
        {
            let passage = Passage { gate: closed.gate, took: closed.took(now), end: GateEnd::Stopped };
            notices(Notice::Passed(passage));
        }
    }

    /// The closed gate opens, because all robots continue.
    pub(super) fn pass_gate(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) {
        let (Some(closed), Some(gate)) = (&mut self.closed, self.gates.get(self.next_gate)) else { return };
        let end = closed.release(now, gate);
        notices(Notice::Passed(Passage { gate: closed.gate, took: closed.took(now), end }));
        self.leave_gate();
    }

    fn leave_gate(&mut self) {
        self.closed = None;
        self.next_gate += 1;
        self.limit = self.gates.get(self.next_gate).map_or_else(
            || Cut { events: self.events.len(), cues: self.cues.len(), marks: self.marks.len(), expects: usize::MAX },
            |gate| gate.next,
        );
    }

    /// Remembers the event that sets a drive, and when its frame was sent.
    pub(super) fn note_drive(&mut self, event: &Event, index: usize, now: Nanos) {
        for resource in self.board.touches(&event.command) {
            if let Some(driven) = self.driven.get_mut(*resource) {
                *driven = (index, now);
            }
        }
    }

    /// Whether the next gate is due, so that reports that came before it must be read first.
    pub(super) fn closes_at(&self, time: Nanos) -> bool {
        self.closed.is_none() && self.gates.get(self.next_gate).is_some_and(|gate| gate.at.nanos() <= time)
    }

    /// When the next frame of the drive is due at a closed gate.
    fn refresh_due(&self) -> Option<Nanos> {
        let driving = self.state.active(self.board).map(|(resource, _)| resource);
        driving.filter_map(|resource| self.refresh_of(resource)).min()
    }

    /// When the frame of a resource is due again; `None` if it is not refreshed.
    fn refresh_of(&self, resource: usize) -> Option<Nanos> {
        let refresh = self.refresh.get(resource).copied().flatten()?;
        let (_, sent) = self.driven.get(resource)?;
        Some(sent.saturating_add(refresh.nanos()))
    }

    /// Sends the last frame of each drive again that `wants` it; `wants` gets the resource and when its next refresh is due.
    fn refresh_drive(
        &mut self,
        now: Nanos,
        notices: &mut impl FnMut(Notice),
        wants: impl Fn(&Self, usize, Nanos) -> bool,
    ) {
        for resource in 0..self.driven.len() {
            let (Some((event, _)), Some(due)) = (self.driven.get(resource).copied(), self.refresh_of(resource)) else {
                continue;
            };
            let command = self.state.last(resource).filter(|command| self.board.keeps_driving(command));
            let Some(command) = command.filter(|_| wants(self, resource, due)) else { continue };
            self.out.push(|bytes| self.board.encode(command, bytes));
            self.due = now;
            self.extra += 1;
            if let Some(driven) = self.driven.get_mut(resource) {
                driven.1 = now;
            }
            notices(Notice::Refreshed { event });
        }
    }

    /// When the next frame of a resource comes, on the clock of the run, or else the next gate or the end of the pass.
    fn next_frame(&self, resource: usize) -> Nanos {
        let next = self.coming().iter().find(|event| self.board.touches(&event.command).contains(&resource));
        let end = self.gates.get(self.next_gate).map_or(self.end, |gate| gate.at.nanos());
        self.run_clock(next.map_or(end, |event| event.at.nanos()))
    }
}
