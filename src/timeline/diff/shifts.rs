//! What has moved, and what says something else.

use super::{Change, Item, Lane, Shift, What, lane_name};

/// An item that is on both sides.
struct Pair<'i> {
    old: &'i Item,
    new: &'i Item,
    /// The place of the next one of the same lane.
    next: Option<usize>,
    /// Whether the one before it in its lane is another one, or goes somewhere else now, so that this one comes from elsewhere.
    comes_from_elsewhere: bool,
}

impl Pair<'_> {
    /// How much later it is, in microseconds.
    fn delta(&self) -> i64 {
        difference(self.old.at_us, self.new.at_us)
    }
}

fn difference(old: u64, new: u64) -> i64 {
    i64::try_from(new).unwrap_or(i64::MAX).saturating_sub_unsigned(old)
}

/// Goes through all items in the order of time, with what each lane has moved by so far.
pub(super) fn tell(lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    let pairs = merged(lanes);
    let mut shifted: Vec<i64> = vec![0; lanes.len()];
    // The newest change that made a move longer or shorter: which it is, when it ended, and by how much.
    let mut longer: Option<(usize, u64, i64)> = None;
    for (at, pair) in pairs.iter().enumerate() {
        let Pair { old, new, .. } = *pair;
        let total_us = pair.delta();
        let before = shifted.get(old.lane).copied().unwrap_or(0);
        let by = Shift { step_us: total_us - before, total_us };
        let next = pair.next.and_then(|next| pairs.get(next)).map(Pair::delta);
        let moved = total_us != before;
        let everything = moved && is_everything(&pairs, at, &shifted);
        // One that goes its own way while what follows goes on as before, or whose lane ends with it, has moved alone.
        let alone = moved && (next == Some(before) || next.is_none() && (!everything || at + 1 == pairs.len()));
        let by_us = if alone { by.step_us } else { 0 };
        let cause = longer.filter(|(_, end_us, by_us)| *end_us <= old.at_us && *by_us == by.step_us);
        let differs = old.says != new.says || old.moves != new.moves;
        if let (true, true, Some((change, ..))) = (moved, everything || alone && next.is_none(), cause) {
            // What made it later was said already.
            if let Some(Change { what: What::Changed { then, .. }, .. }) = changes.get_mut(change) {
                *then = Some(by);
            }
            (longer, shifted) = (None, vec![total_us; lanes.len()]);
        } else if moved && !alone {
            let things = if everything { Vec::new() } else { vec![lane_name(old.lane)] };
            changes.push(Change::new(old.at_us, Some(old.first), Some(new.first), What::Shifted { things, by }));
            if everything {
                shifted = vec![total_us; lanes.len()];
            } else if let Some(shifted) = shifted.get_mut(old.lane) {
                *shifted = total_us;
            }
        } else if alone && !differs {
            changes.push(Change::of(old, new, What::Moved { what: new.words(), by_us }));
        }
        if let Some(what) = differs.then(|| change(pair, by_us)).flatten() {
            let longer_by = difference(old.lasts_us(), new.lasts_us());
            if longer_by != 0 {
                longer = Some((changes.len(), old.at_us + old.lasts_us(), longer_by));
            }
            changes.push(Change::of(old, new, what));
        }
    }
}

/// The items of all lanes in the order of time; of those that start together, in that of sending.
fn merged<'i>(lanes: &[Lane<'i>]) -> Vec<Pair<'i>> {
    let mut pairs: Vec<Pair<'i>> = Vec::new();
    for lane in lanes {
        let mut last: Option<(&Item, &Item)> = None;
        for (old, new) in &lane.pairs {
            let followed = last.is_some_and(|(before, after)| {
                before.says == after.says && before.place + 1 == old.place && after.place + 1 == new.place
            });
            pairs.push(Pair {
                old,
                new,
                next: None,
                comes_from_elsewhere: !followed && (old.place, new.place) != (0, 0),
            });
            last = Some((old, new));
        }
    }
    pairs.sort_by_key(|pair| (pair.old.at_us, pair.old.first));
    let mut next = vec![None; lanes.len()];
    for (at, pair) in pairs.iter_mut().enumerate().rev() {
        pair.next = next.get_mut(pair.old.lane).and_then(|next| next.replace(at));
    }
    pairs
}

/// Whether everything moves with the item at `at`, until further notice: what comes next and has moved otherwise belongs to
/// no lane that stays as it was, and the lane of the item has left its time by then, too.
fn is_everything(pairs: &[Pair<'_>], at: usize, shifted: &[i64]) -> bool {
    let Some(pair) = pairs.get(at) else { return false };
    let by_us = pair.delta();
    let of_this_time = |other: &&Pair<'_>| other.old.at_us == pair.old.at_us;
    let mut beside = pairs.iter().take(at).rev().take_while(of_this_time);
    if beside.any(|other| other.delta() != by_us) {
        return false;
    }
    let Some((other_at, other)) = pairs.iter().enumerate().skip(at + 1).find(|(_, other)| other.delta() != by_us)
    else {
        return true;
    };
    let stays = shifted.get(other.old.lane) == Some(&other.delta());
    let mut follower = pair.next;
    while let Some(next) = follower.filter(|next| *next < other_at) {
        follower = pairs.get(next).and_then(|pair| pair.next);
    }
    !stays
        && !of_this_time(&other)
        && follower.and_then(|next| pairs.get(next)).is_none_or(|next| next.delta() != by_us)
}

/// What an item says that it did not say before; nothing where that only follows from the item before it.
fn change(pair: &Pair<'_>, by_us: i64) -> Option<What> {
    let Pair { old, new, comes_from_elsewhere, .. } = pair;
    let (from, to) = (old.parts(), new.parts());
    if from != to {
        return Some(What::Changed { from, to, by_us, then: None });
    }
    let (from, to) = (old.moves.as_ref()?, new.moves.as_ref()?);
    let follows = *comes_from_elsewhere && from.meant.is_some() && by_us == 0;
    (!follows).then(|| What::Steps { what: new.words(), from: from.steps, to: to.steps })
}
