//! `motionseq board`: a virtual Raspblock that other programs open as their serial port.

use std::io::{self, BufWriter, IsTerminal as _, Write as _};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motionseq::board::{Command, DEFAULT_BAUD, Hundredths, Item, State};
use motionseq::capture::Listing;
use motionseq::link::{Door, DoorError};
use motionseq::playback::Signals;
use motionseq::sim::{Faults, Happened, Settings, VirtualBoard, host, volts};
use motionseq::timeline::Seconds;

use super::ending::board_summary;
use super::exit::Exit;
use super::news::servos;
use super::screen::{Screen, seconds};

/// Be a virtual board that any program opens as its serial port
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq board --link /tmp/board\n  python3 my_robot.py /tmp/board          in another terminal: it opens /tmp/board as it would /dev/ttyAMA0\n  motionseq play dance.motion --port /tmp/board\n\nEach frame that comes is a line: seconds since the start, the bytes, the command, and what is wrong with it, if anything is.\nIt goes on when a program closes the port, and waits for the next one. Ctrl-C ends it and takes the link away."
)]
pub(super) struct Board {
    /// Where programs find the port: a link is made there, and taken away at the end
    #[arg(long, value_name = "PATH")]
    link: PathBuf,
    /// How frames are shown
    #[arg(long, value_enum, default_value_t = Format::Listing)]
    format: Format,
    /// Speed of the line in bits a second
    #[arg(long, value_name = "BAUD", default_value_t = DEFAULT_BAUD, value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    baud: u32,
    /// Voltage of the battery at rest, from 0V to 100V
    #[arg(long, value_name = "VOLTS", value_parser = battery, default_value = "12V")]
    battery: Hundredths,
    /// What goes wrong: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7; times count from the start
    #[arg(long, value_name = "FAULTS")]
    fault: Option<Faults>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Seconds, frame and command, separated by TABs
    Listing,
    /// One JSON object a line
    Jsonl,
}

/// How often the line about the robot is drawn, in microseconds.
const UPDATE_US: u64 = 100_000;

fn battery(text: &str) -> Result<Hundredths, String> {
    volts(text.strip_suffix('V').unwrap_or(text)).ok_or_else(|| "write volts from 0V to 100V, such as 11.4V".to_owned())
}

impl Board {
    /// Serves until a signal ends it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let Ok(signals) = Signals::catch() else {
            screen.error("cannot watch for Ctrl-C");
            return Exit::Failed;
        };
        let door = match Door::open(&self.link) {
            Ok(door) => door,
            Err(error) => return refused(&error, screen),
        };
        let link = self.link.display();
        screen.note(&format!("a virtual board stands at {link}, {} baud; Ctrl-C ends it", self.baud));
        let faults = self.fault.clone().unwrap_or_default();
        let board = VirtualBoard::new(Settings { battery: self.battery, faults, ..Settings::default() });
        let mut watcher =
            Watcher { screen, shown: Shown::new(self.format), drawn_us: 0, is_fresh: false, is_open: false, wrong: 0 };
        let mut was_ended = false;
        let hosted = host(board, &door, self.baud, |now_us, happened, board| {
            watcher.watch(now_us, happened, board)?;
            was_ended |= signals.pending().is_some();
            Ok(!was_ended)
        });
        watcher.end();
        match hosted {
            Ok(board) => {
                let was_pulled = board.faults().unplug_us.is_some() && !was_ended;
                board_summary(screen, &board.finish());
                if was_pulled {
                    screen.note("the cable was pulled, as the fault asked for");
                }
                Exit::Ok
            }
            // Whoever read the frames has seen enough.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Exit::Ok,
            Err(error) => {
                screen.error(&format!("the virtual board failed: {error}"));
                Exit::Port
            }
        }
    }
}

/// Says why there is no port at a path.
pub(super) fn refused(error: &DoorError, screen: &Screen) -> Exit {
    screen.error(&error.to_string());
    match error {
        DoorError::Taken(_) => {
            screen.ask("end it first, or choose another path");
            Exit::InUse
        }
        DoorError::InTheWay(_) => {
            screen.ask("choose another path, or take away what is there; nothing was changed");
            Exit::Usage
        }
        DoorError::Refused { .. } => Exit::Usage,
    }
}

/// What is shown of a board.
struct Watcher<'s> {
    screen: &'s Screen,
    shown: Shown,
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
}

impl Watcher<'_> {
    fn watch(&mut self, now_us: u64, happened: Happened<'_>, board: &VirtualBoard) -> io::Result<()> {
        match happened {
            Happened::Opened => {
                self.is_open = true;
                self.screen.note(&format!("{} s: a program has opened the port", seconds(now_us)));
            }
            Happened::Closed => {
                self.is_open = false;
                if let Shown::Listing(listing) = &mut self.shown {
                    listing.end_run();
                }
                let moves = board.received().state.drive().is_some_and(Command::keeps_driving);
                let warning = if moves { ", and leaves the drive on" } else { "" };
                self.screen.note(&format!("{} s: the port is closed{warning}", seconds(now_us)));
            }
            Happened::Came(item) => {
                self.wrong += u64::from(match item {
                    Item::Frame(frame) => Command::decode(frame).is_err(),
                    Item::Skipped { .. } => true,
                });
                self.shown.take(now_us, item)?;
                self.is_fresh = true;
            }
            Happened::Behind(bytes, us) => self.screen.warning(&format!(
                "at {} s the program has sent more than the line carries: {bytes} bytes wait, for {} ms",
                seconds(now_us),
                us / 1_000
            )),
            Happened::Passed => {
                if std::mem::take(&mut self.is_fresh) {
                    if io::stdout().is_terminal() {
                        self.screen.live("");
                        self.drawn_us = 0;
                    }
                    self.shown.flush()?;
                }
                if now_us.saturating_sub(self.drawn_us) >= UPDATE_US {
                    self.drawn_us = now_us;
                    self.screen.live(&self.line(now_us, board));
                }
            }
        }
        Ok(())
    }

    /// `12.300 s  stands  servo 1 1500  0.0 cm right, 0.0 cm forward, 0°  12.00 V`, as much as there is room for.
    fn line(&self, now_us: u64, board: &VirtualBoard) -> String {
        let received = board.received();
        let mut line = format!("{} s", seconds(now_us));
        let room = self.screen.width().saturating_sub(1);
        for part in self.parts(&received.state, board) {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str("  ");
            line.push_str(&part);
        }
        line
    }

    fn parts(&self, state: &State, board: &VirtualBoard) -> Vec<String> {
        let pose = board.received().pose;
        let mut parts = vec![match state.drive() {
            _ if !self.is_open => "nobody is there".to_owned(),
            Some(drive) if drive.keeps_driving() => drive.to_string(),
            _ => "stands".to_owned(),
        }];
        if self.wrong > 0 {
            parts.push(format!("{} wrong", self.wrong));
        }
        parts.push(format!("x {:.1} y {:.1} cm, {:.0}°", pose.x_cm, pose.y_cm, pose.yaw_deg));
        parts.push(format!("{} V", board.report().voltage));
        if state.buzzer() == Some(true) {
            parts.push("buzzer on".to_owned());
        }
        parts.extend(servos(state));
        parts
    }

    fn end(&mut self) {
        if let Shown::Listing(listing) = &mut self.shown {
            listing.end_run();
        }
        let _ = self.shown.flush();
        self.screen.live("");
    }
}
