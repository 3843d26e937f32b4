//! `--record`: the thread that writes down the bytes that the port took. Whatever plays never waits for it.

use std::fs::File;
use std::io::{self, Write as _};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::time::Duration;

use super::start_thread;

/// How many pieces may wait to be written.
const ROOM: usize = 64 * 1024;
/// How long the end waits for a file that takes nothing.
const PATIENCE: Duration = Duration::from_millis(750);

/// A recording under way.
pub(super) struct Recording {
    pieces: SyncSender<Box<[u8]>>,
    written: Receiver<io::Result<()>>,
    lost: usize,
}

impl Recording {
    /// Starts one into an open file.
    pub(super) fn start(mut file: File) -> io::Result<Self> {
        let (pieces, to_write) = mpsc::sync_channel::<Box<[u8]>>(ROOM);
        let (done, written) = mpsc::channel();
        start_thread("recording", move || {
            let all = to_write.iter().try_for_each(|piece| file.write_all(&piece));
            let _ = done.send(all);
        })?;
        Ok(Recording { pieces, written, lost: 0 })
    }

    /// Takes bytes.
    pub(super) fn put(&mut self, bytes: &[u8]) {
        if self.pieces.try_send(bytes.into()).is_err() {
            self.lost += bytes.len();
        }
    }

    /// Ends it; an error where it is not whole.
    pub(super) fn end(self) -> io::Result<()> {
        let Recording { pieces, written, lost } = self;
        drop(pieces);
        written.recv_timeout(PATIENCE).unwrap_or_else(|why| {
            Err(io::Error::other(match why {
                RecvTimeoutError::Timeout => "it takes no more bytes",
                RecvTimeoutError::Disconnected => "the thread that writes it failed",
            }))
        })?;
        if lost > 0 {
            return Err(io::Error::other(format!("{lost} bytes came faster than they could be written")));
        }
        Ok(())
    }
}
