//! Clips: parts of a timeline, played once or repeatedly. Pure functions of the whole timeline.
//!
//! A clip that begins in the middle first restores the state of the board at that time: first
//! gains, then servos with a smooth motion, then what the drive and the buzzer hold. At its end, a
//! clip brings everything to rest.

use super::schedule::report_requests;
use super::{Bars, Cue, Event, Expectation, Kind, Mark, Timeline, Tween};
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
    /// The start, from the start of the script.
    pub from: Micros,
    /// The end; `None` for the end of the script. Commands at exactly this time are not part of the
    /// clip.
    pub to: Option<Micros>,
    /// The time that servos get to move to their state at the start.
    pub lead_in: Micros,
}

impl Clip {
    /// A clip from a time to another, or to the end.
    pub fn new(from: Micros, to: Option<Micros>, lead_in: Micros) -> Self {
        Clip { from, to, lead_in }
    }
}

/// The interval between two steps of a lead-in.
const STEP: Micros = Micros::from_millis(20);

/// Cuts a clip out of a timeline. `before` is the state of the board before the clip.
pub fn clip(timeline: &Timeline, clip: &Clip, before: &State) -> Timeline {
    let to = clip.to.unwrap_or(Micros::MAX).min(timeline.end + Micros(1));
    let is_whole = clip.from == Micros::ZERO && to > timeline.end;
    if is_whole {
        return timeline.clone();
    }
    let board = &timeline.board;
    let mut cut = Cut { board, events: Vec::new(), state: State::default(), marks: vec![None; board.resources.len()] };
    let events = &timeline.events;
    let begin = events.partition_point(|event| event.at < clip.from);
    for event in events.iter().take(begin).filter(|event| event.kind != Kind::Auto) {
        cut.note(event);
    }
    // The lead-in does not restore what a command sets at exactly that time.
    let at_once = events.iter().skip(begin).take_while(|event| event.at == clip.from);
    let at_once: Vec<&Command> = at_once.map(|event| &event.command).collect();
    let lead = if clip.from > Micros::ZERO { cut.lead_in(clip.lead_in, before, &at_once) } else { Micros::ZERO };
    let shifted = |at: Micros| at - clip.from + lead;
    let inside = events.iter().skip(begin).take_while(|event| event.at < to);
    for event in inside.filter(|event| event.kind != Kind::Auto) {
        cut.note(event);
        cut.events.push(Event { at: shifted(event.at), ..event.clone() });
    }
    let end = shifted(to.min(timeline.end));
    cut.close(end);
    let is_inside = |at: Micros| (clip.from..to).contains(&at);
    let cues = timeline.cues.iter().filter(|cue| is_inside(cue.at));
    let cues = cues.map(|cue| Cue { at: shifted(cue.at), ..cue.clone() }).collect();
    let expects = timeline.expects.iter().filter(|expect| is_inside(expect.at) && expect.until <= to);
    let expects: Vec<Expectation> = expects
        .map(|expect| Expectation { at: shifted(expect.at), until: shifted(expect.until), ..expect.clone() })
        .collect();
    let marks = timeline.marks.iter().filter(|mark| is_inside(mark.at));
    let marks = marks.map(|mark| Mark { at: shifted(mark.at), ..mark.clone() }).collect();
    let mut events = cut.events;
    if let Some([start, stop]) = report_requests(board, &expects, end) {
        events.insert(0, start);
        events.push(stop);
    }
    let shift_us = i64::try_from(lead.0).unwrap_or(0) - i64::try_from(clip.from.0).unwrap_or(0);
    let bars = timeline.bars.map(|bars| Bars { first_us: bars.first_us + shift_us, ..bars });
    Timeline { events, tweens: Vec::new(), cues, expects, marks, end, bars, ..timeline.clone() }
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
    let frames = u64::try_from(again.events.len()).ok()?.checked_mul(more)?.checked_add(first.events.len() as u64)?;
    let end = again.end * more + first.end;
    if frames > events as u64 || end > Micros::DAY {
        return None;
    }
    let mut all = first.clone();
    for pass in 0..more {
        let by = first.end + again.end * pass;
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
        all.marks.extend(again.marks.iter().map(|mark| Mark { at: mark.at + by, ..mark.clone() }));
    }
    all.end = end;
    Some(all)
}

/// Reports errors that arise only between passes: more than the line can carry, commands for one
/// resource at the end of one pass and at the start of the next, and servos that the next pass
/// moves before they can have arrived. `all` is the sequence of passes, or enough passes of an
/// endless one.
pub fn check_passes(first: &Timeline, again: &Timeline, all: &Timeline, diagnostics: &mut Diagnostics) {
    clashes::check_seam(first, again, diagnostics);
    clashes::check_seam(again, again, diagnostics);
    wire::check(all, diagnostics);
    lints::servo_speed::check(all, diagnostics);
}

/// A clip under construction.
struct Cut<'t> {
    board: &'t Board,
    events: Vec<Event>,
    /// The state of the board so far.
    state: State,
    /// The place in the script that set each resource.
    marks: Vec<Option<(Span, TraceId)>>,
}

impl Cut<'_> {
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
    /// are sent once if the current value is unknown; active commands follow afterwards.
    fn lead_in(&mut self, lead_in: Micros, before: &State, at_once: &[&Command]) -> Micros {
        let (board, state) = (self.board, self.state.clone());
        let is_told = |resource: &ResourceId| at_once.iter().any(|command| board.touches(command).contains(resource));
        let mut takes = Micros::ZERO;
        for command in state.commands(board) {
            let resources = board.occupies(command);
            let before = resources.first().and_then(|resource| before.last(*resource));
            if board.is_active(command) {
                if !resources.iter().any(is_told) {
                    self.push(takes, command.clone(), Kind::Auto);
                }
            } else if !board.verb(command.verb()).is_some_and(|verb| verb.moves) {
                self.push(Micros::ZERO, command.clone(), Kind::Auto);
            } else if before != Some(command) {
                takes = lead_in;
                match before {
                    Some(before) => self.glide(before, command, lead_in),
                    // The servo has the whole lead-in to get there.
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
            let part = ease.at(at.0 as f64 / lasts.0.max(1) as f64);
            let between = |(start, end): (i32, i32)| {
                let (start, end) = (f64::from(start), f64::from(end));
                #[expect(clippy::cast_possible_truncation, reason = "between two values of a command")]
                let value = libm::round(start + (end - start) * part) as i32;
                value
            };
            let values: Vec<i32> = from.values().into_iter().zip(to.values()).map(between).collect();
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
