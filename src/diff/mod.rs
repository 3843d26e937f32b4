//! What has changed between two timelines, in the words of the script: by time and thing, not line by line.
//!
//! Frames become items (a command with its refreshes, a move with its steps). The items of each thing are aligned by what they
//! say, so that a later time is no other command; then the times of what stands opposite each other are compared, and
//! what has moved together is said once.

use std::collections::HashMap;
use std::hash::Hash;

use crate::board::Board;
use crate::timeline::{Moment, Snapshot, Tween};
use crate::units::Micros;

mod align;
mod items;
mod shifts;
mod words;

use items::Item;

/// One change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// When it is, or was where it is removed.
    pub at: Micros,
    /// Whether it concerns what is sent where something ends a run early; times and frames count there.
    pub aborts: bool,
    /// The first frame of it in the old timeline, if it is there.
    pub old: Option<usize>,
    /// The first frame of it in the new one, if it is there.
    pub new: Option<usize>,
    /// What has changed.
    pub what: What,
    /// Where the changes of one line are put together: what there is besides.
    pub more: Option<Again>,
}

/// The same change again, later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Again {
    /// How often.
    pub count: usize,
    /// When the last time.
    pub last: Micros,
    /// Whether it is not quite the same: other values.
    pub otherwise: bool,
    /// By how many microseconds everything is later from then on, where it is about that.
    pub total_us: i64,
}

/// What has changed.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum What {
    /// From here on these things added at another time.
    Shifted {
        /// The things; empty for all of them.
        things: Vec<String>,
        /// By how much.
        by: Shift,
    },
    /// One item says something else.
    Changed {
        /// What it said, in parts.
        from: Vec<String>,
        /// What it says.
        to: Vec<String>,
        /// By how many microseconds it is later than it was, where it has moved beside the others.
        by_us: Option<i64>,
        /// It takes longer or shorter, and so what follows has moved: everything, or only its own thing, which is named then.
        then: Option<(Option<String>, Shift)>,
    },
    /// One item has moved beside the others.
    Moved {
        /// What it says.
        what: String,
        /// By how many microseconds it is later than it was; 0 where it alone has not moved.
        by_us: i64,
    },
    /// It is new.
    Added(String),
    /// It is removed.
    Removed(String),
    /// A move says the same, and takes other steps.
    Steps {
        /// What it says.
        what: String,
        /// How many steps it had.
        from: usize,
        /// How many it has.
        to: usize,
    },
    /// The drive is refreshed at another interval (`None`: not at all).
    Refreshed {
        /// Before.
        from: Option<Micros>,
        /// Now.
        to: Option<Micros>,
    },
    /// Frames of one time are sent in another order.
    Reordered,
    /// The speed of the line, in bits a second.
    Baud {
        /// Before.
        from: u32,
        /// Now.
        to: u32,
    },
    /// The script ends at another time.
    Length {
        /// Before.
        from: Micros,
        /// Now.
        to: Micros,
    },
    /// Another number of bytes, in all and in the busiest second.
    Load {
        /// Before.
        from: (u64, u64),
        /// Now.
        to: (u64, u64),
    },
}

/// By how much something has moved, in microseconds; negative where it is earlier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Shift {
    /// Beside what came before it.
    pub step_us: i64,
    /// Beside the old timeline.
    pub total_us: i64,
}

impl What {
    /// Whether it sums up the others, and is at no place in particular.
    pub(crate) fn is_total(&self) -> bool {
        matches!(self, What::Length { .. } | What::Load { .. })
    }
}

/// Compares two timelines: the changes, sorted by time. Empty where a robot does the same.
///
/// Changes that say the same of one line of the script, such as the passes of a `repeat`, are put together; `line` says where
/// a change stands.
pub fn diff<L: Eq + Hash>(old: &Snapshot, new: &Snapshot, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    if old.does_the_same(new) {
        return Vec::new();
    }
    let both = old.more.as_ref().zip(new.more.as_ref());
    let tweens = both.map(|(old, new)| (old.tweens.as_slice(), new.tweens.as_slice()));
    let mut changes = fold(frames(&old.board, &old.moments, &new.moments, tweens), &line);
    let board = &old.board;
    if let Some((old, new)) = both {
        let mut aborts = frames(board, &old.abort, &new.abort, None);
        for change in &mut aborts {
            change.aborts = true;
        }
        changes.extend(fold(aborts, &line));
    }
    let ends = both.map_or((Micros::ZERO, Micros::ZERO), |(old, new)| (old.end, new.end));
    let baud = both.map_or((0, 0), |(old, new)| (old.baud, new.baud));
    let (from, to) = (load(board, &old.moments), load(board, &new.moments));
    let totals = [
        (baud.0 != baud.1, What::Baud { from: baud.0, to: baud.1 }),
        (ends.0 != ends.1, What::Length { from: ends.0, to: ends.1 }),
        (from != to, What::Load { from, to }),
    ];
    let totals = totals.into_iter().filter(|(differs, _)| *differs);
    changes.extend(totals.map(|(_, what)| Change::new(ends.1, None, None, what)));
    changes
}

