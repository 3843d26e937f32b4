//! The tree of a script, with no meaning yet. Names and numbers are slices of the source.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::source::Span;

/// A whole script.
#[derive(Debug, PartialEq, Eq)]
pub struct Ast<'s> {
    /// Its lines, as a block without braces.
    pub body: Block<'s>,
    /// What could not be read of it and names something.
    pub lost: Lost<'s>,
}

/// Names whose definitions could not be read. Their uses are not reported as unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lost<'s> {
    /// Names whose `let` or `def` could not be read.
    pub names: BTreeSet<&'s str>,
    /// Whether a `use` could not be read, so that any name may be meant to exist.
    pub any: bool,
}

impl<'s> Lost<'s> {
    /// Whether nothing was lost.
    pub(crate) fn is_empty(&self) -> bool {
        self.names.is_empty() && !self.any
    }

    /// Whether this name may have been lost.
    pub(crate) fn may_hold(&self, name: &str) -> bool {
        self.any || self.names.contains(name)
    }

    /// Adds what was lost elsewhere.
    pub(crate) fn add(&mut self, other: Lost<'s>) {
        self.names.extend(other.names);
        self.any |= other.any;
    }
}

/// Lines that run one after another.
#[derive(Clone, Debug)]
pub struct Block<'s> {
    lines: Vec<StoredLine<'s>>,
    /// From the opening to the closing brace.
    pub span: Span,
}

/// A line as a block keeps it. The tree of a flat line takes twenty times the memory of its place, and is read again in no time.
#[derive(Clone, Debug)]
pub(super) enum StoredLine<'s> {
    Flat(&'s str, u32),
    Tree(Box<Line<'s>>),
}

/// A line of a block.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum LineRef<'b, 's> {
    /// The text of a flat line, from its first to its last part, and the offset of its first byte.
    Flat(&'s str, u32),
    /// Any other line.
    Tree(&'b Line<'s>),
}

impl LineRef<'_, '_> {
    /// From the first to the last part.
    pub fn span(self) -> Span {
        match self {
            LineRef::Flat(text, at) => Span::new(at as usize, at as usize + text.len()),
            LineRef::Tree(line) => line.span,
        }
    }
}

impl<'s> Block<'s> {
    pub(super) fn new(mut lines: Vec<StoredLine<'s>>, span: Span) -> Self {
        lines.shrink_to_fit();
        Block { lines, span }
    }

    /// How many lines there are.
    pub fn count(&self) -> usize {
        self.lines.len()
    }

    /// The lines, in the order written.
    pub fn places(&self) -> impl Iterator<Item = LineRef<'_, 's>> {
        self.lines.iter().map(|line| match line {
            StoredLine::Flat(text, at) => LineRef::Flat(text, *at),
            StoredLine::Tree(line) => LineRef::Tree(line),
        })
    }

    /// The trees of the lines, in the order written.
    pub fn lines(&self) -> impl Iterator<Item = Cow<'_, Line<'s>>> {
        self.places().map(LineRef::read)
    }
}

impl PartialEq for Block<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.span == other.span && self.lines().eq(other.lines())
    }
}

impl Eq for Block<'_> {}

/// One line: parts joined by `;` that start together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line<'s> {
    /// `at T` or `+D`, which covers the whole line.
    pub start: Option<Start<'s>>,
    /// The parts, in the order written. Empty only where the line was broken and said so.
    pub parts: Vec<Part<'s>>,
    /// From the first to the last part.
    pub span: Span,
}

impl<'s> Line<'s> {
    /// What its parts do.
    pub fn statements(&self) -> impl Iterator<Item = &Statement<'s>> {
        self.parts.iter().map(|part| &part.statement)
    }
}

