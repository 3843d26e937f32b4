//! What has changed between two timelines, in the words of the script: by time and thing, not line by line.
//!
//! Frames become items (a command with its refreshes, a move with its steps). The items of each thing are aligned by what they
//! say, so that a later time is no other command; then the times of what stands opposite each other are compared, and
//! what has moved together is said once.

use std::collections::HashMap;
use std::fmt;

use imara_diff::{Algorithm, Token};

use super::{Kind, Moment, thing_name, things};
use crate::board::Command;

mod items;

use items::{Item, LANES, items};

/// Everything that has changed. Empty where both are the same.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diff {
    /// Sorted by time.
    pub changes: Vec<Change>,
}

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
}

/// What has changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum What {
    /// From here on these things come later by so many microseconds than before; all things where none is named.
    Shifted {
        /// The things.
        things: Vec<String>,
        /// Microseconds; negative where they are earlier.
        by_us: i64,
    },
    /// One item says something else, and may have moved, too.
    Changed {
        /// What it said.
        from: String,
        /// What it says.
        to: String,
        /// By how many microseconds it has moved beside the others.
        by_us: i64,
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
    /// The drive is refreshed at another interval, in microseconds (`None`: not at all).
    Refreshed {
        /// Before.
        from_us: Option<u64>,
        /// Now.
        to_us: Option<u64>,
        /// For how many commands.
        commands: usize,
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

/// Compares two timelines.
pub fn diff(old: &[Moment], new: &[Moment]) -> Diff {
    if old == new {
        return Diff::default();
    }
    let (before, after) = (items(old), items(new));
    let mut changes = Vec::new();
    let mut lanes = Vec::new();
    let mut tokens = HashMap::new();
    for lane in 0..LANES {
        let (old, new) = (lane_of(&before, lane), lane_of(&after, lane));
        lanes.push(Lane { lane, pairs: align(&old, &new, &mut tokens, &mut changes) });
    }
    shifts(&lanes, &mut changes);
    refreshes(&lanes, &mut changes);
    if changes.is_empty() {
        let at = old.iter().zip(new).position(|(old, new)| old != new).unwrap_or(old.len().min(new.len()));
        let at_us = new.get(at).or(old.get(at)).map_or(0, |moment| moment.at_us);
        let there = |moments: &[Moment]| (at < moments.len()).then_some(at);
        changes.push(Change { at_us, old: there(old), new: there(new), what: What::Reordered });
    }
    changes.sort_by_key(|change| (change.at_us, change.new, change.old));
    totals(old, new, &mut changes);
    Diff { changes }
}

/// Items of one thing that stand opposite each other, in the order of time.
struct Lane<'i> {
    lane: usize,
    pairs: Vec<(&'i Item, &'i Item)>,
}

impl Lane<'_> {
    /// The place of the first pair at or behind a time.
    fn first_behind(&self, at_us: u64) -> usize {
        self.pairs.partition_point(|(old, _)| old.at_us < at_us)
    }
}

fn lane_of(items: &[Item], lane: usize) -> Vec<&Item> {
    items.iter().filter(|item| item.lane == lane).collect()
}

