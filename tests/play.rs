//! `play` over a pty, with the built program: the bytes that arrive, their times, and how a run
//! ends.

use std::fs::{self, File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Stdio;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::support::board::OnBoard;
use crate::support::far::{BUZZER_OFF, FarEnd, STOP, assert_at_rest, assert_stopped, bytes, end, start};
use crate::support::{code, motionseq, rendered, run, script, stderr};
use motionseq::faults::Faults;
use motionseq::link::{Pty, Serial};
use motionseq::playback::Cause;
use motionseq::program::Options;
use motionseq::sim::Settings;
use motionseq::source::Source;
use motionseq::verify::{Answers, rehearse};
use rustix::process::{Pid, Signal, kill_process};

/// A script without frames that may be dropped on a machine that stalls: no refreshes and no
/// samples.
fn steady() -> &'static str {
    static PATH: OnceLock<String> = OnceLock::new();
    let steps = "rocker x=10 for 40ms; servo 1 900\nwait 10ms\nbuzzer on for 20ms; servo 1 2000\n";
    PATH.get_or_init(|| script("steady", &format!("refresh off\nrepeat 20 {{\n{steps}}}\n")))
}

#[test]
fn the_bytes_that_arrive_are_the_rendered_ones_and_none_is_early() {
    let steady = steady();
    let far = FarEnd::new();
    let begin = Instant::now();
    let child = start(&["play", steady, "--port", &far.path]);
    let (code, text) = end(child);
    assert_eq!(code, 0, "{text}");
    let reads = far.rest();
    assert_eq!(bytes(&reads), rendered(steady));

    // Time 0 of the script was at `begin` or later, so no frame may arrive earlier after it than it
    // is due. (Bytes that arrived together were due together: the far end reads every byte
    // immediately.)
    let hex = String::from_utf8(run(&["render", steady, "--format", "hex"]).stdout).unwrap();
    let due: Vec<(f64, usize)> = hex
        .lines()
        .map(|line| line.split_once('\t').unwrap())
        .map(|(at, frame)| (at.parse().unwrap(), frame.split(' ').count()))
        .collect();
    let mut frames = due.iter();
    let (mut pending, mut last) = (0, 0.0);
    for (when, read) in reads {
        for _ in read {
            if pending == 0 {
                (last, pending) = *frames.next().unwrap();
            }
            pending -= 1;
            assert!(when - begin >= Duration::from_secs_f64(last), "a frame due at {last} s is early");
        }
    }
    assert!(frames.next().is_none());
}

#[test]
fn the_built_in_board_receives_what_is_recorded() {
    let record = std::env::temp_dir().join(format!("motionseq-record-{}.bin", std::process::id()));
    let output = run(&["play", "scripts/hello.motion", "--record", record.to_str().unwrap()]);
    let text = stderr(&output);
    assert_eq!(code(&output), 0, "{text}");
    assert_eq!(fs::read(&record).unwrap(), rendered("scripts/hello.motion"));
    fs::remove_file(record).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "no --port: playing on the built-in virtual board");
    assert!(lines[1].starts_with("sent 22 frames in 1.5"), "{text}");
    assert_eq!(
        lines[2],
        "the virtual board received 22 frames (281 bytes); the drive is stopped, the buzzer is off, servo 1 at 1500 µs"
    );
    assert!(lines[3].starts_with("the robot moved "), "{text}");
    assert_eq!(lines.len(), 4);
    // No part of the progress line in a pipe.
    assert!(!text.contains(['\r', '\u{1b}']));
}

#[test]
fn said_lines_are_shown_and_quiet_is_quiet() {
    let said = script("say", "say \"here \\\"I\\\" go\"\nservo 1 1500\n");
    let text = stderr(&run(&["play", &said]));
    assert!(text.contains("0.000 s: here \"I\" go\n"), "{text}");
    let braces = script("say-braces", "let n = 5\nsay \"{{}} {{n}} {{{n}}}\"\nservo 1 1500\n");
    let text = stderr(&run(&["play", &braces]));
    assert!(text.contains("0.000 s: {} {n} {5}\n"), "{text}");
    assert_eq!(stderr(&run(&["play", "-q", &said])), "");
    assert!(stderr(&run(&["play", "-v", &said])).contains("0.000 s: servo 1 1500\n"));
}

