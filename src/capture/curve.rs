//! Compares a possible move with the values that were sent during it.

use crate::program::Ease;
use crate::units::Micros;

/// The tolerance in time: values of several channels wait for each other on the line.
pub(super) const QUEUE: Micros = Micros::from_millis(1);
/// The interval between two samples of a move at the default rate of a script.
pub(super) const SAMPLE: Micros = Micros::from_millis(20);

/// The values of a channel's axes; unused axes are 0.
pub(super) type Axes = [i32; 4];

/// A value that was sent at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Point {
    pub(super) at: Micros,
    pub(super) axes: Axes,
    /// Whether the channel already had this value.
    pub(super) repeats: bool,
}

/// The ranges of a channel, and the maximum deviation of a move from the sent values at any time.
#[derive(Clone, Copy, Debug)]
pub(super) struct MoveLimits {
    /// The smallest and the largest value of each axis.
    pub(super) ranges: [(i32, i32); 4],
    pub(super) tolerance: i32,
    /// Whether a move must not send more frames than it replaces.
    pub(super) saves_frames: bool,
}

/// Values of the axes before rounding.
type Values = [f64; 4];

/// A possible move: its start and end times, the values there, and the easing between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    pub(super) begin_at: Micros,
    pub(super) begin: Axes,
    pub(super) end_at: Micros,
    pub(super) end: Axes,
    pub(super) ease: Ease,
}

impl Curve {
    /// The mean squared deviation from the points; 0 if the move sends the same frames. Fails with
    /// the index of the next point if the deviation from the current value exceeds the tolerance. A
    /// sample may precede the value that it leads to by one sampling interval, if that value is the
    /// point `led` or a later one. Adds the effort to `work`.
    pub(super) fn error(
        &self,
        points: &[Point],
        led: usize,
        limits: &MoveLimits,
        work: &mut usize,
    ) -> Result<f64, usize> {
        let mut squares = 0.0;
        let mut next = 0;
        let mut now = self.begin.map(f64::from);
        let (mut sent, mut same) = (0, 0);
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
            let is_sent = |point: &Point| point.at == until && point.axes.map(f64::from) == after;
            same += usize::from(now != after && points.get(next).is_some_and(is_sent));
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
        let changes = points.iter().filter(|point| !point.repeats).count();
        Ok(if (same, same) == (sent, changes) { 0.0 } else { squares / count(points.len()) })
    }

    /// Its samples with their times, as a script sends them, without the one at its start. The last
    /// is its end.
    fn samples(&self) -> impl Iterator<Item = (Micros, Values)> {
        let times = (1..).map(|sample| self.begin_at + SAMPLE * sample);
        let samples = times.take_while(|at| *at < self.end_at);
        samples.map(|at| (at, self.at(at).map(libm::round))).chain([(self.end_at, self.end.map(f64::from))])
    }

    /// Whether a sample is near a value that is current when the sample is sent, given the points
    /// before it and after it.
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

    /// The same, given the curve's values at the time of the point.
    fn is_near(&self, now: Values, point: &Point, limits: &MoveLimits) -> bool {
        let (sent, now) = (point.axes.map(f64::from), now.map(libm::round));
        is_near(sent, &[now], limits) || {
            let at = |at: Micros| self.at(at).map(libm::round);
            let [earlier, later] = [point.at - QUEUE, point.at + QUEUE].map(at);
            is_near(sent, &[earlier, now, later], limits)
        }
    }

    /// The values at a time.
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

/// Whether each value is within the tolerance of the others' range.
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
    /// Whether these values are in range.
    fn holds(&self, values: Values) -> bool {
        let ranges = self.ranges.iter().zip(values);
        ranges.into_iter().all(|((least, most), value)| (f64::from(*least)..=f64::from(*most)).contains(&value))
    }
}

#[expect(clippy::cast_precision_loss, reason = "at most the microseconds of a day")]
pub(super) fn float(number: u64) -> f64 {
    number as f64
}

#[expect(clippy::cast_precision_loss, reason = "at most the number of waiting frames")]
pub(super) fn count(number: usize) -> f64 {
    number as f64
}
