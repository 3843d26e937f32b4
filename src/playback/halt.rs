//! The stop that every early end uses, as a pure function of time and inputs.
//!
//! Queued bytes are discarded, or the frame that has begun is completed, as the board permits. Then it sends zeros (which complete
//! a frame that was cut off), the stop of the board, if it has one, and the script's `on abort`. Nothing skips it: signals are
//! ignored, and a failed write is repeated.

use std::sync::Arc;

use super::hold::Hold;
use super::messages::{Input, Order, Stop};
use super::outbox::Outbox;
use crate::board::{Board, ServoSet};
use crate::timeline::Event;
use crate::units::{Micros, Nanos};

/// Time between two stop frames.
const INTERVAL: Nanos = Nanos::from_millis(20);
/// How long the port may take for one frame before the stop is given up.
const PATIENCE: Nanos = Nanos::from_millis(500);
/// How long after a failed write it is repeated, and how many writes may fail in all.
const RETRY: Nanos = Nanos::from_millis(5);
const MAX_FAILURES: u32 = 10;
/// The frames of a stop and of the following `on abort`, as bytes, and how servos are held.
#[derive(Debug, Default)]
pub struct Stops {
    /// The frames of a stop. The first frame and its repeats are sent at intervals.
    pub frames: Vec<Vec<u8>>,
    /// Whether bytes may follow a truncated frame. Otherwise, a frame is sent once, and nothing after half of it.
    is_lenient: bool,
    /// The frames of `on abort`, with their times from the first of them.
    abort: Vec<(Micros, Vec<u8>)>,
    /// For a board whose stop holds its servos.
    pub(crate) hold: Option<Hold>,
}

impl Stops {
    /// The stop of a board, and what a script sends after it.
    pub fn of(board: &Arc<Board>, abort: &[Event]) -> Self {
        let frames = board.stop.iter().map(|command| board.to_frame(command)).collect();
        let abort = abort.iter().map(|event| (event.at, board.to_frame(&event.command))).collect();
        Stops { frames, is_lenient: board.flushes, abort, hold: Hold::of(board) }
    }

    /// A stop without `on abort`.
    pub fn only(frames: Vec<Vec<u8>>) -> Self {
        Stops { is_lenient: !frames.is_empty(), frames, ..Stops::default() }
    }

    /// A stop begins, with these servos to hold; `goal` is the target of a servo that has followed a move.
    pub(crate) fn begin(&mut self, servos: ServoSet, goal: impl Fn(i32) -> Option<i32>) {
        if let Some(hold) = &mut self.hold {
            hold.begin(servos, goal);
        }
    }

    /// Takes bytes of the board during a stop.
    pub(crate) fn hear(&mut self, bytes: &[u8]) {
        if let Some(hold) = &mut self.hold {
            hold.hear(bytes);
        }
    }

    /// Whether an answer of the board has come that a stop waits for.
    pub(super) fn has_news(&self) -> bool {
        self.hold.as_ref().is_some_and(Hold::has_news)
    }

    /// The servos that may still be on their way after a stop.
    pub(crate) fn missing(&self) -> ServoSet {
        self.hold.as_ref().map(Hold::missing).unwrap_or_default()
    }

    /// Whether a frame is the first one or a repeat of it.
    fn is_first(&self, at: usize) -> bool {
        self.frames.get(at).is_some_and(|frame| self.frames.first() == Some(frame))
    }

    /// How many first frames the port must accept: one may be lost after a frame that was cut off.
    fn needed(&self) -> usize {
        (0..self.frames.len()).filter(|at| self.is_first(*at)).count().min(2)
    }
}

/// A stop under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Halt {
    /// Whether `on abort` follows once the robot was stopped.
    aborts: bool,
    /// How many frames of the stop and then of `on abort` were processed.
    step: usize,
    /// How many frames were sent to hold servos.
    held: usize,
    /// When `abort` began.
    abort_from: Nanos,
    /// How many stop frames the port accepted completely.
    whole: usize,
    /// Whether it accepted a frame of `on abort` completely.
    has_aborted: bool,
    failures: u32,
    /// When the next frame is due.
    next_at: Nanos,
    /// When the port must have accepted the last frame.
    give_up: Nanos,
}

