//! Finds sections that run faster or slower than before, such as after another tempo.
//!
//! Items are matched by content, and each matched time is an anchor. From one anchor to the next,
//! time is scaled, kept, or neither; of all ways from start to end, the one with the fewest
//! sections and exceptions is taken. The end of a command or a move that lasts as long as before
//! may be passed over: a beep of 60 ms stays one at every tempo. If it lasts longer than the pause
//! after it, it may not: then only the pauses are longer.

use std::collections::BTreeMap;

use super::Item;
use super::align::by_content;
use super::shifts::difference;
use crate::units::Micros;

/// A section of the old timeline.
#[derive(Clone, Copy)]
pub(super) struct Section {
    pub(super) from: Micros,
    /// Its end; `None` if nothing follows.
    pub(super) until: Option<Micros>,
    /// Its old and its new length.
    pub(super) lasts: [Micros; 2],
    /// The indices of the first frames of its first item.
    pub(super) first: Option<(usize, usize)>,
}

/// A time that is known on both sides.
#[derive(Clone, Copy)]
struct Anchor<'i> {
    old: Micros,
    new: Micros,
    /// The items, if one starts here.
    start: Option<(&'i Item, &'i Item)>,
    /// Whether it ends something that lasts as long as before.
    is_kept: bool,
}

/// The new and the old length of the same time.
#[derive(Clone, Copy)]
struct Ratio {
    new: u64,
    old: u64,
}

/// How much two lengths may differ because times are whole microseconds.
const ROUNDING_US: u64 = 2;
/// The shortest distance that shows a ratio.
const SHORTEST: Micros = Micros::from_millis(10);
/// How many ratios are tried.
const RATIOS: usize = 3;
/// How many anchors may be passed over.
const REACH: usize = 16;

impl Ratio {
    fn scaled(self, time: Micros) -> Micros {
        let product = u128::from(time.0) * u128::from(self.new) + u128::from(self.old) / 2;
        Micros(u64::try_from(product / u128::from(self.old.max(1))).unwrap_or(u64::MAX))
    }

    fn fits(self, old: Micros, new: Micros) -> bool {
        self.scaled(old).0.abs_diff(new.0) <= ROUNDING_US
    }
}

/// An explanation: the sections, and the old items at the times that they have then, so that only
/// other changes are left.
pub(super) type Explanation = (Vec<Section>, Vec<Item>);

/// Explains the new times by sections with one ratio, for each ratio that may be the right one.
pub(super) fn explanations(lanes: &[(Vec<&Item>, Vec<&Item>)], before: &[Item]) -> Vec<Explanation> {
    let by_lane: Vec<_> = lanes.iter().map(|(old, new)| anchors(&by_content(old, new))).collect();
    let ratios = ratios(&by_lane);
    let mut anchors: Vec<Anchor<'_>> = by_lane.into_iter().flatten().collect();
    anchors.sort_by_key(|anchor| (anchor.old, anchor.new));
    anchors.insert(0, Anchor { old: Micros::ZERO, new: Micros::ZERO, start: None, is_kept: false });
    ratios.into_iter().filter_map(|ratio| explain(&anchors, ratio, before)).collect()
}

