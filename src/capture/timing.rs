//! Reads the timing files of `script --log-timing`, which say when the bytes of a capture came.

use crate::units::Nanos;

/// The numbers of bytes, and their times since the start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// Sorted by time.
    pieces: Vec<(Nanos, u64)>,
}

/// An invalid line of a timing file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {0} is not a delay and a number of bytes, such as `0.020000 13`")]
pub struct TimingError(pub usize);

impl Timing {
    /// Parses a timing file: lines `DELAY COUNT`, or `O DELAY COUNT` for output and `I DELAY COUNT`
    /// for input. If a file has both, the lines of the stream whose counts add up to `length` are
    /// used, or all lines if neither does.
    ///
    /// # Errors
    /// The first invalid line.
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

    /// Splits the next bytes of the capture where times change, and passes each piece to `sink`
    /// with its time. Bytes after the last line belong to it.
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
