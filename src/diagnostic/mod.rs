//! Errors and warnings as data: a stable code, a place, words, and what to write instead.
//!
//! No stage prints. Each one adds to a [`Diagnostics`]; the caller that shows them attaches the source once, with [`Attached`].

mod code_names;
mod codes;
mod denied;
mod macros;
mod show;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use crate::source::{Source, SourceError, Span};

pub use codes::{Code, Severity};
pub use denied::Denied;
pub(crate) use macros::{bail, diagnostic, report};
pub use show::{Attached, Printable, escaped};

/// How many errors of one script are kept. The rest are only counted, so that a large broken file stays small.
pub const MAX_ERRORS: usize = 500;
/// How many warnings of one script are kept.
pub const MAX_WARNINGS: usize = 10_000;

/// A second place that belongs to a [`Diagnostic`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Related {
    /// Where.
    pub span: Span,
    /// What is there.
    pub label: String,
}

/// A correction of a script: a text that replaces a span.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Edit {
    /// What is replaced. It is in one file, and empty for a text that is inserted.
    pub span: Span,
    /// The text that replaces it.
    pub text: String,
}

impl Edit {
    /// The text of a file with this correction; `None` if the span is not in the file.
    pub fn apply(&self, source: &Source) -> Option<String> {
        let (text, count) = Edit::apply_all([self], source);
        (count == 1).then_some(text)
    }

    /// The text of a file with those of the corrections that are in it, and their number. Of corrections that touch each other,
    /// only the first is made, because it may make the others superfluous: compile again to find out.
    pub fn apply_all<'e>(edits: impl IntoIterator<Item = &'e Edit>, source: &Source) -> (String, usize) {
        let (base, old) = (source.base() as usize, source.text());
        let mut edits: Vec<&Edit> = edits.into_iter().collect();
        edits.sort_by_key(|edit| edit.span);
        let (mut new, mut done, mut count) = (String::new(), 0, 0);
        for edit in edits {
            let range = edit.span.range();
            let Some(range) = range.start.checked_sub(base).zip(range.end.checked_sub(base)) else { continue };
            let (start, end) = range;
            if count > 0 && start <= done || end < start || old.get(end..).is_none() {
                continue;
            }
            let Some(kept) = old.get(done..start) else { continue };
            new.push_str(kept);
            new.push_str(&edit.text);
            (done, count) = (end, count + 1);
        }
        new.push_str(old.get(done..).unwrap_or_default());
        (new, count)
    }
}

/// One error or warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The stable code, which also says how bad it is.
    pub code: Code,
    /// Where it is.
    pub span: Span,
    /// The robots that it is about, in the order of `robots`; none if it is about all, or if the script names no robots.
    pub robots: Vec<Arc<str>>,
    /// What is wrong, in the user's words.
    pub message: String,
    /// A word or two at the place itself.
    pub label: Option<String>,
    /// Other places that belong to it.
    pub related: Vec<Related>,
    /// What to write instead.
    pub help: String,
    /// The correction, if there is only one.
    pub fix: Option<Edit>,
}

impl Diagnostic {
    /// A diagnostic with the words that say what is wrong, and those that say what to write instead.
    pub fn new(code: Code, span: Span, message: impl Into<String>, help: impl Into<String>) -> Self {
        Diagnostic {
            code,
            span,
            robots: Vec::new(),
            message: message.into(),
            label: None,
            related: Vec::new(),
            help: help.into(),
            fix: None,
        }
    }

    /// What is wrong with a file that was read but is no script, with the text to show it in. `None` for a file that
    /// cannot be read, of which there is no text.
    pub fn of_source(error: SourceError) -> Option<(Source, Diagnostic)> {
        match error {
            SourceError::Unreadable { .. } => None,
            SourceError::TooLarge(name) => Some((
                Source::new(name, ""),
                diagnostic!(SourceTooLarge, Span::default(), "the script is larger than 64 MiB";
                    help: "split it into several scripts; nothing of it was read"),
            )),
            SourceError::NotUtf8 { lossy, at, byte } => Some((
                lossy,
                diagnostic!(NotUtf8, Span::new(at, at + '\u{FFFD}'.len_utf8()),
                    "the byte 0x{byte:02X} is not UTF-8 text";
                    help: "save the file as UTF-8 in your editor; a script is plain text"),
            )),
        }
    }

    /// Whether it stops the script from compiling.
    pub fn is_error(&self) -> bool {
        self.code.severity() == Severity::Error
    }

    /// Adds a correction, unless its text was cut.
    #[must_use]
    pub(crate) fn fix(mut self, span: Span, text: impl Into<String>) -> Self {
        self.fix = Some(Edit { span, text: text.into() }).filter(|edit| !edit.text.ends_with('…'));
        self
    }

    /// Adds a correction that the help shows.
    #[must_use]
    pub(crate) fn write(mut self, span: Span, text: String) -> Self {
        self.help = format!("write `{text}`");
        self.fix(span, text)
    }

    /// Adds a word or two that are shown at the place itself.
    #[must_use]
    pub(crate) fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Adds a second place.
    #[must_use]
    pub(crate) fn related(mut self, span: Span, label: impl Into<String>) -> Self {
        self.related.push(Related { span, label: label.into() });
        self
    }
}

/// What is wrong, after the names of the robots: `left, right: the clock …`.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, robot) in self.robots.iter().enumerate() {
            f.write_str(if at > 0 { ", " } else { "" })?;
            f.write_str(robot)?;
        }
        f.write_str(if self.robots.is_empty() { "" } else { ": " })?;
        f.write_str(&self.message)
    }
}

