//! The log of a run.

use std::collections::HashSet;
use std::sync::mpsc::Receiver;

use motionseq::playback::{Notice, Passage, Verdict};
use motionseq::sim::Pose;
use motionseq::source::{Lines, Span};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

use super::super::run_summary::{is_for_all, passage_words, servo_words};
use super::{Entry, Level, Log, Spot};

/// Logs what one robot does, with the commands and places of its timeline.
pub(in super::super) struct TimelineLog {
    /// Its number in the order of the script.
    robot: usize,
    /// Time 0 of the pass, on the clock of
    /// [`now`](motionseq::playback::now), moved by the pauses.
    begin: Nanos,
    /// Whether the script is paused. A step then reaches its marks at another time.
    is_paused: bool,
    /// What was said of servos.
    said: HashSet<String>,
    /// The poses of the robot of a virtual board, with their times since time 0.
    poses: Option<Receiver<(Micros, Pose)>>,
}

impl TimelineLog {
    pub(in super::super) fn new(robot: usize, poses: Option<Receiver<(Micros, Pose)>>) -> Self {
        TimelineLog { robot, begin: Nanos::ZERO, is_paused: false, said: HashSet::new(), poses }
    }

    /// Logs the poses that have come.
    pub(in super::super) fn take_poses(&mut self, log: &mut Log) {
        log.robot = self.robot;
        for (time, pose) in self.poses.iter().flat_map(Receiver::try_iter) {
            log.put_since_begin(time, Entry::Pose(pose));
        }
    }

    /// Logs a notice.
    #[expect(clippy::too_many_arguments, reason = "a notice and what it refers to")]
    pub(in super::super) fn tell(
        &mut self,
        log: &mut Log,
        timeline: &Timeline,
        lines: &Lines<'_>,
        at: Nanos,
        notice: Notice,
    ) {
        log.robot = self.robot;
        self.keep_time(timeline, at, notice);
        if self.robot > 0 && is_for_all(timeline, notice) {
            return;
        }
        let spot = |span: Span| Some(spot(lines, span));
        match notice {
            Notice::Say { cue, report } => {
                if let Some(cue) = timeline.cues.get(cue) {
                    line(log, at, Level::Info, cue.text.with(report.as_ref()), spot(cue.span));
                }
            }
            Notice::Waiting { gate } => {
                if let Some(gate) = timeline.gates.get(gate) {
                    line(log, at, Level::Info, gate.gate.to_string(), spot(gate.span));
                }
            }
            Notice::Passed(passage) => passed(log, timeline, lines, (at, passage)),
            Notice::Marked { mark } => {
                if let Some(mark) = timeline.marks.get(mark) {
                    let at = if self.is_paused { at } else { self.begin + mark.at.nanos() };
                    log.put(at, Entry::Mark { name: mark.name.clone(), script: mark.at });
                }
            }
            Notice::Wrote(piece) => log.put(at, Entry::Bytes(piece.bytes().into())),
            Notice::Report(report) => log.put(at, Entry::Report(report)),
            Notice::Judged(verdict) => judged(log, timeline, lines, (at, verdict)),
            Notice::Sent { event, late } => {
                if let Some(event) = timeline.events.get(event) {
                    let (command, place) = (event.command.clone(), spot(event.span));
                    log.put(at, Entry::Late { script: event.at, late, command, place });
                }
            }
            Notice::Dropped { event } => {
                if let Some(event) = timeline.events.get(event) {
                    let words = format!("dropped: {}", timeline.board.show(&event.command));
                    line(log, at, Level::Warning, words, spot(event.span));
                }
            }
            Notice::Sleeping { at: script } | Notice::Paused { at: script } => {
                line(log, at, Level::Info, format!("paused at {script:.3} s"), None);
            }
            Notice::Resumed { at: script } => {
                line(log, at, Level::Info, format!("continues at {script:.3} s"), None);
            }
            Notice::Pass { pass } => {
                if pass > 1 {
                    line(log, at, Level::Info, format!("pass {pass}"), None);
                } else {
                    log.begin(at);
                }
            }
            _ => self.servo(log, timeline, at, notice),
        }
    }

    /// Keeps the clock of the script.
    fn keep_time(&mut self, timeline: &Timeline, at: Nanos, notice: Notice) {
        match notice {
            Notice::Pass { .. } => (self.begin, self.is_paused) = (at, false),
            Notice::Began => self.begin = at,
            Notice::Sleeping { .. } | Notice::Paused { .. } => self.is_paused = true,
            Notice::Resumed { at: script } => (self.begin, self.is_paused) = (at - script.nanos(), false),
            Notice::Passed(passage) => {
                let gate = timeline.gates.get(passage.gate).map_or(Nanos::ZERO, |gate| gate.at.nanos());
                self.begin = at - gate;
            }
            _ => {}
        }
    }

    /// Logs what happens to servos, each once.
    fn servo(&mut self, log: &mut Log, timeline: &Timeline, at: Nanos, notice: Notice) {
        let level = if matches!(notice, Notice::Flags { .. }) { Level::Warning } else { Level::Info };
        if let Some(words) = servo_words(&timeline.board, notice).filter(|words| self.said.insert(words.clone())) {
            line(log, at, level, words, None);
        }
    }
}

/// The place of a span.
fn spot(lines: &Lines<'_>, span: Span) -> Spot {
    let place = lines.place(span);
    (place.file.to_owned(), place.line)
}

fn passed(log: &mut Log, timeline: &Timeline, lines: &Lines<'_>, (at, passage): (Nanos, Passage)) {
    let Some(gate) = timeline.gates.get(passage.gate) else { return };
    let place = lines.place(gate.span);
    let level = if passage.end.is_open() { Level::Info } else { Level::Error };
    line(log, at, level, passage_words(gate, passage), Some((place.file.to_owned(), place.line)));
    let (script, took) = (gate.at, passage.took.micros());
    log.put(at, Entry::Gate { script, gate: gate.gate.to_string(), took, end: passage.end });
}

fn judged(log: &mut Log, timeline: &Timeline, lines: &Lines<'_>, (at, verdict): (Nanos, Verdict)) {
    let Some(due) = timeline.expects.get(verdict.expect) else { return };
    let place = lines.place(due.span);
    let level = if verdict.found.is_passed() { Level::Info } else { Level::Error };
    let words = format!("expect {}: {}", due.expect, verdict.found);
    line(log, at, level, words, Some((place.file.to_owned(), place.line)));
}

fn line(log: &mut Log, at: Nanos, level: Level, text: String, place: Option<Spot>) {
    log.put(at, Entry::Line { level, text, place });
}
