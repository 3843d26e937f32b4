//! A `wait` inside `together`.

use super::super::evaluator::Evaluator;
use crate::diagnostic::report;
use crate::source::Span;

/// In `together`, all statements start at once.
pub(in crate::program) fn check(is_in_together: bool, span: Span, eval: &mut Evaluator<'_, '_>) {
    if is_in_together {
        report!(eval, WaitInTogether, span, "a `wait` delays nothing inside `together`";
            help: "to delay a line, write `+TIME` before it, such as `+1s stop`");
    }
}
