//! The guard: a second process that outlives the player and stops the robot for it.
//!
//! It is this program once more, started with a word that only the player knows, in a session of its own. It holds the open
//! port as its standard input, and one end of a pipe as its standard output. Through the pipe come beats from the loop that
//! sends. Where the pipe closes without a goodbye, the player has died; where no beat came for too long, it hangs, and is
//! killed first, because nothing else could keep it from sending after the stop. The bytes of the script do not pass here.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::{Child, Command};
use std::time::Duration;

use super::halt::{Outbox, Stops};
use super::messages::Stop;
use super::os::{self, Process, Ready};
use super::stop::stop_robot;
use super::watchdog::{Decision, Fate, Heard, Watchdog};
use crate::board::{Board, Hex};
use crate::clock;
use crate::link::Serial;
use crate::source::Place;
use crate::timeline::Timeline;
use crate::units::{Micros, Nanos};

/// How long the start of a guard, and its end, may take.
const START: Duration = Duration::from_secs(5);
const END: Duration = Duration::from_millis(250);
/// How long a player that was killed may take to end before the robot is stopped all the same.
const DEATH: Nanos = Nanos::from_millis(20);
/// How long a guard then waits for that end, to send the stop once more after it.
const LATE_DEATH: Nanos = Nanos::from_millis(2_000);
/// How long after a beat the next one is sent, if there is time for it after a frame, so that the guard knows the place well.
const SOON: Nanos = Nanos::from_millis(10);
/// The longest time between two beats.
const MAX_INTERVAL: Nanos = Nanos::from_millis(100);
/// A guard takes no lateness for a hang that is shorter than twice this: a player that is late says so itself.
const LENIENCE: Nanos = Nanos::from_millis(25);

/// One message to the guard: what it means, where the player is, and in a fixed size, so that none is cut.
#[derive(Clone, Copy, Debug)]
struct Record([u8; RECORD]);

const RECORD: usize = 128;
/// Kind, length of the name, what became of the robot, whether the player has the terminal give it single keys, line, time.
const HEAD: usize = 16;
const STOP_AT: usize = 2;
const KEYS_AT: usize = 3;
/// What a guard says when it watches, and when it has let go of the port.
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
        // The end of a long path tells more than its beginning.
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

    fn has_keys(&self) -> bool {
        self.0.get(KEYS_AT) == Some(&1)
    }

    /// That the run has ended, and what became of the robot.
    fn ended(at: Micros, place: Option<Place<'_>>, stop: Stop) -> Self {
        let mut record = Record::new(ENDED, at, place);
        if let Some(byte) = record.0.get_mut(STOP_AT) {
            *byte = match stop {
                Stop::NotNeeded => b'n',
                Stop::Sent => b's',
                Stop::NotSent => 0,
            };
        }
        record
    }

    fn stop(&self) -> Stop {
        match self.0.get(STOP_AT) {
            Some(b'n') => Stop::NotNeeded,
            Some(b's') => Stop::Sent,
            _ => Stop::NotSent,
        }
    }

    fn heard(&self) -> Heard {
        match self.0.first() {
            Some(&ENDED) => Heard::Ended,
            Some(&GOODBYE) => Heard::Goodbye,
            Some(&AT_REST) => Heard::AtRest,
            _ => Heard::Beat,
        }
    }

    fn at(&self) -> Micros {
        self.0
            .get(8..HEAD)
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

/// What a guard must know of a player.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ward {
    /// A player that is silent for longer than twice this, and for 50 ms at least, is killed.
    pub max_late: Nanos,
    /// How many zeros bring a receiver back in step behind a flush: [`zeros_behind_flush`](crate::board::Board::zeros_behind_flush).
    pub zeros: usize,
    /// Whether the guard runs before all ordinary programs.
    pub realtime: bool,
    /// The frames of a stop.
    pub stop: Vec<Vec<u8>>,
}

