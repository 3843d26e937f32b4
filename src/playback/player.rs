//! What to do next, as a pure function of time and of what happened.
//!
//! Late is never caught up: a frame later than the limit is not sent, and the run ends. A refresh that a newer drive frame
//! has overtaken is dropped. Every end but the regular one is a stop: what is queued is thrown away, then the stop frame is
//! sent three times (a receiver that was cut off in the middle of a frame may miss the first), then buzzer off.

use crate::board::{Command, MAX_FRAME, Report};
use crate::source::Span;
use crate::timeline::{Event, Kind, Timeline};

const MILLISECOND: u64 = 1_000_000;
/// Time between two stop frames, in nanoseconds.
const STOP_INTERVAL: u64 = 20 * MILLISECOND;
/// How long the stop may take before it is given up, in nanoseconds.
const STOP_PATIENCE: u64 = 500 * MILLISECOND;
/// What every early end sends.
static STOP_FRAMES: [Command; 4] = [Command::STOP, Command::STOP, Command::STOP, Command::Buzzer(false)];
/// The most bytes given to the port at once.
const BATCH: usize = 16 * 1024;

/// What happened since the last order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Nothing but time.
    Tick,
    /// The port took so many of the bytes.
    Wrote(usize),
    /// The port takes no bytes now.
    Blocked,
    /// Writing failed, with the system's error number where there is one.
    Failed(Option<i32>),
    /// The other end of the port is gone.
    HungUp,
    /// This process got a signal.
    Signal(i32),
    /// Something panicked.
    Panicked,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Give [`Player::bytes`] to the port, in one write.
    Write,
    /// Throw away what the port was given but has not sent.
    Discard,
    /// Wait until this time, in nanoseconds from the start; if `writable`, no longer than until the port takes bytes.
    Wait {
        /// The deadline.
        until: u64,
        /// Whether to wake as soon as the port takes bytes.
        writable: bool,
    },
    /// Wait until this time, in nanoseconds from the start, and look at nothing else.
    Pause {
        /// The deadline.
        until: u64,
    },
    /// The run is over.
    Done,
}

/// What others may want to know while it plays. Small and without anything on the heap, so that it can be handed to
/// another thread without waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notice {
    /// This frame is given to the port.
    Sent {
        /// Its index in the track.
        event: usize,
        /// How late, in nanoseconds.
        late: u64,
    },
    /// This frame was left out, because a newer one had overtaken it.
    Dropped {
        /// Its index in the track.
        event: usize,
    },
    /// This line is due.
    Say {
        /// Its index in the timeline's cues.
        cue: usize,
    },
    /// The board has sent a report.
    Report(Report),
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Everything was sent.
    Finished,
    /// A signal asked for it.
    Signal(i32),
    /// The port was lost, with the system's error number where there is one.
    Lost(Option<i32>),
    /// The port stopped taking bytes.
    Stalled,
    /// A frame was later than allowed, by so many nanoseconds in all.
    Late(u64),
    /// The program failed.
    Panicked,
}

/// Whether the robot was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The run ended as the script says.
    NotNeeded,
    /// The port took the stop frame, more than once.
    Sent,
    /// It did not: the robot may still be moving.
    NotSent,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Why.
    pub cause: Cause,
    /// When, in microseconds from the start.
    pub at_us: u64,
    /// The last command that was taken up; for [`Cause::Late`] the one that was not sent.
    pub place: Option<Span>,
    /// Whether the robot was stopped.
    pub stop: Stop,
    /// Frames of the timeline that the port took whole.
    pub sent: usize,
    /// Frames that were left out.
    pub dropped: usize,
    /// The worst lateness of a frame, in nanoseconds.
    pub worst_late: u64,
}

/// Plays one track.
#[derive(Debug)]
pub struct Player<'t> {
    events: &'t [Event],
    abort: &'t [Event],
    cues: &'t [crate::timeline::Cue],
    end: u64,
    max_late: u64,
    phase: Phase,
    /// The next event that was not taken up.
    next: usize,
    next_cue: usize,
    /// Bytes for the port, and how many of them it has.
    out: Vec<u8>,
    given: usize,
    /// When the bytes were due.
    due: u64,
    /// How many frames are in it.
    pending: usize,
    /// The last event that was taken up.
    last: Option<usize>,
    sent: usize,
    dropped: usize,
    worst_late: u64,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Playing,
    Stopping(Stopping),
    Done(Outcome),
}

