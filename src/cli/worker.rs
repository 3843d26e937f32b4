//! Threads that write the messages sent to them, so that the sender never waits.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::time::Duration;

use super::start_thread;

/// A thread with an inbox and a result.
pub(super) struct Worker<T, R> {
    inbox: SyncSender<T>,
    result: Receiver<R>,
}

impl<T: Send + 'static, R: Send + 'static> Worker<T, R> {
    /// Starts the thread, with room for this number of messages. Its work ends when there are no more: after [`end`](Self::end).
    pub(super) fn start(
        name: &str,
        room: usize,
        work: impl FnOnce(Receiver<T>) -> R + Send + 'static,
    ) -> io::Result<Self> {
        let ((inbox, messages), (done, result)) = (mpsc::sync_channel(room), mpsc::channel());
        start_thread(name, move || {
            let _ = done.send(work(messages));
        })?;
        Ok(Worker { inbox, result })
    }

    /// Sends a message; fails if the inbox is full.
    pub(super) fn send(&self, message: T) -> Result<(), TrySendError<T>> {
        self.inbox.try_send(message)
    }

    /// Closes the inbox and waits for the result, at most `patience`.
    pub(super) fn end(self, patience: Duration) -> io::Result<R> {
        let Worker { inbox, result } = self;
        drop(inbox);
        result.recv_timeout(patience).map_err(|why| {
            io::Error::other(match why {
                RecvTimeoutError::Timeout => "it accepts no more bytes",
                RecvTimeoutError::Disconnected => "the thread that writes it failed",
            })
        })
    }
}
