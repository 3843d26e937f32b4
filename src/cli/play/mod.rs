//! `motionseq play`: sends a script to a board, in time.

mod display;
mod finish;
mod observer;
mod observers;
mod port;
mod result_files;
mod run_log;

use std::io;
use std::os::fd::BorrowedFd;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

use clap::Args;
use motionseq::link::{Link, Stalling};
use motionseq::playback::{Guard, Keys, Notice, Player, Realtime, Session, Signals, Ward, now};
use motionseq::serve::Served;
use motionseq::sim::{Faults, Settings};
use motionseq::source::Lines;
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos, NotATime};

use super::Script;
use super::exit::Exit;
use super::output::Force;
use super::screen::{Screen, Warnings};
use super::selection::{Selected, Selection};
use display::{Display, Progress};
use finish::Finish;
use observers::Observers;
use port::{Port, system};
use result_files::ResultFiles;
use run_log::Run;

pub(super) use port::refused;

/// Play a script on a board, or on a virtual one
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq play scripts/hello.motion                        on the built-in virtual board\n  motionseq play scripts/hello.motion --port /dev/serial0    on a Raspblock\n  motionseq play show.motion --from bow --speed 0.5          from the mark `bow` on, at half speed\n\nCtrl-C (or Ctrl-\\) stops the robot and ends. Ctrl-Z stops the robot and sleeps; after `fg`, Enter goes on.\nOn a terminal (not with -q or TERM=dumb): space pauses and goes on, q stops and ends, ? shows the keys.\nAt a pause, s plays what is sent next, at one time: of a move, one sample. The drive stands meanwhile.\nTimes that are shown are those of the run, with a lead-in and --speed; --from and --to are times of the script.\nA second process, the guard, stops the robot if this one is killed, and kills it if it hangs.\nEverything that play says goes to standard error."
)]
pub(super) struct Play {
    #[command(flatten)]
    script: Script,
    #[command(flatten)]
    selection: Selection,
    /// The serial port of the board, or else what `MOTIONSEQ_PORT` names; without it a virtual board takes the frames
    #[arg(long, value_name = "PATH")]
    port: Option<PathBuf>,
    /// Stop and end when a frame is later than this, from 1ms to 10s [default: 50ms, on the virtual board 1s]
    #[arg(long, value_name = "TIME", value_parser = max_late)]
    max_late: Option<Nanos>,
    /// Run before all other programs and stay in memory, as far as the system allows
    #[arg(long)]
    realtime: bool,
    /// Play without the process that stops the robot if this one is killed or hangs
    #[arg(long)]
    no_guard: bool,
    /// What goes wrong on the virtual board: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7
    #[arg(long, value_name = "FAULTS")]
    fault: Option<Faults>,
    /// How the run is shown while it goes on
    #[arg(long, value_enum, default_value_t = Progress::Auto)]
    progress: Progress,
    /// Begin paused: space begins, s plays one step
    #[arg(long)]
    paused: bool,
    /// Begin paused, and play one step for each Enter; the drive stands
    #[arg(long)]
    step: bool,
    /// Write the exact bytes that the port was given to this file
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write how the run went to this file, as JSON
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write all that happens to this MCAP file: frames, state, lateness, telemetry, marks and `say`; Foxglove shows it
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

fn max_late(text: &str) -> Result<Nanos, String> {
    match text.parse::<Micros>() {
        Ok(time) if time < Micros::from_millis(1) => Err("no computer is that exact; write 1ms or more".into()),
        Ok(time) if time <= Micros::from_millis(10_000) => Ok(time.nanos()),
        Ok(_) | Err(NotATime::TooLong) => Err("a robot is not left alone for so long; write 10s or less".into()),
        Err(_) => Err("write a time such as 50ms or 1s".into()),
    }
}

/// A frame later than this ends the run: on a real port, and on the virtual board.
const MAX_LATE: [Nanos; 2] = [Nanos::from_millis(50), Nanos::from_millis(1_000)];

impl Play {
    /// Compiles the script, opens the port, plays, and says how it went.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.play(screen).unwrap_or_else(|exit| exit)
    }

