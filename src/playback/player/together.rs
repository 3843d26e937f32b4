//! Playing together with other robots: a conductor tells all players when time 0 is, when a gate opens, and when a paused run
//! continues, so that the clocks of all scripts are the same.

use super::super::gate::HOUR;
use super::super::messages::{Cause, Input, Notice, Order, Outcome, Standing, Stop};
use super::{Phase, Player, due};
use crate::timeline::Kind;
use crate::units::Nanos;

/// Whether other robots play the same script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Together {
    /// No.
    Alone,
    /// Yes, and time 0 of the script has not come yet.
    Starting,
    /// Yes.
    Playing,
}

impl Player<'_> {
    /// Plays together with others: waits for [`Input::Together`] at time 0, at every gate and after every pause.
    #[must_use]
    pub fn together(mut self) -> Self {
        self.together = Together::Starting;
        self
    }

    /// What it waits for, at `now` from the start.
    pub fn standing(&self, now: Nanos) -> Standing {
        match self.phase {
            Phase::Ending(..) => Standing::Ending,
            Phase::Done(outcome) => Standing::Done { is_early: outcome.cause != Cause::Finished },
            // It continues soon.
            Phase::Paused(_) if self.resume.is_some() => Standing::Busy,
            Phase::Paused(at) => {
                let next = self.next_step().map(|(at, is_gate)| (self.passed + at, is_gate));
                let prepares = self.start.is_pending();
                Standing::Paused { at: self.passed + at, next, prepares, is_asleep: false }
            }
            Phase::Playing if self.release.is_some() => Standing::Busy,
            Phase::Playing => match (self.closed_parts(), self.together) {
                (Some((closed, gate)), _) => {
                    let fits_until = closed.fits_until(gate);
                    let has_expired = closed.has_expired(now, gate);
                    let is_go = gate.gate.is_go();
                    Standing::AtGate { pass: self.pass, gate: closed.gate, fits_until, is_go, has_expired }
                }
                (None, Together::Starting) if self.is_ready() => Standing::Ready,
                (None, _) => Standing::Busy,
            },
            Phase::Pausing(..) | Phase::Stepping(_) => Standing::Busy,
        }
    }

    /// The outcome of a run that ends before anything was sent.
    pub fn never_began(&self, cause: Cause) -> Outcome {
        Outcome { stop: Stop::NotNeeded, ..self.outcome_at(cause, Nanos::ZERO) }
    }

    /// Whether everything before time 0 has happened.
    fn is_ready(&self) -> bool {
        let has_hello = self.next >= self.board.hello.len();
        has_hello && self.out.is_empty() && !self.start.is_pending() && !self.reads.holds_start()
    }

    /// The time of the next step of a pause, and whether it is a gate.
    pub(super) fn next_step(&self) -> Option<(Nanos, bool)> {
        if self.start.is_pending() {
            return Some((Nanos::ZERO, false));
        }
        if let Some(at) = self.gate_time() {
            return Some((at, true));
        }
        let events = self.events.get(self.next..self.limit.events).unwrap_or_default();
        let event = events.iter().find(|event| event.kind != Kind::Refresh).map(|event| (due(event), false));
        event.or_else(|| self.gates.get(self.next_gate).map(|gate| (gate.at.nanos(), true)))
    }

    /// Takes the time at which all robots continue.
    pub(super) fn note_together(&mut self, input: Input) {
        if let Input::Together { at } = input {
            self.release = Some(at);
        }
    }

    /// Opens the closed gate if the time has come at which all robots continue.
    pub(super) fn release_gate(&mut self, now: Nanos) {
        if self.release.is_some_and(|at| now >= at)
            && let Some(closed) = &mut self.closed
            && let Some(gate) = self.gates.get(closed.gate)
        {
            closed.release(now, gate);
        }
    }

    /// Before time 0: sends the hello of the board, and waits for the others. `None` once time 0 is set.
    pub(super) fn wait_for_others(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Order> {
        if self.together != Together::Starting {
            return None;
        }
        if self.next < self.board.hello.len() {
            // Only the hello comes before time 0, and it is not late.
            let _ = self.gather(Nanos::ZERO, now, notices);
            self.due = now;
            return Some(Order::Write);
        }
        let Some(at) = self.release.take_if(|at| now >= *at) else {
            if let Some(cause) = self.miss_answers(now, notices) {
                return Some(self.end_early(cause, now));
            }
            let until = self.reads.misses_first().into_iter().chain(self.release).min();
            return Some(Order::Wait { until: until.unwrap_or_else(|| now.saturating_add(HOUR)), writable: false });
        };
        self.together = Together::Playing;
        self.reads.leave_clock();
        self.set_clock(Nanos::ZERO, at);
        notices(Notice::Began);
        None
    }

    /// Whether time 0 of the script is not known yet.
    pub(super) fn waits_for_others(&self) -> bool {
        self.together == Together::Starting
    }

    /// Time 0 of the script has come by a step of a pause.
    pub(super) fn begin_by_step(&mut self) {
        self.release = None;
        if self.together == Together::Starting {
            self.together = Together::Playing;
            self.reads.leave_clock();
        }
    }

    /// A paused run continues at the time of the others. If they have passed time 0 or the closed gate meanwhile, so does it.
    pub(super) fn catch_up(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) {
        if self.release.take().is_none() {
            return;
        }
        if self.closed.is_some() {
            self.pass_gate(now, notices);
        } else if self.together == Together::Starting {
            self.together = Together::Playing;
            self.reads.leave_clock();
            notices(Notice::Began);
        }
    }
}