/// The errors and warnings of one script.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostics {
    /// Those of each place: one, or one for each robot where they differ.
    kept: BTreeMap<(Span, Code), Vec<Diagnostic>>,
    seen: BTreeSet<(Code, Span)>,
    /// Lines on which a comment allows a warning, each code's in order.
    allowed: BTreeMap<Code, Vec<Span>>,
    errors: usize,
    warnings: usize,
    /// The number of robots that the script names.
    robots: usize,
    /// The one of them that is being run.
    about: Option<Arc<str>>,
}

impl Diagnostics {
    /// Allows a warning on a line, for what is added from now on. Lines come in order.
    pub fn allow(&mut self, code: Code, line: Span) {
        self.allowed.entry(code).or_default().push(line);
    }

    /// Whether a comment allows a warning at a place: on the line where it begins.
    pub(crate) fn is_allowed(&self, code: Code, span: Span) -> bool {
        let lines = self.allowed.get(&code).map(Vec::as_slice).unwrap_or_default();
        let after = lines.partition_point(|line| line.start <= span.start);
        let line = after.checked_sub(1).and_then(|at| lines.get(at));
        code.severity() == Severity::Warning && line.is_some_and(|line| span.start <= line.end)
    }

    /// Sets the number of robots that the script names: what is wrong for all of them is not said of each.
    pub(crate) fn of_robots(&mut self, count: usize) {
        self.robots = count;
    }

    /// From here on, what is added is about this robot.
    pub(crate) fn about(&mut self, robot: Option<&Arc<str>>) {
        self.about = robot.cloned();
    }

    /// Adds one, unless a comment allows it. Beyond [`MAX_ERRORS`] and [`MAX_WARNINGS`] it is only counted.
    pub fn push(&mut self, mut diagnostic: Diagnostic) {
        if self.is_allowed(diagnostic.code, diagnostic.span) {
            return;
        }
        diagnostic.robots.extend(self.about.clone());
        let (count, most) = match diagnostic.code.severity() {
            Severity::Error => (&mut self.errors, MAX_ERRORS),
            Severity::Warning => (&mut self.warnings, MAX_WARNINGS),
        };
        let is_new = self.seen.insert((diagnostic.code, diagnostic.span));
        if is_new {
            *count += 1;
            if *count <= most {
                self.kept.insert((diagnostic.span, diagnostic.code), vec![diagnostic]);
            }
            return;
        }
        // A mistake inside a `repeat` or `def` is one mistake, however often it is run. For another robot it may be a different one.
        let Some(found) = self.kept.get_mut(&(diagnostic.span, diagnostic.code)) else { return };
        let is_of = |known: &Diagnostic| {
            known.robots.is_empty() || known.robots.iter().any(|robot| diagnostic.robots.contains(robot))
        };
        if diagnostic.robots.is_empty() || found.iter().any(is_of) {
            return;
        }
        if let Some(same) = found.iter_mut().find(|known| known.message == diagnostic.message) {
            same.robots.append(&mut diagnostic.robots);
            if same.robots.len() == self.robots {
                same.robots.clear();
            }
        } else if *count < most {
            *count += 1;
            found.push(diagnostic);
        }
    }

    /// Replaces an error that was added and kept: the new one has the same robots and the same related calls. `None` removes it.
    pub(crate) fn replace(&mut self, error: (Code, Span), by: Option<Diagnostic>) {
        let Some(old) = self.kept.remove(&(error.1, error.0)) else { return };
        self.seen.remove(&error);
        self.errors -= old.len();
        let Some(Diagnostic { robots, related, .. }) = old.into_iter().next() else { return };
        if let Some(by) = by
            && self.seen.insert((by.code, by.span))
        {
            self.errors += 1;
            let by = Diagnostic { robots, related: [by.related, related].concat(), ..by };
            self.kept.insert((by.span, by.code), vec![by]);
        }
    }

    /// Adds the errors and warnings of another, as if each had been added here.
    pub(crate) fn append(&mut self, other: Diagnostics) {
        let left_out = other.left_out();
        for diagnostic in other.kept.into_values().flatten() {
            self.push(diagnostic);
        }
        if left_out > 0 {
            // Of these only the places are known.
            for (code, span) in other.seen {
                if !self.is_allowed(code, span) && self.seen.insert((code, span)) {
                    match code.severity() {
                        Severity::Error => self.errors += 1,
                        Severity::Warning => self.warnings += 1,
                    }
                }
            }
        }
    }

    /// Whether there is one with this code.
    pub fn has(&self, code: Code) -> bool {
        self.seen.range((code, Span::default())..).next().is_some_and(|(first, _)| *first == code)
    }

    /// Whether anything stops the script from compiling.
    pub fn has_errors(&self) -> bool {
        self.errors > 0
    }

    /// How many errors there are, kept or not.
    pub fn errors(&self) -> usize {
        self.errors
    }

    /// How many warnings there are, kept or not.
    pub fn warnings(&self) -> usize {
        self.warnings
    }

    /// How many there are of each code, kept or not, in the order of the table of codes.
    pub fn counts(&self) -> BTreeMap<Code, usize> {
        let mut counts = BTreeMap::new();
        for (code, span) in &self.seen {
            *counts.entry(*code).or_default() += self.kept.get(&(*span, *code)).map_or(1, Vec::len);
        }
        counts
    }

    /// How many were counted but not kept.
    pub fn left_out(&self) -> usize {
        (self.errors + self.warnings).saturating_sub(self.kept.values().map(Vec::len).sum())
    }

    /// Those that were kept, by place in the script.
    pub fn iter(&self) -> std::vec::IntoIter<&Diagnostic> {
        self.kept.values().flatten().collect::<Vec<_>>().into_iter()
    }
}

/// Those that were kept, by place in the script.
impl<'d> IntoIterator for &'d Diagnostics {
    type Item = &'d Diagnostic;
    type IntoIter = std::vec::IntoIter<&'d Diagnostic>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
