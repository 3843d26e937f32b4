//! Marks and `say` lines, which are reported at their times.

use super::super::messages::Notice;
use super::Player;
use crate::units::{Micros, Nanos};

/// The most marks and `say` lines that are reported in a time, so that a script with thousands of them at one moment delays no frame
/// and leaves room for the notices of the frames. The others follow.
const SAY_MOST: usize = 32;
const SAY_EVERY: Nanos = Nanos::from_millis(1);

impl Player<'_> {
    /// Reports the marks and the `say` lines up to a time, as many as are permitted `now`.
    pub(super) fn say(&mut self, time: Nanos, now: Nanos, notices: &mut impl FnMut(Notice)) {
        if now - self.said.0 >= SAY_EVERY {
            self.said = (now, 0);
        }
        let is_due = |at: Micros| at.nanos() <= time;
        let marks = self.marks.get(..self.limit.marks).unwrap_or_default();
        let cues = self.cues.get(..self.limit.cues).unwrap_or_default();
        while self.said.1 < SAY_MOST && marks.get(self.next_mark).is_some_and(|mark| is_due(mark.at)) {
            notices(Notice::Marked { mark: self.next_mark });
            self.next_mark += 1;
            self.said.1 += 1;
        }
        while self.said.1 < SAY_MOST && cues.get(self.next_cue).is_some_and(|cue| is_due(cue.at)) {
            let rows = cues.get(self.next_cue).into_iter().flat_map(|cue| cue.text.rows());
            notices(Notice::Say { cue: self.next_cue, report: self.judge.fresh_report(rows, now) });
            self.next_cue += 1;
            self.said.1 += 1;
        }
    }

    /// When the next mark or `say` line is reported, in the time of the script.
    pub(super) fn next_said(&self) -> Option<Nanos> {
        let marks = self.marks.get(..self.limit.marks).unwrap_or_default();
        let cues = self.cues.get(..self.limit.cues).unwrap_or_default();
        let cue = cues.get(self.next_cue).map(|cue| cue.at.nanos());
        let mark = marks.get(self.next_mark).map(|mark| mark.at.nanos()).filter(|at| *at <= self.end);
        let (since, count) = self.said;
        let permitted = if count < SAY_MOST { Nanos::ZERO } else { self.since_origin(since.saturating_add(SAY_EVERY)) };
        cue.into_iter().chain(mark).min().map(|at| at.max(permitted))
    }
}
