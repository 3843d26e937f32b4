//! Several robots of one script: decides what all players do together. Pure: the time and what happened are its inputs.
//!
//! The clocks of all players run freely between the moments at which they wait: before time 0, at a gate, and in a pause. There, each
//! waits until all have arrived, and all continue at the same time.

use super::messages::{Input, Standing};
use crate::units::{Micros, Nanos};

/// How long after a decision the players continue, so that each has its order by then.
const LEAD: Nanos = Micros::from_millis(3).nanos();

/// Decides for the players of all robots.
#[derive(Debug)]
pub struct Conductor {
    standings: Vec<Standing>,
    /// The last gate that was opened: its pass and its index.
    opened: Option<(u64, usize)>,
    /// The robot whose run ended early first.
    first: Option<usize>,
    /// How all players end, once they do.
    end: Option<Input>,
}

impl Conductor {
    /// For this number of robots.
    pub fn new(robots: usize) -> Self {
        Conductor { standings: vec![Standing::Busy; robots], opened: None, first: None, end: None }
    }

    /// Takes what a player waits for.
    pub fn hear(&mut self, robot: usize, standing: Standing) {
        if let Some(place) = self.standings.get_mut(robot) {
            *place = standing;
        }
    }

    /// The robot whose run ended early before all others, if one did.
    pub fn first_ended(&self) -> Option<usize> {
        self.first
    }

    /// Whether all players have ended.
    pub fn is_done(&self) -> bool {
        self.standings.iter().all(|standing| matches!(standing, Standing::Done { .. }))
    }

    /// Whether all players are paused, and the time of the script then.
    pub fn paused_at(&self) -> Option<Nanos> {
        let mut latest = None;
        for standing in self.playing() {
            let Standing::Paused { at, .. } = standing else { return None };
            latest = latest.max(Some(at));
        }
        latest
    }

    /// The gate at which all players wait: its pass and its index.
    pub fn closed_gate(&self) -> Option<(u64, usize)> {
        let mut closed = None;
        for standing in self.playing() {
            let Standing::AtGate { pass, gate, .. } = standing else { return None };
            if closed.replace((pass, gate)).is_some_and(|other| other != (pass, gate)) {
                return None;
            }
        }
        closed.filter(|closed| self.opened.is_none_or(|opened| *closed > opened))
    }

    /// Whether all players wait at a gate for the operator.
    pub fn waits_for_go(&self) -> bool {
        let is_go = |standing| matches!(standing, Standing::AtGate { is_go: true, .. });
        self.closed_gate().is_some() && self.playing().all(is_go)
    }

    fn playing(&self) -> impl Iterator<Item = Standing> {
        self.standings.iter().copied().filter(|standing| !matches!(standing, Standing::Done { .. }))
    }

    /// Whether all robots have their guards, and nothing was sent.
    pub fn is_assembled(&self) -> bool {
        self.playing().all(|standing| standing == Standing::Present) && !self.is_done()
    }

    /// Whether all robots rest, so that the process may be suspended.
    pub fn is_asleep(&self) -> bool {
        let is_asleep = |standing| matches!(standing, Standing::Paused { is_asleep: true, .. });
        self.playing().all(is_asleep) && !self.is_done()
    }

    /// Takes an input of the operator or the system, and passes on what each player does at `now` from the start.
    pub fn poll(&mut self, now: Nanos, input: Input, order: &mut impl FnMut(usize, Input)) {
        if input.end().is_some() {
            self.end.get_or_insert(input);
        }
        let early = self.standings.iter().position(|standing| is_early(*standing));
        self.first = self.first.or(early);
        if let Some(robot) = early {
            self.end.get_or_insert(Input::OtherEnded { robot });
        }
        // Said again until each player stops its robot.
        if let Some(end) = self.end {
            let is_left = |standing: &Standing| !matches!(standing, Standing::Ending | Standing::Done { .. });
            let left = self.standings.iter().enumerate().filter(|(_, standing)| is_left(standing));
            left.for_each(|(robot, _)| order(robot, end));
            return;
        }
        match input {
            Input::Resume => {
                if let Some(run) = self.paused_at() {
                    self.all(order, Input::ResumeTogether { run, at: now.saturating_add(LEAD) });
                }
                return;
            }
            Input::Step => return self.step(order),
            Input::Pause | Input::Suspend | Input::GoEnded => {
                (0..self.standings.len()).for_each(|robot| order(robot, input));
            }
            _ => {}
        }
        if self.is_assembled() {
            self.all(order, Input::Tick);
        }
        if self.playing().all(|standing| standing == Standing::Ready) && !self.is_done() {
            self.together(now, order);
        }
        let is_go = input == Input::Go && self.waits_for_go();
        if let Some(closed) = self.closed_gate().filter(|_| is_go || self.opens(now)) {
            self.opened = Some(closed);
            self.together(now, order);
        }
    }

    /// The next step of a pause: of the robots whose servos are not ready, or else the next time of any robot.
    fn step(&mut self, order: &mut impl FnMut(usize, Input)) {
        if self.paused_at().is_none() {
            return;
        }
        let next = |standing| if let Standing::Paused { next, .. } = standing { next } else { None };
        // At one time, commands come before a gate.
        let Some((at, is_gate)) = self.playing().filter_map(next).min() else { return };
        let prepares = |standing: &Standing| matches!(standing, Standing::Paused { prepares: true, .. });
        let any = self.standings.iter().any(prepares);
        for (robot, standing) in self.standings.iter_mut().enumerate() {
            if !matches!(standing, Standing::Done { .. }) && (prepares(standing) || !any) {
                *standing = Standing::Busy;
                order(robot, Input::StepTo { at, is_gate });
            }
        }
    }

    /// Whether the gate opens at which all players wait.
    fn opens(&self, now: Nanos) -> bool {
        let fits = |standing| match standing {
            Standing::AtGate { fits_until, .. } => fits_until.is_some_and(|until| now <= until),
            _ => false,
        };
        let has_expired = |standing| matches!(standing, Standing::AtGate { has_expired: true, .. });
        self.playing().any(has_expired) || self.playing().all(fits)
    }

    /// All players continue at the same time.
    fn together(&mut self, now: Nanos, order: &mut impl FnMut(usize, Input)) {
        self.all(order, Input::Together { at: now.saturating_add(LEAD) });
    }

    fn all(&mut self, order: &mut impl FnMut(usize, Input), input: Input) {
        for (robot, standing) in
            self.standings.iter_mut().enumerate().filter(|(_, of)| !matches!(of, Standing::Done { .. }))
        {
            // Until it says otherwise.
            *standing = Standing::Busy;
            order(robot, input);
        }
    }
}

/// Whether a run has ended early, or ends so.
fn is_early(standing: Standing) -> bool {
    matches!(standing, Standing::Ending | Standing::Done { is_early: true })
}
