//! A frame that is not interpreted.

use super::super::evaluator::Evaluator;
use crate::board::{Sets, Verb};
use crate::diagnostic::report;
use crate::source::Span;

/// Neither ranges nor overlaps of such a frame are checked.
#[inline]
pub(in crate::program) fn check(verb: &Verb, span: Span, eval: &mut Evaluator<'_, '_>) {
    if let Sets::Opaque(_) = verb.sets {
        report!(eval, RawFrame, span, "this frame is not checked";
            help: "write the command for it, or end the line with `# allow: raw-frame`");
    }
}
