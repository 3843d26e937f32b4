//! Threads that are told what happens through a queue of a fixed length: whoever tells them never waits.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::time::Duration;

use motionseq::board::{OwnedItem, Report, State};
use motionseq::link::LineSettings;
use motionseq::sim::Pose;
use motionseq::units::Micros;

use super::start_thread;

/// What happens at a board that other programs use. The display, the tape and the log are told the same.
#[derive(Clone)]
pub(super) enum Event {
    /// A program has opened the port.
    Opened,
    /// It has closed it, or has ended.
    Closed,
    /// Frames of the program, and bytes that are not frames, each with the time at which it began on the line.
    Came(Arc<[(Micros, OwnedItem)]>),
    /// The board has reported.
    Report(Report),
    /// The program sends more than the line carries: how many bytes wait, and for how long.
    Behind(u64, Micros),
    /// At the end: how many bytes that the program had written could not be read.
    Unread(u64),
    /// The program has set its line up otherwise than the board's.
    SetUp(LineSettings),
    /// Some time has passed; how a virtual board is now, a few times a second.
    Passed(Option<Arc<Seen>>),
}

/// How a virtual board is. What a fault has kept from it, it was not told.
pub(super) struct Seen {
    pub(super) state: State,
    pub(super) pose: Pose,
    pub(super) report: Report,
}

/// A thread that is told things of one type, and what becomes of it in the end.
pub(super) struct Observer<T, R> {
    queue: SyncSender<T>,
    result: Receiver<R>,
    lost: u64,
}

impl<T: Send + 'static, R: Send + 'static> Observer<T, R> {
    /// Starts a thread with room for so many things that wait. It works until nothing comes any more.
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
        Ok(Observer { queue, result, lost: 0 })
    }

    /// Tells it something; what finds no room is lost. Returns whether the thread still takes anything.
    pub(super) fn tell(&mut self, what: T) -> bool {
        match self.queue.try_send(what) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.lost += 1;
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// The result of a thread that has ended by itself, once.
    pub(super) fn ended(&self) -> Option<R> {
        self.result.try_recv().ok()
    }

    /// Ends it, and waits for its result at most so long. Returns that, or why there is none, where it writes to what is called
    /// `file`; and how many things were lost.
    pub(super) fn end(self, patience: Duration, file: &str) -> (Result<R, String>, u64) {
        let Observer { queue, result, lost } = self;
        drop(queue);
        let result = result.recv_timeout(patience).map_err(|why| match why {
            RecvTimeoutError::Timeout => format!("{file} takes no more bytes"),
            RecvTimeoutError::Disconnected => "the thread that writes it failed".to_owned(),
        });
        (result, lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_finds_no_room_is_lost_and_nobody_waits() {
        let (go, may_go) = mpsc::channel::<()>();
        let work = move |told: &Receiver<u32>| {
            let _ = may_go.recv();
            told.iter().collect::<Vec<_>>()
        };
        let mut observer = Observer::start("stuck", 2, work).unwrap();
        // The thread takes nothing yet, and all of these return at once.
        assert!((0..5).all(|number| observer.tell(number)));
        go.send(()).unwrap();
        assert_eq!(observer.end(Duration::from_mins(1), "it"), (Ok(vec![0, 1]), 3));
    }

    #[test]
    fn one_that_takes_nothing_to_the_end_is_not_waited_for() {
        let (go, may_go) = mpsc::channel::<()>();
        let observer = Observer::<u32, ()>::start("slow", 1, move |_| may_go.recv().unwrap_or(())).unwrap();
        let (result, _) = observer.end(Duration::from_millis(1), "the file");
        assert_eq!(result, Err("the file takes no more bytes".to_owned()));
        drop(go);
    }

    #[test]
    fn one_that_has_ended_gives_its_result_once() {
        let mut observer = Observer::<u32, u32>::start("short", 1, |told| told.recv().unwrap()).unwrap();
        assert!(observer.tell(7));
        while observer.tell(8) {
            std::thread::yield_now();
        }
        assert_eq!((observer.ended(), observer.ended()), (Some(7), None));
    }
}
