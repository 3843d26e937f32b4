//! `motionseq play`: sends a script to a board, in time.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use clap::Args;
use motionseq::board::{Report, State};
use motionseq::link::{OpenError, Pty, Recorder, Serial};
use motionseq::playback::{Cause, Notice, Outcome, Player, Signals, Stop, drive};
use motionseq::sim::{Received, VirtualBoard, serve};
use motionseq::source::Sources;
use motionseq::timeline::Timeline;
use rtrb::{Consumer, RingBuffer};

use super::Script;
use super::exit::Exit;
use super::output;
use super::screen::{Screen, plural, seconds};

/// Play a script on a board, or on a virtual one
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq play scripts/hello.motion                        on the built-in virtual board\n  motionseq play scripts/hello.motion --port /dev/serial0    on a Raspblock\n\nCtrl-C (or Ctrl-Z, or Ctrl-\\) stops the robot and ends."
)]
pub(super) struct Play {
    #[command(flatten)]
    script: Script,
    /// The serial port of the board, or else what `MOTIONSEQ_PORT` names; without it a virtual board takes the frames
    #[arg(long, value_name = "PATH")]
    port: Option<PathBuf>,
    /// Stop and end when a frame is later than this [default: 50ms, on the virtual board 1s]
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    max_late: Option<Duration>,
    /// Write the exact bytes that the port was given to this file
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
}

/// A frame later than this ends the run: on a real port, and on the virtual board.
const MAX_LATE: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(1)];
/// How often the screen and the recording are brought up to date.
const UPDATE: Duration = Duration::from_millis(40);
/// How long the end of a run waits for a screen or a file.
const PATIENCE: Duration = Duration::from_secs(5);
/// Room for notices and recorded bytes between two updates. The line carries 11,520 bytes a second.
const NOTICES: usize = 16 * 1024;
const BYTES: usize = 256 * 1024;

impl Play {
    /// Compiles the script, opens the port, plays, and says how it went.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match self.try_run(screen) {
            Ok(exit) | Err(exit) => exit,
        }
    }

    fn try_run(&self, screen: &Screen) -> Result<Exit, Exit> {
        let (sources, timeline) = self.script.compile(screen)?;
        let refused = |path: &Path, error: &io::Error| {
            screen.error(&format!("cannot write {}: {error}; nothing was sent", path.display()));
            Exit::Usage
        };
        let recording = match &self.record {
            None => None,
            Some(path) => {
                let file = output::open(path, &self.script.file).map_err(|error| refused(path, &error))?;
                Some((path.clone(), file))
            }
        };
        let signals = Signals::catch().map_err(|error| system(screen, &error))?;
        let port = self.port.clone().or_else(|| std::env::var_os("MOTIONSEQ_PORT").map(PathBuf::from));
        // A variable that is empty is one that is not set.
        let port = port.filter(|port| !port.as_os_str().is_empty());
        let [on_port, on_virtual] = MAX_LATE;
        let max_late = self.max_late.unwrap_or(if port.is_some() { on_port } else { on_virtual });
        let port = Port::open(port.as_deref(), timeline.baud, screen)?;
        if let Some((path, file)) = &recording {
            output::begin(file).map_err(|error| refused(path, &error))?;
        }

        let timeline = Arc::new(timeline);
        let (bytes_in, bytes_out) = RingBuffer::new(BYTES);
        let (mut notices_in, notices_out) = RingBuffer::new(NOTICES);
        let mut link = Recorder::new(port.link, bytes_in);
        let mut player = Player::new(&timeline, u64::try_from(max_late.as_nanos()).unwrap_or(u64::MAX));
        let news = News { timeline: Arc::clone(&timeline), screen: *screen, recording, report: None };
        let news = thread::Builder::new().name("news".into()).spawn(move || news.run(notices_out, bytes_out));
        let news = news.map_err(|error| system(screen, &error))?;

        let mut lost = Lost::default();
        let outcome = drive(&mut player, &mut link, &signals, |notice| {
            // Where the screen cannot follow, it misses something; the motion does not wait.
            lost.notices += u64::from(notices_in.push(notice).is_err());
        });
        lost.bytes = link.lost();
        // Both rings end, which ends the news; the closed port ends the virtual board.
        drop((link, notices_in));
        let end =
            End { screen: *screen, sources, timeline: Arc::clone(&timeline), outcome, lost, news, board: port.board };
        Ok(end.tell())
    }
}

/// What did not fit the rings.
#[derive(Clone, Copy, Debug, Default)]
struct Lost {
    notices: u64,
    bytes: u64,
}

/// All that is left to do when nothing is sent any more: to say how it went.
struct End {
    screen: Screen,
    sources: Sources,
    timeline: Arc<Timeline>,
    outcome: Outcome,
    lost: Lost,
    news: JoinHandle<(io::Result<()>, Option<Report>)>,
    board: Option<JoinHandle<io::Result<Received>>>,
}

