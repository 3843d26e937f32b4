//! Finds moves: runs of values that follow an easing.

use std::ops::Range;

use super::curve::{Axes, Curve, MoveLimits, Point, QUEUE, SAMPLE, float};
use crate::program::Ease;
use crate::units::Micros;

/// Successive points of one channel.
#[derive(Debug)]
pub(super) struct PointSeries<'p> {
    points: &'p [Point],
    /// The median interval between two points.
    step: Micros,
    /// When something else follows.
    until: Micros,
    limits: MoveLimits,
}

impl<'p> PointSeries<'p> {
    pub(super) fn new(points: &'p [Point], until: Micros, limits: MoveLimits) -> Self {
        let gap = |pair: &[Point]| match pair {
            [first, second] => second.at - first.at,
            _ => Micros::ZERO,
        };
        let mut gaps: Vec<Micros> = points.windows(2).map(gap).collect();
        gaps.sort_unstable();
        let median = gaps.get(gaps.len() / 2).copied().unwrap_or_default();
        // In a listing of a script, the samples that change nothing are missing.
        let changes: Vec<Micros> = points.iter().filter(|point| !point.repeats).map(|point| point.at).collect();
        let is_whole =
            |pair: &&[Micros]| matches!(pair, [first, second] if (*second - *first).0.is_multiple_of(SAMPLE.0));
        let whole = changes.windows(2).filter(is_whole).count();
        PointSeries {
            points,
            step: if 4 * whole >= 3 * changes.len().saturating_sub(1) { SAMPLE } else { median },
            until,
            limits,
        }
    }

    /// The next point from this one on that changes the value.
    fn change(&self, from: usize) -> Option<usize> {
        let later = self.points.get(from..)?.iter().position(|point| !point.repeats)?;
        Some(from + later)
    }

    /// The possible end times of a move that ends with this point, and whether only the same frames
    /// confirm them: the last samples are not sent if they round to the same value. The next move
    /// may begin at the end.
    fn ends(&self, last: usize, at: Micros) -> impl Iterator<Item = (Micros, bool)> {
        let next = self.change(last + 1).and_then(|next| self.points.get(next));
        let until = next.map_or(self.until, |next| next.at.min(self.until));
        let half = Micros(self.step.0 / 2);
        // Only a value that stays can be reached long before the end.
        let most = if until > at + self.step * 2 { 2 * AHEAD } else { 2 };
        let next = until.checked_sub(self.step).filter(|end| most > 2 && until < Micros::MAX && *end >= at);
        let usual = (0..=most).map(move |halves| (at + half * halves, false));
        next.map(|end| (end, true)).into_iter().chain(usual).filter(move |(at, _)| *at <= until)
    }
}

/// A move that sends the same values as a run of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoundMove {
    /// Its start time, and the values there.
    pub(super) from_at: Micros,
    pub(super) from: Axes,
    /// The first point that it replaces, and whether that is its start. Otherwise its start was not
    /// sent.
    pub(super) first: usize,
    pub(super) has_start: bool,
    /// The point that it ends at, or shortly after.
    pub(super) last: usize,
    /// Its end time.
    pub(super) to_at: Micros,
    pub(super) ease: Ease,
    /// The mean squared deviation from the points.
    error: f64,
}

/// The fewest values that a move replaces.
const FEWEST: usize = 4;
/// The minimum duration of a move.
const SHORTEST: Micros = SAMPLE.saturating_mul(4);
/// The maximum number of sampling intervals between the start of a move and its first changed
/// value.
const AHEAD: u64 = 64;
/// The resolution of the easing table, and its tolerance as a fraction of the distance.
const PARTS: u64 = 1024;
const SLACK: f64 = 0.02;
/// If the tolerance reaches this fraction of the distance, all easings look alike and a straight
/// line is enough.
const ALIKE: f64 = 0.5;
/// A move may leave 1/`SPARE` of its points to the next move if it fits better without them, or
/// this many if that is more.
const SPARE: usize = 8;
const SPARE_POINTS: usize = 4;
/// With more points than this, an end slightly later than the last point makes little difference.
const MANY: usize = 16;
/// With a mean squared deviation below this, no other move is clearly better: values are rounded.
const EXACT: f64 = 0.1;
/// The search budget for each point of a series. One unit is a comparison of one end with all
/// easings; each comparison of a single point or sample costs two.
const EFFORT: usize = 112;
/// The additional search budget for a series.
const MORE: usize = 1 << 16;
/// The share of the remaining budget that one start may use, and the minimum.
const SHARE: usize = 32;
const LEAST: usize = 64;

