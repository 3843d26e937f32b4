//! What changes in a text file, as `diff -u` writes it and `patch` reads it.

use std::fmt;
use std::io::{self, IsTerminal as _};

use imara_diff::{Algorithm, Diff, InternedInput, Interner, Token, UnifiedDiffConfig, UnifiedDiffPrinter};
use motionseq::diagnostic::escaped;

use super::color::Style;
use super::screen::Screen;

/// The lines of a file that change, with three lines before and after them; empty if none do.
pub(super) fn unified_diff(name: &str, old: &str, new: &str, screen: &Screen) -> String {
    let input = InternedInput::new(old, new);
    let mut diff = Diff::compute(Algorithm::Histogram, &input);
    diff.postprocess_lines(&input);
    let printer = Printer { lines: &input.interner, is_colored: screen.colors_results() };
    let hunks = diff.unified_diff(&printer, UnifiedDiffConfig::default(), &input).to_string();
    if hunks.is_empty() {
        return hunks;
    }
    let header = |mark: &str| Style::Bold.paint(&format!("{mark} {}", escaped(name)), printer.is_colored);
    format!("{}\n{}\n{hunks}", header("---"), header("+++"))
}

struct Printer<'a> {
    lines: &'a Interner<&'a str>,
    is_colored: bool,
}

impl Printer<'_> {
    fn line(&self, f: &mut impl fmt::Write, mark: char, style: Option<Style>, line: Token) -> fmt::Result {
        let line: &str = self.lines[line];
        let text = line.strip_suffix('\n').unwrap_or(line);
        // What is piped to `patch` stays as it is; on a terminal, nothing may move the cursor.
        let text = if io::stdout().is_terminal() { escaped(text) } else { text.to_owned() };
        let text = format!("{mark}{text}");
        writeln!(f, "{}", style.map_or_else(|| text.clone(), |style| style.paint(&text, self.is_colored)))?;
        if line.ends_with('\n') { Ok(()) } else { writeln!(f, "\\ No newline at end of file") }
    }
}

impl UnifiedDiffPrinter for Printer<'_> {
    fn display_header(&self, mut f: impl fmt::Write, old: u32, new: u32, old_len: u32, new_len: u32) -> fmt::Result {
        // Lines count from 1. Without lines, it is the line before.
        let range = |start: u32, length: u32| match length {
            0 => format!("{start},0"),
            1 => (start + 1).to_string(),
            length => format!("{},{length}", start + 1),
        };
        let header = format!("@@ -{} +{} @@", range(old, old_len), range(new, new_len));
        writeln!(f, "{}", Style::Cyan.paint(&header, self.is_colored))
    }

    fn display_context_token(&self, mut f: impl fmt::Write, line: Token) -> fmt::Result {
        self.line(&mut f, ' ', None, line)
    }

    fn display_hunk(&self, mut f: impl fmt::Write, old: &[Token], new: &[Token]) -> fmt::Result {
        old.iter().try_for_each(|line| self.line(&mut f, '-', Some(Style::Red), *line))?;
        new.iter().try_for_each(|line| self.line(&mut f, '+', Some(Style::Green), *line))
    }
}
