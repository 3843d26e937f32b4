//! Replaces the log in a build without the cargo feature `mcap`; [`Log`](super::Log) reports that.

use std::fs::File;

use std::sync::mpsc::Receiver;

use motionseq::units::Nanos;

use super::{About, Entry, LoggedRobot, Screen};

pub(super) const WHY_NOT: Option<&str> = Some("this motionseq was built without logs, the cargo feature `mcap`");

pub(super) fn write(
    _: (File, String),
    _: Vec<LoggedRobot>,
    _: About,
    _: Screen,
    _: &Receiver<(Nanos, usize, Entry)>,
) -> Option<String> {
    None
}
