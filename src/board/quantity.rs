//! The quantities that a board reports, and how it reports them.

use std::fmt;
use std::sync::Arc;

use super::Text;
use super::command::{Command, VerbId};
use crate::units::Nanos;

/// The most values in one report.
pub const MAX_VALUES: usize = 4;

/// A quantity that a board reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Its name in scripts.
    pub name: Text,
    /// Its key in logs and JSON, with the unit.
    pub key: Text,
    /// Its unit, as scripts write it.
    pub unit: Text,
    /// The format of a value, with `{}` for the number.
    pub shown: Text,
    /// The smallest and the largest value that the board reports; `None` if that is unknown.
    pub range: Option<(Hundredths, Hundredths)>,
    /// How far it may change from one report to the next; `None` if it changes slowly.
    pub step: Option<Hundredths>,
    /// The command that requests it, if the board reports only what is requested.
    pub request: Option<Command>,
    /// The verb whose value it is, with the index: a `position 3` can be the value of `servo 3`, in
    /// the unit in which a script writes that. `None` for anything else.
    pub measures: Option<(VerbId, i32)>,
}

/// The change of a quantity since a moment, such as the angle that a robot has turned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// How it is named and shown.
    pub quantity: Arc<Quantity>,
    /// The row of the quantity that changes.
    pub of: usize,
    /// The circumference of that quantity, after which it starts again: 360 degrees for an angle.
    pub circle: Hundredths,
}

impl Change {
    /// The change from one value of the quantity to another, on the shorter way around the circle.
    pub fn between(&self, from: Hundredths, to: Hundredths) -> Hundredths {
        let circle = i64::from(self.circle.0.max(1));
        let half = circle / 2;
        let way = (i64::from(to.0) - i64::from(from.0) + half).rem_euclid(circle) - half;
        Hundredths(i32::try_from(way).unwrap_or(0))
    }
}

impl Quantity {
    /// Formats a value.
    pub fn show(&self, value: Hundredths) -> String {
        self.shown.replace("{}", &value.to_string())
    }
}

/// A number in hundredths, as a board reports degrees and volts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Hundredths(pub i32);

impl Hundredths {
    /// The number as a float.
    pub fn number(self) -> f64 {
        f64::from(self.0) / 100.0
    }
}

impl fmt::Display for Hundredths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let magnitude = self.0.unsigned_abs();
        write!(f, "{sign}{}.{:02}", magnitude / 100, magnitude % 100)
    }
}

/// One report of a board: the values of some of its quantities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Rows of the table of quantities, with their values.
    values: [(u16, Hundredths); MAX_VALUES],
    count: u8,
}

impl Report {
    /// A report of the first quantities of the board. Values after the first [`MAX_VALUES`] are
    /// dropped.
    pub fn new(values: &[Hundredths]) -> Self {
        let mut report = Report::default();
        (0..).zip(values).for_each(|(row, value)| report.add(row, *value));
        report
    }

    /// A report of one quantity, by its row in the table.
    pub fn of(row: u16, value: Hundredths) -> Self {
        let mut report = Report::default();
        report.add(row, value);
        report
    }

    /// Adds the value of a quantity; drops it if the report is full.
    pub(crate) fn add(&mut self, row: u16, value: Hundredths) {
        if let Some(place) = self.values.get_mut(usize::from(self.count)) {
            *place = (row, value);
            self.count += 1;
        }
    }

    /// The values with the rows of their quantities.
    pub fn values(&self) -> impl Iterator<Item = (usize, Hundredths)> {
        self.values.iter().take(usize::from(self.count)).map(|(row, value)| (usize::from(*row), *value))
    }

    /// The value of a quantity, by its row in the table; `None` if the report does not have it.
    pub fn value(&self, quantity: usize) -> Option<Hundredths> {
        self.values().find(|(row, _)| *row == quantity).map(|(_, value)| value)
    }
}

/// How a board answers.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Replies {
    /// Never.
    None,
    /// With reports as lines, which it sends by itself.
    Lines(ReportLine),
    /// With answers to requests.
    Answers(Answers),
}

/// How a board answers requests.
#[derive(Clone, Copy, Debug)]
pub struct Answers {
    /// Whether a command has an answer.
    pub has_answer: fn(&Command) -> bool,
    /// Finds the answer to a command at the start of what the board has sent, at most 64 bytes.
    pub read: fn(&Command, &[u8]) -> Answer,
    /// The most bytes of a request and its answer.
    pub length: u64,
    /// How long an answer may take.
    pub patience: Nanos,
    /// What the error bits of an answer mean.
    pub errors: fn(u16) -> String,
    /// Why a board may not answer.
    pub hint: &'static str,
}

/// What the first bytes of a board's replies are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Answer {
    /// An answer may have begun.
    Incomplete,
    /// This number of bytes is not an answer.
    Skip(usize),
    /// All these bytes are the answer, with the error bits in it.
    Complete(ReportItem, u16),
}

/// The lines that carry reports.
#[derive(Clone, Copy, Debug)]
pub struct ReportLine {
    /// The byte before a report and the byte after it.
    pub bounds: (u8, u8),
    /// Parses the bytes between the bounds.
    pub read: fn(&[u8]) -> Option<Report>,
    /// Formats a report, with its bounds.
    pub write: fn(&Report) -> String,
}

/// The next item in the replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReportItem {
    /// A complete report.
    Report(Report),
    /// The error bits of the board; 0 for no error.
    Errors(u16),
    /// The error bits of one servo, by its index; not 0. What it was asked for follows.
    Flags(i32, u16),
    /// What was asked for, if it is no quantity.
    Values([i32; 2]),
    /// Bytes that are not a report.
    Malformed,
}
