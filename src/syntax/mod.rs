//! Text to [`Ast`]. pest stops here: nothing of it leaves this room.
//!
//! Three steps: the scan pairs the brackets and bounds their depth, the grammar in `grammar/motion.pest` reads the text,
//! and the builder turns pest's pairs into the tree. Every mistake found on the way becomes a diagnostic; the tree holds what
//! could be read.

mod ast;
mod build;
mod expression;
mod flat;
mod print;
mod scan;
mod trouble;

pub use ast::{
    Argument, Ast, Binary, Block, Call, Command, Def, Expression, Given, If, Item, Let, Line, Moment, Name, Node,
    NodeKind, NumberShape, Origin, Parameter, Part, Start, Statement, Value, ValueKind,
};
pub use print::format;
pub use scan::{MAX_LINE, MAX_NESTING};

use pest::Parser as _;
use pest::iterators::Pair;

use crate::diagnostic::Diagnostics;
use crate::source::{Source, Span};

/// The derived parser; its `Rule` type must be at least as visible as itself, so it has a module of its own.
mod grammar {
    #![allow(missing_docs, clippy::pedantic, reason = "derived code")]

    #[derive(pest_derive::Parser)]
    #[grammar = "../grammar/motion.pest"]
    pub(super) struct Grammar;
}

/// Reads a whole script. `None` where a line is too long or its brackets are nested too deep, so that nothing else can be said of it.
pub fn parse<'s>(source: &'s Source, diagnostics: &mut Diagnostics) -> Option<Ast<'s>> {
    let mut reading = read(source, diagnostics)?;
    let mut whole = Ast {
        body: Block { lines: Vec::new(), span: reading.span(0..source.text().len()) },
        broken: Vec::new(),
        names_missing: false,
    };
    while let Some(piece) = reading.next(diagnostics) {
        whole.body.lines.extend(piece.body.lines);
        whole.broken.extend(piece.broken);
        whole.names_missing |= piece.names_missing;
    }
    Some(whole)
}

/// Begins to read a script piece by piece, so that the tree of a long one is never there as a whole. `None` as for [`parse`].
pub fn read<'s>(source: &'s Source, diagnostics: &mut Diagnostics) -> Option<Reading<'s>> {
    Some(Reading { source, scanned: scan::scan(source, diagnostics)?, pieces: 0 })
}

/// A script that is being read.
pub struct Reading<'s> {
    source: &'s Source,
    scanned: scan::Scanned<'s>,
    /// How many pieces were read.
    pieces: usize,
}

impl<'s> Reading<'s> {
    /// The tree of the next piece, a number of whole lines.
    pub fn next(&mut self, diagnostics: &mut Diagnostics) -> Option<Ast<'s>> {
        let (start, piece) = self.scanned.piece(self.pieces)?;
        self.pieces += 1;
        let mut builder = build::Builder::new(self.source, diagnostics);
        let mut done = 0;
        while done < piece.len() {
            done += self.flat_lines(start + done, piece.get(done..)?, &mut builder);
            done += other_line(start + done, piece.get(done..)?, &mut builder);
        }
        Some(builder.finish(self.span(start..start + piece.len())))
    }

    /// Reads flat lines as far as there are any; gives how many bytes they are.
    fn flat_lines(&self, start: usize, text: &str, builder: &mut build::Builder<'s, '_>) -> usize {
        let Ok(lines) = grammar::Grammar::parse(grammar::Rule::flat_lines, text) else { return 0 };
        let base = self.source.base() as usize;
        let mut done = 0;
        for token in lines.flat_map(Pair::into_inner) {
            let span = token.as_span();
            // The same bytes, of the source itself.
            let line = self.source.text().get(start + span.start()..start + span.end());
            let Some(line) = line.and_then(|line| flat::line(line, base + start + span.start())) else { break };
            builder.add_flat(line);
            done = span.end();
        }
        done
    }

    fn span(&self, range: std::ops::Range<usize>) -> Span {
        let base = self.source.base() as usize;
        Span::new(base + range.start, base + range.end)
    }
}

/// Reads one line of the whole language, with its blocks; where that is not possible, all that is left. Gives how many bytes were read.
fn other_line(start: usize, text: &str, builder: &mut build::Builder<'_, '_>) -> usize {
    use grammar::{Grammar, Rule};
    if text.is_empty() {
        return 0;
    }
    let read = Grammar::parse(Rule::one_line, text).or_else(|_| Grammar::parse(Rule::script, text));
    match read {
        Ok(pairs) => {
            let end = pairs.clone().next().map_or(text.len(), |pair| pair.as_span().end());
            builder.add(start, pairs);
            end
        }
        Err(error) => {
            builder.unreadable(start, &error);
            text.len()
        }
    }
}
