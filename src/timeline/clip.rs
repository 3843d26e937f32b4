//! Clips: parts of a timeline, played once or repeatedly. Pure functions of the whole timeline.
//!
//! A clip that begins in the middle first restores the state of the board at that time: first
//! gains, then servos with a smooth motion, then what the drive and the buzzer hold. At its end, a
//! clip brings everything to rest.

use super::gates::{Cut, Position};
use super::greetings::Greetings;
use super::{Bars, Cue, Event, Expectation, Gate, Kind, Mark, Timeline, Tween};
use super::{clashes, lints, wire};
use crate::board::{Board, Command, ResourceId, State};
use crate::diagnostic::Diagnostics;
use crate::program::{Ease, TraceId};
use crate::source::Span;
use crate::units::Micros;

/// The part of a timeline to play.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Clip {
    /// The start. Gates before it are skipped.
    pub from: Position,
    /// The end; `None` for the end of the script. Commands at exactly this time are not part of the
    /// clip, unless a gate before its end follows them.
    pub to: Option<Position>,
    /// The time that servos get to move to their state at the start.
    pub lead_in: Micros,
}

impl Clip {
    /// A clip from a position to another, or to the end.
    pub fn new(from: Position, to: Option<Position>, lead_in: Micros) -> Self {
        Clip { from, to, lead_in }
    }
}

/// The interval between two steps of a lead-in.
const STEP: Micros = Micros::from_millis(20);

/// Cuts the same clip out of the timelines of all robots. `before` are the states of their boards before the clip. Everything that
/// follows the lead-ins starts at one time, so each of them takes as long as the longest.
pub fn clips(timelines: &[Timeline], clip: &Clip, before: &[State]) -> Vec<Timeline> {
    let cut =
        |at_least| timelines.iter().zip(before).map(move |(timeline, before)| cut(timeline, clip, before, at_least));
    let own: Vec<Timeline> = cut(Micros::ZERO).collect();
    let longest = own.iter().map(|cut| cut.end).max().unwrap_or_default();
    if own.iter().all(|cut| cut.end == longest) {
        return own;
    }
    let whole = timelines.iter().map(|timeline| timeline.end).max().unwrap_or_default();
    let end = clip.to.map_or(whole, |to| to.at.min(whole));
    cut(longest - (end - clip.from.at)).collect()
}

/// Cuts a clip out of a timeline. `before` is the state of the board before the clip.
pub fn clip(timeline: &Timeline, clip: &Clip, before: &State) -> Timeline {
    cut(timeline, clip, before, Micros::ZERO)
}

/// Cuts a clip out of a timeline. Its lead-in takes at least a time.
fn cut(timeline: &Timeline, clip: &Clip, before: &State, lead_in: Micros) -> Timeline {
    let from = clip.from;
    let to = clip.to.filter(|to| to.at <= timeline.end);
    if from == Position::default() && to.is_none() {
        return timeline.clone();
    }
    let board = &timeline.board;
    let marks = vec![None; board.resources.len()];
    let mut cut = Cutting { board, events: Vec::new(), state: State::default(), marks };
    board.hello.iter().for_each(|command| cut.state.apply(board, command));
    let start = Cut::at(timeline, from);
    let stop = to.map_or_else(|| Cut::end(timeline), |to| Cut::at(timeline, to));
    for event in part(&timeline.events, 0, start.events).iter().filter(|event| is_scripted(event)) {
        cut.note(event);
    }
    let gates = part(&timeline.gates, from.gates, to.map_or(timeline.gates.len(), |to| to.gates));
    // The lead-in does not restore what a command sets at exactly that time.
    let first_gate = gates.first().map_or(stop.events, |gate| gate.next.events);
    let at_once = part(&timeline.events, start.events, first_gate).iter().take_while(|event| event.at == from.at);
    let at_once: Vec<&Command> = at_once.map(|event| &event.command).collect();
    let is_start = from == Position::default();
    let unknown = if timeline.soft.is_some() { Micros::ZERO } else { clip.lead_in };
    let times = Times { at_least: lead_in, known: clip.lead_in, unknown };
    let lead = if is_start { Micros::ZERO } else { cut.lead_in(&times, before, &at_once) };
    let lead_events = cut.events.len();
    let shifted = |at: Micros| at - from.at + lead;
    for event in part(&timeline.events, start.events, stop.events).iter().filter(|event| is_scripted(event)) {
        cut.note(event);
        cut.events.push(Event { at: shifted(event.at), ..event.clone() });
    }
    let end = shifted(to.map_or(timeline.end, |to| to.at));
    cut.close(end);
    let cues = part(&timeline.cues, start.cues, stop.cues);
    let cues = cues.iter().map(|cue| Cue { at: shifted(cue.at), ..cue.clone() }).collect();
    let expects = part(&timeline.expects, start.expects, stop.expects).iter();
    let expects = expects.filter(|expect| to.is_none_or(|to| expect.until <= to.at));
    let expects: Vec<Expectation> = expects
        .map(|expect| Expectation { at: shifted(expect.at), until: shifted(expect.until), ..expect.clone() })
        .collect();
    let marks = part(&timeline.marks, start.marks, stop.marks).iter();
    let marks = marks.map(|mark| Mark { at: shifted(mark.at), gates: mark.gates - from.gates, ..mark.clone() });
    let marks = marks.collect();
    let mut events = cut.events;
    let Greetings { first, last } = Greetings::of(board, &expects, gates, end);
    let (mut passed, mut index) = (start.events, lead_events + first.len());
    let gates = gates.iter().map(|gate| {
        let between = part(&timeline.events, passed, gate.next.events);
        index += between.iter().filter(|event| is_scripted(event)).count();
        passed = gate.next.events;
        let next = Cut { events: index, ..gate.next.minus(start) };
        Gate { at: shifted(gate.at), next, ..gate.clone() }
    });
    let gates = gates.collect();
    events.splice(0..0, first);
    events.extend(last);
    let shift_us = i64::try_from(lead.0).unwrap_or(0) - i64::try_from(from.at.0).unwrap_or(0);
    let bars = timeline.bars.map(|bars| Bars { first_us: bars.first_us + shift_us, ..bars });
    Timeline { events, tweens: Vec::new(), cues, expects, marks, gates, end, bars, ..timeline.clone() }
}

