//! Joints: servos with a name, whose angles count from a zero of their own.

use crate::board::{Axis, Board, Limited, Measure, ResourceId, Unit, Verb, VerbId};
use crate::source::Span;

/// A servo with a name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joint {
    /// Its name.
    pub(super) name: String,
    /// The number of its robot.
    pub(super) robot: usize,
    /// Where the script defines it.
    pub(super) span: Span,
    /// The verb that moves it, its index, and the value that its angles are.
    pub(super) limited: Limited,
    /// What the verb sets.
    pub(super) resource: ResourceId,
    /// The value of 0°, as a script writes it.
    pub(super) zero: f64,
    /// Whether larger angles are smaller values.
    pub(super) is_reversed: bool,
    /// The smallest and the largest value, as values of the board.
    pub(super) range: Option<(f64, f64)>,
}

impl Joint {
    /// The value of an angle, as a script writes it; `None` if the unit has no angles.
    pub(super) fn value(&self, degrees: f64, unit: Unit) -> Option<f64> {
        let (values, width) = slope(unit)?;
        Some(self.zero + self.direction() * degrees * values / width)
    }

    /// The angle of a value; `None` if the unit has no angles.
    pub(super) fn degrees(&self, value: f64, unit: Unit) -> Option<f64> {
        let (values, width) = slope(unit)?;
        Some(self.direction() * (value - self.zero) * width / values)
    }

    /// The angles of two values, the smaller angle first.
    pub(super) fn angles(&self, least: f64, most: f64, unit: Unit) -> Option<(f64, f64)> {
        let (a, b) = (self.degrees(least, unit)?, self.degrees(most, unit)?);
        Some((a.min(b), a.max(b)))
    }

    fn direction(&self) -> f64 {
        if self.is_reversed { -1.0 } else { 1.0 }
    }

    /// A command with it, for messages.
    pub(super) fn example(&self, board: &Board) -> String {
        let value = board.axis(self.limited).map_or_else(String::new, |axis| match slope(axis.unit) {
            Some(_) => " 0deg".to_owned(),
            None => format!(" {}", self.zero),
        });
        format!("{} {}{value}", board.verb(self.limited.verb).map_or("", |verb| &verb.word), self.name)
    }

    /// Whether its name may be written as the index of a verb: of its own, of one that sets the same, and of one that does not
    /// move and whose index means the same, such as one that sets the torque.
    pub(super) fn fits(&self, board: &Board, id: VerbId, verb: &Verb) -> bool {
        let Some(own) = board.verb(self.limited.verb) else { return false };
        let is_same_index = match (own.axes.first(), verb.axes.first()) {
            (Some(own), Some(other)) => own.what == other.what && own.range == other.range,
            _ => false,
        };
        own.word == verb.word
            || board.occupied(id, self.limited.index).contains(&self.resource)
            || !verb.moves && is_same_index
    }
}

/// How far values, as a script writes them, differ for angles that differ by how many degrees; `None` if the unit has no
/// angles.
pub(super) fn slope(unit: Unit) -> Option<(f64, f64)> {
    match (unit.angle, unit.measure) {
        (Some(scale), _) => Some((scale.values.1 - scale.values.0, scale.degrees.1 - scale.degrees.0)),
        (None, Measure::Degrees) => Some((1.0, 1.0)),
        (None, _) => None,
    }
}

/// The zero of a joint that has no `zero`, as a script writes it: the value of 0° of the board, or the middle of its values if
/// 0° is not between them.
pub(super) fn usual_zero(axis: &Axis) -> f64 {
    let (least, most) = (axis.shown(axis.range.0), axis.shown(axis.range.1));
    let scale = axis.unit.angle;
    let (degrees, values) = scale.map_or(((least, most), (least, most)), |scale| (scale.degrees, scale.values));
    let has_zero = scale.is_some() || axis.unit.measure == Measure::Degrees;
    if has_zero && degrees.0 < 0.0 && 0.0 < degrees.1 {
        values.0 - degrees.0 * (values.1 - values.0) / (degrees.1 - degrees.0)
    } else {
        f64::midpoint(values.0, values.1)
    }
}
