//! The curve of a value, with its numbers, its limits, and what is beyond its scale.

use super::super::canvas::{Anchor, number, stairs, steps, width};
use super::{DOT, DOWN, LEFT, Picture, SOFT, UP};
use crate::units::Micros;

impl Picture<'_> {
    #[expect(clippy::too_many_arguments, reason = "a curve with its scale and its position")]
    pub(super) fn curve(
        &mut self,
        points: &[(Micros, Option<f64>)],
        [low, high]: [f64; 2],
        limits: Option<[f64; 2]>,
        (top, height): (f64, f64),
        is_place: bool,
    ) {
        // What is beyond the scale stays in this lane, and has a symbol with its number.
        let down = |value: f64| top + 3.0 + (high - value.clamp(low, high)) / (high - low) * (height - 6.0);
        if !is_place {
            self.canvas.line("zero", (LEFT, down(0.0)), (self.right, down(0.0)));
        }
        for limit in limits.into_iter().flatten().filter(|limit| (low..=high).contains(limit)) {
            self.canvas.line("limit", (LEFT, down(limit)), (self.right, down(limit)));
        }
        let drawn = points.iter().map(|(at, value)| (self.x(*at), value.map(down)));
        for run in steps(drawn, self.right) {
            if let (false, Some((first, _)), Some((last, _))) = (is_place, run.first(), run.last()) {
                let zero = number(down(0.0));
                // From the zero line up to the curve, and back.
                let curve = stairs(&run).replacen('M', "L", 1);
                let under = format!("M{} {zero}{curve}L{} {zero}z", number(*first), number(*last));
                self.canvas.path("under", &under, None);
            }
            self.canvas.path(if is_place { "curve" } else { "drive" }, &stairs(&run), None);
            // A value at the very end would be invisible.
            if let (Some((x, y)), Some((last, _))) = (run.first(), run.last())
                && last - x < 2.0
            {
                self.canvas.path(if is_place { "say" } else { "expect" }, &DOT(*x, *y), None);
            }
        }
        // A zero that is no position needs no number.
        let has_number = |value: &f64| (low..=high).contains(value) && (is_place || *value != 0.0);
        let inside: Vec<_> = points.iter().map(|(at, value)| (*at, value.filter(has_number))).collect();
        self.values(&inside, down, (top, height));
        self.limits(limits, [low, high], down, (top, height));
        self.beyond(points, [low, high], (top, height));
    }

    /// Writes the numbers of the limits at the right end of their lines.
    fn limits(
        &mut self,
        limits: Option<[f64; 2]>,
        [low, high]: [f64; 2],
        down: impl Fn(f64) -> f64,
        (top, height): (f64, f64),
    ) {
        for limit in limits.into_iter().flatten().filter(|limit| (low..=high).contains(limit)) {
            let y = down(limit);
            // Outside of the limits if there is room.
            let is_upper = limits.is_some_and(|[_, upper]| limit == upper);
            let [above, below] = [y - 4.0, y + 12.0];
            let y = match is_upper {
                true if y - top > 16.0 => above,
                true => below,
                false if top + height - y > 16.0 => below,
                false => above,
            };
            let text = format!("limit {}", reading(limit));
            self.canvas.text((self.right - 4.0, y), "late", Anchor::End, &text);
        }
    }

    /// Marks values beyond the scale at the edge of the lane, with their numbers.
    fn beyond(&mut self, points: &[(Micros, Option<f64>)], [low, high]: [f64; 2], (top, height): (f64, f64)) {
        let mut free = f64::NEG_INFINITY;
        for (at, value) in points {
            let (x, Some(value)) = (self.x(*at), *value) else { continue };
            if (low..=high).contains(&value) || x < free {
                continue;
            }
            let text = reading(value);
            let wide = width(&text, SOFT) + 18.0;
            free = x + wide;
            let is_high = value > high;
            let sign = if is_high { UP(x + 6.0, top + 8.0) } else { DOWN(x + 6.0, top + height - 3.0) };
            self.canvas.path("warn", &sign, Some(&format!("{text} is beyond the lane")));
            let y = if is_high { top + 13.0 } else { top + height - 3.0 };
            // To the left at the right end.
            let (x, anchor) = if x + wide > self.right { (x - 2.0, Anchor::End) } else { (x + 14.0, Anchor::Start) };
            self.canvas.text((x, y), "late", anchor, &text);
        }
    }

    /// Writes values next to the curve, where they stay long enough.
    fn values(&mut self, points: &[(Micros, Option<f64>)], down: impl Fn(f64) -> f64, (top, height): (f64, f64)) {
        let ends = points.iter().skip(1).map(|(at, _)| self.x(*at)).chain([self.right]);
        let mut free = f64::NEG_INFINITY;
        let mut shown = Vec::new();
        for ((at, value), end) in points.iter().zip(ends) {
            let (x, Some(value)) = (self.x(*at), *value) else { continue };
            let text = reading(value);
            let wide = width(&text, SOFT);
            if end - x < wide + 8.0 || x < free || height < 30.0 {
                continue;
            }
            free = x + wide + 8.0;
            let y = down(value);
            // Above the line if there is room.
            let y = if y - top > 17.0 { y - 5.0 } else { y + 14.0 };
            shown.push((x + 4.0, y, text));
        }
        for (x, y, text) in shown {
            self.canvas.text((x, y), "value", Anchor::Start, &text);
        }
    }
}

/// A scale that is symmetric around zero and contains all values and the limits of the script.
pub(super) fn about_zero(points: &[(Micros, Option<f64>)], limits: Option<[f64; 2]>) -> [f64; 2] {
    let values = points.iter().filter_map(|(_, value)| *value).chain(limits.into_iter().flatten());
    let most = values.fold(0.0, |most: f64, value| most.max(value.abs()));
    let most = match most {
        0.0 => 1.0,
        // Up to tenths. A float such as 0.7 is not exact.
        most if most < 1.0 => libm::ceil(most * 10.0 - 1e-9) / 10.0,
        most => libm::ceil(most),
    };
    [-most, most]
}

/// A value as a script writes it, or rounded to a tenth if it has more than six decimals.
pub(super) fn reading(value: f64) -> String {
    let millionths = libm::round(value * 1e6);
    if (value * 1e6 - millionths).abs() > 1e-3 {
        return number(value);
    }
    // Avoid `-0`.
    (millionths / 1e6 + 0.0).to_string()
}
