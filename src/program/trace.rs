//! The calls and passes that led to a step: a tree in which each step knows its leaf.

use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// A place in the tree of calls; 0 is the script itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraceId(u32);

/// One call of a `def`, or one pass of a `repeat`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Trace {
    within: TraceId,
    /// The call, or the `repeat`.
    span: Span,
    /// Which pass it is, counted from 1; 0 for a call.
    pass: u32,
}

/// How many calls a message shows; a deeper chain shows the innermost ones.
const SHOWN: usize = 4;

/// The calls and passes of a script that led to anything.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Traces {
    all: Vec<Trace>,
    /// The way to where the script is now; what leads to nothing is never kept.
    path: Vec<(Span, u32, Option<TraceId>)>,
}

impl Traces {
    /// Where the script is now.
    pub(super) fn here(&mut self) -> TraceId {
        let mut within = TraceId::default();
        for (span, pass, id) in &mut self.path {
            within = *id.get_or_insert_with(|| {
                self.all.push(Trace { within, span: *span, pass: *pass });
                TraceId(u32::try_from(self.all.len()).unwrap_or(0))
            });
        }
        within
    }

    /// Goes into a call, or into a pass counted from 1.
    pub(super) fn enter(&mut self, span: Span, pass: u32) {
        self.path.push((span, pass, None));
    }

    /// Goes back out.
    pub(super) fn leave(&mut self) {
        self.path.pop();
    }

    /// Adds the calls that led to `leaf`, the innermost first. A pass is only shown where it is not the first.
    pub fn attach(&self, mut diagnostic: Diagnostic, leaf: TraceId) -> Diagnostic {
        let mut at = leaf;
        let mut shown = 0;
        while let Some(trace) = self.get(at).filter(|_| shown < SHOWN) {
            at = trace.within;
            let label = match trace.pass {
                0 => "called here".to_owned(),
                1 => continue,
                pass => format!("in pass {pass} of this"),
            };
            // Two places in one chain, such as a clash of two commands of one call, share it.
            if diagnostic.related.iter().any(|related| related.span == trace.span) {
                continue;
            }
            diagnostic = diagnostic.related(trace.span, label);
            shown += 1;
        }
        diagnostic
    }

    /// The calls and passes that led to `leaf`, the innermost first: where the call or the `repeat` stands, and which pass it
    /// is, counted from 1; 0 for a call.
    pub fn chain(&self, leaf: TraceId) -> impl Iterator<Item = (Span, u32)> {
        let first = self.get(leaf);
        std::iter::successors(first, |trace| self.get(trace.within)).map(|trace| (trace.span, trace.pass))
    }

    fn get(&self, at: TraceId) -> Option<&Trace> {
        self.all.get(usize::try_from(at.0).ok()?.checked_sub(1)?)
    }
}
