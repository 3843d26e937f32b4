//! `GitLab` code quality, which is shown at the lines of a merge request.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::{Finding, json::pretty};
use crate::diagnostic::Severity;

/// The errors and warnings of scripts.
pub fn findings(findings: &[Finding]) -> String {
    let mut seen: HashMap<_, u64> = HashMap::new();
    let rows: Vec<Value> = findings
        .iter()
        .map(|finding| {
            let Finding { file, line, severity, code, message, help, .. } = finding;
            // Without the line, so that a line added above it makes no new finding. Equal ones are numbered.
            let count = seen.entry((file, code, message)).or_default();
            let fingerprint = hash(&[file, code, message, &count.to_string()]);
            *count += 1;
            json!({
                "description": format!("{code}: {message}; {help}"),
                "check_name": code,
                "fingerprint": format!("{fingerprint:016x}"),
                "severity": if *severity == Severity::Error { "major" } else { "minor" },
                "location": { "path": file, "lines": { "begin": line } },
            })
        })
        .collect();
    pretty(&rows)
}

/// FNV-1a, which is the same in every version and on every machine. The parts are separated by a byte that is in no text.
fn hash(parts: &[&str]) -> u64 {
    let bytes = parts.iter().flat_map(|part| part.bytes().chain([0xFF]));
    bytes.fold(0xCBF2_9CE4_8422_2325, |hash: u64, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3))
}
