//! Frames grouped into what a script says: a command with its refreshes, a move with its steps.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::{Command, Kind, Moment, things};

/// Lanes behind those of the things that do one thing at a time.
pub(super) const SERVOS: usize = super::super::THINGS;
pub(super) const PID: usize = SERVOS + 1;
pub(super) const REQUESTS: usize = SERVOS + 2;
pub(super) const RAW: usize = SERVOS + 3;
pub(super) const LANES: usize = SERVOS + 4;

/// One command, or one move as far as it goes one way.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) lane: usize,
    pub(super) at_us: u64,
    /// Its first frame.
    pub(super) first: usize,
    /// The command; of a move the last one.
    pub(super) says: String,
    /// What the steps of a move are, in one number; 0 for a command.
    pub(super) steps: u64,
    /// How many steps it has, and how long they take.
    count: usize,
    pub(super) lasts_us: u64,
    /// The time between two refreshes, if there is any.
    pub(super) refresh: Option<u64>,
    /// Which way the values of a move go.
    way: Vec<i8>,
    last: Command,
}

impl Item {
    /// `servo 2 1700`, `servo 2 1700 (a move of 24 steps)`.
    pub(super) fn words(&self) -> String {
        match self.count {
            0 => self.says.clone(),
            1 => format!("{} (a move of 1 step)", self.says),
            count => format!("{} (a move of {count} steps)", self.says),
        }
    }
}

fn lane(command: &Command) -> usize {
    match command {
        Command::Servos { .. } => SERVOS,
        Command::Pid(..) => PID,
        Command::Request(_) => REQUESTS,
        Command::Raw { .. } => RAW,
        other => things(other).into_iter().flatten().next().unwrap_or(RAW),
    }
}

/// Groups frames. What is left of two neighbouring moves is where they turn.
pub(super) fn items(moments: &[Moment]) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    let mut newest: [Option<usize>; LANES] = [None; LANES];
    for (first, moment) in moments.iter().enumerate() {
        let lane = lane(&moment.command);
        let before = newest.get(lane).copied().flatten().and_then(|at| items.get_mut(at));
        let taken = match (moment.kind, before) {
            (Kind::Refresh, Some(item)) => {
                item.refresh.get_or_insert(moment.at_us - item.at_us - item.lasts_us);
                true
            }
            (Kind::Sample, Some(item)) => item.count > 0 && item.refresh.is_none() && extend(item, moment),
            _ => false,
        };
        if taken {
            continue;
        }
        let closing = if moment.kind == Kind::Closing { " (closing)" } else { "" };
        if let Some(newest) = newest.get_mut(lane) {
            *newest = Some(items.len());
        }
        items.push(Item {
            lane,
            at_us: moment.at_us,
            first,
            says: format!("{}{closing}", moment.command),
            steps: 0,
            count: usize::from(moment.kind == Kind::Sample),
            lasts_us: 0,
            refresh: None,
            way: Vec::new(),
            last: moment.command.clone(),
        });
    }
    items
}

/// Takes a further step into a move, if it goes on the same way.
fn extend(item: &mut Item, moment: &Moment) -> bool {
    let way = way(&item.last, &moment.command);
    if !item.way.is_empty() && item.way != way {
        return false;
    }
    let mut hasher = DefaultHasher::new();
    item.lasts_us = moment.at_us - item.at_us;
    (item.steps, item.lasts_us, &item.says).hash(&mut hasher);
    item.steps = hasher.finish();
    item.says = moment.command.to_string();
    item.count += 1;
    item.way = way;
    item.last = moment.command.clone();
    true
}

/// Which of the values rise and which fall.
fn way(from: &Command, to: &Command) -> Vec<i8> {
    let (from, to) = (from.to_string(), to.to_string());
    let number = |word: &str| word.rsplit('=').next().and_then(|number| number.parse::<i64>().ok());
    let values = from.split(' ').map(number).zip(to.split(' ').map(number));
    values.map(|(from, to)| if to > from { 1 } else { -i8::from(to < from) }).collect()
}
