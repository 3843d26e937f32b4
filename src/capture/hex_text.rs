//! Reads bytes from hex digits: bare, as a program prints them, in a listing, or in a dump of `xxd`
//! or `hexdump -C`.

use std::borrow::Cow;
use std::io;

use serde::Deserialize;

use super::stamps::{FromFirst, tio_line};
use crate::timeline::{Snapshot, robot_of};
use crate::units::{Micros, Nanos};

/// A time above this one counts from 1970.
const SINCE_1970: Nanos = Micros::SECOND.saturating_mul(100_000_000).nanos();

/// The start of a sequence that sets colors on a terminal.
const ESCAPE: u8 = 0x1B;

/// A longer line is read in pieces.
const LINE: usize = 64 * 1024;

/// The most bytes that all `*` lines of a dump may repeat.
const REPEATED: usize = 16 << 20;

/// Converts text to bytes, block by block.
#[derive(Debug, Default)]
pub(super) struct HexText {
    /// The incomplete last line.
    line: Vec<u8>,
    /// The first digit of an incomplete byte.
    half: Option<u8>,
    /// The last row of a dump with positions, and the position after it.
    row: Vec<u8>,
    next: u64,
    /// Whether a `*` line repeats the last row, and how many bytes such lines have repeated so far.
    repeats: bool,
    repeated: usize,
    not_hex: u64,
    /// Whether the `on abort` part of a snapshot has begun, which is not part of a run; and the
    /// number of its lines.
    is_abort: bool,
    aborts: u64,
    /// The speed of the line in bits per second, if a snapshot states it.
    baud: Option<u32>,
    /// The robot of these frames, if a line names it, and the first other robot that a line names.
    robot: Option<String>,
    other_robot: Option<String>,
    /// The time of the last line that had one, the time that counts as 0, and the times of a clock.
    at: Option<Nanos>,
    base: Option<Nanos>,
    clock: FromFirst,
    /// A buffer for the bytes of a block.
    bytes: Vec<u8>,
}

