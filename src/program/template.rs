//! Strings that values are inserted into: `"pass {i}"`.

use std::iter;

/// One piece of such a string.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Piece<'t> {
    /// A character that is shown.
    Char(char),
    /// `{NAME}`, with what is between the braces.
    Name(&'t str),
    /// A `{` without its `}`.
    Unclosed,
    /// A `\` that no `"` or `\` follows.
    LoneBackslash,
}

/// The pieces of a string in its quotation marks: `\"`, `\\`, `{{` and `}}` are one character each.
pub(super) fn pieces(quoted: &str) -> impl Iterator<Item = Piece<'_>> {
    let mut rest = quoted.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(quoted);
    iter::from_fn(move || {
        let mut chars = rest.chars();
        let first = chars.next()?;
        let after = chars.as_str();
        let second = chars.next();
        let piece;
        (piece, rest) = match (first, second) {
            ('\\', Some(c @ ('"' | '\\'))) | ('{', Some(c @ '{')) | ('}', Some(c @ '}')) => {
                (Piece::Char(c), chars.as_str())
            }
            ('\\', _) => (Piece::LoneBackslash, after),
            ('{', _) => match after.split_once('}') {
                Some((name, after)) => (Piece::Name(name.trim()), after),
                None => (Piece::Unclosed, after),
            },
            _ => (Piece::Char(first), after),
        };
        Some(piece)
    })
}

/// The names in a string.
pub(super) fn names(quoted: &str) -> impl Iterator<Item = &str> {
    pieces(quoted).filter_map(|piece| if let Piece::Name(name) = piece { Some(name) } else { None })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text with each name in angle brackets.
    fn read(text: &str) -> String {
        pieces(&format!("\"{text}\""))
            .map(|piece| match piece {
                Piece::Char(c) => c.to_string(),
                Piece::Name(name) => format!("<{name}>"),
                Piece::Unclosed => "<".to_owned(),
                Piece::LoneBackslash => "?".to_owned(),
            })
            .collect()
    }

    #[test]
    fn doubled_braces_are_braces() {
        for (text, wanted) in [
            ("{{}}", "{}"),
            ("{{n}}", "{n}"),
            ("{{{n}}}", "{<n>}"),
            ("{{{{ }}}}", "{{ }}"),
            ("{n}{ m }", "<n><m>"),
            ("n}", "n}"),
            ("{}", "<>"),
            ("{n", "<n"),
            (r#"\"{n}\\{{"#, r#""<n>\{"#),
            (r"\n{{", "?n{"),
        ] {
            assert_eq!(read(text), wanted, "{text}");
        }
    }
}
