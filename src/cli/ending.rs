//! The end of a run: what is said when nothing is sent any more, and the exit code.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use motionseq::board::{Board, ON_SILENCE, Report};
use motionseq::diagnostic::Diagnostics;
use motionseq::playback::{Cause, Guard, Outcome, Stop, now};
use motionseq::serve::Served;
use motionseq::sim::Received;
use motionseq::source::{Sources, Span};
use motionseq::timeline::Timeline;
use motionseq::timeline::wire::{LATE, load};
use motionseq::units::Micros;

use super::exit::Exit;
use super::log::Level;
use super::news::Told;
use super::notes::{Asking, Facts, Notes};
use super::replace::Replacement;
use super::screen::{PATIENCE, Screen, plural};
use super::start_thread;

/// How long it waits for the thread that has heard the run; it has nothing to do but to write down what it has heard.
const NEWS: Duration = Duration::from_millis(1_500);

/// What did not fit the rings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lost {
    pub(super) notices: u64,
    pub(super) bytes: u64,
}

/// All that is left to do when nothing is sent any more: to say how it went.
pub(super) struct End<'r> {
    pub(super) screen: Screen,
    pub(super) sources: &'r Sources,
    pub(super) timeline: &'r Timeline,
    pub(super) outcome: Outcome,
    pub(super) lost: Lost,
    pub(super) news: Receiver<Told>,
    /// Where the report goes, its name, and what is wrong with the script.
    pub(super) report: Option<(PathBuf, Reporter, Diagnostics)>,
    pub(super) run: Asking,
    pub(super) board: Option<Served>,
    /// Tells this that all was said.
    pub(super) guard: Option<Guard>,
}

/// The thread that writes a report, made before the first frame: at the end the system may have none to give.
pub(super) struct Reporter {
    text: Sender<String>,
    written: Receiver<io::Result<()>>,
}

impl Reporter {
    /// Starts it; a file that is there already is what is written to.
    pub(super) fn start(path: &Path, file: Option<Replacement>) -> io::Result<Self> {
        let ((text, texts), (done, written)) = (mpsc::channel::<String>(), mpsc::channel());
        let path = path.to_owned();
        start_thread("report", move || {
            if let Ok(text) = texts.recv() {
                let file = file.map_or_else(|| Replacement::begin(&path), Ok);
                let all = file.and_then(|mut file| {
                    file.write_all(text.as_bytes())?;
                    file.finish()
                });
                let _ = done.send(all);
            }
        })?;
        Ok(Reporter { text, written })
    }

    /// Waits until it is written.
    fn end(self, until: Instant) -> io::Result<()> {
        self.written.recv_timeout(until.saturating_duration_since(Instant::now())).unwrap_or_else(|why| {
            Err(io::Error::other(match why {
                RecvTimeoutError::Timeout => "it takes no more bytes",
                RecvTimeoutError::Disconnected => "the thread that writes it failed",
            }))
        })
    }
}

