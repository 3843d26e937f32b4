//! pest's pairs to the tree. What the grammar kept only for its message is reported here, and its statement left out, so
//! that one mistake is one message.

use std::sync::Arc;

use pest::error::InputLocation;
use pest::iterators::{Pair, Pairs};

use super::ast::{
    Argument, Block, Call, Command, Def, Expression, Given, If, Item, Kept, Let, Line, Lost, Moment, Name, Node,
    NodeKind, NumberShape, Origin, Parameter, Part, Start, Statement, Value, ValueKind,
};
use super::grammar::Rule;
use super::scan::{Outline, Scanned};
use super::trouble;
use crate::diagnostic::Diagnostics;
use crate::source::{Source, Span};

pub(super) struct Builder<'s, 'd> {
    pub(super) source: &'s Source,
    pub(super) scanned: &'d Scanned<'s>,
    /// The text that pest has read.
    outline: &'d Outline<'d>,
    pub(super) diagnostics: &'d mut Diagnostics,
    lines: Vec<Line<'s>>,
    /// Names whose `let` or `def` could not be read, or is being read.
    pub(super) lost: Vec<&'s str>,
    /// Whether a `use` could not be read.
    pub(super) lost_any: bool,
    /// The last `;` that was reported to join nothing.
    empty_at: Option<usize>,
}

impl<'s, 'd> Builder<'s, 'd> {
    pub(super) fn new(scanned: &'d Scanned<'s>, outline: &'d Outline<'d>, diagnostics: &'d mut Diagnostics) -> Self {
        let (lines, lost) = (Vec::new(), Vec::new());
        Builder { source: scanned.source, scanned, outline, diagnostics, lines, lost, lost_any: false, empty_at: None }
    }

    /// Adds the lines that pest has read.
    pub(super) fn add(&mut self, pairs: Pairs<'_, Rule>) {
        for pair in pairs.flat_map(Pair::into_inner) {
            if pair.as_rule() == Rule::line {
                let line = self.line(pair);
                self.lines.extend(line);
            }
        }
    }

    /// A part that the grammar cannot read at all, which a script that passed the scan should never have.
    pub(super) fn unreadable(&mut self, error: &pest::error::Error<Rule>) {
        let (InputLocation::Pos(at) | InputLocation::Span((at, _))) = error.location;
        self.diagnostics.push(trouble::beyond_the_grammar(self.place(at)));
    }

    /// The place in the source of one in the text that pest has read.
    fn place(&self, at: usize) -> usize {
        self.source.base() as usize + self.outline.place(at)
    }

    /// What was added, and what was lost.
    pub(super) fn finish(self) -> (Vec<Line<'s>>, Lost<'s>) {
        (self.lines, Lost { names: self.lost.into_iter().collect(), any: self.lost_any })
    }

    /// The place of a pair, without blanks behind it. Rules that are neither atomic nor end in a bracket may also have
    /// swallowed a comment, so their places are put together from their children.
    pub(super) fn span(&self, pair: &Pair<'_, Rule>) -> Span {
        let start = pair.as_span().start();
        Span::new(self.place(start), self.place(start + pair.as_str().trim_end().len()))
    }

