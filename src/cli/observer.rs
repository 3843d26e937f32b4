//! What happens at a board that other programs use, for the display, the tape and the log.

use std::sync::Arc;

use motionseq::board::{OwnedItem, Report, State};
use motionseq::link::LineSettings;
use motionseq::sim::Pose;
use motionseq::units::Micros;

/// What happens at a board that other programs use. The display, the tape and the log are told the same.
#[derive(Clone)]
pub(super) enum Event {
    /// A program has opened the port.
    Opened,
    /// It has closed it, or has ended.
    Closed,
    /// Frames of the program, and bytes that are not frames, each with the time at which it began on the line.
    Came(Arc<[(Micros, OwnedItem)]>),
    /// The board has reported.
    Report(Report),
    /// The program sends more than the line carries: how many bytes wait, and for how long.
    Behind(u64, Micros),
    /// At the end: how many bytes that the program had written could not be read.
    Unread(u64),
    /// The program has set its line up otherwise than the board's.
    SetUp(LineSettings),
    /// Some time has passed; how a virtual board is now, a few times a second.
    Passed(Option<Arc<Seen>>),
}

/// How a virtual board is. What a fault has kept from it, it was not told.
pub(super) struct Seen {
    pub(super) state: State,
    pub(super) pose: Pose,
    pub(super) report: Report,
}
