//! `motionseq play`: sends a script to a board on schedule.

mod display;
mod finish;
mod observer;
mod observers;
mod port;
mod result_files;
mod run_log;

use std::os::fd::BorrowedFd;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;
use std::{fs, io};

use clap::{Args, ValueEnum};
use motionseq::faults::{Faults, Stalling};
use motionseq::link::Link;
use motionseq::playback::{GoLines, Guard, GuardConfig, Keys, Notice, Player, Realtime, Session, Signals, now};
use motionseq::serve::BoardThread;
use motionseq::source::{Lines, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

use super::Options;
use super::exit::Exit;
use super::port_opening::{self, PortRequest};
use super::project::{ChosenPort, VIRTUAL, ValueSource, max_late};
use super::screen::{Screen, Warnings};
use super::selection::{Selected, Selection};
use display::{Display, KeysShown, Progress};
use finish::Finish;
use observers::Observers;
use port::{Port, system};
use result_files::{ResultFiles, ResultPaths};
use run_log::Run;

/// Play a script on a robot or on a virtual board
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq play scripts/hello.motion                         # on the built-in virtual board\n  motionseq play scripts/hello.motion --port /dev/serial0     # on a Raspblock\n  motionseq play scripts/dance.motion --from spin --speed 0.5 # from a mark, at half speed\n  motionseq play scripts/dance.motion --loop forever --report run.json\n\nKeys:\n  space     pause or continue\n  s         play one step while paused; the drive stays stopped\n  Enter, g  say go at a `wait go`\n  q         stop the robot and exit\n  ?         show the keys\n  Ctrl-C    stop the robot and exit, also without a terminal\n  Ctrl-Z    stop the robot and suspend; after `fg`, Enter continues\n\nThe keys work only on a terminal and without `-q`. A step is one command, or one sample of a move.\nThe progress line shows the time since the start of the run; `--from` and `--to` take times of the script.\nA second process, the guard, stops the robot if `play` is killed or hangs.\nAll messages go to standard error."
)]
pub(super) struct Play {
    /// Script to read, or `-` for standard input
    file: PathBuf,
    /// Serial port of the board, such as /dev/serial0, or `auto` or `virtual` [default: `MOTIONSEQ_PORT`, `port` of motionseq.toml, else virtual]
    #[arg(long, value_name = "PATH")]
    port: Option<PathBuf>,
    /// If the port cannot be opened yet, wait for it up to TIME, as a service does at boot
    #[arg(long, value_name = "TIME", value_parser = port_opening::wait)]
    wait: Option<Micros>,
    /// Stop the robot if a frame is more than TIME late (1ms to 10s) [default: 50ms; 1s on the virtual board]
    #[arg(long, value_name = "TIME", value_parser = max_late)]
    max_late: Option<Nanos>,
    /// Use real-time priority and locked memory, if permitted
    #[arg(long)]
    realtime: bool,
    /// Do not start the guard: then nothing stops the robot if `play` is killed or hangs
    #[arg(long)]
    no_guard: bool,
    /// Simulate faults on the virtual board: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7, servo=3:silent
    #[arg(long, value_name = "FAULTS")]
    fault: Option<Faults>,
    /// Choose how progress is shown
    #[arg(long, value_enum, default_value_t = Progress::Auto)]
    progress: Progress,
    /// Start paused; press space to continue, or `s` to play one step
    #[arg(long)]
    paused: bool,
    /// Start paused and play one step per Enter; the drive stays stopped
    #[arg(long)]
    step: bool,
    /// Open each `wait go` with a line on standard input, besides Enter and `g` on a terminal
    #[arg(long, value_enum, value_name = "SOURCE")]
    go: Option<GoSource>,
    #[command(flatten)]
    selection: Selection,
    #[command(flatten)]
    results: ResultPaths,
    #[command(flatten)]
    options: Options,
}

/// Where a go comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum GoSource {
    /// Each line on standard input opens one gate
    Stdin,
}

