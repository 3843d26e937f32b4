//! What is shown, and kept, of a board that other programs use.

use std::io::{self, BufWriter, IsTerminal as _, Write as _};

use clap::ValueEnum;
use motionseq::board::{Command, Item, Report, ReportDecoder, ReportItem, State};
use motionseq::capture::{Listing, TimedDecoder};
use motionseq::link::Happened;
use motionseq::sim::VirtualBoard;
use motionseq::timeline::Seconds;

use super::log::{Entry, Level, Log};
use super::news::servos;
use super::screen::{Screen, seconds};
use super::tape::Tape;

/// How often the line about the robot is drawn, in microseconds.
const UPDATE_US: u64 = 100_000;

/// How frames are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Seconds, frame and command, separated by TABs
    Listing,
    /// One JSON object a line
    Jsonl,
}

/// Watches what happens at a board, virtual or real.
pub(super) struct Watcher<'s> {
    screen: &'s Screen,
    /// Where frames are shown, if they are.
    shown: Option<Shown>,
    /// Where they are written down, if they are.
    tape: Option<Tape>,
    /// Where all that happens is logged, if it is.
    log: Option<Log>,
    /// When the pose was logged last, in microseconds.
    logged_us: u64,
    decoder: TimedDecoder,
    reports: ReportDecoder,
    /// What the board was told, and what it said last.
    state: State,
    report: Option<Report>,
    /// When the line about the robot was drawn last, in microseconds.
    drawn_us: u64,
    /// Whether there are frames that were not shown yet.
    is_fresh: bool,
    is_open: bool,
    /// Frames and runs of bytes that no correct program sends.
    wrong: u64,
}

/// Standard output, in one of two forms.
enum Shown {
    Listing(Listing<BufWriter<io::Stdout>>),
    Jsonl(BufWriter<io::Stdout>),
}

impl Shown {
    fn new(format: Format) -> Self {
        let out = BufWriter::new(io::stdout());
        match format {
            Format::Listing => Shown::Listing(Listing::new(out)),
            Format::Jsonl => Shown::Jsonl(out),
        }
    }

    fn take(&mut self, now_us: u64, item: Item<'_>) -> io::Result<()> {
        match self {
            Shown::Listing(listing) => {
                listing.take(Seconds(now_us), item);
                Ok(())
            }
            Shown::Jsonl(out) => motionseq::capture::write_json(now_us, item, out),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Shown::Listing(listing) => {
                listing.flush();
                listing.failure()
            }
            Shown::Jsonl(out) => out.flush(),
        }
    }

    fn end_run(&mut self) {
        if let Shown::Listing(listing) = self {
            listing.end_run();
        }
    }
}

impl<'s> Watcher<'s> {
    /// Shows frames on standard output, or not.
    pub(super) fn new(screen: &'s Screen, shown: Option<Format>, baud: u32) -> Self {
        Watcher {
            screen,
            shown: shown.map(Shown::new),
            tape: None,
            log: None,
            logged_us: 0,
            decoder: TimedDecoder::new(baud),
            reports: ReportDecoder::new(),
            state: State::default(),
            report: None,
            drawn_us: 0,
            is_fresh: false,
            is_open: false,
            wrong: 0,
        }
    }

    /// Writes down what comes, too.
    pub(super) fn with_tape(self, tape: Tape) -> Self {
        Watcher { tape: Some(tape), ..self }
    }

    /// Logs what happens, too.
    pub(super) fn with_log(self, log: Option<Log>) -> Self {
        Watcher { log, ..self }
    }

    /// What the board was told.
    pub(super) fn state(&self) -> &State {
        &self.state
    }

