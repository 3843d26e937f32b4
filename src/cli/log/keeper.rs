//! Takes a log to its file.

use std::fs::File;
use std::io::{self, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use motionseq::board::Board;
use motionseq::units::Nanos;

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
    path: PathBuf,
    board: Arc<Board>,
    screen: Screen,
    entries: &Receiver<(Nanos, Entry)>,
) -> Option<String> {
    let is_file = file.metadata().is_ok_and(|meta| meta.is_file());
    let mut keeper = Keeper { file, is_file, at: 0, path, screen, pending: Vec::new(), failing: None, is_over: false };
    match keeper.write_all(entries, board) {
        Ok(()) => keeper.failing,
        Err(error) => Some(error.to_string()),
    }
}

/// Has the file.
struct Keeper {
    file: File,
    /// Only in a file something can be written over.
    is_file: bool,
    /// How much of the log the file has.
    at: u64,
    path: PathBuf,
    screen: Screen,
    /// What the file has not taken yet.
    pending: Vec<u8>,
    /// Why the file takes nothing.
    failing: Option<String>,
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
                if !piece.is_empty() || self.failing.is_some() {
                    self.write(&piece, END);
                }
                written = Instant::now();
            }
        }
        let last = book.last()?;
        self.write(&last, &[]);
        Ok(())
    }

    /// Gives the file what it has not taken yet, and an end; where it does not take it, it is tried again the next time.
    fn write(&mut self, piece: &[u8], end: &[u8]) {
        if self.is_over {
            return;
        }
        self.pending.extend_from_slice(piece);
        let result = if self.is_file { self.write_over(end) } else { self.write_on() };
        if result.is_ok() {
            self.at += self.pending.len() as u64;
            self.pending.clear();
            // A robot's power may be cut at any time.
            let _ = self.file.sync_data();
        }
        let was_failing = self.failing.is_some();
        self.failing = result.err().map(|error| error.to_string());
        let path = self.path.display();
        match &self.failing {
            Some(error) if self.pending.len() > MOST_PENDING => {
                self.screen.warning(&format!("the log {path} ends here: {error}"));
                self.is_over = true;
                self.pending = Vec::new();
            }
            Some(error) if !was_failing => {
                self.screen.warning(&format!("the log {path} cannot be written: {error}; it is tried again"));
            }
            None if was_failing => self.screen.note(&format!("the log {path} is written again")),
            _ => {}
        }
    }
    /// Writes over the last end.
    fn write_over(&mut self, end: &[u8]) -> io::Result<()> {
        let text = [self.pending.as_slice(), end].concat();
        let written = self.file.write_all_at(&text, self.at);
        if written.is_err() {
            // Half a piece is no log, and what stood there was whole.
            self.file.set_len(self.at)?;
            let _ = self.file.write_all_at(END, self.at);
        } else {
            self.file.set_len(self.at + text.len() as u64)?;
        }
        written
    }

    /// Writes to what only goes on, such as a pipe; what it takes of a piece is not given to it again.
    fn write_on(&mut self) -> io::Result<()> {
        while !self.pending.is_empty() {
            match self.file.write(&self.pending) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => drop(self.pending.drain(..count)),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
