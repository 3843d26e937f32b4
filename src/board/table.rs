//! The table of a board family: its resources, verbs and axes, and all that follows from them.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::Text;
use super::command::{Command, VerbId};
use super::frame::{FrameError, Front};
use super::quantity::{Quantity, ReportLine};

/// A resource, by its row in the table of its board.
pub type ResourceId = usize;

/// A family of boards.
#[derive(Clone, Debug)]
pub struct Board {
    /// What it is called.
    pub name: Text,
    /// The speed of its serial line, in bits a second (8N1: ten bits a byte).
    pub baud: u32,
    /// What its verbs set, in the order in which [`State::commands`](super::State::commands) brings a board back to a state. What is still active at the end of a
    /// script is brought to rest in the opposite order.
    pub resources: Vec<Resource>,
    /// Its commands. A frame that several of them send is decoded as the first one.
    pub verbs: Vec<Verb>,
    /// Ranges that hold where a script sets none.
    pub limits: Vec<DefaultLimit>,
    /// What it reports, in the order of the values of a [`Report`](super::Report). The first one is always shown, and of a whole report last.
    pub quantities: Vec<Arc<Quantity>>,
    /// What makes it report, and what ends that: sent at the start and at the end of a script that expects something.
    pub reporting: Option<[Command; 2]>,
    /// What every early end sends. A first command that comes several times is sent at intervals.
    pub stop: Vec<Command>,
    /// A verb whose frames can be read in two ways, if there is one.
    pub ambiguity: Option<Ambiguity>,
    /// What other languages call what its verbs do: the word, and a line to write instead.
    pub foreign: Vec<(Text, Text)>,
    /// How it is drawn; `None` for a lane for each value.
    pub picture: Option<Picture>,
    /// What the virtual board does besides keeping the state.
    pub simulation: Simulation,
    /// The way to bytes and back.
    pub codec: Codec,
}

/// A part of a robot that does one thing at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resource {
    /// What messages call it: `the drive`, `servo 1`.
    pub name: Text,
    /// What logs call it: `drive`, `servo_1`.
    pub key: Text,
    /// What it is for; empty where the name says it.
    pub about: Text,
    /// The command that brings it to rest, ends a `for`, and closes a script that leaves it active.
    pub rest: Option<Command>,
    /// How it is while it is active, and otherwise: `running` and `stands`, `on` and `is off`.
    pub activity: Text,
    /// The other one.
    pub idle: Text,
    /// Whether a command that keeps it active must be sent again and again.
    pub needs_refresh: bool,
    /// Whether two commands for it at one time are a mistake.
    pub is_exclusive: bool,
    /// How fast it is taken to go where a script does not say, in the unit of its value a second; `None` for at once.
    pub speed: Option<u32>,
}

/// One command of a script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verb {
    /// The word that a line starts with.
    pub word: Text,
    /// The whole line, with its arguments.
    pub usage: Text,
    /// A line that works.
    pub example: Text,
    /// What it does, in a few words.
    pub meaning: Text,
    /// Its values.
    pub axes: Vec<Axis>,
    /// Which resources it sets.
    pub sets: Sets,
    /// What stays active after it.
    pub activity: Activity,
    /// Whether `for D` may follow it.
    pub holds: bool,
    /// Whether `over D` may follow it; then it has at most [`MAX_MOVING`](super::MAX_MOVING) values besides an index.
    pub moves: bool,
    /// What must come before it.
    pub needs: Option<Needs>,
    /// What its frames are called together, where they set several resources or none.
    pub frames: Text,
    /// The command that it is another word for.
    pub is: Option<Command>,
    /// The verb that is another word for one of its commands, and is shown instead.
    pub alias: Option<VerbId>,
    /// How far a folded move may be from what was recorded, at any time, in the unit of its values.
    pub tolerance: i32,
}

