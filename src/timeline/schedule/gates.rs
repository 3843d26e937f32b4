//! Gates: their places among the frames, and what may hold at them.

use super::super::{Cut, Gate};
use super::{Origin, Scheduler};
use crate::diagnostic::{Code, diagnostic};
use crate::program::{self, Action, Awaited, Step, Time};
use crate::units::Micros;

/// The longest time that something may run at a gate.
const LONGEST: Time = Time::from_millis(60_000);

/// The times and the places in the order of unrolling of all gates of some sorted steps.
pub(super) fn places(steps: &[Step]) -> Vec<(Micros, u32)> {
    steps.iter().filter(|step| is_gate(step)).map(|step| (step.at.micros(), step.order)).collect()
}

/// The number of gates before something at this time and place in the order of unrolling.
#[inline]
pub(super) fn count_before(places: &[(Micros, u32)], at: Micros, order: u32) -> usize {
    // Most scripts have none.
    if places.is_empty() {
        return 0;
    }
    places.partition_point(|place| *place < (at, order))
}

/// The number of steps at the same time, up to and including a gate.
pub(super) fn group_length(steps: &[Step], at: Micros) -> usize {
    let mut length = 0;
    for step in steps.iter().take_while(|step| step.at.micros() == at) {
        length += 1;
        if is_gate(step) {
            break;
        }
    }
    length
}

pub(super) fn is_gate(step: &Step) -> bool {
    matches!(step.action, Action::Gate(_))
}

impl Scheduler<'_> {
    /// The origin of what ends at `end`. If a gate is at exactly that time, it comes before the gate.
    pub(super) fn before_gate(&self, start: Time, end: Time, from: Origin) -> Origin {
        let next = count_before(&self.gate_places, start.micros(), from.order);
        match self.gate_places.get(next) {
            Some((at, order)) if *at == end.micros() => Origin { order: from.order.min(*order), ..from },
            _ => from,
        }
    }

    /// Adds a gate, and reports what may not hold at it.
    pub(super) fn gate(&mut self, at: Time, gate: &program::Gate, from: Origin) {
        let within = gate.within;
        let restless = self.state.restless(self.board).next();
        if let Some(resource) = restless
            && within.is_none_or(|within| within > LONGEST)
        {
            let problem = if within.is_some() { "may wait for more than 60 s" } else { "has no time limit" };
            let limited = match gate.awaited {
                Awaited::Others(_) => format!("within {LONGEST}"),
                _ => program::Gate { within: Some(LONGEST), ..gate.clone() }.to_string(),
            };
            let rest = resource.rest.as_ref().map(|rest| self.board.show(rest).to_string()).unwrap_or_default();
            let diagnostic = diagnostic!(GateTime, from.span, "this gate {problem}, but {} may be {}",
                resource.name, resource.activity;
                help: "write `{rest}` before it, or a limit of at most 60 s: `{limited}`");
            // A `for` that is too long was reported.
            if !self.diagnostics.has(Code::GateOverlap) {
                self.report(diagnostic, from);
            }
        }
        let is_off = self.settings.refresh.iter().all(Option::is_none);
        if is_off && self.state.restless(self.board).any(|resource| resource.drives && resource.refresh.is_some()) {
            let diagnostic = diagnostic!(GateRefresh, from.span, "with `refresh off`, the drive may not hold at a gate";
                help: "stop it before the gate, or remove `refresh off`");
            let held = self.held.iter().flatten().next().map(|held| held.from.span);
            let diagnostic = held.map_or(diagnostic.clone(), |held| diagnostic.related(held, "this holds"));
            self.report(diagnostic, from);
        }
        if self.has_room(1, from) {
            let next = Cut { cues: self.cues.len(), expects: self.expects.len(), ..Cut::default() };
            let (mut gate, span, trace) = (gate.clone(), from.span, from.trace);
            // Only the robots whose reports it waits for measure the time.
            gate.within = gate.within.filter(|_| !matches!(gate.awaited, Awaited::Others(_)));
            self.gates.push(Gate { at: at.micros(), gate, next, span, trace });
        }
    }
}
