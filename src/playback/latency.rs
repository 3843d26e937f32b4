//! How exactly this machine keeps time: the driver's way of waiting, with nothing to send.

use super::driver::close_in;
use super::os;
use crate::clock;

/// Waits for deadlines `interval` nanoseconds apart for so many nanoseconds, as the driver waits for a frame, and tells how late
/// it was each time, in nanoseconds. What was overslept is not caught up: the next deadline lies ahead.
///
/// `realtime` says that this thread has real-time priority. `goes_on` is asked at each deadline.
pub fn lateness(interval: u64, lasts: u64, realtime: bool, mut tell: impl FnMut(u64), goes_on: impl Fn() -> bool) {
    os::wake_exactly();
    let end = clock::now().saturating_add(lasts);
    let interval = interval.max(1);
    let mut deadline = clock::now().saturating_add(interval);
    while deadline < end && goes_on() {
        close_in(deadline, realtime);
        let now = clock::now();
        tell(now.saturating_sub(deadline));
        let missed = now.saturating_sub(deadline) / interval;
        deadline = deadline.saturating_add(interval.saturating_mul(missed + 1));
    }
}