impl HexText {
    /// Whether a stream's first block is enough to decide if it is such text: it contains a
    /// complete line that is not a comment, or cannot be text.
    pub(super) fn is_decided(block: &[u8]) -> bool {
        let whole = block.iter().rposition(|&byte| byte == b'\n').and_then(|end| block.get(..end)).unwrap_or_default();
        block.len() >= LINE
            || !block.iter().all(is_text)
            || whole.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).any(has_bytes)
    }

    /// A reader, if a stream that begins with this block is such text. No frame consists only of
    /// these characters.
    pub(super) fn of(block: &[u8]) -> Option<Self> {
        let first = block.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).find(|line| has_bytes(line));
        let begins_with_hex = first.is_none_or(|line| {
            let (mut probe, mut bytes) = (HexText::default(), Vec::new());
            match LogLine::of(line) {
                Some(logged) => probe.digits(&logged.digits, &mut bytes),
                None => probe.take_line(line, &mut bytes),
            }
            probe.not_hex <= bytes.len() as u64
        });
        (begins_with_hex && block.iter().all(is_text)).then(Self::default)
    }

    /// Reads a block, and passes the bytes of every complete line to `sink`, with the time of the
    /// line if it has one.
    pub(super) fn feed(
        &mut self,
        block: &[u8],
        mut sink: impl FnMut(Option<Nanos>, &[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut bytes = std::mem::take(&mut self.bytes);
        for piece in block.split_inclusive(|&byte| byte == b'\n') {
            self.line.extend_from_slice(piece);
            if piece.ends_with(b"\n") || self.line.len() >= LINE {
                self.end_line(&mut bytes, &mut sink)?;
            }
        }
        // Pass lines without times together.
        if !bytes.is_empty() {
            sink(self.at, &bytes)?;
            bytes.clear();
        }
        self.bytes = bytes;
        Ok(())
    }

    /// Reads the last line, which may lack a line end.
    pub(super) fn finish(&mut self, mut sink: impl FnMut(Option<Nanos>, &[u8]) -> io::Result<()>) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.end_line(&mut bytes, &mut sink)?;
        if bytes.is_empty() { Ok(()) } else { sink(self.at, &bytes) }
    }

    /// Adds the bytes of a line. Bytes before a line with a time are passed to `sink` with the
    /// previous time.
    fn end_line(
        &mut self,
        bytes: &mut Vec<u8>,
        sink: &mut impl FnMut(Option<Nanos>, &[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        let line = std::mem::take(&mut self.line);
        self.comment(line.trim_ascii());
        let logged = LogLine::of(&line);
        if let Some(robot) = logged.as_ref().and_then(|logged| logged.robot.as_deref()) {
            self.of_robot(robot);
        }
        if self.is_abort || self.other_robot.is_some() {
            self.aborts += u64::from(has_bytes(line.trim_ascii()));
            self.line = line;
            self.line.clear();
            return Ok(());
        }
        if let Some(at) = logged.as_ref().and_then(|logged| logged.at) {
            if !bytes.is_empty() {
                sink(self.at, bytes)?;
                bytes.clear();
            }
            self.at = Some(if logged.as_ref().is_some_and(|logged| logged.is_clock) {
                self.clock.take(at)
            } else {
                // Times since 1970 count from the first one.
                let base = *self.base.get_or_insert(if at > SINCE_1970 { at } else { Nanos::ZERO });
                at - base
            });
        }
        match logged {
            Some(logged) => self.digits(&logged.digits, bytes),
            None => self.take_line(&line, bytes),
        }
        self.line = line;
        self.line.clear();
        Ok(())
    }

    /// Reads the comments of a snapshot.
    fn comment(&mut self, line: &[u8]) {
        let Some(line) = std::str::from_utf8(line).ok().filter(|line| line.starts_with('#')) else { return };
        self.is_abort |= Snapshot::begins_abort(line);
        self.baud = Snapshot::baud(line).or(self.baud);
        if let Some(robot) = robot_of(line) {
            self.of_robot(robot);
        }
    }

    /// Notes the robot of the frames that follow.
    fn of_robot(&mut self, robot: &str) {
        if self.robot.get_or_insert_with(|| robot.to_owned()) != robot {
            self.other_robot.get_or_insert_with(|| robot.to_owned());
        }
    }

    /// The first two robots, if there are frames of several. Only those of the first are read.
    pub(super) fn robots(&self) -> Option<[&str; 2]> {
        Some([self.robot.as_deref()?, self.other_robot.as_deref()?])
    }

    fn take_line(&mut self, line: &[u8], bytes: &mut Vec<u8>) {
        if !has_bytes(line.trim_ascii()) {
            return;
        }
        if line.trim_ascii() == b"*" && !self.row.is_empty() {
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

    /// Adds the rows that a `*` line repeats, up to a position.
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
            _ => self.not_hex += 1,
        }
    }

    /// The position at the start of a line of a dump, and the bytes after it, without the character
    /// column.
    fn dumped<'l>(&self, line: &'l [u8]) -> Option<(u64, &'l [u8])> {
        let digits = line.iter().take_while(|byte| byte.is_ascii_hexdigit()).count();
        let (position, rest) = line.split_at_checked(digits)?;
        let position = u64::from_str_radix(std::str::from_utf8(position).ok()?, 16).ok()?;
        if digits >= 4
            && let Some(rest) = rest.strip_prefix(b": ")
        {
            // xxd: two spaces precede the characters.
            let end = rest.windows(2).position(|pair| pair == b"  ").unwrap_or(rest.len());
            return Some((position, rest.get(..end)?));
        }
        if digits == 8 && rest.starts_with(b"  ") && rest.contains(&b'|') {
            return Some((position, rest.split(|&byte| byte == b'|').next()?));
        }
        // The last line of `hexdump -C` contains only the length.
        let is_length = digits == 8 && rest.trim_ascii().is_empty() && (self.repeats || position == self.next);
        (is_length && !self.row.is_empty()).then_some((position, &[]))
    }

    /// Reads pairs of digits; spaces and commas may separate them. `0x` starts a byte, which may
    /// have one digit. Any other character is counted and skipped, together with a half byte before
    /// it.
    fn digits(&mut self, mut text: &[u8], bytes: &mut Vec<u8>) {
        while let Some((&byte, rest)) = text.split_first() {
            text = rest;
            if let (b'0' | b'\\', Some((b'x' | b'X', rest))) = (byte, text.split_first()) {
                self.not_hex += u64::from(self.half.take().is_some());
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
                    self.not_hex += 1;
                    self.half = None;
                }
            }
        }
    }

    /// The number of frames in the `on abort` part of a snapshot. They are left out.
    pub(super) fn aborts(&self) -> u64 {
        self.aborts
    }

    /// The speed of the line in bits per second, if a snapshot states it.
    pub(super) fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// The number of characters that are not hex digits.
    pub(super) fn not_hex(&self) -> u64 {
        self.not_hex
    }

    /// Whether the text ends with half a byte.
    pub(super) fn is_half(&self) -> bool {
        self.half.is_some()
    }
}

/// Whether a byte may be part of hex text. Characters beyond ASCII may be the ellipsis of a
/// listing; no text contains the bytes that start a frame.
fn is_text(byte: &u8) -> bool {
    (b' '..=b'~').contains(byte) || *byte == ESCAPE || byte.is_ascii_whitespace() || (0x80..0xF5).contains(byte)
}

