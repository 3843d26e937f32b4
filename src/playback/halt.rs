//! The stop that every early end goes through, as a pure function of time and of what happened.
//!
//! What is queued is thrown away, then come zeros (a receiver that was cut off in the middle of a frame takes them for the rest of
//! it), the stop frame three times, buzzer off, and the script's `on abort`. Nothing skips it: a signal changes nothing, and a frame
//! that could not be written is tried again.

use super::messages::{Input, Order, Stop};
use crate::board::Board;
use crate::timeline::Event;
use crate::units::{Micros, Nanos};

/// Time between two stop frames.
const INTERVAL: Nanos = Nanos::from_millis(20);
/// How long the port may need for one frame before the stop is given up.
const PATIENCE: Nanos = Nanos::from_millis(500);
/// How long after a failure a frame is given to the port again, and how many failures there may be in all.
const RETRY: Nanos = Nanos::from_millis(5);
const MAX_FAILURES: u32 = 10;
/// The most bytes given to the port at once.
const BATCH: usize = 16 * 1024;

/// The frames of a stop and of the `on abort` after it, as bytes: the guard does not depend on a board family.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stops {
    /// Those that every early end sends. A first one that comes several times is sent at intervals.
    pub frames: Vec<Vec<u8>>,
    /// Those that follow, with their times from the first of them.
    abort: Vec<(Micros, Vec<u8>)>,
}

impl Stops {
    /// The stop of a board, and what a script sends after it.
    pub fn of(board: &Board, abort: &[Event]) -> Self {
        let frames = board.stop.iter().map(|command| board.to_frame(command)).collect();
        Stops { frames, abort: abort.iter().map(|event| (event.at, board.to_frame(&event.command))).collect() }
    }

    /// Only these.
    pub fn only(frames: Vec<Vec<u8>>) -> Self {
        Stops { frames, abort: Vec::new() }
    }

    /// Whether a frame is the first one, or the same again.
    fn is_first(&self, at: usize) -> bool {
        self.frames.get(at).is_some_and(|frame| self.frames.first() == Some(frame))
    }

    /// How many of the first frames the port must take: one may be lost after a frame that was cut.
    fn needed(&self) -> usize {
        (0..self.frames.len()).filter(|at| self.is_first(*at)).count().min(2)
    }
}

/// Bytes for the port, and how many of them it has taken. Never grows beyond what it was made with.
#[derive(Debug)]
pub(crate) struct Outbox {
    bytes: Vec<u8>,
    taken: usize,
    /// How many zeros follow a flush.
    zeros: usize,
}

impl Outbox {
    /// An empty one, for frames of at most `longest` bytes. So many zeros bring whoever receives what it holds back in step behind a
    /// flush.
    pub(crate) fn new(zeros: usize, longest: usize) -> Self {
        Outbox { bytes: Vec::with_capacity(BATCH + longest), taken: 0, zeros }
    }

    /// Of what comes from now on, a receiver may need more zeros.
    pub(super) fn needs_zeros(&mut self, zeros: usize) {
        self.zeros = self.zeros.max(zeros);
    }

    /// What the port still has to take.
    pub(super) fn rest(&self) -> &[u8] {
        self.bytes.get(self.taken..).unwrap_or_default()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rest().is_empty()
    }

    /// Whether no further frame should be added.
    pub(super) fn is_full(&self) -> bool {
        self.bytes.len() >= BATCH
    }

    /// Appends what `write` writes, a frame.
    pub(super) fn push(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        write(&mut self.bytes);
    }

    fn push_zeros(&mut self) {
        self.bytes.resize(self.bytes.len() + self.zeros.min(BATCH), 0);
    }

    /// The port took so many of them. Says whether these were the last.
    pub(super) fn took(&mut self, count: usize) -> bool {
        self.taken = self.taken.saturating_add(count).min(self.bytes.len());
        let all = self.is_empty();
        if all {
            self.clear();
        }
        all
    }

    /// To be taken once more from the beginning.
    fn rewind(&mut self) {
        self.taken = 0;
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
    /// How many frames of the stop, and behind them of `on abort`, were taken up.
    step: usize,
    /// When `abort` began.
    abort_from: Nanos,
    /// How many stops the port took whole.
    whole: usize,
    failures: u32,
    /// When the next frame is due.
    next_at: Nanos,
    /// When the port must have taken the last one.
    give_up: Nanos,
}

impl Halt {
    /// A stop that begins at `now`, once what was queued is thrown away, and whether `on abort` follows it.
    pub(super) fn new(aborts: bool, now: Nanos) -> Self {
        Halt { aborts, step: 0, abort_from: Nanos::ZERO, whole: 0, failures: 0, next_at: now, give_up: now }
    }

    /// How it went so far.
    pub(super) fn stop(&self, stops: &Stops) -> Stop {
        if self.whole >= stops.needed() { Stop::Sent } else { Stop::NotSent }
    }

    /// How many frames it has given to the port.
    pub(super) fn frames(&self) -> usize {
        self.step
    }

    /// What to do next; `None` once it is over.
    pub(super) fn poll(&mut self, now: Nanos, input: Input, stops: &Stops, out: &mut Outbox) -> Option<Order> {
        match input {
            Input::Failed(_) if self.failures < MAX_FAILURES => {
                self.failures += 1;
                out.rewind();
                return Some(Order::Pause { until: now.saturating_add(RETRY) });
            }
            Input::Failed(_) | Input::HungUp | Input::Panicked => out.clear(),
            Input::Wrote(count) => {
                let is_stop = self.step.checked_sub(1).is_some_and(|at| stops.is_first(at));
                self.whole += usize::from(out.took(count) && is_stop);
            }
            _ => {}
        }
        if !out.is_empty() {
            // A machine that stalls is no reason to give up: only a port that takes nothing is.
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

    /// The next frame of the stop, or of `on abort` behind it, which follows only where the robot was stopped.
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

    /// Where in `on abort` it is, once the stop is done.
    fn abort_at(&self, stops: &Stops) -> Option<usize> {
        self.step.checked_sub(stops.frames.len())
    }
}
