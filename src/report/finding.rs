//! Errors and warnings of scripts with their positions, for every report format.

use serde::Serialize;

use crate::diagnostic::{Diagnostics, Severity};
use crate::source::{Encoding, Lines, Position, Sources};

/// One error or warning. Lines and columns count from 1, columns in characters; the end is exclusive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The file.
    pub file: String,
    /// First line.
    pub line: usize,
    /// First column.
    pub column: usize,
    /// Last line.
    pub end_line: usize,
    /// Column after the last character.
    pub end_column: usize,
    /// `error` or `warning`.
    pub severity: Severity,
    /// The stable code.
    pub code: &'static str,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: String,
}

/// The numbers of errors and warnings, listed or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Errors.
    pub errors: usize,
    /// Warnings.
    pub warnings: usize,
}

impl Totals {
    /// Adds the numbers of one script.
    pub fn add(&mut self, diagnostics: &Diagnostics) {
        self.errors += diagnostics.errors();
        self.warnings += diagnostics.warnings();
    }
}

/// The code of a file that cannot be read.
pub(super) const UNREADABLE: &str = "unreadable";

impl Finding {
    /// A file that cannot be read.
    pub fn unreadable(file: &str, message: String) -> Self {
        Finding {
            file: file.to_owned(),
            line: 1,
            column: 1,
            end_line: 1,
            end_column: 1,
            severity: Severity::Error,
            code: UNREADABLE,
            message,
            help: "check the name and the permissions of the file".to_owned(),
        }
    }
}

/// The errors and warnings of one script, sorted by position.
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
            severity: diagnostic.code.severity(),
            code: diagnostic.code.name(),
            message: diagnostic.message.clone(),
            help: diagnostic.help.clone(),
        }
    });
    all.collect()
}
