//! The ends of `for`s, and which of them are left out.

use std::cmp::Ordering;

use super::Origin;
use crate::board::{Board, Command};
use crate::program::{Action, Step, Time};
use crate::units::Micros;

/// The end of a `for`. Ends are sorted by time, and at one time in script order.
pub(super) struct End {
    pub(super) due: Micros,
    pub(super) from: Origin,
    /// The exact time.
    pub(super) at: Time,
    pub(super) command: Command,
}

impl End {
    fn key(&self) -> (Micros, u32) {
        (self.due, self.from.order)
    }
}

impl PartialEq for End {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for End {}

impl PartialOrd for End {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for End {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key().cmp(&other.key())
    }
}

/// Of each resource, the first two steps of one moment that start something else for it.
#[derive(Default)]
pub(super) struct Starts(Vec<[Option<u32>; 2]>);

impl Starts {
    pub(super) fn read(&mut self, board: &Board, group: &[Step]) {
        self.0.clear();
        self.0.resize(board.resources.len(), [None; 2]);
        for step in group {
            let command = match &step.action {
                Action::Send(command) => command,
                Action::Hold(held) => &held.0,
                Action::Go(_) | Action::Say(_) | Action::Expect(_) => continue,
            };
            for resource in board.occupies(command) {
                if let Some([first, second]) = self.0.get_mut(*resource) {
                    *second = first.and(second.or(Some(step.order)));
                    first.get_or_insert(step.order);
                }
            }
        }
    }

    /// Whether the end of a `for` is left out, because another command for the same resource starts at that very moment. A move
    /// replaces it only with its first sample, and a raw frame is not interpreted, so both leave it in.
    pub(super) fn supersede(&self, board: &Board, end: &End) -> bool {
        let mut starts = board.occupies(&end.command).iter().filter_map(|resource| self.0.get(*resource));
        starts.any(|starts| starts.iter().flatten().any(|order| *order != end.from.order))
    }
}
