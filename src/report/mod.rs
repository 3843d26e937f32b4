//! Results as text for other programs: pure functions of the data.

mod cases;
mod findings;
mod run;

pub use cases::{cases_github, cases_json, cases_junit, cases_tap, located};
pub use findings::{Finding, findings, findings_github, findings_json, findings_sarif};
pub use run::{Asked, Dropped, Expected, Frames, Lateness, Run, run_json};

/// A value of a workflow command, as GitHub's own toolkit escapes it.
fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