impl Halt {
    /// A stop that starts at `now`, after queued bytes were discarded. `aborts`: whether `on abort` follows.
    pub(super) fn new(aborts: bool, now: Nanos) -> Self {
        let give_up = now.saturating_add(PATIENCE);
        let (step, held, whole, has_aborted, failures) = (0, 0, 0, false, 0);
        Halt { aborts, step, held, abort_from: Nanos::ZERO, whole, has_aborted, failures, next_at: now, give_up }
    }

    /// Whether the robot is stopped.
    pub(super) fn stop(&self, stops: &Stops) -> Stop {
        if let Some(hold) = &stops.hold {
            hold.stop()
        } else if stops.frames.is_empty() {
            Stop::NotDefined
        } else if self.whole >= stops.needed() {
            Stop::Sent
        } else {
            Stop::NotSent
        }
    }

    /// Whether the port accepted a frame of `on abort` completely.
    pub(super) fn has_aborted(&self) -> bool {
        self.has_aborted
    }

    /// How many frames were written to the port.
    pub(super) fn frames(&self) -> usize {
        self.step + self.held
    }

    /// What to do next; `None` once it is over.
    pub(super) fn poll(&mut self, now: Nanos, input: Input, stops: &mut Stops, out: &mut Outbox) -> Option<Order> {
        match input {
            Input::Failed(_) if self.failures < MAX_FAILURES => {
                self.failures += 1;
                if stops.is_lenient {
                    out.rewind();
                }
                return Some(Order::Pause { until: now.saturating_add(RETRY) });
            }
            Input::Failed(_) | Input::HungUp => {
                self.aborts &= stops.is_lenient;
                out.clear();
                if stops.hold.is_some() {
                    return None;
                }
            }
            Input::Panicked => {
                self.aborts &= stops.is_lenient || !out.has_begun();
                out.clear();
                stops.hold.iter_mut().for_each(Hold::ask_again);
            }
            Input::Wrote(count) => {
                let is_stop = self.step.checked_sub(1).is_some_and(|at| stops.is_first(at));
                let is_whole = out.took(count);
                self.whole += usize::from(is_whole && is_stop);
                self.has_aborted |= is_whole && self.step > stops.frames.len();
            }
            _ => {}
        }
        if !out.is_empty() {
            // Give up only on a port that accepts nothing, not on a machine that stalls.
            (now <= self.give_up).then_some(match input {
                Input::Blocked => Order::Wait { until: self.give_up + Nanos(1), writable: true },
                _ => Order::Write,
            })
        } else if now < self.next_at {
            Some(Order::Pause { until: self.next_at })
        } else if let Some(order) = stops.hold.as_mut().and_then(|hold| hold.poll(now, out)) {
            self.give_up = now.saturating_add(PATIENCE);
            self.held += usize::from(order == Order::Write);
            Some(order)
        } else {
            let is_first = self.step == 0;
            let frame = self.next_frame(now, stops)?;
            if is_first {
                out.push_zeros();
            }
            out.push(|bytes| bytes.extend_from_slice(frame));
            Some(Order::Write)
        }
    }

    /// The next frame of the stop, or of `on abort`, which follows only if the robot was stopped.
    fn next_frame<'s>(&mut self, now: Nanos, stops: &'s Stops) -> Option<&'s [u8]> {
        let frame = match self.abort_at(stops) {
            None => stops.frames.get(self.step)?,
            Some(_) if !self.aborts || self.stop(stops) == Stop::NotSent => return None,
            Some(at) => &stops.abort.get(at)?.1,
        };
        self.step += 1;
        let pause = if stops.is_first(self.step) { INTERVAL } else { Nanos::ZERO };
        self.next_at = now.saturating_add(pause);
        if let Some(at) = self.abort_at(stops) {
            if at == 0 {
                self.abort_from = now;
            }
            if let Some((at, _)) = stops.abort.get(at) {
                self.next_at = self.abort_from.saturating_add(at.nanos());
            }
        }
        self.give_up = now.saturating_add(PATIENCE);
        Some(frame)
    }

    /// The position in `on abort`, once the stop is done.
    fn abort_at(&self, stops: &Stops) -> Option<usize> {
        self.step.checked_sub(stops.frames.len())
    }
}
