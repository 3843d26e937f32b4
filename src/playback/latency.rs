//! Measures how well this machine keeps time: waits like a session, without sending.

use super::os;
use super::session::close_in;
use crate::clock;
use crate::units::Nanos;

/// Waits for deadlines `interval` apart, for the time `lasts`, as a session waits for a frame, and passes each lateness to `tell`.
/// Missed deadlines are skipped.
///
/// `realtime`: this thread has real-time priority. Ends early when `goes_on` returns false.
pub fn lateness(
    interval: Nanos,
    lasts: Nanos,
    realtime: bool,
    mut tell: impl FnMut(Nanos),
    goes_on: impl Fn() -> bool,
) {
    os::wake_exactly();
    let end = clock::now().saturating_add(lasts);
    let interval = interval.max(Nanos(1));
    let mut deadline = clock::now().saturating_add(interval);
    while deadline < end && goes_on() {
        close_in(deadline, realtime);
        let now = clock::now();
        tell(now.saturating_sub(deadline));
        let missed = (now - deadline).0 / interval.0;
        deadline = deadline.saturating_add(interval.saturating_mul(missed + 1));
    }
}
