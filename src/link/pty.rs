//! A pseudo-terminal: the board's end of a port that a program opens by its path.

use std::ffi::OsString;
use std::fmt;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::OpenptFlags;
use rustix::termios::{ControlModes, OptionalActions};
use rustix::time::Timespec;

use crate::clock::timespec;
use crate::units::Nanos;

/// The board's end of a port.
#[derive(Debug)]
pub struct Pty {
    far: OwnedFd,
    path: PathBuf,
}

impl Pty {
    /// Creates a pseudo-terminal in raw mode; otherwise a 0x04 byte would mean the end of the file, and every byte would be
    /// echoed.
    pub fn open() -> io::Result<Self> {
        let far = rustix::pty::openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        rustix::pty::grantpt(&far)?;
        rustix::pty::unlockpt(&far)?;
        let mut line = rustix::termios::tcgetattr(&far)?;
        line.make_raw();
        rustix::termios::tcsetattr(&far, OptionalActions::Now, &line)?;
        let path = rustix::pty::ptsname(&far, Vec::new())?;
        let path = PathBuf::from(OsString::from_vec(path.into_bytes()));
        Ok(Pty { far, path })
    }

    /// The line settings of the program.
    pub fn settings(&self) -> io::Result<LineSettings> {
        let line = rustix::termios::tcgetattr(&self.far)?;
        let modes = line.control_modes;
        let stops = if modes.contains(ControlModes::CSTOPB) { 2 } else { 1 };
        Ok(LineSettings { baud: line.output_speed(), stops })
    }

    /// Configures the line like a program that sets only the speed.
    pub(super) fn set_up(&self, baud: u32) -> io::Result<()> {
        let mut line = rustix::termios::tcgetattr(&self.far)?;
        line.make_raw();
        line.control_modes.remove(ControlModes::CSTOPB);
        line.set_speed(baud)?;
        Ok(rustix::termios::tcsetattr(&self.far, OptionalActions::Now, &line)?)
    }

    /// The path that a program opens as its serial port.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes reading and writing non-blocking.
    pub fn never_wait(&self) -> io::Result<()> {
        Ok(fcntl_setfl(&self.far, fcntl_getfl(&self.far)? | OFlags::NONBLOCK)?)
    }

    /// Waits at most `time` until the program closes its end or, with `for_bytes`, sends bytes. Returns whether it did.
    pub fn wait(&self, for_bytes: bool, time: Nanos) -> io::Result<bool> {
        let events = if for_bytes { PollFlags::IN } else { PollFlags::empty() };
        let mut polled = [PollFd::new(&self.far, events)];
        match rustix::event::poll(&mut polled, Some(&timespec(time))) {
            Ok(_) | Err(Errno::INTR) => Ok(polled.iter().any(|polled| !polled.revents().is_empty())),
            Err(error) => Err(error.into()),
        }
    }

    /// Whether a program has its end open.
    pub(crate) fn is_in_use(&self) -> io::Result<bool> {
        let mut polled = [PollFd::new(&self.far, PollFlags::empty())];
        rustix::event::poll(&mut polled, Some(&Timespec { tv_sec: 0, tv_nsec: 0 }))?;
        Ok(!polled.iter().any(|polled| polled.revents().contains(PollFlags::HUP)))
    }

    /// How many bytes of the program are not read yet.
    pub fn waiting(&self) -> io::Result<u64> {
        Ok(rustix::io::ioctl_fionread(&self.far)?)
    }

    /// Writes to the program. Bytes that do not fit in its buffer are lost.
    pub fn write(&self, bytes: &[u8]) -> io::Result<()> {
        match rustix::io::write(&self.far, bytes) {
            Ok(_) | Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// Reads what the program wrote. Returns 0 if the program closed its end and everything was read.
    pub fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut read = || rustix::io::read(&self.far, &mut *buffer);
        // Linux may report the end before the last bytes: about once in a thousand runs, a second read finds them.
        match read().or_else(|error| if error == Errno::IO { read() } else { Err(error) }) {
            Err(Errno::IO) => Ok(0),
            other => Ok(other?),
        }
    }
}

/// The line settings of a program. A pseudo-terminal transmits correctly with any settings, where a real line would garble the
/// bytes. Linux keeps neither parity nor data bits of a pseudo-terminal (`pty_set_termios`), so they are unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineSettings {
    /// Bits per second.
    pub baud: u32,
    /// Stop bits.
    pub stops: u8,
}

/// `9600 baud, 1 stop bit`.
impl fmt::Display for LineSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let LineSettings { baud, stops } = self;
        write!(f, "{baud} baud, {stops} stop bit{}", if *stops == 1 { "" } else { "s" })
    }
}

impl AsFd for Pty {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.far.as_fd()
    }
}
