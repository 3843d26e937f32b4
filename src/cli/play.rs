//! `motionseq play`: sends a script to a board, in time.

use std::fs::File;
use std::io;
use std::os::fd::BorrowedFd;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use clap::Args;
use motionseq::faults::{Faults, Faulty, Stalling};
use motionseq::link::{Link, OpenError, Pty, Recorder, Serial};
use motionseq::playback::{Cause, Guard, Keys, Notice, Player, Realtime, Rig, Signals, Stop, Ward, drive, now};
use motionseq::serve::Served;
use motionseq::sim::{Device, Settings};
use motionseq::source::{Lines, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos, NotATime};
use rtrb::RingBuffer;

use super::Script;
use super::ending::{End, Lost, Reporter};
use super::exit::Exit;
use super::growing;
use super::log::Log;
use super::news::{Desk, Files, News, Progress};
use super::notes::Asking;
use super::output::{self, Force, Inputs};
use super::recording::Recording;
use super::replace::Replacement;
use super::screen::Screen;
use super::show::{Show, Staged};

/// Play a script on a board, or on a virtual one
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq play scripts/hello.motion                        on the built-in virtual board\n  motionseq play scripts/hello.motion --port /dev/serial0    on a Raspblock\n  motionseq play show.motion --from bow --speed 0.5          from the mark `bow` on, at half speed\n\nCtrl-C (or Ctrl-\\) stops the robot and ends. Ctrl-Z stops the robot and sleeps; after `fg`, Enter goes on.\nOn a terminal (not with -q or TERM=dumb): space pauses and goes on, q stops and ends, ? shows the keys.\nAt a pause, s plays what is sent next, at one time: of a move, one sample. The drive stands meanwhile.\nTimes that are shown are those of the run, with a lead-in and --speed; --from and --to are times of the script.\nA second process, the guard, stops the robot if this one is killed, and kills it if it hangs.\nEverything that play says goes to standard error."
)]
pub(super) struct Play {
    #[command(flatten)]
    script: Script,
    #[command(flatten)]
    show: Show,
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

/// The files for results, each with its name. A report that is not written to where it is has no file yet.
struct Results<'p> {
    recording: Option<(&'p Path, File)>,
    report: Option<(&'p Path, Option<Replacement>)>,
    log: Option<(&'p Path, File)>,
}

/// Opens a file for a result, if one was asked for, or says why it cannot.
fn open_result<'p, T>(
    path: Option<&'p PathBuf>,
    refused: &impl Fn(&Path, &io::Error) -> Exit,
    open: impl FnOnce(&Path) -> io::Result<T>,
) -> Result<Option<(&'p Path, T)>, Exit> {
    let Some(path) = path else { return Ok(None) };
    open(path).map(|opened| Some((path.as_path(), opened))).map_err(|error| refused(path, &error))
}

/// A frame later than this ends the run: on a real port, and on the virtual board.
const MAX_LATE: [Nanos; 2] = [Nanos::from_millis(50), Nanos::from_millis(1_000)];
/// Room for notices and pieces of recorded bytes between two updates. The line carries 11,520 bytes a second.
const NOTICES: usize = 16 * 1024;
const PIECES: usize = 16 * 1024;

impl Play {
    /// Compiles the script, opens the port, plays, and says how it went.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match self.try_run(screen) {
            Ok(exit) | Err(exit) => exit,
        }
    }

