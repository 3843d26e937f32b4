//! When a line with a start time starts: `+TIME`, `at TIME`, `at MARK`, `at bar N beat M`.

use super::super::arguments::{self, misplaced_unit};
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::words;
use super::Walker;
use crate::diagnostic::bail;
use crate::source::Span;
use crate::syntax::{Line, Moment, Origin, Start, Statement, Value, ValueKind};

impl<'s> Walker<'s, '_> {
    /// When a line starts.
    pub(super) fn start(&mut self, start: &Start<'s>, line: &Line<'s>, block: Time, now: Time) -> Option<Time> {
        match start {
            Start::After(value) => {
                self.no_separate_unit(value, line)?;
                let delay = arguments::time(value, &mut self.eval)?;
                if delay < Time::ZERO {
                    return self.negative("+", value.span);
                }
                Some(now.plus(delay))
            }
            Start::At(moment) => self.moment(moment, line, block),
        }
    }

    fn moment(&mut self, moment: &Moment<'s>, line: &Line<'s>, block: Time) -> Option<Time> {
        let mut at = match &moment.origin {
            Origin::Bar(count) => self.bar(&count.0, count.1.as_ref(), block)?,
            Origin::Value(value) => self.origin(value, line, block)?,
        };
        for (away, value) in &moment.offsets {
            let offset = arguments::time(value, &mut self.eval)?;
            let moved = if *away { at.checked_minus(offset) } else { at.checked_plus(offset) };
            at = self.eval.exact(moved, value.span)?;
        }
        if at < block {
            bail!(self.eval, StartTime, moment.span, "this is before the start of the block";
                help: "write a time after the start of the block");
        }
        Some(at)
    }

    /// When a bar or one of its beats begins.
    fn bar(&mut self, bar: &Value<'s>, beat: Option<&Value<'s>>, block: Time) -> Option<Time> {
        let number = self.count_from_one(bar, "a bar")?;
        let tempo = self.eval.tempo;
        let beat = match beat {
            None => Time::ZERO,
            Some(beat) => {
                let count = self.count_from_one(beat, "a beat")?;
                let beats = tempo.beats();
                if count >= f64::from(beats) + 1.0 {
                    bail!(self.eval, OutOfRange, beat.span, "beat {count} is out of range (1 to {beats})";
                        help: "write the next bar, or another `meter`");
                }
                self.eval.exact(tempo.beat().by_number(count), beat.span)?.minus(tempo.beat())
            }
        };
        if libm::floor(number) != number {
            bail!(self.eval, NotWhole, bar.span, "a bar must be a whole number";
                help: "write a whole number, and then the beat: `bar 2 beat 2.5`");
        }
        let bars = self.eval.exact(tempo.bar().by_number(number), bar.span)?.minus(tempo.bar());
        Some(block.plus(bars).plus(beat))
    }

    /// The moment that a value after `at` means.
    fn origin(&mut self, value: &Value<'s>, line: &Line<'s>, block: Time) -> Option<Time> {
        if let ValueKind::Word(word) = value.kind
            && words::find(self.eval.board, word).is_some()
        {
            bail!(self.eval, StartTime, value.span, "`at` needs a time before the command";
                help: "for example `at 0.5s {word} …`");
        }
        self.no_separate_unit(value, line)?;
        let origin = match value.kind {
            ValueKind::Word(word) if !value.negative => self.eval.moment_name(word, value.span)?,
            _ => self.eval.value(value)?,
        };
        match origin {
            Quantity::Moment(_) if self.in_abort => {
                bail!(self.eval, Abort, value.span, "a mark of the script cannot be used in `on abort`";
                    help: "write a time: `on abort` counts from its own start")
            }
            Quantity::Moment(moment) => Some(moment),
            Quantity::Time(time) => Some(block.plus(time)),
            Quantity::Number(number) => self.eval.needs_unit(number, value.span),
            other => {
                bail!(self.eval, Unit, value.span, "a time or a mark is needed here, not {}", other.kind();
                    help: "write a time such as `0.5s`, `bar 2` or the name of a mark")
            }
        }
    }

    /// A bar or a beat, counted from 1.
    fn count_from_one(&mut self, value: &Value<'s>, what: &str) -> Option<f64> {
        match self.eval.value(value)? {
            Quantity::Number(count) if count >= 1.0 => Some(count),
            _ => {
                bail!(self.eval, OutOfRange, value.span, "{what} is a number without a unit, counted from 1";
                    help: "the block starts at `bar 1 beat 1`; a beat may have decimals")
            }
        }
    }

    /// `at 1 s stop`: the unit was read as a command.
    fn no_separate_unit(&mut self, value: &Value<'s>, line: &Line<'s>) -> Option<()> {
        let head = match line.parts.first().map(|part| &part.statement) {
            Some(Statement::Command(command)) => command.head,
            _ => return Some(()),
        };
        let Some(diagnostic) = misplaced_unit(value, head) else { return Some(()) };
        self.eval.push(diagnostic);
        None
    }

    /// A negative delay after `word`.
    pub(super) fn negative<T>(&mut self, word: &str, span: Span) -> Option<T> {
        bail!(self.eval, OutOfRange, span, "`{word}` needs a time that is not negative";
            help: "write `at TIME` to start a line at an earlier time")
    }
}
