//! What stands behind a command's name, taken piece by piece. Every mistake in it is reported, not only the first.

mod values;

use smallvec::SmallVec;

use super::ease::Ease;
use super::evaluator::Evaluator;
use super::suggest::{list, suggest};
use super::time::Time;
use super::value::{self, Quantity};
use super::words::{self, MODIFIERS, Signature, Word, is_modifier};
use crate::diagnostic::{Code, Diagnostic, bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Argument, Command, Item, Name, NumberShape, Value, ValueKind};
use crate::units::{Measure, Unit};

pub(super) use values::Bound;

/// The arguments of one command that are not taken yet.
pub(super) struct Arguments<'r, 'a, 's, 'd> {
    /// What its word is.
    word: Word<'d>,
    /// The command itself.
    pub(super) command: &'a Command<'s>,
    pub(super) eval: &'r mut Evaluator<'s, 'd>,
    positional: smallvec::IntoIter<[&'a Argument<'s>; 4]>,
    named: SmallVec<[&'a Argument<'s>; 4]>,
    modifiers: SmallVec<[(Name<'s>, &'a Argument<'s>); 2]>,
    /// Whether something is missing.
    incomplete: bool,
    /// How many errors there were before this command.
    errors_before: usize,
}

/// How long a command takes: not at all, or with `for` or `over`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lasting {
    Instant,
    For(Time),
    Over(Time, Ease),
}

impl Lasting {
    /// How long.
    pub(super) fn time(self) -> Time {
        match self {
            Lasting::Instant => Time::ZERO,
            Lasting::For(time) | Lasting::Over(time, _) => time,
        }
    }
}

impl<'r, 'a, 's, 'd> Arguments<'r, 'a, 's, 'd> {
    /// Sorts the arguments; `None` where they cannot be, which is reported.
    pub(super) fn new(word: Word<'d>, command: &'a Command<'s>, eval: &'r mut Evaluator<'s, 'd>) -> Option<Self> {
        let row = word.signature();
        match &command.block {
            Some(block) if !row.block => {
                let span = Span { end: block.span.start + 1, ..block.span };
                bail!(eval, Arguments, span, "`{}` takes no block", row.name; help: "end the line before the `{{`");
            }
            // Its brace was reported to be missing its partner.
            None if row.block && eval.diagnostics.has(Code::Unclosed) => return None,
            None if row.block => {
                bail!(eval, Arguments, command.span, "`{}` needs a block behind it", row.name;
                    help: "{}; its `{{` stands on the same line", row.how());
            }
            _ => {}
        }
        let errors_before = eval.diagnostics.errors();
        let mut args = Arguments {
            word,
            command,
            eval,
            positional: SmallVec::new().into_iter(),
            named: SmallVec::new(),
            modifiers: SmallVec::new(),
            incomplete: false,
            errors_before,
        };
        args.sort()?;
        Some(args)
    }

    /// How a line with its word looks.
    pub(super) fn row(&self) -> Signature<'d> {
        self.word.signature()
    }

    fn sort(&mut self) -> Option<()> {
        let mut positional = SmallVec::new();
        let mut rest = self.command.arguments.iter();
        let mut last: Option<&'a Argument<'s>> = None;
        while let Some(argument) = rest.next() {
            let word = bare_word(argument);
            if let Some(word) = word.filter(|word| is_modifier(word.text)) {
                last = rest.next();
                self.modifier(word, last)?;
                continue;
            }
            if let (Some(word), Some(before)) = (word, last.replace(argument))
                && let Item::One(value) = &before.item
                && let Some(diagnostic) = blank_before_unit(value, word)
            {
                self.eval.push(diagnostic);
                return None;
            }
            if let Item::Arrow(ends) = &argument.item
                && let Value { kind: ValueKind::Word(word), negative: false, .. } = ends.1
                && is_modifier(word)
            {
                let from = text_of(&ends.0).unwrap_or_else(|| "A".to_owned());
                bail!(self.eval, Arguments, argument.span, "the value behind `->` is missing";
                    help: "write where it goes: `{from} -> B {word} …`");
            }
            match argument.name {
                None => positional.push(argument),
                Some(name) => {
                    let twice = |other: &&Argument<'_>| other.name.is_some_and(|other| other.text == name.text);
                    if self.named.iter().any(twice) {
                        return self.twice(name.text, argument.span);
                    }
                    self.named.push(argument);
                }
            }
        }
        self.positional = positional.into_iter();
        Some(())
    }

