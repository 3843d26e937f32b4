//! `motionseq board`: a virtual board that other programs open as their serial port.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use motionseq::board::{Board as Family, FAMILIES, Hundredths, Simulation};
use motionseq::diagnostic::escaped;
use motionseq::faults::{Faults, Faulty, volts};
use motionseq::link::{PtyLink, PtyLinkError};
use motionseq::playback::Signals;
use motionseq::serve::{End, ServeError, Server};
use motionseq::sim::{Device, Settings};
use motionseq::units::{Micros, NotATime};

use super::display::Format;
use super::exit::Exit;
use super::family::Reading;
use super::log::{About, Log};
use super::run_summary::{board_summary, signal_name};
use super::screen::Screen;
use super::tape::Tape;
use super::watcher::Watcher;

/// Provide a virtual board that any program can open as its serial port
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq board --link /tmp/board\n  python3 my_robot.py /tmp/board          in another terminal: it opens /tmp/board as it would /dev/ttyAMA0\n  motionseq play dance.motion --port /tmp/board\n  motionseq board --link /tmp/board --family my-robot.toml\n\nEach frame is shown on a line: seconds since the start, the bytes, the command, and the error, if any.\nWhen a program closes the port, the board waits for the next program. Ctrl-C ends the board and removes the link."
)]
pub(super) struct Board {
    /// Create a symbolic link to the port at this path, and remove the link at the end
    #[arg(long, value_name = "PATH")]
    link: PathBuf,
    /// Choose how frames are shown
    #[arg(long, value_enum, default_value_t = Format::Listing)]
    format: Format,
    /// Set the bit rate of the line [default: that of the board, 115200 for the Raspblock]
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    baud: Option<u32>,
    /// Set the battery voltage at rest, 0V to 100V [default: 12V]
    #[arg(long, value_name = "VOLTS", value_parser = battery)]
    battery: Option<Hundredths>,
    /// Simulate faults: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7; times count from the start
    #[arg(long, value_name = "FAULTS")]
    fault: Option<Faults>,
    /// Once a program has requested reports, send one every TIME (10ms to 10s) [default: 100ms]
    #[arg(long, value_name = "TIME", value_parser = report_every)]
    report_every: Option<Micros>,
    /// Write an MCAP log of frames, state, pose and telemetry for Foxglove to FILE, or to a new file in a folder
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

/// Reads the voltage of a battery.
pub(super) fn battery(text: &str) -> Result<Hundredths, String> {
    volts(text.strip_suffix('V').unwrap_or(text)).ok_or_else(|| "write volts from 0V to 100V, such as 11.4V".to_owned())
}

/// Reads the time between two reports.
pub(super) fn report_every(text: &str) -> Result<Micros, String> {
    let time: Micros = text.parse().map_err(|error: NotATime| error.to_string())?;
    let is_fine = (Micros::from_millis(10)..=Micros::from_millis(10_000)).contains(&time);
    is_fine.then_some(time).ok_or_else(|| "write a time from 10ms to 10s, such as 100ms".to_owned())
}

impl Board {
    /// Serves until a signal ends it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match self.try_run(screen) {
            Ok(exit) | Err(exit) => exit,
        }
    }

    fn try_run(&self, screen: &Screen) -> Result<Exit, Exit> {
        let family = self.reading.chosen(screen)?.board;
        check_simulated(&family, self.baud, self.battery, self.report_every, screen)?;
        let baud = self.baud.unwrap_or(family.baud);
        let mut pty_link = PtyLink::open(&self.link, baud).map_err(|error| refused(&error, screen))?;
        let what = ("board", About::new(None));
        let log = Log::open(self.log.as_deref(), None, what, Arc::clone(&family), screen)?;
        let signals = begin(screen)?;
        let link = self.link.display();
        screen.note(&format!("{link} leads to {} with {baud} baud; Ctrl-C ends it", virtual_board(&family)));
        let watcher = Watcher::start(*screen, Some(self.format), baud, Arc::clone(&family), false);
        let board = board_with(family, self.battery, self.report_every, self.fault.clone());
        let watcher = watcher.map_err(|error| failed(screen, &error))?.keeping(None, log);
        Ok(serve_board(&mut pty_link, board, baud, &signals, watcher, screen).0)
    }
}

/// What it is in messages: `a virtual board`, with its name unless it is the default one.
pub(super) fn virtual_board(family: &Family) -> String {
    let is_usual = FAMILIES.first().is_some_and(|usual| usual.word == family.line);
    if is_usual { "a virtual board".to_owned() } else { format!("a virtual board ({})", escaped(&family.name)) }
}

