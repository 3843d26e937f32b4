//! Errors and warnings of scripts, as text for other programs.

use std::fmt::Write;

use serde::Serialize;
use serde_json::{Value, json};

use super::{data, property};
use crate::diagnostic::{Code, Diagnostics, Severity};
use crate::source::{Encoding, Lines, Position, Sources};

/// One error or warning at its place. Lines and columns count from 1, columns in characters; the end is behind the last one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The file.
    pub file: String,
    /// Where it begins.
    pub line: usize,
    /// Where it begins.
    pub column: usize,
    /// Where it ends.
    pub end_line: usize,
    /// Where it ends.
    pub end_column: usize,
    /// `error` or `warning`.
    pub severity: &'static str,
    /// The stable code.
    pub code: &'static str,
    /// What is wrong.
    pub message: String,
    /// What to write instead.
    pub help: String,
}

/// How many errors and warnings there are, listed or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Errors.
    pub errors: usize,
    /// Warnings.
    pub warnings: usize,
}

impl Totals {
    /// Adds those of one script.
    pub fn add(&mut self, diagnostics: &Diagnostics) {
        self.errors += diagnostics.errors();
        self.warnings += diagnostics.warnings();
    }
}

/// The code of a file that cannot be read.
const UNREADABLE: &str = "unreadable";

impl Finding {
    /// A file that cannot be read, of which no text is known.
    pub fn unreadable(file: &str, message: String) -> Self {
        Finding {
            file: file.to_owned(),
            line: 1,
            column: 1,
            end_line: 1,
            end_column: 1,
            severity: "error",
            code: UNREADABLE,
            message,
            help: "look at its name, and whether you may read it".to_owned(),
        }
    }
}

/// The errors and warnings of one script, sorted by place.
pub fn findings(sources: &Sources, diagnostics: &Diagnostics) -> Vec<Finding> {
    let lines = Lines::of(sources);
    let place = |offset| {
        let Position { line, column } = lines.position(offset, Encoding::Utf32);
        (line as usize + 1, column as usize + 1)
    };
    let all = diagnostics.iter().map(|diagnostic| {
        let file = sources.file(diagnostic.span);
        let (line, column) = place(diagnostic.span.start);
        let (end_line, end_column) = place(diagnostic.span.end);
        Finding {
            file: file.name().to_owned(),
            line,
            column,
            end_line,
            end_column,
            severity: severity(diagnostic.code),
            code: diagnostic.code.name(),
            message: diagnostic.message.clone(),
            help: diagnostic.help.clone(),
        }
    });
    all.collect()
}

fn severity(code: Code) -> &'static str {
    match code.severity() {
        Severity::Error => "error",
        Severity::Warning => "warning",
    }
}

/// One JSON object: the version of its form, how many errors and warnings there are, and the findings that were kept.
pub fn findings_json(findings: &[Finding], totals: Totals) -> String {
    let Totals { errors, warnings } = totals;
    let left_out = (errors + warnings).saturating_sub(findings.len());
    pretty(&json!({
        "version": 1, "errors": errors, "warnings": warnings, "findings": findings, "left_out": left_out,
    }))
}

/// What `GitHub` shows at the lines of a pull request.
pub fn findings_github(findings: &[Finding]) -> String {
    let mut text = String::new();
    for finding in findings {
        let Finding { line, column, end_line, end_column, severity, code, .. } = finding;
        let file = property(&finding.file);
        let message = data(&format!("{}\n{}", finding.message, finding.help));
        // GitHub takes columns only within one line.
        let columns = if line == end_line { format!(",col={column},endColumn={end_column}") } else { String::new() };
        let _ =
            writeln!(text, "::{severity} file={file},line={line},endLine={end_line}{columns},title={code}::{message}");
    }
    text
}

/// SARIF 2.1.0, as code scanning reads it.
pub fn findings_sarif(findings: &[Finding]) -> String {
    let rules: Vec<Value> = Code::ALL
        .iter()
        .map(|code| {
            let (wrong, right) = code.example();
            let help = format!("{}\n\nWrong:\n{wrong}\nRight:\n{right}", code.explanation());
            json!({
                "id": code.name(),
                "shortDescription": { "text": code.title() },
                "fullDescription": { "text": code.explanation() },
                "help": { "text": help },
                "defaultConfiguration": { "level": severity(*code) },
            })
        })
        .chain([json!({
            "id": UNREADABLE,
            "shortDescription": { "text": "A file cannot be read." },
            "fullDescription": { "text": "A file cannot be read, so that nothing is known of it." },
            "help": { "text": "Look at its name, and whether you may read it." },
            "defaultConfiguration": { "level": "error" },
        })])
        .collect();
    let results: Vec<Value> = findings
        .iter()
        .map(|finding| {
            json!({
                "ruleId": finding.code,
                "level": finding.severity,
                "message": { "text": format!("{}\n{}", finding.message, finding.help) },
                "locations": [{ "physicalLocation": {
                    "artifactLocation": { "uri": uri(&finding.file) },
                    "region": {
                        "startLine": finding.line,
                        "startColumn": finding.column,
                        "endLine": finding.end_line,
                        "endColumn": finding.end_column,
                    },
                }}],
            })
        })
        .collect();
    pretty(&json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": { "name": "motionseq", "version": env!("CARGO_PKG_VERSION"), "rules": rules } },
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    }))
}

/// A path as a relative reference: what has a meaning in a URI is escaped.
fn uri(path: &str) -> String {
    let mut uri = String::new();
    // Standard input is no path.
    for byte in path.trim_matches(['<', '>']).bytes() {
        if byte.is_ascii_alphanumeric() || b"/-._~".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            let _ = write!(uri, "%{byte:02X}");
        }
    }
    uri
}

fn pretty(document: &Value) -> String {
    // Strings and numbers cannot fail to be written.
    serde_json::to_string_pretty(document).unwrap_or_default() + "\n"
}
