//! Sessions inside the test process. Signals and the allocator belong to the whole process, so
//! these tests are separate from all others, and run one after another.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::process::Command;
use std::sync::Arc;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use motionseq::faults::{Faults, Faulty};
use motionseq::link::{Link, Pty, Serial};
use motionseq::playback::{Cause, Guard, GuardConfig, Notice, Player, Session, Signals, Stop, Why, now};
use motionseq::program::Options;
use motionseq::serve::BoardThread;
use motionseq::sim::{Device, Settings};
use motionseq::source::{Lines, Source, Sources};
use motionseq::units::{Micros, Nanos};
use rustix::process::{Signal, getpid, kill_process};
use support::far::{assert_stopped, commands};

/// Locked by the test that runs.
static PROCESS: Mutex<()> = Mutex::new(());

/// A script that uses everything. The far end answers with reports, and ends the run with a signal.
const SCRIPT: &str = "refresh 10ms
say \"go {voltage}\"
rocker x=5
wait until yaw > 80deg within 5s
rocker x=10; servo 1 1000 -> 2000 over 1h; buzzer on
at 250ms expect voltage > 1V
at 260ms expect voltage > 1V within 50ms
at 1h stop; buzzer off
on abort { servo 1 1000 -> 1500 over 100ms; buzzer on for 50ms }
";

#[test]
fn the_thread_that_sends_allocates_nothing() {
    // Not even during the stop: an allocator's lock could delay it.
    let _process = PROCESS.lock().unwrap_or_else(PoisonError::into_inner);
    let sources = Sources::from(Source::new("test", SCRIPT));
    let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
    let pty = Pty::open().unwrap();
    let port = Serial::open(pty.path(), timeline.baud).unwrap();
    let far = thread::spawn(move || {
        let (mut received, mut buffer) = (Vec::new(), [0; 4096]);
        let mut reads = 0;
        while let Ok(count @ 1..) = pty.read(&mut buffer) {
            received.extend(buffer.iter().take(count));
            reads += 1;
            rustix::io::write(&pty, b"{A-120:35:9000:1187}#noise{A1:2:3}#").unwrap();
            if reads == 60 {
                kill_process(getpid(), Signal::TERM).unwrap();
            }
        }
        received
    });
    let mut program = Command::new(env!("CARGO_BIN_EXE_motionseq"));
    program.arg("guard-a-player");
    let mut ward = GuardConfig::of(&timeline);
    ward.max_late = Nanos::from_millis(5_000);
    let guard = Guard::start(program, port.descriptor(), &ward).unwrap();
    let (mut notices, mut heard) = rtrb::RingBuffer::new(64 * 1024);
    let player = Player::new(&timeline, Nanos::from_millis(5_000));
    let mut session = Session::new(player, port, Signals::catch().unwrap(), Lines::of(&sources));
    session.guard = Some(guard);
    let mut outcome = None;
    let counted = allocation_counter::measure(|| {
        outcome = Some(session.play(now(), |notice| {
            let _ = notices.push(notice);
        }));
    });
    session.guard.take().unwrap().goodbye();
    drop(session);
    let outcome = outcome.unwrap();
    assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(15), Stop::Sent));
    assert!(outcome.sent > 20 && heard.slots() > 20);
    let mut written = Vec::new();
    let (mut judged, mut passed) = (0, 0);
    for notice in heard.read_chunk(heard.slots()).unwrap() {
        match notice {
            Notice::Wrote(piece) => written.extend_from_slice(piece.bytes()),
            Notice::Judged(_) => judged += 1,
            Notice::Passed(passage) => passed += usize::from(passage.end.is_open()),
            _ => {}
        }
    }
    assert_eq!((judged, passed), (2, 1));
    let received = far.join().unwrap();
    assert_eq!(written, received);
    assert!(commands(&received).iter().any(|command| support::board::OnBoard::said(command) == "servo 1 1500"));
    assert_eq!(counted.count_total, 0, "{counted:?}");
    // The counter works.
    assert_eq!(allocation_counter::measure(|| drop(std::hint::black_box(Box::new(1)))).count_total, 1);
}

