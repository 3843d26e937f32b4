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

/// Runs a board on a thread until the program at the other end has closed its port and every byte was taken, or until a fault of
/// the board pulls the cable. Time 0 of the board is now.
///
/// A pseudo-terminal has no line rate, so the board takes `baud / 10` bytes a second itself. The port must have been opened
/// before, or the board takes it for closed.
pub fn serve(board: VirtualBoard, port: Pty, baud: u32) -> io::Result<JoinHandle<io::Result<Received>>> {
    port.never_wait()?;
    thread::Builder::new().name("virtual board".into()).spawn(move || run(board, &port, baud))
}

fn run(mut board: VirtualBoard, port: &Pty, baud: u32) -> io::Result<Received> {
    let nanos_a_byte = BITS_A_BYTE * 1_000_000_000 / u64::from(baud.max(1));
    let start = clock::now();
    let at = |us: u64| start.saturating_add(us.saturating_mul(1_000));
    let (unplug, stall) = (board.faults().unplug_us, board.faults().stall_us);
    let mut buffer = [0; CHUNK];
    let mut busy_until = 0;
    loop {
        let now = clock::now();
        let now_us = (now - start) / 1_000;
        if unplug.is_some_and(|us| us <= now_us) {
            return Ok(board.finish());
        }
        board.poll(now_us);
        let replies: Vec<u8> = board.replies().collect();
        // What nobody reads is lost, as on a real line.
        if !replies.is_empty() {
            port.write(&replies)?;
        }
        let is_open = stall.is_none_or(|us| us > now_us);
        let wakes = [board.next_due(), unplug, stall.filter(|_| is_open)].into_iter().flatten().map(at).min();
        let wakes = wakes.unwrap_or(u64::MAX).saturating_sub(now);
        match (port.wait(is_open, wakes)?, is_open) {
            (false, _) => continue,
            // It takes nothing, and the program has gone.
            (true, false) => return Ok(board.finish()),
            (true, true) => {}
        }
        let taken = match port.read(&mut buffer) {
            Ok(0) => return Ok(board.finish()),
            Ok(taken) => taken,
            Err(error) if matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock) => continue,
            Err(error) => return Err(error),
        };
        let now = clock::now();
        board.receive((now - start) / 1_000, buffer.get(..taken).unwrap_or_default());
        busy_until = now.max(busy_until) + nanos_a_byte * taken as u64;
        // A signal may cut one sleep short; the next one makes up for it.
        clock::sleep_until(busy_until);
    }
}
