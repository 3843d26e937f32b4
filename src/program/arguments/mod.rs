//! The arguments of a command, read one by one. Every mistake in them is reported, not only the first.

mod complaints;
mod values;

use smallvec::SmallVec;

use super::ease::Ease;
use super::evaluator::Evaluator;
use super::suggest::{list, suggest};
use super::time::Time;
use super::value::{self, Quantity};
use super::words::{MODIFIERS, Signature, Word, is_modifier};
use crate::diagnostic::{Code, Diagnostic, bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Argument, Command, Item, Name, NumberShape, Value, ValueKind, foreign};
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
pub(super) enum CommandDuration {
    Instant,
    For(Time),
    Over(Time, Ease),
}

impl CommandDuration {
    /// How long.
    pub(super) fn time(self) -> Time {
        match self {
            CommandDuration::Instant => Time::ZERO,
            CommandDuration::For(time) | CommandDuration::Over(time, _) => time,
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
                bail!(eval, Block, span, "`{}` takes no block", row.name; help: "end the line before the `{{`");
            }
            // The missing partner of its brace was reported.
            None if row.block && eval.diagnostics.has(Code::Unclosed) => return None,
            None if row.block => {
                bail!(eval, Block, command.span, "`{}` needs a block", row.name;
                    help: "{}, with the `{{` on the same line", row.how());
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
            let word = argument.bare_word();
            if let Some(word) = word.filter(|word| is_modifier(word.text)) {
                last = rest.next();
                self.modifier(word, last)?;
                continue;
            }
            if let (Some(word), Some(before)) = (word, last.replace(argument))
                && let Item::One(value) = &before.item
                && let Some(diagnostic) = misplaced_unit(value, word)
            {
                self.eval.push(diagnostic);
                return None;
            }
            if let Item::Arrow(ends) = &argument.item
                && let Value { kind: ValueKind::Word(word), negative: false, .. } = ends.1
                && is_modifier(word)
            {
                let from = text_of(&ends.0).unwrap_or_else(|| "A".to_owned());
                bail!(self.eval, MissingArgument, argument.span, "the value after `->` is missing";
                    help: "write the target: `{from} -> B {word} …`");
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
            bail!(self.eval, MissingArgument, word.span, "the value after `{}` is missing", word.text;
                help: "for example `{example}`");
        };
        if self.modifiers.iter().any(|(name, _)| name.text == word.text) {
            return self.twice(word.text, word.span);
        }
        self.modifiers.push((word, operand));
        Some(())
    }

    fn twice<T>(&mut self, name: &str, span: Span) -> Option<T> {
        bail!(self.eval, DuplicateArgument, span, "`{name}` is given twice"; help: "keep one of the two")
    }

    /// Reports every argument that was not read; `None` if there was one.
    pub(super) fn finish(mut self) -> Option<()> {
        if self.incomplete {
            return None;
        }
        if self.positional.as_slice().is_empty() && self.named.is_empty() && self.modifiers.is_empty() {
            return Some(());
        }
        let row = self.row();
        let usage = row.how();
        let mut clean = true;
        // The first one too many is enough: the others often belong to it. After another mistake, it often belongs to that.
        if let Some(argument) = self.positional.as_slice().first() {
            clean = false;
            if self.eval.diagnostics.errors() == self.errors_before {
                let diagnostic = self.too_many(argument);
                self.eval.push(diagnostic);
            }
        }
        for argument in std::mem::take(&mut self.named) {
            clean = false;
            let diagnostic = self.unknown_axis(argument);
            self.eval.push(diagnostic);
        }
        for (word, operand) in self.modifiers {
            clean = false;
            let help = match (word.text, number_text(operand)) {
                ("for", Some(time)) => format!("wait on a line of its own: `wait {time}`"),
                ("ease", _) if row.moves => "an easing needs a time: `over 2s ease in-out-sine`".to_owned(),
                _ => usage.clone(),
            };
            report!(self.eval, UnexpectedArgument, word.span.to(operand.span), "`{}` takes no `{}`", row.name, word.text;
                help: "{help}");
        }
        clean.then_some(())
    }

    /// The next argument without a name, which is not taken.
    pub(super) fn peek(&self) -> Option<&'a Argument<'s>> {
        self.positional.as_slice().first().copied()
    }

    /// The next argument without a name.
    pub(super) fn next_argument(&mut self) -> Option<&'a Argument<'s>> {
        let argument = self.positional.next();
        if argument.is_none() {
            self.missing();
        }
        argument
    }

    /// The next argument without a name, if it is a word. It is not read yet.
    pub(super) fn next_word(&self) -> Option<Name<'s>> {
        self.positional.as_slice().first()?.bare_word()
    }