    /// Takes in what happened at a time, at a virtual board or a real one.
    pub(super) fn watch(
        &mut self,
        now_us: u64,
        happened: Happened<'_>,
        board: Option<&VirtualBoard>,
    ) -> io::Result<()> {
        if let Some(tape) = &mut self.tape {
            tape.take(now_us, happened);
        }
        if let Some(log) = &mut self.log {
            log_happened(log, now_us, happened);
        }
        match happened {
            Happened::Opened => {
                self.is_open = true;
                self.screen.note(&format!("{} s: a program has opened the port", seconds(now_us)));
            }
            Happened::Closed => {
                self.is_open = false;
                if let Some(shown) = &mut self.shown {
                    shown.end_run();
                }
                let moves = self.state.drive().is_some_and(Command::keeps_driving);
                let warning = if moves { ", and leaves the drive on" } else { "" };
                self.screen.note(&format!("{} s: the port is closed{warning}", seconds(now_us)));
            }
            Happened::Came(at, bytes) => self.came(at, bytes)?,
            Happened::Answered(bytes) => {
                let Watcher { report, log, .. } = self;
                self.reports.feed(bytes, |item| {
                    if let ReportItem::Report(newest) = item {
                        *report = Some(newest);
                        if let Some(log) = log {
                            log.put(log.at(now_us.saturating_mul(1_000)), Entry::Report(newest));
                        }
                    }
                });
            }
            Happened::Behind(bytes, us) => self.screen.warning(&format!(
                "at {} s the program has sent more than the line carries: {bytes} bytes wait, for {} ms",
                seconds(now_us),
                us / 1_000
            )),
            Happened::Passed => {
                if let (Some(log), Some(board)) = (&mut self.log, board)
                    && now_us.saturating_sub(self.logged_us) >= UPDATE_US
                {
                    self.logged_us = now_us;
                    log.put(log.at(now_us.saturating_mul(1_000)), Entry::Pose(board.received().pose));
                }
                if std::mem::take(&mut self.is_fresh)
                    && let Some(shown) = &mut self.shown
                {
                    if io::stdout().is_terminal() {
                        self.screen.live("");
                        self.drawn_us = 0;
                    }
                    shown.flush()?;
                }
                if now_us.saturating_sub(self.drawn_us) >= UPDATE_US {
                    self.drawn_us = now_us;
                    self.screen.live(&self.line(now_us, board));
                }
            }
        }
        Ok(())
    }

    fn came(&mut self, at: u64, bytes: &[u8]) -> io::Result<()> {
        let Watcher { decoder, shown, state, wrong, is_fresh, .. } = self;
        let mut taken = Ok(());
        decoder.feed(at, bytes, |at_us, item| {
            *is_fresh = true;
            match item {
                Item::Frame(frame) => match Command::decode(frame) {
                    Ok(command) => state.apply(&command),
                    Err(_) => *wrong += 1,
                },
                Item::Skipped { .. } => *wrong += 1,
            }
            if let (Some(shown), true) = (shown.as_mut(), taken.is_ok()) {
                taken = shown.take(at_us, item);
            }
        });
        taken
    }

    /// `12.300 s  stands  servo 1 1500  0.0 cm right, 0.0 cm forward, 0°  12.00 V`, as much as there is room for.
    fn line(&self, now_us: u64, board: Option<&VirtualBoard>) -> String {
        let mut line = format!("{} s", seconds(now_us));
        let room = self.screen.width().saturating_sub(1);
        for part in self.parts(board) {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str("  ");
            line.push_str(&part);
        }
        line
    }

    fn parts(&self, board: Option<&VirtualBoard>) -> Vec<String> {
        // What a fault has kept from a virtual board, it was not told.
        let state = board.map_or(&self.state, |board| &board.received().state);
        let mut parts = vec![match state.drive() {
            _ if !self.is_open => "nobody is there".to_owned(),
            Some(drive) if drive.keeps_driving() => drive.to_string(),
            _ => "stands".to_owned(),
        }];
        if self.wrong > 0 {
            parts.push(format!("{} wrong", self.wrong));
        }
        if let Some(pose) = board.map(|board| board.received().pose) {
            parts.push(format!("x {:.1} y {:.1} cm, {:.0}°", pose.x_cm, pose.y_cm, pose.yaw_deg));
        }
        if let Some(report) = board.map(VirtualBoard::report).or(self.report) {
            parts.push(format!("{} V", report.voltage));
        }
        if state.buzzer() == Some(true) {
            parts.push("buzzer on".to_owned());
        }
        parts.extend(servos(state));
        parts
    }

    /// Shows what is left, and ends, as the log does; gives the tape, which is to be ended too.
    pub(super) fn end(mut self) -> Option<Tape> {
        if let Some(shown) = &mut self.shown {
            shown.end_run();
            let _ = shown.flush();
        }
        self.screen.live("");
        if let Some(log) = self.log {
            log.end();
        }
        self.tape
    }
}

/// Logs what happens at a board.
fn log_happened(log: &mut Log, now_us: u64, happened: Happened<'_>) {
    let at = log.at(now_us.saturating_mul(1_000));
    match happened {
        Happened::Opened => log.line(at, Level::Info, "a program has opened the port"),
        Happened::Closed => log.line(at, Level::Info, "the program has closed the port"),
        Happened::Came(nanos, bytes) => log.put(log.at(nanos), Entry::Bytes(bytes.into())),
        Happened::Behind(bytes, us) => {
            let text = format!("the program has sent more than the line carries: {bytes} bytes wait, for {us} us");
            log.line(at, Level::Warning, text);
        }
        Happened::Answered(_) | Happened::Passed => {}
    }
}