impl Ward {
    /// What the guard of a player of this timeline must know. A frame may be 50 ms late.
    pub fn of(timeline: &Timeline) -> Self {
        let commands = timeline.events.iter().map(|event| &event.command);
        Ward { zeros: timeline.board.zeros_behind_flush(commands), ..Ward::of_board(&timeline.board) }
    }

    /// What the guard of any program on a board must know.
    pub fn of_board(board: &Board) -> Self {
        let stop = Stops::of(board, &[]).frames;
        Ward { max_late: Nanos::from_millis(50), zeros: board.most_zeros(), realtime: false, stop }
    }

    /// How late a player may be before its guard worries.
    fn patience(&self) -> Nanos {
        self.max_late.max(LENIENCE)
    }

    /// As arguments of a process.
    fn arguments(&self) -> [String; 4] {
        [self.patience().0.to_string(), self.zeros.to_string(), self.realtime.to_string(), hex(&self.stop)]
    }

    /// Reads its arguments; `None` if they are not such.
    fn read(arguments: &[String]) -> Option<Self> {
        let [max_late, zeros, realtime, stop] = arguments else { return None };
        let (max_late, zeros, realtime) = (max_late.parse().ok()?, zeros.parse().ok()?, realtime.parse().ok()?);
        Some(Ward { max_late: Nanos(max_late), zeros, realtime, stop: frames(stop)? })
    }
}

/// A player's guard, as the player sees it.
///
/// Dropped without [`Guard::goodbye`], it stops the robot: a player that fails need not do anything.
#[derive(Debug)]
pub struct Guard {
    pipe: UnixStream,
    child: Child,
    interval: Nanos,
    /// When the next beat is welcome, and when it must be sent.
    soon: Nanos,
    deadline: Nanos,
    bond: Bond,
}

/// Whether the guard watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bond {
    Watched,
    /// It has ended, or lets beats pile up.
    Lost,
    /// It is lost, and the player knows.
    Known,
}

