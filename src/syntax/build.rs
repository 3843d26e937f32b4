//! pest's pairs to the tree. What the grammar kept only for its message is reported here, and its statement left out, so
//! that one mistake is one message.

use pest::error::InputLocation;
use pest::iterators::{Pair, Pairs};

use super::ast::{
    Argument, Ast, Block, Command, Item, Later, Line, Moment, Name, NumberShape, Origin, Part, Start, Statement, Value,
    ValueKind,
};
use super::grammar::Rule;
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::{Source, Span};

pub(super) struct Builder<'s, 'd> {
    source: &'s Source,
    diagnostics: &'d mut Diagnostics,
    /// Where the text that pest has read begins in the source.
    offset: usize,
    lines: Vec<Line<'s>>,
    /// The last `;` that was reported to join nothing.
    empty_at: Option<usize>,
}

impl<'s, 'd> Builder<'s, 'd> {
    pub(super) fn new(source: &'s Source, diagnostics: &'d mut Diagnostics) -> Self {
        Builder { source, diagnostics, offset: 0, lines: Vec::new(), empty_at: None }
    }

    /// Adds the lines of a piece of the script that begins at `offset`.
    pub(super) fn add(&mut self, offset: usize, pairs: Pairs<'_, Rule>) {
        self.offset = offset;
        for pair in pairs.flat_map(Pair::into_inner) {
            if pair.as_rule() == Rule::line {
                let line = self.line(pair);
                self.lines.extend(line);
            }
        }
    }

    /// A piece that the grammar cannot read at all, which a script that passed the scan should never have.
    pub(super) fn unreadable(&mut self, offset: usize, error: &pest::error::Error<Rule>) {
        let (InputLocation::Pos(at) | InputLocation::Span((at, _))) = error.location;
        self.diagnostics.push(Diagnostic::new(
            Code::Syntax,
            Span::new(offset + at, offset + at + 1),
            "this cannot be read",
            "write one command a line, such as `servo 1 1500`",
        ));
    }