    fn modifier(&mut self, word: Name<'s>, operand: Option<&'a Argument<'s>>) -> Option<()> {
        let Some(operand) = operand else {
            let example =
                MODIFIERS.iter().find(|(modifier, _)| *modifier == word.text).map_or("", |(_, example)| example);
            bail!(self.eval, Arguments, word.span, "something is missing behind `{}`", word.text;
                help: "for example `{example}`");
        };
        if self.modifiers.iter().any(|(name, _)| name.text == word.text) {
            return self.twice(word.text, word.span);
        }
        self.modifiers.push((word, operand));
        Some(())
    }

    fn twice<T>(&mut self, name: &str, span: Span) -> Option<T> {
        bail!(self.eval, Arguments, span, "`{name}` stands here twice"; help: "keep one of the two")
    }

    /// Reports everything that was not taken. `None` where there was anything.
    pub(super) fn finish(self) -> Option<()> {
        if self.incomplete {
            return None;
        }
        if self.positional.as_slice().is_empty() && self.named.is_empty() && self.modifiers.is_empty() {
            return Some(());
        }
        let row = self.row();
        let usage = row.how();
        let mut clean = true;
        // The first one too many is enough: the others often belong to it.
        if let Some(argument) = self.positional.as_slice().first() {
            clean = false;
            let message = format!("`{}` takes no more arguments", row.name);
            let help = self.meant(argument).unwrap_or_else(|| usage.clone());
            report!(self.eval, Arguments, argument.span, "{message}"; help: "{help}");
        }
        for argument in self.named {
            clean = false;
            let name = argument.name.map_or("", |name| name.text);
            report!(self.eval, Arguments, argument.span, "`{}` has no `{name}=`", row.name; help: "{usage}");
        }
        for (word, operand) in self.modifiers {
            clean = false;
            let help = match (word.text, number_text(operand)) {
                ("for", Some(time)) => format!("give the time a line of its own: `wait {time}`"),
                ("ease", _) if row.moves => "an easing needs a time: `over 2s ease in-out-sine`".to_owned(),
                _ => usage.clone(),
            };
            report!(self.eval, Arguments, word.span.to(operand.span), "`{}` takes no `{}`", row.name, word.text;
                help: "{help}");
        }
        clean.then_some(())
    }

    /// What an argument that is one too many may have been meant for.
    fn meant(&self, argument: &Argument<'_>) -> Option<String> {
        let time = number_text(argument).filter(|text| text.ends_with(['s', 'm', 'h']));
        if let Some(time) = time.filter(|_| self.row().holds) {
            return Some(format!("write `for {time}` for how long it holds"));
        }
        if let Some(time) = time.filter(|_| self.row().moves) {
            return Some(format!("write `over {time}` for how long it takes to get there"));
        }
        let word = bare_word(argument)?.text;
        if self.row().moves && Ease::named(word).is_some() {
            return Some(format!("write `over 1s ease {word}`"));
        }
        if self.row().moves && matches!(word, "to" | "from") {
            return Some("write an arrow from the one value to the other: `1500 -> 900`".to_owned());
        }
        if self.row().moves && word == "in" {
            return Some("write `over 1s` for how long it takes to get there".to_owned());
        }
        if self.row().block && word == "times" {
            return Some("take `times` away: `repeat 3 { … }`".to_owned());
        }
        if word == "at" {
            return Some(format!("a start time stands first in its line: `at 1s {} …`", self.row().name));
        }
        if words::find(self.eval.board, word).is_some() {
            return Some(format!("give `{word}` a line of its own, or put a `;` before it to start both together"));
        }
        suggest(word, MODIFIERS.iter().map(|(modifier, _)| *modifier)).map(|near| format!("did you mean `{near}`?"))
    }

    /// The next argument without a name, whatever it is.
    pub(super) fn next_argument(&mut self) -> Option<&'a Argument<'s>> {
        let argument = self.positional.next();
        if argument.is_none() {
            self.missing();
        }
        argument
    }

    /// The next argument without a name. Where none is left, that is reported.
    pub(super) fn next(&mut self) -> Option<&'a Value<'s>> {
        let argument = self.next_argument()?;
        self.one(argument)
    }

    /// Reports, once a command, that something is missing.
    pub(super) fn missing(&mut self) {
        let told = self.incomplete || self.eval.diagnostics.errors() > self.errors_before;
        self.incomplete = true;
        // What is missing is often in what was wrong before.
        if told {
            return;
        }
        let message = format!("`{}` needs more than this", self.row().name);
        let span =
            self.command.arguments.last().map_or(self.command.head.span, |last| self.command.head.span.to(last.span));
        report!(self.eval, Arguments, span, "{message}"; help: "{}", self.row().how());
    }

