//! A link that keeps a copy of every byte that the port took.

use std::io;
use std::os::fd::BorrowedFd;

use rtrb::Producer;

use super::Link;
use crate::clock::now;
use crate::units::Nanos;

/// Bytes that a port took, at most as many as a frame of any command has; more are several of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// When, on the clock of [`now`].
    pub at: Nanos,
    bytes: [u8; PIECE],
    length: u8,
}

/// How many bytes are kept together: with their time they fill half a line of a processor's cache.
const PIECE: usize = 23;

impl Taken {
    fn new(at: Nanos, bytes: &[u8]) -> Self {
        let mut taken = Taken { at, bytes: [0; PIECE], length: 0 };
        for (place, byte) in taken.bytes.iter_mut().zip(bytes) {
            *place = *byte;
            taken.length += 1;
        }
        taken
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }
}

/// Passes everything on, and puts the bytes that the port took into a ring for another thread to write down.
///
/// It never waits: where the ring is full, the bytes are counted as lost and the motion goes on.
pub struct Recorder<L> {
    inner: L,
    ring: Producer<Taken>,
    taken: u64,
    lost: u64,
}

impl<L: Link> Recorder<L> {
    /// Records what `inner` takes into `ring`.
    pub fn new(inner: L, ring: Producer<Taken>) -> Self {
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
        let at = now();
        for piece in bytes.get(..taken).unwrap_or_default().chunks(PIECE) {
            if self.ring.push(Taken::new(at, piece)).is_err() {
                self.lost += piece.len() as u64;
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
