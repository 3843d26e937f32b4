//! The system calls of playback: waiting, signals, processes, priorities. The only file with `unsafe` in it.

use std::io::{self, Read};
use std::num::NonZeroU64;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::mm::MlockAllFlags;
use rustix::process::{Pid, PidfdFlags, Signal};
use rustix::termios::{LocalModes, OptionalActions, QueueSelector, SpecialCodeIndex, Termios};
use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGXFSZ};

use crate::clock::timespec;
use crate::units::{Micros, Nanos};

pub(crate) use rustix::event::PollFlags as Ready;

/// Waits until one of these descriptors is ready, at most `timeout`, and returns what each is ready for. A signal handler ends the
/// wait with nothing ready.
pub(crate) fn wait<const N: usize>(
    watched: [(Option<BorrowedFd<'_>>, Ready); N],
    timeout: Option<Nanos>,
) -> io::Result<[Ready; N]> {
    let Some(some) = watched.iter().find_map(|(descriptor, _)| *descriptor) else { return Ok([Ready::empty(); N]) };
    // A descriptor that is not watched is replaced by another one with no events.
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

/// Whether poll reports that the other end is gone.
pub(crate) fn is_gone(ready: Ready) -> bool {
    ready.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
}

/// The signals that end or suspend a run: Ctrl-C, Ctrl-\\, Ctrl-Z, a request to terminate, a closed terminal.
#[derive(Debug)]
pub struct Signals {
    pipe: UnixStream,
    /// Whether each signal of [`CAUGHT`] was received.
    caught: [(i32, Arc<AtomicBool>); CAUGHT.len()],
    continued: Arc<AtomicBool>,
}

/// In order of priority: signals that end the run precede the one that suspends it.
const CAUGHT: [i32; 5] = [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP];
/// How long a process waits to be suspended: the system suspends none that no shell can continue.
const DOZE: Nanos = Nanos::from_millis(200);

impl Signals {
    /// Catches them from now on, for the whole process.
    pub fn catch() -> io::Result<Self> {
        let (pipe, sender) = UnixStream::pair()?;
        pipe.set_nonblocking(true)?;
        unblock(CAUGHT.into_iter().chain([SIGCONT]));
        let flag = |signal| {
            let flag = Arc::new(AtomicBool::new(false));
            // A signal that was ignored at the start stays ignored, as `nohup` and a shell's `&` intend.
            if is_ignored(signal) {
                return Ok((signal, flag));
            }
            // In this order, so that the flag is set when the pipe wakes the loop.
            signal_hook::flag::register(signal, Arc::clone(&flag))?;
            signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?;
            io::Result::Ok((signal, flag))
        };
        let [int, term, hup, quit, tstp] = CAUGHT;
        let caught = [flag(int)?, flag(term)?, flag(hup)?, flag(quit)?, flag(tstp)?];
        let (_, continued) = flag(SIGCONT)?;
        // SIGXFSZ would kill the player if a recording exceeds the file size limit; ignored, the write fails instead. SIGTTOU and
        // SIGTTIN would stop a player in the background that writes to the terminal or reads from it.
        ignore([SIGXFSZ, SIGTTOU, SIGTTIN]);
        Ok(Signals { pipe, caught, continued })
    }

    /// The received signal with the highest priority; empties the pipe.
    pub fn take(&self) -> Option<i32> {
        self.empty();
        self.pending()
    }

    /// The received signal with the highest priority, without a system call. Bytes left in the pipe only wake the next wait.
    pub fn pending(&self) -> Option<i32> {
        let mut caught = self.caught.iter();
        caught.find(|(_, flag)| flag.swap(false, Ordering::AcqRel)).map(|(signal, _)| *signal)
    }

    pub(super) fn empty(&self) {
        let mut buffer = [0; 64];
        while matches!((&self.pipe).read(&mut buffer), Ok(count) if count > 0) {}
    }

    /// Whether a signal that ends the run was received.
    fn is_ending(&self) -> bool {
        self.caught.iter().any(|(signal, flag)| *signal != SIGTSTP && flag.load(Ordering::Acquire))
    }

    /// Suspends this process until it is continued, unless a signal ends the run or no shell can continue it. Further Ctrl-Z
    /// meanwhile are ignored.
    pub fn suspend(&self) {
        self.continued.store(false, Ordering::Release);
        if !self.is_ending() {
            stop_this_process();
            // Another thread may be stopped first, or none if the system refuses.
            let until = crate::clock::now().saturating_add(DOZE);
            while !self.continued.load(Ordering::Acquire) && !self.is_ending() {
                let left = until.saturating_sub(crate::clock::now());
                if left == Nanos::ZERO || wait([(Some(self.pipe.as_fd()), Ready::IN)], Some(left)).is_err() {
                    break;
                }
                self.empty();
            }
        }
        for (_, flag) in self.caught.iter().filter(|(signal, _)| *signal == SIGTSTP) {
            flag.store(false, Ordering::Release);
        }
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pipe.as_fd()
    }
}

/// An event descriptor, by which one thread wakes another.
#[derive(Clone, Debug)]
pub(super) struct Bell(Arc<OwnedFd>);

impl Bell {
    pub(super) fn new() -> io::Result<Self> {
        Ok(Bell(Arc::new(eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?)))
    }

    pub(super) fn ring(&self) {
        // It only fails if it has rung very often, and then it wakes all the same.
        let _ = rustix::io::write(&*self.0, &1_u64.to_ne_bytes());
    }

    pub(super) fn empty(&self) {
        let _ = rustix::io::read(&*self.0, &mut [0; 8]);
    }
}

impl AsFd for Bell {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

/// Whether this process is in the foreground of a terminal.
pub fn is_in_foreground(terminal: impl AsFd) -> bool {
    rustix::termios::tcgetpgrp(terminal).is_ok_and(|group| group.as_raw_nonzero().get() == own_group())
}

/// The keys of the terminal that this process was started from.
#[derive(Debug)]
pub struct Keys {
    terminal: OwnedFd,
    /// Whether single keys are read, without Enter and without echo.
    single: bool,
    /// The original state of the terminal, while single keys are read.
    before: Option<Termios>,
    /// Whether Enter plays one step instead of continuing.
    pub enter_steps: bool,
    /// The time of the script of the last reported pause.
    pub(super) reported: Option<Micros>,
    /// The position in the escape sequence of a key, such as an arrow.
    sequence: Sequence,
}

/// The position in an escape sequence: `ESC`, `ESC [ … LETTER` or `ESC O LETTER`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sequence {
    Outside,
    Escape,
    Inside,
}

impl Sequence {
    /// Takes the next character; returns it if it is a key by itself.
    fn take(&mut self, character: u8) -> Option<u8> {
        let was = std::mem::replace(self, Sequence::Outside);
        match (was, character) {
            (_, 0x1B) => *self = Sequence::Escape,
            (Sequence::Escape, b'[' | b'O') | (Sequence::Inside, b'0'..=b'9' | b';' | b'?') => *self = Sequence::Inside,
            (Sequence::Inside, b'@'..=b'~') => {}
            // The Escape key itself, followed by another key.
            _ => return Some(character),
        }
        None
    }
}

impl Keys {
    /// Opens the terminal, if this process has one. With `single`, single keys are read after [`Keys::begin`].
    pub fn open(single: bool) -> Option<Self> {
        let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let terminal = rustix::fs::open("/dev/tty", flags, Mode::empty()).ok()?;
        Some(Keys { terminal, single, before: None, enter_steps: false, reported: None, sequence: Sequence::Outside })
    }

    /// Starts to read single keys, if this process is in the foreground. Ctrl-C and Ctrl-Z keep their meaning.
    pub fn begin(&mut self) {
        if !self.single || self.before.is_some() || !is_in_foreground(&self.terminal) {
            return;
        }
        let Ok(before) = rustix::termios::tcgetattr(&self.terminal) else { return };
        let single = single_keys(&before);
        if rustix::termios::tcsetattr(&self.terminal, OptionalActions::Now, &single).is_ok() {
            self.before = Some(before);
        }
    }

    /// Restores the terminal.
    pub fn end(&mut self) {
        if let Some(before) = self.before.take() {
            let _ = rustix::termios::tcsetattr(&self.terminal, OptionalActions::Now, &before);
        }
    }

    /// Whether single keys are being read.
    pub(super) fn is_single(&self) -> bool {
        self.before.is_some()
    }

    /// The descriptor to poll, while this process is in the foreground.
    pub(super) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        is_in_foreground(&self.terminal).then(|| self.terminal.as_fd())
    }

    /// Discards keys typed before.
    pub(super) fn forget(&self) {
        let _ = rustix::termios::tcflush(&self.terminal, QueueSelector::IFlush);
    }

    /// The next key; of a line, its last character. `None` without a key, or if it sends an escape sequence, such as an arrow.
    pub(super) fn key(&mut self) -> Option<u8> {
        let mut buffer = [0; 256];
        if !self.is_single() {
            let count = rustix::io::read(&self.terminal, &mut buffer).ok()?;
            return buffer.get(..count)?.last().copied();
        }
        let (key, _) = buffer.split_at_mut(1);
        while rustix::io::read(&self.terminal, &mut *key).is_ok_and(|count| count > 0) {
            if let Some(key) = self.sequence.take(*key.first()?) {
                return Some(key);
            }
        }
        None
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        self.end();
    }
}

/// The saved state of a terminal, which a guard restores if its player cannot.
pub(super) struct Terminal {
    /// The terminal and its original state.
    before: Option<(OwnedFd, Termios)>,
    /// The session of the player, and its group.
    session: i32,
    group: i32,
}

impl Terminal {
    /// Saves the state. Must be called before the guard leaves its session and before the player reads single keys.
    pub(super) fn remember() -> Self {
        let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let opened = rustix::fs::open("/dev/tty", flags, Mode::empty());
        let before = opened.ok().and_then(|terminal| {
            let state = rustix::termios::tcgetattr(&terminal).ok()?;
            Some((terminal, state))
        });
        Terminal { before, session: own_session(), group: own_group() }
    }

    /// Restores the state, if the terminal is exactly in the state of a player that reads single keys. Otherwise the player or another
    /// program has changed it, and nothing is done.
    pub(super) fn restore(&self) {
        let Some((terminal, before)) = &self.before else { return };
        let Ok(now) = rustix::termios::tcgetattr(terminal) else { return };
        let is_the_players = is_same(&now, &single_keys(before)) && !is_same(&now, before);
        // Only if the player, its shell or no process is in the foreground.
        let foreground = foreground(self.session);
        let is_anothers = foreground.is_some_and(|group| ![self.group, self.session].contains(&group));
        if is_the_players && !is_anothers {
            let _ = rustix::termios::tcsetattr(terminal, OptionalActions::Now, before);
        }
    }
}

/// The state of a terminal that delivers single keys without echo.
fn single_keys(state: &Termios) -> Termios {
    let mut single = state.clone();
    single.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
    single
}

fn is_same(one: &Termios, other: &Termios) -> bool {
    let modes = |state: &Termios| (state.input_modes, state.output_modes, state.control_modes, state.local_modes);
    let codes = [SpecialCodeIndex::VMIN, SpecialCodeIndex::VTIME, SpecialCodeIndex::VINTR, SpecialCodeIndex::VEOF];
    modes(one) == modes(other) && codes.iter().all(|code| one.special_codes[*code] == other.special_codes[*code])
}

/// The foreground group of the terminal of a session, read from the session leader.
fn foreground(session: i32) -> Option<i32> {
    let stat = std::fs::read_to_string(format!("/proc/{session}/stat")).ok()?;
    // After the name in parentheses: state, parent, group, session, terminal, foreground group.
    let group: i32 = stat.rsplit_once(')')?.1.split_whitespace().nth(5)?.parse().ok()?;
    (group > 0).then_some(group)
}

/// What was granted of `--realtime`.
#[derive(Debug)]
pub struct Realtime {
    /// Real-time priority of the sending thread (`SCHED_FIFO`).
    pub priority: io::Result<()>,
    /// Locked memory.
    pub memory: io::Result<()>,
}

/// The real-time priority of the sending thread, from 1 to 99; that of its guard is one higher.
const PRIORITY: i32 = 80;

impl Realtime {
    /// Requests real-time priority for this thread, and locks the current memory of this process.
    pub fn ask() -> Self {
        Realtime { priority: run_before_others(PRIORITY), memory: lock_memory() }
    }
}

fn lock_memory() -> io::Result<()> {
    Ok(rustix::mm::mlockall(MlockAllFlags::CURRENT)?)
}

/// Makes this thread wake as exactly as possible; by default Linux may be 50 µs late.
pub(crate) fn wake_exactly() {
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
}

/// Signals that cannot be ignored, that report a fault of the program, or the end of a child.
const FAULTS: [i32; 10] = [
    libc::SIGKILL,
    libc::SIGSTOP,
    libc::SIGSEGV,
    libc::SIGBUS,
    libc::SIGILL,
    libc::SIGFPE,
    libc::SIGTRAP,
    libc::SIGSYS,
    libc::SIGABRT,
    libc::SIGCHLD,
];

/// Makes this process a guard: only SIGKILL and SIGSTOP affect it, and it wakes as exactly as possible.
pub(super) fn become_guard(realtime: bool) {
    ignore((1..=libc::SIGRTMAX()).filter(|signal| !FAULTS.contains(signal)));
    // Fails only if this process is a session leader already.
    let _ = rustix::process::setsid();
    wake_exactly();
    let _ = lock_memory();
    if realtime {
        let _ = run_before_others(PRIORITY + 1);
    }
}

/// Another process, by a descriptor, so that its number cannot be reused for another one.
#[derive(Debug)]
pub(super) struct Process(OwnedFd);

impl Process {
    /// The parent of this process, which must have this number. Fails if the parent has died, because its number may be reused.
    pub(super) fn parent(id: i32) -> io::Result<Self> {
        let id = Pid::from_raw(id).ok_or(io::ErrorKind::InvalidInput)?;
        let is_parent = || rustix::process::getppid() == Some(id);
        let gone = || io::Error::other("the player has ended");
        if !is_parent() {
            return Err(gone());
        }
        let process = rustix::process::pidfd_open(id, PidfdFlags::empty())?;
        if is_parent() { Ok(Process(process)) } else { Err(gone()) }
    }

    /// Kills it, if it has not ended.
    pub(super) fn kill(&self) {
        let _ = rustix::process::pidfd_send_signal(&self.0, Signal::KILL);
    }

    /// Waits for its end, at most `timeout`. Returns whether it has ended.
    pub(super) fn has_ended(&self, timeout: Nanos) -> bool {
        let until = crate::clock::now().saturating_add(timeout);
        loop {
            let left = until.saturating_sub(crate::clock::now());
            match wait([(Some(self.0.as_fd()), Ready::IN)], Some(left)) {
                Ok([ready]) if ready.contains(Ready::IN) => return true,
                Ok(_) if left > Nanos::ZERO => {}
                _ => return false,
            }
        }
    }
}

#[expect(unsafe_code, reason = "neither the standard library nor rustix can ignore a signal")]
fn ignore(signals: impl IntoIterator<Item = i32>) {
    for signal in signals {
        // SAFETY: no handler runs: SIG_IGN takes a valid signal number or fails with EINVAL.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }
}

/// Whether a signal is ignored.
#[expect(unsafe_code, reason = "neither the standard library nor rustix can tell")]
fn is_ignored(signal: i32) -> bool {
    // SAFETY: the pointer is to a live value of the type that the call writes; nothing is changed.
    unsafe {
        let mut now: libc::sigaction = std::mem::zeroed();
        libc::sigaction(signal, std::ptr::null(), &raw mut now) == 0 && now.sa_sigaction == libc::SIG_IGN
    }
}

/// Unblocks these signals for this thread and those that it starts, in case the parent process blocked them.
#[expect(unsafe_code, reason = "neither the standard library nor rustix can unblock a signal")]
fn unblock(signals: impl IntoIterator<Item = i32>) {
    // SAFETY: the pointers are to a live set, which is emptied before it is filled and read.
    unsafe {
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut set);
        for signal in signals {
            libc::sigaddset(&raw mut set, signal);
        }
        libc::pthread_sigmask(libc::SIG_UNBLOCK, &raw const set, std::ptr::null_mut());
    }
}

/// Stops this process as Ctrl-Z would; does nothing if no shell can continue it.
#[expect(unsafe_code, reason = "the handler must be put aside for it, and back")]
fn stop_this_process() {
    // SAFETY: all pointers are to live values of the type that the calls read and write, and the handler that is put back is
    // the one that was there.
    unsafe {
        let mut default: libc::sigaction = std::mem::zeroed();
        let mut caught: libc::sigaction = std::mem::zeroed();
        default.sa_sigaction = libc::SIG_DFL;
        if libc::sigaction(libc::SIGTSTP, &raw const default, &raw mut caught) == 0 {
            libc::kill(libc::getpid(), libc::SIGTSTP);
            libc::sigaction(libc::SIGTSTP, &raw const caught, std::ptr::null_mut());
        }
    }
}

/// The process group of this process. Zero if it is in another namespace, which rustix does not handle.
#[expect(unsafe_code, reason = "rustix cannot tell of a group that its namespace does not know")]
fn own_group() -> i32 {
    // SAFETY: it has no arguments and cannot fail.
    unsafe { libc::getpgrp() }
}

/// The session of this process. Zero if it is in another namespace, as in a container that was entered from outside.
#[expect(unsafe_code, reason = "rustix cannot tell of a session that its namespace does not know")]
fn own_session() -> i32 {
    // SAFETY: it takes a number, and cannot fail for this process.
    unsafe { libc::getsid(0) }
}

/// `SCHED_FIFO` for this thread, but not for threads that it starts.
#[expect(unsafe_code, reason = "rustix cannot set a scheduling policy")]
fn run_before_others(priority: i32) -> io::Result<()> {
    // SAFETY: all of its fields are integers. Some C libraries have more of them than the priority.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = priority;
    // SAFETY: the pointer is to a live value of the type that the call reads; 0 is the calling thread.
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
