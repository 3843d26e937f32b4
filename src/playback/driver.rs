//! The loop that does what the player orders, under the real clock.
//!
//! It waits for the port and for signals until a millisecond before the deadline, then sleeps on the absolute deadline, so
//! nothing drifts. It neither locks, logs nor prints.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::os::{self, Signals};
use super::player::{Input, Notice, Order, Outcome, Player};
use crate::board::{ReportDecoder, ReportItem};
use crate::clock;
use crate::link::Link;

/// How long before a deadline the loop stops looking at the port, in nanoseconds.
const CLOSE: u64 = 1_000_000;
/// How often the loop may panic before it is given up.
const MAX_PANICS: usize = 10;

/// Plays until the end, or until something ends it early. Time 0 of the script is now.
pub fn drive(
    player: &mut Player<'_>,
    link: &mut impl Link,
    signals: &Signals,
    mut notices: impl FnMut(Notice),
) -> Outcome {
    let start = clock::now();
    let mut input = Input::Tick;
    // A robot hangs on this: whatever failed, it is stopped. What fails again while stopping is skipped.
    for _ in 0..MAX_PANICS {
        let run = AssertUnwindSafe(|| run(player, link, signals, start, input, &mut notices));
        match catch_unwind(run) {
            Ok(outcome) => return outcome,
            Err(_) => input = Input::Panicked,
        }
    }
    player.give_up(clock::now().saturating_sub(start))
}

fn run(
    player: &mut Player<'_>,
    link: &mut impl Link,
    signals: &Signals,
    start: u64,
    mut input: Input,
    notices: &mut impl FnMut(Notice),
) -> Outcome {
    let mut reports = ReportDecoder::new();
    loop {
        if input == Input::Tick {
            // Also where one write follows another, and before the first.
            input = signals.pending().map_or(Input::Tick, Input::Signal);
        }
        let now = clock::now().saturating_sub(start);
        let order = player.poll(now, input, notices);
        if let Some(outcome) = player.outcome() {
            return outcome;
        }
        input = match order {
            Order::Write => match link.write(player.bytes()) {
                Ok(count) => Input::Wrote(count),
                Err(error) => failed(&error),
            },
            Order::Discard => {
                // Where the port is gone there is nothing to throw away, and the stop tells.
                let _ = link.discard();
                Input::Tick
            }
            Order::Wait { until, writable } => {
                let mut heard = |item| {
                    if let ReportItem::Report(report) = item {
                        notices(Notice::Report(report));
                    }
                };
                wait(link, signals, start.saturating_add(until), writable, &mut reports, &mut heard)
            }
            Order::Pause { until } => {
                clock::sleep_until(start.saturating_add(until));
                Input::Tick
            }
            Order::Done => Input::Tick,
        };
    }
}

fn failed(error: &io::Error) -> Input {
    match error.kind() {
        io::ErrorKind::WouldBlock => Input::Blocked,
        io::ErrorKind::Interrupted => Input::Tick,
        _ => Input::Failed(error.raw_os_error()),
    }
}

/// Waits until `deadline` on the monotonic clock, or until something happens.
fn wait(
    link: &mut impl Link,
    signals: &Signals,
    deadline: u64,
    writable: bool,
    reports: &mut ReportDecoder,
    heard: &mut impl FnMut(ReportItem),
) -> Input {
    loop {
        let left = deadline.saturating_sub(clock::now());
        if left <= CLOSE && !writable {
            clock::sleep_until(deadline);
            return Input::Tick;
        }
        let timeout = if writable { left } else { left - CLOSE };
        let woken = match os::wait(link.descriptor(), signals, writable, timeout) {
            Ok(woken) => woken,
            Err(error) => return Input::Failed(error.raw_os_error()),
        };
        if woken.signal
            && let Some(signal) = signals.take()
        {
            return Input::Signal(signal);
        }
        if woken.readable {
            let mut buffer = [0; 256];
            match link.read(&mut buffer) {
                Ok(0) => return Input::HungUp,
                Ok(count) => reports.feed(buffer.get(..count).unwrap_or_default(), &mut *heard),
                Err(error) if matches!(failed(&error), Input::Failed(_)) => return failed(&error),
                Err(_) => {}
            }
        }
        if woken.hung_up {
            return Input::HungUp;
        }
        if writable {
            return Input::Tick;
        }
    }
}
