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
    /// Whether time 0 has been set, and the last gate that was opened: its pass and its index.
    has_begun: bool,
    opened: Option<(u64, usize)>,
    /// The robot whose run ended early first.
    first: Option<usize>,
    /// Whether every player has the order to end.
    has_ended: bool,
    /// Whether the operator has said go.
    go: bool,
}

impl Conductor {
    /// For this number of robots.
    pub fn new(robots: usize) -> Self {
        Conductor {
            standings: vec![Standing::Busy; robots],
            has_begun: false,
            opened: None,
            first: None,
            has_ended: false,
            go: false,
        }
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

    /// Whether a player prepares to play, plays, or waits at a gate.
    pub fn is_running(&self) -> bool {
        self.playing().any(|standing| !matches!(standing, Standing::Paused { .. } | Standing::Ending))
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

    /// Takes an input of the operator or the system, and passes on what each player does at `now` from the start.
    pub fn poll(&mut self, now: Nanos, input: Input, order: &mut impl FnMut(usize, Input)) {
        let robots = 0..self.standings.len();
        if input.end().is_some() {
            self.has_ended = true;
        }
        match input {
            Input::Tick => {}
            Input::Go => self.go = self.waits_for_go(),
            Input::Resume => {
                if let Some(script) = self.paused_at() {
                    self.all(order, Input::ResumeTogether { script, at: now.saturating_add(LEAD) });
                }
                return;
            }
            Input::Step => {
                let next = |standing| if let Standing::Paused { next, .. } = standing { next } else { None };
                // At one time, commands come before a gate.
                let next = self.paused_at().and_then(|_| self.playing().filter_map(next).min());
                if let Some((at, is_gate)) = next {
                    self.all(order, Input::StepTo { at, is_gate });
                    self.has_begun = true;
                }
                return;
            }
            other => robots.clone().for_each(|robot| order(robot, other)),
        }
        let is_early = |standing: &Standing| matches!(standing, Standing::Ending | Standing::Done { is_early: true });
        let early = self.standings.iter().position(is_early);
        if let (Some(robot), false) = (early, self.has_ended) {
            self.has_ended = true;
            robots.clone().filter(|other| *other != robot).for_each(|other| order(other, Input::OtherEnded { robot }));
        }
        self.first = self.first.or(early);
        if self.has_ended {
            return;
        }
        let is_ready = self.playing().all(|standing| standing == Standing::Ready);
        if is_ready && !self.has_begun && !self.is_done() {
            self.has_begun = true;
            self.together(now, order);
        }
        if let Some(closed) = self.closed_gate().filter(|_| self.opens(now)) {
            (self.opened, self.go) = (Some(closed), false);
            self.together(now, order);
        }
    }

    /// Whether the gate opens at which all players wait.
    fn opens(&self, now: Nanos) -> bool {
        let fits = |standing| match standing {
            Standing::AtGate { fits_until, .. } => fits_until.is_some_and(|until| now <= until),
            _ => false,
        };
        let has_expired = |standing| matches!(standing, Standing::AtGate { has_expired: true, .. });
        self.go || self.playing().any(has_expired) || self.playing().all(fits)
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
