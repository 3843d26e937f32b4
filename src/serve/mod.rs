//! The loop that serves every port that this program offers: a virtual board for `play`, and a virtual board or a tap to a real board for
//! any program.
//!
//! The loop waits only for bytes, time, signals and the guard. It reports events to a closure, which must not wait.

mod board_end;
mod port_end;

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Duration;

use crate::board::{Board, ServoSet};
use crate::clock;
use crate::faults::{Faulty, Stall};
use crate::link::{LineSettings, PortEvent, Pty, PtyLink, Serial};
use crate::playback::os::{self, Ready};
use crate::playback::{Guard, Signals, Stop};
use crate::sim::{Device, Received};
use crate::units::{Micros, Nanos};
use board_end::BoardEnd;
use port_end::PortEnd;

/// The longest time without checking everything.
const LOOK: Nanos = Nanos::from_millis(20);
/// How often the loop checks whether a program has opened the port.
const IDLE: Nanos = Nanos::from_millis(2);
/// How many times a hang-up must be reported before it counts: a busy system may report it before the last bytes.
const LAST_BYTES: u32 = 5;
/// The most bytes that are read at the end, and the most time for that: a program may never stop writing.
const MOST_LEFT: u64 = 1 << 20;
const DRAIN: Nanos = Nanos::from_millis(1_000);

/// Why a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum End {
    /// The program has closed its port, and every byte was taken.
    Closed,
    /// A signal ended it.
    Signal(i32),
    /// A fault unplugged the virtual board.
    Unplugged,
    /// The guard was lost.
    Unguarded,
}

/// Why a server failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The port of the board was lost.
    #[error("the port was lost: {0}")]
    Lost(io::Error),
    /// The port of the program failed, or the observer did.
    #[error(transparent)]
    Failed(#[from] io::Error),
}

/// How serving a real board ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TapEnd {
    /// Whether the robot was stopped at the end; not needed if the last command of the board is known to be rest.
    pub stop: Stop,
    /// The servos that may still be on their way.
    pub missing: ServoSet,
    /// How many bytes of the program were not sent to the board.
    pub undelivered: u64,
}

/// The far end of the port.
enum Far {
    Board(Box<BoardEnd>),
    Port(Box<PortEnd>),
}

/// A server.
pub struct Server<'d> {
    pty_link: &'d mut PtyLink,
    far: Far,
    signals: Option<&'d Signals>,
    /// Time 0 on the clock, in nanoseconds; 0 until the run begins.
    begin: Arc<AtomicU64>,
    /// Whether it ends with the first program.
    once: bool,
    /// Whether a program has the port open, and how many times in a row a hang-up was reported.
    is_open: bool,
    hang_ups: u32,
    /// The wrong line settings of the program that were reported.
    wrong: Option<LineSettings>,
}

/// The observer of a server: it gets the time, the event, and the virtual board, if there is one.
pub type Watch<'w> = dyn FnMut(Micros, PortEvent<'_>, Option<&Device>) -> io::Result<()> + 'w;

impl<'d> Server<'d> {
    /// Serves a virtual board at a [`PtyLink`]. A pseudo-terminal has no bit rate, so the server itself takes `baud / 10` bytes per second.
    pub fn of_board(pty_link: &'d mut PtyLink, board: Faulty, baud: u32, signals: Option<&'d Signals>) -> Self {
        Server::new(pty_link, Far::Board(Box::new(BoardEnd::new(board, baud))), signals)
    }

    /// Serves a real board: bytes pass both ways unchanged. While the port takes none, the program waits, as it would without a tap. What
    /// the board sends while no program has the port open is lost, as it would be.
    pub fn of_port(
        pty_link: &'d mut PtyLink,
        board: Arc<Board>,
        port: Serial,
        guard: Option<Guard>,
        signals: &'d Signals,
    ) -> Self {
        Server::new(pty_link, Far::Port(Box::new(PortEnd::new(board, port, guard))), Some(signals))
    }

    fn new(pty_link: &'d mut PtyLink, far: Far, signals: Option<&'d Signals>) -> Self {
        Server {
            pty_link,
            far,
            signals,
            begin: Arc::new(AtomicU64::new(clock::now().0)),
            once: false,
            is_open: false,
            hang_ups: 0,
            wrong: None,
        }
    }