/// When a line starts.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Start<'s> {
    /// `at T`: at a moment, independent of the lines before.
    At(Moment<'s>),
    /// `+D`: a time after the line before has ended.
    After(Value<'s>),
}

/// The moment of an `at`: where it counts from, and times added or subtracted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moment<'s> {
    /// What it counts from.
    pub origin: Origin<'s>,
    /// Times that follow it, each with whether it is subtracted.
    pub offsets: Vec<(bool, Value<'s>)>,
    /// From the origin to the last offset.
    pub span: Span,
}

impl<'s> Moment<'s> {
    /// The word that it counts from, if it is one.
    pub(super) fn word(&self) -> Option<Name<'s>> {
        match self.origin {
            Origin::Value(Value { kind: ValueKind::Word(text), span, .. }) => Some(Name { text, span }),
            _ => None,
        }
    }
}

/// What a moment counts from.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin<'s> {
    /// A time from the start of the block, or a mark's name.
    Value(Value<'s>),
    /// `bar N beat M`, counted from 1.
    Bar(Box<(Value<'s>, Option<Value<'s>>)>),
}

/// One statement of a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part<'s> {
    /// The robots it is said to; empty for all.
    pub robots: Vec<Name<'s>>,
    /// What is done.
    pub statement: Statement<'s>,
}

/// What is done.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Statement<'s> {
    /// Words and arguments, perhaps with a block.
    Command(Command<'s>),
    /// A bare block.
    Block(Block<'s>),
    /// A call of a `def`.
    Call(Call<'s>),
    /// A value gets a name.
    Let(Let<'s>),
    /// A phrase gets a name. It is kept as long as it can be called.
    Def(Arc<Def<'s>>),
    /// One of several blocks.
    If(If<'s>),
}

impl Statement<'_> {
    /// Its place.
    pub fn span(&self) -> Span {
        match self {
            Statement::Command(command) => command.span,
            Statement::Block(block) => block.span,
            Statement::Call(call) => call.span,
            Statement::Let(each) => each.span,
            Statement::Def(def) => def.span,
            Statement::If(each) => each.span,
        }
    }
}

/// `NAME(1, b = 2)`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call<'s> {
    /// What is called.
    pub name: Name<'s>,
    /// What it is given.
    pub arguments: Vec<CallArgument<'s>>,
    /// From the name to the closing bracket.
    pub span: Span,
}

/// One argument of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallArgument<'s> {
    /// The name in `NAME = VALUE`.
    pub name: Option<Name<'s>>,
    /// Its value.
    pub value: Expression<'s>,
}

/// `let NAME = VALUE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Let<'s> {
    /// The name.
    pub name: Name<'s>,
    /// The value.
    pub value: Expression<'s>,
    /// From `let` to the value.
    pub span: Span,
}

/// `def NAME(a, b = 5) { … }`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Def<'s> {
    /// The name.
    pub name: Name<'s>,
    /// What a call may give.
    pub parameters: Vec<Parameter<'s>>,
    /// What a call runs.
    pub body: Block<'s>,
    /// From `def` to the closing bracket of the parameters.
    pub span: Span,
}

/// A parameter of a `def`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter<'s> {
    /// Its name.
    pub name: Name<'s>,
    /// Its value where a call gives none.
    pub default: Option<Expression<'s>>,
}

/// `if … { … } else if … { … } else { … }`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct If<'s> {
    /// Conditions and their blocks, in order.
    pub arms: Vec<(Expression<'s>, Block<'s>)>,
    /// The block of the last `else`.
    pub otherwise: Option<Block<'s>>,
    /// The word `if`.
    pub span: Span,
}

impl<'s> If<'s> {
    /// Its blocks, one of which runs, or none.
    pub fn blocks(&self) -> impl Iterator<Item = &Block<'s>> {
        self.arms.iter().map(|(_, block)| block).chain(&self.otherwise)
    }
}

/// A word, its arguments, perhaps a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Command<'s> {
    /// The first word.
    pub head: Name<'s>,
    /// Its arguments, in the order written.
    pub arguments: Vec<Argument<'s>>,
    /// Its block.
    pub block: Option<Block<'s>>,
    /// From the head to the last argument or the closing brace.
    pub span: Span,
}

/// A word with its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name<'s> {
    /// The word.
    pub text: &'s str,
    /// Its place.
    pub span: Span,
}

