//! Compares the robots of two scripts or snapshots, each with its namesake.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

use super::{Change, What, diff, diff_scripts};
use crate::timeline::{Snapshot, Timeline};
use crate::units::Micros;

/// Compares what all robots of two snapshots send, like [`diff`]. A robot that only one of the two has is one change. Equal changes of
/// several robots on one line are one change of these robots.
pub fn diff_all<L: Eq + Hash>(old: &[Snapshot], new: &[Snapshot], line: impl Fn(&Change) -> Option<L>) -> Vec<Change> {
    let of = |side: &[Snapshot]| side.iter().map(|snapshot| snapshot.robot.clone()).collect::<Vec<_>>();
    let find = |side, robot: &_| find(side, |snapshot: &Snapshot| snapshot.robot == *robot);
    let each = |robot: &_| Some(diff(find(old, robot)?, find(new, robot)?, &line));
    by_name([of(old), of(new)], each, &line)
}

/// Compares all robots of two scripts, as [`diff_all`] does, and like [`diff_scripts`].
pub fn diff_all_scripts<L: Eq + Hash>(
    old: &[Timeline],
    new: &[Timeline],
    line: impl Fn(&Change) -> Option<L>,
) -> Vec<Change> {
    let of = |side: &[Timeline]| side.iter().map(|timeline| timeline.robot.clone()).collect::<Vec<_>>();
    let find = |side, robot: &_| find(side, |timeline: &Timeline| timeline.robot == *robot);
    let each = |robot: &_| Some(diff_scripts(find(old, robot)?, find(new, robot)?, &line));
    by_name([of(old), of(new)], each, &line)
}

fn find<T>(side: &[T], is_it: impl Fn(&T) -> bool) -> Option<&T> {
    side.iter().find(|one| is_it(one))
}

/// The changes of all robots, in the order of time if there are several. `each` compares one robot of both sides.
fn by_name<L: Eq + Hash>(
    [old, new]: [Vec<Option<Arc<str>>>; 2],
    each: impl Fn(&Option<Arc<str>>) -> Option<Vec<Change>>,
    line: impl Fn(&Change) -> Option<L>,
) -> Vec<Change> {
    let alone = |robot: &Option<Arc<str>>, what| Change {
        robots: robot.iter().cloned().collect(),
        ..Change::new(Micros::ZERO, None, None, what)
    };
    let gone = old.iter().filter(|robot| !new.contains(robot)).map(|robot| alone(robot, What::RobotRemoved));
    let added = new.iter().filter(|robot| !old.contains(robot)).map(|robot| alone(robot, What::RobotAdded));
    let mut changes: Vec<Change> = gone.chain(added).collect();
    let mut known = HashMap::new();
    for change in new.iter().filter_map(each).flatten() {
        let key = (change.at, change.aborts, change.what.clone(), line(&change));
        let same = known.get(&key).and_then(|&at: &usize| changes.get_mut(at));
        let is_of_another = |same: &&mut Change| same.more == change.more && same.robots.last() != change.robots.last();
        match same.filter(is_of_another) {
            Some(same) => same.robots.extend(change.robots),
            None => {
                known.insert(key, changes.len());
                changes.push(change);
            }
        }
    }
    if new.len() > 1 {
        changes.sort_by_key(|change| (change.what.is_total(), change.aborts, change.at));
    }
    changes
}
