//! The words of a `say`.

use super::context::Context;
use crate::diagnostic::{Code, Diagnostic};
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
    let inner = quoted.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(quoted);
    let mut text = String::with_capacity(inner.len());
    let mut chars = inner.chars();
    while let Some(c) = chars.next() {
        match c {
            '\\' => {
                if let Some(escaped @ ('"' | '\\')) = chars.next() {
                    text.push(escaped);
                } else {
                    context.report(Diagnostic::new(
                        Code::Arguments,
                        value.span,
                        "a `\\` in a text stands before `\"` or `\\` only",
                        "write `\\\\` for a backslash",
                    ));
                    return None;
                }
            }
            '{' => {
                let rest = chars.as_str();
                let name = rest.split_once('}').map(|(name, _)| name);
                let value = name.and_then(|name| context.scope.value(name.trim()));
                let Some((name, found)) = name.zip(value) else {
                    context.report(Diagnostic::new(
                        Code::UnknownName,
                        span,
                        format!("nothing is called `{}` here", name.unwrap_or(rest).trim()),
                        "put the name of a `let` between `{` and `}`",
                    ));
                    return None;
                };
                text.push_str(&found.to_string());
                chars = rest.get(name.len() + 1..).unwrap_or_default().chars();
            }
            _ => text.push(c),
        }
    }
    Some(text)
}