#[derive(Clone, Copy, Debug)]
struct Stopping {
    outcome: Outcome,
    /// Whether the queue was thrown away.
    discarded: bool,
    /// How many of [`STOP_FRAMES`], and behind them of `on abort`, were taken up.
    step: usize,
    /// When `on abort` began.
    abort_from: u64,
    /// How many stops the port took whole.
    whole: usize,
    /// When the next one is due.
    next_at: u64,
    give_up: u64,
}

impl<'t> Player<'t> {
    /// A player for the only track of `timeline`. A frame later than `max_late` nanoseconds ends the run.
    pub fn new(timeline: &'t Timeline, max_late: u64) -> Self {
        Player {
            events: timeline.events(),
            abort: timeline.abort(),
            cues: &timeline.cues,
            end: timeline.end_us.saturating_mul(1_000),
            max_late,
            phase: Phase::Playing,
            next: 0,
            next_cue: 0,
            out: Vec::with_capacity(BATCH + MAX_FRAME),
            given: 0,
            due: 0,
            pending: 0,
            last: None,
            sent: 0,
            dropped: 0,
            worst_late: 0,
        }
    }

    /// The bytes that the port still has to take.
    pub fn bytes(&self) -> &[u8] {
        self.out.get(self.given..).unwrap_or_default()
    }

    /// How the run ended, once it has.
    pub fn outcome(&self) -> Option<Outcome> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// What to do at `now`, in nanoseconds from the start, after `input` happened.
    pub fn poll(&mut self, now: u64, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        match self.phase {
            Phase::Playing => self.play(now, input, notices),
            Phase::Stopping(stopping) => self.stop(stopping, now, input),
            Phase::Done(_) => Order::Done,
        }
    }

    /// Ends the run at once, for a driver that cannot go on.
    pub(super) fn give_up(&mut self, now: u64) -> Outcome {
        Outcome { stop: Stop::NotSent, ..self.outcome_now(Cause::Panicked, now) }
    }

    fn play(&mut self, now: u64, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        match input {
            Input::Signal(signal) => return self.end_early(Cause::Signal(signal), now),
            Input::HungUp => return self.end_early(Cause::Lost(None), now),
            Input::Failed(error) => return self.end_early(Cause::Lost(error), now),
            Input::Panicked => return self.end_early(Cause::Panicked, now),
            Input::Wrote(count) => self.wrote(count),
            Input::Blocked | Input::Tick => {}
        }
        if !self.bytes().is_empty() {
            let give_up = self.due.saturating_add(self.max_late);
            return match input {
                _ if now > give_up => self.end_early(Cause::Stalled, now),
                Input::Blocked => Order::Wait { until: give_up + 1, writable: true },
                _ => Order::Write,
            };
        }
        self.say(now, notices);
        if let Some(late) = self.gather(now, notices) {
            return self.end_early(Cause::Late(late), now);
        }
        if !self.bytes().is_empty() {
            return Order::Write;
        }
        let next_event = self.events.get(self.next).map(due);
        let next_cue = self.cues.get(self.next_cue).map(|cue| cue.at_us.saturating_mul(1_000));
        match next_event.into_iter().chain(next_cue).min() {
            Some(until) => Order::Wait { until, writable: false },
            None if now < self.end => Order::Wait { until: self.end, writable: false },
            None => self.done(self.outcome_now(Cause::Finished, now)),
        }
    }

    /// The port took bytes.
    fn wrote(&mut self, count: usize) {
        self.given = self.given.saturating_add(count).min(self.out.len());
        if self.bytes().is_empty() {
            self.sent += self.pending;
            self.clear();
        }
    }

    fn clear(&mut self) {
        self.out.clear();
        self.given = 0;
        self.pending = 0;
    }

    fn say(&mut self, now: u64, notices: &mut impl FnMut(Notice)) {
        while self.cues.get(self.next_cue).is_some_and(|cue| cue.at_us.saturating_mul(1_000) <= now) {
            notices(Notice::Say { cue: self.next_cue });
            self.next_cue += 1;
        }
    }

    /// Takes up every event that is due. Gives the lateness of one that is too late.
    fn gather(&mut self, now: u64, notices: &mut impl FnMut(Notice)) -> Option<u64> {
        let rest = self.events.get(self.next..).unwrap_or_default();
        let is_due = rest.iter().take_while(|event| due(event) <= now).count();
        let ready = rest.get(..is_due).unwrap_or_default();
        for (at, event) in ready.iter().enumerate() {
            let index = self.next;
            let late = now - due(event);
            // Also for a refresh that would be dropped: a robot that was not fed for so long may have stopped already, and
            // must not start again by itself.
            if late > self.max_late {
                return Some(late);
            }
            if event.kind == Kind::Refresh && ready.iter().skip(at + 1).any(|newer| newer.command.is_drive()) {
                self.next += 1;
                self.dropped += 1;
                notices(Notice::Dropped { event: index });
                continue;
            }
            if self.out.is_empty() {
                self.due = due(event);
            } else if self.out.len() >= BATCH {
                break;
            }
            event.encode(&mut self.out);
            self.next += 1;
            self.pending += 1;
            self.last = Some(index);
            self.worst_late = self.worst_late.max(late);
            notices(Notice::Sent { event: index, late });
        }
        None
    }

