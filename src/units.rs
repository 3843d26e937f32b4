//! Times as types: microseconds and nanoseconds, how they are formatted and parsed, and how long a
//! byte takes on a line.
//!
//! A moment is the time since a start (of the script, of the computer), so moments and durations
//! have the same type.

use std::fmt;
use std::ops::{Add, AddAssign, Mul, Sub};
use std::str::FromStr;

use serde::Serialize;

/// A time in whole microseconds, up to 584,000 years.
///
/// Operators and `saturating_*` stop at [`Micros::ZERO`] and [`Micros::MAX`] and never panic.
/// `Display` shows seconds, as for [`Nanos`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct Micros(pub u64);

/// A time in whole nanoseconds, up to 584 years.
///
/// Operators and `saturating_*` stop at [`Nanos::ZERO`] and [`Nanos::MAX`] and never panic.
///
/// `Display` shows seconds without a unit: with a precision exactly that many decimals, otherwise
/// as few as the time needs. Digits are truncated, not rounded, so that no time is shown before it
/// is reached. Width and fill are ignored.
///
/// ```
/// use motionseq::units::{Micros, Nanos};
///
/// assert_eq!(format!("{:.6} {:.3} {}", Micros(500_000), Micros(1_999_999), Micros(500_000)),
/// "0.500000 1.999 0.5"); assert_eq!(Nanos(1_234).to_string(), "0.000001234");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct Nanos(pub u64);

/// The operations that both units of time share.
macro_rules! arithmetic {
    ($time:ident) => {
        impl $time {
            /// Zero duration, or the start.
            pub const ZERO: $time = $time(0);
            /// The longest time, or never.
            pub const MAX: $time = $time(u64::MAX);

            /// The sum, at most [`MAX`](Self::MAX).
            #[must_use]
            pub const fn saturating_add(self, other: $time) -> $time {
                $time(self.0.saturating_add(other.0))
            }

            /// The difference; zero if `other` is longer.
            #[must_use]
            pub const fn saturating_sub(self, other: $time) -> $time {
                $time(self.0.saturating_sub(other.0))
            }

            /// This time multiplied by `factor`, at most [`MAX`](Self::MAX).
            #[must_use]
            pub const fn saturating_mul(self, factor: u64) -> $time {
                $time(self.0.saturating_mul(factor))
            }
        }

        /// Saturates at [`MAX`](Self::MAX).
        impl Add for $time {
            type Output = $time;

            fn add(self, other: $time) -> $time {
                self.saturating_add(other)
            }
        }

        /// Saturates at [`MAX`](Self::MAX).
        impl AddAssign for $time {
            fn add_assign(&mut self, other: $time) {
                *self = self.saturating_add(other);
            }
        }

        /// Saturates at zero.
        impl Sub for $time {
            type Output = $time;

            fn sub(self, other: $time) -> $time {
                self.saturating_sub(other)
            }
        }

        /// Saturates at [`MAX`](Self::MAX).
        impl Mul<u64> for $time {
            type Output = $time;

            fn mul(self, factor: u64) -> $time {
                self.saturating_mul(factor)
            }
        }
    };
}

arithmetic!(Micros);
arithmetic!(Nanos);

impl Micros {
    /// One second.
    pub const SECOND: Micros = Micros(1_000_000);
    /// The maximum length of a script: 24 hours.
    pub const DAY: Micros = Micros::SECOND.saturating_mul(24 * 60 * 60);

    /// A time in whole milliseconds.
    pub const fn from_millis(millis: u64) -> Micros {
        Micros(millis.saturating_mul(1_000))
    }

    /// The same time in nanoseconds, at most [`Nanos::MAX`].
    pub const fn nanos(self) -> Nanos {
        Nanos(self.0.saturating_mul(1_000))
    }

    /// The difference; `None` if `other` is longer.
    pub fn checked_sub(self, other: Micros) -> Option<Micros> {
        self.0.checked_sub(other.0).map(Micros)
    }

