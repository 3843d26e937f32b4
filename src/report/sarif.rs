//! SARIF 2.1.0, as code scanning reads it.

use std::fmt::Write;

use serde_json::{Value, json};

use super::finding::UNREADABLE;
use super::{Finding, RelatedPlace, Replacement, json::pretty};
use crate::diagnostic::Code;

/// The errors and warnings of scripts.
pub fn findings(findings: &[Finding]) -> String {
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
                "defaultConfiguration": { "level": code.severity() },
            })
        })
        .chain([json!({
            "id": UNREADABLE,
            "shortDescription": { "text": "A file cannot be read." },
            "fullDescription": { "text": "A file cannot be read and was not checked." },
            "help": { "text": "Check the name and the permissions of the file." },
            "defaultConfiguration": { "level": "error" },
        })])
        .collect();
    let results: Vec<Value> = findings.iter().map(result).collect();
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

fn result(finding: &Finding) -> Value {
    let Finding { file, line, column, end_line, end_column, .. } = finding;
    let mut result = json!({
        "ruleId": finding.code,
        "level": finding.severity,
        "message": { "text": format!("{}\n{}", finding.message, finding.help) },
        "locations": [location(file, (*line, *column), (*end_line, *end_column))],
    });
    let Some(object) = result.as_object_mut() else { return result };
    // The schema allows no `null`.
    if !finding.related.is_empty() {
        object.insert("relatedLocations".into(), finding.related.iter().map(related).collect());
    }
    if let Some(fix) = &finding.fix {
        let changes: Vec<Value> = fix.edits.iter().map(change).collect();
        let fixes = json!([{ "description": { "text": fix.message }, "artifactChanges": changes }]);
        object.insert("fixes".into(), fixes);
    }
    result
}

fn related(place: &RelatedPlace) -> Value {
    let RelatedPlace { file, line, column, end_line, end_column, message } = place;
    let mut location = location(file, (*line, *column), (*end_line, *end_column));
    if let Some(object) = location.as_object_mut() {
        object.insert("message".into(), json!({ "text": message }));
    }
    location
}

/// A place, whose end is exclusive.
fn location(file: &str, (line, column): (usize, usize), (end_line, end_column): (usize, usize)) -> Value {
    json!({ "physicalLocation": {
        "artifactLocation": { "uri": uri(file) },
        "region": { "startLine": line, "startColumn": column, "endLine": end_line, "endColumn": end_column },
    }})
}

fn change(edit: &Replacement) -> Value {
    json!({
        "artifactLocation": { "uri": uri(&edit.file) },
        "replacements": [{
            "deletedRegion": {
                "startLine": edit.line,
                "startColumn": edit.column,
                "endLine": edit.end_line,
                "endColumn": edit.end_column,
            },
            "insertedContent": { "text": edit.text },
        }],
    })
}

/// A path as a relative URI reference, percent-encoded.
fn uri(path: &str) -> String {
    let mut uri = String::new();
    // `<stdin>` is not a path.
    for byte in path.trim_matches(['<', '>']).bytes() {
        if byte.is_ascii_alphanumeric() || b"/-._~".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            let _ = write!(uri, "%{byte:02X}");
        }
    }
    uri
}
