//! Messages for text that cannot be read, and what to write instead.

use super::ambiguous;
use super::foreign;
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;
use crate::units::Unit;

/// Text that cannot be read, and where it is.
pub(super) struct Unreadable<'t> {
    /// From the first character that cannot be read to the end of the statement.
    pub(super) text: &'t str,
    pub(super) start: usize,
    /// What precedes it in its line.
    pub(super) before: &'t str,
    /// The rest of the file from the start of the statement.
    pub(super) statement: &'t str,
    pub(super) statement_start: usize,
}

/// Text that fits nothing.
pub(super) fn unreadable(at: &Unreadable<'_>) -> Diagnostic {
    let Unreadable { text, start, before, .. } = *at;
    let first = text.chars().next().unwrap_or(' ');
    let word = text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
    if let Some(foreign) = foreign::statement(at.statement, at.statement_start) {
        let foreign = if before.trim().is_empty() { foreign.at_line_start() } else { foreign };
        return foreign.diagnostic();
    }
    let found = space_before_unit(word, before, start).or_else(|| operator(at)).or_else(|| dashed_name(at));
    if let Some(found) = found.or_else(|| ambiguous::character(text, start)).or_else(|| foreign_letters(at)) {
        return found;
    }
    // Point at the first character, or at the first word; the rest may be correct.
    let shown = if word.is_empty() { text.get(..first.len_utf8()).unwrap_or_default() } else { word };
    let span = Span::new(start, start + shown.len());
    if let Some(help) = negation(text, before) {
        return diagnostic!(Syntax, span, "`{first}` cannot be read here"; help: "{help}");
    }
    diagnostic!(Syntax, span, "`{shown}` cannot be read here"; help: "{}", help(text, before))
}

/// What to write instead of text that fits nothing, by its first character.
fn help(text: &str, before: &str) -> String {
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let next_to_digit = is_digit(before.chars().next_back()) || is_digit(text.chars().nth(1));
    let lists = "there are no lists: `nth(i, 1, 2, 3)` is one of several values";
    let is_in_parentheses = before.rsplit('(').next().is_some_and(|inside| inside.len() < before.len());
    let help = match text.chars().next().unwrap_or(' ') {
        '.' if text.starts_with("..") && before.contains('(') => {
            "separate the values of a call with commas: `random(1, 6)`"
        }
        '.' if next_to_digit => "write digits on both sides of the decimal point: `0.5`, not `.5` or `5.`",
        '.' => "a name contains no `.`: write only what follows it, such as `random(1, 5)`",
        '/' => "a comment starts with `#`",
        '-' if text.starts_with("--") => "a comment starts with `#`; a number has at most one `-`",
        ',' if before.trim_start().starts_with("robots") => "separate names with one comma: `robots left, right`",
        ',' => "separate arguments with spaces: `rocker x=10 z=50`, `wheels 8 -8 -8 8`",
        '\\' => "remove the `\\`: a line may only be broken inside `( )`",
        'b' if text.starts_with("beat") || text.starts_with("bar") => "multiply: `(n * 1 beat)`",
        '=' if text.starts_with("=>") && before.trim_start().starts_with("expect") => "write `>=`",
        '=' if text.starts_with("=>") => "write `->` for an arrow, and `>=` to compare",
        '=' if text.starts_with("=+") || text.starts_with("= +") => "write a positive number without its `+`",
        '=' if text.starts_with("=-") || text.starts_with("= -") => {
            "write a minus sign directly before its number: `x=-5`"
        }
        '=' if text.trim_start_matches(['=', ' ']).starts_with('[') => lists,
        '=' => return equals(text, before),
        ':' => colon(text, before),
        '[' => lists,
        '+' if before.trim_end().ends_with(':') => "the start time comes before the names of robots: `+1s left: stop`",
        '+' => "a line starts with the name of a command, `at TIME` or `+TIME`",
        '-' if text.starts_with("->") => "write an arrow between two values: `0 -> 12`",
        '°' => "write degrees as `deg`: `90deg`",
        c if c.is_ascii_digit() && is_in_parentheses => {
            "separate the values in parentheses with commas: `random(5, 10)`"
        }
        _ => "remove it; an argument is a number with its unit, a word, or a calculation in parentheses",
    };
    help.to_owned()
}

