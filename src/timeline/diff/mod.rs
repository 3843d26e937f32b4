//! What has changed between two timelines, in the words of the script: by time and thing, not line by line.
//!
//! Frames become items (a command with its refreshes, a move with its steps). The items of each thing are aligned by what they
//! say, so that a later time is no other command; then the times of what stands opposite each other are compared, and
//! what has moved together is said once.

use std::collections::HashMap;
use std::hash::Hash;

use imara_diff::{Algorithm, Token};

use super::{LANES, PID, RAW, REQUESTS, SERVOS, Snapshot, thing_name};

mod items;
mod shifts;
mod words;

use items::Item;
use words::Span;

/// One change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// When it is, or was where it is gone, in microseconds.
    pub at_us: u64,
    /// The first frame of it in the old timeline, if it is there.
    pub old: Option<usize>,
    /// The first frame of it in the new one, if it is there.
    pub new: Option<usize>,
    /// What has changed.
    pub what: What,
    /// Where the same changes are put together: how many there are besides, and when the last of them is.
    pub more: Option<(usize, u64)>,
}

/// What has changed.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum What {
    /// From here on these things come at another time.
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
        /// By how many microseconds it has moved beside the others.
        by_us: i64,
        /// How everything behind it has moved with it: it takes longer or shorter.
        then: Option<Shift>,
    },
    /// One item has moved beside the others.
    Moved {
        /// What it says.
        what: String,
        /// By how many microseconds.
        by_us: i64,
    },
    /// It is new.
    Added(String),
    /// It is gone.
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
    /// The drive is refreshed at another interval, in microseconds (`None`: not at all).
    Refreshed {
        /// Before.
        from_us: Option<u64>,
        /// Now.
        to_us: Option<u64>,
    },
    /// Frames of one time are sent in another order.
    Reordered,
    /// The last frame is sent at another time, in microseconds.
    Length {
        /// Before.
        from_us: u64,
        /// Now.
        to_us: u64,
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
    pub fn is_total(&self) -> bool {
        matches!(self, What::Length { .. } | What::Load { .. })
    }
}

/// Compares two timelines: the changes, sorted by time. Empty where both send the same.
///
/// Changes that say the same of one line of the script, such as the passes of a `repeat`, are put together; `line` says where
/// a change stands.
pub fn diff<L: Eq + Hash>(old: &Snapshot, new: &Snapshot, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    if old.moments == new.moments {
        return Vec::new();
    }
    let (before, after) = items::both(old, new);
    let mut changes = Vec::new();
    let mut lanes = Vec::new();
    let mut tokens = HashMap::new();
    for lane in 0..LANES {
        let (old, new) = (lane_of(&before, lane), lane_of(&after, lane));
        lanes.push(Lane { pairs: align(&old, &new, &mut tokens, &mut changes) });
    }
    shifts::tell(&lanes, &mut changes);
    refreshes(&lanes, &mut changes);
    let (old, new) = (&old.moments, &new.moments);
    if changes.is_empty() {
        let at = old.iter().zip(new).position(|(old, new)| old != new).unwrap_or(old.len().min(new.len()));
        let at_us = new.get(at).or(old.get(at)).map_or(0, |moment| moment.at_us);
        let there = |length: usize| (at < length).then_some(at);
        changes.push(Change::new(at_us, there(old.len()), there(new.len()), What::Reordered));
    }
    changes.sort_by_key(|change| (change.at_us, change.new, change.old));
    changes = fold(changes, line);
    let end = |moments: &[super::Moment]| moments.last().map_or(0, |moment| moment.at_us);
    let (from_us, to_us) = (end(old), end(new));
    let (from, to) = (load(old), load(new));
    let totals = [(from_us != to_us, What::Length { from_us, to_us }), (from != to, What::Load { from, to })];
    let totals = totals.into_iter().filter(|(differs, _)| *differs);
    changes.extend(totals.map(|(_, what)| Change::new(to_us, None, None, what)));
    changes
}

/// Puts changes together that say the same: those of one line of the script, and those that one setting has made.
fn fold<L: Eq + Hash>(changes: Vec<Change>, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    let mut folded: Vec<Change> = Vec::new();
    let mut known = HashMap::new();
    for change in changes {
        let everywhere = matches!(change.what, What::Refreshed { .. } | What::Steps { .. });
        let key = (if everywhere { None } else { line(&change) }, change.kind());
        let first = known.get(&key).and_then(|&at: &usize| folded.get_mut(at));
        let Some(first) = first else {
            known.insert(key, folded.len());
            folded.push(change);
            continue;
        };
        first.more = Some((first.more.map_or(1, |(more, _)| more + 1), change.at_us));
        first.grow(&change);
    }
    folded
}

