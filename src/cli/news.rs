//! The thread that writes while it plays: the progress line, `say` lines, the recording. Motion never waits for it.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use motionseq::board::{Board, Report, State};
use motionseq::link::Taken;
use motionseq::playback::{Notice, Verdict, now};
use motionseq::source::{Lines, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};
use rtrb::Consumer;

use super::log::{Entry, Log, RunLog};
use super::notes::Notes;
use super::progress::bar;
use super::recording::Recording;
use super::screen::Screen;
use super::show::ScriptTime;
use super::start_thread;

/// How often the screen and the recording are brought up to date.
const UPDATE: Duration = Duration::from_millis(40);

/// How a run is shown while it goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Progress {
    /// One line that is drawn over and over, on a terminal
    Auto,
    /// A line each second, for pipes and screen readers
    Plain,
    /// Nothing but what happens
    None,
}

/// How somebody looks on, and has a say.
#[derive(Clone, Copy, Debug)]
pub(super) struct Desk {
    /// Whether single keys count.
    pub(super) keys: bool,
    /// Whether Enter plays a step, too.
    pub(super) steps: bool,
    /// How the run is shown.
    pub(super) progress: Progress,
    /// What a time of the run is in the script.
    pub(super) script: ScriptTime,
}

/// How often a plain line is written.
const SECOND: Duration = Duration::from_secs(1);

/// What the keys are.
const KEYS: &str = "space: pause, and go on · Enter: go on, or a step with --step · s: one step of a pause, without the drive · q: stop and end · ?: this";

/// What stands behind the progress of a run that stands.
const PAUSED: &str = "paused";

/// What is left to tell at the end.
pub(super) struct Told {
    /// What became of the recording, if there is one.
    pub(super) recorded: io::Result<()>,
    /// The board's last report.
    pub(super) report: Option<Report>,
    pub(super) notes: Notes,
    /// The log, which waits for the last word, and the timeline that was played last.
    pub(super) log: Option<(RunLog, Arc<Timeline>)>,
}

/// What a run is written to while it goes on.
pub(super) struct Files {
    /// The bytes that the port took.
    pub(super) recording: Option<Recording>,
    /// All that happens, and the text that it comes from.
    pub(super) log: Option<(Log, Sources)>,
}

/// The ends of rings at which a run is heard: what it tells, each with its time on the clock of [`now`], and what its port took.
pub(super) type Heard = (Consumer<(Nanos, Notice)>, Consumer<Taken>);

/// What the thread works with.
pub(super) struct News {
    timeline: Arc<Timeline>,
    /// What comes again and again behind it.
    again: Arc<Timeline>,
    desk: Desk,
    /// Whether the keys of a pause were told.
    told: bool,
    screen: Screen,
    recording: Option<Recording>,
    log: Option<RunLog>,
    report: Option<Report>,
    notes: Notes,
    /// What the board was told so far, the worst lateness, and how many frames were dropped.
    state: State,
    worst_late: Nanos,
    dropped: usize,
    clock: Clock,
    /// The pass and the time that a plain line has shown last.
    shown: (u64, Micros),
}

/// The time of the script, for the progress line.
enum Clock {
    /// Time 0 was then on the clock of [`now`], or would have been without the pauses.
    Runs(Nanos),
    /// It stands, at a time of the script.
    Stands(Micros),
}

impl News {
    /// Starts the thread. When both rings have ended and are empty, it says what is left to tell.
    pub(super) fn start(
        [timeline, again]: [Arc<Timeline>; 2],
        desk: Desk,
        screen: Screen,
        files: Files,
        heard: Heard,
    ) -> io::Result<Receiver<Told>> {
        let (told, end) = mpsc::channel();
        let Files { recording, log } = files;
        let (log, sources) = log.unzip();
        let news = News {
            timeline,
            again,
            desk,
            told: false,
            screen,
            recording,
            log: log.map(RunLog::new),
            report: None,
            notes: Notes::new(),
            state: State::default(),
            worst_late: Nanos::ZERO,
            dropped: 0,
            clock: Clock::Runs(now()),
            shown: (0, Micros::ZERO),
        };
        start_thread("news", move || {
            let lines = sources.as_ref().map(Lines::of);
            let _ = told.send(news.run(heard, lines.as_ref()));
        })?;
        Ok(end)
    }

