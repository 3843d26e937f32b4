//! Shows a board that other programs use: frames on standard output, and on a terminal a status line.

use std::io::{self, BufWriter, IsTerminal as _, Write as _};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use clap::ValueEnum;
use motionseq::board::{Board, Item, ON_SILENCE, Report, Skip, State};
use motionseq::capture::Listing;
use motionseq::units::Micros;

use super::decode::doubt;
use super::observer::{Event, Seen};
use super::screen::{Screen, plural};
use super::state_line::{active_words, drive_words};

/// How often the status line is drawn.
pub(super) const UPDATE: Micros = Micros::from_millis(100);
/// How long frames wait until the status line is cleared, on a terminal.
const CLEARED: Duration = Duration::from_millis(50);

/// How frames are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Time in seconds, frame and command, separated by tabs
    Listing,
    /// One JSON object per line
    Jsonl,
}

/// Shows what happens.
pub(super) struct Display {
    screen: Screen,
    /// Where frames are shown, if anywhere.
    shown: Option<Shown>,
    /// The state of the board, and its last report.
    state: State,
    report: Option<Report>,
    seen: Option<Arc<Seen>>,
    /// When the status line was last drawn.
    drawn: Micros,
    /// Whether there are frames that are not shown yet.
    is_fresh: bool,
    is_open: bool,
    /// The number of frames and runs of bytes that no correct program sends, and why the last bytes were skipped, if they were.
    wrong: u64,
    run: Option<Skip>,
    baud: u32,
    board: Arc<Board>,
    /// Whether an ambiguous frame has come.
    has_doubt: bool,
}

/// Standard output, in one of two formats.
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

impl Display {
    /// Shows frames on standard output, or not; `baud` is the bit rate of the line.
    pub(super) fn new(screen: Screen, shown: Option<Format>, baud: u32, board: Arc<Board>) -> Self {
        Display {
            screen,
            shown: shown.map(|format| Shown::new(format, Arc::clone(&board))),
            has_doubt: false,
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
        }
    }

    /// Shows events until there are no more, or until standard output fails.
    pub(super) fn run(mut self, events: &Receiver<(Micros, Event)>) -> io::Result<()> {
        for (now, event) in events {
            self.take(now, event)?;
        }
        self.screen.live("");
        if let Some(shown) = &mut self.shown {
            shown.end_run();
            shown.flush()?;
        }
        Ok(())
    }

    fn take(&mut self, now: Micros, event: Event) -> io::Result<()> {
        match event {
            Event::Opened => {
                self.is_open = true;
                self.screen.note(&format!("{now:.3} s: a program has opened the port"));
            }
            Event::Closed => {
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
            Event::Came(items) => {
                items.iter().try_for_each(|(at, item)| self.came(*at, item.item()))?;
            }
            Event::Report(report) => self.report = Some(report),
            Event::Behind(bytes, delay) => self.screen.warning(&format!(
                "at {now:.3} s the program has sent more than the line can carry: {bytes} bytes wait for {:.0} ms",
                delay.in_millis()
            )),
            Event::SetUp(settings) => self.screen.warning(&format!(
                "at {now:.3} s the program has set its line to {settings}; a board at {} baud, 1 stop bit would get garbage",
                self.baud
            )),
            Event::Unread(bytes) => self.screen.warning(&format!(
                "at the end, {now:.3} s, {} of the program were not read",
                plural(usize::try_from(bytes).unwrap_or(usize::MAX), "byte")
            )),
            Event::Passed(seen) => {
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

    fn came(&mut self, at: Micros, item: Item<'_>) -> io::Result<()> {
        let Display { board, .. } = self;
        self.is_fresh = true;
        match item {
            Item::Frame(frame) => {
                self.run = None;
                self.wrong += u64::from(board.decode(frame.bytes()).is_err());
                if let Some(command) = board.decode_or_raw(frame.bytes()) {
                    if board.is_ambiguous(&command) && !std::mem::replace(&mut self.has_doubt, true) {
                        self.screen.note(&doubt(board));
                    }
                    self.state.apply(board, &command);
                }
            }
            // A run of bytes counts once, because it is one line of the listing.
            Item::Skipped { why, .. } => {
                self.wrong += u64::from(why.is_wrong() && self.run != Some(why));
                self.run = Some(why);
            }
            _ => {}
        }
        self.shown.as_mut().map_or(Ok(()), |shown| shown.take(at, item))
    }

    /// `12.300 s  stopped  servo 1 1500  x 0.0 y 0.0 cm, 0°  12.00 V`, as much as fits.
    fn line(&self, now: Micros) -> String {
        let mut line = format!("{now:.3} s");
        let room = self.screen.live_width();
        for part in self.parts().into_iter().filter(|part| !part.is_empty()) {
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
        let mut parts = vec![if self.is_open { drive_words(board, state) } else { "no program".to_owned() }];
        if self.wrong > 0 {
            parts.push(format!("{} wrong", self.wrong));
        }
        if let Some(pose) = self.seen.as_ref().and_then(|seen| seen.pose) {
            parts.push(format!("x {:.1} y {:.1} cm, {:.0}°", pose.x_cm, pose.y_cm, pose.yaw_deg));
        }
        if let Some(report) = self.seen.as_ref().map(|seen| seen.report).or(self.report) {
            parts.extend(board.main_quantity(&report));
        }
        parts.extend(active_words(board, state));
        parts
    }
}