impl Play {
    /// Compiles the script, opens the port, plays, and reports the result.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.play(screen).unwrap_or_else(|exit| exit)
    }

    fn play(&self, screen: &Screen) -> Result<Exit, Exit> {
        if self.go == Some(GoSource::Stdin) && is_standard_input(&self.file) {
            screen.error("`--go stdin` cannot be used with a script from standard input; write the script to a file");
            return Err(Exit::Usage);
        }
        let (sources, selected) = self.selection.compile(&self.file, &self.options, Warnings::Counted, screen)?;
        let Selected { timelines, again, first_pass, script, diagnostics, config } = selected;
        // Only the first robot plays.
        let first = |timelines: Vec<Timeline>| timelines.into_iter().next();
        let (timeline, again) = (first(timelines).ok_or(Exit::Script)?, again.and_then(first));
        let results = ResultFiles::open(&self.results, &sources, screen)?;
        self.check_terminal(screen)?;
        let go = self.go.map(|_| GoLines::open()).transpose().map_err(|error| system(screen, &error))?.flatten();
        check_go(&timeline, go.is_some(), &sources, screen)?;
        Screen::never_wait().map_err(|error| system(screen, &error))?;
        let signals = Signals::catch().map_err(|error| system(screen, &error))?;
        let chosen = config.port(self.port.as_deref());
        let limit = self.max_late.unwrap_or_else(|| config.max_late(chosen.path.is_some()));
        let Port { link, path, board, poses } = self.open_port(&chosen, &timeline, &signals, screen)?;

        // The port is open. Everything that may fail or wait is done before the first frame.
        let (mut files, report) = results.start(&timeline.board, &sources, path.as_deref(), screen)?;
        files.poses = poses;
        let (timeline, again) = (Arc::new(timeline), again.map(Arc::new));
        let keys = Keys::open(screen.is_live());
        let inputs = KeysShown { single: keys.is_some() && screen.is_live(), steps: self.step, go_lines: go.is_some() };
        let display = Display::new(*screen, self.shown(screen), script, inputs);
        let timelines = [Arc::clone(&timeline), Arc::clone(again.as_ref().unwrap_or(&timeline))];
        let mut observers = Observers::start(timelines, display, files).map_err(|error| system(screen, &error))?;
        let stalls = board.as_ref().map(BoardThread::stalls).unwrap_or_default();
        let player = self.player(Player::new(&timeline, limit), again.as_deref());
        let mut session = Session::new(player, Stalling::new(link, stalls), signals, Lines::of(&sources));
        (session.keys, session.go) = (keys, go);
        session.realtime = self.realtime && become_realtime(screen);
        // The guard is started last, because from then on the player must send heartbeats.
        let mut ward = GuardConfig::of(&timeline);
        (ward.max_late, ward.realtime) = (limit, self.realtime);
        session.guard = self.guard(session.link.descriptor(), &ward, board.is_some(), screen).map_err(|error| {
            // Ctrl-C also reaches a guard that is starting.
            session.signals.pending().map_or_else(|| system(screen, &error), Exit::Signal)
        })?;
        if let Some(keys) = &mut session.keys {
            keys.enter_steps = self.step;
            // The guard has saved the state of the terminal.
            keys.begin();
        }

        let (start, started) = (now(), SystemTime::now());
        // The clock of the progress line starts here too.
        observers.notify_at(start, Notice::Pass { pass: 1 });
        if let Some(board) = &board {
            board.begin(start);
        }
        let outcome = session.play(start, |notice| observers.notify(notice));
        let elapsed = (now() - start).micros();

        let Session { link, guard, .. } = session;
        let port = path.map(|path| path.display().to_string());
        // The virtual board ends when its port is closed. A real port is closed last, because closing it may take half a minute.
        let held = Some(link).filter(|_| port.is_some());
        let asked = self.selection.asked();
        let run = Run { sources: &sources, timeline: &timeline, asked, first_pass, port, started, elapsed, outcome };
        let exit = Finish { screen: *screen, run, report: report.map(|report| (report, diagnostics)), board, guard }
            .report(observers.end());
        drop(held);
        Ok(exit)
    }

    /// Checks that there is a terminal if the options need one.
    fn check_terminal(&self, screen: &Screen) -> Result<(), Exit> {
        if (self.paused || self.step) && !(screen.is_live() && Keys::open(false).is_some()) {
            screen.error("`--paused` and `--step` need a terminal: run in the foreground, without `-q`, TERM=dumb or a redirected standard error");
            return Err(Exit::Usage);
        }
        Ok(())
    }

    fn open_port(
        &self,
        chosen: &ChosenPort,
        timeline: &Timeline,
        signals: &Signals,
        screen: &Screen,
    ) -> Result<Port, Exit> {
        let faults = self.faults(chosen.path.is_some(), screen)?;
        let Some(path) = &chosen.path else { return Port::of_board(chosen, timeline, faults, screen) };
        let request = PortRequest { path, board: &timeline.board, baud: timeline.baud, wait: self.wait };
        let opened = port_opening::open(&request, signals, screen).inspect_err(|_| {
            // A user may not know that there is a file.
            if let ValueSource::File(place) = &chosen.source {
                screen.ask(&format!("the port is from {place}; `--port {VIRTUAL}` plays on the virtual board"));
            }
        })?;
        Ok(Port::real(opened, &chosen.origin(), screen))
    }

    /// The faults of the virtual board.
    fn faults(&self, is_real: bool, screen: &Screen) -> Result<Faults, Exit> {
        let faults = self.fault.clone().unwrap_or_default();
        if is_real && !faults.is_none() {
            screen.error("`--fault` works only on the virtual board; remove `--fault` or the port");
            return Err(Exit::Usage);
        }
        Ok(faults)
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

    fn guard(
        &self,
        port: BorrowedFd<'_>,
        ward: &GuardConfig,
        with_board: bool,
        screen: &Screen,
    ) -> io::Result<Option<Guard>> {
        if self.no_guard {
            screen.note("no guard: nothing stops the robot if motionseq is killed or hangs");
            return Ok(None);
        }
        super::guard::start(port, ward, with_board, screen).map(Some)
    }
}

