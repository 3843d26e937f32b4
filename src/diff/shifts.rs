//! Finds items that have moved or changed.

use super::items::lane_name;
use super::words::span;
use super::{Change, Item, Lane, Shift, What};
use crate::board::Board;
use crate::units::Micros;

/// A matched item.
struct Pair<'i> {
    old: &'i Item,
    new: &'i Item,
    /// The index of the next one in the same lane.
    next: Option<usize>,
    /// Whether the previous item of its lane differs, so that a move starts from another value.
    comes_from_elsewhere: bool,
}

impl Pair<'_> {
    /// The shift in microseconds.
    fn delta(&self) -> i64 {
        difference(self.old.at, self.new.at)
    }
}

/// The shift from `old` to `new` in microseconds.
pub(super) fn difference(old: Micros, new: Micros) -> i64 {
    i64::try_from(new.0).unwrap_or(i64::MAX).saturating_sub_unsigned(old.0)
}

/// The items of all lanes in the order of time, and how far they have been compared.
struct Scan<'i> {
    pairs: Vec<Pair<'i>>,
    /// The indices of each lane's items.
    lanes: Vec<Vec<usize>>,
    /// For each lane, the index of the next item.
    heads: Vec<Option<usize>>,
    /// The shift of each lane so far, in microseconds.
    shifted: Vec<i64>,
}

/// A move with a new duration.
struct Longer {
    /// The index of its change.
    change: usize,
    lane: usize,
    end: Micros,
    by_us: i64,
}

/// The last item of a lane that was compared.
#[derive(Clone, Copy)]
struct Before {
    /// The index of its pair.
    pair: usize,
    /// The index of its change, if its content has changed.
    change: Option<usize>,
}

/// Compares all items in the order of time.
pub(super) fn find_changes(board: &Board, lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    let mut scan = Scan::new(lanes);
    // For each lane, the last move with a new duration.
    let mut longer: Vec<Option<Longer>> = lanes.iter().map(|_| None).collect();
    let mut before: Vec<Option<Before>> = vec![None; lanes.len()];
    for at in 0..scan.pairs.len() {
        let Some(&Pair { old, new, next, .. }) = scan.pairs.get(at) else { continue };
        let total_us = difference(old.at, new.at);
        let step_us = total_us - scan.shifted(old.lane);
        if let Some(head) = scan.heads.get_mut(old.lane) {
            *head = next;
        }
        let moved = step_us != 0;
        let everything = moved && scan.is_everything(at);
        // An item has moved alone if the items after it stay where they were, or if it is the last
        // of its lane.
        let follower = next.and_then(|next| scan.pairs.get(next)).map(Pair::delta);
        let is_last = at + 1 == scan.pairs.len();
        let alone = moved && (follower == Some(total_us - step_us) || follower.is_none() && (!everything || is_last));
        let by = Shift { step_us, total_us };
        let is_reason = everything && difference(old.pause, new.pause) == step_us;
        let pause = is_reason.then_some([old.pause, new.pause]);
        let differs = old.notation != new.notation || old.moves != new.moves;
        let by_us = alone.then_some(total_us);
        let what = scan.pairs.get(at).filter(|_| differs).and_then(|pair| change(pair, by_us));
        let is_cause =
            |cause: &&Longer| cause.end <= old.at && cause.by_us == step_us && (everything || cause.lane == old.lane);
        let cause = longer.iter().flatten().find(is_cause).filter(|_| moved && (!alone || follower.is_none()));
        let cause = cause.and_then(|cause| changes.get_mut(cause.change));
        if let Some(Change { what: What::Changed { then, .. }, .. }) = cause {
            // The cause of the shift was already reported.
            *then = Some(((!everything).then(|| lane_name(board, old.lane)), by));
            scan.shift(total_us, old.lane, everything);
        } else if let Some(held) = before.get(old.lane).copied().flatten().filter(|_| moved && what.is_none())
            && let Some(mut change) = scan.held(held.pair, at)
        {
            // The item ends a command that lasts longer or shorter.
            if let What::Changed { then, .. } = &mut change.what {
                *then = (!alone).then(|| ((!everything).then(|| lane_name(board, old.lane)), by));
            }
            lasts_longer(change, held.change, changes);
            if !alone {
                scan.shift(total_us, old.lane, everything);
            }
        } else if moved && (!alone || is_last && what.is_none() && pause.is_some()) {
            let things = if everything { Vec::new() } else { vec![lane_name(board, old.lane)] };
            changes.push(Change::new(old.shown, Some(old.first), Some(new.first), What::Shifted { things, by, pause }));
            scan.shift(total_us, old.lane, everything);
        } else if alone && !matches!(what, Some(What::Changed { .. })) {
            changes.push(Change::of(old, new, What::Moved { what: new.words(), by_us: total_us }));
        }
        if let Some(before) = before.get_mut(old.lane) {
            let is_changed = matches!(what, Some(What::Changed { .. }));
            *before = Some(Before { pair: at, change: is_changed.then_some(changes.len()) });
        }
        let Some(what) = what else { continue };
        let longer_by = difference(old.lasts(), new.lasts());
        if let Some(longer) = longer.get_mut(old.lane).filter(|_| longer_by != 0) {
            let end = old.at + old.lasts();
            *longer = Some(Longer { change: changes.len(), lane: old.lane, end, by_us: longer_by });
        }
        changes.push(Change::of(old, new, what));
    }
}

