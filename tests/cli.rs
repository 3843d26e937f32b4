//! The program as a user runs it: `check`, `render`, and files that are not scripts.

use std::fs::{self, File};
use std::io::Write;
use std::process::{Command, Output, Stdio};

use crate::support::{Scratch, code, motionseq, run, script, stderr, stdout};

/// Runs the program with at most 128 MiB of memory.
fn run_small(args: &[&str]) -> Output {
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -v 131072; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_motionseq")]).args(args);
    shell.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null()).output().unwrap()
}

const HELLO: &str = "scripts/hello.motion";

#[test]
fn render_prints_the_listing() {
    let output = run(&["render", HELLO]);
    let text = stdout(&output);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 22);
    assert_eq!(lines[0], "0.500000\tFF FE 02 03 01 05 DC E7\tservo 1 1500");
    assert_eq!(lines[1], "0.500000\tFF FE 03 08 01 00 0A 00 00 00 32 01 49\trocker x=10 y=0 z=50");
    assert_eq!(lines[2], "0.550000\tFF FE 03 08 01 00 0A 00 00 00 32 01 49\trocker x=10 y=0 z=50\trefresh");
    assert_eq!(lines[21], "1.500000\tFF FE 03 08 01 00 00 00 00 00 00 01 0D\tstop");
    assert_eq!((code(&output), stderr(&output).as_str()), (0, ""));
}

#[test]
fn the_three_formats_say_the_same() {
    let scratch = Scratch::new("formats");
    let listing = stdout(&run(&["render", HELLO]));
    let hex = stdout(&run(&["render", HELLO, "--format", "hex"]));
    let columns: Vec<String> =
        listing.lines().map(|line| line.split('\t').take(2).collect::<Vec<_>>().join("\t")).collect();
    assert_eq!(hex.lines().collect::<Vec<_>>(), columns);
    let bytes: Vec<u8> = columns
        .iter()
        .flat_map(|line| line.split('\t').nth(1).unwrap().split(' '))
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect();
    assert_eq!(run(&["render", HELLO, "--format", "bin"]).stdout, bytes);
    let file = scratch.path("hello.bin");
    assert_eq!(code(&run(&["render", HELLO, "--format", "bin", "-o", &file])), 0);
    assert_eq!(fs::read(file).unwrap(), bytes);
}

#[test]
fn check_counts_what_it_found() {
    let scratch = Scratch::new("check");
    let good = run(&["check", HELLO]);
    assert_eq!((code(&good), stderr(&good).as_str()), (0, "scripts/hello.motion: ok, 22 frames in 1.500 s\n"));
    assert_eq!(stdout(&good), "");
    let warning = scratch.file("warning.motion", b"rocker x=1\nwait 1s\n");
    let bad = scratch.file("bad.motion", b"servoo 1 1500\nservo 1 9999\nrocker x=1\n");
    // Every file is checked, even if an earlier one has errors.
    let all = run(&["check", &bad, &warning, HELLO]);
    let text = stderr(&all);
    assert_eq!(code(&all), 1);
    for part in [
        "did you mean `servo`?",
        "bad.motion: 2 errors; motionseq explain unknown-word\n",
        "warning.motion: 1 warning; motionseq explain left-running\n",
        "hello.motion: ok",
    ] {
        assert!(text.contains(part), "{part} is not in:\n{text}");
    }
    assert_eq!(code(&run(&["check", &warning])), 0);
    let denied = run(&["check", "--deny", "warnings", &warning]);
    assert_eq!(code(&denied), 1);
    assert!(stderr(&denied).contains("has warnings, which `--deny warnings` forbids"));
    assert!(stderr(&run(&["check", "-q", "--deny", "warnings", &warning])).contains("left-running"));
    // `-q` hides warnings, but never errors.
    assert_eq!(stderr(&run(&["check", "-q", &warning])), "");
    assert!(stderr(&run(&["check", "-q", &bad])).contains("servoo"));
}

#[test]
fn a_script_comes_from_standard_input_too() {
    let mut child = motionseq(&["render", "-"]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"servo 1 1500\n").unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(stdout(&output), "0.000000\tFF FE 02 03 01 05 DC E7\tservo 1 1500\n");
}

#[test]
fn colors_are_asked_for() {
    let scratch = Scratch::new("colors");
    let bad = scratch.file("bad.motion", b"servoo\n");
    let escapes = |args: &[&str]| stderr(&run(args)).contains('\u{1b}');
    assert!(!escapes(&["check", &bad]), "no color in a pipe");
    assert!(escapes(&["check", &bad, "--color", "always"]));
    assert!(!escapes(&["check", &bad, "--color", "never"]));
}

