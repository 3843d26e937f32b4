//! The thread that writes while it plays: the progress line, `say` lines, the recording. Motion never waits for it.

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use motionseq::board::{Report, ServoIndex, State};
use motionseq::playback::{Notice, Verdict};
use motionseq::timeline::Timeline;
use rtrb::Consumer;

use super::log::Log;
use super::progress::bar;
use super::screen::{Screen, seconds};
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
}

/// How often a plain line is written.
const SECOND: Duration = Duration::from_secs(1);

/// What the keys are.
const KEYS: &str = "space: pause, and go on · Enter: go on, or a step with --step · s: one step of a pause, without the drive · q: stop and end · ?: this";

/// What stands behind the progress of a run that stands.
const PAUSED: &str = "paused";

/// What is left to tell at the end: whether the recording is whole, the board's last report, and what was noted.
pub(super) type Told = (io::Result<()>, Option<Report>, Log);

/// What the thread works with.
pub(super) struct News {
    timeline: Arc<Timeline>,
    /// What comes again and again behind it.
    again: Arc<Timeline>,
    desk: Desk,
    /// Whether the keys of a pause were told.
    told: bool,
    screen: Screen,
    recording: Option<File>,
    report: Option<Report>,
    log: Log,
    /// What the board was told so far, the worst lateness in nanoseconds, and how many frames were dropped.
    state: State,
    worst_late: u64,
    dropped: usize,
    clock: Clock,
}

/// The time of the script, for the progress line.
enum Clock {
    /// Time 0 was then, or would have been without the pauses.
    Runs(Instant),
    /// It stands, at so many microseconds.
    Stands(u64),
}

impl News {
    /// Starts the thread. When both rings have ended and are empty, it says what is left to tell.
    pub(super) fn start(
        [timeline, again]: [Arc<Timeline>; 2],
        desk: Desk,
        screen: Screen,
        recording: Option<File>,
        notices: Consumer<Notice>,
        bytes: Consumer<u8>,
    ) -> io::Result<Receiver<Told>> {
        let (told, end) = mpsc::channel();
        let news = News {
            timeline,
            again,
            desk,
            told: false,
            screen,
            recording,
            report: None,
            log: Log::new(),
            state: State::default(),
            worst_late: 0,
            dropped: 0,
            clock: Clock::Runs(Instant::now()),
        };
        start_thread("news", move || {
            let _ = told.send(news.run(notices, bytes));
        })?;
        Ok(end)
    }

