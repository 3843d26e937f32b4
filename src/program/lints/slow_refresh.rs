//! A long time between two drive frames.

use super::super::evaluator::Evaluator;
use super::super::time::Time;
use crate::board::ON_SILENCE;
use crate::diagnostic::report;
use crate::source::Span;

/// The longest time between two drive frames that gets no warning.
const LONGEST: Time = Time::from_millis(500);

/// The board may stop if it gets no frames.
pub(in crate::program) fn check(interval: Time, span: Span, eval: &mut Evaluator<'_, '_>) {
    if interval > LONGEST {
        report!(eval, SlowRefresh, span, "with this `refresh`, the robot may stop between two drive frames";
            help: "{ON_SILENCE}. Write `refresh 500ms` or less");
    }
}
