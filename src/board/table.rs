//! The table of a board family: its resources, verbs, axes, and codec.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::Text;
use super::command::{Command, VerbId};
use super::frame::{BufferStart, FrameError};
use super::quantity::{Change, Quantity, ReportLine};

/// The row of a resource in the table of its board.
pub type ResourceId = usize;

/// A family of boards.
#[derive(Clone, Debug)]
pub struct Board {
    /// The name of the family.
    pub name: Text,
    /// The speed of its serial line in bits per second (8N1: ten bits per byte).
    pub baud: u32,
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
    /// What every early end sends. If the first command is repeated, its copies are sent at
    /// intervals.
    pub stop: Vec<Command>,
    /// A verb whose frames can be read in two ways, if there is one.
    pub ambiguity: Option<Ambiguity>,
    /// Words of other languages for these verbs, each with the line to write instead.
    pub foreign: Vec<(Text, Text)>,
    /// How the board is drawn; `None` for one lane per value.
    pub picture: Option<Picture>,
    /// What the virtual board does in addition to keeping the state.
    pub simulation: Simulation,
    /// Encodes and decodes frames.
    pub codec: Codec,
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
    /// Whether the command that keeps it active must be repeated.
    pub needs_refresh: bool,
    /// Whether two commands for it at the same time are an error.
    pub is_exclusive: bool,
    /// Its assumed speed unless a script sets one, in the unit of its value per second; `None` if
    /// it reaches values immediately.
    pub speed: Option<u32>,
}

/// One command of a script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verb {
    /// The first word of the line.
    pub word: Text,
    /// The complete line with its arguments.
    pub usage: Text,
    /// A valid line.
    pub example: Text,
    /// What it does, in a few words.
    pub meaning: Text,
    /// Its values.
    pub axes: Vec<Axis>,
    /// The resources that it sets.
    pub sets: Sets,
    /// What stays active after it.
    pub activity: Activity,
    /// Whether `for D` can follow it.
    pub holds: bool,
    /// Whether `over D` can follow it. Such a verb has at most [`MAX_MOVING`](super::MAX_MOVING)
    /// values besides an index.
    pub moves: bool,
    /// Its precondition.
    pub needs: Option<Needs>,
    /// The name of the lane of its frames, if it sets several resources or none.
    pub frames: Text,
    /// The command that this word is a synonym of.
    pub is: Option<Command>,
    /// The verb that is displayed instead of this one for one of its commands.
    pub alias: Option<VerbId>,
    /// The tolerance of a move in a recording: how far it may be from the recorded values at any
    /// time, in their unit.
    pub tolerance: i32,
}

/// One value of a verb.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Its name before the `=` in a script; empty for a positional value.
    pub name: Text,
    /// Its name in messages, with an article: `the speed x`.
    pub what: Text,
    /// Its key in logs: `x`; empty if the key of the resource is enough.
    pub key: Text,
    /// The smallest and the largest value that the board accepts.
    pub range: (i32, i32),
    /// How a script writes it.
    pub takes: ValueForm,
    /// Its unit.
    pub unit: Unit,
    /// Why its range ends there, or where to write the value; empty if that needs no explanation.
    pub why: Text,
}

/// How a script writes a value.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ValueForm {
    /// A number, which is rounded. A named one may be omitted and is 0 then.
    Number,
    /// A whole number that selects a resource.
    Index,
    /// A whole number from 0 to 255.
    Byte,
    /// Any number of bytes up to this maximum; always the last axis.
    Bytes(usize),
    /// One of these words, each with its value.
    Word(Vec<(Text, i32)>),
    /// Several whole numbers separated by commas, each of which is a value: the name of one, and
    /// the letters that represent them, separated by commas.
    List(Text, Text),
}

/// The unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// No unit, or the board's own.
    None,
    /// A pulse width in microseconds. A script may also give the angle of a servo, in degrees.
    Micros {
        /// The pulse width at 0 degrees.
        least: i32,
        /// The pulse width at 180 degrees.
        most: i32,
    },
}

impl Unit {
    /// Its symbol in messages, after a number and a space; empty if there is none.
    pub fn symbol(self) -> &'static str {
        match self {
            Unit::None => "",
            Unit::Micros { .. } => "µs",
        }
    }
}

/// The resources that a verb sets.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sets {
    /// None.
    Nothing,
    /// One resource.
    One(ResourceId),
    /// One resource for each value of the first axis, an index.
    Indexed(Vec<ResourceId>),
    /// Several resources, each as another verb would set it.
    Parts(Vec<Part>, Vec<ResourceId>),
    /// Unknown: the frame is not interpreted. These first values make a resource unknown.
    Opaque(Vec<(i32, ResourceId)>),
}

