//! What a run tells, in a log.

use motionseq::playback::Notice;
use motionseq::source::{Lines, Span};
use motionseq::timeline::Timeline;

use super::super::screen::seconds;
use super::{Entry, Level, Log, Spot};

/// The log of a run that is played.
pub(in super::super) struct RunLog {
    pub(in super::super) log: Log,
    /// When time 0 of the pass was, or would have been without the pauses, in nanoseconds on the clock of
    /// [`now`](motionseq::playback::now).
    begin: u64,
    /// How many marks the pass has gone by.
    marked: usize,
}

impl RunLog {
    pub(in super::super) fn new(log: Log) -> Self {
        RunLog { log, begin: 0, marked: 0 }
    }

    /// Logs what a run tells at a time. A mark is passed when something happens at its time or later: nobody knows before
    /// that the run gets there.
    pub(in super::super) fn tell(&mut self, timeline: &Timeline, lines: &Lines<'_>, at: u64, notice: Notice) {
        let spot = |span: Span| -> Option<Spot> {
            let place = lines.place(span);
            Some((place.file.to_owned(), place.line))
        };
        match notice {
            Notice::Say { cue } => {
                if let Some(cue) = timeline.cues.get(cue) {
                    self.pass_marks(timeline, cue.at_us);
                    self.line(at, Level::Info, cue.text.clone(), spot(cue.span));
                }
            }
            Notice::Report(report) => self.log.put(at, Entry::Report(report)),
            Notice::Judged(verdict) => {
                if let Some(due) = timeline.expects.get(verdict.expect) {
                    let level = if verdict.found.is_passed() { Level::Info } else { Level::Error };
                    self.line(at, level, format!("expect {}: {}", due.expect, verdict.found), spot(due.span));
                }
            }
            Notice::Sent { event, late } => {
                if let Some(event) = timeline.events().get(event) {
                    self.pass_marks(timeline, event.at_us);
                    let (command, place) = (event.command.clone(), spot(event.span));
                    self.log.put(at, Entry::Late { event_us: event.at_us, late, command, place });
                }
            }
            Notice::Dropped { event } => {
                if let Some(event) = timeline.events().get(event) {
                    self.line(
                        at,
                        Level::Warning,
                        format!("dropped: {}", timeline.board.show(&event.command)),
                        spot(event.span),
                    );
                }
            }
            Notice::Sleeping { at_us } | Notice::Paused { at_us } => {
                self.line(at, Level::Info, format!("paused at {} s", seconds(at_us)), None);
            }
            Notice::Resumed { at_us } => {
                self.begin = at.saturating_sub(at_us.saturating_mul(1_000));
                self.line(at, Level::Info, format!("goes on at {} s", seconds(at_us)), None);
            }
            Notice::Pass { pass } => {
                match pass {
                    1 => self.log.begin(at),
                    // What stands at the end of the one before was passed.
                    _ => self.pass_marks(timeline, timeline.end_us),
                }
                (self.begin, self.marked) = (at, 0);
                if pass > 1 {
                    self.line(at, Level::Info, format!("pass {pass}"), None);
                }
            }
            Notice::Passed { .. } | Notice::Help => {}
        }
    }

    /// Logs the marks that the run has reached, up to a time of the script.
    pub(in super::super) fn pass_marks(&mut self, timeline: &Timeline, until_us: u64) {
        let marks = timeline.marks.get(self.marked..).unwrap_or_default();
        for mark in marks.iter().take_while(|mark| mark.at_us <= until_us) {
            let at = self.begin.saturating_add(mark.at_us.saturating_mul(1_000));
            self.log.put(at, Entry::Mark { name: mark.name.clone(), at_us: mark.at_us });
            self.marked += 1;
        }
    }

    fn line(&mut self, at: u64, level: Level, text: String, place: Option<Spot>) {
        self.log.put(at, Entry::Line { level, text, place });
    }
}
