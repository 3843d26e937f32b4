//! Moments and lengths of time, exact until they are rounded, once, to whole microseconds.

use std::cmp::Ordering;
use std::fmt;

use crate::units::{Micros, Nanos};

/// A time as an exact fraction of nanoseconds.
///
/// A beat of 1/3 s stays one: three of them are a second. A fraction that needs more than 64 bits a side is rounded to
/// 10⁻¹⁵ s (10⁻¹⁴ s beyond two and a half hours). No time is longer than 292 years, forwards or backwards: a calculation
/// that leads further has no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Time {
    nanos: i64,
    /// What the nanoseconds are divided by; above zero, and with no factor in common.
    per: i64,
}

/// Parts of a nanosecond that a fraction is rounded to where it needs too many bits.
const FINEST: i64 = 1_000_000;

impl Default for Time {
    fn default() -> Self {
        Time::ZERO
    }
}

impl Time {
    /// No time.
    pub const ZERO: Time = Time::from_nanos(0);
    /// The longest time there is: 292 years.
    const MAX: Time = Time::from_nanos(i64::MAX);
    /// The longest script: [`Micros::DAY`].
    pub const LONGEST: Time = Time::from_nanos(Micros::DAY.nanos().0.cast_signed());

    pub(super) const fn from_nanos(nanos: i64) -> Time {
        Time { nanos, per: 1 }
    }

    /// A whole number of microseconds.
    pub(crate) fn from_micros(micros: Micros) -> Time {
        Time::from_nanos(i64::try_from(micros.nanos().0).unwrap_or(i64::MAX))
    }

    /// Milliseconds.
    pub const fn from_millis(millis: u32) -> Time {
        Time::from_nanos(millis as i64 * 1_000_000)
    }

    /// Nanoseconds divided by `per`, which is not zero; `None` beyond 292 years.
    pub(super) fn from_fraction(nanos: i128, per: i128) -> Option<Time> {
        (per != 0).then(|| Time::exact(nanos, per)).flatten()
    }

    /// `nanos / per`, in lowest terms, rounded where that needs too many bits; `None` beyond 292 years. `per` is not zero.
    fn exact(nanos: i128, per: i128) -> Option<Time> {
        let common = gcd(nanos.unsigned_abs(), per.unsigned_abs());
        let common = i128::try_from(common).unwrap_or(1) * per.signum();
        let (nanos, per) = (nanos / common, per / common);
        // The minimum has no opposite.
        let fits = |nanos: i128| i64::try_from(nanos).ok().filter(|nanos| *nanos != i64::MIN);
        if let (Some(nanos), Ok(per)) = (fits(nanos), i64::try_from(per)) {
            return Some(Time { nanos, per });
        }
        // As fine as fits: 10⁻¹⁵ s, for hours a little less.
        let part = |finest: i64| {
            let whole = nanos.div_euclid(per).checked_mul(i128::from(finest))?;
            let all = whole.checked_add(rounded(nanos.rem_euclid(per), per, finest))?;
            fits(all).and_then(|_| Time::exact(all, i128::from(finest)))
        };
        [FINEST, FINEST / 10, FINEST / 100, FINEST / 1_000, 1].into_iter().find_map(part)
    }

    /// Whether it is a whole number of nanoseconds.
    pub(super) fn is_whole(self) -> bool {
        self.per == 1
    }

    /// In whole microseconds, half up; times before zero count as zero.
    pub fn micros(self) -> Micros {
        // Nearly every time is whole nanoseconds.
        if let (1, Ok(nanos)) = (self.per, u64::try_from(self.nanos)) {
            return Micros(nanos / 1_000 + u64::from(nanos % 1_000 >= 500));
        }
        let (nanos, per) = (i128::from(self.nanos), i128::from(self.per));
        Micros(u64::try_from((2 * nanos + 1_000 * per).div_euclid(2_000 * per)).unwrap_or(0))
    }