    fn run(mut self, (mut notices, mut taken): Heard, lines: Option<&Lines<'_>>) -> Told {
        let mut recording = self.recording.take();
        let mut told_at = Instant::now();
        if self.desk.keys {
            self.screen.note("space pauses, q stops and ends, ? shows all keys");
        }
        loop {
            // Looked at before the rings are emptied, so that nothing is left in them at the end.
            let last = notices.is_abandoned() && taken.is_abandoned();
            while let Ok((at, notice)) = notices.pop() {
                if let (Some(log), Some(lines)) = (&mut self.log, lines) {
                    log.tell(&self.timeline, lines, at, notice);
                }
                self.tell(at, notice);
            }
            while let Ok(piece) = taken.pop() {
                if let Some(log) = &mut self.log {
                    log.log.put(piece.at, Entry::Bytes(piece.bytes().into()));
                }
                if let Some(recording) = &mut recording {
                    recording.put(piece.bytes());
                }
            }
            if last {
                break;
            }
            let progress = self.desk.progress;
            match progress {
                Progress::Auto => self.screen.live(&self.progress()),
                // What stands is not said again and again.
                Progress::Plain if told_at.elapsed() >= SECOND && self.is_further() => {
                    told_at = Instant::now();
                    self.screen.note(&self.progress());
                }
                Progress::Plain | Progress::None => {}
            }
            thread::park_timeout(UPDATE);
        }
        if self.desk.progress == Progress::Auto {
            self.screen.live("");
        }
        let log = self.log.map(|log| (log, self.timeline));
        let recorded = recording.map_or(Ok(()), Recording::end);
        Told { recorded, report: self.report, notes: self.notes, log }
    }

    #[expect(clippy::too_many_lines, reason = "one kind of notice after the other")]
    fn tell(&mut self, at: Nanos, notice: Notice) {
        match notice {
            Notice::Say { cue } => {
                if let Some(cue) = self.timeline.cues.get(cue) {
                    self.screen.note(&format!("{:.3} s: {}", cue.at, cue.text));
                }
            }
            Notice::Report(newest) => self.report = Some(newest),
            Notice::Judged(verdict) => {
                self.notes.judged(&self.timeline, verdict);
                self.judged(verdict);
            }
            Notice::Sent { event, late } => {
                if let Some(event) = self.timeline.events.get(event) {
                    self.notes.sent(late);
                    self.state.apply(&self.timeline.board, &event.command);
                    self.worst_late = self.worst_late.max(late);
                }
                // At a pause it is a step, which somebody follows with the eyes.
                if self.screen.is_verbose() || matches!(self.clock, Clock::Stands(_)) {
                    self.frame("", event);
                }
            }
            Notice::Passed { event } => {
                if let Some(event) = self.timeline.events.get(event) {
                    self.state.apply(&self.timeline.board, &event.command);
                }
                self.frame("not sent, as the drive stands: ", event);
            }
            Notice::Dropped { event } => {
                self.notes.dropped(&self.timeline, event);
                self.dropped += 1;
                self.frame("dropped: ", event);
            }
            Notice::Sleeping { at } => {
                self.stand(at);
                self.screen.ask(&format!("{at:.3} s: the robot stands; `fg` comes back to it"));
            }
            Notice::Help => self.screen.ask(KEYS),
            Notice::Paused { at } => {
                self.stand(at);
                let how = match (self.desk.keys, self.desk.steps) {
                    _ if std::mem::replace(&mut self.told, true) => "",
                    (false, _) => "; Enter goes on (the robot may move at once), Ctrl-C ends",
                    (true, false) => "; space or Enter goes on (the robot may move at once), s plays one step, q ends",
                    (true, true) => "; space goes on (the robot may move at once), Enter or s plays one step, q ends",
                };
                self.screen.ask(&format!("{at:.3} s: paused{}{how}", self.desk.script.words(at)));
            }
            Notice::Pass { pass: 1 } => self.clock = Clock::Runs(at),
            Notice::Pass { pass } => {
                self.notes.passes = pass;
                self.timeline = Arc::clone(&self.again);
                self.clock = Clock::Runs(at);
                // The line about the run says it, too.
                if self.screen.is_verbose() {
                    self.screen.note(&format!("pass {pass}"));
                }
            }
            Notice::Resumed { at: script } => {
                self.clock = Clock::Runs(at - script.nanos());
                self.screen.note(&format!("{script:.3} s: goes on"));
            }
            _ => {}
        }
    }

