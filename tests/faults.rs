//! The built program over a pty while things around it fail: the robot stops, or the message says
//! that it did not.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use crate::support::board::OnBoard;
use crate::support::far::{BUZZER_OFF, FarEnd, STOP, assert_at_rest, assert_stopped, bytes, commands, end, start};
use crate::support::{motionseq, rendered, run, script, stderr};
use motionseq::link::{Link, Pty, Serial};
use motionseq::playback::{Guard, GuardConfig};
use rustix::process::{Pid, Signal, kill_process};

/// A script that uses everything, sends a frame at least every 10 ms, and outlasts every test.
const DRIVING: &str = "refresh 10ms\nrocker x=10; buzzer on; servo 1 1000 -> 2000 over 1h\nstop; buzzer off\n";

/// Runs cases on several threads, because they mostly wait.
fn at_once(cases: usize, case: impl Fn(usize) + Sync) {
    let next = AtomicUsize::new(0);
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    if at >= cases {
                        break;
                    }
                    case(at);
                }
            });
        }
    });
}

/// Starts a run and waits until it has sent this many writes: a random phase of the run.
fn start_and_wait(far: &FarEnd, args: &[&str], sent: usize) -> (Child, Vec<u8>) {
    let child = start(args);
    let mut received = Vec::new();
    for _ in 0..=sent {
        match far.reads.recv_timeout(Duration::from_secs(20)) {
            Ok((_, read)) => received.extend(read),
            Err(error) => panic!("{error}; {:?}; received {received:02X?}", end(child)),
        }
    }
    (child, received)
}

/// Waits for a child that a signal ends, and returns its messages.
fn killed(child: Child) -> (Option<i32>, String) {
    let output = child.wait_with_output().unwrap();
    (output.status.signal(), stderr(&output))
}

/// The only line that starts like an error.
fn closing_line(text: &str) -> &str {
    let mut lines = text.lines().filter(|line| line.starts_with("error: "));
    let line = lines.next().unwrap_or_else(|| panic!("no closing line: {text}"));
    assert_eq!(lines.next(), None, "{text}");
    line
}

/// A container that was entered from outside does not know the session and the process group.
#[test]
fn a_player_in_an_unknown_session_still_has_its_guard() {
    let in_a_namespace = ["--pid", "--fork", "--mount-proc", "--kill-child"];
    if !Command::new("unshare").args(in_a_namespace).arg("true").output().is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: namespaces may not be made here");
        return;
    }
    let far = FarEnd::new();
    let short = script("namespace", "rocker x=10\nwait 50ms\nstop\n");
    let mut player = Command::new("unshare");
    player.args(in_a_namespace).arg(env!("CARGO_BIN_EXE_motionseq")).args(["play", &short, "--port", &far.path]);
    let output = player.stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(!stderr(&output).contains("guard"), "{}", stderr(&output));
    assert_at_rest(&bytes(&far.rest()));
}

#[test]
fn two_hundred_killed_players_leave_two_hundred_robots_stopped() {
    let long = script("killed", DRIVING);
    let placed = AtomicUsize::new(0);
    at_once(200, |case| {
        let far = FarEnd::new();
        let (child, mut received) = start_and_wait(&far, &["play", &long, "--port", &far.path], case % 13);
        kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
        let (signal, text) = killed(child);
        received.extend(bytes(&far.rest()));
        assert_eq!(signal, Some(9));
        assert_stopped(&received);
        let line = closing_line(&text);
        assert!(line.starts_with("error: motionseq was killed") && line.ends_with("; stop: sent"), "{line}");
        // The first heartbeat follows the first frame, unless the system lets another process run in between.
        let has_place = line.contains(&format!(" at {long}:2, 0."));
        assert!(has_place || line.contains("killed, 0.000 s into the run"), "{line}");
        placed.fetch_add(usize::from(has_place), Ordering::Relaxed);
    });
    assert!(placed.into_inner() > 150);
}