/// An `=` that is not expected.
fn equals(text: &str, before: &str) -> String {
    let value = text.trim_start_matches('=').split(['#', ';', '{', '}']).next().unwrap_or_default().trim();
    let name = before.trim();
    if name.contains(' ') || name.is_empty() || value.is_empty() {
        return "remove the `=`; to name a value, write `let x = 3`; to compare, write `==`".to_owned();
    }
    format!("write `let {name} = {value}` to name a value; a setting or a command has no `=`: `{name} {value}`")
}

/// `let my-pos = 1`.
fn dashed_name(at: &Unreadable<'_>) -> Option<Diagnostic> {
    let name = at.before.trim().strip_prefix("let ")?.trim();
    let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    let value = at.text.strip_prefix('=').filter(|_| is_name && name.contains('-'))?;
    let value = value.split(['#', ';', '{', '}', '\n']).next().unwrap_or_default().trim();
    let start = at.start - at.before.len() + at.before.find(name)?;
    let (span, write) = (Span::new(start, start + name.len()), name.replace('-', "_"));
    Some(diagnostic!(Name, span, "a name consists of lower-case letters, digits and `_`";
        help: "write `let {write} = {value}`"; fix: span => "{write}"))
}

/// `let größe = 1`.
fn foreign_letters(at: &Unreadable<'_>) -> Option<Diagnostic> {
    let letter = at.text.chars().next().filter(|first| first.is_alphabetic() && !first.is_ascii())?;
    let is_part = |c: &char| c.is_alphanumeric() || *c == '_';
    let head: usize = at.before.chars().rev().take_while(is_part).map(char::len_utf8).sum();
    let tail: usize = at.text.chars().take_while(is_part).map(char::len_utf8).sum();
    let (span, code) = (Span::new(at.start - head, at.start + tail), u32::from(letter));
    Some(diagnostic!(Name, span, "`{letter}` (U+{code:04X}) is not allowed in a name";
        help: "use only the letters a to z, digits and `_`"))
}

/// An operator of another language.
fn operator(at: &Unreadable<'_>) -> Option<Diagnostic> {
    // `expect voltage != 10V`.
    if at.text.starts_with("!=") && at.before.trim_start().starts_with("expect ") {
        return None;
    }
    let found = foreign::operator_at(at.text, at.before)?;
    let (line, written) = (at.start - at.before.len(), found.written);
    let span = Span::new(at.start, at.start + written.len());
    let diagnostic = diagnostic!(ForeignSyntax, span, "there is no operator `{written}`"; help: "{}", found.help);
    Some(match found.fix {
        Some((range, text)) => diagnostic.fix(Span::new(line + range.start, line + range.end), text),
        None => diagnostic,
    })
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

/// A unit with a space between it and its number: `let a = 5 s`.
fn space_before_unit(word: &str, before: &str, start: usize) -> Option<Diagnostic> {
    let is_unit = Unit::named(word).is_some_and(Unit::is_unmistakable);
    let number = before.trim_end().rsplit(|c: char| !c.is_ascii_digit() && c != '.').next().unwrap_or_default();
    let spaces = before.len() - before.trim_end().len();
    (is_unit && spaces > 0 && !number.is_empty()).then(|| {
        let span = Span::new(start, start + word.len());
        diagnostic!(Unit, span, "no space is allowed between a number and its unit `{word}`";
            help: "write `{number}{word}`"; fix: Span::new(start - spaces, start) => "")
    })
}

/// What a `:` was most likely meant for.
fn colon(text: &str, before: &str) -> &'static str {
    let after = text.get(1..).unwrap_or_default();
    let words: Vec<&str> = before.split_whitespace().collect();
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    match words.as_slice() {
        _ if after.trim().is_empty() => "write a block in braces, with its `{` on the same line: `repeat 4 { … }`",
        [.., "bar", _] => "write `bar 1 beat 2`",
        ["robot", _] => "write only the name of the robot: `left: stop`",
        [_, "and", _] => "separate the names of robots with commas: `left, right: stop`",
        [first, _] if first.ends_with(':') => {
            "name all robots of the line before one `:`, with commas: `left, right: stop`"
        }
        ["meter", ..] => "write `meter 4/4`",
        ["limit", ..] => "write a range with two dots: `500..1950`",
        _ if is_digit(before.chars().next_back()) && is_digit(after.chars().next()) => {
            "write a time with its units, `1m30s`, and a range with two dots, `500..1950`"
        }
        _ if before.ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_') => {
            "write an argument with a name as NAME=VALUE: `rocker x=10`"
        }
        _ => "remove the `:`",
    }
}

