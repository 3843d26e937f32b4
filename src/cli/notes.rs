//! What is noted while a run is played, and the report that is made of it.

use std::sync::Arc;
use std::time::SystemTime;

use hdrhistogram::Histogram;
use motionseq::diagnostic::Diagnostics;
use motionseq::playback::{Cause, Outcome, Stop, Verdict};
use motionseq::report::{self, Asked, Dropped, Expected, Frames, Lateness, Run};
use motionseq::source::{Lines, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

/// The most frames that are named as dropped, and the most `expect`s.
const NAMED: usize = 1_000;

/// What was noted. Frames and expectations are those of the timeline that was played then.
pub(super) struct Notes {
    /// How late frames were, in nanoseconds; `None` only where there is no room for it.
    lateness: Option<Histogram<u64>>,
    dropped: Vec<(Arc<Timeline>, usize)>,
    verdicts: Vec<(Arc<Timeline>, Verdict)>,
    pub(super) passes: u64,
    pub(super) pauses: u64,
}

/// What else a report tells of.
pub(super) struct Facts<'a> {
    pub(super) sources: &'a Sources,
    pub(super) diagnostics: &'a Diagnostics,
    pub(super) outcome: &'a Outcome,
    /// The cause in words.
    pub(super) cause: String,
    pub(super) exit: u8,
    /// Notices that did not fit the ring.
    pub(super) not_noted: u64,
    /// Where in the script it ended early.
    pub(super) place: Option<motionseq::source::Span>,
    /// How much later than it is due a frame leaves at the worst, on a line of this speed.
    pub(super) line_late: Micros,
    /// How long all passes take.
    pub(super) end: Micros,
    pub(super) run: &'a Asking,
}

/// What is known of a run without its news.
pub(super) struct Asking {
    pub(super) asked: Asked,
    /// How long the first pass takes.
    pub(super) first_pass: Micros,
    pub(super) port: Option<String>,
    pub(super) started: SystemTime,
    pub(super) elapsed: Micros,
    pub(super) bytes: u64,
}

impl Asking {
    /// In which pass a run was at a time; all passes take so long.
    fn passes_until(&self, at: Micros, end: Micros) -> u64 {
        let Some(count @ 2..) = self.asked.passes else { return 1 };
        let each = (end - self.first_pass).0 / (count - 1);
        let more = match each {
            0 => count - 1,
            each => (at - self.first_pass).0.div_ceil(each),
        };
        if at < self.first_pass { 1 } else { (1 + more).min(count) }
    }
}

impl Notes {
    pub(super) fn new() -> Self {
        // From a nanosecond to a minute, to three digits; what is later counts as a minute.
        let lateness = Histogram::new_with_bounds(1, 60_000_000_000, 3).ok();
        Notes { lateness, dropped: Vec::new(), verdicts: Vec::new(), passes: 1, pauses: 0 }
    }

    pub(super) fn sent(&mut self, late: Nanos) {
        if let Some(lateness) = &mut self.lateness {
            lateness.saturating_record(late.0);
        }
    }

    pub(super) fn dropped(&mut self, timeline: &Arc<Timeline>, event: usize) {
        if self.dropped.len() < NAMED {
            self.dropped.push((Arc::clone(timeline), event));
        }
    }

    pub(super) fn judged(&mut self, timeline: &Arc<Timeline>, verdict: Verdict) {
        if self.verdicts.len() < NAMED {
            self.verdicts.push((Arc::clone(timeline), verdict));
        }
    }

    /// The report, as text.
    #[expect(clippy::too_many_lines, reason = "a table of fields")]
    pub(super) fn report(&self, facts: Facts<'_>) -> String {
        let Facts { sources, diagnostics, outcome, cause, exit, not_noted, place, line_late, end, run } = facts;
        let lines = Lines::of(sources);
        let place = place.map(|span| lines.place(span));
        let at = |quantile: f64| {
            let nanos = self.lateness.as_ref().map_or(0, |lateness| lateness.value_at_quantile(quantile));
            // The histogram rounds up to its three digits.
            tenths(Nanos(nanos).min(outcome.worst_late))
        };
        let dropped = self.dropped.iter().filter_map(|(timeline, event)| {
            let event = timeline.events.get(*event)?;
            let place = lines.place(event.span);
            let (at, command) = (event.at, timeline.board.show(&event.command).to_string());
            Some(Dropped { at, command, file: place.file.to_owned(), line: place.line })
        });
        let expects = self.verdicts.iter().filter_map(|(timeline, verdict)| {
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
        report::json::run(&Run {
            script: sources.main().name().to_owned(),
            reason: match outcome.cause {
                Cause::Finished => "finished",
                Cause::Quit => "quit",
                Cause::Signal(_) => "signal",
                Cause::Lost(_) => "port",
                Cause::Stalled => "stalled",
                Cause::Late(_) => "late",
                Cause::Expect(_) => "expect",
                Cause::Unguarded => "guard",
                _ => "failed",
            },
            cause,
            exit,
            started: humantime::format_rfc3339_seconds(run.started).to_string(),
            port: run.port.clone(),
            asked: run.asked.clone(),
            end: outcome.at,
            elapsed: run.elapsed,
            pauses: self.pauses,
            file: place.as_ref().map(|place| place.file.to_owned()),
            line: place.as_ref().map(|place| place.line),
            stop: match outcome.stop {
                Stop::NotNeeded => "not needed",
                Stop::Sent => "sent",
                _ => "not sent",
            },
            passes: self.passes.max(run.passes_until(outcome.at, end)),
            frames: Frames { sent: outcome.sent, dropped: outcome.dropped, extra: outcome.extra, not_noted },
            bytes: run.bytes,
            lateness_us: Lateness {
                p50: at(0.5),
                p99: at(0.99),
                max: tenths(outcome.worst_late),
                line: tenths(line_late.nanos()),
            },
            dropped: dropped.collect(),
            expects: expects.collect(),
            warnings: report::findings(sources, diagnostics),
        })
    }
}

/// In microseconds, to the tenth.
fn tenths(Nanos(nanos): Nanos) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a minute of nanoseconds fits")]
    let tenths = (nanos.saturating_add(50) / 100) as f64;
    tenths / 10.0
}