    /// Serves until a signal or a fault of the board ends it.
    pub fn run(&mut self, watch: &mut Watch<'_>) -> Result<End, ServeError> {
        os::wake_exactly();
        let end = self.serve(watch)?;
        if let End::Signal(_) = end {
            self.drain(watch)?;
        }
        Ok(end)
    }

    /// What the virtual board has received; `None` for a real board.
    pub fn received(self) -> Option<Received> {
        match self.far {
            Far::Board(end) => Some(end.board.finish()),
            Far::Port(_) => None,
        }
    }

    /// Stops a real board, unless its last command is known to be rest, reports that to the guard, and returns the guard for its goodbye.
    pub fn stop(&mut self) -> Option<(TapEnd, Option<Guard>)> {
        let time = self.time(clock::now());
        match &mut self.far {
            Far::Board(_) => None,
            Far::Port(end) => {
                let waiting = self.pty_link.pty().waiting().unwrap_or(0);
                Some(end.stop(time, waiting))
            }
        }
    }

    fn time(&self, now: Nanos) -> Micros {
        match Nanos(self.begin.load(Ordering::Relaxed)) {
            Nanos::ZERO => Micros::ZERO,
            begin => (now - begin).micros(),
        }
    }

    fn serve(&mut self, watch: &mut Watch<'_>) -> Result<End, ServeError> {
        loop {
            let time = self.time(clock::now());
            self.far.poll(time);
            watch(time, PortEvent::Passed, self.far.board())?;
            if let Some(signal) = self.signals.and_then(Signals::pending) {
                return Ok(End::Signal(signal));
            }
            if let Some(end) = self.far.end() {
                return Ok(end);
            }
            self.look_for_program(time, watch)?;
            self.answer(time, watch)?;
            let is_stalled = !self.far.carries();
            if self.wait(time, is_stalled)? && self.take(is_stalled, watch)? {
                return Ok(End::Closed);
            }
        }
    }

    /// A program that has written and already closed the port counts, too.
    fn look_for_program(&mut self, time: Micros, watch: &mut Watch<'_>) -> io::Result<()> {
        let port = self.pty_link.pty();
        if !self.is_open && (port.is_in_use()? || port.waiting()? > 0) {
            (self.is_open, self.hang_ups, self.wrong) = (true, 0, None);
            watch(time, PortEvent::Opened, self.far.board())?;
        }
        Ok(())
    }

    /// Passes what the far end has sent to the program. Without a program it is lost, as on a real line.
    fn answer(&mut self, time: Micros, watch: &mut Watch<'_>) -> io::Result<()> {
        let said = self.far.said();
        if self.is_open && !said.is_empty() {
            self.pty_link.pty().write(&said)?;
            watch(time, PortEvent::Answered(&said), self.far.board())?;
        }
        Ok(())
    }

    /// Waits until something may have happened. Returns whether the program has written bytes that can be taken, or has closed the port.
    fn wait(&mut self, time: Micros, is_stalled: bool) -> Result<bool, ServeError> {
        let now = clock::now();
        let takes_at = self.far.takes_at();
        let due = self.far.next_due().map(|due| now + (due - time).nanos());
        let until = [Some(now + if self.is_open { LOOK } else { IDLE }), due, takes_at.filter(|at| *at > now)];
        let until = until.into_iter().flatten().min().unwrap_or(now);
        // While nothing can be taken, the program is not polled: a closed port would be reported repeatedly.
        let takes = self.is_open && takes_at.is_some_and(|at| at <= now);
        let asks = if is_stalled { Ready::empty() } else { Ready::IN };
        let watched = [
            (takes.then(|| std::os::fd::AsFd::as_fd(self.pty_link.pty())), asks),
            (self.signals.map(std::os::fd::AsFd::as_fd), Ready::IN),
            self.far.watched(),
            (self.far.guard().and_then(Guard::descriptor), Ready::IN),
        ];
        if watched.iter().all(|(descriptor, _)| descriptor.is_none()) {
            clock::sleep_until(until);
            return Ok(false);
        }
        let [program, _, far, guard] = os::wait(watched, Some(until.saturating_sub(now)))?;
        self.far.ready(far, guard).map_err(ServeError::Lost)?;
        Ok(!program.is_empty())
    }

