//! A move, compared with what was sent at every moment of it.

use crate::program::Ease;
use crate::units::Micros;

/// How much earlier or later a value may have been meant: those of several things wait for each other on the line.
pub(super) const QUEUE: Micros = Micros::from_millis(1);
/// The time between two samples of a move, at the rate that a script has.
pub(super) const SAMPLE: Micros = Micros::from_millis(20);

/// Values of the axes of one thing; those that it does not have are 0.
pub(super) type Axes = [i32; 4];

/// A value that a thing was given at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Point {
    pub(super) at: Micros,
    pub(super) axes: Axes,
    /// Whether it is the value that the thing had already.
    pub(super) repeats: bool,
}

/// What a thing may be given, and how far a move may be from what it was given, at any time.
#[derive(Clone, Copy, Debug)]
pub(super) struct MoveLimits {
    /// The smallest and the largest value of each axis.
    pub(super) ranges: [(i32, i32); 4],
    pub(super) tolerance: i32,
    /// Whether a move may not send more frames than it replaces.
    pub(super) saves_frames: bool,
}

/// Values of the axes before they are rounded.
type Values = [f64; 4];

/// A move: when it begins and ends, the values there, and how it gets from one to the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    pub(super) begin_at: Micros,
    pub(super) begin: Axes,
    pub(super) end_at: Micros,
    pub(super) end: Axes,
    pub(super) ease: Ease,
}

impl Curve {
    /// How far it is from the points: the mean square. Fails where it is further from what was held than the tolerance, with the next point. A
    /// sample may come up to one sampling interval before the value that it leads to, if that is `led` or a later point. Adds what it took to
    /// `work`.
    pub(super) fn error(&self, points: &[Point], led: usize, limits: &MoveLimits, work: &mut usize) -> Result<f64, usize> {
        let mut squares = 0.0;
        let mut next = 0;
        let mut now = self.begin.map(f64::from);
        let mut sent = 0;
        for (until, after) in self.samples() {
            *work += 2;
            sent += usize::from(now != after);
            while let Some(point) = points.get(next).filter(|point| point.at < until) {
                *work += 2;
                let values = point.axes.map(f64::from);
                let far = self.at(point.at);
                if !is_near(values, &[now, after], limits) || !self.is_near(far, point, limits) {
                    return Err(next);
                }
                squares += far.iter().zip(values).map(|(far, value)| (far - value) * (far - value)).sum::<f64>();
                next += 1;
            }
            let around = points.split_at_checked(next).unwrap_or((points, &[]));
            if !limits.holds(after) || !self.is_held(around, led.saturating_sub(next), (until, after), limits) {
                return Err(next);
            }
            now = after;
        }
        let rest = points.get(next..).unwrap_or_default();
        let is_spared = !limits.saves_frames || sent <= points.len();
        if !is_spared || rest.iter().any(|point| point.axes != self.end) {
            return Err(next);
        }
        Ok(squares / count(points.len()))
    }

    /// Its samples but for the one at its beginning, as a script sends them, with their times. The last one is its end.
    fn samples(&self) -> impl Iterator<Item = (Micros, Values)> {
        let times = (1..).map(|sample| self.begin_at + SAMPLE * sample);
        let samples = times.take_while(|at| *at < self.end_at);
        samples.map(|at| (at, self.at(at).map(libm::round))).chain([(self.end_at, self.end.map(f64::from))])
    }

    /// Whether a sample is near what is held when it is sent, of the points before it and the others.
    fn is_held(
        &self,
        (earlier, later): (&[Point], &[Point]),
        led: usize,
        (at, sample): (Micros, Values),
        limits: &MoveLimits,
    ) -> bool {
        let values = |point: &Point| point.axes.map(f64::from);
        let begin = self.begin.map(f64::from);
        let held = earlier.last().map_or(begin, values);
        let soon = later.iter().take_while(|point| point.at <= at + QUEUE).count();
        let leads = |point: &Point| point.at <= at + SAMPLE + QUEUE;
        let soon = soon + usize::from(soon >= led && later.get(soon).is_some_and(leads));
        let around: Vec<Values> = std::iter::once(held).chain(later.iter().take(soon).map(values)).collect();
        is_near(sample, &around, limits)
    }

    /// Whether a point is near the curve within a millisecond.
    pub(super) fn follows(&self, point: &Point, limits: &MoveLimits) -> bool {
        self.is_near(self.at(point.at), point, limits)
    }

    /// The same, where it is at the time of the point.
    fn is_near(&self, now: Values, point: &Point, limits: &MoveLimits) -> bool {
        let (sent, now) = (point.axes.map(f64::from), now.map(libm::round));
        is_near(sent, &[now], limits) || {
            let at = |at: Micros| self.at(at).map(libm::round);
            let [earlier, later] = [point.at - QUEUE, point.at + QUEUE].map(at);
            is_near(sent, &[earlier, now, later], limits)
        }
    }

    /// Where it is at a time.
    fn at(&self, at: Micros) -> Values {
        let passed = at.clamp(self.begin_at, self.end_at) - self.begin_at;
        let far = self.ease.at(float(passed.0) / float((self.end_at - self.begin_at).0.max(1)));
        let mut values = self.begin.map(f64::from);
        for (value, end) in values.iter_mut().zip(self.end) {
            *value += (f64::from(end) - *value) * far;
        }
        values
    }
}

/// Whether each value is within the tolerance of those of the others.
fn is_near(values: Values, others: &[Values], limits: &MoveLimits) -> bool {
    let tolerance = f64::from(limits.tolerance);
    values.iter().enumerate().all(|(axis, value)| {
        let others = others.iter().filter_map(|values| values.get(axis).copied());
        let (least, most) =
            others.fold((f64::MAX, f64::MIN), |(least, most), other| (least.min(other), most.max(other)));
        (least - tolerance..=most + tolerance).contains(value)
    })
}

impl MoveLimits {
    /// Whether the thing may be given these values.
    fn holds(&self, values: Values) -> bool {
        let ranges = self.ranges.iter().zip(values);
        ranges.into_iter().all(|((least, most), value)| (f64::from(*least)..=f64::from(*most)).contains(&value))
    }
}

#[expect(clippy::cast_precision_loss, reason = "times of a day in microseconds, and less")]
pub(super) fn float(number: u64) -> f64 {
    number as f64
}

#[expect(clippy::cast_precision_loss, reason = "as many as wait to be written, at most")]
pub(super) fn count(number: usize) -> f64 {
    number as f64
}
