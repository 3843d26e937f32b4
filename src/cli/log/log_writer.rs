//! Writes a log to its file.

use std::fs::File;
use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use motionseq::playback::now;
use motionseq::units::Nanos;

use super::super::growing_file::GrowingFile;
use super::log_builder::LogBuilder;
use super::{About, Entry, LoggedRobot, Screen};

/// How often the file is updated. A killed program loses at most this and [`HOLD`] of its log.
const UPDATE: Duration = Duration::from_millis(500);
/// How long a message waits for earlier ones, so that all are written in the order of their times.
const HOLD: Nanos = Nanos::from_millis(250);
/// The end of a log without an index: the records `DataEnd` and `Footer`, and the magic bytes (<https://mcap.dev/spec>). It follows
/// each piece, and the next piece overwrites it, so that every tool can read the log of a program that was killed.
const END: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";
/// How much is buffered for a file that takes nothing. After that, the log ends.
const MOST_PENDING: usize = 16 << 20;

pub(super) const WHY_NOT: Option<&str> = None;

/// Writes until there are no more entries. Returns why the log is not complete, if it is not.
pub(super) fn write(
    (file, name): (File, String),
    robots: Vec<LoggedRobot>,
    about: About,
    screen: Screen,
    entries: &Receiver<(Nanos, usize, Entry)>,
) -> Option<String> {
    let mut writer = LogWriter { out: GrowingFile::new(file, name.clone(), screen), name, screen, is_over: false };
    match writer.write_all(entries, robots, about) {
        Ok(()) => writer.out.failing().map(str::to_owned),
        Err(error) => Some(error.to_string()),
    }
}

struct LogWriter {
    out: GrowingFile,
    name: String,
    screen: Screen,
    /// Whether the log has ended because the file took nothing for too long.
    is_over: bool,
}

impl LogWriter {
    fn write_all(
        &mut self,
        entries: &Receiver<(Nanos, usize, Entry)>,
        robots: Vec<LoggedRobot>,
        about: About,
    ) -> io::Result<()> {
        let mut log = LogBuilder::new(robots)?;
        log.about(about)?;
        let mut written = Instant::now();
        loop {
            match entries.recv_timeout(UPDATE.saturating_sub(written.elapsed())) {
                Ok((at, robot, entry)) if !self.is_over => log.take_of(robot, at, entry)?,
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if written.elapsed() >= UPDATE {
                let until = now() - HOLD;
                // What waits in the queue may be older.
                for (at, robot, entry) in entries.try_iter().filter(|_| !self.is_over) {
                    log.take_of(robot, at, entry)?;
                }
                let piece = log.piece(until)?;
                if !piece.is_empty() || self.out.failing().is_some() {
                    self.write(&piece, END);
                }
                written = Instant::now();
            }
        }
        let last = log.last()?;
        self.write(&last, &[]);
        Ok(())
    }

    /// Writes a piece and an end.
    fn write(&mut self, piece: &[u8], end: &[u8]) {
        if self.is_over {
            return;
        }
        self.out.write(piece, end, END);
        if self.out.pending() > MOST_PENDING
            && let Some(error) = self.out.failing()
        {
            self.screen.warning(&format!("{} ends here: {error}", self.name));
            self.is_over = true;
            self.out.forget();
        }
    }
}
