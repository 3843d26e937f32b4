//! The port of a real board at the far end, with a guard.

use std::io;
use std::os::fd::BorrowedFd;
use std::sync::Arc;

use super::{TapEnd, is_nothing};
use crate::board::{Board, Decoder, Item, ServoSet, State};
use crate::clock;
use crate::link::{Link, Serial};
use crate::playback::os::{self, Ready};
use crate::playback::{Guard, Heartbeat, Outbox, Stop, Stops, stop_robot};
use crate::units::Micros;

/// The most bytes taken at once.
pub(super) const CHUNK: usize = 4 * 1024;

pub(super) struct PortEnd {
    board: Arc<Board>,
    port: Serial,
    guard: Option<Guard>,
    is_unguarded: bool,
    /// Bytes of the program that the port has not taken yet.
    left: Vec<u8>,
    /// What it took: the state of the board, as far as it is known.
    decoder: Decoder,
    state: State,
    /// What the board has sent.
    said: Vec<u8>,
    out: Outbox,
}

impl PortEnd {
    pub(super) fn new(board: Arc<Board>, port: Serial, guard: Option<Guard>) -> Self {
        PortEnd {
            port,
            guard,
            is_unguarded: false,
            left: Vec::with_capacity(CHUNK),
            decoder: Decoder::new(&board),
            state: State::default(),
            said: Vec::with_capacity(CHUNK),
            // The program may send frames of any length.
            out: Outbox::new(board.most_zeros(), board.codec.longest()),
            board,
        }
    }

    /// Sends the guard a sign of life.
    pub(super) fn beat(&mut self, time: Micros) {
        let (now, moving) = (clock::now(), self.state.held(&self.board));
        if let Some(guard) = self.guard.as_mut().filter(|guard| guard.wants_beat(now, true)) {
            guard.beat(now, Heartbeat { at: time, moving, ..Heartbeat::default() });
        }
        self.is_unguarded |= self.guard.as_mut().is_some_and(Guard::is_newly_lost);
    }

    pub(super) fn guard(&self) -> Option<&Guard> {
        self.guard.as_ref()
    }

    pub(super) fn lose_guard(&mut self) {
        if let Some(guard) = &mut self.guard {
            guard.lose();
        }
    }

    pub(super) fn is_unguarded(&self) -> bool {
        self.is_unguarded
    }

    /// Whether it can take more bytes of the program.
    pub(super) fn takes(&self) -> bool {
        self.left.is_empty()
    }

    pub(super) fn watched(&self) -> (Option<BorrowedFd<'_>>, Ready) {
        let ready = if self.left.is_empty() { Ready::IN } else { Ready::IN | Ready::OUT };
        (Some(self.port.descriptor()), ready)
    }

    /// Handles what its port is ready for.
    pub(super) fn ready(&mut self, ready: Ready) -> io::Result<()> {
        if ready.contains(Ready::OUT) {
            self.write()?;
        }
        if ready.contains(Ready::IN) || os::is_gone(ready) {
            self.read()?;
        }
        Ok(())
    }

    pub(super) fn give(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.left.extend_from_slice(bytes);
        self.write()
    }

    /// What the board has sent.
    pub(super) fn said(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.said)
    }

    fn write(&mut self) -> io::Result<()> {
        let taken = match self.port.write(&self.left) {
            Ok(taken) => taken,
            Err(error) if is_nothing(&error) => return Ok(()),
            Err(error) => return Err(error),
        };
        let PortEnd { board, decoder, state, left, .. } = self;
        decoder.feed(left.get(..taken).unwrap_or_default(), |item| {
            if let Item::Frame(frame) = item {
                board.decode_or_raw(frame.bytes()).iter().for_each(|command| state.apply(board, command));
            }
        });
        left.drain(..taken);
        Ok(())
    }

    /// Reads what the board has sent, perhaps nothing; a hang-up is an error.
    fn read(&mut self) -> io::Result<()> {
        let mut buffer = [0; CHUNK];
        match self.port.read(&mut buffer) {
            Ok(0) => Err(io::Error::other("it has hung up")),
            Ok(count) => {
                self.said.extend_from_slice(buffer.get(..count).unwrap_or_default());
                Ok(())
            }
            Err(error) if is_nothing(&error) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// Leaves the rest of the frame that the port has begun to take: bytes after a truncated frame would be an error of the board.
    fn complete_frame(&mut self) {
        let rest: Vec<u8> = self.left.drain(..).collect();
        let mut end = 0;
        while !self.decoder.is_between_frames() && end < rest.len() {
            self.decoder.feed(rest.get(end..=end).unwrap_or_default(), |_| {});
            end += 1;
        }
        self.out.push(|bytes| bytes.extend(rest.get(..end).unwrap_or_default()));
    }

    /// Stops the robot, unless what its port took is known to end at rest. The program can send nothing more.
    pub(super) fn stop(&mut self, time: Micros, waiting: u64) -> (TapEnd, Option<Guard>) {
        let undelivered = waiting.saturating_add(self.left.len() as u64);
        let rests = self.state.surely_at_rest(&self.board) && self.decoder.is_between_frames() && self.left.is_empty();
        if !self.board.flushes {
            self.complete_frame();
        }
        let moving = self.state.held(&self.board);
        let PortEnd { board, port, out, guard, .. } = self;
        let beat = || {
            let now = clock::now();
            if let Some(guard) = guard.as_mut().filter(|guard| guard.wants_beat(now, true)) {
                guard.beat(now, Heartbeat { at: time, moving, ..Heartbeat::default() });
            }
        };
        let mut missing = ServoSet::default();
        let stop = if rests && !board.stop.is_empty() {
            Stop::NotNeeded
        } else {
            let mut stops = Stops::of(board, &[]);
            stops.begin(moving, |_| None);
            let stop = stop_robot(port, &mut stops, out, beat);
            missing = stops.missing();
            stop
        };
        if stop == Stop::NotSent {
            // Bytes that the port never took must not delay its closing.
            let _ = self.port.discard();
        }
        let mut guard = self.guard.take();
        if let Some(guard) = &mut guard {
            guard.ended(time, None, stop, missing);
        }
        (TapEnd { stop, missing, undelivered }, guard)
    }
}
