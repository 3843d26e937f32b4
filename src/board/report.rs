//! What the board sends back: lines such as `{A-120:35:9000:1187}#`.
//!
//! Source: users' programs; the single requests' replies are not published. Nothing here is trusted: the buffer is
//! bounded, and a report with a missing or non-numeric field is skipped whole.

use std::fmt;

/// A number in hundredths, as the board reports degrees and volts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Hundredths(pub i32);

impl fmt::Display for Hundredths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let magnitude = self.0.unsigned_abs();
        write!(f, "{sign}{}.{:02}", magnitude / 100, magnitude % 100)
    }
}

/// One report of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// Pitch in degrees.
    pub pitch: Hundredths,
    /// Roll in degrees.
    pub roll: Hundredths,
    /// Yaw in degrees.
    pub yaw: Hundredths,
    /// Battery voltage in volts.
    pub voltage: Hundredths,
}

/// The line that carries the report.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { pitch, roll, yaw, voltage } = self;
        write!(f, "{{A{}:{}:{}:{}}}#", pitch.0, roll.0, yaw.0, voltage.0)
    }
}

/// What the decoder found next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportItem {
    /// A whole report.
    Report(Report),
    /// Something between braces that is no report.
    Malformed,
}

/// The longest report: four fields of ten digits with signs and what stands around them, and a little room.
const MAX_REPORT: usize = 64;

/// Finds reports in a stream, however it is cut into reads. Noise between reports is passed over.
#[derive(Debug)]
pub struct ReportDecoder {
    /// The bytes since the last `{`, without it, and how many they are.
    line: [u8; MAX_REPORT],
    length: usize,
    inside: bool,
}

impl Default for ReportDecoder {
    fn default() -> Self {
        ReportDecoder { line: [0; MAX_REPORT], length: 0, inside: false }
    }
}

impl ReportDecoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next bytes and hands what is complete to `sink`. Allocates nothing.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(ReportItem)) {
        for &byte in bytes {
            match byte {
                // A report that was cut gives way to the one that starts here.
                b'{' => {
                    if self.inside {
                        sink(ReportItem::Malformed);
                    }
                    self.length = 0;
                    self.inside = true;
                }
                _ if !self.inside => {}
                b'#' => {
                    let line = self.line.get(..self.length).unwrap_or_default();
                    sink(read(line).map_or(ReportItem::Malformed, ReportItem::Report));
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

fn read(line: &[u8]) -> Option<Report> {
    let body = std::str::from_utf8(line.strip_prefix(b"A")?).ok()?;
    let mut fields = body.strip_suffix('}')?.split(':').map(field);
    let report =
        Report { pitch: fields.next()??, roll: fields.next()??, yaw: fields.next()??, voltage: fields.next()?? };
    fields.next().is_none().then_some(report)
}

/// A signed decimal integer; Rust would also take a leading `+`, which the board does not send.
fn field(text: &str) -> Option<Hundredths> {
    if text.starts_with('+') {
        return None;
    }
    text.parse().ok().map(Hundredths)
}
