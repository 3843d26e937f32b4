//! The bracket scan before the grammar: pairs brackets, bounds their depth, finds characters that cannot be seen, and
//! turns line breaks inside `( )` into spaces. One pass, no recursion, offsets unchanged.

use std::borrow::Cow;
use std::ops::Range;

use crate::diagnostic::{Code, Diagnostic, Diagnostics, Severity, diagnostic, report};
use crate::source::{Source, Span};

/// How deep brackets may be nested.
pub(crate) const MAX_NESTING: usize = 64;
/// How many codes a comment may allow.
const MAX_ALLOWED: usize = 64;
/// How long a line may be, in bytes. What pest keeps of a line is hundreds of times as long as the line.
pub(crate) const MAX_LINE: usize = 64 * 1024;

/// The least bytes of a piece that the grammar reads at once. What pest keeps of a text is many times as long as the text,
/// so a long script, and a long block, is read in pieces, small enough that the allocator keeps the memory for the next one.
const PIECE: usize = if cfg!(test) { 24 } else { 4 * 1024 };

/// The text as the grammar reads it, of the same length as that of its source.
pub(super) struct Scanned<'s> {
    pub(super) source: &'s Source,
    text: Cow<'s, str>,
    /// Ends of lines, outside of all `( )`, where what is between two brackets, or the whole text, may be cut into pieces. Each with the
    /// number of brackets around it.
    cuts: Vec<(usize, usize)>,
    /// The long blocks: those with a cut inside, in the order in which they begin.
    pub(super) blocks: Vec<BlockText>,
}

/// What is between the braces of a long block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BlockText {
    pub(super) range: Range<usize>,
    /// How many brackets are around it.
    pub(super) depth: usize,
}

impl Scanned<'_> {
    /// All of it.
    pub(super) fn whole(&self) -> BlockText {
        BlockText { range: 0..self.text.len(), depth: 0 }
    }

    /// Where the piece ends that begins at `start`.
    pub(super) fn piece(&self, start: usize, inside: &BlockText) -> usize {
        let next = self.cuts.partition_point(|&(cut, _)| cut <= start);
        let cuts = self.cuts.iter().skip(next).take_while(|(cut, _)| *cut < inside.range.end);
        cuts.filter(|(_, depth)| *depth == inside.depth).map(|(cut, _)| *cut).next().unwrap_or(inside.range.end)
    }

    /// A part of the text.
    pub(super) fn text(&self, range: Range<usize>) -> &str {
        self.text.get(range).unwrap_or_default()
    }

    /// The long block whose opening brace is at this place.
    pub(super) fn block(&self, brace: usize) -> Option<&BlockText> {
        let at = self.blocks.binary_search_by_key(&(brace + 1), |block| block.range.start).ok()?;
        self.blocks.get(at)
    }

    /// A part of the text for the grammar, without what is inside of its long blocks: what pest keeps of a text is hundreds of times as long
    /// as the text.
    pub(super) fn outline(&self, range: Range<usize>) -> Outline<'_> {
        let first = self.blocks.partition_point(|block| block.range.start <= range.start);
        let blocks = self.blocks.iter().skip(first).take_while(|block| block.range.end < range.end);
        let (mut text, mut gaps, mut done) = (String::new(), Vec::new(), range.start);
        for BlockText { range: inside, .. } in blocks {
            if inside.start >= done {
                text.push_str(self.text(done..inside.start));
                done = inside.end;
                gaps.push((text.len(), done - text.len()));
            }
        }
        let rest = self.text(done..range.end);
        let text = if gaps.is_empty() { Cow::Borrowed(rest) } else { Cow::Owned(text + rest) };
        Outline { text, start: range.start, gaps }
    }
}

/// A part of a text without what is inside of its long blocks.
pub(super) struct Outline<'t> {
    pub(super) text: Cow<'t, str>,
    /// Where it begins in the whole text.
    start: usize,
    /// Where something is left out, and how much further in the whole text that is which follows.
    gaps: Vec<(usize, usize)>,
}

