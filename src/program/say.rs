//! The text of a `say`.

use std::fmt::Display;

use super::evaluator::Evaluator;
use super::template::{Piece, pieces};
use crate::diagnostic::bail;
use crate::source::Span;
use crate::syntax::{Value, ValueKind};

/// The text of a `say`: escapes undone, values inserted.
pub(super) fn say<'s>(value: &Value<'s>, eval: &mut Evaluator<'s, '_>) -> Option<String> {
    let span = value.span;
    let ValueKind::Text(quoted) = value.kind else {
        bail!(eval, InvalidArgument, value.span, "`say` needs a string";
            help: "write it in quotation marks: `say \"here I go\"`");
    };
    let mut text = String::with_capacity(quoted.len());
    for piece in pieces(quoted) {
        match piece {
            Piece::Char(c) => text.push(c),
            Piece::LoneBackslash => {
                bail!(eval, InvalidArgument, value.span, "a `\\` in a string must precede `\"` or `\\`";
                    help: "write `\\\\` for a backslash");
            }
            Piece::Name(name) => match eval.scope.value(name) {
                Some(found) => text.push_str(&found.to_string()),
                None => return unknown(format!("unknown name `{name}`"), span, eval),
            },
            Piece::Unclosed => return unknown("a `{` in this string has no `}`", span, eval),
        }
    }
    Some(text)
}

fn unknown<T>(message: impl Display, span: Span, eval: &mut Evaluator<'_, '_>) -> Option<T> {
    bail!(eval, UnknownName, span, "{message}";
        help: "write the name of a `let` between `{{` and `}}`; to show braces, write `{{{{` and `}}}}`")
}
