//! A progress bar for long work, on terminals only.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use super::screen::Screen;

/// Work that takes less than this, in milliseconds, shows no bar.
const PATIENCE: u64 = 200;
/// Time between two updates, in milliseconds.
const REFRESH: u64 = 100;

/// Counts finished items and draws a bar. Dropping it clears the bar.
pub(super) struct ProgressBar<'s> {
    screen: &'s Screen,
    what: &'static str,
    total: usize,
    done: AtomicUsize,
    begin: Instant,
    /// When the bar is drawn next, in milliseconds since `begin`.
    next: AtomicU64,
}

impl<'s> ProgressBar<'s> {
    pub(super) fn new(screen: &'s Screen, what: &'static str, total: usize) -> Self {
        let (done, next) = (AtomicUsize::new(0), AtomicU64::new(PATIENCE));
        ProgressBar { screen, what, total, done, begin: Instant::now(), next }
    }

    /// Adds finished items, from any thread.
    pub(super) fn add(&self, count: usize) {
        let done = self.done.fetch_add(count, Ordering::Relaxed) + count;
        let now = u64::try_from(self.begin.elapsed().as_millis()).unwrap_or(u64::MAX);
        let next = self.next.load(Ordering::Relaxed);
        let is_due = now >= next
            // Only one thread draws.
            && self.next.compare_exchange(next, now.saturating_add(REFRESH), Ordering::Relaxed, Ordering::Relaxed).is_ok();
        if is_due {
            self.draw(done);
        }
    }

    fn draw(&self, done: usize) {
        let words = format!("{done} / {} {}", self.total, self.what);
        let room = self.screen.width().saturating_sub(words.len() + 2);
        let (done, total) = (u64::try_from(done).unwrap_or(u64::MAX), u64::try_from(self.total).unwrap_or(u64::MAX));
        self.screen.live(&format!("{words} {}", bar(done, total, room)));
    }
}

impl Drop for ProgressBar<'_> {
    fn drop(&mut self) {
        if self.next.load(Ordering::Relaxed) > PATIENCE {
            self.screen.live("");
        }
    }
}

/// `█████░░░░░`, at most 20 columns and at most `room`.
pub(super) fn bar(done: u64, total: u64, room: usize) -> String {
    let width = u64::try_from(room.min(20)).unwrap_or(0);
    let filled = u128::from(done) * u128::from(width);
    let filled = filled.checked_div(u128::from(total)).unwrap_or(u128::from(width));
    (0..width).map(|place| if u128::from(place) < filled { '█' } else { '░' }).collect()
}
