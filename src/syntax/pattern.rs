//! Patterns of statements, such as `sleep(<seconds>)`: text with holes, each matched by what the user wrote there.
//!
//! A space in a pattern matches spaces, or nothing next to punctuation; spaces inside brackets are ignored. The name of a hole says what it matches: see [`Hole`].

/// The longest statement that is compared. Each hole tries every length, so this bounds the time.
const MAX_STATEMENT: usize = 120;

/// What a hole matches, and how its text is written here.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hole {
    /// A number in this unit, written with the unit.
    Time(&'static str),
    /// A number with a unit of time.
    Duration,
    /// A string in any quotation marks, perhaps with a letter before them, written in `"`.
    Text,
    /// A string in `"`.
    Quoted,
    /// A name.
    Name,
    /// Digits.
    Digits,
    /// Anything but spaces, or nothing.
    Any,
    /// Anything at all.
    Some,
}

impl Hole {
    fn named(name: &str) -> Hole {
        match name {
            "seconds" => Hole::Time("s"),
            "millis" => Hole::Time("ms"),
            "micros" => Hole::Time("us"),
            "time" => Hole::Duration,
            "text" => Hole::Text,
            "quoted" => Hole::Quoted,
            "name" | "type" => Hole::Name,
            "digits" => Hole::Digits,
            "any" | "more" => Hole::Any,
            _ => Hole::Some,
        }
    }

    /// Whether it may match this text.
    fn fits(self, text: &str) -> bool {
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        match self {
            Hole::Any => is_balanced(text),
            Hole::Some | Hole::Time(_) => !text.is_empty() && text == text.trim() && is_balanced(text),
            Hole::Duration => {
                text.starts_with(|c: char| c.is_ascii_digit())
                    && text.ends_with(|c: char| c.is_ascii_alphabetic())
                    && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '.')
            }
            Hole::Text => string(text).is_some(),
            Hole::Quoted => text.starts_with('"') && string(text).is_some(),
            Hole::Name => text.starts_with(|c: char| is_word(c) && !c.is_ascii_digit()) && text.chars().all(is_word),
            Hole::Digits => !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()),
        }
    }

    /// The text as it is written here.
    fn written(self, text: &str) -> String {
        let is_number = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
        match self {
            Hole::Time(unit) if is_number => format!("{}{text}{unit}", if text.starts_with('.') { "0" } else { "" }),
            Hole::Time(_) if Hole::Duration.fits(text) => text.to_owned(),
            Hole::Time(unit) if Hole::Name.fits(text) => format!("({text} * 1{unit})"),
            Hole::Time(unit) => format!("(({text}) * 1{unit})"),
            Hole::Text => format!("\"{}\"", string(text).unwrap_or_default().replace("\\'", "'")),
            _ => text.trim().to_owned(),
        }
    }
}

/// What is in a string, in any quotation marks, perhaps with a letter before them.
fn string(text: &str) -> Option<&str> {
    let text = text.strip_prefix(['f', 'r', 'b', 'u', 'F', 'R']).unwrap_or(text);
    let quote = text.chars().next().filter(|quote| matches!(quote, '"' | '\'' | '`'))?;
    let inner = text.strip_prefix(quote)?.strip_suffix(quote)?;
    let is_end = |(at, _): (usize, &str)| !inner.get(..at).is_some_and(|before| before.ends_with('\\'));
    let is_broken = inner.match_indices(quote).any(is_end) || (quote != '"' && inner.contains('"'));
    (!is_broken).then_some(inner)
}

/// Whether every bracket and quotation mark has its partner in the text.
fn is_balanced(text: &str) -> bool {
    let mut depth = 0_i32;
    let mut in_string = false;
    for c in text.chars() {
        match c {
            '"' => in_string = !in_string,
            '(' | '[' if !in_string => depth += 1,
            ')' | ']' if !in_string => depth -= 1,
            _ => {}
        }
        if depth < 0 {
            return false;
        }
    }
    depth == 0 && !in_string
}

/// What the holes of a pattern match: the name of each, and the text.
pub(super) type Found<'t> = Vec<(&'static str, &'t str)>;

/// Matches a statement, which neither begins nor ends with a space.
pub(super) fn find<'t>(pattern: &'static str, statement: &'t str) -> Option<Found<'t>> {
    let mut found = Vec::new();
    (statement.len() <= MAX_STATEMENT && matches(pattern, statement, None, &mut found)).then_some(found)
}

/// Matches the rest of a statement; `before` is the last character of what was matched.
fn matches<'t>(pattern: &'static str, text: &'t str, before: Option<char>, found: &mut Found<'t>) -> bool {
    let is_word = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    // Spaces next to punctuation mean nothing.
    let is_loose =
        matches!(before, Some('(' | ',' | ';')) || matches!(pattern.chars().next(), Some(')' | ',' | ';' | ':'));
    let text = if is_loose { text.trim_start() } else { text };
    if let Some(rest) = pattern.strip_prefix('<').filter(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()))
        && let Some((name, rest)) = rest.split_once('>')
    {
        let hole = Hole::named(name);
        let ends = text.char_indices().map(|(at, _)| at).chain([text.len()]);
        for (part, after) in ends.filter_map(|end| text.split_at_checked(end)) {
            if hole.fits(part) {
                found.push((name, part));
                if matches(rest, after, part.chars().next_back().or(before), found) {
                    return true;
                }
                found.pop();
            }
        }
        return false;
    }
    let Some(next) = pattern.chars().next() else { return text.is_empty() };
    let rest = pattern.get(next.len_utf8()..).unwrap_or_default();
    if next == ' ' {
        let after = text.trim_start();
        let is_apart = after.len() < text.len() || !(is_word(before) && is_word(after.chars().next()));
        return is_apart && matches(rest, after, before, found);
    }
    text.strip_prefix(next).is_some_and(|after| matches(rest, after, Some(next), found))
}

/// A line with what was found in its holes.
pub(super) fn fill(line: &str, found: &Found<'_>) -> String {
    let mut filled = line.to_owned();
    for (name, text) in found {
        filled = filled.replace(&format!("<{name}>"), &Hole::named(name).written(text));
    }
    filled.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_filled_with_what_was_written() {
        for (pattern, write, text, wanted) in [
            ("sleep(<seconds>)", "wait <seconds>", "sleep( 1 )", Some("wait 1s")),
            ("sleep(<seconds>)", "wait <seconds>", "sleep(.5)", Some("wait 0.5s")),
            ("sleep(<seconds>)", "wait <seconds>", "sleep(2s)", Some("wait 2s")),
            ("sleep(<seconds>)", "wait <seconds>", "sleep(a + 1)", Some("wait ((a + 1) * 1s)")),
            ("sleep(<seconds>)", "wait <seconds>", "sleep(1", None),
            ("print(<text>)", "say <text>", "print(f'a {b}')", Some("say \"a {b}\"")),
            ("print(<text>)", "say <text>", "print(\"a\", \"b\")", None),
            ("G<digits> <any>", "<digits>", "G1 X10", Some("1")),
            ("G<digits> <any>", "<digits>", "G1", Some("1")),
            ("while <any>", "<any>", "while", Some("")),
            ("while <any>", "<any>", "whiley", None),
        ] {
            let filled = find(pattern, text).map(|found| fill(write, &found));
            assert_eq!(filled.as_deref(), wanted, "{text}");
        }
    }
}
