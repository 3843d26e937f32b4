//! What a board sends back, as values of its quantities.
//!
//! Nothing here is trusted: the buffer is bounded, and a report with a missing or non-numeric field is skipped whole.

use std::fmt;

use super::Text;

/// The most quantities that one report has.
pub const MAX_QUANTITIES: usize = 4;

/// Something that a board reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// What scripts call it.
    pub name: Text,
    /// What logs and JSON call it, with its unit.
    pub key: Text,
    /// Its unit, as scripts write it.
    pub unit: Text,
    /// How its value is shown, with `{}` for the number.
    pub shown: Text,
}

impl Quantity {
    /// A value, as it is shown.
    pub fn show(&self, value: Hundredths) -> String {
        self.shown.replace("{}", &value.to_string())
    }
}

/// A number in hundredths, as a board reports degrees and volts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Hundredths(pub i32);

impl Hundredths {
    /// It as a number.
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

/// One report of a board: a value for each of its quantities, in the order of its table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    values: [Hundredths; MAX_QUANTITIES],
}

impl Report {
    /// A report of these values; those that are missing are 0, and there are at most [`MAX_QUANTITIES`].
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
    /// The byte before a report, and the byte after it.
    pub bounds: (u8, u8),
    /// Reads what is between them.
    pub read: fn(&[u8]) -> Option<Report>,
    /// Writes a whole one.
    pub write: fn(&Report) -> String,
}

/// What the decoder found next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReportItem {
    /// A whole report.
    Report(Report),
    /// Something between the bounds that is not a report.
    Malformed,
}

/// The longest report: four fields of ten digits with their signs and separators, and a little room.
const MAX_REPORT: usize = 64;

/// Finds reports in a stream, however it is cut into reads. Noise between reports is passed over.
#[derive(Debug)]
pub struct ReportDecoder {
    form: ReportLine,
    /// The bytes since the last beginning, without it, and how many they are.
    line: [u8; MAX_REPORT],
    length: usize,
    inside: bool,
}

impl ReportDecoder {
    /// A decoder at the start of a stream of replies of a board, [`Codec::replies`](super::Codec::replies).
    pub fn new(form: ReportLine) -> Self {
        ReportDecoder { form, line: [0; MAX_REPORT], length: 0, inside: false }
    }

    /// Takes the next bytes and hands what is complete to `sink`. Allocates nothing.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(ReportItem)) {
        let (begin, end) = self.form.bounds;
        for &byte in bytes {
            match byte {
                // A report that was cut gives way to the one that starts here.
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
