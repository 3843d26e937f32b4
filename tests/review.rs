//! `test --review`, `--filter`, `--prune`, and `--watch`.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Command, Stdio};

use crate::support::{Scratch, code, stderr, stdout, with_motionseq};

const PROGRAM: &str = env!("CARGO_BIN_EXE_motionseq");

/// Two changed scripts, one without a snapshot, and one that is as it was.
fn changed(name: &str) -> Scratch {
    let folder = Scratch::new(name);
    folder.file("nod.motion", b"servo 2 1500\nwait 1s\nservo 2 1700\nwait 1s\nservo 2 1500\n");
    folder.file("drive.motion", b"rocker y=10 for 1s\n");
    folder.file("same.motion", b"servo 1 1500\n");
    let blessed = with_motionseq("motionseq", &folder.0).args(["test", "--bless"]).output().unwrap();
    assert_eq!(code(&blessed), 0, "{}", stderr(&blessed));
    folder.file("nod.motion", b"servo 2 1500\nwait 2s\nservo 2 1700\nwait 1s\nservo 2 1500\n");
    folder.file("drive.motion", b"rocker y=10 for 2s\n");
    folder.file("new.motion", b"servo 3 1500\n");
    folder
}

/// Reviews in a terminal, typing these answers.
fn review(folder: &Scratch, steps: &[&str]) -> String {
    let terminal = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/terminal.py");
    let output = Command::new("python3")
        .args([terminal, "120"])
        .args(steps)
        .args(["--", PROGRAM, "test", "--review"])
        .env("TMPDIR", &folder.0)
        .env("MOTIONSEQ_PORT", "/dev/never")
        .env("NO_COLOR", "1")
        .current_dir(&folder.0)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output).replace('\r', "")
}

fn run(folder: &Scratch, args: &[&str]) -> (i32, String, String) {
    let output = with_motionseq("motionseq", &folder.0).args(args).stdin(Stdio::null()).output().unwrap();
    (code(&output), stdout(&output), stderr(&output))
}

#[test]
fn changes_are_shown_one_by_one_and_only_accepted_ones_are_written() {
    let folder = changed("review");
    let before = fs::read(folder.0.join("nod.motion.frames")).unwrap();
    let steps = ["wait:(1 of 3) drive.motion", "key:a\n", "wait:(2 of 3)", "key:s\n", "wait:(3 of 3)", "key:s\n"];
    let text = review(&folder, &steps);
    assert!(text.starts_with("exit 1\n"), "{text}");
    assert!(text.contains("at 0.000 s (drive.motion:1): rocker x=0 y=10 z=0 for 1.000 s -> 2.000 s\n"), "{text}");
    assert!(
        text.contains("(nod.motion:3): the pause before it is 1.000 s -> 2.000 s, so everything is 1.000 s later\n"),
        "{text}"
    );
    assert!(text.trim_end().ends_with("1 accepted, 2 skipped"), "{text}");
    assert_eq!(fs::read(folder.0.join("nod.motion.frames")).unwrap(), before);
    assert_eq!(run(&folder, &["test", "drive.motion"]).0, 0);
    // What was skipped comes again; nothing is left after it is accepted.
    let text = review(&folder, &["wait:(1 of 2)", "key:a\n", "wait:(2 of 2)", "key:a\n"]);
    assert!(text.starts_with("exit 0\n") && text.trim_end().ends_with("2 accepted, 0 skipped"), "{text}");
    assert_eq!(run(&folder, &["test"]), (0, String::new(), "4 scripts: 4 passed, 0 failed\n".to_owned()));
}

#[test]
fn a_review_draws_both_versions_plays_on_the_virtual_board_and_quits() {
    let folder = changed("review-looks");
    let steps = [
        "wait:(1 of 3)",
        "key:p\n",
        "wait:1-drive.new.svg",
        "key:v\n",
        "wait:the virtual board received",
        "wait:[q]uit?",
        "key:q\n",
    ];
    let text = review(&folder, &steps);
    assert!(text.starts_with("exit 1\n") && text.contains("1-drive.old.svg\n"), "{text}");
    assert!(text.contains("moved 0.0 cm to the right and 20.0 cm forward"), "{text}");
    assert!(text.trim_end().ends_with("0 accepted, 0 skipped, 3 not reviewed"), "{text}");
    // The pictures are gone with the review.
    let mut names = fs::read_dir(&folder.0).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(!names.any(|name| name.to_string_lossy().starts_with("motionseq-review")), "{text}");
}

