//! Runs of values that follow an easing, found as moves.

use crate::program::Ease;

/// Values of the axes of one thing; those that it does not have are 0.
pub(super) type Axes = [i32; 4];

/// A value that a thing was given at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Point {
    /// Microseconds.
    pub(super) at_us: u64,
    pub(super) axes: Axes,
    /// Whether it is the value that the thing had already.
    pub(super) repeats: bool,
}

/// What a thing may be given, and how far a move may be from what it was given, at a time within a millisecond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// The smallest and the largest value of each axis.
    pub(super) ranges: [(i32, i32); 4],
    pub(super) tolerance: i32,
}

/// Points of one thing in a row.
#[derive(Debug)]
pub(super) struct Course<'p> {
    points: &'p [Point],
    /// The usual time from one to the next, in microseconds.
    step_us: u64,
    /// When something else follows, in microseconds.
    until_us: u64,
    room: Room,
}

impl<'p> Course<'p> {
    pub(super) fn new(points: &'p [Point], until_us: u64, room: Room) -> Self {
        let gap = |pair: &[Point]| match pair {
            [first, second] => second.at_us.saturating_sub(first.at_us),
            _ => 0,
        };
        let mut gaps: Vec<u64> = points.windows(2).map(gap).collect();
        gaps.sort_unstable();
        Course { points, step_us: gaps.get(gaps.len() / 2).copied().unwrap_or_default(), until_us, room }
    }

    /// When a move that ends with a point may have ended: its last sample is left out where it rounds to the value before.
    fn ends(&self, last: usize, at_us: u64) -> impl Iterator<Item = u64> {
        let until_us = self.points.get(last + 1).map_or(self.until_us, |next| next.at_us.min(self.until_us));
        [0, self.step_us / 2, self.step_us]
            .into_iter()
            .map(move |more| at_us + more)
            .filter(move |at_us| *at_us <= until_us)
    }
}

/// A move that says the same as a run of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fold {
    /// When it begins, in microseconds, and the values there.
    pub(super) from_us: u64,
    pub(super) from: Axes,
    /// Which point it begins at, if at one: otherwise its beginning was never sent.
    pub(super) first: Option<usize>,
    /// Which point it ends at, or behind which.
    pub(super) last: usize,
    /// When it ends, in microseconds.
    pub(super) to_us: u64,
    pub(super) ease: Ease,
    /// How far it is from the points: the mean square.
    error: f64,
}

/// The fewest values that a move stands for.
const FEWEST: usize = 4;
/// How much earlier or later a value may have been meant, in microseconds: those of several things wait for each other on the line.
const QUEUE_US: u64 = 1_000;
/// Microseconds between two samples of a move, at the rate that a script has.
const SAMPLE_US: u64 = 20_000;
/// A move lasts at least so long, in microseconds.
const SHORTEST_US: u64 = 4 * SAMPLE_US;
/// How many sampling intervals before its first value that changes a move may have begun.
const AHEAD: u64 = 64;
/// In how many parts an easing is looked up, and how much of the way the table may be wrong.
const PARTS: usize = 1024;
const SLACK: f64 = 0.02;
/// Of a move, a part of so many may be left to the next one where it fits better without, and so many points at least.
const SPARE: usize = 8;
const SPARE_POINTS: usize = 4;

/// Every easing, the straight one first, with a table of it.
pub(super) struct Easings(Vec<(Ease, Vec<f64>)>);

impl Easings {
    pub(super) fn new() -> Self {
        let easings = Ease::names().into_iter().filter_map(|name| Ease::named(&name));
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let table = |ease: Ease| (0..=PARTS).map(|part| ease.at(part as f64 / PARTS as f64)).collect();
        Easings(easings.map(|ease| (ease, table(ease))).collect())
    }

    /// The moves in a course, in their order; what is in none of them is no part of a move. `before` is the value that the thing had before,
    /// and since when; the points may begin with some that repeat it.
    pub(super) fn folds(&self, course: &Course<'_>, before: Option<(u64, Axes)>) -> Vec<Fold> {
        let ahead = before.and_then(|before| self.begins_ahead(course, before));
        let mut from = ahead.map_or(0, |fold| fold.last);
        let mut folds: Vec<Fold> = ahead.into_iter().collect();
        while let Some(point) = course.points.get(from) {
            // A move that has ended behind its last value holds the next one up.
            let begin_us = folds.last().filter(|fold| fold.last == from).map_or(point.at_us, |fold| fold.to_us);
            match self.longest(course, from, (begin_us, point.axes), Some(from)) {
                Some(fold) => {
                    folds.push(fold);
                    from = fold.last;
                }
                None => from += 1,
            }
        }
        folds
    }

    /// The longest move that begins before the first value that changes, at a moment when nothing was sent: its first samples were left out
    /// where they changed nothing, or repeat the value.
    fn begins_ahead(&self, course: &Course<'_>, (since_us, axes): (u64, Axes)) -> Option<Fold> {
        let change = course.points.iter().find(|point| !point.repeats)?;
        let begins = (1..=AHEAD).map_while(|steps| change.at_us.checked_sub(steps.checked_mul(course.step_us)?));
        let begins = begins.take_while(|begin_us| *begin_us >= since_us);
        let folds = begins.filter_map(|begin_us| {
            let from = course.points.iter().position(|point| point.at_us > begin_us)?;
            self.longest(course, from, (begin_us, axes), None)
        });
        let folds: Vec<Fold> = folds.collect();
        let longest = folds.iter().map(|fold| fold.last).max()?;
        let long = folds.into_iter().filter(|fold| fold.last + spare(longest) >= longest);
        long.reduce(|best, fold| if fold.error < best.error { fold } else { best })
    }

