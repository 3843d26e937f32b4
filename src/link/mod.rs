//! Connections to a board.

mod ports;
mod pty;
mod pty_link;
mod serial;

use std::io;
use std::os::fd::BorrowedFd;

pub use ports::{BoardLikelihood, Obstacle, Owner, PortInfo, obstacle, permission, port_at, ports};
pub use pty::{LineSettings, Pty};
pub use pty_link::{PortEvent, PtyLink, PtyLinkError};
pub use serial::{OpenError, Serial};

/// A port that never blocks.
pub trait Link {
    /// Writes as many of these bytes as the port accepts now; fails with [`io::ErrorKind::WouldBlock`] if it accepts none.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Reads received bytes; fails with [`io::ErrorKind::WouldBlock`] if nothing was received. Zero bytes mean a hang-up.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Discards bytes that were written but not sent yet.
    fn discard(&mut self) -> io::Result<()>;

    /// The descriptor to poll for reading, writing and hang-up.
    fn descriptor(&self) -> BorrowedFd<'_>;
}
