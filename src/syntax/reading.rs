//! A script line by line: flat lines by hand, all others by the grammar.

use pest::Parser as _;
use pest::iterators::Pair;

use super::ast::{Line, Lost};
use super::build::Builder;
use super::flat::{self, NotFlat};
use super::grammar::{Grammar, Rule};
use super::scan::Scanned;
use crate::diagnostic::Diagnostics;
use crate::source::Source;

/// How many bytes of lines are cut at once.
const FEW: usize = 4 * 1024;

/// A script that is being read.
pub struct Reading<'s> {
    source: &'s Source,
    scanned: Scanned<'s>,
    /// How far it is read.
    at: usize,
    /// Where the piece ends that is being read.
    end: usize,
    /// Where its next lines end, as the grammar has cut them.
    ends: std::vec::IntoIter<usize>,
    /// Lines that the grammar has read.
    lines: std::vec::IntoIter<Line<'s>>,
}

impl<'s> Reading<'s> {
    pub(super) fn new(source: &'s Source, scanned: Scanned<'s>) -> Self {
        let (ends, lines) = (Vec::new().into_iter(), Vec::new().into_iter());
        Reading { source, scanned, at: 0, end: 0, ends, lines }
    }

    /// How long the script is, in bytes.
    pub(super) fn length(&self) -> usize {
        self.source.text().len()
    }

    /// The next line, with its blocks. What cannot be read is reported and left out.
    pub fn next(&mut self, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) -> Option<Line<'s>> {
        loop {
            if let Some(line) = self.lines.next() {
                return Some(line);
            }
            if self.at == self.end && !self.next_piece() {
                return None;
            }
            match self.flat_line() {
                Ok(Some(line)) => return Some(line),
                Ok(None) => {}
                Err(NotFlat) => self.other_line(diagnostics, lost),
            }
        }
    }

    /// Goes on to the next piece; `false` where there is none.
    fn next_piece(&mut self) -> bool {
        self.end = self.scanned.piece(self.at);
        self.at < self.end
    }

    /// Cuts the next few lines. A piece is long where empty lines and comments follow each other, and a token is longer than they are.
    fn cut(&mut self) {
        let rest = self.scanned.text(self.at..self.end);
        let most = rest.floor_char_boundary(FEW);
        let end = rest.bytes().skip(most).position(|byte| byte == b'\n').map_or(rest.len(), |at| most + at + 1);
        let few = rest.get(..end).unwrap_or_default();
        let lines = Grammar::parse(Rule::text_lines, few).into_iter().flatten().flat_map(Pair::into_inner);
        let ends: Vec<usize> = lines.map(|line| self.at + line.as_span().end()).collect();
        self.ends = ends.into_iter();
    }

    /// Reads a flat line, which may be empty.
    fn flat_line(&mut self) -> Result<Option<Line<'s>>, NotFlat> {
        if self.ends.as_slice().is_empty() {
            self.cut();
        }
        let end = self.ends.next().ok_or(NotFlat)?;
        // The same bytes as the grammar has seen, of the source itself.
        let text = self.source.text().get(self.at..end).ok_or(NotFlat)?;
        let line = flat::line(text, self.source.base() as usize + self.at)?;
        self.at = end;
        Ok(line)
    }

    /// Reads one line of the whole language; where that is not possible, all that is left of the piece.
    fn other_line(&mut self, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) {
        let text = self.scanned.text(self.at..self.end);
        let mut builder = Builder::new(self.source, diagnostics);
        let length = match Grammar::parse(Rule::one_line, text).or_else(|_| Grammar::parse(Rule::script, text)) {
            Ok(pairs) => {
                let length = pairs.clone().next().map_or(text.len(), |pair| pair.as_span().end());
                builder.add(self.at, pairs);
                length
            }
            Err(error) => {
                builder.unreadable(self.at, &error);
                text.len()
            }
        };
        let (lines, names) = builder.finish();
        self.lines = lines.into_iter();
        lost.add(names);
        self.at += length;
        // It ends where a line ends, perhaps further down.
        while self.ends.as_slice().first().is_some_and(|end| *end <= self.at) {
            self.ends.next();
        }
    }
}
