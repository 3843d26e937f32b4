//! The thread that writes a recording. The server of the board never waits for the disk.

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use motionseq::board::Board;
use motionseq::capture::ScriptWriter;
use motionseq::source::MAX_SOURCE;
use motionseq::units::Micros;

use super::growing_file::GrowingFile;
use super::observer::Event;
use super::screen::Screen;
use super::worker::Worker;

/// How many pieces may wait to be written.
const ROOM: usize = 64 * 1024;
/// How often the file is updated.
const UPDATE: Duration = Duration::from_millis(300);
/// How long the end waits for a file that takes no bytes.
const PATIENCE: Duration = Duration::from_secs(3);

/// A recording that is being written.
pub(super) struct Tape(Worker<(Micros, Event), Kept>);

/// The result of a recording.
pub(super) struct Kept {
    /// The number of frames, and of lines of the script that send them.
    pub(super) frames: u64,
    pub(super) lines: u64,
    /// Why it is not complete.
    pub(super) failed: Option<String>,
}

impl Tape {
    /// Starts a recording into a file, or into standard output.
    pub(super) fn start(
        file: Option<File>,
        exact: bool,
        baud: u32,
        board: &Arc<Board>,
        screen: Screen,
    ) -> io::Result<Self> {
        let file = match file {
            Some(file) => file,
            None => File::from(std::os::fd::AsFd::as_fd(&io::stdout()).try_clone_to_owned()?),
        };
        let out = GrowingFile::new(file, "the recording".to_owned(), screen);
        let mut script = ScriptWriter::new(Arc::clone(board), exact, baud);
        if !out.is_file {
            // The start of a pipe cannot be amended later.
            script.widen_all();
        }
        let (now, begin) = (Micros::ZERO, None);
        let writer = Writer { script, out, screen, now, begin, was_closed: false, failed: None };
        Worker::start("tape", ROOM, |events| writer.run(events)).map(Tape)
    }

    /// Adds what happened at a time, and the time.
    pub(super) fn take(&mut self, now: Micros, event: &Event) {
        if matches!(event, Event::Came(_) | Event::Opened | Event::Closed | Event::Passed(_)) {
            self.0.send((now, event.clone()));
        }
    }

    /// Ends it, and returns the result.
    pub(super) fn end(self) -> Kept {
        let (ended, lost) = self.0.end(PATIENCE, "the file");
        let mut kept = ended.unwrap_or_else(|why| Kept { frames: 0, lines: 0, failed: Some(why) });
        if lost > 0 {
            kept.failed.get_or_insert(format!("{lost} pieces came faster than they could be written"));
        }
        kept
    }
}

struct Writer {
    script: ScriptWriter,
    out: GrowingFile,
    screen: Screen,
    now: Micros,
    /// The time of the first frame.
    begin: Option<Micros>,
    /// Whether a program has closed the port.
    was_closed: bool,
    failed: Option<String>,
}

impl Writer {
    fn run(mut self, events: &Receiver<(Micros, Event)>) -> Kept {
        let mut written = Instant::now();
        loop {
            match events.recv_timeout(UPDATE.saturating_sub(written.elapsed())) {
                Ok((now, event)) => self.take(now, &event),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if written.elapsed() >= UPDATE {
                self.script.settle(self.now);
                let tail = self.script.tail();
                self.write(&tail);
                written = Instant::now();
            }
        }
        self.script.finish(self.now);
        let failed = self.write("");
        Kept { frames: self.script.frames(), lines: self.script.lines(), failed: self.failed.or(failed) }
    }

    fn take(&mut self, now: Micros, event: &Event) {
        self.now = self.now.max(now);
        if self.failed.is_some() {
            return;
        }
        let begin = *self.begin.get_or_insert(now);
        if now - begin >= Micros::DAY || self.out.length() + MARGIN >= MAX_SOURCE {
            // The recording is a script so far. A longer one would be too long for a script.
            let failed = "a script may be at most 64 MiB and 24 hours long".to_owned();
            self.screen.warning(&format!("at {now:.3} s the recording ends: {failed}"));
            self.failed = Some(failed);
            return;
        }
        let script = &mut self.script;
        match event {
            Event::Came(items) => items.iter().for_each(|(at, item)| script.take(*at, item.item())),
            Event::Opened if self.was_closed => script.reopened(now),
            Event::Closed => {
                self.was_closed = true;
                script.closed(now);
            }
            _ => {}
        }
    }

    /// Updates the file. A failed write is tried again the next time.
    fn write(&mut self, tail: &str) -> Option<String> {
        let settled = self.script.settled();
        if let Some((at, text)) = self.script.amendment() {
            self.out.amend(at as u64, text.as_bytes());
        }
        self.out.write(settled.as_bytes(), tail.as_bytes(), b"");
        self.out.failing().map(str::to_owned)
    }
}

/// The largest part of a script that may still change.
const MARGIN: u64 = 1 << 20;
