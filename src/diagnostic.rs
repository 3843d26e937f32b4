//! Errors and warnings as data: a stable code, a place, words, and what to write instead.
//!
//! No stage prints. Each one adds to a [`Diagnostics`]; whoever shows them attaches the source once, with [`Attached`].

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt;

use crate::source::{Source, SourceError, Sources, Span};

/// How many diagnostics of one script are kept. The rest are only counted, so that a large broken file stays small.
pub const MAX_KEPT: usize = 500;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The script runs, but probably not as meant.
    Warning,
    /// The script does not compile; nothing is sent.
    Error,
}

/// The one table of codes: variant, name, severity, title.
macro_rules! codes {
    ($($variant:ident $name:literal $severity:ident $title:literal,)*) => {
        /// What kind of mistake it is. The name of a code never changes its meaning.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Code {
            $(#[doc = $title] $variant,)*
        }

        impl Code {
            /// Every code there is.
            pub const ALL: &[Code] = &[$(Code::$variant,)*];

            /// The stable name, such as `out-of-range`.
            pub fn name(self) -> &'static str {
                match self { $(Code::$variant => $name,)* }
            }

            /// Whether it stops the script from compiling.
            pub fn severity(self) -> Severity {
                match self { $(Code::$variant => Severity::$severity,)* }
            }

            /// What it is, in a few words.
            pub fn title(self) -> &'static str {
                match self { $(Code::$variant => $title,)* }
            }
        }
    };
}

codes! {
    // text
    NotUtf8 "not-utf8" Error "The file is not UTF-8 text.",
    SourceTooLarge "source-too-large" Error "The script is larger than 64 MiB.",
    ControlCharacter "control-character" Error "A character that cannot be seen stands in the script.",
    // syntax
    EmptyScript "empty-script" Error "The script does nothing.",
    Unclosed "unclosed" Error "A bracket or a quotation mark is opened and never closed.",
    Unopened "unopened" Error "A bracket is closed that was never opened.",
    LineTooLong "line-too-long" Error "A line is longer than 64 KiB.",
    Nesting "nesting" Error "Brackets are nested too deep.",
    Syntax "syntax" Error "This cannot be read.",
    EmptyPlace "empty-place" Error "Nothing stands before or behind a `;`.",
    Number "number" Error "A number or its unit cannot be read.",
    // program
    UnknownWord "unknown-word" Error "No command or setting has this name.",
    NotYet "not-yet" Error "The language has this, but this version of motionseq does not.",
    Arguments "arguments" Error "A command has too few, too many or the wrong arguments.",
    Unit "unit" Error "A value has the wrong unit, or none.",
    OutOfRange "out-of-range" Error "A value is outside the range that the robot takes.",
    NotWhole "not-whole" Error "A value must be a whole number.",
    LanguageVersion "language-version" Error "The script is written for another version of the language.",
    SettingPlace "setting-place" Error "A setting stands behind a command, or twice.",
    Joined "joined" Error "This cannot be joined to other commands with `;`.",
    StartTime "start-time" Error "A start time is missing, doubled or out of place.",
    TooLong "too-long" Error "The script is longer than 24 hours.",
    TooManySteps "too-many-steps" Error "The script takes too many steps to unroll.",
    UnknownName "unknown-name" Error "Nothing has this name here.",
    Name "name" Error "A name is given twice, or cannot be a name.",
    Arithmetic "arithmetic" Error "A calculation has no result.",
    TopLevel "top-level" Error "A statement stands inside a block and may not.",
    Recursion "recursion" Error "A phrase ends up calling itself.",
    Use "use" Error "A file cannot be used.",
    Abort "abort" Error "`on abort` holds what it cannot.",
    Limit "limit" Error "A command breaks a limit of the script.",
    Unused "unused" Warning "Nothing uses a name.",
    WaitInTogether "wait-in-together" Warning "A `wait` delays nothing inside `together`.",
    // timeline
    UnknownStart "unknown-start" Error "A move starts from a value that nobody knows.",
    Clash "clash" Error "Two commands want the same thing at the same time.",
    MoveMode "move-mode" Error "`move` needs the board in position mode.",
    TooManyEvents "too-many-events" Error "The script sends too many frames.",
    LeftRunning "left-running" Warning "The script ends with the drive running or the buzzer on.",
    TiltRange "tilt-range" Warning "A tilt servo does not survive this pulse width.",
    RawFrame "raw-frame" Warning "Nothing checks what a raw frame does.",
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A second place that belongs to a [`Diagnostic`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Related {
    /// Where.
    pub span: Span,
    /// What stands there.
    pub label: String,
}

/// One error or warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The stable code, which also says how bad it is.
    pub code: Code,
    /// Where it is.
    pub span: Span,
    /// What is wrong, in the user's words.
    pub message: String,
    /// A word or two at the place itself.
    pub label: Option<String>,
    /// Other places that belong to it.
    pub related: Vec<Related>,
    /// What to write instead.
    pub help: String,
}

impl Diagnostic {
    /// A diagnostic with the words that say what is wrong, and those that say what to write instead.
    pub fn new(code: Code, span: Span, message: impl Into<String>, help: impl Into<String>) -> Self {
        Diagnostic { code, span, message: message.into(), label: None, related: Vec::new(), help: help.into() }
    }

    /// What is wrong with a file that was read but is no script, with the text to show it in. `None` for a file that
    /// cannot be read, of which there is no text.
    pub fn of_source(error: SourceError) -> Option<(Source, Diagnostic)> {
        match error {
            SourceError::Unreadable { .. } => None,
            SourceError::TooLarge(name) => Some((
                Source::new(name, ""),
                Diagnostic::new(
                    Code::SourceTooLarge,
                    Span::default(),
                    "the script is larger than 64 MiB",
                    "split it into several scripts; nothing of it was read",
                ),
            )),
            SourceError::NotUtf8 { lossy, at, byte } => Some((
                lossy,
                Diagnostic::new(
                    Code::NotUtf8,
                    Span::new(at, at + '\u{FFFD}'.len_utf8()),
                    format!("the byte 0x{byte:02X} is not UTF-8 text"),
                    "save the file as UTF-8 in your editor; a script is plain text",
                ),
            )),
        }
    }

    /// Whether it stops the script from compiling.
    pub fn is_error(&self) -> bool {
        self.code.severity() == Severity::Error
    }

    /// Adds a word or two that stand at the place itself.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Adds a second place.
    #[must_use]
    pub fn related(mut self, span: Span, label: impl Into<String>) -> Self {
        self.related.push(Related { span, label: label.into() });
        self
    }
}

/// The errors and warnings of one script.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostics {
    kept: Vec<Diagnostic>,
    seen: BTreeSet<(Code, Span)>,
    errors: usize,
    warnings: usize,
}

