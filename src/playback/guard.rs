//! The guard: a second process that stops the robot if the player cannot.
//!
//! It is this program again, started with a hidden command in its own session. It has the open port as standard input and one
//! end of a socket as standard output, through which the sending loop sends heartbeats. If the socket closes without a goodbye,
//! the player has died. If no heartbeat comes for too long, the player hangs; it is killed before the stop, so that it cannot
//! send afterwards. The bytes of the script do not pass through the guard.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::{Child, Command};
use std::sync::Arc;
use std::time::Duration;

use super::halt::Stops;
use super::messages::Stop;
use super::os::{self, Process, Ready};
use super::outbox::Outbox;
use super::stop::stop_robot;
use super::watchdog::{Decision, PlayerFailure, PlayerMessage, Watchdog};
use crate::board::{Board, Family, Hex, ServoSet};
use crate::clock;
use crate::link::Serial;
use crate::source::Place;
use crate::timeline::Timeline;
use crate::units::{Micros, Nanos};

/// How long a guard may take to start, and to end.
const START: Duration = Duration::from_secs(5);
const END: Duration = Duration::from_millis(250);
/// How long a killed player may take to end before the robot is stopped anyway.
const DEATH: Nanos = Nanos::from_millis(20);
/// How long the guard then waits for that end, to send the stop again.
const LATE_DEATH: Nanos = Nanos::from_millis(2_000);
/// How long after a heartbeat the next one is sent, if there is time after a frame, so that the guard knows the position.
const SOON: Nanos = Nanos::from_millis(10);
/// The longest time between two heartbeats.
const MAX_INTERVAL: Nanos = Nanos::from_millis(100);
/// A silence shorter than twice this never counts as a hang: a late player reports that itself.
const LENIENCE: Nanos = Nanos::from_millis(25);

/// One message to the guard: its kind and the position of the player. It has a fixed size, so that it is never cut.
#[derive(Clone, Copy, Debug)]
struct Record([u8; RECORD]);

const RECORD: usize = 128;
/// Kind, length of the name, whether the robot was stopped, whether the player reads single keys, line, time, servos.
const HEAD: usize = SERVOS_AT + ServoSet::BYTES;
const SERVOS_AT: usize = 16;
const STOP_AT: usize = 2;
const KEYS_AT: usize = 3;
/// The message of the guard when it watches, and when it has closed the port.
const READY: [u8; 1] = *b"+";
const BEAT: u8 = b'b';
const AT_REST: u8 = b'r';
const ENDED: u8 = b'e';
const GOODBYE: u8 = b'g';

impl Record {
    fn new(kind: u8, at: Micros, place: Option<Place<'_>>) -> Self {
        let mut bytes = [0; RECORD];
        let (head, name) = bytes.split_at_mut(HEAD);
        let (file, line) = place.map_or(("", 0), |place| (place.file, place.line));
        // Of a long path, keep the end.
        let from = file.ceil_char_boundary(file.len().saturating_sub(name.len()));
        let file = file.get(from..).unwrap_or_default().as_bytes();
        name.iter_mut().zip(file).for_each(|(to, from)| *to = *from);
        let length = u8::try_from(file.len()).unwrap_or(0);
        let line = u32::try_from(line).unwrap_or(u32::MAX).to_le_bytes();
        let fields = [kind, length, 0, 0].into_iter().chain(line).chain(at.0.to_le_bytes());
        head.iter_mut().zip(fields).for_each(|(to, from)| *to = from);
        Record(bytes)
    }

    /// Whether the player has changed the terminal.
    fn with_keys(mut self, keys: bool) -> Self {
        if let Some(byte) = self.0.get_mut(KEYS_AT) {
            *byte = u8::from(keys);
        }
        self
    }

    /// The servos that may be on their way.
    fn with_servos(mut self, servos: ServoSet) -> Self {
        if let Some(place) = self.0.get_mut(SERVOS_AT..HEAD) {
            place.copy_from_slice(&servos.bytes());
        }
        self
    }

    fn servos(&self) -> ServoSet {
        ServoSet::from_bytes(self.0.get(SERVOS_AT..HEAD).unwrap_or_default())
    }

    fn has_keys(&self) -> bool {
        self.0.get(KEYS_AT) == Some(&1)
    }