impl Guard {
    /// Starts a guard over an open port, and waits until it is ready. `program` must hand the five arguments that are added
    /// to it to [`guard`]: the process, and the fields of its [`Ward`].
    pub fn start(mut program: Command, port: BorrowedFd<'_>, ward: &Ward) -> io::Result<Self> {
        let (pipe, theirs) = UnixStream::pair()?;
        program.arg(std::process::id().to_string()).args(ward.arguments());
        program.stdin(port.try_clone_to_owned()?).stdout(OwnedFd::from(theirs));
        let child = program.spawn()?;
        // With it goes our copy of the guard's end of the pipe.
        drop(program);
        let interval = Nanos(ward.patience().0 / 2).min(MAX_INTERVAL);
        let deadline = clock::now().saturating_add(interval);
        let mut guard = Guard { pipe, child, interval, soon: Nanos::ZERO, deadline, bond: Bond::Watched };
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
            return Err(failed("it ended at once"));
        }
        self.pipe.set_nonblocking(true)
    }

    /// What to wait on for its end.
    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        (self.bond == Bond::Watched).then(|| self.pipe.as_fd())
    }

    /// When the next beat must be sent at the latest.
    pub(super) fn deadline(&self) -> Nanos {
        if self.bond == Bond::Watched { self.deadline } else { Nanos::MAX }
    }

    /// Whether a beat is wanted now: it is welcome and there is time for it, or it cannot wait.
    pub(crate) fn wants_beat(&self, now: Nanos, has_time: bool) -> bool {
        self.bond == Bond::Watched && now >= if has_time { self.soon } else { self.deadline }
    }

    /// Tells that the player is alive, where it is, and whether it has the terminal give it single keys.
    pub(crate) fn beat(&mut self, now: Nanos, at: Micros, place: Option<Place<'_>>, keys: bool) {
        self.soon = now.saturating_add(SOON.min(Nanos(self.interval.0 / 2)));
        self.deadline = now.saturating_add(self.interval);
        self.tell(Record::new(BEAT, at, place).with_keys(keys));
    }

    /// Tells that the robot stands, and that no beats will come until the next one.
    pub(super) fn rest(&mut self, at: Micros, place: Option<Place<'_>>) {
        self.tell(Record::new(AT_REST, at, place));
    }

    /// It has ended.
    pub(crate) fn lose(&mut self) {
        if self.bond == Bond::Watched {
            self.bond = Bond::Lost;
        }
    }

    /// Whether it was lost since this was asked last.
    pub(crate) fn is_newly_lost(&mut self) -> bool {
        let newly = self.bond == Bond::Lost;
        if newly {
            self.bond = Bond::Known;
        }
        newly
    }

    /// Tells how and where the run has ended, and waits until the guard has let go of the port. From here on it says what became of the robot if
    /// this process is killed before it has said so itself, and [`Guard::goodbye`] tells it that it has.
    pub fn ended(&mut self, at: Micros, place: Option<Place<'_>>, stop: Stop) {
        let told = self.send(Record::ended(at, place, stop));
        if told.and_then(|()| self.hear(END)).is_err() {
            self.lose();
            let _ = self.child.kill();
        }
    }

    /// Tells that all was said, and waits for the guard's end.
    pub fn goodbye(mut self) {
        if self.send(Record::new(GOODBYE, Micros::ZERO, None)).and_then(|()| self.hear(END)).is_err() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }

    /// Waits for a word of the guard, or for its end.
    fn hear(&mut self, patience: Duration) -> io::Result<()> {
        self.pipe.set_nonblocking(false)?;
        self.pipe.set_read_timeout(Some(patience))?;
        uninterrupted(|| self.pipe.read(&mut [0])).map(|_| ())
    }

    fn tell(&mut self, record: Record) {
        if self.send(record).is_err() {
            self.lose();
        }
    }

    fn send(&mut self, record: Record) -> io::Result<()> {
        // So small a message is taken whole or not at all. A guard that lets them pile up does not watch.
        uninterrupted(|| self.pipe.write(&record.0)).map(|_| ())
    }
}

/// How often a call is made again that a signal has interrupted: no storm of them keeps a run from ending.
const MAX_INTERRUPTED: usize = 1_000;

/// Does it again where a signal has interrupted it.
fn uninterrupted<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    for _ in 0..MAX_INTERRUPTED {
        match call() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
    Err(io::ErrorKind::Interrupted.into())
}

/// What a guard found, and did in the place of its player.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guarded {
    /// What became of the player.
    pub fate: Fate,
    /// How long it may be silent before it counts as hung.
    pub silence: Nanos,
    /// The last time of the script that it told.
    pub at: Micros,
    /// The last place in the script that it told, as `FILE:LINE`.
    pub place: Option<String>,
    /// Whether the robot was stopped.
    pub stop: Stop,
}

/// Frames as an argument: hexadecimal, with commas between them.
fn hex(frames: &[Vec<u8>]) -> String {
    let frame = |frame: &Vec<u8>| Hex(frame).to_string().replace(' ', "");
    frames.iter().map(frame).collect::<Vec<_>>().join(",")
}

/// Reads the frames in an argument; `None` if it is not hexadecimal.
fn frames(argument: &str) -> Option<Vec<Vec<u8>>> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let frames = argument.split(',').filter(|frame| !frame.is_empty());
    frames.map(|frame| frame.as_bytes().chunks(2).map(byte).collect()).collect()
}