/// One value of a verb.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Its name before the `=` in a script; empty for a positional value.
    pub name: Text,
    /// What messages call it, with its article: `the speed x`.
    pub what: Text,
    /// What logs call it: `x`; empty where they name the resource.
    pub key: Text,
    /// The smallest and the largest value that the board takes.
    pub range: (i32, i32),
    /// How it is written.
    pub takes: Takes,
    /// Its unit.
    pub unit: Unit,
    /// Why its range ends where it does, or where it is written; empty where that needs no words.
    pub why: Text,
}

/// How a value is written in a script.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Takes {
    /// A number, which is rounded. One with a name may be left out, and is 0 then.
    Number,
    /// A whole number that says which resource is meant.
    Index,
    /// A whole number from 0 to 255.
    Byte,
    /// As many of these as there are, but no more than this: always the last axis.
    Bytes(usize),
    /// One of these words, each with its value.
    Word(Vec<(Text, i32)>),
    /// Several whole numbers with commas between them, which are several values: what each is called, and how many letters stand for them.
    List(Text, Text),
}

/// The unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// None, or the board's own.
    None,
    /// A pulse width in microseconds. A script may also give the angle of a servo: what 0 and 180 degrees are.
    Micros {
        /// At 0 degrees.
        least: i32,
        /// At 180 degrees.
        most: i32,
    },
}

impl Unit {
    /// Its symbol in messages, after a number and a space; empty for none.
    pub fn symbol(self) -> &'static str {
        match self {
            Unit::None => "",
            Unit::Micros { .. } => "µs",
        }
    }
}

/// Which resources a verb sets.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sets {
    /// None.
    Nothing,
    /// This one.
    One(ResourceId),
    /// One for each value of its first axis, an index.
    Indexed(Vec<ResourceId>),
    /// Several, each as another verb would; and these.
    Parts(Vec<Part>, Vec<ResourceId>),
    /// It is not interpreted, so its effect is unknown; certain first values make a resource unknown.
    Opaque(Vec<(i32, ResourceId)>),
}

/// What one value of a verb sets, in the words of another.
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
    /// Nothing: the value stays.
    Still,
    /// Its resource is active, unless every value is 0.
    Unless0,
    /// Its resource is active, also where every value is 0.
    Always,
    /// Its resource is active for an unknown time, and then at rest.
    Passing,
}

/// What must come before a verb.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    /// The resource that must have been set last,
    pub resource: ResourceId,
    /// with this as its first value.
    pub value: i32,
    /// What is wrong otherwise.
    pub message: Text,
    /// What sets it, as short as it can be said.
    pub what: Text,
    /// A line that sets it.
    pub line: Text,
}

/// What a limit is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limited {
    /// The verb.
    pub verb: VerbId,
    /// The value of its index, if it has one.
    pub index: Option<i32>,
    /// Which of its values; `None` for each of them.
    pub axis: Option<usize>,
}

/// A range that holds where a script sets none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DefaultLimit {
    /// What is limited.
    pub limited: Limited,
    /// The smallest and the largest value.
    pub range: (i32, i32),
    /// Why.
    pub why: Text,
    /// When a script may widen it.
    pub unless: Text,
}

/// A verb whose frames can be read in two ways.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ambiguity {
    /// The verb.
    pub verb: VerbId,
    /// What is said where there is such a frame.
    pub note: Text,
}

/// What the virtual board does besides keeping its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Simulation {
    /// Nothing.
    State,
    /// It drives on mecanum wheels, and reports where it looks and its voltage.
    Mecanum,
}

/// How a family is drawn.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The lanes, from the top.
    pub lanes: Vec<Lane>,
    /// What a command shows: lanes, and what becomes of each.
    pub draw: fn(&Board, &Command) -> Vec<(usize, Shown)>,
}

