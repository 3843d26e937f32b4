//! GitHub Actions annotations, which are shown at the lines of a pull request.

use std::fmt::Write;

use super::Finding;
use crate::diagnostic::escaped;
use crate::verify::{Case, Status, TOTAL};

/// The errors and warnings of scripts.
pub fn findings(findings: &[Finding]) -> String {
    let mut text = String::new();
    for finding in findings {
        let Finding { line, column, end_line, end_column, severity, code, .. } = finding;
        let file = property(&finding.file);
        let related = finding.related.iter().map(|place| format!("\n{}:{}: {}", place.file, place.line, place.message));
        let message = data(&format!("{}\n{}{}", finding.message, finding.help, related.collect::<String>()));
        // GitHub accepts columns only within one line.
        let columns = if line == end_line { format!(",col={column},endColumn={end_column}") } else { String::new() };
        let _ =
            writeln!(text, "::{severity} file={file},line={line},endLine={end_line}{columns},title={code}::{message}");
    }
    text
}

/// The problems of scripts and their snapshots.
pub fn cases(cases: &[Case]) -> String {
    let mut text = String::new();
    for case in cases {
        let mut hint = case.hint();
        for problem in &case.problems {
            let level = match (case.status, problem.code) {
                (Status::Orphan, _) => "warning",
                (_, TOTAL) => "notice",
                _ => "error",
            };
            let line = if problem.line > 0 { format!(",line={}", problem.line) } else { String::new() };
            let file = property(&problem.file);
            // Once per script.
            let hint = hint.take().map(|hint| format!("\n{hint}")).unwrap_or_default();
            let message = data(&format!("{}{hint}", problem.message));
            let _ = writeln!(text, "::{level} file={file}{line},title={}::{message}", problem.code);
        }
    }
    text
}

/// Text of one or more lines, with invisible characters and those that XML forbids escaped.
fn visible(text: &str) -> String {
    text.split('\n').map(escaped).collect::<Vec<_>>().join("\n")
}

/// The value of a workflow command, escaped as GitHub's toolkit escapes it.
fn data(text: &str) -> String {
    visible(text).replace('%', "%25").replace('\n', "%0A")
}

fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