impl Diagnostics {
    /// Adds one. Beyond [`MAX_KEPT`] it is only counted, except that the first error is always kept.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        // A mistake inside a `repeat` or `def` is one mistake, however often it is run.
        if !self.seen.insert((diagnostic.code, diagnostic.span)) {
            return;
        }
        let first_error = match diagnostic.code.severity() {
            Severity::Error => {
                self.errors += 1;
                self.errors == 1
            }
            Severity::Warning => {
                self.warnings += 1;
                false
            }
        };
        if self.kept.len() < MAX_KEPT || first_error {
            self.kept.push(diagnostic);
        }
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

    /// How many were counted but not kept.
    pub fn left_out(&self) -> usize {
        (self.errors + self.warnings).saturating_sub(self.kept.len())
    }

    /// Those that were kept, by place in the script.
    pub fn sorted(&self) -> Vec<&Diagnostic> {
        let mut list: Vec<_> = self.kept.iter().collect();
        list.sort_by_key(|diagnostic| (diagnostic.span, diagnostic.code));
        list
    }
}

/// A source made fit for showing: every character that could move a terminal's cursor is replaced by one of the same
/// length, so offsets still fit, and lines are cut to a window around the place that is shown.
#[derive(Debug)]
pub struct Printable<'s> {
    base: usize,
    name: String,
    text: Cow<'s, str>,
    lines: Vec<usize>,
}

/// The most bytes shown before and behind a place, and of a place itself.
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

/// Control characters, and those that change the direction of text.
fn is_hidden(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}' | '\u{FEFF}')
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
    elsewhere: Vec<Elsewhere<'a>>,
}

/// A place that belongs to a diagnostic and is in another file.
#[derive(Debug)]
struct Elsewhere<'a> {
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
            .filter_map(|related| Some(Elsewhere { related, source: file(related.span)? }))
            .collect();
        Attached { diagnostic, source, elsewhere }
    }
}

impl fmt::Display for Attached<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&short(&self.diagnostic.message))
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

impl fmt::Display for Elsewhere<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&escaped(&self.related.label))
    }
}

impl std::error::Error for Elsewhere<'_> {}

impl miette::Diagnostic for Elsewhere<'_> {
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
