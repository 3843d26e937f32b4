//! A condition that can become true and false again between two reports.

use super::super::evaluator::Evaluator;
use super::super::expect::{Condition, Criterion};
use crate::diagnostic::report;
use crate::source::Span;

/// The value is compared only when a report arrives.
pub(in crate::program) fn check(criterion: &Criterion, span: Span, eval: &mut Evaluator<'_, '_>) {
    let Some(step) = criterion.measured.step() else { return };
    let (from, to) = match criterion.wanted {
        Condition::Equal(bound) => (bound, bound),
        Condition::In(low, high) => (low, high),
        _ => return,
    };
    if to - from < step.number() {
        let (name, unit) = (criterion.measured.name(), criterion.measured.unit());
        report!(eval, BriefCondition, span, "`{criterion}` may be true only between two reports, where nothing sees it";
            help: "write one bound, such as `{name} >= {from}{unit}`, or a range of at least {}{unit}", step.number());
    }
}
