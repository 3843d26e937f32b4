//! Verbs: the commands that a script can contain, with their values.

use std::ops::RangeInclusive;

use super::Text;
use super::command::{Command, VerbId};

/// The row of a resource in the table of its board.
pub type ResourceId = usize;

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
    /// The command of its resource after which it is an error.
    pub forbidden: Option<Forbidden>,
    /// The verb that is sent instead, once for each servo that the script uses.
    pub each: Option<VerbId>,
    /// Whether it only asks the board for something.
    pub asks: bool,
    /// The name of the lane of its frames, if it sets several resources or none.
    pub frames: Text,
    /// The command that this word is a synonym of.
    pub is: Option<Command>,
    /// The verb that is displayed instead of this one for one of its commands.
    pub alias: Option<VerbId>,
    /// Whether the values of the resources that it sets are unknown after it.
    pub forgets: bool,
    /// What it uses its resource as, with an article, if one script must not use it in two ways;
    /// otherwise empty.
    pub uses_as: Text,
    /// Whether its positional values may also be written with their keys as names.
    pub takes_names: bool,
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
    /// How many of these values are 1 in a script: 4 if the board counts quarters.
    pub scale: i32,
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

/// The unit of a value, as a script writes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unit {
    /// What a number measures.
    pub measure: Measure,
    /// How an angle becomes a value, if a script may write one.
    pub angle: Option<AngleScale>,
}

impl Eq for Unit {}

/// What a number measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Measure {
    /// Nothing, or something that only the board knows.
    #[default]
    Number,
    /// A pulse width in microseconds.
    Micros,
    /// An angle in degrees.
    Degrees,
}

/// A linear scale from angles to values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleScale {
    /// The smallest and the largest angle in degrees.
    pub degrees: (f64, f64),
    /// Their values, as a script writes them.
    pub values: (f64, f64),
}

impl AngleScale {
    /// The value of an angle in degrees; `None` outside of the scale.
    pub fn value(self, degrees: f64) -> Option<f64> {
        let AngleScale { degrees: (least, most), values: (from, to) } = self;
        let is_inside = (least..=most).contains(&degrees) && least < most;
        is_inside.then(|| from + (degrees - least) / (most - least) * (to - from))
    }
}

impl Unit {
    /// A pulse width in microseconds. A script may also give the angle of a servo: 0 to 180 degrees
    /// are 500 to 2500 µs.
    pub fn pulse_width() -> Self {
        let angle = Some(AngleScale { degrees: (0.0, 180.0), values: (500.0, 2_500.0) });
        Unit { measure: Measure::Micros, angle }
    }

    /// Its symbol in messages, after a number and a space; empty for a bare number.
    pub fn symbol(self) -> &'static str {
        match self.measure {
            Measure::Number => "",
            Measure::Micros => "µs",
            Measure::Degrees => "°",
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
    /// All these resources at once.
    All(Vec<ResourceId>),
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
    /// The resource is active, unless this is the command that brings it to rest.
    UnlessRest,
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

/// A command after which another one for the same resource is an error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Forbidden {
    /// Its verb, which has an index.
    pub after: VerbId,
    /// Its value.
    pub value: i32,
    /// The message, with `{}` for the index.
    pub message: Text,
    /// What to write instead, with `{}` for the index.
    pub help: Text,
    /// What the other command does, in a few words.
    pub label: Text,
}

impl Axis {
    /// A value as a script writes it.
    pub fn shown(&self, value: i32) -> f64 {
        f64::from(value) / f64::from(self.scale.max(1))
    }

    /// A number of a script as a value, which is not rounded.
    pub fn value(&self, number: f64) -> f64 {
        number * f64::from(self.scale.max(1))
    }

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

    /// The name of one of these values in a `limit`; empty if it needs none.
    pub fn label<'v>(&self, axis: &'v Axis) -> &'v str {
        if axis.name.is_empty() && self.takes_names && self.moving().len() > 1 { &axis.key } else { &axis.name }
    }

    /// Whether a script can contain it. Other verbs are only in the table to be decoded and shown.
    pub fn is_in_scripts(&self) -> bool {
        !self.word.starts_with('"')
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
