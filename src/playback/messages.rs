//! What the player takes in, what it orders, and what it reports to others.

use std::io;

use super::judge::Verdict;
use crate::board::Report;
use crate::source::Span;
use crate::units::{Micros, Nanos};

/// The number of the signal that Ctrl-Z sends.
pub(super) const SIGTSTP: i32 = 20;

/// What happened since the last order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Input {
    /// Nothing but time.
    Tick,
    /// The port took so many of the bytes.
    Wrote(usize),
    /// The port takes no bytes now.
    Blocked,
    /// Writing failed, with the system's error number where there is one.
    Failed(Option<i32>),
    /// The other end of the port is gone.
    HungUp,
    /// This process got a signal.
    Signal(i32),
    /// This process shall sleep until it is continued (Ctrl-Z on a terminal).
    Suspend,
    /// Somebody at the terminal said that the robot shall stand, until somebody says that it goes on.
    Pause,
    /// Somebody at the terminal said that a paused run shall go on.
    Resume,
    /// Somebody at the terminal said that a paused run shall play what comes next, and pause again.
    Step,
    /// Somebody at the terminal said that the run shall end.
    Quit,
    /// Somebody at the terminal asks what the keys are.
    Help,
    /// The guard is gone, or takes no beats.
    Unguarded,
    /// Something panicked.
    Panicked,
}

impl Input {
    /// What became of bytes that were given to a port.
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

    /// The end that it brings, if it brings one.
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
            | Input::Help => None,
        }
    }
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Order {
    /// Give [`Player::bytes`](super::Player::bytes) to the port, in one write.
    Write,
    /// Throw away what the port was given but has not sent.
    Discard,
    /// Wait until this time, from the start; if `writable`, no longer than until the port takes bytes.
    Wait {
        /// The deadline.
        until: Nanos,
        /// Whether to wake as soon as the port takes bytes.
        writable: bool,
    },
    /// Wait until this time, from the start, and look at nothing else.
    Pause {
        /// The deadline.
        until: Nanos,
    },
    /// The robot stands: sleep until this process is continued.
    Suspend,
    /// Wait until somebody says that the run shall go on, or something ends it.
    Stay,
    /// The run is over.
    Done,
}

/// What others may want to know while it plays. Small and without anything on the heap, so that it can be handed to
/// another thread without waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// This frame is given to the port.
    Sent {
        /// Its index in the timeline.
        event: usize,
        /// How late.
        late: Nanos,
    },
    /// This frame of the drive was not sent at a pause; what it says holds when the run goes on.
    Passed {
        /// Its index in the timeline.
        event: usize,
    },
    /// This frame was left out, because a newer one had overtaken it.
    Dropped {
        /// Its index in the timeline.
        event: usize,
    },
    /// This line is due.
    Say {
        /// Its index in the timeline's cues.
        cue: usize,
    },
    /// The port took these bytes, of a frame, a stop or a pause.
    Wrote(Piece),
    /// The board has sent a report.
    Report(Report),
    /// Somebody asks what the keys are.
    Help,
    /// An `expect` was judged.
    Judged(Verdict),
    /// The robot stands, and the process is about to sleep.
    Sleeping {
        /// The time of the script.
        at: Micros,
    },
    /// Somebody at the terminal is waited for, to say that the run shall go on.
    Paused {
        /// The time of the script.
        at: Micros,
    },
    /// A further pass of a run without end begins.
    Pass {
        /// Which one, counted from 1.
        pass: u64,
    },
    /// It goes on.
    Resumed {
        /// The time of the script.
        at: Micros,
    },
}

/// Bytes that a port took, at most as many as a frame of any command has; more are several of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    bytes: [u8; PIECE],
    length: u8,
}

/// How many bytes are kept together.
const PIECE: usize = 23;

impl Piece {
    /// All these bytes, in pieces.
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
    /// The port took the stop frame, more than once.
    Sent,
    /// It did not: the robot may still be moving.
    NotSent,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// Everything was sent.
    Finished,
    /// Somebody at the terminal asked for it.
    Quit,
    /// A signal asked for it.
    Signal(i32),
    /// The port was lost, with the system's error number where there is one.
    Lost(Option<i32>),
    /// The port stopped taking bytes.
    Stalled,
    /// A frame was later than allowed, by so much in all.
    Late(Nanos),
    /// An `expect` failed.
    Expect(Verdict),
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
    /// When, in the time of the timeline, with the passes before this one.
    pub at: Micros,
    /// The last command that was taken up; for [`Cause::Late`] the one that was not sent.
    pub place: Option<Span>,
    /// Whether the robot was stopped.
    pub stop: Stop,
    /// Frames of the timeline that the port took whole.
    pub sent: usize,
    /// Frames of the timeline that were left out.
    pub dropped: usize,
    /// Frames beside the timeline's: those of stops, of `on abort`, and those that go on behind a pause.
    pub extra: usize,
    /// The worst lateness of a frame.
    pub worst_late: Nanos,
}
