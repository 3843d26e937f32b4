//! One line for each error and warning, as compilers write them and editors read them.

use std::fmt::Write;

use super::Finding;
use crate::diagnostic::escaped;

/// The errors and warnings of scripts: `FILE:LINE:COLUMN: error[CODE]: MESSAGE`. Columns count characters.
pub fn findings(findings: &[Finding]) -> String {
    let mut text = String::new();
    for Finding { file, line, column, severity, code, message, .. } in findings {
        let (file, message) = (escaped(file), escaped(message));
        // Writing to a string does not fail.
        let _ = writeln!(text, "{file}:{line}:{column}: {severity}[{code}]: {message}");
    }
    text
}
