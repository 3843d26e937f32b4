//! Everything that is written to standard error. A standard error that is closed, full or blocked never stops a robot.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write as _};
use std::sync::{Condvar, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use miette::{GraphicalReportHandler, GraphicalTheme};
use motionseq::diagnostic::{Attached, Code, Diagnostic, Diagnostics, MAX_ERRORS, Printable, Severity, escaped};
#[cfg(target_os = "linux")]
use motionseq::playback::is_in_foreground;
use motionseq::source::{SourceError, Sources};
use terminal_size::{Width, terminal_size, terminal_size_of};
use textwrap::{WordSeparator, WordSplitter};

use super::color::Color;

/// Standard error, and how much is written there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Screen {
    color: bool,
    /// Whether standard output is colored.
    results: bool,
    volume: Volume,
    terminal: bool,
}

/// How much is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Volume {
    Quiet,
    Normal,
    Verbose,
}

/// Which warnings of a script are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Warnings {
    /// The first three of each code in full; the others are counted.
    First,
    /// All in full.
    All,
    /// One line for all of them.
    Counted,
}

/// How many warnings of each code are shown in full.
const FIRST: usize = 3;

/// Width of messages without a terminal, or on one that does not know its size.
pub(super) const WIDTH: usize = 80;

/// How long the end of a run waits for a blocked standard error, and for a blocked report file. Neither waits for the other.
pub(super) const PATIENCE: Duration = Duration::from_secs(2);

/// Text to be written, after [`Screen::never_wait`] was called.
static QUEUE: OnceLock<Queue> = OnceLock::new();

#[derive(Default)]
struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    texts: VecDeque<Text>,
    /// Whether a text is being written.
    is_writing: bool,
    /// How many texts were lost because the queue was full.
    lost: u64,
}

/// One text to write.
struct Text {
    text: String,
    /// Whether it is a live line, which a newer one replaces.
    is_live: bool,
}

/// Whether this process may draw on the terminal; assumed on other systems.
#[cfg(not(target_os = "linux"))]
fn is_in_foreground(_: io::Stderr) -> bool {
    true
}

/// How many texts may wait; errors may exceed it.
const CAPACITY: usize = 4 * 1024;

impl Screen {
    pub(super) fn new(color: Color, volume: Volume) -> Self {
        let terminal = io::stderr().is_terminal();
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let (color, results) = (color.is_for(&io::stderr()), color.is_for(&io::stdout()));
        Screen { color, results, volume, terminal: terminal && !dumb }
    }

    /// From now on a thread writes all text, and nothing else waits for standard error. If the thread cannot keep up, lines are lost
    /// and counted, except errors.
    pub(super) fn never_wait() -> io::Result<()> {
        super::start_thread("screen", || write_waiting(QUEUE.get_or_init(Queue::default)))?;
        QUEUE.get_or_init(Queue::default);
        Ok(())
    }

    /// Waits until everything is written, at most `patience`. Returns whether it is.
    pub(super) fn is_written(patience: Duration) -> bool {
        let Some(queue) = QUEUE.get() else { return true };
        let until = Instant::now() + patience;
        let mut waiting = queue.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        while waiting.is_writing || !waiting.texts.is_empty() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            let waited = queue.changed.wait_timeout(waiting, left);
            waiting = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    /// Whether a line can be redrawn: on a terminal, and not in the background, where the shell writes too.
    pub(super) fn is_live(&self) -> bool {
        self.terminal && self.volume != Volume::Quiet && is_in_foreground(io::stderr())
    }

    /// The `--color` option that makes another process look the same.
    pub(super) fn color_option(&self) -> &'static str {
        if self.color { "--color=always" } else { "--color=never" }
    }

    /// Whether standard output is colored.
    pub(super) fn colors_results(&self) -> bool {
        self.results
    }

    pub(super) fn is_quiet(&self) -> bool {
        self.volume == Volume::Quiet
    }

    pub(super) fn is_verbose(&self) -> bool {
        self.volume == Volume::Verbose
    }

    /// Writes a line, unless `-q`. Replaces a live line.
    pub(super) fn note(&self, line: &str) {
        if self.volume != Volume::Quiet {
            print(&format!("{}{}\n", self.clearing(), self.folded(line)), Importance::Droppable);
        }
    }

    /// Redraws the live line, if lines can be redrawn.
    ///
    /// The line is not padded to the width of the terminal, because an echoed `^C` would break it in two.
    pub(super) fn live(&self, line: &str) {
        if self.is_live() {
            let line: String = line.chars().take(self.live_width()).collect();
            print(&format!("{}{line}", self.clearing()), Importance::Live);
        }
    }

