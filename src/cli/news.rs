//! The thread that writes while it plays: the progress line, `say` lines, the recording. Motion never waits for it.

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use motionseq::board::Report;
use motionseq::playback::{Notice, Verdict};
use motionseq::timeline::Timeline;
use rtrb::Consumer;

use super::log::Log;
use super::screen::{Screen, seconds};
use super::start_thread;

/// How often the screen and the recording are brought up to date.
const UPDATE: Duration = Duration::from_millis(40);

/// What stands behind the progress of a run that stands.
const PAUSED: &str = " paused";

/// What is left to tell at the end: whether the recording is whole, the board's last report, and what was noted.
pub(super) type Told = (io::Result<()>, Option<Report>, Log);

/// What the thread works with.
pub(super) struct News {
    timeline: Arc<Timeline>,
    /// What comes again and again behind it.
    again: Arc<Timeline>,
    screen: Screen,
    recording: Option<File>,
    report: Option<Report>,
    log: Log,
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
        screen: Screen,
        recording: Option<File>,
        notices: Consumer<Notice>,
        bytes: Consumer<u8>,
    ) -> io::Result<Receiver<Told>> {
        let (told, end) = mpsc::channel();
        let news = News {
            timeline,
            again,
            screen,
            recording,
            report: None,
            log: Log::new(),
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
            self.screen.live(&self.progress());
            thread::park_timeout(UPDATE);
        }
        self.screen.live("");
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
                    self.log.sent(event, late);
                }
                if self.screen.is_verbose() {
                    self.frame("", event);
                }
            }
            Notice::Dropped { event } => {
                self.log.dropped(&self.timeline, event);
                self.frame("dropped: ", event);
            }
            Notice::Sleeping { at_us } => {
                self.clock = Clock::Stands(at_us);
                self.screen.ask(&format!("{} s: the robot stands; `fg` comes back to it", seconds(at_us)));
            }
            Notice::Paused { at_us } => self
                .screen
                .ask(&format!("{} s: paused; Enter goes on (the robot may move at once), Ctrl-C ends", seconds(at_us))),
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

    /// `1.2 / 3.0 s ████░░░░░░`.
    fn progress(&self) -> String {
        // The bar gives way to the numbers on a narrow terminal.
        let width = u64::try_from(self.screen.width().saturating_sub(30 + PAUSED.len()).min(30)).unwrap_or(0);
        let end = self.timeline.end_us;
        let now = match self.clock {
            Clock::Runs(begin) => u64::try_from(begin.elapsed().as_micros()).unwrap_or(u64::MAX).min(end),
            Clock::Stands(at_us) => at_us,
        };
        let done = now.saturating_mul(width).checked_div(end).unwrap_or(width);
        let bar: String = (0..width).map(|place| if place < done { '█' } else { '░' }).collect();
        let paused = if matches!(self.clock, Clock::Stands(_)) { PAUSED } else { "" };
        format!("{} / {} s {bar}{paused}", seconds(now), seconds(end))
    }
}