    /// Whether arguments without a name are left.
    pub(super) fn more(&self) -> bool {
        !self.positional.as_slice().is_empty()
    }

    /// The argument with this name, if it is given.
    pub(super) fn named(&mut self, name: &str) -> Option<&'a Argument<'s>> {
        let is = |argument: &&Argument<'_>| argument.name.is_some_and(|given| given.text == name);
        let at = self.named.iter().position(is)?;
        Some(self.named.remove(at))
    }

    /// Whether it may say where its values go: with an arrow, or with `over`.
    pub(super) fn may_go(&self) -> bool {
        let is_arrow = |argument: &Argument<'_>| matches!(argument.item, Item::Arrow(_));
        self.modifiers.iter().any(|(name, _)| name.text == "over") || self.command.arguments.iter().any(is_arrow)
    }

    /// The argument behind a word such as `every`.
    pub(super) fn behind(&mut self, word: &str) -> Option<&'a Argument<'s>> {
        let at = self.modifiers.iter().position(|(name, _)| name.text == word)?;
        Some(self.modifiers.remove(at).1)
    }

    /// How long it takes, with `for` or `over`; `Err` where that is wrong, which is reported.
    pub(super) fn lasting(&mut self) -> Result<Lasting, ()> {
        let hold = if self.row().holds { self.behind("for") } else { None };
        let over = if self.row().moves { self.behind("over") } else { None };
        let ease = if over.is_some() { self.behind("ease") } else { None };
        match (hold, over) {
            (None, None) => Ok(Lasting::Instant),
            (Some(hold), None) => Ok(Lasting::For(self.above_zero("for", hold)?)),
            (None, Some(over)) => {
                let over = self.above_zero("over", over)?;
                let ease = match ease {
                    None => Ease::LINEAR,
                    Some(ease) => self.ease(ease).ok_or(())?,
                };
                Ok(Lasting::Over(over, ease))
            }
            (Some(hold), Some(over)) => {
                report!(self.eval, Arguments, hold.span.to(over.span), "`over` and `for` do not stand together";
                    help: "first get there with `over`, then hold: a `wait` on the next line, and a `stop` behind it");
                Err(())
            }
        }
    }

    fn above_zero(&mut self, word: &str, operand: &'a Argument<'s>) -> Result<Time, ()> {
        let value = self.one(operand).ok_or(())?;
        let time = time(value, self.eval).ok_or(())?;
        if time <= Time::ZERO {
            report!(self.eval, OutOfRange, value.span, "`{word}` needs a time above zero";
                help: "write a time such as `0.5s`, or leave the command out");
            return Err(());
        }
        Ok(time)
    }

    fn ease(&mut self, argument: &'a Argument<'s>) -> Option<Ease> {
        let word = bare_word(argument).map_or("", |word| word.text);
        let found = Ease::named(word);
        if found.is_none() {
            let names = Ease::names();
            let help = match suggest(word, names.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!(
                    "write `linear`, or `in-`, `out-` or `in-out-` with {}",
                    list(super::ease::CURVES.iter().map(|curve| curve.name))
                ),
            };
            report!(self.eval, Arguments, argument.span, "there is no such easing"; help: "{help}");
        }
        found
    }

    /// Whether an argument is the first one of the command.
    fn is_first(&self, argument: &Argument<'_>) -> bool {
        self.command.arguments.first().is_some_and(|first| first.span == argument.span)
    }

    /// The single value of an argument; arrows, ranges and lists are reported.
    pub(super) fn one(&mut self, argument: &'a Argument<'s>) -> Option<&'a Value<'s>> {
        let (message, help) = match &argument.item {
            Item::One(value) => return Some(value),
            Item::Arrow(ends) if self.row().moves && self.is_first(argument) => {
                let [number, to] = [&ends.0, &ends.1].map(|value| text_of(value).unwrap_or_else(|| "…".to_owned()));
                let name = self.row().name;
                let help = format!(
                    "write `{name} {number} {to} over 1s` to go there from the last value, or the start too: `{name} {number} A -> {to} over 1s`"
                );
                ("the value before `->` is missing".to_owned(), help)
            }
            Item::Arrow(..) => {
                let moving = self.eval.board.verbs.iter().filter(|verb| verb.moves);
                let moving: Vec<String> = moving.map(|verb| format!("`{}`", verb.word)).collect();
                let message = "a move from one value to another has no place here".to_owned();
                (message, format!("`A -> B` stands in {}, with `over`", list(moving.iter().map(String::as_str))))
            }
            Item::Range(..) => ("one value is needed here, not a range".to_owned(), self.row().how()),
            Item::List(list) => ("one value is needed here, not a list".to_owned(), without_commas(list, argument)),
            Item::Comparison(sign) => {
                (format!("`{}` compares, and nothing is compared here", sign.text), self.row().how())
            }
        };
        bail!(self.eval, Arguments, argument.span, "{message}"; help: "{help}")
    }
}