impl End {
    /// Says it, but waits no longer than [`PATIENCE`] for a screen or a file that takes nothing.
    fn tell(self) -> Exit {
        let exit = exit_code(&self.outcome);
        let (done, finished) = mpsc::channel();
        let told = thread::Builder::new().spawn(move || {
            self.say();
            let _ = done.send(());
        });
        if told.is_ok() {
            let _ = finished.recv_timeout(PATIENCE);
        }
        exit
    }

    fn say(self) {
        let End { screen, sources, timeline, outcome, lost, news, board } = self;
        let (written, report) =
            news.join().unwrap_or_else(|_| (Err(io::Error::other("the thread that writes it failed")), None));
        let written = match lost.bytes {
            0 => written,
            bytes => written.and(Err(io::Error::other(format!("{bytes} bytes did not fit the buffer")))),
        };
        if let Err(error) = written {
            screen.error(&format!("the recording is not complete: {error}; the motion was not changed by that"));
        }
        if lost.notices > 0 {
            screen.note(&format!(
                "{} were not shown",
                plural(usize::try_from(lost.notices).unwrap_or(usize::MAX), "line")
            ));
        }
        if outcome.stop == Stop::Sent {
            for cue in &timeline.abort_cues {
                screen.note(&format!("on abort: {}", cue.text));
            }
        }
        summary(&screen, &outcome, report);
        match board.map(JoinHandle::join) {
            None => {}
            Some(Ok(Ok(received))) => board_summary(&screen, &received),
            Some(Ok(Err(error))) => screen.error(&format!("the virtual board failed: {error}")),
            Some(Err(_)) => screen.error("the virtual board failed"),
        }
        early_end(&screen, &sources, &outcome);
    }
}

/// An open port, and the virtual board behind it if there is one.
struct Port {
    link: Serial,
    board: Option<JoinHandle<io::Result<Received>>>,
}

impl Port {
    fn open(path: Option<&Path>, baud: u32, screen: &Screen) -> Result<Self, Exit> {
        if let Some(path) = path {
            let link = Serial::open(path, baud).map_err(|error| refused(screen, path, &error))?;
            return Ok(Port { link, board: None });
        }
        let pty = Pty::open().map_err(|error| system(screen, &error))?;
        // By its path, so that a rehearsal takes the way of the real thing.
        let link = Serial::open(pty.path(), baud).map_err(|error| refused(screen, pty.path(), &error))?;
        screen.note("no --port given: playing on the built-in virtual board");
        let board = serve(VirtualBoard::new(), pty, baud).map_err(|error| system(screen, &error))?;
        Ok(Port { link, board: Some(board) })
    }
}

fn system(screen: &Screen, error: &io::Error) -> Exit {
    screen.error(&format!("cannot play: {error}; nothing was sent"));
    Exit::Port
}

/// Says why a port cannot be opened, and what to do.
fn refused(screen: &Screen, path: &Path, error: &OpenError) -> Exit {
    let help = match error {
        OpenError::Missing => {
            "look for it with `ls /dev/tty* /dev/serial*`; on a Raspberry Pi it is usually /dev/serial0"
        }
        OpenError::InUse => "close that program, or wait until it has ended",
        OpenError::Forbidden => "run `sudo usermod -aG dialout $USER`, then log out and in again",
        OpenError::NotAPort => "name the device that the board hangs on, usually /dev/serial0",
        OpenError::Other(_) => "check the cable and the port",
    };
    screen.error(&format!("cannot open port {}: {error}; nothing was sent; {help}", path.display()));
    match error {
        OpenError::InUse => Exit::InUse,
        _ => Exit::Port,
    }
}

/// The thread that writes: the progress line, `say` lines, the recording. Motion never waits for it.
struct News {
    timeline: Arc<Timeline>,
    screen: Screen,
    recording: Option<(PathBuf, File)>,
    report: Option<Report>,
}

impl News {
    /// Writes until both rings have ended and are empty. Gives whether the recording is whole, and the board's last report.
    fn run(mut self, mut notices: Consumer<Notice>, mut bytes: Consumer<u8>) -> (io::Result<()>, Option<Report>) {
        let begin = Instant::now();
        let mut recording = self.recording.take().map(|(_, file)| BufWriter::new(file));
        let mut written = Ok(());
        loop {
            // Looked at before the rings are emptied, so that nothing is left in them at the end.
            let last = notices.is_abandoned() && bytes.is_abandoned();
            while let Ok(notice) = notices.pop() {
                self.tell(notice);
            }
            if let Ok(chunk) = bytes.read_chunk(bytes.slots()) {
                if let Some(file) = &mut recording {
                    let (first, second) = chunk.as_slices();
                    written = written.and_then(|()| file.write_all(first)).and_then(|()| file.write_all(second));
                }
                chunk.commit_all();
            }
            if last {
                break;
            }
            self.screen.live(&self.progress(begin.elapsed()));
            thread::park_timeout(UPDATE);
        }
        self.screen.live("");
        if let Some(mut file) = recording {
            written = written.and_then(|()| file.flush());
        }
        (written, self.report)
    }

