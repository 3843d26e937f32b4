//! What is shown, and kept, of a board that other programs use.

use std::io::{self, BufWriter, IsTerminal as _, Write as _};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};
use std::time::Duration;

use clap::ValueEnum;
use motionseq::board::{Board, Item, ON_SILENCE, Report, ReportDecoder, ReportItem, Skip, State};
use motionseq::capture::{Listing, TimedDecoder};
use motionseq::link::{LineSettings, PortEvent};
use motionseq::sim::{Pose, VirtualBoard};
use motionseq::units::{Micros, Nanos};

use super::decode::doubt;
use super::log::{Entry, Level, Log};
use super::screen::{Screen, plural};
use super::start_thread;
use super::state_line::{active_words, drive_words};
use super::tape::Tape;

/// How often the line about the robot is drawn.
const UPDATE: Micros = Micros::from_millis(100);

/// How frames are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Seconds, frame and command, separated by TABs
    Listing,
    /// One JSON object a line
    Jsonl,
}

/// How much may wait to be shown, in pieces.
const ROOM: usize = 16 * 1024;
/// How long frames wait for the line about the robot to be cleared, on a terminal.
const CLEARED: Duration = Duration::from_millis(50);
/// How long the end waits for a screen that takes nothing.
const PATIENCE: Duration = Duration::from_secs(1);

/// Watches what happens at a board, virtual or real: has it shown, and kept. Whoever serves the board or passes its bytes on
/// waits for none of these, so that a terminal that stands still stands in no robot's way.
pub(super) struct Watcher {
    screen: Screen,
    /// Whether bytes pass to a real board, which goes on where nothing can be shown.
    is_tap: bool,
    shown: Option<SyncSender<(Micros, Sight)>>,
    /// How showing it has ended.
    end: Receiver<io::Result<()>>,
    /// What was not shown, as the screen could not follow.
    missed: u64,
    /// Where it is written down, if it is.
    tape: Option<Tape>,
    /// Where all that happens is logged, if it is.
    log: Option<Log>,
    reports: ReportDecoder,
    /// Whether something came that is to be shown at once; when the thread was told last how the board is.
    is_fresh: bool,
    told: Micros,
}

/// What there is to show.
enum Sight {
    Opened,
    Closed,
    Came(Nanos, Box<[u8]>),
    Behind(u64, Micros),
    Unread(u64),
    SetUp(LineSettings),
    Report(Report),
    /// Some time has passed; how a virtual board is now, now and then.
    Passed(Option<Box<Seen>>),
}

/// How a virtual board is. What a fault has kept from it, it was not told.
struct Seen {
    state: State,
    pose: Pose,
    report: Report,
}

/// Shows it.
struct Display {
    screen: Screen,
    /// Where frames are shown, if they are.
    shown: Option<Shown>,
    decoder: TimedDecoder,
    /// What the board was told, and what it said last.
    state: State,
    report: Option<Report>,
    seen: Option<Box<Seen>>,
    /// When the line about the robot was drawn last.
    drawn: Micros,
    /// Whether there are frames that were not shown yet.
    is_fresh: bool,
    is_open: bool,
    /// Frames and runs of bytes that no correct program sends, and why the last bytes were skipped, if they were.
    wrong: u64,
    run: Option<Skip>,
    baud: u32,
    board: Arc<Board>,
    /// Whether a frame has come that can be read in two ways.
    has_doubt: bool,
}

/// Standard output, in one of two forms.
enum Shown {
    Listing(Listing<BufWriter<io::Stdout>>),
    Jsonl(BufWriter<io::Stdout>, Arc<Board>),
}

impl Shown {
    fn new(format: Format, board: Arc<Board>) -> Self {
        let out = BufWriter::new(io::stdout());
        match format {
            Format::Listing => Shown::Listing(Listing::new(out, board)),
            Format::Jsonl => Shown::Jsonl(out, board),
        }
    }

    fn take(&mut self, now: Micros, item: Item<'_>) -> io::Result<()> {
        match self {
            Shown::Listing(listing) => {
                listing.take(format_args!("{now:.6}"), item);
                Ok(())
            }
            Shown::Jsonl(out, board) => motionseq::capture::write_json(board, now, item, out),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Shown::Listing(listing) => {
                listing.flush();
                listing.failure()
            }
            Shown::Jsonl(out, _) => out.flush(),
        }
    }

    fn end_run(&mut self) {
        if let Shown::Listing(listing) = self {
            listing.end_run();
        }
    }
}

impl Watcher {
    /// Starts to watch; shows frames on standard output, or not.
    pub(super) fn start(
        screen: Screen,
        shown: Option<Format>,
        baud: u32,
        board: Arc<Board>,
        is_tap: bool,
    ) -> io::Result<Self> {
        let reports = ReportDecoder::new(board.codec.replies);
        let (show, sights) = mpsc::sync_channel(ROOM);
        let (tell, end) = mpsc::channel();
        let display = Display {
            screen,
            shown: shown.map(|format| Shown::new(format, Arc::clone(&board))),
            has_doubt: false,
            decoder: TimedDecoder::new(&board, baud),
            board,
            state: State::default(),
            report: None,
            seen: None,
            drawn: Micros::ZERO,
            is_fresh: false,
            is_open: false,
            wrong: 0,
            run: None,
            baud,
        };
        start_thread("display", move || {
            let _ = tell.send(display.run(&sights));
        })?;
        Ok(Watcher {
            screen,
            is_tap,
            shown: Some(show),
            end,
            missed: 0,
            tape: None,
            log: None,
            reports,
            is_fresh: false,
            told: Micros::ZERO,
        })
    }

