//! `motionseq record`: writes what another program sends as a script.

use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use motionseq::board::Board as Family;
use motionseq::link::{Link as _, PtyLink, Serial};
use motionseq::playback::{Guard, GuardConfig, Signals, Stop};
use motionseq::serve::{End, ServeError, Server, TapEnd};
use motionseq::units::{Micros, Nanos};

use super::board::{self, Simulated, serve_board};
use super::display::Format;
use super::exit::Exit;
use super::family::Reading;
use super::growing_file;
use super::guard;
use super::log::{About, Log};
use super::output::{self, Inputs};
use super::port_opening::{self, PortRequest, doubt};
use super::run_summary::stop_words;
use super::screen::{PATIENCE, Screen, plural};
use super::tape::{Kept, Tape};
use super::watcher::Watcher;

/// Record what another program sends to its board, and write it as a script
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq record --link /tmp/board -o dance.motion                        a virtual board\n  motionseq record --link /tmp/board --port /dev/serial0 -o dance.motion    between the program and a Raspblock\n  motionseq record --link /tmp/board --family my-robot.toml -o dance.motion a board that a file describes\n  python3 my_robot.py /tmp/board                  in another terminal: it opens /tmp/board as it would /dev/serial0\n\nCtrl-C ends the recording. The file is updated every half second. Time 0 of the script is the first frame.\nTimes are relative and rounded to a millisecond; a mark follows each pause of more than a second. Repeated commands to the\ndrive, a servo or the buzzer are left out, and a command and its end become one line with `for`. Values that follow an\neasing, within 5 us for servos and 1 for the drive, become one line with `over`. --exact keeps every frame at its time."
)]
pub(super) struct Record {
    /// Create a symbolic link at this path, which the program opens as its port; the link is removed at the end
    #[arg(long, value_name = "PATH")]
    link: PathBuf,
    /// Pass bytes between the program and the board at this serial port (or `auto`), both ways and unchanged
    #[arg(long, value_name = "PATH", conflicts_with_all = ["battery", "fault", "report_every", "servos"])]
    port: Option<PathBuf>,
    /// If the port cannot be opened yet, wait for it up to TIME
    #[arg(long, value_name = "TIME", requires = "port", value_parser = port_opening::wait)]
    wait: Option<Micros>,
    /// Write the script to this file instead of standard output; a file that has content is refused
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Also show each frame on standard output as it arrives
    #[arg(long, value_enum, requires = "output")]
    format: Option<Format>,
    /// Keep every frame: the script sends what the program sent, each frame at its time
    #[arg(long)]
    exact: bool,
    /// Set the bit rate of the line [default: that of the board, 115200 for the Raspblock]
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    baud: Option<u32>,
    #[command(flatten)]
    simulated: Simulated,
    /// Write an MCAP log of frames, state and telemetry for Foxglove to FILE, or to a new file in a folder
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Run without the guard, the process that stops the robot if this one is killed or hangs
    #[arg(long, requires = "port")]
    no_guard: bool,
    #[command(flatten)]
    reading: Reading,
}

/// Without a sign of life for twice this time, the guard kills this process and stops the robot.
const MAX_LATE: Nanos = Nanos::from_millis(250);

