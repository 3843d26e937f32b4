//! A condition that no report can meet.

use super::super::evaluator::Evaluator;
use super::super::expect::{Condition, Criterion};
use crate::diagnostic::report;
use crate::source::Span;

/// The quantity has a range, and the condition is outside of it.
pub(in crate::program) fn check(criterion: &Criterion, span: Span, eval: &mut Evaluator<'_, '_>) {
    let Some((least, most)) = criterion.measured.range() else { return };
    let (low, high) = (least.number(), most.number());
    let is_possible = match criterion.wanted {
        Condition::Less(bound) => bound > low,
        Condition::AtMost(bound) => bound >= low,
        Condition::Greater(bound) => bound < high,
        Condition::AtLeast(bound) => bound <= high,
        Condition::Equal(bound) => (low..=high).contains(&bound),
        Condition::In(from, to) => from <= high && to >= low,
    };
    if !is_possible {
        let (name, unit) = (criterion.measured.name(), criterion.measured.unit());
        report!(eval, ImpossibleCondition, span, "`{criterion}` is never true: {name} is between {low}{unit} and {high}{unit}";
            help: "write a value in this range");
    }
}