fn explain(anchors: &[Anchor<'_>], ratio: Ratio, before: &[Item]) -> Option<Explanation> {
    let way = way(anchors, ratio);
    let end = anchors.last()?.old;
    let mut sections: Vec<Section> = Vec::new();
    for pair in way.windows(2) {
        let [(begin, _), (to, Gap::Scaled)] = pair else { continue };
        let (from, to) = (anchors.get(*begin)?, anchors.get(*to)?);
        let lasts = [to.old - from.old, to.new - from.new];
        match sections.last_mut() {
            Some(section) if section.until == Some(from.old) => {
                section.until = Some(to.old);
                section.lasts = [section.lasts[0] + lasts[0], section.lasts[1] + lasts[1]];
            }
            _ => {
                let starts = || anchors.iter().skip(*begin).filter_map(|anchor| anchor.start);
                let first = starts().find(|(old, _)| !old.is_note).or_else(|| starts().next());
                let first = first.map(|(old, new)| (old.first, new.first));
                sections.push(Section { from: from.old, until: Some(to.old), lasts, first });
            }
        }
    }
    // A move beside a section that lasts as long as before shows that not everything is scaled.
    let is_against = |(item, new): (&Item, &Item)| {
        let end = item.at + item.lasts();
        let crosses = |section: &Section| item.at < section.from && section.from < end || Some(end) > section.until;
        let next = sections.partition_point(|section| section.from < end).checked_sub(1);
        let beside = next.and_then(|at| sections.get(at)).filter(|section| section.until > Some(item.at));
        item.lasts() > SHORTEST && item.lasts() == new.lasts() && beside.is_some_and(crosses)
    };
    if anchors.iter().filter_map(|anchor| anchor.start).any(is_against) {
        return None;
    }
    let items = retimed(anchors, &way, (ratio, &sections), before);
    if let Some(last) = sections.last_mut().filter(|last| last.until == Some(end)) {
        last.until = None;
    }
    (!sections.is_empty()).then_some((sections, items))
}

/// The starts and ends of the items of a lane.
fn anchors<'i>(pairs: &[(&'i Item, &'i Item)]) -> Vec<Anchor<'i>> {
    let mut anchors: Vec<Anchor<'i>> = Vec::new();
    let mut add = |old: Micros, new: Micros, start: Option<(&'i Item, &'i Item)>| {
        let is_kept = anchors.last().is_some_and(|before: &Anchor<'_>| {
            let is_end = start.is_none() || before.start.is_some_and(|(item, _)| item.is_active);
            is_end && difference(before.old, before.new) == difference(old, new)
        });
        anchors.push(Anchor { old, new, start, is_kept });
    };
    for (old, new) in pairs {
        add(old.at, new.at, Some((*old, *new)));
        if let (lasts @ Micros(1..), is @ Micros(1..)) = (old.lasts(), new.lasts()) {
            add(old.at + lasts, new.at + is, None);
        }
    }
    for at in 1..anchors.len() {
        let beside = [at - 1, at, at + 1].map(|at| anchors.get(at).map(|anchor| anchor.old));
        if let ([Some(start), Some(end), Some(next)], Some(anchor)) = (beside, anchors.get_mut(at)) {
            anchor.is_kept &= end - start <= next - end;
        }
    }
    anchors
}

/// The most frequent ratios of distances, by the time for which they hold.
fn ratios(lanes: &[Vec<Anchor<'_>>]) -> Vec<Ratio> {
    let mut found: BTreeMap<u64, (u64, Ratio)> = BTreeMap::new();
    let steps = lanes.iter().flat_map(|lane| (1..=2).flat_map(|apart| lane.iter().zip(lane.iter().skip(apart))));
    for (from, to) in steps {
        let (old, new) = (to.old - from.old, to.new.saturating_sub(from.new));
        if old < SHORTEST || new < SHORTEST || old.0.abs_diff(new.0) <= ROUNDING_US {
            continue;
        }
        let ratio = Ratio { new: new.0, old: old.0 };
        let (weight, longest) = found.entry(ratio.scaled(Micros(1_000)).0).or_insert((0, ratio));
        *weight += old.0;
        if longest.old < old.0 {
            *longest = ratio;
        }
    }
    let mut found: Vec<(u64, Ratio)> = found.into_values().collect();
    found.sort_by_key(|(weight, _)| std::cmp::Reverse(*weight));
    found.into_iter().take(RATIOS).map(|(_, ratio)| ratio).collect()
}

/// What time does between two anchors.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Gap {
    Scaled,
    Kept,
    Other,
}

