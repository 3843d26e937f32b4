//! Words for what cannot be read: what stands there, and what the user probably meant.

use crate::diagnostic::{Code, Diagnostic};
use crate::source::Span;

/// Text from the first character that fits nothing. `before` is the character right before it.
pub(super) fn unreadable(text: &str, start: usize, before: Option<char>) -> Diagnostic {
    let first = text.chars().next().unwrap_or(' ');
    let digit_beside =
        before.is_some_and(|c| c.is_ascii_digit()) || text.chars().nth(1).is_some_and(|c| c.is_ascii_digit());
    let help = match first {
        '.' if !digit_beside => "write a file's name between quotation marks: `use \"lib/phrases.motion\"`",
        '.' => "write digits on both sides of the point: `0.5`, not `.5` or `5.`",
        '\'' | '`' | '“' | '”' | '„' => "write texts between plain quotation marks: `\"text\"`",
        '/' => "a comment starts with `#`",
        '-' if text.starts_with("--") => "a comment starts with `#`",
        ',' => "arguments stand behind each other with a blank between them: `rocker x=10 z=50`, `wheels 8 -8 -8 8`",
        '!' => "write `not (a == b)` for different, and `not` for the opposite",
        '&' => "write `and`",
        '|' => "write `or`",
        '→' => "write the arrow as `->`",
        'b' if text.starts_with("beat") || text.starts_with("bar") => "multiply: `(n * 1 beat)`",
        '=' if text.starts_with("=+") || text.starts_with("= +") => "write a positive number without its `+`",
        '=' => {
            "a named argument is NAME=VALUE, such as `rocker x=10`, others have no `=`, such as `servo 1 1500`; to compare, write `==`"
        }
        ':' => "take the `:` away",
        '+' => "a line starts with the name of a command, `at TIME` or `+TIME`",
        '-' if text.starts_with("->") => "an arrow stands between two values, such as `0 -> 12`",
        '–' | '−' | '—' => "write the minus sign of your keyboard, `-`",
        '°' => "write degrees as `deg`: `90deg`",
        _ => "take it away; an argument is a number with its unit, a word, or a calculation in parentheses",
    };
    // Point at the first character; the rest may be fine.
    let span = Span::new(start, start + first.len_utf8());
    Diagnostic::new(Code::Syntax, span, format!("`{first}` cannot be read here"), help)
}

/// A calculation as an argument.
pub(super) fn lacks_parentheses(written: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        "a calculation as an argument needs parentheses around it",
        format!("write `({})`", on_one_line(written)),
    )
}

/// What was written, also where it breaks its line.
fn on_one_line(written: &str) -> String {
    let lines = written.lines().map(|line| line.split('#').next().unwrap_or_default());
    lines.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
}

/// Two arguments that touch.
pub(super) fn lacks_blank(first: &str, second: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        "a blank is missing between two arguments",
        format!("write `{0} {1}`, or `({0}{1})` for a calculation", on_one_line(first), on_one_line(second)),
    )
}

/// A `;` with nothing beside it.
pub(super) fn joins_nothing(span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::EmptyPlace,
        span,
        "`;` joins two commands, but one is missing here",
        "take the `;` away; a line ends by itself",
    )
}

/// Something on the line of a block that has ended.
pub(super) fn behind_a_block(text: &str, span: Span) -> Diagnostic {
    let help = if text.starts_with("else") {
        "put the `{` on the line of its `else`"
    } else {
        "put it on a line of its own, or a `;` before it to start both together"
    };
    Diagnostic::new(Code::Syntax, span, "a block ends its statement, but something stands behind it", help)
}

/// A line that starts with a time.
pub(super) fn starts_with_time(written: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        "a line starts with a word, not with a time",
        format!(
            "write `at {written} …` to start at that time, `+{written} …` to start so much later, or `wait {written}`"
        ),
    )
}

/// A line that starts with anything else that is no word.
pub(super) fn starts_with_no_word(span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        "a line starts with the name of a command",
        "write one command a line, such as `servo 1 1500`",
    )
}

/// Arguments or a block behind a call.
pub(super) fn behind_a_call(written: &str, name: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        format!("`{written}` is a call, and nothing stands behind a call"),
        format!("for a command, put a blank behind its name: `{name} …`"),
    )
}

/// A second start time behind a `;`.
pub(super) fn late_start(span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Joined,
        span,
        "a start time covers the whole line, so it stands first in it",
        "give this command a line of its own",
    )
}

/// `at servo 1 1500`: the command was read as the name of a mark.
pub(super) fn no_time(word: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::StartTime,
        span,
        "`at` needs a time before the command",
        format!("for example `at 0.5s {word} …`"),
    )
}

/// `at 1s` alone, or `at stop`.
pub(super) fn no_command(written: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::StartTime,
        span,
        "a start time and a command stand together, and one of them is missing",
        format!("write the command on the same line: `{written} stop`"),
    )
}

/// `left:` alone.
pub(super) fn no_command_for(robot: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        "a robot is named, but no command",
        format!("write the command on the same line: `{robot}: stop`"),
    )
}

/// What passed the scan and still cannot be read at all, which no script should manage.
pub(super) fn beyond_the_grammar(at: usize) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        Span::new(at, at + 1),
        "this cannot be read",
        "write one command a line, such as `servo 1 1500`",
    )
}

/// `a < b < c`.
pub(super) fn chained(span: Span) -> Diagnostic {
    Diagnostic::new(Code::Syntax, span, "comparisons do not chain", "write `a < b and b < c`")
}

/// `max(a = 1)`.
pub(super) fn named_in_a_function(name: &str, span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        format!("`{name}` takes no names in a calculation"),
        "write the values in their order; only calls of a `def` on a line of their own take names",
    )
}

/// `()`.
pub(super) fn nothing_inside(span: Span) -> Diagnostic {
    Diagnostic::new(
        Code::Syntax,
        span,
        "nothing stands inside these parentheses",
        "write a calculation, such as `(1500us + 200us)`",
    )
}
