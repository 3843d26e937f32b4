//! The virtual board as a pure device: frames in, reports out. It never fails; what goes wrong is put around it (`faults`).
//!
//! It holds no clock and no line: time is an input, so that the same device is behind a pseudo-terminal in real time (`serve`) and
//! under a clock that jumps. What the maker of the board does not publish is nominal here, and can be set ([`Settings`]).

mod device;
mod motion;

pub use crate::board::raspblock::{Geometry, Twist};
use crate::board::{Hundredths, NotACommand, Skip, State};
use crate::units::Micros;

pub use device::Device;
pub use motion::Pose;

/// What a board is like.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Nominal units, and the size of the robot.
    pub geometry: Geometry,
    /// The battery's voltage at rest, in hundredths of a volt.
    pub battery: Hundredths,
    /// After how long without a drive frame the robot stops; `None` for never. The real board's is not published.
    pub silence: Option<Micros>,
    /// The time between two reports.
    pub report_every: Micros,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            geometry: Geometry::default(),
            battery: Hundredths(1_200),
            silence: Some(Micros::from_millis(500)),
            report_every: Micros::from_millis(100),
        }
    }
}

/// What a board has received, and what became of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Received {
    /// All bytes.
    pub bytes: u64,
    /// Frames that were understood.
    pub frames: u64,
    /// Whole frames that say nothing the board knows.
    pub not_understood: u64,
    /// Bytes that belong to no frame, but for the zeros of a stop.
    pub skipped: u64,
    /// The first thing that was wrong, with its position in the stream.
    pub first_fault: Option<(u64, Fault)>,
    /// Frames on the line that the board did not get, or spoiled.
    pub lost: u64,
    /// What the board was last told.
    pub state: State,
    /// Where the robot is.
    pub pose: Pose,
    /// Whether it moves: a speed holds, or a displacement is under way.
    pub moves: bool,
}

/// What was wrong with received bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// Bytes that are no frame.
    #[error(transparent)]
    Skipped(Skip),
    /// A frame that is no command.
    #[error(transparent)]
    NotACommand(NotACommand),
}
