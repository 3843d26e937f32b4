//! pest's pairs to the tree. What the grammar kept only for its message is reported here, and its statement left out, so
//! that one mistake is one message.

use std::sync::Arc;

use pest::error::InputLocation;
use pest::iterators::{Pair, Pairs};

use super::ast::{
    Argument, Block, Call, CallArgument, Command, Def, If, Item, Let, Line, Lost, Moment, Name, Node, NodeKind,
    NumberShape, Origin, Parameter, Part, Start, Statement, StoredLine, Value, ValueKind,
};
use super::errors::{self, Unreadable};
use super::foreign;
use super::grammar::Rule;
use super::scan::{Outline, Scanned};
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
    /// Where the statement begins that is being read.
    pub(super) statement: usize,
}

impl<'s, 'd> Builder<'s, 'd> {
    pub(super) fn new(scanned: &'d Scanned<'s>, outline: &'d Outline<'d>, diagnostics: &'d mut Diagnostics) -> Self {
        let (lines, lost, statement) = (Vec::new(), Vec::new(), scanned.source.base() as usize);
        Builder {
            source: scanned.source,
            scanned,
            outline,
            diagnostics,
            lines,
            lost,
            lost_any: false,
            empty_at: None,
            statement,
        }
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
        self.diagnostics.push(errors::unparsable(self.place(at)));
    }

    /// The place in the source of one in the text that pest has read.
    fn place(&self, at: usize) -> usize {
        self.source.base() as usize + self.outline.place(at)
    }

    /// What was added, and what was lost.
    pub(super) fn finish(self) -> (Vec<Line<'s>>, Lost<'s>) {
        (self.lines, Lost { names: self.lost.into_iter().collect(), any: self.lost_any })
    }

    /// The place of a pair, without spaces after it. Rules that are neither atomic nor end in a bracket may also have
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
    pub(super) fn block(&mut self, pair: Pair<'_, Rule>) -> Block<'s> {
        let span = self.span(&pair);
        let brace = self.outline.place(pair.as_span().start());
        let lines = match self.scanned.block(brace) {
            Some(inside) => self.long_block(inside),
            None => pair
                .into_inner()
                .filter_map(|line| self.line(line))
                .map(|line| StoredLine::Tree(Box::new(line)))
                .collect(),
        };
        Block::new(lines, span)
    }

    fn line(&mut self, pair: Pair<'_, Rule>) -> Option<Line<'s>> {
        let mut line = None;
        for (place, child) in pair.into_inner().enumerate() {
            match child.as_rule() {
                Rule::part => self.part(place, child, &mut line),
                Rule::empty => self.empty_place(&child),
                _ => self.after_block(&child),
            }
        }
        line
    }

    /// Adds one part to its line; `place` counts the parts and the empty places of the line.
    fn part(&mut self, place: usize, pair: Pair<'_, Rule>, line: &mut Option<Line<'s>>) {
        let from = self.place(pair.as_span().start());
        let outer = std::mem::replace(&mut self.statement, from);
        self.part_of_line(place, pair, line);
        self.statement = outer;
    }

    fn part_of_line(&mut self, place: usize, pair: Pair<'_, Rule>, line: &mut Option<Line<'s>>) {
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
            self.diagnostics.push(errors::late_start(*span));
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
            self.diagnostics.push(errors::no_time(word.text, word.span));
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

    /// A start time or robots, and nothing after them.
    fn no_statement(&mut self, robot: Option<&Name<'s>>, started: Option<(Start<'s>, Span)>) {
        if let Some(robot) = robot {
            if let Some(found) = foreign::statement(self.statement_text(), self.statement) {
                return self.diagnostics.push(found.diagnostic());
            }
            self.diagnostics.push(errors::no_command_for(robot.text, robot.span));
        } else if let Some((start, span)) = started {
            let written = match &start {
                Start::At(moment) if moment.word().is_some() => "at 0.5s",
                _ => self.source.slice(span),
            };
            self.diagnostics.push(errors::no_command(written, span));
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
            self.diagnostics.push(errors::unquoted_file(name, whole));
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
                arguments.push(CallArgument { name, value: self.expression(value)? });
            }
            return Some(Statement::Call(Call { name, arguments, span }));
        }
        let (arguments, _, readable) = self.arguments(pair.into_inner());
        if !readable {
            return None;
        }
        let first = arguments.first()?;
        let written = self.source.slice(first.span);
        let error = match &first.item {
            Item::One(Value { kind: ValueKind::Expression(expression), .. }) if first.name.is_none() => {
                match expression.nodes.last() {
                    Some(Node { kind: NodeKind::Call(name, _), .. }) => {
                        errors::after_call(written, name, (expression.span, self.statement_text()))
                    }
                    _ => errors::starts_with_no_word(written, first.span),
                }
            }
            Item::One(Value { kind: ValueKind::Number(NumberShape::Duration | NumberShape::Beats, _), .. }) => {
                errors::starts_with_time(written, first.span)
            }
            _ => errors::starts_with_no_word(written, first.span),
        };
        self.diagnostics.push(error);
        None
    }

    fn empty_place(&mut self, pair: &Pair<'_, Rule>) {
        // The place has no width; show the `;` after it, or else the one before it.
        let base = self.source.base() as usize;
        let at = self.outline.place(pair.as_span().start());
        let (before, after) = self.source.text().split_at_checked(at).unwrap_or_default();
        let spaces = after.len() - after.trim_start_matches([' ', '\t']).len();
        let at = if after.get(spaces..).is_some_and(|rest| rest.starts_with(';')) {
            at + spaces
        } else {
            before.trim_end().len().saturating_sub(1)
        };
        // A lone `;` has an empty place on both sides.
        if self.empty_at.replace(at) == Some(at) {
            return;
        }
        self.diagnostics.push(errors::empty_command(Span::new(base + at, base + at + 1)));
    }

    fn after_block(&mut self, pair: &Pair<'_, Rule>) {
        let span = self.span(pair);
        self.diagnostics.push(errors::after_block(self.source.slice(span), span));
    }

    pub(super) fn junk(&mut self, pair: &Pair<'_, Rule>) {
        let span = self.span(pair);
        let (base, source) = (self.source.base() as usize, self.source.text());
        let start = span.range().start;
        // Not trimmed: it may be a no-break space.
        let text = source.get(start - base..start - base + pair.as_str().len()).unwrap_or_default();
        // A quotation mark without its partner was reported by the scan, which has removed the string.
        if !text.starts_with('"') || text == pair.as_str() {
            let before = source.get(..start - base).and_then(|text| text.rsplit('\n').next()).unwrap_or_default();
            let (statement, statement_start) = (self.statement_text(), self.statement);
            self.diagnostics.push(errors::unreadable(&Unreadable { text, start, before, statement, statement_start }));
        }
    }

    /// The text from the start of the statement that is being read.
    pub(super) fn statement_text(&self) -> &'s str {
        self.source.text().get(self.statement - self.source.base() as usize..).unwrap_or_default()
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