impl End<'_> {
    /// Says how it went; gives the exit code.
    #[expect(clippy::too_many_lines, reason = "one line after the other")]
    pub(super) fn tell(self) -> Exit {
        let End { screen, sources, timeline, outcome, lost, news, report, run, board, guard } = self;
        let exit = exit_code(&outcome);
        let ending = early_end(sources, timeline, &outcome);
        let whole = match outcome.dropped {
            0 => "everything was sent".to_owned(),
            dropped => format!("everything was sent but {}, which newer ones had overtaken", plural(dropped, "frame")),
        };
        let line_late = load(timeline).worst.map_or(Micros::ZERO, |(_, late)| late);
        let Told { recorded, report: last, notes, log } = news.recv_timeout(NEWS).unwrap_or_else(|_| {
            let failed = Err(io::Error::other("the thread that keeps it failed"));
            Told { recorded: failed, report: None, notes: Notes::new(), log: None }
        });
        let report = report.map(|(path, reporter, diagnostics)| {
            let facts = Facts {
                sources,
                diagnostics: &diagnostics,
                outcome: &outcome,
                cause: ending.as_ref().map_or_else(|| whole.clone(), |(cause, _)| cause.clone()),
                exit: exit.code(),
                not_noted: lost.notices,
                place: ending.as_ref().and_then(|_| place_of(timeline, &outcome)),
                line_late,
                end: timeline.end,
                run: &run,
            };
            // Where nobody takes it, that is said below.
            let _ = reporter.text.send(notes.report(facts));
            (path, reporter, Instant::now() + PATIENCE)
        });
        let recorded = match lost.bytes {
            0 => recorded,
            bytes => recorded.and(Err(io::Error::other(format!("{bytes} bytes did not fit the buffer")))),
        };
        let mut is_whole = recorded.is_ok();
        if let Err(error) = recorded {
            screen.warning(&format!("the recording is not complete: {error}; the motion was not changed by that"));
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
        summary(&screen, &timeline.board, &outcome, last);
        if line_late > LATE {
            screen.note(&format!(
                "a line of {} baud carries a frame up to {} later than that",
                timeline.baud,
                line_late.short()
            ));
        }
        board_end(&screen, &timeline.board, board);
        if let Some((mut log, timeline)) = log {
            log.pass_marks(&timeline, outcome.at);
            match &ending {
                None => log.log.line(now(), Level::Info, whole),
                Some((_, line)) => log.log.line(now(), Level::Error, line),
            }
            is_whole &= log.log.end();
        }
        let is_early = ending.is_some();
        if let Some((_, line)) = ending {
            if (outcome.cause, outcome.stop) == (Cause::Quit, Stop::Sent) {
                screen.note(&line);
            } else {
                screen.error(&line);
            }
        }
        // A guard that gets no goodbye says it in the place of a screen that takes nothing.
        let is_said = Screen::is_written(PATIENCE);
        if let Some(guard) = guard.filter(|_| is_said || !is_early) {
            guard.goodbye();
        }
        if let Some((path, reporter, until)) = report
            && let Err(error) = reporter.end(until)
        {
            is_whole = false;
            screen.warning(&format!("the report {} is not complete: {error}", path.display()));
        }
        match exit {
            Exit::Ok if !is_whole => Exit::Usage,
            exit => exit,
        }
    }
}

/// What became of the virtual board.
fn board_end(screen: &Screen, board: &Board, served: Option<Served>) {
    match served.map(|served| served.join(PATIENCE)) {
        None => {}
        Some(Some(Ok(received))) => board_summary(screen, board, &received),
        Some(Some(Err(error))) => screen.error(&format!("the virtual board failed: {error}")),
        Some(None) => screen.error("the virtual board failed"),
    }
}

fn summary(screen: &Screen, board: &Board, outcome: &Outcome, report: Option<Report>) {
    let frames = plural(outcome.sent, "frame");
    let dropped = match outcome.dropped {
        0 => String::new(),
        count => format!(", {count} dropped"),
    };
    let extra = match outcome.extra {
        0 => String::new(),
        count => format!(", and {} of stops, pauses and `on abort`", plural(count, "frame")),
    };
    screen.note(&format!(
        "sent {frames}{dropped} in {:.3} s{extra}; the worst was {:.3} ms late",
        outcome.at,
        outcome.worst_late.in_millis()
    ));
    if let Some(report) = report {
        screen.note(&format!("last report of the board: {}", board.report(&report)));
    }
}

/// What a virtual board has received, in words.
pub(super) fn board_summary(screen: &Screen, board: &Board, received: &Received) {
    let frames = plural(usize::try_from(received.frames).unwrap_or(usize::MAX), "frame");
    screen.note(&format!(
        "the virtual board received {frames} ({} bytes); {}",
        received.bytes,
        described(board, received)
    ));
    let pose = received.pose;
    if (pose.x_cm, pose.y_cm, pose.yaw_deg) != (0.0, 0.0, 0.0) {
        screen.note(&format!(
            "in its nominal units the robot has moved {} and {}, and turned {}",
            way(pose.x_cm, " cm", ["to the right", "to the left"]),
            way(pose.y_cm, " cm", ["forward", "back"]),
            way(pose.yaw_deg, "°", ["clockwise", "counterclockwise"])
        ));
    }
    if received.lost > 0 {
        let lost = plural(usize::try_from(received.lost).unwrap_or(usize::MAX), "frame");
        screen.note(&format!("by the fault that was asked for, {lost} did not reach it"));
    }
    if let Some((at, fault)) = received.first_fault {
        let count = |count, word| plural(usize::try_from(count).unwrap_or(usize::MAX), word);
        let (frames, bytes) = (count(received.not_understood, "frame"), count(received.skipped, "byte"));
        screen.note(&format!("it could not use {frames} and {bytes}; the first at byte {at}: {fault}"));
    }
}