impl Record {
    /// Records until a signal ends it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.try_run(screen).unwrap_or_else(|exit| exit)
    }

    fn try_run(&self, screen: &Screen) -> Result<Exit, Exit> {
        let chosen = self.reading.chosen(screen)?;
        self.simulated.check(&chosen.board, self.baud, screen)?;
        let inputs = Inputs::of(&chosen.file);
        let created = self.output.as_deref().map(|path| {
            growing_file::create(path, &inputs).map_err(|error| output::exit(Err(error), Some(path), screen))
        });
        let created = created.transpose()?;
        let family = chosen.for_script(self.output.as_deref(), screen).board;
        // Until the end: if nothing is recorded, it removes the file.
        let file = created.as_ref().map(|created| created.file.try_clone()).transpose();
        let file = file.map_err(|error| board::failed(screen, &error))?;
        self.record(&family, file, screen)
    }

    /// Fails if nothing was recorded.
    fn record(&self, family: &Arc<Family>, file: Option<File>, screen: &Screen) -> Result<Exit, Exit> {
        let signals = board::begin(screen)?;
        let baud = self.baud.unwrap_or(family.baud);
        let request = |path| PortRequest { robot: "", path, board: family, baud, wait: self.wait };
        let port = self.port.as_deref().map(request);
        let port = port.map(|request| port_opening::open(&request, &signals, screen)).transpose()?;
        let path = port.as_ref().map(|(_, path)| path.clone());
        let mut pty_link = PtyLink::open(&self.link, baud).map_err(|error| board::refused(&error, screen))?;
        let what = ("record", About::new(&[path.as_deref()]));
        let log = Log::open(self.log.as_deref(), file.as_ref(), what, Arc::clone(family), screen)?;
        let failed = |error: io::Error| board::failed(screen, &error);
        let tape = Tape::start(file, self.exact, baud, family, *screen).map_err(failed)?;
        let watcher = Watcher::start(*screen, self.format, baud, Arc::clone(family), port.is_some()).map_err(failed)?;
        let watcher = watcher.keeping(Some(tape), log);
        let begun = |what: &str| {
            screen.note(&format!("{} leads to {what} and is recorded; Ctrl-C ends the recording", self.link.display()));
        };
        let (exit, tape) = match port {
            None => {
                let board = self.simulated.board(Arc::clone(family), baud);
                begun(&board::virtual_board(family));
                serve_board(&mut pty_link, board, baud, &signals, watcher, screen)
            }
            Some((port, path)) => {
                doubt(&path, screen);
                // Last: from here on the loop must send signs of life.
                let guard = self.guard(&port, family, screen).map_err(failed)?;
                begun(&format!("the board at {}", path.display()));
                between(&mut pty_link, Arc::clone(family), port, guard, &signals, watcher, screen)
            }
        };
        drop(pty_link);
        Ok(tape.map(Tape::end).map_or(exit, |kept| self.summary(&kept, exit, screen)))
    }

    fn guard(&self, port: &Serial, family: &Arc<Family>, screen: &Screen) -> io::Result<Option<Guard>> {
        if self.no_guard {
            screen.note("no guard: if this program is killed or hangs, nothing stops the robot");
            return Ok(None);
        }
        let mut ward = GuardConfig::of_board(family);
        ward.max_late = MAX_LATE;
        guard::start(port.descriptor(), &ward, false, screen).map(Some)
    }

    fn summary(&self, kept: &Kept, exit: Exit, screen: &Screen) -> Exit {
        let count = |count: u64, word| plural(usize::try_from(count).unwrap_or(usize::MAX), word);
        let name = self.output.as_ref().map(|path| path.display().to_string());
        let wrote = format!("recorded {} as {}", count(kept.frames, "frame"), count(kept.lines, "line"));
        screen.note(&match &name {
            None => wrote,
            Some(name) => format!("{wrote} in {name}"),
        });
        match (&kept.failed, name) {
            (None, _) => exit,
            (Some(why), name) => {
                let name = name.unwrap_or_else(|| "standard output".to_owned());
                output::exit(
                    Err(io::Error::other(format!("{why}; the recording is incomplete"))),
                    Some(name.as_ref()),
                    screen,
                )
            }
        }
    }
}

/// Records between a program and a board.
#[expect(clippy::too_many_arguments, reason = "a server and its observer")]
fn between(
    pty_link: &mut PtyLink,
    board: Arc<Family>,
    port: Serial,
    guard: Option<Guard>,
    signals: &Signals,
    mut watcher: Watcher,
    screen: &Screen,
) -> (Exit, Option<Tape>) {
    let without_stop = board.without_stop.clone();
    let mut server = Server::of_port(pty_link, board, port, guard, signals);
    let ended = server.run(&mut |now, happened, board| watcher.watch(now, happened, board));
    // The program can no longer stop the robot through this port.
    let Some((TapEnd { stop, missing, undelivered }, guard)) = server.stop() else {
        return watcher.end(Exit::Failed, "motionseq failed; this is a bug");
    };
    let (exit, cause) = match ended {
        Ok(End::Unguarded) => (Exit::Failed, Some("the guard of this recording was lost".to_owned())),
        Ok(_) if stop == Stop::NotSent => (Exit::Stalled, None),
        Ok(_) => (Exit::Ok, None),
        Err(ServeError::Failed(error)) => {
            (Exit::Port, Some(format!("cannot pass bytes between the program and its board: {error}")))
        }
        Err(error) => (Exit::Port, Some(error.to_string())),
    };
    if undelivered > 0 {
        let bytes = plural(usize::try_from(undelivered).unwrap_or(usize::MAX), "byte");
        screen.note(&format!("{bytes} of the program did not reach the board"));
    }
    let robot = match stop {
        Stop::NotNeeded => "the program left the robot at rest".to_owned(),
        Stop::NotDefined | Stop::Held | Stop::NotHeld => stop_words(stop, missing, &without_stop),
        _ => format!("the program did not stop the robot; {}", stop_words(stop, missing, &without_stop)),
    };
    let words = cause.as_ref().map_or_else(|| robot.clone(), |cause| format!("{cause}; {robot}"));
    if cause.is_some() || matches!(stop, Stop::NotSent | Stop::NotHeld) {
        screen.error(&words);
    } else {
        screen.note(&words);
    }
    // A guard without a goodbye prints this line itself, if the screen takes nothing.
    if let Some(guard) = guard.filter(|_| Screen::is_written(PATIENCE)) {
        guard.goodbye();
    }
    watcher.end(exit, &words)
}
