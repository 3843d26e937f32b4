//! JSON, as described in docs/schemas. Fields may be added, but never change their meaning.

use serde::Serialize;
use serde_json::json;

use super::{Finding, Run, Totals};
use crate::diagnostic::Code;
use crate::verify::{Case, Problem};

/// One JSON object: the format version, the counts, and every case with its problems.
pub fn cases(cases: &[Case]) -> String {
    #[derive(Serialize)]
    struct Document<'a> {
        version: u32,
        passed: usize,
        failed: usize,
        orphans: usize,
        cases: Vec<Row<'a>>,
    }
    #[derive(Serialize)]
    struct Row<'a> {
        file: &'a str,
        passed: bool,
        verdict: &'static str,
        problems: Vec<JsonProblem<'a>>,
        left_out: usize,
    }
    #[derive(Serialize)]
    struct JsonProblem<'a> {
        file: &'a str,
        line: Option<usize>,
        code: &'static str,
        message: &'a str,
    }
    let line = |problem: &'_ Problem| Some(problem.line).filter(|line| *line > 0);
    let rows = cases.iter().map(|case| Row {
        file: &case.name,
        passed: case.status.is_passed(),
        verdict: case.status.words(),
        problems: case
            .problems
            .iter()
            .map(|problem| JsonProblem {
                file: &problem.file,
                line: line(problem),
                code: problem.code,
                message: &problem.message,
            })
            .collect(),
        left_out: case.left_out,
    });
    let failed = cases.iter().filter(|case| !case.status.is_passed()).count();
    let orphans = cases.iter().filter(|case| case.status.is_orphan()).count();
    let passed = cases.iter().filter(|case| case.status.is_passed() && !case.status.is_orphan()).count();
    let document = Document { version: 1, passed, failed, orphans, cases: rows.collect() };
    pretty(&document)
}

/// One JSON object: the format version, the numbers of errors and warnings, and the findings that were kept.
pub fn findings(findings: &[Finding], totals: Totals) -> String {
    let Totals { errors, warnings } = totals;
    let left_out = (errors + warnings).saturating_sub(findings.len());
    pretty(&json!({
        "version": 1, "errors": errors, "warnings": warnings, "findings": findings, "left_out": left_out,
    }))
}

/// One JSON object: the format version, and everything about some codes. The examples are those of [`Code::example`].
pub fn codes(codes: &[Code]) -> String {
    let row = |code: &Code| {
        let (wrong, right) = code.example();
        json!({
            "code": code.name(), "severity": code.severity(), "title": code.title(), "explanation": code.explanation(),
            "wrong": wrong, "right": right,
        })
    };
    pretty(&json!({ "version": 1, "codes": codes.iter().map(row).collect::<Vec<_>>() }))
}

/// One JSON object: the format version and the result of a run.
pub fn run(run: &Run) -> String {
    #[derive(Serialize)]
    struct Document<'a> {
        version: u32,
        #[serde(flatten)]
        run: &'a Run,
    }
    pretty(&Document { version: 1, run })
}

/// Indented JSON with a final newline.
pub(super) fn pretty(document: &impl Serialize) -> String {
    // Serializing strings and numbers cannot fail.
    serde_json::to_string_pretty(document).unwrap_or_default() + "\n"
}
