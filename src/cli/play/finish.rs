//! The end of a run: summary, closing lines, report and exit code.

use motionseq::diagnostic::Diagnostics;
use motionseq::playback::{Cause, Guard, Outcome, ServoFault, ServoFaultKind, Stop, now};
use motionseq::report;
use motionseq::serve::BoardThread;
use motionseq::timeline::Timeline;
use motionseq::timeline::wire::LATE;
use motionseq::units::Nanos;

use super::super::exit::Exit;
use super::super::log::Level;
use super::super::run_summary::board_summary;
use super::super::screen::{PATIENCE, Screen, plural};
use super::observers::Results;
use super::result_files::Report;
use super::run_log::{Run, RunLog};

/// The age of a report whose values a line of `on abort` still shows, with the time that the stop took.
const FRESH: Nanos = Nanos::from_millis(1_500);

/// Everything needed to report a run that has ended.
pub(super) struct Finish<'r> {
    pub(super) screen: Screen,
    pub(super) robots: Vec<Ended<'r>>,
    /// The robot whose run ended before that of all others.
    pub(super) first: usize,
    /// The report file, if there is one, and the warnings of the script.
    pub(super) report: Option<(Report, Diagnostics)>,
}

/// The end of one robot's run.
pub(super) struct Ended<'r> {
    pub(super) run: Run<'r>,
    pub(super) board: Option<BoardThread>,
    /// Gets the goodbye once everything is reported.
    pub(super) guard: Option<Guard>,
}

impl Finish<'_> {
    /// Reports the run and returns the exit code. Files are written first, because standard error may be blocked.
    pub(super) fn report(self, results: Results) -> Exit {
        let Finish { screen, mut robots, first, report } = self;
        let Results { runs: counted, recorded, log } = results;
        let report = report.map(|(report, diagnostics)| {
            let runs = robots.iter().zip(&counted).map(|(ended, counted)| ended.run.report(counted, &diagnostics));
            let text = text_of(runs.collect(), &robots, first);
            (report.path.clone(), report.write(text))
        });
        let mut is_whole = recorded.is_ok();
        if let Err(error) = recorded {
            screen.warning(&format!("the recording is incomplete: {error}; motion was not affected"));
        }
        for (ended, counted) in robots.iter_mut().zip(&counted) {
            summary(&screen, &ended.run, counted);
            board_end(&screen, ended.run.timeline, ended.board.take());
        }
        let exit = exit_of(&robots, first);
        let mut order: Vec<(usize, &Ended<'_>)> = robots.iter().enumerate().collect();
        // The cause comes first, but a robot that may be moving is named last.
        order.sort_by_key(|(number, ended)| (badness(ended.run.outcome.stop) > 1, *number != first));
        if let Some(mut log) = log {
            for (number, ended) in &order {
                log.robot = *number;
                let level = if ended.run.is_early() { Level::Error } else { Level::Info };
                log.line(now(), level, ended.run.closing_line());
            }
            let cause = robots.get(first).map(|ended| ended.run.closing_line()).unwrap_or_default();
            is_whole &= log.end(exit, &cause);
        }
        for (_, ended) in &order {
            closing(&screen, &ended.run);
        }
        let is_early = robots.iter().any(|ended| ended.run.is_early());
        // If standard error is blocked, the guards get no goodbye and write the closing lines themselves.
        let is_said = Screen::is_written(PATIENCE);
        for guard in robots.into_iter().filter_map(|ended| ended.guard).filter(|_| is_said || !is_early) {
            guard.goodbye();
        }
        if let Some((path, write)) = report
            && let Err(error) = write()
        {
            is_whole = false;
            screen.warning(&format!("the report {} is incomplete: {error}", path.display()));
        }
        match exit {
            Exit::Ok if !is_whole => Exit::Usage,
            exit => exit,
        }
    }
}

