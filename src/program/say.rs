//! The words of a `say`.

use super::evaluator::Evaluator;
use super::template::{Piece, pieces};
use crate::diagnostic::Code;
use crate::source::Span;
use crate::syntax::{Value, ValueKind};

/// The words of a `say`: escapes undone, values put in.
pub(super) fn say<'s>(value: &Value<'s>, eval: &mut Evaluator<'s, '_>) -> Option<String> {
    let span = value.span;
    let ValueKind::Text(quoted) = value.kind else {
        let message = "`say` needs a text";
        let help = "write it between quotation marks: `say \"here I go\"`";
        return eval.refuse(Code::Arguments, value.span, message, help);
    };
    let mut text = String::with_capacity(quoted.len());
    for piece in pieces(quoted) {
        match piece {
            Piece::Char(c) => text.push(c),
            Piece::LoneBackslash => {
                let message = "a `\\` in a text stands before `\"` or `\\` only";
                let help = "write `\\\\` for a backslash";
                return eval.refuse(Code::Arguments, value.span, message, help);
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

fn unknown<T>(message: impl Into<String>, span: Span, eval: &mut Evaluator<'_, '_>) -> Option<T> {
    let help = "put the name of a `let` between `{` and `}`; write `{{` and `}}` to show braces";
    eval.refuse(Code::UnknownName, span, message, help)
}
