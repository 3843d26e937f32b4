//! Times that other tools write between the bytes of a capture: tio into its log, socat before each block.

use crate::units::Nanos;

const SECOND: u64 = 1_000_000_000;
const DAY: u64 = 24 * 3_600 * SECOND;

/// The time of a clock: of a day (`21:03:47.328`), with a date (`2026-11-28T21:03:47.328`, `2026/11/28 21:03:47`), or in seconds since
/// 1970 (`1764363827.328`). A local time counts as UTC, because only differences matter.
pub(super) fn clock(text: &str) -> Option<Nanos> {
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (Some(date), time),
        None => (None, text),
    };
    if !time.contains(':') {
        return if date.is_none() && text.contains('.') { Nanos::from_seconds(text) } else { None };
    }
    let (whole, fraction) = time.split_once('.').unwrap_or((time, "0"));
    let parts: Vec<u64> = whole.split(':').map(|part| digits(part, 2)).collect::<Option<_>>()?;
    let [hours, minutes, seconds @ 0..=60] = parts[..] else { return None };
    let fraction = Nanos::from_seconds(&format!("0.{fraction}"))?;
    let seconds = (hours * 60 + minutes) * 60 + seconds + date.map_or(Some(0), days)? * 24 * 3_600;
    Some(Nanos(seconds.checked_mul(SECOND)?).saturating_add(fraction))
}

/// A number with at most this many digits.
fn digits(text: &str, most: usize) -> Option<u64> {
    (text.len() <= most && text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok()).flatten()
}

/// The days from 1970 to a date of the Gregorian calendar, `2026-11-28` or `2026/11/28`.
fn days(date: &str) -> Option<u64> {
    let parts: Vec<u64> = date.split(['-', '/']).map(|part| digits(part, 4)).collect::<Option<_>>()?;
    let [year @ 1970..=9_999, month @ 1..=12, day @ 1..=31] = parts[..] else { return None };
    // A year that begins in March ends with its leap day.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let until_year = year * 365 + year / 4 - year / 100 + year / 400;
    // The same for 1 January 1970.
    (until_year + (month * 153 + 2) / 5 + day).checked_sub(719_469)
}

/// Makes times count from the first one. A time of a day that is much earlier than the one before it is of the next day.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FromFirst {
    first: Option<Nanos>,
    last: Nanos,
}

impl FromFirst {
    pub(super) fn take(&mut self, mut at: Nanos) -> Nanos {
        let first = *self.first.get_or_insert(at);
        while at.saturating_add(Nanos(DAY / 2)) < self.last && at < Nanos(2 * DAY) {
            at = at.saturating_add(Nanos(DAY));
        }
        self.last = self.last.max(at);
        self.last - first
    }
}

/// A log of tio with times: bytes, and before some of them a time in brackets.
#[derive(Debug)]
pub(super) struct Stamped {
    /// What may be the beginning of a time.
    waiting: Vec<u8>,
    times: FromFirst,
    at: Nanos,
    /// What tio writes before a time, besides the bytes: a line end, if it shows them as hex.
    before: &'static [u8],
    is_at_start: bool,
    /// Whether the last byte that was passed on is a line end.
    is_line_end: bool,
}

impl Stamped {
    /// A reader, if a stream that begins with this block is such a log.
    pub(super) fn of(block: &[u8]) -> Option<Self> {
        let before: &[u8] = if block.starts_with(b"\r\n[") { b"\r\n" } else { b"" };
        let first = block.get(before.len()..)?;
        matches!(stamp(first), Stamp::Whole(..)).then(|| Stamped {
            waiting: Vec::new(),
            times: FromFirst::default(),
            at: Nanos::ZERO,
            before,
            is_at_start: true,
            is_line_end: false,
        })
    }

    /// Reads a block, and passes the bytes to `sink` with their times.
    pub(super) fn feed(&mut self, block: &[u8], mut sink: impl FnMut(Nanos, &[u8])) {
        let mut bytes = std::mem::take(&mut self.waiting);
        bytes.extend_from_slice(block);
        let mut rest = bytes.as_slice();
        let mut from = 0;
        while let Some(place) = self.next_stamp(rest, from) {
            match stamp(rest.get(place..).unwrap_or_default()) {
                Stamp::None => from = place + 1,
                Stamp::Partial => {
                    rest = self.pass(rest, place.saturating_sub(self.before.len()), &mut sink);
                    self.waiting = rest.to_vec();
                    return;
                }
                Stamp::Whole(at, length) => {
                    self.pass(rest, place.saturating_sub(self.before.len()), &mut sink);
                    self.at = self.times.take(at);
                    rest = rest.get(place + length..).unwrap_or_default();
                    (from, self.is_at_start, self.is_line_end) = (0, false, false);
                }
            }
        }
        // A line end may belong to the next time.
        let ends = |count: &usize| rest.ends_with(self.before.get(..*count).unwrap_or_default());
        let kept = (1..=self.before.len()).rev().find(ends).unwrap_or(0);
        self.waiting = self.pass(rest, rest.len() - kept, &mut sink).to_vec();
    }

