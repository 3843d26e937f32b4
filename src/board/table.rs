//! The table of a board family: its resources, verbs, axes, and codec.

use std::fmt;
use std::sync::Arc;

use super::Text;
use super::command::{Command, VerbId};
use super::frame::{BufferStart, FrameError};
use super::quantity::{Change, Hundredths, Quantity, Replies};
use super::verb::{Axis, Verb};
use crate::units::Micros;

/// The highest speed of a serial line, in bits per second.
pub const MAX_BAUD: u32 = 4_000_000;

/// A family of boards.
#[derive(Clone, Debug)]
pub struct Board {
    /// Its name in messages.
    pub name: Text,
    /// How a script chooses it, after the word `board`: `raspblock`, `"my-robot.toml"`.
    pub line: Text,
    /// The speed of its serial line in bits per second (8N1: ten bits per byte).
    pub baud: u32,
    /// The highest speed that it accepts.
    pub max_baud: u32,
    /// What its verbs set, in the order in which [`State::commands`](super::State::commands)
    /// restores a state. The end of a script brings active resources to rest in the opposite order.
    pub resources: Vec<Resource>,
    /// Its commands. If several of them send the same frame, it is decoded as the first.
    pub verbs: Vec<Verb>,
    /// Limits that apply unless a script sets its own.
    pub limits: Vec<DefaultLimit>,
    /// The quantities that it reports, in the order of the values of a [`Report`](super::Report).
    /// The first is always displayed, and comes last in a complete report.
    pub quantities: Vec<Arc<Quantity>>,
    /// Changes of these quantities, which scripts use like quantities.
    pub changes: Vec<Change>,
    /// The commands that start and stop reports. A script with an `expect` or a `wait until` sends
    /// them at its start and end.
    pub reporting: Option<[Command; 2]>,
    /// What is sent at time 0, before everything else.
    pub hello: Vec<Command>,
    /// What is sent after the last frame, unless the run ends early.
    pub goodbye: Vec<Command>,
    /// What every early end sends; nothing, if the board has no stop. If the first command is
    /// repeated, its copies are sent at intervals.
    pub stop: Vec<Command>,
    /// What the robot does after an early end of a board without a stop: `servos hold their last
    /// position`.
    pub without_stop: Text,
    /// Whether an early end discards bytes that the port has not sent, which may truncate a frame.
    /// Otherwise, a frame that has begun is completed.
    pub flushes: bool,
    /// A verb whose frames can be read in two ways, if there is one.
    pub ambiguity: Option<Ambiguity>,
    /// Words of other languages for these verbs, each with the line to write instead.
    pub foreign: Vec<(Text, Text)>,
    /// How the board is drawn; `None` for one lane per value.
    pub picture: Option<Picture>,
    /// What the virtual board does in addition to keeping the state.
    pub simulation: Simulation,
    /// Encodes and decodes frames.
    pub codec: Arc<dyn Codec>,
    /// How the board answers.
    pub replies: Replies,
    /// How its servos are prepared before a script and held at a stop, if it reports their positions.
    pub feedback: Option<Feedback>,
}

/// How the servos of a board that reports their positions are prepared before a script, and held at a stop.
#[derive(Clone, Debug)]
pub struct Feedback {
    /// The verb that sets the position of a servo, which its index selects.
    pub verb: VerbId,
    /// The verb with the same index that asks for this position.
    pub position: VerbId,
    /// A reported position in the unit of `verb`, perhaps outside of its range; `None` if the servo has no
    /// position.
    pub value: fn(Hundredths) -> Option<i32>,
    /// What must be read and sent before the first command of a script; `None` for nothing.
    pub preparation: Option<Preparation>,
    /// Whether a stop reads the positions of servos, and makes them their targets, unless a move has
    /// brought a servo as near to its target as this.
    pub holds: Option<i32>,
}

