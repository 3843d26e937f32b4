//! The stop that every early end goes through, as a pure function of time and of what happened.
//!
//! What is queued is thrown away, then come zeros (a receiver that was cut off in the middle of a frame takes them for the rest of
//! it), the stop frame three times, buzzer off, and the script's `on abort`. Nothing skips it: a signal changes nothing, and a frame
//! that could not be written is tried again.

use super::messages::{Input, Order, Stop};
use crate::board::{Command, MAX_FRAME, MOST_ZEROS};
use crate::timeline::Event;

/// Time between two stop frames, in nanoseconds.
const INTERVAL: u64 = 20_000_000;
/// How long the port may need for one frame before the stop is given up, in nanoseconds.
const PATIENCE: u64 = 500_000_000;
/// How long after a failure a frame is given to the port again, in nanoseconds, and how many failures there may be in all.
const RETRY: u64 = 5_000_000;
const MAX_FAILURES: u32 = 10;
/// What every early end sends.
static FRAMES: [Command; 4] = [Command::STOP, Command::STOP, Command::STOP, Command::Buzzer(false)];
/// The most bytes given to the port at once.
const BATCH: usize = 16 * 1024;

/// Bytes for the port, and how many of them it has taken. Never grows beyond what it was made with.
#[derive(Debug)]
pub(crate) struct Outbox {
    bytes: Vec<u8>,
    taken: usize,
    /// How many zeros follow a flush.
    zeros: usize,
}

impl Outbox {
    /// An empty one. So many zeros bring whoever receives what it holds back in step behind a flush.
    pub(crate) fn new(zeros: usize) -> Self {
        Outbox { bytes: Vec::with_capacity(BATCH + MAX_FRAME), taken: 0, zeros }
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

    pub(super) fn push(&mut self, command: &Command) {
        command.encode(&mut self.bytes);
    }

    fn push_zeros(&mut self) {
        self.bytes.resize(self.bytes.len() + self.zeros.min(MOST_ZEROS), 0);
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
pub(super) struct Halt<'t> {
    /// What follows once the robot was stopped.
    abort: &'t [Event],
    /// How many of [`FRAMES`], and behind them of `abort`, were taken up.
    step: usize,
    /// When `abort` began.
    abort_from: u64,
    /// How many stops the port took whole.
    whole: usize,
    failures: u32,
    /// When the next frame is due.
    next_at: u64,
    /// When the port must have taken the last one.
    give_up: u64,
}

impl<'t> Halt<'t> {
    /// A stop that begins at `now`, once what was queued is thrown away, and what follows it.
    pub(super) fn new(abort: &'t [Event], now: u64) -> Self {
        Halt { abort, step: 0, abort_from: 0, whole: 0, failures: 0, next_at: now, give_up: now }
    }

    /// How it went so far. One stop may be lost behind a frame that was cut.
    pub(super) fn stop(&self) -> Stop {
        if self.whole > 1 { Stop::Sent } else { Stop::NotSent }
    }

    /// How many frames it has given to the port.
    pub(super) fn frames(&self) -> usize {
        self.step
    }

    /// What to do next; `None` once it is over.
    pub(super) fn poll(&mut self, now: u64, input: Input, out: &mut Outbox) -> Option<Order> {
        match input {
            Input::Failed(_) if self.failures < MAX_FAILURES => {
                self.failures += 1;
                out.rewind();
                return Some(Order::Pause { until: now.saturating_add(RETRY) });
            }
            Input::Failed(_) | Input::HungUp | Input::Panicked => out.clear(),
            Input::Wrote(count) => {
                let is_stop = (1..FRAMES.len()).contains(&self.step);
                self.whole += usize::from(out.took(count) && is_stop);
            }
            _ => {}
        }
        if !out.is_empty() {
            // A machine that stalls is no reason to give up: only a port that takes nothing is.
            (now <= self.give_up).then_some(match input {
                Input::Blocked => Order::Wait { until: self.give_up + 1, writable: true },
                _ => Order::Write,
            })
        } else if now < self.next_at {
            Some(Order::Pause { until: self.next_at })
        } else {
            let is_first = self.step == 0;
            let frame = self.next_frame(now)?;
            if is_first {
                out.push_zeros();
            }
            out.push(frame);
            Some(Order::Write)
        }
    }

    /// The next frame of the stop, or of `on abort` behind it, which follows only where the robot was stopped.
    fn next_frame(&mut self, now: u64) -> Option<&'t Command> {
        let frame: &'t Command = match self.abort_at() {
            None => FRAMES.get(self.step)?,
            Some(_) if self.stop() == Stop::NotSent => return None,
            Some(at) => &self.abort.get(at)?.command,
        };
        self.step += 1;
        let pause = if self.step + 1 < FRAMES.len() { INTERVAL } else { 0 };
        self.next_at = now.saturating_add(pause);
        if let Some(at) = self.abort_at() {
            if at == 0 {
                self.abort_from = now;
            }
            if let Some(next) = self.abort.get(at) {
                self.next_at = self.abort_from.saturating_add(next.at_us.saturating_mul(1_000));
            }
        }
        self.give_up = now.saturating_add(PATIENCE);
        Some(frame)
    }

    /// Where in `on abort` it is, once the stop is done.
    fn abort_at(&self) -> Option<usize> {
        self.step.checked_sub(FRAMES.len())
    }
}