/// All easings, the linear one first, and the progress of each at every part of the time.
pub(super) struct EasingTable {
    all: Vec<Ease>,
    far: Vec<[f64; EASINGS]>,
    /// The maximum progress of any easing so far.
    most: Vec<f64>,
}

/// At least the number of easings; the progress of unused entries is NaN.
const EASINGS: usize = 32;

/// The start of a move: its time, the values there, and the point that it begins at, if any.
#[derive(Clone, Copy)]
struct Begin {
    at: Micros,
    axes: Axes,
    first: Option<usize>,
    /// The first point that a sample may precede.
    led: usize,
}

/// For each easing, whether a move may have it.
type Plausible = [bool; EASINGS];

/// A part of the time, in 1/[`PARTS`], and the progress of a move then.
struct Probe {
    part: usize,
    far: f64,
}

impl EasingTable {
    pub(super) fn new() -> Self {
        let all: Vec<Ease> = Ease::names().into_iter().filter_map(|name| Ease::named(&name)).collect();
        let far = |part: u64| {
            let mut far = [f64::NAN; EASINGS];
            for (far, ease) in far.iter_mut().zip(&all) {
                *far = ease.at(float(part) / float(PARTS));
            }
            far
        };
        let far: Vec<_> = (0..=PARTS).map(far).collect();
        let until = |most: &mut f64, far: &[f64; EASINGS]| {
            *most = far.iter().fold(*most, |most, far| most.max(far.abs()));
            Some(*most)
        };
        EasingTable { most: far.iter().scan(0.0, until).collect(), far, all }
    }

    /// The moves in a series, in order; other points belong to no move. `before` is the previous
    /// value of the channel and the time since when it has it. The first points may repeat it.
    pub(super) fn find_moves(&self, series: &PointSeries<'_>, before: Option<(Micros, Axes)>) -> Vec<FoundMove> {
        let axes = |of: fn(i32, i32) -> i32| {
            let all = series.points.iter().map(|point| point.axes).chain(before.map(|(_, axes)| axes));
            all.reduce(|one, other| std::array::from_fn(|axis| of(value(one, axis), value(other, axis))))
                .unwrap_or_default()
        };
        let left = EFFORT * series.points.len() + MORE;
        let mut search =
            Search { easings: self, series, least: axes(i32::min), most: axes(i32::max), left, suspect: 0 };
        let free = before.map_or(Micros::ZERO, |(since, _)| since);
        let ahead = before.and_then(|before| search.begins_ahead(0, before));
        let mut from = ahead.map_or(0, |found| found.last);
        let mut moves: Vec<FoundMove> = ahead.into_iter().collect();
        while let Some(point) = series.points.get(from) {
            // A move that ends after its last value delays the next one.
            let at = point.at.max(moves.last().map_or(free, |found| found.to_at));
            let at_once = search.longest(from, Begin { at, axes: point.axes, first: Some(from), led: from });
            match search.later(from, at, at_once).or(at_once) {
                Some(found) => {
                    moves.push(found);
                    from = found.last;
                }
                None => from += 1,
            }
        }
        moves
    }

    /// The easings whose progress matches the probes within the tolerance.
    fn plausible(&self, probes: impl Iterator<Item = Probe>, slack: f64) -> Plausible {
        let mut may = [true; EASINGS];
        for Probe { part, far } in probes {
            for (may, at) in may.iter_mut().zip(self.far.get(part).into_iter().flatten()) {
                *may &= (at - far).abs() <= slack;
            }
            if !may.contains(&true) {
                break;
            }
        }
        if slack >= ALIKE {
            may.iter_mut().skip(1).for_each(|may| *may = false);
        }
        may
    }
}

/// A search for the moves in a series.
struct Search<'s> {
    easings: &'s EasingTable,
    series: &'s PointSeries<'s>,
    /// The minimum and maximum of each axis.
    least: Axes,
    most: Axes,
    /// The remaining search budget.
    left: usize,
    /// The point that the last move missed. The next move is compared with it first.
    suspect: usize,
}