#[test]
fn a_recording_is_complete_with_thousands_of_marks_at_one_moment() {
    let marks: String = (0..40_000).map(|number| format!("mark m{number}\n")).collect();
    let path = script("many-marks", &format!("rocker x=10\nwait 100ms\n{marks}wait 100ms\nservo 1 1500\nstop\n"));
    let recording = std::env::temp_dir().join(format!("motionseq-many-marks-{}.bin", std::process::id()));
    let output = run(&["play", &path, "--record", recording.to_str().unwrap(), "--max-late", "5s"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(std::fs::read(&recording).unwrap(), crate::support::rendered(&path));
    std::fs::remove_file(recording).unwrap();
}

#[test]
fn every_signal_stops_the_robot() {
    let long = script("signal", "rocker x=10; buzzer on\nwait 1h\nstop; buzzer off\n");
    for (signal, number, words) in [
        (Signal::INT, 2, "Ctrl-C"),
        (Signal::TERM, 15, "SIGTERM"),
        (Signal::HUP, 1, "SIGHUP"),
        (Signal::QUIT, 3, "SIGQUIT"),
        (Signal::TSTP, 20, "SIGTSTP"),
    ] {
        let far = FarEnd::new();
        // In its own session, so that there is no terminal on which a pause could be ended.
        let mut command = std::process::Command::new("setsid");
        command.args([crate::support::program(), "play", &long, "--max-late", "5s", "--port", &far.path]);
        let child = command.stdin(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut received = far.first();
        kill_process(Pid::from_child(&child), signal).unwrap();
        let (code, text) = end(child);
        received.extend(bytes(&far.rest()));
        assert_eq!(code, 128 + number, "{text}");
        assert!(text.contains(words) && text.contains("motion:1, ") && text.contains("; stop: sent\n"), "{text}");
        assert_stopped(&received);
    }
}

#[test]
fn a_gap_in_the_run_is_late_even_if_it_contains_only_refreshes() {
    let long = script("hole", "rocker x=10\nwait 1h\nstop\n");
    let far = FarEnd::new();
    // A guard would kill the player first.
    let child = start(&["play", &long, "--port", &far.path, "--max-late", "50ms", "--no-guard"]);
    let mut received = far.first();
    kill_process(Pid::from_child(&child), Signal::STOP).unwrap();
    // Suspended for longer than allowed: until nothing has arrived for half a second.
    while let Ok((_, read)) = far.reads.recv_timeout(Duration::from_millis(500)) {
        received.extend(read);
    }
    kill_process(Pid::from_child(&child), Signal::CONT).unwrap();
    let (code, text) = end(child);
    received.extend(bytes(&far.rest()));
    assert_eq!(code, 4, "{text}");
    assert!(text.contains(" ms late at ") && text.contains("; stop: sent\n"), "{text}");
    assert_stopped(&received);
}

#[test]
fn a_recording_at_the_size_limit_does_not_stop_motion() {
    let steady = steady();
    let record = std::env::temp_dir().join(format!("motionseq-limit-{}.bin", std::process::id()));
    let _ = fs::remove_file(&record);
    let far = FarEnd::new();
    // 1 block of 512 bytes. By default, the system kills a process that writes more.
    let shell = format!(
        "ulimit -f 1; exec {} play {steady} --max-late 5s --port {} --record {}",
        env!("CARGO_BIN_EXE_motionseq"),
        far.path,
        record.display()
    );
    let output = std::process::Command::new("sh").args(["-c", &shell]).output().unwrap();
    let text = stderr(&output);
    assert_eq!(code(&output), 2, "{text}");
    assert_eq!(bytes(&far.rest()), rendered(steady));
    assert!(text.contains("the recording is incomplete"), "{text}");
    fs::remove_file(record).unwrap();
}

#[test]
fn a_recording_never_overwrites_the_script_and_a_refused_port_no_recording() {
    let precious = script("precious", "servo 1 1500\n");
    let output = run(&["play", &precious, "--record", &precious]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("this run reads it; choose another file; nothing was sent"));
    let output = run(&["render", &precious, "-o", &precious]);
    assert_eq!(code(&output), 2);
    assert_eq!(fs::read_to_string(&precious).unwrap(), "servo 1 1500\n");
    let earlier = format!("{precious}.bin");
    fs::write(&earlier, "an earlier recording").unwrap();
    assert_eq!(code(&run(&["play", &precious, "--record", &earlier, "--port", "/dev/no-such-port"])), 3);
    assert_eq!(fs::read_to_string(&earlier).unwrap(), "an earlier recording");
}

#[test]
fn a_blocked_terminal_does_not_keep_the_program_alive() {
    // 4,000 lines are more than an unread pipe holds.
    let chatty = script("chatty", &"say \"a line that is long enough to fill a pipe sooner or later\"\n".repeat(4_000));
    let far = FarEnd::new();
    let mut child = start(&["play", "-v", &chatty, "--port", &far.path]);
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(0));
}

#[test]
fn a_report_of_the_board_is_shown() {
    let pty = Pty::open().unwrap();
    let asking = script("report", "request report-start\nwait 3s\nrequest report-stop\n");
    let child = start(&["play", &asking, "--port", pty.path().to_str().unwrap()]);
    let mut buffer = [0; 64];
    assert!(pty.read(&mut buffer).unwrap() > 0);
    rustix::io::write(&pty, b"noise {A1:2:{A-120:35:9000:1187}#").unwrap();
    let (code, text) = end(child);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("last report of the board: pitch -1.20°, roll 0.35°, yaw 90.00°, 11.87 V"), "{text}");
}

#[test]
fn a_signal_stops_the_built_in_board_too() {
    let long = script("signal-virtual", "say \"on\"\nrocker x=10; buzzer on\nwait 1h\nstop; buzzer off\n");
    let mut child = start(&["play", &long]);
    // The message says that it has started.
    let mut pipe = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("s: on") {
        assert!(std::io::BufRead::read_line(&mut pipe, &mut said).unwrap() > 0, "{said}");
    }
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    std::io::Read::read_to_string(&mut pipe, &mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(said.contains("the drive is stopped, the buzzer is off"), "{said}");
    assert!(said.contains("stop: sent"), "{said}");
}

#[test]
fn a_port_that_goes_away_is_lost() {
    let long = script("lost", "rocker x=10\nwait 1h\nstop\n");
    let far = FarEnd::new();
    let child = start(&["play", &long, "--port", &far.path]);
    far.first();
    drop(far);
    let (code, text) = end(child);
    assert_eq!(code, 3, "{text}");
    assert!(text.contains("stop: NOT SENT - cut the power"), "{text}");
}

#[test]
fn a_port_whose_reader_stops_is_stalled_and_still_gets_the_stop() {
    // 200 frames of 260 bytes in a fifth of a second are more than a pty holds.
    let raw = format!("raw 0x40 {}\nwait 1ms\n", "0 ".repeat(255));
    let flood = script("stalled", &format!("baud 4000000\n{}", raw.repeat(200)));
    let pty = Pty::open().unwrap();
    let path = pty.path().to_str().unwrap().to_owned();
    let (code, text) = end(start(&["play", &flood, "--port", &path, "--max-late", "500ms"]));
    assert_eq!(code, 6, "{text}");
    assert!(text.contains("the port stopped accepting bytes") && text.contains("; stop: sent\n"), "{text}");
    let mut received = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = pty.read(&mut buffer) {
        received.extend_from_slice(&buffer[..count]);
    }
    // The queue was discarded. The flush may have truncated a frame, but not all three stops.
    assert!(received.ends_with(&[&STOP[..], &STOP, &BUZZER_OFF].concat()));
    assert_at_rest(&received);
}

#[test]
fn a_port_in_use_is_left_alone() {
    let steady = steady();
    let far = FarEnd::new();
    let owner = start(&["play", steady, "--port", &far.path]);
    let mut received = far.first();
    for _ in 0..3 {
        let output = run(&["play", steady, "--port", &far.path]);
        assert_eq!(code(&output), 5);
        let text = stderr(&output);
        assert!(text.contains("another program uses it; nothing was sent"), "{text}");
    }
    let (code, text) = end(owner);
    assert_eq!(code, 0, "{text}");
    received.extend(bytes(&far.rest()));
    assert_eq!(received, rendered(steady));
}

#[test]
fn the_library_holds_its_port_alone() {
    let pty = Pty::open().unwrap();
    let first = Serial::open(pty.path(), 115_200).unwrap();
    assert!(matches!(Serial::open(pty.path(), 115_200), Err(motionseq::link::OpenError::InUse)));
    drop(first);
    Serial::open(pty.path(), 115_200).unwrap();
}

#[test]
fn a_pty_is_raw_from_the_start() {
    let pty = Pty::open().unwrap();
    let mut port = File::options().read(true).write(true).open(pty.path()).unwrap();
    // A terminal would change or swallow end-of-file, line ends and interrupt.
    let all = [0x04, b'\r', b'\n', 0x03, 0xFF, 0x00];
    std::io::Write::write_all(&mut port, &all).unwrap();
    let mut buffer = [0; 64];
    let count = pty.read(&mut buffer).unwrap();
    assert_eq!(buffer[..count], all);
}

#[test]
fn a_port_that_cannot_be_opened_says_what_to_do() {
    let file = script("no-port", "servo 1 1500\n");
    for (port, words) in [
        ("/dev/no-such-port", "no such port"),
        ("/dev/null", "not a serial port"),
        (file.as_str(), "not a serial port"),
        ("/tmp", "not a serial port"),
    ] {
        let output = run(&["play", "scripts/hello.motion", "--port", port]);
        let text = stderr(&output);
        assert_eq!(code(&output), 3, "{text}");
        assert!(text.contains(words) && text.contains("nothing was sent"), "{text}");
        assert_eq!(text.lines().count(), 1, "one line: {text}");
    }
}

#[test]
fn a_port_that_only_its_owner_may_open_says_so() {
    let pty = Pty::open().unwrap();
    fs::set_permissions(pty.path(), Permissions::from_mode(0o000)).unwrap();
    // Root may open anything, so another user tries, with a copy of the program that anybody may
    // run.
    let folder = PathBuf::from(format!("/tmp/motionseq-forbidden-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let program = folder.join("motionseq");
    crate::support::copy_program(&program);
    let script = folder.join("x.motion");
    fs::write(&script, "servo 1 1500\n").unwrap();
    fs::set_permissions(&program, Permissions::from_mode(0o755)).unwrap();
    fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
    let mut command = std::process::Command::new(&program);
    command.current_dir("/").arg("play").arg(&script).arg("--port").arg(pty.path());
    if rustix::process::geteuid().is_root() {
        command.uid(65_534).gid(65_534);
    }
    let output = command.output().unwrap();
    fs::remove_dir_all(folder).unwrap();
    let text = stderr(&output);
    assert_eq!(code(&output), 3, "{text}");
    assert!(text.contains("only its owner may open it; a udev rule"), "{text}");
}

#[test]
fn the_port_may_come_from_the_environment() {
    let steady = steady();
    let far = FarEnd::new();
    let status = motionseq(&["play", "-q", steady]).env("MOTIONSEQ_PORT", &far.path).status().unwrap();
    assert_eq!(status.code(), Some(0));
    assert_eq!(bytes(&far.rest()), rendered(steady));
}

#[test]
fn output_without_a_reader_does_not_stop_motion() {
    let steady = steady();
    let far = FarEnd::new();
    let full = || File::options().write(true).open("/dev/full").unwrap();
    let status = motionseq(&["play", "-v", steady, "--port", &far.path, "--record", "/dev/full"])
        .stderr(full())
        .stdout(full())
        .status()
        .unwrap();
    // The requested output is not complete.
    assert_eq!(status.code(), Some(2));
    assert_eq!(bytes(&far.rest()), rendered(steady));
}

#[test]
fn a_script_that_does_not_compile_sends_nothing() {
    let bad = script("bad", "servo 1 1500\nservo 1 9999\n");
    let far = FarEnd::new();
    let output = run(&["play", &bad, "--port", &far.path]);
    assert_eq!(code(&output), 1);
    assert!(far.reads.try_recv().is_err());
}

/// The verdicts of a run on the virtual board, and the bytes that it wrote to the port.
#[test]
fn a_rehearsal_in_real_time_and_one_without_waiting_are_the_same() {
    let text = "servo 1 1500\nwait 300ms\nexpect voltage > 11V\nrocker y=10 z=90 for 1s\nexpect yaw in 80deg..100deg within 500ms\nexpect voltage < 5V\nservo 1 900\n";
    let path = script("both-clocks", text);
    let record = format!("{path}.bin");
    let output = run(&["play", &path, "--record", &record]);
    assert_eq!(output.status.code(), Some(7), "{}", crate::support::stderr(&output));
    let said = crate::support::stderr(&output);
    let timeline = motionseq::compile(&Source::new("x", text).into(), &Options::default()).timeline().unwrap();
    let rehearsal = rehearse(&timeline, Settings::default(), Faults::default(), &Answers::default());
    assert!(matches!(rehearsal.outcome.cause, Cause::Expect(_)));
    assert_eq!(rehearsal.verdicts.len(), 3);
    for verdict in &rehearsal.verdicts {
        let due = &timeline.expects[verdict.expect];
        let passed = said.contains(&format!("expect {}: the board reports", due.expect));
        assert_eq!(passed, verdict.found.is_passed(), "{said}");
    }
    assert!(said.contains("`expect voltage < 5V` failed: the board reports 1"), "{said}");
    let mut expected: Vec<u8> = Vec::new();
    for event in timeline.events.iter().take(rehearsal.given) {
        expected.extend(event.command.to_frame());
    }
    // The zeros that resynchronize a receiver after a flush.
    expected.extend([0; 12]);
    for moment in &rehearsal.aborted {
        expected.extend(moment.command.to_frame());
    }
    assert_eq!(std::fs::read(&record).unwrap(), expected);
}

#[test]
fn faults_of_the_virtual_board_end_a_run_as_real_ones_do() {
    let path = script("faulty", "rocker y=10 for 2s\n");
    for (fault, code, words) in [
        ("unplug@510ms", 3, "the port hung up"),
        ("drop=50%", 0, "did not reach the board"),
        ("battery=6.5V", 0, "sent 41 frames"),
    ] {
        let output = run(&["play", &path, "--fault", fault]);
        assert_eq!(output.status.code(), Some(code), "{fault}: {}", crate::support::stderr(&output));
        assert!(crate::support::stderr(&output).contains(words), "{fault}: {}", crate::support::stderr(&output));
    }
    // More than a port holds, and a board that stopped reading.
    let flood = format!(
        "baud 4000000\n{}",
        "raw 0x40 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\nwait 200us\n".repeat(4_000)
    );
    let output = run(&["play", &script("stalling", &flood), "--fault", "stall@100ms", "--max-late", "300ms"]);
    assert_eq!(output.status.code(), Some(6), "{}", crate::support::stderr(&output));
    let output = run(&["play", &path, "--fault", "silent", "--port", "/dev/null"]);
    assert_eq!(output.status.code(), Some(2), "{}", crate::support::stderr(&output));
}