    /// The run has ended; whether the robot was stopped.
    fn ended(at: Micros, place: Option<Place<'_>>, stop: Stop) -> Self {
        let mut record = Record::new(ENDED, at, place);
        if let Some(byte) = record.0.get_mut(STOP_AT) {
            *byte = match stop {
                Stop::NotNeeded => b'n',
                Stop::Sent => b's',
                Stop::NotDefined => b'd',
                Stop::Held => b'h',
                Stop::NotHeld => b'l',
                Stop::NotSent => 0,
            };
        }
        record
    }

    fn stop(&self) -> Stop {
        match self.0.get(STOP_AT) {
            Some(b'n') => Stop::NotNeeded,
            Some(b's') => Stop::Sent,
            Some(b'd') => Stop::NotDefined,
            Some(b'h') => Stop::Held,
            Some(b'l') => Stop::NotHeld,
            _ => Stop::NotSent,
        }
    }

    fn heard(&self) -> PlayerMessage {
        match self.0.first() {
            Some(&ENDED) => PlayerMessage::Ended,
            Some(&GOODBYE) => PlayerMessage::Goodbye,
            Some(&AT_REST) => PlayerMessage::AtRest,
            _ => PlayerMessage::Beat,
        }
    }

    fn at(&self) -> Micros {
        self.0
            .get(8..SERVOS_AT)
            .and_then(|bytes| bytes.try_into().ok())
            .map_or(Micros::ZERO, |bytes| Micros(u64::from_le_bytes(bytes)))
    }

    fn place(&self) -> Option<String> {
        let line = self.0.get(4..8).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes);
        let length = usize::from(*self.0.get(1)?);
        let file = std::str::from_utf8(self.0.get(HEAD..HEAD + length)?).ok()?;
        (line > 0).then(|| format!("{file}:{line}"))
    }
}

/// What a guard needs to know about its player.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GuardConfig {
    /// A player that is silent for more than twice this, and at least 50 ms, is killed.
    pub max_late: Nanos,
    /// How many zeros synchronize a receiver after a flush: [`zeros_after_flush`](crate::board::Board::zeros_after_flush).
    pub zeros: usize,
    /// Whether the guard has real-time priority.
    pub realtime: bool,
    /// The frames of a stop.
    pub stop: Vec<Vec<u8>>,
    /// What the robot does if the board has no stop.
    pub without_stop: String,
    /// The family of a board whose stop holds servos, as a script chooses it; empty for others.
    pub holds: String,
    /// The name of the robot, for messages; empty if the script names no robots.
    pub robot: String,
}

impl GuardConfig {
    /// For a player of this timeline, with a `max_late` of 50 ms.
    pub fn of(timeline: &Timeline) -> Self {
        let commands = timeline.events.iter().map(|event| &event.command);
        let zeros = timeline.board.zeros_after_flush(commands);
        let robot = timeline.robot.as_deref().unwrap_or_default().to_owned();
        GuardConfig { zeros, robot, ..GuardConfig::of_board(&timeline.board) }
    }

    /// For any program on a board.
    pub fn of_board(board: &Arc<Board>) -> Self {
        let Stops { frames: stop, hold, .. } = Stops::of(board, &[]);
        let without_stop = board.without_stop.to_string();
        let holds = if hold.is_some() { board.line.to_string() } else { String::new() };
        let (max_late, zeros) = (Nanos::from_millis(50), board.most_zeros());
        GuardConfig { max_late, zeros, realtime: false, stop, without_stop, holds, robot: String::new() }
    }

    /// The lateness that the guard tolerates.
    fn patience(&self) -> Nanos {
        self.max_late.max(LENIENCE)
    }

    /// As process arguments.
    fn arguments(&self) -> [String; 7] {
        let (max_late, zeros) = (self.patience().0.to_string(), self.zeros.to_string());
        let (without_stop, holds, robot) = (self.without_stop.clone(), self.holds.clone(), self.robot.clone());
        [max_late, zeros, self.realtime.to_string(), hex(&self.stop), without_stop, holds, robot]
    }

