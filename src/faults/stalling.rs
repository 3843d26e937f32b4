//! The link of a player on a faulty board.

use std::io;
use std::os::fd::BorrowedFd;

use super::Stall;
use crate::link::Link;

/// Passes everything on until the port stalls. Then it takes nothing until its content is discarded.
#[derive(Debug)]
pub struct Stalling<L> {
    inner: L,
    stall: Stall,
}

impl<L: Link> Stalling<L> {
    /// Stalls as `stall` says.
    pub fn new(inner: L, stall: Stall) -> Self {
        Stalling { inner, stall }
    }

    /// Returns the link.
    pub fn into_inner(self) -> L {
        self.inner
    }
}

impl<L: Link> Link for Stalling<L> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.stall.blocks() {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        self.inner.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.inner.read(buffer)
    }

    fn discard(&mut self) -> io::Result<()> {
        self.stall.discard();
        self.inner.discard()
    }

    fn descriptor(&self) -> BorrowedFd<'_> {
        self.inner.descriptor()
    }
}
