//! How much a block unrolls to at least, counted before anything is unrolled.

use super::words::{self, Operation, Word};
use crate::board::Board;
use crate::syntax::{Block, Command, Item, NumberShape, Statement, Value, ValueKind};

/// A lower bound: an `if` counts as its smallest branch, and a `repeat` whose number is calculated as one pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cost {
    pub(super) steps: u64,
    /// Commands to the board.
    pub(super) events: u64,
    pub(super) moves: u64,
    /// Bytes of what is neither: marks, lines to show, expectations and gates.
    pub(super) kept: u64,
}

/// What one mark, one line to show, one expectation and one gate take, on their whole way to the timeline, besides their texts.
pub(super) const MARK: u64 = 160;
pub(super) const SAY: u64 = 240;
pub(super) const EXPECT: u64 = 400;
pub(super) const GATE: u64 = 500;

impl Cost {
    pub(super) fn plus(self, other: Cost) -> Cost {
        self.with(other, u64::saturating_add)
    }

    fn smaller(self, other: Cost) -> Cost {
        self.with(other, u64::min)
    }

    pub(super) fn times(self, passes: u64) -> Cost {
        let passes = Cost { steps: passes, events: passes, moves: passes, kept: passes };
        self.with(passes, u64::saturating_mul)
    }

    fn with(self, other: Cost, each: impl Fn(u64, u64) -> u64) -> Cost {
        Cost {
            steps: each(self.steps, other.steps),
            events: each(self.events, other.events),
            moves: each(self.moves, other.moves),
            kept: each(self.kept, other.kept),
        }
    }
}

/// The cost of a block; `phrase` knows the cost of a `def`. The recursion is bounded by the depth of brackets.
pub(super) fn of_block(board: &Board, block: &Block<'_>, phrase: &dyn Fn(&str) -> Cost) -> Cost {
    let mut cost = Cost { steps: block.count() as u64, ..Cost::default() };
    for line in block.lines() {
        let costs = line.statements().map(|statement| of_statement(board, statement, phrase));
        cost = costs.fold(cost, Cost::plus);
    }
    cost
}

fn of_statement(board: &Board, statement: &Statement<'_>, phrase: &dyn Fn(&str) -> Cost) -> Cost {
    match statement {
        Statement::Block(block) => of_block(board, block, phrase),
        Statement::Call(call) => phrase(call.name.text),
        Statement::If(each) => {
            let smallest = each.blocks().map(|block| of_block(board, block, phrase)).reduce(Cost::smaller);
            smallest.filter(|_| each.otherwise.is_some()).unwrap_or_default()
        }
        Statement::Command(command) => of_command(board, command, phrase),
        Statement::Let(_) | Statement::Def(_) => Cost::default(),
    }
}

fn of_command(board: &Board, command: &Command<'_>, phrase: &dyn Fn(&str) -> Cost) -> Cost {
    let inside = command.block.as_ref().map(|block| of_block(board, block, phrase)).unwrap_or_default();
    let row = match words::of_command(board, command) {
        Some(Word::Verb(_, verb)) if verb.moves && takes_time(command) => {
            return Cost { moves: 1, ..Cost::default() };
        }
        Some(Word::Verb(..)) => return Cost { events: 1, ..Cost::default() },
        Some(Word::Row(row)) => Some(row.does),
        None => None,
    };
    match row {
        Some(Operation::Mark) => kept(MARK, texts(command)),
        // What a `say` shows may be shorter than what is written.
        Some(Operation::Say) => kept(SAY, 0),
        Some(Operation::Expect) => kept(EXPECT, texts(command)),
        Some(Operation::WaitUntil | Operation::WaitGo) => Cost { events: 1, ..kept(GATE, 0) },
        Some(Operation::Together) => inside,
        Some(Operation::Repeat) => {
            let passes = command.arguments.first().and_then(|argument| match &argument.item {
                Item::One(Value { kind: ValueKind::Number(NumberShape::Plain, text), .. }) => text.parse().ok(),
                _ => None,
            });
            // At least its lines' own step for every pass.
            inside.plus(Cost { steps: 1, ..Cost::default() }).times(passes.unwrap_or(0))
        }
        _ => Cost::default(),
    }
}

fn kept(bytes: u64, texts: u64) -> Cost {
    Cost { kept: bytes.saturating_add(texts), ..Cost::default() }
}

/// Bytes of the words and strings of a command: at least half of those that were written.
fn texts(command: &Command<'_>) -> u64 {
    let texts = command.arguments.iter().map(|argument| match &argument.item {
        Item::One(Value { kind: ValueKind::Word(text) | ValueKind::Text(text), .. }) => text.len() as u64 / 2,
        _ => 0,
    });
    texts.sum()
}

/// Whether a command is a move: a word of its own, `over`, says how long it takes.
fn takes_time(command: &Command<'_>) -> bool {
    let is_over = |item: &Item<'_>| matches!(item, Item::One(Value { kind: ValueKind::Word("over"), .. }));
    command.arguments.iter().any(|argument| is_over(&argument.item))
}