/// What must be read and sent for each servo before the first command of a script. The position becomes the target before the servo
/// gets torque, so that it does not move.
#[derive(Clone, Debug)]
pub struct Preparation {
    /// The verb that asks for the mode of a servo, which must be 0.
    pub mode: VerbId,
    /// What another mode means, to follow the name of the servo.
    pub mode_words: fn(i32) -> String,
    /// The verb that asks for settings that a servo keeps, and the verbs that set them.
    pub settings: (VerbId, [VerbId; 2]),
    /// The verb that switches the torque of a servo on, with the value 1.
    pub enable: VerbId,
    /// How long a soft start takes, unless a script sets it.
    pub soft: Micros,
}

/// A part of a robot that does one thing at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Its name in messages: `the drive`, `servo 1`.
    pub name: Text,
    /// Its key in logs: `drive`, `servo_1`.
    pub key: Text,
    /// What it is for; empty if the name says it.
    pub about: Text,
    /// The command that brings it to rest, ends a `for`, and closes a script that leaves it active.
    pub rest: Option<Command>,
    /// The word for its active state: `running`, `on`.
    pub activity: Text,
    /// The phrase for its state at rest: `is stopped`, `is off`.
    pub idle: Text,
    /// Whether the robot moves while it is active.
    pub drives: bool,
    /// How often the command that keeps it active is repeated, unless a script sets another
    /// interval; `None` if that is not needed.
    pub refresh: Option<Micros>,
    /// Whether two commands for it at the same time are an error.
    pub is_exclusive: bool,
    /// Its assumed speed unless a script sets one, in the unit of its value per second; `None` if
    /// it reaches values immediately.
    pub speed: Option<u32>,
}

/// The subject of a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limited {
    /// The verb.
    pub verb: VerbId,
    /// The value of its index, if it has one.
    pub index: Option<i32>,
    /// The position of the value; `None` for all values.
    pub axis: Option<usize>,
}

/// A limit that applies unless a script sets its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DefaultLimit {
    /// The limited value.
    pub limited: Limited,
    /// The smallest and the largest value.
    pub range: (i32, i32),
    /// The reason for it.
    pub why: Text,
    /// When a script may set a wider one.
    pub unless: Text,
}

/// A verb whose frames can be read in two ways.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ambiguity {
    /// The verb.
    pub verb: VerbId,
    /// The note for such frames.
    pub note: Text,
}

/// What the virtual board does in addition to keeping its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Simulation {
    /// Nothing.
    State,
    /// It drives on mecanum wheels, and reports its orientation and its voltage.
    Mecanum,
    /// It answers for its channels, and an error sends them home.
    Channels,
    /// Each servo answers for itself, on a line of one wire.
    Servos,
}

/// How a family is drawn.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The lanes, from the top.
    pub lanes: Vec<Lane>,
    /// What a command changes in which lanes.
    pub draw: fn(&Board, &Command) -> Vec<(usize, Shown)>,
}

/// A lane of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Lane {
    /// Its name.
    pub name: Text,
    /// Its place on the robot, or its purpose; empty if the name says it.
    pub about: Text,
    /// What it shows.
    pub kind: LaneKind,
}

/// What a lane shows.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LaneKind {
    /// A value over time.
    Curve {
        /// Its unit.
        unit: Text,
        /// The labels of values below and above zero.
        ends: [Text; 2],
        /// The smallest and the largest value that the board takes, as a script writes them.
        range: (f64, f64),
        /// The limits that apply to it.
        limited: Vec<Limited>,
        /// Its group. All lanes of a group are hidden if each of them is always zero.
        group: Option<u8>,
        /// Whether the lane is shown even then, if the script only stops the robot.
        shows_rest: bool,
    },
    /// A state that is on or off.
    Spans {
        /// The text of the tooltip while it is on; empty if the state is one of several words.
        text: Text,
        /// Whether it is drawn as prominently as a command.
        is_strong: bool,
    },
    /// Moments.
    Ticks {
        /// Whether the robot moves then.
        is_motion: bool,
    },
}

