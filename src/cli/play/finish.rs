//! The end of a run: summary, closing line, report and exit code.

use motionseq::board::Board;
use motionseq::diagnostic::Diagnostics;
use motionseq::playback::{Cause, Guard, Outcome, ServoFault, ServoFaultKind, Stop, now};
use motionseq::serve::BoardThread;
use motionseq::timeline::wire::LATE;
use motionseq::units::Nanos;

use super::super::exit::Exit;
use super::super::log::Level;
use super::super::run_summary::board_summary;
use super::super::screen::{PATIENCE, Screen, plural};
use super::observers::Observed;
use super::result_files::Report;
use super::run_log::{Run, RunLog};

/// The age of a report whose values a line of `on abort` still shows, with the time that the stop took.
const FRESH: Nanos = Nanos::from_millis(1_500);

/// Everything needed to report a run that has ended.
pub(super) struct Finish<'r> {
    pub(super) screen: Screen,
    pub(super) run: Run<'r>,
    /// The report file, if there is one, and the warnings of the script.
    pub(super) report: Option<(Report, Diagnostics)>,
    pub(super) board: Option<BoardThread>,
    /// Gets the goodbye once everything is reported.
    pub(super) guard: Option<Guard>,
}

impl Finish<'_> {
    /// Reports the run and returns the exit code. Files are written first, because standard error may be blocked.
    pub(super) fn report(self, observed: Observed) -> Exit {
        let Finish { screen, run, report, board, guard } = self;
        let Observed { run: counted, recorded, log } = observed;
        let report =
            report.map(|(report, diagnostics)| (report.path.clone(), report.write(run.report(&counted, &diagnostics))));
        let mut is_whole = recorded.is_ok();
        if let Err(error) = recorded {
            screen.warning(&format!("the recording is incomplete: {error}; motion was not affected"));
        }
        summary(&screen, &run, &counted);
        board_end(&screen, &run.timeline.board, board);
        let line = run.closing_line();
        if let Some(mut log) = log {
            log.take_poses();
            log.log.line(now(), if run.is_early() { Level::Error } else { Level::Info }, line.as_str());
            is_whole &= log.log.end(run.exit(), &line);
        }
        match (run.outcome.cause, run.outcome.stop) {
            (Cause::Finished, _) => {}
            (Cause::Quit, Stop::Sent | Stop::NotDefined | Stop::Held) => screen.note(&line),
            _ => screen.error(&line),
        }
        if let Cause::Servo(ServoFault { kind: ServoFaultKind::Silent, .. }) = run.outcome.cause {
            screen.ask(run.timeline.board.silence_hint());
        }
        // If standard error is blocked, the guard gets no goodbye and writes the closing line itself.
        let is_said = Screen::is_written(PATIENCE);
        if let Some(guard) = guard.filter(|_| is_said || !run.is_early()) {
            guard.goodbye();
        }
        if let Some((path, write)) = report
            && let Err(error) = write()
        {
            is_whole = false;
            screen.warning(&format!("the report {} is incomplete: {error}", path.display()));
        }
        match run.exit() {
            Exit::Ok if !is_whole => Exit::Usage,
            exit => exit,
        }
    }
}

fn summary(screen: &Screen, run: &Run<'_>, counted: &RunLog) {
    let Run { timeline, outcome: Outcome { at, stop, sent, dropped, extra, worst_late, .. }, .. } = run;
    if counted.not_noted > 0 {
        screen.note(&format!(
            "{} were not shown",
            plural(usize::try_from(counted.not_noted).unwrap_or(usize::MAX), "line")
        ));
    }
    if run.outcome.aborted || matches!(stop, Stop::Sent | Stop::NotDefined) {
        let report = counted.report.filter(|(came, _)| now() - *came <= FRESH).map(|(_, report)| report);
        for cue in &timeline.abort_cues {
            screen.note(&format!("on abort: {}", cue.text.with(report.as_ref())));
        }
    }
    if timeline.events.is_empty() {
        screen.note("the script sends nothing");
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
    screen.note(&format!("sent {sent}{dropped} in {at:.3} s{gates}{extra}; worst lateness {worst:.3} ms"));
    if let Some((_, report)) = &counted.report {
        screen.note(&format!("last report of the board: {}", timeline.board.report(report)));
    }
    let (baud, late) = (timeline.baud, run.line_late());
    if late > LATE {
        screen.note(&format!("at {baud} baud, a frame waits up to {} for the serial line", late.short()));
    }
}

/// Reports the end of the virtual board.
fn board_end(screen: &Screen, board: &Board, served: Option<BoardThread>) {
    match served.map(|served| served.join(PATIENCE)) {
        None => {}
        Some(Some(Ok(received))) => board_summary(screen, board, &received),
        Some(Some(Err(error))) => screen.error(&format!("the virtual board failed: {error}")),
        Some(None) => screen.error("the virtual board failed"),
    }
}
