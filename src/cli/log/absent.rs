//! Replaces the log in a build without the cargo feature `mcap`; [`Log`](super::Log) reports that.

use std::fs::File;

use std::sync::Arc;
use std::sync::mpsc::Receiver;

use motionseq::board::Board;
use motionseq::units::Nanos;

use super::{About, Entry, Screen};

pub(super) const WHY_NOT: Option<&str> = Some("this motionseq was built without logs, the cargo feature `mcap`");

#[expect(clippy::too_many_arguments, reason = "as with logs")]
pub(super) fn write(
    _: File,
    _: String,
    _: Arc<Board>,
    _: About,
    _: Screen,
    _: &Receiver<(Nanos, Entry)>,
) -> Option<String> {
    None
}
