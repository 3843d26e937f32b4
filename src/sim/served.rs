//! A virtual board behind a pseudo-terminal, in real time.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};

use super::{Received, VirtualBoard};
use crate::clock;
use crate::link::Pty;

/// Bits that a byte takes on the line: start, eight data bits, stop.
const BITS_A_BYTE: u64 = 10;
/// The most bytes taken at once; the line is then busy for as long as they need.
const CHUNK: usize = 16;
/// The longest time without a look at whether the script has begun, in nanoseconds.
pub(super) const LOOK: u64 = 20_000_000;

/// How long the line is busy with a byte, in nanoseconds.
pub(super) fn nanos_a_byte(baud: u32) -> u64 {
    BITS_A_BYTE * 1_000_000_000 / u64::from(baud.max(1))
}

/// A board that runs on a thread of its own.
#[derive(Debug)]
pub struct Served {
    thread: JoinHandle<io::Result<Received>>,
    /// When the script begins, on the clock; 0 until somebody says so.
    start: Arc<AtomicU64>,
    stalls: Arc<AtomicBool>,
}

impl Served {
    /// Says when the script begins: the board's time 0, from which its faults count.
    pub fn begin(&self, now: u64) {
        self.start.store(now.max(1), Ordering::Relaxed);
    }

    /// Set as soon as the port shall take no bytes any more.
    pub fn stalls(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stalls)
    }

    /// Waits for its end; `None` where the thread failed.
    pub fn join(self) -> Option<io::Result<Received>> {
        self.thread.join().ok()
    }
}

/// Runs a board on a thread until the program at the other end has closed its port and every byte was taken, or until a fault of
/// the board pulls the cable.
///
/// A pseudo-terminal has no line rate, so the board takes `baud / 10` bytes a second itself. The port must have been opened
/// before, or the board takes it for closed.
pub fn serve(board: VirtualBoard, port: Pty, baud: u32) -> io::Result<Served> {
    port.never_wait()?;
    let (start, stalls) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
    let (begin, stall) = (Arc::clone(&start), Arc::clone(&stalls));
    let work = move || run(board, &port, baud, &begin, &stall);
    let thread = thread::Builder::new().name("virtual board".into()).spawn(work)?;
    Ok(Served { thread, start, stalls })
}

fn run(mut board: VirtualBoard, port: &Pty, baud: u32, begin: &AtomicU64, stalls: &AtomicBool) -> io::Result<Received> {
    let nanos_a_byte = nanos_a_byte(baud);
    // Until the script begins, it is time 0.
    let time = |now: u64| match begin.load(Ordering::Relaxed) {
        0 => 0,
        start => now.saturating_sub(start) / 1_000,
    };
    let (unplug, stall) = (board.faults().unplug_us, board.faults().stall_us);
    let mut buffer = [0; CHUNK];
    let mut busy_until = 0;
    loop {
        let now_us = time(clock::now());
        board.poll(now_us);
        if unplug.is_some_and(|us| us <= now_us) {
            return Ok(board.finish());
        }
        let replies: Vec<u8> = board.replies().collect();
        // What nobody reads is lost, as on a real line.
        if !replies.is_empty() {
            port.write(&replies)?;
        }
        let is_open = stall.is_none_or(|us| us > now_us);
        stalls.store(!is_open, Ordering::Relaxed);
        let wakes = [board.next_due(), unplug, stall.filter(|_| is_open)].into_iter().flatten().min();
        let wakes = wakes.map_or(LOOK, |us| us.saturating_sub(now_us).saturating_mul(1_000)).min(LOOK);
        match (port.wait(is_open, wakes)?, is_open) {
            (false, _) => continue,
            // It takes nothing, and the program has gone.
            (true, false) => return Ok(end(board, &time)),
            (true, true) => {}
        }
        let taken = match port.read(&mut buffer) {
            Ok(0) => return Ok(end(board, &time)),
            Ok(taken) => taken,
            Err(error) if matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock) => continue,
            Err(error) => return Err(error),
        };
        let now = clock::now();
        board.receive(time(now), buffer.get(..taken).unwrap_or_default());
        busy_until = now.max(busy_until) + nanos_a_byte * taken as u64;
        // A signal may cut one sleep short; the next one makes up for it.
        clock::sleep_until(busy_until);
    }
}

/// What became of the board by now.
fn end(mut board: VirtualBoard, time: &impl Fn(u64) -> u64) -> Received {
    board.poll(time(clock::now()));
    board.finish()
}
