//! `record --port` between a program and a robot: whatever fails, the robot stops, or a message
//! says that it did not.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::thread;
use std::time::Duration;

use motionseq::link::Pty;
use rustix::process::{Pid, Signal, kill_process};
use rustix::termios::Action;
use serialport::SerialPort;

use crate::support::board::{OnBoard, say};
use crate::support::far::{BUZZER_OFF, FarEnd, STOP, assert_at_rest, assert_stopped, bytes, commands, end};
use crate::support::host::{Host, link, request, rocker};
use crate::support::{motionseq, stderr};

/// The number of attempts for events at random times. `STRESS=200` is the long form.
fn times() -> usize {
    std::env::var("STRESS").map_or(16, |times| times.parse().unwrap())
}

/// A tap between a program's port and a far end.
struct Tap {
    child: Child,
    path: PathBuf,
    script: PathBuf,
}

/// A blocked terminal, as after Ctrl-S; open as long as this lives.
struct Stopped {
    _far: Pty,
    near: File,
}

impl Stopped {
    fn new() -> Self {
        let pty = Pty::open().unwrap();
        let near = File::options().read(true).write(true).open(pty.path()).unwrap();
        rustix::termios::tcflow(&near, Action::OOff).unwrap();
        Stopped { _far: pty, near }
    }

    fn stdio(&self) -> Stdio {
        Stdio::from(OwnedFd::from(self.near.try_clone().unwrap()))
    }
}

impl Tap {
    /// Starts a tap; `blocked` is the destination of its output instead of this test.
    fn start(name: &str, far: &str, blocked: Option<&Stopped>) -> Self {
        let (path, script) = (link(name), link(&format!("{name}.motion")));
        let args = ["record", "--link", path.to_str().unwrap(), "--port", far, "-o", script.to_str().unwrap()];
        let mut command = motionseq(&args);
        command.args(["--format", "listing", "-v"]);
        let (out, err) = blocked.map_or((Stdio::piped(), Stdio::piped()), |stopped| (stopped.stdio(), stopped.stdio()));
        let child = command.stdout(out).stderr(err).spawn().unwrap();
        while fs::symlink_metadata(&path).is_err() {
            thread::yield_now();
        }
        Tap { child, path, script }
    }

    fn open(&self) -> Box<dyn SerialPort> {
        serialport::new(self.path.to_str().unwrap(), 115_200).timeout(Duration::from_secs(20)).open().unwrap()
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Waits until the far end has this many drive frames.
    fn drives(far: &FarEnd, received: &mut Vec<u8>, count: usize) {
        while commands(received).iter().filter(|command| command.is_drive()).count() < count {
            received.extend(far.first());
        }
    }

    /// Waits for its end, and removes its files.
    fn end(self) -> (i32, String) {
        let (path, script) = (self.path, self.script);
        let ended = end(self.child);
        assert!(fs::symlink_metadata(&path).is_err(), "the link is gone: {}", ended.1);
        let _ = fs::remove_file(script);
        ended
    }
}

#[test]
fn blocked_output_delays_no_stop() {
    let stopped = Stopped::new();
    let far = FarEnd::new();
    let tap = Tap::start("blocked", &far.path, Some(&stopped));
    let mut port = tap.open();
    // More lines than a terminal holds.
    let (mut received, sent) = (Vec::new(), rocker(20).repeat(500));
    port.write_all(&sent).unwrap();
    port.write_all(&STOP).unwrap();
    Tap::drives(&far, &mut received, 501);
    assert!(received.starts_with(&sent) && received.ends_with(&STOP));
    tap.signal(Signal::TERM);
    let (code, _) = tap.end();
    assert_eq!(code, 0);
    // The program had stopped it.
    received.extend(bytes(&far.rest()));
    assert!(received.ends_with(&STOP), "{received:02X?}");
}

#[test]
fn a_board_with_blocked_output_answers_and_ends() {
    let stopped = Stopped::new();
    let path = link("blocked-board");
    let mut command = motionseq(&["board", "-v", "--link", path.to_str().unwrap(), "--baud", "1000000"]);
    let mut child = command.stdout(stopped.stdio()).stderr(stopped.stdio()).spawn().unwrap();
    while fs::symlink_metadata(&path).is_err() {
        thread::yield_now();
    }
    let mut port = serialport::new(path.to_str().unwrap(), 115_200).timeout(Duration::from_secs(20)).open().unwrap();
    port.write_all(&rocker(20).repeat(2_000)).unwrap();
    port.write_all(&request(5)).unwrap();
    let mut answer = [0; 2];
    port.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"{A");
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(fs::symlink_metadata(&path).is_err(), "the link is gone");
}

