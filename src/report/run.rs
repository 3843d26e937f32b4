//! The result of a run, for the JSON report.

use serde::Serialize;

use super::Finding;
use crate::units::Micros;

/// The result of a run. Fields may be added, but never change their meaning.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// The name of the robot; `None` if the script names no robots, and for a run with several robots.
    pub robot: Option<String>,
    /// The script.
    pub script: String,
    /// Why it ended: `finished`, `quit`, `signal`, `port`, `stalled`, `late`, `expect`, `gate`, `guard`, `failed`,
    /// or `other` for a robot that was stopped because the run of another one ended.
    pub reason: &'static str,
    /// Why it ended, in words.
    pub cause: String,
    /// The exit code.
    pub exit: u8,
    /// When it started, in RFC 3339 format.
    pub started: String,
    /// The port; `None` for the virtual board.
    pub port: Option<String>,
    /// The selected part, speed and number of passes.
    pub asked: Asked,
    /// When it ended, in the time of the timeline, including all passes and without the pauses.
    #[serde(rename = "end_us")]
    pub end: Micros,
    /// How long it took, including the pauses and the stop.
    #[serde(rename = "elapsed_us")]
    pub elapsed: Micros,
    /// How many times it was paused, by a key or by Ctrl-Z.
    pub pauses: u64,
    /// The file in which it ended early.
    pub file: Option<String>,
    /// The line on which it ended early.
    pub line: Option<usize>,
    /// Whether the robot was stopped: `not needed`, `sent`, `not sent`, `not defined` (the board has no stop), `held` (every servo
    /// with torque holds its position) or `not held` (a servo did not answer).
    pub stop: &'static str,
    /// The last pass, counted from 1.
    pub passes: u64,
    /// The numbers of frames.
    pub frames: Frames,
    /// All bytes that the port accepted, including those of stops.
    pub bytes: u64,
    /// The lateness of frames, in microseconds.
    pub lateness_us: Lateness,
    /// Frames that were dropped because a newer one replaced them.
    pub dropped: Vec<Dropped>,
    /// The results of `expect`s.
    pub expects: Vec<Expected>,
    /// The gates that closed.
    pub gates: Vec<Gate>,
    /// Frames that were sent because of the world, and not because of the script. What the port received, without these and
    /// with those in `dropped`, is what `render` prints.
    pub unscripted: Vec<Unscripted>,
    /// Warnings of the script.
    pub warnings: Vec<Finding>,
    /// The result of each robot, if the script names its robots. Then the fields above are about all of them: numbers are added up,
    /// the lateness and `stop` are the worst, and the end is that of the robot that ended first.
    pub robots: Vec<Run>,
}

impl Run {
    /// The result of a run with several robots, of which the one with the number `first` ended first.
    pub fn of_all(robots: Vec<Run>, first: usize) -> Option<Run> {
        let mut all = robots.get(first)?.clone();
        all.robot = None;
        let ports: Vec<&str> = robots.iter().filter_map(|run| run.port.as_deref()).collect();
        all.port = Some(ports.join(", ")).filter(|ports| !ports.is_empty());
        for run in robots.iter().enumerate().filter(|(number, _)| *number != first).map(|(_, run)| run) {
            all.frames.sent += run.frames.sent;
            all.frames.dropped += run.frames.dropped;
            all.frames.extra += run.frames.extra;
            all.frames.not_noted += run.frames.not_noted;
            all.bytes += run.bytes;
            let (worst, other) = (&mut all.lateness_us, run.lateness_us);
            worst.p50 = worst.p50.max(other.p50);
            worst.p99 = worst.p99.max(other.p99);
            worst.max = worst.max.max(other.max);
            worst.line = worst.line.max(other.line);
            all.dropped.extend(run.dropped.iter().cloned());
            all.expects.extend(run.expects.iter().cloned());
            all.gates.extend(run.gates.iter().cloned());
            all.unscripted.extend(run.unscripted.iter().cloned());
        }
        all.robots = robots;
        Some(all)
    }
}

/// The selected part, speed and number of passes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Asked {
    /// `--from`: a time or a mark, as written.
    pub from: Option<String>,
    /// `--to`: a time or a mark, as written.
    pub to: Option<String>,
    /// The speed factor; 1 is normal speed.
    pub speed: f64,
    /// The number of passes; `None` for an endless run.
    pub passes: Option<u64>,
}

/// The numbers of frames.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Frames {
    /// Frames of the script that the port accepted.
    pub sent: usize,
    /// Frames of the script that were dropped.
    pub dropped: usize,
    /// Other frames: of stops, of `on abort`, after a pause, at closed gates.
    pub extra: usize,
    /// Frames that are missing in `lateness_us` and `dropped` because the observer could not keep up.
    pub not_noted: u64,
}

/// The lateness of frames, in microseconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Lateness {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Worst.
    pub max: f64,
    /// The longest time that a frame waits for the serial line, on a perfect computer.
    pub line: f64,
}

/// A frame that was dropped.
#[derive(Clone, Debug, Serialize)]
pub struct Dropped {
    /// When it was due, in the time of the script.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// Its command.
    pub command: String,
    /// The file of the script.
    pub file: String,
    /// The line of the script.
    pub line: usize,
}

/// The result of an `expect`.
#[derive(Clone, Debug, Serialize)]
pub struct Expected {
    /// When it was due, in the time of the script.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// The condition.
    pub expect: String,
    /// The reason given in the script.
    pub why: Option<String>,
    /// What was found.
    pub found: String,
    /// Whether it passed.
    pub passed: bool,
    /// The file of the script.
    pub file: String,
    /// The line of the script.
    pub line: usize,
}

/// A gate that closed.
#[derive(Clone, Debug, Serialize)]
pub struct Gate {
    /// When the clock of the script stopped, in the time of the script.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// The line in the notation of scripts.
    pub gate: String,
    /// How long it was closed, in real time, without pauses.
    #[serde(rename = "took_us")]
    pub took: Micros,
    /// Why it ended: `matched`, `go`, `continued`, `others`, `timed out`, `silent`, `input ended` or `stopped`.
    pub end: &'static str,
    /// What was found, in words.
    pub found: String,
    /// Whether the run continued.
    pub opened: bool,
    /// The file of the script.
    pub file: String,
    /// The line of the script.
    pub line: usize,
}

/// One frame that was sent once or repeatedly because of the world.
#[derive(Clone, Debug, Serialize)]
pub struct Unscripted {
    /// Why: `gate` for a refresh at a closed gate, `read` for a request, `start` before the script, `soft` for the soft start, and
    /// `torque` before the torque of a servo is switched on.
    pub reason: &'static str,
    /// The number of frames of the script before it.
    pub after: u64,
    /// How many times it was sent there.
    pub count: u64,
    /// The frame in hex.
    pub frame: String,
    /// Its command.
    pub command: String,
    /// The file of the script; `None` unless it is a refresh.
    pub file: Option<String>,
    /// The line of the script.
    pub line: Option<usize>,
}
