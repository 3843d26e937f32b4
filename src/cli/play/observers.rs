//! The thread that shows, records, logs and counts a run. Motion never waits for it.

use std::fs::File;
use std::io::{self, Write as _};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Duration;

use motionseq::playback::{Notice, now};
use motionseq::sim::Pose;
use motionseq::source::{Lines, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};
use rtrb::{Consumer, Producer, RingBuffer};

use super::super::log::{Log, TimelineLog};
use super::super::start_thread;
use super::super::worker::Worker;
use super::display::Display;
use super::observer::Observer;
use super::run_log::RunLog;

/// How often the ring is emptied.
const UPDATE: Duration = Duration::from_millis(40);
/// How many notices fit between two updates. The line carries 11,520 bytes per second.
const ROOM: usize = 32 * 1024;
/// How long the end waits for the thread, which only has to empty the ring.
const PATIENCE: Duration = Duration::from_millis(1_500);

/// The files that are written while a run plays.
pub(super) struct Files {
    /// The bytes that the port of each robot accepts.
    pub(super) recordings: Vec<Recording>,
    /// The log, and the script that it refers to.
    pub(super) log: Option<(Log, Sources)>,
}

/// What the observers know of one robot.
pub(super) struct Observed {
    /// Its timeline, and that of the passes after the first of an endless run.
    pub(super) timelines: [Arc<Timeline>; 2],
    pub(super) display: Display,
    /// Where the robot of a virtual board is, for the log.
    pub(super) poses: Option<Receiver<(Micros, Pose)>>,
}

/// One thread for all robots.
pub(super) struct Observers(Receiver<Results>);

/// The sending end of a ring, for a thread that plays or conducts.
pub(super) struct Notifier {
    ring: Producer<(Nanos, Notice)>,
    /// All bytes that the port accepted.
    bytes: u64,
    /// What did not fit in the ring: bytes that the port accepted, and other notices.
    lost_bytes: u64,
    lost_notices: u64,
}

/// The results of the observers.
pub(super) struct Results {
    /// One for each robot.
    pub(super) runs: Vec<RunLog>,
    /// Whether the recordings are complete.
    pub(super) recorded: io::Result<()>,
    /// The log, which still needs its last line.
    pub(super) log: Option<Log>,
}

impl Observers {
    /// Starts the thread. Returns a ring for each robot, and one for what is about all of them.
    pub(super) fn start(robots: Vec<Observed>, files: Files) -> io::Result<(Self, Vec<Notifier>)> {
        let (mut notifiers, mut rings) = (Vec::new(), Vec::new());
        for _ in 0..=robots.len() {
            let (ring, notices) = RingBuffer::new(ROOM);
            notifiers.push(Notifier { ring, bytes: 0, lost_bytes: 0, lost_notices: 0 });
            rings.push(notices);
        }
        let (done, results) = mpsc::channel();
        start_thread("observers", move || {
            let _ = done.send(observe(rings, robots, files));
        })?;
        Ok((Observers(results), notifiers))
    }

    /// Ends the thread and returns its results.
    pub(super) fn end(self, notifiers: Vec<Notifier>) -> Results {
        let counts: Vec<_> = notifiers.iter().map(|one| (one.bytes, one.lost_bytes, one.lost_notices)).collect();
        drop(notifiers);
        let mut results = self.0.recv_timeout(PATIENCE).unwrap_or_else(|_| {
            let failed = Err(io::Error::other("the thread that writes it failed"));
            Results { runs: counts.iter().map(|_| RunLog::new()).collect(), recorded: failed, log: None }
        });
        for (run, (bytes, _, lost_notices)) in results.runs.iter_mut().zip(&counts) {
            (run.bytes, run.not_noted) = (*bytes, *lost_notices);
        }
        let lost_bytes: u64 = counts.iter().map(|(_, lost, _)| lost).sum();
        if lost_bytes > 0 && results.recorded.is_ok() {
            results.recorded = Err(io::Error::other(format!("{lost_bytes} bytes did not fit in the buffer")));
        }
        results
    }
}

impl Notifier {
    /// Passes on a notice. If the ring is full, the notice is lost and counted.
    pub(super) fn notify(&mut self, notice: Notice) {
        self.notify_at(now(), notice);
    }

    /// Passes on a notice with a time on the clock of [`now`].
    pub(super) fn notify_at(&mut self, at: Nanos, notice: Notice) {
        let bytes = match &notice {
            Notice::Wrote(piece) => Some(piece.bytes().len() as u64),
            _ => None,
        };
        self.bytes += bytes.unwrap_or(0);
        if self.ring.push((at, notice)).is_err() {
            match bytes {
                Some(bytes) => self.lost_bytes += bytes,
                None => self.lost_notices += 1,
            }
        }
    }
}