/// Kills or suspends a tap at random times of a program that drives.
fn fails(signal: Signal, name: &str) {
    for case in 0..times() {
        let stopped = (case % 2 == 1).then(Stopped::new);
        let far = FarEnd::new();
        let tap = Tap::start(&format!("{name}-{case}"), &far.path, stopped.as_ref());
        let mut port = tap.open();
        let mut received = Vec::new();
        for speed in 1..=(1 + i32::try_from(case % 11).unwrap()) {
            port.write_all(&rocker(speed)).unwrap();
        }
        Tap::drives(&far, &mut received, 1 + case % 11);
        tap.signal(signal);
        let output = tap.child.wait_with_output().unwrap();
        received.extend(bytes(&far.rest()));
        assert_eq!(output.status.signal(), Some(9));
        assert_stopped(&received);
        if stopped.is_none() {
            assert!(stderr(&output).contains("s into the run; stop: sent"), "{}", stderr(&output));
        }
        let _ = (fs::remove_file(tap.path), fs::remove_file(tap.script));
    }
}

#[test]
fn a_killed_tap_leaves_a_stopped_robot() {
    fails(Signal::KILL, "killed-tap");
}

#[test]
fn a_tap_that_hangs_is_killed_and_its_robot_stopped() {
    fails(Signal::STOP, "hung-tap");
}

#[test]
fn bytes_that_the_port_never_took_were_not_delivered() {
    for (is_held, exit, words) in [(false, 0, "stop: sent"), (true, 6, "stop: NOT SENT - cut the power")] {
        let pty = Pty::open().unwrap();
        // An ordinary user cannot open it later.
        let held = File::options().read(true).write(true).open(pty.path()).unwrap();
        let tap = Tap::start(&format!("pending-{is_held}"), pty.path().to_str().unwrap(), None);
        let mut port = tap.open();
        port.write_all(&rocker(20)).unwrap();
        let mut received = vec![0; 13];
        pty.read(&mut received).unwrap();
        if is_held {
            // Like a line whose other end sent XOFF: nothing leaves, even after a flush.
            rustix::termios::tcflow(&held, Action::OOff).unwrap();
        }
        // The far end stops reading, so that the stop after these does not arrive.
        let mut frames = rocker(20).repeat(200);
        frames.extend(STOP);
        port.set_timeout(Duration::from_millis(300)).unwrap();
        while port.write(&frames).is_ok() {}
        tap.signal(Signal::INT);
        let (code, said) = tap.end();
        assert_eq!(code, exit, "{said}");
        assert!(said.contains(words) && said.contains("did not reach the board"), "{said}");
        if !is_held {
            pty.never_wait().unwrap();
            let mut rest = vec![0; 1 << 16];
            while let Ok(count @ 1..) = pty.read(&mut rest) {
                received.extend(&rest[..count]);
            }
            assert!(received.ends_with(&[&STOP[..], &STOP, &STOP, &BUZZER_OFF].concat()), "{received:02X?}");
        }
    }
}

/// A frame of a function, with the right checksum.
fn frame(function: u8, payload: &[u8]) -> Vec<u8> {
    let length = u8::try_from(payload.len()).unwrap();
    let sum = payload.iter().fold(function.wrapping_add(length), |sum, byte| sum.wrapping_add(*byte));
    [&[0xFF, 0xFE, function, length], payload, &[sum]].concat()
}

#[test]
fn unknown_frames_count_as_driving() {
    let cases: [(&str, Vec<u8>, bool); 13] = [
        ("a speed out of range", frame(3, &[1, 0, 30, 0, 0, 0, 0, 1]), false),
        ("an unused direction bit", frame(3, &[1, 0, 0, 0, 0, 0, 0, 9]), false),
        ("an unknown kind", frame(3, &[7, 0, 0, 0, 0, 0, 0, 1]), false),
        ("a kind of zero", frame(3, &[0, 0, 0, 0, 0, 0, 0, 1]), false),
        ("a move that runs", say("move", &[50, 0, 0]).to_frame(), false),
        ("wheels that turn", frame(3, &[2, 9, 9, 9, 9, 0, 0, 0]), false),
        ("a wheel out of range", frame(3, &[2, 99, 0, 0, 0, 0, 0, 0]), false),
        ("a buzzer that is 2", frame(4, &[2]), false),
        ("half a frame", rocker(20)[..9].to_vec(), false),
        ("a stop", STOP.to_vec(), true),
        ("stopped wheels", frame(3, &[2, 0, 0, 0, 0, 0, 0, 0]), true),
        ("a servo", frame(2, &[1, 5, 220]), true),
        ("a frame of another function", frame(0x40, &[3, 8, 1]), true),
    ];
    for (at, (what, sent, rests)) in cases.into_iter().enumerate() {
        let far = FarEnd::new();
        let tap = Tap::start(&format!("malformed-{at}"), &far.path, None);
        let mut port = tap.open();
        port.write_all(&sent).unwrap();
        let mut received = Vec::new();
        while received.len() < sent.len() {
            received.extend(far.first());
        }
        tap.signal(Signal::INT);
        let (code, said) = tap.end();
        received.extend(bytes(&far.rest()));
        assert_eq!(code, 0, "{what}: {said}");
        let is_stopped = received.ends_with(&[&STOP[..], &STOP, &STOP, &BUZZER_OFF].concat());
        assert_eq!(is_stopped, !rests, "{what}: {received:02X?}");
        assert_eq!(said.contains("stop: sent"), !rests, "{what}: {said}");
        assert_at_rest(&received);
    }
}