/// One argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Argument<'s> {
    /// The name in `NAME=ARG`.
    pub name: Option<Name<'s>>,
    /// The value or values.
    pub item: Item<'s>,
    /// From the name or the first value to the last.
    pub span: Span,
}

impl<'s> Argument<'s> {
    /// The word, if it is nothing but a word.
    pub(crate) fn bare_word(&self) -> Option<Name<'s>> {
        match self.item {
            Item::One(Value { kind: ValueKind::Word(text), negative: false, span }) if self.name.is_none() => {
                Some(Name { text, span })
            }
            _ => None,
        }
    }
}

impl Argument<'_> {
    /// The place of its last value.
    pub(super) fn last_value(&self) -> Span {
        match &self.item {
            Item::One(value) => value.span,
            Item::Arrow(ends) | Item::Range(ends) => ends.1.span,
            Item::List(list) => list.last().map_or(self.span, |value| value.span),
            Item::Comparison(operator) => operator.span,
        }
    }

    /// Whether `next` follows it without a space between two values.
    pub(super) fn touches(&self, next: &Argument<'_>) -> bool {
        let is_operator = |argument: &Argument<'_>| matches!(argument.item, Item::Comparison(_));
        self.span.end == next.span.start && !is_operator(self) && !is_operator(next)
    }
}

/// The values of an argument.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Item<'s> {
    /// One value.
    One(Value<'s>),
    /// `A -> B`.
    Arrow(Box<(Value<'s>, Value<'s>)>),
    /// `A..B`.
    Range(Box<(Value<'s>, Value<'s>)>),
    /// `A,B,…`.
    List(Vec<Value<'s>>),
    /// A comparison operator, for `expect`.
    Comparison(Name<'s>),
}

/// One value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Value<'s> {
    /// Whether a minus directly precedes it.
    pub negative: bool,
    /// What it is.
    pub kind: ValueKind<'s>,
    /// With its minus.
    pub span: Span,
}

/// What a value is, before it has a meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ValueKind<'s> {
    /// A number with its unit.
    Number(NumberShape, &'s str),
    /// A string, as written, with its quotation marks.
    Text(&'s str),
    /// A word or a name.
    Word(&'s str),
    /// A call of a function, or an expression in parentheses.
    Expression(Box<Expression<'s>>),
}

/// A calculation, in the order in which it is done: operands before their operator. Flat, so that nothing that walks it can
/// run out of stack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Expression<'s> {
    /// Its parts; the last one gives the result.
    pub nodes: Vec<Node<'s>>,
    /// All of it.
    pub span: Span,
}

/// One step of a calculation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node<'s> {
    /// What is done.
    pub kind: NodeKind<'s>,
    /// The operand, or the operator.
    pub span: Span,
}

/// What one step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NodeKind<'s> {
    /// A number with its unit.
    Number(NumberShape, &'s str),
    /// A string with its quotation marks.
    Text(&'s str),
    /// A name.
    Name(&'s str),
    /// `-` before an operand.
    Negate,
    /// `not`.
    Not,
    /// An operator between the last two results.
    Binary(Binary),
    /// Skips this number of nodes, up to and including the operator, if the last result already decides an `and` or `or`.
    Skip(Binary, usize),
    /// A function of this number of the last results.
    Call(&'s str, usize),
}

/// An operator between two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Binary {
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`
    Divide,
    /// `%`
    Remainder,
    /// `<`
    Less,
    /// `<=`
    LessOrEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterOrEqual,
    /// `==`
    Equal,
    /// `and`
    And,
    /// `or`
    Or,
}

/// The shape of a number, as the grammar found it. Its digits are bounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NumberShape {
    /// `0x1F`.
    Hex,
    /// One or more numbers with time units: `1m30s`.
    Duration,
    /// A number, perhaps followed by letters: `90deg`.
    Plain,
    /// A number of beats or bars.
    Beats,
    /// `3/4`.
    Ratio,
    /// Anything else that starts with a digit.
    Odd,
}