/// What a command shows in a lane.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shown {
    /// A value from here on; `None` if it is unknown.
    Value(Option<f64>),
    /// Another verb brings the resource to rest: 0 from here on, if the lane has any value.
    Rest,
    /// The state changes to on or off.
    Switch(bool),
    /// The state changes to this word; `None` if it is off or unknown.
    Word(Option<Text>),
    /// Something happens at this moment.
    Tick,
}

/// The codec of a family: how its commands become bytes, and how bytes are read. It must find the
/// frames of a stream no matter how the stream is split into reads.
pub trait Codec: fmt::Debug + Send + Sync {
    /// Appends the frame of a command.
    fn encode(&self, board: &Board, command: &Command, out: &mut Vec<u8>);

    /// The length of that frame in bytes.
    fn length(&self, board: &Board, command: &Command) -> usize {
        let mut out = Vec::new();
        self.encode(board, command, &mut out);
        out.len()
    }

    /// Checks that bytes are exactly one frame.
    ///
    /// # Errors
    /// Why they are not.
    fn check(&self, bytes: &[u8]) -> Result<(), FrameError>;

    /// Decodes a frame. Strict: encoding the result gives the same bytes.
    ///
    /// # Errors
    /// Why the frame is not a command.
    fn decode(&self, board: &Board, frame: &[u8]) -> Result<Command, NotACommand>;

    /// Any frame as the verb that sends raw frames; `None` if the family has no such verb.
    fn raw(&self, _board: &Board, _frame: &[u8]) -> Option<Command> {
        None
    }

    /// Another command with the same frame as the one that [`decode`](Self::decode) returns.
    fn other_reading(&self, board: &Board, frame: &[u8]) -> Option<Command> {
        self.raw(board, frame)
    }

    /// The commands of a script that together do the same as one that no script contains; none if there are no such commands.
    fn in_script(&self, _board: &Board, _command: &Command) -> Vec<Command> {
        Vec::new()
    }

    /// Classifies the first bytes of a stream; `in_zeros` says whether zeros came just before them.
    fn front(&self, bytes: &[u8], in_zeros: bool) -> BufferStart;

    /// The number of bytes, at least one, up to the next byte that can start a frame.
    fn next_start(&self, bytes: &[u8]) -> usize;

    /// The longest frame in bytes.
    fn longest(&self) -> usize;

    /// The number of zeros that resynchronize a receiver after a flush truncated the frame of this
    /// command; `None` for any frame.
    fn resync(&self, _command: Option<&Command>) -> usize {
        0
    }
}

/// Why a valid frame is not a command in the table of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotACommand {
    /// No verb sends it.
    #[error("no command has this function and length")]
    Unknown,
    /// A value is outside its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The values are valid, but this is not their frame: it has a wrong direction byte, for
    /// example.
    #[error("the bytes differ from the frame of this command")]
    Inconsistent,
    /// The frame is valid only in the other reading of the verb in [`Board::ambiguity`].
    #[error("{0}")]
    OtherReading(&'static str),
    /// The board knows it, but no verb sends it; what it does.
    #[error("{0}, which no command of a script does")]
    NotInScripts(&'static str),
}

/// A value that the board does not accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} is out of range ({} to {})", self.shown(self.value), self.shown(self.min), self.shown(self.max))]
pub struct OutOfRange {
    /// The value.
    pub value: i32,
    /// The smallest allowed.
    pub min: i32,
    /// The largest allowed.
    pub max: i32,
    /// How many of these values are 1 in a script.
    pub scale: i32,
}

impl OutOfRange {
    /// Checks a value of an axis.
    pub fn check(value: i32, axis: &Axis) -> Result<i32, OutOfRange> {
        let (min, max) = axis.range;
        if (min..=max).contains(&value) { Ok(value) } else { Err(OutOfRange { value, min, max, scale: axis.scale }) }
    }

    /// A value as a script writes it.
    fn shown(&self, value: i32) -> f64 {
        f64::from(value) / f64::from(self.scale.max(1))
    }
}

/// Boards with the same names and the same tables are equal.
impl PartialEq for Board {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.line, &self.resources, &self.verbs)
            == (&other.name, &other.line, &other.resources, &other.verbs)
    }
}

impl Eq for Board {}
