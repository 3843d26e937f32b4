//! The bracket scan before the grammar: pairs brackets, bounds their depth, finds characters that cannot be seen, and
//! makes line breaks inside `( )` blanks. One pass, no recursion, offsets unchanged.

use std::borrow::Cow;

use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::Span;

/// How deep brackets may be nested.
pub const MAX_NESTING: usize = 64;

/// The least bytes of a piece that the grammar reads at once. What pest keeps of a text is many times as long as the text,
/// so a long script is read in pieces.
const PIECE: usize = 16 * 1024;

/// The text as the grammar reads it, of the same length.
pub(super) struct Scanned<'s> {
    text: Cow<'s, str>,
    /// Ends of lines, outside of all brackets, where the text may be cut into pieces.
    cuts: Vec<usize>,
}

impl Scanned<'_> {
    /// Pieces of whole lines, each with its offset.
    pub(super) fn pieces(&self) -> impl Iterator<Item = (usize, &str)> {
        let starts = std::iter::once(0).chain(self.cuts.iter().copied());
        let ends = self.cuts.iter().copied().chain([self.text.len()]);
        starts.zip(ends).filter_map(|(start, end)| Some((start, self.text.get(start..end)?)))
    }
}

/// Scans a script; `None` where its brackets do not pair.
pub(super) fn scan<'s>(text: &'s str, diagnostics: &mut Diagnostics) -> Option<Scanned<'s>> {
    let mut scan =
        Scan { text, open: Vec::new(), parens: 0, blanks: Vec::new(), cuts: Vec::new(), paired: true, diagnostics };
    scan.run();
    let Scan { blanks, cuts, paired, .. } = scan;
    paired.then(|| Scanned { text: blank_out(text, &blanks), cuts })
}

struct Scan<'s, 'd> {
    text: &'s str,
    /// Brackets that are open, with their offsets.
    open: Vec<(u8, usize)>,
    /// How many of them are `(`.
    parens: usize,
    /// Ranges that the grammar sees as blanks, the last byte of each as this one.
    blanks: Vec<(usize, usize, char)>,
    cuts: Vec<usize>,
    paired: bool,
    diagnostics: &'d mut Diagnostics,
}