/// Compares frames, with the moves that they belong to where both sides say so.
fn frames(board: &Board, old: &[Moment], new: &[Moment], tweens: Option<(&[Tween], &[Tween])>) -> Vec<Change> {
    if old == new {
        return Vec::new();
    }
    let before = items::items(board, old, tweens.map(|(old, _)| old));
    let after = items::items(board, new, tweens.map(|(_, new)| new));
    let mut changes = Vec::new();
    let mut lanes = Vec::new();
    let of_lane = |lane| -> (Vec<&Item>, Vec<&Item>) {
        let is_of_lane = |item: &&Item| item.lane == lane;
        (before.iter().filter(is_of_lane).collect(), after.iter().filter(is_of_lane).collect())
    };
    let both: Vec<_> = (0..board.lanes()).map(of_lane).collect();
    for align::Aligned { pairs, removed, added } in align::align(&both) {
        changes
            .extend(removed.iter().map(|item| Change::new(item.at, Some(item.first), None, What::Removed(item.words()))));
        changes.extend(added.iter().map(|item| Change::new(item.at, None, Some(item.first), What::Added(item.words()))));
        lanes.push(Lane { pairs });
    }
    shifts::find_changes(board, &lanes, &mut changes);
    refreshes(&lanes, &mut changes);
    if changes.is_empty() {
        let first = old.iter().zip(new).position(|(old, new)| old != new).unwrap_or(old.len().min(new.len()));
        let at = new.get(first).or(old.get(first)).map_or(Micros::ZERO, |moment| moment.at);
        let there = |length: usize| (first < length).then_some(first);
        changes.push(Change::new(at, there(old.len()), there(new.len()), What::Reordered));
    }
    changes.sort_by_key(|change| (change.at, change.new, change.old));
    changes
}

/// Puts changes together that say the same: those of one line of the script, and those that one setting has made.
fn fold<L: Eq + Hash>(changes: Vec<Change>, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    let mut folded: Vec<Change> = Vec::new();
    let mut known = HashMap::new();
    for change in changes {
        let everywhere = matches!(change.what, What::Refreshed { .. } | What::Steps { .. });
        let line = if everywhere { None } else { line(&change) };
        // Without a script nothing says that other values are of one line.
        let key = (change.kind(line.is_some()), line);
        let first = known.get(&key).and_then(|&at: &usize| folded.get_mut(at));
        match first {
            Some(first) => first.grow(&change),
            None => {
                known.insert(key, folded.len());
                folded.push(change);
            }
        }
    }
    folded
}

/// Items of one thing that stand opposite each other, in the order of time.
struct Lane<'i> {
    pairs: Vec<(&'i Item, &'i Item)>,
}

/// Other intervals of refreshes. A hold that is shorter than an interval tells nothing, and nor does another command.
fn refreshes(lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    let told =
        |item: &Item, other: Option<Micros>| item.refresh.is_some() || other.is_some_and(|other| item.holds > other);
    for (old, new) in lanes.iter().flat_map(|lane| &lane.pairs) {
        let (from, to) = (old.refresh, new.refresh);
        let comparable = old.notation == new.notation || from.is_some() && to.is_some();
        if from != to && comparable && told(old, to) && told(new, from) {
            changes.push(Change::of(old, new, What::Refreshed { from, to }));
        }
    }
}

/// Bytes in all, and in the busiest second of the script.
fn load(board: &Board, moments: &[Moment]) -> (u64, u64) {
    let (mut all, mut second, mut now, mut busiest) = (0, 0, 0, 0);
    for moment in moments {
        let bytes = board.frame_length(&moment.command) as u64;
        let its_second = moment.at.0 / Micros::SECOND.0;
        if its_second != second {
            (second, now) = (its_second, 0);
        }
        all += bytes;
        now += bytes;
        busiest = busiest.max(now);
    }
    (all, busiest)
}

impl Change {
    fn new(at: Micros, old: Option<usize>, new: Option<usize>, what: What) -> Self {
        Change { at, aborts: false, old, new, what, more: None }
    }

    /// Of an item that is on both sides, at its new time.
    fn of(old: &Item, new: &Item, what: What) -> Self {
        Change::new(new.at, Some(old.first), Some(new.first), what)
    }
}
