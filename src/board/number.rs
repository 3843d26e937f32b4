//! Numbers that are inside the range that the board takes, or do not exist.

use std::cmp::Ordering;
use std::fmt;

/// A whole number from `MIN` to `MAX`. It is kept in the lower three bytes of an `i32`, which is enough for every range of the
/// protocol: there may be millions of commands.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ranged<const MIN: i32, const MAX: i32>([u8; 3]);

/// Index of a servo, 1-4 (protocol row 0x02, 3).
pub type ServoIndex = Ranged<1, 4>;
/// Pulse width of a servo in microseconds, 500-2500 (protocol rows 0x02).
pub type PulseWidth = Ranged<500, 2500>;
/// Pulse width of the tilt servo in microseconds, 500-1950 (protocol row 0x02, 4). More damages it.
pub type TiltPulseWidth = Ranged<500, 1950>;
/// Speed along an axis or of a wheel in the board's own unit, -25..25 (protocol rows 0x03).
pub type Speed = Ranged<-25, 25>;
/// Turning speed in the board's own unit, -200..200, clockwise positive (protocol row 0x03, 0x01).
pub type TurnRate = Ranged<-200, 200>;
/// Displacement in the board's own unit: 16 bits and a sign (protocol row 0x03, 0x04).
pub type Displacement = Ranged<-65535, 65535>;

impl<const MIN: i32, const MAX: i32> Ranged<MIN, MAX> {
    /// The smallest value.
    pub const MIN: i32 = MIN;
    /// The largest value.
    pub const MAX: i32 = MAX;
    /// Zero, for ranges that hold it.
    pub const ZERO: Self = {
        assert!(MIN <= 0 && MAX >= 0, "the range does not hold zero");
        Ranged([0; 3])
    };

    /// Checks a value; fails with [`OutOfRange`].
    pub const fn new(value: i32) -> Result<Self, OutOfRange> {
        const { assert!(MIN >= -0x80_0000 && MAX <= 0x7F_FFFF, "three bytes hold no more") };
        if value < MIN || value > MAX {
            return Err(OutOfRange { value, min: MIN, max: MAX });
        }
        let [low, middle, high, _] = value.to_le_bytes();
        Ok(Ranged([low, middle, high]))
    }

    /// The value.
    pub const fn get(self) -> i32 {
        let [low, middle, high] = self.0;
        // The sign comes down from the highest byte.
        i32::from_le_bytes([0, low, middle, high]) >> 8
    }

    /// Whether it is zero.
    pub const fn is_zero(self) -> bool {
        self.get() == 0
    }

    /// Whether it is below zero.
    pub(crate) const fn is_negative(self) -> bool {
        self.get() < 0
    }

    /// The magnitude as the wire carries it: two bytes, high byte first. Every range here fits.
    pub(crate) const fn magnitude(self) -> [u8; 2] {
        const { assert!(MIN >= -0xFFFF && MAX <= 0xFFFF, "two bytes hold no more") };
        let [_, _, high, low] = self.get().unsigned_abs().to_be_bytes();
        [high, low]
    }

    /// The value with this magnitude and sign.
    pub(crate) fn from_wire(magnitude: [u8; 2], negative: bool) -> Result<Self, OutOfRange> {
        let value = i32::from(u16::from_be_bytes(magnitude));
        Self::new(if negative { -value } else { value })
    }
}

impl<const MIN: i32, const MAX: i32> TryFrom<i32> for Ranged<MIN, MAX> {
    type Error = OutOfRange;

    fn try_from(value: i32) -> Result<Self, OutOfRange> {
        Self::new(value)
    }
}

impl<const MIN: i32, const MAX: i32> PartialOrd for Ranged<MIN, MAX> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<const MIN: i32, const MAX: i32> Ord for Ranged<MIN, MAX> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.get().cmp(&other.get())
    }
}

impl<const MIN: i32, const MAX: i32> fmt::Debug for Ranged<MIN, MAX> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Ranged({self})")
    }
}

impl<const MIN: i32, const MAX: i32> fmt::Display for Ranged<MIN, MAX> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(f)
    }
}

/// A value that the board does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} is outside {min} to {max}")]
pub struct OutOfRange {
    /// The value.
    pub value: i32,
    /// The smallest allowed.
    pub min: i32,
    /// The largest allowed.
    pub max: i32,
}
