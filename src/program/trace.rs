//! The calls and passes that led to a step: a tree in which each step knows its leaf.

use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// A place in the tree of calls: one more than the index of its first byte among the bytes that are kept; 0 is the script itself.
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
    /// Each is four numbers of as few bytes as possible, because there may be some for each of millions of events: its distance from the
    /// one that contains it, the start and the length of its span, and its pass.
    all: Vec<u8>,
    /// The way to where the script is now; what leads to nothing is never kept.
    path: Vec<(Span, u32, Option<TraceId>)>,
}

impl Traces {
    /// Where the script is now.
    pub(super) fn here(&mut self) -> TraceId {
        let mut within = TraceId::default();
        for (span, pass, id) in &mut self.path {
            within = *id.get_or_insert_with(|| {
                let id = u32::try_from(self.all.len() + 1).unwrap_or(0);
                for number in [id - within.0, span.start, span.end - span.start, *pass] {
                    put(number, &mut self.all);
                }
                TraceId(id)
            });
        }
        within
    }

    /// Goes into a call, or into a pass counted from 1.
    pub(super) fn enter(&mut self, span: Span, pass: u32) {
        self.path.push((span, pass, None));
    }

    /// The pass that the innermost `repeat` or call is in: counted from 1, and 0 for a call and outside of both.
    pub(super) fn pass(&self) -> u32 {
        self.path.last().map_or(0, |(_, pass, _)| *pass)
    }

    /// The innermost call or `repeat` that is run.
    pub(super) fn latest(&self) -> Span {
        self.path.last().map_or(Span::default(), |(span, ..)| *span)
    }

    /// Goes back out.
    pub(super) fn leave(&mut self) {
        self.path.pop();
    }

    /// Adds the calls that led to `leaf`, the innermost first. A pass is only shown where it is not the first.
    pub(crate) fn attach(&self, mut diagnostic: Diagnostic, leaf: TraceId) -> Diagnostic {
        let mut at = leaf;
        let mut shown = 0;
        while let Some(trace) = self.get(at).filter(|_| shown < SHOWN) {
            at = trace.within;
            let label = match trace.pass {
                0 => "called here".to_owned(),
                1 => continue,
                pass => format!("in pass {pass} of this `repeat`"),
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

    /// The calls and passes that led to `leaf`, the innermost first: the place of the call or the `repeat`, and which pass it
    /// is, counted from 1; 0 for a call.
    pub fn chain(&self, leaf: TraceId) -> impl Iterator<Item = (Span, u32)> {
        let first = self.get(leaf);
        std::iter::successors(first, |trace| self.get(trace.within)).map(|trace| (trace.span, trace.pass))
    }

    fn get(&self, TraceId(at): TraceId) -> Option<Trace> {
        let mut bytes = self.all.get(usize::try_from(at).ok()?.checked_sub(1)?..)?;
        let [distance, start, length, pass] = [(); 4].map(|()| take(&mut bytes));
        let span = Span { start: start?, end: start?.checked_add(length?)? };
        Some(Trace { within: TraceId(at.checked_sub(distance?)?), span, pass: pass? })
    }
}

/// Appends a number: seven bits a byte, the lowest first; the highest bit says that more follow.
fn put(mut number: u32, bytes: &mut Vec<u8>) {
    loop {
        let [low, ..] = number.to_le_bytes();
        number >>= 7;
        if number == 0 {
            return bytes.push(low);
        }
        bytes.push(low | 0x80);
    }
}

/// Takes the next number.
fn take(bytes: &mut &[u8]) -> Option<u32> {
    let mut number = 0;
    for shift in (0..32).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u32::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_led_to_a_step_is_known_again() {
        let mut traces = Traces::default();
        let call = Span { start: 0, end: 3 };
        let far = Span { start: u32::MAX - 1, end: u32::MAX };
        traces.enter(far, u32::MAX);
        traces.enter(call, 0);
        let inner = traces.here();
        traces.leave();
        let outer = traces.here();
        traces.enter(call, 128);
        let other = traces.here();
        let chain = |leaf| traces.chain(leaf).collect::<Vec<_>>();
        assert_eq!(chain(inner), [(call, 0), (far, u32::MAX)]);
        assert_eq!(chain(outer), [(far, u32::MAX)]);
        assert_eq!(chain(other), [(call, 128), (far, u32::MAX)]);
        assert_eq!(chain(TraceId::default()), []);
    }
}
