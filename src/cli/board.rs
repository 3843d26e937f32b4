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
use motionseq::sim::{Device, ServoSetup, Settings};
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
    #[command(flatten)]
    simulated: Simulated,
    /// Write an MCAP log of frames, state, pose and telemetry for Foxglove to FILE, or to a new file in a folder
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

/// The properties of a virtual board.
#[derive(Debug, Args)]
pub(super) struct Simulated {
    /// Set the battery voltage of the virtual board at rest, 0V to 100V [default: 12V]
    #[arg(long, value_name = "VOLTS", value_parser = battery)]
    battery: Option<Hundredths>,
    /// Simulate faults: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7, servo=3:silent (or twice, other, sum, late,
    /// wheel, lost, error, slow, a position); times count from the start
    #[arg(long, value_name = "FAULTS")]
    fault: Option<Faults>,
    /// Once the program has requested reports, send one every TIME from the virtual board (10ms to 10s) [default: 100ms]
    #[arg(long, value_name = "TIME", value_parser = report_every)]
    report_every: Option<Micros>,
    /// Choose the servos on the virtual bus: numbers from 0 to 253 and ranges, separated by commas [default: 1..6]
    #[arg(long, value_name = "NUMBERS", value_parser = servos)]
    servos: Option<ServoNumbers>,
}

/// The numbers of servos.
#[derive(Clone, Debug)]
struct ServoNumbers(Vec<u8>);

impl Default for ServoNumbers {
    /// Those of an arm.
    fn default() -> Self {
        ServoNumbers((1..=6).collect())
    }
}

/// Reads the numbers of servos: `1..6`, `1,2,5`.
fn servos(text: &str) -> Result<ServoNumbers, String> {
    let number = |text: &str| text.trim().parse::<u8>().ok().filter(|number| *number <= 253);
    let range = |part: &str| {
        let (first, last) = part.split_once("..").unwrap_or((part, part));
        Some(number(first)?..=number(last)?).filter(|range| !range.is_empty())
    };
    let ranges: Option<Vec<_>> = text.split(',').map(range).collect();
    let mut numbers: Vec<u8> = ranges.into_iter().flatten().flatten().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let found = (!numbers.is_empty()).then_some(ServoNumbers(numbers));
    found.ok_or_else(|| "write numbers from 0 to 253, such as 1..6 or 1,2,5".to_owned())
}

/// Reads the voltage of a battery.
fn battery(text: &str) -> Result<Hundredths, String> {
    volts(text.strip_suffix('V').unwrap_or(text)).ok_or_else(|| "write volts from 0V to 100V, such as 11.4V".to_owned())
}

/// Reads the time between two reports.
fn report_every(text: &str) -> Result<Micros, String> {
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
        self.simulated.check(&family, self.baud, screen)?;
        let baud = self.baud.unwrap_or(family.baud);
        let mut pty_link = PtyLink::open(&self.link, baud).map_err(|error| refused(&error, screen))?;
        let what = ("board", About::new(&[None]));
        let log = Log::open(self.log.as_deref(), None, what, Arc::clone(&family), screen)?;
        let signals = begin(screen)?;
        let link = self.link.display();
        screen.note(&format!("{link} leads to {} with {baud} baud; Ctrl-C ends it", virtual_board(&family)));
        let watcher = Watcher::start(*screen, Some(self.format), baud, Arc::clone(&family), false);
        let board = self.simulated.board(family, baud);
        let watcher = watcher.map_err(|error| failed(screen, &error))?.keeping(None, log);
        Ok(serve_board(&mut pty_link, board, baud, &signals, watcher, screen).0)
    }
}

/// What it is in messages: `a virtual board`, with its name unless it is the default one.
pub(super) fn virtual_board(family: &Family) -> String {
    let is_usual = FAMILIES.first().is_some_and(|usual| usual.word == family.line);
    if is_usual { "a virtual board".to_owned() } else { format!("a virtual board ({})", escaped(&family.name)) }
}

impl Simulated {
    /// Refuses a speed of the line that the board does not take, and options that have no effect on its virtual board.
    pub(super) fn check(&self, family: &Family, baud: Option<u32>, screen: &Screen) -> Result<(), Exit> {
        let line = &family.line;
        if let Some(baud) = baud.filter(|baud| *baud > family.max_baud) {
            screen.error(&format!("the board `{line}` takes at most {} baud, not {baud}", family.max_baud));
            return Err(Exit::Usage);
        }
        let (reports, is_bus) = (family.simulation == Simulation::Mecanum, family.simulation == Simulation::Servos);
        let without_reports = "has no battery, and sends no reports by itself";
        let without_bus = "has no servos that answer for themselves";
        let has_servo_fault = self.fault.as_ref().is_some_and(|faults| !faults.servos.is_empty());
        let given = [
            (self.battery.is_some() && !reports, "--battery", without_reports),
            (self.report_every.is_some() && !reports, "--report-every", without_reports),
            (self.servos.is_some() && !is_bus, "--servos", without_bus),
            (has_servo_fault && !is_bus, "--fault servo=", without_bus),
        ];
        let Some((_, option, why)) = given.iter().find(|(is_useless, ..)| *is_useless) else { return Ok(()) };
        screen.error(&format!("`{option}` has no effect: the virtual board `{line}` {why}; remove it"));
        Err(Exit::Usage)
    }

    /// A virtual board, switched on now.
    pub(super) fn board(&self, of: Arc<Family>, baud: u32) -> Faulty {
        let mut settings = Settings::default();
        settings.battery = self.battery.unwrap_or(settings.battery);
        settings.report_every = self.report_every.unwrap_or(settings.report_every);
        let ServoNumbers(servos) = self.servos.clone().unwrap_or_default();
        settings.servos = Some(servos.into_iter().map(ServoSetup::new).collect());
        settings.baud = Some(baud);
        Faulty::new(Device::new(of, settings), self.fault.clone().unwrap_or_default())
    }
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
        board_summary(screen, "", &family, &received);
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
