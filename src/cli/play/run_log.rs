//! The result of a run: counters, the closing line and the report.

use std::io;
use std::sync::Arc;
use std::time::SystemTime;

use hdrhistogram::Histogram;
use motionseq::board::{Hex, Report};
use motionseq::diagnostic::Diagnostics;
use motionseq::playback::{Cause, Notice, Outcome, Passage, ShortCommand, Stop, Verdict, Why};
use motionseq::report::{self, Asked, Dropped, Expected, Frames, Lateness};
use motionseq::source::{Lines, Sources, Span};
use motionseq::timeline::wire::load;
use motionseq::timeline::{Gate, Timeline};
use motionseq::units::{Micros, Nanos};

use super::super::exit::Exit;
use super::super::run_summary::{closing_line, signal_name, stop_words};
use super::super::screen::plural;
use super::observer::Observer;

/// The most dropped frames and the most `expect`s that are listed.
const NAMED: usize = 1_000;

/// The most gates that are listed, besides one that failed.
const MOST_GATES: usize = 100_000;

/// A frame that depends on the world.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extra {
    /// A frame of the drive, sent again at a closed gate: the index of its command.
    Refresh(usize),
    /// A request: the row of the quantity.
    Read(usize),
    /// A frame before the script, or before the torque of a servo is switched on.
    Servo(Why, ShortCommand),
}

/// Counters of a run. Frames and expectations refer to the timeline that was playing.
pub(super) struct RunLog {
    /// The lateness of frames, in nanoseconds; `None` if memory ran out.
    lateness: Option<Histogram<u64>>,
    dropped: Vec<(Arc<Timeline>, usize)>,
    verdicts: Vec<(Arc<Timeline>, Verdict)>,
    passages: Vec<(Arc<Timeline>, Passage)>,
    /// How long gates were closed.
    pub(super) waited: Nanos,
    /// Frames that are not of the script: which, the frames of the script before them, and how many.
    unscripted: Vec<(Arc<Timeline>, Extra, u64, u64)>,
    /// Whether the board was asked for a quantity.
    pub(super) has_asked: bool,
    /// Whether servos were prepared.
    pub(super) has_prepared: bool,
    /// The frames of the script so far.
    sent: u64,
    passes: u64,
    pauses: u64,
    is_paused: bool,
    /// The board's last report, and when it came.
    pub(super) report: Option<(Nanos, Report)>,
    /// All bytes that the port accepted.
    pub(super) bytes: u64,
    /// How many notices did not fit in the ring.
    pub(super) not_noted: u64,
}

impl RunLog {
    pub(super) fn new() -> Self {
        // From a nanosecond to a minute, to three digits; longer times count as a minute.
        let lateness = Histogram::new_with_bounds(1, 60_000_000_000, 3).ok();
        RunLog {
            lateness,
            dropped: Vec::new(),
            verdicts: Vec::new(),
            passages: Vec::new(),
            waited: Nanos::ZERO,
            unscripted: Vec::new(),
            has_asked: false,
            has_prepared: false,
            sent: 0,
            passes: 1,
            pauses: 0,
            is_paused: false,
            report: None,
            bytes: 0,
            not_noted: 0,
        }
    }
}