    /// The next argument without a name, if it is one value. It is not read yet.
    pub(super) fn next_value(&self) -> Option<&'a Value<'s>> {
        let argument: &'a Argument<'s> = self.positional.as_slice().first()?;
        if let Item::One(value) = &argument.item { Some(value) } else { None }
    }

    /// The next argument without a name. Where none is left, that is reported.
    pub(super) fn next(&mut self) -> Option<&'a Value<'s>> {
        let argument = self.next_argument()?;
        self.one(argument)
    }

    /// Reports missing arguments, once per command.
    pub(super) fn missing(&mut self) {
        let is_reported = self.incomplete || self.eval.diagnostics.errors() > self.errors_before;
        self.incomplete = true;
        // After another mistake, what is missing often belongs to that.
        if is_reported {
            return;
        }
        let diagnostic = self.too_few();
        self.eval.push(diagnostic);
    }

    /// Leaves out all other values of a command with a mistake.
    pub(super) fn skip(&mut self) {
        self.positional = SmallVec::new().into_iter();
        self.named.clear();
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

    /// Puts arguments that all have names in the order of these names; `None` if some have no name or are missing, which is reported.
    pub(super) fn in_order<'n>(&mut self, names: impl Iterator<Item = &'n str> + Clone) -> Option<()> {
        let Some(first) = self.named.first() else { return Some(()) };
        let (span, word) = (first.span, self.row().name);
        if self.more() {
            let all: Vec<String> = names.map(|name| format!("{name}=")).collect();
            self.named.clear();
            bail!(self.eval, InvalidArgument, span, "either all values of `{word}` have names, or none";
                help: "write {}, or the values alone in this order", list(all.iter().map(String::as_str)));
        }
        let mut positional = SmallVec::new();
        for name in names {
            let Some(argument) = self.named(name) else {
                bail!(self.eval, MissingArgument, self.command.span, "`{word}` needs `{name}=`"; help: "{}", self.row().how());
            };
            positional.push(argument);
        }
        self.positional = positional.into_iter();
        Some(())
    }

    /// Whether it may say where its values go: with an arrow, or with `over`.
    pub(super) fn may_go(&self) -> bool {
        let is_arrow = |argument: &Argument<'_>| matches!(argument.item, Item::Arrow(_));
        self.modifiers.iter().any(|(name, _)| name.text == "over") || self.command.arguments.iter().any(is_arrow)
    }

    /// The place of a word such as `within`, if it is given.
    pub(super) fn span_of(&self, word: &str) -> Option<Span> {
        self.modifiers.iter().find(|(name, _)| name.text == word).map(|(name, _)| name.span)
    }

    /// The argument of a word such as `every`.
    pub(super) fn modified_by(&mut self, word: &str) -> Option<&'a Argument<'s>> {
        let at = self.modifiers.iter().position(|(name, _)| name.text == word)?;
        Some(self.modifiers.remove(at).1)
    }

    /// How long it takes, with `for` or `over`; `Err` where that is wrong, which is reported.
    pub(super) fn lasting(&mut self) -> Result<CommandDuration, ()> {
        let hold = if self.row().holds { self.modified_by("for") } else { None };
        let over = if self.row().moves { self.modified_by("over") } else { None };
        let ease = if over.is_some() { self.modified_by("ease") } else { None };
        match (hold, over) {
            (None, None) => Ok(CommandDuration::Instant),
            (Some(hold), None) => Ok(CommandDuration::For(self.above_zero("for", hold)?)),
            (None, Some(over)) => {
                let over = self.above_zero("over", over)?;
                let ease = match ease {
                    None => Ease::LINEAR,
                    Some(ease) => self.ease(ease).ok_or(())?,
                };
                Ok(CommandDuration::Over(over, ease))
            }
            (Some(hold), Some(over)) => {
                report!(self.eval, DuplicateArgument, hold.span.to(over.span), "a command takes either `over` or `for`";
                    help: "first move with `over`, then hold: a `wait` on the next line, and a `stop` after it");
                Err(())
            }
        }
    }

    fn above_zero(&mut self, word: &str, operand: &'a Argument<'s>) -> Result<Time, ()> {
        let value = self.one(operand).ok_or(())?;
        let time = time(value, self.eval).ok_or(())?;
        if time <= Time::ZERO {
            report!(self.eval, OutOfRange, value.span, "`{word}` needs a time greater than zero";
                help: "write a time such as `0.5s`, or leave the command out");
            return Err(());
        }
        Ok(time)
    }