impl Search<'_> {
    /// The longest move that starts before the first changed value, at a time when nothing was
    /// sent: its first samples were not sent because they changed nothing, or they repeat the
    /// value.
    fn begins_ahead(&mut self, first: usize, (since, axes): (Micros, Axes)) -> Option<FoundMove> {
        let PointSeries { points, step, .. } = *self.series;
        let still = self.series.change(first)?;
        let change = points.get(still)?;
        let begins = (1..=AHEAD).map_while(|steps| change.at.checked_sub(step * steps));
        let begins = begins.take_while(|begin_at| *begin_at >= since);
        let moves = begins.filter_map(|at| {
            let from = first + points.get(first..)?.iter().position(|point| point.at > at)?;
            self.longest(from, Begin { at, axes, first: None, led: still + 1 })
        });
        let moves: Vec<FoundMove> = moves.collect();
        let longest = moves.iter().map(|found| found.last).max()?;
        let long = moves.into_iter().filter(|found| found.last + spare(longest) >= longest);
        long.reduce(|best, found| if found.error < best.error { found } else { best })
    }

    /// A move that begins some time after a point, if it fits better than one that begins there.
    fn later(&mut self, from: usize, at: Micros, at_once: Option<FoundMove>) -> Option<FoundMove> {
        // The begins after a point include those after its repeats.
        let point = self.series.points.get(from).filter(|point| !point.repeats)?;
        let change = self.series.change(from + 1).and_then(|change| self.series.points.get(change))?;
        let has_room = change.at > at + self.series.step;
        let is_exact = at_once.is_some_and(|found| found.error <= 0.0);
        let later =
            if has_room && !is_exact { self.begins_ahead(from + 1, (at + Micros(1), point.axes)) } else { None }?;
        let is_better = at_once.is_none_or(|found| later.last >= found.last && later.error < found.error / 2.0);
        is_better.then_some(later)
    }

    /// The longest move from a start, over the points from `from` on.
    fn longest(&mut self, from: usize, begin: Begin) -> Option<FoundMove> {
        let points = self.series.points;
        let allowed = (self.left / SHARE).max(LEAST);
        let (mut work, mut best) = (0, None::<FoundMove>);
        let from_points = from + usize::from(begin.first.is_some());
        let reach = self.reach(from_points, begin).min(from.saturating_add(allowed));
        let mut changes = points.get(from_points..reach)?.iter().filter(|point| !point.repeats).count();
        for last in (from_points..reach).rev() {
            let Some(end) = points.get(last).filter(|end| !end.repeats) else { continue };
            let is_spared = best.is_none_or(|best| last + spare(best.last - from) >= best.last && best.error > EXACT);
            if changes < FEWEST || !is_spared || work > allowed {
                break;
            }
            changes -= 1;
            let has_tail = self.series.ends(last, end.at).count() > 3;
            for (to_at, must_match) in self.series.ends(last, end.at).filter(|_| end.axes != begin.axes) {
                let range = from_points..last + 1;
                let Some(plausible) = self.plausible(range.clone(), begin, (to_at, end.axes)) else { continue };
                work += 1;
                // With many points, a slightly later end makes little difference.
                if range.len() > MANY && !has_tail && !plausible.contains(&true) {
                    break;
                }
                if let Some((ease, error)) = self.fitting(range, begin, (to_at, end.axes), plausible, &mut work)
                    && best.is_none_or(|best| error < best.error / 2.0)
                    && (!must_match || error <= 0.0)
                {
                    let has_start = begin.first.is_some();
                    let (from_at, first) = (begin.at, begin.first.unwrap_or(from));
                    best = Some(FoundMove { from_at, from: begin.axes, first, has_start, last, to_at, ease, error });
                }
            }
        }
        self.left = self.left.saturating_sub(work);
        best
    }

    /// The last point that a move can reach if it passes the first changed value in time: the
    /// larger that change, the sooner the move ends.
    fn reach(&self, from: usize, begin: Begin) -> usize {
        let points = self.series.points;
        let Some(change) = points.iter().skip(from).find(|point| !point.repeats) else { return 0 };
        let far = |axis: usize| {
            let begin = value(begin.axes, axis);
            let way = (value(self.most, axis) - begin).max(begin - value(self.least, axis));
            let jump = (value(change.axes, axis) - begin).abs() - self.series.limits.tolerance - 1;
            f64::from(jump) / f64::from(way.max(1))
        };
        let far = (0..4).map(far).fold(0.0, f64::max);
        // The table may be off by one part.
        let part = self.easings.most.partition_point(|most| *most < far).saturating_sub(1) as u64;
        let passed = change.at - begin.at + SAMPLE + QUEUE;
        let Some(longest) = (passed * PARTS).0.checked_div(part) else { return points.len() };
        points.partition_point(|point| point.at <= begin.at + Micros(longest))
    }

    /// The best easing that all points of a range follow, and its mean squared deviation.
    #[expect(clippy::too_many_arguments, reason = "a move, its candidates, and the budget")]
    fn fitting(
        &mut self,
        range: Range<usize>,
        begin: Begin,
        (end_at, end): (Micros, Axes),
        plausible: Plausible,
        work: &mut usize,
    ) -> Option<(Ease, f64)> {
        let points = self.series.points.get(range.clone())?;
        let limits = &self.series.limits;
        let mut best: Option<(Ease, f64)> = None;
        for (&ease, _) in self.easings.all.iter().zip(plausible).filter(|(_, may)| *may) {
            let curve = Curve { begin_at: begin.at, begin: begin.axes, end_at, end, ease };
            let suspect = self.suspect.checked_sub(range.start).and_then(|suspect| points.get(suspect));
            *work += 2;
            if suspect.is_some_and(|suspect| !curve.follows(suspect, limits)) {
                continue;
            }
            match curve.error(points, begin.led.saturating_sub(range.start), limits, work) {
                Err(at) => self.suspect = range.start + at,
                // Prefer the straight line, then the gentlest curve, unless another easing fits
                // clearly better.
                Ok(error) if best.is_none_or(|(_, least)| error < least / 2.0) => best = Some((ease, error)),
                Ok(_) => {}
            }
        }
        best
    }

    /// The easings that match some of the points and do not change the value before the first
    /// changed point. `None` if the move is too short.
    fn plausible(&self, range: Range<usize>, begin: Begin, (end_at, end): (Micros, Axes)) -> Option<Plausible> {
        let points = self.series.points.get(range)?;
        let duration = end_at.checked_sub(begin.at).filter(|duration| *duration >= SHORTEST)?;
        // The axis with the largest distance is the most precise.
        let way = |axis: usize| end.get(axis).zip(begin.axes.get(axis)).map_or(0, |(end, begin)| end - begin);
        let axis = (0..4).max_by_key(|axis| way(*axis).abs())?;
        let (way, start) = (f64::from(way(axis)), f64::from(*begin.axes.get(axis)?));
        let slack = (f64::from(self.series.limits.tolerance) + 1.0) / way.abs() + SLACK;
        let scale = float(PARTS) / float(duration.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to PARTS")]
        let part = |passed: Micros| (float(passed.0) * scale + 0.5) as usize;
        let quarters = [2, 1, 3].into_iter().filter_map(|quarter| {
            let point = points.get(points.len() * quarter / 4)?;
            let far = (f64::from(*point.axes.get(axis)?) - start) / way;
            Some(Probe { part: part(point.at - begin.at), far })
        });
        // The last sample before the first changed value.
        let change = begin.led.checked_sub(1).filter(|_| begin.first.is_none());
        let change = change.and_then(|change| self.series.points.get(change));
        let passed = change.and_then(|change| change.at.checked_sub(begin.at + QUEUE + Micros(1)));
        let still = passed.map(|passed| Probe { part: part(SAMPLE * (passed.0 / SAMPLE.0)), far: 0.0 });
        Some(self.easings.plausible(still.into_iter().chain(quarters), slack))
    }
}

/// The value of an axis.
fn value(of: Axes, axis: usize) -> i32 {
    of.get(axis).copied().unwrap_or_default()
}

/// How many of these points may be left to the next move.
fn spare(points: usize) -> usize {
    (points / SPARE).max(SPARE_POINTS)
}
