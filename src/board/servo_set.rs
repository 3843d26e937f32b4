//! A set of servos.

/// A set of servos by their numbers, 0 to 255. Others are not added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoSet([u64; 4]);

impl ServoSet {
    /// The number of bytes of [`bytes`](Self::bytes).
    pub const BYTES: usize = 32;

    /// The place of a servo.
    fn place(servo: i32) -> Option<(usize, u64)> {
        let servo = u8::try_from(servo).ok()?;
        Some((usize::from(servo / 64), 1 << (servo % 64)))
    }

    /// Adds a servo, or removes it.
    pub fn set(&mut self, servo: i32, is_in: bool) {
        if let Some((word, bit)) = Self::place(servo)
            && let Some(word) = self.0.get_mut(word)
        {
            *word = if is_in { *word | bit } else { *word & !bit };
        }
    }

    /// Whether a servo is in the set.
    pub fn contains(&self, servo: i32) -> bool {
        Self::place(servo).is_some_and(|(word, bit)| self.0.get(word).is_some_and(|word| word & bit != 0))
    }

    /// The servos, from the lowest number.
    pub fn iter(&self) -> impl Iterator<Item = i32> {
        (0..=255).filter(|servo| self.contains(*servo))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0 == [0; 4]
    }

    /// As bytes, the lowest servo in the lowest bit of the first.
    pub fn bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let all = self.0.iter().flat_map(|word| word.to_le_bytes());
        bytes.iter_mut().zip(all).for_each(|(place, byte)| *place = byte);
        bytes
    }

    /// Reads bytes; missing ones are 0.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let mut set = ServoSet::default();
        for (word, bytes) in set.0.iter_mut().zip(bytes.chunks(8)) {
            *word = bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
        }
        set
    }
}

impl FromIterator<i32> for ServoSet {
    fn from_iter<I: IntoIterator<Item = i32>>(servos: I) -> Self {
        let mut set = ServoSet::default();
        servos.into_iter().for_each(|servo| set.set(servo, true));
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read_as_the_same_set() {
        let set: ServoSet = [0, 1, 63, 64, 200, 253, 255, 256, -1].into_iter().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 1, 63, 64, 200, 253, 255]);
        assert_eq!(ServoSet::from_bytes(&set.bytes()), set);
        assert_eq!(ServoSet::from_bytes(&[2]).iter().collect::<Vec<_>>(), [1]);
    }
}