    /// Reads process arguments; `None` if they are invalid.
    fn read(arguments: &[String]) -> Option<Self> {
        let [max_late, zeros, realtime, stop, without_stop, holds, robot] = arguments else { return None };
        let (max_late, zeros, realtime) = (max_late.parse().ok()?, zeros.parse().ok()?, realtime.parse().ok()?);
        let (without_stop, holds, robot) = (without_stop.clone(), holds.clone(), robot.clone());
        let (max_late, stop) = (Nanos(max_late), frames(stop)?);
        Some(GuardConfig { max_late, zeros, realtime, stop, without_stop, holds, robot })
    }
}

/// What a heartbeat tells the guard.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heartbeat<'p> {
    /// The time of the script.
    pub(crate) at: Micros,
    /// The place in the script.
    pub(crate) place: Option<Place<'p>>,
    /// Whether the player reads single keys.
    pub(crate) keys: bool,
    /// The servos that may be on their way.
    pub(crate) moving: ServoSet,
}

/// A player's guard, as the player sees it.
///
/// If dropped without [`Guard::goodbye`], the guard stops the robot.
#[derive(Debug)]
pub struct Guard {
    pipe: UnixStream,
    child: Child,
    interval: Nanos,
    /// When the next heartbeat may be sent, and when it must be sent.
    soon: Nanos,
    deadline: Nanos,
    watching: Watching,
}

/// Whether the guard watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Watching {
    Watched,
    /// It has ended, or does not read heartbeats.
    Lost,
    /// Lost, and reported to the player.
    Known,
}

impl Guard {
    /// Starts a guard over an open port, and waits until it is ready. `program` must pass the eight arguments that are added
    /// to it to [`guard`]: the process, and the fields of [`GuardConfig`].
    pub fn start(mut program: Command, port: BorrowedFd<'_>, ward: &GuardConfig) -> io::Result<Self> {
        let (pipe, theirs) = UnixStream::pair()?;
        program.arg(std::process::id().to_string()).args(ward.arguments());
        program.stdin(port.try_clone_to_owned()?).stdout(OwnedFd::from(theirs));
        let child = program.spawn()?;
        // Closes our copy of the guard's end of the socket.
        drop(program);
        let interval = Nanos(ward.patience().0 / 2).min(MAX_INTERVAL);
        let deadline = clock::now().saturating_add(interval);
        let mut guard = Guard { pipe, child, interval, soon: Nanos::ZERO, deadline, watching: Watching::Watched };
        match guard.is_ready() {
            Ok(()) => Ok(guard),
            Err(error) => {
                let _ = guard.child.kill();
                let _ = guard.child.wait();
                Err(error)
            }
        }
    }

    fn is_ready(&mut self) -> io::Result<()> {
        self.pipe.set_read_timeout(Some(START))?;
        let mut ready = [0];
        let failed = |why: &str| io::Error::other(format!("the guard did not start ({why})"));
        uninterrupted(|| self.pipe.read(&mut ready)).map_err(|error| failed(&error.to_string()))?;
        if ready != READY {
            return Err(failed("it ended immediately"));
        }
        self.pipe.set_nonblocking(true)
    }

