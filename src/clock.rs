//! The clock that cannot be set. Only code that runs in real time imports it: playback, the link to
//! a board, and the virtual board's thread.
//!
//! It continues while the computer is suspended: after that, a robot that kept driving must not get
//! the rest of its script as if nothing had happened.

use crate::units::Nanos;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// The time since the computer was booted.
pub fn now() -> Nanos {
    let now = clock_gettime(ClockId::Boottime);
    let nanos = now.tv_sec.saturating_mul(1_000_000_000).saturating_add(now.tv_nsec);
    Nanos(u64::try_from(nanos).unwrap_or(0))
}

/// Sleeps until an absolute time, so that delays do not accumulate. A signal ends the sleep early.
pub(crate) fn sleep_until(time: Nanos) {
    let _ = rustix::thread::clock_nanosleep_absolute(ClockId::Boottime, &timespec(time));
}

/// Converts a time to the system's type.
pub(crate) fn timespec(Nanos(nanos): Nanos) -> Timespec {
    let part = |nanos: u64| i64::try_from(nanos).unwrap_or(i64::MAX);
    Timespec { tv_sec: part(nanos / 1_000_000_000), tv_nsec: part(nanos % 1_000_000_000) }
}