    /// The longest move from a moment, over the points from `from` on.
    fn longest(
        &self,
        course: &Course<'_>,
        from: usize,
        (begin_us, begin): (u64, Axes),
        first: Option<usize>,
    ) -> Option<Fold> {
        let Course { points, .. } = course;
        let rest = points.get(from..)?;
        let mut best: Option<Fold> = None;
        let mut changes = rest.iter().skip(usize::from(first.is_some())).filter(|point| !point.repeats).count();
        for last in (from..points.len()).rev().filter(|at| Some(*at) != first) {
            let Some(end) = points.get(last).filter(|end| !end.repeats) else { continue };
            let is_spared = best.is_none_or(|best| last + spare(best.last - from) >= best.last);
            if changes < FEWEST || !is_spared {
                break;
            }
            changes -= 1;
            let within = points.get(from + usize::from(first.is_some())..=last)?;
            for to_us in course.ends(last, end.at_us).filter(|_| end.axes != begin) {
                if let Some((ease, error)) = self.fitting(within, (begin_us, begin), (to_us, end.axes), course.room)
                    && best.is_none_or(|best| error < best.error / 2.0)
                {
                    best = Some(Fold { from_us: begin_us, from: begin, first, last, to_us, ease, error });
                }
            }
        }
        best
    }

    /// The easing that all points follow, and follow best, and how far they are from it: the mean square.
    fn fitting(
        &self,
        points: &[Point],
        (begin_us, begin): (u64, Axes),
        (to_us, to): (u64, Axes),
        room: Room,
    ) -> Option<(Ease, f64)> {
        let duration = to_us.checked_sub(begin_us).filter(|duration| *duration >= SHORTEST_US)?;
        let part = |at_us: u64| float(at_us.saturating_sub(begin_us)) / float(duration);
        // The axis with the longest way says the most.
        let way = |axis: usize| to.get(axis).zip(begin.get(axis)).map_or(0, |(end, begin)| end - begin);
        let axis = (0..4).max_by_key(|axis| way(*axis).abs())?;
        let (way, start) = (f64::from(way(axis)), f64::from(*begin.get(axis)?));
        let slack = (f64::from(room.tolerance) + 1.0) / way.abs() + SLACK;
        let probes = [2, 1, 3].map(|quarter| points.get(points.len() * quarter / 4));
        let probes = probes.map(|point| {
            let point = point?;
            let part = part(point.at_us);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to PARTS")]
            let place = libm::round(part * float(PARTS as u64)) as usize;
            Some((place, (f64::from(*point.axes.get(axis)?) - start) / way))
        });
        let may_fit = |table: &[f64]| {
            probes.iter().flatten().all(|(place, far)| table.get(*place).is_some_and(|at| (at - far).abs() <= slack))
        };
        let error = |ease: Ease| {
            let mut squares = 0.0;
            for point in points {
                let (at_us, within) = (point.at_us, f64::from(room.tolerance));
                let far = ease.at(part(at_us));
                let at = |us: u64| ease.at(part(us.clamp(begin_us, to_us)));
                let [earlier, later] = [at_us.saturating_sub(QUEUE_US), at_us + QUEUE_US].map(at);
                // What the script will send before and after it, so that a swing between two samples is none.
                let after_us = at_us.saturating_sub(begin_us);
                let before = after_us.saturating_sub(QUEUE_US) / SAMPLE_US;
                let on = (after_us + QUEUE_US) / SAMPLE_US;
                let [before, on, after] = [before, on, on + 1].map(|sample| at(begin_us + sample * SAMPLE_US));
                for (axis, sent) in point.axes.iter().enumerate() {
                    let sent = f64::from(*sent);
                    let value = between(begin, to, axis, far);
                    let is_near = |fars: [f64; 4]| {
                        let values = fars.map(|far| libm::round(between(begin, to, axis, far)));
                        let least = values.iter().copied().fold(f64::MAX, f64::min);
                        let most = values.iter().copied().fold(f64::MIN, f64::max);
                        (least - within..=most + within).contains(&sent)
                    };
                    if !is_near([earlier, far, far, later]) || !is_near([before, on, on, after]) {
                        return None;
                    }
                    squares += (value - sent) * (value - sent);
                }
            }
            Some(squares / float(points.len() as u64))
        };
        let keeps_range = |ease: Ease| {
            let samples = (0..).map(|sample| begin_us + sample * SAMPLE_US).take_while(|at_us| *at_us < to_us);
            samples.map(|at_us| ease.at(part(at_us))).all(|far| {
                room.ranges.iter().enumerate().all(|(axis, (least, most))| {
                    let value = libm::round(between(begin, to, axis, far));
                    (f64::from(*least)..=f64::from(*most)).contains(&value)
                })
            })
        };
        let easings = self.0.iter().filter(|(_, table)| may_fit(table)).map(|(ease, _)| *ease);
        let fitting = easings.filter_map(|ease| Some((ease, error(ease)?))).filter(|(ease, _)| keeps_range(*ease));
        // A straight line, or else the gentlest curve, unless another one is clearly meant.
        fitting.reduce(|best, other| if other.1 < best.1 / 2.0 { other } else { best })
    }
}

/// The value of an axis after a part of the way, before it is rounded.
fn between(begin: Axes, end: Axes, axis: usize, far: f64) -> f64 {
    let of = |axes: Axes| f64::from(axes.get(axis).copied().unwrap_or_default());
    of(begin) + (of(end) - of(begin)) * far
}

/// How many of so many points may be left to the next move.
fn spare(points: usize) -> usize {
    (points / SPARE).max(SPARE_POINTS)
}

#[expect(clippy::cast_precision_loss, reason = "times of a day in microseconds, and less")]
fn float(number: u64) -> f64 {
    number as f64
}