/// A robot that is observed.
struct Robot {
    /// The timeline of the current pass, and that of the next ones.
    timeline: Arc<Timeline>,
    again: Arc<Timeline>,
    run: RunLog,
    log: TimelineLog,
    recording: Option<Recording>,
}

/// Passes every notice to every observer until the rings are closed and empty.
fn observe(mut rings: Vec<Consumer<(Nanos, Notice)>>, observed: Vec<Observed>, files: Files) -> Results {
    let Files { recordings, log } = files;
    let (mut log, sources) = log.unzip();
    let lines = sources.as_ref().map(Lines::of);
    let mut recordings = recordings.into_iter();
    let (mut robots, mut displays) = (Vec::new(), Vec::new());
    for (number, Observed { timelines: [timeline, again], display, poses }) in observed.into_iter().enumerate() {
        let log = TimelineLog::new(number, poses);
        robots.push(Robot { timeline, again, run: RunLog::new(), log, recording: recordings.next() });
        displays.push(display);
    }
    loop {
        // Checked before the rings are emptied, so that nothing is left in them at the end.
        let is_last = rings.iter().all(Consumer::is_abandoned);
        while let Some((ring, at, notice)) = earliest(&mut rings) {
            // The last ring is about all robots.
            let is_for_all = ring >= displays.len();
            for (number, robot) in robots.iter_mut().enumerate().filter(|(number, _)| is_for_all || ring == *number) {
                robot.run.observe(&robot.timeline, at, notice);
                if let Some((log, lines)) = log.as_mut().zip(lines.as_ref()) {
                    robot.log.tell(log, &robot.timeline, lines, at, notice);
                }
                if let Some(recording) = &mut robot.recording {
                    recording.observe(&robot.timeline, at, notice);
                }
                if let Some(display) = displays.get_mut(number) {
                    display.observe(&robot.timeline, at, notice);
                }
                if matches!(notice, Notice::Pass { pass: 2.. }) {
                    robot.timeline = Arc::clone(&robot.again);
                }
            }
        }
        if is_last {
            break;
        }
        if let (Some((first, others)), Some(robot)) = (displays.split_first_mut(), robots.first()) {
            first.update(&robot.timeline, others);
        }
        if let Some(log) = &mut log {
            for robot in &mut robots {
                robot.log.take_poses(log);
            }
        }
        thread::park_timeout(UPDATE);
    }
    displays.first().iter().for_each(|display| display.end());
    let mut recorded = Ok(());
    let mut runs = Vec::new();
    for mut robot in robots {
        if let Some(log) = &mut log {
            robot.log.take_poses(log);
        }
        recorded = recorded.and(robot.recording.map_or(Ok(()), Recording::end));
        runs.push(robot.run);
    }
    Results { runs, recorded, log }
}

/// The earliest notice of all rings, and its ring.
fn earliest(rings: &mut [Consumer<(Nanos, Notice)>]) -> Option<(usize, Nanos, Notice)> {
    let first = |ring: &Consumer<(Nanos, Notice)>| ring.peek().ok().map(|(at, _)| *at);
    let next = rings.iter().enumerate().filter_map(|(number, ring)| Some((first(ring)?, number))).min();
    let (_, number) = next?;
    let (at, notice) = rings.get_mut(number)?.pop().ok()?;
    Some((number, at, notice))
}

/// `--record`: a thread that writes the bytes that the port accepted.
pub(super) struct Recording(Worker<Box<[u8]>, io::Result<()>>);

impl Recording {
    /// How many writes may be queued.
    const ROOM: usize = 64 * 1024;
    /// How long the end waits for a blocked file.
    const PATIENCE: Duration = Duration::from_millis(750);

    /// Starts recording to an open file.
    pub(super) fn start(mut file: File) -> io::Result<Self> {
        let write = move |pieces: &Receiver<Box<[u8]>>| pieces.iter().try_for_each(|piece| file.write_all(&piece));
        Worker::start("recording", Self::ROOM, write).map(Recording)
    }

    /// Ends the recording; fails if it is incomplete.
    fn end(self) -> io::Result<()> {
        let (written, lost) = self.0.end(Self::PATIENCE, "it");
        written.map_err(io::Error::other)??;
        match lost {
            0 => Ok(()),
            lost => Err(io::Error::other(format!("{lost} pieces came faster than they could be written"))),
        }
    }
}

impl Observer for Recording {
    fn observe(&mut self, _: &Arc<Timeline>, _: Nanos, notice: Notice) {
        if let Notice::Wrote(piece) = notice {
            self.0.send(piece.bytes().into());
        }
    }
}