/// Refuses a speed of the line that the board does not take, and options that have no effect on its virtual board.
pub(super) fn check_simulated(
    family: &Family,
    baud: Option<u32>,
    battery: Option<Hundredths>,
    report_every: Option<Micros>,
    screen: &Screen,
) -> Result<(), Exit> {
    if let Some(baud) = baud.filter(|baud| *baud > family.max_baud) {
        let (line, most) = (&family.line, family.max_baud);
        screen.error(&format!("the board `{line}` takes at most {most} baud, not {baud}"));
        return Err(Exit::Usage);
    }
    let given = [(battery.is_some(), "--battery"), (report_every.is_some(), "--report-every")];
    let given = given.iter().find(|(is_given, _)| *is_given && family.simulation != Simulation::Mecanum);
    let Some((_, option)) = given else { return Ok(()) };
    screen.error(&format!(
        "`{option}` has no effect: the virtual board `{}` has no battery, and sends no reports by itself; remove it",
        family.line
    ));
    Err(Exit::Usage)
}

/// A virtual board, switched on now.
pub(super) fn board_with(
    of: Arc<Family>,
    battery: Option<Hundredths>,
    report_every: Option<Micros>,
    faults: Option<Faults>,
) -> Faulty {
    let mut settings = Settings::default();
    settings.battery = battery.unwrap_or(settings.battery);
    settings.report_every = report_every.unwrap_or(settings.report_every);
    Faulty::new(Device::new(of, settings), faults.unwrap_or_default())
}

/// Catches signals, and lets nothing wait for the screen: from here on a signal always ends the server.
pub(super) fn begin(screen: &Screen) -> Result<Signals, Exit> {
    Screen::never_wait().and_then(|()| Signals::catch()).map_err(|error| failed(screen, &error))
}

/// Reports why the system refuses to start.
pub(super) fn failed(screen: &Screen, error: &io::Error) -> Exit {
    screen.error(&format!("cannot start: {error}"));
    Exit::Failed
}

/// Serves a virtual board until a signal ends it, and reports how it ended. Returns the recording, too, if there is one.
#[expect(clippy::too_many_arguments, reason = "a server and its observer")]
pub(super) fn serve_board(
    pty_link: &mut PtyLink,
    board: Faulty,
    baud: u32,
    signals: &Signals,
    mut watcher: Watcher,
    screen: &Screen,
) -> (Exit, Option<Tape>) {
    let family = Arc::clone(board.device().family());
    let mut server = Server::of_board(pty_link, board, baud, Some(signals));
    let ended = server.run(&mut |now, happened, board| watcher.watch(now, happened, board));
    let received = server.received();
    let (is_unplugged, is_broken) = (matches!(ended, Ok(End::Unplugged)), ended.is_err());
    let (exit, cause) = match ended {
        Ok(End::Unplugged) => (Exit::Ok, "the board was unplugged, by the fault `unplug`".to_owned()),
        Ok(End::Signal(signal)) => (Exit::Ok, signal_name(signal)),
        Ok(_) => (Exit::Ok, "the program has closed the port".to_owned()),
        // The reader of the frames has closed its end.
        Err(ServeError::Failed(error)) if error.kind() == io::ErrorKind::BrokenPipe => {
            (Exit::Ok, "the reader of the frames has closed its end".to_owned())
        }
        Err(error) => (Exit::Port, format!("the virtual board failed: {error}")),
    };
    let (exit, tape) = watcher.end(exit, &cause);
    if exit == Exit::Port {
        screen.error(&cause);
        return (exit, tape);
    }
    if let Some(received) = received.filter(|_| !is_broken) {
        board_summary(screen, &family, &received);
    }
    if is_unplugged {
        screen.note(&cause);
    }
    (exit, tape)
}

/// Reports why there is no port at a path.
pub(super) fn refused(error: &PtyLinkError, screen: &Screen) -> Exit {
    screen.error(&error.to_string());
    match error {
        PtyLinkError::Taken(_) | PtyLinkError::Living(_) => {
            screen.ask("end it first, or choose another path");
            Exit::InUse
        }
        PtyLinkError::InTheWay(_) => {
            screen.ask("choose another path, or remove what is there; nothing was changed");
            Exit::Usage
        }
        _ => Exit::Usage,
    }
}
