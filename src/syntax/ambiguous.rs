//! Characters that look like others, or cannot be seen.

use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;

/// What to type instead of a character; `None` for one that means itself.
fn meant(c: char) -> Option<&'static str> {
    const FULL_WIDTH: &str =
        "!\"#$%&'()*+,-./0123456789:;<=>?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_`abcdefghijklmnopqrstuvwxyz{|}~";
    Some(match c {
        '\u{A0}' | '\u{1680}' | '\u{2000}'..='\u{200A}' | '\u{202F}' | '\u{205F}' | '\u{3000}' => " ",
        '\u{AD}'
        | '\u{180E}'
        | '\u{200B}'..='\u{200F}'
        | '\u{202A}'..='\u{202E}'
        | '\u{2060}'..='\u{206F}'
        | '\u{FEFF}' => "",
        '\u{2010}'..='\u{2015}' | '\u{2212}' | '\u{FE58}' | '\u{FE63}' => "-",
        '\'' | '`' | '´' | '‘'..='‟' | '«' | '»' | '‹' | '›' | '″' => "\"",
        '×' => "*",
        '÷' | '∕' | '⁄' => "/",
        '≤' => "<=",
        '≥' => ">=",
        '→' => "->",
        '…' => "..",
        ';' => ";",
        '\u{FF01}'..='\u{FF5E}' => {
            let at = usize::try_from(u32::from(c).checked_sub(0xFF01)?).ok()?;
            FULL_WIDTH.get(at..=at)?
        }
        _ => return None,
    })
}

/// What is wrong with the first such character of a text that cannot be read, which begins at `start`.
pub(super) fn character(text: &str, start: usize) -> Option<Diagnostic> {
    let is_meant = |(at, c): (usize, char)| at == 0 || !c.is_ascii();
    let outside = text.split(['"', '#']).next().unwrap_or_default();
    let (at, c, meant) =
        outside.char_indices().filter(|c| is_meant(*c)).find_map(|(at, c)| Some((at, c, meant(c)?)))?;
    let code = format!("U+{:04X}", u32::from(c));
    let (from, to) = (start + at, start + at + c.len_utf8());
    let span = Span::new(from, to);
    Some(match meant {
        " " => {
            diagnostic!(AmbiguousCharacter, span, "this space is the character {code}"; help: "type a space"; fix: span => " ")
        }
        "" => {
            diagnostic!(AmbiguousCharacter, span, "there is an invisible character, {code}"; help: "delete it"; fix: span => "")
        }
        "\"" => quotes(text.get(at..)?, from, &code)?,
        meant => diagnostic!(AmbiguousCharacter, span, "`{c}` is the character {code}, not `{meant}`";
            help: "type `{meant}`"; fix: span => "{meant}"),
    })
}

/// A text that begins with a quotation mark other than `"`.
fn quotes(text: &str, start: usize, code: &str) -> Option<Diagnostic> {
    let c = text.chars().next()?;
    let rest = text.get(c.len_utf8()..)?;
    let line = rest.split('\n').next().unwrap_or_default();
    let end = line.char_indices().find(|(_, c)| *c == '"' || meant(*c) == Some("\""));
    let Some((end, last)) = end else {
        let span = Span::new(start, start + c.len_utf8());
        return Some(diagnostic!(AmbiguousCharacter, span, "`{c}` is the character {code}, not `\"`";
            help: "type `\"` before and after a string"));
    };
    let string = line.get(..end)?;
    let span = Span::new(start, start + c.len_utf8() + end + last.len_utf8());
    Some(diagnostic!(AmbiguousCharacter, span, "`{c}` is the character {code}, not `\"`";
        help: "type `\"` before and after the string: `\"{string}\"`"; fix: span => "\"{string}\""))
}