    /// Displays the time with a unit: `1.5 s`, `12.3 ms` or `850 µs`.
    pub fn short(self) -> Short {
        self.nanos().short()
    }

    /// Displays the time in milliseconds, without a unit.
    pub fn in_millis(self) -> InMillis {
        self.nanos().in_millis()
    }
}

impl Nanos {
    /// A time in whole milliseconds.
    pub const fn from_millis(millis: u64) -> Nanos {
        Micros::from_millis(millis).nanos()
    }

    /// Whole microseconds, truncated.
    pub const fn micros(self) -> Micros {
        Micros(self.0 / 1_000)
    }

    /// Whole microseconds, rounded up.
    pub const fn micros_up(self) -> Micros {
        Micros(self.0.div_ceil(1_000))
    }

    /// Parses seconds such as `0.02` or `12`, truncated to nanoseconds; `None` for other text.
    pub(crate) fn from_seconds(text: &str) -> Option<Nanos> {
        let (seconds, decimals) = text.split_once('.').unwrap_or((text, ""));
        if seconds.is_empty() || !text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.') {
            return None;
        }
        let decimals: String = decimals.chars().chain("000000000".chars()).take(9).collect();
        seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(decimals.parse().ok()?).map(Nanos)
    }

    /// Displays the time with a unit: `1.5 s`, `12.3 ms`, `850 µs` or `8.5 µs`.
    pub fn short(self) -> Short {
        Short(self)
    }

    /// Displays the time in milliseconds, without a unit.
    pub fn in_millis(self) -> InMillis {
        InMillis(self)
    }
}

/// Shows seconds, as for [`Nanos`].
impl fmt::Display for Micros {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        decimal(self.0, 6, f)
    }
}

/// Shows seconds.
impl fmt::Display for Nanos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        decimal(self.0, 9, f)
    }
}

/// Displays a time in milliseconds: see [`Nanos::in_millis`].
#[derive(Clone, Copy, Debug)]
pub struct InMillis(Nanos);

impl fmt::Display for InMillis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        decimal(self.0.0, 6, f)
    }
}

/// Displays a time with its unit, for messages: see [`Nanos::short`].
#[derive(Clone, Copy, Debug)]
pub struct Short(Nanos);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Nanos(nanos) = self.0;
        let (places, unit, name): (usize, u32, &str) = match nanos {
            0..10_000 => (1, 3, "µs"),
            10_000..1_000_000 => (0, 3, "µs"),
            1_000_000..1_000_000_000 => (1, 6, "ms"),
            _ => (1, 9, "s"),
        };
        write!(f, "{:.places$} {name}", Decimal(nanos, unit))
    }
}

/// A number of parts and a power of ten: 10 to this power parts are one.
struct Decimal(u64, u32);

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        decimal(self.0, self.1, f)
    }
}

/// The only function that writes times as decimals: `parts` of 10^-`digits` (at most 9), truncated
/// to the precision, or without trailing zeros if there is none.
fn decimal(parts: u64, digits: u32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let scale = 10_u64.pow(digits);
    let (whole, mut part) = (parts / scale, parts % scale);
    let mut width = digits as usize;
    let places = f.precision();
    while width > 0 && places.map_or(part.is_multiple_of(10), |places| width > places) {
        (part, width) = (part / 10, width - 1);
    }
    write!(f, "{whole}")?;
    if width > 0 || places.is_some_and(|places| places > 0) {
        let more = places.unwrap_or(width) - width;
        write!(f, ".")?;
        if width > 0 {
            write!(f, "{part:0width$}")?;
        }
        write!(f, "{:0<more$}", "")?;
    }
    Ok(())
}

/// Why a string is not a duration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotATime {
    /// It is not a sequence of numbers with units of time.
    #[error("write a time such as 500ms, 1.5s or 1m30s")]
    Malformed,
    /// Its units are not in order from long to short, or one is repeated.
    #[error("write the units of a time from long to short, each once, such as 1m30s")]
    Order,
    /// It is longer than 292 years.
    #[error("this time is too long")]
    TooLong,
}

