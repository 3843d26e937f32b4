//! The system calls of playback: waiting, signals, processes, priorities. The only file with `unsafe` in it.

use std::io::{self, Read};
use std::num::NonZeroU64;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rustix::event::{PollFd, PollFlags};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::mm::MlockAllFlags;
use rustix::process::{Pid, PidfdFlags, Signal};
use rustix::termios::QueueSelector;
use signal_hook::consts::{
    SIGALRM, SIGCONT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGXFSZ,
};

use crate::clock::timespec;

pub(super) use rustix::event::PollFlags as Ready;

/// Waits at most so many nanoseconds (`None`: as long as it takes) until one of these descriptors is ready, and says for
/// each what it is ready for. A wait that a signal handler interrupts ends with nothing ready.
pub(super) fn wait<const N: usize>(
    watched: [(Option<BorrowedFd<'_>>, Ready); N],
    timeout: Option<u64>,
) -> io::Result<[Ready; N]> {
    let Some(some) = watched.iter().find_map(|(descriptor, _)| *descriptor) else { return Ok([Ready::empty(); N]) };
    // What is not watched stands there as one that is, and wakes for nothing of its own.
    let mut polled = watched.map(|(descriptor, ready)| match descriptor {
        Some(descriptor) => PollFd::from_borrowed_fd(descriptor, ready),
        None => PollFd::from_borrowed_fd(some, Ready::empty()),
    });
    match rustix::event::poll(&mut polled, timeout.map(timespec).as_ref()) {
        Ok(_) => {}
        Err(Errno::INTR) => return Ok([Ready::empty(); N]),
        Err(error) => return Err(error.into()),
    }
    let mut found = polled.iter().map(PollFd::revents);
    Ok(watched.map(|(descriptor, _)| {
        let found = found.next().unwrap_or(Ready::empty());
        if descriptor.is_some() { found } else { Ready::empty() }
    }))
}

/// What poll reports where the other end is gone.
pub(super) fn is_gone(ready: Ready) -> bool {
    ready.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
}

/// The signals that end a run: Ctrl-C, Ctrl-\\, Ctrl-Z, a request to terminate, a closed terminal.
#[derive(Debug)]
pub struct Signals {
    pipe: UnixStream,
    last: Arc<AtomicUsize>,
    continued: Arc<AtomicBool>,
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
        let continued = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(SIGCONT, Arc::clone(&continued))?;
        signal_hook::low_level::pipe::register(SIGCONT, sender)?;
        // A recording that grows past the limit of file sizes would kill the player while the robot drives. Ignored, it is
        // a write that fails. Likewise a terminal that stops programs in the background that write to it or read from it.
        ignore(&[SIGXFSZ, SIGTTOU, SIGTTIN]);
        Ok(Signals { pipe, last, continued })
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

    /// Sleeps as a stopped process until it is continued.
    pub(super) fn suspend(&self) {
        self.continued.store(false, Ordering::Release);
        if rustix::process::kill_process(rustix::process::getpid(), Signal::STOP).is_err() {
            return;
        }
        // Another thread may be the one that is stopped first.
        while !self.continued.load(Ordering::Acquire) {
            if wait([(Some(self.pipe.as_fd()), Ready::IN)], None).is_err() {
                return;
            }
            let mut buffer = [0; 64];
            while matches!((&self.pipe).read(&mut buffer), Ok(count) if count > 0) {}
        }
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pipe.as_fd()
    }
}

/// The terminal that this process was started from, for somebody to say there that a paused run shall go on.
#[derive(Debug)]
pub struct Keys {
    terminal: OwnedFd,
}

impl Keys {
    /// Opens it; `None` where there is none, or where this process is the first of its session: no shell is there that
    /// could continue it.
    pub fn open() -> Option<Self> {
        if rustix::process::getsid(None).is_ok_and(|leader| leader == rustix::process::getpid()) {
            return None;
        }
        let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let terminal = rustix::fs::open("/dev/tty", flags, Mode::empty()).ok()?;
        Some(Keys { terminal })
    }

    /// The descriptor to wait on, while this process is the one that the terminal talks to.
    pub(super) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        let talks_to = rustix::termios::tcgetpgrp(&self.terminal).ok()?;
        (talks_to == rustix::process::getpgrp()).then(|| self.terminal.as_fd())
    }

    /// Forgets what was typed before.
    pub(super) fn forget(&self) {
        if self.descriptor().is_some() {
            let _ = rustix::termios::tcflush(&self.terminal, QueueSelector::IFlush);
        }
    }

    /// Whether a line was typed.
    pub(super) fn line(&self) -> bool {
        let mut buffer = [0; 256];
        rustix::io::read(&self.terminal, &mut buffer).is_ok_and(|count| count > 0)
    }
}

/// What `--realtime` got of what it asked for.
#[derive(Debug)]
pub struct Realtime {
    /// Whether the sending thread runs before all ordinary ones (`SCHED_FIFO`).
    pub priority: io::Result<()>,
    /// Whether the program's memory stays in memory.
    pub memory: io::Result<()>,
}

/// The real-time priority of the sending thread, from 1 to 99; its guard's is one higher.
const PRIORITY: i32 = 80;

impl Realtime {
    /// Asks for real-time priority for this thread, and for the memory that this process has now to stay in memory.
    pub fn ask() -> Self {
        Realtime { priority: run_before_others(PRIORITY), memory: lock_memory() }
    }
}

fn lock_memory() -> io::Result<()> {
    Ok(rustix::mm::mlockall(MlockAllFlags::CURRENT)?)
}

/// Lets this thread wake as exactly as the clock can; by default Linux may be 50 µs late.
pub(super) fn wake_exactly() {
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
}

/// Makes this process a guard: nothing but a kill or a stop reaches it, and it wakes as soon as it can.
pub(super) fn become_guard(realtime: bool) {
    ignore(&[SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGALRM, SIGXFSZ]);
    // Fails only for a process that leads its session already.
    let _ = rustix::process::setsid();
    wake_exactly();
    let _ = lock_memory();
    if realtime {
        let _ = run_before_others(PRIORITY + 1);
    }
}

/// Another process, held so that its number cannot come to mean a third one.
#[derive(Debug)]
pub(super) struct Process(OwnedFd);

impl Process {
    pub(super) fn open(id: i32) -> io::Result<Self> {
        let id = Pid::from_raw(id).ok_or(io::ErrorKind::InvalidInput)?;
        Ok(Process(rustix::process::pidfd_open(id, PidfdFlags::empty())?))
    }

    /// Kills it; a process that has ended already stays so.
    pub(super) fn kill(&self) {
        let _ = rustix::process::pidfd_send_signal(&self.0, Signal::KILL);
    }

    /// Waits for its end, at most so many nanoseconds.
    pub(super) fn has_ended(&self, timeout: u64) -> bool {
        let until = crate::clock::now().saturating_add(timeout);
        loop {
            let left = until.saturating_sub(crate::clock::now());
            match wait([(Some(self.0.as_fd()), Ready::IN)], Some(left)) {
                Ok([ready]) if ready.contains(Ready::IN) => return true,
                Ok(_) if left > 0 => {}
                _ => return false,
            }
        }
    }
}

#[expect(unsafe_code, reason = "neither the standard library nor rustix can ignore a signal")]
fn ignore(signals: &[i32]) {
    for &signal in signals {
        // SAFETY: no handler runs: SIG_IGN takes a valid signal number or fails with EINVAL.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }
}

/// `SCHED_FIFO` for this thread, and for none that it starts.
#[expect(unsafe_code, reason = "rustix cannot set a scheduling policy")]
fn run_before_others(priority: i32) -> io::Result<()> {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: the pointer is to a live value of the type that the call reads; 0 is the calling thread.
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
