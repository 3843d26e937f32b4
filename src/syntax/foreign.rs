//! The one table of what users write as in other languages, or as in English, and what to write instead.

use std::ops::Range;

use super::pattern;
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;

/// One row of the table.
struct Row {
    place: Place,
    /// How it is written there; for a statement a [`pattern`].
    written: &'static str,
    /// The language; empty for English.
    origin: &'static str,
    /// What to write instead, with the holes of the pattern; empty if nothing does the same.
    write: &'static str,
    /// What else the help says.
    note: &'static str,
    /// Whether `write` is only an example.
    is_example: bool,
}

/// Where it is written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Statement,
    Comment,
    Operator,
    Value,
    Easing,
}

const fn row(place: Place, written: &'static str, origin: &'static str, write: &'static str) -> Row {
    Row { place, written, origin, write, note: "", is_example: false }
}

/// A whole statement, without its block.
const fn line(written: &'static str, origin: &'static str, write: &'static str) -> Row {
    row(Place::Statement, written, origin, write)
}

/// A statement that nothing replaces.
const fn without(written: &'static str, origin: &'static str, note: &'static str) -> Row {
    Row { note, ..line(written, origin, "") }
}

/// A comment, alone or after a command. It is corrected only where it starts a line: `a // 2` may well be a division.
const fn comment(written: &'static str, origin: &'static str, write: &'static str) -> Row {
    row(Place::Comment, written, origin, write).note("a comment starts with `#`")
}

/// An operator; with `<a>` and `<b>`, its operands are replaced, too.
const fn operator(written: &'static str, origin: &'static str, write: &'static str) -> Row {
    row(Place::Operator, written, origin, write)
}

const fn value(written: &'static str, origin: &'static str, write: &'static str) -> Row {
    row(Place::Value, written, origin, write)
}

const fn easing(written: &'static str, origin: &'static str, write: &'static str) -> Row {
    row(Place::Easing, written, origin, write)
}

impl Row {
    const fn note(self, note: &'static str) -> Row {
        Row { note, ..self }
    }

    const fn example(self) -> Row {
        Row { is_example: true, ..self }
    }
}

const NO_LOOP: &str =
    "a script always ends: write `repeat 4 { … }`, or play it again and again with `play --loop forever`";
const NO_G_CODE: &str = "G-code is not read; write one command per line, such as `servo 1 1500`";
const NO_JUMP: &str = "a block always runs to its end; put what depends on a condition in an `if`";
const NO_IMPORT: &str = "remove it: `wait` and the functions are part of the language";

