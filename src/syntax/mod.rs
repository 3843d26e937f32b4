//! Text to [`Ast`]. pest stops here: nothing of it leaves this room.
//!
//! Three steps: the scan pairs the brackets and bounds their depth, the grammar in `grammar/motion.pest` reads the text,
//! and the builder turns pest's pairs into the tree. Every mistake found on the way becomes a diagnostic; the tree holds what
//! could be read.

mod ambiguous;
mod arguments;
mod ast;
mod build;
mod errors;
mod expression;
mod flat;
pub(crate) mod foreign;
mod pattern;
mod print;
mod read_ahead;
mod reading;
mod scan;
mod visit;

pub use ast::{
    Argument, Ast, Binary, Block, Call, CallArgument, Command, Def, Expression, If, Item, Let, Line, LineRef, Lost,
    Moment, Name, Node, NodeKind, NumberShape, Origin, Parameter, Part, Start, Statement, Value, ValueKind,
};
pub use print::format;
pub(crate) use read_ahead::{Lines, read_ahead};
pub use reading::{Reading, parse_set};

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
    let mut lost = Lost::default();
    let lines = std::iter::from_fn(|| reading.next_kept(diagnostics, &mut lost)).collect();
    let base = source.base() as usize;
    let body = Block::new(lines, Span::new(base, base + source.text().len()));
    Some(Ast { body, lost })
}

/// Begins to read a script line by line, so that the tree of a long one is never there as a whole. `None` as for [`parse`].
pub fn read<'s>(source: &'s Source, diagnostics: &mut Diagnostics) -> Option<Reading<'s>> {
    scan::scan(source, diagnostics).map(Reading::new)
}