#[test]
fn a_wrong_command_line_is_exit_2() {
    for args in [
        &["fly"][..],
        &["render"],
        &["render", HELLO, "--format", "morse"],
        &["check", HELLO, "--deny", "everything"],
        &[],
    ] {
        let output = run(args);
        assert_eq!(code(&output), 2, "{args:?}");
        assert!(!output.stderr.is_empty(), "{args:?} says what is wrong");
    }
}

#[test]
fn help_shows_an_example_of_every_command() {
    for command in ["check", "render", "play"] {
        let help = stdout(&run(&[command, "--help"]));
        assert!(help.contains(&format!("motionseq {command} scripts/hello.motion")), "{help}");
    }
    assert_eq!(stdout(&run(&["--version"])), format!("motionseq {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn files_that_are_not_scripts_are_refused_with_a_reason() {
    let scratch = Scratch::new("bad-files");
    let fifo = scratch.path("fifo.motion");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let latin = scratch.file("latin.motion", b"servo 1 1500\nsay \"gr\xFC\xDF\"\n");
    let huge = scratch.path("huge.motion");
    File::create(&huge).unwrap().set_len(1 << 30).unwrap();
    let brackets = scratch.file("brackets.motion", &vec![b'('; 3_000_000]);
    let blocks = scratch.file("blocks.motion", &b"{ ".repeat(1_500_000));
    let cases = [
        (scratch.path("missing.motion"), "no such file or directory"),
        (scratch.0.to_str().unwrap().to_owned(), "it is a folder"),
        (fifo, "not a regular file"),
        ("/dev/null".to_owned(), "not a regular file"),
        (latin, "the byte 0xFC is not UTF-8 text"),
        (huge, "larger than 64 MiB"),
        (brackets, "nested more than 64 deep"),
        (blocks, "nested more than 64 deep"),
    ];
    for (file, words) in cases {
        for command in ["check", "render", "play"] {
            // `check` accepts folders, and checks each script in them.
            let words = if command == "check" && words == "it is a folder" { "not a regular file" } else { words };
            let output = run_small(&[command, &file]);
            let text = stderr(&output);
            assert_eq!(code(&output), 1, "{command} {file}: {text}");
            assert!(text.contains(words), "{command} {file}: {text}");
            assert_eq!(stdout(&output), "");
        }
    }
}

#[test]
fn hostile_scripts_stay_small() {
    let scratch = Scratch::new("hostile");
    let cases = [
        ("nul.motion", vec![0; 3_000_000], "a NUL byte"),
        ("long_line.motion", b"servo 1 1500 ".repeat(5_000), "needs a line of its own"),
        ("many_errors.motion", b"servoo\n".repeat(10_000), "and 9500 more errors not shown"),
        ("far.motion", b"at 1000000000000000000000000000000s stop\n".to_vec(), "at most 15 digits"),
        ("minus.motion", [&b"servo 1 "[..], &b"-".repeat(50_000), b"5\n"].concat(), "error"),
        ("quotes.motion", b"\"".repeat(50_001), "no closing quotation mark"),
        ("texts.motion", [&b"say "[..], &b"\"\"".repeat(30_000), b"\n"].concat(), "no space between"),
        ("blank_lines.motion", [&b"stop now\n"[..], &b"\n".repeat(1_000_000), b"# x"].concat(), "takes no arguments"),
        ("long.motion", [&b"raw "[..], &b"1 ".repeat(1_000_000)].concat(), "longer than 64 KiB"),
        ("word.motion", b"s".repeat(60_000), "there is no command"),
        ("not.motion", [&b"if "[..], &b"not ".repeat(50_000), b"true { stop }\n"].concat(), "error"),
    ];
    for (name, content, words) in cases {
        let file = scratch.file(name, &content);
        let output = run_small(&["check", &file]);
        let text = stderr(&output);
        assert_eq!(code(&output), 1, "{name}: {}", text.chars().take(2_000).collect::<String>());
        assert!(text.contains(words), "{name}: {}", text.chars().take(2_000).collect::<String>());
        assert!(text.len() < 500_000, "{name} prints {} bytes", text.len());
    }
}

#[test]
fn too_many_events_are_counted_before_they_are_added() {
    let scratch = Scratch::new("events");
    let day = scratch.file("day.motion", b"refresh 10ms\nrocker x=1 for 24h\n");
    let output = run_small(&["check", "--max-events", "1000000", &day]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("sends more than 1000000 frames"));
    let small = run(&["check", "--max-events", "22", HELLO]);
    assert_eq!(code(&small), 0, "{}", stderr(&small));
    assert_eq!(code(&run(&["check", "--max-events", "21", HELLO])), 1);
}

#[test]
fn only_frames_that_are_sent_count_as_events() {
    let scratch = Scratch::new("sent-events");
    for (text, sent) in [
        // A move to the current value, and samples that would repeat the last one.
        ("servo 1 1500\nservo 1 1500 over 10s\nrepeat 50 { servo 1 1500 over 10ms }\n", 1),
        ("servo 1 1500 -> 1503 over 10s\n", 4),
        // The last refresh would be due at the end, which is sent anyway.
        ("rocker x=1 for 1s\n", 1 + 19 + 1),
        // `say` and `expect` are not sent; the requests that start and stop reports are.
        ("servo 1 1500\nrepeat 5 { say \"a\" }\nexpect voltage > 9V\n", 3),
        // `on abort` has its own limit.
        ("repeat 4 as i { servo 1 (1500 + i)\nwait 10ms }\non abort { servo 1 1500\nwait 10ms\nservo 1 1000 }\n", 4),
    ] {
        let file = scratch.file("sent.motion", text.as_bytes());
        let enough = run(&["check", "--max-events", &sent.to_string(), &file]);
        assert_eq!(code(&enough), 0, "{text}: {}", stderr(&enough));
        let listing = run(&["render", &file]);
        assert_eq!(stdout(&listing).lines().count(), sent, "{text}");
        assert_eq!(code(&run(&["check", "--max-events", &(sent - 1).to_string(), &file])), 1, "{text}");
    }
}

#[test]
fn times_of_options_are_read_as_those_of_scripts() {
    for (options, words) in [
        (vec!["play", HELLO, "--max-late", "18446744073709551615s1000ms"], "write a time such as 50ms or 1s"),
        (vec!["play", HELLO, "--max-late", "1 s"], "write a time such as 50ms or 1s"),
        (vec!["play", HELLO, "--max-late", "1d"], "write a time such as 50ms or 1s"),
        (vec!["play", HELLO, "--max-late", "1s1s"], "write a time such as 50ms or 1s"),
        (vec!["play", HELLO, "--max-late", "11s"], "write 10s or less"),
        (vec!["play", HELLO, "--max-late", "999999999999999h"], "write 10s or less"),
        (vec!["play", HELLO, "--max-late", "0.4us"], "write 1ms or more"),
        (vec!["play", HELLO, "--fault", "unplug@18446744073709551615s1000ms"], "unknown fault"),
        (vec!["play", HELLO, "--fault", "stall@1s1s"], "unknown fault"),
        (vec!["play", HELLO, "--fault", "battery=6V@25h"], "unknown fault"),
        (vec!["board", "--link", "x", "--report-every", "18446744073709551615s1000ms"], "write a time such as 500ms"),
        (vec!["board", "--link", "x", "--report-every", "1h"], "write a time from 10ms to 10s"),
        (vec!["render", HELLO, "--lead-in", "18446744073709551615s1000ms"], "write a time such as 500ms"),
        (vec!["render", HELLO, "--lead-in", "1ms1s"], "from long to short"),
        (vec!["render", HELLO, "--lead-in", "25h"], "too long"),
        (vec!["render", HELLO, "--from", "18446744073709551615s1000ms"], "is neither a time such as 1.5s"),
        (vec!["latency", "--for", "18446744073709551615s1000ms"], "write a time from 200ms to 1h"),
        (vec!["latency", "--for", "1s1s"], "write a time from 200ms to 1h"),
    ] {
        let output = run(&options);
        assert_eq!(code(&output), 2, "{options:?}");
        assert!(stderr(&output).contains(words), "{options:?}: {}", stderr(&output));
    }
}

/// Results of a pass besides frames, each in quantities beyond any memory. They are counted before
/// the loop runs if the number of passes is a literal, and while it runs if the number is computed.
#[test]
fn the_results_of_a_pass_are_bounded() {
    let scratch = Scratch::new("left-behind");
    let long = "x".repeat(60_000);
    for line in [
        "mark x".to_owned(),
        format!("mark {long}"),
        "say \"a\"".to_owned(),
        format!("say \"{long}\""),
        "expect voltage > 9V".to_owned(),
        format!("expect voltage > 9V \"{long}\""),
        "expect voltage > 9V within 1us".to_owned(),
    ] {
        for text in [
            format!("repeat 33000000 {{\n{line}\nwait 2us\n}}\n"),
            format!("repeat (33000 * 1000) as i {{\nif i >= 0 {{\n{line}\nwait 2us\n}}\n}}\n"),
            format!("def f() {{\n{line}\nwait 2us\n}}\nrepeat (33000 * 1000) {{ f() }}\n"),
        ] {
            let file = scratch.file("left.motion", text.as_bytes());
            let output = run_small(&["check", &file]);
            let errors: String = stderr(&output).chars().take(1_000).collect();
            assert_eq!(code(&output), 1, "{line:.40}: {errors}");
            assert!(errors.contains("too-many-events\n"), "{line:.40}: {errors}");
        }
    }
}

#[test]
fn a_result_that_cannot_be_written_is_reported() {
    let full = || File::options().write(true).open("/dev/full").unwrap();
    let output = motionseq(&["render", HELLO])
        .stdout(full())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
        .wait_with_output()
        .unwrap();
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("cannot write standard output"));
    // The messages have no reader: no panic, and the same exit code.
    let status = motionseq(&["check", HELLO]).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    let output = run(&["render", HELLO, "-o", "/no/such/folder/x"]);
    assert_eq!(code(&output), 2);
}

#[test]
fn a_file_name_does_not_draw_on_the_terminal() {
    let scratch = Scratch::new("names");
    let evil = scratch.file("e\u{1b}[31mvil\nok.motion", b"servo 1 1500\n");
    let text = stderr(&run(&["check", &evil]));
    assert!(text.contains("e\\u{1b}[31mvil\\nok.motion: ok"), "{text}");
    assert_eq!(text.lines().count(), 1);
    let missing = stderr(&run(&["check", "no\u{1b}such\nfile"]));
    assert!(missing.lines().count() == 1 && !missing.contains('\u{1b}'), "{missing}");
}

#[test]
fn a_reader_of_a_listing_may_stop_early() {
    let shell = format!("{} render scripts/wheels.motion | head -1", env!("CARGO_BIN_EXE_motionseq"));
    let output = Command::new("sh").args(["-c", &shell]).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert_eq!(stdout(&output).lines().count(), 1);
    assert_eq!(stderr(&output), "");
}

#[test]
fn warnings_are_summed_up_by_code() {
    let scratch = Scratch::new("many-warnings");
    let raw = "raw 0x04 0\nwait 10ms\n".repeat(300);
    let text = format!("{raw}together {{ wait 10ms }}\ntogether {{ wait 10ms }}\n");
    let many = scratch.file("many.motion", text.as_bytes());
    let output = run(&["check", &many]);
    let shown = stderr(&output);
    let full = |code: &str, text: &str| text.lines().filter(|line| *line == code).count();
    assert_eq!((code(&output), full("raw-frame", &shown), full("wait-in-together", &shown)), (0, 3, 2), "{shown}");
    assert!(shown.contains("\nand 297 more `raw-frame` warnings; `--all` shows them\n"), "{shown}");
    assert!(shown.contains("many.motion: 302 warnings"), "{shown}");
    // The same for commands that compile a script as a first step.
    let shown = stderr(&run(&["render", &many, "-o", "/dev/null"]));
    assert!(full("raw-frame", &shown) == 3 && shown.contains("and 297 more"), "{shown}");
    let shown = stderr(&run(&["check", "--all", &many]));
    assert!(full("raw-frame", &shown) == 300 && !shown.contains(" more "), "{shown}");
    let shown = stderr(&run(&["check", "-q", &many]));
    assert_eq!(shown, "");
    // A run shows one line for all warnings, and plays.
    let output = run(&["play", &many, "--speed", "10"]);
    let shown = stderr(&output);
    assert_eq!((code(&output), full("raw-frame", &shown)), (0, 0), "{shown}");
    let line = "many.motion: 302 warnings (2 wait-in-together, 300 raw-frame); `--all` shows them\n";
    assert!(shown.starts_with("warning: ") && shown.contains(line), "{shown}");
    // Errors are always shown, all of them.
    let wrong = scratch.file("wrong.motion", [raw.as_bytes(), &b"servo 1 1\n".repeat(20)].concat().as_slice());
    let shown = stderr(&run(&["play", &wrong]));
    assert_eq!((full("out-of-range", &shown), full("raw-frame", &shown)), (20, 0), "{shown}");
    assert_eq!(full("out-of-range", &stderr(&run(&["check", &wrong]))), 20);
}

#[test]
fn commands_that_must_end_offer_no_endless_loop() {
    for command in ["render", "plot"] {
        let output = run(&[command, "--help"]);
        assert!(!stdout(&output).contains("forever"), "{}", stdout(&output));
        let output = run(&[command, HELLO, "--loop", "forever"]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("write a number of passes, 1 or more"), "{}", stderr(&output));
        let output = run(&[command, HELLO, "--loop", "100000000"]);
        assert!(code(&output) == 2 && !stderr(&output).contains("forever"), "{}", stderr(&output));
    }
    assert!(stdout(&run(&["play", "--help"])).contains("forever"));
}

#[test]
fn a_closing_frame_names_the_first_raw_frame_in_time() {
    // The raw frame of line 1 is sent with the last sample of the move, and after that of line 3.
    let path = script("closing", "at 0.6s raw 3 0\nat 0.3s yawhold x=0 -> 13 y=0 -> 0 over 300ms\nat 0.5s raw 2 1\n");
    let frames = stdout(&run(&["render", "--format", "jsonl", &path]));
    let last = frames.lines().last().unwrap();
    assert!(last.contains("\"kind\":\"closing\"") && last.contains("\"line\":3"), "{last}");
}