/// A lane of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lane {
    /// What it is.
    pub name: Text,
    /// Where on the robot, or what for; empty where the name says it.
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
        /// What the values below and above zero are called.
        ends: [Text; 2],
        /// The smallest and the largest value that the board takes.
        range: (i32, i32),
        /// What a `limit` on it is for.
        limited: Vec<Limited>,
        /// Whether it is left out where it is zero all the time, and so are all of this group.
        group: Option<u8>,
        /// Whether it is shown nevertheless, where the script only stops the robot.
        shows_rest: bool,
    },
    /// Something that is on or off.
    Spans {
        /// What is said of it while it is on.
        text: Text,
        /// Whether it is drawn as strongly as a command.
        is_strong: bool,
    },
    /// Things that happen.
    Ticks {
        /// Whether the robot moves then.
        is_motion: bool,
    },
}

/// What a command shows in a lane.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shown {
    /// A value from here on, or that it is unknown.
    Value(Option<f64>),
    /// It goes on or off.
    Switch(bool),
    /// It happens.
    Tick,
}

/// The codec. It must find the frames in a stream however the stream is cut into reads.
#[derive(Clone, Copy, Debug)]
pub struct Codec {
    /// Appends the frame that carries a command.
    pub encode: fn(&Board, &Command, &mut Vec<u8>),
    /// How many bytes that frame has.
    pub length: fn(&Board, &Command) -> usize,
    /// Whether bytes are exactly one frame.
    pub check: fn(&[u8]) -> Result<(), FrameError>,
    /// Reads a frame. Strict: encoding what it returns gives the same bytes.
    pub decode: fn(&Board, &[u8]) -> Result<Command, NotACommand>,
    /// Any frame, as the verb that sends any frame; `None` in a family that has none.
    pub raw: fn(&Board, &[u8]) -> Option<Command>,
    /// What the bytes at the front of a stream are, and whether padding came just before them.
    pub front: fn(&[u8], bool) -> Front,
    /// How many bytes there are until the next one that can start a frame; at least one.
    pub next_start: fn(&[u8]) -> usize,
    /// The longest frame in bytes.
    pub longest: usize,
    /// How many zeros bring a receiver back in step that a flush has cut off inside the frame of this command; `None` for any frame at all.
    pub resync: fn(Option<&Command>) -> usize,
    /// How reports are found in the board's replies, and read.
    pub replies: ReportLine,
}

/// A frame that is whole but says nothing that the table of the board knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotACommand {
    /// No verb sends it.
    #[error("no command has this function and length")]
    Unknown,
    /// A value is outside its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The values are fine, but the frame is not the one that carries them (a wrong direction byte, say).
    #[error("the bytes are not those that carry this command")]
    Inconsistent,
    /// Only another way to read the verb in [`Board::ambiguity`] explains it.
    #[error("{0}")]
    OtherReading(&'static str),
}

/// A value that the board does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} is outside {min} to {max}")]
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

/// Two boards of one name have one table.
impl PartialEq for Board {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.resources, &self.verbs) == (&other.name, &other.resources, &other.verbs)
    }
}

impl Eq for Board {}

impl Axis {
    /// How many values it has in a command; those of [`Takes::Bytes`] are not counted.
    pub fn count(&self) -> usize {
        match &self.takes {
            Takes::List(_, letters) => letters.split(',').count(),
            Takes::Bytes(_) => 0,
            _ => 1,
        }
    }
}

impl Verb {
    /// The values that a move changes: all but an index.
    pub fn moving(&self) -> &[Axis] {
        self.axes.get(usize::from(self.is_indexed())..).unwrap_or_default()
    }

    /// Whether its first value says which resource is meant.
    pub fn is_indexed(&self) -> bool {
        matches!(self.sets, Sets::Indexed(_))
    }

    /// The values of its index.
    pub(crate) fn indices(&self) -> Option<RangeInclusive<i32>> {
        let (least, most) = self.axes.first().filter(|_| self.is_indexed())?.range;
        Some(least..=most)
    }
}