    /// Writes down what comes, too.
    pub(super) fn with_tape(self, tape: Tape) -> Self {
        Watcher { tape: Some(tape), ..self }
    }

    /// Logs what happens, too.
    pub(super) fn with_log(self, log: Option<Log>) -> Self {
        Watcher { log, ..self }
    }

    /// Takes in what happened at a time, at a virtual board or a real one. Fails where nobody can be shown anything any more.
    pub(super) fn watch(
        &mut self,
        now: Micros,
        happened: PortEvent<'_>,
        board: Option<&VirtualBoard>,
    ) -> io::Result<()> {
        if let Some(tape) = &mut self.tape {
            tape.take(now, happened);
        }
        if let Some(log) = &mut self.log {
            log_happened(log, now, happened);
        }
        match happened {
            PortEvent::Opened => self.show(now, Sight::Opened),
            PortEvent::Closed => self.show(now, Sight::Closed),
            PortEvent::Came(at, bytes) => {
                self.is_fresh = true;
                self.show(now, Sight::Came(at, bytes.into()))
            }
            PortEvent::Answered(bytes) => {
                let mut newest = Vec::new();
                self.reports.feed(bytes, |item| {
                    if let ReportItem::Report(report) = item {
                        newest.push(report);
                    }
                });
                newest.into_iter().try_for_each(|report| {
                    if let Some(log) = &mut self.log {
                        log.put(log.at(now.nanos()), Entry::Report(report));
                    }
                    self.show(now, Sight::Report(report))
                })
            }
            PortEvent::Behind(bytes, delay) => self.show(now, Sight::Behind(bytes, delay)),
            PortEvent::Unread(bytes) => self.show(now, Sight::Unread(bytes)),
            PortEvent::SetUp(settings) => self.show(now, Sight::SetUp(settings)),
            PortEvent::Passed => self.passed(now, board),
            _ => Ok(()),
        }
    }

    fn passed(&mut self, now: Micros, board: Option<&VirtualBoard>) -> io::Result<()> {
        let is_due = now - self.told >= UPDATE;
        if !is_due && !self.is_fresh {
            return Ok(());
        }
        self.is_fresh = false;
        let mut seen = None;
        if is_due {
            self.told = now;
            seen = board.map(|board| {
                let received = board.received();
                Box::new(Seen { state: received.state.clone(), pose: received.pose, report: board.report() })
            });
        }
        if let (Some(log), Some(seen)) = (&mut self.log, &seen) {
            log.put(log.at(now.nanos()), Entry::Pose(seen.pose));
        }
        self.show(now, Sight::Passed(seen))
    }

    fn show(&mut self, now: Micros, sight: Sight) -> io::Result<()> {
        let Some(shown) = &self.shown else { return Ok(()) };
        match shown.try_send((now, sight)) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => {
                self.missed += 1;
                Ok(())
            }
            // It goes only where it cannot write.
            Err(TrySendError::Disconnected(_)) => {
                let why = self.end.try_recv().ok().and_then(Result::err);
                let why = why.unwrap_or_else(|| io::Error::other("the thread that shows it failed"));
                if !self.is_tap {
                    return Err(why);
                }
                self.shown = None;
                self.screen.warning(&format!("nothing more can be shown: {why}; bytes pass as before"));
                Ok(())
            }
        }
    }

    /// Shows what is left, and ends, as the log does; gives the tape, which is to be ended too.
    pub(super) fn end(self) -> Option<Tape> {
        let Watcher { screen, shown, end, missed, tape, log, .. } = self;
        drop(shown);
        let _ = end.recv_timeout(PATIENCE);
        if missed > 0 {
            let missed = plural(usize::try_from(missed).unwrap_or(usize::MAX), "piece");
            screen.note(&format!("{missed} of what happened could not be shown: nobody took it in time"));
        }
        if let Some(log) = log {
            log.end();
        }
        tape
    }
}

impl Display {
    /// Shows what happens until nothing does any more, or until it cannot.
    fn run(mut self, sights: &Receiver<(Micros, Sight)>) -> io::Result<()> {
        for (now, sight) in sights {
            self.take(now, sight)?;
        }
        self.screen.live("");
        if let Some(shown) = &mut self.shown {
            shown.end_run();
            shown.flush()?;
        }
        Ok(())
    }

