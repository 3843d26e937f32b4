//! A virtual board at a door, for any program that opens its port, one after another.

use std::io;

use super::VirtualBoard;
use super::served::{LOOK, nanos_a_byte};
use crate::clock;
use crate::link::{Door, Happened};

/// The most bytes taken at once.
const CHUNK: usize = 16;
/// How long nobody looks whether a program has come, in nanoseconds.
const IDLE: u64 = 2_000_000;
/// How much may wait before the line counts as overrun, in microseconds.
const BEHIND_US: u64 = 50_000;

/// Serves a board until `watch` says `false`, or until a fault pulls the cable. `watch` is told what happens and when, in microseconds from
/// the start on.
///
/// A pseudo-terminal has no line rate, so the board takes `baud / 10` bytes a second itself.
#[expect(clippy::too_many_lines, reason = "one loop")]
pub fn host(
    mut board: VirtualBoard,
    door: &Door,
    baud: u32,
    mut watch: impl FnMut(u64, Happened<'_>, &VirtualBoard) -> io::Result<bool>,
) -> io::Result<VirtualBoard> {
    let begin = clock::now();
    let time = |now: u64| now.saturating_sub(begin) / 1_000;
    let (unplug, stall) = (board.faults().unplug_us, board.faults().stall_us);
    let nanos_a_byte = nanos_a_byte(baud);
    let port = door.pty();
    let mut buffer = [0; CHUNK];
    let (mut is_open, mut is_ending, mut is_behind, mut has_waited, mut busy_until) = (false, false, false, false, 0);
    loop {
        let now_us = time(clock::now());
        board.poll(now_us);
        if !watch(now_us, Happened::Passed, &board)? || unplug.is_some_and(|us| us <= now_us) {
            return Ok(board);
        }
        // One that has written and gone already counts, too.
        if !is_open && (port.is_in_use()? || port.waiting()? > 0) {
            (is_open, is_ending) = (true, false);
            watch(now_us, Happened::Opened, &board)?;
        }
        let replies: Vec<u8> = board.replies().collect();
        if !is_open {
            // What is said while nobody listens is lost, as on a real line.
            clock::sleep_until(clock::now() + IDLE);
            continue;
        }
        if !replies.is_empty() {
            port.write(&replies)?;
            watch(now_us, Happened::Answered(&replies), &board)?;
        }
        let listens = stall.is_none_or(|us| us > now_us);
        let wakes = [board.next_due(), unplug, stall.filter(|_| listens)].into_iter().flatten().min();
        let wakes = wakes.map_or(LOOK, |us| us.saturating_sub(now_us).saturating_mul(1_000)).min(LOOK);
        if !port.wait(listens, wakes)? {
            continue;
        }
        let taken = match if listens { port.read(&mut buffer) } else { Ok(0) } {
            // The system may tell of the end before the last bytes are through.
            Ok(0) if listens && !std::mem::replace(&mut is_ending, true) => {
                clock::sleep_until(clock::now() + IDLE);
                continue;
            }
            Ok(0) => {
                (is_open, has_waited) = (false, false);
                door.sweep()?;
                watch(time(clock::now()), Happened::Closed, &board)?;
                continue;
            }
            Ok(taken) => {
                is_ending = false;
                taken
            }
            Err(error) if matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock) => continue,
            Err(error) => return Err(error),
        };
        let now = clock::now();
        let bytes = buffer.get(..taken).unwrap_or_default();
        board.receive(time(now), bytes);
        // What has waited for the line stands right behind what came before it, however late this thread woke up.
        let begin_byte = if has_waited { busy_until } else { now.max(busy_until) };
        watch(time(now), Happened::Came(begin_byte.saturating_sub(begin), bytes), &board)?;
        let waiting = port.waiting()?;
        let waiting_us = waiting.saturating_mul(nanos_a_byte) / 1_000;
        if waiting_us > BEHIND_US && !is_behind {
            watch(time(now), Happened::Behind(waiting, waiting_us), &board)?;
        }
        has_waited = waiting > 0;
        is_behind = has_waited && (is_behind || waiting_us > BEHIND_US);
        busy_until = begin_byte + nanos_a_byte * taken as u64;
        clock::sleep_until(busy_until);
    }
}
