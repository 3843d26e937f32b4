//! Stops the robot, for a guard and for a tap that ends.

use super::halt::{Halt, Stops};
use super::messages::{Input, Order, Stop};
use super::os::{self, Ready};
use super::outbox::Outbox;
use crate::clock;
use crate::link::Link;
use crate::units::Nanos;

/// The longest time between two heartbeats.
const BEAT: Nanos = Nanos::from_millis(20);
/// The most reads of old bytes: more than a port buffers.
const MAX_READS: usize = 64;

/// Stops the robot: discards queued bytes and sends the stop frames. For a board without a stop, it only completes the frame in
/// `out`. Calls `beat` regularly, for a guard that watches.
pub(crate) fn stop_robot(port: &mut impl Link, stops: &mut Stops, out: &mut Outbox, mut beat: impl FnMut()) -> Stop {
    if !stops.frames.is_empty() {
        let _ = port.discard();
        out.clear();
    }
    // An answer from before would be taken for that of the stop.
    let mut buffer = [0; 256];
    for _ in 0..MAX_READS {
        if !matches!(port.read(&mut buffer), Ok(1..)) {
            break;
        }
    }
    let mut halt = Halt::new(false, clock::now());
    let mut input = Input::Tick;
    while let Some(order) = halt.poll(clock::now(), input, stops, out) {
        beat();
        input = match order {
            Order::Write => Input::of_write(port.write(out.rest())),
            Order::Wait { until, writable } => {
                let left = until.saturating_sub(clock::now()).min(BEAT);
                let watched = if writable { Ready::OUT } else { Ready::IN };
                match os::wait([(Some(port.descriptor()), watched)], Some(left)) {
                    Ok([ready]) if os::is_gone(ready) => Input::HungUp,
                    Ok([ready]) if ready.contains(Ready::IN) => {
                        let count = port.read(&mut buffer).unwrap_or(0);
                        stops.hear(buffer.get(..count).unwrap_or_default());
                        Input::Tick
                    }
                    _ => Input::Tick,
                }
            }
            Order::Pause { until } => {
                clock::sleep_until(until);
                Input::Tick
            }
            _ => Input::Tick,
        };
    }
    halt.stop(stops)
}