/// A calculation as an argument, or what looks like one.
pub(super) fn needs_parentheses(source: &str, span: Span) -> Diagnostic {
    let written = on_one_line(source);
    let trouble = |message: &str, help: String| diagnostic!(MissingParentheses, span, "{message}"; help: "{help}");
    let part = |at: usize, length: usize| Span::new(span.range().start + at, span.range().start + at + length);
    if let Some((at, sign)) = ["//", "/*"].into_iter().find_map(|sign| Some((source.find(sign)?, sign))) {
        let (value, comment) = written.split_once(sign).unwrap_or((&written, ""));
        let (value, comment) = (value.trim(), comment.trim_end_matches("*/").trim());
        return diagnostic!(ForeignSyntax, part(at, 2), "`{sign}` does not start a comment";
            help: "write `#`: `{value} # {comment}`");
    }
    if let Some(at) = source.find("- >") {
        return diagnostic!(MissingParentheses, span, "there is a space inside an arrow";
            help: "write `{}`", written.replace("- >", "->"); fix: part(at, 3) => "->");
    }
    if written.ends_with("->") {
        return trouble("the value after `->` is missing", "write both values: `900 -> 1500`".to_owned());
    }
    if written.contains('"') {
        let help = "insert values into a string with braces: `say \"n is {n}\"`".to_owned();
        return trouble("strings cannot be joined", help);
    }
    // `10% for 1s` reads as a remainder, too.
    let percent =
        |(at, _): (usize, &str)| written.get(..at).unwrap_or_default().ends_with(|c: char| c.is_ascii_digit());
    if written.match_indices('%').any(percent) && (written.ends_with('%') || written.contains("% ")) {
        let value = written.split(['%', ' ']).next().unwrap_or_default();
        return trouble("there is no unit `%`", format!("write the value itself, such as `{value}`"));
    }
    // `1 +1500`, and `8 - 8 8 - 8`: signs and not a calculation.
    let words: Vec<&str> = written.split(' ').collect();
    let is_sign = |word: &&str| matches!(*word, "+" | "-" | "*" | "/" | "%");
    let signed = words.iter().skip(1).any(|word| word.len() > 1 && word.starts_with('+'));
    if signed {
        let help = format!("write it without: `{}`; a sum is `({written})`", written.replace('+', ""));
        return trouble("a positive number has no `+`", help);
    }
    // `1 beat` is one value.
    let is_unit = |word: &&&str| matches!(**word, "beat" | "beats" | "bar" | "bars");
    let values: Vec<&str> = words.iter().filter(|word| !is_unit(word)).copied().collect();
    if values.windows(2).any(|pair| !pair.iter().any(is_sign)) {
        let help = format!("write `{}`; a difference needs parentheses: `(8 - 8)`", written.replace("- ", "-"));
        return trouble("no space is allowed between a minus sign and its number", help);
    }
    diagnostic!(MissingParentheses, span, "a calculation as an argument needs parentheses"; write: span => "({written})")
}

/// What was written, also where it breaks its line.
fn on_one_line(written: &str) -> String {
    let lines = written.lines().map(|line| line.split('#').next().unwrap_or_default());
    lines.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
}

/// Two arguments without a space between them, with the text from the start of their statement, and where that is.
pub(super) fn needs_space(
    first: &str,
    second: &str,
    span: Span,
    (statement, statement_start): (&str, usize),
) -> Diagnostic {
    let (first, second) = (on_one_line(first), on_one_line(second));
    let is_number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
    if let Some(number) = foreign::without_exponent(&format!("{first}{second}")) {
        return diagnostic!(Number, span, "`{first}{second}` has an exponent"; write: span => "{number}");
    }
    let is_prefix = matches!(first.as_str(), "f" | "r" | "b" | "u") && second.starts_with('"');
    if is_prefix && let Some(found) = foreign::statement(statement, statement_start) {
        return found.diagnostic();
    }
    if is_prefix {
        return diagnostic!(ForeignSyntax, span, "`{first}\"` is Python syntax";
            help: "remove the `{first}`: `{second}`"; fix: span => "{second}");
    }
    if statement.starts_with("limit")
        && is_number(&first)
        && let Some(most) = second.strip_prefix('-').filter(|most| is_number(most))
    {
        return diagnostic!(MissingSpace, span, "a range is written with two dots"; write: span => "{first}..{most}");
    }
    diagnostic!(MissingSpace, span, "there is no space between two arguments";
        help: "write `{first} {second}`; a calculation is `({first}{second})`, and a range has two dots: `500..1950`")
}

/// A `;` without a command on one side.
pub(super) fn empty_command(span: Span) -> Diagnostic {
    diagnostic!(EmptyPlace, span, "there is no command on one side of this `;`";
        help: "remove the `;`; the end of the line ends a command"; fix: span => "")
}