/// A unit of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Its name, written directly after the number.
    pub name: &'static str,
    /// Its meaning in words.
    pub meaning: &'static str,
    /// The quantity that it measures.
    pub of: Measure,
}

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Measure {
    /// A time, with the length of the unit.
    Time(Nanos),
    /// An angle.
    Angle,
    /// A voltage.
    Voltage,
    /// A tempo of music.
    Tempo,
    /// A frequency.
    Frequency,
}

/// Every unit, those of time from long to short. A test compares these with the grammar.
pub const UNITS: [Unit; 10] = [
    Unit { name: "h", meaning: "hours", of: Measure::Time(Nanos::from_millis(3_600_000)) },
    Unit { name: "min", meaning: "minutes", of: Measure::Time(Nanos::from_millis(60_000)) },
    Unit { name: "m", meaning: "minutes", of: Measure::Time(Nanos::from_millis(60_000)) },
    Unit { name: "s", meaning: "seconds", of: Measure::Time(Nanos::from_millis(1_000)) },
    Unit { name: "ms", meaning: "milliseconds", of: Measure::Time(Nanos::from_millis(1)) },
    Unit { name: "us", meaning: "microseconds", of: Measure::Time(Nanos(1_000)) },
    Unit { name: "deg", meaning: "degrees", of: Measure::Angle },
    Unit { name: "V", meaning: "volts", of: Measure::Voltage },
    Unit { name: "bpm", meaning: "beats a minute", of: Measure::Tempo },
    Unit { name: "hz", meaning: "times a second", of: Measure::Frequency },
];

impl Unit {
    /// The unit with this name.
    pub fn named(name: &str) -> Option<&'static Unit> {
        UNITS.iter().find(|unit| unit.name == name)
    }

    /// Whether this word is a unit even without a number. `m`, for example, may be a name.
    pub(crate) fn is_unmistakable(&self) -> bool {
        self.name != "m"
    }
}

/// The length of a unit of time; `None` for other words.
pub(crate) fn time_unit(name: &str) -> Option<Nanos> {
    match Unit::named(name)?.of {
        Measure::Time(length) => Some(length),
        _ => None,
    }
}

/// The most digits before and after the point of a number, as in the grammar.
const MAX_DIGITS: usize = 15;
/// Parts per nanosecond. Every duration that a script can contain is a whole number of parts.
const PARTS: u128 = 1_000_000_000_000_000;
/// The longest duration, in nanoseconds: 292 years.
const LONGEST: u128 = (1 << 63) - 1;

/// Parses a duration as scripts and options write it, such as `0.5s`, `250ms` or `1m30s`. Half a
/// microsecond is rounded up.
impl FromStr for Micros {
    type Err = NotATime;

    fn from_str(text: &str) -> Result<Self, NotATime> {
        let micro = 1_000 * PARTS;
        u64::try_from((parts(text)? + micro / 2) / micro).map(Micros).map_err(|_| NotATime::TooLong)
    }
}

/// Parses a duration exactly: a numerator in nanoseconds, and a denominator.
pub(crate) fn fraction(text: &str) -> Result<(i128, i128), NotATime> {
    let whole = |number: u128| i128::try_from(number).map_err(|_| NotATime::TooLong);
    Ok((whole(parts(text)?)?, whole(PARTS)?))
}

/// Parses a duration in [`PARTS`] of a nanosecond.
fn parts(text: &str) -> Result<u128, NotATime> {
    let (mut rest, mut sum, mut last) = (text, 0_u128, u64::MAX);
    loop {
        let (number, tail) = split(rest, |byte| byte.is_ascii_digit() || byte == b'.');
        let (name, next) = split(tail, |byte| byte.is_ascii_alphabetic());
        let Nanos(nanos) = time_unit(name).ok_or(NotATime::Malformed)?;
        if nanos >= last {
            return Err(NotATime::Order);
        }
        let term = number_in_parts(number)?.checked_mul(nanos.into());
        let total = term.and_then(|term| sum.checked_add(term)).filter(|total| *total <= LONGEST * PARTS);
        sum = total.ok_or(NotATime::TooLong)?;
        if next.is_empty() {
            return Ok(sum);
        }
        (rest, last) = (next, nanos);
    }
}

