//! Errors in the order of commands: two commands that use one resource at the same time, and a
//! command without its precondition (a `move` outside of position mode).
//!
//! A `for` or `over` occupies its resources for its duration, any other command for an instant. A
//! gate at the moment separates what is before it from what is after it.
//! Intervals that touch do not overlap if the one that starts there is also written later. Two
//! instants at the same time clash. An instant and a hold that starts at the same time do not, if
//! the instant is written first.

use super::{Event, Timeline, occupied};
use crate::board::{self, Board, Needs, ResourceId, ServoSet};
use crate::diagnostic::{Diagnostic, Diagnostics, diagnostic};
use crate::program::{Action, Program, Step, TraceId, Traces};
use crate::source::{Sources, Span};
use crate::units::Micros;

/// The time during which a command occupies its resources.
#[derive(Clone, Copy)]
struct Occupied {
    start: Micros,
    end: Micros,
    order: u32,
    /// The number of gates before its start.
    gates: usize,
    /// Whether it has no duration.
    instant: bool,
    span: Span,
    trace: TraceId,
}

impl Occupied {
    /// Whether `next` overlaps this. `next` starts later, or is written later if both start
    /// together.
    fn clashes_with(self, next: Occupied) -> bool {
        if self.end != next.start {
            return self.end > next.start;
        }
        match (self.instant, next.instant) {
            _ if next.gates > self.gates => false,
            (true, true) => true,
            (true, false) => false,
            (false, _) => next.order < self.order,
        }
    }
}

/// Reports each command that overlaps an earlier one, and each command without its precondition.
/// The steps are sorted by time.
pub(super) fn check(program: &Program, steps: &[Step], sources: &Sources, diagnostics: &mut Diagnostics) {
    let Program { board, traces, .. } = program;
    // For each resource, the command that occupies it longest so far, and the first value of its
    // last command.
    let mut busy: Vec<Option<Occupied>> = vec![None; board.resources.len()];
    let mut first_values: Vec<Option<i32>> = vec![None; board.resources.len()];
    let mut forbidden = Forbidden::new(board);
    let mut gates = 0;
    for step in steps {
        gates += usize::from(matches!(step.action, Action::Gate(_)));
        let resources = occupied(board, &step.action);
        if let Action::Send(command) = &step.action {
            let is_met = |needs: &&Needs| first_values.get(needs.resource) == Some(&Some(needs.value));
            if let Some(needs) = board.needs(command).filter(|needs| !is_met(needs)) {
                diagnostics.push(traces.attach(missing(needs, step.span), step.trace));
            }
            for resource in resources {
                if let Some(first) = first_values.get_mut(*resource) {
                    *first = command.value(0);
                }
            }
        }
        if let Some(diagnostic) = forbidden.check(step, resources) {
            diagnostics.push(traces.attach(diagnostic, step.trace));
        }
        let lasting = match &step.action {
            Action::Hold(held) => Some(held.1),
            Action::Go(going) => Some(going.over),
            Action::Send(_) | Action::Say(_) | Action::Expect(_) | Action::Gate(_) => None,
        };
        let start = step.at.micros();
        let end = lasting.map_or(start, |lasting| step.at.plus(lasting).micros());
        let Step { order, span, trace, .. } = *step;
        let next = Occupied { start, end, order, gates, instant: lasting.is_none(), span, trace };
        let mut reported = false;
        for resource in exclusive(board, resources) {
            let Some(slot) = busy.get_mut(resource) else {
                continue;
            };
            match *slot {
                Some(last) if last.clashes_with(next) => {
                    if !reported {
                        let clash = clash(board, resource, last, next);
                        let clash = in_one_line(clash, (last, next), traces, sources);
                        let diagnostic = traces.attach(clash, next.trace);
                        diagnostics.push(traces.attach(diagnostic, last.trace));
                    }
                    reported = true;
                    if next.end > last.end {
                        *slot = Some(next);
                    }
                }
                _ => *slot = Some(next),
            }
        }
    }
}

