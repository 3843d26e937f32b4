//! Words for what cannot be read: what stands there, and what the user probably meant.

use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;
use crate::units::Unit;

/// Text from the first character that fits nothing. `before` is what stands before it in its line.
pub(super) fn unreadable(text: &str, start: usize, before: &str) -> Diagnostic {
    let first = text.chars().next().unwrap_or(' ');
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let digit_beside = is_digit(before.chars().next_back()) || is_digit(text.chars().nth(1));
    let word = text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
    if let Some(unit) = behind_a_number(word, before) {
        return unit(start);
    }
    if let Some(help) = negation(text, before) {
        let span = Span::new(start, start + first.len_utf8());
        return diagnostic!(Syntax, span, "`{first}` cannot be read here"; help: "{help}");
    }
    let help = match first {
        '.' if text.starts_with("..") && before.contains('(') => {
            "a call takes its values with a comma between them: `random(1, 6)`"
        }
        '.' if digit_beside => "write digits on both sides of the point: `0.5`, not `.5` or `5.`",
        '.' => "a name has no point: write only what stands behind it, such as `random(1, 5)`",
        '\'' | '`' | '“' | '”' | '„' => "write texts between plain quotation marks: `\"text\"`",
        '/' => "a comment starts with `#`",
        '-' if text.starts_with("--") => "a comment starts with `#`; of two signs before a number take one away",
        ',' => "arguments stand behind each other with a blank between them: `rocker x=10 z=50`, `wheels 8 -8 -8 8`",
        '!' => "write `not (a == b)` for different, and `not` for the opposite",
        '&' => "to start two commands together, write `;`; in a condition, write `and`",
        '|' => "write `or`",
        '→' => "write the arrow as `->`",
        'b' if text.starts_with("beat") || text.starts_with("bar") => "multiply: `(n * 1 beat)`",
        '=' if text.starts_with("=>") && before.trim_start().starts_with("expect") => "write `>=`",
        '=' if text.starts_with("=>") => "write the arrow as `->`, and `>=` to compare",
        '=' if text.starts_with("=+") || text.starts_with("= +") => "write a positive number without its `+`",
        '=' if text.starts_with("=-") || text.starts_with("= -") => "a minus stands right before its number: `x=-5`",
        '=' if text.trim_start_matches(['=', ' ']).starts_with('[') => {
            "there are no lists; `nth(i, 1, 2, 3)` takes one of several values"
        }
        '=' => {
            "to name a value, write `let x = 3`; a setting and a value without a name have no `=`: `tempo 120bpm`, `servo 1 1500`; to compare, write `==`"
        }
        ':' => colon(text, before),
        '[' => "there are no lists; `nth(i, 1, 2, 3)` takes one of several values",
        '+' => "a line starts with the name of a command, `at TIME` or `+TIME`",
        '-' if text.starts_with("->") => "an arrow stands between two values, such as `0 -> 12`",
        '–' | '−' | '—' => "write the minus sign of your keyboard, `-`",
        '°' => "write degrees as `deg`: `90deg`",
        c if c.is_ascii_digit() && before.rsplit('(').next().is_some_and(|inside| inside.len() < before.len()) => {
            "values stand in parentheses with a comma between them: `random(5, 10)`"
        }
        _ => "take it away; an argument is a number with its unit, a word, or a calculation in parentheses",
    };
    // Point at the first character, or at the first word; the rest may be fine.
    let shown = if word.is_empty() { text.get(..first.len_utf8()).unwrap_or_default() } else { word };
    let span = Span::new(start, start + shown.len());
    diagnostic!(Syntax, span, "`{shown}` cannot be read here"; help: "{help}")
}

/// `!` as other languages write it, where what to write is known.
fn negation(text: &str, before: &str) -> Option<String> {
    let before = before.trim();
    if let Some(value) = text.strip_prefix("!=").filter(|_| before.starts_with("expect ")) {
        let value = value.split('"').next().unwrap_or_default().trim();
        return Some(format!(
            "write what it should be: `{before} < {value}`, `{before} > {value}`, or a range with `in`"
        ));
    }
    let operand = text.strip_prefix('=')?.trim_start().strip_prefix('!')?.trim();
    (!operand.starts_with('=')).then(|| format!("write `not`: `{before} = not {operand}`"))
}

