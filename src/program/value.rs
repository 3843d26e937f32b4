//! Numbers and their units.

use std::fmt;

use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;
use crate::syntax::{NumberShape, foreign};
use crate::units::{Measure, NotATime, UNITS, Unit};

use super::duration;
use super::suggest::{list, suggest};
use super::tempo::Tempo;
use super::time::Time;

/// A number with what it measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Quantity {
    /// A bare number.
    Number(f64),
    /// A time.
    Time(Time),
    /// An angle in degrees.
    Degrees(f64),
    /// Volts.
    Volts(f64),
    /// Beats per minute.
    Tempo(f64),
    /// Hertz.
    Hertz(f64),
    /// A moment of the script, which a mark names.
    Moment(Time),
    /// True or false.
    Truth(bool),
    /// A joint, by its number among the joints of the script.
    Joint(usize),
}

/// As a `say` shows it.
impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Quantity::Number(number) => write!(f, "{number}"),
            Quantity::Time(time) | Quantity::Moment(time) => write!(f, "{time}"),
            Quantity::Degrees(number) => write!(f, "{number}deg"),
            Quantity::Volts(number) => write!(f, "{number}V"),
            Quantity::Tempo(number) => write!(f, "{number}bpm"),
            Quantity::Hertz(number) => write!(f, "{number}hz"),
            Quantity::Truth(truth) => write!(f, "{truth}"),
            Quantity::Joint(_) => f.write_str(self.kind()),
        }
    }
}

impl Quantity {
    /// What it is, for messages.
    pub(super) fn kind(self) -> &'static str {
        match self {
            Quantity::Number(_) => "a number without a unit",
            Quantity::Time(_) => "a time",
            Quantity::Degrees(_) => "an angle",
            Quantity::Volts(_) => "a voltage",
            Quantity::Tempo(_) => "a tempo",
            Quantity::Hertz(_) => "a frequency",
            Quantity::Moment(_) => "a moment",
            Quantity::Truth(_) => "true or false",
            Quantity::Joint(_) => "a joint",
        }
    }

    /// The negated value; `None` if it cannot be negative.
    pub(super) fn negated(self) -> Option<Quantity> {
        Some(match self {
            Quantity::Number(x) => Quantity::Number(-x),
            Quantity::Time(time) => Quantity::Time(time.negated()),
            Quantity::Degrees(x) => Quantity::Degrees(-x),
            Quantity::Volts(x) => Quantity::Volts(-x),
            Quantity::Tempo(x) => Quantity::Tempo(-x),
            Quantity::Hertz(x) => Quantity::Hertz(-x),
            Quantity::Moment(_) | Quantity::Truth(_) | Quantity::Joint(_) => return None,
        })
    }

    /// The number and its unit, for those that are a float.
    #[expect(clippy::type_complexity, reason = "a unit is the way back to a quantity")]
    pub(super) fn float(self) -> Option<(f64, fn(f64) -> Quantity)> {
        Some(match self {
            Quantity::Number(x) => (x, Quantity::Number),
            Quantity::Degrees(x) => (x, Quantity::Degrees),
            Quantity::Volts(x) => (x, Quantity::Volts),
            Quantity::Tempo(x) => (x, Quantity::Tempo),
            Quantity::Hertz(x) => (x, Quantity::Hertz),
            Quantity::Time(_) | Quantity::Moment(_) | Quantity::Truth(_) | Quantity::Joint(_) => return None,
        })
    }
}

/// The unit that a word after a space is, or is meant to be.
pub(super) fn unit_meant(word: &str) -> Option<&'static str> {
    let unit = match word {
        "sec" | "secs" | "second" | "seconds" => "s",
        "msec" | "millis" | "milliseconds" => "ms",
        "usec" | "micros" | "microseconds" => "us",
        "mins" | "minute" | "minutes" => "min",
        "hr" | "hrs" | "hour" | "hours" => "h",
        "degree" | "degrees" => "deg",
        other => other,
    };
    Unit::named(unit).map(|unit| unit.name)
}

/// Reads a number with its unit, at a tempo.
pub(super) fn number(shape: NumberShape, text: &str, span: Span, tempo: Tempo) -> Result<Quantity, Box<Diagnostic>> {
    match shape {
        NumberShape::Hex => {
            let digits = text.strip_prefix("0x").unwrap_or(text);
            u32::from_str_radix(digits, 16)
                .map(|number| Quantity::Number(f64::from(number)))
                .map_err(|_| odd(text, span).into())
        }
        NumberShape::Duration => duration(text, span),
        NumberShape::Plain => plain(text, span),
        NumberShape::Beats => {
            let (digits, unit) = text.split_once([' ', '\t']).unwrap_or((text, ""));
            let one = if unit.trim_start().starts_with("bar") { tempo.bar() } else { tempo.beat() };
            let time = digits.parse().ok().and_then(|number: f64| one.by_number(number));
            time.map(Quantity::Time).ok_or_else(|| odd(text, span).into())
        }
        NumberShape::Ratio => Err(Box::new(diagnostic!(MissingParentheses, span,
            "a division as an argument needs parentheses"; write: span => "({text})"))),
        NumberShape::Odd => Err(odd(text, span).into()),
    }
}

