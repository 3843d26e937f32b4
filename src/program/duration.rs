//! Lengths of time as scripts write them: `0.5s`, `1m30s`. Exact, however many digits there are.

use super::time::Time;

/// Why a text is not a length of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrong {
    /// It is not numbers with units of time.
    NoTime,
    /// Its units do not go from long to short, each at most once.
    Order,
    /// It is longer than 292 years.
    TooLong,
}

/// The units of time from the longest to the shortest, with their nanoseconds.
pub(super) const UNITS: [(&str, i64); 6] = [
    ("h", 3_600_000_000_000),
    ("min", 60_000_000_000),
    ("m", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
];

/// The most digits before and behind a point, as in the grammar.
const MAX_DIGITS: usize = 15;

impl Time {
    /// Reads a length of time as a script writes it, such as `0.5s`, `250ms` or `1m30s`; `None` for anything else.
    pub fn parse(text: &str) -> Option<Time> {
        read(text).ok()
    }
}

/// Reads a length of time.
pub(super) fn read(text: &str) -> Result<Time, Wrong> {
    if let Some(time) = one_unit(text) {
        return Ok(time);
    }
    let (mut rest, mut sum, mut last) = (text, Time::ZERO, i64::MAX);
    loop {
        let (number, behind) = split(rest, |byte| byte.is_ascii_digit() || byte == b'.');
        let (name, next) = split(behind, |byte| byte.is_ascii_alphabetic());
        let (_, nanos) = *UNITS.iter().find(|(unit, _)| *unit == name).ok_or(Wrong::NoTime)?;
        if nanos >= last {
            return Err(Wrong::Order);
        }
        sum = sum.checked_plus(part(number, nanos)?).ok_or(Wrong::TooLong)?;
        if next.is_empty() {
            return Ok(sum);
        }
        (rest, last) = (next, nanos);
    }
}

/// Splits a text behind its first bytes of a kind.
fn split(text: &str, is_one: impl Fn(u8) -> bool) -> (&str, &str) {
    let end = text.bytes().position(|byte| !is_one(byte)).unwrap_or(text.len());
    text.split_at_checked(end).unwrap_or((text, ""))
}

/// A decimal number of units of so many nanoseconds.
fn part(number: &str, nanos: i64) -> Result<Time, Wrong> {
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    if [whole, fraction].iter().any(|digits| !(1..=MAX_DIGITS).contains(&digits.len())) {
        return Err(Wrong::NoTime);
    }
    let digits = |digits: &str| digits.parse::<i64>().map_err(|_| Wrong::NoTime);
    // Both are below 10¹⁵, so the sum is exact and the result fits whatever the unit.
    let time = Time::from_nanos(nanos).scaled(digits(whole)?, 1).ok_or(Wrong::TooLong)?;
    let per = u32::try_from(fraction.len()).ok().and_then(|places| 10_i64.checked_pow(places)).ok_or(Wrong::NoTime)?;
    let rest = Time::from_nanos(nanos).scaled(digits(fraction)?, per).ok_or(Wrong::TooLong)?;
    time.checked_plus(rest).ok_or(Wrong::TooLong)
}

/// A short time with one unit, as nearly all lines of a long script have one: the same, sooner. `None` is any other.
fn one_unit(text: &str) -> Option<Time> {
    let mut rest = text.as_bytes();
    let (mut number, mut digits, mut places) = (0_i64, 0, None);
    while let [byte @ (b'0'..=b'9' | b'.'), behind @ ..] = rest {
        match (byte, &mut places) {
            (b'.', None) if digits > 0 => places = Some(0),
            (b'.', _) => return None,
            (byte, places) => {
                number = number * 10 + i64::from(byte - b'0');
                digits += 1;
                *places = places.map(|places: u32| places + 1);
            }
        }
        if digits > MAX_DIGITS {
            return None;
        }
        rest = behind;
    }
    let nanos = match rest {
        b"s" => 1_000_000_000,
        b"ms" => 1_000_000,
        b"us" => 1_000,
        _ => return None,
    };
    if digits == 0 || places == Some(0) {
        return None;
    }
    let (nanos, parts) = (number.checked_mul(nanos)?, 10_i64.pow(places.unwrap_or(0)));
    // What is finer than a nanosecond is a fraction.
    (nanos % parts == 0).then(|| Time::from_nanos(nanos / parts))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 5_000, ..ProptestConfig::default() })]

        /// What humantime reads of these is read the same; it refuses what is finer than a nanosecond.
        #[test]
        fn times_are_those_of_humantime(
            text in "([0-9]{1,6}(\\.[0-9]{1,10})?h)?([0-9]{1,6}m)?([0-9]{1,7}(\\.[0-9]{1,10})?(s|ms|us))?",
        ) {
            if let Some(time) = humantime::parse_duration(&text).ok().and_then(Time::from_duration) {
                prop_assert_eq!(Time::parse(&text), Some(time));
            }
        }

        /// The short way to a time is exact.
        #[test]
        fn short_times_are_exact(text in "[0-9]{1,7}(\\.[0-9]{1,10})?", unit in 0_usize..3) {
            let (name, nanos) = [("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1_000)][unit];
            let text = text + name;
            if let Some(time) = one_unit(&text) {
                prop_assert_eq!(part(text.trim_end_matches(name), nanos), Ok(time));
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
        let exact = |nanos, per| Time::from_fraction(nanos, per).unwrap();
        for (text, time) in [
            ("0.0001h", exact(360_000_000, 1)),
            ("0.333333333333s", exact(333_333_333_333, 1_000)),
            ("123.4567us", exact(1_234_567, 10)),
            ("0.000000000000001s", exact(1, 1_000_000)),
            ("0.000000000000001us", exact(1, 1_000_000_000_000)),
            ("1h0.0005m", exact(3_600_030_000_000, 1)),
            ("999999999.999999999999999s", exact(999_999_999_999_999_999_999_999, 1_000_000)),
        ] {
            assert_eq!(read(text), Ok(time), "{text}");
        }
    }

    #[test]
    fn what_is_no_time() {
        for (text, wrong) in [
            ("", Wrong::NoTime),
            ("s", Wrong::NoTime),
            ("1", Wrong::NoTime),
            ("inf", Wrong::NoTime),
            ("1 s", Wrong::NoTime),
            ("-1s", Wrong::NoTime),
            ("+1s", Wrong::NoTime),
            (".5s", Wrong::NoTime),
            ("1.s", Wrong::NoTime),
            ("1.2.3s", Wrong::NoTime),
            ("1d", Wrong::NoTime),
            ("1sec", Wrong::NoTime),
            ("1s2", Wrong::NoTime),
            ("90deg", Wrong::NoTime),
            ("1234567890123456s", Wrong::NoTime),
            ("1s1s", Wrong::Order),
            ("1m1min", Wrong::Order),
            ("1ms1s", Wrong::Order),
            ("999999999999999h", Wrong::TooLong),
            ("292000h999999999999s", Wrong::TooLong),
        ] {
            assert_eq!(read(text), Err(wrong), "{text}");
        }
    }
}