    /// Passes the first bytes to `sink`, and returns the others.
    fn pass<'b>(&mut self, bytes: &'b [u8], count: usize, sink: &mut impl FnMut(Nanos, &[u8])) -> &'b [u8] {
        let (given, kept) = bytes.split_at_checked(count).unwrap_or((bytes, &[]));
        if let Some(last) = given.last() {
            sink(self.at, given);
            (self.is_at_start, self.is_line_end) = (false, *last == b'\n');
        }
        kept
    }

    /// Reads the rest.
    pub(super) fn finish(self, mut sink: impl FnMut(Nanos, &[u8])) {
        sink(self.at, &self.waiting);
    }

    /// The next place at which a time may begin: at the start, or after a line end.
    fn next_stamp(&self, bytes: &[u8], from: usize) -> Option<usize> {
        let is_start = |at: usize| {
            let before = bytes.get(..at).unwrap_or_default();
            match (self.before.is_empty(), at) {
                (true, 0) => self.is_at_start || self.is_line_end,
                (true, _) => before.ends_with(b"\n"),
                (false, _) => before.ends_with(self.before),
            }
        };
        (from..bytes.len()).find(|at| bytes.get(*at) == Some(&b'[') && is_start(*at))
    }
}

/// A time in brackets at the start of some bytes.
enum Stamp {
    None,
    /// It may be one, if more bytes come.
    Partial,
    /// Its time and its length.
    Whole(Nanos, usize),
}

/// The longest time in brackets, in bytes.
const LONGEST: usize = 32;

fn stamp(bytes: &[u8]) -> Stamp {
    let head = bytes.get(..bytes.len().min(LONGEST)).unwrap_or_default();
    let is_inside = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b':' | b'.' | b'-' | b'T');
    if head.first() != Some(&b'[') {
        return Stamp::None;
    }
    let inside: Vec<u8> = head.iter().skip(1).copied().take_while(is_inside).collect();
    let rest = head.get(inside.len() + 1..).unwrap_or_default();
    if rest.is_empty() || rest == b"]" {
        return if head.len() < LONGEST { Stamp::Partial } else { Stamp::None };
    }
    let at = String::from_utf8(inside).ok().and_then(|inside| Some((clock(&inside)?, inside.len() + 3)));
    match at {
        Some((at, length)) if rest.starts_with(b"] ") => Stamp::Whole(at, length),
        _ => Stamp::None,
    }
}

/// A text line of tio with a time in brackets: `[21:03:47.328] ff fe 04`, or one of its messages, which has no bytes. Returns the time
/// and the hex digits.
pub(super) fn tio_line(line: &str) -> Option<(Nanos, &str)> {
    let Stamp::Whole(at, length) = stamp(line.as_bytes()) else { return None };
    let digits = line.get(length..)?.trim();
    let is_hex = |word: &str| word.len() == 2 && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    Some((at, if digits.split_ascii_whitespace().all(is_hex) { digits } else { "" }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_clocks_are_read() {
        assert_eq!(clock("00:00:01.5"), Some(Nanos(1_500_000_000)));
        assert_eq!(clock("1970-01-02T00:00:00.001"), Some(Nanos(DAY + 1_000_000)));
        assert_eq!(clock("1970/03/01 00:00:00"), Some(Nanos(59 * DAY)));
        assert_eq!(clock("2000-03-01T00:00:00"), Some(Nanos(11_017 * DAY)));
        // `date -u -d 2026-11-28T21:03:47Z +%s`
        assert_eq!(clock("2026-11-28T21:03:47"), Some(Nanos(1_795_899_827 * SECOND)));
        assert_eq!(clock("1764363827.328"), Some(Nanos(1_764_363_827_328_000_000)));
        for text in ["", "12", "tio", "1:2", "2026-13-01T00:00:00", "12:00:00.x", "0:0:61"] {
            assert_eq!(clock(text), None, "{text}");
        }
    }

    #[test]
    fn times_count_from_the_first_across_midnight() {
        let mut times = FromFirst::default();
        let took = ["23:59:59.5", "00:00:00.5", "00:00:01.0"].map(|text| times.take(clock(text).unwrap()));
        assert_eq!(took, [0, SECOND, 3 * SECOND / 2].map(Nanos));
    }
}
