//! Playing at a terminal: keys, the display, and that the terminal is always restored.

use std::fs;
use std::process::Command;

use crate::support::{run, script, stderr};

/// Plays in a terminal with this many columns, and returns the output.
pub(crate) fn at_terminal(columns: &str, steps: &[&str], args: &[&str]) -> String {
    in_terminal("xterm", columns, steps, &[args, &["--max-late", "5s"]].concat())
}

/// Runs the program in a terminal whose TERM is `term`.
fn in_terminal(term: &str, columns: &str, steps: &[&str], args: &[&str]) -> String {
    let output = Command::new("python3")
        .arg("tests/support/terminal.py")
        .arg(columns)
        .args(steps)
        .args(["--", env!("CARGO_BIN_EXE_motionseq")])
        .args(args)
        .env("TERM", term)
        .env_remove("MOTIONSEQ_PORT")
        .output()
        .expect("python3 runs");
    assert!(output.status.success(), "{}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

fn show() -> String {
    script("desk", "servos 1500 1500\nwait 300ms\nmark turn\nrocker y=10 z=20 for 60s\nmark end\nservo 1 1000\n")
}

#[test]
fn space_pauses_and_continues_s_steps_and_q_ends() {
    let steps = [
        "wait:rocker x=0 y=10 z=20",
        "key: ",
        "wait:paused; space or Enter continues",
        "wait:paused  stopped  next end at",
        "key:?",
        "wait:space: pause or continue",
        "key:s",
        "wait:60.300 s: paused",
        "key: ",
        "wait:continued",
        "wait:exit",
    ];
    let text = at_terminal("120", &steps[..10], &["play", &show()]);
    assert!(text.starts_with("exit 0\nicanon True\necho True\n"), "{text}");
    // The step was the stop, which the pause had already sent; the servo remains.
    assert!(text.contains("servo 1 at 1000") && text.contains("the drive is stopped"), "{text}");
    let text = at_terminal("120", &["wait:rocker x=0", "key:xq"], &["play", &show()]);
    assert!(text.starts_with("exit 0\nicanon True\necho True\n"), "{text}");
    assert!(text.contains("stopped by q at") || text.contains("never"), "{text}");
    // For an endless run, the frames of all passes count.
    let short = script("short-pass", "servo 2 1500\nwait 400ms\n");
    let text = at_terminal("120", &["wait:pass 3", "key:q"], &["play", &short, "--loop", "forever"]);
    let (frames, rest) = text.split_once("sent ").unwrap().1.split_once(" frames in ").unwrap();
    let (frames, seconds): (f64, f64) = (frames.parse().unwrap(), rest.split_once(' ').unwrap().0.parse().unwrap());
    assert!(frames >= 3.0 && seconds >= (frames - 1.0) * 0.4, "{text}");
}

#[test]
fn the_terminal_is_always_restored() {
    let show = show();
    for (steps, code) in [
        (vec!["wait:rocker x=0", "kill"], "exit -9"),
        (vec!["wait:rocker x=0", "key:\u{3}"], "exit 130"),
        (vec!["wait:rocker x=0", "key: ", "wait:paused;", "kill"], "exit -9"),
        (vec!["wait:rocker x=0", "key: ", "wait:paused;", "key:\u{3}"], "exit 130"),
    ] {
        let text = at_terminal("100", &steps, &["play", &show]);
        assert!(text.starts_with(&format!("{code}\nicanon True\necho True\n")), "{steps:?}: {text}");
        if code == "exit -9" {
            assert!(text.contains("motionseq was killed at"), "the guard reports: {text}");
        }
    }
}

#[test]
fn a_paused_start_waits_for_a_key_and_needs_a_terminal() {
    let show = show();
    let text = at_terminal("100", &["wait:0.000 s: paused", "key:q"], &["play", &show, "--paused"]);
    assert!(text.starts_with("exit 0\n") && text.contains("sent 0 frames"), "{text}");
    // Enter plays one step each time.
    let steps = ["wait:0.000 s: paused", "key:\n", "wait:0.000 / 60.300 s", "key:\n", "wait:0.300 s: paused", "key:q"];
    let text = at_terminal("100", &steps, &["play", &show, "--step"]);
    assert!(text.starts_with("exit 0\n") && text.contains("sent 1 frame "), "{text}");
    let output = run(&["play", &show, "--paused"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("need a terminal: run in the foreground"), "{}", stderr(&output));
}

#[test]
fn the_line_fits_narrow_terminals_and_is_plain_where_asked_to() {
    let short = script("short-desk", "servos 1500 1500\nrocker y=10 z=20 for 500ms\n");
    for columns in [24_usize, 40, 200] {
        let text = at_terminal(&columns.to_string(), &[], &["play", &short]);
        let drawn: Vec<&str> = text.split("\r\u{1b}[K").skip(1).filter(|line| !line.contains('\n')).collect();
        assert!(drawn.len() > 3, "{text:?}");
        assert!(drawn.iter().all(|line| line.chars().count() < columns), "{columns}: {drawn:?}");
    }
    let long = script("long-desk", "rocker y=10 for 2500ms\n");
    let output = run(&["play", &long, "--progress", "plain"]);
    let lines = stderr(&output).lines().filter(|line| line.contains(" / 2.500 s")).count();
    assert!((1..=3).contains(&lines), "{}", stderr(&output));
    assert!(!stderr(&output).contains(['\r', '\u{1b}']));
    // A terminal that becomes narrow during the run, and one that cannot redraw a line.
    let steps = ["wait:rocker x=0 y=10 z=20  servo", "resize:30"];
    let text = at_terminal("120", &steps, &["play", &short, "--speed", "0.2"]);
    let drawn: Vec<&str> = text.split("\r\u{1b}[K").skip(1).filter(|line| !line.contains('\n')).collect();
    let widths: Vec<usize> = drawn.iter().map(|line| line.chars().count()).collect();
    assert!(widths[0] > 30 && widths[widths.len() - 1] < 30, "{drawn:?}");
    let text = in_terminal("dumb", "80", &[], &["play", &long, "--max-late", "5s"]);
    assert!(text.starts_with("exit 0\n") && text.contains("sent ") && !text.contains('\u{1b}'), "{text}");
    assert!(text.contains(" / 2.500 s"), "{text}");
    // A line that is too long is broken between words, and a redrawn one never fills a very narrow
    // terminal.
    let text = at_terminal("50", &[], &["play", &short]);
    let shown = text.split_once("\necho True\n").unwrap().1;
    let lines: Vec<&str> = shown.split(['\n', '\r']).collect();
    assert!(lines.iter().all(|line| line.replace("\u{1b}[K", "").chars().count() <= 50), "{lines:?}");
    assert!(shown.contains("the virtual board received"), "{shown}");
    let text = at_terminal("12", &[], &["play", &short]);
    let drawn = text.split("\r\u{1b}[K").skip(1).filter(|line| !line.contains('\n'));
    assert!(drawn.into_iter().all(|line| line.chars().count() < 12), "{text:?}");
    assert!(text.contains("keys: space pauses, q"), "{text}");
    // Without a terminal there is no redrawn line, and keys do nothing.
    let output = run(&["play", &short]);
    assert!(!stderr(&output).contains(['\r', '\u{1b}']));
}

#[test]
fn long_work_shows_progress_on_a_terminal_only() {
    let folder = std::env::temp_dir().join(format!("motionseq-bar-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    for number in 0..31 {
        let text = "repeat 20000 {\n  servo 1 1500\n  wait 10ms\n}\n";
        fs::write(folder.join(format!("{number}.motion")), text).unwrap();
    }
    let folder = folder.to_str().unwrap();
    let text = in_terminal("xterm", "80", &[], &["test", "--bless", folder]);
    assert!(
        text.contains(" / 31 scripts █") && text.contains("\r\u{1b}[K31 scripts: 31 passed (31 blessed)"),
        "{text}"
    );
    let big = script("big", "repeat 400000 {\n  servo 1 1500\n  wait 10ms\n}\n");
    let render = ["render", &big, "--format", "jsonl", "-o", "/dev/null"];
    let text = in_terminal("xterm", "80", &[], &render);
    assert!(text.contains(" / 400000 frames █") && text.ends_with("\r\u{1b}[K\n"), "{text}");
    assert_eq!(stderr(&run(&render)), "");
}

#[test]
fn keys_work_at_any_frame_rate_and_after_earlier_input() {
    // A frame every half millisecond for a minute.
    let fast = script(
        "fast-keys",
        "baud 4000000\nrocker y=10\nrepeat 120000 { servo 1 1500; servo 3 1600\nwait 500us }\nstop\n",
    );
    let play = ["play", &fast, "--max-events", "1000000"];
    let text = at_terminal("120", &["wait:rocker x=0", "key:q"], &play);
    assert!(text.starts_with("exit 0\nicanon True\n") && text.contains("stopped by q"), "{text}");
    let text = at_terminal("120", &["wait:rocker x=0", "key: ", "wait:paused; space", "key:q"], &play);
    assert!(text.starts_with("exit 0\nicanon True\n"), "{text}");
    // Escape, or an arrow, and then q.
    for typed in ["key:\u{1b}q", "key:\u{1b}[Aq", "key:\u{1b}[1;5Cq", "key:\u{1b}OAq"] {
        let text = at_terminal("120", &["wait:rocker x=0", typed], &["play", &show()]);
        assert!(text.starts_with("exit 0\n") && text.contains("stopped by q"), "{typed:?}: {text}");
    }
}

#[test]
fn the_terminal_of_another_program_is_left_alone() {
    // The terminal that it was started from is not a port.
    let text = at_terminal("120", &[], &["play", &show(), "--port", "/dev/tty"]);
    assert!(text.starts_with("exit 3\nicanon True\necho True\n"), "{text}");
    assert!(text.contains("it is the terminal of this program"), "{text}");
    // A player in the background is killed while another program has changed the terminal's modes.
    let output = Command::new("python3")
        .args(["tests/support/background.py", env!("CARGO_BIN_EXE_motionseq"), "play", &show(), "--max-late", "5s"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(crate::support::stdout(&output), "the other program's modes are there\n");
}

#[test]
fn a_pause_says_where_in_the_script_it_is() {
    let text = at_terminal(
        "120",
        &["wait:rocker x=0", "key: ", "wait:paused (", "key:q"],
        &["play", &show(), "--speed", "0.5"],
    );
    let (at, script) = text.split_once(" s: paused (").unwrap();
    let at: f64 = at.rsplit(|c: char| c != '.' && !c.is_ascii_digit()).next().unwrap().parse().unwrap();
    let script: f64 = script.split(' ').next().unwrap().parse().unwrap();
    assert!((at - 2.0 * script).abs() < 0.01, "{text}");
    // Passes do not get lines of their own.
    let short = script_of_passes();
    let text = at_terminal("120", &["wait:pass 3", "key:q"], &["play", &short, "--loop", "forever"]);
    assert!(
        !text.lines().any(|line| line.trim_start_matches(['\r', '\u{1b}', '[', 'K']).starts_with("pass ")),
        "{text}"
    );
}

fn script_of_passes() -> String {
    script("passes-desk", "servo 2 1500\nwait 300ms\n")
}
