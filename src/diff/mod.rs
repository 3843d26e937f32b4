//! Compares two timelines by time and resource, not line by line, and reports changes in the
//! notation of scripts.
//!
//! Frames are grouped into items (a command with its refreshes, a move with its steps). The items
//! of each lane are aligned by content, so that another time does not make another command. Then
//! the times of matched items are compared, and items that moved together are reported once.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

use crate::board::Board;
use crate::timeline::{Gate, Moment, Note, NoteKind, Snapshot, Timeline, Tween, gate_notes};
use crate::units::Micros;

mod align;
mod items;
mod parts;
mod robots;
mod scale;
mod shifts;
mod words;

use items::Item;
pub use parts::{Part, Words};
pub use robots::{diff_all, diff_all_scripts};

/// One change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The robots that it concerns, if the script names its robots. Indices refer to the first one.
    pub robots: Vec<Arc<str>>,
    /// Its time; the old time if it was removed.
    pub at: Micros,
    /// Whether it concerns the frames that are sent if something ends a run early. Times and
    /// indices refer to those.
    pub aborts: bool,
    /// The index of its first frame in the old timeline, if any. Notes are counted after all
    /// frames.
    pub old: Option<usize>,
    /// The index of its first frame in the new timeline, if any. Notes are counted after all
    /// frames.
    pub new: Option<usize>,
    /// The change.
    pub what: What,
    /// The repetitions, if changes of one line were combined.
    pub more: Option<Again>,
}

/// The repetitions of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Again {
    /// Their number.
    pub count: usize,
    /// The time of the last one.
    pub last: Micros,
    /// Whether some of them have other values.
    pub otherwise: bool,
    /// The total shift in microseconds after the last one, if the change is a shift.
    pub total_us: i64,
}

/// The kind of a change.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum What {
    /// From here on, these lanes come at another time.
    Shifted {
        /// The names of the lanes; empty for all.
        things: Vec<String>,
        /// The shift.
        by: Shift,
        /// The old and the new pause before it, if that is the reason.
        pause: Option<[Micros; 2]>,
    },
    /// From here on, everything runs faster or slower.
    Scaled {
        /// The end of this section in the old timeline; `None` if nothing follows.
        until: Option<Micros>,
        /// Its old and its new length.
        lasts: [Micros; 2],
        /// The shift of what follows; in total, with the sections before.
        by: Shift,
    },
    /// One item has other content.
    Changed {
        /// The old content, in parts.
        from: Vec<String>,
        /// The new content, in parts.
        to: Vec<String>,
        /// Its shift in microseconds, if it moved relative to the others.
        by_us: Option<i64>,
        /// It takes longer or shorter, so later items have moved: of all lanes, or only of the
        /// named one.
        then: Option<(Option<String>, Shift)>,
    },
    /// One item has moved relative to the others.
    Moved {
        /// The item.
        what: String,
        /// Its shift in microseconds; 0 if all others have moved.
        by_us: i64,
    },
    /// A gate waits for something else.
    Gate {
        /// The old line.
        from: String,
        /// The new line.
        to: String,
    },
    /// A gate is on the other side of something at the same moment.
    GateOrder(String),
    /// An item was added.
    Added(String),
    /// An item was removed.
    Removed(String),
    /// A robot is new.
    RobotAdded,
    /// A robot is gone.
    RobotRemoved,
    /// A move with equal content has other steps.
    Steps {
        /// The move.
        what: String,
        /// The old number of steps.
        from: usize,
        /// The new number of steps.
        to: usize,
    },
    /// The interval of drive refreshes; `None` if there are none.
    Refreshed {
        /// The old interval.
        from: Option<Micros>,
        /// The new interval.
        to: Option<Micros>,
    },
    /// Frames at one time are sent in another order.
    Reordered,
    /// The speed of the line in bits per second.
    Baud {
        /// The old speed.
        from: u32,
        /// The new speed.
        to: u32,
    },
    /// The end of the script.
    Length {
        /// The old end.
        from: Micros,
        /// The new end.
        to: Micros,
    },
    /// The number of bytes in total and in the busiest second.
    Load {
        /// The old numbers.
        from: (u64, u64),
        /// The new numbers.
        to: (u64, u64),
    },
}

/// A shift in microseconds; negative if earlier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Shift {
    /// Relative to the previous shift.
    pub step_us: i64,
    /// Relative to the old timeline.
    pub total_us: i64,
}