/// `11.6 cm to the left`.
fn way(value: f64, unit: &str, [ahead, back]: [&str; 2]) -> String {
    format!("{:.1}{unit} {}", value.abs(), if value < 0.0 { back } else { ahead })
}

/// What a board was last told, in words.
fn described(board: &Board, received: &Received) -> String {
    let state = &received.state;
    let mut words = Vec::new();
    for (id, resource) in board.resources.iter().enumerate().rev().filter(|(_, resource)| resource.rest.is_some()) {
        let (name, told) = (&resource.name, state.told(id));
        let is_active = told.is_some_and(|told| board.is_active(told));
        words.push(match told.map(|told| board.show(told)) {
            Some(told) if resource.is_fed && received.moves => format!("{name} runs: {told}"),
            Some(told) if resource.is_fed && is_active => {
                format!("it was left at {told}, and the virtual board has stopped by itself; {ON_SILENCE}")
            }
            _ if is_active => format!("{name} is {}", resource.activity),
            _ => format!("{name} {}", resource.idle),
        });
    }
    for (id, resource) in
        board.resources.iter().enumerate().filter(|(_, found)| found.rest.is_none() && found.is_exclusive)
    {
        let told =
            state.told(id).and_then(|told| Some((board.verb(told.verb())?.axes.last()?, *told.values().last()?)));
        if let Some((axis, value)) = told {
            words.push(format!("{} at {value} {}", resource.name, axis.unit.symbol()).trim_end().to_owned());
        }
    }
    words.join(", ")
}

fn exit_code(outcome: &Outcome) -> Exit {
    match outcome.cause {
        // Who asked for the end and did not get the stop must know.
        Cause::Quit if outcome.stop == Stop::NotSent => Exit::Port,
        Cause::Finished | Cause::Quit => Exit::Ok,
        Cause::Signal(signal) => Exit::Signal(signal),
        Cause::Lost(_) => Exit::Port,
        Cause::Stalled => Exit::Stalled,
        Cause::Late(_) => Exit::Late,
        Cause::Expect(_) => Exit::Expect,
        _ => Exit::Failed,
    }
}

/// For an early end its cause in words, and the one line that says what happened.
fn early_end(sources: &Sources, timeline: &Timeline, outcome: &Outcome) -> Option<(String, String)> {
    let cause = match outcome.cause {
        Cause::Finished => return None,
        Cause::Quit => "ended by q".into(),
        Cause::Signal(signal) => signal_name(signal),
        Cause::Lost(None) => "the port hung up".into(),
        Cause::Lost(Some(error)) => format!("the port was lost ({})", io::Error::from_raw_os_error(error)),
        Cause::Stalled => "the port stopped taking bytes".into(),
        Cause::Late(late) => format!("a frame was {:.0} ms late", late.in_millis()),
        Cause::Expect(verdict) => timeline.verdict_words(verdict.expect, &verdict.found.to_string()),
        Cause::Unguarded => "the guard of this run was lost".into(),
        _ => "motionseq failed, which is a bug".into(),
    };
    let place = place_of(timeline, outcome).map(|span| sources.place(span).to_string());
    let line = closing_line(&cause, place, outcome.at, stop_words(outcome.stop));
    Some((cause, line))
}

/// Where in the script a run ended: at the `expect` that failed, or at the last frame.
fn place_of(timeline: &Timeline, outcome: &Outcome) -> Option<Span> {
    let failed = match outcome.cause {
        Cause::Expect(verdict) => timeline.expects.get(verdict.expect).map(|expect| expect.span),
        _ => None,
    };
    failed.or(outcome.place)
}

/// What became of the robot, for the end of a closing line.
pub(super) fn stop_words(stop: Stop) -> &'static str {
    match stop {
        Stop::Sent | Stop::NotNeeded => "stop: sent",
        _ => "stop: NOT SENT - cut the power",
    }
}

/// What happened, where in the script, when, and what became of the robot.
pub(super) fn closing_line(cause: &str, place: Option<String>, at: Micros, robot: &str) -> String {
    let place = place.map(|place| format!(" at {place}")).unwrap_or_default();
    format!("{cause}{place}, {at:.3} s into the run; {robot}")
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
