//! A command: a verb of a board with its values.

use smallvec::SmallVec;

/// The most values that can move together in one command, and that one line of a recording can
/// hold.
pub const MAX_MOVING: usize = 4;

/// The row of a verb in the table of its board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VerbId(pub u8);

impl VerbId {
    /// The row in [`Board::verbs`](super::Board::verbs).
    pub fn row(self) -> usize {
        usize::from(self.0)
    }
}

/// The values of a command, in the order of its axes.
pub type Values = SmallVec<[i32; MAX_MOVING]>;

/// A command to a board: a verb and its values. [`Board::command`](super::Board::command) has
/// checked the ranges. A command has a meaning only together with its board.
///
/// A script can have millions of commands, so each takes two words: up to four values of three
/// bytes, or a pointer to more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Command(Packed);

/// Every command that fits is [`Packed::Few`], so that equal commands compare equal.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Packed {
    Few { verb: VerbId, count: u8, values: [[u8; 3]; MAX_MOVING] },
    Many { verb: VerbId, values: Box<Box<[i32]>> },
}

impl Command {
    /// Makes a command. The caller has checked the number of values and their ranges.
    pub(crate) fn new(verb: VerbId, values: &[i32]) -> Self {
        let mut few = [[0; 3]; MAX_MOVING];
        let fits = values.len() <= MAX_MOVING && few.iter_mut().zip(values).all(|(place, value)| pack(*value, place));
        Command(match u8::try_from(values.len()) {
            Ok(count) if fits => Packed::Few { verb, count, values: few },
            _ => Packed::Many { verb, values: Box::new(values.into()) },
        })
    }

    /// The verb.
    pub fn verb(&self) -> VerbId {
        match &self.0 {
            Packed::Few { verb, .. } | Packed::Many { verb, .. } => *verb,
        }
    }

    /// All values, an index first.
    pub fn values(&self) -> Values {
        match &self.0 {
            Packed::Few { count, values, .. } => {
                let [a, b, c, d] = values;
                Values::from_buf_and_len([a, b, c, d].map(unpack), usize::from(*count))
            }
            Packed::Many { values, .. } => Values::from_slice(values),
        }
    }

    /// The number of values.
    pub fn len(&self) -> usize {
        match &self.0 {
            Packed::Few { count, .. } => usize::from(*count),
            Packed::Many { values, .. } => values.len(),
        }
    }

    /// Whether the command has no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value at a position; `None` beyond the last one.
    pub fn value(&self, at: usize) -> Option<i32> {
        match &self.0 {
            Packed::Few { count, values, .. } => values.get(at).filter(|_| at < usize::from(*count)).map(unpack),
            Packed::Many { values, .. } => values.get(at).copied(),
        }
    }

    /// Whether all values are zero.
    pub fn is_zero(&self) -> bool {
        match &self.0 {
            Packed::Few { values, .. } => *values == [[0; 3]; MAX_MOVING],
            Packed::Many { values, .. } => values.iter().all(|value| *value == 0),
        }
    }
}

/// Packs a value into three bytes; `false` if it does not fit.
fn pack(value: i32, place: &mut [u8; 3]) -> bool {
    let [low, middle, high, _] = value.to_le_bytes();
    *place = [low, middle, high];
    unpack(place) == value
}

fn unpack([low, middle, high]: &[u8; 3]) -> i32 {
    // The shift extends the sign of the highest byte.
    i32::from_le_bytes([0, *low, *middle, *high]) >> 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_any_size_and_number_are_kept_exactly() {
        for values in [&[][..], &[0], &[-1, 8_388_607], &[1, 2, 3, -8_388_608], &[8_388_608], &[i32::MIN, i32::MAX]] {
            assert_eq!(Command::new(VerbId(3), values).values().as_slice(), values);
        }
        let many = [7; 9];
        assert_eq!(Command::new(VerbId(3), &many).value(8), Some(7));
        assert_eq!(Command::new(VerbId(3), &many).value(9), None);
    }

    #[test]
    fn a_command_is_two_words() {
        assert_eq!(size_of::<Command>(), 16);
    }
}
