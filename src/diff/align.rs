//! Which items of one thing stand opposite each other in two timelines.
//!
//! There are three ways to see it: by what items say and how long after the one before they start, so that an inserted pause touches
//! one item only; by what they say and when; and by when they should be as another thing has moved. The one that leaves
//! least to say is taken. What a way leaves open between two places is aligned with as little moved in time as possible.

use std::hash::Hash;
use std::ops::Range;

use imara_diff::{Algorithm, InternedInput, Interner};

use super::Item;
use super::shifts::difference;
use crate::units::Micros;

/// The items of both sides.
#[derive(Default)]
pub(super) struct Aligned<'i> {
    /// Those that stand opposite each other, in the order of time.
    pub(super) pairs: Vec<(&'i Item, &'i Item)>,
    /// Those that are only in the old timeline.
    pub(super) removed: Vec<&'i Item>,
    /// Those that are only in the new one.
    pub(super) added: Vec<&'i Item>,
}

/// The most combinations of two items that are weighed one by one.
const WEIGHED: usize = 40_000;

/// By how much the items of a lane have moved: their old times, in order, and microseconds.
#[derive(Default)]
struct Moved {
    points: Vec<(Micros, i64)>,
    /// Whether a time between two points has moved as the one after it, and not as the one before.
    early: bool,
}

impl Moved {
    fn of(lane: &Aligned<'_>, early: bool) -> Self {
        Moved { points: lane.pairs.iter().map(|pair| (pair.0.at, delta(pair))).collect(), early }
    }

    fn at(&self, at: Micros) -> i64 {
        let until = self.points.partition_point(|(from, _)| *from <= at);
        let from = self.points.partition_point(|(from, _)| *from < at);
        let before = until.checked_sub(1).and_then(|at| self.points.get(at));
        let behind = self.points.get(from);
        // Before the first point nothing is known, and nothing has moved.
        let point = before.and_then(|before| if self.early { behind.or(Some(before)) } else { Some(before) });
        point.map_or(0, |(_, by_us)| *by_us)
    }
}

/// Aligns the items of every lane.
pub(super) fn align<'i>(lanes: &[(Vec<&'i Item>, Vec<&'i Item>)]) -> Vec<Aligned<'i>> {
    let still = [Moved::default()];
    let mut aligned: Vec<Aligned<'i>> =
        lanes.iter().map(|(old, new)| best([by_gaps(old, new), by_times(old, new, &still[0])], &still)).collect();
    // The lane that has most of its items on both sides tells best how time has moved.
    let surest = aligned.iter().max_by_key(|lane| (lane.removed.len() + lane.added.len() == 0, lane.pairs.len()));
    let Some(moved) = surest.map(|lane| [false, true].map(|early| Moved::of(lane, early))) else { return aligned };
    for (lane, (old, new)) in aligned.iter_mut().zip(lanes) {
        if lane.removed.len() + lane.added.len() > 0 {
            let [late, early] = &moved;
            *lane = best([std::mem::take(lane), by_times(old, new, late), by_times(old, new, early)], &moved);
        }
    }
    aligned
}

fn delta((old, new): &(&Item, &Item)) -> i64 {
    difference(old.at, new.at)
}

/// The one that leaves least to say, by itself and relative_us what has moved; the first of those that leave the same.
fn best<'i, const N: usize>(all: [Aligned<'i>; N], moved: &[Moved]) -> Aligned<'i> {
    let still = Moved::default();
    let least = |aligned: &Aligned<'i>| {
        let relative_us = moved.iter().map(|moved| aligned.statements(moved)).min().unwrap_or(0);
        aligned.statements(&still) + relative_us
    };
    all.into_iter().min_by_key(least).unwrap_or_default()
}

fn by_gaps<'i>(old: &[&'i Item], new: &[&'i Item]) -> Aligned<'i> {
    aligned(old, new, &keyed(old), &keyed(new))
}

/// `moved` says where old items should be now.
fn by_times<'i>(old: &[&'i Item], new: &[&'i Item], moved: &Moved) -> Aligned<'i> {
    let keyed = |items: &[&'i Item], moved: &Moved| -> Vec<_> {
        let time = |item: &Item| item.at.0.saturating_add_signed(moved.at(item.at));
        items.iter().map(|item| (item.notation.as_str(), item.moves.is_some(), time(item))).collect()
    };
    aligned(old, new, &keyed(old, moved), &keyed(new, &Moved::default()))
}

fn aligned<'i, T: Eq + Hash>(old: &[&'i Item], new: &[&'i Item], before: &[T], after: &[T]) -> Aligned<'i> {
    let mut aligned = Aligned::default();
    aligned.by_keys([old, new], [before, after], |aligned, removed, added, next| {
        // By how much the item before the gap has moved, and the one after it.
        let last = aligned.pairs.last().map_or(0, delta);
        if removed.len().saturating_mul(added.len()) <= WEIGHED {
            aligned.weigh(removed, added, [last, next.as_ref().map_or(last, delta)]);
        } else {
            aligned.by_words(removed, added);
        }
    });
    aligned
}

/// What an item says, whether it is a move, and how long after the one before it starts.
fn keyed<'i>(items: &[&'i Item]) -> Vec<(&'i str, bool, Micros)> {
    let mut last = Micros::ZERO;
    let gap =
        |item: &&'i Item| (item.notation.as_str(), item.moves.is_some(), item.at - std::mem::replace(&mut last, item.at));
    items.iter().map(gap).collect()
}

