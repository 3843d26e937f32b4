//! Durations as scripts write them: `0.5s`, `1m30s`. Exact, however many digits there are.

use super::time::Time;
use crate::units::{self, Measure, Nanos, NotATime, UNITS};

impl Time {
    /// Reads a length of time as a script writes it, such as `0.5s`, `250ms` or `1m30s`; `None` for anything else.
    pub fn parse(text: &str) -> Option<Time> {
        read(text).ok()
    }
}

/// Reads a length of time.
pub(super) fn read(text: &str) -> Result<Time, NotATime> {
    if let Some(time) = one_unit(text) {
        return Ok(time);
    }
    let (nanos, per) = units::fraction(text)?;
    Time::from_fraction(nanos, per).ok_or(NotATime::TooLong)
}

/// A short time with one unit, as nearly all lines of a long script have one: the same, sooner. `None` is any other.
fn one_unit(text: &str) -> Option<Time> {
    let mut rest = text.as_bytes();
    let (mut number, mut digits, mut places) = (0_i64, 0, None);
    while let [byte @ (b'0'..=b'9' | b'.'), tail @ ..] = rest {
        match (byte, &mut places) {
            (b'.', None) if digits > 0 => places = Some(0),
            (b'.', _) => return None,
            (byte, places) => {
                number = number * 10 + i64::from(byte - b'0');
                digits += 1;
                *places = places.map(|places: u32| places + 1);
            }
        }
        if digits > 15 {
            return None;
        }
        rest = tail;
    }
    let unit = UNITS.iter().find(|unit| unit.name.as_bytes() == rest)?;
    let Measure::Time(Nanos(nanos)) = unit.of else { return None };
    if digits == 0 || places == Some(0) {
        return None;
    }
    let (nanos, parts) = (number.checked_mul(i64::try_from(nanos).ok()?)?, 10_i64.pow(places.unwrap_or(0)));
    // What is finer than a nanosecond is a fraction.
    (nanos % parts == 0).then(|| Time::from_nanos(nanos / parts))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The long way.
    fn exact(text: &str) -> Option<Time> {
        let (nanos, per) = units::fraction(text).unwrap();
        Time::from_fraction(nanos, per)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 5_000, ..ProptestConfig::default() })]

        /// The short way to a time is exact.
        #[test]
        fn short_times_are_exact(text in "[0-9]{1,7}(\\.[0-9]{1,10})?(s|ms|us)") {
            if let Some(time) = one_unit(&text) {
                prop_assert_eq!(exact(&text), Some(time));
            }
        }
    }

    #[test]
    fn usual_times_take_the_short_way() {
        for text in ["0.5s", "10ms", "1234.56s", "250us"] {
            assert!(one_unit(text).is_some(), "{text}");
        }
    }

    #[test]
    fn all_digits_count() {
        let fraction = |nanos, per| Time::from_fraction(nanos, per).unwrap();
        for (text, time) in [
            ("0.0001h", fraction(360_000_000, 1)),
            ("0.333333333333s", fraction(333_333_333_333, 1_000)),
            ("123.4567us", fraction(1_234_567, 10)),
            ("0.000000000000001s", fraction(1, 1_000_000)),
            ("0.000000000000001us", fraction(1, 1_000_000_000_000)),
            ("1h0.0005m", fraction(3_600_030_000_000, 1)),
            ("999999999.999999999999999s", fraction(999_999_999_999_999_999_999_999, 1_000_000)),
        ] {
            assert_eq!(read(text), Ok(time), "{text}");
        }
    }

    #[test]
    fn what_is_longer_than_times_can_be_is_refused() {
        for text in ["9223372036s854ms775.8075us", "999999999999999h"] {
            assert_eq!(read(text), Err(NotATime::TooLong), "{text}");
        }
    }
}
