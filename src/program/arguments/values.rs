//! Arguments as values: numbers in range, pulse widths, words.

use super::super::motion::Glide;
use super::super::suggest::{list, suggest};
use super::super::value::{self, Quantity};
use super::Arguments;
use crate::board::{Axis, Unit};
use crate::diagnostic::{bail, report};
use crate::source::Span;
use crate::syntax::{Argument, Item, Value, ValueKind};

/// What a number must be, and how messages speak of it.
#[derive(Clone, Copy)]
pub(in crate::program) struct Bound<'t> {
    pub(in crate::program) what: &'t str,
    /// The smallest and the largest.
    pub(in crate::program) range: (i32, i32),
    pub(in crate::program) unit: Unit,
    /// Why the range ends there; empty where that needs no words.
    pub(in crate::program) why: &'t str,
}

impl<'t> From<&'t Axis> for Bound<'t> {
    fn from(axis: &'t Axis) -> Self {
        Bound { what: &axis.what, range: axis.range, unit: axis.unit, why: &axis.why }
    }
}

impl<'a, 's> Arguments<'_, 'a, 's, '_> {
    /// A value that may be a move: `B` or `A -> B`.
    pub(in crate::program) fn glide(&mut self, argument: &'a Argument<'s>, bound: Bound<'_>) -> Option<Glide> {
        let (from, to) = match &argument.item {
            Item::Arrow(ends) => (Some(&ends.0), &ends.1),
            _ => (None, self.one(argument)?),
        };
        let mut checked = |value: &'a Value<'s>| {
            let number = self.measure(value, bound)?;
            self.in_range(number, value.span, bound)?;
            Some(number)
        };
        let from = match from {
            None => None,
            Some(from) => Some(checked(from)?),
        };
        Some(Glide { from, to: checked(to)? })
    }

    /// A number in its unit, rounded to a whole one.
    pub(in crate::program) fn ranged(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<i32> {
        let number = self.measure(value, bound)?;
        self.in_range(number, value.span, bound)
    }

    fn measure(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<f64> {
        match bound.unit {
            Unit::Micros { .. } => self.micros(value, bound.what, bound.unit),
            Unit::None => self.number(value, bound.what),
        }
    }

    /// A whole number: an index, a count or a byte is never rounded. `what` names it in messages.
    pub(in crate::program) fn integer(&mut self, value: &'a Value<'s>, what: &str, range: (i32, i32)) -> Option<i32> {
        self.whole(value, Bound { what, range, unit: Unit::None, why: "" })
    }

    /// The same, with what is said of a number outside.
    pub(in crate::program) fn whole(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<i32> {
        let number = self.number(value, bound.what)?;
        let (what, (least, most)) = (bound.what, bound.range);
        if libm::trunc(number) != number {
            bail!(self.eval, NotWhole, value.span, "{what} is a whole number, and {number} is not";
                help: "write one from {least} to {most}, or round it: `round(…)`");
        }
        self.in_range(number, value.span, bound)
    }

    /// A pulse width in microseconds: a bare number, a time, or an angle from 0 to 180 degrees where the unit says what that is.
    pub(in crate::program) fn micros(&mut self, value: &'a Value<'s>, what: &str, unit: Unit) -> Option<f64> {
        match (self.eval.value(value)?, unit) {
            (Quantity::Number(micros), _) => Some(micros),
            (Quantity::Time(time), _) => Some(time.in_micros()),
            (Quantity::Degrees(degrees), Unit::Micros { least, most }) if (0.0..=180.0).contains(&degrees) => {
                let (least, most) = (f64::from(least), f64::from(most));
                Some(least + degrees / 180.0 * (most - least))
            }
            (Quantity::Degrees(_), Unit::Micros { .. }) => bail!(self.eval, OutOfRange, value.span,
                "a servo turns from 0 to 180 degrees";
                help: "write an angle from `0deg` to `180deg`, or a pulse width such as `1500us`"),
            (other, _) => {
                let help = "write microseconds, such as `1500` or `1500us`, or degrees, such as `90deg`";
                self.wrong_unit(value.span, what, other, help);
                None
            }
        }
    }

    /// A word out of `words`.
    pub(in crate::program) fn word<'w>(&mut self, value: &'a Value<'s>, words: &[&'w str]) -> Option<&'w str> {
        let found = match &value.kind {
            ValueKind::Word(word) | ValueKind::Text(word) | ValueKind::Number(_, word) if !value.negative => *word,
            _ => "this",
        };
        if let Some(word) = words.iter().find(|&&word| word == found) {
            return Some(word);
        }
        let help = match suggest(found, words.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("write one of {}", list(words.iter().copied())),
        };
        bail!(self.eval, Arguments, value.span, "`{}` does not know `{found}`", self.row().name; help: "{help}")
    }

    /// A bare number.
    pub(in crate::program) fn number(&mut self, value: &'a Value<'s>, what: &str) -> Option<f64> {
        match self.eval.value(value)? {
            Quantity::Number(number) => Some(number),
            other => {
                self.wrong_unit(value.span, what, other, "write the bare number");
                None
            }
        }
    }

    fn wrong_unit(&mut self, span: Span, what: &str, found: Quantity, help: &str) {
        report!(self.eval, Unit, span, "{what} is needed here, not {}", found.kind(); help: "{help}");
    }

    fn in_range(&mut self, number: f64, span: Span, bound: Bound<'_>) -> Option<i32> {
        let Bound { what, range: (least, most), unit, why } = bound;
        let checked = value::round(number).filter(|number| (least..=most).contains(number));
        if checked.is_none() {
            let is_angle = matches!(unit, Unit::Micros { .. }) && (0.0..=180.0).contains(&number);
            let angle = is_angle.then(|| format!("for an angle, write `{number}deg`"));
            let because = match (angle, why) {
                (Some(angle), _) => format!("; {angle}"),
                (None, "") => String::new(),
                (None, why) => format!("; {why}"),
            };
            let symbol = unit.symbol();
            let blank = if symbol.is_empty() { "" } else { " " };
            report!(self.eval, OutOfRange, span,
                "{what} is from {least} to {most}{blank}{symbol}, and {number} is outside";
                help: "write a value from {least} to {most}{because}");
        }
        checked
    }
}
