//! When the bytes of a capture came, as `script --log-timing` writes it down for scriptreplay.

use crate::units::Nanos;

/// How many bytes came, and when, from the start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// In the order of time.
    pieces: Vec<(Nanos, u64)>,
}

/// A line of a timing file that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {0} is no time and number of bytes, such as `0.020000 13`")]
pub struct TimingError(pub usize);

impl Timing {
    /// Reads the lines of a timing file: `DELAY COUNT`, or with the stream before it, `O DELAY COUNT` for what came out and `I` for what
    /// went in. Of a file with both, those belong to a capture of so many bytes that add up to them; to one of another length, all.
    pub fn read(text: &str, length: Option<u64>) -> Result<Self, TimingError> {
        let mut pieces: Vec<(Option<char>, Nanos, u64)> = Vec::new();
        let mut now = Nanos::ZERO;
        for (number, line) in (1..).zip(text.lines()) {
            let mut words = line.split_ascii_whitespace().peekable();
            let Some(first) = words.peek() else { continue };
            let stream = first.chars().next().filter(char::is_ascii_uppercase);
            if stream.is_some() {
                words.next();
            }
            let mut next = || words.next().ok_or(TimingError(number));
            now += Nanos::from_seconds(next()?).ok_or(TimingError(number))?;
            // Headers and signals have no bytes.
            if stream.is_none_or(|stream| matches!(stream, 'I' | 'O')) {
                pieces.push((stream, now, next()?.parse().map_err(|_| TimingError(number))?));
            }
        }
        let sum =
            |of: char| pieces.iter().filter(|(stream, ..)| *stream == Some(of)).map(|(.., count)| count).sum::<u64>();
        let only = ['O', 'I'].into_iter().find(|stream| sum(*stream) > 0 && Some(sum(*stream)) == length);
        let pieces = pieces.into_iter().filter(|(stream, ..)| only.is_none() || *stream == only);
        Ok(Timing { pieces: pieces.map(|(_, at, count)| (at, count)).collect() })
    }

    /// Cuts the next bytes of the capture where the times change, and hands each piece on with its time. What comes behind the last line
    /// counts to it.
    pub(super) fn cut<'b>(&mut self, mut bytes: &'b [u8], mut sink: impl FnMut(Nanos, &'b [u8])) {
        let mut done = 0;
        while !bytes.is_empty() {
            let is_last = done + 1 >= self.pieces.len();
            let Some((at, left)) = self.pieces.get_mut(done) else {
                sink(Nanos::ZERO, bytes);
                return;
            };
            let count = usize::try_from(*left).unwrap_or(usize::MAX);
            let (piece, rest) = bytes.split_at(if is_last { bytes.len() } else { count.min(bytes.len()) });
            *left = left.saturating_sub(piece.len() as u64);
            if !piece.is_empty() {
                sink(*at, piece);
            }
            done += usize::from(*left == 0 && !is_last);
            bytes = rest;
        }
        self.pieces.drain(..done);
    }
}