/// A number, perhaps followed by letters.
fn plain(text: &str, span: Span) -> Result<Quantity, Box<Diagnostic>> {
    let digits_end = text.bytes().position(|byte| !byte.is_ascii_digit() && byte != b'.').unwrap_or(text.len());
    let (digits, name) = text.split_at_checked(digits_end).unwrap_or((text, ""));
    let Some(number) = float(digits) else {
        return Err(odd(text, span).into());
    };
    if name.is_empty() {
        return Ok(Quantity::Number(number));
    }
    if digits == "0" && name.starts_with('x') {
        return Err(odd(text, span).into());
    }
    match Unit::named(name).map(|unit| unit.of) {
        Some(Measure::Angle) => return Ok(Quantity::Degrees(number)),
        Some(Measure::Voltage) => return Ok(Quantity::Volts(number)),
        Some(Measure::Tempo) => return Ok(Quantity::Tempo(number)),
        Some(Measure::Frequency) => return Ok(Quantity::Hertz(number)),
        Some(Measure::Time(_)) | None => {}
    }
    let names = || UNITS.iter().map(|unit| unit.name);
    let help = match name {
        "µs" | "μs" | "usec" => format!("write microseconds as `{digits}us`"),
        "ns" | "nsec" | "nanos" => "times are sent in whole microseconds: write `us` or longer".into(),
        "d" | "day" | "days" | "w" | "week" | "weeks" | "M" | "month" | "months" | "y" | "year" | "years" => {
            "a script is at most 24 hours long; write hours as `h`".into()
        }
        "mm" | "cm" => format!("lengths and speeds have no unit: write `{digits}`"),
        "S" => format!("write seconds as `{digits}s`"),
        "H" => format!("write hours as `{digits}h`"),
        "beat" | "beats" | "bar" | "bars" => {
            return Err(
                diagnostic!(Unit, span, "`{name}` needs a space before it"; help: "write `{digits} {name}`").into()
            );
        }
        _ => match unit_meant(name).or_else(|| suggest(name, names())) {
            Some(near) => format!("did you mean `{digits}{near}`?"),
            None => format!("the units are {}", list(names())),
        },
    };
    Err(diagnostic!(Unit, span, "`{name}` is not a unit"; help: "{help}").into())
}

/// A decimal number. There is a faster way for whole numbers, which most are.
fn float(digits: &str) -> Option<f64> {
    small(digits).or_else(|| digits.parse().ok())
}

/// A whole number of few digits.
#[inline]
pub(super) fn small(digits: &str) -> Option<f64> {
    if !(1..=9).contains(&digits.len()) {
        return None;
    }
    let mut number = 0_u32;
    for byte in digits.bytes() {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        number = number * 10 + u32::from(digit);
    }
    Some(f64::from(number))
}

/// A time, as [`duration`](super::duration) reads it.
fn duration(text: &str, span: Span) -> Result<Quantity, Box<Diagnostic>> {
    let error = |wrong| match wrong {
        NotATime::Order => diagnostic!(Number, span, "the units of `{text}` are not in descending order";
            help: "write the longest unit first and each unit once: `1h30m`, `1m30s`, `1s500ms`"),
        NotATime::TooLong => diagnostic!(Number, span, "`{text}` is longer than 292 years";
            help: "a script is at most 24 hours long"),
        NotATime::Malformed => odd(text, span),
    };
    duration::read(text).map(Quantity::Time).map_err(|wrong| error(wrong).into())
}

/// What is wrong with something that starts with a digit and is not a number.
fn odd(text: &str, span: Span) -> Diagnostic {
    if let Some(number) = foreign::without_exponent(text) {
        return diagnostic!(Number, span, "`{text}` has an exponent"; write: span => "{number}");
    }
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    let help = if text.starts_with("0x") {
        "a hexadecimal number has one to eight digits from 0-9 and A-F, such as `0x1F`"
    } else if digits > 15 || text.split('.').nth(1).is_some_and(|rest| rest.len() > 15) {
        "a number has at most 15 digits before its decimal point, and 15 after it"
    } else if text.contains(['e', 'E']) {
        "write the number without an exponent"
    } else if text.matches('.').count() > 1 {
        "a number has one decimal point"
    } else {
        "a number consists of digits, perhaps with a decimal point, directly followed by its unit: `1500us`, `0.5s`, `1m30s`"
    };
    let shown: String = text.chars().take(40).collect();
    diagnostic!(Number, span, "`{shown}` is not a number"; help: "{help}")
}

/// The whole number nearest to `number`, halves away from zero; `None` far outside of what anything here needs.
pub(super) fn round(number: f64) -> Option<i32> {
    let rounded = libm::round(number);
    #[expect(clippy::cast_possible_truncation, reason = "in range and whole")]
    (rounded.abs() <= f64::from(i32::MAX)).then_some(rounded as i32)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 5_000, ..ProptestConfig::default() })]

        #[test]
        fn whole_numbers_are_those_of_the_standard_library(text in "[0-9]{1,15}") {
            prop_assert_eq!(float(&text), text.parse().ok());
        }
    }
}
