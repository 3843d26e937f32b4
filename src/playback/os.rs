//! The system calls of playback: waiting and signals.

use std::io::{self, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rustix::event::{PollFd, PollFlags};
use rustix::io::Errno;
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGXFSZ};

use crate::clock::timespec;

/// What woke a wait.
pub(super) struct Woken {
    pub(super) signal: bool,
    pub(super) readable: bool,
    pub(super) hung_up: bool,
}

/// Waits for the port or a signal, at most so many nanoseconds. A wait that a signal handler interrupts ends with nothing
/// woken.
pub(super) fn wait(port: BorrowedFd<'_>, signals: &Signals, writable: bool, timeout: u64) -> io::Result<Woken> {
    let interest = if writable { PollFlags::IN | PollFlags::OUT } else { PollFlags::IN };
    let mut waits = [PollFd::from_borrowed_fd(port, interest), PollFd::new(&signals.pipe, PollFlags::IN)];
    match rustix::event::poll(&mut waits, Some(&timespec(timeout))) {
        Ok(_) | Err(Errno::INTR) => {}
        Err(error) => return Err(error.into()),
    }
    let [port, signal] = &waits;
    Ok(Woken {
        signal: signal.revents().contains(PollFlags::IN),
        readable: port.revents().contains(PollFlags::IN),
        hung_up: port.revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL),
    })
}

/// The signals that end a run: Ctrl-C, Ctrl-\\, Ctrl-Z, a request to terminate, a closed terminal.
#[derive(Debug)]
pub struct Signals {
    pipe: UnixStream,
    last: Arc<AtomicUsize>,
}

impl Signals {
    /// Catches them from now on, for the whole process.
    pub fn catch() -> io::Result<Self> {
        let (pipe, sender) = UnixStream::pair()?;
        pipe.set_nonblocking(true)?;
        let last = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGQUIT, SIGTERM, SIGHUP, SIGTSTP] {
            // In this order, so that the number is there when the pipe wakes somebody.
            let number = usize::try_from(signal).unwrap_or(0);
            signal_hook::flag::register_usize(signal, Arc::clone(&last), number)?;
            signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?;
        }
        // A recording that grows past the limit of file sizes would kill the player while the robot drives. Caught, it is a
        // write that fails.
        signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
        Ok(Signals { pipe, last })
    }

    /// The last signal that came; empties the pipe.
    pub(super) fn take(&self) -> Option<i32> {
        let mut buffer = [0; 64];
        while matches!((&self.pipe).read(&mut buffer), Ok(count) if count > 0) {}
        self.pending()
    }

    /// The last signal that came, without a system call. What it leaves in the pipe only wakes the next wait.
    pub(super) fn pending(&self) -> Option<i32> {
        match self.last.swap(0, Ordering::AcqRel) {
            0 => None,
            signal => i32::try_from(signal).ok(),
        }
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pipe.as_fd()
    }
}
