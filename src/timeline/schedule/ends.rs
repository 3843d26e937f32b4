//! The ends of `for`s, and which of them are not sent.

use std::collections::BTreeMap;

use super::Origin;
use crate::board::{Board, Command};
use crate::program::{Action, Step, Time};
use crate::units::Micros;

/// The end of a `for`.
pub(super) struct End {
    pub(super) from: Origin,
    /// The exact time of the end.
    pub(super) at: Time,
    pub(super) command: Command,
}

/// Ends by time; at the same time, in script order.
pub(super) type Ends = BTreeMap<(Micros, u32), End>;

/// For each resource, the first two steps at one time that start something else for it.
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
                Action::Go(_) | Action::Say(_) | Action::Expect(_) | Action::Gate(_) => continue,
            };
            for resource in board.occupies(command) {
                if let Some([first, second]) = self.0.get_mut(*resource) {
                    *second = first.and(second.or(Some(step.order)));
                    first.get_or_insert(step.order);
                }
            }
        }
    }

    /// Whether the end of a `for` is not sent, because another command for the same resource starts
    /// at exactly that time. A move replaces it only with its first sample, and a raw frame is not
    /// interpreted, so both keep it.
    pub(super) fn supersede(&self, board: &Board, end: &End) -> bool {
        let mut starts = board.occupies(&end.command).iter().filter_map(|resource| self.0.get(*resource));
        starts.any(|starts| starts.iter().flatten().any(|order| *order != end.from.order))
    }
}