/// Whether a line contains bytes separated by spaces, some with one digit.
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

/// Whether a line contains more than a comment.
fn has_bytes(line: &[u8]) -> bool {
    !line.is_empty() && !line.starts_with(b"#")
}

/// A line of a log: its bytes, and its time if it has one.
struct LogLine<'l> {
    at: Option<Nanos>,
    digits: Cow<'l, [u8]>,
    /// Whether the time is that of a clock, and counts from the first one.
    is_clock: bool,
    /// The robot, if the line names it.
    robot: Option<String>,
}

impl<'l> LogLine<'l> {
    fn of(line: &'l [u8]) -> Option<Self> {
        let line = line.trim_ascii();
        match *line.first()? {
            b'(' => Self::of_candump(line),
            b'{' => Self::of_json(line),
            b'[' | ESCAPE => Self::of_tio(line),
            byte if byte.is_ascii_digit() => Self::of_listing(line),
            _ => None,
        }
    }

    /// A line of `render --format hex`, of a listing, or of `decode`: the bytes after the time or
    /// position.
    fn of_listing(line: &'l [u8]) -> Option<Self> {
        let mut columns = line.split(|&byte| byte == b'\t');
        let (first, frame, more) = (columns.next()?, columns.next()?, columns.next());
        let at = first.contains(&b'.').then(|| Nanos::from_seconds(std::str::from_utf8(first).ok()?)).flatten();
        let is_position = more.is_some() && first.iter().all(u8::is_ascii_digit);
        let frame = frame.strip_suffix(" …".as_bytes()).unwrap_or(frame);
        (at.is_some() || is_position).then_some(LogLine {
            at,
            digits: Cow::Borrowed(frame),
            is_clock: false,
            robot: None,
        })
    }

    /// `(1436509052.249713) can0 044#2A366C2B`, `(0.5) ttyUSB0 FF FE 04 01 01 06`, `(0.5) can0 123
    /// [3] 11 22 33`.
    fn of_candump(line: &'l [u8]) -> Option<Self> {
        let (at, rest) = std::str::from_utf8(line).ok()?.strip_prefix('(')?.split_once(')')?;
        let at = Nanos::from_seconds(at.trim())?;
        let digits = if let Some((_, data)) = rest.split_once('#') {
            // After the second `#` of a long frame comes one digit of flags.
            data.strip_prefix('#').map_or(data, |data| data.get(1..).unwrap_or_default())
        } else if let Some((_, data)) = rest.split_once(']') {
            data
        } else {
            let is_hex = |word: &str| word.len().is_multiple_of(2) && word.bytes().all(|byte| byte.is_ascii_hexdigit());
            let name = rest.split_ascii_whitespace().take_while(|word| !is_hex(word)).last();
            name.and_then(|name| rest.split_once(name)).map_or(rest, |(_, data)| data)
        };
        Some(LogLine { at: Some(at), digits: Cow::Borrowed(digits.as_bytes()), is_clock: false, robot: None })
    }

    /// What tio shows of a port (`tio -x`, `--output-mode hex`): its messages and bytes, with a time or not, and maybe in bold.
    fn of_tio(line: &'l [u8]) -> Option<Self> {
        let text = std::str::from_utf8(line).ok()?;
        // `ESC [ 1 m` to `ESC [ 0 m`.
        let plain: String = text
            .split('\u{1b}')
            .enumerate()
            .map(|(at, part)| if at == 0 { part } else { part.split_once('m').map_or("", |(_, text)| text) })
            .collect();
        let (at, digits) = tio_line(plain.trim())?;
        let digits = digits.as_bytes().to_vec();
        Some(LogLine {
            at: (!digits.is_empty()).then_some(at),
            digits: Cow::Owned(digits),
            is_clock: true,
            robot: None,
        })
    }

    /// A line of `--format jsonl`.
    fn of_json(line: &'l [u8]) -> Option<Self> {
        #[derive(Deserialize)]
        struct Line {
            t_us: u64,
            frame: Option<String>,
            skipped: Option<String>,
            robot: Option<String>,
        }
        let Line { t_us, frame, skipped, robot } = serde_json::from_slice(line).ok()?;
        // A gate has no frame.
        let digits = frame.or(skipped).unwrap_or_default().into_bytes();
        Some(LogLine { at: Some(Micros(t_us).nanos()), digits: Cow::Owned(digits), is_clock: false, robot })
    }
}

fn digit(byte: u8) -> Option<u8> {
    match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        b'A'..=b'F' => Some(byte - b'A' + 10),
        _ => None,
    }
}
