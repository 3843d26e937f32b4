//! The clock that nobody can set, in nanoseconds. Only what runs in real time imports it: playback, the way to a board,
//! and the virtual board's thread.
//!
//! It goes on while the computer sleeps: a robot that drove on meanwhile must not be sent the rest of its script as if
//! nothing had happened.

use rustix::time::{ClockId, Timespec, clock_gettime};

/// Nanoseconds since the computer was started.
pub fn now() -> u64 {
    let now = clock_gettime(ClockId::Boottime);
    let nanos = now.tv_sec.saturating_mul(1_000_000_000).saturating_add(now.tv_nsec);
    u64::try_from(nanos).unwrap_or(0)
}

/// Sleeps until an absolute time, so that nothing drifts; a signal ends the sleep early.
pub(crate) fn sleep_until(nanos: u64) {
    let _ = rustix::thread::clock_nanosleep_absolute(ClockId::Boottime, &timespec(nanos));
}

/// So many nanoseconds, as the system wants them.
pub(crate) fn timespec(nanos: u64) -> Timespec {
    let part = |nanos: u64| i64::try_from(nanos).unwrap_or(i64::MAX);
    Timespec { tv_sec: part(nanos / 1_000_000_000), tv_nsec: part(nanos % 1_000_000_000) }
}
