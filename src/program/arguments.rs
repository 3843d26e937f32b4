//! What stands behind a command's name, taken piece by piece. Every mistake in it is reported, not only the first.

use crate::board::Ranged;
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::Span;
use crate::syntax::{Argument, Command, Item, Name, NumberShape, Value, ValueKind};

use super::commands::{self, Row};
use super::suggest::{list, suggest};
use super::time::Time;
use super::value::{self, Quantity};

/// The words that change how a command runs, each with one argument behind it.
const MODIFIERS: &[&str] = &["for", "over", "ease", "within"];

/// The arguments of one command that are not taken yet.
pub(super) struct Arguments<'a, 's> {
    /// The command's row in the table.
    pub(super) row: &'static Row,
    /// The command itself.
    pub(super) command: &'a Command<'s>,
    pub(super) diagnostics: &'a mut Diagnostics,
    positional: std::vec::IntoIter<&'a Argument<'s>>,
    named: Vec<&'a Argument<'s>>,
    modifiers: Vec<(Name<'s>, &'a Argument<'s>)>,
    /// Whether something is missing.
    incomplete: bool,
    /// How many errors there were before this command.
    errors_before: usize,
}

impl<'a, 's> Arguments<'a, 's> {
    /// Sorts the arguments; `None` where they cannot be, which is reported.
    pub(super) fn new(row: &'static Row, command: &'a Command<'s>, diagnostics: &'a mut Diagnostics) -> Option<Self> {
        if let Some(block) = &command.block {
            diagnostics.push(Diagnostic::new(
                Code::Arguments,
                Span { end: block.span.start + 1, ..block.span },
                format!("`{}` takes no block", row.name),
                "end the line before the `{`",
            ));
            return None;
        }
        let mut positional: Vec<&Argument<'_>> = Vec::new();
        let mut named: Vec<&Argument<'_>> = Vec::new();
        let mut modifiers: Vec<(Name<'_>, &Argument<'_>)> = Vec::new();
        let mut rest = command.arguments.iter();
        while let Some(argument) = rest.next() {
            let word = bare_word(argument);
            if let Some(word) = word.filter(|word| MODIFIERS.contains(&word.text)) {
                let Some(operand) = rest.next() else {
                    let example = if word.text == "ease" { "ease in-out-sine" } else { "for 2s" };
                    diagnostics.push(Diagnostic::new(
                        Code::Arguments,
                        word.span,
                        format!("something is missing behind `{}`", word.text),
                        format!("for example `{example}`"),
                    ));
                    return None;
                };
                if modifiers.iter().any(|(name, _)| name.text == word.text) {
                    diagnostics.push(Diagnostic::new(
                        Code::Arguments,
                        word.span,
                        format!("`{}` stands here twice", word.text),
                        "keep one of the two",
                    ));
                    return None;
                }
                modifiers.push((word, operand));
                continue;
            }
            if let (Some(word), Some(before)) = (word, positional.last().or(named.last()))
                && let Item::One(value) = before.item
                && let Some(diagnostic) = blank_before_unit(value, word)
            {
                diagnostics.push(diagnostic);
                return None;
            }
            match argument.name {
                None => positional.push(argument),
                Some(name) => {
                    if named.iter().any(|other| other.name.is_some_and(|other| other.text == name.text)) {
                        diagnostics.push(Diagnostic::new(
                            Code::Arguments,
                            argument.span,
                            format!("`{}` is given twice", name.text),
                            "keep one of the two",
                        ));
                        return None;
                    }
                    named.push(argument);
                }
            }
        }
        let errors_before = diagnostics.errors();
        Some(Arguments {
            row,
            command,
            diagnostics,
            positional: positional.into_iter(),
            named,
            modifiers,
            incomplete: false,
            errors_before,
        })
    }

