//! Finds room for labels that would overlap: in other rows, each with a line from its symbol.

use super::canvas::{Anchor, fit, width};

/// The widest label, and the distances around labels, in pixels.
const WIDEST: f64 = 420.0;
const GAP: f64 = 10.0;
const BESIDE: f64 = 8.0;
const LEADER: f64 = 4.0;

/// Where labels may be.
pub(super) struct Room {
    /// Their right end in pixels.
    pub(super) right: f64,
    /// The maximum number of rows.
    pub(super) rows: usize,
    /// The font size in pixels.
    pub(super) size: f64,
    /// Whether the first row also contains a symbol for each label.
    pub(super) has_symbols: bool,
}

/// A label with its place.
pub(super) struct Label {
    /// The position that it names.
    pub(super) x: f64,
    /// The position of its text, and which end of it is there.
    pub(super) at: f64,
    pub(super) anchor: Anchor,
    /// Its row, counted from the symbols.
    pub(super) row: usize,
    pub(super) text: String,
}

/// Labels with their places.
#[derive(Default)]
pub(super) struct Labels {
    pub(super) shown: Vec<Label>,
    /// The number of rows, at least 1.
    pub(super) rows: usize,
    /// The number of labels for which there is no room.
    pub(super) hidden: usize,
}

/// Places texts, sorted by position, from right to left: each in the first row where neither a
/// label nor the line of a label in a farther row is in its way.
pub(super) fn place(texts: &[(f64, &str)], room: &Room) -> Labels {
    let mut placed = Labels { rows: 1, ..Labels::default() };
    // For each row, the left end of what is in it and in farther rows.
    let mut taken = vec![f64::INFINITY; room.rows];
    for (at, (x, text)) in texts.iter().enumerate().rev() {
        let text = fit(text, room.size, WIDEST);
        let wide = width(&text, room.size);
        let before = at.checked_sub(1).and_then(|before| texts.get(before)).map_or(0.0, |(before, _)| *before);
        let start = |row: usize| {
            let beside = x + if row == 0 && room.has_symbols { BESIDE } else { LEADER };
            match beside + wide > room.right {
                false => Some(beside),
                true if row > 0 || !room.has_symbols => Some(room.right - wide),
                // To the left of its symbol.
                true => Some(x - BESIDE - wide).filter(|from| *from > before + BESIDE),
            }
        };
        let is_free = |(row, taken): (usize, &f64)| {
            let from = start(row)?;
            (from + wide + GAP <= *taken).then_some((row, from))
        };
        let found = taken.iter().enumerate().find_map(is_free);
        if let Some((row, from)) = found {
            taken.iter_mut().take(row + 1).for_each(|taken| *taken = taken.min(from).min(*x));
            placed.rows = placed.rows.max(row + 1);
            let (at, anchor) = if from > *x { (from, Anchor::Start) } else { (from + wide, Anchor::End) };
            placed.shown.push(Label { x: *x, at, anchor, row, text });
        } else {
            placed.hidden += 1;
        }
        if let Some(taken) = taken.first_mut().filter(|_| room.has_symbols) {
            *taken = taken.min(*x);
        }
    }
    placed
}