/// The rows. The first one that matches counts.
const ROWS: &[Row] = &[
    // Time.
    line("time.sleep(<seconds>)", "Python", "wait <seconds>"),
    line("await asyncio.sleep(<seconds>)", "Python", "wait <seconds>"),
    line("sleep(<seconds>)", "Python", "wait <seconds>"),
    line("sleep <seconds>", "shell", "wait <seconds>"),
    line("usleep(<micros>)", "C", "wait <micros>"),
    line("delay(<millis>)", "Arduino", "wait <millis>"),
    line("delayMicroseconds(<micros>)", "Arduino", "wait <micros>"),
    line("delay <millis>", "", "wait <millis>"),
    line("wait(<seconds>)", "Python", "wait <seconds>"),
    line("pause(<seconds>)", "", "wait <seconds>"),
    line("pause <seconds>", "", "wait <seconds>"),
    line("wait for <time>", "", "wait <time>"),
    line("after <time> <rest>", "", "+<time> <rest>"),
    line("in <time> <rest>", "", "+<time> <rest>"),
    line("after <time>: <rest>", "", "+<time> <rest>"),
    line("at <time>: <rest>", "", "at <time> <rest>").note("remove the `:`"),
    line("at <time>, <rest>", "", "at <time> <rest>").note("remove the `,`"),
    line("@<time> <rest>", "", "at <time> <rest>"),
    line("<time>: <rest>", "", "at <time> <rest>"),
    line("every <time> <rest>", "", "repeat 4 every <time> { <rest> }").example(),
    line("every <time>", "", "repeat 4 every <time> { … }"),
    line("then <rest>", "", "<rest>").note("lines run one after another"),
    // What is shown.
    line("print(<text>)", "Python", "say <text>"),
    line("print(<name>)", "Python", "say \"{<name>}\""),
    line("print <text>", "Python", "say <text>"),
    line("printf(<text>)", "C", "say <text>"),
    line("puts(<text>)", "C", "say <text>"),
    line("println(<text>)", "Java", "say <text>"),
    line("Serial.println(<text>)", "Arduino", "say <text>"),
    line("Serial.print(<text>)", "Arduino", "say <text>"),
    line("console.log(<text>)", "JavaScript", "say <text>"),
    line("echo <text>", "shell", "say <text>"),
    line("echo <any>", "shell", "say \"<any>\""),
    line("log(<text>)", "", "say <text>"),
    line("say(<text>)", "Python", "say <text>"),
    line("say f<quoted>", "Python", "say <quoted>").note("remove the `f`"),
    line("say '<any>'", "Python", "say \"<any>\""),
    // Loops.
    line("for <name> in range(<count>):", "Python", "repeat <count> as <name> { … }"),
    line("for <name> in range(<from>, <to>):", "Python", "repeat (<to> - <from>) as <name> { … }"),
    line("for (<type> <name> = 0; <any> < <count>; <more>)", "C", "repeat <count> as <name> { … }"),
    line("for (<any>)", "C", "repeat 4 as i { … }").example(),
    line("for <name> in 0..<count>", "Rust", "repeat <count> as <name> { … }"),
    line("for <name> = 1, <count> do", "Lua", "repeat <count> as <name> { … }"),
    line("for <digits> times", "", "repeat <digits> { … }"),
    line("for <any>:", "Python", "repeat 4 as i { … }").example(),
    line("for <any>", "", "repeat 4 as i { … }").example(),
    line("repeat(<count>)", "", "repeat <count> { … }"),
    line("repeat <count>: <rest>", "Python", "repeat <count> { <rest> }"),
    line("repeat <count>:", "Python", "repeat <count> { … }"),
    line("loop <digits> times", "", "repeat <digits> { … }"),
    line("loop <digits>", "", "repeat <digits> { … }"),
    without("while <any>", "", NO_LOOP),
    without("while(<any>)", "", NO_LOOP),
    without("until <any>", "", NO_LOOP),
    without("do <any>", "", NO_LOOP),
    without("loop <any>", "", NO_LOOP),
    without("forever <any>", "", NO_LOOP),
    without("repeat forever <any>", "", NO_LOOP),
    without("break", "", NO_JUMP),
    without("continue", "", NO_JUMP),
    without("return <any>", "", NO_JUMP),
    without("goto <any>", "", NO_JUMP),
    // Blocks.
    line("def <name>(<any>):", "Python", "def <name>(<any>) { … }"),
    line("def <name>:", "Python", "def <name>() { … }"),
    line("function <name>(<any>)", "JavaScript", "def <name>(<any>) { … }"),
    line("fn <name>(<any>)", "Rust", "def <name>(<any>) { … }"),
    line("func <name>(<any>)", "Go", "def <name>(<any>) { … }"),
    line("void <name>(<any>)", "C", "def <name>() { … }"),
    line("phrase <name>(<any>)", "", "def <name>(<any>) { … }"),
    line("macro <name>(<any>)", "", "def <name>(<any>) { … }"),
    line("sub <name>(<any>)", "", "def <name>(<any>) { … }"),
    line("proc <name>(<any>)", "", "def <name>(<any>) { … }"),
    line("procedure <name>(<any>)", "", "def <name>(<any>) { … }"),
    line("function <any>", "", "def nod() { … }").example(),
    line("fn <any>", "", "def nod() { … }").example(),
    line("if <condition>:", "Python", "if <condition> { … }"),
    line("if <condition> then", "Lua", "if <condition> { … }"),
    line("elif <condition>:", "Python", "else if <condition> { … }"),
    line("elif <condition>", "Python", "else if <condition>"),
    line("elsif <condition>", "Ruby", "else if <condition>"),
    line("elseif <condition>", "Lua", "else if <condition>"),
    line("else if <condition>:", "Python", "else if <condition> { … }"),
    line("else:", "Python", "else { … }"),
    line("together:", "Python", "together { … }"),
    line("switch <any>", "C", "if a == 1 { … } else { … }").example(),
    line("match <any>", "Rust", "if a == 1 { … } else { … }").example(),
    without("pass", "Python", "remove it; an empty block is `{ }`"),
    without("end", "", "a block ends with `}`"),
    without("endif", "", "a block ends with `}`"),
    without("fi", "shell", "a block ends with `}`"),
    without("done", "shell", "a block ends with `}`"),
    line("parallel <any>", "", "together { … }").example(),
    line("both <any>", "", "together { … }").example(),
    line("sync <any>", "", "together { … }").example(),
    without("import time", "Python", NO_IMPORT),
    without("import math", "Python", NO_IMPORT),
    without("import random", "Python", NO_IMPORT),
    without("from time import <any>", "Python", NO_IMPORT),
    without("from math import <any>", "Python", NO_IMPORT),
    without("from random import <any>", "Python", NO_IMPORT),
    line("import <name>", "Python", "use \"<name>.motion\""),
    line("from <name> import <any>", "Python", "use \"<name>.motion\""),
    line("import <text>", "JavaScript", "use <text>"),
    line("include <text>", "C", "use <text>"),
    line("require(<text>)", "Lua", "use <text>"),
    // Values.
    line("let mut <name> = <value>", "Rust", "let <name> = <value>"),
    line("var <name> = <value>", "JavaScript", "let <name> = <value>"),
    line("const <name> = <value>", "JavaScript", "let <name> = <value>"),
    line("local <name> = <value>", "Lua", "let <name> = <value>"),
    line("int <name> = <value>", "C", "let <name> = <value>"),
    line("float <name> = <value>", "C", "let <name> = <value>"),
    line("double <name> = <value>", "C", "let <name> = <value>"),
    line("bool <name> = <value>", "C", "let <name> = <value>"),
    line("auto <name> = <value>", "C", "let <name> = <value>"),
    line("<name> := <value>", "Go", "let <name> = <value>"),
    line("let <name> := <value>", "Go", "let <name> = <value>"),
    line("var <name>", "JavaScript", "let <name> = 0").example(),
    without("<name>++", "C", "a value never changes: in a `repeat`, count with `as i`, as in `repeat 4 as i { … }`"),
    without("++<name>", "C", "a value never changes: in a `repeat`, count with `as i`, as in `repeat 4 as i { … }`"),
    line("<name> += <value>", "Python", "let <name>_2 = <name> + <value>")
        .note("a value never changes: name a new one")
        .example(),
    line("<name> -= <value>", "Python", "let <name>_2 = <name> - <value>")
        .note("a value never changes: name a new one")
        .example(),
    line("<command> += <value>", "", "<command> (a + <value>)")
        .note("there are no relative moves: give the value a name, `let a = 1500us`, and write the sum")
        .example(),
    line("<command> -= <value>", "", "<command> (a - <value>)")
        .note("there are no relative moves: give the value a name, `let a = 1500us`, and write the difference")
        .example(),
    line("<command> ease cubic-bezier(<any>)", "CSS", "<command> ease in-out-sine").example(),
    line("<command> ease steps(<any>)", "CSS", "<command> ease linear").example(),
    // G-code.
    line("G4 P<millis>", "G-code", "wait <millis>"),
    line("G4 S<seconds>", "G-code", "wait <seconds>"),
    without("G<digits> <any>", "G-code", NO_G_CODE),
    without("M<digits> <any>", "G-code", NO_G_CODE),
    without("N<digits> <any>", "G-code", NO_G_CODE),
    // Comments.
    comment("// <any>", "C", "# <any>"),
    comment("/* <any> */", "C", "# <any>"),
    comment("/* <any>", "C", "# <any>").note("a comment starts with `#`, and ends with its line").example(),
    comment("-- <any>", "Lua", "# <any>"),
    comment("rem <any>", "BASIC", "# <any>"),
    comment("<command> // <any>", "C", "<command>  # <any>").example(),
    comment("<command> /* <any> */", "C", "<command>  # <any>").example(),
    comment("<command> -- <any>", "Lua", "<command>  # <any>").example(),
    // Operators.
    operator("!==", "JavaScript", "not (<a> == <b>)"),
    operator("!=", "C", "not (<a> == <b>)"),
    operator("<>", "BASIC", "not (<a> == <b>)"),
    operator("===", "JavaScript", "<a> == <b>"),
    operator("&&", "C", "and"),
    operator("||", "C", "or"),
    operator("&", "C", "and").note("to start two commands together, write `;`; in a condition").example(),
    operator("|", "C", "or"),
    operator("!", "C", "not "),
    operator("→", "", "->"),
    // Values.
    value("True", "Python", "true"),
    value("False", "Python", "false"),
    value("TRUE", "C", "true"),
    value("FALSE", "C", "false"),
    value("PI", "C", "3.14159265358979"),
    value("pi", "Python", "3.14159265358979"),
    // Easings. Their curves are similar, not equal.
    easing("ease", "CSS", "in-out-sine").example(),
    easing("ease-in", "CSS", "in-sine").example(),
    easing("ease-out", "CSS", "out-sine").example(),
    easing("ease-in-out", "CSS", "in-out-sine").example(),
    easing("smooth", "", "in-out-sine").example(),
    easing("smoothstep", "GLSL", "in-out-sine").example(),
    easing("none", "", "linear"),
    easing("swing", "jQuery", "in-out-sine").example(),
    easing("in", "", "in-sine").example(),
    easing("out", "", "out-sine").example(),
    easing("in-out", "", "in-out-sine").example(),
];