impl<'s> Scan<'s, '_> {
    fn run(&mut self) {
        let bytes = self.text.as_bytes();
        let mut at = 0;
        if self.text.starts_with('\u{FEFF}') {
            at = '\u{FEFF}'.len_utf8();
            self.blanks.push((0, at, ' '));
        }
        while let Some(&byte) = bytes.get(at) {
            at = match byte {
                b'#' => self.comment(at),
                b'"' => self.string(at),
                b'(' | b'{' => match self.opened(byte, at) {
                    Some(next) => next,
                    None => return,
                },
                b')' | b'}' => self.closed(byte, at),
                b'\r' if bytes.get(at + 1) == Some(&b'\n') => at + 1,
                b'\n' => {
                    if self.parens > 0 {
                        let from = if at > 0 && bytes.get(at - 1) == Some(&b'\r') { at - 1 } else { at };
                        self.blanks.push((from, at + 1, ' '));
                    }
                    self.cut(at + 1);
                    at + 1
                }
                _ if is_hidden(byte) => {
                    let end = self.hidden(at);
                    self.blanks.push((at, end, ' '));
                    end
                }
                _ => at + 1,
            };
        }
        while let Some((bracket, from)) = self.open.pop() {
            self.unclosed(bracket, from, None);
        }
    }

    /// Cuts behind a line, if the piece is long enough. `else` belongs to the line before it, and so may a comment.
    fn cut(&mut self, at: usize) {
        let last = self.cuts.last().copied().unwrap_or(0);
        let long_enough = self.open.is_empty() && at - last >= PIECE;
        let next = || self.text.get(at..).unwrap_or_default().trim_start();
        if long_enough && !next().starts_with("else") && !next().starts_with('#') {
            self.cuts.push(at);
        }
    }

    /// To the end of the line; the line break stays.
    fn comment(&mut self, from: usize) -> usize {
        let line = self.rest_of_line(from);
        if let Some(at) = line.bytes().position(is_hidden) {
            self.hidden(from + at);
        }
        if self.parens > 0 {
            self.blanks.push((from, from + line.len(), ' '));
        }
        from + line.len()
    }

    fn string(&mut self, from: usize) -> usize {
        let line = self.rest_of_line(from);
        if let Some(at) = line.bytes().position(is_hidden) {
            self.hidden(from + at);
        }
        let mut escaped = false;
        for (at, byte) in line.bytes().enumerate().skip(1) {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => return from + at + 1,
                _ => {}
            }
        }
        // The grammar sees an empty text, so that the rest of the script is still read.
        if line.len() > 1 {
            self.blanks.push((from + 1, from + line.len(), '"'));
        }
        self.diagnostics.push(Diagnostic::new(
            Code::Unclosed,
            Span::new(from, from + line.len()),
            "this text has no closing quotation mark",
            "end it with `\"` on the same line; inside a text write `\\\"` for a quotation mark",
        ));
        from + line.len()
    }

    /// From `from` to the end of its line, without the line break.
    fn rest_of_line(&self, from: usize) -> &'s str {
        let rest = self.text.get(from..).unwrap_or_default();
        let line = rest.split('\n').next().unwrap_or_default();
        line.strip_suffix('\r').unwrap_or(line)
    }

    /// `None` where the nesting is too deep to go on.
    fn opened(&mut self, bracket: u8, at: usize) -> Option<usize> {
        if self.open.len() == MAX_NESTING {
            self.paired = false;
            self.open.clear();
            self.diagnostics.push(Diagnostic::new(
                Code::Nesting,
                Span::new(at, at + 1),
                format!("brackets are nested more than {MAX_NESTING} deep here"),
                "take inner blocks out; the rest of the script was not read",
            ));
            return None;
        }
        self.open.push((bracket, at));
        if bracket == b'(' {
            self.parens += 1;
        }
        Some(at + 1)
    }

    fn closed(&mut self, bracket: u8, at: usize) -> usize {
        let opening = if bracket == b')' { b'(' } else { b'{' };
        let Some(partner) = self.open.iter().rposition(|&(open, _)| open == opening) else {
            self.paired = false;
            let name = char::from(bracket);
            self.diagnostics.push(Diagnostic::new(
                Code::Unopened,
                Span::new(at, at + 1),
                format!("this `{name}` closes nothing"),
                format!("take it away, or put a `{}` where it should begin", char::from(opening)),
            ));
            return at + 1;
        };
        // What was opened behind the partner was never closed.
        for (inner, from) in self.open.split_off(partner + 1) {
            self.unclosed(inner, from, Some(at));
            if inner == b'(' {
                self.parens -= 1;
            }
        }
        self.open.pop();
        if bracket == b')' {
            self.parens -= 1;
        }
        at + 1
    }

    fn unclosed(&mut self, bracket: u8, from: usize, noticed: Option<usize>) {
        self.paired = false;
        let closing = if bracket == b'(' { ')' } else { '}' };
        let open = char::from(bracket);
        let diagnostic = Diagnostic::new(
            Code::Unclosed,
            Span::new(from, from + 1),
            format!("this `{open}` is never closed"),
            format!("put a `{closing}` where it should end"),
        )
        .label("opened here");
        self.diagnostics.push(match noticed {
            Some(at) => diagnostic.related(Span::new(at, at + 1), format!("a `{closing}` is missing before this")),
            None => diagnostic,
        });
    }

    /// A run of hidden characters, reported once.
    fn hidden(&mut self, from: usize) -> usize {
        let rest = self.text.as_bytes().get(from..).unwrap_or_default();
        let length = rest.iter().take_while(|&&byte| is_hidden(byte)).count().max(1);
        let byte = rest.first().copied().unwrap_or_default();
        let name = match byte {
            0 => "a NUL byte".to_owned(),
            b'\r' => "a carriage return without a line feed".to_owned(),
            _ => format!("the control character U+{byte:04X}"),
        };
        self.diagnostics.push(Diagnostic::new(
            Code::ControlCharacter,
            Span::new(from, from + length),
            format!("{name} stands here"),
            "delete it; a script is plain text",
        ));
        from + length
    }
}

/// Control characters but tab and line feed. A carriage return belongs to its line feed or is one of them.
fn is_hidden(byte: u8) -> bool {
    byte.is_ascii_control() && !matches!(byte, b'\t' | b'\n')
}

/// A copy of `text` with these ranges made blank, or `text` itself where there are none.
fn blank_out<'s>(text: &'s str, ranges: &[(usize, usize, char)]) -> Cow<'s, str> {
    if ranges.is_empty() {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut done = 0;
    for &(start, end, last) in ranges {
        out.push_str(text.get(done..start).unwrap_or_default());
        out.extend(std::iter::repeat_n(' ', end - start - 1));
        out.push(last);
        done = end;
    }
    out.push_str(text.get(done..).unwrap_or_default());
    Cow::Owned(out)
}
