//! Between a program and a real board: bytes pass both ways unchanged, and somebody watches.

use std::io;
use std::os::fd::AsFd as _;

use super::guard::halt;
use super::halt::{Outbox, Stop};
use super::os::{self, Ready};
use crate::clock;
use crate::link::{Door, Happened, Link};

/// The most bytes taken at once.
const CHUNK: usize = 4 * 1024;
/// The longest time without a look at whether it shall end, in nanoseconds.
const LOOK: u64 = 20_000_000;
/// How long nobody looks whether a program has come, in nanoseconds.
const IDLE: u64 = 2_000_000;

/// Why a tap ended by itself.
#[derive(Debug, thiserror::Error)]
pub enum TapError {
    /// The port of the board was lost.
    #[error("the port was lost: {0}")]
    Lost(io::Error),
    /// The side of the program, or whoever watches, failed.
    #[error(transparent)]
    Failed(#[from] io::Error),
}

/// Passes bytes between whatever program opens the door and the port of a board, until `watch` says `false`. `watch` is told what
/// happens and when, in microseconds from the start on.
///
/// Bytes pass before anybody is told of them. Where the port takes none for now, the program waits, as it would without a tap. What
/// the board says while no program is there is lost, as it would be.
pub fn tap(
    door: &Door,
    port: &mut impl Link,
    mut watch: impl FnMut(u64, Happened<'_>) -> io::Result<bool>,
) -> Result<(), TapError> {
    let begin = clock::now();
    let time = || clock::now().saturating_sub(begin);
    let program = door.pty();
    let (mut from_program, mut from_board) = (vec![0; CHUNK], vec![0; CHUNK]);
    // What of the program's bytes the port has not taken yet.
    let mut left = 0..0;
    let (mut is_open, mut is_ending) = (false, false);
    loop {
        if !watch(time() / 1_000, Happened::Passed)? {
            return Ok(());
        }
        if !is_open && (program.is_in_use()? || program.waiting()? > 0) {
            (is_open, is_ending) = (true, false);
            watch(time() / 1_000, Happened::Opened)?;
        }
        if !is_open && left.is_empty() {
            take(port, &mut from_board).map_err(TapError::Lost)?;
            clock::sleep_until(clock::now() + IDLE);
            continue;
        }
        let asks = if left.is_empty() { Ready::IN } else { Ready::empty() };
        let gives = if left.is_empty() { Ready::IN } else { Ready::IN | Ready::OUT };
        let watched = [(is_open.then(|| program.as_fd()), asks), (Some(port.descriptor()), gives)];
        let [asks, gives] = os::wait(watched, Some(LOOK))?;
        if left.is_empty() && !asks.is_empty() {
            match program.read(&mut from_program) {
                // The system may tell of the end before the last bytes are through.
                Ok(0) if !std::mem::replace(&mut is_ending, true) => clock::sleep_until(clock::now() + IDLE),
                Ok(0) => {
                    is_open = false;
                    door.sweep()?;
                    watch(time() / 1_000, Happened::Closed)?;
                }
                Ok(taken) => {
                    let at = time();
                    is_ending = false;
                    left = give(port, &from_program, 0..taken).map_err(TapError::Lost)?;
                    watch(time() / 1_000, Happened::Came(at, from_program.get(..taken).unwrap_or_default()))?;
                }
                Err(error) if is_nothing(&error) => {}
                Err(error) => return Err(error.into()),
            }
        } else if !left.is_empty() {
            left = give(port, &from_program, left).map_err(TapError::Lost)?;
        }
        if gives.contains(Ready::IN) || os::is_gone(gives) {
            let taken = take(port, &mut from_board).map_err(TapError::Lost)?;
            let bytes = from_board.get(..taken).unwrap_or_default();
            if is_open && !bytes.is_empty() {
                program.write(bytes)?;
                watch(time() / 1_000, Happened::Answered(bytes))?;
            }
        }
    }
}

/// Gives the port bytes of a buffer; says which are left.
fn give(port: &mut impl Link, buffer: &[u8], left: std::ops::Range<usize>) -> io::Result<std::ops::Range<usize>> {
    match port.write(buffer.get(left.clone()).unwrap_or_default()) {
        Ok(taken) => Ok(left.start + taken..left.end),
        Err(error) if is_nothing(&error) => Ok(left),
        Err(error) => Err(error),
    }
}

/// Takes what the board has sent, perhaps nothing; a port that has hung up is an error.
fn take(port: &mut impl Link, buffer: &mut [u8]) -> io::Result<usize> {
    match port.read(buffer) {
        Ok(0) => Err(io::Error::other("it has hung up")),
        Ok(taken) => Ok(taken),
        Err(error) if is_nothing(&error) => Ok(0),
        Err(error) => Err(error),
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Stops the robot when a tap ends and the program can send nothing any more, as every end of a run does: throws away what is queued, then
/// the stop frame three times and buzzer off.
pub fn stop_now(port: &mut impl Link) -> Stop {
    halt(port, &mut Outbox::new())
}
