//! How much a script may unroll to.

use super::super::MAX_STEPS;
use super::super::weight::Weight;
use super::Unroll;
use crate::diagnostic::Code;
use crate::source::Span;

/// The most moves, and the most bytes of marks, lines to show and expectations.
const MAX_MOVES: u64 = 1_000_000;
const MAX_KEPT: u64 = 48 << 20;

impl Unroll<'_, '_> {
    /// Whether more may be run; where not, that is reported once.
    pub(super) fn within_bounds(&mut self, span: Span) -> bool {
        self.allow_more(Weight::default(), span)
    }

    /// Whether so much more may be run; where not, that is reported, and nothing more is run.
    pub(super) fn allow_more(&mut self, more: Weight, span: Span) -> bool {
        let done = Weight { steps: self.done, events: self.sent, moves: self.moves, kept: self.kept };
        let weight = done.plus(more);
        if weight.steps > MAX_STEPS {
            let message = format!("the script takes more than {MAX_STEPS} steps to unroll");
            self.eval.report(Code::TooManySteps, span, message, "repeat less often");
        } else if weight.events > self.max_events as u64 {
            let message = format!("the script sends more than {} frames", self.max_events);
            let help = "repeat less often, or allow more with `--max-events`";
            self.eval.report(Code::TooManyEvents, span, message, help);
        } else if weight.moves > MAX_MOVES {
            let message = format!("the script has more than {MAX_MOVES} moves");
            self.eval.report(Code::TooManyEvents, span, message, "repeat less often, or move less often");
        } else if weight.kept > MAX_KEPT {
            let message = "the marks, `say`s and `expect`s of the script take more than 48 MiB";
            self.eval.report(Code::TooManyEvents, span, message, "repeat them less often, or make their texts shorter");
        } else {
            return true;
        }
        self.exhausted = true;
        false
    }
}