    /// The whole script.
    pub(super) fn finish(self) -> Ast<'s> {
        let span = Span::new(0, self.source.text().len());
        Ast { body: Block { lines: self.lines, span } }
    }

    /// The place of a pair, without blanks behind it. Rules that are neither atomic nor end in a bracket may also have
    /// swallowed a comment, so their places are put together from their children.
    fn span(&self, pair: &Pair<'_, Rule>) -> Span {
        let start = self.offset + pair.as_span().start();
        Span::new(start, start + pair.as_str().trim_end().len())
    }

    fn name(&self, pair: &Pair<'_, Rule>) -> Name<'s> {
        let span = self.span(pair);
        Name { text: self.source.slice(span), span }
    }

    /// The recursion over blocks is bounded by the depth of brackets, which the scan has checked.
    fn block(&mut self, pair: Pair<'_, Rule>) -> Block<'s> {
        let span = self.span(&pair);
        let lines = pair.into_inner().filter_map(|line| self.line(line)).collect();
        Block { lines, span }
    }

    fn line(&mut self, pair: Pair<'_, Rule>) -> Option<Line<'s>> {
        let mut line = None;
        for (place, child) in pair.into_inner().enumerate() {
            match child.as_rule() {
                Rule::part => self.part(place, child, &mut line),
                Rule::empty => self.empty_place(&child),
                _ => self.behind(&child),
            }
        }
        line
    }

    /// Adds one part to its line; `place` counts what stands between the `;`.
    fn part(&mut self, place: usize, pair: Pair<'_, Rule>, line: &mut Option<Line<'s>>) {
        let mut robots = Vec::new();
        let mut started: Option<(Start<'s>, Span)> = None;
        let mut described = false;
        for child in pair.into_inner() {
            match child.as_rule() {
                Rule::start => {
                    started = self.start(child);
                    if let (Some((_, span)), true) = (&started, place > 0) {
                        let message = "a start time covers the whole line, so it stands first in it";
                        self.diagnostics.push(Diagnostic::new(
                            Code::Joined,
                            *span,
                            message,
                            "give this command a line of its own",
                        ));
                        started = None;
                    }
                }
                Rule::robots => robots = child.into_inner().map(|name| self.name(&name)).collect(),
                _ => {
                    described = true;
                    let Some(inner) = child.into_inner().next() else {
                        continue;
                    };
                    if let (Some((Start::At(moment), _)), Rule::stray) = (&started, inner.as_rule())
                        && let Origin::Value(Value { kind: ValueKind::Word(word), span, .. }) = moment.origin
                    {
                        // `at servo 1 1500`: the command was read as the name of a mark.
                        self.diagnostics.push(Diagnostic::new(
                            Code::StartTime,
                            span,
                            "`at` needs a time before the command",
                            format!("for example `at 0.5s {word} …`"),
                        ));
                        started = None;
                        continue;
                    }
                    let Some(statement) = self.statement(inner) else {
                        continue;
                    };
                    let span = statement.span();
                    let part = Part { robots: std::mem::take(&mut robots), statement };
                    let start = started.take();
                    let span = start.as_ref().map_or(span, |(_, start)| start.to(span));
                    match line {
                        Some(line) => {
                            line.span = line.span.to(span);
                            line.parts.push(part);
                        }
                        None => {
                            *line = Some(Line { start: start.map(|(start, _)| start), parts: vec![part], span });
                        }
                    }
                }
            }
        }
        if let (Some(robot), false) = (robots.last(), described) {
            let written = self.source.slice(robot.span);
            self.diagnostics.push(Diagnostic::new(
                Code::Syntax,
                robot.span,
                "a robot is named, but no command",
                format!("write the command on the same line: `{written}: stop`"),
            ));
        } else if let (Some((start, span)), false) = (started, described) {
            let written = match start {
                Start::At(Moment { origin: Origin::Value(Value { kind: ValueKind::Word(_), .. }), .. }) => "at 0.5s",
                _ => self.source.slice(span),
            };
            self.diagnostics.push(Diagnostic::new(
                Code::StartTime,
                span,
                "a start time and a command stand together, and one of them is missing",
                format!("write the command on the same line: `{written} stop`"),
            ));
        }
    }

    fn start(&mut self, pair: Pair<'_, Rule>) -> Option<(Start<'s>, Span)> {
        let from = self.span(&pair);
        let inner = pair.into_inner().next()?;
        if inner.as_rule() == Rule::after {
            let value = self.value(inner.into_inner().find(|pair| pair.as_rule() == Rule::time)?)?;
            let span = Span { start: from.start, ..value.span };
            return Some((Start::After(value), span));
        }
        let moment = inner.into_inner().find(|pair| pair.as_rule() == Rule::moment)?;
        let moment = self.moment(moment)?;
        let span = Span { start: from.start, ..moment.span };
        Some((Start::At(moment), span))
    }

    fn moment(&mut self, pair: Pair<'_, Rule>) -> Option<Moment<'s>> {
        let mut parts = pair.into_inner();
        let first = parts.next()?;
        let (origin, mut span) = if first.as_rule() == Rule::bar {
            let span = self.span(&first);
            (Origin::Bar(span), span)
        } else {
            let value = self.value(first)?;
            (Origin::Value(value), value.span)
        };
        let mut offsets = Vec::new();
        let mut away = false;
        for part in parts {
            match part.as_rule() {
                Rule::plus => away = false,
                Rule::minus => away = true,
                _ => {
                    let value = self.value(part)?;
                    span = span.to(value.span);
                    offsets.push((away, value));
                }
            }
        }
        Some(Moment { origin, offsets, span })
    }

    fn statement(&mut self, pair: Pair<'_, Rule>) -> Option<Statement<'s>> {
        match pair.as_rule() {
            Rule::block => Some(Statement::Block(self.block(pair))),
            Rule::command => self.command(pair),
            Rule::stray => self.stray(pair),
            rule => {
                let what = match rule {
                    Rule::def => "def",
                    Rule::let_ => "let",
                    _ => "if",
                };
                let start = self.offset + pair.as_span().start();
                let span = Span::new(start, start + what.len());
                Some(Statement::Later(Later { what, span }))
            }
        }
    }

    fn command(&mut self, pair: Pair<'_, Rule>) -> Option<Statement<'s>> {
        let mut inner = pair.into_inner();
        let head = self.name(&inner.next()?);
        let (arguments, block, readable) = self.arguments(inner);
        let end = block
            .as_ref()
            .map(|block| block.span)
            .or_else(|| arguments.last().map(|argument: &Argument| argument.span));
        let span = end.map_or(head.span, |end| head.span.to(end));
        readable.then_some(Statement::Command(Command { head, arguments, block, span }))
    }

    /// A statement that starts with no word: a call, or a mistake.
    fn stray(&mut self, pair: Pair<'_, Rule>) -> Option<Statement<'s>> {
        let (arguments, block, readable) = self.arguments(pair.into_inner());
        if !readable {
            return None;
        }
        let first = arguments.first()?;
        let written = self.source.slice(first.span);
        match first.item {
            Item::One(Value { kind: ValueKind::Call(name), span, .. }) if first.name.is_none() => {
                if arguments.len() == 1 && block.is_none() {
                    return Some(Statement::Later(Later { what: name, span }));
                }
                self.diagnostics.push(Diagnostic::new(
                    Code::Syntax,
                    span,
                    format!("`{written}` is a call, and nothing stands behind a call"),
                    format!("for a command, put a blank behind its name: `{name} …`"),
                ));
            }
            Item::One(Value { kind: ValueKind::Number(NumberShape::Duration | NumberShape::Beats, _), .. }) => {
                self.diagnostics.push(
                    Diagnostic::new(Code::Syntax, first.span, "a line starts with a word, not with a time", format!("write `at {written} …` to start at that time, `+{written} …` to start so much later, or `wait {written}`")),
                );
            }
            _ => self.diagnostics.push(Diagnostic::new(
                Code::Syntax,
                first.span,
                "a line starts with the name of a command",
                "write one command a line, such as `servo 1 1500`",
            )),
        }
        None
    }

    /// Arguments, the block behind them, and whether everything could be read.
    fn arguments(&mut self, pairs: Pairs<'_, Rule>) -> (Vec<Argument<'s>>, Option<Block<'s>>, bool) {
        let mut arguments: Vec<Argument<'s>> = Vec::new();
        let mut block = None;
        let mut readable = true;
        // From the first value of a sum that lacks its parentheses to its last operator.
        let mut sum: Option<Span> = None;
        for pair in pairs {
            match pair.as_rule() {
                Rule::block => block = Some(self.block(pair)),
                Rule::junk => {
                    readable = false;
                    self.junk(&pair);
                }
                _ => {
                    let Some(argument) = self.argument(pair, &mut sum, arguments.last()) else {
                        readable = false;
                        continue;
                    };
                    if let Some(last) = arguments.last().filter(|_| sum.is_none())
                        && last.span.end == argument.span.start
                        && !matches!(argument.item, Item::Comparison(_))
                        && !matches!(last.item, Item::Comparison(_))
                    {
                        readable = false;
                        self.no_blank(last.span, argument.span);
                    }
                    arguments.push(argument);
                }
            }
        }
        if let Some(sum) = sum {
            readable = false;
            let last = arguments.last().map_or(sum, |last| last.span);
            let whole = sum.to(last);
            let written = self.source.slice(whole);
            self.diagnostics.push(Diagnostic::new(
                Code::Syntax,
                whole,
                "a calculation as an argument needs parentheses around it",
                format!("write `({written})`"),
            ));
        }
        (arguments, block, readable)
    }

    /// One argument. An arithmetic sign is none: it widens `sum`.
    fn argument(
        &mut self,
        pair: Pair<'_, Rule>,
        sum: &mut Option<Span>,
        before: Option<&Argument<'s>>,
    ) -> Option<Argument<'s>> {
        let inner = pair.into_inner().next()?;
        match inner.as_rule() {
            Rule::operator => {
                let span = self.span(&inner);
                let sign = self.source.slice(span);
                if sign == "->" {
                    self.junk(&inner);
                    return None;
                }
                if matches!(sign, "+" | "-" | "*" | "/" | "%") {
                    let Some(before) = before else {
                        self.junk(&inner);
                        return None;
                    };
                    let from = before.span.to(span);
                    *sum = Some(sum.map_or(from, |sum| sum.to(span)));
                    return None;
                }
                Some(Argument { name: None, item: Item::Comparison(Name { text: sign, span }), span })
            }
            Rule::pair => {
                let mut parts = inner.into_inner();
                let name = self.name(&parts.next()?);
                let (item, span) = self.item(parts.next()?)?;
                Some(Argument { name: Some(name), item, span: name.span.to(span) })
            }
            _ => {
                let (item, span) = self.item(inner)?;
                Some(Argument { name: None, item, span })
            }
        }
    }

    fn item(&mut self, pair: Pair<'_, Rule>) -> Option<(Item<'s>, Span)> {
        let mut parts = pair.into_inner();
        let first = self.value(parts.next()?)?;
        let Some(next) = parts.next() else {
            return Some((Item::One(first), first.span));
        };
        if next.as_rule() == Rule::value {
            let mut list = vec![first, self.value(next)?];
            for pair in parts {
                list.push(self.value(pair)?);
            }
            let end = list.last().map_or(first.span, |last| last.span);
            return Some((Item::List(list), first.span.to(end)));
        }
        let second = self.value(parts.next()?)?;
        let span = first.span.to(second.span);
        Some(match next.as_rule() {
            Rule::arrow => (Item::Arrow(first, second), span),
            _ => (Item::Range(first, second), span),
        })
    }

    /// A `value` or a `time`. `None` where it could not be read, which was reported.
    fn value(&mut self, pair: Pair<'_, Rule>) -> Option<Value<'s>> {
        let mut negative = None;
        for inner in pair.into_inner() {
            let mut span = self.span(&inner);
            let text = self.source.slice(span);
            let kind = match inner.as_rule() {
                Rule::sign => {
                    negative = Some(span);
                    continue;
                }
                Rule::number => self.number(inner)?,
                Rule::beats => ValueKind::Number(NumberShape::Beats, text),
                Rule::ratio => ValueKind::Number(NumberShape::Ratio, text),
                Rule::text => ValueKind::Text(text),
                Rule::word | Rule::name => ValueKind::Word(text),
                rule => {
                    let mut parts = inner.into_inner();
                    let name = (rule == Rule::call).then(|| parts.next()).flatten();
                    let name = name.map(|name| self.name(&name).text);
                    if let Some(wrong) = parts.find(|part| part.as_rule() == Rule::wrong) {
                        self.junk(&wrong);
                        return None;
                    }
                    name.map_or(ValueKind::Paren, ValueKind::Call)
                }
            };
            if let Some(sign) = negative {
                span = sign.to(span);
            }
            return Some(Value { negative: negative.is_some(), kind, span });
        }
        None
    }

    fn number(&mut self, pair: Pair<'_, Rule>) -> Option<ValueKind<'s>> {
        let inner = pair.into_inner().next()?;
        let span = self.span(&inner);
        let text = self.source.slice(span);
        let shape = match inner.as_rule() {
            Rule::hex => NumberShape::Hex,
            Rule::duration => NumberShape::Duration,
            Rule::plain => NumberShape::Plain,
            _ => NumberShape::Odd,
        };
        Some(ValueKind::Number(shape, text))
    }

    fn no_blank(&mut self, left: Span, right: Span) {
        let (first, second) = (self.source.slice(left), self.source.slice(right));
        self.diagnostics.push(Diagnostic::new(
            Code::Syntax,
            left.to(right),
            "a blank is missing between two arguments",
            format!("write `{first} {second}`, or `({first}{second})` for a calculation"),
        ));
    }

    fn empty_place(&mut self, pair: &Pair<'_, Rule>) {
        // The place has no width; show the `;` behind it, or else the one before it.
        let at = self.offset + pair.as_span().start();
        let (before, behind) = self.source.text().split_at_checked(at).unwrap_or_default();
        let blanks = behind.len() - behind.trim_start_matches([' ', '\t']).len();
        let at = if behind.get(blanks..).is_some_and(|rest| rest.starts_with(';')) {
            at + blanks
        } else {
            before.trim_end().len().saturating_sub(1)
        };
        // A lone `;` has an empty place on both sides.
        if self.empty_at.replace(at) == Some(at) {
            return;
        }
        self.diagnostics.push(Diagnostic::new(
            Code::EmptyPlace,
            Span::new(at, at + 1),
            "`;` joins two commands, but one is missing here",
            "take the `;` away; a line ends by itself",
        ));
    }

    fn behind(&mut self, pair: &Pair<'_, Rule>) {
        let span = self.span(pair);
        let help = if self.source.slice(span).starts_with("else") {
            "put the `{` on the line of its `else`"
        } else {
            "put it on a line of its own, or a `;` before it to start both together"
        };
        self.diagnostics.push(Diagnostic::new(
            Code::Syntax,
            span,
            "a block ends its statement, but something stands behind it",
            help,
        ));
    }

    fn junk(&mut self, pair: &Pair<'_, Rule>) {
        let start = self.offset + pair.as_span().start();
        let text = pair.as_str().trim_end();
        let first = text.chars().next().unwrap_or(' ');
        if first == '"' {
            // A text without its end, which the scan has reported.
            return;
        }
        // Point at the first character; the rest may be fine.
        let span = Span::new(start, start + first.len_utf8());
        let help = match first {
            '.' => "write digits on both sides of the point: `0.5`, not `.5` or `5.`",
            '\'' | '`' | '“' | '”' | '„' => "write texts between plain quotation marks: `\"text\"`",
            '/' => "a comment starts with `#`",
            ',' => "arguments stand behind each other with a blank between them: `wheels 8 -8 -8 8`",
            '=' => "write a named argument as NAME=VALUE, such as `x=10`",
            ':' => "a `:` only stands behind the names of robots at the start of a line",
            '+' => "a line starts with the name of a command, `at TIME` or `+TIME`",
            '-' if text.starts_with("->") => "an arrow stands between two values, such as `0 -> 12`",
            '–' | '−' | '—' => "write the minus sign of your keyboard, `-`",
            _ => "take it away; an argument is a number with its unit, a word, or a calculation in parentheses",
        };
        self.diagnostics.push(Diagnostic::new(Code::Syntax, span, format!("`{first}` cannot be read here"), help));
    }
}