    fn ease(&mut self, argument: &'a Argument<'s>) -> Option<Ease> {
        let word = argument.bare_word().map_or("", |word| word.text);
        let found = Ease::named(word);
        if found.is_none() {
            let names = Ease::names();
            let foreign = foreign::easing_named(word).filter(|name| Ease::named(name).is_some());
            if let Some(name) = foreign {
                bail!(self.eval, UnknownEasing, argument.span, "unknown easing `{word}`"; write: argument.span => "{name}");
            }
            let help = match suggest(word, names.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!(
                    "write `linear`, or `in-`, `out-` or `in-out-` with {}",
                    list(super::ease::CURVES.iter().map(|curve| curve.name))
                ),
            };
            report!(self.eval, UnknownEasing, argument.span, "unknown easing `{}`", self.eval.written(argument.span); help: "{help}");
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
                    "write `{name} {number} {to} over 1s` to move there from the last value, or with the start: `{name} {number} A -> {to} over 1s`"
                );
                ("the value before `->` is missing".to_owned(), help)
            }
            Item::Arrow(..) => {
                let moving = self.eval.board.verbs.iter().filter(|verb| verb.moves);
                let moving: Vec<String> = moving.map(|verb| format!("`{}`", verb.word)).collect();
                let message = format!("`{}` does not move from one value to another", self.row().name);
                (message, format!("`A -> B` is for {}, with `over`", list(moving.iter().map(String::as_str))))
            }
            Item::Range(..) => ("one value is needed here, not a range".to_owned(), self.row().how()),
            Item::List(list) => return self.without_commas(list, argument),
            Item::Comparison(_) => (format!("`{}` does not compare anything", self.row().name), self.row().how()),
        };
        bail!(self.eval, InvalidArgument, argument.span, "{message}"; help: "{help}")
    }

    /// A list where one value is needed: most likely arguments with commas between them, or a decimal comma.
    fn without_commas<T>(&mut self, list: &[Value<'s>], argument: &Argument<'s>) -> Option<T> {
        let is_tight = list.windows(2).all(|pair| matches!(pair, [one, two] if one.span.end + 1 == two.span.start));
        let texts: Vec<&str> = list.iter().map(|value| self.eval.written(value.span)).collect();
        let is_number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
        let span = argument.span;
        if let [whole, rest] = texts.as_slice()
            && (is_tight && whole.bytes().all(|byte| byte.is_ascii_digit()) && is_number(rest))
        {
            bail!(self.eval, InvalidArgument, span, "one value is needed here, not a list";
                help: "write a decimal point, `{whole}.{rest}`, or a space between two arguments: `{whole} {rest}`");
        }
        let name = argument.name.map(|name| format!("{}=", name.text)).unwrap_or_default();
        let values = name + &texts.join(" ");
        let line = self.eval.rewritten(self.command.span, &[(span, values.clone())]);
        let diagnostic = diagnostic!(InvalidArgument, span, "arguments are separated by spaces, not by commas"; help: "write `{line}`");
        // `x=1, 2` may well be meant for two axes.
        self.eval.push(if argument.name.is_none() { diagnostic.fix(span, values) } else { diagnostic });
        None
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

/// `1 s` or `1 seconds` instead of `1s`, `2 Bars`, and `n beats`.
pub(super) fn misplaced_unit(value: &Value<'_>, word: Name<'_>) -> Option<Diagnostic> {
    let (span, unit) = (value.span.to(word.span), word.text);
    match &value.kind {
        ValueKind::Number(NumberShape::Plain, number) => {
            let small = unit.to_lowercase();
            if matches!(small.as_str(), "beat" | "beats" | "bar" | "bars") {
                return Some(
                    diagnostic!(Unit, word.span, "units are written in lower case"; write: span => "{number} {small}"),
                );
            }
            let meant = value::unit_meant(unit)?;
            let is_bare = number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
            is_bare.then(|| {
                diagnostic!(Unit, span, "no space is allowed between a number and its unit `{unit}`"; write: span => "{number}{meant}")
            })
        }
        ValueKind::Word(name) if matches!(unit, "beat" | "beats" | "bar" | "bars") => {
            let name = if value.negative { format!("-{name}") } else { (*name).to_owned() };
            let one = if unit.starts_with("beat") { "1 beat" } else { "1 bar" };
            Some(diagnostic!(Unit, span, "`{unit}` needs a number before it"; help: "multiply: `({name} * {one})`";
                fix: span => "({name} * {one})"))
        }
        ValueKind::Word(name) if !value.negative && is_time(unit) => {
            Some(diagnostic!(Unit, span, "`{unit}` needs a number before it"; help: "multiply: `({name} * 1{unit})`";
                fix: span => "({name} * 1{unit})"))
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
                Quantity::Moment(_) => {
                    "a mark is a moment: write `at` before it, or subtract one mark from another: `(b - a)`"
                }
                _ => "write a time such as `0.5s`, `250ms` or `2 beats`",
            };
            bail!(eval, Unit, value.span, "a time is needed here, not {}", other.kind(); help: "{help}")
        }
    }
}