/// A unit that a blank keeps from its number: `let a = 5 s`.
fn behind_a_number(word: &str, before: &str) -> Option<impl FnOnce(usize) -> Diagnostic> {
    let is_unit = Unit::named(word).is_some_and(Unit::is_unmistakable);
    let number = before.trim_end().rsplit(|c: char| !c.is_ascii_digit() && c != '.').next().unwrap_or_default();
    let is_apart = before.ends_with([' ', '\t']);
    (is_unit && is_apart && !number.is_empty()).then(|| {
        let (message, help) = (
            format!("no blank stands between a number and `{word}`"),
            format!("write them together: `{number}{word}`"),
        );
        let length = word.len();
        move |start| diagnostic!(Unit, Span::new(start, start + length), "{message}"; help: "{help}")
    })
}

/// What a `:` was most likely meant for.
fn colon(text: &str, before: &str) -> &'static str {
    let behind = text.get(1..).unwrap_or_default();
    let words: Vec<&str> = before.split_whitespace().collect();
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    match words.as_slice() {
        _ if behind.trim().is_empty() => {
            "a block stands between braces: `repeat 4 { … }`, with its `{` on the same line"
        }
        [.., "bar", _] => "write `bar 1 beat 2`",
        ["meter", ..] => "write `meter 4/4`",
        ["limit", ..] => "write a range with two points: `500..1950`",
        _ if is_digit(before.chars().next_back()) && is_digit(behind.chars().next()) => {
            "write a time with its units, `1m30s`, and a range with two points, `500..1950`"
        }
        _ if before.ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_') => {
            "an argument with a name is NAME=VALUE: `rocker x=10`"
        }
        _ => "take the `:` away",
    }
}

/// A calculation as an argument, or what looks like one.
pub(super) fn lacks_parentheses(written: &str, span: Span) -> Diagnostic {
    let written = on_one_line(written);
    let trouble = |message: &str, help: String| diagnostic!(Syntax, span, "{}", message; help: "{help}");
    if let Some((sign, (value, comment))) =
        ["//", "/*"].into_iter().find_map(|sign| Some((sign, written.split_once(sign)?)))
    {
        let comment = comment.trim_end_matches("*/").trim();
        let help = format!("a comment starts with `#`: `{} # {comment}`", value.trim());
        return trouble(&format!("`{sign}` cannot be read here"), help);
    }
    if written.contains("- >") || written.ends_with("->") {
        return trouble("an arrow is one sign", "write it without a blank inside: `900 -> 1500`".to_owned());
    }
    if written.contains('"') {
        let help = "values are put into a text between braces: `say \"n is {n}\"`".to_owned();
        return trouble("texts are not joined", help);
    }
    // `10% for 1s` reads as a remainder, too.
    let percent =
        |(at, _): (usize, &str)| written.get(..at).unwrap_or_default().ends_with(|c: char| c.is_ascii_digit());
    if written.match_indices('%').any(percent) && (written.ends_with('%') || written.contains("% ")) {
        let value = written.split(['%', ' ']).next().unwrap_or_default();
        return trouble("there is no percent", format!("write the value itself, such as `{value}`"));
    }
    // `1 +1500`, and `8 - 8 8 - 8`: signs and not a calculation.
    let words: Vec<&str> = written.split(' ').collect();
    let is_sign = |word: &&str| matches!(*word, "+" | "-" | "*" | "/" | "%");
    let signed = words.iter().skip(1).any(|word| word.len() > 1 && word.starts_with('+'));
    if signed {
        let help = format!("write it without: `{}`; a sum is `({written})`", written.replace('+', ""));
        return trouble("a positive number has no sign", help);
    }
    // `1 beat` is one value.
    let is_unit = |word: &&&str| matches!(**word, "beat" | "beats" | "bar" | "bars");
    let values: Vec<&str> = words.iter().filter(|word| !is_unit(word)).copied().collect();
    if values.windows(2).any(|pair| !pair.iter().any(is_sign)) {
        let help = format!("write `{}`; a difference stands in parentheses, `(8 - 8)`", written.replace("- ", "-"));
        return trouble("a minus stands right before its number", help);
    }
    trouble("a calculation as an argument needs parentheses around it", format!("write `({written})`"))
}

/// What was written, also where it breaks its line.
fn on_one_line(written: &str) -> String {
    let lines = written.lines().map(|line| line.split('#').next().unwrap_or_default());
    lines.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
}

/// Two arguments that touch.
pub(super) fn lacks_blank(first: &str, second: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "a blank is missing between two arguments";
        help: "write `{0} {1}`, `({0}{1})` for a calculation, or two points for a range: `500..1950`", on_one_line(first), on_one_line(second))
}