#[test]
fn a_tap_whose_guard_is_lost_stops_the_robot() {
    let far = FarEnd::new();
    let tap = Tap::start("unguarded-tap", &far.path, None);
    let mut port = tap.open();
    let mut received = Vec::new();
    port.write_all(&rocker(20)).unwrap();
    Tap::drives(&far, &mut received, 1);
    let children = fs::read_to_string(format!("/proc/{0}/task/{0}/children", tap.child.id())).unwrap();
    kill_process(Pid::from_raw(children.trim().parse().unwrap()).unwrap(), Signal::KILL).unwrap();
    let (code, said) = tap.end();
    received.extend(bytes(&far.rest()));
    assert_eq!(code, 101, "{said}");
    assert!(said.contains("the guard of this recording was lost"), "{said}");
    assert_stopped(&received);
}

#[test]
fn bytes_written_before_the_end_are_recorded() {
    let script = link("late.motion");
    let mut host = Host::start_at("record", link("late"), &["-o", script.to_str().unwrap(), "--exact"]);
    let mut port = host.open();
    // Eleven seconds of the line.
    let frames: Vec<u8> = (0..1_000).flat_map(|at| rocker(1 + at % 20)).chain(STOP).collect();
    let mut written = 0;
    port.set_timeout(Duration::from_millis(200)).unwrap();
    while let Ok(count @ 1..) = port.write(&frames[written..]) {
        written += count;
    }
    host.signal(Signal::INT);
    let mut said = String::new();
    while let line @ 1.. = host.line().len() {
        let _ = line;
        said.push('.');
    }
    assert_eq!(host.child.wait().unwrap().code(), Some(0));
    let text = fs::read_to_string(&script).unwrap();
    fs::remove_file(&script).unwrap();
    assert!(written > 1_000, "{written}");
    assert_eq!(text.matches("rocker").count() + text.matches("stop\n").count(), written / 13, "{text}");
}

#[test]
fn programs_that_write_and_exit_at_once_lose_no_frame() {
    let host = Host::start("quick", &["--baud", "4000000"]);
    let (rounds, path) = (if std::env::var_os("STRESS").is_some() { 16_000 } else { 2_000 }, host.path.clone());
    for at in 0..rounds {
        let mut port = File::options().write(true).open(&path).unwrap();
        port.write_all(&rocker(1 + at % 25)).unwrap();
    }
    let (listing, said) = host.end();
    let frames = listing.lines().filter(|line| line.contains("rocker")).count();
    assert_eq!(frames, usize::try_from(rounds).unwrap(), "{said}");
}

#[test]
fn a_player_killed_at_any_moment_of_its_end_says_that_nothing_was_sent() {
    let long = crate::support::script("ends", "rocker x=10\nwait 1h\n");
    for case in 0..times() {
        let pty = Pty::open().unwrap();
        let path = pty.path().to_str().unwrap().to_owned();
        let held = File::options().read(true).write(true).open(pty.path()).unwrap();
        let mut command = motionseq(&["play", &long, "--port", &path, "--max-late", "100ms"]);
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        assert!(pty.read(&mut [0; 64]).unwrap() > 0);
        rustix::termios::tcflow(&held, Action::OOff).unwrap();
        // A random time within the second that this takes: the stall, the stop that does not
        // arrive, the last message.
        let until =
            std::time::Instant::now() + Duration::from_millis(u64::try_from(case).unwrap() * 900 / times() as u64);
        while std::time::Instant::now() < until && child.try_wait().unwrap().is_none() {
            thread::yield_now();
        }
        let _ = child.kill();
        let mut said = String::new();
        BufReader::new(child.stderr.take().unwrap()).read_to_string(&mut said).unwrap();
        child.wait().unwrap();
        assert!(said.contains("stop: NOT SENT - cut the power"), "{case}: {said}");
    }
}

#[test]
fn a_blocked_report_hides_no_closing_line() {
    let long = crate::support::script("stuck-report", "rocker x=10\nwait 1h\n");
    let pipe = link("stuck-report");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // A process has it open, and never reads.
    let mut full = File::options().read(true).write(true).open(&pipe).unwrap();
    rustix::fs::fcntl_setfl(&full, rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::RDWR).unwrap();
    while full.write(&[0; 4096]).is_ok() {}
    let far = FarEnd::new();
    let mut child = motionseq(&["play", &long, "--port", &far.path, "--report", pipe.to_str().unwrap()])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut received = far.first();
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.ends_with("; stop: sent")), "the closing line comes");
    assert!(lines.any(|line| line.contains("is incomplete")), "and that the report is incomplete");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    received.extend(bytes(&far.rest()));
    assert_stopped(&received);
    fs::remove_file(pipe).unwrap();
}
