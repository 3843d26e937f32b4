//! JSON, as described in docs/schemas. Fields may be added, but never change their meaning.

use serde::Serialize;
use serde_json::{Value, json};

use super::{Finding, Run, Totals};
use crate::diagnostic::Code;
use crate::diff::{Again, Change, What};
use crate::source::Place;
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

/// A change between two timelines, with the lines it comes from.
#[derive(Clone, Debug)]
pub struct LocatedChange<'c> {
    /// The change.
    pub change: &'c Change,
    /// The line of the old script.
    pub old: Option<Place<'c>>,
    /// The line of the new script.
    pub new: Option<Place<'c>>,
    /// The change in words, with its place.
    pub message: String,
}

/// One JSON object: the format version, the names of what was compared, and the changes.
pub fn changes([old, new]: [&str; 2], changes: &[LocatedChange<'_>]) -> String {
    let place = |place: Option<Place<'_>>| place.map(|Place { file, line }| json!({ "file": file, "line": line }));
    let row = |LocatedChange { change, old, new, message }: &LocatedChange<'_>| {
        let (kind, values) = values(&change.what);
        let robots: Vec<&str> = change.robots.iter().map(|robot| &**robot).collect();
        let more = change.more.map(|Again { count, last, otherwise, total_us }| {
            json!({ "count": count, "last_us": last, "other_values": otherwise, "total_us": total_us })
        });
        json!({
            "kind": kind, "robots": robots, "at_us": change.at, "on_abort": change.aborts, "old": place(*old), "new": place(*new),
            "values": values, "more": more, "message": message,
        })
    };
    let rows: Vec<Value> = changes.iter().map(row).collect();
    pretty(&json!({ "version": 1, "old": old, "new": new, "changes": rows }))
}

/// The kind of a change, and its values.
fn values(what: &What) -> (&'static str, Value) {
    match what {
        What::Shifted { things, by, pause } => {
            let pause = pause.map(|[old, new]| json!({ "old_us": old, "new_us": new }));
            let values = json!({ "things": things, "pause": pause, "by_us": by.step_us, "total_us": by.total_us });
            ("shifted", values)
        }
        What::Scaled { until, lasts: [old, new], by } => {
            let values = json!({
                "until_us": until, "old_us": old, "new_us": new, "by_us": by.step_us, "total_us": by.total_us,
            });
            ("scaled", values)
        }
        What::Changed { from, to, by_us, then } => {
            let then = then
                .as_ref()
                .map(|(thing, by)| json!({ "thing": thing, "by_us": by.step_us, "total_us": by.total_us }));
            ("changed", json!({ "old": from, "new": to, "by_us": by_us, "then": then }))
        }
        What::Moved { what, by_us } => ("moved", json!({ "command": what, "by_us": by_us })),
        What::Gate { from, to } => ("gate", json!({ "old": from, "new": to })),
        What::GateOrder(gate) => ("gate-order", json!({ "command": gate })),
        What::Added(what) => ("added", json!({ "command": what })),
        What::Removed(what) => ("removed", json!({ "command": what })),
        What::RobotAdded => ("robot-added", json!({})),
        What::RobotRemoved => ("robot-removed", json!({})),
        What::Steps { what, from, to } => ("steps", json!({ "command": what, "old": from, "new": to })),
        What::Refreshed { from, to } => ("refreshed", json!({ "old_us": from, "new_us": to })),
        What::Reordered => ("reordered", json!({})),
        What::Baud { from, to } => ("baud", json!({ "old": from, "new": to })),
        What::Length { from, to } => ("length", json!({ "old_us": from, "new_us": to })),
        What::Load { from, to } => {
            let bytes = |(all, busiest): &(u64, u64)| json!({ "bytes": all, "busiest_second": busiest });
            ("load", json!({ "old": bytes(from), "new": bytes(to) }))
        }
    }
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
