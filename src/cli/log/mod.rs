//! `--log`: the thread that writes a log. Playing and serving never wait for it.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use motionseq::board::{Board, Command, OwnedItem, Report};
use motionseq::playback::now;
use motionseq::sim::Pose;
use motionseq::units::{Micros, Nanos};

use super::exit::Exit;
use super::growing_file;
use super::observer::Event;
use super::output::{self, Inputs};
use super::screen::Screen;
use super::worker::Worker;

#[cfg(feature = "mcap")]
mod log_builder;
#[cfg_attr(not(feature = "mcap"), path = "absent.rs")]
mod log_writer;
mod run;

pub(super) use run::TimelineLog;

/// How many entries may wait to be written.
const ROOM: usize = 16 * 1024;
/// How long the end waits for a file that takes no bytes.
const PATIENCE: Duration = Duration::from_millis(500);

/// A log that is being written.
pub(super) struct Log {
    path: PathBuf,
    screen: Screen,
    /// Returns at its end why the log is not complete.
    worker: Worker<(Nanos, Entry), Option<String>>,
    /// Time 0, on the clock of [`now`].
    begin: Nanos,
}

/// Something that happened.
#[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "only a log reads them"))]
pub(super) enum Entry {
    /// Time 0 since the start of 1970.
    Begin { since_1970: Nanos },
    /// Bytes went to the board at this time.
    Bytes(Box<[u8]>),
    /// Frames went to the board, and bytes that are not frames, each at its time.
    Items(Arc<[(Micros, OwnedItem)]>),
    /// A frame of the script was written to the port, with its lateness.
    Late { script: Micros, late: Nanos, command: Command, place: Option<Spot> },
    /// The board has reported.
    Report(Report),
    /// The position of the robot of a virtual board.
    Pose(Pose),
    /// A mark of the script was passed.
    Mark { name: String, script: Micros },
    /// A line for the reader.
    Line { level: Level, text: String, place: Option<Spot> },
}

/// A file and a line.
pub(super) type Spot = (String, usize);

/// The level of a line.
#[derive(Clone, Copy, Debug)]
pub(super) enum Level {
    Info,
    Warning,
    Error,
}

impl Log {
    /// Starts the log that is asked for, next to another result, or reports why it cannot.
    pub(super) fn open(
        path: Option<&Path>,
        beside: Option<&File>,
        board: Arc<Board>,
        screen: &Screen,
    ) -> Result<Option<Self>, Exit> {
        let Some(path) = path else { return Ok(None) };
        let file = growing_file::create(path, &Inputs::default()).and_then(|created| match beside {
            Some(other) if growing_file::is_same(&created.file, other) => Err(io::Error::other("it is the file of -o")),
            _ => Ok(created.file),
        });
        let started = file.and_then(|file| Log::start(file, path, board, *screen));
        started.map(Some).map_err(|error| output::exit(Err(error), Some(path), screen))
    }

    /// Starts a log in a file, and discards the content of the file. Time 0 is now.
    pub(super) fn start(file: File, path: &Path, board: Arc<Board>, screen: Screen) -> io::Result<Self> {
        if let Some(why_not) = log_writer::WHY_NOT {
            return Err(io::Error::other(why_not));
        }
        growing_file::begin(&file)?;
        let name = format!("the log {}", path.display());
        let worker = Worker::start("log", ROOM, move |entries| log_writer::write(file, name, board, screen, entries))?;
        let mut log = Log { path: path.to_owned(), screen, worker, begin: Nanos::ZERO };
        log.begin(now());
        Ok(log)
    }

    /// Sets time 0, on the clock of [`now`].
    pub(super) fn begin(&mut self, begin: Nanos) {
        self.begin = begin;
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let since_1970 = Nanos(u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX));
        self.put(begin, Entry::Begin { since_1970: since_1970 - (now() - begin) });
    }

    /// Adds what happened at a time on the clock of [`now`].
    pub(super) fn put(&mut self, at: Nanos, entry: Entry) {
        self.worker.send((at - self.begin, entry));
    }

    /// Adds what happened at a board that other programs use, at a time since time 0.
    pub(super) fn take(&mut self, time: Micros, event: &Event) {
        let at = self.begin + time.nanos();
        match event {
            Event::Came(items) => self.put(at, Entry::Items(Arc::clone(items))),
            Event::Report(report) => self.put(at, Entry::Report(*report)),
            Event::Passed(seen) => seen.iter().for_each(|seen| self.put(at, Entry::Pose(seen.pose))),
            Event::Opened => self.line(at, Level::Info, "a program has opened the port"),
            Event::Closed => self.line(at, Level::Info, "the program has closed the port"),
            Event::Behind(bytes, Micros(delay)) => {
                let text =
                    format!("the program has sent more than the line can carry: {bytes} bytes wait for {delay} us");
                self.line(at, Level::Warning, text);
            }
            Event::Unread(bytes) => {
                self.line(at, Level::Warning, format!("{bytes} bytes of the program were not read"));
            }
            Event::SetUp(settings) => {
                self.line(at, Level::Warning, format!("the program has set its line to {settings}"));
            }
        }
    }

    /// Adds a line.
    pub(super) fn line(&mut self, at: Nanos, level: Level, text: impl Into<String>) {
        self.put(at, Entry::Line { level, text: text.into(), place: None });
    }

    /// Ends the log, and warns if it is not complete. Returns whether it is.
    pub(super) fn end(self) -> bool {
        let Log { path, screen, worker, .. } = self;
        let (failed, lost) = worker.end(PATIENCE, "it");
        let lost = (lost > 0).then(|| format!("{lost} entries came faster than they could be written"));
        let why_not = failed.unwrap_or_else(Some).or(lost);
        if let Some(why) = &why_not {
            screen.warning(&format!("the log {} is incomplete: {why}; this affects only the log", path.display()));
        }
        why_not.is_none()
    }
}
