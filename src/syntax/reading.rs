//! A script line by line: flat lines by hand, all others by the grammar, and so the lines of long blocks.

use pest::Parser as _;

use super::ast::{Let, Line, Lost, StoredLine};
use super::build::Builder;
use super::errors;
use super::flat::{self, NotFlat};
use super::grammar::{Grammar, Rule};
use super::scan::{BlockText, Scanned, scan};
use crate::diagnostic::Diagnostics;
use crate::source::{Source, Span};

/// A script that is being read.
pub struct Reading<'s> {
    scanned: Scanned<'s>,
    level: Position<'s>,
}

/// How far the script, or a long block of it, is read.
struct Position<'s> {
    inside: BlockText,
    /// How far it is read.
    at: usize,
    /// Where the piece ends that is being read.
    end: usize,
    /// Lines that the grammar has read.
    lines: std::vec::IntoIter<Line<'s>>,
}

/// A line, by who has read it.
enum Read<'s> {
    ByHand(Line<'s>),
    ByGrammar(Line<'s>),
}

impl<'s> Read<'s> {
    /// As a block keeps it.
    fn kept(self, source: &'s Source) -> StoredLine<'s> {
        match self {
            Read::ByHand(line) => StoredLine::Flat(source.slice(line.span), line.span.start),
            Read::ByGrammar(line) => StoredLine::Tree(Box::new(line)),
        }
    }
}

impl<'s> Reading<'s> {
    pub(super) fn new(scanned: Scanned<'s>) -> Self {
        let level = Position::new(scanned.whole());
        Reading { scanned, level }
    }

    /// How long the script is, in bytes.
    pub(super) fn length(&self) -> usize {
        self.scanned.source.text().len()
    }

    /// The next line, with its blocks. What cannot be read is reported and left out.
    pub fn next(&mut self, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) -> Option<Line<'s>> {
        let (Read::ByHand(line) | Read::ByGrammar(line)) = self.level.next(&self.scanned, diagnostics, lost)?;
        Some(line)
    }

    /// The next line, as a block keeps it.
    pub(super) fn next_kept(&mut self, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) -> Option<StoredLine<'s>> {
        Some(self.level.next(&self.scanned, diagnostics, lost)?.kept(self.scanned.source))
    }
}

/// Reads the `NAME=VALUE` of an option, with nothing after the value, not even a comment. `None` where that is not possible,
/// which is reported.
pub fn parse_set<'s>(source: &'s Source, diagnostics: &mut Diagnostics) -> Option<Let<'s>> {
    let errors = diagnostics.errors();
    let scanned = scan(source, diagnostics)?;
    let outline = scanned.outline(scanned.whole().range);
    let (base, text) = (source.base() as usize, source.text().trim_end());
    let equals = base + text.find('=').unwrap_or(text.len());
    let Ok(mut pairs) = Grammar::parse(Rule::set, &outline.text) else {
        diagnostics.push(errors::no_name(Span::new(base, equals)));
        return None;
    };
    let set = Builder::new(&scanned, &outline, diagnostics).let_(pairs.next()?);
    let is_fine = diagnostics.errors() == errors;
    let set = set.filter(|set| is_fine && set.span.range().end == base + text.len());
    if set.is_none() && is_fine {
        diagnostics.push(errors::no_value(Span::new(equals + 1, base + text.len())));
    }
    set
}

impl<'s> Builder<'s, '_> {
    /// The lines of a block that pest has not seen.
    pub(super) fn long_block(&mut self, inside: &BlockText) -> Vec<StoredLine<'s>> {
        let mut level = Position::new(inside.clone());
        let mut lost = Lost::default();
        let lines = std::iter::from_fn(|| level.next(self.scanned, self.diagnostics, &mut lost));
        let lines = lines.map(|line| line.kept(self.source)).collect();
        self.lost.extend(lost.names);
        self.lost_any |= lost.any;
        lines
    }
}

impl<'s> Position<'s> {
    fn new(inside: BlockText) -> Self {
        let at = inside.range.start;
        Position { inside, at, end: at, lines: Vec::new().into_iter() }
    }

    /// The next line, with its blocks. What cannot be read is reported and left out.
    fn next(&mut self, scanned: &Scanned<'s>, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) -> Option<Read<'s>> {
        loop {
            if let Some(line) = self.lines.next() {
                return Some(Read::ByGrammar(line));
            }
            if self.at == self.end && !self.next_piece(scanned) {
                return None;
            }
            match self.flat_line(scanned) {
                Ok(Some(line)) => return Some(Read::ByHand(line)),
                Ok(None) => {}
                Err(NotFlat) => self.other_line(scanned, diagnostics, lost),
            }
        }
    }

    /// Moves on to the next piece. Returns whether there is one.
    fn next_piece(&mut self, scanned: &Scanned<'_>) -> bool {
        self.end = scanned.piece(self.at, &self.inside);
        self.at < self.end
    }

    /// Reads a flat line, which may be empty.
    fn flat_line(&mut self, scanned: &Scanned<'s>) -> Result<Option<Line<'s>>, NotFlat> {
        let rest = scanned.source.text().get(self.at..self.end).ok_or(NotFlat)?;
        let length = rest.bytes().position(|byte| byte == b'\n').map_or(rest.len(), |at| at + 1);
        let (line, end) = (rest.get(..length).ok_or(NotFlat)?, self.at + length);
        let line = flat::line(line, scanned.source.base() as usize + self.at)?;
        self.at = end;
        Ok(line)
    }

    /// Reads one line of the whole language; where that is not possible, all that is left of the piece.
    fn other_line(&mut self, scanned: &Scanned<'s>, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) {
        let outline = scanned.outline(self.at..self.end);
        let mut builder = Builder::new(scanned, &outline, diagnostics);
        let parsed = Grammar::parse(Rule::one_line, &outline.text);
        self.at = match parsed.or_else(|_| Grammar::parse(Rule::script, &outline.text)) {
            Ok(pairs) => {
                let end = pairs.clone().next().map_or(self.end, |pair| outline.place(pair.as_span().end()));
                builder.add(pairs);
                end
            }
            Err(error) => {
                builder.unreadable(&error);
                self.end
            }
        };
        let (lines, names) = builder.finish();
        self.lines = lines.into_iter();
        lost.add(names);
    }
}