impl Observer for RunLog {
    fn observe(&mut self, timeline: &Arc<Timeline>, at: Nanos, notice: Notice) {
        match notice {
            Notice::Report(newest) => self.report = Some((at, newest)),
            Notice::Passed(passage) => {
                self.waited += passage.took;
                if self.passages.len() < MOST_GATES || !passage.end.is_open() {
                    self.passages.push((Arc::clone(timeline), passage));
                }
            }
            Notice::Refreshed { event } => self.note_unscripted(timeline, Extra::Refresh(event)),
            Notice::Asked { quantity } => {
                self.has_asked = true;
                self.note_unscripted(timeline, Extra::Read(quantity));
            }
            Notice::Unscripted { why, command } => {
                self.has_prepared = true;
                self.note_unscripted(timeline, Extra::Servo(why, command));
            }
            Notice::Sent { late, .. } => {
                self.sent += 1;
                if let Some(lateness) = &mut self.lateness {
                    lateness.saturating_record(late.0);
                }
            }
            Notice::Dropped { event } if self.dropped.len() < NAMED => {
                self.dropped.push((Arc::clone(timeline), event));
            }
            Notice::Judged(verdict) if self.verdicts.len() < NAMED => {
                self.verdicts.push((Arc::clone(timeline), verdict));
            }
            Notice::Sleeping { .. } | Notice::Paused { .. } => {
                self.pauses += u64::from(!self.is_paused);
                self.is_paused = true;
            }
            Notice::Resumed { .. } => self.is_paused = false,
            Notice::Pass { pass } => (self.passes, self.is_paused) = (pass, false),
            _ => {}
        }
    }
}

impl RunLog {
    /// The gates, for the report.
    fn gates(&self, lines: &Lines<'_>) -> impl Iterator<Item = report::Gate> {
        self.passages.iter().filter_map(|(timeline, passage)| {
            let Gate { at, gate, span, .. } = timeline.gates.get(passage.gate)?;
            let place = lines.place(*span);
            Some(report::Gate {
                at: *at,
                gate: gate.to_string(),
                took: passage.took.micros(),
                end: passage.end.word(),
                found: passage.end.words(gate.unit()),
                opened: passage.end.is_open(),
                file: place.file.to_owned(),
                line: place.line,
            })
        })
    }

    /// The frames that depend on the world, for the report.
    fn unscripted(&self, lines: &Lines<'_>) -> impl Iterator<Item = report::Unscripted> {
        self.unscripted.iter().filter_map(|(timeline, extra, after, count)| {
            let board = &timeline.board;
            let (reason, command, place) = match *extra {
                Extra::Refresh(event) => {
                    let event = timeline.events.get(event)?;
                    ("gate", event.command.clone(), Some(lines.place(event.span)))
                }
                Extra::Read(quantity) => ("read", board.quantities.get(quantity)?.request.clone()?, None),
                Extra::Servo(Why::Soft, command) => ("soft", command.command(), None),
                Extra::Servo(Why::Torque, command) => ("torque", command.command(), None),
                Extra::Servo(_, command) => ("start", command.command(), None),
            };
            Some(report::Unscripted {
                reason,
                after: *after,
                count: *count,
                frame: Hex(&board.to_frame(&command)).to_string(),
                command: board.show(&command).to_string(),
                file: place.as_ref().map(|place| place.file.to_owned()),
                line: place.map(|place| place.line),
            })
        })
    }

    /// Counts a frame that is not of the script, together with equal ones at the same place.
    fn note_unscripted(&mut self, timeline: &Arc<Timeline>, extra: Extra) {
        let (extras, sent) = (&mut self.unscripted, self.sent);
        let here = extras.iter_mut().rev().take_while(|(_, _, after, _)| *after == sent);
        match here.into_iter().find(|(_, other, ..)| *other == extra) {
            Some((.., count)) => *count += 1,
            None => extras.push((Arc::clone(timeline), extra, sent, 1)),
        }
    }
}

/// A run that has ended.
pub(super) struct Run<'r> {
    pub(super) sources: &'r Sources,
    pub(super) timeline: &'r Timeline,
    /// The names of all robots, if the script names them.
    pub(super) names: &'r [Arc<str>],
    pub(super) asked: Asked,
    /// How long the first pass takes.
    pub(super) first_pass: Micros,
    /// The port; `None` for the virtual board.
    pub(super) port: Option<String>,
    pub(super) started: SystemTime,
    pub(super) elapsed: Micros,
    pub(super) outcome: Outcome,
}

