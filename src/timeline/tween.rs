//! The moves of a timeline: which steps belong together, and what the script asked for.

use super::Kind;
use crate::board::{Board, Command};
use crate::program::Ease;
use crate::units::Micros;

/// One scheduled move. Its steps are frames of kind [`Kind::Sample`]. Steps that would change
/// nothing are not sent, and a move without steps is not recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tween {
    /// Its start, from the start of the script. Its first step may be later.
    pub at: Micros,
    /// Its end.
    pub end: Micros,
    /// Its easing.
    pub ease: Ease,
    /// The number of its steps, at least 1.
    pub steps: usize,
}

/// Assigns steps to moves, frame by frame. A resource does one thing at a time, so the steps of a
/// lane belong to its moves in order.
pub(crate) struct MoveTracker<'t> {
    next: std::slice::Iter<'t, Tween>,
    /// For each lane, the remaining steps of its move.
    left: Vec<usize>,
    board: &'t Board,
}

/// The role of a frame in its move.
pub(crate) enum StepRole<'t> {
    /// The frame is not a step.
    None,
    /// The first step of a move.
    First(&'t Tween),
    /// A later step of the move of its lane.
    Further,
    /// A step whose move is missing.
    Stray,
}

impl<'t> MoveTracker<'t> {
    pub(crate) fn new(board: &'t Board, tweens: &'t [Tween]) -> Self {
        MoveTracker { next: tweens.iter(), left: vec![0; board.lanes()], board }
    }

    /// Whether all steps of all moves were seen.
    pub(crate) fn is_complete(&self) -> bool {
        self.next.len() == 0 && self.left.iter().all(|left| *left == 0)
    }

    /// Returns the role of the next frame.
    pub(crate) fn take(&mut self, command: &Command, kind: Kind) -> StepRole<'t> {
        if kind != Kind::Sample {
            return StepRole::None;
        }
        let Some(left) = self.left.get_mut(self.board.lane(command)) else {
            return StepRole::None;
        };
        if let Some(fewer) = left.checked_sub(1) {
            *left = fewer;
            return StepRole::Further;
        }
        match self.next.next() {
            Some(tween) => {
                *left = tween.steps.saturating_sub(1);
                StepRole::First(tween)
            }
            None => StepRole::Stray,
        }
    }
}