#[test]
fn a_player_that_hangs_is_killed_and_its_robot_stopped() {
    let long = script("hung", DRIVING);
    at_once(8, |case| {
        let far = FarEnd::new();
        let (child, mut received) =
            start_and_wait(&far, &["play", &long, "--port", &far.path, "--max-late", "100ms"], case);
        kill_process(Pid::from_child(&child), Signal::STOP).unwrap();
        let (signal, text) = killed(child);
        received.extend(bytes(&far.rest()));
        // A shell shows exit code 137.
        assert_eq!(signal, Some(9));
        assert_stopped(&received);
        let line = closing_line(&text);
        assert!(line.contains("motionseq hung for 200 ms and was killed") && line.ends_with("; stop: sent"), "{line}");
    });
}

#[test]
fn a_player_that_sleeps_for_less_than_the_guard_waits_is_late_by_itself() {
    // Its own limit has passed, the guard's limit of twice as much has not. In both cases the robot
    // stops.
    let long = script("nap", DRIVING);
    at_once(8, |case| {
        let far = FarEnd::new();
        let (child, mut received) =
            start_and_wait(&far, &["play", &long, "--port", &far.path, "--max-late", "500ms"], case);
        kill_process(Pid::from_child(&child), Signal::STOP).unwrap();
        while let Ok((_, read)) = far.reads.recv_timeout(Duration::from_millis(700)) {
            received.extend(read);
        }
        kill_process(Pid::from_child(&child), Signal::CONT).unwrap();
        let output = child.wait_with_output().unwrap();
        received.extend(bytes(&far.rest()));
        assert!(output.status.code() == Some(4) || output.status.signal() == Some(9), "{:?}", output.status);
        let text = stderr(&output);
        assert!(closing_line(&text).ends_with("; stop: sent"), "{text}");
        assert_stopped(&received);
    });
}

#[test]
fn a_frozen_program_without_a_guard_stops_no_robot_and_warns_before() {
    let long = script("unguarded", DRIVING);
    let far = FarEnd::new();
    let child = start(&["play", &long, "--port", &far.path, "--no-guard"]);
    let mut received = far.first();
    // Another thread writes what is shown, and has time for it until some frames have come.
    while commands(&received).len() < 8 {
        received.extend(far.first());
    }
    kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
    let (_, text) = killed(child);
    received.extend(bytes(&far.rest()));
    assert!(text.contains("no guard: nothing stops the robot if motionseq is killed or hangs\n"), "{text}");
    assert!(!commands(&received).contains(&crate::support::board::stop()));
}

#[test]
fn signals_at_random_phases_stop_the_robot() {
    let long = script("signals", DRIVING);
    let signals = [(Signal::INT, 130), (Signal::TERM, 143), (Signal::HUP, 129), (Signal::QUIT, 131)];
    at_once(40, |case| {
        let (signal, code) = signals[case % signals.len()];
        let far = FarEnd::new();
        let (child, mut received) = start_and_wait(&far, &["play", &long, "--port", &far.path], case % 11);
        // A second and a third signal skip nothing.
        for _ in 0..=case % 3 {
            kill_process(Pid::from_child(&child), signal).unwrap();
        }
        let (ended, text) = end(child);
        received.extend(bytes(&far.rest()));
        assert_eq!(ended, code, "{text}");
        assert_stopped(&received);
        assert!(closing_line(&text).ends_with("; stop: sent"), "{text}");
    });
}

/// The process ID of a process's only child, such as a player's guard.
fn child_of(child: &Child) -> Pid {
    let children = format!("/proc/{0}/task/{0}/children", child.id());
    Pid::from_raw(std::fs::read_to_string(children).unwrap().trim().parse().unwrap()).unwrap()
}

#[test]
fn a_player_whose_guard_no_longer_listens_stops_the_robot_itself() {
    let long = script("guard-hung", DRIVING);
    let far = FarEnd::new();
    let (child, mut received) = start_and_wait(&far, &["play", &long, "--port", &far.path], 0);
    // Heartbeats pile up until the pipe is full.
    kill_process(child_of(&child), Signal::STOP).unwrap();
    let (code, text) = end(child);
    received.extend(bytes(&far.rest()));
    assert_eq!(code, 101, "{text}");
    assert_stopped(&received);
    assert!(closing_line(&text).contains("the guard of this run was lost at "), "{text}");
}

