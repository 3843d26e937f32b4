//! Lines that do the same in every pass of a `repeat`: what one does is worked out in the first pass, and only put at its time
//! in all others. A script of a few lines may unroll to millions of commands.

use super::super::Action;
use super::super::time::Time;
use super::super::words::{self, Operation, Word};
use super::{Frame, Walker};
use crate::board::Board;
use crate::source::Span;
use crate::syntax::{Line, LineRef, Part, Start, Statement};

/// What the lines of one `repeat` do in every pass.
pub(super) struct CachedLines {
    /// The number of local names before the first pass. Later ones are defined anew in each pass. A name that an `if` defines ends the
    /// caching, because it hides others in some passes only.
    outer: usize,
    /// What is known of each line, by its place in the block.
    lines: Vec<Option<CachedLine>>,
}

/// What a line did.
#[derive(Clone)]
struct CachedLine {
    line: Span,
    /// How long after the line before its step began.
    delay: Time,
    /// How long it took from there.
    lasted: Time,
    /// Its step, if it had one, and the place of that.
    step: Option<(Span, Action)>,
}

impl CachedLines {
    pub(super) fn new(outer: usize) -> Self {
        CachedLines { outer, lines: Vec::new() }
    }

    fn done(&self, place: usize, line: Span) -> Option<&CachedLine> {
        self.lines.get(place)?.as_ref().filter(|done| done.line == line)
    }

    fn keep(&mut self, place: usize, done: CachedLine) {
        if self.lines.len() <= place {
            self.lines.resize(place + 1, None);
        }
        if let Some(slot) = self.lines.get_mut(place) {
            *slot = Some(done);
        }
    }
}

impl<'s> Walker<'s, '_> {
    /// Runs a line, which may be known from a pass before.
    pub(super) fn run_line(&mut self, place: usize, line: LineRef<'_, 's>, frame: &mut Frame) -> Option<()> {
        let Some(cached) = &frame.cached else { return self.line(&line.read(), frame) };
        // A pass is no `together`.
        let from = frame.now;
        if let Some(done) = cached.done(place, line.span()) {
            let start = from.plus(done.delay);
            let end = start.plus(done.lasted);
            if let Some((span, action)) = &done.step {
                self.push(start, *span, action.clone());
            }
            frame.begun = true;
            frame.now = end;
            frame.latest = frame.latest.max(end);
            return Some(());
        }
        let line = line.read();
        if !is_cacheable(self.eval.board, &line) {
            return self.line(&line, frame);
        }
        let outer = cached.outer;
        let before = self.robot.steps.len();
        (self.eval.varies, self.eval.scope.newest) = (false, 0);
        self.line(&line, frame)?;
        if self.eval.varies || self.eval.scope.newest > outer {
            return Some(());
        }
        let step = self.robot.steps.get(before);
        let (start, end) = (step.map_or(from, |step| step.at), frame.now);
        // Whole nanoseconds are added and subtracted exactly.
        if [from, start, end].into_iter().all(Time::is_whole)
            && let Some(cached) = &mut frame.cached
        {
            let step = step.map(|step| (step.span, step.action.clone()));
            cached
                .keep(place, CachedLine { line: line.span, delay: start.minus(from), lasted: end.minus(start), step });
        }
        Some(())
    }
}

/// Whether a line is one command to the board or a `wait`, and starts when the line before has ended, or a time after that.
fn is_cacheable(board: &Board, line: &Line<'_>) -> bool {
    let [Part { robots, statement: Statement::Command(command) }] = line.parts.as_slice() else { return false };
    let is_plain = match words::of_command(board, command) {
        Some(Word::Verb(..)) => true,
        Some(Word::Row(row)) => row.does == Operation::Wait,
        None => false,
    };
    is_plain && robots.is_empty() && matches!(line.start, None | Some(Start::After(_)))
}