/// A script that reads servos before it begins, while it runs and when it ends.
const ARM: &str = "board sts
soft 200ms
servo 1 1500; servo 2 2500
wait 50ms
torque 2 off
wait 20ms
torque 2 on
expect position 1 > 3000 within 10s
servo 1 2500 over 300ms
servo 1 1000
wait 10s
on abort { torque all off }
";

#[test]
fn nor_does_it_for_the_servos_of_a_bus() {
    let _process = PROCESS.lock().unwrap_or_else(PoisonError::into_inner);
    let sources = Sources::from(Source::new("test", ARM.replace("expect", "at 100ms expect")));
    let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
    let pty = Pty::open().unwrap();
    let port = Serial::open(pty.path(), timeline.baud).unwrap();
    let device = Device::new(Arc::clone(&timeline.board), Settings::default());
    let mut has_ended = false;
    let watch = move |time: Micros, _: &Device| {
        if time > Micros::from_millis(1_500) && !std::mem::replace(&mut has_ended, true) {
            kill_process(getpid(), Signal::TERM).unwrap();
        }
    };
    let far = BoardThread::start(Faulty::new(device, Faults::default()), pty, timeline.baud, watch).unwrap();
    let player = Player::new(&timeline, Nanos::from_millis(5_000));
    let (mut notices, mut heard) = rtrb::RingBuffer::new(64 * 1024);
    let mut session = Session::new(player, port, Signals::catch().unwrap(), Lines::of(&sources));
    let mut outcome = None;
    far.begin(now());
    let counted = allocation_counter::measure(|| {
        outcome = Some(session.play(now(), |notice| {
            let _ = notices.push(notice);
        }));
    });
    drop(session);
    let outcome = outcome.unwrap();
    assert_eq!((outcome.cause, outcome.stop, outcome.aborted), (Cause::Signal(15), Stop::Held, true));
    let heard: Vec<Notice> = heard.read_chunk(heard.slots()).unwrap().into_iter().collect();
    let count = |is: fn(&Notice) -> bool| heard.iter().filter(|notice| is(notice)).count();
    assert!(count(|notice| matches!(notice, Notice::Report(_))) > 5, "it reads while it moves");
    assert!(count(|notice| matches!(notice, Notice::Unscripted { why: Why::Soft, .. })) > 5);
    assert!(count(|notice| matches!(notice, Notice::Unscripted { why: Why::Torque, .. })) >= 2);
    let received = far.join(Duration::from_secs(5)).unwrap().unwrap();
    assert_eq!(received.first_fault, None);
    assert_eq!(counted.count_total, 0, "{counted:?}");
}

/// A port whose third write panics.
struct Fragile(UnixStream, usize);
impl Link for Fragile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.1 += 1;
        assert!(self.1 != 3, "on purpose");
        self.0.write(bytes)
    }
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        Err(io::ErrorKind::WouldBlock.into())
    }
    fn discard(&mut self) -> io::Result<()> {
        Ok(())
    }
    fn descriptor(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[test]
fn a_program_that_fails_still_stops_the_robot() {
    let _process = PROCESS.lock().unwrap_or_else(PoisonError::into_inner);
    let source = Source::new("test", "rocker x=10\nwait 1h\nstop");
    let sources = Sources::from(source);
    let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
    let (near, mut far) = UnixStream::pair().unwrap();
    let player = Player::new(&timeline, Nanos::from_millis(1_000));
    let mut session = Session::new(player, Fragile(near, 0), Signals::catch().unwrap(), Lines::of(&sources));
    let outcome = session.play(now(), |_| {});
    drop(session);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Panicked, Stop::Sent));
    let mut received = Vec::new();
    far.read_to_end(&mut received).unwrap();
    assert_stopped(&received);
}