#[test]
fn a_blocked_port_is_reported_as_not_stopped() {
    let long = script("held", DRIVING);
    for kill in [false, true] {
        let pty = Pty::open().unwrap();
        // An ordinary user cannot open it later.
        let port = std::fs::File::options().read(true).write(true).open(pty.path()).unwrap();
        let child = start(&["play", &long, "--port", pty.path().to_str().unwrap(), "--max-late", "300ms"]);
        assert!(pty.read(&mut [0; 64]).unwrap() > 0);
        // Like a line whose other end sent XOFF: nothing leaves, even after a flush.
        rustix::termios::tcflow(&port, rustix::termios::Action::OOff).unwrap();
        drop(port);
        if kill {
            kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
        }
        let output = child.wait_with_output().unwrap();
        let text = stderr(&output);
        assert_eq!(output.status.code(), (!kill).then_some(6), "{text}");
        assert!(closing_line(&text).ends_with("; stop: NOT SENT - cut the power"), "{text}");
    }
}

#[test]
fn a_run_whose_guard_does_not_start_does_not_start() {
    let pty = Pty::open().unwrap();
    let port = Serial::open(pty.path(), 115_200).unwrap();
    let ward = GuardConfig::of_board(crate::support::board::board());
    for program in ["true", "echo", "/no/such/program"] {
        assert!(Guard::start(Command::new(program), port.descriptor(), &ward).is_err(), "{program}");
    }
}

#[test]
fn realtime_plays_the_same_bytes_and_reports_missing_permissions() {
    let short = script("realtime", "servo 1 1500\nwait 50ms\nservo 1 1600\n");
    std::fs::set_permissions(&short, std::os::unix::fs::PermissionsExt::from_mode(0o644)).unwrap();
    let far = FarEnd::new();
    let (code, text) = end(start(&["play", &short, "--realtime", "--port", &far.path]));
    assert_eq!((code, bytes(&far.rest())), (0, rendered(&short)), "{text}");
    // A user without either permission, on the virtual board, with a copy of the program that
    // anybody may run.
    let copy = std::env::temp_dir().join(format!("motionseq-realtime-{}", std::process::id()));
    crate::support::copy_program(&copy);
    let mut command = Command::new("sh");
    let shell = format!("ulimit -r 0; ulimit -l 64; exec {} play {short} --realtime --max-late 5s", copy.display());
    command.args(["-c", &shell]).current_dir("/");
    if rustix::process::geteuid().is_root() {
        std::os::unix::process::CommandExt::uid(&mut command, 65_534);
    }
    let output = command.output().unwrap();
    std::fs::remove_file(copy).unwrap();
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for line in ["`@dialout - rtprio 90`", "`@dialout - memlock unlimited`"] {
        assert!(text.contains(line), "{text}");
    }
}

#[test]
fn a_player_whose_guard_is_killed_stops_the_robot_itself() {
    let long = script("guard-killed", DRIVING);
    let far = FarEnd::new();
    let child = start(&["play", &long, "--port", &far.path]);
    let mut received = far.first();
    kill_process(child_of(&child), Signal::KILL).unwrap();
    let (code, text) = end(child);
    received.extend(bytes(&far.rest()));
    assert_eq!(code, 101, "{text}");
    assert_stopped(&received);
    assert!(closing_line(&text).contains("the guard of this run was lost at "), "{text}");
}

#[test]
fn the_guard_of_the_virtual_board_does_not_ask_to_cut_the_power() {
    let long = script("virtual-killed", "say \"on\"\nrocker x=10\nwait 1h\nstop\n");
    let mut child = start(&["play", &long]);
    let mut pipe = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("s: on") {
        assert!(pipe.read_line(&mut said).unwrap() > 0, "{said}");
    }
    kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
    pipe.read_to_string(&mut said).unwrap();
    child.wait().unwrap();
    assert!(closing_line(&said).ends_with("; the virtual board ended too"), "{said}");
}

#[test]
fn a_guard_that_cannot_report_closes_the_port() {
    let long = script("mute", DRIVING);
    let (reader, mut full) = std::io::pipe().unwrap();
    rustix::fs::fcntl_setfl(&full, rustix::fs::OFlags::NONBLOCK).unwrap();
    while full.write(&[0; 4096]).is_ok() {}
    rustix::fs::fcntl_setfl(&full, rustix::fs::OFlags::empty()).unwrap();
    let far = FarEnd::new();
    let mut child = motionseq(&["play", "-q", &long, "--port", &far.path]).stderr(full).spawn().unwrap();
    let mut received = far.first();
    kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
    // It ends only after every process has closed the port.
    received.extend(bytes(&far.rest()));
    assert_stopped(&received);
    child.wait().unwrap();
    drop(reader);
}

