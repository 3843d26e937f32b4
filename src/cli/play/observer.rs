//! What follows a run: shows it, writes it down, counts.

use std::sync::Arc;

use motionseq::playback::Notice;
use motionseq::timeline::Timeline;
use motionseq::units::Nanos;

/// Follows a run from its own thread.
pub(super) trait Observer {
    /// Something happened at a time on the clock of [`now`](motionseq::playback::now), in a pass that plays this timeline.
    fn observe(&mut self, timeline: &Arc<Timeline>, at: Nanos, notice: Notice);

    /// Some time has passed.
    fn update(&mut self, _: &Timeline) {}
}