/// Reports commands for one resource at the end of one pass and at the start of the next, as in a
/// `repeat`.
pub(super) fn check_seam(before: &Timeline, after: &Timeline, diagnostics: &mut Diagnostics) {
    forbidden_after(before, after, diagnostics);
    // A gate separates what is before it from what is after it.
    let passed = before.gates.last().map_or(0, |gate| gate.next.events);
    let last = before.events.get(passed..).unwrap_or_default().iter().rev();
    let last = last.take_while(|event| event.at == before.end);
    let last: Vec<&Event> = last.filter(|event| event.is_instant).collect();
    if last.is_empty() {
        return;
    }
    let board = &before.board;
    let gate = after.gates.first().map_or(after.events.len(), |gate| gate.next.events);
    let first = after.events.iter().take(gate).take_while(|event| event.at == Micros::ZERO);
    for second in first.filter(|event| event.is_instant) {
        let shared = |first: &Event| {
            let set = board.occupies(&first.command);
            exclusive(board, board.occupies(&second.command)).find(|resource| set.contains(resource))
        };
        if let Some((resource, first)) = last.iter().find_map(|first| Some((shared(first)?, *first))) {
            let occupied = |event: &Event| Occupied {
                start: before.end,
                end: before.end,
                order: 0,
                gates: 0,
                instant: true,
                span: event.span,
                trace: event.trace,
            };
            diagnostics
                .push(before.traces.attach(clash(board, resource, occupied(first), occupied(second)), first.trace));
        }
    }
}

/// Reports commands of the next pass that are errors after what the last pass leaves.
fn forbidden_after(before: &Timeline, after: &Timeline, diagnostics: &mut Diagnostics) {
    let board = &before.board;
    for forbidden in board.verbs.iter().filter_map(|verb| verb.forbidden.as_ref()) {
        let is_after =
            |event: &&Event| (event.command.verb(), event.command.value(1)) == (forbidden.after, Some(forbidden.value));
        let servos: ServoSet =
            before.events.iter().filter(is_after).filter_map(|event| event.command.value(0)).collect();
        for index in servos.iter() {
            let Some(resource) = board.occupied(forbidden.after, Some(index)).first() else { continue };
            let sets = |event: &&Event| board.occupies(&event.command).contains(resource);
            let Some(last) = before.events.iter().rfind(sets).filter(is_after) else { continue };
            let next = after.events.iter().find(sets);
            let is_forbidden =
                |event: &&Event| board.verb(event.command.verb()).is_some_and(|verb| verb.forbidden.is_some());
            if let Some(next) = next.filter(is_forbidden) {
                let diagnostic = forbidden_here(forbidden, index, next.span)
                    .related(last.span, format!("{}, in the pass before", forbidden.label));
                diagnostics.push(before.traces.attach(diagnostic, next.trace));
            }
        }
    }
}

fn forbidden_here(forbidden: &board::Forbidden, index: i32, span: Span) -> Diagnostic {
    let filled = |text: &str| text.replace("{}", &index.to_string());
    let (message, help) = (filled(&forbidden.message), filled(&forbidden.help));
    diagnostic!(TorqueOff, span, "{message}"; help: "{help}")
}

/// The resources that accept only one command at a time.
fn exclusive<'b>(board: &'b Board, resources: &'b [ResourceId]) -> impl Iterator<Item = ResourceId> {
    let is_exclusive = |resource: &ResourceId| board.resource(*resource).is_some_and(|found| found.is_exclusive);
    resources.iter().copied().filter(is_exclusive)
}

/// The commands after which others for the same resource are errors: for each resource, the last one and its place.
struct Forbidden<'b> {
    board: &'b Board,
    /// Empty if the board has no such commands.
    after: Vec<Option<Span>>,
}