/// The text of a value that is a number or a word.
pub(super) fn text_of(value: &Value<'_>) -> Option<String> {
    let minus = if value.negative { "-" } else { "" };
    match value.kind {
        ValueKind::Number(_, text) | ValueKind::Word(text) => Some(format!("{minus}{text}")),
        ValueKind::Text(_) | ValueKind::Expression(_) => None,
    }
}

/// The text of an argument that is nothing but a number.
fn number_text<'s>(argument: &Argument<'s>) -> Option<&'s str> {
    match argument.item {
        Item::One(Value { kind: ValueKind::Number(_, text), .. }) if argument.name.is_none() => Some(text),
        _ => None,
    }
}

/// What to write instead of a list.
fn without_commas(list: &[Value<'_>], argument: &Argument<'_>) -> String {
    let is_tight = list.windows(2).all(|pair| matches!(pair, [one, two] if one.span.end + 1 == two.span.start));
    let texts: Option<Vec<&str>> = list
        .iter()
        .map(|value| match value.kind {
            ValueKind::Number(_, text) if !value.negative => Some(text),
            _ => None,
        })
        .collect();
    match texts.as_deref() {
        Some([whole, rest])
            if is_tight && argument.name.is_none() && whole.bytes().all(|byte| byte.is_ascii_digit()) =>
        {
            format!("write a decimal point as `{whole}.{rest}`, or a blank between two arguments: `{whole} {rest}`")
        }
        Some(texts) if argument.name.is_none() => {
            format!("arguments stand behind each other with a blank between them: `{}`", texts.join(" "))
        }
        _ => "arguments stand behind each other with a blank between them, not a comma".to_owned(),
    }
}

/// An argument that is nothing but a word.
pub(super) fn bare_word<'s>(argument: &Argument<'s>) -> Option<Name<'s>> {
    match argument.item {
        Item::One(Value { kind: ValueKind::Word(text), negative: false, span }) if argument.name.is_none() => {
            Some(Name { text, span })
        }
        _ => None,
    }
}

/// `1 s` or `1 seconds` instead of `1s`, and `n beats`.
pub(super) fn blank_before_unit(value: &Value<'_>, word: Name<'_>) -> Option<Diagnostic> {
    let span = value.span.to(word.span);
    match &value.kind {
        ValueKind::Number(NumberShape::Plain, number) => {
            let unit = value::unit_meant(word.text)?;
            let bare = number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
            bare.then(|| {
                diagnostic!(Unit, span, "no blank stands between a number and `{}`", word.text;
                    help: "write them together: `{number}{unit}`")
            })
        }
        ValueKind::Word(name) if matches!(word.text, "beat" | "beats" | "bar" | "bars") => {
            let one = if word.text.starts_with("beat") { "beat" } else { "bar" };
            let message = format!("`{}` stands behind a number only", word.text);
            Some(diagnostic!(Unit, span, "{message}"; help: "multiply: `({name} * 1 {one})`"))
        }
        ValueKind::Word(name) if !value.negative && is_time(word.text) => {
            let message = format!("`{}` stands behind a number only", word.text);
            Some(diagnostic!(Unit, span, "{message}"; help: "multiply: `({name} * 1{})`", word.text))
        }
        _ => None,
    }
}

/// Whether a word is a unit of time, and not the name of something.
fn is_time(word: &str) -> bool {
    Unit::named(word).is_some_and(|unit| matches!(unit.of, Measure::Time(_)) && unit.is_unmistakable())
}

/// Reads a time; anything else is reported.
pub(super) fn time<'s>(value: &Value<'s>, eval: &mut Evaluator<'s, '_>) -> Option<Time> {
    match eval.value(value)? {
        Quantity::Time(time) => Some(time),
        Quantity::Number(number) => eval.needs_unit(number, value.span),
        other => {
            let help = match other {
                Quantity::Moment(_) => "a mark is a moment: write `at` before it, or take two of them apart: `(b - a)`",
                _ => "write a time such as `0.5s`, `250ms` or `2 beats`",
            };
            bail!(eval, Unit, value.span, "a time is needed here, not {}", other.kind(); help: "{help}")
        }
    }
}
