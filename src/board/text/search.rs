//! A search through all strings that templates write.

use std::collections::BTreeSet;

/// The most states of a comparison. Strings that need more count as equal.
const MAX_SEARCH: usize = 20_000;

/// A breadth-first search through strings, by what is known after them.
pub(super) struct Search<K> {
    /// What is known, where the search came from, and by which byte.
    found: Vec<(K, usize, u8)>,
    seen: BTreeSet<K>,
    next: usize,
}

impl<K: Copy + Ord> Search<K> {
    pub(super) fn new(from: K) -> Self {
        Search { found: vec![(from, 0, 0)], seen: BTreeSet::from([from]), next: 0 }
    }

    /// What is known after the next string.
    pub(super) fn next(&mut self) -> Option<K> {
        let (known, ..) = *self.found.get(self.next)?;
        self.next += 1;
        Some(known)
    }

    /// Adds what is known after the string of the last `next` and another byte.
    pub(super) fn add(&mut self, known: K, byte: u8) {
        if self.seen.insert(known) {
            self.found.push((known, self.next - 1, byte));
        }
    }

    /// The string of the last `next`.
    pub(super) fn string(&self) -> Vec<u8> {
        let mut string = Vec::new();
        let mut at = self.next - 1;
        while let Some((_, from, byte)) = self.found.get(at).filter(|_| at > 0) {
            string.push(*byte);
            at = *from;
        }
        string.reverse();
        string
    }

    /// Whether the last `next` was not the first.
    pub(super) fn has_moved(&self) -> bool {
        self.next > 1
    }

    /// Whether it has become too large.
    pub(super) fn is_full(&self) -> bool {
        self.found.len() > MAX_SEARCH
    }
}
