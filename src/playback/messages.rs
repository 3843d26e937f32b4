//! Inputs, orders and notices of the player.

use std::io;

use super::gate::Passage;
use super::judge::Verdict;
use crate::board::{Board, Command, Hundredths, Report, ServoSet, VerbId};
use crate::source::Span;
use crate::units::{Micros, Nanos};

/// The number of the signal that Ctrl-Z sends.
pub(super) const SIGTSTP: i32 = 20;

/// What happened since the last order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Input {
    /// Only time has passed.
    Tick,
    /// The port accepted this number of bytes.
    Wrote(usize),
    /// The port accepts no bytes now.
    Blocked,
    /// Writing failed, with the system's error number where there is one.
    Failed(Option<i32>),
    /// The other end of the port is gone.
    HungUp,
    /// This process got a signal.
    Signal(i32),
    /// Suspend this process (Ctrl-Z on a terminal).
    Suspend,
    /// Pause (a key).
    Pause,
    /// Continue a paused run (a key).
    Resume,
    /// Play one step of a paused run (a key).
    Step,
    /// With other robots: time 0 of the script, or the end of the closed gate, is at this time from the start.
    Together {
        /// When.
        at: Nanos,
    },
    /// With other robots: continue a paused run.
    ResumeTogether {
        /// The time of the run: that of the script and of earlier passes.
        run: Nanos,
        /// When that is, from the start.
        at: Nanos,
    },
    /// With other robots: play the next step of a paused run.
    StepTo {
        /// Its time in the run, with earlier passes.
        at: Nanos,
        /// Whether all robots are at a gate then, which closes or opens.
        is_gate: bool,
    },
    /// The run of another robot of the script has ended early.
    OtherEnded {
        /// Its number.
        robot: usize,
    },
    /// Open the gate that waits for it (a key or a line).
    Go,
    /// The lines that open gates have ended.
    GoEnded,
    /// End the run (a key).
    Quit,
    /// Show the keys (a key).
    Help,
    /// The guard has ended, or accepts no heartbeats.
    Unguarded,
    /// Something panicked.
    Panicked,
}

impl Input {
    /// The result of a write to a port.
    pub fn of_write(result: io::Result<usize>) -> Self {
        match result {
            Ok(count) => Input::Wrote(count),
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock => Input::Blocked,
                io::ErrorKind::Interrupted => Input::Tick,
                _ => Input::Failed(error.raw_os_error()),
            },
        }
    }

    /// Why this input ends the run, if it does.
    pub(super) fn end(self) -> Option<Cause> {
        match self {
            Input::Signal(signal) => Some(Cause::Signal(signal)),
            Input::HungUp => Some(Cause::Lost(None)),
            Input::Failed(error) => Some(Cause::Lost(error)),
            Input::Unguarded => Some(Cause::Unguarded),
            Input::Quit => Some(Cause::Quit),
            Input::Panicked => Some(Cause::Panicked),
            Input::OtherEnded { robot } => Some(Cause::Other { robot }),
            Input::Tick
            | Input::Wrote(_)
            | Input::Blocked
            | Input::Suspend
            | Input::Pause
            | Input::Resume
            | Input::Step
            | Input::StepTo { .. }
            | Input::Together { .. }
            | Input::ResumeTogether { .. }
            | Input::Go
            | Input::GoEnded
            | Input::Help => None,
        }
    }
}

/// What a player waits for that plays together with others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Standing {
    /// For all robots to have their guards. Nothing was sent.
    Present,
    /// For nothing: it prepares the robot, plays, or stops for a pause.
    Busy,
    /// For time 0 of the script.
    Ready,
    /// For the end of a gate.
    AtGate {
        /// The pass, counted from 1.
        pass: u64,
        /// The gate's index in the timeline.
        gate: usize,
        /// Until when its own reports match, if nothing more comes; `None` if they do not.
        fits_until: Option<Nanos>,
        /// Whether it waits for the operator.
        is_go: bool,
        /// Whether the time limit has passed, and the script continues all the same.
        has_expired: bool,
    },
    /// For the end of a pause.
    Paused {
        /// The time of the run, with earlier passes.
        at: Nanos,
        /// The time of the next step in the run, and whether that is a gate; `None` at the end of a pass.
        next: Option<(Nanos, bool)>,
        /// Whether the next step prepares servos, before time 0.
        prepares: bool,
        /// Whether its process may be suspended.
        is_asleep: bool,
    },
    /// For nothing: the run ends early, and the robot is being stopped.
    Ending,
    /// For nothing: the run has ended.
    Done {
        /// Whether it ended early.
        is_early: bool,
    },
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Order {
    /// Write [`Player::bytes`](super::Player::bytes) to the port, in one write.
    Write,
    /// A stop begins. Discard what the port has not sent yet, if the board permits that.
    Halt {
        /// Whether it does.
        discards: bool,
    },
    /// Wait until this time from the start; if `writable`, only until the port accepts bytes.
    Wait {
        /// The deadline.
        until: Nanos,
        /// Whether to wake as soon as the port accepts bytes.
        writable: bool,
    },
    /// Wait until this time from the start, and ignore all inputs.
    Pause {
        /// The deadline.
        until: Nanos,
    },
    /// The robot is stopped: suspend this process.
    Suspend,
    /// Wait until the run is continued or ended.
    Stay,
    /// The run is over.
    Done,
}

