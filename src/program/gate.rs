//! Gates: `wait until` and `wait go`, which stop the clock of a script until something happens.

use std::fmt;

use super::arguments::Arguments;
use super::evaluator::Evaluator;
use super::expect::{self, Criterion};
use super::say;
use super::suggest::suggest;
use super::time::Time;
use super::words::{self, Operation};
use crate::board::Board;
use crate::diagnostic::{bail, escaped};
use crate::syntax::{Command, Item, Value, ValueKind};

/// A gate.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    /// What opens it.
    pub awaited: Awaited,
    /// How long it waits, in real time; `None` without a limit.
    pub within: Option<Time>,
    /// Whether the run continues after that time. Otherwise it fails.
    pub continues: bool,
    /// What the operator is asked, or the reason that the script gives.
    pub text: Option<String>,
}

/// What opens a gate.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Awaited {
    /// A report that meets a criterion.
    Report(Criterion),
    /// The operator.
    Go,
    /// Reports of other robots: the line with their names, such as `left: wait until yaw > 90deg within 4s`.
    Others(String),
}

impl Gate {
    /// A text as it is written between quotation marks, with invisible characters escaped. In a question, braces are doubled.
    fn quoted(&self, text: &str) -> String {
        let text = text.replace('\\', "\\\\").replace('"', "\\\"");
        let text = if self.awaited == Awaited::Go { text.replace('{', "{{").replace('}', "}}") } else { text };
        escaped(&text)
    }

    /// The same without its text.
    pub(crate) fn without_text(&self) -> Gate {
        Gate { text: None, ..self.clone() }
    }

    /// A gate as [`Display`](fmt::Display) writes it; `None` for anything else.
    pub(crate) fn parse(board: &Board, line: &str) -> Option<Gate> {
        if let Some((names, _)) = line.split_once(": wait until ") {
            let is_name = |name: &str| !name.is_empty() && words::is_name(name);
            return names.split(", ").all(is_name).then(|| Gate::of_others(line.to_owned(), None));
        }
        let rest = line.strip_prefix("wait ")?;
        let (awaited, mut rest) = match rest.strip_prefix("until ") {
            Some(rest) => Criterion::parse(board, rest).map(|(criterion, rest)| (Awaited::Report(criterion), rest))?,
            None => (Awaited::Go, rest.strip_prefix("go")?),
        };
        let is_go = awaited == Awaited::Go;
        let mut text = if is_go { quoted(&mut rest).ok()? } else { None };
        text = text.map(|text| text.replace("{{", "{").replace("}}", "}"));
        let mut within = None;
        if let Some(limit) = rest.strip_prefix(" within ") {
            let (time, more) = limit.split_at(limit.find(' ').unwrap_or(limit.len()));
            (within, rest) = (Some(Time::parse(time)?), more);
        }
        let continues = rest.starts_with(" or continue");
        rest = rest.strip_prefix(" or continue").unwrap_or(rest);
        if !is_go {
            text = quoted(&mut rest).ok()?;
        }
        let is_limited = within.is_some_and(|within| within > Time::ZERO);
        let is_complete = is_limited || within.is_none() && is_go && !continues;
        let gate = Gate { awaited, within, continues, text };
        (rest.is_empty() && is_complete && gate.to_string() == line).then_some(gate)
    }

    /// The unit of the value that it waits for.
    pub fn unit(&self) -> &str {
        self.criterion().map_or("", |criterion| criterion.measured.unit())
    }

    /// The criterion for reports of this robot, if it waits for one.
    pub fn criterion(&self) -> Option<&Criterion> {
        match &self.awaited {
            Awaited::Report(criterion) => Some(criterion),
            Awaited::Go | Awaited::Others(_) => None,
        }
    }

    /// Whether it waits for the operator.
    pub fn is_go(&self) -> bool {
        self.awaited == Awaited::Go
    }

    /// The gate of a line that is for other robots. In a timeline it has no limit: that is in the line.
    pub(crate) fn of_others(line: String, within: Option<Time>) -> Gate {
        Gate { awaited: Awaited::Others(line), within, continues: false, text: None }
    }
}

/// As a script writes it: `wait until turned > 90deg within 4s or continue`.
impl fmt::Display for Gate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let quoted = |f: &mut fmt::Formatter<'_>| match &self.text {
            Some(text) => write!(f, " \"{}\"", self.quoted(text)),
            None => Ok(()),
        };
        match &self.awaited {
            Awaited::Others(line) => return f.write_str(line),
            Awaited::Report(criterion) => write!(f, "wait until {criterion}")?,
            Awaited::Go => {
                f.write_str("wait go")?;
                quoted(f)?;
            }
        }
        if let Some(within) = self.within {
            write!(f, " within {within}")?;
        }
        if self.continues {
            f.write_str(" or continue")?;
        }
        if self.criterion().is_some() { quoted(f) } else { Ok(()) }
    }
}

/// Takes a string in quotation marks off the front, if there is one; `Err` if it has no end.
fn quoted(rest: &mut &str) -> Result<Option<String>, ()> {
    let Some(inner) = rest.strip_prefix(" \"") else { return Ok(None) };
    let mut text = String::new();
    let mut chars = inner.chars();
    loop {
        match chars.next().ok_or(())? {
            '"' => break,
            '\\' => match chars.next().ok_or(())? {
                'u' => {
                    let (code, rest) =
                        chars.as_str().strip_prefix('{').and_then(|rest| rest.split_once('}')).ok_or(())?;
                    let code = u32::from_str_radix(code, 16).map_err(drop)?;
                    text.push(char::from_u32(code).ok_or(())?);
                    chars = rest.chars();
                }
                c => text.push(c),
            },
            c => text.push(c),
        }
    }
    *rest = chars.as_str();
    Ok(Some(text))
}