    /// Takes what the program has written. Returns whether a server that ends with its program has ended.
    fn take(&mut self, is_stalled: bool, watch: &mut Watch<'_>) -> Result<bool, ServeError> {
        let mut buffer = [0; 4096];
        let room = self.far.room().min(buffer.len());
        let (buffer, _) = buffer.split_at_mut(room);
        match if is_stalled { Ok(0) } else { self.pty_link.pty().read(buffer) } {
            // The system may report the hang-up before the last bytes.
            Ok(0) if !is_stalled && self.hang_ups < LAST_BYTES => {
                self.hang_ups += 1;
                clock::sleep_until(clock::now().saturating_add(IDLE));
            }
            Ok(0) => {
                self.is_open = false;
                if self.once {
                    return Ok(true);
                }
                self.pty_link.sweep()?;
                watch(self.time(clock::now()), PortEvent::Closed, self.far.board())?;
            }
            Ok(count) => {
                self.hang_ups = 0;
                self.pass(clock::now(), buffer.get(..count).unwrap_or_default(), watch)?;
            }
            Err(error) if is_nothing(&error) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(false)
    }

    /// Passes bytes to the far end, and then reports them.
    fn pass(&mut self, now: Nanos, bytes: &[u8], watch: &mut Watch<'_>) -> Result<(), ServeError> {
        let time = self.time(now);
        let wrong = self.pty_link.wrong_settings()?;
        if let Some(settings) = wrong.filter(|_| wrong != self.wrong) {
            watch(time, PortEvent::SetUp(settings), self.far.board())?;
        }
        self.wrong = wrong;
        let waiting = self.pty_link.pty().waiting()?;
        let begin = Nanos(self.begin.load(Ordering::Relaxed));
        let (at, behind) = self.far.give(now, time, bytes, waiting).map_err(ServeError::Lost)?;
        watch(time, PortEvent::Came(at.saturating_sub(begin), bytes), self.far.board())?;
        if let Some(delay) = behind {
            watch(time, PortEvent::Behind(waiting, delay), self.far.board())?;
        }
        Ok(())
    }

    /// Takes what the program had written before the end: for a virtual board it counts as sent. A real board gets no more.
    fn drain(&mut self, watch: &mut Watch<'_>) -> Result<(), ServeError> {
        let Far::Board(end) = &mut self.far else { return Ok(()) };
        end.hurry();
        let until = clock::now().saturating_add(DRAIN);
        let mut left = MOST_LEFT;
        let mut buffer = [0; 256];
        while left > 0 && clock::now() < until && self.far.carries() {
            match self.pty_link.pty().read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => {
                    left = left.saturating_sub(count as u64);
                    let on_the_line = self.far.takes_at().unwrap_or(Nanos::ZERO).max(clock::now());
                    self.pass(on_the_line, buffer.get(..count).unwrap_or_default(), watch)?;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => return Err(error.into()),
            }
        }
        let unread = self.pty_link.pty().waiting()?;
        if unread > 0 {
            watch(self.time(clock::now()), PortEvent::Unread(unread), self.far.board())?;
        }
        Ok(())
    }
}

impl Far {
    fn board(&self) -> Option<&Device> {
        match self {
            Far::Board(end) => Some(end.board.device()),
            Far::Port(_) => None,
        }
    }

    fn poll(&mut self, time: Micros) {
        match self {
            Far::Board(end) => end.board.poll(time),
            Far::Port(end) => end.beat(time),
        }
    }

    /// Whether it has ended.
    fn end(&mut self) -> Option<End> {
        match self {
            Far::Board(end) => end.board.hangs_up().then_some(End::Unplugged),
            Far::Port(end) => end.is_unguarded().then_some(End::Unguarded),
        }
    }

    /// Whether bytes of the program reach it.
    fn carries(&self) -> bool {
        match self {
            Far::Board(end) => end.board.carries(),
            Far::Port(_) => true,
        }
    }

