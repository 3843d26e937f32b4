//! An `expect` before the first report, or a change that is measured from there.

use super::super::evaluator::Evaluator;
use super::super::expect::{Criterion, Expect};
use super::super::time::Time;
use crate::diagnostic::report;
use crate::source::Span;

/// The board reports from the start of the script on, so no report has arrived at time 0.
pub(in crate::program) fn check(expect: &Expect, start: Time, span: Span, eval: &mut Evaluator<'_, '_>) {
    if start == Time::ZERO && expect.within.is_none() {
        report!(eval, EarlyExpect, span, "no report has arrived yet at the start of the script";
            help: "write `wait 0.5s` before it, or `expect {expect} within 2s`");
    }
}

/// The same for a gate: other reports may come while it waits.
pub(in crate::program) fn check_gate(criterion: &Criterion, start: Time, span: Span, eval: &mut Evaluator<'_, '_>) {
    if start == Time::ZERO && criterion.measured.change().is_some() {
        let name = criterion.measured.name();
        report!(eval, EarlyExpect, span, "no report has arrived yet at the start of the script, so `{name}` counts from the first one";
            help: "write `wait 0.5s` before the movement");
    }
}
