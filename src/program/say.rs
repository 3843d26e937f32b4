//! The words of a `say`.

use super::context::Context;
use super::template::{Piece, pieces};
use crate::diagnostic::{Code, Diagnostic};
use crate::source::Span;
use crate::syntax::{Value, ValueKind};

/// The words of a `say`: escapes undone, values put in.
pub(super) fn say<'s>(value: &Value<'s>, context: &mut Context<'s, '_>) -> Option<String> {
    let span = value.span;
    let ValueKind::Text(quoted) = value.kind else {
        context.report(Diagnostic::new(
            Code::Arguments,
            value.span,
            "`say` needs a text",
            "write it between quotation marks: `say \"here I go\"`",
        ));
        return None;
    };
    let mut text = String::with_capacity(quoted.len());
    for piece in pieces(quoted) {
        match piece {
            Piece::Char(c) => text.push(c),
            Piece::LoneBackslash => {
                context.report(Diagnostic::new(
                    Code::Arguments,
                    value.span,
                    "a `\\` in a text stands before `\"` or `\\` only",
                    "write `\\\\` for a backslash",
                ));
                return None;
            }
            Piece::Name(name) => match context.scope.value(name) {
                Some(found) => text.push_str(&found.to_string()),
                None => return unknown(format!("nothing is called `{name}` here"), span, context),
            },
            Piece::Unclosed => return unknown("a `{` in a text has no `}` behind its name", span, context),
        }
    }
    Some(text)
}

fn unknown<T>(message: impl Into<String>, span: Span, context: &mut Context<'_, '_>) -> Option<T> {
    let help = "put the name of a `let` between `{` and `}`; write `{{` and `}}` to show braces";
    context.report(Diagnostic::new(Code::UnknownName, span, message, help));
    None
}
