//! `motionseq play`: sends a script to a board on schedule.

mod display;
mod finish;
mod observer;
mod observers;
mod perform;
mod port;
mod ports;
mod result_files;
mod run_log;

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use clap::{Args, ValueEnum};
use motionseq::faults::{Faults, Stalling};
use motionseq::playback::{GoLines, Keys, Realtime, Signals, now};
use motionseq::serve::BoardThread;
use motionseq::source::Sources;
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

use super::Options;
use super::exit::Exit;
use super::port_opening::{self, PortRequest};
use super::project::{ChosenPort, Config, VIRTUAL, ValueSource, max_late};
use super::screen::{Screen, Warnings};
use super::selection::{Selected, Selection};
use display::{Display, KeysShown, Progress};
use finish::{Ended, Finish};
use observers::{Observed, Observers};
use perform::{Operator, Performance, Played, Robot, Shared};
use port::{Port, system};
use result_files::{ResultFiles, ResultPaths};
use run_log::Run;

/// Play a script on a robot or on a virtual board
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq play scripts/hello.motion                         # on the built-in virtual board\n  motionseq play scripts/hello.motion --port /dev/serial0     # on a Raspblock\n  motionseq play scripts/dance.motion --from spin --speed 0.5 # from a mark, at half speed\n  motionseq play scripts/dance.motion --loop forever --report run.json\n  motionseq play scripts/duet.motion --port left=/dev/ttyUSB0 --port right=/dev/ttyUSB1\n\nKeys:\n  space     pause or continue\n  s         play one step while paused; the drive stays stopped\n  Enter, g  say go at a `wait go`\n  q         stop the robot and exit\n  ?         show the keys\n  Ctrl-C    stop the robot and exit, also without a terminal\n  Ctrl-Z    stop the robot and suspend; after `fg`, Enter continues\n\nThe keys work only on a terminal and without `-q`. A step is one command, or one sample of a move.\nThe progress line shows the time since the start of the run; `--from` and `--to` take times of the script.\nA second process, the guard, stops the robot if `play` is killed or hangs.\nAll messages go to standard error."
)]
pub(super) struct Play {
    /// Script to read, or `-` for standard input
    file: PathBuf,
    /// Serial port of the board, such as /dev/serial0, or `auto` or `virtual` [default: `MOTIONSEQ_PORT`, `port` of motionseq.toml, else virtual];
    /// with several robots, `left=PATH` for each [default: `MOTIONSEQ_PORT_LEFT`, else virtual]
    #[arg(long, value_name = "PATH")]
    port: Vec<PathBuf>,
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
    /// Simulate faults on the virtual board: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7, servo=3:silent;
    /// with several robots, on all virtual boards, or `left: FAULTS` on one
    #[arg(long, value_name = "FAULTS")]
    fault: Vec<String>,
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
        let results = ResultFiles::open(&self.results, &timelines, &sources, screen)?;
        self.check_terminal(screen)?;
        let go = self.go.map(|_| GoLines::open()).transpose().map_err(|error| system(screen, &error))?.flatten();
        check_go(&timelines, go.is_some(), &sources, screen)?;
        Screen::never_wait().map_err(|error| system(screen, &error))?;
        let signals = Signals::catch().map_err(|error| system(screen, &error))?;
        let ports = self.open_ports(&timelines, &config, &signals, screen)?;

        // The ports are open. Everything that may fail or wait is done before the first frame.
        let paths: Vec<Option<&Path>> = ports.iter().map(|port| port.path.as_deref()).collect();
        let (files, report) = results.start(&timelines, &sources, &paths, screen)?;
        let keys = Keys::open(screen.is_live());
        let inputs = KeysShown { single: keys.is_some() && screen.is_live(), steps: self.step, go_lines: go.is_some() };
        let names: Vec<Arc<str>> = timelines.iter().filter_map(|timeline| timeline.robot.clone()).collect();
        let count = timelines.len();
        let mut again = again.into_iter().flatten();
        let (mut robots, mut links, mut boards, mut paths, mut observed) = (vec![], vec![], vec![], vec![], vec![]);
        for (timeline, Port { link, path, board, poses }) in timelines.into_iter().zip(ports) {
            let (timeline, again) = (Arc::new(timeline), again.next().map(Arc::new));
            let robot = (timeline.prefix(), robots.len(), count);
            let display = Display::new(*screen, self.shown(screen), script, inputs, robot);
            let timelines = [Arc::clone(&timeline), Arc::clone(again.as_ref().unwrap_or(&timeline))];
            observed.push(Observed { timelines, display, poses });
            let limit = self.max_late.unwrap_or_else(|| config.max_late(path.is_some()));
            robots.push(Robot { timeline, again, limit, is_virtual: board.is_some() });
            links.push(Stalling::new(link, board.as_ref().map(BoardThread::stalls).unwrap_or_default()));
            boards.push(board);
            paths.push(path);
        }
        let (observers, mut notifiers) = Observers::start(observed, files).map_err(|error| system(screen, &error))?;
        let common = notifiers.pop();
        let started = SystemTime::now();
        let actors = robots.iter().zip(links).zip(notifiers).map(|((robot, link), notifier)| (robot, link, notifier));
        let shared = Shared { common, boards: boards.iter().flatten().collect(), sources: &sources };
        let operator = Operator { signals, keys, go };
        let performance = self.perform(actors.collect(), operator, shared, screen)?;
        let Performance { played, first, start, common } = performance;
        let elapsed = (now() - start).micros();