    /// Rounded to whole microseconds, and at least one.
    #[must_use]
    pub(super) fn in_whole_micros(self) -> Time {
        let micros = i64::try_from(self.micros().0.max(1)).unwrap_or(i64::MAX);
        Time::from_nanos(micros.saturating_mul(1_000))
    }

    /// The sum; `None` beyond 292 years.
    pub(crate) fn checked_plus(self, other: Time) -> Option<Time> {
        if (self.per, other.per) == (1, 1)
            && let Some(nanos) = self.nanos.checked_add(other.nanos).filter(|nanos| *nanos != i64::MIN)
        {
            return Some(Time::from_nanos(nanos));
        }
        let [a, b, c, d] = [self.nanos, self.per, other.nanos, other.per].map(i128::from);
        Time::exact(a * d + c * b, b * d)
    }

    /// The difference; `None` beyond 292 years.
    pub(crate) fn checked_minus(self, other: Time) -> Option<Time> {
        self.checked_plus(other.negated())
    }

    /// The sum, for places in a script: beyond 292 years it is held there, which is still longer than any script may be.
    #[must_use]
    pub(crate) fn plus(self, other: Time) -> Time {
        let held = if self < Time::ZERO { Time::MAX.negated() } else { Time::MAX };
        self.checked_plus(other).unwrap_or(held)
    }

    /// The difference, held as a sum is.
    #[must_use]
    pub fn minus(self, other: Time) -> Time {
        self.plus(other.negated())
    }

    /// The same length backwards.
    #[must_use]
    pub(crate) fn negated(self) -> Time {
        Time { nanos: self.nanos.saturating_neg(), ..self }
    }

    /// `above / below` times as long; `None` where `below` is zero, and beyond 292 years.
    pub(crate) fn scaled(self, above: i64, below: i64) -> Option<Time> {
        let [a, b, c, d] = [self.nanos, self.per, above, below].map(i128::from);
        Time::from_fraction(a * c, b * d)
    }

    /// This time multiplied by a count, with the bound of a sum.
    #[must_use]
    pub fn times(self, factor: u64) -> Time {
        let held = if self < Time::ZERO { Time::MAX.negated() } else { Time::MAX };
        i64::try_from(factor).ok().and_then(|factor| self.scaled(factor, 1)).unwrap_or(held)
    }

    /// As many times as long as this number says; a number counts as the decimal that it prints as. `None` where the number
    /// is too long to be exact.
    pub(crate) fn by_number(self, number: f64) -> Option<Time> {
        let (above, below) = decimal(number)?;
        self.scaled(above, below)
    }

    /// Divided by a number, which counts as the decimal that it prints as. `None` for zero and for numbers too long.
    pub(crate) fn over_number(self, number: f64) -> Option<Time> {
        let (above, below) = decimal(number)?;
        self.scaled(below, above)
    }

    /// How often `other` goes into it. `None` where `other` is zero.
    pub fn over(self, other: Time) -> Option<f64> {
        let [a, b, c, d] = [self.nanos, self.per, other.nanos, other.per].map(i128::from);
        // Divided in whole numbers first, so that what comes out even is even.
        let (above, below) = (a * d, b * c);
        if below == 0 {
            return None;
        }
        let whole = above / below;
        #[expect(clippy::cast_precision_loss, reason = "a float is what is asked for")]
        Some(whole as f64 + (above % below) as f64 / below as f64)
    }

    /// The remainder of the division by `other`; it has the sign of `other`. `None` if `other` is zero.
    pub(crate) fn remainder(self, other: Time) -> Option<Time> {
        let [a, b, c, d] = [self.nanos, self.per, other.nanos, other.per].map(i128::from);
        let below = c * b;
        let rest = (a * d).checked_rem(below)?;
        let is_other_side = rest != 0 && (rest < 0) != (below < 0);
        Time::exact(if is_other_side { rest + below } else { rest }, b * d)
    }

    /// As a number of microseconds.
    pub(crate) fn in_micros(self) -> f64 {
        self.over(Time::from_nanos(1_000)).unwrap_or(0.0)
    }
}

