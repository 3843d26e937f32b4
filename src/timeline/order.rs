//! What is wrong with the order in time: two commands that want one thing at the same time, and a `move` outside of
//! position mode.
//!
//! `for` occupies its thing for as long as it holds, anything else for an instant. Ends that touch are no overlap if the
//! one that starts there is also written later. Two instants at one time clash; an instant and a hold that starts there do
//! not, if the instant is written first.

use super::listing::Seconds;
use super::{Event, THINGS, Timeline, thing_name, things, things_of};
use crate::board::{Command, Mode};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::program::{Action, Step, TraceId, Traces};
use crate::source::Span;

/// When a command occupies its things, in microseconds.
#[derive(Clone, Copy)]
struct Occupied {
    start: u64,
    end: u64,
    order: u32,
    /// Whether it has no `for`.
    instant: bool,
    span: Span,
    trace: TraceId,
}

impl Occupied {
    /// Whether `next`, which starts later or is written later at the same time, runs into this.
    fn clashes_with(self, next: Occupied) -> bool {
        if self.end != next.start {
            return self.end > next.start;
        }
        match (self.instant, next.instant) {
            (true, true) => true,
            (true, false) => false,
            (false, _) => next.order < self.order,
        }
    }
}

/// Reports every command that runs into one before it, and every `move` whose last `pid` was not `pid position`. The steps are
/// sorted by time.
pub(super) fn check(steps: &[Step], traces: &Traces, diagnostics: &mut Diagnostics) {
    // Of each thing, the command that occupies it longest so far.
    let mut occupied: [Option<Occupied>; THINGS] = [None; THINGS];
    let mut mode = None;
    for step in steps {
        match &step.action {
            Action::Send(Command::Pid(to, _)) => mode = Some(*to),
            Action::Send(Command::Move { .. }) if mode != Some(Mode::Position) => {
                diagnostics.push(traces.attach(move_mode(step.span), step.trace));
            }
            _ => {}
        }
        let lasting = match &step.action {
            Action::Hold(held) => Some(held.1),
            Action::Go(going) => Some(going.over),
            Action::Send(_) | Action::Say(_) | Action::Expect(_) => None,
        };
        let start = step.at.micros();
        let end = lasting.map_or(start, |lasting| step.at.plus(lasting).micros());
        let next =
            Occupied { start, end, order: step.order, instant: lasting.is_none(), span: step.span, trace: step.trace };
        let mut reported = false;
        for thing in things_of(&step.action).into_iter().flatten() {
            let Some(slot) = occupied.get_mut(thing) else {
                continue;
            };
            match *slot {
                Some(last) if last.clashes_with(next) => {
                    if !reported {
                        let diagnostic = traces.attach(clash(thing, last, next), next.trace);
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

/// Reports a thing that is told something at the very end of one pass and again at the start of the next one, as it would be in a
/// `repeat`.
pub(super) fn check_seam(before: &Timeline, behind: &Timeline, diagnostics: &mut Diagnostics) {
    let last = before.events().iter().rev().take_while(|event| event.at_us == before.end_us);
    let last: Vec<&Event> = last.filter(|event| event.is_instant).collect();
    if last.is_empty() {
        return;
    }
    let first = behind.events().iter().take_while(|event| event.at_us == 0);
    for second in first.filter(|event| event.is_instant) {
        let shared = |first: &Event| {
            let told = things(&first.command);
            things(&second.command).into_iter().flatten().find(|thing| told.contains(&Some(*thing)))
        };
        if let Some((thing, first)) = last.iter().find_map(|first| Some((shared(first)?, *first))) {
            let occupied = |event: &Event| Occupied {
                start: before.end_us,
                end: before.end_us,
                order: 0,
                instant: true,
                span: event.span,
                trace: event.trace,
            };
            diagnostics.push(before.traces.attach(clash(thing, occupied(first), occupied(second)), first.trace));
        }
    }
}

fn move_mode(span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::MoveMode,
        span,
        "`move` needs the board in position mode",
        "put this line before it: `pid position speed=200,150 position=20,0,20 yaw=12,2,5`",
    )
}

fn clash(thing: usize, first: Occupied, second: Occupied) -> Diagnostic {
    let thing = thing_name(thing);
    let at = Seconds(second.start);
    if first.instant {
        return Diagnostic::new(
            Code::Clash,
            second.span,
            format!("{thing} is told two things at {at} s"),
            "keep one of the two, or let time pass between them: a plain command takes none (`wait 0.5s`, or `+0.5s` before a line in `together`)",
        )
        .label("this")
        .related(first.span, "and this");
    }
    let end = literal(first.end);
    let help = if first.end == second.start {
        "what starts when another ends is written below it: swap the two lines".to_owned()
    } else {
        format!("start it at {end} or later, on a line of its own, or make the other one shorter")
    };
    let message = format!("{thing} is busy until {} s, and this starts at {at} s", Seconds(first.end));
    Diagnostic::new(Code::Clash, second.span, message, help)
        .label("starts too early")
        .related(first.span, "still running")
}

/// A time as a script says it.
fn literal(us: u64) -> String {
    let seconds = Seconds(us).to_string();
    format!("{}s", seconds.trim_end_matches('0').trim_end_matches('.'))
}