#[test]
fn a_script_that_changes_during_the_review_is_shown_again() {
    let folder = changed("review-again");
    let edit = format!("run:echo 'rocker y=10 for 3s' > {}", folder.path("drive.motion"));
    let text = review(&folder, &["wait:(1 of 3)", &edit, "key:a\n", "wait:has changed since", "key:q\n"]);
    assert!(text.contains("for 1.000 s -> 3.000 s") && text.contains("0 accepted"), "{text}");
}

#[test]
fn without_a_terminal_the_changes_are_listed() {
    let folder = changed("review-list");
    let (exit, out, error) = run(&folder, &["test", "--review"]);
    assert_eq!((exit, error.as_str()), (1, "3 scripts to review\n"));
    let lines: Vec<&str> = out.lines().filter(|line| !line.starts_with(' ')).collect();
    assert_eq!(
        lines,
        [
            "FAILED drive.motion: differs from its snapshot",
            "FAILED new.motion: has no snapshot",
            "FAILED nod.motion: differs from its snapshot"
        ]
    );
    run(&folder, &["test", "--bless"]);
    assert_eq!(run(&folder, &["test", "--review"]).0, 0);
    // A script that does not compile cannot be accepted.
    folder.file("bad.motion", b"servo 9 1500\n");
    let (exit, out, error) = run(&folder, &["test", "--review"]);
    assert_eq!((exit, error.as_str()), (1, "0 scripts to review, 1 failed\n"));
    assert!(out.starts_with("FAILED bad.motion: does not compile\n"), "{out}");
}

#[test]
fn a_filter_selects_scripts_by_a_part_of_their_path() {
    let folder = changed("filter");
    let (exit, _, error) = run(&folder, &["test", "--filter", "same"]);
    assert_eq!((exit, error.as_str()), (0, "1 script: 1 passed, 0 failed\n"));
    let (exit, _, error) = run(&folder, &["test", "--filter", "waltz"]);
    assert_eq!((exit, error.as_str()), (1, "error: no .motion files whose path contains `waltz` in .\n"));
    // Only what was selected is written.
    run(&folder, &["test", "--bless", "--filter", "new"]);
    assert!(folder.0.join("new.motion.frames").exists());
    assert_eq!(run(&folder, &["test"]).2, "4 scripts: 2 passed, 2 failed\n");
}

#[test]
fn pruning_removes_only_snapshots_without_a_script_that_motionseq_wrote() {
    let folder = changed("prune");
    run(&folder, &["test", "--bless"]);
    fs::remove_file(folder.0.join("nod.motion")).unwrap();
    folder.file("notes.motion.frames", b"my notes\n");
    let (exit, out, error) = run(&folder, &["test", "--bless", "--prune"]);
    assert_eq!(exit, 0);
    assert_eq!(
        out,
        "nod.motion.frames: removed, because it had no script\n\
        warning: notes.motion.frames: has no script, and is kept\n  \
        notes.motion.frames: orphan: motionseq did not write it\n"
    );
    assert_eq!(error, "3 scripts: 3 passed, 0 failed, 1 snapshot without a script, 1 snapshot removed\n");
    assert!(!folder.0.join("nod.motion.frames").exists());
    assert_eq!(fs::read(folder.0.join("notes.motion.frames")).unwrap(), b"my notes\n");
    // Neither a link out of the folder nor a script that is a broken link loses its snapshot.
    let other = Scratch::new("prune-other");
    fs::copy(folder.0.join("drive.motion.frames"), other.0.join("far.motion.frames")).unwrap();
    std::os::unix::fs::symlink(&other.0, folder.0.join("shared")).unwrap();
    std::os::unix::fs::symlink("nowhere", folder.0.join("same.motion.new")).unwrap();
    fs::rename(folder.0.join("same.motion.new"), folder.0.join("same.motion")).unwrap();
    run(&folder, &["test", "--bless", "--prune"]);
    assert!(other.0.join("far.motion.frames").exists() && folder.0.join("same.motion.frames").exists());
    // It is part of `--bless`.
    assert_eq!(run(&folder, &["test", "--prune"]).0, 2);
}

/// A program that watches, and what it writes to standard error.
struct Watching(Child, BufReader<std::process::ChildStderr>);

