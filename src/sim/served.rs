//! A virtual board behind a pseudo-terminal, in real time.

use std::io;
use std::thread::{self, JoinHandle};

use super::{Received, VirtualBoard};
use crate::clock;
use crate::link::Pty;

/// Bits that a byte takes on the line: start, eight data bits, stop.
const BITS_A_BYTE: u64 = 10;
/// The most bytes taken at once; the line is then busy for as long as they need.
const CHUNK: usize = 16;

/// Runs a board on a thread until the program at the other end has closed its port and every byte was taken.
///
/// A pseudo-terminal has no line rate, so the board takes `baud / 10` bytes a second itself. The port must have been opened
/// before, or the board takes it for closed.
pub fn serve(board: VirtualBoard, port: Pty, baud: u32) -> io::Result<JoinHandle<io::Result<Received>>> {
    thread::Builder::new().name("virtual board".into()).spawn(move || run(board, &port, baud))
}

fn run(mut board: VirtualBoard, port: &Pty, baud: u32) -> io::Result<Received> {
    let nanos_a_byte = BITS_A_BYTE * 1_000_000_000 / u64::from(baud.max(1));
    let mut buffer = [0; CHUNK];
    let mut busy_until = 0;
    loop {
        let taken = match port.read(&mut buffer) {
            Ok(0) => return Ok(board.finish()),
            Ok(taken) => taken,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        board.receive(buffer.get(..taken).unwrap_or_default());
        busy_until = clock::now().max(busy_until) + nanos_a_byte * taken as u64;
        // A signal may cut one sleep short; the next one makes up for it.
        clock::sleep_until(busy_until);
    }
}
