//! How much a block unrolls to at least, counted before anything is unrolled.

use super::commands::{self, Build};
use crate::syntax::{Block, Command, Item, NumberShape, Statement, Value, ValueKind};

/// A lower bound: an `if` counts as its lightest branch, and a `repeat` whose number is calculated as one pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Weight {
    pub(super) steps: u64,
    /// Commands to the board.
    pub(super) events: u64,
}

impl Weight {
    pub(super) fn plus(self, other: Weight) -> Weight {
        Weight { steps: self.steps.saturating_add(other.steps), events: self.events.saturating_add(other.events) }
    }

    fn lighter(self, other: Weight) -> Weight {
        Weight { steps: self.steps.min(other.steps), events: self.events.min(other.events) }
    }

    pub(super) fn times(self, passes: u64) -> Weight {
        Weight { steps: self.steps.saturating_mul(passes), events: self.events.saturating_mul(passes) }
    }
}

/// The weight of a block; `phrase` knows the weight of a `def`. The recursion is bounded by the depth of brackets.
pub(super) fn of_block(block: &Block<'_>, phrase: &dyn Fn(&str) -> Weight) -> Weight {
    let parts = block.lines.iter().flat_map(|line| &line.parts);
    let weights = parts.map(|part| of_statement(&part.statement, phrase));
    weights.fold(Weight { steps: block.lines.len() as u64, events: 0 }, Weight::plus)
}

fn of_statement(statement: &Statement<'_>, phrase: &dyn Fn(&str) -> Weight) -> Weight {
    match statement {
        Statement::Block(block) => of_block(block, phrase),
        Statement::Call(call) => phrase(call.name.text),
        Statement::If(each) => {
            let blocks = each.arms.iter().map(|(_, block)| block).chain(&each.otherwise);
            let lightest = blocks.map(|block| of_block(block, phrase)).reduce(Weight::lighter);
            lightest.filter(|_| each.otherwise.is_some()).unwrap_or_default()
        }
        Statement::Command(command) => of_command(command, phrase),
        Statement::Let(_) | Statement::Def(_) => Weight::default(),
    }
}

fn of_command(command: &Command<'_>, phrase: &dyn Fn(&str) -> Weight) -> Weight {
    let inside = command.block.as_ref().map(|block| of_block(block, phrase)).unwrap_or_default();
    match commands::find(command.head.text).map(|row| &row.build) {
        Some(Build::Send(_)) => Weight { steps: 0, events: 1 },
        Some(Build::Together) => inside,
        Some(Build::Repeat) => {
            let passes = command.arguments.first().and_then(|argument| match &argument.item {
                Item::One(Value { kind: ValueKind::Number(NumberShape::Plain, text), .. }) => text.parse().ok(),
                _ => None,
            });
            // At least its lines' own step for every pass.
            inside.plus(Weight { steps: 1, events: 0 }).times(passes.unwrap_or(0))
        }
        _ => Weight::default(),
    }
}
