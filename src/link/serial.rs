//! A serial port. The only file that uses the crate serialport.
//!
//! serialport opens and configures the port. Bytes go through a descriptor of our own, because serialport's `write` blocks
//! regardless of its timeout (measured: 64 KiB with a timeout of 100 ms blocked until the other end closed).

use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::QueueSelector;

use super::Link;

/// An open serial port, locked against other programs.
#[derive(Debug)]
pub struct Serial {
    port: OwnedFd,
}

/// Why a port cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The path does not exist.
    #[error("no such port")]
    Missing,
    /// Another program uses it.
    #[error("another program uses it")]
    InUse,
    /// This user may not open it.
    #[error("permission denied")]
    Forbidden,
    /// It is a file, a folder or another device.
    #[error("it is not a serial port")]
    NotAPort,
    /// It is the terminal of this program.
    #[error("it is the terminal of this program")]
    OwnTerminal,
    /// It is the board's end of a pseudo-terminal, such as `/dev/ptmx`.
    #[error("nothing is connected to it")]
    NoPeer,
    /// Any other error.
    #[error("{0}")]
    Other(String),
}

impl Serial {
    /// Opens a port at `baud` bits a second, 8N1, no flow control.
    ///
    /// Locks a descriptor of our own first, so that a port in use is refused with [`OpenError::InUse`] before anything is
    /// changed. serialport locks its descriptor too (`flock`, since 4.7), which would conflict with our exclusive lock. So ours
    /// is exclusive at first, shared while serialport has the port open with a shared lock, and exclusive again afterwards. A
    /// second player asks for an exclusive lock first, and never gets it.
    pub fn open(path: &Path, baud: u32) -> Result<Self, OpenError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let port = rustix::fs::open(path, flags, Mode::empty()).map_err(|error| open_error(path, error))?;
        if !rustix::termios::isatty(&port) {
            return Err(OpenError::NotAPort);
        }
        // Opening `/dev/ptmx` creates a new terminal, which no program has open.
        if rustix::pty::ptsname(&port, Vec::new()).is_ok() {
            return Err(OpenError::NoPeer);
        }
        if is_own_terminal(&port) {
            return Err(OpenError::OwnTerminal);
        }
        lock(&port, FlockOperation::NonBlockingLockExclusive)?;
        lock(&port, FlockOperation::NonBlockingLockShared)?;
        let name = path.to_str().ok_or(OpenError::NotAPort)?;
        let set_up = serialport::new(name, baud)
            .exclusive(false)
            .timeout(Duration::from_millis(50))
            .open_native()
            .map_err(|error| OpenError::Other(error.to_string()))?;
        // The port keeps its settings while our descriptor is open.
        drop(set_up);
        lock(&port, FlockOperation::NonBlockingLockExclusive)?;
        // For programs that do not lock; root can still open the port.
        let _ = rustix::termios::ioctl_tiocexcl(&port);
        // Discard what the board sent earlier.
        rustix::termios::tcflush(&port, QueueSelector::IFlush).map_err(|error| OpenError::Other(error.to_string()))?;
        Ok(Serial { port })
    }

    /// A port that another process opened, locked and configured, and shares with this one.
    pub(crate) fn inherited(port: OwnedFd) -> io::Result<Self> {
        if !rustix::termios::isatty(&port) {
            return Err(io::Error::other("it is not a serial port"));
        }
        Ok(Serial { port })
    }
}

/// Clears the exclusive mode, which would otherwise remain on a pseudo-terminal and lock out other programs.
impl Drop for Serial {
    fn drop(&mut self) {
        let _ = rustix::termios::ioctl_tiocnxcl(&self.port);
    }
}

/// Whether this is the terminal of this process: only its own terminal reports a session, which is zero if it is in another
/// namespace.
#[expect(unsafe_code, reason = "rustix cannot tell of a session that its namespace does not know")]
fn is_own_terminal(port: &OwnedFd) -> bool {
    // SAFETY: the descriptor is open.
    unsafe { libc::tcgetsid(port.as_raw_fd()) >= 0 }
}

fn lock(port: &OwnedFd, operation: FlockOperation) -> Result<(), OpenError> {
    rustix::fs::flock(port, operation).map_err(|error| match error {
        Errno::WOULDBLOCK => OpenError::InUse,
        other => OpenError::Other(other.to_string()),
    })
}

fn open_error(path: &Path, error: Errno) -> OpenError {
    let is_other = || std::fs::metadata(path).is_ok_and(|meta| !meta.file_type().is_char_device());
    match error {
        Errno::NOENT | Errno::NODEV | Errno::NXIO => OpenError::Missing,
        Errno::BUSY => OpenError::InUse,
        Errno::ACCESS | Errno::PERM if is_other() => OpenError::NotAPort,
        Errno::ACCESS | Errno::PERM => OpenError::Forbidden,
        Errno::ISDIR | Errno::NOTDIR => OpenError::NotAPort,
        other => OpenError::Other(io::Error::from(other).to_string()),
    }
}

impl Link for Serial {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(rustix::io::write(&self.port, bytes)?)
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        Ok(rustix::io::read(&self.port, buffer)?)
    }

    fn discard(&mut self) -> io::Result<()> {
        Ok(rustix::termios::tcflush(&self.port, QueueSelector::OFlush)?)
    }

    fn descriptor(&self) -> BorrowedFd<'_> {
        self.port.as_fd()
    }
}