    /// The next frame of the stop, or of `on abort` behind it, and when the one after it is due.
    fn next_stop_frame(&self, stopping: &mut Stopping, now: u64) -> Option<&'t Command> {
        let stop: Option<&'static Command> = STOP_FRAMES.get(stopping.step);
        let frame = match stopping.abort_at() {
            None => stop?,
            Some(_) if stopping.outcome.stop != Stop::Sent => return None,
            Some(at) => &self.abort.get(at)?.command,
        };
        stopping.step += 1;
        let pause = if stopping.step + 1 < STOP_FRAMES.len() { STOP_INTERVAL } else { 0 };
        stopping.next_at = now.saturating_add(pause);
        if let Some(at) = stopping.abort_at() {
            if at == 0 {
                stopping.abort_from = now;
            }
            if let Some(next) = self.abort.get(at) {
                stopping.next_at = stopping.abort_from.saturating_add(due(next));
            }
            stopping.give_up = stopping.next_at.saturating_add(STOP_PATIENCE);
        }
        Some(frame)
    }

    fn outcome_now(&self, cause: Cause, now: u64) -> Outcome {
        let place = match cause {
            Cause::Late(_) => Some(self.next),
            _ => self.last,
        };
        Outcome {
            cause,
            at_us: now / 1_000,
            place: place.and_then(|index| self.events.get(index)).map(|event| event.span),
            stop: Stop::NotNeeded,
            sent: self.sent,
            dropped: self.dropped,
            worst_late: self.worst_late,
        }
    }

    fn done(&mut self, outcome: Outcome) -> Order {
        self.phase = Phase::Done(outcome);
        Order::Done
    }

    fn end_early(&mut self, cause: Cause, now: u64) -> Order {
        self.clear();
        let outcome = Outcome { stop: Stop::NotSent, ..self.outcome_now(cause, now) };
        let stopping = Stopping {
            outcome,
            discarded: false,
            step: 0,
            abort_from: 0,
            whole: 0,
            next_at: now,
            give_up: now.saturating_add(STOP_PATIENCE),
        };
        self.stop(stopping, now, Input::Tick)
    }

    /// Goes on stopping. Nothing skips it: a second signal changes nothing, and a write that failed is tried again with
    /// the next frame.
    fn stop(&mut self, mut stopping: Stopping, now: u64, input: Input) -> Order {
        if !stopping.discarded {
            stopping.discarded = true;
            self.phase = Phase::Stopping(stopping);
            return Order::Discard;
        }
        match input {
            Input::Wrote(count) => {
                self.wrote(count);
                if self.bytes().is_empty() && (1..STOP_FRAMES.len()).contains(&stopping.step) {
                    stopping.whole += 1;
                }
                // The first may be lost behind a frame that was cut.
                if stopping.whole > 1 {
                    stopping.outcome.stop = Stop::Sent;
                }
            }
            Input::Failed(_) | Input::HungUp | Input::Panicked => self.clear(),
            Input::Blocked | Input::Signal(_) | Input::Tick => {}
        }
        // `on abort` follows only where the robot was stopped, and each of its frames has the patience of the stop.
        let order = if now > stopping.give_up {
            return self.done(stopping.outcome);
        } else if !self.bytes().is_empty() {
            match input {
                Input::Blocked => Order::Wait { until: stopping.give_up + 1, writable: true },
                _ => Order::Write,
            }
        } else if now < stopping.next_at {
            Order::Pause { until: stopping.next_at }
        } else if let Some(frame) = self.next_stop_frame(&mut stopping, now) {
            frame.encode(&mut self.out);
            Order::Write
        } else {
            return self.done(stopping.outcome);
        };
        self.phase = Phase::Stopping(stopping);
        order
    }
}

impl Stopping {
    /// Where in `on abort` it is, once the stop is done.
    fn abort_at(&self) -> Option<usize> {
        self.step.checked_sub(STOP_FRAMES.len())
    }
}

/// When an event is due, in nanoseconds from the start.
fn due(event: &Event) -> u64 {
    event.at_us.saturating_mul(1_000)
}