/// A statement as it is written in another language, and what to write instead.
pub(crate) struct Foreign {
    /// The language; empty for English.
    pub(crate) origin: &'static str,
    /// What was written, shortened.
    shown: String,
    /// All of it, but for its block.
    span: Span,
    pub(crate) help: String,
    /// The text that replaces it, if it is certain.
    fix: Option<String>,
    /// The same if that is certain only at the start of a line: a comment.
    comment: Option<String>,
}

impl Foreign {
    /// The diagnostic of it, under its own code.
    pub(crate) fn diagnostic(self) -> Diagnostic {
        let Foreign { shown, origin, span, .. } = &self;
        let diagnostic = if origin.is_empty() {
            diagnostic!(Syntax, *span, "`{shown}` is not a statement"; help: "{}", self.help)
        } else {
            diagnostic!(ForeignSyntax, *span, "`{shown}` is {origin} syntax"; help: "{}", self.help)
        };
        self.fixed(diagnostic)
    }

    /// The same where only spaces precede it in its line.
    pub(super) fn at_line_start(self) -> Foreign {
        Foreign { fix: self.fix.or(self.comment), comment: None, ..self }
    }

    /// Another diagnostic of the same statement, with its correction.
    pub(crate) fn fixed(self, diagnostic: Diagnostic) -> Diagnostic {
        match self.fix {
            Some(fix) => diagnostic.fix(self.span, fix),
            None => diagnostic,
        }
    }
}

