//! What a run shows while it plays: the progress line, `say` lines, pauses.

use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use motionseq::board::State;
use motionseq::playback::{Notice, Verdict, now};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

use super::super::progress_bar::bar;
use super::super::screen::Screen;
use super::super::selection::ScriptTime;
use super::super::state_line::{AT_REST, active_words, drive_words};
use super::observer::Observer;

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in super::super) enum Progress {
    /// One line that is redrawn, on a terminal
    Auto,
    /// One line per second, for pipes and screen readers
    Plain,
    /// No progress line
    None,
}

/// How often a plain line is written.
const SECOND: Duration = Duration::from_secs(1);

/// The keys.
const KEYS: &str = "space: pause or continue · Enter: continue, or one step with --step · s: one step while paused, drive stopped · q: stop and exit · ?: help";

/// Shown in the progress line of a paused run.
const PAUSED: &str = "paused";

/// Shows a run.
pub(super) struct Display {
    screen: Screen,
    progress: Progress,
    /// Whether single keys work, and whether Enter plays a step.
    has_keys: bool,
    steps: bool,
    /// Converts times of the run to times of the script.
    script: ScriptTime,
    /// Whether the keys of a pause were shown.
    has_shown_keys: bool,
    /// The commands sent so far, the worst lateness, the number of dropped frames, and the pass.
    state: State,
    worst_late: Nanos,
    dropped: usize,
    pass: u64,
    clock: Clock,
    /// The pass and the time in the last plain line, and when it was written.
    shown: (u64, Micros),
    shown_at: Instant,
}

/// The time of the script, for the progress line.
enum Clock {
    /// Time 0 on the clock of [`now`], moved by the pauses.
    Runs(Nanos),
    /// Paused at a time of the script.
    Paused(Micros),
}

impl Observer for Display {
    fn observe(&mut self, timeline: &Arc<Timeline>, at: Nanos, notice: Notice) {
        match notice {
            Notice::Say { cue } => {
                if let Some(cue) = timeline.cues.get(cue) {
                    self.screen.note(&format!("{:.3} s: {}", cue.at, cue.text));
                }
            }
            Notice::Judged(verdict) => self.judged(timeline, verdict),
            Notice::Sent { event, late } => {
                if let Some(event) = timeline.events.get(event) {
                    self.state.apply(&timeline.board, &event.command);
                    self.worst_late = self.worst_late.max(late);
                }
                // While paused, this is a step, which is always shown.
                if self.screen.is_verbose() || matches!(self.clock, Clock::Paused(_)) {
                    self.frame(timeline, "", event);
                }
            }
            Notice::Passed { event } => {
                if let Some(event) = timeline.events.get(event) {
                    self.state.apply(&timeline.board, &event.command);
                }
                self.frame(timeline, "not sent while paused: ", event);
            }
            Notice::Dropped { event } => {
                self.dropped += 1;
                self.frame(timeline, "dropped: ", event);
            }
            Notice::Sleeping { at } => {
                self.clock = Clock::Paused(at);
                self.screen.ask(&format!("{at:.3} s: suspended, robot stopped; resume with `fg`"));
            }
            Notice::Help => self.screen.ask(KEYS),
            Notice::Paused { at } => {
                self.clock = Clock::Paused(at);
                let how = match (self.has_keys, self.steps) {
                    _ if std::mem::replace(&mut self.has_shown_keys, true) => "",
                    (false, _) => "; Enter continues (the robot may move at once), Ctrl-C exits",
                    (true, false) => {
                        "; space or Enter continues (the robot may move at once), s plays one step, q exits"
                    }
                    (true, true) => {
                        "; space continues (the robot may move at once), Enter or s plays one step, q exits"
                    }
                };
                self.screen.ask(&format!("{at:.3} s: paused{}{how}", self.script.words(at)));
            }
            Notice::Pass { pass: 1 } => self.clock = Clock::Runs(at),
            Notice::Pass { pass } => {
                self.pass = pass;
                self.clock = Clock::Runs(at);
                // The progress line shows it too.
                if self.screen.is_verbose() {
                    self.screen.note(&format!("pass {pass}"));
                }
            }
            Notice::Resumed { at: script } => {
                self.clock = Clock::Runs(at - script.nanos());
                self.screen.note(&format!("{script:.3} s: continued"));
            }
            _ => {}
        }
    }

