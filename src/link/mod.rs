//! The way to a board: what bytes are written to and read from.

mod door;
mod pty;
mod serial;

use std::io;
use std::os::fd::BorrowedFd;

pub use door::{Door, DoorError, PortEvent};
pub use pty::{LineSettings, Pty};
pub use serial::{Likely, OpenError, PortInfo, Serial, ports};

/// A port that never blocks.
pub trait Link {
    /// Gives the port as many of these bytes as it takes now; fails with [`io::ErrorKind::WouldBlock`] where it takes none.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Reads what has come; fails with [`io::ErrorKind::WouldBlock`] where nothing has. Zero bytes are a hang-up.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Throws away what was written but has not left yet.
    fn discard(&mut self) -> io::Result<()>;

    /// What to wait on for reading, writing and hang-up.
    fn descriptor(&self) -> BorrowedFd<'_>;
}
