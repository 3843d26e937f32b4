//! Arguments: pest's pairs to values, ranges and lists.

use pest::iterators::{Pair, Pairs};

use super::ast::{Argument, Block, Expression, Item, Name, NumberShape, Value, ValueKind};
use super::build::Builder;
use super::errors;
use super::grammar::Rule;
use crate::source::Span;

impl<'s> Builder<'s, '_> {
    /// Arguments, the block after them, and whether everything could be read.
    pub(super) fn arguments(&mut self, pairs: Pairs<'_, Rule>) -> (Vec<Argument<'s>>, Option<Block<'s>>, bool) {
        let mut arguments: Vec<Argument<'s>> = Vec::new();
        let mut block = None;
        let mut readable = true;
        let mut junk = false;
        // A calculation that lacks its parentheses, from its first value on, and whether it ends in an operator.
        let mut sum: Option<(Span, bool)> = None;
        for pair in pairs {
            match pair.as_rule() {
                Rule::block => block = Some(self.block(pair)),
                Rule::junk => {
                    // One message per statement: what follows is often part of the same mistake.
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
                        self.diagnostics.push(errors::needs_space(
                            first,
                            second,
                            last.span.to(argument.span),
                            (self.statement_text(), self.statement),
                        ));
                    }
                    arguments.push(argument);
                }
            }
        }
        if let Some((span, _)) = sum.filter(|_| !junk) {
            readable = false;
            self.diagnostics.push(errors::needs_parentheses(self.source.slice(span), span));
        }
        (arguments, block, readable && !junk)
    }

    /// One argument. An arithmetic operator is not an argument: it extends `sum`.
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
    pub(super) fn value(&mut self, pair: Pair<'_, Rule>) -> Option<Value<'s>> {
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
}