impl Outline<'_> {
    /// The place in the whole text.
    pub(super) fn place(&self, at: usize) -> usize {
        let before = self.gaps.partition_point(|(gap, _)| *gap < at).checked_sub(1);
        at + before.and_then(|gap| self.gaps.get(gap)).map_or(self.start, |(_, further)| *further)
    }
}

/// Scans a script; `None` where a line is too long or its brackets are nested too deep. A bracket without a partner is reported, and a space for
/// the grammar, so that the rest of the script is still read.
pub(super) fn scan<'s>(source: &'s Source, diagnostics: &mut Diagnostics) -> Option<Scanned<'s>> {
    let text = source.text();
    let base = source.base() as usize;
    let mut scan = Scan {
        text,
        base,
        open: Vec::new(),
        parens: 0,
        spaces: Vec::new(),
        cuts: Vec::new(),
        piece: 0,
        blocks: Vec::new(),
        beyond_reading: false,
        diagnostics,
    };
    scan.run();
    let Scan { mut spaces, cuts, mut blocks, beyond_reading, .. } = scan;
    spaces.sort_unstable();
    blocks.sort_unstable_by_key(|block| block.range.start);
    (!beyond_reading).then(|| Scanned { source, text: with_spaces(text, &spaces), cuts, blocks })
}

struct Scan<'s, 'd> {
    text: &'s str,
    /// The offset of the text's first byte.
    base: usize,
    /// Brackets that are open, with their offsets, and where the piece begins that each is in.
    open: Vec<(u8, usize, usize)>,
    /// How many of them are `(`.
    parens: usize,
    /// Ranges that the grammar sees as spaces, with the last byte of each.
    spaces: Vec<(usize, usize, char)>,
    cuts: Vec<(usize, usize)>,
    /// Where the piece begins.
    piece: usize,
    blocks: Vec<BlockText>,
    beyond_reading: bool,
    diagnostics: &'d mut Diagnostics,
}