    /// Reports everything that was not taken. `None` where there was anything.
    pub(super) fn finish(self) -> Option<()> {
        if self.incomplete {
            return None;
        }
        let usage = self.usage();
        let mut clean = true;
        // The first one too many is enough: the others often belong to it.
        if let Some(argument) = self.positional.as_slice().first() {
            clean = false;
            self.diagnostics.push(Diagnostic::new(
                Code::Arguments,
                argument.span,
                format!("`{}` takes no more arguments", self.row.name),
                self.meant(argument).unwrap_or_else(|| usage.clone()),
            ));
        }
        for argument in self.named {
            clean = false;
            let name = argument.name.map_or("", |name| name.text);
            self.diagnostics.push(Diagnostic::new(
                Code::Arguments,
                argument.span,
                format!("`{}` has no `{name}=`", self.row.name),
                usage.clone(),
            ));
        }
        for (word, operand) in self.modifiers {
            clean = false;
            let span = word.span.to(operand.span);
            self.diagnostics.push(match word.text {
                "over" if self.row.moves => value::not_yet(span, "a move with `over`"),
                taken => Diagnostic::new(
                    Code::Arguments,
                    span,
                    format!("`{}` takes no `{taken}`", self.row.name),
                    match (taken, number_text(operand)) {
                        ("for", Some(time)) => format!("give the time a line of its own: `wait {time}`"),
                        _ => usage.clone(),
                    },
                ),
            });
        }
        clean.then_some(())
    }

    /// What an argument that is one too many may have been meant for.
    fn meant(&self, argument: &Argument<'_>) -> Option<String> {
        if let Some(time) = number_text(argument).filter(|text| self.row.holds && text.ends_with(['s', 'm', 'h'])) {
            return Some(format!("write `for {time}` for how long it holds"));
        }
        let word = bare_word(argument)?.text;
        if commands::find(word).is_some() {
            return Some(format!("give `{word}` a line of its own, or put a `;` before it to start both together"));
        }
        suggest(word, MODIFIERS.iter().copied()).map(|near| format!("did you mean `{near}`?"))
    }

    /// The next argument without a name. Where none is left, that is reported.
    pub(super) fn next(&mut self) -> Option<Value<'s>> {
        let Some(argument) = self.positional.next() else {
            self.missing();
            return None;
        };
        self.one(argument)
    }

    /// Reports, once a command, that something is missing.
    pub(super) fn missing(&mut self) {
        let told = self.incomplete || self.diagnostics.errors() > self.errors_before;
        self.incomplete = true;
        // What is missing is often in what was wrong before.
        if told {
            return;
        }
        self.diagnostics.push(Diagnostic::new(
            Code::Arguments,
            self.command.span,
            format!("`{}` needs more than this", self.row.name),
            self.usage(),
        ));
    }

    /// How the command is written.
    pub(super) fn usage(&self) -> String {
        self.row.how()
    }

    /// Whether arguments without a name are left.
    pub(super) fn more(&self) -> bool {
        !self.positional.as_slice().is_empty()
    }

    /// The argument with this name, if it is given.
    pub(super) fn named(&mut self, name: &str) -> Option<&'a Argument<'s>> {
        let at = self.named.iter().position(|argument| argument.name.is_some_and(|given| given.text == name))?;
        Some(self.named.remove(at))
    }

    /// The time behind `for`: `Ok(None)` where there is none, `Err` where it is wrong, which is reported.
    pub(super) fn hold(&mut self) -> Result<Option<Time>, ()> {
        let Some(at) = self.modifiers.iter().position(|(word, _)| word.text == "for") else {
            return Ok(None);
        };
        let (word, operand) = self.modifiers.remove(at);
        let value = self.one(operand).ok_or(())?;
        let time = time(value, self.diagnostics).ok_or(())?;
        if time <= Time::ZERO {
            self.diagnostics.push(Diagnostic::new(
                Code::OutOfRange,
                word.span.to(value.span),
                "`for` needs a time above zero",
                "leave the command out, or write `stop`",
            ));
            return Err(());
        }
        Ok(Some(time))
    }

