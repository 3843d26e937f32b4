//! The observer of a run: shows, records, logs or counts it.

use std::sync::Arc;

use motionseq::playback::Notice;
use motionseq::timeline::Timeline;
use motionseq::units::Nanos;

/// Follows a run from the observers' thread.
pub(super) trait Observer {
    /// Takes a notice with its time on the clock of [`now`](motionseq::playback::now), in a pass that plays this timeline.
    fn observe(&mut self, timeline: &Arc<Timeline>, at: Nanos, notice: Notice);
}