/// The items between two indices.
fn part<T>(items: &[T], from: usize, to: usize) -> &[T] {
    items.get(from..to.max(from)).unwrap_or_default()
}

/// Whether a frame belongs to the script, and not to the requests for reports.
fn is_scripted(event: &Event) -> bool {
    event.kind != Kind::Auto
}

/// The state of the board after a timeline.
pub fn state_after(timeline: &Timeline) -> State {
    let mut state = State::default();
    for event in &timeline.events {
        state.apply(&timeline.board, &event.command);
    }
    state
}

/// Concatenates `count` passes of a clip. Each pass takes exactly its duration, so that times do
/// not drift. `None` for more than `events` frames or more than a day.
pub fn passes(first: &Timeline, again: &Timeline, count: u64, events: usize) -> Option<Timeline> {
    let more = count.saturating_sub(1);
    // Gates count, too.
    let count = |pass: &Timeline| (pass.events.len() + pass.gates.len()) as u64;
    let frames = count(again).checked_mul(more)?.checked_add(count(first))?;
    let end = again.end * more + first.end;
    if frames > events as u64 || end > Micros::DAY {
        return None;
    }
    // Only the last pass says goodbye.
    let mut all = if more > 0 { first.clone().without_goodbye() } else { first.clone() };
    let inner = again.clone().without_goodbye();
    let mut marks = all.marks.to_vec();
    for pass in 0..more {
        let again = if pass + 1 < more { &inner } else { again };
        let by = first.end + again.end * pass;
        let (before, gates) = (Cut { marks: marks.len(), ..Cut::end(&all) }, all.gates.len());
        all.events.extend(again.events.iter().map(|event| Event { at: event.at + by, ..event.clone() }));
        let tweens = again.tweens.iter();
        all.tweens.extend(tweens.map(|tween| Tween { at: tween.at + by, end: tween.end + by, ..tween.clone() }));
        let expects = again.expects.iter();
        all.expects.extend(expects.map(|expect| Expectation {
            at: expect.at + by,
            until: expect.until + by,
            ..expect.clone()
        }));
        all.cues.extend(again.cues.iter().map(|cue| Cue { at: cue.at + by, ..cue.clone() }));
        let more = again.marks.iter();
        marks.extend(more.map(|mark| Mark { at: mark.at + by, gates: mark.gates + gates, ..mark.clone() }));
        let next = |gate: &Gate| gate.next.plus(before);
        all.gates.extend(again.gates.iter().map(|gate| Gate { at: gate.at + by, next: next(gate), ..gate.clone() }));
    }
    all.marks = marks.into();
    all.end = end;
    Some(all)
}

