//! How much a script may unroll to, and how deep.

use std::collections::HashMap;

use super::cost::{self, Cost};
use super::evaluator::Evaluator;
use super::time::Time;
use super::{Action, MAX_STEPS};
use crate::diagnostic::report;
use crate::source::Span;
use crate::syntax::Block;

/// The most moves, and the most bytes of marks, lines to show, expectations and gates.
const MAX_MOVES: u64 = 1_000_000;
const MAX_KEPT: u64 = 48 << 20;

/// How many steps of a script that has an error are looked through.
const ENOUGH: u64 = 300_000;

/// How deep blocks and calls may run inside each other.
const MAX_DEPTH: usize = 200;

/// What has been run, and what else may be run.
#[derive(Debug, Default)]
pub(super) struct Bounds {
    /// Lines and passes that were run, and what they added. A move may send nothing, where everything is there already.
    pub(super) done: Cost,
    max_events: usize,
    /// How many robots there are. Each may send that many frames; the exact number is checked for each timeline.
    pub(super) robots: u64,
    /// Whether a bound was reached, so that nothing more is run.
    exhausted: bool,
    too_long: bool,
    /// The costs of blocks that were counted.
    blocks: HashMap<Span, Cost>,
    /// The cost of each `def`, by its number in the scope.
    phrases: Vec<Cost>,
}

impl Bounds {
    pub(super) fn new(max_events: usize) -> Self {
        Bounds { max_events, robots: 1, ..Bounds::default() }
    }

    /// Counts a line; whether it may be run.
    pub(super) fn line(&mut self, span: Span, eval: &mut Evaluator<'_, '_>) -> bool {
        self.done.steps += 1;
        // After an error, the rest is run only to find more errors, and not without end.
        self.exhausted |= self.done.steps > ENOUGH && eval.diagnostics.has_errors();
        let Cost { steps, events, moves, kept } = self.done;
        let is_within = steps <= MAX_STEPS && events <= self.most_events() && moves <= MAX_MOVES && kept <= MAX_KEPT;
        // Nearly every line is within all bounds.
        !self.exhausted && (is_within || self.allow(Cost::default(), span, eval).is_some())
    }

    fn most_events(&self) -> u64 {
        (self.max_events as u64).saturating_mul(self.robots)
    }

    /// Whether another pass may be run.
    pub(super) fn another(&mut self, span: Span, eval: &mut Evaluator<'_, '_>) -> bool {
        !self.exhausted && self.allow(Cost::default(), span, eval).is_some() && !self.too_long
    }

    /// Whether this may be run in addition; `None` if not, which is reported, and nothing more is run.
    pub(super) fn allow(&mut self, more: Cost, span: Span, eval: &mut Evaluator<'_, '_>) -> Option<()> {
        let cost = self.done.plus(more);
        if cost.steps > MAX_STEPS {
            report!(eval, TooManySteps, span, "the script has more than {MAX_STEPS} steps";
                help: "repeat less often");
        } else if cost.events > self.most_events() {
            report!(eval, TooManyEvents, span, "the script sends more than {} frames", self.max_events;
                help: "repeat less often, or allow more with `--max-events`");
        } else if cost.moves > MAX_MOVES {
            report!(eval, TooManyEvents, span, "the script has more than {MAX_MOVES} moves";
                help: "repeat less often, or move less often");
        } else if cost.kept > MAX_KEPT {
            report!(eval, TooManyEvents, span, "the marks, gates, `say`s and `expect`s of the script take more than 48 MiB";
                help: "repeat them less often, or make their strings shorter");
        } else {
            return Some(());
        }
        self.exhausted = true;
        None
    }

    /// Whether a block or a call may run at this depth.
    pub(super) fn allow_depth(&mut self, depth: usize, span: Span, eval: &mut Evaluator<'_, '_>) -> bool {
        if depth > MAX_DEPTH {
            report!(eval, Nesting, span, "blocks and calls are nested more than {MAX_DEPTH} deep";
                help: "call fewer phrases in each other");
            self.exhausted = true;
        }
        depth <= MAX_DEPTH
    }

    /// Reports, once, that a script has become too long.
    #[inline]
    pub(super) fn check_length(&mut self, latest: Time, span: Span, eval: &mut Evaluator<'_, '_>) {
        if latest > Time::LONGEST && !self.too_long {
            self.too_long = true;
            report!(eval, TooLong, span, "the script exceeds 24 hours here";
                help: "make it shorter; a script may last at most 24 hours");
        }
    }

    /// Counts what a step does.
    pub(super) fn count(&mut self, action: &Action) {
        self.done.moves += u64::from(matches!(action, Action::Go(_)));
        self.done.events += u64::from(matches!(action, Action::Send(_) | Action::Hold(_) | Action::Gate(_)));
    }

    /// What a block unrolls to at least.
    pub(super) fn of_block(&mut self, block: &Block<'_>, eval: &Evaluator<'_, '_>) -> Cost {
        if let Some(cost) = self.blocks.get(&block.span) {
            return *cost;
        }
        let of_phrase = |name: &str| eval.scope.phrase_number(name).map(|at| self.of_phrase(at)).unwrap_or_default();
        let cost = cost::of_block(eval.board, block, &of_phrase);
        self.blocks.insert(block.span, cost);
        cost
    }

    /// What a `def` unrolls to at least, by its number in the scope.
    pub(super) fn of_phrase(&self, number: usize) -> Cost {
        self.phrases.get(number).copied().unwrap_or_default()
    }

    /// Keeps the cost of a `def`.
    pub(super) fn define(&mut self, number: usize, cost: Cost) {
        self.phrases.resize(number, Cost::default());
        self.phrases.push(cost);
    }
}