/// Something after a block, on the line where the block ends.
pub(super) fn after_block(text: &str, span: Span) -> Diagnostic {
    if let Some(foreign) = foreign::statement(text, span.range().start).filter(|found| !found.origin.is_empty()) {
        return foreign.diagnostic();
    }
    let word = text.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
    let help = match word {
        "else" if !text.contains('{') => "an `else` needs a block: `} else { … }`",
        "else" if text.starts_with("else if") => "an `else if` needs a condition and a block: `} else if n > 1 { … }`",
        "else" => "write `} else { … }`, or with a condition `} else if n > 1 { … }`",
        _ => "put it on a line of its own, or write a `;` before it to start both together",
    };
    diagnostic!(Block, span, "a block ends its statement, but more text follows on its line"; help: "{help}")
}

/// A line that starts with a time.
pub(super) fn starts_with_time(written: &str, span: Span) -> Diagnostic {
    let help = match written.strip_prefix('-') {
        None => format!(
            "write `at {written} …` to start at that time, `+{written} …` to start {written} later, or `wait {written}`"
        ),
        Some(time) => format!("write when it starts, such as `at 1s …`, or before a mark: `at bow - {time} …`"),
    };
    diagnostic!(Syntax, span, "a line starts with a word, not with a time"; help: "{help}")
}

/// A line that starts with anything else that is not a word.
pub(super) fn starts_with_no_word(written: &str, span: Span) -> Diagnostic {
    if written.starts_with('"') {
        return diagnostic!(Syntax, span, "a line starts with the name of a command"; write: span => "say {written}");
    }
    diagnostic!(Syntax, span, "a line starts with the name of a command";
        help: "write one command per line, such as `servo 1 1500`")
}

/// Arguments or a block after a call.
pub(super) fn after_call(written: &str, name: &str, (span, statement): (Span, &str)) -> Diagnostic {
    if let Some(foreign) = foreign::statement(statement, span.range().start) {
        return foreign.diagnostic();
    }
    diagnostic!(Call, span, "`{written}` is a call, and nothing may follow a call";
        help: "the `def` decides how long it takes; after the name of a command, write a space: `{name} …`")
}

/// A second start time after a `;`.
pub(super) fn late_start(span: Span) -> Diagnostic {
    diagnostic!(Joined, span, "a start time applies to the whole line, so it comes first";
        help: "put this command on a line of its own")
}

/// `at servo 1 1500`: the command was read as the name of a mark.
pub(super) fn no_time(word: &str, span: Span) -> Diagnostic {
    if word == "beat" {
        return diagnostic!(StartTime, span, "`at` needs a time before the command"; help: "write `at bar 1 beat 3 …`");
    }
    diagnostic!(StartTime, span, "`at` needs a time before the command"; help: "for example `at 0.5s {word} …`")
}

/// `at 1s` alone, or `at stop`.
pub(super) fn no_command(written: &str, span: Span) -> Diagnostic {
    diagnostic!(StartTime, span, "this line has a start time, but no command, or the reverse";
        help: "write both on one line: `{written} stop`")
}

/// `left:` alone.
pub(super) fn no_command_for(robot: &str, span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "the command for this robot is missing";
        help: "write the command on the same line: `{robot}: stop`")
}

/// What passed the scan and still cannot be read at all, which should never happen.
pub(super) fn unparsable(at: usize) -> Diagnostic {
    diagnostic!(Syntax, Span::new(at, at + 1), "this cannot be read";
        help: "write one command per line, such as `servo 1 1500`")
}

/// `a < b < c`.
pub(super) fn chained(span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "comparisons cannot be chained"; help: "write `a < b and b < c`")
}

/// `max(a = 1)`.
pub(super) fn named_in_a_function(name: &str, span: Span) -> Diagnostic {
    diagnostic!(Call, span, "the arguments of `{name}` have no names";
        help: "write the values in order; only a call of a `def` takes names")
}

/// `()`.
pub(super) fn empty_parentheses(span: Span) -> Diagnostic {
    diagnostic!(Syntax, span, "these parentheses are empty"; help: "write a calculation, such as `(1500us + 200us)`")
}

/// `use lib/phrases.motion`; `whole` is the statement.
pub(super) fn unquoted_file(name: &str, whole: Span) -> Diagnostic {
    diagnostic!(Syntax, whole, "the name of a file needs quotation marks"; write: whole => "use \"{name}\"")
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