    /// The descriptor to poll for the end of the guard.
    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        (self.watching == Watching::Watched).then(|| self.pipe.as_fd())
    }

    /// When the next heartbeat must be sent.
    pub(super) fn deadline(&self) -> Nanos {
        if self.watching == Watching::Watched { self.deadline } else { Nanos::MAX }
    }

    /// Whether to send a heartbeat now: it may be sent and there is time, or it must be sent.
    pub(crate) fn wants_beat(&self, now: Nanos, has_time: bool) -> bool {
        self.watching == Watching::Watched && now >= if has_time { self.soon } else { self.deadline }
    }

    /// Sends a heartbeat.
    pub(crate) fn beat(&mut self, now: Nanos, heartbeat: Heartbeat<'_>) {
        let Heartbeat { at, place, keys, moving } = heartbeat;
        self.soon = now.saturating_add(SOON.min(Nanos(self.interval.0 / 2)));
        self.deadline = now.saturating_add(self.interval);
        self.send_or_lose(Record::new(BEAT, at, place).with_keys(keys).with_servos(moving));
    }

    /// Reports that the robot is stopped, and that no heartbeats will come until the next one.
    pub(super) fn rest(&mut self, at: Micros, place: Option<Place<'_>>) {
        self.send_or_lose(Record::new(AT_REST, at, place));
    }

    /// Records that the guard is lost.
    pub(crate) fn lose(&mut self) {
        if self.watching == Watching::Watched {
            self.watching = Watching::Lost;
        }
    }

    /// Whether it was lost since the last call.
    pub(crate) fn is_newly_lost(&mut self) -> bool {
        let newly = self.watching == Watching::Lost;
        if newly {
            self.watching = Watching::Known;
        }
        newly
    }

    /// Reports the end of the run, and waits until the guard has closed the port. If this process is killed before it reports the
    /// end itself and says [`Guard::goodbye`], the guard reports it.
    pub fn ended(&mut self, at: Micros, place: Option<Place<'_>>, stop: Stop, missing: ServoSet) {
        let sent = self.send(Record::ended(at, place, stop).with_servos(missing));
        if sent.and_then(|()| self.hear(END)).is_err() {
            self.lose();
            let _ = self.child.kill();
        }
    }

    /// Reports that everything is done, and waits for the end of the guard.
    pub fn goodbye(mut self) {
        if self.send(Record::new(GOODBYE, Micros::ZERO, None)).and_then(|()| self.hear(END)).is_err() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }

    /// Waits for a message of the guard, or for its end.
    fn hear(&mut self, patience: Duration) -> io::Result<()> {
        self.pipe.set_nonblocking(false)?;
        self.pipe.set_read_timeout(Some(patience))?;
        uninterrupted(|| self.pipe.read(&mut [0])).map(|_| ())
    }

    fn send_or_lose(&mut self, record: Record) {
        if self.send(record).is_err() {
            self.lose();
        }
    }

    fn send(&mut self, record: Record) -> io::Result<()> {
        // A message this small is never cut. A guard that does not read them does not watch.
        uninterrupted(|| self.pipe.write(&record.0)).map(|_| ())
    }
}

/// How many times an interrupted call is repeated, so that many signals cannot keep a run from ending.
const MAX_INTERRUPTED: usize = 1_000;

/// Repeats a call that a signal interrupted.
fn uninterrupted<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    for _ in 0..MAX_INTERRUPTED {
        match call() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
    Err(io::ErrorKind::Interrupted.into())
}

/// The report of a guard whose player failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guarded {
    /// How the player failed.
    pub fate: PlayerFailure,
    /// The silence after which it counts as hung.
    pub silence: Nanos,
    /// The last reported time of the script.
    pub at: Micros,
    /// The last reported position in the script, as `FILE:LINE`.
    pub place: Option<String>,
    /// Whether the robot was stopped.
    pub stop: Stop,
    /// The servos that may still be on their way.
    pub missing: ServoSet,
    /// What the robot does if the board has no stop.
    pub without_stop: String,
    /// The name of the robot; empty if the script names no robots.
    pub robot: String,
}

/// Frames as an argument: hex, separated by commas.
fn hex(frames: &[Vec<u8>]) -> String {
    let frame = |frame: &Vec<u8>| Hex(frame).to_string().replace(' ', "");
    frames.iter().map(frame).collect::<Vec<_>>().join(",")
}

/// Reads the frames in an argument; `None` if it is not hex.
fn frames(argument: &str) -> Option<Vec<Vec<u8>>> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let frames = argument.split(',').filter(|frame| !frame.is_empty());
    frames.map(|frame| frame.as_bytes().chunks(2).map(byte).collect()).collect()
}

