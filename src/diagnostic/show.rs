//! How diagnostics are prepared for a terminal, and for miette, which prints them.

use std::borrow::Cow;
use std::fmt;

use super::{Diagnostic, Related, Severity};
use crate::source::{Source, Sources, Span};

/// A source prepared for a terminal: every character that could move a terminal's cursor is replaced by one of the same
/// length, so offsets still fit, and lines are cut to a window around the place that is shown.
#[derive(Debug)]
pub struct Printable<'s> {
    base: usize,
    name: String,
    text: Cow<'s, str>,
    lines: Vec<usize>,
}

/// The most bytes shown before and after a place, and of a place itself.
const WINDOW: usize = 160;

impl<'s> Printable<'s> {
    /// Prepares a source for showing.
    pub fn new(source: &'s Source) -> Self {
        let text = printable(source.text());
        let starts = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n');
        let lines = std::iter::once(0).chain(starts.map(|(at, _)| at + 1)).collect();
        Printable { base: source.base() as usize, name: escaped(source.name()), text, lines }
    }

    /// Prepares a script and the files that it uses.
    pub fn all(sources: &'s Sources) -> Vec<Self> {
        sources.iter().map(Printable::new).collect()
    }

    /// Whether a span is in this file.
    fn holds(&self, span: Span) -> bool {
        (self.base..=self.base + self.text.len()).contains(&span.range().start)
    }

    /// The index of the line that holds `offset`.
    fn line_of(&self, offset: usize) -> usize {
        self.lines.partition_point(|&start| start <= offset).saturating_sub(1)
    }

    fn line_start(&self, line: usize) -> usize {
        self.lines.get(line).copied().unwrap_or(self.text.len())
    }

    /// The nearest character boundary at or before `offset`.
    fn floor(&self, offset: usize) -> usize {
        let mut at = offset.min(self.text.len());
        while !self.text.is_char_boundary(at) {
            at -= 1;
        }
        at
    }

    /// A span held inside its first line and the window.
    fn clip(&self, span: Span) -> miette::SourceSpan {
        let local = |offset: u32| (offset as usize).saturating_sub(self.base);
        let start = self.floor(local(span.start));
        let line_end = self.line_start(self.line_of(start) + 1);
        let rest = self.text.get(start..line_end).unwrap_or_default();
        let line_end = start + rest.trim_end_matches(['\n', '\r']).len();
        let end = self.floor(local(span.end)).min(line_end).min(self.floor(start + WINDOW));
        (start, end.saturating_sub(start)).into()
    }
}

/// Control characters, those that end a line or change the direction of text, and those that XML forbids.
fn is_hidden(c: char) -> bool {
    let is_bidi = matches!(
        c,
        '\u{061C}' | '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}'
    );
    let is_control = c.is_control() && !matches!(c, '\n' | '\t');
    is_control || is_bidi || matches!(c, '\u{2028}' | '\u{2029}' | '\u{FEFF}' | '\u{FFFE}' | '\u{FFFF}')
}

/// Replaces hidden characters by visible ones of the same length in bytes. A carriage return belongs to its line feed.
fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        let hidden = is_hidden(c) && !(c == '\r' && chars.peek() == Some(&'\n'));
        out.push(match (hidden, c.len_utf8()) {
            (false, _) => c,
            (true, 1) => '?',
            (true, 2) => '\u{BF}',
            (true, _) => '\u{FFFD}',
        });
    }
    Cow::Owned(out)
}

/// Text for one line of a message: every character that could move a terminal's cursor is escaped.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if is_hidden(c) || c == '\n' {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// Words of a message, escaped, and cut where they quote something endless.
fn short(text: &str) -> String {
    const LONGEST: usize = 400;
    let mut text = escaped(text);
    if let Some((end, _)) = text.char_indices().nth(LONGEST) {
        text.truncate(end);
        text.push('…');
    }
    text
}

impl miette::SourceCode for Printable<'_> {
    fn read_span<'a>(
        &'a self,
        span: &miette::SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn miette::SpanContents<'a> + 'a>, miette::MietteError> {
        let start = span.offset();
        let end = start + span.len();
        let from_line = self.line_of(start).saturating_sub(lines_before);
        let from = if lines_before == 0 { start } else { self.line_start(from_line) };
        let from = self.floor(from.max(start.saturating_sub(WINDOW)));
        let to = if lines_after == 0 { end } else { self.line_start(self.line_of(end) + 1 + lines_after) };
        let to = self.floor(to.min(end + WINDOW));
        let data = self.text.get(from..to).ok_or(miette::MietteError::OutOfBounds)?;
        let line = self.line_of(from);
        let column = self.text.get(self.line_start(line)..from).unwrap_or_default().chars().count();
        Ok(Box::new(miette::MietteSpanContents::new_named(
            self.name.clone(),
            data.as_bytes(),
            (from, data.len()).into(),
            line,
            column,
            data.lines().count(),
        )))
    }
}

/// A diagnostic with its sources, as [`miette`] wants it.
#[derive(Debug)]
pub struct Attached<'a> {
    diagnostic: &'a Diagnostic,
    source: Option<&'a Printable<'a>>,
    /// Places in other files.
    elsewhere: Vec<InOtherFile<'a>>,
}

/// A place that belongs to a diagnostic and is in another file.
#[derive(Debug)]
struct InOtherFile<'a> {
    related: &'a Related,
    source: &'a Printable<'a>,
}

impl<'a> Attached<'a> {
    /// A diagnostic with the files that its spans point into.
    pub fn new(diagnostic: &'a Diagnostic, sources: &'a [Printable<'a>]) -> Self {
        let file = |span| sources.iter().find(|source| source.holds(span));
        let source = file(diagnostic.span).or(sources.first());
        let elsewhere = diagnostic
            .related
            .iter()
            .filter(|related| !source.is_some_and(|source| source.holds(related.span)))
            .filter_map(|related| Some(InOtherFile { related, source: file(related.span)? }))
            .collect();
        Attached { diagnostic, source, elsewhere }
    }
}

impl fmt::Display for Attached<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&short(&self.diagnostic.to_string()))
    }
}

impl std::error::Error for Attached<'_> {}

impl miette::Diagnostic for Attached<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.diagnostic.code))
    }

    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.diagnostic.code.severity() {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(short(&self.diagnostic.help)))
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.source.map(|source| source as &dyn miette::SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let source = self.source?;
        let label = self.diagnostic.label.as_deref().map(escaped);
        let primary = miette::LabeledSpan::new_primary_with_span(label, source.clip(self.diagnostic.span));
        let here = self.diagnostic.related.iter().filter(|related| source.holds(related.span));
        let related = here.map(|related| labeled(related, source));
        Some(Box::new(std::iter::once(primary).chain(related)))
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        if self.elsewhere.is_empty() {
            return None;
        }
        Some(Box::new(self.elsewhere.iter().map(|place| place as &dyn miette::Diagnostic)))
    }
}

fn labeled(related: &Related, source: &Printable<'_>) -> miette::LabeledSpan {
    miette::LabeledSpan::new_with_span(Some(escaped(&related.label)), source.clip(related.span))
}

impl fmt::Display for InOtherFile<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&escaped(&self.related.label))
    }
}

impl std::error::Error for InOtherFile<'_> {}

impl miette::Diagnostic for InOtherFile<'_> {
    fn severity(&self) -> Option<miette::Severity> {
        Some(miette::Severity::Advice)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        Some(self.source)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        Some(Box::new(std::iter::once(labeled(self.related, self.source))))
    }
}
