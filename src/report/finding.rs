//! Errors and warnings of scripts with their positions, for every report format.

use serde::Serialize;

use crate::diagnostic::{Diagnostics, Edit, Related, Severity};
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
    /// Other places that belong to it, such as the calls that led to it, the innermost first.
    pub related: Vec<RelatedPlace>,
    /// The correction, if there is only one.
    pub fix: Option<Fix>,
}

/// A second place that belongs to a [`Finding`], whose lines and columns count in the same way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RelatedPlace {
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
    /// What is there.
    pub message: String,
}

/// A correction: edits of scripts. None of them touch.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fix {
    /// What it does.
    pub message: String,
    /// What it changes.
    pub edits: Vec<Replacement>,
}

/// A text that replaces a part of a file. Lines and columns count as in a [`Finding`]; without a length, the text is inserted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Replacement {
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
    /// The new text.
    pub text: String,
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
    /// The same with other paths, such as those relative to a repository.
    #[must_use]
    pub fn with_paths(mut self, path: impl Fn(&str) -> String) -> Self {
        self.file = path(&self.file);
        for related in &mut self.related {
            related.file = path(&related.file);
        }
        for edit in self.fix.iter_mut().flat_map(|fix| &mut fix.edits) {
            edit.file = path(&edit.file);
        }
        self
    }

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
            related: Vec::new(),
            fix: None,
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
    let fix = |help: &str, Edit { span, text, .. }: &Edit| {
        let ((line, column), (end_line, end_column)) = (place(span.start), place(span.end));
        let file = sources.file(*span).name().to_owned();
        let edit = Replacement { file, line, column, end_line, end_column, text: text.clone() };
        Fix { message: help.to_owned(), edits: vec![edit] }
    };
    let related = |Related { span, label }: &Related| {
        let ((line, column), (end_line, end_column)) = (place(span.start), place(span.end));
        let file = sources.file(*span).name().to_owned();
        RelatedPlace { file, line, column, end_line, end_column, message: label.clone() }
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
            message: diagnostic.to_string(),
            help: diagnostic.help.clone(),
            related: diagnostic.related.iter().map(related).collect(),
            fix: diagnostic.fix.as_ref().map(|edit| fix(&diagnostic.help, edit)),
        }
    });
    all.collect()
}