/// Adds a new duration to the change of a command, if its content has changed as well.
fn lasts_longer(change: Change, known: Option<usize>, changes: &mut Vec<Change>) {
    let known = known.and_then(|known| changes.get_mut(known)).map(|known| &mut known.what);
    if let (Some(What::Changed { from, to, then, .. }), What::Changed { from: old, to: new, then: followers, .. }) =
        (known, &change.what)
    {
        from.extend(old.last().cloned());
        to.extend(new.last().cloned());
        then.clone_from(followers);
    } else {
        changes.push(change);
    }
}

impl<'i> Scan<'i> {
    /// Sorts the items of all lanes by time, and at the same time in the order of sending.
    fn new(lanes: &[Lane<'i>]) -> Self {
        let mut pairs: Vec<Pair<'i>> = Vec::new();
        for lane in lanes {
            let mut last: Option<(&Item, &Item)> = None;
            for (old, new) in &lane.pairs {
                let followed = last.is_some_and(|(before, after)| {
                    before.notation == after.notation && before.place + 1 == old.place && after.place + 1 == new.place
                });
                let comes_from_elsewhere = !followed && (old.place, new.place) != (0, 0);
                pairs.push(Pair { old, new, next: None, comes_from_elsewhere });
                last = Some((old, new));
            }
        }
        pairs.sort_by_key(|pair| (pair.old.at, pair.old.first));
        let mut heads = vec![None; lanes.len()];
        let mut places = vec![Vec::new(); lanes.len()];
        for (at, pair) in pairs.iter_mut().enumerate().rev() {
            pair.next = heads.get_mut(pair.old.lane).and_then(|head: &mut Option<usize>| head.replace(at));
        }
        for (at, pair) in pairs.iter().enumerate() {
            if let Some(places) = places.get_mut(pair.old.lane) {
                places.push(at);
            }
        }
        Scan { pairs, lanes: places, heads, shifted: vec![0; lanes.len()] }
    }

    fn shifted(&self, lane: usize) -> i64 {
        self.shifted.get(lane).copied().unwrap_or(0)
    }

    fn shift(&mut self, by_us: i64, lane: usize, everything: bool) {
        for (other, shifted) in self.shifted.iter_mut().enumerate() {
            if everything || other == lane {
                *shifted = by_us;
            }
        }
    }

    /// The change of an active command that the next item of its lane ends, if only its end has
    /// moved.
    fn held(&self, before: usize, at: usize) -> Option<Change> {
        let (held, end) = (self.pairs.get(before)?, self.pairs.get(at)?);
        let follows = |before: &Item, item: &Item| before.is_active && before.place + 1 == item.place;
        let is_held = follows(held.old, end.old) && follows(held.new, end.new);
        if !is_held || held.delta() != self.shifted(held.old.lane) {
            return None;
        }
        let parts = |item: &Item, end: &Item| {
            let mut parts = item.parts();
            parts.push(format!("for {}", span(end.shown.saturating_sub(item.shown))));
            parts
        };
        let (from, to) = (parts(held.old, end.old), parts(held.new, end.new));
        Some(Change::of(held.old, held.new, What::Changed { from, to, by_us: None, then: None }))
    }

    /// Whether everything moves with the item at `at`: in every other lane, the next item has the
    /// same shift as this one or, if it is later, the shift that this lane has by then.
    fn is_everything(&self, at: usize) -> bool {
        let Some(Pair { old: item, .. }) = self.pairs.get(at) else { return false };
        let by_us = self.pairs.get(at).map_or(0, Pair::delta);
        let mut beside = self.pairs.iter().take(at).rev().take_while(|other| other.old.at == item.at);
        if beside.any(|other| other.delta() != by_us) {
            return false;
        }
        // A move that has already begun and continues.
        let others = self.heads.iter().enumerate().filter(|(lane, _)| *lane != item.lane);
        let mut running = others.clone().filter_map(|(lane, _)| self.last_until(lane, item.at));
        let end = |item: &Item| item.at + item.lasts();
        if running.any(|last| end(last.old) > item.at && difference(end(last.old), end(last.new)) != by_us) {
            return false;
        }
        let next = others.filter_map(|(lane, head)| Some((lane, self.pairs.get((*head)?)?)));
        next.into_iter().all(|(lane, next)| {
            let stays = self.shifted(lane) == next.delta();
            let agrees = next.delta() == by_us
                || next.old.at > item.at && self.around(item.lane, next.old.at).contains(&Some(next.delta()));
            agrees && !stays
        })
    }

    /// The last item of a lane that starts at or before a time.
    fn last_until(&self, lane: usize, at: Micros) -> Option<&Pair<'i>> {
        let places = self.lanes.get(lane)?;
        let until = places.partition_point(|place| self.pairs.get(*place).is_some_and(|pair| pair.old.at <= at));
        self.pairs.get(*places.get(until.checked_sub(1)?)?)
    }