    /// The sequence that clears a live line, if there can be one.
    fn clearing(&self) -> &'static str {
        if self.is_live() { "\r\x1b[K" } else { "" }
    }

    /// Writes a line that the user must see, even with `-q`.
    pub(super) fn ask(&self, line: &str) {
        print(&format!("{}{}\n", self.clearing(), self.folded(line)), Importance::Droppable);
    }

    /// Writes a question, even with `-q`; the answer follows on the same line.
    pub(super) fn prompt(&self, question: &str) {
        print(&format!("{}{question}", self.clearing()), Importance::Required);
    }

    /// Clears a terminal.
    pub(super) fn clear(&self) {
        if self.is_live() {
            print("\x1b[2J\x1b[H", Importance::Droppable);
        }
    }

    /// Writes a warning, even with `-q`.
    pub(super) fn warning(&self, line: &str) {
        print(&self.headed("warning", "33;1", line), Importance::Droppable);
    }

    /// A line after a word in a color, folded with the word.
    fn headed(&self, word: &str, color: &str, line: &str) -> String {
        let folded = self.folded(&format!("{word}: {line}"));
        let folded =
            if self.color { folded.replacen(word, &format!("\u{1b}[{color}m{word}\u{1b}[0m"), 1) } else { folded };
        format!("{}{folded}\n", self.clearing())
    }

    /// Writes an error on a new line, because a shell prompt may precede it.
    pub(super) fn late_error(&self, line: &str) {
        if self.terminal {
            print("\n", Importance::Required);
        }
        self.error(line);
    }

    /// Writes an error that is not about a script, even with `-q`.
    pub(super) fn error(&self, line: &str) {
        print(&self.headed("error", "31;1", line), Importance::Required);
    }

    /// Writes why a script cannot be read.
    pub(super) fn unreadable(&self, error: SourceError) {
        let words = error.to_string();
        match Diagnostic::of_source(error) {
            None => self.error(&words),
            Some((source, diagnostic)) => {
                let mut diagnostics = Diagnostics::default();
                diagnostics.push(diagnostic);
                self.diagnostics(&source.into(), &diagnostics, Warnings::First, false);
            }
        }
    }

    /// Writes every error of a script, the selected warnings, and a line with the totals.
    ///
    /// `-q` hides warnings, unless they make the command fail (`denied`).
    pub(super) fn diagnostics(&self, sources: &Sources, diagnostics: &Diagnostics, warnings: Warnings, denied: bool) {
        if diagnostics.errors() + diagnostics.warnings() == 0 {
            return;
        }
        let is_quiet = self.volume == Volume::Quiet && !denied;
        if warnings == Warnings::Counted && diagnostics.warnings() > 0 && !is_quiet {
            self.warning(&counted(sources, diagnostics));
        }
        let most = match warnings {
            _ if is_quiet => 0,
            Warnings::First => FIRST,
            Warnings::All => usize::MAX,
            Warnings::Counted => 0,
        };
        let mut shown: BTreeMap<Code, usize> = BTreeMap::new();
        let list = diagnostics.iter().filter(|diagnostic| {
            let count = shown.entry(diagnostic.code).or_default();
            let is_shown = diagnostic.is_error() || *count < most;
            *count += usize::from(is_shown);
            is_shown
        });
        let mut text = self.rendered(sources, list);
        if !is_quiet && warnings != Warnings::Counted {
            text += &left_out(diagnostics, &shown, warnings);
        }
        if diagnostics.errors() > MAX_ERRORS {
            let _ = writeln!(text, "and {} not shown", plural(diagnostics.errors() - MAX_ERRORS, "more error"));
        }
        print(&text, Importance::Required);
        if warnings != Warnings::Counted || diagnostics.has_errors() {
            let code = diagnostics
                .iter()
                .find(|found| found.is_error())
                .or(diagnostics.iter().next())
                .map(|first| format!("; motionseq explain {}", first.code));
            self.note(&format!("{}: {}{}", sources.main().name(), count(diagnostics), code.unwrap_or_default()));
        }
    }

    /// Errors and warnings in full, with their lines.
    fn rendered<'d>(&self, sources: &Sources, list: impl Iterator<Item = &'d Diagnostic>) -> String {
        let mut list = list.peekable();
        let mut text = String::new();
        if list.peek().is_none() {
            return text;
        }
        let printable = Printable::all(sources);
        let theme = if self.color { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
        let handler = GraphicalReportHandler::new_themed(theme)
            .with_width(self.width())
            .with_links(false)
            // Suggested text is not hyphenated, so that it can be copied.
            .with_word_separator(WordSeparator::AsciiSpace)
            .with_word_splitter(WordSplitter::NoHyphenation);
        for diagnostic in list {
            // Writing to a string does not fail.
            let _ = handler.render_report(&mut text, &Attached::new(diagnostic, &printable));
            text.push('\n');
        }
        text
    }

    /// The width of messages, in columns.
    pub(super) fn width(&self) -> usize {
        self.columns().map_or(WIDTH, |columns| columns.clamp(24, 120))
    }

    /// The width of a live line, in columns: less than the terminal, so that it does not wrap.
    pub(super) fn live_width(&self) -> usize {
        self.columns().unwrap_or(WIDTH).saturating_sub(1)
    }

    /// The width of the terminal, in columns.
    fn columns(&self) -> Option<usize> {
        let (Width(columns), _) = self.terminal.then(|| terminal_size_of(io::stderr())).flatten()?;
        Some(usize::from(columns))
    }

    /// Whether this is a terminal that cannot redraw a line.
    pub(super) fn is_dumb(&self) -> bool {
        !self.terminal && io::stderr().is_terminal()
    }

    /// A line as it is shown: escaped, and wrapped at words on a terminal.
    fn folded(&self, line: &str) -> String {
        let line = escaped(line);
        let room = self.width();
        if !self.terminal || line.chars().count() <= room {
            return line;
        }
        let options = textwrap::Options::new(room)
            .subsequent_indent("  ")
            .word_separator(WordSeparator::AsciiSpace)
            .word_splitter(WordSplitter::NoHyphenation)
            .break_words(false);
        textwrap::fill(&line, options)
    }
}