/// Aligns the items of one thing by what they say. What is only on one side is a change at once.
fn align<'i>(
    old: &[&'i Item],
    new: &[&'i Item],
    tokens: &mut HashMap<(&'i str, u64), u32>,
    changes: &mut Vec<Change>,
) -> Vec<(&'i Item, &'i Item)> {
    let mut token = |item: &&'i Item| {
        let next = u32::try_from(tokens.len()).unwrap_or(u32::MAX);
        Token(*tokens.entry((item.says.as_str(), item.steps)).or_insert(next))
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
        for item in gone.iter().skip(come.len()) {
            changes.push(Change {
                at_us: item.at_us,
                old: Some(item.first),
                new: None,
                what: What::Removed(item.words()),
            });
        }
        for item in come.iter().skip(gone.len()) {
            changes.push(Change {
                at_us: item.at_us,
                old: None,
                new: Some(item.first),
                what: What::Added(item.words()),
            });
        }
    }
    pairs.extend(slice(old, old_at, old.len()).iter().copied().zip(slice(new, new_at, new.len()).iter().copied()));
    pairs
}

fn slice<T>(all: &[T], from: usize, to: usize) -> &[T] {
    all.get(from..to).unwrap_or_default()
}

/// How much later the second is than the first.
fn delta((old, new): &(&Item, &Item)) -> i64 {
    i64::try_from(new.at_us).unwrap_or(i64::MAX).saturating_sub_unsigned(old.at_us)
}

/// From one item of a thing on all of them have moved by the same time.
struct Shift {
    lane: usize,
    /// Its place among the pairs of its lane, and how many pairs follow it.
    first: usize,
    count: usize,
    at_us: u64,
    by_us: i64,
}

/// Says what has moved, and what says something else.
fn shifts(lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    let mut shifts = Vec::new();
    for lane in lanes {
        lane_shifts(lane, &mut shifts, changes);
    }
    shifts.sort_by_key(|shift: &Shift| (shift.at_us, shift.lane));
    let mut told = vec![false; shifts.len()];
    let mut alike: HashMap<i64, Vec<usize>> = HashMap::new();
    for (at, shift) in shifts.iter().enumerate() {
        alike.entry(shift.by_us).or_default().push(at);
    }
    for at in 0..shifts.len() {
        let Some(shift) = shifts.get(at).filter(|_| !told.get(at).copied().unwrap_or(true)) else { continue };
        let together: Vec<usize> = alike.get(&shift.by_us).into_iter().flatten().copied().collect();
        let together: Vec<usize> = together
            .into_iter()
            .filter(|&other| {
                other >= at && shifts.get(other).is_some_and(|other| is_first_behind(lanes, other, shift.at_us))
            })
            .collect();
        let moves_too = |lane: &Lane<'_>| {
            lane.pairs.get(lane.first_behind(shift.at_us)).is_none_or(|pair| delta(pair) == shift.by_us)
        };
        let is_everything = lanes.iter().all(moves_too);
        let count: usize = together.iter().filter_map(|&other| shifts.get(other)).map(|shift| shift.count).sum();
        let members: Vec<usize> = if is_everything { together } else { vec![at] };
        for &member in &members {
            if let Some(told) = told.get_mut(member) {
                *told = true;
            }
        }
        let Some((old, new)) = lanes.get(shift.lane).and_then(|lane| lane.pairs.get(shift.first)) else { continue };
        let what = match (is_everything, if is_everything { count } else { shift.count }) {
            (_, 1) if old.says == new.says => What::Moved { what: new.words(), by_us: shift.by_us },
            (true, _) => What::Shifted { things: Vec::new(), by_us: shift.by_us },
            (false, _) => What::Shifted { things: vec![lane_name(shift.lane)], by_us: shift.by_us },
        };
        changes.push(Change { at_us: old.at_us, old: Some(old.first), new: Some(new.first), what });
    }
}

