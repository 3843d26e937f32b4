//! Reports that a board sends back, as values of its quantities.
//!
//! Input is not trusted: the buffer is bounded, and a report with a missing or non-numeric field is
//! skipped as a whole.

use std::fmt;
use std::sync::Arc;

use super::Text;

/// The most quantities in one report.
pub const MAX_QUANTITIES: usize = 4;

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

/// One report of a board: a value for each quantity, in the order of the board's table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    values: [Hundredths; MAX_QUANTITIES],
}

impl Report {
    /// A report of these values. Missing values are 0; values after the first [`MAX_QUANTITIES`]
    /// are dropped.
    pub fn new(values: &[Hundredths]) -> Self {
        let mut report = Report::default();
        report.values.iter_mut().zip(values).for_each(|(place, value)| *place = *value);
        report
    }

    /// The value of a quantity, by its row in the table.
    pub fn value(&self, quantity: usize) -> Hundredths {
        self.values.get(quantity).copied().unwrap_or_default()
    }
}

/// How the replies of a board contain its reports.
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
    /// Bytes between the bounds that are not a report.
    Malformed,
}

/// The longest report in bytes: four fields of ten digits with signs and separators, and some spare
/// room.
const MAX_REPORT: usize = 64;

/// Finds reports in a stream, no matter how it is split into reads. It skips noise between reports.
#[derive(Debug)]
pub struct ReportDecoder {
    form: ReportLine,
    /// The bytes since the last start byte, without it, and their number.
    line: [u8; MAX_REPORT],
    length: usize,
    inside: bool,
}

impl ReportDecoder {
    /// A decoder at the start of a board's replies; `form` is
    /// [`Codec::replies`](super::Codec::replies).
    pub fn new(form: ReportLine) -> Self {
        ReportDecoder { form, line: [0; MAX_REPORT], length: 0, inside: false }
    }

    /// Reads the next bytes and passes each complete item to `sink`. Does not allocate.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(ReportItem)) {
        let (begin, end) = self.form.bounds;
        for &byte in bytes {
            match byte {
                // A truncated report ends where the next one starts.
                _ if byte == begin => {
                    if self.inside {
                        sink(ReportItem::Malformed);
                    }
                    self.length = 0;
                    self.inside = true;
                }
                _ if !self.inside => {}
                _ if byte == end => {
                    let line = self.line.get(..self.length).unwrap_or_default();
                    sink((self.form.read)(line).map_or(ReportItem::Malformed, ReportItem::Report));
                    self.inside = false;
                }
                _ => match self.line.get_mut(self.length) {
                    Some(place) => {
                        *place = byte;
                        self.length += 1;
                    }
                    None => {
                        sink(ReportItem::Malformed);
                        self.inside = false;
                    }
                },
            }
        }
    }
}