/// The part below one nanosecond, in units of `1 / finest`, half up.
fn rounded(rest: i128, per: i128, finest: i64) -> i128 {
    // `rest` is below `per`, which is below 2^127: scale both down where doubling them would not fit.
    let shift = (128 - per.leading_zeros()).saturating_sub(100);
    let (rest, per) = (rest >> shift, (per >> shift).max(1));
    (2 * rest * i128::from(finest) + per).div_euclid(2 * per)
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.max(1)
}

/// A number as the fraction of the decimal that it prints as; `None` where that needs more than 64 bits.
pub(super) fn decimal(number: f64) -> Option<(i64, i64)> {
    if !number.is_finite() {
        return None;
    }
    let fraction = |text: &str| {
        let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
        let above = format!("{whole}{fraction}").parse().ok()?;
        let below = 10_i64.checked_pow(u32::try_from(fraction.len()).ok()?)?;
        Some((above, below))
    };
    // A decimal that is too long is cut to as many places as fit.
    fraction(&number.to_string()).or_else(|| (0..=17).rev().find_map(|places| fraction(&format!("{number:.places$}"))))
}

impl PartialOrd for Time {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Time {
    fn cmp(&self, other: &Self) -> Ordering {
        if self.per == other.per {
            return self.nanos.cmp(&other.nanos);
        }
        let [a, b, c, d] = [self.nanos, self.per, other.nanos, other.per].map(i128::from);
        (a * d).cmp(&(c * b))
    }
}

/// In seconds: `0.5s`; where that never ends, to the nanosecond.
impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let nanos = i128::from(self.nanos) * 2 + i128::from(self.per);
        let nanos = nanos.div_euclid(2 * i128::from(self.per));
        let sign = if nanos < 0 { "-" } else { "" };
        write!(f, "{sign}{}s", Nanos(u64::try_from(nanos.unsigned_abs()).unwrap_or(u64::MAX)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirds_of_a_second_do_not_drift() {
        let second = Time::from_millis(1_000);
        let third = second.scaled(1, 3).unwrap();
        assert_eq!(third.micros(), Micros(333_333));
        assert_eq!(third.plus(third).micros(), Micros(666_667));
        assert_eq!(third.plus(third).plus(third), second);
        assert_eq!(second.over(third), Some(3.0));
        assert_eq!(second.by_number(0.1).unwrap().micros(), Micros(100_000));
    }

    #[test]
    fn fractions_past_64_bits_are_rounded_and_never_panic() {
        let mut time = Time::from_millis(1_000);
        for prime in [7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73] {
            time = time.plus(time.scaled(1, prime).unwrap());
        }
        assert!(time.micros() > Micros::SECOND);
        assert_eq!(Time::MAX.by_number(0.000_000_1).unwrap().over(Time::MAX).unwrap().to_bits(), 1e-7_f64.to_bits());
    }

    #[test]
    fn no_calculation_is_held_at_292_years() {
        let (far, back) = (Time::MAX, Time::MAX.negated());
        let nano = Time::from_nanos(1);
        for result in [
            far.checked_plus(nano),
            back.checked_minus(nano),
            far.checked_plus(nano.scaled(2, 3).unwrap()),
            far.scaled(2, 1),
            back.scaled(2, 1),
            far.by_number(1.000_001),
            far.over_number(0.999),
            Time::from_fraction(i128::MAX, 3),
        ] {
            assert_eq!(result, None);
        }
        assert_eq!((far.checked_plus(back), far.scaled(1, 1)), (Some(Time::ZERO), Some(far)));
        // Places in a script stay beyond its longest.
        assert_eq!((far.plus(nano), back.minus(nano), far.times(u64::MAX)), (far, back, far));
    }

    #[test]
    fn remainders_have_the_sign_of_the_divisor() {
        let time = Time::from_millis;
        assert_eq!(time(700).remainder(time(500)), Some(time(200)));
        assert_eq!(time(700).negated().remainder(time(500)), Some(time(300)));
        assert_eq!(time(700).remainder(time(500).negated()), Some(time(300).negated()));
        assert_eq!(time(700).remainder(Time::ZERO), None);
    }
}