    fn play(&self, screen: &Screen) -> Result<Exit, Exit> {
        let (sources, selected) =
            self.selection.compile(&self.script.file, &self.script.options, Warnings::Counted, screen)?;
        let Selected { timeline, again, first_pass, script, diagnostics } = selected;
        let results = ResultFiles::open(self, &sources, screen)?;
        self.check_terminal(screen)?;
        Screen::never_wait().map_err(|error| system(screen, &error))?;
        let signals = Signals::catch().map_err(|error| system(screen, &error))?;
        let path = self.port_path();
        let Port { link, board } =
            Port::open(path.as_deref(), &timeline, self.settings(path.is_some(), screen)?, screen)?;

        // From here on there is a port. Everything that may fail or wait is made before the first frame.
        let (files, report) = results.start(&timeline.board, &sources, screen)?;
        let (timeline, again) = (Arc::new(timeline), again.map(Arc::new));
        let keys = Keys::open(screen.is_live());
        let display = Display::new(*screen, self.shown(screen), script, keys.is_some() && screen.is_live(), self.step);
        let timelines = [Arc::clone(&timeline), Arc::clone(again.as_ref().unwrap_or(&timeline))];
        let mut observers = Observers::start(timelines, display, files).map_err(|error| system(screen, &error))?;
        let stalls = board.as_ref().map(Served::stalls).unwrap_or_default();
        let player = self.player(Player::new(&timeline, self.limit(path.is_some())), again.as_deref());
        let mut session = Session::new(player, Stalling::new(link, stalls), signals, Lines::of(&sources));
        session.keys = keys;
        session.realtime = self.realtime && become_realtime(screen);
        // The last of all: from here on the player must beat.
        let mut ward = Ward::of(&timeline);
        (ward.max_late, ward.realtime) = (self.limit(path.is_some()), self.realtime);
        session.guard = self.guard(session.link.descriptor(), &ward, board.is_some(), screen).map_err(|error| {
            // A Ctrl-C reaches the guard, too, while it starts.
            session.signals.pending().map_or_else(|| system(screen, &error), Exit::Signal)
        })?;
        if let Some(keys) = &mut session.keys {
            keys.enter_steps = self.step;
            // The guard has seen the terminal as it was.
            keys.begin();
        }

        let (start, started) = (now(), SystemTime::now());
        // The time that is shown begins here, too.
        observers.put(start, Notice::Pass { pass: 1 });
        if let Some(board) = &board {
            board.begin(start);
        }
        let outcome = session.play(start, |notice| observers.tell(notice));
        let elapsed = (now() - start).micros();

        let Session { link, guard, .. } = session;
        let port = path.map(|path| path.display().to_string());
        // The virtual board ends when its port is closed. A real port is closed when everything was said: the system may wait for it as
        // long as half a minute.
        let held = Some(link).filter(|_| port.is_some());
        let asked = self.selection.asked();
        let run = Run { sources: &sources, timeline: &timeline, asked, first_pass, port, started, elapsed, outcome };
        let exit = Finish { screen: *screen, run, report: report.map(|report| (report, diagnostics)), board, guard }
            .report(observers.end());
        drop(held);
        Ok(exit)
    }

    /// Whether there is a terminal where it is asked for.
    fn check_terminal(&self, screen: &Screen) -> Result<(), Exit> {
        if (self.paused || self.step) && !(screen.is_live() && Keys::open(false).is_some()) {
            screen.error("--paused and --step need a terminal where keys are seen and pressed: in the foreground, standard error not redirected, no -q, no TERM=dumb");
            return Err(Exit::Usage);
        }
        Ok(())
    }

    /// The port that is asked for. A variable that is empty is one that is not set.
    fn port_path(&self) -> Option<PathBuf> {
        let port = self.port.clone().or_else(|| std::env::var_os("MOTIONSEQ_PORT").map(PathBuf::from));
        port.filter(|port| !port.as_os_str().is_empty())
    }

    fn limit(&self, is_real: bool) -> Nanos {
        let [on_port, on_virtual] = MAX_LATE;
        self.max_late.unwrap_or(if is_real { on_port } else { on_virtual })
    }

    /// How the virtual board is.
    fn settings(&self, is_real: bool, screen: &Screen) -> Result<Settings, Exit> {
        let faults = self.fault.clone().unwrap_or_default();
        if is_real && !faults.is_none() {
            screen.error("faults happen on the virtual board only: leave out `--fault` or the port");
            return Err(Exit::Usage);
        }
        Ok(Settings::with_faults(faults))
    }

    fn shown(&self, screen: &Screen) -> Progress {
        match self.progress {
            Progress::Auto if screen.is_dumb() && !screen.is_quiet() => Progress::Plain,
            progress => progress,
        }
    }

    fn player<'t>(&self, mut player: Player<'t>, again: Option<&'t Timeline>) -> Player<'t> {
        if let Some(again) = again {
            player = player.again_and_again(again);
        }
        if self.paused || self.step { player.paused() } else { player }
    }

    fn guard(&self, port: BorrowedFd<'_>, ward: &Ward, with_board: bool, screen: &Screen) -> io::Result<Option<Guard>> {
        if self.no_guard {
            screen.note("no guard: if this program is killed or hangs, nothing stops the robot");
            return Ok(None);
        }
        super::guard::start(port, ward, with_board, screen).map(Some)
    }
}

/// Asks for what `--realtime` means and says what was refused. Gives whether this thread runs before all others.
pub(super) fn become_realtime(screen: &Screen) -> bool {
    let got = Realtime::ask();
    for (result, what, line) in [
        (&got.priority, "real-time priority", "@dialout - rtprio 90"),
        (&got.memory, "locked memory", "@dialout - memlock unlimited"),
    ] {
        if let Err(error) = result {
            screen.note(&format!(
                "--realtime: no {what}, so it plays without: {error}; to allow it to users of the group dialout, add the line `{line}` to /etc/security/limits.conf and log in again"
            ));
        }
    }
    got.priority.is_ok()
}