    /// The single value of an argument; arrows, ranges and lists are reported.
    pub(super) fn one(&mut self, argument: &Argument<'s>) -> Option<Value<'s>> {
        let diagnostic = match &argument.item {
            Item::One(value) => return Some(*value),
            Item::Arrow(..) => value::not_yet(argument.span, "a move from one value to another"),
            Item::Range(..) => {
                Diagnostic::new(Code::Arguments, argument.span, "one value is needed here, not a range", self.usage())
            }
            Item::List(list) => Diagnostic::new(
                Code::Arguments,
                argument.span,
                "one value is needed here, not a list",
                match list.as_slice() {
                    [
                        Value { kind: ValueKind::Number(_, whole), .. },
                        Value { kind: ValueKind::Number(_, rest), .. },
                    ] if whole.bytes().all(|byte| byte.is_ascii_digit()) && argument.name.is_none() => {
                        format!(
                            "write a decimal point as `{whole}.{rest}`, or a blank between two arguments: `{whole} {rest}`"
                        )
                    }
                    _ => "arguments stand behind each other with a blank between them, not a comma".to_owned(),
                },
            ),
            Item::Comparison(sign) => Diagnostic::new(
                Code::Arguments,
                argument.span,
                format!("`{}` compares, and nothing is compared here", sign.text),
                self.usage(),
            ),
        };
        self.diagnostics.push(diagnostic);
        None
    }

    /// A bare number in the range of `Ranged`, rounded to a whole one. `what` names it in messages.
    pub(super) fn ranged<const MIN: i32, const MAX: i32>(
        &mut self,
        value: Value<'s>,
        what: &str,
    ) -> Option<Ranged<MIN, MAX>> {
        let number = self.number(value, what)?;
        self.in_range(number, value.span, what, ["", ""])
    }

    /// A whole number in the range of `Ranged`: an index, a count or a byte is never rounded.
    pub(super) fn whole<const MIN: i32, const MAX: i32>(
        &mut self,
        value: Value<'s>,
        what: &str,
    ) -> Option<Ranged<MIN, MAX>> {
        let number = self.number(value, what)?;
        if number.fract() != 0.0 {
            self.diagnostics.push(Diagnostic::new(
                Code::NotWhole,
                value.span,
                format!("{what} is a whole number"),
                format!("write one from {MIN} to {MAX}"),
            ));
            return None;
        }
        self.in_range(number, value.span, what, ["", ""])
    }

    /// A byte: whole, 0-255 or 0x00-0xFF.
    pub(super) fn byte(&mut self, value: Value<'s>, what: &str) -> Option<u8> {
        let byte: Ranged<0, 255> = self.whole(value, what)?;
        u8::try_from(byte.get()).ok()
    }

    /// A pulse width: a bare number of microseconds, a time, or an angle from 0 to 180 degrees on 500-2500.
    pub(super) fn pulse<const MIN: i32, const MAX: i32>(
        &mut self,
        value: Value<'s>,
        what: &str,
        why: &str,
    ) -> Option<Ranged<MIN, MAX>> {
        let mut why = why.to_owned();
        let micros = match value::read(value, self.diagnostics)? {
            Quantity::Number(micros) => {
                if (0.0..=180.0).contains(&micros) {
                    why = format!("for an angle, write `{micros}deg`");
                }
                micros
            }
            // A pulse width is far below 2^53 ns wherever it is in range.
            #[expect(clippy::cast_precision_loss, reason = "exact in range")]
            Quantity::Time(time) => time.nanos() as f64 / 1_000.0,
            Quantity::Degrees(degrees) if (0.0..=180.0).contains(&degrees) => 500.0 + degrees / 180.0 * 2_000.0,
            Quantity::Degrees(_) => {
                self.diagnostics.push(Diagnostic::new(
                    Code::OutOfRange,
                    value.span,
                    "a servo turns from 0 to 180 degrees",
                    "write an angle from `0deg` to `180deg`, or a pulse width such as `1500us`",
                ));
                return None;
            }
            other => {
                self.wrong_unit(
                    value.span,
                    what,
                    other,
                    "write microseconds, such as `1500` or `1500us`, or degrees, such as `90deg`",
                );
                return None;
            }
        };
        self.in_range(micros, value.span, what, [" µs", &why])
    }

    /// A word out of `words`.
    pub(super) fn word(&mut self, value: Value<'s>, words: &[&'static str]) -> Option<&'static str> {
        let found = match value.kind {
            ValueKind::Word(word) | ValueKind::Text(word) | ValueKind::Number(_, word) if !value.negative => word,
            _ => "this",
        };
        if let Some(word) = words.iter().find(|&&word| word == found) {
            return Some(word);
        }
        let help = match suggest(found, words.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("write one of {}", list(words.iter().copied())),
        };
        self.diagnostics.push(Diagnostic::new(
            Code::Arguments,
            value.span,
            format!("`{}` does not know `{found}`", self.row.name),
            help,
        ));
        None
    }

    fn number(&mut self, value: Value<'s>, what: &str) -> Option<f64> {
        match value::read(value, self.diagnostics)? {
            Quantity::Number(number) => Some(number),
            other => {
                self.wrong_unit(value.span, what, other, "write the bare number");
                None
            }
        }
    }

    fn wrong_unit(&mut self, span: Span, what: &str, found: Quantity, help: &str) {
        self.diagnostics.push(Diagnostic::new(
            Code::Unit,
            span,
            format!("{what} is needed here, not {}", found.kind()),
            help,
        ));
    }

    fn in_range<const MIN: i32, const MAX: i32>(
        &mut self,
        number: f64,
        span: Span,
        what: &str,
        [unit, why]: [&str; 2],
    ) -> Option<Ranged<MIN, MAX>> {
        let checked = value::round(number).and_then(|number| Ranged::new(number).ok());
        if checked.is_none() {
            let because = if why.is_empty() { String::new() } else { format!("; {why}") };
            self.diagnostics.push(Diagnostic::new(
                Code::OutOfRange,
                span,
                format!("{what} is from {MIN} to {MAX}{unit}, and {number} is outside"),
                format!("write a value from {MIN} to {MAX}{because}"),
            ));
        }
        checked
    }
}

