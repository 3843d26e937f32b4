//! The log of a run.

use motionseq::playback::Notice;
use motionseq::source::{Lines, Span};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

use super::{Entry, Level, Log, Spot};

/// Logs a run, with the commands and places of its timeline.
pub(in super::super) struct TimelineLog {
    pub(in super::super) log: Log,
    /// Time 0 of the pass, on the clock of
    /// [`now`](motionseq::playback::now), moved by the pauses.
    begin: Nanos,
    /// How many marks the pass has reached.
    marked: usize,
}

impl TimelineLog {
    pub(in super::super) fn new(log: Log) -> Self {
        TimelineLog { log, begin: Nanos::ZERO, marked: 0 }
    }

    /// Logs a notice. A mark is reached when something happens at its time or later: before that, the run may still end.
    pub(in super::super) fn tell(&mut self, timeline: &Timeline, lines: &Lines<'_>, at: Nanos, notice: Notice) {
        let spot = |span: Span| -> Option<Spot> {
            let place = lines.place(span);
            Some((place.file.to_owned(), place.line))
        };
        match notice {
            Notice::Say { cue } => {
                if let Some(cue) = timeline.cues.get(cue) {
                    self.pass_marks(timeline, cue.at);
                    self.line(at, Level::Info, cue.text.clone(), spot(cue.span));
                }
            }
            Notice::Wrote(piece) => self.log.put(at, Entry::Bytes(piece.bytes().into())),
            Notice::Report(report) => self.log.put(at, Entry::Report(report)),
            Notice::Judged(verdict) => {
                if let Some(due) = timeline.expects.get(verdict.expect) {
                    let level = if verdict.found.is_passed() { Level::Info } else { Level::Error };
                    self.line(at, level, format!("expect {}: {}", due.expect, verdict.found), spot(due.span));
                }
            }
            Notice::Sent { event, late } => {
                if let Some(event) = timeline.events.get(event) {
                    self.pass_marks(timeline, event.at);
                    let (command, place) = (event.command.clone(), spot(event.span));
                    self.log.put(at, Entry::Late { script: event.at, late, command, place });
                }
            }
            Notice::Dropped { event } => {
                if let Some(event) = timeline.events.get(event) {
                    self.line(
                        at,
                        Level::Warning,
                        format!("dropped: {}", timeline.board.show(&event.command)),
                        spot(event.span),
                    );
                }
            }
            Notice::Sleeping { at: script } | Notice::Paused { at: script } => {
                self.line(at, Level::Info, format!("paused at {script:.3} s"), None);
            }
            Notice::Resumed { at: script } => {
                self.begin = at - script.nanos();
                self.line(at, Level::Info, format!("continues at {script:.3} s"), None);
            }
            Notice::Pass { pass } => {
                match pass {
                    1 => self.log.begin(at),
                    // The marks at the end of the previous pass were reached.
                    _ => self.pass_marks(timeline, timeline.end),
                }
                (self.begin, self.marked) = (at, 0);
                if pass > 1 {
                    self.line(at, Level::Info, format!("pass {pass}"), None);
                }
            }
            _ => {}
        }
    }

    /// Logs the marks up to a time of the script.
    pub(in super::super) fn pass_marks(&mut self, timeline: &Timeline, until: Micros) {
        let marks = timeline.marks.get(self.marked..).unwrap_or_default();
        for mark in marks.iter().take_while(|mark| mark.at <= until) {
            let at = self.begin + mark.at.nanos();
            self.log.put(at, Entry::Mark { name: mark.name.clone(), script: mark.at });
            self.marked += 1;
        }
    }

    fn line(&mut self, at: Nanos, level: Level, text: String, place: Option<Spot>) {
        self.log.put(at, Entry::Line { level, text, place });
    }
}
