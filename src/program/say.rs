//! The words of a `say`.

use std::fmt::Display;

use super::evaluator::Evaluator;
use super::template::{Piece, pieces};
use crate::diagnostic::bail;
use crate::source::Span;
use crate::syntax::{Value, ValueKind};

/// The words of a `say`: escapes undone, values put in.
pub(super) fn say<'s>(value: &Value<'s>, eval: &mut Evaluator<'s, '_>) -> Option<String> {
    let span = value.span;
    let ValueKind::Text(quoted) = value.kind else {
        bail!(eval, Arguments, value.span, "`say` needs a text";
            help: "write it between quotation marks: `say \"here I go\"`");
    };
    let mut text = String::with_capacity(quoted.len());
    for piece in pieces(quoted) {
        match piece {
            Piece::Char(c) => text.push(c),
            Piece::LoneBackslash => {
                bail!(eval, Arguments, value.span, "a `\\` in a text stands before `\"` or `\\` only";
                    help: "write `\\\\` for a backslash");
            }
            Piece::Name(name) => match eval.scope.value(name) {
                Some(found) => text.push_str(&found.to_string()),
                None => return unknown(format!("nothing is called `{name}` here"), span, eval),
            },
            Piece::Unclosed => return unknown("a `{` in a text has no `}` behind its name", span, eval),
        }
    }
    Some(text)
}

fn unknown<T>(message: impl Display, span: Span, eval: &mut Evaluator<'_, '_>) -> Option<T> {
    bail!(eval, UnknownName, span, "{message}";
        help: "put the name of a `let` between `{{` and `}}`; write `{{{{` and `}}}}` to show braces")
}