impl Watching {
    fn start(folder: &Scratch, args: &[&str]) -> Self {
        let mut command = with_motionseq("motionseq", &folder.0);
        let mut child = command.args(args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap());
        Watching(child, lines)
    }

    /// Reads up to a line with this text, and returns what came before it.
    fn until(&mut self, text: &str) -> String {
        let mut read = String::new();
        while !read.contains(text) {
            assert!(self.1.read_line(&mut read).unwrap() > 0, "it ended: {read}");
        }
        read
    }

    /// Presses Ctrl-C.
    fn interrupt(mut self) {
        let id = self.0.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        assert_eq!(self.0.wait().unwrap().signal(), Some(2));
    }
}

/// A failing test leaves no program running.
impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_watched_script_is_checked_after_each_change_of_it_and_of_what_it_uses() {
    let folder = Scratch::new("watch");
    let script = folder.file("dance.motion", b"use \"steps.motion\"\nnod()\n");
    let mut check = Watching::start(&folder, &["check", "--watch", "dance.motion"]);
    // The used file does not exist yet.
    assert!(check.until("Ctrl-C ends").contains("steps.motion"));
    folder.file("steps.motion", b"def nod() { servo 2 1700 }\n");
    let text = check.until("Ctrl-C ends");
    assert!(text.contains("steps.motion changed\n") && text.contains("ok, 1 frame in"), "{text}");
    folder.file("steps.motion", b"def nod() { servo 2 9999 }\n");
    assert!(check.until("Ctrl-C ends").contains("9999"));
    fs::write(&script, "servo 1 1500\nservo 3 1500\n").unwrap();
    let text = check.until("Ctrl-C ends");
    assert!(text.contains("dance.motion changed\n") && text.contains("ok, 2 frames in"), "{text}");
    check.interrupt();
    assert_eq!(run(&folder, &["check", "--watch", "-"]).0, 2);
}

#[test]
fn a_watched_script_is_checked_after_a_change_of_its_board() {
    let folder = Scratch::new("watch-board");
    let board = |most: u32| {
        format!(
            "name = \"Demo\"\nbaud = 9600\n[verb.turn]\naxes = [{{ name = \"to\", range = \"0..{most}\" }}]\nsend = 'T{{to}}\\n'\n"
        )
    };
    folder.file("demo.toml", board(90).as_bytes());
    folder.file("turn.motion", b"board \"demo.toml\"\nturn 90\n");
    let mut check = Watching::start(&folder, &["check", "--watch", "turn.motion"]);
    let text = check.until("Ctrl-C ends");
    assert!(text.contains("ok, 1 frame in"), "{text}");
    folder.file("demo.toml", board(9).as_bytes());
    let text = check.until("Ctrl-C ends");
    assert!(text.contains("demo.toml changed\n") && text.contains("out of range"), "{text}");
    check.interrupt();
}

#[test]
fn watched_folders_have_new_scripts_and_pictures_are_drawn_again() {
    let folder = changed("watch-more");
    let mut test = Watching::start(&folder, &["test", "--watch"]);
    assert!(test.until("Ctrl-C ends").contains("4 scripts: 1 passed, 3 failed\n"));
    folder.file("more.motion", b"servo 1 1500\n");
    assert!(test.until("Ctrl-C ends").contains("5 scripts: 1 passed, 4 failed\n"));
    // A snapshot counts as well.
    run(&folder, &["test", "--bless", "more.motion"]);
    assert!(test.until("Ctrl-C ends").contains("5 scripts: 2 passed, 3 failed\n"));
    test.interrupt();
    let mut plot = Watching::start(&folder, &["plot", "--watch", "same.motion", "-o", "same.html"]);
    plot.until("Ctrl-C ends");
    let first = fs::read_to_string(folder.0.join("same.html")).unwrap();
    assert!(first.contains("<meta http-equiv=\"refresh\""), "the page reloads itself");
    folder.file("same.motion", b"servo 1 1500\nwait 1s\nservo 1 1700\n");
    plot.until("Ctrl-C ends");
    assert_ne!(fs::read_to_string(folder.0.join("same.html")).unwrap(), first);
    plot.interrupt();
    run(&folder, &["plot", "same.motion", "-o", "same.html"]);
    assert!(!fs::read_to_string(folder.0.join("same.html")).unwrap().contains("refresh"));
    assert_eq!(run(&folder, &["plot", "--watch", "same.motion"]).0, 2);
}
