//! Threads that write the messages sent to them, so that the sender never waits.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::time::Duration;

use super::start_thread;

/// A thread with an inbox and a result.
pub(super) struct Worker<T, R> {
    queue: SyncSender<T>,
    result: Receiver<R>,
    lost: u64,
}

impl<T: Send + 'static, R: Send + 'static> Worker<T, R> {
    /// Starts a thread with room for this number of waiting messages. It works until there are no more.
    pub(super) fn start(
        name: &str,
        room: usize,
        work: impl FnOnce(&Receiver<T>) -> R + Send + 'static,
    ) -> io::Result<Self> {
        let (queue, told) = mpsc::sync_channel(room);
        let (tell, result) = mpsc::channel();
        start_thread(name, move || {
            let _ = tell.send(work(&told));
        })?;
        Ok(Worker { queue, result, lost: 0 })
    }

    /// Sends a message; without room it is lost and counted. Returns whether the thread still takes messages.
    pub(super) fn send(&mut self, message: T) -> bool {
        match self.queue.try_send(message) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.lost += 1;
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// The result of a thread that has ended early, once.
    pub(super) fn ended(&self) -> Option<R> {
        self.result.try_recv().ok()
    }

    /// Ends it when it has taken every message, and waits for its result at most this long. Returns the result, or why there is none
    /// (`file` names what it writes to), and how many messages were lost.
    pub(super) fn end(self, patience: Duration, file: &str) -> (Result<R, String>, u64) {
        let Worker { queue, result, lost } = self;
        drop(queue);
        let result = result.recv_timeout(patience).map_err(|why| match why {
            RecvTimeoutError::Timeout => format!("{file} accepts no more bytes"),
            RecvTimeoutError::Disconnected => "the thread that writes it failed".to_owned(),
        });
        (result, lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_without_room_is_lost_and_the_sender_does_not_wait() {
        let (go, may_go) = mpsc::channel::<()>();
        let work = move |told: &Receiver<u32>| {
            let _ = may_go.recv();
            told.iter().collect::<Vec<_>>()
        };
        let mut worker = Worker::start("stuck", 2, work).unwrap();
        // The thread takes nothing yet, and all of these return at once.
        assert!((0..5).all(|number| worker.send(number)));
        go.send(()).unwrap();
        assert_eq!(worker.end(Duration::from_mins(1), "it"), (Ok(vec![0, 1]), 3));
    }

    #[test]
    fn a_stuck_thread_is_not_waited_for() {
        let (go, may_go) = mpsc::channel::<()>();
        let worker = Worker::<u32, ()>::start("slow", 1, move |_| may_go.recv().unwrap_or(())).unwrap();
        let (result, _) = worker.end(Duration::from_millis(1), "the file");
        assert_eq!(result, Err("the file accepts no more bytes".to_owned()));
        drop(go);
    }

    #[test]
    fn an_ended_thread_gives_its_result_once() {
        let mut worker = Worker::<u32, u32>::start("short", 1, |told| told.recv().unwrap()).unwrap();
        assert!(worker.send(7));
        while worker.send(8) {
            std::thread::yield_now();
        }
        assert_eq!((worker.ended(), worker.ended()), (Some(7), None));
    }
}
