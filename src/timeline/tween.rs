//! The moves of a timeline: which steps belong together, and how they were meant.

use super::Kind;
use crate::board::{Board, Command};
use crate::program::Ease;
use crate::units::Micros;

/// One move, as it was laid. Its steps are frames of kind [`Kind::Sample`]; those that would change nothing are left out, and
/// a move without any step leaves no trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tween {
    /// When it starts, from the start of the script. Its first step may be later.
    pub at: Micros,
    /// When it arrives.
    pub end: Micros,
    /// How it gets there.
    pub ease: Ease,
    /// How many steps it has, at least 1.
    pub steps: usize,
}

/// Gives each step its move, frame by frame: a thing does one thing at a time, so the steps of a lane belong to its moves
/// in their order.
pub(crate) struct MoveTracker<'t> {
    next: std::slice::Iter<'t, Tween>,
    /// Of each lane, how many steps of its move are still to come.
    left: Vec<usize>,
    board: &'t Board,
}

/// What a frame is to the moves.
pub(crate) enum StepRole<'t> {
    /// No step.
    None,
    /// The first step of this move.
    First(&'t Tween),
    /// A further step of the move of its lane.
    Further,
    /// A step of a move that is not there.
    Stray,
}

impl<'t> MoveTracker<'t> {
    pub(crate) fn new(board: &'t Board, tweens: &'t [Tween]) -> Self {
        MoveTracker { next: tweens.iter(), left: vec![0; board.lanes()], board }
    }

    /// Whether every move was taken whole.
    pub(crate) fn is_complete(&self) -> bool {
        self.next.len() == 0 && self.left.iter().all(|left| *left == 0)
    }

    /// Takes the next frame.
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
