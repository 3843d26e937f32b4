//! The thread that writes a recording: whatever serves the board never waits for the disk.

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::time::{Duration, Instant};

use motionseq::board::Board;
use motionseq::capture::{ScriptWriter, TimedDecoder};
use motionseq::link::PortEvent;
use motionseq::source::MAX_SOURCE;
use motionseq::units::{Micros, Nanos};

use super::growing::Growing;
use super::screen::Screen;
use super::start_thread;

/// What may wait to be written down, in pieces.
const ROOM: usize = 64 * 1024;
/// How often the file is brought up to date.
const UPDATE: Duration = Duration::from_millis(300);
/// How long the end waits for a file that takes nothing.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often the time is told where nothing else happens.
const TELL: Micros = Micros::from_millis(100);

/// A recording under way.
pub(super) struct Tape {
    pieces: SyncSender<(Micros, Piece)>,
    kept: Receiver<Kept>,
    told: Micros,
    lost: u64,
}

/// What is written down.
enum Piece {
    Came(Nanos, Box<[u8]>),
    Note(&'static str),
    Nothing,
}

/// What became of a recording.
pub(super) struct Kept {
    /// Frames that came, and lines of the script that say them.
    pub(super) frames: u64,
    pub(super) lines: u64,
    /// Why it is not whole.
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
        let (pieces, to_write) = mpsc::sync_channel(ROOM);
        let (keep, kept) = mpsc::channel();
        let file = match file {
            Some(file) => file,
            None => File::from(std::os::fd::AsFd::as_fd(&io::stdout()).try_clone_to_owned()?),
        };
        let out = Growing::new(file, "the recording".to_owned(), screen);
        let mut scribe = ScriptWriter::new(Arc::clone(board), exact, baud);
        if !out.is_file {
            // What is written to a pipe cannot be amended.
            scribe.widen();
        }
        let writer = Writer {
            scribe,
            decoder: TimedDecoder::new(board, baud),
            out,
            lines: 0,
            screen,
            now: Micros::ZERO,
            begin: None,
            failed: None,
        };
        start_thread("tape", move || {
            let _ = keep.send(writer.run(&to_write));
        })?;
        Ok(Tape { pieces, kept, told: Micros::ZERO, lost: 0 })
    }

    /// Takes in what happened at a time.
    pub(super) fn take(&mut self, now: Micros, happened: PortEvent<'_>) {
        let piece = match happened {
            PortEvent::Came(at, bytes) => Piece::Came(at, bytes.into()),
            PortEvent::Opened => Piece::Note("a program has opened the port"),
            PortEvent::Closed => Piece::Note("the program has closed the port"),
            PortEvent::Passed if now >= self.told + TELL => Piece::Nothing,
            _ => return,
        };
        self.told = now;
        self.lost += u64::from(self.pieces.try_send((now, piece)).is_err());
    }

    /// Ends it, and says what became of it.
    pub(super) fn end(self) -> Kept {
        let Tape { pieces, kept, lost, .. } = self;
        drop(pieces);
        let mut kept = kept.recv_timeout(PATIENCE).unwrap_or_else(|why| {
            let why = match why {
                RecvTimeoutError::Timeout => "the file takes no more bytes",
                RecvTimeoutError::Disconnected => "the thread that writes it failed",
            };
            Kept { frames: 0, lines: 0, failed: Some(why.to_owned()) }
        });
        if lost > 0 {
            kept.failed.get_or_insert(format!("{lost} pieces came faster than they could be written"));
        }
        kept
    }
}

struct Writer {
    scribe: ScriptWriter,
    decoder: TimedDecoder,
    out: Growing,
    lines: u64,
    screen: Screen,
    now: Micros,
    /// When the first frame came.
    begin: Option<Micros>,
    failed: Option<String>,
}

impl Writer {
    fn run(mut self, pieces: &Receiver<(Micros, Piece)>) -> Kept {
        let mut written = Instant::now();
        loop {
            let ended = match pieces.recv_timeout(UPDATE.saturating_sub(written.elapsed())) {
                Ok((now, piece)) => {
                    self.take(now, piece);
                    false
                }
                Err(RecvTimeoutError::Timeout) => false,
                Err(RecvTimeoutError::Disconnected) => true,
            };
            if ended {
                break;
            }
            if written.elapsed() >= UPDATE {
                self.scribe.settle(self.now);
                let tail = self.scribe.tail();
                self.write(&tail);
                written = Instant::now();
            }
        }
        if self.failed.is_none() {
            let scribe = &mut self.scribe;
            self.decoder.finish(|at, item| scribe.take(at, item));
        }
        self.scribe.finish(self.now);
        let failed = self.write("");
        Kept { frames: self.scribe.frames(), lines: self.lines, failed: self.failed.or(failed) }
    }

    fn take(&mut self, now: Micros, piece: Piece) {
        self.now = self.now.max(now);
        if self.failed.is_some() {
            return;
        }
        let begin = *self.begin.get_or_insert(now);
        if now - begin >= Micros::DAY || self.out.length() + MARGIN >= MAX_SOURCE {
            // What stands so far is a script; more would be none.
            let failed = "it is as long as a script may be: 64 MiB and 24 hours".to_owned();
            self.screen.warning(&format!("at {now:.3} s the recording ends: {failed}"));
            self.failed = Some(failed);
            return;
        }
        let scribe = &mut self.scribe;
        match piece {
            Piece::Came(at, bytes) => self.decoder.feed(at, &bytes, |at, item| scribe.take(at, item)),
            Piece::Note(words) => scribe.note(now, words),
            Piece::Nothing => {}
        }
    }

    /// Brings the file up to date; where that fails it is tried again the next time.
    fn write(&mut self, tail: &str) -> Option<String> {
        let settled = self.scribe.settled();
        self.lines += settled.lines().filter(|line| line.starts_with("at ")).count() as u64;
        if let Some((at, text)) = self.scribe.amendment() {
            self.out.amend(at as u64, text.as_bytes());
        }
        self.out.write(settled.as_bytes(), tail.as_bytes(), b"");
        self.out.failing().map(str::to_owned)
    }
}

/// How much of the largest script may not be settled.
const MARGIN: u64 = 1 << 20;