    /// When it next has something to do.
    fn next_due(&self) -> Option<Micros> {
        match self {
            Far::Board(end) => end.board.next_due(),
            Far::Port(_) => None,
        }
    }

    /// When it can take more bytes, on the clock; `None` if that depends on its port.
    fn takes_at(&self) -> Option<Nanos> {
        match self {
            Far::Board(end) => Some(end.busy_until),
            Far::Port(end) => end.takes().then_some(Nanos::ZERO),
        }
    }

    /// The number of bytes that it takes at once.
    fn room(&self) -> usize {
        match self {
            Far::Board(_) => board_end::CHUNK,
            Far::Port(_) => port_end::CHUNK,
        }
    }

    /// Passes it bytes. Returns when the first of them was on the line, on the clock, and, for a new overrun, how long the waiting bytes
    /// will keep the line busy.
    fn give(&mut self, now: Nanos, time: Micros, bytes: &[u8], waiting: u64) -> io::Result<(Nanos, Option<Micros>)> {
        match self {
            Far::Board(end) => Ok(end.give(now, time, bytes, waiting)),
            Far::Port(end) => end.give(bytes).map(|()| (now, None)),
        }
    }

    /// What it has sent.
    fn said(&mut self) -> Vec<u8> {
        match self {
            Far::Board(end) => end.board.replies(),
            Far::Port(end) => end.said(),
        }
    }

    fn watched(&self) -> (Option<std::os::fd::BorrowedFd<'_>>, Ready) {
        match self {
            Far::Board(_) => (None, Ready::empty()),
            Far::Port(end) => end.watched(),
        }
    }

    fn guard(&self) -> Option<&Guard> {
        match self {
            Far::Board(_) => None,
            Far::Port(end) => end.guard(),
        }
    }

    /// Handles what its port and its guard are ready for.
    fn ready(&mut self, port: Ready, guard: Ready) -> io::Result<()> {
        let Far::Port(end) = self else { return Ok(()) };
        if !guard.is_empty() {
            end.lose_guard();
        }
        end.ready(port)
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// A virtual board on its own thread, for one run of a script.
#[derive(Debug)]
pub struct BoardThread {
    end: Receiver<Result<Received, ServeError>>,
    begin: Arc<AtomicU64>,
    stall: Stall,
}

impl BoardThread {
    /// Runs a board on a thread until the program at the other end has closed its port and every byte was taken, or until a fault
    /// unplugs the board. The port must have been opened before. Every 20 ms at least, `watch` gets the time since the script began and
    /// the board; it must not wait.
    pub fn start(
        board: Faulty,
        port: Pty,
        baud: u32,
        mut watch: impl FnMut(Micros, &Device) + Send + 'static,
    ) -> io::Result<Self> {
        let mut pty_link = PtyLink::unnamed(port)?;
        let (begin, stall) = (Arc::new(AtomicU64::new(0)), board.stall());
        let its_begin = Arc::clone(&begin);
        let (tell, end) = mpsc::channel();
        thread::Builder::new().name("virtual board".into()).spawn(move || {
            let mut server = Server::of_board(&mut pty_link, board, baud, None);
            (server.begin, server.once, server.is_open) = (its_begin, true, true);
            let end = server.run(&mut |time, event, board| {
                if let (PortEvent::Passed, Some(board)) = (event, board) {
                    watch(time, board);
                }
                Ok(())
            });
            let received = server.received().ok_or_else(|| ServeError::Failed(io::ErrorKind::NotFound.into()));
            // Closes the port before the result is sent.
            drop(pty_link);
            let _ = tell.send(end.and(received));
        })?;
        Ok(BoardThread { end, begin, stall })
    }

    /// Sets when the script begins: time 0 of the board and of its faults.
    pub fn begin(&self, now: Nanos) {
        self.begin.store(now.max(Nanos(1)).0, Ordering::Relaxed);
    }

    /// The state of a stall, for the link of the player.
    pub fn stalls(&self) -> Stall {
        self.stall.clone()
    }

    /// Waits for its end, at most this long; `None` if it does not end in time, or if the thread panicked.
    pub fn join(self, patience: Duration) -> Option<Result<Received, ServeError>> {
        self.end.recv_timeout(patience).ok()
    }
}