/// Runs a guard, in a process of its own: with the port as standard input and the pipe as standard output. The arguments
/// are those that [`Guard::start`] added. Gives what was done where the player did not say goodbye.
///
/// # Errors
/// Where a player did not start it, or the system refuses what it needs.
pub fn guard(arguments: &[String]) -> io::Result<Option<Guarded>> {
    let stranger = || io::Error::other("only a player can start it");
    let (player, ward) = arguments.split_first().ok_or_else(stranger)?;
    let (player, ward) = player.parse().ok().zip(Ward::read(ward)).ok_or_else(stranger)?;
    let mut port = Some(Serial::inherited(io::stdin().as_fd().try_clone_to_owned()?)?);
    let mut pipe = UnixStream::from(io::stdout().as_fd().try_clone_to_owned()?);
    // Somebody who starts it by hand would have a process that only a kill ends.
    pipe.peer_addr().map_err(|_| stranger())?;
    let terminal = os::Terminal::remember();
    os::become_guard(ward.realtime);
    // Its number means it and no other process as long as it is the parent of this one.
    let player = Process::parent(player)?;
    let stops = Stops::only(ward.stop);
    let mut out = Outbox::new(ward.zeros, stops.frames.iter().map(Vec::len).max().unwrap_or_default());
    // As long as it has told nothing, it may have changed the terminal.
    let mut last = Record::new(BEAT, Micros::ZERO, None).with_keys(true);
    pipe.set_nonblocking(true)?;
    pipe.write_all(&READY)?;

    let silence = ward.max_late.saturating_mul(2);
    let mut watch = Watchdog::new(clock::now(), silence);
    let mut heard = Heard::Silence;
    let fate = loop {
        match watch.poll(clock::now(), heard) {
            Decision::Listen(until) => heard = listen(&mut pipe, until, &mut last),
            Decision::Release => {
                release(port.take());
                // Where nobody hears it the player has died, which is heard next.
                let _ = pipe.write_all(&READY);
                heard = Heard::Silence;
            }
            Decision::Over(fate) => break fate,
            Decision::Done => return Ok(None),
        }
    };
    let stop = match port {
        None => last.stop(),
        Some(mut port) => {
            // Also where it seems to have died: nothing may be sent behind the stop.
            player.kill();
            let has_ended = fate != Fate::Hung || player.has_ended(DEATH);
            if last.has_keys() {
                terminal.restore();
            }
            let mut stop = stop_robot(&mut port, &stops, &mut out, || {});
            if !has_ended && player.has_ended(LATE_DEATH) {
                stop = stop_robot(&mut port, &stops, &mut out, || {});
            }
            release(Some(port));
            stop
        }
    };
    Ok(Some(Guarded { fate, silence, at: last.at(), place: last.place(), stop }))
}

/// Lets go of the port, which is standard input, too: whoever plays next must not wait until all was told.
fn release(port: Option<Serial>) {
    drop(port);
    let _ = File::open("/dev/null").map(rustix::stdio::dup2_stdin);
}

/// Waits for a message, at most until a time on the clock.
fn listen(pipe: &mut UnixStream, until: Option<Nanos>, last: &mut Record) -> Heard {
    let timeout = until.map(|until| until.saturating_sub(clock::now()));
    // What it says does not matter: the read does not wait.
    let _ = os::wait([(Some(pipe.as_fd()), Ready::IN)], timeout);
    let mut buffer = [0; 8 * RECORD];
    match pipe.read(&mut buffer) {
        Ok(0) => Heard::Closed,
        Ok(count) => {
            let mut heard = Heard::Beat;
            for record in buffer.get(..count).unwrap_or_default().as_chunks().0 {
                *last = if heard == Heard::Goodbye { *last } else { Record(*record) };
                heard = last.heard();
            }
            heard
        }
        Err(error) if error.kind() == io::ErrorKind::ConnectionReset => Heard::Closed,
        // The player may well be alive. If this goes on, it is silent for too long.
        Err(_) => Heard::Silence,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_record_says_again_what_was_put_in() {
        let record = Record::new(AT_REST, Micros(1_234_567), Some(Place { file: "scripts/dance.motion", line: 14 }));
        assert_eq!(record.heard(), Heard::AtRest);
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