/// Runs a guard in its own process, with the port as standard input and the socket as standard output. The arguments are those
/// that [`Guard::start`] added. Returns a report if the player did not say goodbye.
///
/// # Errors
/// If it was not started by a player, or the system refuses a call.
pub fn guard(arguments: &[String]) -> io::Result<Option<Guarded>> {
    let stranger = || io::Error::other("only `play` and `record` can start it");
    let (player, ward) = arguments.split_first().ok_or_else(stranger)?;
    let (player, ward) = player.parse().ok().zip(GuardConfig::read(ward)).ok_or_else(stranger)?;
    let mut port = Some(Serial::inherited(io::stdin().as_fd().try_clone_to_owned()?)?);
    let mut pipe = UnixStream::from(io::stdout().as_fd().try_clone_to_owned()?);
    // Refuse to start by hand: only SIGKILL could end the process.
    pipe.peer_addr().map_err(|_| stranger())?;
    let terminal = os::Terminal::remember();
    os::become_guard(ward.realtime);
    // The process number is unambiguous only while the player is the parent of this process.
    let player = Process::parent(player)?;
    let (without_stop, robot) = (ward.without_stop, ward.robot);
    let mut stops = Family::board(&ward.holds).map_or_else(|| Stops::only(ward.stop), |board| Stops::of(&board, &[]));
    let mut out = Outbox::new(ward.zeros, stops.frames.iter().map(Vec::len).max().unwrap_or_default());
    // Before the first heartbeat, the player may have changed the terminal.
    let mut last = Record::new(BEAT, Micros::ZERO, None).with_keys(true);
    pipe.set_nonblocking(true)?;
    pipe.write_all(&READY)?;

    let silence = ward.max_late.saturating_mul(2);
    let mut watch = Watchdog::new(clock::now(), silence);
    let mut heard = PlayerMessage::Silence;
    let fate = loop {
        match watch.poll(clock::now(), heard) {
            Decision::Listen(until) => heard = listen(&mut pipe, until, &mut last),
            Decision::Release => {
                release(port.take());
                // If this fails, the player has died, which is noticed next.
                let _ = pipe.write_all(&READY);
                heard = PlayerMessage::Silence;
            }
            Decision::Over(fate) => break fate,
            Decision::Done => return Ok(None),
        }
    };
    let (stop, missing) = match port {
        None => (last.stop(), last.servos()),
        Some(mut port) => {
            // Even if it seems dead: nothing may be sent after the stop.
            player.kill();
            let has_ended = fate != PlayerFailure::Hung || player.has_ended(DEATH);
            if last.has_keys() {
                terminal.restore();
            }
            stops.begin(last.servos(), |_| None);
            let mut stop = stop_robot(&mut port, &mut stops, &mut out, || {});
            if !has_ended && player.has_ended(LATE_DEATH) {
                stops.begin(last.servos(), |_| None);
                stop = stop_robot(&mut port, &mut stops, &mut out, || {});
            }
            release(Some(port));
            (stop, stops.missing())
        }
    };
    Ok(Some(Guarded { fate, silence, at: last.at(), place: last.place(), stop, missing, without_stop, robot }))
}

/// Closes the port, which is also standard input, so that the next player need not wait for the report.
fn release(port: Option<Serial>) {
    drop(port);
    let _ = File::open("/dev/null").map(rustix::stdio::dup2_stdin);
}

/// Waits for a message, at most until a time on the clock.
fn listen(pipe: &mut UnixStream, until: Option<Nanos>, last: &mut Record) -> PlayerMessage {
    let timeout = until.map(|until| until.saturating_sub(clock::now()));
    // The result does not matter, because the read does not block.
    let _ = os::wait([(Some(pipe.as_fd()), Ready::IN)], timeout);
    let mut buffer = [0; 8 * RECORD];
    match pipe.read(&mut buffer) {
        Ok(0) => PlayerMessage::Closed,
        Ok(count) => {
            let mut heard = PlayerMessage::Beat;
            for record in buffer.get(..count).unwrap_or_default().as_chunks().0 {
                *last = if heard == PlayerMessage::Goodbye { *last } else { Record(*record) };
                heard = last.heard();
            }
            heard
        }
        Err(error) if error.kind() == io::ErrorKind::ConnectionReset => PlayerMessage::Closed,
        // The player may be alive; if not, it will be silent for too long.
        Err(_) => PlayerMessage::Silence,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_record_says_again_what_was_put_in() {
        let record = Record::new(AT_REST, Micros(1_234_567), Some(Place { file: "scripts/dance.motion", line: 14 }));
        assert_eq!(record.heard(), PlayerMessage::AtRest);
        assert_eq!(record.at(), Micros(1_234_567));
        assert_eq!(record.place().unwrap(), "scripts/dance.motion:14");
        assert_eq!(Record::new(GOODBYE, Micros::ZERO, None).place(), None);
    }

    #[test]
    fn of_a_long_name_the_end_is_kept() {
        let name = format!("{}dance.motion", "ü/".repeat(200));
        let record = Record::new(BEAT, Micros::ZERO, Some(Place { file: &name, line: 7 }));
        let place = record.place().unwrap();
        assert!(
            place.ends_with("/dance.motion:7") && place.len() <= RECORD && place.len() > RECORD - HEAD - 2,
            "{place}"
        );
    }
}
