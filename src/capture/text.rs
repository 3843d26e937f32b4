//! Bytes written down as hex digits: bare, as a program prints them, in a listing, or as `xxd` and `hexdump -C` dump them.

/// A longer line is read in pieces.
const LINE: usize = 64 * 1024;

/// The most bytes that all `*` of a dump stand for.
const REPEATED: usize = 16 << 20;

/// Turns text into bytes, block by block.
#[derive(Debug, Default)]
pub(super) struct Text {
    /// What of the last line has come so far.
    line: Vec<u8>,
    /// The first digit of a byte that is not whole.
    half: Option<u8>,
    /// The last row of a dump that begins its lines with positions, and where the row behind it begins.
    row: Vec<u8>,
    next: u64,
    /// Whether a `*` stands for rows like the last one, and how many bytes all of them have stood for.
    repeats: bool,
    repeated: usize,
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
        } else if line.trim_ascii() == b"*" && !self.row.is_empty() {
            self.repeats = true;
        } else if let Some((position, dumped)) = self.dumped(line) {
            self.repeat(position, bytes);
            let from = bytes.len();
            self.digits(dumped, bytes);
            self.row = bytes.get(from..).unwrap_or_default().to_vec();
            self.next = position.saturating_add(self.row.len() as u64);
        } else if is_sparse(line) {
            for digit in line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty()) {
                bytes.extend(digit.iter().copied().filter_map(self::digit).reduce(|high, low| high << 4 | low));
            }
        } else {
            self.digits(line, bytes);
        }
    }

    /// Writes the rows that a `*` stands for, up to a position.
    fn repeat(&mut self, position: u64, bytes: &mut Vec<u8>) {
        if !std::mem::take(&mut self.repeats) {
            return;
        }
        let missing = position.saturating_sub(self.next);
        match usize::try_from(missing) {
            Ok(missing) if self.repeated.saturating_add(missing) <= REPEATED => {
                self.repeated += missing;
                bytes.extend(self.row.iter().cycle().take(missing));
            }
            _ => self.strangers += 1,
        }
    }

    /// The position that begins a line of a dump, and the bytes behind it, before the characters.
    fn dumped<'l>(&self, line: &'l [u8]) -> Option<(u64, &'l [u8])> {
        let digits = line.iter().take_while(|byte| byte.is_ascii_hexdigit()).count();
        let (position, rest) = line.split_at_checked(digits)?;
        let position = u64::from_str_radix(std::str::from_utf8(position).ok()?, 16).ok()?;
        if digits >= 4
            && let Some(rest) = rest.strip_prefix(b": ")
        {
            // xxd: the characters stand behind two blanks.
            let end = rest.windows(2).position(|pair| pair == b"  ").unwrap_or(rest.len());
            return Some((position, rest.get(..end)?));
        }
        if digits == 8 && rest.starts_with(b"  ") && rest.contains(&b'|') {
            return Some((position, rest.split(|&byte| byte == b'|').next()?));
        }
        // The last line of `hexdump -C` is the length alone.
        let is_length = digits == 8 && rest.trim_ascii().is_empty() && (self.repeats || position == self.next);
        (is_length && !self.row.is_empty()).then_some((position, &[]))
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

/// Whether a line is bytes with blanks between them, some of one digit.
fn is_sparse(line: &[u8]) -> bool {
    let mut tokens = line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty());
    let mut short = 0;
    let is_hex = tokens.all(|token| {
        short += usize::from(token.len() == 1);
        token.len() <= 2 && token.iter().all(u8::is_ascii_hexdigit)
    });
    let is_whole = line.split(u8::is_ascii_whitespace).filter(|token| token.len() == 2).count() > 0;
    is_hex && short > 0 && is_whole
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