/// The anchors of the cheapest way, each with the gap before it.
fn way(anchors: &[Anchor<'_>], ratio: Ratio) -> Vec<(usize, Gap)> {
    /// The best way to an anchor: its cost, the anchor before, whether that is in a section, and
    /// the gap.
    type Best = (u32, usize, bool, Gap);
    // Outside of a section and inside.
    let mut best: Vec<[Option<Best>; 2]> = vec![[Some((0, 0, false, Gap::Kept)), None]];
    for (at, to) in anchors.iter().enumerate().skip(1) {
        let mut here: [Option<Best>; 2] = [None; 2];
        for (from_at, from) in anchors.iter().enumerate().take(at).rev().take(REACH) {
            let (old, new) = (to.old - from.old, difference(from.new, to.new));
            let new = u64::try_from(new).ok().map(Micros);
            let is_scaled = new.is_some_and(|new| ratio.fits(old, new));
            let is_kept = new.is_some_and(|new| old.0.abs_diff(new.0) <= ROUNDING_US);
            for (inside, was) in [false, true].into_iter().zip(best.get(from_at).copied().unwrap_or_default()) {
                let Some((cost, ..)) = was else { continue };
                // So short a distance that it is both stays in the section.
                let (gap, goes, more) = match (is_scaled, is_kept) {
                    (true, false) => (Gap::Scaled, true, u32::from(!inside)),
                    (true, true) if inside => (Gap::Scaled, true, 0),
                    (_, true) => (Gap::Kept, false, 0),
                    (false, false) => (Gap::Other, false, 1),
                };
                let [outside, within] = &mut here;
                let place = if goes { within } else { outside };
                if place.is_none_or(|(least, ..)| cost + more < least) {
                    *place = Some((cost + more, from_at, inside, gap));
                }
            }
            if !from.is_kept {
                break;
            }
        }
        best.push(here);
    }
    let mut way = Vec::new();
    let mut at = anchors.len() - 1;
    let get = |at: usize, inside: bool| {
        let [outside, within] = *best.get(at)?;
        if inside { within } else { outside }
    };
    let cost = |inside: bool| get(at, inside).map_or(u32::MAX, |(cost, ..)| cost);
    let mut inside = cost(true) < cost(false);
    while at > 0 {
        let Some((_, from, was, gap)) = get(at, inside) else { break };
        way.push((at, gap));
        (at, inside) = (from, was);
    }
    way.push((0, Gap::Kept));
    way.reverse();
    way
}

/// The old items at the times that they have if only the sections are scaled.
fn retimed(
    anchors: &[Anchor<'_>],
    way: &[(usize, Gap)],
    (ratio, sections): (Ratio, &[Section]),
    before: &[Item],
) -> Vec<Item> {
    // How far anchors have moved for other reasons, and how far sections have moved items.
    let mut other_us: i64 = 0;
    let mut matched: BTreeMap<usize, (Micros, &Item)> = BTreeMap::new();
    let mut moved: Vec<(Micros, i64)> = Vec::new();
    let mut last: Option<&Anchor<'_>> = None;
    let mut steps = way.iter().peekable();
    for (at, anchor) in anchors.iter().enumerate() {
        if let Some((_, gap)) = steps.next_if(|(next, _)| *next == at) {
            if let (Gap::Other, Some(last)) = (gap, last) {
                other_us += difference(last.old, last.new).saturating_neg() + difference(anchor.old, anchor.new);
            }
            last = Some(anchor);
        }
        let new = Micros(anchor.new.0.saturating_add_signed(other_us.saturating_neg()));
        moved.push((anchor.old, difference(anchor.old, new)));
        if let Some((old, item)) = anchor.start {
            matched.insert(old.first, (new, item));
        }
    }
    let mut items = before.to_vec();
    for item in &mut items {
        let section = sections.partition_point(|section| section.from <= item.at).checked_sub(1);
        let is_scaled = section.and_then(|at| sections.get(at)).is_some_and(|section| Some(item.at) < section.until);
        let before = moved.partition_point(|(from, _)| *from <= item.at).checked_sub(1);
        let by_us = before.and_then(|before| moved.get(before)).map_or(0, |(_, by_us)| *by_us);
        item.at = Micros(item.at.0.saturating_add_signed(by_us));
        let Some((at, new)) = matched.get(&item.first) else { continue };
        item.at = *at;
        if is_scaled {
            item.scale_like(new, |old, new| ratio.fits(old, new));
        }
    }
    items
}
