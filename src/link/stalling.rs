//! A link that takes no bytes any more, for rehearsals.

use std::io;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Link;

/// Passes everything on until somebody says that the port stalls; then it takes nothing, until what it holds is thrown away.
#[derive(Debug)]
pub struct Stalling<L> {
    inner: L,
    stalls: Arc<AtomicBool>,
    /// Whether there is room again.
    discarded: bool,
}

impl<L: Link> Stalling<L> {
    /// Stalls as soon as `stalls` is set.
    pub fn new(inner: L, stalls: Arc<AtomicBool>) -> Self {
        Stalling { inner, stalls, discarded: false }
    }

    /// Gives the link back.
    pub fn into_inner(self) -> L {
        self.inner
    }
}

impl<L: Link> Link for Stalling<L> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.discarded && self.stalls.load(Ordering::Relaxed) {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        self.inner.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.inner.read(buffer)
    }

    fn discard(&mut self) -> io::Result<()> {
        self.discarded = true;
        self.inner.discard()
    }

    fn descriptor(&self) -> BorrowedFd<'_> {
        self.inner.descriptor()
    }
}