    /// The shifts of a lane just before and just after a time.
    fn around(&self, lane: usize, at: Micros) -> [Option<i64>; 2] {
        let places = self.lanes.get(lane).map(Vec::as_slice).unwrap_or_default();
        let delta = |place: Option<&usize>| place.and_then(|&place| self.pairs.get(place)).map(Pair::delta);
        let time = |place: &usize| self.pairs.get(*place).map_or(Micros::ZERO, |pair| pair.old.at);
        let from = places.partition_point(|place| time(place) < at);
        [self.last_until(lane, at).map(Pair::delta), delta(places.get(from))]
    }
}

/// The change of an item; none if it only follows from the previous item.
fn change(pair: &Pair<'_>, by_us: Option<i64>) -> Option<What> {
    let Pair { old, new, comes_from_elsewhere, .. } = pair;
    let (from, to) = (old.parts(), new.parts());
    if from != to && old.is_gate {
        return Some(What::Gate { from: old.notation.clone(), to: new.notation.clone() });
    }
    if from != to {
        return Some(What::Changed { from, to, by_us, then: None });
    }
    let (from, to) = (old.moves.as_ref()?, new.moves.as_ref()?);
    let follows = *comes_from_elsewhere && from.meant.is_some();
    (!follows).then(|| What::Steps { what: new.words(), from: from.steps, to: to.steps })
}
