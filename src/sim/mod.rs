//! The virtual board as a pure device: frames in, reports out. It fails only if
//! the module `faults` tells it to.
//!
//! It has no clock and no line: time is an input, so that the same device works in real time (`serve`) and with a simulated clock. Values
//! that the maker of the board does not publish are nominal, and can be set ([`Settings`]).

mod channels;
mod device;
mod motion;
mod servos;

pub use crate::board::raspblock::{Geometry, Twist};
use crate::board::{Hundredths, NotACommand, Skip, State};
use crate::units::Micros;

pub use device::Device;
pub use motion::Pose;
pub use servos::servo_fault;

/// The properties of a board.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Nominal units, and the size of the robot.
    pub geometry: Geometry,
    /// The battery's voltage at rest, in hundredths of a volt.
    pub battery: Hundredths,
    /// The time without a drive frame after which the robot stops; `None` for never. The time of the real board is unknown.
    pub silence: Option<Micros>,
    /// The time between two reports.
    pub report_every: Micros,
    /// The servos on a bus; `None` for one of each number.
    pub servos: Option<Vec<ServoSetup>>,
    /// The speed of the line in bits per second; `None` for that of the family.
    pub baud: Option<u32>,
}

/// A servo on a bus when it is switched on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ServoSetup {
    /// Its number.
    pub id: u8,
    /// Where it is, in steps.
    pub position: u16,
    /// How it is driven: 0 for positions, 1 as a wheel.
    pub mode: u8,
}

impl ServoSetup {
    /// A servo in the center, which is driven by positions.
    pub fn new(id: u8) -> Self {
        ServoSetup { id, position: 2_048, mode: 0 }
    }
}

/// What is wrong with a servo of a bus, or different.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ServoFault {
    /// It never answers.
    Silent,
    /// It answers twice.
    Twice,
    /// It answers with the number of another servo.
    Other,
    /// The sums of its answers are wrong.
    Sum,
    /// It answers 40 ms later.
    Late,
    /// It is driven as a wheel.
    Wheel,
    /// It reports a position that no servo has.
    Lost,
    /// It reports too much load.
    Error,
    /// It moves slowly.
    Slow,
    /// It is at this position when it is switched on.
    At(u16),
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            geometry: Geometry::default(),
            battery: Hundredths(1_200),
            silence: Some(Micros::from_millis(500)),
            report_every: Micros::from_millis(100),
            servos: None,
            baud: None,
        }
    }
}

/// What a board has received, and the effects.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Received {
    /// All bytes.
    pub bytes: u64,
    /// Frames that were understood.
    pub frames: u64,
    /// Complete frames that the board does not know.
    pub not_understood: u64,
    /// Bytes outside of frames, except the zeros of a stop.
    pub skipped: u64,
    /// The first error, with its position in the stream.
    pub first_fault: Option<(u64, Fault)>,
    /// How often an error sent all channels home, on a board that does so.
    pub homes: u64,
    /// Frames on the line that did not arrive, or arrived with errors.
    pub lost: u64,
    /// The last commands of the board.
    pub state: State,
    /// Where the robot is.
    pub pose: Pose,
    /// Whether it moves: a speed applies, or a displacement is not finished.
    pub moves: bool,
    /// The servos that fell when their torque went off.
    pub fell: Vec<u8>,
}

/// What was wrong with received bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// Bytes that are not a frame.
    #[error(transparent)]
    Skipped(Skip),
    /// A frame that is not a command.
    #[error(transparent)]
    NotACommand(NotACommand),
}