/// The text of an argument that is nothing but a number.
fn number_text<'s>(argument: &Argument<'s>) -> Option<&'s str> {
    match argument.item {
        Item::One(Value { kind: ValueKind::Number(_, text), .. }) if argument.name.is_none() => Some(text),
        _ => None,
    }
}

/// An argument that is nothing but a word.
fn bare_word<'s>(argument: &Argument<'s>) -> Option<Name<'s>> {
    match argument.item {
        Item::One(Value { kind: ValueKind::Word(text), negative: false, span }) if argument.name.is_none() => {
            Some(Name { text, span })
        }
        _ => None,
    }
}

/// `1 s` or `1 seconds` instead of `1s`.
pub(super) fn blank_before_unit(value: Value<'_>, word: Name<'_>) -> Option<Diagnostic> {
    let unit = value::unit_meant(word.text)?;
    let ValueKind::Number(NumberShape::Plain, number) = value.kind else {
        return None;
    };
    if !number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.') {
        return None;
    }
    Some(Diagnostic::new(
        Code::Unit,
        value.span.to(word.span),
        format!("no blank stands between a number and `{}`", word.text),
        format!("write them together: `{number}{unit}`"),
    ))
}

/// Reads a time; anything else is reported.
pub(super) fn time(value: Value<'_>, diagnostics: &mut Diagnostics) -> Option<Time> {
    match value::read(value, diagnostics)? {
        Quantity::Time(time) => Some(time),
        Quantity::Number(number) => {
            diagnostics.push(Diagnostic::new(
                Code::Unit,
                value.span,
                format!("a time needs a unit, and {number} has none"),
                format!("write `{number}s` for seconds or `{number}ms` for milliseconds"),
            ));
            None
        }
        other => {
            diagnostics.push(Diagnostic::new(
                Code::Unit,
                value.span,
                format!("a time is needed here, not {}", other.kind()),
                "write a time such as `0.5s`, `250ms` or `1m30s`",
            ));
            None
        }
    }
}
