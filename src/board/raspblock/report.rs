//! Reports of the board: lines such as `{A-120:35:9000:1187}#`, in hundredths of a degree and of a
//! volt.
//!
//! Source: programs of users. The replies to single requests are not published.

use crate::board::{Hundredths, Report, ReportLine};

/// Maps the rows of the quantities (voltage, pitch, roll, yaw) to the order of a line (pitch, roll,
/// yaw, voltage).
pub(super) const LINE: ReportLine = ReportLine { bounds: (b'{', b'#'), read, write };

fn write(report: &Report) -> String {
    let [pitch, roll, yaw, voltage] = [1, 2, 3, 0].map(|quantity| report.value(quantity).unwrap_or_default().0);
    format!("{{A{pitch}:{roll}:{yaw}:{voltage}}}#")
}

fn read(line: &[u8]) -> Option<Report> {
    let body = std::str::from_utf8(line.strip_prefix(b"A")?).ok()?;
    let mut fields = body.strip_suffix('}')?.split(':').map(field);
    let [pitch, roll, yaw, voltage] = [fields.next()??, fields.next()??, fields.next()??, fields.next()??];
    fields.next().is_none().then(|| Report::new(&[voltage, pitch, roll, yaw]))
}

/// Parses a signed decimal integer. Unlike Rust, it accepts no leading `+`, which the board does
/// not send.
fn field(text: &str) -> Option<Hundredths> {
    if text.starts_with('+') {
        return None;
    }
    text.parse().ok().map(Hundredths)
}