    /// Whether the run is further than when a plain line was written last: behind a sleep, the clock runs ahead of it for a moment.
    fn is_further(&mut self) -> bool {
        let now = (self.notes.passes, self.time());
        let is_further = matches!(self.clock, Clock::Runs(_)) && now > self.shown;
        if is_further {
            self.shown = now;
        }
        is_further
    }

    fn stand(&mut self, at: Micros) {
        self.notes.pauses += u64::from(matches!(self.clock, Clock::Runs(_)));
        self.clock = Clock::Stands(at);
    }

    /// An `expect` that holds; one that does not is told at the end.
    fn judged(&self, verdict: Verdict) {
        if let (Some(due), true) = (self.timeline.expects.get(verdict.expect), verdict.found.is_passed()) {
            self.screen.note(&format!("{:.3} s: expect {}: {}", due.at, due.expect, verdict.found));
        }
    }

    /// A line about one frame.
    fn frame(&self, what: &str, event: usize) {
        if let Some(event) = self.timeline.events.get(event) {
            let kind = event.kind.word().map(|word| format!(" ({word})")).unwrap_or_default();
            self.screen.note(&format!("{:.3} s: {what}{}{kind}", event.at, self.timeline.board.show(&event.command)));
        }
    }

    /// `1.2 / 3.0 s ████░░░░░░  rocker x=10 y=0 z=0  next bow at 2.0 s  servo 1 1500`, as much of it as there is room for.
    fn progress(&self) -> String {
        let (end, now) = (self.timeline.end, self.time());
        let mut line = format!("{now:.3} / {end:.3} s");
        // The bar gives way to the words on a narrow terminal.
        let room = if self.screen.is_live() { self.screen.live_width() } else { self.screen.width() };
        // A pipe and a screen reader can do without.
        let room_for_bar = room.saturating_sub(line.len() + 50);
        let bar = bar(now.0, end.0, if self.desk.progress == Progress::Plain { 0 } else { room_for_bar });
        for part in std::iter::once(bar).chain(self.parts(now)).filter(|part| !part.is_empty()) {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str(if line.ends_with('s') && part.starts_with(['█', '░']) { " " } else { "  " });
            line.push_str(&part);
        }
        line
    }

    /// The time of the script.
    fn time(&self) -> Micros {
        match self.clock {
            Clock::Runs(begin) => (now() - begin).micros().min(self.timeline.end),
            Clock::Stands(at) => at,
        }
    }

    /// What is said of a run besides its time, the most important first.
    fn parts(&self, now: Micros) -> Vec<String> {
        let mut parts = Vec::new();
        if matches!(self.clock, Clock::Stands(_)) {
            parts.push(PAUSED.to_owned());
        }
        if self.dropped > 0 {
            parts.push(format!("{} dropped", self.dropped));
        }
        if self.notes.passes > 1 {
            parts.push(format!("pass {}", self.notes.passes));
        }
        let mut next = None;
        if let Some(mark) = self.timeline.marks.iter().find(|mark| mark.at > now) {
            next = Some(format!("next {} at {:.3} s", mark.name, mark.at));
        }
        let board = &self.timeline.board;
        let stands = matches!(self.clock, Clock::Stands(_));
        parts.push(if stands { STANDS.to_owned() } else { drive_words(board, &self.state) });
        parts.extend(next);
        if self.worst_late >= Nanos::from_millis(1) {
            parts.push(format!("worst {} late", self.worst_late.short()));
        }
        parts.extend(active_words(board, &self.state));
        parts
    }
}

/// How a drive is called that does not drive.
const STANDS: &str = "stands";

/// What drives, in words.
pub(super) fn drive_words(board: &Board, state: &State) -> String {
    let driving = state.active(board).filter(|(resource, _)| board.is_fed(*resource));
    let driving: Vec<String> = driving.map(|(_, command)| board.show(command).to_string()).collect();
    if driving.is_empty() { STANDS.to_owned() } else { driving.join(", ") }
}

/// What else is active, and the values of the rest.
pub(super) fn active_words<'b>(board: &'b Board, state: &'b State) -> impl Iterator<Item = String> + 'b {
    let active = state.active(board).filter(|(resource, _)| !board.is_fed(*resource)).map(|(_, command)| command);
    let still =
        board.resources.iter().enumerate().filter(|(_, resource)| resource.rest.is_none() && resource.is_exclusive);
    let still = still.filter_map(|(resource, _)| state.told(resource));
    active.chain(still).map(|command| board.show(command).to_string())
}
