//! Gates with the built program: keys, lines on standard input, reports, the report of a run, kills, and rehearsals.

use std::fs;
use std::io::Write;
use std::process::{Child, Command, Output, Stdio};

use crate::support::board::OnBoard;
use crate::support::far::{FarEnd, assert_stopped, bytes, commands};
use crate::support::{Scratch, code, motionseq, rendered, script, stderr, stdout};
use motionseq::faults::Faults;
use motionseq::link::Pty;
use motionseq::playback::{Cause, GateEnd, Passage};
use motionseq::program::Options;
use motionseq::sim::Settings;
use motionseq::source::{Disk, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::Micros;
use motionseq::verify::{Answers, rehearse};
use rustix::process::{Pid, Signal, kill_process};

const CUES: &str = "servo 1 1500\nwait go \"first?\"\nservo 1 1600\nwait go \"second?\"\nservo 1 1700\n";

/// Plays with these lines on standard input, without a terminal.
fn play_with(lines: &str, args: &[&str]) -> Output {
    let mut child = start(args);
    // A run that is refused reads nothing.
    let _ = child.stdin.take().unwrap().write_all(lines.as_bytes());
    child.wait_with_output().unwrap()
}

/// Starts `play` in a session of its own, which has no terminal.
fn start(args: &[&str]) -> Child {
    let mut command = Command::new("setsid");
    command.args([env!("CARGO_BIN_EXE_motionseq"), "play"]).args(args).env_remove("MOTIONSEQ_PORT");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn each_line_on_standard_input_opens_one_gate() {
    let cues = script("cues", CUES);
    // Lines that are already waiting count, and so does the last one without its line feed.
    for lines in ["go\ngo\n", "\n\n", "first\nsecond", "1\n2\n3\n"] {
        let output = play_with(lines, &[&cues, "--go", "stdin"]);
        assert_eq!(code(&output), 0, "{lines:?}: {}", stderr(&output));
        assert!(
            stderr(&output).contains("0.000 s: second? (a line on standard input continues)"),
            "{}",
            stderr(&output)
        );
    }
    let output = play_with("go\n", &[&cues, "--go", "stdin"]);
    assert_eq!(code(&output), 7);
    assert!(stderr(&output).contains("`wait go` failed: standard input ended (second?)"), "{}", stderr(&output));
    assert!(
        stderr(&output).contains(&format!("{cues}:4")) && stderr(&output).contains("stop: sent"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_run_without_a_way_to_say_go_is_refused_before_anything_moves() {
    let cues = script("cues-refused", CUES);
    let far = FarEnd::new();
    let output = play_with("", &[&cues, "--port", &far.path]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains(&format!("{cues}:2 waits for a go")), "{}", stderr(&output));
    assert!(far.reads.try_recv().is_err());
    for name in ["-", "/dev/stdin"] {
        let output = play_with(CUES, &[name, "--go", "stdin"]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("cannot be used with a script from standard input"), "{}", stderr(&output));
    }
    // A part without such a gate needs no operator.
    let output =
        play_with("", &[&script("cues-part", "servo 1 1500\nwait 100ms\nwait go\nservo 1 1600\n"), "--to", "50ms"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

#[test]
fn enter_and_g_say_go_and_an_earlier_key_does_not() {
    let cues = script("cues-keys", "servo 1 1500\nwait 400ms\nwait go \"first?\"\nwait go \"second?\"\nservo 1 1700\n");
    let steps = [
        "wait:servo 1 1500",
        "key:g",
        "wait:first? (Enter or g",
        "wait:waiting for a go",
        "key:g",
        "wait:second?",
        "key:\n",
    ];
    let output = Command::new("python3")
        .args(["tests/support/terminal.py", "120"])
        .args(steps)
        .args(["--", env!("CARGO_BIN_EXE_motionseq"), "play", &cues, "--max-late", "5s", "-v"])
        .env("TERM", "xterm")
        .output()
        .unwrap();
    let text = stdout(&output);
    assert!(text.starts_with("exit 0\nicanon True\necho True\n"), "{text}");
    assert!(text.contains("sent 2 frames"), "{text}");
}

#[test]
fn a_key_that_is_pressed_twice_opens_one_gate() {
    let cues = script("cues-twice", "wait go \"first?\"\nwait go \"second?\"\nservo 1 1700\n");
    let output = Command::new("python3")
        .args([
            "tests/support/terminal.py",
            "120",
            "wait:waiting for a go",
            "key:gg",
            "wait:second?",
            "wait:for a go  1.",
        ])
        .args(["key:q", "--", env!("CARGO_BIN_EXE_motionseq"), "play", &cues, "--max-late", "5s"])
        .env("TERM", "xterm")
        .output()
        .unwrap();
    assert!(
        stdout(&output).contains("stopped by q") && stdout(&output).contains("sent 0 frames"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn while_paused_at_a_gate_enter_only_resumes() {
    let cues = script("cues-paused", "wait go \"first?\"\nservo 1 1700\n");
    let steps = ["wait:first?", "key: ", "wait:paused", "key:\n", "wait:continued", "wait:waiting for a go", "key:\n"];
    let output = Command::new("python3")
        .args(["tests/support/terminal.py", "120"])
        .args(steps)
        .args(["--", env!("CARGO_BIN_EXE_motionseq"), "play", &cues, "--max-late", "5s"])
        .env("TERM", "xterm")
        .output()
        .unwrap();
    assert!(stdout(&output).starts_with("exit 0\n"), "{}", stdout(&output));
}

/// A turn that takes a while on the virtual board.
const TURN: &str = "wait 300ms\nrocker z=50\nwait until turned > 20deg within 5s\nstop\nsay \"{yaw}, {voltage}\"\n";

#[test]
fn the_report_lists_gates_and_every_frame_that_the_script_does_not_have() {
    let turn = script("turn", TURN);
    let scratch = Scratch::new("gate-report");
    let (record, report) = (scratch.path("run.bin"), scratch.path("run.json"));
    let output = play_with("", &[&turn, "--record", &record, "--report", &report]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let run: serde_json::Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
    let gate = &run["gates"][0];
    assert_eq!(
        (gate["t_us"].as_u64(), gate["end"].as_str(), gate["line"].as_u64()),
        (Some(300_000), Some("matched"), Some(3))
    );
    let took = gate["took_us"].as_u64().unwrap();
    assert!((350_000..3_000_000).contains(&took), "{took}");
    // What the port received, without these frames, is what `render` prints.
    let mut received = fs::read(&record).unwrap();
    let unscripted = run["unscripted"].as_array().unwrap();
    assert_eq!(unscripted.len(), 1);
    let (after, count) = (unscripted[0]["after"].as_u64().unwrap(), unscripted[0]["count"].as_u64().unwrap());
    assert_eq!(unscripted[0]["command"], "rocker x=0 y=0 z=50");
    assert!(count >= 5 && run["frames"]["extra"].as_u64() == Some(count), "{count}");
    let frame: Vec<u8> =
        unscripted[0]["frame"].as_str().unwrap().split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
    let before: usize = commands(&received).iter().take(after as usize).map(|command| command.to_frame().len()).sum();
    for _ in 0..count {
        let removed: Vec<u8> = received.drain(before..before + frame.len()).collect();
        assert_eq!(removed, frame);
    }
    assert_eq!(received, rendered(&turn));
    // The values of the newest report, with their units.
    assert!(stderr(&output).contains("deg, 11."), "{}", stderr(&output));
}

#[test]
fn a_board_that_reports_nothing_ends_the_turn_and_so_does_a_kill() {
    let turn = script("turn-ends", TURN);
    let output = play_with("", &[&turn, "--fault", "silent"]);
    assert_eq!(code(&output), 7);
    let words = "`wait until turned > 20deg within 5s` failed: the board has reported nothing for 500 ms while the robot was driving";
    assert!(stderr(&output).contains(words), "{}", stderr(&output));
    // Nothing reports at the far end: the gate is closed, and the drive is refreshed.
    for (signal, exit) in [(Signal::INT, Some(130)), (Signal::KILL, None), (Signal::STOP, None)] {
        let far = FarEnd::new();
        let waits = script("turn-waits", "rocker z=50\nwait go within 50s\nstop\n");
        let mut child = start(&[&waits, "--port", &far.path, "--go", "stdin", "--max-late", "500ms"]);
        // It stays open.
        let _lines = child.stdin.take();
        // The command, and two refreshes at the gate.
        let mut received = Vec::new();
        while commands(&received).len() < 3 {
            received.extend(far.first());
        }
        kill_process(Pid::from_child(&child), signal).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), exit, "{}", stderr(&output));
        received.extend(bytes(&far.rest()));
        assert_stopped(&received);
    }
}

#[test]
fn noise_and_damaged_reports_open_no_gate() {
    let waits = script("noise", "wait until yaw > 20deg within 30s\nservo 1 1500\n");
    let pty = Pty::open().unwrap();
    let child = start(&[&waits, "--port", pty.path().to_str().unwrap(), "--max-late", "5s"]);
    // The request for reports.
    let mut buffer = [0; 4096];
    assert!(pty.read(&mut buffer).unwrap() > 0);
    pty.write(&[0xFF; 16_000]).unwrap();
    for damaged in
        ["{A0:0:9000", "}#{A0:0:9x00:1200}#", "{A0:0:9000:1200:7}#", "{A0:0:+9000:1200}#", "{0:0:9000:1200}#"]
    {
        pty.write(damaged.as_bytes()).unwrap();
    }
    pty.write(b"{A0:0:1900:1200}#{A0:0:25").unwrap();
    pty.write(b"00:1200}#").unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(
        stderr(&output).contains("yaw > 20deg after ") && stderr(&output).contains(": 25.00deg"),
        "{}",
        stderr(&output)
    );
}

/// A shipped script.
fn shipped(name: &str) -> Timeline {
    let sources = Sources::read(name.as_ref(), Disk).unwrap();
    motionseq::compile(&sources, &Options::default()).timeline().unwrap()
}

#[test]
fn a_quarter_turn_is_a_quarter_at_any_speed_and_ends_if_the_robot_does_not_turn() {
    let quarter = shipped("scripts/quarter.motion");
    for speed in [0.25, 0.5, 0.77, 1.0, 1.3, 2.0, 3.1, 4.0] {
        let mut settings = Settings::default();
        settings.geometry.deg_s = speed;
        let rehearsal = rehearse(&quarter, settings, Faults::default(), &Answers::default());
        assert_eq!(rehearsal.outcome.cause, Cause::Finished, "at {speed}");
        let turned = rehearsal.received.pose.yaw_deg;
        assert!((88.0..=92.0).contains(&turned), "{turned} degrees at {speed}");
    }
    let mut stuck = Settings::default();
    stuck.geometry.deg_s = 0.0;
    let rehearsal = rehearse(&quarter, stuck, Faults::default(), &Answers::default());
    let Cause::Gate(Passage { took, end: GateEnd::TimedOut(Some(seen)), .. }) = rehearsal.outcome.cause else {
        panic!("{:?}", rehearsal.outcome)
    };
    assert_eq!((took.micros(), seen.newest.0), (Micros(45_000_000), 0));
}

#[test]
fn answers_of_a_rehearsal_open_gates_in_order() {
    let scratch = Scratch::new("answers");
    let name = scratch.path("cues.motion");
    let test = |head: &str, body: &str| {
        fs::write(&name, format!("{head}\n{body}")).unwrap();
        motionseq(&["test", "--play", "--bless", &name]).output().unwrap()
    };
    let two = "wait go within 2s\nservo 1 1500\nwait go within 500ms\nservo 1 1600\n";
    assert_eq!(code(&test("", two)), 0);
    assert_eq!(code(&test("# rehearse: go=1.5s, go=0.4s", two)), 0);
    // The last answer is for all further gates.
    let output = test("# rehearse: go=1.5s", two);
    assert_eq!(code(&output), 7, "{}", stdout(&output));
    assert!(
        stdout(&output).contains(
            "cues.motion:4: gate: at 0.000000 s, after 0.500 s: `wait go within 0.5s` failed: nothing came in this time"
        ),
        "{}",
        stdout(&output)
    );
    let battery = "wait until voltage > 12V within 2s \"charge it\"\nservo 1 1500\n";
    let output = test("", battery);
    assert_eq!(code(&output), 7);
    assert!(stdout(&output).contains("the value was 12.00V (charge it)"), "{}", stdout(&output));
    assert_eq!(code(&test("# rehearse: voltage=12.5V@1s", battery)), 0);
    assert_eq!(code(&test("# rehearse: voltage=12.5V@3s", battery)), 7);
    // They create no snapshot, and apply to faults, too.
    assert!(!fs::exists(format!("{name}.voltage=12.5V@1s.frames")).unwrap());
    let output = test("# rehearse: voltage=12.5V@1s, unplug@0.5s", battery);
    assert_eq!(code(&output), 0, "{}", stdout(&output));
    assert!(fs::exists(format!("{name}.unplug@0.5s.frames")).unwrap());
    for wrong in ["go=soon", "voltage=12.5@1s", "voltage=12.5V", "speed=3"] {
        let output = test(&format!("# rehearse: {wrong}"), battery);
        assert_ne!(code(&output), 0, "{wrong}");
        assert!(stdout(&output).contains(&format!("`{wrong}`")), "{}", stdout(&output));
    }
}

#[test]
fn the_button_and_the_web_hook_of_the_documentation_open_the_gates() {
    let scratch = Scratch::new("hooks");
    let page = fs::read_to_string("docs/gates.md").unwrap();
    let programs: Vec<&str> = page.split("```python\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let [button, hook] = programs.as_slice() else { panic!("two programs") };
    let length = |program: &&str| program.lines().filter(|line| !line.is_empty()).count();
    assert!(programs.iter().all(|program| length(program) <= 10));
    let cues = script("cues-hooks", CUES);
    // A button that is pressed whenever the program waits for it.
    scratch.file("gpiozero.py", b"class Button:\n    def __init__(self, pin, bounce_time=None): pass\n    def wait_for_press(self): pass\n    def wait_for_release(self): pass\n");
    scratch.file("button.py", button.as_bytes());
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    scratch.file("hook.py", hook.replace("8000", &port.to_string()).as_bytes());
    let requests = format!(
        "import sys, time, urllib.request\nfor _ in range(int(sys.argv[1])):\n    for _ in range(100):\n        try:\n            urllib.request.urlopen('http://127.0.0.1:{port}', data=b'')\n            break\n        except OSError:\n            time.sleep(0.1)\n"
    );
    scratch.file("post.py", requests.as_bytes());
    let program = env!("CARGO_BIN_EXE_motionseq");
    for shell in [
        format!("{program} play {cues} --go stdin < <(python3 button.py)"),
        format!(
            "python3 post.py 2 & {program} play {cues} --go stdin < <(python3 hook.py); exit=$?; python3 post.py 1; exit $exit"
        ),
    ] {
        let output = Command::new("bash").args(["-c", &shell]).current_dir(scratch.path(".")).output().unwrap();
        assert!(output.status.success(), "{shell}: {}", stderr(&output));
        assert!(stderr(&output).contains("sent 3 frames"), "{}", stderr(&output));
    }
}