    pub(super) fn name(&self, pair: &Pair<'_, Rule>) -> Name<'s> {
        let span = self.span(pair);
        Name { text: self.source.slice(span), span }
    }

    /// The recursion over blocks is bounded by the depth of brackets, which the scan has checked.
    fn block(&mut self, pair: Pair<'_, Rule>) -> Block<'s> {
        let span = self.span(&pair);
        let brace = self.outline.place(pair.as_span().start());
        let lines = match self.scanned.block(brace) {
            Some(inside) => self.long_block(inside),
            None => {
                pair.into_inner().filter_map(|line| self.line(line)).map(|line| Kept::Tree(Box::new(line))).collect()
            }
        };
        Block::new(lines, span)
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
        let mut described = None;
        for child in pair.into_inner() {
            match child.as_rule() {
                Rule::start => started = self.start(child),
                Rule::robots => robots = child.into_inner().map(|name| self.name(&name)).collect(),
                _ => described = child.into_inner().next(),
            }
        }
        if let (Some((_, span)), true) = (&started, place > 0) {
            self.diagnostics.push(trouble::late_start(*span));
            return;
        }
        let Some(described) = described else {
            self.no_statement(robots.last(), started);
            return;
        };
        if let (Some((Start::At(moment), _)), Rule::stray) = (&started, described.as_rule())
            && lone_call(&described).is_none()
            && let Some(word) = moment.word()
        {
            self.diagnostics.push(trouble::no_time(word.text, word.span));
            return;
        }
        let Some(statement) = self.statement(described) else {
            return;
        };
        let span = started.as_ref().map_or(statement.span(), |(_, start)| start.to(statement.span()));
        let part = Part { robots, statement };
        match line {
            Some(line) => {
                line.span = line.span.to(span);
                line.parts.push(part);
            }
            None => *line = Some(Line { start: started.map(|(start, _)| start), parts: vec![part], span }),
        }
    }

    /// A start time or robots, and nothing behind them.
    fn no_statement(&mut self, robot: Option<&Name<'s>>, started: Option<(Start<'s>, Span)>) {
        if let Some(robot) = robot {
            self.diagnostics.push(trouble::no_command_for(robot.text, robot.span));
        } else if let Some((start, span)) = started {
            let written = match &start {
                Start::At(moment) if moment.word().is_some() => "at 0.5s",
                _ => self.source.slice(span),
            };
            self.diagnostics.push(trouble::no_command(written, span));
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
            let from = self.span(&first);
            let mut parts = first.into_inner().filter(|part| part.as_rule() == Rule::count);
            let bar = self.value(parts.next()?)?;
            let beat = match parts.next() {
                Some(beat) => Some(self.value(beat)?),
                None => None,
            };
            let last = beat.as_ref().map_or(bar.span, |beat| beat.span);
            (Origin::Bar(Box::new((bar, beat))), Span { end: last.end, ..from })
        } else {
            let value = self.value(first)?;
            let span = value.span;
            (Origin::Value(value), span)
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
            Rule::let_ => self.let_(pair).map(Statement::Let),
            Rule::def => self.def(pair),
            _ => self.if_(pair),
        }
    }

    /// A `let`, or the `NAME=VALUE` of an option.
    pub(super) fn let_(&mut self, pair: Pair<'_, Rule>) -> Option<Let<'s>> {
        let from = self.span(&pair);
        let mut parts = pair.into_inner().filter(|part| part.as_rule() != Rule::kw_let);
        let name = self.name(&parts.next()?);
        self.lost.push(name.text);
        let mut value = None;
        for part in parts {
            if part.as_rule() == Rule::junk {
                self.junk(&part);
                return None;
            }
            value = Some(self.expression(part)?);
        }
        let value = value?;
        self.lost.pop();
        let span = Span { end: value.span.end, ..from };
        Some(Let { name, value, span })
    }

    fn def(&mut self, pair: Pair<'_, Rule>) -> Option<Statement<'s>> {
        let from = self.span(&pair);
        let mut parts = pair.into_inner().skip(1);
        let name = self.name(&parts.next()?);
        self.lost.push(name.text);
        let place = self.lost.len();
        let mut parameters = Vec::new();
        let mut readable = true;
        for part in parts {
            match part.as_rule() {
                Rule::parameter => {
                    let mut inner = part.into_inner();
                    let name = self.name(&inner.next()?);
                    let default = match inner.next() {
                        Some(default) => Some(self.expression(default)?),
                        None => None,
                    };
                    parameters.push(Parameter { name, default });
                }
                Rule::block => {
                    let body = self.block(part);
                    let span = Span { end: body.span.start, ..from };
                    if readable {
                        self.lost.remove(place - 1);
                    }
                    let def = Def { name, parameters, body, span };
                    return readable.then(|| Statement::Def(Arc::new(def)));
                }
                _ => {
                    readable = false;
                    self.junk(&part);
                }
            }
        }
        None
    }

    fn if_(&mut self, pair: Pair<'_, Rule>) -> Option<Statement<'s>> {
        let from = self.span(&pair);
        let span = Span { end: from.start + 2, ..from };
        let (mut arms, mut otherwise, mut condition) = (Vec::new(), None, None);
        let mut readable = true;
        for part in pair.into_inner() {
            match part.as_rule() {
                Rule::expression => {
                    condition = Some(self.expression(part));
                }
                Rule::block => {
                    let block = self.block(part);
                    match condition.take() {
                        Some(Some(condition)) => arms.push((condition, block)),
                        Some(None) => readable = false,
                        None => otherwise = Some(block),
                    }
                }
                Rule::junk => {
                    readable = false;
                    self.junk(&part);
                }
                _ => {}
            }
        }
        readable.then_some(Statement::If(If { arms, otherwise, span }))
    }

    fn command(&mut self, pair: Pair<'_, Rule>) -> Option<Statement<'s>> {
        let whole = self.span(&pair);
        let mut inner = pair.into_inner();
        let head = self.name(&inner.next()?);
        if head.text == "use" && inner.peek().is_some_and(|first| !first.as_str().trim_start().starts_with('"')) {
            let name = self.source.slice(Span { start: head.span.end, ..whole }).trim().trim_matches(['\'', '`']);
            self.lost_any = true;
            self.diagnostics.push(trouble::file_without_marks(name, whole));
            return None;
        }
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
        if let Some(call) = lone_call(&pair) {
            let span = self.span(&call);
            let (name, parts) = self.call_parts(call)?;
            let mut arguments = Vec::new();
            for (name, value) in parts {
                arguments.push(Given { name, value: self.expression(value)? });
            }
            return Some(Statement::Call(Call { name, arguments, span }));
        }
        let (arguments, _, readable) = self.arguments(pair.into_inner());
        if !readable {
            return None;
        }
        let first = arguments.first()?;
        let written = self.source.slice(first.span);
        let trouble = match &first.item {
            Item::One(Value { kind: ValueKind::Expression(expression), .. }) if first.name.is_none() => {
                match expression.nodes.last() {
                    Some(Node { kind: NodeKind::Call(name, _), .. }) => {
                        trouble::behind_a_call(written, name, expression.span)
                    }
                    _ => trouble::starts_with_no_word(first.span),
                }
            }
            Item::One(Value { kind: ValueKind::Number(NumberShape::Duration | NumberShape::Beats, _), .. }) => {
                trouble::starts_with_time(written, first.span)
            }
            _ => trouble::starts_with_no_word(first.span),
        };
        self.diagnostics.push(trouble);
        None
    }

    /// Arguments, the block behind them, and whether everything could be read.
    fn arguments(&mut self, pairs: Pairs<'_, Rule>) -> (Vec<Argument<'s>>, Option<Block<'s>>, bool) {
        let mut arguments: Vec<Argument<'s>> = Vec::new();
        let mut block = None;
        let mut readable = true;
        let mut junk = false;
        // A calculation that lacks its parentheses, from its first value on, and whether it ends in a sign.
        let mut sum: Option<(Span, bool)> = None;
        for pair in pairs {
            match pair.as_rule() {
                Rule::block => block = Some(self.block(pair)),
                Rule::junk => {
                    // One message for a statement: what stands behind is often part of the same mistake.
                    if !junk {
                        self.junk(&pair);
                    }
                    junk = true;
                }
                _ if junk => {}
                _ => {
                    let last = arguments.last();
                    let Some(argument) = self.argument(pair, &mut sum, &mut junk, last) else {
                        readable = false;
                        continue;
                    };
                    if let Some((span, open @ true)) = &mut sum {
                        *span = span.to(argument.span);
                        *open = false;
                    } else if let Some(last) = last.filter(|last| last.touches(&argument)) {
                        readable = false;
                        let (first, second) = (self.source.slice(last.span), self.source.slice(argument.span));
                        self.diagnostics.push(trouble::lacks_blank(first, second, last.span.to(argument.span)));
                    }
                    arguments.push(argument);
                }
            }
        }
        if let Some((span, _)) = sum {
            readable = false;
            self.diagnostics.push(trouble::lacks_parentheses(self.source.slice(span), span));
        }
        (arguments, block, readable && !junk)
    }

    /// One argument. An arithmetic sign is none: it widens `sum`.
    fn argument(
        &mut self,
        pair: Pair<'_, Rule>,
        sum: &mut Option<(Span, bool)>,
        junk: &mut bool,
        before: Option<&Argument<'s>>,
    ) -> Option<Argument<'s>> {
        let inner = pair.into_inner().next()?;
        match inner.as_rule() {
            Rule::operator => {
                let span = self.span(&inner);
                let sign = self.source.slice(span);
                if sign == "->" {
                    self.junk(&inner);
                    *junk = true;
                    return None;
                }
                if matches!(sign, "+" | "-" | "*" | "/" | "%") {
                    let Some(before) = before else {
                        self.junk(&inner);
                        *junk = true;
                        return None;
                    };
                    let from = sum.map_or_else(|| before.last_value(), |(sum, _)| sum);
                    *sum = Some((from.to(span), true));
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
        let from = first.span;
        let Some(next) = parts.next() else {
            return Some((Item::One(first), from));
        };
        if next.as_rule() == Rule::value {
            let mut list = vec![first, self.value(next)?];
            for pair in parts {
                list.push(self.value(pair)?);
            }
            let end = list.last().map_or(from, |last| last.span);
            return Some((Item::List(list), from.to(end)));
        }
        let second = self.value(parts.next()?)?;
        let span = from.to(second.span);
        Some(match next.as_rule() {
            Rule::arrow => (Item::Arrow(Box::new((first, second))), span),
            _ => (Item::Range(Box::new((first, second))), span),
        })
    }

    /// A `value` or a `time`. `None` where it could not be read, which was reported.
    fn value(&mut self, pair: Pair<'_, Rule>) -> Option<Value<'s>> {
        let mut sign: Option<Span> = None;
        for inner in pair.into_inner() {
            let span = self.span(&inner);
            let text = self.source.slice(span);
            let kind = match inner.as_rule() {
                Rule::sign => {
                    sign = Some(span);
                    continue;
                }
                Rule::number => {
                    let (shape, text) = self.number(inner)?;
                    ValueKind::Number(shape, text)
                }
                Rule::beats => ValueKind::Number(NumberShape::Beats, text),
                Rule::ratio => ValueKind::Number(NumberShape::Ratio, text),
                Rule::text => ValueKind::Text(text),
                Rule::word | Rule::name => ValueKind::Word(text),
                _ => {
                    let mut nodes = Vec::new();
                    self.operand(inner, &mut nodes)?;
                    ValueKind::Expression(Box::new(Expression { nodes, span }))
                }
            };
            let span = sign.map_or(span, |sign| sign.to(span));
            return Some(Value { negative: sign.is_some(), kind, span });
        }
        None
    }

    fn empty_place(&mut self, pair: &Pair<'_, Rule>) {
        // The place has no width; show the `;` behind it, or else the one before it.
        let base = self.source.base() as usize;
        let at = self.outline.place(pair.as_span().start());
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
        self.diagnostics.push(trouble::joins_nothing(Span::new(base + at, base + at + 1)));
    }

    fn behind(&mut self, pair: &Pair<'_, Rule>) {
        let span = self.span(pair);
        self.diagnostics.push(trouble::behind_a_block(self.source.slice(span), span));
    }

    pub(super) fn junk(&mut self, pair: &Pair<'_, Rule>) {
        let span = self.span(pair);
        let text = self.source.slice(span);
        // A quotation mark without its partner was reported by the scan.
        if !text.starts_with('"') {
            let text_before = self.source.text().get(..span.range().start - self.source.base() as usize);
            let before = text_before.and_then(|text| text.rsplit('\n').next()).unwrap_or_default();
            self.diagnostics.push(trouble::unreadable(text, span.range().start, before));
        }
    }
}

/// The call that a stray statement is, if it is nothing else.
fn lone_call<'p>(stray: &Pair<'p, Rule>) -> Option<Pair<'p, Rule>> {
    let mut only = stray.clone();
    // stray, argument, item, value: each with one child, down to the call.
    for _ in 0..4 {
        let mut inner = only.into_inner();
        only = inner.next()?;
        if inner.next().is_some() {
            return None;
        }
    }
    (only.as_rule() == Rule::call).then_some(only)
}
