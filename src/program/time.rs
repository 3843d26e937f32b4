//! Moments and lengths of time, exact until they are rounded, once, to whole microseconds.

use std::fmt;
use std::time::Duration;

/// A time in whole nanoseconds, which is as fine as a script can write one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(i64);

impl Time {
    /// No time.
    pub const ZERO: Time = Time(0);
    /// The longest script.
    pub const LONGEST: Time = Time(24 * 3_600 * 1_000_000_000);

    /// So many milliseconds.
    pub const fn from_millis(millis: u32) -> Time {
        Time(millis as i64 * 1_000_000)
    }

    /// The same time; `None` beyond 292 years.
    pub fn from_duration(duration: Duration) -> Option<Time> {
        i64::try_from(duration.as_nanos()).ok().map(Time)
    }

    /// In nanoseconds.
    pub fn nanos(self) -> i64 {
        self.0
    }

    /// In whole microseconds, half up; times before zero count as zero.
    pub fn micros(self) -> u64 {
        u64::try_from(self.0.saturating_add(500).div_euclid(1_000)).unwrap_or(0)
    }

    /// The sum, held at the ends of what a time can be; those are far beyond [`Time::LONGEST`].
    #[must_use]
    pub fn plus(self, other: Time) -> Time {
        Time(self.0.saturating_add(other.0))
    }

    /// The difference, held likewise.
    #[must_use]
    pub fn minus(self, other: Time) -> Time {
        Time(self.0.saturating_sub(other.0))
    }

    /// So many times as long, held likewise.
    #[must_use]
    pub fn times(self, factor: u64) -> Time {
        Time(self.0.saturating_mul(i64::try_from(factor).unwrap_or(i64::MAX)))
    }
}

/// In seconds, as short as exact: `0.5s`.
impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let nanos = self.0.unsigned_abs();
        let (seconds, fraction) = (nanos / 1_000_000_000, nanos % 1_000_000_000);
        let fraction = format!("{fraction:09}");
        match fraction.trim_end_matches('0') {
            "" => write!(f, "{sign}{seconds}s"),
            digits => write!(f, "{sign}{seconds}.{digits}s"),
        }
    }
}
