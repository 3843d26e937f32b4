//! Observes a board that other programs use: decodes the bytes once, and passes the events to the display, the tape and the log.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use motionseq::board::{Board, OwnedItem, ReportDecoder, ReportItem, Simulation};
use motionseq::capture::TimedDecoder;
use motionseq::link::PortEvent;
use motionseq::sim::Device;
use motionseq::units::{Micros, Nanos};

use super::display::{Display, Format, UPDATE};
use super::exit::Exit;
use super::log::Log;
use super::observer::{Event, Seen};
use super::screen::{Screen, plural};
use super::tape::Tape;
use super::worker::Worker;

/// The most pieces that may wait to be shown, and the most items of a piece: noise may be one item per byte.
const ROOM: usize = 16 * 1024;
const PIECE: usize = 64;
/// How long the end waits for a screen that takes nothing.
const PATIENCE: Duration = Duration::from_secs(1);

/// Passes the events of a board, virtual or real, to its observers. The server waits for none of them, so a blocked terminal does not
/// delay the robot.
pub(super) struct Watcher {
    screen: Screen,
    /// Whether bytes pass to a real board, which continues even if nothing can be shown.
    is_tap: bool,
    /// The display, and whether it has ended.
    display: Worker<(Micros, Event), io::Result<()>>,
    is_over: bool,
    /// The recording, if there is one.
    tape: Option<Tape>,
    /// The log, if there is one.
    log: Option<Log>,
    decoder: TimedDecoder,
    reports: ReportDecoder,
    now: Micros,
    /// Whether there is something to show at once; when the state of the board was last passed on.
    is_fresh: bool,
    told: Micros,
}

impl Watcher {
    /// Starts; shows frames on standard output, or not.
    pub(super) fn start(
        screen: Screen,
        shown: Option<Format>,
        baud: u32,
        board: Arc<Board>,
        is_tap: bool,
    ) -> io::Result<Self> {
        let (decoder, reports) = (TimedDecoder::new(&board, baud), ReportDecoder::new(&board));
        let display = Display::new(screen, shown, baud, board);
        Ok(Watcher {
            screen,
            is_tap,
            display: Worker::start("display", ROOM, |events| display.run(events))?,
            is_over: false,
            tape: None,
            log: None,
            decoder,
            reports,
            now: Micros::ZERO,
            is_fresh: false,
            told: Micros::ZERO,
        })
    }

    /// Adds a recording and a log.
    pub(super) fn keeping(self, tape: Option<Tape>, log: Option<Log>) -> Self {
        Watcher { tape, log, ..self }
    }

    /// Passes on what happened at a time, at a virtual board or a real one. Fails if nothing can be shown any more.
    pub(super) fn watch(&mut self, now: Micros, happened: PortEvent<'_>, board: Option<&Device>) -> io::Result<()> {
        self.now = now;
        match happened {
            PortEvent::Opened => self.tell(Event::Opened),
            PortEvent::Closed => self.tell(Event::Closed),
            PortEvent::Came(at, bytes) => self.came(at, bytes),
            PortEvent::Answered(bytes) => {
                let mut newest = Vec::new();
                self.reports.feed(bytes, |item| {
                    if let ReportItem::Report(report) = item {
                        newest.push(report);
                    }
                });
                newest.into_iter().try_for_each(|report| self.tell(Event::Report(report)))
            }
            PortEvent::Behind(bytes, delay) => self.tell(Event::Behind(bytes, delay)),
            PortEvent::Unread(bytes) => self.tell(Event::Unread(bytes)),
            PortEvent::SetUp(settings) => self.tell(Event::SetUp(settings)),
            PortEvent::Passed => self.passed(board),
            _ => Ok(()),
        }
    }

    fn came(&mut self, at: Nanos, bytes: &[u8]) -> io::Result<()> {
        let mut items = Vec::new();
        self.decoder.feed(at, bytes, |at, item| items.push((at, OwnedItem::from(item))));
        self.is_fresh |= !items.is_empty();
        let mut items = items.into_iter();
        while items.len() > 0 {
            self.tell(Event::Came(items.by_ref().take(PIECE).collect()))?;
        }
        Ok(())
    }

    fn passed(&mut self, board: Option<&Device>) -> io::Result<()> {
        let is_due = self.now - self.told >= UPDATE;
        if !is_due && !self.is_fresh {
            return Ok(());
        }
        self.is_fresh = false;
        let mut seen = None;
        if is_due {
            self.told = self.now;
            seen = board.map(|board| {
                let received = board.received();
                let pose = Some(received.pose).filter(|_| board.family().simulation == Simulation::Mecanum);
                Arc::new(Seen { state: received.state.clone(), pose, report: board.report() })
            });
        }
        self.tell(Event::Passed(seen))
    }

    fn tell(&mut self, event: Event) -> io::Result<()> {
        self.keep(&event);
        // The display ends early only if it cannot write.
        if self.is_over || self.display.send((self.now, event)) {
            return Ok(());
        }
        let why = self.display.ended().and_then(Result::err);
        let why = why.unwrap_or_else(|| io::Error::other("the thread that shows it failed"));
        if !self.is_tap {
            return Err(why);
        }
        self.is_over = true;
        self.screen.warning(&format!("nothing more can be shown: {why}; bytes still pass"));
        Ok(())
    }

    fn keep(&mut self, event: &Event) {
        if let Some(tape) = &mut self.tape {
            tape.take(self.now, event);
        }
        if let Some(log) = &mut self.log {
            log.take(self.now, event);
        }
    }

    /// Shows the rest, and ends the display, and the log with the result of the command. Returns the result, which counts whether the
    /// log is complete, and the tape, which must be ended, too.
    pub(super) fn end(mut self, result: Exit, cause: &str) -> (Exit, Option<Tape>) {
        // A truncated frame is recorded, but not shown.
        let mut cut = Vec::new();
        self.decoder.finish(|at, item| cut.push((at, OwnedItem::from(item))));
        if !cut.is_empty() {
            self.keep(&Event::Came(cut.into()));
        }
        let Watcher { screen, display, tape, log, .. } = self;
        let (_, missed) = display.end(PATIENCE, "the screen");
        if missed > 0 {
            let missed = plural(usize::try_from(missed).unwrap_or(usize::MAX), "piece");
            screen.note(&format!("{missed} were not shown: standard output was too slow"));
        }
        let is_whole = log.is_none_or(|log| log.end(result, cause));
        (if is_whole || result != Exit::Ok { result } else { Exit::Usage }, tape)
    }
}
