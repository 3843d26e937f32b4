//! Replaces the reader of logs in a build without the cargo feature `mcap`.

use std::io;

/// The first bytes of an MCAP file.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

pub(super) fn listing(_: &[u8]) -> io::Result<(String, bool)> {
    Err(io::Error::other("it is an MCAP file, and this motionseq was built without logs, the cargo feature `mcap`"))
}