    fn take(&mut self, now: Micros, sight: Sight) -> io::Result<()> {
        match sight {
            Sight::Opened => {
                self.is_open = true;
                self.screen.note(&format!("{now:.3} s: a program has opened the port"));
            }
            Sight::Closed => {
                self.is_open = false;
                if let Some(shown) = &mut self.shown {
                    shown.end_run();
                }
                let warning = if self.state.surely_at_rest(&self.board) {
                    String::new()
                } else {
                    format!(", and the program has not stopped the robot; {ON_SILENCE}")
                };
                self.run = None;
                self.screen.note(&format!("{now:.3} s: the port is closed{warning}"));
            }
            Sight::Came(at, bytes) => self.came(at, &bytes)?,
            Sight::Report(report) => self.report = Some(report),
            Sight::Behind(bytes, delay) => self.screen.warning(&format!(
                "at {now:.3} s the program has sent more than the line carries: {bytes} bytes wait, for {:.0} ms",
                delay.in_millis()
            )),
            Sight::SetUp(settings) => self.screen.warning(&format!(
                "at {now:.3} s the program has its line at {settings}; a board at {} baud, 1 stop bit would get garbage",
                self.baud
            )),
            Sight::Unread(bytes) => self.screen.warning(&format!(
                "at {now:.3} s it ended, and {} that the program had written were not read",
                plural(usize::try_from(bytes).unwrap_or(usize::MAX), "byte")
            )),
            Sight::Passed(seen) => {
                self.seen = seen.or(self.seen.take());
                if std::mem::take(&mut self.is_fresh)
                    && let Some(shown) = &mut self.shown
                {
                    if io::stdout().is_terminal() {
                        self.screen.live("");
                        Screen::is_written(CLEARED);
                        self.drawn = Micros::ZERO;
                    }
                    shown.flush()?;
                }
                if now - self.drawn >= UPDATE {
                    self.drawn = now;
                    self.screen.live(&self.line(now));
                }
            }
        }
        Ok(())
    }

    fn came(&mut self, at: Nanos, bytes: &[u8]) -> io::Result<()> {
        let Display { decoder, shown, state, wrong, run, is_fresh, board, has_doubt, screen, .. } = self;
        let mut taken = Ok(());
        decoder.feed(at, bytes, |at, item| {
            *is_fresh = true;
            match item {
                Item::Frame(frame) => {
                    *run = None;
                    *wrong += u64::from(board.decode(frame.bytes()).is_err());
                    if let Some(command) = board.decode_or_raw(frame.bytes()) {
                        if board.is_ambiguous(&command) && !std::mem::replace(has_doubt, true) {
                            screen.note(&doubt(board));
                        }
                        state.apply(board, &command);
                    }
                }
                // Bytes in a row count once, as they are one line of the listing.
                Item::Skipped { why, .. } => {
                    *wrong += u64::from(why.is_wrong() && *run != Some(why));
                    *run = Some(why);
                }
                _ => {}
            }
            if let (Some(shown), true) = (shown.as_mut(), taken.is_ok()) {
                taken = shown.take(at, item);
            }
        });
        taken
    }

    /// `12.300 s  stands  servo 1 1500  0.0 cm right, 0.0 cm forward, 0°  12.00 V`, as much as there is room for.
    fn line(&self, now: Micros) -> String {
        let mut line = format!("{now:.3} s");
        let room = self.screen.live_width();
        for part in self.parts() {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str("  ");
            line.push_str(&part);
        }
        line
    }

    fn parts(&self) -> Vec<String> {
        let state = self.seen.as_ref().map_or(&self.state, |seen| &seen.state);
        let board = &self.board;
        let mut parts = vec![if self.is_open { drive_words(board, state) } else { "nobody is there".to_owned() }];
        if self.wrong > 0 {
            parts.push(format!("{} wrong", self.wrong));
        }
        if let Some(pose) = self.seen.as_ref().map(|seen| seen.pose) {
            parts.push(format!("x {:.1} y {:.1} cm, {:.0}°", pose.x_cm, pose.y_cm, pose.yaw_deg));
        }
        if let Some(report) = self.seen.as_ref().map(|seen| seen.report).or(self.report) {
            parts.extend(board.main_quantity(&report));
        }
        parts.extend(active_words(board, state));
        parts
    }
}

/// Logs what happens at a board.
fn log_happened(log: &mut Log, now: Micros, happened: PortEvent<'_>) {
    let at = log.at(now.nanos());
    match happened {
        PortEvent::Opened => log.line(at, Level::Info, "a program has opened the port"),
        PortEvent::Closed => log.line(at, Level::Info, "the program has closed the port"),
        PortEvent::Came(nanos, bytes) => log.put(log.at(nanos), Entry::Bytes(bytes.into())),
        PortEvent::Behind(bytes, Micros(delay)) => {
            let text = format!("the program has sent more than the line carries: {bytes} bytes wait, for {delay} us");
            log.line(at, Level::Warning, text);
        }
        PortEvent::Unread(bytes) => {
            log.line(at, Level::Warning, format!("{bytes} bytes that the program had written were not read"));
        }
        PortEvent::SetUp(settings) => {
            log.line(at, Level::Warning, format!("the program has its line at {settings}"));
        }
        _ => {}
    }
}
