//! Expressions: pest gives operands and operators as they stand; here they are sorted by how they bind.

use pest::iterators::Pair;

use super::ast::{Binary, Expression, Name, Node, NodeKind, NumberShape};
use super::build::Builder;
use super::errors;
use super::grammar::Rule;
use crate::source::Span;

/// An operator that waits for its right operand.
struct Waiting {
    operator: Operator,
    span: Span,
    /// The place of the jump of an `and` or `or`.
    jump: usize,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Operator {
    Negate,
    Not,
    Binary(Binary),
}

impl Operator {
    /// How tightly it binds.
    fn binding(self) -> u8 {
        match self {
            Operator::Negate => 7,
            Operator::Binary(Binary::Multiply | Binary::Divide | Binary::Remainder) => 6,
            Operator::Binary(Binary::Add | Binary::Subtract) => 5,
            Operator::Binary(Binary::And) => 2,
            Operator::Binary(Binary::Or) => 1,
            Operator::Binary(_) => 4,
            Operator::Not => 3,
        }
    }
}

impl<'s> Builder<'s, '_> {
    /// An expression; `None` where something in it could not be read, which was reported.
    pub(super) fn expression(&mut self, pair: Pair<'_, Rule>) -> Option<Expression<'s>> {
        let mut nodes = Vec::new();
        let mut span = None;
        self.flatten(pair, &mut nodes, &mut span)?;
        Some(Expression { nodes, span: span? })
    }

    /// Appends the steps of an expression. Operators wait on a stack until what binds tighter is done; the recursion into
    /// parentheses is bounded by the scan.
    fn flatten(&mut self, pair: Pair<'_, Rule>, nodes: &mut Vec<Node<'s>>, span: &mut Option<Span>) -> Option<()> {
        let mut waiting: Vec<Waiting> = Vec::new();
        let mut whole: Option<Span> = None;
        let mut grow = |part: Span| whole = Some(whole.map_or(part, |whole| whole.to(part)));
        for part in pair.into_inner() {
            let at = self.span(&part);
            if part.as_rule() == Rule::infix {
                let operator = Operator::Binary(binary(self.source.slice(at)));
                while let Some(top) = waiting.pop_if(|top| top.operator.binding() >= operator.binding()) {
                    if top.operator.binding() == 4 && operator.binding() == 4 {
                        self.diagnostics.push(errors::chained(top.span.to(at)));
                        return None;
                    }
                    finish(&top, nodes);
                }
                let jump = nodes.len();
                if let Operator::Binary(lazy @ (Binary::And | Binary::Or)) = operator {
                    nodes.push(Node { kind: NodeKind::Skip(lazy, 0), span: at });
                }
                waiting.push(Waiting { operator, span: at, jump });
                continue;
            }
            for inner in part.into_inner() {
                let at = self.span(&inner);
                grow(at);
                if inner.as_rule() == Rule::prefix {
                    let operator = if self.source.slice(at) == "-" { Operator::Negate } else { Operator::Not };
                    waiting.push(Waiting { operator, span: at, jump: 0 });
                } else {
                    self.operand(inner, nodes)?;
                }
            }
        }
        while let Some(top) = waiting.pop() {
            finish(&top, nodes);
        }
        *span = whole;
        Some(())
    }

    /// Appends one operand.
    pub(super) fn operand(&mut self, pair: Pair<'_, Rule>, nodes: &mut Vec<Node<'s>>) -> Option<()> {
        let span = self.span(&pair);
        let text = self.source.slice(span);
        let kind = match pair.as_rule() {
            Rule::number => {
                let (shape, text) = self.number(pair)?;
                NodeKind::Number(shape, text)
            }
            Rule::beats => NodeKind::Number(NumberShape::Beats, text),
            Rule::text => NodeKind::Text(text),
            Rule::paren => return self.parentheses(pair, nodes),
            Rule::call => {
                let (name, arguments) = self.call_parts(pair)?;
                let count = arguments.len();
                for (named, argument) in arguments {
                    if let Some(named) = named {
                        self.diagnostics.push(errors::named_in_a_function(name.text, named.span));
                        return None;
                    }
                    self.flatten(argument, nodes, &mut None)?;
                }
                NodeKind::Call(name.text, count)
            }
            _ => NodeKind::Name(text),
        };
        nodes.push(Node { kind, span });
        Some(())
    }

    pub(super) fn number(&mut self, pair: Pair<'_, Rule>) -> Option<(NumberShape, &'s str)> {
        let inner = pair.into_inner().next()?;
        let text = self.source.slice(self.span(&inner));
        let shape = match inner.as_rule() {
            Rule::hex => NumberShape::Hex,
            Rule::duration => NumberShape::Duration,
            Rule::plain => NumberShape::Plain,
            _ => NumberShape::Odd,
        };
        Some((shape, text))
    }

    fn parentheses(&mut self, pair: Pair<'_, Rule>, nodes: &mut Vec<Node<'s>>) -> Option<()> {
        let span = self.span(&pair);
        let mut done = false;
        for inner in pair.into_inner() {
            if inner.as_rule() == Rule::wrong {
                self.junk(&inner);
                return None;
            }
            self.flatten(inner, nodes, &mut None)?;
            done = true;
        }
        if !done {
            self.diagnostics.push(errors::empty_parentheses(span));
            return None;
        }
        Some(())
    }

    /// The name of a call and its arguments.
    #[expect(clippy::type_complexity, reason = "used in two places, next to each other")]
    pub(super) fn call_parts<'p>(
        &mut self,
        pair: Pair<'p, Rule>,
    ) -> Option<(Name<'s>, Vec<(Option<Name<'s>>, Pair<'p, Rule>)>)> {
        let mut parts = pair.into_inner();
        let name = self.name(&parts.next()?);
        let mut arguments = Vec::new();
        for part in parts {
            if part.as_rule() == Rule::wrong {
                self.junk(&part);
                return None;
            }
            let mut inner = part.into_inner();
            let first = inner.next()?;
            arguments.push(match inner.next() {
                Some(value) => (Some(self.name(&first)), value),
                None => (None, first),
            });
        }
        Some((name, arguments))
    }
}

/// Appends an operator whose operands are done.
fn finish(top: &Waiting, nodes: &mut Vec<Node<'_>>) {
    let kind = match top.operator {
        Operator::Negate => NodeKind::Negate,
        Operator::Not => NodeKind::Not,
        Operator::Binary(binary) => NodeKind::Binary(binary),
    };
    nodes.push(Node { kind, span: top.span });
    let after = nodes.len();
    if let Some(Node { kind: NodeKind::Skip(_, over), .. }) = nodes.get_mut(top.jump)
        && matches!(top.operator, Operator::Binary(Binary::And | Binary::Or))
    {
        *over = after - top.jump - 1;
    }
}

fn binary(sign: &str) -> Binary {
    match sign {
        "+" => Binary::Add,
        "-" => Binary::Subtract,
        "*" => Binary::Multiply,
        "/" => Binary::Divide,
        "%" => Binary::Remainder,
        "<" => Binary::Less,
        "<=" => Binary::LessOrEqual,
        ">" => Binary::Greater,
        ">=" => Binary::GreaterOrEqual,
        "==" => Binary::Equal,
        "and" => Binary::And,
        _ => Binary::Or,
    }
}
