//! The stop that every early end uses, as a pure function of time and inputs.
//!
//! Queued bytes are discarded, or the frame that has begun is completed, as the board permits. Then it sends zeros (which complete
//! a frame that was cut off), the stop of the board, if it has one, and the script's `on abort`. Nothing skips it: signals are
//! ignored, and a failed write is repeated.

use super::messages::{Input, Order, Stop};
use crate::board::{Board, BufferStart, Codec};
use crate::timeline::Event;
use crate::units::{Micros, Nanos};

/// Time between two stop frames.
const INTERVAL: Nanos = Nanos::from_millis(20);
/// How long the port may take for one frame before the stop is given up.
const PATIENCE: Nanos = Nanos::from_millis(500);
/// How long after a failed write it is repeated, and how many writes may fail in all.
const RETRY: Nanos = Nanos::from_millis(5);
const MAX_FAILURES: u32 = 10;
/// The most bytes written to the port at once.
const BATCH: usize = 16 * 1024;

/// The frames of a stop and of the following `on abort`, as bytes: the guard does not depend on a board family.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stops {
    /// The frames of a stop. The first frame and its repeats are sent at intervals.
    pub frames: Vec<Vec<u8>>,
    /// Whether bytes may follow a truncated frame. Otherwise, a frame is sent once, and nothing after half of it.
    is_lenient: bool,
    /// The frames of `on abort`, with their times from the first of them.
    abort: Vec<(Micros, Vec<u8>)>,
}

impl Stops {
    /// The stop of a board, and what a script sends after it.
    pub fn of(board: &Board, abort: &[Event]) -> Self {
        let frames = board.stop.iter().map(|command| board.to_frame(command)).collect();
        let abort = abort.iter().map(|event| (event.at, board.to_frame(&event.command))).collect();
        Stops { frames, is_lenient: board.flushes, abort }
    }

    /// A stop without `on abort`.
    pub fn only(frames: Vec<Vec<u8>>) -> Self {
        Stops { is_lenient: !frames.is_empty(), frames, abort: Vec::new() }
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

/// Bytes for the port, and how many of them it has accepted. Its capacity never grows.
#[derive(Debug)]
pub(crate) struct Outbox {
    bytes: Vec<u8>,
    taken: usize,
    /// How many zeros are sent after a flush.
    zeros: usize,
}

impl Outbox {
    /// An empty outbox, for frames of at most `longest` bytes. `zeros` bytes of zeros synchronize the receiver after a flush.
    pub(crate) fn new(zeros: usize, longest: usize) -> Self {
        Outbox { bytes: Vec::with_capacity(BATCH + longest), taken: 0, zeros }
    }

    /// Raises the number of zeros, for a receiver that needs more from now on.
    pub(super) fn needs_zeros(&mut self, zeros: usize) {
        self.zeros = self.zeros.max(zeros);
    }

    /// The bytes that the port has not accepted.
    pub(super) fn rest(&self) -> &[u8] {
        self.bytes.get(self.taken..).unwrap_or_default()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rest().is_empty()
    }

    /// Whether the port has accepted a part of the bytes.
    fn has_begun(&self) -> bool {
        self.taken > 0 && !self.is_empty()
    }

    /// Whether no further frame should be added.
    pub(super) fn is_full(&self) -> bool {
        self.bytes.len() >= BATCH
    }

    /// Appends a frame, which `write` writes.
    pub(crate) fn push(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        write(&mut self.bytes);
    }

    fn push_zeros(&mut self) {
        self.bytes.resize(self.bytes.len() + self.zeros.min(BATCH), 0);
    }

    /// The port accepted `count` bytes. Returns whether the outbox is empty now.
    pub(super) fn took(&mut self, count: usize) -> bool {
        self.taken = self.taken.saturating_add(count).min(self.bytes.len());
        let all = self.is_empty();
        if all {
            self.clear();
        }
        all
    }

    /// Writes everything again from the start.
    fn rewind(&mut self) {
        self.taken = 0;
    }

    /// Keeps only the rest of the frame that the port has begun to accept.
    pub(super) fn keep_begun(&mut self, codec: &dyn Codec) {
        let mut end = 0;
        while end < self.taken {
            match codec.front(self.bytes.get(end..).unwrap_or_default(), false) {
                BufferStart::Frame(length) | BufferStart::Skip(length, _) => end += length.max(1),
                BufferStart::NeedMore => end = self.bytes.len(),
            }
        }
        self.bytes.truncate(end);
        self.took(0);
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.taken = 0;
    }
}

/// A stop under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Halt {
    /// Whether `on abort` follows once the robot was stopped.
    aborts: bool,
    /// How many frames of the stop and then of `on abort` were processed.
    step: usize,
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
        let (step, whole, has_aborted, failures) = (0, 0, false, 0);
        Halt { aborts, step, abort_from: Nanos::ZERO, whole, has_aborted, failures, next_at: now, give_up }
    }

    /// Whether the robot is stopped.
    pub(super) fn stop(&self, stops: &Stops) -> Stop {
        if stops.frames.is_empty() {
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
        self.step
    }

    /// What to do next; `None` once it is over.
    pub(super) fn poll(&mut self, now: Nanos, input: Input, stops: &Stops, out: &mut Outbox) -> Option<Order> {
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
            }
            Input::Panicked => {
                self.aborts &= stops.is_lenient || !out.has_begun();
                out.clear();
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