#[test]
fn the_recording_of_a_killed_run_holds_what_was_sent() {
    let long = script("recorded", DRIVING);
    let record = std::env::temp_dir().join(format!("motionseq-killed-{}.bin", std::process::id()));
    let far = FarEnd::new();
    let (child, mut received) =
        start_and_wait(&far, &["play", &long, "--port", &far.path, "--record", record.to_str().unwrap()], 3);
    while std::fs::metadata(&record).unwrap().len() == 0 {
        received.extend(far.first());
    }
    kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
    killed(child);
    received.extend(bytes(&far.rest()));
    let recorded = std::fs::read(&record).unwrap();
    std::fs::remove_file(record).unwrap();
    assert!(!recorded.is_empty() && received.starts_with(&recorded));
}

#[test]
fn a_ctrl_c_together_with_a_ctrl_z_is_not_lost() {
    let long = script("both", DRIVING);
    for _ in 0..5 {
        let far = FarEnd::new();
        // On a terminal, a Ctrl-Z alone would pause the run; in a session of its own it ends it
        // with another code.
        let (child, mut received) = start_and_wait(&far, &["play", &long, "--port", &far.path], 0);
        kill_process(Pid::from_child(&child), Signal::STOP).unwrap();
        kill_process(Pid::from_child(&child), Signal::TSTP).unwrap();
        kill_process(Pid::from_child(&child), Signal::INT).unwrap();
        kill_process(Pid::from_child(&child), Signal::CONT).unwrap();
        let (code, text) = end(child);
        received.extend(bytes(&far.rest()));
        assert_eq!(code, 130, "{text}");
        assert_stopped(&received);
    }
}

#[test]
fn a_guard_ignores_what_ends_other_programs() {
    let long = script("guard-signals", DRIVING);
    let far = FarEnd::new();
    let child = start(&["play", &long, "--port", &far.path]);
    let mut received = far.first();
    let guard = child_of(&child);
    let signals =
        [Signal::HUP, Signal::INT, Signal::QUIT, Signal::TERM, Signal::TSTP, Signal::USR1, Signal::ALARM, Signal::PROF];
    for signal in signals {
        kill_process(guard, signal).unwrap();
    }
    // It still works.
    kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
    killed(child);
    received.extend(bytes(&far.rest()));
    assert_stopped(&received);
}

#[test]
fn a_guard_cannot_be_started_by_hand() {
    let pty = Pty::open().unwrap();
    let port = std::fs::File::options().read(true).write(true).open(pty.path()).unwrap();
    let by_hand = ["guard-a-player", "1", "50000000", "12", "false", "FFFE0401", "", "", ""];
    let output = motionseq(&by_hand).stdin(port).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("only `play` and `record` can start it"), "{}", stderr(&output));
    let output = motionseq(&by_hand).output().unwrap();
    assert!(stderr(&output).contains("it is not a serial port"), "{}", stderr(&output));
    assert!(!crate::support::stdout(&run(&["--help"])).contains("guard-a-player"));
}

#[test]
fn a_port_that_hangs_up_at_any_phase_is_lost() {
    let long = script("hang-up", DRIVING);
    at_once(12, |case| {
        let far = FarEnd::new();
        let (child, _) = start_and_wait(&far, &["play", &long, "--port", &far.path], case);
        drop(far);
        let (code, text) = end(child);
        assert_eq!(code, 3, "{text}");
        assert!(closing_line(&text).ends_with("; stop: NOT SENT - cut the power"), "{text}");
    });
}

/// Reads the bytes of a run, at most `chunk` at a time with a pause after each read, until the run
/// ends. Returns them, the exit code and the messages.
fn take_slowly(child: Child, pty: &Pty, chunk: usize, pause: Duration) -> (Vec<u8>, i32, String) {
    let mut received = Vec::new();
    let mut buffer = vec![0; chunk];
    let ended = thread::spawn(move || end(child));
    loop {
        let is_over = ended.is_finished();
        let mut ready = [rustix::event::PollFd::new(pty, rustix::event::PollFlags::IN)];
        let timeout = rustix::time::Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
        if rustix::event::poll(&mut ready, Some(&timeout)).unwrap() > 0 {
            match pty.read(&mut buffer) {
                Ok(count @ 1..) => received.extend_from_slice(&buffer[..count]),
                _ => break,
            }
            // The slow reader is the injected fault.
            thread::park_timeout(pause);
        } else if is_over {
            break;
        }
    }
    let (code, text) = ended.join().unwrap();
    (received, code, text)
}