impl<'s> Scan<'s, '_> {
    fn run(&mut self) {
        let bytes = self.text.as_bytes();
        let mut line = 0;
        let mut at = 0;
        if self.text.starts_with('\u{FEFF}') {
            at = '\u{FEFF}'.len_utf8();
            self.spaces.push((0, at, ' '));
        }
        loop {
            // Most bytes mean nothing here.
            let rest = bytes.get(at..).unwrap_or_default();
            at += rest.iter().position(|&byte| is_telling(byte)).unwrap_or(rest.len());
            let Some(&byte) = bytes.get(at) else { break };
            if at - line > MAX_LINE {
                self.line_too_long(line);
                return;
            }
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
                        self.spaces.push((from, at + 1, ' '));
                    }
                    line = at + 1;
                    self.line_ended(line);
                    line
                }
                _ if is_hidden(byte) => {
                    let end = self.hidden(at);
                    self.spaces.push((at, end, ' '));
                    end
                }
                _ => at + 1,
            };
        }
        if at - line > MAX_LINE {
            self.line_too_long(line);
            return;
        }
        while let Some((bracket, from, _)) = self.open.pop() {
            self.unclosed(bracket, from, None);
        }
    }

    fn push(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    fn span(&self, start: usize, end: usize) -> Span {
        Span::new(self.base + start, self.base + end)
    }

    fn line_too_long(&mut self, from: usize) {
        self.beyond_reading = true;
        self.open.clear();
        report!(self, LineTooLong, self.span(from, from + 1), "this line is longer than 64 KiB";
            help: "break it into several lines; the rest of the script was not read");
    }

    /// After a line break outside of all `( )`: a piece that is long enough ends here, unless the next line is empty, or a
    /// comment, after which an `else` may follow, or an `else`, which belongs to the block before.
    fn line_ended(&mut self, at: usize) {
        if at - self.piece < PIECE || self.parens > 0 {
            return;
        }
        let next = self.text.get(at..).unwrap_or_default().trim_start_matches([' ', '\t']);
        if !next.starts_with(['#', '\r', '\n']) && !next.starts_with("else") {
            self.cuts.push((at, self.open.len()));
            self.piece = at;
        }
    }

    /// To the end of the line; the line break stays.
    fn comment(&mut self, from: usize) -> usize {
        let line = self.rest_of_line(from);
        if let Some(at) = line.bytes().position(is_hidden) {
            self.hidden(from + at);
        }
        if line.contains("allow:") {
            let allowed = line.split('#').filter_map(|words| words.trim_start().strip_prefix("allow:"));
            self.allow(allowed, from, from + line.trim_end().len());
        }
        if self.parens > 0 {
            self.spaces.push((from, from + line.len(), ' '));
        }
        from + line.len()
    }

    /// `# allow: CODE`: suppresses those warnings on this line.
    fn allow<'t>(&mut self, comments: impl Iterator<Item = &'t str>, from: usize, to: usize) {
        let mut comments = comments.peekable();
        if comments.peek().is_none() {
            return;
        }
        let before = self.text.get(..from).unwrap_or_default();
        let line = before.rfind('\n').map_or(0, |at| at + 1);
        let comment = Span::new(self.base + from, self.base + to);
        let mut report = |message: String, help: String| {
            report!(self.diagnostics, Allow, comment, "{message}"; help: "{help}");
        };
        if before.get(line..).is_none_or(|code| code.trim().is_empty()) {
            let help = "write it at the end of the line that has the warning".to_owned();
            return report("this comment is on a line of its own, so it allows nothing".to_owned(), help);
        }
        // A reason may follow a code.
        let names = comments.flat_map(|codes| codes.split(',')).filter_map(|words| words.split_whitespace().next());
        for name in names.take(MAX_ALLOWED) {
            let (warnings, errors): (Vec<Code>, Vec<Code>) =
                Code::all_named(name).into_iter().partition(|code| code.severity() == Severity::Warning);
            for code in &warnings {
                self.diagnostics.allow(*code, Span::new(self.base + line, self.base + to));
            }
            if !errors.is_empty() {
                report!(self.diagnostics, Allow, comment, "`{name}` is an error";
                    help: "correct the line; only warnings can be allowed");
            } else if warnings.is_empty() {
                let help = match name {
                    "tilt-range" => {
                        "servo 2 is limited to 500..1950 now: `limit servo 2 500..2500` widens it".to_owned()
                    }
                    _ => {
                        let warnings = Code::ALL.iter().filter(|code| code.severity() == Severity::Warning);
                        let warnings: Vec<_> = warnings.map(|code| code.name()).collect();
                        format!("the warnings are: {}", warnings.join(", "))
                    }
                };
                report!(self.diagnostics, Allow, comment, "there is no warning `{name}`"; help: "{help}");
            }
        }
    }

    /// Skips to the end of the string, or of the line.
    fn string(&mut self, from: usize) -> usize {
        let mut at = from + 1;
        while let Some(&byte) = self.text.as_bytes().get(at) {
            match byte {
                b'\n' => break,
                b'\r' if self.text.as_bytes().get(at + 1) == Some(&b'\n') => break,
                b'\\' if self.text.as_bytes().get(at + 1).is_some_and(|&next| !is_hidden(next) && next != b'\n') => {
                    at += 2;
                }
                b'"' => return at + 1,
                _ if is_hidden(byte) => at = self.hidden(at),
                _ => at += 1,
            }
        }
        // The grammar sees an empty string, so that the rest of the script is still read.
        if at > from + 1 {
            self.spaces.push((from + 1, at, '"'));
        }
        report!(self, Unclosed, self.span(from, at), "this string has no closing quotation mark";
            help: "end it with `\"` on the same line; inside a string, write `\\\"` for a quotation mark");
        at
    }

    /// From `from` to the end of its line, without the line break.
    fn rest_of_line(&self, from: usize) -> &'s str {
        let rest = self.text.get(from..).unwrap_or_default();
        let end = rest.bytes().position(|byte| byte == b'\n').unwrap_or(rest.len());
        let line = rest.get(..end).unwrap_or_default();
        line.strip_suffix('\r').unwrap_or(line)
    }

    /// `None` if the nesting is too deep to continue.
    fn opened(&mut self, bracket: u8, at: usize) -> Option<usize> {
        if self.open.len() == MAX_NESTING {
            self.beyond_reading = true;
            self.open.clear();
            report!(self, Nesting, self.span(at, at + 1),
                "brackets are nested more than {MAX_NESTING} deep";
                help: "nest fewer blocks; the rest of the script was not read");
            return None;
        }
        self.open.push((bracket, at, self.piece));
        self.piece = at + 1;
        if bracket == b'(' {
            self.parens += 1;
        }
        Some(at + 1)
    }

    fn closed(&mut self, bracket: u8, at: usize) -> usize {
        let opening = if bracket == b')' { b'(' } else { b'{' };
        let Some(partner) = self.open.iter().rposition(|&(open, ..)| open == opening) else {
            self.spaces.push((at, at + 1, ' '));
            let name = char::from(bracket);
            report!(self, Unopened, self.span(at, at + 1), "this `{name}` closes nothing";
                help: "remove it, or write a `{}` where it should begin", char::from(opening));
            return at + 1;
        };
        // What was opened after the partner was never closed.
        for (inner, from, _) in self.open.split_off(partner + 1) {
            self.unclosed(inner, from, Some(at));
            if inner == b'(' {
                self.parens -= 1;
            }
        }
        if bracket == b')' {
            self.parens -= 1;
        }
        let depth = self.open.len();
        if let Some((_, from, piece)) = self.open.pop() {
            if self.parens == 0 && self.cuts.last().is_some_and(|(cut, _)| *cut > from) {
                self.blocks.push(BlockText { range: from + 1..at, depth });
            }
            self.piece = piece;
        }
        at + 1
    }

    fn unclosed(&mut self, bracket: u8, from: usize, noticed: Option<usize>) {
        self.spaces.push((from, from + 1, ' '));
        let closing = if bracket == b'(' { ')' } else { '}' };
        let open = char::from(bracket);
        let span = self.span(from, from + 1);
        self.push(
            match noticed {
                Some(at) => diagnostic!(Unclosed, span, "this `{open}` is not closed";
                help: "write a `{closing}` where it should end")
                .related(self.span(at, at + 1), format!("a `{closing}` is missing before this")),
                None => diagnostic!(Unclosed, span, "this `{open}` is still open at the end of the file";
                help: "write a `{closing}` where it should end"),
            }
            .label("opened here"),
        );
    }

    /// A run of hidden characters, reported once.
    fn hidden(&mut self, from: usize) -> usize {
        let rest = self.text.as_bytes().get(from..).unwrap_or_default();
        // A carriage return before a line feed belongs to the end of the line.
        let visible = |pair: &[u8]| !pair.first().is_some_and(|&byte| is_hidden(byte)) || pair == b"\r\n";
        let run = rest.windows(2).position(visible).unwrap_or(rest.len());
        let length = rest.iter().take(run).take_while(|&&byte| is_hidden(byte)).count().max(1);
        let byte = rest.first().copied().unwrap_or_default();
        let name = match byte {
            0 => "a NUL byte".to_owned(),
            b'\r' => "a carriage return without a line feed".to_owned(),
            _ => format!("the control character U+{byte:04X}"),
        };
        report!(self, ControlCharacter, self.span(from, from + length), "there is {name} here";
            help: "delete it; a script is plain text");
        from + length
    }
}

/// Whether the scan does anything at this byte.
fn is_telling(byte: u8) -> bool {
    // Nearly all bytes are in this range, which ends the question at once.
    !matches!(byte, b'*'..=b'z' | b' ')
        && (matches!(byte, b'#' | b'"' | b'(' | b')' | b'{' | b'}' | b'\n') || is_hidden(byte))
}

/// Control characters but tab and line feed. A carriage return belongs to its line feed or is one of them.
fn is_hidden(byte: u8) -> bool {
    byte.is_ascii_control() && !matches!(byte, b'\t' | b'\n')
}

/// A copy of `text` with these ranges made spaces, or `text` itself if there are none.
fn with_spaces<'s>(text: &'s str, ranges: &[(usize, usize, char)]) -> Cow<'s, str> {
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