/// The statement that begins with this text, which begins at `start`, if the table has it.
pub(crate) fn statement(text: &str, start: usize) -> Option<Foreign> {
    let statement = head(text);
    let tight = without_space(statement).and_then(|statement| search(&statement));
    let (row, write) = tight.or_else(|| search(statement))?;
    let help = match (write.as_str(), row.note) {
        ("", note) => note.to_owned(),
        (write, "") => format!("write `{write}`"),
        (write, note) if note.ends_with("write") => format!("{note} `{write}`"),
        (write, note) => format!("{note}: `{write}`"),
    };
    let is_certain = !write.is_empty() && !row.is_example && !row.write.contains('…');
    let fix = is_certain.then_some(write);
    // A comment of one line ends with the line, so nothing may follow a `*/`.
    let is_whole = text.lines().next().is_some_and(|line| line.trim() == statement);
    let ends = |write: &String| !statement.starts_with("/*") || (is_whole && !write.contains("*/"));
    let (fix, comment) = if row.place == Place::Comment { (None, fix.filter(ends)) } else { (fix, None) };
    Some(Foreign {
        origin: row.origin,
        shown: shown(statement),
        span: Span::new(start, start + statement.len()),
        help,
        fix,
        comment,
    })
}

/// The first row that matches a statement, and what to write instead.
fn search(statement: &str) -> Option<(&'static Row, String)> {
    let mut rows = ROWS.iter().filter(|row| matches!(row.place, Place::Statement | Place::Comment));
    rows.find_map(|row| Some((row, pattern::fill(row.write, &pattern::find(row.written, statement)?))))
}

