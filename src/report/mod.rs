//! Results as text for other programs: pure functions of the data.

mod cases;
mod findings;
mod repository;
mod run;

use crate::diagnostic::escaped;

pub use cases::{cases_github, cases_in, cases_json, cases_junit, cases_tap, located};
pub use findings::{Finding, Totals, findings, findings_github, findings_json, findings_sarif};
pub use repository::Repository;
pub use run::{Asked, Dropped, Expected, Frames, Lateness, Run, run_json};

/// Text of one or more lines without characters that a reader cannot see or that XML forbids.
fn visible(text: &str) -> String {
    text.split('\n').map(escaped).collect::<Vec<_>>().join("\n")
}

/// A value of a workflow command, as GitHub's own toolkit escapes it.
fn data(text: &str) -> String {
    visible(text).replace('%', "%25").replace('\n', "%0A")
}

fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