#[test]
fn a_reader_slower_than_the_script_ends_the_run_and_gets_the_stop() {
    // 400 frames of 260 bytes, one per millisecond: 260,000 bytes per second, for a reader that
    // reads a tenth of that.
    let raw = format!("raw 0x40 {}\nwait 1ms\n", "0 ".repeat(255));
    let flood = script("slow", &format!("baud 4000000\nrocker x=10\n{}stop\n", raw.repeat(400)));
    let pty = Pty::open().unwrap();
    let path = pty.path().to_str().unwrap().to_owned();
    let child = start(&["play", &flood, "--port", &path, "--max-late", "300ms"]);
    let (received, code, text) = take_slowly(child, &pty, 26, Duration::from_millis(1));
    assert_eq!(code, 6, "{text}");
    assert!(closing_line(&text).ends_with("; stop: sent"), "{text}");
    // The flush may have truncated a frame, and with it the first stop, but not all three.
    assert!(received.ends_with(&[&STOP[..], &STOP, &BUZZER_OFF].concat()), "{:02X?}", &received[received.len() - 80..]);
    assert_at_rest(&received);
}

#[test]
fn a_reader_as_fast_as_the_line_gets_every_byte_through_short_writes() {
    // 60 frames at once are 15,600 bytes: the port accepts them in pieces.
    let raw = format!("raw 0x40 {}\n", "0 ".repeat(255));
    let burst = script("burst", &format!("baud 4000000\n{}wait 2s\nservo 1 1500\n", raw.repeat(60)));
    let pty = Pty::open().unwrap();
    let path = pty.path().to_str().unwrap().to_owned();
    let child = start(&["play", &burst, "--port", &path]);
    let (received, code, text) = take_slowly(child, &pty, 512, Duration::from_millis(1));
    assert_eq!(code, 0, "{text}");
    assert_eq!(received, rendered(&burst));
}

#[test]
fn of_two_players_that_race_a_hundred_times_exactly_one_wins() {
    // A script without frames that may be dropped on a machine that stalls.
    let short = script("race", "refresh off\nrocker x=10 for 300ms\n");
    at_once(100, |_| {
        let far = FarEnd::new();
        let players = [(); 2].map(|()| start(&["play", &short, "--port", &far.path]));
        let mut codes = players.map(|player| end(player).0);
        codes.sort_unstable();
        assert_eq!(codes, [0, 5]);
        assert_eq!(bytes(&far.rest()), rendered(&short));
    });
}

