//! Gates: where the clock of a script stops until something happens.
//!
//! A gate has a place in the order of unrolling. At its moment, everything that is written before it
//! is sent before it, and so are the ends of what began earlier. Everything else follows.

use super::{Timeline, occupied};
use crate::diagnostic::{Diagnostics, diagnostic};
use crate::program::{self, Action, Program, Step, Time, TraceId};
use crate::source::Span;
use crate::units::Micros;

/// A gate in a timeline.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    /// The time of the script at which its clock stops.
    pub at: Micros,
    /// What it waits for.
    pub gate: program::Gate,
    /// What comes after it.
    pub next: Cut,
    /// Its place in the script.
    pub span: Span,
    /// The calls and passes that led to it.
    pub trace: TraceId,
}

impl Gate {
    /// The longest time that it waits, in real time.
    pub fn within(&self) -> Option<Micros> {
        self.gate.within.map(Time::micros)
    }
}

/// A position in a script. Its gates divide everything at one time into what is before and after them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// The time from the start of the script.
    pub at: Micros,
    /// The number of gates before it.
    pub gates: usize,
}

impl Position {
    /// The position before everything at a time, including the gates.
    pub fn before(timeline: &Timeline, at: Micros) -> Self {
        Position { at, gates: timeline.gates.partition_point(|gate| gate.at < at) }
    }
}

/// A place between what comes before and after it in a timeline: for each list, the index of the
/// first item after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cut {
    /// In the events.
    pub events: usize,
    /// In the lines to show.
    pub cues: usize,
    /// In the marks.
    pub marks: usize,
    /// In the expectations.
    pub expects: usize,
}

impl Cut {
    /// The end of a timeline.
    pub fn end(timeline: &Timeline) -> Self {
        let Timeline { events, cues, marks, expects, .. } = timeline;
        Cut { events: events.len(), cues: cues.len(), marks: marks.len(), expects: expects.len() }
    }

    /// The place of a position: before everything at its time that no gate separates from it.
    pub(super) fn at(timeline: &Timeline, position: Position) -> Self {
        let Timeline { events, cues, marks, expects, .. } = timeline;
        let at = position.at;
        let passed = position.gates.checked_sub(1).and_then(|last| timeline.gates.get(last));
        let after = passed.map(|gate| gate.next).unwrap_or_default();
        Cut {
            events: events.partition_point(|event| event.at < at).max(after.events),
            cues: cues.partition_point(|cue| cue.at < at).max(after.cues),
            marks: marks.partition_point(|mark| mark.at < at).max(after.marks),
            expects: expects.partition_point(|expect| expect.at < at).max(after.expects),
        }
    }

    /// The same place if other items come first.
    pub(super) fn plus(self, other: Cut) -> Self {
        self.with(other, usize::saturating_add)
    }

    /// The same place in a part that begins at `start`.
    pub(super) fn minus(self, start: Cut) -> Self {
        self.with(start, usize::saturating_sub)
    }

    fn with(self, other: Cut, each: impl Fn(usize, usize) -> usize) -> Self {
        Cut {
            events: each(self.events, other.events),
            cues: each(self.cues, other.cues),
            marks: each(self.marks, other.marks),
            expects: each(self.expects, other.expects),
        }
    }
}

/// Reports everything with a duration that starts before a gate and ends after it. The steps are
/// sorted by time.
pub(super) fn check(program: &Program, diagnostics: &mut Diagnostics) {
    let gates: Vec<&Step> = program.steps.iter().filter(|step| matches!(step.action, Action::Gate(_))).collect();
    let key = |step: &Step| (step.at.micros(), step.order);
    for step in &program.steps {
        let lasting = match &step.action {
            Action::Hold(held) => held.1,
            Action::Go(going) => going.over,
            Action::Expect(expect) => expect.within.unwrap_or_default(),
            Action::Send(_) | Action::Say(_) | Action::Gate(_) => continue,
        };
        let end = step.at.plus(lasting).micros();
        let next = gates.partition_point(|gate| key(gate) < key(step));
        let Some(gate) = gates.get(next).filter(|gate| gate.at.micros() < end) else { continue };
        let resources = occupied(&program.board, &step.action).iter();
        let thing = resources.filter_map(|id| program.board.resource(*id)).map(|resource| &*resource.name).next();
        let diagnostic = diagnostic!(GateOverlap, gate.span, "{} until {end:.6} s, but this gate stops the clock at {:.6} s",
            thing.map_or_else(|| "an `expect` waits".to_owned(), |thing| format!("{thing} is busy")), gate.at.micros();
            help: "start the gate at {end}s or later, or let the other command end before it");
        let diagnostic = diagnostic.label("stops the clock").related(step.span, "still running");
        let diagnostic = program.traces.attach(diagnostic, gate.trace);
        diagnostics.push(program.traces.attach(diagnostic, step.trace));
    }
}
