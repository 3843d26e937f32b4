//! Which items of one thing stand opposite each other in two timelines.
//!
//! First by what they say and how long after the one before: an inserted pause then touches one item only. What is left
//! between is aligned by what it says, with as little moved in time as possible.

use std::collections::HashMap;
use std::hash::Hash;

use imara_diff::{Algorithm, Token};

use super::Item;
use super::shifts::difference;

/// The items of both sides.
#[derive(Default)]
pub(super) struct Aligned<'i> {
    /// Those that stand opposite each other, in the order of time.
    pub(super) pairs: Vec<(&'i Item, &'i Item)>,
    /// Those that are only in the old timeline.
    pub(super) gone: Vec<&'i Item>,
    /// Those that are only in the new one.
    pub(super) come: Vec<&'i Item>,
}

/// The most combinations of two items that are weighed one by one.
const WEIGHED: usize = 40_000;

pub(super) fn align<'i>(old: &[&'i Item], new: &[&'i Item]) -> Aligned<'i> {
    let mut aligned = Aligned::default();
    // A gap between two items that were aligned, from the last of them on: by how much that one was later.
    let gaps = hunks(&keyed(old), &keyed(new));
    let (mut old_at, mut new_at) = (0, 0);
    for (before, after) in gaps {
        aligned.beside(slice(old, old_at, before.0), slice(new, new_at, after.0));
        let (gone, come) = (slice(old, before.0, before.1), slice(new, after.0, after.1));
        (old_at, new_at) = (before.1, after.1);
        let last = aligned.pairs.last().map_or(0, |(old, new)| difference(old.at_us, new.at_us));
        let next = old.get(old_at).zip(new.get(new_at)).map_or(last, |(old, new)| difference(old.at_us, new.at_us));
        if gone.len().saturating_mul(come.len()) <= WEIGHED {
            aligned.weigh(gone, come, [last, next]);
        } else {
            aligned.by_words(gone, come);
        }
    }
    aligned.beside(slice(old, old_at, old.len()), slice(new, new_at, new.len()));
    aligned
}

/// What an item says, whether it is a move, and how long after the one before it starts.
fn keyed<'i>(items: &[&'i Item]) -> Vec<(&'i str, bool, u64)> {
    let mut last = 0;
    let gap = |item: &&'i Item| {
        (item.says.as_str(), item.moves.is_some(), item.at_us - std::mem::replace(&mut last, item.at_us))
    };
    items.iter().map(gap).collect()
}

/// Where two sequences differ: in each the first place, and the first behind.
fn hunks<T: Eq + Hash>(old: &[T], new: &[T]) -> Vec<((usize, usize), (usize, usize))> {
    let mut tokens = HashMap::new();
    let mut token = |key| {
        let next = u32::try_from(tokens.len()).unwrap_or(u32::MAX);
        Token(*tokens.entry(key).or_insert(next))
    };
    let before: Vec<Token> = old.iter().map(&mut token).collect();
    let after: Vec<Token> = new.iter().map(&mut token).collect();
    let count = u32::try_from(tokens.len()).unwrap_or(u32::MAX);
    let mut found = imara_diff::Diff::default();
    found.compute_with(Algorithm::Histogram, &before, &after, count);
    let range = |range: std::ops::Range<u32>| (range.start as usize, range.end as usize);
    found.hunks().map(|hunk| (range(hunk.before), range(hunk.after))).collect()
}

fn slice<T>(all: &[T], from: usize, to: usize) -> &[T] {
    all.get(from..to).unwrap_or_default()
}

impl<'i> Aligned<'i> {
    fn beside(&mut self, old: &[&'i Item], new: &[&'i Item]) {
        self.pairs.extend(old.iter().copied().zip(new.iter().copied()));
    }

    /// Aligns by words alone, and what is left in its order.
    fn by_words(&mut self, old: &[&'i Item], new: &[&'i Item]) {
        let words =
            |items: &[&'i Item]| -> Vec<_> { items.iter().map(|item| (&item.says, item.moves.is_some())).collect() };
        let (mut old_at, mut new_at) = (0, 0);
        for (before, after) in hunks(&words(old), &words(new)) {
            self.beside(slice(old, old_at, before.0), slice(new, new_at, after.0));
            let (gone, come) = (slice(old, before.0, before.1), slice(new, after.0, after.1));
            (old_at, new_at) = (before.1, after.1);
            self.beside(gone, come);
            self.gone.extend(gone.iter().skip(come.len()));
            self.come.extend(come.iter().skip(gone.len()));
        }
        self.beside(slice(old, old_at, old.len()), slice(new, new_at, new.len()));
    }

    /// Aligns at the least cost. `usual` is by how much the items before and behind have moved.
    fn weigh(&mut self, old: &[&'i Item], new: &[&'i Item], usual: [i64; 2]) {
        const ALONE: u32 = 4;
        let cost = |old: &Item, new: &Item| {
            let same = old.says == new.says && old.moves.is_some() == new.moves.is_some();
            match (same, usual.contains(&difference(old.at_us, new.at_us))) {
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
            let gone = old.get(i).map(|_| ALONE + read(costs, i + 1, j));
            let come = new.get(j).map(|_| ALONE + read(costs, i, j + 1));
            [pair, gone, come]
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
                    self.beside(slice(old, i, i + 1), slice(new, j, j + 1));
                    (i, j) = (i + 1, j + 1);
                }
                [_, gone, _] if gone == least => {
                    self.gone.extend(old.get(i));
                    i += 1;
                }
                _ => {
                    self.come.extend(new.get(j));
                    j += 1;
                }
            }
        }
    }
}