/// Where two sequences differ: in each the first place, and the first behind.
fn hunks<T: Eq + Hash>(before: &[T], after: &[T]) -> Vec<[Range<usize>; 2]> {
    let mut interner = Interner::new(0);
    let [before, after] = [before, after].map(|keys| keys.iter().map(|key| interner.intern(key)).collect());
    let found = imara_diff::Diff::compute(Algorithm::Histogram, &InternedInput { before, after, interner });
    let range = |range: Range<u32>| range.start as usize..range.end as usize;
    found.hunks().map(|hunk| [range(hunk.before), range(hunk.after)]).collect()
}

fn slice<T>(all: &[T], range: Range<usize>) -> &[T] {
    all.get(range).unwrap_or_default()
}

impl<'i> Aligned<'i> {
    /// How much there is to say: what is on one side only, says something else, or moves otherwise than what came before it.
    fn statements(&self, moved: &Moved) -> usize {
        let mut last = 0;
        let changes = self.pairs.iter().filter(|pair| {
            let relative_us = delta(pair) - moved.at(pair.0.at);
            let otherwise = std::mem::replace(&mut last, relative_us) != relative_us;
            otherwise || pair.0.notation != pair.1.notation
        });
        self.removed.len() + self.added.len() + changes.count()
    }

    fn relative_us(&mut self, old: &[&'i Item], new: &[&'i Item]) {
        self.pairs.extend(old.iter().copied().zip(new.iter().copied()));
    }

    /// Aligns what has the same keys. `gap` aligns what is between; it is given the pair that follows, too.
    fn by_keys<T: Eq + Hash>(
        &mut self,
        [old, new]: [&[&'i Item]; 2],
        [before, after]: [&[T]; 2],
        mut gap: impl FnMut(&mut Self, &[&'i Item], &[&'i Item], Option<(&'i Item, &'i Item)>),
    ) {
        let (mut old_at, mut new_at) = (0, 0);
        for [before, after] in hunks(before, after) {
            self.relative_us(slice(old, old_at..before.start), slice(new, new_at..after.start));
            (old_at, new_at) = (before.end, after.end);
            let next = old.get(old_at).copied().zip(new.get(new_at).copied());
            gap(self, slice(old, before), slice(new, after), next);
        }
        self.relative_us(slice(old, old_at..old.len()), slice(new, new_at..new.len()));
    }

    /// Aligns by words alone, and what is left in its order.
    fn by_words(&mut self, old: &[&'i Item], new: &[&'i Item]) {
        let words =
            [old, new].map(|items| -> Vec<_> { items.iter().map(|item| (&item.notation, item.moves.is_some())).collect() });
        let [before, after] = &words;
        self.by_keys([old, new], [before, after], |aligned, removed, added, _| {
            aligned.relative_us(removed, added);
            aligned.removed.extend(removed.iter().skip(added.len()));
            aligned.added.extend(added.iter().skip(removed.len()));
        });
    }

    /// Aligns at the least cost. `usual` is by how much the items before and behind have moved.
    fn weigh(&mut self, old: &[&'i Item], new: &[&'i Item], usual: [i64; 2]) {
        const ALONE: u32 = 4;
        let cost = |old: &Item, new: &Item| {
            let same = old.notation == new.notation && old.moves.is_some() == new.moves.is_some();
            match (same, usual.contains(&difference(old.at, new.at))) {
                (true, true) => 0,
                (true, false) => 3,
                (false, true) => 4,
                (false, false) => 7,
            }
        };
        // The least cost of aligning everything from here on, for each place in both.
        let width = new.len() + 1;
        let mut costs = vec![0_u32; (old.len() + 1) * width];
        let at = |i: usize, j: usize| i * width + j;
        let read = |costs: &[u32], i: usize, j: usize| costs.get(at(i, j)).copied().unwrap_or(u32::MAX / 2);
        let choices = |costs: &[u32], i: usize, j: usize| {
            let pair = old.get(i).zip(new.get(j)).map(|(one, two)| cost(one, two) + read(costs, i + 1, j + 1));
            let removed = old.get(i).map(|_| ALONE + read(costs, i + 1, j));
            let added = new.get(j).map(|_| ALONE + read(costs, i, j + 1));
            [pair, removed, added]
        };
        for i in (0..=old.len()).rev() {
            for j in (0..=new.len()).rev() {
                let least = choices(&costs, i, j).into_iter().flatten().min().unwrap_or(0);
                if let Some(cost) = costs.get_mut(at(i, j)) {
                    *cost = least;
                }
            }
        }
        let (mut i, mut j) = (0, 0);
        while i < old.len() || j < new.len() {
            let least = Some(read(&costs, i, j));
            match choices(&costs, i, j) {
                [pair, _, _] if pair == least => {
                    self.relative_us(slice(old, i..i + 1), slice(new, j..j + 1));
                    (i, j) = (i + 1, j + 1);
                }
                [_, removed, _] if removed == least => {
                    self.removed.extend(old.get(i));
                    i += 1;
                }
                _ => {
                    self.added.extend(new.get(j));
                    j += 1;
                }
            }
        }
    }
}