#[test]
fn telemetry_changes_no_byte_of_the_run() {
    let asking = script("telemetry", "refresh off\nrequest report-start\nrocker x=10 for 300ms\nrequest report-stop\n");
    let cut = b"{A-120:35:9000:11".to_vec();
    let joined = b"{A-120:35:9000:1187}#{A-121:35:9000:1187}#".to_vec();
    let noise: Vec<u8> = (0..5_000u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let flood = b"{A-120:35:9000:1187}#".repeat(3_000);
    let nonsense = b"{A1:2:3}#{A:::}#{Ax:1:1:1}#{{{{####{A99999999999:1:1:1}#".to_vec();
    let cases: [(&str, &[Vec<u8>]); 6] = [
        ("silence", &[]),
        ("cut and joined", &[cut, b"87}#".to_vec(), joined.clone()]),
        ("noise", &[noise]),
        ("flood", &[flood]),
        ("nonsense", &[nonsense]),
        ("one byte at a time", &joined.iter().map(|byte| vec![*byte]).collect::<Vec<_>>()),
    ];
    for (what, chunks) in cases {
        let pty = Pty::open().unwrap();
        let child = start(&["play", &asking, "--port", pty.path().to_str().unwrap()]);
        let mut received = vec![0; 64];
        let count = pty.read(&mut received).unwrap();
        received.truncate(count);
        for chunk in chunks {
            // What does not fit is lost, as on a line without a reader.
            let _ = rustix::fs::fcntl_setfl(&pty, rustix::fs::OFlags::NONBLOCK);
            let _ = rustix::io::write(&pty, chunk);
        }
        rustix::fs::fcntl_setfl(&pty, rustix::fs::OFlags::empty()).unwrap();
        let (rest, code, text) = take_slowly(child, &pty, 4096, Duration::ZERO);
        received.extend(rest);
        assert_eq!(code, 0, "{what}: {text}");
        assert_eq!(received, rendered(&asking), "{what}");
        let reported = text.contains("last report of the board: pitch -1.2");
        assert_eq!(reported, ["cut and joined", "flood", "one byte at a time"].contains(&what), "{what}: {text}");
    }
}

#[test]
fn ctrl_z_on_a_terminal_stops_the_robot_and_enter_continues() {
    // Without a shell, nothing could continue a suspended process, so it does not suspend.
    for with_shell in [true, false] {
        pause_and_resume(with_shell);
    }
}

fn pause_and_resume(with_shell: bool) {
    let long = script("terminal", "refresh off\nrocker x=10; buzzer on\nwait 400ms\nstop; buzzer off\n");
    let far = FarEnd::new();
    let terminal = Pty::open().unwrap();
    // A session on this terminal, with a process like a shell; the test itself continues the
    // player.
    let mut python = Command::new("python3");
    let child = python
        .args(["-c", IN_A_TERMINAL, terminal.path().to_str().unwrap(), if with_shell { "shell" } else { "" }])
        .args([env!("CARGO_BIN_EXE_motionseq"), "play", &long])
        .args(["--max-late", "5s", "--port", &far.path])
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut received = far.first();
    rustix::io::write(&terminal, b"\x1a").unwrap();
    // It stops the robot, then itself.
    while !received.ends_with(&BUZZER_OFF) {
        received.extend(far.first());
    }
    assert_stopped(&received);
    if with_shell {
        let player = child_of(&child);
        let status = format!("/proc/{}/stat", player.as_raw_nonzero());
        while !std::fs::read_to_string(&status).unwrap().contains(") T ") {
            thread::yield_now();
        }
        kill_process(player, Signal::CONT).unwrap();
    }
    // Earlier input is discarded. Later input may come before it is read, so send it until the run
    // continues.
    let (sender, heard) = std::sync::mpsc::channel();
    let enter = thread::spawn(move || {
        while heard.try_recv().is_err() {
            let _ = rustix::io::write(&terminal, b"\n");
            thread::park_timeout(Duration::from_millis(20));
        }
        terminal
    });
    let again = far.first();
    sender.send(()).unwrap();
    assert_eq!(
        commands(&again)[..2].iter().map(OnBoard::said).collect::<Vec<_>>(),
        ["buzzer on", "rocker x=10 y=0 z=0"]
    );
    received.extend(again);
    received.extend(bytes(&far.rest()));
    let (code, text) = end(child);
    drop(enter.join());
    assert_eq!(code, 0, "{text}");
    assert_at_rest(&received);
    assert!(
        text.contains("s: suspended, robot stopped; resume with `fg`\n")
            && text.contains("s: paused; Enter continues (")
            && text.contains("s: continued\n"),
        "{text}"
    );
    // The whole script was sent, with the stop and the restored state in between.
    let all = commands(&received).len();
    assert_eq!(all, commands(&rendered(&long)).len() + 4 + 2);
}

/// Runs a program in the foreground of a terminal, as a shell does, but with its own standard
/// error.
const IN_A_TERMINAL: &str = "import fcntl, os, signal, sys, termios
os.setsid()
terminal = os.open(sys.argv[1], os.O_RDWR)
fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
attributes = termios.tcgetattr(terminal)
attributes[3] |= termios.ISIG | termios.ICANON
attributes[6][termios.VSUSP] = b'\\x1a'
termios.tcsetattr(terminal, termios.TCSANOW, attributes)
os.dup2(terminal, 0)
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
player = os.fork() if sys.argv[2] else 0
if player == 0:
    if sys.argv[2]:
        os.setpgid(0, 0)
        os.tcsetpgrp(terminal, os.getpgrp())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.execv(sys.argv[3], sys.argv[3:])
sys.exit(os.waitstatus_to_exitcode(os.waitpid(player, 0)[1]))";
