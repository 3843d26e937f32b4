//! The Test Anything Protocol.

use std::fmt::Write;

use crate::diagnostic::escaped;
use crate::verify::{Case, Status};

/// The results of scripts, in version 13.
pub fn cases(cases: &[Case]) -> String {
    let mut text = format!("TAP version 13\n1..{}\n", cases.len());
    for (case, number) in cases.iter().zip(1..) {
        let ok = if case.status.is_passed() { "ok" } else { "not ok" };
        // An unescaped `#` starts a directive, and a line break would end the line.
        let name = escaped(&case.name).replace('\\', "\\\\").replace('#', "\\#");
        let skipped = if case.status == Status::Orphan { " # SKIP no script" } else { "" };
        let _ = writeln!(text, "{ok} {number} - {name}: {}{skipped}", case.status.words());
        for problem in &case.problems {
            let _ = writeln!(text, "# {}", escaped(&problem.located()));
        }
        if case.left_out > 0 {
            let _ = writeln!(text, "# and {} more", case.left_out);
        }
        if let Some(hint) = case.hint() {
            let _ = writeln!(text, "# {}", escaped(&hint));
        }
    }
    text
}