/// Splits a string after its longest prefix of matching bytes.
fn split(text: &str, is_one: impl Fn(u8) -> bool) -> (&str, &str) {
    let end = text.bytes().position(|byte| !is_one(byte)).unwrap_or(text.len());
    text.split_at_checked(end).unwrap_or((text, ""))
}

/// Parses a decimal number times [`PARTS`]; below 10³⁰.
fn number_in_parts(number: &str) -> Result<u128, NotATime> {
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    if [whole, fraction].iter().any(|digits| !(1..=MAX_DIGITS).contains(&digits.len())) {
        return Err(NotATime::Malformed);
    }
    let digits = |digits: &str| digits.parse::<u128>().map_err(|_| NotATime::Malformed);
    let decimals = digits(&format!("{fraction:0<MAX_DIGITS$}"))?;
    Ok(digits(whole)? * PARTS + decimals)
}

/// The bits that a byte takes on the line: a start bit, eight data bits, a stop bit (8N1).
pub(crate) const BITS_A_BYTE: u64 = 10;

/// The time of one byte at `baud` bits per second, truncated to whole nanoseconds.
pub const fn byte_time(baud: u32) -> Nanos {
    // A line of 0 baud carries nothing; treat it as 1 baud.
    let baud = if baud == 0 { 1 } else { baud as u64 };
    Nanos(BITS_A_BYTE * 1_000_000_000 / baud)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn arithmetic_saturates() {
        assert_eq!(Micros(1) - Micros(2), Micros::ZERO);
        assert_eq!(Micros::MAX + Micros(1), Micros::MAX);
        assert_eq!(Nanos::MAX * 2, Nanos::MAX);
        assert_eq!(Micros(1).checked_sub(Micros(2)), None);
        assert_eq!((Micros::MAX.nanos(), Nanos::MAX.micros()), (Nanos::MAX, Micros(18_446_744_073_709_551)));
        assert_eq!(
            (Nanos(1_999).micros(), Nanos(1_001).micros_up(), Nanos(1_000).micros_up()),
            (Micros(1), Micros(2), Micros(1))
        );
        assert_eq!((Micros::DAY, Micros::from_millis(u64::MAX)), (Micros(86_400_000_000), Micros::MAX));
    }

    #[test]
    fn times_are_shown_in_seconds() {
        let all = |time: Micros| {
            [format!("{time}"), format!("{time:.0}"), format!("{time:.3}"), format!("{time:.6}"), format!("{time:.8}")]
        };
        assert_eq!(all(Micros(0)), ["0", "0", "0.000", "0.000000", "0.00000000"]);
        assert_eq!(all(Micros(1_999_999)), ["1.999999", "1", "1.999", "1.999999", "1.99999900"]);
        assert_eq!(all(Micros(10_500_000)), ["10.5", "10", "10.500", "10.500000", "10.50000000"]);
        assert_eq!(Micros::MAX.to_string(), "18446744073709.551615");
        assert_eq!(
            (Nanos(5).to_string(), Nanos::MAX.to_string()),
            ("0.000000005".into(), "18446744073.709551615".into())
        );
        assert_eq!(format!("{:.3} {}", Micros(12_345).in_millis(), Nanos(1_500_000).in_millis()), "12.345 1.5");
        assert_eq!(serde_json::to_string(&Micros(12)).unwrap(), "12");
    }

    #[test]
    fn messages_show_the_unit_that_fits() {
        for (nanos, shown) in [
            (0, "0.0 µs"),
            (9_999, "9.9 µs"),
            (10_000, "10 µs"),
            (850_999, "850 µs"),
            (12_345_678, "12.3 ms"),
            (999_999_999, "999.9 ms"),
            (1_500_000_000, "1.5 s"),
        ] {
            assert_eq!(Nanos(nanos).short().to_string(), shown);
        }
    }

    #[test]
    fn seconds_are_read_to_the_nanosecond() {
        let read = Nanos::from_seconds;
        assert_eq!(
            [read("12"), read("0.02"), read("1.")],
            [12_000_000_000, 20_000_000, 1_000_000_000].map(|ns| Some(Nanos(ns)))
        );
        assert_eq!(read("0.0000000019"), Some(Nanos(1)));
        for text in ["", ".", ".5", "-1", "+1", "1e3", "1.2.3", "inf", "18446744074", "99999999999999999999"] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn durations_are_read_with_every_digit() {
        for (text, micros) in [
            ("0s", 0),
            ("0.5s", 500_000),
            ("250ms", 250_000),
            ("1m30s", 90_000_000),
            ("1min30s", 90_000_000),
            ("1h0.0005m", 3_600_030_000),
            ("0.5us", 1),
            ("0.499999999999999us", 0),
            ("24h", Micros::DAY.0),
            ("9223372036s854ms775.807us", i64::MAX as u64 / 1_000 + 1),
        ] {
            assert_eq!(text.parse(), Ok(Micros(micros)), "{text}");
        }
        assert_eq!(fraction("0.000000000000001us"), Ok((1_000, 1_000_000_000_000_000)));
    }

    #[test]
    fn what_is_not_a_duration_is_refused() {
        for text in [
            "",
            "s",
            "1",
            "inf",
            "1 s",
            " 1s",
            "-1s",
            "+1s",
            ".5s",
            "1.s",
            "1.2.3s",
            "1d",
            "1sec",
            "1s2",
            "90deg",
            "1S",
            "1µs",
            "1234567890123456s",
            "18446744073709551615s1000ms",
        ] {
            assert_eq!(text.parse::<Micros>(), Err(NotATime::Malformed), "{text}");
        }
        for text in ["1s1s", "1m1min", "1ms1s"] {
            assert_eq!(text.parse::<Micros>(), Err(NotATime::Order), "{text}");
        }
        for text in ["999999999999999h", "292000h999999999999s", "9223372036s854ms776us"] {
            assert_eq!(text.parse::<Micros>(), Err(NotATime::TooLong), "{text}");
        }
    }

    #[test]
    fn a_byte_is_ten_bits() {
        assert_eq!((byte_time(115_200), byte_time(9_600) * 3), (Nanos(86_805), Nanos(3_124_998)));
        assert_eq!((byte_time(0), byte_time(u32::MAX)), (Nanos(10_000_000_000), Nanos(2)));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 5_000, ..ProptestConfig::default() })]

        /// Durations that humantime accepts have the same value here; it refuses digits below a
        /// nanosecond.
        #[test]
        fn durations_are_those_of_humantime(
            text in "([0-9]{1,6}(\\.[0-9]{1,10})?h)?([0-9]{1,6}m)?([0-9]{1,7}(\\.[0-9]{1,10})?(s|ms|us))?",
        ) {
            if let Ok(time) = humantime::parse_duration(&text) {
                let rounded = (time + Duration::from_nanos(500)).as_micros();
                prop_assert_eq!(text.parse::<Micros>().map(|time| u128::from(time.0)), Ok(rounded));
            }
        }

        /// No string causes a panic.
        #[test]
        fn any_text_is_read_or_refused(text in "([0-9.]{0,18}(h|min|m|s|ms|us|x|µ)?){0,4}") {
            let _ = (text.parse::<Micros>(), Nanos::from_seconds(&text));
        }

        /// Each shorter decimal is a prefix of the exact one.
        #[test]
        fn decimals_are_cut_off(nanos: u64, places in 0_usize..12) {
            let (exact, cut) = (format!("{:.12}", Nanos(nanos)), format!("{:.places$}", Nanos(nanos)));
            prop_assert!(exact.starts_with(&cut));
            prop_assert_eq!(cut.len(), exact.len() - 12 + places - usize::from(places == 0));
        }
    }
}
