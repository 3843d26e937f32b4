//! The thread that sends allocates nothing, not even in the stop: an allocator's lock could make it late.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::process::Command;
use std::thread;

use motionseq::link::{Link, Pty, Recorder, Serial};
use motionseq::playback::{Cause, Guard, Notice, Player, Rig, Signals, Stop, drive, now};
use motionseq::program::Options;
use motionseq::source::{Lines, Source, Sources};
use rustix::process::{Signal, getpid, kill_process};
use support::far::commands;

/// Something of everything; the far end answers with reports, and ends the run by a signal when it has seen enough.
const SCRIPT: &str = "refresh 10ms
say \"go\"
rocker x=10; servo 1 1000 -> 2000 over 1h; buzzer on
at 250ms expect voltage > 1V
at 260ms expect voltage > 1V within 50ms
at 1h stop; buzzer off
on abort { servo 1 1000 -> 1500 over 100ms; buzzer on for 50ms }
";

#[test]
fn the_thread_that_sends_allocates_nothing() {
    let sources = Sources::from(Source::new("test", SCRIPT));
    let timeline = motionseq::compile(&sources, &Options::default()).timeline.unwrap();
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
    let guard = Guard::start(program, port.descriptor(), 5_000_000_000, false).unwrap();
    let (bytes, _recorded) = rtrb::RingBuffer::new(64 * 1024);
    let (mut notices, mut heard) = rtrb::RingBuffer::new(64 * 1024);
    let mut rig = Rig {
        link: Recorder::new(port, bytes),
        signals: Signals::catch().unwrap(),
        guard: Some(guard),
        keys: None,
        lines: Lines::of(&sources),
        realtime: false,
    };
    let mut player = Player::new(&timeline, 5_000_000_000);
    let mut outcome = None;
    let counted = allocation_counter::measure(|| {
        outcome = Some(drive(&mut player, &mut rig, now(), |notice| {
            let _ = notices.push(notice);
        }));
    });
    rig.guard.take().unwrap().goodbye();
    drop(rig);
    let outcome = outcome.unwrap();
    assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(15), Stop::Sent));
    assert!(outcome.sent > 20 && heard.slots() > 20);
    let judged =
        heard.read_chunk(heard.slots()).unwrap().into_iter().filter(|notice| matches!(notice, Notice::Judged(_)));
    assert_eq!(judged.count(), 2);
    assert!(commands(&far.join().unwrap()).iter().any(|command| command.to_string() == "servo 1 1500"));
    assert_eq!(counted.count_total, 0, "{counted:?}");
    // The counter counts.
    assert_eq!(allocation_counter::measure(|| drop(Box::new(1))).count_total, 1);
}
