//! Lays the steps of a program out in time: ends of holds, refreshes, closing frames.

use super::{Cue, Event, Kind, Limits, Timeline, Track, ending};
use crate::board::{Command, State};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::program::{Action, Program, Time};
use crate::source::Span;

pub(super) fn lay(program: Program, limits: Limits, diagnostics: &mut Diagnostics) -> Timeline {
    let Program { settings, steps, end, .. } = program;
    let end_us = end.micros();
    let mut cues = Vec::new();
    let mut points = Vec::with_capacity(steps.len());
    for (order, step) in steps.into_iter().enumerate() {
        match step.action {
            Action::Say(text) => cues.push(Cue { at_us: step.at.micros(), text, span: step.span }),
            Action::Send(command, hold) => {
                if let Some(hold) = hold {
                    points.push(Point {
                        at: step.at.plus(hold),
                        order,
                        command: ending(&command),
                        ends: true,
                        span: step.span,
                    });
                }
                points.push(Point { at: step.at, order, command, ends: false, span: step.span });
            }
        }
    }
    cues.sort_by_key(|cue| cue.at_us);
    points.sort_by_key(|point| (point.at.micros(), point.order, point.ends));

    let mut lay = Lay {
        refresh: settings.refresh,
        limits,
        events: Vec::with_capacity(points.len()),
        refreshes: Vec::new(),
        state: State::default(),
        held: None,
        last_drive: Span::default(),
        last_buzzer: Span::default(),
        raw: None,
        full: false,
        diagnostics,
    };
    for group in points.chunk_by(|left, right| left.at.micros() == right.at.micros()) {
        for point in group {
            lay.point(point, group);
        }
    }
    lay.close(end, end_us);
    let events = lay.finish();
    Timeline { tracks: vec![Track { robot: None, events }], cues, end_us, baud: settings.baud }
}

/// A command's start, or the end of its `for`.
struct Point {
    /// The exact time.
    at: Time,
    /// The place in script order.
    order: usize,
    command: Command,
    /// Whether it is the end of a `for`.
    ends: bool,
    span: Span,
}

struct Lay<'d> {
    refresh: Option<Time>,
    limits: Limits,
    /// Commands, sorted by time.
    events: Vec<Event>,
    /// Refreshes, sorted by time.
    refreshes: Vec<Event>,
    state: State,
    /// The drive command that holds, with the time it was sent.
    held: Option<(Time, Command, Span)>,
    last_drive: Span,
    last_buzzer: Span,
    /// The first raw frame.
    raw: Option<Span>,
    /// Whether the limit of events was reached.
    full: bool,
    diagnostics: &'d mut Diagnostics,
}

impl Lay<'_> {
    /// Sends the command of one point; `group` is everything at the same time.
    fn point(&mut self, point: &Point, group: &[Point]) {
        if point.ends && superseded(point, group) {
            return;
        }
        let command = &point.command;
        if command.is_drive() {
            self.release(point.at);
            self.last_drive = point.span;
            self.held = command.keeps_driving().then(|| (point.at, command.clone(), point.span));
        }
        match command {
            Command::Buzzer(_) => self.last_buzzer = point.span,
            Command::Raw { .. } => self.raw = self.raw.or(Some(point.span)),
            _ => {}
        }
        self.state.apply(command);
        if self.has_room(1, point.span) {
            let at_us = point.at.micros();
            self.events.push(Event { at_us, command: command.clone(), kind: Kind::Command, span: point.span });
        }
    }

    /// Ends a hold just before `until`, and sends its refreshes.
    fn release(&mut self, until: Time) {
        let (Some((from, command, span)), Some(interval)) = (self.held.take(), self.refresh) else {
            return;
        };
        // Counted before anything is laid, so that a day of refreshes costs nothing where it is too much.
        let length = until.minus(from).nanos().max(0);
        let count = usize::try_from(length / interval.nanos().max(1)).unwrap_or(usize::MAX);
        if !self.has_room(count, span) {
            return;
        }
        let times = (1_u64..).map(|k| from.plus(interval.times(k)).micros());
        for at_us in times.take_while(|&at_us| at_us < until.micros()) {
            self.refreshes.push(Event { at_us, command: command.clone(), kind: Kind::Refresh, span });
        }
    }

    /// What is still running at the end is ended.
    fn close(&mut self, end: Time, end_us: u64) {
        self.release(end);
        let mut closing = Vec::new();
        if self.state.drive().is_some_and(Command::keeps_driving) {
            self.left_running(self.last_drive, "the drive is still running when the script ends", "stop");
            closing.push((Command::STOP, self.last_drive));
        }
        if self.state.buzzer() == Some(true) {
            self.left_running(self.last_buzzer, "the buzzer is still on when the script ends", "buzzer off");
            closing.push((Command::Buzzer(false), self.last_buzzer));
        }
        if let Some(span) = self.raw {
            // Nobody knows what a raw frame left behind.
            closing = vec![(Command::STOP, span), (Command::Buzzer(false), span)];
        }
        for (command, span) in closing {
            self.events.push(Event { at_us: end_us, command, kind: Kind::Closing, span });
        }
    }

    fn left_running(&mut self, span: Span, message: &str, command: &str) {
        self.diagnostics.push(Diagnostic::new(
            Code::LeftRunning,
            span,
            message,
            format!("end the script with `{command}`; motionseq sends it at the end in any case"),
        ));
    }

    /// Whether so many more frames are allowed; where not, that is reported once.
    fn has_room(&mut self, more: usize, span: Span) -> bool {
        let total = self.events.len().saturating_add(self.refreshes.len()).saturating_add(more);
        let room = total <= self.limits.events;
        if !room && !self.full {
            self.full = true;
            let limit = self.limits.events;
            self.diagnostics.push(Diagnostic::new(
                Code::TooManyEvents,
                span,
                format!("the script sends more than {limit} frames"),
                "make it shorter or the refresh interval longer, or allow more with `--max-events`",
            ));
        }
        room
    }

    /// All events in the order of sending. The sort is stable, and both parts are sorted already.
    fn finish(self) -> Vec<Event> {
        let mut events = self.events;
        events.extend(self.refreshes);
        events.sort_by_key(|event| (event.at_us, event.kind));
        events
    }
}

/// Whether the end of a `for` is left out, because another command for the same thing starts at that very moment. A raw
/// frame is not interpreted, so it ends nothing.
fn superseded(end: &Point, group: &[Point]) -> bool {
    let same = |other: &Point| match end.command {
        Command::Buzzer(_) => matches!(other.command, Command::Buzzer(_)),
        _ => other.command.is_drive() && !matches!(other.command, Command::Raw { .. }),
    };
    group.iter().any(|other| !other.ends && other.order != end.order && same(other))
}
