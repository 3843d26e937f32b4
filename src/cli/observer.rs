//! Events at a board that other programs use, for the display, the tape and the log.

use std::sync::Arc;

use motionseq::board::{OwnedItem, Report, State};
use motionseq::link::LineSettings;
use motionseq::sim::Pose;
use motionseq::units::Micros;

/// An event at a board that other programs use. The display, the tape and the log get the same events.
#[derive(Clone)]
pub(super) enum Event {
    /// A program has opened the port.
    Opened,
    /// The program has closed the port, or has ended.
    Closed,
    /// Frames of the program, and bytes that are not frames, each with the time at which it began on the line.
    Came(Arc<[(Micros, OwnedItem)]>),
    /// The board has reported.
    Report(Report),
    /// The program sends more than the line can carry: the number of waiting bytes, and for how long they wait.
    Behind(u64, Micros),
    /// At the end: the number of bytes of the program that were not read.
    Unread(u64),
    /// The program has set its line to other values than those of the board.
    SetUp(LineSettings),
    /// Some time has passed; a few times a second with the state of a virtual board.
    Passed(Option<Arc<Seen>>),
}

/// The state of a virtual board. Frames that a fault dropped are not in it.
pub(super) struct Seen {
    pub(super) state: State,
    /// Where the robot is, if the virtual board drives.
    pub(super) pose: Option<Pose>,
    pub(super) report: Report,
}