/// A `;` with nothing beside it.
pub(super) fn joins_nothing(span: Span) -> Diagnostic {
    diagnostic!(EmptyPlace, span, "`;` joins two commands, but one is missing here";
        help: "take the `;` away; a line ends by itself")
}

/// Something on the line of a block that has ended.
pub(super) fn behind_a_block(text: &str, span: Span) -> Diagnostic {
    let word = text.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
    let help = match word {
        "elif" | "elseif" | "elsif" => "write `} else if n > 1 { … }`",
        "else" if !text.contains('{') => "an `else` has a block: `} else { … }`",
        "else" if text.starts_with("else if") => "an `else if` has a condition and a block: `} else if n > 1 { … }`",
        "else" => "an `else` has nothing but its block, `} else { … }`; with a condition write `} else if n > 1 { … }`",
        _ => "put it on a line of its own, or a `;` before it to start both together",
    };
    diagnostic!(Syntax, span, "a block ends its statement, but something stands behind it"; help: "{help}")
}

/// A line that starts with a time.
pub(super) fn starts_with_time(written: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "a line starts with a word, not with a time";
    help: "{}", match written.strip_prefix('-') {
        None => format!(
            "write `at {written} …` to start at that time, `+{written} …` to start so much later, or `wait {written}`"
        ),
        Some(time) => format!("write when it starts, such as `at 1s …`, or before a mark: `at bow - {time} …`"),
    })
}

/// A line that starts with anything else that is no word.
pub(super) fn starts_with_no_word(span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "a line starts with the name of a command";
        help: "write one command a line, such as `servo 1 1500`")
}

/// Arguments or a block behind a call.
pub(super) fn behind_a_call(written: &str, name: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "`{written}` is a call, and nothing stands behind a call";
        help: "how long a `def` takes is said inside it; a command has a blank behind its name: `{name} …`")
}

/// A second start time behind a `;`.
pub(super) fn late_start(span: Span) -> Diagnostic {
    diagnostic!(Joined, span, "a start time covers the whole line, so it stands first in it";
        help: "give this command a line of its own")
}

/// `at servo 1 1500`: the command was read as the name of a mark.
pub(super) fn no_time(word: &str, span: Span) -> Diagnostic {
    diagnostic!(StartTime, span, "`at` needs a time before the command";
    help: "{}", if word == "beat" {
        "write `at bar 1 beat 3 …`".to_owned()
    } else {
        format!("for example `at 0.5s {word} …`")
    })
}

/// `at 1s` alone, or `at stop`.
pub(super) fn no_command(written: &str, span: Span) -> Diagnostic {
    diagnostic!(StartTime, span, "a start time and a command stand together, and one of them is missing";
        help: "write the command on the same line: `{written} stop`")
}

/// `left:` alone.
pub(super) fn no_command_for(robot: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "a robot is named, but no command";
        help: "write the command on the same line: `{robot}: stop`")
}

/// What passed the scan and still cannot be read at all, which no script should manage.
pub(super) fn beyond_the_grammar(at: usize) -> Diagnostic {
    diagnostic!(Syntax, Span::new(at, at + 1), "this cannot be read";
        help: "write one command a line, such as `servo 1 1500`")
}

/// `a < b < c`.
pub(super) fn chained(span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "comparisons do not chain"; help: "write `a < b and b < c`")
}

/// `max(a = 1)`.
pub(super) fn named_in_a_function(name: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "`{name}` takes no names in a calculation";
        help: "write the values in their order; only calls of a `def` on a line of their own take names")
}

/// `()`.
pub(super) fn nothing_inside(span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "nothing stands inside these parentheses";
        help: "write a calculation, such as `(1500us + 200us)`")
}

/// `use lib/phrases.motion`.
pub(super) fn file_without_marks(name: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "the name of a file stands between quotation marks"; help: "write `use \"{name}\"`")
}

/// `--set 2x=5`.
pub(super) fn no_name(span: Span) -> Diagnostic {
    diagnostic!(Name, span, "this is not the name of a value";
        help: "write `--set NAME=VALUE` with the name of a `let`, such as `--set depth=300us`")
}

/// `--set x=`, or `--set x=1;`.
pub(super) fn no_value(span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "this cannot be read as a value";
        help: "write `--set NAME=VALUE` with a value such as `3`, `1500us` or `2 beats`")
}