/// The exit code of all robots: that of the first cause.
fn exit_of(robots: &[Ended<'_>], first: usize) -> Exit {
    let first = robots.get(first).into_iter();
    first.chain(robots).map(|ended| ended.run.exit()).find(|exit| *exit != Exit::Ok).unwrap_or(Exit::Ok)
}

/// How far a robot is from a safe stop; above 1, it may be moving.
fn badness(stop: Stop) -> u8 {
    match stop {
        Stop::NotNeeded => 0,
        Stop::Sent | Stop::Held | Stop::NotDefined => 1,
        Stop::NotHeld => 2,
        _ => 3,
    }
}

/// The report of all robots.
fn text_of(mut runs: Vec<report::Run>, robots: &[Ended<'_>], first: usize) -> String {
    let exit = exit_of(robots, first).code();
    for (run, ended) in runs.iter_mut().zip(robots) {
        // It ended for no reason of its own.
        if let Cause::Other { .. } = ended.run.outcome.cause {
            run.exit = exit;
        }
    }
    let worst = robots.iter().zip(&runs).max_by_key(|(ended, _)| badness(ended.run.outcome.stop));
    let stop = worst.map_or("not sent", |(_, run)| run.stop);
    let names_robots = runs.iter().any(|run| run.robot.is_some());
    let whole = if names_robots { report::Run::of_all(runs, first) } else { runs.pop() };
    whole.map(|run| report::json::run(&report::Run { exit, stop, ..run })).unwrap_or_default()
}

/// Shows why a run ended.
fn closing(screen: &Screen, run: &Run<'_>) {
    let line = run.closing_line();
    match (run.outcome.cause, run.outcome.stop) {
        (Cause::Finished, _) => {}
        (Cause::Quit, Stop::Sent | Stop::NotDefined | Stop::Held) => screen.note(&line),
        _ => screen.error(&line),
    }
    if let Cause::Servo(ServoFault { kind: ServoFaultKind::Silent, .. }) = run.outcome.cause {
        screen.ask(run.timeline.board.silence_hint());
    }
}

fn summary(screen: &Screen, run: &Run<'_>, counted: &RunLog) {
    let Run { timeline, outcome: Outcome { at, stop, sent, dropped, extra, worst_late, .. }, .. } = run;
    let name = timeline.prefix();
    if counted.not_noted > 0 {
        screen.note(&format!(
            "{name}{} were not shown",
            plural(usize::try_from(counted.not_noted).unwrap_or(usize::MAX), "line")
        ));
    }
    if run.outcome.aborted || matches!(stop, Stop::Sent | Stop::NotDefined) {
        let report = counted.report.filter(|(came, _)| now() - *came <= FRESH).map(|(_, report)| report);
        for cue in &timeline.abort_cues {
            screen.note(&format!("{name}on abort: {}", cue.text.with(report.as_ref())));
        }
    }
    if timeline.events.is_empty() {
        let what = if run.names.is_empty() { "the script sends nothing" } else { "the script sends nothing to it" };
        screen.note(&format!("{name}{what}"));
    }
    let dropped = if *dropped == 0 { String::new() } else { format!(", {dropped} dropped") };
    let extra = match *extra {
        0 => String::new(),
        count => {
            let requests = if counted.has_asked { "requests, " } else { "" };
            let start = if counted.has_prepared { "the start, " } else { "" };
            format!(", plus {} for {start}{requests}stops, pauses, gates and `on abort`", plural(count, "frame"))
        }
    };
    let gates = match counted.waited {
        Nanos::ZERO => String::new(),
        waited => format!(" and {:.3} s at gates", waited.micros()),
    };
    let (sent, worst) = (plural(*sent, "frame"), worst_late.in_millis());
    screen.note(&format!("{name}sent {sent}{dropped} in {at:.3} s{gates}{extra}; worst lateness {worst:.3} ms"));
    if let Some((_, report)) = &counted.report {
        screen.note(&format!("{name}last report of the board: {}", timeline.board.report(report)));
    }
    let (baud, late) = (timeline.baud, run.line_late());
    if late > LATE {
        screen.note(&format!("{name}at {baud} baud, a frame waits up to {} for the serial line", late.short()));
    }
}

/// Reports the end of the virtual board.
fn board_end(screen: &Screen, timeline: &Timeline, served: Option<BoardThread>) {
    let name = timeline.prefix();
    match served.map(|served| served.join(PATIENCE)) {
        None => {}
        Some(Some(Ok(received))) => board_summary(screen, &name, &timeline.board, &received),
        Some(Some(Err(error))) => screen.error(&format!("{name}the virtual board failed: {error}")),
        Some(None) => screen.error(&format!("{name}the virtual board failed")),
    }
}