impl<'b> Forbidden<'b> {
    fn new(board: &'b Board) -> Self {
        let has_any = board.verbs.iter().any(|verb| verb.forbidden.is_some());
        Forbidden { board, after: vec![None; if has_any { board.resources.len() } else { 0 }] }
    }

    /// Reports a step that is an error after an earlier one.
    fn check(&mut self, step: &Step, resources: &[ResourceId]) -> Option<Diagnostic> {
        let resource = *resources.first().filter(|_| !self.after.is_empty())?;
        let place = self.after.get_mut(resource)?;
        let (verb, index, value) = match &step.action {
            Action::Send(command) => (command.verb(), command.value(0), command.value(1)),
            Action::Hold(held) => (held.0.verb(), held.0.value(0), None),
            Action::Go(going) => (going.motion.verb, going.motion.index, None),
            Action::Say(_) | Action::Expect(_) | Action::Gate(_) => return None,
        };
        if let Some(forbidden) = &self.board.verb(verb)?.forbidden {
            let first = (*place)?;
            let diagnostic = forbidden_here(forbidden, index.unwrap_or_default(), step.span);
            return Some(diagnostic.related(first, forbidden.label.clone()));
        }
        let mut all = self.board.verbs.iter().filter_map(|verb| verb.forbidden.as_ref());
        *place = all.any(|forbidden| (forbidden.after, Some(forbidden.value)) == (verb, value)).then_some(step.span);
        None
    }
}

fn missing(needs: &Needs, span: Span) -> Diagnostic {
    diagnostic!(MoveMode, span, "{}", needs.message.as_ref(); help: "add this line before it: `{}`", needs.line)
}

/// The same for two commands of one line: joined by `;`, or one command in two passes.
fn in_one_line(clash: Diagnostic, both: (Occupied, Occupied), traces: &Traces, sources: &Sources) -> Diagnostic {
    let (first, second) = both;
    if first.span == second.span {
        let mut passes = outermost(traces, first.trace).into_iter().zip(outermost(traces, second.trace));
        let (label, help) = match passes.find(|(one, other)| one != other) {
            Some(((_, one), (_, other))) if one > 0 && other > 0 => (
                format!("in pass {one} and in pass {other}"),
                "add a `wait 0.5s` to the `repeat`, so that its passes start at different times".to_owned(),
            ),
            _ => ("twice".to_owned(), clash.help.clone()),
        };
        return Diagnostic { label: Some(label), related: Vec::new(), help, ..clash };
    }
    let between = Span { start: first.span.end.min(second.span.end), end: first.span.start.max(second.span.start) };
    let between = sources.file(first.span).slice(between);
    if first.start == second.start && between.contains(';') && !between.contains('\n') {
        let help = "`;` starts both at the same time; to run one after the other, write two lines".to_owned();
        return Diagnostic { help, ..clash };
    }
    clash
}

/// The calls and passes that led to a command, the outermost first.
fn outermost(traces: &Traces, trace: TraceId) -> Vec<(Span, u32)> {
    let mut chain: Vec<_> = traces.chain(trace).collect();
    chain.reverse();
    chain
}

fn clash(board: &Board, resource: ResourceId, first: Occupied, second: Occupied) -> Diagnostic {
    let thing = board.resource(resource).map(|resource| &*resource.name).unwrap_or_default();
    let at = second.start;
    if first.instant {
        return diagnostic!(Clash, second.span, "{thing} gets two commands at {at:.6} s";
            help: "remove one of them, or separate them in time: with a `wait 0.5s`, or with `+0.5s` before a line in `together`")
        .label("second command")
        .related(first.span, "first command");
    }
    let end = first.end;
    let help = if first.end == second.start {
        "this starts when the other command ends, but is written above it: swap the two lines".to_owned()
    } else {
        format!("start it at {end}s or later, on its own line, or shorten the other command")
    };
    diagnostic!(Clash, second.span, "{thing} is busy until {end:.6} s, but this starts at {at:.6} s"; help: "{help}")
        .label("starts too early")
        .related(first.span, "still running")
}