/// `print ("x")` as `print("x")`. After a word of this language, such as `wait (a + 1s)`, the parentheses contain an argument.
fn without_space(statement: &str) -> Option<String> {
    let (word, rest) = statement.split_once(" (")?;
    let is_ours = matches!(word, "wait" | "say" | "repeat" | "if" | "else if" | "at");
    (!is_ours && !word.contains(' ')).then(|| format!("{word}({rest}"))
}

/// The value of a name in another language.
pub(crate) fn value_named(name: &str) -> Option<&'static str> {
    ROWS.iter().find(|row| row.place == Place::Value && row.written == name).map(|row| row.write)
}

/// The easing with this name in another language: one of the table, or `easeInOutSine`, `InOutSine`, `sine.inOut`.
pub(crate) fn easing_named(name: &str) -> Option<String> {
    if let Some(row) = ROWS.iter().find(|row| row.place == Place::Easing && row.written.eq_ignore_ascii_case(name)) {
        return Some(row.write.to_owned());
    }
    // Letters alone, without `ease`.
    let letters: String = name.chars().filter(char::is_ascii_alphabetic).map(|c| c.to_ascii_lowercase()).collect();
    let letters = letters.strip_prefix("ease").unwrap_or(&letters);
    [("inout", "in-out"), ("in", "in"), ("out", "out")].into_iter().find_map(|(direction, write)| {
        let curve = letters.strip_prefix(direction).or(letters.strip_suffix(direction))?;
        let curve = match curve {
            "" | "sin" => "sine",
            "quadratic" => "quad",
            "exponential" => "expo",
            "circular" => "circ",
            curve => curve,
        };
        Some(format!("{write}-{curve}"))
    })
}

/// A number with an exponent, such as `1e-1s`, written without it.
pub(crate) fn without_exponent(text: &str) -> Option<String> {
    let (digits, rest) = text.split_once(['e', 'E'])?;
    let (sign, rest) = match rest.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, rest.strip_prefix('+').unwrap_or(rest)),
    };
    let (exponent, unit) = rest.split_at_checked(rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len()))?;
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty()
        || !is_number(whole)
        || !is_number(fraction)
        || !unit.bytes().all(|byte| byte.is_ascii_alphabetic())
    {
        return None;
    }
    let exponent = sign * exponent.parse::<i32>().ok().filter(|exponent| *exponent <= 12)?;
    // Enough zeros on both sides, and the point moved.
    let point = usize::try_from(i32::try_from(whole.len()).ok()? + 12 + exponent).ok()?;
    let all = format!("{:0>12}{whole}{fraction}{:0<12}", "", "");
    let (whole, fraction) = all.split_at_checked(point)?;
    let (whole, fraction) = (whole.trim_start_matches('0'), fraction.trim_end_matches('0'));
    let whole = if whole.is_empty() { "0" } else { whole };
    let point = if fraction.is_empty() { "" } else { "." };
    Some(format!("{whole}{point}{fraction}{unit}"))
}

/// An operator of another language.
pub(super) struct ForeignOperator {
    pub(super) written: &'static str,
    pub(super) help: String,
    /// What is replaced of its line, and by what, if that is certain.
    pub(super) fix: Option<(Range<usize>, String)>,
}