/// One value of a verb, expressed as another verb.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The other verb, which has an index and one more value.
    pub verb: VerbId,
    /// The index.
    pub index: i32,
}

/// What stays active after a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Activity {
    /// Nothing is active: the value stays.
    Still,
    /// The resource is active unless all values are 0.
    Unless0,
    /// The resource is active, even if all values are 0.
    Always,
    /// The resource is active for an unknown time and then at rest.
    Passing,
}

/// The precondition of a verb.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    /// The resource that must have been set
    pub resource: ResourceId,
    /// to a command with this first value.
    pub value: i32,
    /// The message if it was not.
    pub message: Text,
    /// The command that sets it, in short.
    pub what: Text,
    /// A line that sets it.
    pub line: Text,
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
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lane {
    /// Its name.
    pub name: Text,
    /// Its place on the robot, or its purpose; empty if the name says it.
    pub about: Text,
    /// What it shows.
    pub kind: LaneKind,
}

/// What a lane shows.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LaneKind {
    /// A value over time.
    Curve {
        /// Its unit.
        unit: Text,
        /// The labels of values below and above zero.
        ends: [Text; 2],
        /// The smallest and the largest value that the board takes.
        range: (i32, i32),
        /// The limits that apply to it.
        limited: Vec<Limited>,
        /// Its group. All lanes of a group are hidden if each of them is always zero.
        group: Option<u8>,
        /// Whether the lane is shown even then, if the script only stops the robot.
        shows_rest: bool,
    },
    /// A state that is on or off.
    Spans {
        /// The text of the tooltip while it is on.
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
    /// The state changes to on or off.
    Switch(bool),
    /// Something happens at this moment.
    Tick,
}

/// The codec. It must find the frames of a stream no matter how the stream is split into reads.
#[derive(Clone, Copy, Debug)]
pub struct Codec {
    /// Appends the frame of a command.
    pub encode: fn(&Board, &Command, &mut Vec<u8>),
    /// The length of that frame in bytes.
    pub length: fn(&Board, &Command) -> usize,
    /// Checks that bytes are exactly one frame.
    pub check: fn(&[u8]) -> Result<(), FrameError>,
    /// Decodes a frame. Strict: encoding the result gives the same bytes.
    pub decode: fn(&Board, &[u8]) -> Result<Command, NotACommand>,
    /// Any frame as the verb that sends raw frames; `None` if the family has no such verb.
    pub raw: fn(&Board, &[u8]) -> Option<Command>,
    /// Classifies the first bytes of a stream; the flag says whether padding came just before them.
    pub front: fn(&[u8], bool) -> BufferStart,
    /// The number of bytes, at least one, up to the next byte that can start a frame.
    pub next_start: fn(&[u8]) -> usize,
    /// The longest frame in bytes.
    pub longest: usize,
    /// The number of zeros that resynchronize a receiver after a flush truncated the frame of this
    /// command; `None` for any frame.
    pub resync: fn(Option<&Command>) -> usize,
    /// How to find and parse reports in the board's replies.
    pub replies: ReportLine,
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
}

/// A value that the board does not accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} is out of range ({min} to {max})")]
pub struct OutOfRange {
    /// The value.
    pub value: i32,
    /// The smallest allowed.
    pub min: i32,
    /// The largest allowed.
    pub max: i32,
}

impl OutOfRange {
    /// Checks a value.
    pub fn check(value: i32, (min, max): (i32, i32)) -> Result<i32, OutOfRange> {
        if (min..=max).contains(&value) { Ok(value) } else { Err(OutOfRange { value, min, max }) }
    }
}

/// Boards with the same name and the same tables are equal.
impl PartialEq for Board {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.resources, &self.verbs) == (&other.name, &other.resources, &other.verbs)
    }
}

impl Eq for Board {}

impl Axis {
    /// The number of values that it has in a command; those of [`ValueForm::Bytes`] are not counted.
    pub fn count(&self) -> usize {
        match &self.takes {
            ValueForm::List(_, letters) => letters.split(',').count(),
            ValueForm::Bytes(_) => 0,
            _ => 1,
        }
    }
}

impl Verb {
    /// The values that a move changes: all except an index.
    pub fn moving(&self) -> &[Axis] {
        self.axes.get(usize::from(self.is_indexed())..).unwrap_or_default()
    }

    /// Whether the first value selects a resource.
    pub fn is_indexed(&self) -> bool {
        matches!(self.sets, Sets::Indexed(_))
    }

    /// The range of its index.
    pub(crate) fn indices(&self) -> Option<RangeInclusive<i32>> {
        let (least, most) = self.axes.first().filter(|_| self.is_indexed())?.range;
        Some(least..=most)
    }
}
