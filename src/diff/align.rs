//! Aligns the items of each lane in two timelines.
//!
//! There are three ways to match items: by content and distance to the previous item, so that an
//! inserted pause affects only one item; by content and time; and by the time that they would have
//! if they had moved like another lane. The alignment with the fewest changes is chosen. Items
//! between matches are aligned with the smallest possible changes of time.

use std::hash::Hash;
use std::ops::Range;

use imara_diff::{Algorithm, InternedInput, Interner};

use super::Item;
use super::shifts::difference;
use crate::units::Micros;

/// The items of both sides.
#[derive(Default)]
pub(super) struct Aligned<'i> {
    /// Matched items, in the order of time.
    pub(super) pairs: Vec<(&'i Item, &'i Item)>,
    /// Items only in the old timeline.
    pub(super) removed: Vec<&'i Item>,
    /// Items only in the new timeline.
    pub(super) added: Vec<&'i Item>,
}

/// The maximum number of pairs for which a cost is computed.
const WEIGHED: usize = 40_000;

/// How far the items of a lane have moved: their old times, sorted, and the shifts in microseconds.
#[derive(Default)]
struct Moved {
    points: Vec<(Micros, i64)>,
    /// Whether a time between two points has moved like the point after it, not like the one
    /// before.
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
        let after = self.points.get(from);
        // Nothing has moved before the first point.
        let point = before.and_then(|before| if self.early { after.or(Some(before)) } else { Some(before) });
        point.map_or(0, |(_, by_us)| *by_us)
    }
}

/// Aligns the items of all lanes.
pub(super) fn align<'i>(lanes: &[(Vec<&'i Item>, Vec<&'i Item>)]) -> Vec<Aligned<'i>> {
    let still = [Moved::default()];
    let mut aligned: Vec<Aligned<'i>> =
        lanes.iter().map(|(old, new)| best([by_gaps(old, new), by_times(old, new, &still[0])], &still)).collect();
    // The lane with the most matched items is the best evidence of how time has moved.
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

/// Aligns the items of a lane by content only.
pub(super) fn by_content<'i>(old: &[&'i Item], new: &[&'i Item]) -> Vec<(&'i Item, &'i Item)> {
    let mut aligned = Aligned::default();
    aligned.by_words(old, new);
    aligned.pairs
}

fn delta((old, new): &(&Item, &Item)) -> i64 {
    difference(old.at, new.at)
}

/// The alignment with the fewest changes, both absolute and relative to the shifts; the first of
/// equal ones.
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

/// `moved` gives the new times of old items.
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
        // The shifts of the items before and after the gap.
        let last = aligned.pairs.last().map_or(0, delta);
        if removed.len().saturating_mul(added.len()) <= WEIGHED {
            aligned.weigh(removed, added, [last, next.as_ref().map_or(last, delta)]);
        } else {
            aligned.by_words(removed, added);
        }
    });
    aligned
}

/// The content of an item, whether it is a move, and its distance to the previous item.
fn keyed<'i>(items: &[&'i Item]) -> Vec<(&'i str, bool, Micros)> {
    let mut last = Micros::ZERO;
    let gap = |item: &&'i Item| {
        (item.notation.as_str(), item.moves.is_some(), item.at - std::mem::replace(&mut last, item.at))
    };
    items.iter().map(gap).collect()
}

/// The ranges where two sequences differ.
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
    /// The number of changes: items on one side only, items with other content, and items that
    /// moved differently from the previous one.
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

    /// Aligns items with equal keys. `gap` aligns the items in between, and also gets the next
    /// pair.
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

    /// Aligns by content only, and the remaining items in their order.
    fn by_words(&mut self, old: &[&'i Item], new: &[&'i Item]) {
        let words = [old, new]
            .map(|items| -> Vec<_> { items.iter().map(|item| (&item.notation, item.moves.is_some())).collect() });
        let [before, after] = &words;
        self.by_keys([old, new], [before, after], |aligned, removed, added, _| {
            aligned.relative_us(removed, added);
            aligned.removed.extend(removed.iter().skip(added.len()));
            aligned.added.extend(added.iter().skip(removed.len()));
        });
    }

    /// Aligns at the lowest cost. `usual` contains the shifts of the items before and after.
    fn weigh(&mut self, old: &[&'i Item], new: &[&'i Item], usual: [i64; 2]) {
        const ALONE: u32 = 4;
        let cost = |old: &Item, new: &Item| {
            let same = old.notation == new.notation && old.moves.is_some() == new.moves.is_some();
            match (same, usual.contains(&difference(old.at, new.at))) {
                (true, true) => 0,
                (true, false) => 3,
                (false, true) => 4,
                // A note elsewhere is another note.
                (false, false) => {
                    if old.is_note {
                        2 * ALONE + 1
                    } else {
                        7
                    }
                }
            }
        };
        // The lowest cost of aligning all remaining items, for each pair of positions.
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
