//! A `let` or `def` of the main script that is never used.

use super::super::evaluator::Evaluator;
use crate::diagnostic::report;

/// Most likely another name was meant, or a call is missing. Runs at the end of the script.
pub(in crate::program) fn check(eval: &mut Evaluator<'_, '_>) {
    for (name, span) in eval.scope.unused() {
        report!(eval, Unused, span, "`{name}` is never used"; help: "remove it, or use it");
    }
}
