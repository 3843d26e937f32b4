//! When a line starts, where it says so: `+TIME`, `at TIME`, `at MARK`, `at bar N beat M`.

use super::super::arguments::{self, blank_before_unit};
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::words;
use super::Walker;
use crate::diagnostic::Code;
use crate::source::Span;
use crate::syntax::{Line, Moment, Origin, Start, Statement, Value, ValueKind};

impl<'s> Walker<'s, '_> {
    /// When a line starts.
    pub(super) fn start(&mut self, start: &Start<'s>, line: &Line<'s>, block: Time, now: Time) -> Option<Time> {
        match start {
            Start::After(value) => {
                self.no_unit_behind(value, line)?;
                let delay = arguments::time(value, &mut self.eval)?;
                if delay < Time::ZERO {
                    return self.taken_back("+", value.span);
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
            let help = "write a time from the start of its block on";
            return self.eval.refuse(Code::StartTime, moment.span, "nothing starts before its own block", help);
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
                    let message = format!("there is no beat {count} in a bar of {beats}");
                    let help = "write the next bar, or another `meter`";
                    return self.eval.refuse(Code::OutOfRange, beat.span, message, help);
                }
                self.eval.exact(tempo.beat().by_number(count), beat.span)?.minus(tempo.beat())
            }
        };
        if libm::floor(number) != number {
            let help = "write a whole number, and the beat behind it: `bar 2 beat 2.5`";
            return self.eval.refuse(Code::NotWhole, bar.span, "a bar is counted in whole numbers", help);
        }
        let bars = self.eval.exact(tempo.bar().by_number(number), bar.span)?.minus(tempo.bar());
        Some(block.plus(bars).plus(beat))
    }

    /// The moment that a value behind `at` is.
    fn origin(&mut self, value: &Value<'s>, line: &Line<'s>, block: Time) -> Option<Time> {
        if let ValueKind::Word(word) = value.kind
            && words::find(self.eval.board, word).is_some()
        {
            let help = format!("for example `at 0.5s {word} …`");
            return self.eval.refuse(Code::StartTime, value.span, "`at` needs a time before the command", help);
        }
        self.no_unit_behind(value, line)?;
        let origin = match value.kind {
            ValueKind::Word(word) if !value.negative => self.eval.moment_name(word, value.span)?,
            _ => self.eval.value(value)?,
        };
        match origin {
            Quantity::Moment(_) if self.in_abort => {
                let help = "write a time: `on abort` counts from its own start";
                let message = "a mark of the script means nothing in `on abort`";
                self.eval.refuse(Code::Abort, value.span, message, help)
            }
            Quantity::Moment(moment) => Some(moment),
            Quantity::Time(time) => Some(block.plus(time)),
            Quantity::Number(number) => self.eval.needs_unit(number, value.span),
            other => {
                let message = format!("a time or a mark is needed here, not {}", other.kind());
                let help = "write a time such as `0.5s`, `bar 2` or the name of a mark";
                self.eval.refuse(Code::Unit, value.span, message, help)
            }
        }
    }

    /// A bar or a beat, counted from 1.
    fn count_from_one(&mut self, value: &Value<'s>, what: &str) -> Option<f64> {
        match self.eval.value(value)? {
            Quantity::Number(count) if count >= 1.0 => Some(count),
            _ => {
                let help = "write `at bar 1 beat 1` for the very start; a beat may have decimals";
                self.eval.refuse(Code::OutOfRange, value.span, format!("{what} is a bare number, counted from 1"), help)
            }
        }
    }

    /// `at 1 s stop`: the unit was read as a command.
    fn no_unit_behind(&mut self, value: &Value<'s>, line: &Line<'s>) -> Option<()> {
        let head = match line.parts.first().map(|part| &part.statement) {
            Some(Statement::Command(command)) => command.head,
            _ => return Some(()),
        };
        let Some(diagnostic) = blank_before_unit(value, head) else { return Some(()) };
        self.eval.push(diagnostic);
        None
    }

    /// A delay below zero; `word` is what it is written behind.
    pub(super) fn taken_back<T>(&mut self, word: &str, span: Span) -> Option<T> {
        let help = "write `at TIME` to start a line at an earlier time";
        self.eval.refuse(Code::OutOfRange, span, format!("time cannot be taken back with `{word}`"), help)
    }
}