/// Reports errors that arise only between passes: more than the line can carry, commands for one
/// resource at the end of one pass and at the start of the next, and servos that the next pass
/// moves before they can have arrived. `all` is the sequence of passes, or enough passes of an
/// endless one.
pub fn check_passes(first: &Timeline, again: &Timeline, all: &Timeline, diagnostics: &mut Diagnostics) {
    diagnostics.about(first.robot.as_ref());
    clashes::check_seam(first, again, diagnostics);
    clashes::check_seam(again, again, diagnostics);
    wire::check(all, diagnostics);
    lints::servo_speed::check(all, diagnostics);
    diagnostics.about(None);
}

/// How long a lead-in takes.
struct Times {
    at_least: Micros,
    /// To go from a known value to another.
    known: Micros,
    /// To go to a value from an unknown one.
    unknown: Micros,
}

/// A clip under construction.
struct Cutting<'t> {
    board: &'t Board,
    events: Vec<Event>,
    /// The state of the board so far.
    state: State,
    /// The place in the script that set each resource.
    marks: Vec<Option<(Span, TraceId)>>,
}

impl Cutting<'_> {
    fn note(&mut self, event: &Event) {
        self.state.apply(self.board, &event.command);
        for resource in self.board.touches(&event.command) {
            if let Some(mark) = self.marks.get_mut(*resource) {
                *mark = Some((event.span, event.trace));
            }
        }
    }

    fn push(&mut self, at: Micros, command: Command, kind: Kind) {
        let resource = self.board.occupies(&command).first().copied();
        let mark = resource.and_then(|resource| self.marks.get(resource).copied().flatten());
        let (span, trace) = mark.unwrap_or_default();
        self.events.push(Event { at, command, kind, is_instant: false, span, trace });
    }

    /// Restores the state at the start, and returns how long that takes. Values move smoothly, or
    /// are sent once if the current value is unknown, for which there is another time; active
    /// commands follow afterwards.
    fn lead_in(&mut self, times: &Times, before: &State, at_once: &[&Command]) -> Micros {
        let (board, state) = (self.board, self.state.clone());
        let is_told = |resource: &ResourceId| at_once.iter().any(|command| board.touches(command).contains(resource));
        let mut takes = times.at_least;
        for command in state.commands(board) {
            let resources = board.occupies(command);
            // A servo that was switched on, for example, has no known value.
            let before = resources.first().and_then(|resource| before.last(*resource));
            let before = before.filter(|before| before.verb() == command.verb());
            if board.is_active(command) {
                if !resources.iter().any(is_told) {
                    self.push(takes, command.clone(), Kind::Auto);
                }
            } else if !board.verb(command.verb()).is_some_and(|verb| verb.moves) {
                self.push(Micros::ZERO, command.clone(), Kind::Auto);
            } else if before != Some(command) {
                takes = takes.max(if before.is_some() { times.known } else { times.unknown });
                match before {
                    Some(before) => self.glide(before, command, times.known),
                    // The servo has all the time to get there, or a soft start has brought it there.
                    None => self.push(Micros::ZERO, command.clone(), Kind::Auto),
                }
            }
        }
        // Immediate commands first, then the steps; resources keep their order.
        self.events.sort_by_key(|event| event.at);
        takes
    }

    /// Moves smoothly from one value to another.
    fn glide(&mut self, from: &Command, to: &Command, lasts: Micros) {
        let ease = Ease::named("in-out-sine").unwrap_or(Ease::LINEAR);
        let mut last = from.clone();
        let steps = (1..).map(|step| STEP * step).take_while(|at| *at < lasts).chain([lasts]);
        for at in steps {
            #[expect(clippy::cast_precision_loss, reason = "microseconds of a lead-in fit")]
            let part = at.0 as f64 / lasts.0.max(1) as f64;
            let values: Vec<i32> =
                from.values().into_iter().zip(to.values()).map(|ends| ease.between(ends, part)).collect();
            let step = self.board.command(to.verb(), &values).ok().filter(|_| at < lasts);
            let step = step.unwrap_or_else(|| to.clone());
            if step != last {
                self.push(at, step.clone(), Kind::Auto);
                last = step;
            }
        }
    }

    /// Ends everything that is still active, the last resource first.
    fn close(&mut self, end: Micros) {
        if self.events.last().is_some_and(|event| event.kind == Kind::Closing) {
            return;
        }
        let is_unknown = self.events.iter().any(|event| self.board.is_opaque(&event.command));
        for (.., rest) in self.state.closing(self.board, is_unknown).collect::<Vec<_>>() {
            self.push(end, rest.clone(), Kind::Closing);
        }
    }
}
