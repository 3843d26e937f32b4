//! Arguments as values: numbers in range, pulse widths, words.

use super::super::motion::Glide;
use super::super::suggest::{list, suggest};
use super::super::value::{self, Quantity};
use super::Arguments;
use crate::board::Ranged;
use crate::diagnostic::{Code, Diagnostic};
use crate::source::Span;
use crate::syntax::{Argument, Item, Value, ValueKind};

impl<'a, 's> Arguments<'_, 'a, 's, '_> {
    /// A value in the range of `Ranged`, which may be a move: `B` or `A -> B`. `read` gives its number.
    pub(in crate::program) fn glide<const MIN: i32, const MAX: i32>(
        &mut self,
        argument: &'a Argument<'s>,
        read: impl Fn(&mut Self, &'a Value<'s>) -> Option<f64>,
        what: &str,
        unit_and_why: [&str; 2],
    ) -> Option<Glide> {
        let (from, to) = match &argument.item {
            Item::Arrow(ends) => (Some(&ends.0), &ends.1),
            _ => (None, self.one(argument)?),
        };
        let mut checked = |value: &'a Value<'s>| {
            let number = read(self, value)?;
            self.in_range::<MIN, MAX>(number, value.span, what, unit_and_why)?;
            Some(number)
        };
        let from = match from {
            None => None,
            Some(from) => Some(checked(from)?),
        };
        Some(Glide { from, to: checked(to)? })
    }

    /// A bare number in the range of `Ranged`, rounded to a whole one. `what` names it in messages.
    pub(in crate::program) fn ranged<const MIN: i32, const MAX: i32>(
        &mut self,
        value: &'a Value<'s>,
        what: &str,
    ) -> Option<Ranged<MIN, MAX>> {
        let number = self.number(value, what)?;
        let number = self.in_range::<MIN, MAX>(number, value.span, what, ["", ""])?;
        Ranged::new(number).ok()
    }

    /// A whole number in the range of `Ranged`: an index, a count or a byte is never rounded.
    pub(in crate::program) fn whole<const MIN: i32, const MAX: i32>(
        &mut self,
        value: &'a Value<'s>,
        what: &str,
    ) -> Option<Ranged<MIN, MAX>> {
        self.whole_because(value, what, "")
    }

    /// The same; `why` is said of a number outside.
    pub(in crate::program) fn whole_because<const MIN: i32, const MAX: i32>(
        &mut self,
        value: &'a Value<'s>,
        what: &str,
        why: &str,
    ) -> Option<Ranged<MIN, MAX>> {
        let number = self.integer::<MIN, MAX>(value, what, why)?;
        Ranged::new(number).ok()
    }

    /// The same for ranges that the board does not know.
    pub(in crate::program) fn integer<const MIN: i32, const MAX: i32>(
        &mut self,
        value: &'a Value<'s>,
        what: &str,
        why: &str,
    ) -> Option<i32> {
        let number = self.number(value, what)?;
        if libm::trunc(number) != number {
            self.context.report(Diagnostic::new(
                Code::NotWhole,
                value.span,
                format!("{what} is a whole number, and {number} is not"),
                format!("write one from {MIN} to {MAX}, or round it: `round(…)`"),
            ));
            return None;
        }
        self.in_range::<MIN, MAX>(number, value.span, what, ["", why])
    }

    /// A byte: whole, 0-255 or 0x00-0xFF.
    pub(in crate::program) fn byte(&mut self, value: &'a Value<'s>, what: &str) -> Option<u8> {
        let byte: Ranged<0, 255> = self.whole(value, what)?;
        u8::try_from(byte.get()).ok()
    }

    /// A pulse width in microseconds: a bare number, a time, or an angle from 0 to 180 degrees on 500-2500.
    pub(in crate::program) fn micros(&mut self, value: &'a Value<'s>, what: &str) -> Option<f64> {
        match self.context.value(value)? {
            Quantity::Number(micros) => Some(micros),
            Quantity::Time(time) => Some(time.in_micros()),
            Quantity::Degrees(degrees) if (0.0..=180.0).contains(&degrees) => Some(500.0 + degrees / 180.0 * 2_000.0),
            Quantity::Degrees(_) => {
                self.context.report(Diagnostic::new(
                    Code::OutOfRange,
                    value.span,
                    "a servo turns from 0 to 180 degrees",
                    "write an angle from `0deg` to `180deg`, or a pulse width such as `1500us`",
                ));
                None
            }
            other => {
                let help = "write microseconds, such as `1500` or `1500us`, or degrees, such as `90deg`";
                self.wrong_unit(value.span, what, other, help);
                None
            }
        }
    }

    /// A word out of `words`.
    pub(in crate::program) fn word(&mut self, value: &'a Value<'s>, words: &[&'static str]) -> Option<&'static str> {
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
        let message = format!("`{}` does not know `{found}`", self.row.name);
        self.context.report(Diagnostic::new(Code::Arguments, value.span, message, help));
        None
    }

    /// A bare number.
    pub(in crate::program) fn number(&mut self, value: &'a Value<'s>, what: &str) -> Option<f64> {
        match self.context.value(value)? {
            Quantity::Number(number) => Some(number),
            other => {
                self.wrong_unit(value.span, what, other, "write the bare number");
                None
            }
        }
    }

    fn wrong_unit(&mut self, span: Span, what: &str, found: Quantity, help: &str) {
        let message = format!("{what} is needed here, not {}", found.kind());
        self.context.report(Diagnostic::new(Code::Unit, span, message, help));
    }

    pub(super) fn in_range<const MIN: i32, const MAX: i32>(
        &mut self,
        number: f64,
        span: Span,
        what: &str,
        [unit, why]: [&str; 2],
    ) -> Option<i32> {
        let checked = value::round(number).filter(|number| (MIN..=MAX).contains(number));
        if checked.is_none() {
            let angle = (unit == " µs" && (0.0..=180.0).contains(&number))
                .then(|| format!("for an angle, write `{number}deg`"));
            let because = match (angle, why) {
                (Some(angle), _) => format!("; {angle}"),
                (None, "") => String::new(),
                (None, why) => format!("; {why}"),
            };
            self.context.report(Diagnostic::new(
                Code::OutOfRange,
                span,
                format!("{what} is from {MIN} to {MAX}{unit}, and {number} is outside"),
                format!("write a value from {MIN} to {MAX}{because}"),
            ));
        }
        checked
    }
}