/// Whether there is a terminal, but neither it nor the environment knows its size. A serial console has no rows and no columns.
pub(super) fn is_terminal_of_unknown_size() -> bool {
    let is_terminal = io::stdout().is_terminal() || io::stderr().is_terminal();
    is_terminal && terminal_size().is_none() && std::env::var_os("COLUMNS").is_none()
}

/// How important a text is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Importance {
    /// A live line: the next one replaces it.
    Live,
    /// May be lost if the queue is full.
    Droppable,
    /// Must not be lost.
    Required,
}

/// Writes a text, or queues it. Errors are ignored: there is nowhere to report them.
fn print(text: &str, importance: Importance) {
    let Some(queue) = QUEUE.get() else {
        let _ = io::stderr().lock().write_all(text.as_bytes());
        return;
    };
    let mut waiting = queue.waiting.lock().unwrap_or_else(PoisonError::into_inner);
    if waiting.texts.back().is_some_and(|last| last.is_live && importance == Importance::Live) {
        waiting.texts.pop_back();
    }
    if waiting.texts.len() < CAPACITY || importance == Importance::Required {
        waiting.texts.push_back(Text { text: text.to_owned(), is_live: importance == Importance::Live });
    } else {
        waiting.lost += 1;
    }
    queue.changed.notify_all();
}

/// Writes queued texts as long as the program runs.
fn write_waiting(queue: &Queue) {
    let mut waiting = queue.waiting.lock().unwrap_or_else(PoisonError::into_inner);
    loop {
        let Some(Text { text, .. }) = waiting.texts.pop_front() else {
            waiting.is_writing = false;
            queue.changed.notify_all();
            waiting = queue.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        waiting.is_writing = true;
        let lost = std::mem::take(&mut waiting.lost);
        drop(waiting);
        let _ = io::stderr().lock().write_all(text.as_bytes());
        if lost > 0 {
            let _ = writeln!(
                io::stderr().lock(),
                "{} were not shown",
                plural(usize::try_from(lost).unwrap_or(usize::MAX), "line")
            );
        }
        waiting = queue.waiting.lock().unwrap_or_else(PoisonError::into_inner);
    }
}

/// One line for each code with warnings that were not shown.
fn left_out(diagnostics: &Diagnostics, shown: &BTreeMap<Code, usize>, warnings: Warnings) -> String {
    let how = if warnings == Warnings::All { " (not kept)" } else { "; `--all` shows them" };
    let all = diagnostics.counts().into_iter().filter(|(code, _)| code.severity() == Severity::Warning);
    let more = all.map(|(code, count)| (code, count - shown.get(&code).copied().unwrap_or(0)));
    let lines = more.filter(|(_, more)| *more > 0).map(|(code, more)| {
        let word = if more == 1 { "warning" } else { "warnings" };
        format!("and {more} more `{code}` {word}{how}\n")
    });
    lines.collect()
}

/// All warnings of a script in one line: `dance.motion: 297 warnings (290 servo-speed, 7 long-hold)`.
fn counted(sources: &Sources, diagnostics: &Diagnostics) -> String {
    let counts = diagnostics.counts().into_iter().filter(|(code, _)| code.severity() == Severity::Warning);
    let codes: Vec<String> = counts.map(|(code, count)| format!("{count} {code}")).collect();
    let name = sources.main().name();
    let warnings = plural(diagnostics.warnings(), "warning");
    format!("{name}: {warnings} ({}); `--all` shows them", codes.join(", "))
}

/// `2 errors, 1 warning`.
fn count(diagnostics: &Diagnostics) -> String {
    let parts = [(diagnostics.errors(), "error"), (diagnostics.warnings(), "warning")];
    let parts = parts.into_iter().filter(|(count, _)| *count > 0).map(|(count, word)| plural(count, word));
    parts.collect::<Vec<_>>().join(", ")
}

/// `22 frames`, `1 frame`.
pub(super) fn plural(count: usize, word: &str) -> String {
    if count == 1 { format!("1 {word}") } else { format!("{count} {word}s") }
}