/// Items of one thing that stand opposite each other, in the order of time.
struct Lane<'i> {
    pairs: Vec<(&'i Item, &'i Item)>,
}

fn lane_of(items: &[Item], lane: usize) -> Vec<&Item> {
    items.iter().filter(|item| item.lane == lane).collect()
}

/// Aligns the items of one thing by what they say. What is only on one side is a change at once.
fn align<'i>(
    old: &[&'i Item],
    new: &[&'i Item],
    tokens: &mut HashMap<(&'i str, bool), u32>,
    changes: &mut Vec<Change>,
) -> Vec<(&'i Item, &'i Item)> {
    let mut token = |item: &&'i Item| {
        let next = u32::try_from(tokens.len()).unwrap_or(u32::MAX);
        Token(*tokens.entry((item.says.as_str(), item.moves.is_some())).or_insert(next))
    };
    let before: Vec<Token> = old.iter().map(&mut token).collect();
    let after: Vec<Token> = new.iter().map(&mut token).collect();
    let count = u32::try_from(tokens.len()).unwrap_or(u32::MAX);
    let mut found = imara_diff::Diff::default();
    found.compute_with(Algorithm::Histogram, &before, &after, count);
    let mut pairs = Vec::new();
    let (mut old_at, mut new_at) = (0, 0);
    for hunk in found.hunks() {
        let (old_end, new_end) = (hunk.before.start as usize, hunk.after.start as usize);
        pairs.extend(slice(old, old_at, old_end).iter().copied().zip(slice(new, new_at, new_end).iter().copied()));
        (old_at, new_at) = (hunk.before.end as usize, hunk.after.end as usize);
        let (gone, come) = (slice(old, old_end, old_at), slice(new, new_end, new_at));
        pairs.extend(gone.iter().copied().zip(come.iter().copied()));
        changes.extend(
            gone.iter()
                .skip(come.len())
                .map(|item| Change::new(item.at_us, Some(item.first), None, What::Removed(item.words()))),
        );
        changes.extend(
            come.iter()
                .skip(gone.len())
                .map(|item| Change::new(item.at_us, None, Some(item.first), What::Added(item.words()))),
        );
    }
    pairs.extend(slice(old, old_at, old.len()).iter().copied().zip(slice(new, new_at, new.len()).iter().copied()));
    pairs
}

fn slice<T>(all: &[T], from: usize, to: usize) -> &[T] {
    all.get(from..to).unwrap_or_default()
}

/// Other intervals of refreshes. A hold that is shorter than an interval tells nothing.
fn refreshes(lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    let told = |item: &Item, other: Option<u64>| item.refresh.is_some() || other.is_some_and(|us| item.holds_us > us);
    for (old, new) in lanes.iter().flat_map(|lane| &lane.pairs) {
        let (from_us, to_us) = (old.refresh, new.refresh);
        if from_us != to_us && told(old, to_us) && told(new, from_us) {
            changes.push(Change::of(old, new, What::Refreshed { from_us, to_us }));
        }
    }
}

/// Bytes in all, and in the busiest second of the script.
fn load(moments: &[super::Moment]) -> (u64, u64) {
    let (mut all, mut second, mut now, mut busiest) = (0, 0, 0, 0);
    for moment in moments {
        let bytes = moment.command.to_frame().len() as u64;
        if moment.at_us / 1_000_000 != second {
            (second, now) = (moment.at_us / 1_000_000, 0);
        }
        all += bytes;
        now += bytes;
        busiest = busiest.max(now);
    }
    (all, busiest)
}

fn lane_name(lane: usize) -> String {
    match lane {
        SERVOS => "the servos together".into(),
        PID => "the gains".into(),
        REQUESTS => "the requests".into(),
        RAW => "the raw frames".into(),
        thing => thing_name(thing),
    }
}

impl Change {
    fn new(at_us: u64, old: Option<usize>, new: Option<usize>, what: What) -> Self {
        Change { at_us, old, new, what, more: None }
    }

    /// Of an item that is on both sides, at its new time.
    fn of(old: &Item, new: &Item, what: What) -> Self {
        Change::new(new.at_us, Some(old.first), Some(new.first), what)
    }
}
