//! Takes a log to its file.

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use motionseq::board::Board;
use motionseq::units::Nanos;

use super::super::growing::Growing;
use super::book::Book;
use super::{Entry, Screen};

/// How often what was written goes to the file: so much is lost where the program is killed.
const UPDATE: Duration = Duration::from_millis(500);
/// What makes a log whole that has no index: the records `DataEnd` and `Footer`, which say that none follows, and the magic bytes
/// (<https://mcap.dev/spec>). It stands behind each piece, and the next one is written over it, so that any tool reads the log of a
/// program that was killed.
const END: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";
/// How much is kept for a file that takes nothing; where more comes, the log is over.
const MOST_PENDING: usize = 16 << 20;

pub(super) const WHY_NOT: Option<&str> = None;

/// Writes until nothing comes any more; says why the log is not whole, if it is not.
pub(super) fn keep(
    file: File,
    name: String,
    board: Arc<Board>,
    screen: Screen,
    entries: &Receiver<(Nanos, Entry)>,
) -> Option<String> {
    let mut keeper = Keeper { out: Growing::new(file, name.clone(), screen), name, screen, is_over: false };
    match keeper.write_all(entries, board) {
        Ok(()) => keeper.out.failing().map(str::to_owned),
        Err(error) => Some(error.to_string()),
    }
}

struct Keeper {
    out: Growing,
    name: String,
    screen: Screen,
    /// Whether it took nothing for so long that the log is over.
    is_over: bool,
}

impl Keeper {
    fn write_all(&mut self, entries: &Receiver<(Nanos, Entry)>, board: Arc<Board>) -> io::Result<()> {
        let mut book = Book::new(board)?;
        let mut written = Instant::now();
        loop {
            match entries.recv_timeout(UPDATE.saturating_sub(written.elapsed())) {
                Ok((at, entry)) if !self.is_over => book.take(at, entry)?,
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if written.elapsed() >= UPDATE {
                let piece = book.piece()?;
                if !piece.is_empty() || self.out.failing().is_some() {
                    self.write(&piece, END);
                }
                written = Instant::now();
            }
        }
        let last = book.last()?;
        self.write(&last, &[]);
        Ok(())
    }

    /// Gives the file a piece, and an end.
    fn write(&mut self, piece: &[u8], end: &[u8]) {
        if self.is_over {
            return;
        }
        self.out.write(piece, end, END);
        if self.out.pending() > MOST_PENDING
            && let Some(error) = self.out.failing()
        {
            self.screen.warning(&format!("{} ends here: {error}", self.name));
            self.is_over = true;
            self.out.forget();
        }
    }
}
