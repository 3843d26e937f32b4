//! `motionseq record`: what another program sends, as a script.

use std::io;
use std::path::PathBuf;

use clap::Args;
use motionseq::board::{DEFAULT_BAUD, Hundredths};
use motionseq::link::{Door, Serial};
use motionseq::playback::{Signals, Stop, TapError, stop_now, tap};
use motionseq::sim::{Faults, Settings, VirtualBoard, host};

use super::board::{self, battery};
use super::ending::board_summary;
use super::exit::Exit;
use super::log::Log;
use super::output;
use super::play;
use super::screen::{Screen, plural};
use super::tape::{Kept, Tape};
use super::watcher::{Format, Watcher};

/// Write what another program sends to its board down as a script
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq record --link /tmp/board -o dance.motion                        a virtual board\n  motionseq record --link /tmp/board --port /dev/serial0 -o dance.motion    between the program and a Raspblock\n  python3 my_robot.py /tmp/board                  in another terminal: it opens /tmp/board as it would /dev/serial0\n\nCtrl-C ends it. The script is on disk as it goes, at most half a second behind. Its time 0 is that of the first frame.\nRepeats of a drive command that its hold covers are left out, and so are repeats of what a servo or the buzzer was told. Values\nthat follow an easing, of servos within 5 us and of the drive within 1, become one line with `over`. --exact keeps every frame."
)]
pub(super) struct Record {
    /// Where the program finds its port: a link is made there, and taken away at the end
    #[arg(long, value_name = "PATH")]
    link: PathBuf,
    /// The serial port of a board: bytes pass between it and the program, both ways and unchanged
    #[arg(long, value_name = "PATH", conflicts_with_all = ["battery", "fault"])]
    port: Option<PathBuf>,
    /// Write the script to this file, which must not be there yet, instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Show each frame on standard output, too, as it comes
    #[arg(long, value_enum, requires = "output")]
    format: Option<Format>,
    /// Keep every frame: the script sends what the program has sent, each frame at its time
    #[arg(long)]
    exact: bool,
    /// Speed of the line in bits a second
    #[arg(long, value_name = "BAUD", default_value_t = DEFAULT_BAUD, value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    baud: u32,
    /// Voltage of the virtual board's battery at rest, from 0V to 100V
    #[arg(long, value_name = "VOLTS", value_parser = battery, default_value = "12V")]
    battery: Hundredths,
    /// What goes wrong with the virtual board, as for `board`
    #[arg(long, value_name = "FAULTS")]
    fault: Option<Faults>,
    /// Write all that happens to this MCAP file, too: frames, state, telemetry; Foxglove shows it
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

impl Record {
    /// Records until a signal ends it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let Ok(signals) = Signals::catch() else {
            screen.error("cannot watch for Ctrl-C");
            return Exit::Failed;
        };
        let file = match self.output.as_deref().map(|path| (path, output::create(path))) {
            None => None,
            Some((_, Ok(file))) => Some(file),
            Some((path, Err(error))) => return output::exit(Err(error), Some(path), screen),
        };
        let port = match self.port.as_deref().map(|path| (path, Serial::open(path, self.baud))) {
            None => None,
            Some((_, Ok(port))) => Some(port),
            Some((path, Err(error))) => return self.nothing(play::refused(screen, path, &error)),
        };
        let door = match Door::open(&self.link) {
            Ok(door) => door,
            Err(error) => return self.nothing(board::refused(&error, screen)),
        };
        let log = match Log::open(self.log.as_deref(), file.as_ref(), screen) {
            Ok(log) => log,
            Err(exit) => return self.nothing(exit),
        };
        let tape = match Tape::start(file, self.exact, self.baud, *screen) {
            Ok(tape) => tape,
            Err(error) => {
                screen.error(&format!("cannot record: {error}"));
                return self.nothing(Exit::Failed);
            }
        };
        let what = match &self.port {
            None => "a virtual board".to_owned(),
            Some(port) => format!("the board at {}", port.display()),
        };
        screen.note(&format!("{what} stands at {}, and is recorded; Ctrl-C ends it", self.link.display()));
        let mut watcher = Watcher::new(screen, self.format, self.baud).with_tape(tape).with_log(log);
        let exit = match port {
            None => self.virtually(&door, &signals, &mut watcher, screen),
            Some(port) => between(&door, port, &signals, &mut watcher, screen),
        };
        let kept = watcher.end().map(Tape::end);
        kept.map_or(exit, |kept| self.summary(&kept, exit, screen))
    }

    fn virtually(&self, door: &Door, signals: &Signals, watcher: &mut Watcher<'_>, screen: &Screen) -> Exit {
        let faults = self.fault.clone().unwrap_or_default();
        let board = VirtualBoard::new(Settings { battery: self.battery, faults, ..Settings::default() });
        // A signal is told once, whatever happens at that moment.
        let mut was_ended = false;
        let hosted = host(board, door, self.baud, |now_us, happened, board| {
            watcher.watch(now_us, happened, Some(board))?;
            was_ended |= signals.pending().is_some();
            Ok(!was_ended)
        });
        match hosted {
            Ok(board) => {
                board_summary(screen, &board.finish());
                Exit::Ok
            }
            Err(error) => {
                screen.error(&format!("the virtual board failed: {error}"));
                Exit::Port
            }
        }
    }

    /// Takes the file away again where nothing was recorded.
    fn nothing(&self, exit: Exit) -> Exit {
        if let Some(path) = &self.output {
            let _ = std::fs::remove_file(path);
        }
        exit
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
                    Err(io::Error::other(format!("{why}; the recording is not whole"))),
                    Some(name.as_ref()),
                    screen,
                )
            }
        }
    }
}

/// Records between a program and a board.
fn between(door: &Door, mut port: Serial, signals: &Signals, watcher: &mut Watcher<'_>, screen: &Screen) -> Exit {
    let mut was_ended = false;
    let tapped = tap(door, &mut port, |now_us, happened| {
        watcher.watch(now_us, happened, None)?;
        was_ended |= signals.pending().is_some();
        Ok(!was_ended)
    });
    // Nobody can stop it through this port any more.
    let stop = (!watcher.state().at_rest()).then(|| stop_now(&mut port));
    match stop {
        None | Some(Stop::NotNeeded) => {}
        Some(Stop::Sent) => screen.note("the program had left the robot moving; stop: sent"),
        Some(Stop::NotSent) => screen.error("the program had left the robot moving; stop: NOT SENT - cut the power"),
    }
    match tapped {
        Ok(()) => Exit::Ok,
        Err(error @ TapError::Lost(_)) => {
            screen.error(&error.to_string());
            Exit::Port
        }
        Err(TapError::Failed(error)) => {
            screen.error(&format!("cannot go on between the program and its board: {error}"));
            Exit::Port
        }
    }
}