/// Whether a shift begins with the first item of its lane at or behind a time.
fn is_first_behind(lanes: &[Lane<'_>], shift: &Shift, at_us: u64) -> bool {
    let lane = lanes.iter().find(|lane| lane.lane == shift.lane);
    lane.is_some_and(|lane| lane.first_behind(at_us) == shift.first)
}

fn lane_shifts(lane: &Lane<'_>, shifts: &mut Vec<Shift>, changes: &mut Vec<Change>) {
    let deltas: Vec<i64> = lane.pairs.iter().map(delta).collect();
    let mut by_us = 0;
    for (at, (old, new)) in lane.pairs.iter().enumerate() {
        let own = deltas.get(at).copied().unwrap_or(0);
        // One that goes its own way while what follows goes on as before has moved alone.
        let alone = own != by_us && deltas.get(at + 1) == Some(&by_us);
        if own != by_us && !alone {
            by_us = own;
            shifts.push(Shift { lane: lane.lane, first: at, count: 0, at_us: old.at_us, by_us });
        }
        if let Some(shift) = shifts.last_mut().filter(|shift| shift.lane == lane.lane) {
            shift.count += 1;
        }
        let beside = if alone { own - by_us } else { 0 };
        let change = |what| Change { at_us: new.at_us, old: Some(old.first), new: Some(new.first), what };
        if old.says != new.says || old.steps != new.steps {
            changes.push(change(What::Changed { from: old.words(), to: new.words(), by_us: beside }));
        } else if alone {
            changes.push(change(What::Moved { what: new.words(), by_us: beside }));
        }
    }
}

/// Another interval of refreshes, summed up where it is the same for many commands.
fn refreshes(lanes: &[Lane<'_>], changes: &mut Vec<Change>) {
    type Interval = (Option<u64>, Option<u64>);
    let mut found: Vec<(Interval, usize, &Item, &Item)> = Vec::new();
    for (old, new) in lanes.iter().flat_map(|lane| &lane.pairs) {
        // A hold that is shorter than the interval tells nothing.
        let comparable = old.refresh.is_some() && new.refresh.is_some() || old.lasts_us == new.lasts_us;
        if old.refresh == new.refresh || !comparable {
            continue;
        }
        match found.iter_mut().find(|(interval, ..)| *interval == (old.refresh, new.refresh)) {
            Some((_, commands, ..)) => *commands += 1,
            None => found.push(((old.refresh, new.refresh), 1, old, new)),
        }
    }
    changes.extend(found.into_iter().map(|((from_us, to_us), commands, old, new)| Change {
        at_us: new.at_us,
        old: Some(old.first),
        new: Some(new.first),
        what: What::Refreshed { from_us, to_us, commands },
    }));
}

/// Length and load, last.
fn totals(old: &[Moment], new: &[Moment], changes: &mut Vec<Change>) {
    let end = |moments: &[Moment]| moments.last().map_or(0, |moment| moment.at_us);
    let (from_us, to_us) = (end(old), end(new));
    let total = |what| Change { at_us: to_us, old: None, new: None, what };
    if from_us != to_us {
        changes.push(total(What::Length { from_us, to_us }));
    }
    let (from, to) = (load(old), load(new));
    if from != to {
        changes.push(total(What::Load { from, to }));
    }
}

/// Bytes in all, and in the busiest second of the script.
fn load(moments: &[Moment]) -> (u64, u64) {
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
        items::SERVOS => "the servos together".into(),
        items::PID => "the gains".into(),
        items::REQUESTS => "the requests".into(),
        items::RAW => "the raw frames".into(),
        thing => thing_name(thing),
    }
}

impl Change {
    /// The change in words, with the place in the script where that is known.
    pub fn words(&self, place: Option<&str>) -> String {
        let place = place.map(|place| format!(" ({place})")).unwrap_or_default();
        let at = format!("at {}{place}: ", Secs(self.at_us));
        match &self.what {
            What::Shifted { things, by_us } if things.is_empty() => {
                format!("from {} on{place} everything is {}", Secs(self.at_us), Later(*by_us))
            }
            What::Shifted { things, by_us } => {
                format!("from {} on{place} {} is {}", Secs(self.at_us), things.join(", "), Later(*by_us))
            }
            What::Changed { from, to, by_us: 0 } => format!("{at}{}", between(from, to)),
            What::Changed { from, to, by_us } => format!("{at}{}, {}", between(from, to), Later(*by_us)),
            What::Moved { what, by_us } => format!("{at}{what} is {}", Later(*by_us)),
            What::Added(what) => format!("{at}{what} is new"),
            What::Removed(what) => format!("{at}{what} is gone"),
            What::Refreshed { from_us, to_us, commands } => {
                let interval = |us: &Option<u64>| us.map_or("not at all".into(), |us| format!("every {}", Span(us)));
                let more = if *commands > 1 { format!(", and so {commands} commands in all") } else { String::new() };
                format!("{at}refreshed {} -> {}{more}", interval(from_us), interval(to_us))
            }
            What::Reordered => format!("{at}the frames of this time are sent in another order"),
            What::Length { from_us, to_us } => format!("the last frame is at {} -> {}", Secs(*from_us), Secs(*to_us)),
            What::Load { from, to } => {
                let all = format!("on the wire: {} -> {} bytes", from.0, to.0);
                if from.1 == to.1 { all } else { format!("{all}, {} -> {} in the busiest second", from.1, to.1) }
            }
        }
    }
}

/// `servo 2 1500 -> 1600`: what is the same is said once.
fn between(from: &str, to: &str) -> String {
    if from == to {
        return format!("{to} goes there by other steps");
    }
    let (old, new): (Vec<&str>, Vec<&str>) = (from.split(' ').collect(), to.split(' ').collect());
    if old.len() != new.len() || old.first() != new.first() {
        return format!("{from} -> {to}");
    }
    let words =
        old.iter().zip(&new).map(|(old, new)| if old == new { (*old).to_owned() } else { format!("{old} -> {new}") });
    words.collect::<Vec<_>>().join(" ")
}

/// Seconds to the millisecond, or as exactly as they are.
struct Secs(u64);

impl fmt::Display for Secs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 % 1_000 {
            0 => write!(f, "{}.{:03} s", self.0 / 1_000_000, self.0 / 1_000 % 1_000),
            _ => write!(f, "{}.{:06} s", self.0 / 1_000_000, self.0 % 1_000_000),
        }
    }
}

/// A time that passes: microseconds, milliseconds or seconds.
struct Span(u64);

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            us if us % 1_000 != 0 && us < 1_000_000 => write!(f, "{us} us"),
            us if us < 1_000_000 => write!(f, "{} ms", us / 1_000),
            us => Secs(us).fmt(f),
        }
    }
}

/// `200 ms later`.
struct Later(i64);

impl fmt::Display for Later {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.0 < 0 { "earlier" } else { "later" };
        write!(f, "{} {word}", Span(self.0.unsigned_abs()))
    }
}