    fn update(&mut self, timeline: &Timeline) {
        let progress = self.progress;
        match progress {
            Progress::Auto => self.screen.live(&self.line(timeline)),
            // An unchanged line is not repeated.
            Progress::Plain if self.shown_at.elapsed() >= SECOND && self.is_further(timeline) => {
                self.shown_at = Instant::now();
                self.screen.note(&self.line(timeline));
            }
            Progress::Plain | Progress::None => {}
        }
    }
}

impl Display {
    /// Shows a run on a screen, and the keys if they work.
    pub(super) fn new(screen: Screen, progress: Progress, script: ScriptTime, has_keys: bool, steps: bool) -> Self {
        if has_keys {
            screen.note("keys: space pauses, q stops and exits, ? shows all");
        }
        Display {
            screen,
            progress,
            has_keys,
            steps,
            script,
            has_shown_keys: false,
            state: State::default(),
            worst_late: Nanos::ZERO,
            dropped: 0,
            pass: 1,
            clock: Clock::Runs(now()),
            shown: (0, Micros::ZERO),
            shown_at: Instant::now(),
        }
    }

    /// Clears the progress line.
    pub(super) fn end(&self) {
        if self.progress == Progress::Auto {
            self.screen.live("");
        }
    }

    /// Whether the run has advanced since the last plain line: after a suspension, the clock is ahead for a moment.
    fn is_further(&mut self, timeline: &Timeline) -> bool {
        let now = (self.pass, self.time(timeline));
        let is_further = matches!(self.clock, Clock::Runs(_)) && now > self.shown;
        if is_further {
            self.shown = now;
        }
        is_further
    }

    /// Shows an `expect` that passed; one that failed is shown at the end.
    fn judged(&self, timeline: &Timeline, verdict: Verdict) {
        if let (Some(due), true) = (timeline.expects.get(verdict.expect), verdict.found.is_passed()) {
            self.screen.note(&format!("{:.3} s: expect {}: {}", due.at, due.expect, verdict.found));
        }
    }

    /// Shows one frame.
    fn frame(&self, timeline: &Timeline, what: &str, event: usize) {
        if let Some(event) = timeline.events.get(event) {
            let kind = event.kind.word().map(|word| format!(" ({word})")).unwrap_or_default();
            self.screen.note(&format!("{:.3} s: {what}{}{kind}", event.at, timeline.board.show(&event.command)));
        }
    }

    /// `1.2 / 3.0 s ████░░░░░░  rocker x=10 y=0 z=0  next bow at 2.0 s  servo 1 1500`, as much of it as fits.
    fn line(&self, timeline: &Timeline) -> String {
        let (end, now) = (timeline.end, self.time(timeline));
        let mut line = format!("{now:.3} / {end:.3} s");
        // On a narrow terminal, the words take precedence over the bar.
        let room = if self.screen.is_live() { self.screen.live_width() } else { self.screen.width() };
        // Plain lines have no bar.
        let room_for_bar = room.saturating_sub(line.len() + 50);
        let bar = bar(now.0, end.0, if self.progress == Progress::Plain { 0 } else { room_for_bar });
        for part in std::iter::once(bar).chain(self.parts(timeline, now)).filter(|part| !part.is_empty()) {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str(if line.ends_with('s') && part.starts_with(['█', '░']) { " " } else { "  " });
            line.push_str(&part);
        }
        line
    }

    /// The time of the script.
    fn time(&self, timeline: &Timeline) -> Micros {
        match self.clock {
            Clock::Runs(begin) => (now() - begin).micros().min(timeline.end),
            Clock::Paused(at) => at,
        }
    }

    /// The parts of the line after the time, the most important first.
    fn parts(&self, timeline: &Timeline, now: Micros) -> Vec<String> {
        let mut parts = Vec::new();
        if matches!(self.clock, Clock::Paused(_)) {
            parts.push(PAUSED.to_owned());
        }
        if self.dropped > 0 {
            parts.push(format!("{} dropped", self.dropped));
        }
        if self.pass > 1 {
            parts.push(format!("pass {}", self.pass));
        }
        let mut next = None;
        if let Some(mark) = timeline.marks.iter().find(|mark| mark.at > now) {
            next = Some(format!("next {} at {:.3} s", mark.name, mark.at));
        }
        let board = &timeline.board;
        let is_paused = matches!(self.clock, Clock::Paused(_));
        parts.push(if is_paused { AT_REST.to_owned() } else { drive_words(board, &self.state) });
        parts.extend(next);
        if self.worst_late >= Nanos::from_millis(1) {
            parts.push(format!("worst lateness {}", self.worst_late.short()));
        }
        parts.extend(active_words(board, &self.state));
        parts
    }
}
