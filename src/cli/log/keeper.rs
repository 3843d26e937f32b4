//! Takes a log to its file.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::book::Book;
use super::{Entry, Screen};

/// How often what was written goes to the file: so much is lost where the program is killed.
const UPDATE: Duration = Duration::from_millis(500);
/// How much is kept for a file that takes nothing; where more comes, the log is over.
const MOST_PENDING: usize = 16 << 20;

pub(super) const WHY_NOT: Option<&str> = None;

/// Writes until nothing comes any more; says why the log is not whole, if it is not.
pub(super) fn keep(file: File, path: PathBuf, screen: Screen, entries: &Receiver<(u64, Entry)>) -> Option<String> {
    let mut keeper = Keeper { file, path, screen, pending: Vec::new(), failing: None, is_over: false };
    match keeper.write_all(entries) {
        Ok(()) => keeper.failing,
        Err(error) => Some(error.to_string()),
    }
}

/// Has the file.
struct Keeper {
    file: File,
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
    fn write_all(&mut self, entries: &Receiver<(u64, Entry)>) -> io::Result<()> {
        let mut book = Book::new()?;
        let mut written = Instant::now();
        loop {
            match entries.recv_timeout(UPDATE.saturating_sub(written.elapsed())) {
                Ok((at, entry)) if !self.is_over => book.take(at, entry)?,
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if written.elapsed() >= UPDATE {
                let piece = book.piece()?;
                self.write(&piece);
                written = Instant::now();
            }
        }
        let last = book.last()?;
        self.write(&last);
        Ok(())
    }

    /// Gives the file what it has not taken yet; where it does not take it, it is tried again the next time.
    fn write(&mut self, piece: &[u8]) {
        if self.is_over {
            return;
        }
        self.pending.extend_from_slice(piece);
        let mut taken = 0;
        let result = loop {
            match self.file.write(self.pending.get(taken..).unwrap_or_default()) {
                Ok(0) if taken == self.pending.len() => break Ok(()),
                Ok(0) => break Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => taken += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => break Err(error),
            }
        };
        self.pending.drain(..taken.min(self.pending.len()));
        // A robot's power may be cut at any time; what cannot be made safe, such as a pipe, is written all the same.
        if taken > 0 {
            let _ = self.file.sync_data();
        }
        let was_failing = self.failing.is_some();
        self.failing = result.err().map(|error: io::Error| error.to_string());
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
}