    #[expect(clippy::too_many_lines, reason = "one resource after the other")]
    fn try_run(&self, screen: &Screen) -> Result<Exit, Exit> {
        let (sources, Staged { timeline, again, first_pass, script, diagnostics }) =
            self.show.compile(&self.script.file, &self.script.options, super::screen::Warnings::Counted, screen)?;
        let refused = |path: &Path, error: &io::Error| {
            screen.error(&format!("cannot write {}: {error}; nothing was sent", path.display()));
            Exit::Usage
        };
        let Results { recording, report, log } = self.results(&sources, &refused)?;
        if (self.paused || self.step) && !(screen.is_live() && Keys::open(false).is_some()) {
            screen.error("--paused and --step need somebody who sees and presses keys: a terminal in the foreground, standard error not redirected, no -q, no TERM=dumb");
            return Err(Exit::Usage);
        }
        Screen::never_wait().map_err(|error| system(screen, &error))?;
        let signals = Signals::catch().map_err(|error| system(screen, &error))?;
        let port = self.port.clone().or_else(|| std::env::var_os("MOTIONSEQ_PORT").map(PathBuf::from));
        // A variable that is empty is one that is not set.
        let port = port.filter(|port| !port.as_os_str().is_empty());
        let [on_port, on_virtual] = MAX_LATE;
        let max_late = self.max_late.unwrap_or(if port.is_some() { on_port } else { on_virtual });
        let faults = self.fault.clone().unwrap_or_default();
        if port.is_some() && !faults.is_none() {
            screen.error("faults happen on the virtual board only: leave `--fault` or the port away");
            return Err(Exit::Usage);
        }
        let name = port.as_ref().map(|port| port.display().to_string());
        let port = Port::open(port.as_deref(), &timeline, faults, screen)?;
        if let Some((path, file)) = &recording {
            growing::begin(file).map_err(|error| refused(path, &error))?;
        }
        let log = match log {
            None => None,
            Some((path, file)) => Some((
                Log::start(file, path, Arc::clone(&timeline.board), *screen).map_err(|error| refused(path, &error))?,
                sources.clone(),
            )),
        };

        let timeline = Arc::new(timeline);
        let (bytes_in, bytes_out) = RingBuffer::new(PIECES);
        let (mut notices_in, notices_out) = RingBuffer::new(NOTICES);
        let recording = recording.map(|(_, file)| Recording::start(file)).transpose();
        let files = Files { recording: recording.map_err(|error| system(screen, &error))?, log };
        let keys = Keys::open(screen.is_live());
        let progress = match self.progress {
            Progress::Auto if screen.is_dumb() && !screen.is_quiet() => Progress::Plain,
            progress => progress,
        };
        let is_at_desk = keys.is_some() && screen.is_live();
        let desk = Desk { keys: is_at_desk, steps: self.step, progress, script };
        let again = again.map(Arc::new);
        let timelines = [Arc::clone(&timeline), Arc::clone(again.as_ref().unwrap_or(&timeline))];
        let news = News::start(timelines, desk, *screen, files, (notices_out, bytes_out));
        let news = news.map_err(|error| system(screen, &error))?;
        let report =
            report.map(|(path, file)| Ok((path.to_owned(), Reporter::start(path, file)?, diagnostics))).transpose();
        let report = report.map_err(|error: io::Error| system(screen, &error))?;
        let mut player = Player::new(&timeline, max_late);
        if let Some(again) = &again {
            player = player.again_and_again(again);
        }
        let stalls = port.board.as_ref().map(Served::stalls).unwrap_or_default();
        let link = Recorder::new(Stalling::new(port.link, stalls), bytes_in);
        let mut rig = Rig::new(link, signals, Lines::of(&sources));
        rig.keys = keys;
        rig.realtime = self.realtime && become_realtime(screen);
        // The last of all: from here on the player must beat.
        let mut ward = Ward::of(&timeline);
        (ward.max_late, ward.realtime) = (max_late, self.realtime);
        rig.guard = match self.guard(rig.link.descriptor(), &ward, port.board.is_some(), screen) {
            Ok(guard) => guard,
            // A Ctrl-C reaches the guard, too, while it starts.
            Err(error) => {
                return Err(rig.signals.pending().map_or_else(|| system(screen, &error), Exit::Signal));
            }
        };

        let mut lost = Lost::default();
        if self.paused || self.step {
            player = player.paused();
        }
        if let Some(keys) = &mut rig.keys {
            keys.enter_steps = self.step;
            // The guard has seen the terminal as it was.
            keys.begin();
        }
        let (start, started) = (now(), SystemTime::now());
        // The time that is shown begins here, too.
        lost.notices += u64::from(notices_in.push((start, Notice::Pass { pass: 1 })).is_err());
        if let Some(board) = &port.board {
            board.begin(start);
        }
        let outcome = drive(&mut player, &mut rig, start, |notice| {
            // Where the screen cannot follow, it misses something; the motion does not wait.
            lost.notices += u64::from(notices_in.push((now(), notice)).is_err());
        });
        let elapsed = (now() - start).micros();
        let Rig { mut link, mut guard, keys, lines, .. } = rig;
        drop(keys);
        if (outcome.cause, outcome.stop) == (Cause::Panicked, Stop::NotSent) {
            // A player that failed before it could stop the robot leaves that to its guard, which kills it first.
            drop(guard.take());
        }
        if let Some(guard) = &mut guard {
            guard.ended(outcome.at, outcome.place.map(|span| lines.place(span)), outcome.stop);
        }
        if outcome.stop == Stop::NotSent {
            // What the port never took must not keep it from closing.
            let _ = link.discard();
        }
        lost.bytes = link.lost();
        let bytes = link.taken();
        // Both rings end, which ends the news.
        drop(notices_in);
        let is_real = port.board.is_none();
        // The virtual board ends when its port is closed. A real one is closed when all was said: the system may wait for it as long as
        // half a minute.
        let held = Some(link.into_inner().into_inner()).filter(|_| is_real);
        let run = Asking { asked: self.show.asked(), first_pass, port: name, started, elapsed, bytes };
        let (sources, timeline) = (&sources, &*timeline);
        let end =
            End { run, screen: *screen, sources, timeline, outcome, lost, news, report, board: port.board, guard };
        let exit = end.tell();
        drop(held);
        Ok(exit)
    }