/// Reports a `wait` that looks like a gate: `wait untill yaw > 90deg`, `wait "ready?"`.
pub(super) fn misspelled(command: &Command<'_>, eval: &mut Evaluator<'_, '_>) -> Option<()> {
    let Some(argument) = command.arguments.first() else { return Some(()) };
    let span = argument.span;
    if let Item::One(Value { kind: ValueKind::Text(_), .. }) = argument.item {
        bail!(eval, InvalidArgument, span, "`wait` needs a time, not a string";
            help: "to wait for the operator, write `wait go {}`", eval.written(span); fix: span => "go {}", eval.written(span));
    }
    let word = argument.bare_word().filter(|word| eval.scope.value(word.text).is_none());
    let near = word.and_then(|word| suggest(&word.text.to_lowercase(), [words::UNTIL, "go"]));
    let Some(near) = near else { return Some(()) };
    let line = eval.rewritten(command.span, &[(span, near.to_owned())]);
    bail!(eval, UnknownName, span, "unknown name `{}`", eval.written(span); help: "did you mean `{line}`?")
}

/// Reads the arguments of a gate, after `wait`.
pub(super) fn gate(args: &mut Arguments<'_, '_, '_, '_>, does: Operation) -> Option<Gate> {
    // `until` or `go`.
    args.next_argument()?;
    let is_until = does == Operation::WaitUntil;
    let awaited = if is_until { Awaited::Report(expect::criterion(args)?) } else { Awaited::Go };
    let asked = args.next_value().filter(|value| !is_until && matches!(value.kind, ValueKind::Text(_)));
    let asked = match asked {
        Some(value) => {
            args.next_argument()?;
            let text = say::say(value, args.eval)?;
            if text.is_live() {
                bail!(args.eval, InvalidArgument, value.span, "a question shows no values that the board reports";
                    help: "show them with a `say` on the line before: `say \"{{voltage}}\"`");
            }
            Some(text.to_string())
        }
        None => None,
    };
    if !is_until && asked.is_none() {
        unquoted(args)?;
    }
    let limit = args.span_of("within");
    let or = args.next_word().filter(|word| word.text == "or");
    let continues = continues(args)?;
    let why = if is_until { expect::why(args).ok()? } else { None };
    let has_why = why.is_some();
    let within = expect::within(args).ok()?.map(Time::in_whole_micros);
    let gate = Gate { awaited, within, continues, text: asked.or(why) };
    if let Some(word) = args.next_word().filter(|word| has_why && word.text == "or") {
        let whole = Gate { continues: true, ..gate };
        bail!(args.eval, UnexpectedArgument, word.span, "the reason comes last"; help: "write `{whole}`");
    }
    if let (Some(or), Some(limit)) = (or, limit)
        && or.span.start < limit.start
    {
        bail!(args.eval, UnexpectedArgument, or.span, "the time limit comes before `or continue`"; help: "write `{gate}`");
    }
    if within.is_none() && (is_until || continues) {
        let given = args.modified_by("for").and_then(|operand| Time::parse(args.eval.written(operand.span)));
        let whole = Gate { within: given.or_else(|| Time::parse("4s")), ..gate };
        bail!(args.eval, MissingArgument, args.command.span, "the time limit is missing";
            help: "write how long it may take: `{whole}`");
    }
    Some(gate)
}

/// Reports what follows `wait go` and is neither a string nor `or`: a time, or words without quotation marks.
fn unquoted(args: &mut Arguments<'_, '_, '_, '_>) -> Option<()> {
    let Some(value) = args.next_value() else { return Some(()) };
    let end = args.command.arguments.last().map_or(value.span, |last| last.span);
    match value.kind {
        ValueKind::Word("or" | "continue") => Some(()),
        ValueKind::Word(_) => {
            let words = value.span.to(end);
            let text = args.eval.written(words);
            bail!(args.eval, InvalidArgument, words, "the text of `wait go` needs quotation marks";
                help: "write `wait go \"{text}\"`")
        }
        ValueKind::Number(..) => {
            let text = args.eval.written(value.span);
            bail!(args.eval, UnexpectedArgument, value.span, "a time limit needs `within`"; write: value.span => "within {text}")
        }
        _ => Some(()),
    }
}

/// Reads `or continue`, if it is there.
fn continues(args: &mut Arguments<'_, '_, '_, '_>) -> Option<bool> {
    let next = args.next_word();
    if let Some(word) = next.filter(|word| word.text == "continue") {
        bail!(args.eval, MissingArgument, word.span, "`or` is missing before `continue`"; write: word.span => "or continue");
    }
    let Some(word) = next.filter(|word| word.text == "or") else { return Some(false) };
    args.next_argument()?;
    match args.next_word().filter(|word| word.text == "continue") {
        Some(_) => args.next_argument().map(|_| true),
        None => bail!(args.eval, MissingArgument, word.span, "`continue` is missing after `or`";
            help: "write `or continue`, or remove `or`"),
    }
}
