//! Inputs, orders and notices of the player.

use std::io;

use super::gate::Passage;
use super::judge::Verdict;
use crate::board::{Hundredths, Report};
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
            Input::Tick
            | Input::Wrote(_)
            | Input::Blocked
            | Input::Suspend
            | Input::Pause
            | Input::Resume
            | Input::Step
            | Input::Go
            | Input::GoEnded
            | Input::Help => None,
        }
    }
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
    /// The guard was lost.
    Unguarded,
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
