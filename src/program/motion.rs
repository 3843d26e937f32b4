//! Commands that may go somewhere over a time: which values they have, and the frame for each set of values.

use smallvec::SmallVec;

use super::ease::Ease;
use super::time::Time;
use super::value::round;
use crate::board::{Axis, Board, Command, MAX_MOVING, Values, VerbId};

/// One value of such a command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Glide {
    /// Where it starts, if the script has `A -> B`. Both are values of the board, not rounded.
    pub from: Option<f64>,
    /// Where it goes. In range when rounded.
    pub to: f64,
}

/// A command with its values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motion {
    /// Which command.
    pub verb: VerbId,
    /// Its index, if it has one.
    pub index: Option<i32>,
    /// Its values; most moves are those of one servo, and there may be a million.
    glides: SmallVec<[Glide; 1]>,
}

/// A command that goes somewhere over a time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Move {
    /// The command and its values.
    pub motion: Motion,
    /// How long it takes; above zero.
    pub over: Time,
    /// How it gets there.
    pub ease: Ease,
}

impl Motion {
    /// A command with these values.
    pub(super) fn new(verb: VerbId, index: Option<i32>, glides: SmallVec<[Glide; 1]>) -> Self {
        Motion { verb, index, glides }
    }

    /// Its values, without the index.
    pub(crate) fn values(&self) -> &[Glide] {
        &self.glides
    }

    /// What one of its values is called, without an article.
    pub(crate) fn name(&self, board: &Board, at: usize) -> String {
        let what = self.axis(board, at).map_or("value", |axis| &axis.what);
        what.strip_prefix("a ").or(what.strip_prefix("the ")).unwrap_or(what).to_owned()
    }

    /// A value of the board as a script writes it.
    pub(crate) fn shown(&self, board: &Board, at: usize, value: f64) -> f64 {
        value / f64::from(self.axis(board, at).map_or(1, |axis| axis.scale))
    }

    fn axis<'b>(&self, board: &'b Board, at: usize) -> Option<&'b Axis> {
        board.verb(self.verb)?.moving().get(at)
    }

    /// The command with other values, rounded; the index of the first one that is out of range where there is one.
    pub(crate) fn command(&self, board: &Board, values: &[f64]) -> Result<Command, usize> {
        let mut whole: Values = self.index.into_iter().collect();
        for (at, value) in values.iter().enumerate() {
            let range = self.axis(board, at).map(|axis| axis.range).ok_or(at)?;
            let value = round(*value).filter(|value| (range.0..=range.1).contains(value));
            whole.push(value.ok_or(at)?);
        }
        Ok(Command::new(self.verb, &whole))
    }

    /// The command as a script says it, with a start before each value; one that is not known is taken for a usual one.
    pub(crate) fn with_starts(&self, board: &Board) -> String {
        let usual = |axis: &Axis, to: f64| {
            let (least, most) = (axis.shown(axis.range.0), axis.shown(axis.range.1));
            if least <= 0.0 && most >= 0.0 {
                return axis.unit.angle.and_then(|scale| scale.value(0.0)).map_or(0.0, libm::round);
            }
            let (from, until) = axis.unit.angle.map_or((least, most), |scale| scale.values);
            let far = if to < f64::midpoint(from, until) { 0.75 } else { 0.25 };
            libm::round(from + (until - from) * far).clamp(least, most)
        };
        let value = |(at, glide): (usize, &Glide)| {
            let axis = self.axis(board, at);
            let shown = |value: f64| self.shown(board, at, value);
            let to = shown(libm::round(glide.to));
            let from = glide.from.map_or_else(|| axis.map_or(0.0, |axis| usual(axis, to)), shown);
            let name = axis.map(|axis| &axis.name).filter(|name| !name.is_empty());
            let name = name.map(|name| format!("{name}=")).unwrap_or_default();
            format!(" {name}{from} -> {to}")
        };
        let word = board.verb(self.verb).map(|verb| verb.word.to_string()).unwrap_or_default();
        let index = self.index.map(|index| format!(" {index}")).unwrap_or_default();
        std::iter::once(word + &index).chain(self.values().iter().enumerate().map(value)).collect()
    }

    /// Whether any value says where it starts.
    pub(crate) fn has_start(&self) -> bool {
        self.values().iter().any(|glide| glide.from.is_some())
    }

    /// The command that it arrives at.
    pub(crate) fn target(&self, board: &Board) -> Option<Command> {
        let targets: SmallVec<[f64; MAX_MOVING]> = self.glides.iter().map(|glide| glide.to).collect();
        self.command(board, &targets).ok()
    }
}
