//! `motionseq board`: a virtual Raspblock that other programs open as their serial port.

use std::io;
use std::path::PathBuf;

use clap::Args;
use motionseq::board::{DEFAULT_BAUD, Hundredths};
use motionseq::link::{Door, DoorError};
use motionseq::playback::Signals;
use motionseq::sim::{Faults, Settings, VirtualBoard, host, volts};

use super::ending::board_summary;
use super::exit::Exit;
use super::log::Log;
use super::screen::Screen;
use super::watcher::{Format, Watcher};

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
    /// Write all that happens to this MCAP file, too: frames, state, pose, telemetry; Foxglove shows it
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

/// Reads the voltage of a battery.
pub(super) fn battery(text: &str) -> Result<Hundredths, String> {
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
        let log = match Log::open(self.log.as_deref(), None, screen) {
            Ok(log) => log,
            Err(exit) => return exit,
        };
        let link = self.link.display();
        screen.note(&format!("a virtual board stands at {link}, {} baud; Ctrl-C ends it", self.baud));
        let faults = self.fault.clone().unwrap_or_default();
        let board = VirtualBoard::new(Settings { battery: self.battery, faults, ..Settings::default() });
        let mut watcher = Watcher::new(screen, Some(self.format), self.baud).with_log(log);
        let mut was_ended = false;
        let hosted = host(board, &door, self.baud, |now_us, happened, board| {
            watcher.watch(now_us, happened, Some(board))?;
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
