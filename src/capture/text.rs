//! Bytes written down as hex digits: bare, as a program prints them, in a listing, or as `xxd` and `hexdump -C` dump them.

/// A longer line is read in pieces.
const LINE: usize = 64 * 1024;

/// Turns text into bytes, block by block.
#[derive(Debug, Default)]
pub(super) struct Text {
    /// What of the last line has come so far.
    line: Vec<u8>,
    /// The first digit of a byte that is not whole.
    half: Option<u8>,
    /// Whether lines begin with positions, as `hexdump -C` writes them.
    dump: bool,
    strangers: u64,
}

impl Text {
    /// Whether a stream that begins with this block is such text: no frame consists of these characters alone.
    pub(super) fn of(block: &[u8]) -> Option<Self> {
        let is_text = |byte: &u8| (b' '..=b'~').contains(byte) || byte.is_ascii_whitespace();
        let first = block.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).find(|line| is_told(line));
        let begins_with_hex = first.is_none_or(|line| {
            let (mut probe, mut bytes) = (Text::default(), Vec::new());
            probe.take_line(line, &mut bytes);
            probe.strangers <= bytes.len() as u64
        });
        (begins_with_hex && block.iter().all(is_text)).then(Self::default)
    }

    /// Takes a block, and gives the bytes of every line that is whole.
    pub(super) fn feed(&mut self, block: &[u8], bytes: &mut Vec<u8>) {
        for piece in block.split_inclusive(|&byte| byte == b'\n') {
            self.line.extend_from_slice(piece);
            if piece.ends_with(b"\n") || self.line.len() >= LINE {
                self.end_line(bytes);
            }
        }
    }

    /// Takes what stands in the last line, which nothing ends.
    pub(super) fn finish(&mut self, bytes: &mut Vec<u8>) {
        self.end_line(bytes);
    }

    fn end_line(&mut self, bytes: &mut Vec<u8>) {
        let line = std::mem::take(&mut self.line);
        self.take_line(&line, bytes);
        self.line = line;
        self.line.clear();
    }

    fn take_line(&mut self, line: &[u8], bytes: &mut Vec<u8>) {
        if !is_told(line.trim_ascii()) {
            return;
        }
        if let Some(frame) = listed(line) {
            self.digits(frame, bytes);
        } else if let Some(dumped) = self.dumped(line) {
            self.digits(dumped, bytes);
        } else {
            self.digits(line, bytes);
        }
    }

    /// The bytes in a line of a dump: behind the position, before the characters.
    fn dumped<'l>(&mut self, line: &'l [u8]) -> Option<&'l [u8]> {
        let position = line.iter().take_while(|byte| byte.is_ascii_hexdigit()).count();
        let rest = line.get(position..)?;
        if position >= 4
            && let Some(rest) = rest.strip_prefix(b": ")
        {
            // xxd: the characters stand behind two blanks.
            let end = rest.windows(2).position(|pair| pair == b"  ").unwrap_or(rest.len());
            return rest.get(..end);
        }
        if position == 8 && rest.starts_with(b"  ") && rest.contains(&b'|') {
            self.dump = true;
            return rest.split(|&byte| byte == b'|').next();
        }
        // The last line of `hexdump -C` is the length alone.
        (self.dump && position == 8 && rest.trim_ascii().is_empty()).then_some(&[])
    }

    /// Reads digits in pairs, whatever blanks and commas stand between them. `0x` begins a byte, which may have one digit.
    /// A character that is no digit is counted and passed over, with the half byte before it.
    fn digits(&mut self, mut text: &[u8], bytes: &mut Vec<u8>) {
        while let Some((&byte, rest)) = text.split_first() {
            text = rest;
            if let (b'0' | b'\\', Some((b'x' | b'X', rest))) = (byte, text.split_first()) {
                self.strangers += u64::from(self.half.take().is_some());
                let count = rest.iter().take(2).take_while(|byte| byte.is_ascii_hexdigit()).count();
                let (digits, rest) = rest.split_at_checked(count).unwrap_or_default();
                bytes.extend(digits.iter().copied().filter_map(digit).reduce(|high, low| high << 4 | low));
                text = rest;
                continue;
            }
            match (digit(byte), self.half) {
                (Some(low), Some(high)) => {
                    bytes.push(high << 4 | low);
                    self.half = None;
                }
                (Some(high), None) => self.half = Some(high),
                (None, _) if byte.is_ascii_whitespace() || byte == b',' => {}
                (None, _) => {
                    self.strangers += 1;
                    self.half = None;
                }
            }
        }
    }

    /// How many characters were no digits.
    pub(super) fn strangers(&self) -> u64 {
        self.strangers
    }

    /// Whether a digit is left alone at the end.
    pub(super) fn is_half(&self) -> bool {
        self.half.is_some()
    }
}

/// Whether a line is more than a comment.
fn is_told(line: &[u8]) -> bool {
    !line.is_empty() && !line.starts_with(b"#")
}

/// The frame in a line of `render --format hex`, of a listing, or of `decode` itself: behind the time or the position.
fn listed(line: &[u8]) -> Option<&[u8]> {
    let mut columns = line.split(|&byte| byte == b'\t');
    let (first, frame, more) = (columns.next()?, columns.next()?, columns.next());
    let is_number = first.iter().all(|byte| byte.is_ascii_digit() || *byte == b'.');
    (is_number && !first.is_empty() && (more.is_some() || first.contains(&b'.'))).then_some(frame)
}

fn digit(byte: u8) -> Option<u8> {
    match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        b'A'..=b'F' => Some(byte - b'A' + 10),
        _ => None,
    }
}
