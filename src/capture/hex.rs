//! Bytes written as hex digits.

/// Turns hex digits into bytes, block by block. Blanks and line ends may stand anywhere between digits.
#[derive(Debug, Default)]
pub(super) struct Hex {
    /// The first digit of a byte that is not whole.
    half: Option<u8>,
    strangers: u64,
}

impl Hex {
    /// Whether a stream that begins with this block is hex: no frame consists of such characters alone.
    pub(super) fn of(block: &[u8]) -> Option<Self> {
        let is_hex = |byte: &u8| byte.is_ascii_hexdigit() || byte.is_ascii_whitespace();
        block.iter().all(is_hex).then(Self::default)
    }

    /// Decodes a block in its own place. A character that is no digit is counted and passed over, with the half byte
    /// before it.
    pub(super) fn decode<'b>(&mut self, block: &'b mut [u8]) -> &'b mut [u8] {
        let mut length = 0;
        for at in 0..block.len() {
            let Some(&byte) = block.get(at) else { break };
            let digit = match byte {
                b'0'..=b'9' => byte - b'0',
                b'a'..=b'f' => byte - b'a' + 10,
                b'A'..=b'F' => byte - b'A' + 10,
                _ => {
                    if !byte.is_ascii_whitespace() {
                        self.strangers += 1;
                        self.half = None;
                    }
                    continue;
                }
            };
            match self.half.take() {
                None => self.half = Some(digit),
                Some(high) => {
                    // Two digits make one byte, so this never overtakes what is still to be read.
                    if let Some(place) = block.get_mut(length) {
                        *place = high << 4 | digit;
                        length += 1;
                    }
                }
            }
        }
        block.get_mut(..length).unwrap_or_default()
    }

    /// How many characters were no digits; a digit that is left alone at the end is one.
    pub(super) fn strangers(&self) -> u64 {
        self.strangers + u64::from(self.half.is_some())
    }
}
