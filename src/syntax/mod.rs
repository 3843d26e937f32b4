//! Text to [`Ast`]. pest stops here: nothing of it leaves this room.
//!
//! Three steps: [`scan`] pairs the brackets and bounds their depth, the grammar in `grammar/motion.pest` reads the text,
//! and `build` turns pest's pairs into the tree. Every mistake found on the way becomes a diagnostic; the tree holds what
//! could be read.

mod ast;
mod build;
mod scan;

pub use ast::{
    Argument, Ast, Block, Command, Item, Later, Line, Moment, Name, NumberShape, Origin, Part, Start, Statement, Value,
    ValueKind,
};
pub use scan::MAX_NESTING;

use pest::Parser as _;

use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::{Source, Span};

/// The derived parser; its `Rule` type must be at least as visible as itself, so it has a module of its own.
mod grammar {
    #![allow(missing_docs, clippy::pedantic, reason = "derived code")]

    #[derive(pest_derive::Parser)]
    #[grammar = "../grammar/motion.pest"]
    pub(super) struct Grammar;
}

/// Reads a whole script. `None` where its brackets do not pair, so that nothing else can be said of it.
pub fn parse<'s>(source: &'s Source, diagnostics: &mut Diagnostics) -> Option<Ast<'s>> {
    let text = scan::scan(source.text(), diagnostics)?;
    match grammar::Grammar::parse(grammar::Rule::script, &text) {
        Ok(pairs) => Some(build::build(source, pairs, diagnostics)),
        Err(error) => {
            let at = match error.location {
                pest::error::InputLocation::Pos(at) => Span::new(at, at + 1),
                pest::error::InputLocation::Span((start, end)) => Span::new(start, end),
            };
            diagnostics.push(Diagnostic::new(
                Code::Syntax,
                at,
                "this cannot be read",
                "write one command a line, such as `servo 1 1500`",
            ));
            None
        }
    }
}
