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
    /// The bytes that the port accepts.
    pub(super) recording: Option<Recording>,
    /// The log, and the script that it refers to.
    pub(super) log: Option<(Log, Sources)>,
    /// The poses of the robot of the virtual board, for the log.
    pub(super) poses: Option<Receiver<(Micros, Pose)>>,
}

/// The sending end of the ring, for the thread that plays.
pub(super) struct Observers {
    ring: Producer<(Nanos, Notice)>,
    observed: Receiver<Observed>,
    /// All bytes that the port accepted.
    bytes: u64,
    /// What did not fit in the ring: bytes that the port accepted, and other notices.
    lost_bytes: u64,
    lost_notices: u64,
}

/// The results of the observers.
pub(super) struct Observed {
    pub(super) run: RunLog,
    /// Whether the recording is complete.
    pub(super) recorded: io::Result<()>,
    /// The log, which still needs its last line.
    pub(super) log: Option<TimelineLog>,
}

impl Observers {
    /// Starts the thread. An endless run plays `timelines[1]` after the first pass.
    pub(super) fn start(timelines: [Arc<Timeline>; 2], display: Display, files: Files) -> io::Result<Self> {
        let (ring, notices) = RingBuffer::new(ROOM);
        let (done, observed) = mpsc::channel();
        start_thread("observers", move || {
            let _ = done.send(observe(notices, timelines, display, files));
        })?;
        Ok(Observers { ring, observed, bytes: 0, lost_bytes: 0, lost_notices: 0 })
    }

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

    /// Ends the thread and returns its results.
    pub(super) fn end(self) -> Observed {
        let Observers { ring, observed, bytes, lost_bytes, lost_notices } = self;
        drop(ring);
        let mut observed = observed.recv_timeout(PATIENCE).unwrap_or_else(|_| {
            let failed = Err(io::Error::other("the thread that writes it failed"));
            Observed { run: RunLog::new(), recorded: failed, log: None }
        });
        (observed.run.bytes, observed.run.not_noted) = (bytes, lost_notices);
        if lost_bytes > 0 && observed.recorded.is_ok() {
            observed.recorded = Err(io::Error::other(format!("{lost_bytes} bytes did not fit in the buffer")));
        }
        observed
    }
}

/// Passes every notice to every observer until the ring is closed and empty.
fn observe(
    mut notices: Consumer<(Nanos, Notice)>,
    [first, again]: [Arc<Timeline>; 2],
    mut display: Display,
    files: Files,
) -> Observed {
    let Files { mut recording, log, poses } = files;
    let (log, sources) = log.unzip();
    let mut log = log.map(|log| TimelineLog::new(log, poses));
    let lines = sources.as_ref().map(Lines::of);
    let (mut run, mut timeline) = (RunLog::new(), first);
    let mut logged = log.as_mut().zip(lines.as_ref()).map(|(log, lines)| Logged(log, lines));
    let mut observers: Vec<&mut dyn Observer> = vec![&mut run];
    observers.extend(logged.as_mut().map(|logged| logged as &mut dyn Observer));
    observers.extend(recording.as_mut().map(|recording| recording as &mut dyn Observer));
    observers.push(&mut display);
    loop {
        // Checked before the ring is emptied, so that nothing is left in it at the end.
        let is_last = notices.is_abandoned();
        while let Ok((at, notice)) = notices.pop() {
            for observer in &mut observers {
                observer.observe(&timeline, at, notice);
            }
            if matches!(notice, Notice::Pass { pass: 2.. }) {
                timeline = Arc::clone(&again);
            }
        }
        if is_last {
            break;
        }
        for observer in &mut observers {
            observer.update(&timeline);
        }
        thread::park_timeout(UPDATE);
    }
    display.end();
    let recorded = recording.map_or(Ok(()), Recording::end);
    Observed { run, recorded, log }
}

/// A log and the lines of the script.
struct Logged<'l>(&'l mut TimelineLog, &'l Lines<'l>);

impl Observer for Logged<'_> {
    fn observe(&mut self, timeline: &Arc<Timeline>, at: Nanos, notice: Notice) {
        self.0.tell(timeline, self.1, at, notice);
    }

    fn update(&mut self, _: &Timeline) {
        self.0.take_poses();
    }
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