    /// Opens the files for results, each of them another one; what is in them stays for now. A report is written when it is whole.
    fn results(&self, sources: &Sources, refused: &impl Fn(&Path, &io::Error) -> Exit) -> Result<Results<'_>, Exit> {
        let inputs = Inputs::of_sources(sources);
        let asked = [("--record", &self.record), ("--report", &self.report), ("--log", &self.log)];
        let mut places: Vec<(&str, PathBuf)> = Vec::new();
        for (option, path) in asked {
            let Some(path) = path else { continue };
            let place = growing::place(path);
            if let Some((other, _)) = places.iter().find(|(_, other)| *other == place) {
                return Err(refused(path, &io::Error::other(format!("it is the file of {other}"))));
            }
            places.extend((!growing::takes_everything(path)).then_some((option, place)));
        }
        Ok(Results {
            recording: open_result(self.record.as_ref(), refused, |path| growing::open(path, &inputs, self.force))?,
            report: open_result(self.report.as_ref(), refused, |path| {
                output::whole(path, &inputs, self.force).map(|file| file.is_in_place().then_some(file))
            })?,
            log: open_result(self.log.as_ref(), refused, |path| {
                growing::create(path, &inputs).map(|created| created.file)
            })?,
        })
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

/// An open port, and the virtual board behind it if there is one.
struct Port {
    link: Serial,
    board: Option<Served>,
}

impl Port {
    fn open(path: Option<&Path>, timeline: &Timeline, faults: Faults, screen: &Screen) -> Result<Self, Exit> {
        let Timeline { board, baud, .. } = timeline;
        if let Some(path) = path {
            let link = Serial::open(path, *baud).map_err(|error| refused(screen, path, &error))?;
            screen.note(&format!("playing on {}", path.display()));
            return Ok(Port { link, board: None });
        }
        let pty = Pty::open().map_err(|error| system(screen, &error))?;
        // By its path, so that a rehearsal takes the way of the real thing.
        let link = Serial::open(pty.path(), *baud).map_err(|error| refused(screen, pty.path(), &error))?;
        screen.note("no --port given: playing on the built-in virtual board");
        let board = Faulty::new(Device::new(Arc::clone(board), Settings::default()), faults);
        let board = Served::start(board, pty, *baud).map_err(|error| system(screen, &error))?;
        Ok(Port { link, board: Some(board) })
    }
}

fn system(screen: &Screen, error: &io::Error) -> Exit {
    screen.error(&format!("cannot play: {error}; nothing was sent"));
    Exit::Port
}

/// Says why a port cannot be opened, and what to do.
pub(super) fn refused(screen: &Screen, path: &Path, error: &OpenError) -> Exit {
    let help = match error {
        OpenError::Missing => {
            "`motionseq ports` lists those that there are; on a Raspberry Pi it is usually /dev/serial0".to_owned()
        }
        OpenError::InUse => {
            "close that program (a paused motionseq? see `jobs`), or wait until it has ended".to_owned()
        }
        OpenError::Forbidden => permission(path),
        OpenError::NotAPort | OpenError::OwnTerminal | OpenError::Nobody => {
            "name the device that the board hangs on, usually /dev/serial0".to_owned()
        }
        _ => "check the cable and the port".to_owned(),
    };
    screen.error(&format!("cannot open port {}: {error}; nothing was sent; {help}", path.display()));
    match error {
        OpenError::InUse => Exit::InUse,
        _ => Exit::Port,
    }
}

/// How a user comes by the permission to open a port: the group of its node, if that may.
fn permission(path: &Path) -> String {
    let Ok(meta) = path.metadata() else {
        return "the folder that it is in may not be read".to_owned();
    };
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(meta.gid())).then(|| name.to_owned())
    });
    match name {
        Some(name) if meta.mode() & 0o060 == 0o060 && meta.gid() != 0 => {
            format!("run `sudo usermod -aG {name} $USER`, then log out and in again")
        }
        _ => "only its owner may open it; a udev rule with GROUP=\"dialout\", MODE=\"0660\" gives it to the users of that group"
            .to_owned(),
    }
}