        let (mut ended, mut held, mut notifiers) = (vec![], vec![], vec![]);
        for ((robot, played), (board, path)) in robots.iter().zip(played).zip(boards.into_iter().zip(paths)) {
            let Played { outcome, link, guard, notifier } = played;
            let port = path.map(|path| path.display().to_string());
            // A virtual board ends when its port is closed. A real port is closed last, because closing it may take half a minute.
            held.extend(Some(link).filter(|_| port.is_some()));
            notifiers.push(notifier);
            let (timeline, asked) = (&*robot.timeline, self.selection.asked());
            let sources = &sources;
            let run = Run { sources, timeline, names: &names, asked, first_pass, port, started, elapsed, outcome };
            ended.push(Ended { run, board, guard });
        }
        notifiers.extend(common);
        let report = report.map(|report| (report, diagnostics));
        let exit = Finish { screen: *screen, robots: ended, first, report }.report(observers.end(notifiers));
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

    /// Opens the ports of all robots.
    fn open_ports(
        &self,
        timelines: &[Timeline],
        config: &Config,
        signals: &Signals,
        screen: &Screen,
    ) -> Result<Vec<Port>, Exit> {
        let chosen = ports::choose(&self.port, timelines, config, screen)?;
        let faults = ports::faults(&self.fault, timelines, screen)?;
        let all_real = chosen.iter().all(|chosen| chosen.path.is_some());
        let is_for_real = |(chosen, faults): (&ChosenPort, &Faults)| chosen.path.is_some() && !faults.is_none();
        // What is meant for all virtual boards does not reach the real ones.
        if chosen.iter().zip(&faults).any(is_for_real)
            && (all_real || self.fault.iter().all(|faults| ports::of_robots(faults).is_some()))
        {
            screen.error("`--fault` works only on the virtual board; remove `--fault` or the port");
            return Err(Exit::Usage);
        }
        let robots = chosen.iter().zip(timelines).zip(faults);
        robots.map(|((chosen, timeline), faults)| self.open_port((chosen, timeline), faults, signals, screen)).collect()
    }

    fn open_port(
        &self,
        (chosen, timeline): (&ChosenPort, &Timeline),
        faults: Faults,
        signals: &Signals,
        screen: &Screen,
    ) -> Result<Port, Exit> {
        let Some(path) = &chosen.path else { return Port::of_board(chosen, timeline, faults, screen) };
        let (board, baud, wait) = (&timeline.board, timeline.baud, self.wait);
        let request = PortRequest { path, robot: &timeline.prefix(), board, baud, wait };
        let opened = port_opening::open(&request, signals, screen).inspect_err(|_| {
            // A user may not know that there is a file.
            if let ValueSource::File(place) = &chosen.source {
                screen.ask(&format!("the port is from {place}; `--port {VIRTUAL}` plays on the virtual board"));
            }
        })?;
        Ok(Port::real(opened, timeline, chosen, screen))
    }

    fn shown(&self, screen: &Screen) -> Progress {
        match self.progress {
            Progress::Auto if screen.is_dumb() && !screen.is_quiet() => Progress::Plain,
            progress => progress,
        }
    }
}

/// Whether a path is standard input, by whatever name.
fn is_standard_input(path: &Path) -> bool {
    let place = |path: &Path| fs::metadata(path).map(|file| (file.dev(), file.ino())).ok();
    path.as_os_str() == "-" || place(path).is_some_and(|place_of| place("/dev/stdin".as_ref()) == Some(place_of))
}

/// Checks that there is a way to say go, if the script waits for it.
fn check_go(timelines: &[Timeline], has_lines: bool, sources: &Sources, screen: &Screen) -> Result<(), Exit> {
    // All robots have the same gates.
    let gate = timelines.iter().flat_map(|timeline| &timeline.gates).find(|gate| gate.gate.is_go());
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