    fn tell(&mut self, notice: Notice) {
        match notice {
            Notice::Say { cue } => {
                if let Some(cue) = self.timeline.cues.get(cue) {
                    self.screen.note(&format!("{} s: {}", seconds(cue.at_us), cue.text));
                }
            }
            Notice::Report(newest) => self.report = Some(newest),
            Notice::Sent { event, .. } if self.screen.is_verbose() => self.frame("", event),
            Notice::Sent { .. } => {}
            Notice::Dropped { event } => self.frame(" dropped", event),
        }
    }

    /// A line about one frame.
    fn frame(&self, what: &str, event: usize) {
        if let Some(event) = self.timeline.events().get(event) {
            let kind = event.kind.word().map(|word| format!(" ({word})")).unwrap_or_default();
            self.screen.note(&format!("{} s{what}: {}{kind}", seconds(event.at_us), event.command));
        }
    }

    /// `1.2 / 3.0 s ████░░░░░░`.
    fn progress(&self, elapsed: Duration) -> String {
        // The bar gives way to the numbers on a narrow terminal.
        let width = u64::try_from(self.screen.width().saturating_sub(30).min(30)).unwrap_or(0);
        let end = self.timeline.end_us;
        let now = u64::try_from(elapsed.as_micros()).unwrap_or(u64::MAX).min(end);
        let done = now.saturating_mul(width).checked_div(end).unwrap_or(width);
        let bar: String = (0..width).map(|place| if place < done { '█' } else { '░' }).collect();
        format!("{} / {} s {bar}", seconds(now), seconds(end))
    }
}

fn summary(screen: &Screen, outcome: &Outcome, report: Option<Report>) {
    let frames = plural(outcome.sent, "frame");
    let worst = outcome.worst_late / 1_000;
    let dropped = match outcome.dropped {
        0 => String::new(),
        count => format!(", {count} dropped"),
    };
    screen.note(&format!(
        "sent {frames}{dropped} in {} s; the latest was {}.{:03} ms late",
        seconds(outcome.at_us),
        worst / 1_000,
        worst % 1_000
    ));
    if let Some(Report { pitch, roll, yaw, voltage }) = report {
        screen.note(&format!("last report of the board: pitch {pitch}°, roll {roll}°, yaw {yaw}°, {voltage} V"));
    }
}

fn board_summary(screen: &Screen, received: &Received) {
    let frames = plural(usize::try_from(received.frames).unwrap_or(usize::MAX), "frame");
    screen.note(&format!(
        "the virtual board received {frames} ({} bytes); {}",
        received.bytes,
        described(&received.state)
    ));
    if let Some((at, fault)) = received.first_fault {
        let more = received.not_understood;
        screen.note(&format!(
            "it could not use {more} frames and {} bytes; the first at byte {at}: {fault}",
            received.skipped
        ));
    }
}

/// What a board was last told, in words.
fn described(state: &State) -> String {
    let drive = match state.drive() {
        Some(drive) if drive.keeps_driving() => format!("the drive runs: {drive}"),
        _ => "the drive stands".into(),
    };
    let buzzer = if state.buzzer() == Some(true) { "the buzzer is on" } else { "the buzzer is off" };
    let servos = (1..=4).filter_map(|index| {
        let servo = state.servo(motionseq::board::ServoIndex::new(index).ok()?)?;
        Some(format!(", servo {index} at {servo} µs"))
    });
    format!("{drive}, {buzzer}{}", servos.collect::<String>())
}

fn exit_code(outcome: &Outcome) -> Exit {
    match outcome.cause {
        Cause::Finished => Exit::Ok,
        Cause::Signal(signal) => Exit::Signal(signal),
        Cause::Lost(_) => Exit::Port,
        Cause::Stalled => Exit::Stalled,
        Cause::Late(_) => Exit::Late,
        Cause::Panicked => Exit::Failed,
    }
}

/// For an early end the one line that says what happened.
fn early_end(screen: &Screen, sources: &Sources, outcome: &Outcome) {
    let cause = match outcome.cause {
        Cause::Finished => return,
        Cause::Signal(signal) => signal_name(signal),
        Cause::Lost(None) => "the port hung up".into(),
        Cause::Lost(Some(error)) => format!("the port was lost ({})", io::Error::from_raw_os_error(error)),
        Cause::Stalled => "the port stopped taking bytes".into(),
        Cause::Late(late) => format!("a frame was {} ms late", late / 1_000_000),
        Cause::Panicked => "motionseq failed, which is a bug".into(),
    };
    let place = match outcome.place {
        Some(span) => format!(" at {}", sources.place(span)),
        None => String::new(),
    };
    let stop = match outcome.stop {
        Stop::NotSent => "stop: NOT SENT - cut the power",
        Stop::Sent | Stop::NotNeeded => "stop: sent",
    };
    screen.error(&format!("{cause}{place}, {} s into the script; {stop}", seconds(outcome.at_us)));
}

fn signal_name(signal: i32) -> String {
    match signal {
        1 => "the terminal was closed (SIGHUP)".into(),
        2 => "stopped by Ctrl-C".into(),
        3 => "stopped by Ctrl-\\ (SIGQUIT)".into(),
        20 => "stopped by Ctrl-Z (SIGTSTP)".into(),
        15 => "asked to terminate (SIGTERM)".into(),
        other => format!("stopped by signal {other}"),
    }
}