impl Run<'_> {
    pub(super) fn exit(&self) -> Exit {
        match self.outcome.cause {
            // A quit that could not stop the robot is an error.
            Cause::Quit if matches!(self.outcome.stop, Stop::NotSent | Stop::NotHeld) => Exit::Port,
            Cause::Finished | Cause::Quit => Exit::Ok,
            Cause::Signal(signal) => Exit::Signal(signal),
            Cause::Lost(_) | Cause::Unanswered | Cause::Servo(_) | Cause::Other { .. } => Exit::Port,
            Cause::Stalled => Exit::Stalled,
            Cause::Late(_) => Exit::Late,
            Cause::Expect(_) | Cause::Gate(_) => Exit::Expect,
            _ => Exit::Failed,
        }
    }

    /// Why the run ended.
    fn cause(&self) -> String {
        match self.outcome.cause {
            Cause::Finished => match self.outcome.dropped {
                0 => "everything was sent".to_owned(),
                dropped => {
                    format!("everything was sent except {} replaced by newer ones", plural(dropped, "frame"))
                }
            },
            Cause::Quit => "stopped by q".into(),
            Cause::Signal(signal) => signal_name(signal),
            Cause::Lost(None) => "the port hung up".into(),
            Cause::Lost(Some(error)) => format!("the port was lost ({})", io::Error::from_raw_os_error(error)),
            Cause::Stalled => "the port stopped accepting bytes".into(),
            Cause::Late(late) => format!("a frame was {:.0} ms late", late.in_millis()),
            Cause::Expect(verdict) => self.timeline.verdict_words(verdict.expect, &verdict.found.to_string()),
            Cause::Gate(passage) => self.timeline.gate_words(passage.gate, |unit| passage.end.words(unit)),
            Cause::Unanswered => "the board does not answer, and the script needs its answers".into(),
            Cause::Servo(fault) => fault.words(&self.timeline.board),
            Cause::Unguarded => "the guard of this run was lost".into(),
            Cause::Other { robot } => {
                format!("stopped together with {}", self.names.get(robot).map_or("another robot", |name| name))
            }
            _ => "motionseq failed; this is a bug".into(),
        }
    }

    pub(super) fn is_early(&self) -> bool {
        self.outcome.cause != Cause::Finished
    }

    /// The closing line: the robot, the cause and, of an early end, the place, the time and whether the robot was stopped.
    pub(super) fn closing_line(&self) -> String {
        format!("{}{}", self.timeline.prefix(), self.ending())
    }

    fn ending(&self) -> String {
        let Outcome { at, stop, missing, aborted, .. } = self.outcome;
        match self.place() {
            _ if !self.is_early() => self.cause(),
            place => {
                let place = place.map(|span| self.sources.place(span).to_string());
                let without_stop = &self.timeline.board.without_stop;
                let robot = match stop {
                    Stop::NotNeeded => "nothing has moved".to_owned(),
                    Stop::NotDefined if aborted => format!("`on abort` was sent, otherwise {without_stop}"),
                    Stop::Held if aborted => format!("`on abort` was sent; {without_stop}"),
                    Stop::NotHeld if aborted => {
                        format!("`on abort` was sent; {}", stop_words(stop, missing, without_stop))
                    }
                    stop => stop_words(stop, missing, without_stop),
                };
                closing_line(&self.cause(), place, at, &robot)
            }
        }
    }

    /// Where in the script the run ended early: at the failed `expect` or gate, or at the last frame.
    fn place(&self) -> Option<Span> {
        let failed = match self.outcome.cause {
            Cause::Expect(verdict) => self.timeline.expects.get(verdict.expect).map(|expect| expect.span),
            Cause::Gate(passage) => self.timeline.gates.get(passage.gate).map(|gate| gate.span),
            _ => None,
        };
        failed.or(self.outcome.place).filter(|_| self.is_early())
    }

    /// The longest time that a frame waits for the serial line.
    pub(super) fn line_late(&self) -> Micros {
        load(self.timeline).worst.map_or(Micros::ZERO, |(_, late)| late)
    }

    /// The pass in which the run ended, if all passes are in one timeline.
    fn pass(&self) -> u64 {
        let Some(count @ 2..) = self.asked.passes else { return 1 };
        let at = self.outcome.at;
        let each = (self.timeline.end - self.first_pass).0 / (count - 1);
        let more = match each {
            0 => count - 1,
            each => (at - self.first_pass).0.div_ceil(each),
        };
        if at < self.first_pass { 1 } else { (1 + more).min(count) }
    }

    /// The report.
    #[expect(clippy::too_many_lines, reason = "a table of fields")]
    pub(super) fn report(&self, log: &RunLog, diagnostics: &Diagnostics) -> report::Run {
        let Run { sources, outcome, .. } = self;
        let lines = Lines::of(sources);
        let place = self.place().map(|span| lines.place(span));
        let at = |quantile: f64| {
            let nanos = log.lateness.as_ref().map_or(0, |lateness| lateness.value_at_quantile(quantile));
            // The histogram rounds up to its three digits.
            tenths(Nanos(nanos).min(outcome.worst_late))
        };
        let dropped = log.dropped.iter().filter_map(|(timeline, event)| {
            let event = timeline.events.get(*event)?;
            let place = lines.place(event.span);
            let (at, command) = (event.at, timeline.board.show(&event.command).to_string());
            Some(Dropped { at, command, file: place.file.to_owned(), line: place.line })
        });
        let expects = log.verdicts.iter().filter_map(|(timeline, verdict)| {
            let due = timeline.expects.get(verdict.expect)?;
            let place = lines.place(due.span);
            Some(Expected {
                at: due.at,
                expect: due.expect.to_string(),
                why: due.expect.why.clone(),
                found: verdict.found.to_string(),
                passed: verdict.found.is_passed(),
                file: place.file.to_owned(),
                line: place.line,
            })
        });
        report::Run {
            robot: self.timeline.robot.as_ref().map(ToString::to_string),
            script: sources.main().name().to_owned(),
            reason: match outcome.cause {
                Cause::Finished => "finished",
                Cause::Quit => "quit",
                Cause::Signal(_) => "signal",
                Cause::Lost(_) | Cause::Unanswered | Cause::Servo(_) => "port",
                Cause::Stalled => "stalled",
                Cause::Late(_) => "late",
                Cause::Expect(_) => "expect",
                Cause::Gate(_) => "gate",
                Cause::Unguarded => "guard",
                Cause::Other { .. } => "other",
                _ => "failed",
            },
            cause: self.cause(),
            exit: self.exit().code(),
            started: humantime::format_rfc3339_seconds(self.started).to_string(),
            port: self.port.clone(),
            asked: self.asked.clone(),
            end: outcome.at,
            elapsed: self.elapsed,
            pauses: log.pauses,
            file: place.as_ref().map(|place| place.file.to_owned()),
            line: place.as_ref().map(|place| place.line),
            stop: match outcome.stop {
                Stop::NotNeeded => "not needed",
                Stop::Sent => "sent",
                Stop::NotDefined => "not defined",
                Stop::Held => "held",
                Stop::NotHeld => "not held",
                _ => "not sent",
            },
            passes: log.passes.max(self.pass()),
            frames: Frames {
                sent: outcome.sent,
                dropped: outcome.dropped,
                extra: outcome.extra,
                not_noted: log.not_noted,
            },
            bytes: log.bytes,
            lateness_us: Lateness {
                p50: at(0.5),
                p99: at(0.99),
                max: tenths(outcome.worst_late),
                line: tenths(self.line_late().nanos()),
            },
            dropped: dropped.collect(),
            expects: expects.collect(),
            gates: log.gates(&lines).collect(),
            unscripted: log.unscripted(&lines).collect(),
            warnings: report::findings(sources, diagnostics),
            robots: Vec::new(),
        }
    }
}

/// In microseconds, to the tenth.
fn tenths(Nanos(nanos): Nanos) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a minute of nanoseconds fits")]
    let tenths = (nanos.saturating_add(50) / 100) as f64;
    tenths / 10.0
}
