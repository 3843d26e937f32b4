//! A link that keeps a copy of every byte that the port took.

use std::io;
use std::os::fd::BorrowedFd;

use rtrb::Producer;

use super::Link;

/// Passes everything on, and puts the bytes that the port took into a ring for another thread to write down.
///
/// It never waits: where the ring is full, the bytes are counted as lost and the motion goes on.
pub struct Recorder<L> {
    inner: L,
    ring: Producer<u8>,
    taken: u64,
    lost: u64,
}

impl<L: Link> Recorder<L> {
    /// Records what `inner` takes into `ring`.
    pub fn new(inner: L, ring: Producer<u8>) -> Self {
        Recorder { inner, ring, taken: 0, lost: 0 }
    }

    /// Ends the recording and gives the link back.
    pub fn into_inner(self) -> L {
        self.inner
    }

    /// How many bytes the port took.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// How many bytes did not fit the ring.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

impl<L: Link> Link for Recorder<L> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.inner.write(bytes)?;
        self.taken += taken as u64;
        for &byte in bytes.iter().take(taken) {
            if self.ring.push(byte).is_err() {
                self.lost += 1;
            }
        }
        Ok(taken)
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.inner.read(buffer)
    }

    fn discard(&mut self) -> io::Result<()> {
        self.inner.discard()
    }

    fn descriptor(&self) -> BorrowedFd<'_> {
        self.inner.descriptor()
    }
}