    fn run(mut self, mut notices: Consumer<Notice>, mut bytes: Consumer<u8>) -> Told {
        let mut recording = self.recording.take();
        let mut written = Ok(());
        let mut told_at = Instant::now();
        loop {
            // Looked at before the rings are emptied, so that nothing is left in them at the end.
            let last = notices.is_abandoned() && bytes.is_abandoned();
            while let Ok(notice) = notices.pop() {
                self.tell(notice);
            }
            if let Ok(chunk) = bytes.read_chunk(bytes.slots()) {
                if let Some(file) = &mut recording {
                    let (first, second) = chunk.as_slices();
                    written = written.and_then(|()| file.write_all(first)).and_then(|()| file.write_all(second));
                }
                chunk.commit_all();
            }
            if last {
                break;
            }
            match self.desk.progress {
                Progress::Auto => self.screen.live(&self.progress()),
                // What stands is not said again and again.
                Progress::Plain if told_at.elapsed() >= SECOND && matches!(self.clock, Clock::Runs(_)) => {
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
        (written, self.report, self.log)
    }

    fn tell(&mut self, notice: Notice) {
        match notice {
            Notice::Say { cue } => {
                if let Some(cue) = self.timeline.cues.get(cue) {
                    self.screen.note(&format!("{} s: {}", seconds(cue.at_us), cue.text));
                }
            }
            Notice::Report(newest) => self.report = Some(newest),
            Notice::Judged(verdict) => {
                self.log.judged(&self.timeline, verdict);
                self.judged(verdict);
            }
            Notice::Sent { event, late } => {
                if let Some(event) = self.timeline.events().get(event) {
                    self.log.sent(late);
                    self.state.apply(&event.command);
                    self.worst_late = self.worst_late.max(late);
                }
                // At a pause it is a step, which somebody follows with the eyes.
                if self.screen.is_verbose() || matches!(self.clock, Clock::Stands(_)) {
                    self.frame("", event);
                }
            }
            Notice::Passed { event } => {
                if let Some(event) = self.timeline.events().get(event) {
                    self.state.apply(&event.command);
                }
                self.frame("not sent, as the drive stands: ", event);
            }
            Notice::Dropped { event } => {
                self.log.dropped(&self.timeline, event);
                self.dropped += 1;
                self.frame("dropped: ", event);
            }
            Notice::Sleeping { at_us } => {
                self.stand(at_us);
                self.screen.ask(&format!("{} s: the robot stands; `fg` comes back to it", seconds(at_us)));
            }
            Notice::Help => self.screen.ask(KEYS),
            Notice::Paused { at_us } => {
                self.stand(at_us);
                let how = match (self.desk.keys, self.desk.steps) {
                    _ if std::mem::replace(&mut self.told, true) => "",
                    (false, _) => "; Enter goes on (the robot may move at once), Ctrl-C ends",
                    (true, false) => "; space or Enter goes on (the robot may move at once), s plays one step, q ends",
                    (true, true) => "; space goes on (the robot may move at once), Enter or s plays one step, q ends",
                };
                self.screen.ask(&format!("{} s: paused{how}", seconds(at_us)));
            }
            Notice::Pass { pass: 1 } => self.clock = Clock::Runs(Instant::now()),
            Notice::Pass { pass } => {
                self.log.passes = pass;
                self.timeline = Arc::clone(&self.again);
                self.clock = Clock::Runs(Instant::now());
                self.screen.note(&format!("pass {pass}"));
            }
            Notice::Resumed { at_us } => {
                let now = Instant::now();
                self.clock = Clock::Runs(now.checked_sub(Duration::from_micros(at_us)).unwrap_or(now));
                self.screen.note(&format!("{} s: goes on", seconds(at_us)));
            }
        }
    }

    fn stand(&mut self, at_us: u64) {
        self.log.pauses += u64::from(matches!(self.clock, Clock::Runs(_)));
        self.clock = Clock::Stands(at_us);
    }

    /// An `expect` that holds; one that does not is told at the end.
    fn judged(&self, verdict: Verdict) {
        if let (Some(due), true) = (self.timeline.expects.get(verdict.expect), verdict.found.is_passed()) {
            self.screen.note(&format!("{} s: expect {}: {}", seconds(due.at_us), due.expect, verdict.found));
        }
    }

    /// A line about one frame.
    fn frame(&self, what: &str, event: usize) {
        if let Some(event) = self.timeline.events().get(event) {
            let kind = event.kind.word().map(|word| format!(" ({word})")).unwrap_or_default();
            self.screen.note(&format!("{} s: {what}{}{kind}", seconds(event.at_us), event.command));
        }
    }

    /// `1.2 / 3.0 s ████░░░░░░  rocker x=10 y=0 z=0  next bow at 2.0 s  servo 1 1500`, as much of it as there is room for.
    fn progress(&self) -> String {
        let (end, now) = (self.timeline.end_us, self.time());
        let mut line = format!("{} / {} s", seconds(now), seconds(end));
        // The bar gives way to the words on a narrow terminal.
        let room = self.screen.width().saturating_sub(1);
        // A pipe and a screen reader can do without.
        let room_for_bar = room.saturating_sub(line.len() + 50);
        let bar = bar(now, end, if self.desk.progress == Progress::Plain { 0 } else { room_for_bar });
        for part in std::iter::once(bar).chain(self.parts(now)).filter(|part| !part.is_empty()) {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str(if line.ends_with('s') && part.starts_with(['█', '░']) { " " } else { "  " });
            line.push_str(&part);
        }
        line
    }

    /// The time of the script, in microseconds.
    fn time(&self) -> u64 {
        match self.clock {
            Clock::Runs(begin) => {
                u64::try_from(begin.elapsed().as_micros()).unwrap_or(u64::MAX).min(self.timeline.end_us)
            }
            Clock::Stands(at_us) => at_us,
        }
    }

    /// What is said of a run besides its time, the most important first.
    fn parts(&self, now: u64) -> Vec<String> {
        let mut parts = Vec::new();
        if matches!(self.clock, Clock::Stands(_)) {
            parts.push(PAUSED.to_owned());
        }
        if self.dropped > 0 {
            parts.push(format!("{} dropped", self.dropped));
        }
        if self.log.passes > 1 {
            parts.push(format!("pass {}", self.log.passes));
        }
        let mut next = None;
        if let Some(mark) = self.timeline.marks.iter().find(|mark| mark.at_us > now) {
            next = Some(format!("next {} at {} s", mark.name, seconds(mark.at_us)));
        }
        parts.push(match self.state.drive() {
            Some(drive) if drive.keeps_driving() && !matches!(self.clock, Clock::Stands(_)) => drive.to_string(),
            _ => "stands".to_owned(),
        });
        parts.extend(next);
        if self.worst_late >= 1_000_000 {
            parts.push(format!("worst {}.{} ms late", self.worst_late / 1_000_000, self.worst_late / 100_000 % 10));
        }
        if self.state.buzzer() == Some(true) {
            parts.push("buzzer on".to_owned());
        }
        parts.extend(servos(&self.state));
        parts
    }
}

/// Where the servos are that were told.
pub(super) fn servos(state: &State) -> impl Iterator<Item = String> {
    (1..=4).filter_map(|index| {
        let pulse = state.servo(ServoIndex::new(index).ok()?)?;
        Some(format!("servo {index} {pulse}"))
    })
}