/// An event of a run. Small and without heap memory, so that it can be passed to another thread without waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// This frame is sent to the port.
    Sent {
        /// Its index in the timeline.
        event: usize,
        /// How late.
        late: Nanos,
    },
    /// This drive frame was not sent, because the run is paused; it applies when the run continues.
    Withheld {
        /// Its index in the timeline.
        event: usize,
    },
    /// This frame was dropped, because a newer one replaces it.
    Dropped {
        /// Its index in the timeline.
        event: usize,
    },
    /// This `say` line is due.
    Say {
        /// Its index in the timeline's cues.
        cue: usize,
        /// The newest report, unless it is too old.
        report: Option<Report>,
    },
    /// This mark is passed.
    Marked {
        /// Its index in the timeline's marks.
        mark: usize,
    },
    /// The port accepted these bytes, of a frame, a stop or a pause.
    Wrote(Piece),
    /// The board sent a report.
    Report(Report),
    /// Show the keys.
    Help,
    /// An `expect` was judged.
    Judged(Verdict),
    /// The clock of the script stops at this gate.
    Waiting {
        /// Its index in the timeline's gates.
        gate: usize,
    },
    /// The gate has a new value.
    Measured {
        /// Its index in the timeline's gates.
        gate: usize,
        /// The value.
        value: Hundredths,
    },
    /// A gate has ended.
    Passed(Passage),
    /// The last frame of a drive command was sent again, because a gate is closed.
    Refreshed {
        /// The index of the command in the timeline.
        event: usize,
    },
    /// The board was asked for a quantity.
    Asked {
        /// Its row in the table of the board.
        quantity: usize,
    },
    /// This frame was sent because of the world, and not because of the script.
    Unscripted {
        /// Why.
        why: Why,
        /// Its command.
        command: ShortCommand,
    },
    /// A servo keeps these settings, which the script does not set; in the order of
    /// [`Preparation::settings`](crate::board::Preparation::settings).
    Kept {
        /// The servo.
        servo: i32,
        /// Their values; `None` for those that the script sets.
        values: [Option<i32>; 2],
    },
    /// The servos begin to move to their first positions.
    SoftStart {
        /// How many of them.
        servos: usize,
        /// How long it takes.
        takes: Nanos,
        /// Whether that is longer than asked, because of a limit of a servo's speed.
        is_longer: bool,
    },
    /// The servos are ready: this is time 0 of the script.
    Began,
    /// A servo answered with these error bits.
    Flags {
        /// The servo.
        servo: i32,
        /// The bits.
        bits: u16,
    },
    /// The board answered the first frame with its error bits; 0 for no error.
    Errors(u16),
    /// The board did not answer the first frame.
    Unanswered,
    /// The robot is stopped, and the process is about to be suspended.
    Sleeping {
        /// The time of the script.
        at: Micros,
    },
    /// The run is paused and waits for a key.
    Paused {
        /// The time of the script.
        at: Micros,
    },
    /// The next pass of an endless run starts.
    Pass {
        /// Which one, counted from 1.
        pass: u64,
    },
    /// The run continues.
    Resumed {
        /// The time of the script.
        at: Micros,
    },
}

/// Why a frame was sent that is not of the script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Why {
    /// It prepares a servo before the script.
    Start,
    /// It belongs to the soft start.
    Soft,
    /// It belongs to switching the torque of a servo on.
    Torque,
}

/// A command with at most two values, without heap memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShortCommand {
    verb: VerbId,
    values: [i32; 2],
    count: u8,
}

impl ShortCommand {
    /// The same command with its first two values.
    pub(super) fn of(command: &Command) -> Self {
        let mut short = ShortCommand { verb: command.verb(), values: [0; 2], count: 0 };
        for (place, value) in short.values.iter_mut().zip(command.values()) {
            *place = value;
            short.count += 1;
        }
        short
    }