impl What {
    /// Whether it summarizes the run and has no place of its own. A shortened list keeps these.
    pub fn is_total(&self) -> bool {
        matches!(self, What::Baud { .. } | What::Length { .. } | What::Load { .. })
    }
}

/// Compares what two snapshots send. Returns the changes sorted by time, or none if the robot does
/// the same.
///
/// Equal changes of one line of the script, such as the passes of a `repeat`, are combined; `line`
/// returns the line of a change.
pub fn diff<L: Eq + Hash>(old: &Snapshot, new: &Snapshot, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    let gates = |side: &Snapshot| side.more.as_ref().map(|more| gate_notes(&more.gates)).unwrap_or_default();
    compare([old, new], [[gates(old), gates(new)], Default::default()], line)
}

/// Compares two scripts like [`diff`], and also their marks, `say` and `expect`, which a snapshot
/// does not contain.
pub fn diff_scripts<L: Eq + Hash>(old: &Timeline, new: &Timeline, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    let notes = [false, true].map(|aborts| [old.notes(aborts), new.notes(aborts)]);
    compare([&Snapshot::of(old), &Snapshot::of(new)], notes, line)
}

/// `notes` contains those of the run and those of `on abort`, of both sides.
fn compare<L: Eq + Hash>(
    [old, new]: [&Snapshot; 2],
    [run, abort]: [[Vec<Note>; 2]; 2],
    line: impl Fn(&Change) -> Option<L>,
) -> Vec<Change> {
    let board = &old.board;
    let both = old.more.as_ref().zip(new.more.as_ref());
    let tweens = both.map(|(old, new)| [old.tweens.as_slice(), new.tweens.as_slice()]);
    let gates = both.map(|(old, new)| [old.gates.as_slice(), new.gates.as_slice()]).unwrap_or_default();
    let run = Sides { moments: [&old.moments, &new.moments], tweens, notes: run, gates };
    let of_robot = |mut changes: Vec<Change>, aborts: bool| {
        for change in &mut changes {
            change.aborts = aborts;
            change.robots = new.robot.iter().cloned().collect();
        }
        changes
    };
    let mut changes = fold(of_robot(run.changes(board), false), &line);
    if let Some((old, new)) = both {
        let abort = Sides { moments: [&old.abort, &new.abort], tweens: None, notes: abort, gates: Default::default() };
        changes.extend(fold(of_robot(abort.changes(board), true), &line));
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
    let totals = totals.map(|(_, what)| Change::new(ends.1, None, None, what)).collect();
    changes.extend(of_robot(totals, false));
    changes
}

/// What is compared: the old and the new run, or what they send on abort.
struct Sides<'s> {
    moments: [&'s [Moment]; 2],
    /// The moves, if both sides have them.
    tweens: Option<[&'s [Tween]; 2]>,
    notes: [Vec<Note>; 2],
    gates: [&'s [Gate]; 2],
}

impl Sides<'_> {
    fn changes(&self, board: &Board) -> Vec<Change> {
        let [old, new] = self.moments;
        let words = |notes: &[Note]| notes.iter().map(|note| (note.at, note.words.clone())).collect::<Vec<_>>();
        let places = self.gates.map(|gates| gates.iter().map(|gate| gate.next.events).collect::<Vec<_>>());
        let is_same_order = places[0] == places[1];
        if old == new && is_same_order && words(&self.notes[0]) == words(&self.notes[1]) {
            return Vec::new();
        }
        let tweens = self.tweens;
        let [was, is] = &self.notes;
        let before = items::items(board, old, tweens.map(|[old, _]| old), was);
        let after = items::items(board, new, tweens.map(|[_, new]| new), is);
        let mut changes = compare_items(board, &before, &after);
        // An explanation must save more than one line.
        let explanations = (changes.len() > 2).then(|| scale::explanations(&by_lane(board, &before, &after), &before));
        for (sections, retimed) in explanations.into_iter().flatten() {
            if sections.len() + 1 >= changes.len() {
                continue;
            }
            let mut fewer = compare_items(board, &retimed, &after);
            fewer.extend(section_changes(sections));
            if fewer.len() + 1 < changes.len() {
                changes = fewer;
            }
        }
        if changes.is_empty() && old == new {
            changes.extend(self.other_side());
        }
        if changes.is_empty() && old != new {
            let first = old.iter().zip(new).position(|(old, new)| old != new).unwrap_or(old.len().min(new.len()));
            let at = new.get(first).or(old.get(first)).map_or(Micros::ZERO, |moment| moment.at);
            let there = |length: usize| (first < length).then_some(first);
            changes.push(Change::new(at, there(old.len()), there(new.len()), What::Reordered));
        }
        changes.sort_by_key(|change| (change.at, change.new, change.old));
        changes
    }
}

impl Sides<'_> {
    /// The first gate with something at its moment that is on its other side now.
    fn other_side(&self) -> Option<Change> {
        let [was, is] = &self.notes;
        let note = || is.iter().zip(was).position(|(is, was)| is.words != was.words);
        let gate = self.gates[1].iter().zip(self.gates[0]).position(|(is, was)| is.next.events != was.next.events);
        let at = match gate {
            Some(gate) => self.gates[1].get(gate)?.at,
            None => is.get(note()?)?.at,
        };
        let place = is.iter().position(|note| note.at == at && note.kind == NoteKind::Gate)?;
        let words = is.get(place)?.words.clone();
        let index = self.moments[1].len() + place;
        Some(Change::new(at, None, Some(index), What::GateOrder(words)))
    }
}

fn section_changes(sections: Vec<scale::Section>) -> impl Iterator<Item = Change> {
    let mut total_us = 0;
    sections.into_iter().map(move |scale::Section { from, until, lasts, first }| {
        let (old, new) = first.unzip();
        let step_us = shifts::difference(lasts[0], lasts[1]);
        total_us += step_us;
        Change::new(from, old, new, What::Scaled { until, lasts, by: Shift { step_us, total_us } })
    })
}

/// The items of each lane, on both sides.
fn by_lane<'i>(board: &Board, before: &'i [Item], after: &'i [Item]) -> Vec<(Vec<&'i Item>, Vec<&'i Item>)> {
    let mut lanes = vec![(Vec::new(), Vec::new()); board.lanes() + NoteKind::ALL.len()];
    for item in before {
        if let Some((old, _)) = lanes.get_mut(item.lane) {
            old.push(item);
        }
    }
    for item in after {
        if let Some((_, new)) = lanes.get_mut(item.lane) {
            new.push(item);
        }
    }
    lanes
}

