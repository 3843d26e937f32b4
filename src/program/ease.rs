//! The one table of easings: the usual curves of Robert Penner, from 0 at 0 to 1 at 1.

use std::f64::consts::PI;

/// A way to get from one value to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ease {
    direction: Direction,
    /// Index in [`CURVES`].
    curve: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Linear,
    In,
    Out,
    InOut,
}

/// One row of the table: a curve that starts slowly.
#[derive(Debug)]
pub struct Curve {
    /// Its name, after `in-`, `out-` or `in-out-`.
    pub name: &'static str,
    /// What it looks like.
    pub meaning: &'static str,
    /// The curve that starts slowly.
    start: fn(f64) -> f64,
    /// What `in-out-` is made of, where that is another curve.
    middle: fn(f64) -> f64,
}

/// Every curve.
pub const CURVES: &[Curve] = &[
    row("sine", "a quarter of a sine, the gentlest", |x| 1.0 - libm::cos(x * PI / 2.0)),
    row("quad", "the square", |x| x * x),
    row("cubic", "the third power", |x| x * x * x),
    row("quart", "the fourth power", |x| x * x * x * x),
    row("quint", "the fifth power", |x| x * x * x * x * x),
    row("expo", "doubles every tenth of the way", expo),
    row("circ", "a quarter of a circle", |x| 1.0 - libm::sqrt(1.0 - x * x)),
    Curve {
        name: "back",
        meaning: "draws back a little first",
        start: |x| back(x, BACK),
        middle: |x| back(x, BACK * 1.525),
    },
    Curve {
        name: "elastic",
        meaning: "swings like a spring",
        start: |x| elastic(x, 0.3),
        middle: |x| elastic(x, 0.45),
    },
    row("bounce", "bounces like a ball", |x| 1.0 - bounce(1.0 - x)),
];

const fn row(name: &'static str, meaning: &'static str, start: fn(f64) -> f64) -> Curve {
    Curve { name, meaning, start, middle: start }
}

/// How far `back` draws back: a tenth of the way.
const BACK: f64 = 1.701_58;

fn expo(x: f64) -> f64 {
    if x <= 0.0 { 0.0 } else { libm::exp2(10.0 * x - 10.0) }
}

fn back(x: f64, far: f64) -> f64 {
    x * x * ((far + 1.0) * x - far)
}

/// A spring with this period, in parts of the way.
fn elastic(x: f64, period: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x;
    }
    -libm::exp2(10.0 * (x - 1.0)) * libm::sin((x - 1.0 - period / 4.0) * (2.0 * PI) / period)
}

/// A ball that falls to 1 and bounces three times.
fn bounce(x: f64) -> f64 {
    const STEEP: f64 = 7.562_5;
    let (from, floor) = match x * 2.75 {
        x if x < 1.0 => (0.0, 0.0),
        x if x < 2.0 => (1.5, 0.75),
        x if x < 2.5 => (2.25, 0.937_5),
        _ => (2.625, 0.984_375),
    };
    let x = x - from / 2.75;
    STEEP * x * x + floor
}

impl Ease {
    /// Straight from one value to the other.
    pub(crate) const LINEAR: Ease = Ease { direction: Direction::Linear, curve: 0 };

    /// The easing with this name, such as `in-out-sine`.
    pub fn named(name: &str) -> Option<Ease> {
        if name == "linear" {
            return Some(Ease::LINEAR);
        }
        let (direction, curve) = [("in-out-", Direction::InOut), ("in-", Direction::In), ("out-", Direction::Out)]
            .into_iter()
            .find_map(|(prefix, direction)| Some((direction, name.strip_prefix(prefix)?)))?;
        let curve = u8::try_from(CURVES.iter().position(|row| row.name == curve)?).ok()?;
        Some(Ease { direction, curve })
    }

    /// Every name.
    pub fn names() -> Vec<String> {
        let curves = ["in-", "out-", "in-out-"]
            .iter()
            .flat_map(|prefix| CURVES.iter().map(move |curve| format!("{prefix}{}", curve.name)));
        std::iter::once("linear".to_owned()).chain(curves).collect()
    }

    /// Its name.
    pub fn name(self) -> String {
        let prefix = match self.direction {
            Direction::Linear => return "linear".to_owned(),
            Direction::In => "in-",
            Direction::Out => "out-",
            Direction::InOut => "in-out-",
        };
        format!("{prefix}{}", CURVES.get(usize::from(self.curve)).map_or("", |curve| curve.name))
    }

    /// A value on the way between two others, rounded, after this part of the time.
    pub(crate) fn between(self, (from, to): (i32, i32), part: f64) -> i32 {
        let value = libm::round(f64::from(from) + (f64::from(to) - f64::from(from)) * self.at(part));
        #[expect(clippy::cast_possible_truncation, reason = "held in range")]
        let value = value.clamp(f64::from(i32::MIN), f64::from(i32::MAX)) as i32;
        value
    }

    /// How far it is, from 0 to 1 and for some curves beyond, after this part of the time.
    pub fn at(self, part: f64) -> f64 {
        let Some(curve) = CURVES.get(usize::from(self.curve)) else {
            return part;
        };
        match self.direction {
            Direction::Linear => part,
            Direction::In => (curve.start)(part),
            Direction::Out => 1.0 - (curve.start)(1.0 - part),
            Direction::InOut if part < 0.5 => (curve.middle)(2.0 * part) / 2.0,
            Direction::InOut => 1.0 - (curve.middle)(2.0 - 2.0 * part) / 2.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_starts_at_0_and_ends_at_1() {
        for name in Ease::names() {
            let ease = Ease::named(&name).unwrap();
            assert_eq!(ease.name(), name);
            assert!(ease.at(0.0).abs() < 1e-9 && (ease.at(1.0) - 1.0).abs() < 1e-9, "{name}");
        }
        assert_eq!(Ease::names().len(), 31);
    }

    #[test]
    fn curves_are_the_usual_ones() {
        // From the formulas of easings.net, computed apart from this code.
        for (name, part, value) in [
            ("in-quad", 0.25, 0.0625),
            ("out-quad", 0.25, 0.4375),
            ("in-out-quad", 0.25, 0.125),
            ("in-sine", 0.5, 0.292_893_218_8),
            ("in-expo", 0.5, 0.03125),
            ("out-circ", 0.5, 0.866_025_403_8),
            ("in-back", 0.5, -0.087_697_5),
            ("in-out-back", 0.25, -0.099_681_843_75),
            ("in-elastic", 0.5, -0.015_625),
            ("out-elastic", 0.25, 0.911_611_652_4),
            ("in-out-elastic", 0.25, 0.011_969_444_4),
            ("out-bounce", 0.5, 0.765_625),
            ("in-bounce", 0.25, 0.027_343_75),
        ] {
            let found = Ease::named(name).unwrap().at(part);
            assert!((found - value).abs() < 1e-9, "{name} at {part} is {found}, not {value}");
        }
    }
}