/// The operator that begins `text`, which follows `before` in its line.
pub(super) fn operator_at(text: &str, before: &str) -> Option<ForeignOperator> {
    let row = ROWS.iter().find(|row| row.place == Place::Operator && text.starts_with(row.written))?;
    let (written, at) = (row.written, before.len());
    let after = text.get(written.len()..)?;
    if !row.write.contains("<a>") {
        let note = if row.note.is_empty() { String::new() } else { format!("{}, ", row.note) };
        let help = format!("{note}write `{}`", row.write.trim_end());
        let fix = (!row.is_example).then(|| (at..at + written.len(), row.write.to_owned()));
        return Some(ForeignOperator { written, help, fix });
    }
    let (from, to) = (left_operand(before), right_operand(after));
    let (a, b) = (before.get(from..)?.trim(), after.get(..to)?.trim());
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let write = row.write.replace("<a>", a).replace("<b>", b);
    let help = format!("write `{write}`");
    Some(ForeignOperator { written, help, fix: Some((from..at + written.len() + to, write)) })
}

/// Where the operand at the end of a line begins.
fn left_operand(text: &str) -> usize {
    let ends = ["if ", "and ", "or ", "not ", "(", ",", "= ", "{", "&& ", "|| "];
    let begin = ends.iter().filter_map(|end| Some(text.rfind(end)? + end.len())).max().unwrap_or(0);
    begin + text.get(begin..).map_or(0, |rest| rest.len() - rest.trim_start().len())
}

/// Where the operand at the start of a line ends.
fn right_operand(text: &str) -> usize {
    let starts = [" and ", " or ", ")", ",", "{", "#", " && ", " || ", "\n", "\r"];
    let end = starts.iter().filter_map(|start| text.find(start)).min().unwrap_or(text.len());
    text.get(..end).map_or(end, |operand| operand.trim_end().len())
}

/// A statement up to its block, its end, or a comment.
fn head(text: &str) -> &str {
    let (mut depth, mut quote, mut end) = (0_usize, None, text.len());
    for (at, c) in text.char_indices() {
        match (quote, c) {
            (_, '\n') => {
                end = at;
                break;
            }
            (Some(open), c) => quote = if c == open { None } else { Some(open) },
            (None, '"' | '\'') => quote = Some(c),
            (None, '(') => depth += 1,
            (None, ')') => depth = depth.saturating_sub(1),
            (None, '#' | '{' | '}' | ';') if depth == 0 => {
                end = at;
                break;
            }
            _ => {}
        }
    }
    text.get(..end).unwrap_or(text).trim()
}

/// What a message shows of a statement.
fn shown(statement: &str) -> String {
    const MOST: usize = 40;
    match statement.char_indices().nth(MOST) {
        Some((end, _)) => statement.get(..end).unwrap_or_default().to_owned() + "…",
        None => statement.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_written_out() {
        for (text, wanted) in [
            ("1e-1s", Some("0.1s")),
            ("1e3s", Some("1000s")),
            ("1.5E2", Some("150")),
            ("12.5e-3ms", Some("0.0125ms")),
            ("1e99", None),
            ("e3", None),
            ("1500us", None),
        ] {
            assert_eq!(without_exponent(text).as_deref(), wanted, "{text}");
        }
    }

    #[test]
    fn each_hole_of_a_line_is_in_its_pattern() {
        for row in ROWS.iter().filter(|row| matches!(row.place, Place::Statement | Place::Comment)) {
            let holes = row.write.split('<').skip(1).filter_map(|rest| rest.split_once('>'));
            for (hole, _) in holes {
                assert!(row.written.contains(&format!("<{hole}>")), "{} has no <{hole}>", row.written);
            }
        }
    }

    #[test]
    fn easings_of_other_languages_are_found() {
        for (name, wanted) in [
            ("ease-in-out", Some("in-out-sine")),
            ("easeInOutSine", Some("in-out-sine")),
            ("easeOutQuad", Some("out-quad")),
            ("InOutBack", Some("in-out-back")),
            ("sine.inOut", Some("in-out-sine")),
            ("in-circular", Some("in-circ")),
            ("wobble", None),
        ] {
            assert_eq!(easing_named(name).as_deref(), wanted, "{name}");
        }
    }
}