/// Whether a path is standard input, by whatever name.
fn is_standard_input(path: &Path) -> bool {
    let place = |path: &Path| fs::metadata(path).map(|file| (file.dev(), file.ino())).ok();
    path.as_os_str() == "-" || place(path).is_some_and(|place_of| place("/dev/stdin".as_ref()) == Some(place_of))
}

/// Checks that there is a way to say go, if the script waits for it.
fn check_go(timeline: &Timeline, has_lines: bool, sources: &Sources, screen: &Screen) -> Result<(), Exit> {
    let gate = timeline.gates.iter().find(|gate| gate.gate.criterion().is_none());
    let Some(gate) = gate.filter(|_| !has_lines && Keys::open(false).is_none()) else { return Ok(()) };
    let place = sources.place(gate.span);
    screen.error(&format!(
        "{place} waits for a go, and there is no terminal to say it on; run it on a terminal, or with `--go stdin` and one line on standard input for each gate"
    ));
    Err(Exit::Usage)
}

/// Requests real-time priority and locked memory, and reports what was refused. Returns whether this thread has the priority.
pub(super) fn become_realtime(screen: &Screen) -> bool {
    let got = Realtime::ask();
    for (result, what, line) in [
        (&got.priority, "real-time priority", "@dialout - rtprio 90"),
        (&got.memory, "locked memory", "@dialout - memlock unlimited"),
    ] {
        if let Err(error) = result {
            screen.note(&format!(
                "--realtime: no {what} ({error}); to permit it for the group dialout, add `{line}` to /etc/security/limits.conf and log in again"
            ));
        }
    }
    got.priority.is_ok()
}