fn compare_items(board: &Board, before: &[Item], after: &[Item]) -> Vec<Change> {
    let mut changes = Vec::new();
    let mut lanes = Vec::new();
    for align::Aligned { pairs, removed, added } in align::align(&by_lane(board, before, after)) {
        changes.extend(
            removed.iter().map(|item| Change::new(item.shown, Some(item.first), None, What::Removed(item.words()))),
        );
        changes
            .extend(added.iter().map(|item| Change::new(item.at, None, Some(item.first), What::Added(item.words()))));
        lanes.push(Lane { pairs });
    }
    shifts::find_changes(board, &lanes, &mut changes);
    refreshes(&lanes, &mut changes);
    changes
}

/// Combines equal changes of one line of the script, and those that one setting has caused.
fn fold<L: Eq + Hash>(changes: Vec<Change>, line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    let mut folded: Vec<Change> = Vec::new();
    let mut known = HashMap::new();
    for change in changes {
        let everywhere = matches!(change.what, What::Refreshed { .. } | What::Steps { .. } | What::Scaled { .. });
        let line = if everywhere { None } else { line(&change) };
        // Without a script, it is unknown whether other values come from one line.
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

/// The matched items of one lane, in the order of time.
struct Lane<'i> {
    pairs: Vec<(&'i Item, &'i Item)>,
}

/// Finds changed refresh intervals. A hold shorter than the interval shows none, nor does another
/// command.
fn refreshes(lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    let is_visible =
        |item: &Item, other: Option<Micros>| item.refresh.is_some() || other.is_some_and(|other| item.holds > other);
    for (old, new) in lanes.iter().flat_map(|lane| &lane.pairs) {
        let (from, to) = (old.refresh, new.refresh);
        let comparable = old.notation == new.notation || from.is_some() && to.is_some();
        if from != to && comparable && is_visible(old, to) && is_visible(new, from) {
            changes.push(Change::of(old, new, What::Refreshed { from, to }));
        }
    }
}

/// The bytes in total and in the busiest second.
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
        Change { robots: Vec::new(), at, aborts: false, old, new, what, more: None }
    }

    /// A change of a matched item, at its new time.
    fn of(old: &Item, new: &Item, what: What) -> Self {
        Change::new(new.at, Some(old.first), Some(new.first), what)
    }
}