    /// The command.
    pub fn command(&self) -> Command {
        Command::new(self.verb, self.values.get(..usize::from(self.count)).unwrap_or_default())
    }
}

/// Bytes that a port accepted, at most as many as the longest frame has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    bytes: [u8; PIECE],
    length: u8,
}

/// The most bytes of a piece.
const PIECE: usize = 23;

impl Piece {
    /// All these bytes, in pieces.
    #[cfg(all(feature = "player", target_os = "linux"))]
    pub(super) fn all(bytes: &[u8]) -> impl Iterator<Item = Self> {
        bytes.chunks(PIECE).map(|chunk| {
            let mut piece = Piece { bytes: [0; PIECE], length: 0 };
            for (place, byte) in piece.bytes.iter_mut().zip(chunk) {
                *place = *byte;
                piece.length += 1;
            }
            piece
        })
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }
}

/// Whether the robot was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The run ended as the script says.
    NotNeeded,
    /// The port accepted the stop frame, more than once.
    Sent,
    /// The port did not accept it: the robot may still be moving.
    NotSent,
    /// The board has no stop, so that nothing was sent. [`Board::without_stop`](crate::board::Board::without_stop) says
    /// what the robot does.
    NotDefined,
    /// Every servo holds its position: those that were on their way got the target where they were.
    Held,
    /// Some servos did not say where they are, so that they may still be on their way.
    NotHeld,
}

/// What is wrong with a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoFault {
    /// The servo.
    pub servo: i32,
    /// What is wrong with it.
    pub kind: ServoFaultKind,
}

impl ServoFault {
    /// In words.
    pub fn words(&self, board: &Board) -> String {
        let feedback = board.feedback.as_ref();
        let resource = feedback.and_then(|feedback| board.occupied(feedback.verb, Some(self.servo)).first());
        let name = resource.and_then(|resource| board.resource(*resource)).map_or("a servo", |resource| &resource.name);
        match self.kind {
            ServoFaultKind::Silent => format!("{name} does not answer"),
            ServoFaultKind::Mode(mode) => {
                let words = feedback.and_then(|feedback| Some((feedback.preparation.as_ref()?.mode_words)(mode)));
                format!("{name} {}", words.unwrap_or_default())
            }
            ServoFaultKind::Position(position) => {
                let axis = feedback.and_then(|feedback| board.verb(feedback.verb)?.moving().first());
                let (least, most) = axis.map_or((0, 0), |axis| axis.range);
                format!("{name} reports the position {}, which is not from {least} to {most}", position.number())
            }
            ServoFaultKind::Flags(bits) => format!("{name} reports an error: {}", board.errors(bits)),
        }
    }
}

/// What may be wrong with a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ServoFaultKind {
    /// It does not answer.
    Silent,
    /// It is in this mode, which is not the one for positions.
    Mode(i32),
    /// It reports this position, which is not a valid one.
    Position(Hundredths),
    /// It answers with these error bits.
    Flags(u16),
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// Everything was sent.
    Finished,
    /// A key ended it.
    Quit,
    /// A signal ended it.
    Signal(i32),
    /// The port was lost, with the system's error number where there is one.
    Lost(Option<i32>),
    /// The port stopped accepting bytes.
    Stalled,
    /// A frame was later than allowed; its lateness.
    Late(Nanos),
    /// An `expect` failed.
    Expect(Verdict),
    /// A gate did not open.
    Gate(Passage),
    /// The board did not answer, and the script needs its answers.
    Unanswered,
    /// Something is wrong with a servo.
    Servo(ServoFault),
    /// The guard was lost.
    Unguarded,
    /// The run of another robot ended early.
    Other {
        /// Its number, in the order of the script.
        robot: usize,
    },
    /// The program failed.
    Panicked,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Why.
    pub cause: Cause,
    /// When, in the time of the timeline, including earlier passes.
    pub at: Micros,
    /// The last command that was processed; for [`Cause::Late`] the one that was not sent.
    pub place: Option<Span>,
    /// Whether the robot was stopped.
    pub stop: Stop,
    /// The servos that may still be on their way.
    pub missing: ServoSet,
    /// Frames of the timeline that the port accepted completely.
    pub sent: usize,
    /// Frames of the timeline that were dropped.
    pub dropped: usize,
    /// Other frames: of stops, of `on abort`, at closed gates, and those that restore the state after a pause.
    pub extra: usize,
    /// Whether the port accepted a frame of `on abort`.
    pub aborted: bool,
    /// The worst lateness of a frame.
    pub worst_late: Nanos,
}
