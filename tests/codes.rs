//! Every code: its wrong example has exactly this error, its right example has none; and the output
//! of `explain`.

use std::fs;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::support::{run, script, stderr, stdout};
use motionseq::diagnostic::{Code, Diagnostic, Severity};
use motionseq::program::Options;
use motionseq::source::{Disk, Files as _, Sources};
use serde_json::Value;

/// The codes of a script in a folder with a file of phrases.
fn codes(text: &[u8]) -> Vec<Code> {
    codes_of(text, Kind::Script)
}

/// What an example is.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Script,
    Config,
    Board,
}

/// The codes of an example.
fn codes_of(text: &[u8], kind: Kind) -> Vec<Code> {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("motionseq-codes-{}-{number}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("phrases.motion"), "def nod() { servo 2 1700 }\n").unwrap();
    let path = folder.join("x.motion");
    let text = if kind == Kind::Board {
        fs::write(folder.join("robot.toml"), text).unwrap();
        b"board \"robot.toml\"\nwait 1s\n"
    } else {
        text
    };
    if kind == Kind::Config {
        // The program reads the configuration, not the library.
        fs::write(folder.join("motionseq.toml"), text).unwrap();
        fs::write(&path, "servo 1 1500\n").unwrap();
        let output = run(&["check", path.to_str().unwrap()]);
        fs::remove_dir_all(&folder).unwrap();
        let messages = stderr(&output);
        assert_eq!(output.status.code(), Some(if messages.contains(": ok") { 0 } else { 2 }), "{messages}");
        return messages.lines().filter_map(Code::named).collect();
    }
    fs::write(&path, text).unwrap();
    let source = match Disk.read(&path) {
        Ok(source) => source,
        Err(error) => {
            fs::remove_dir_all(&folder).unwrap();
            return vec![Diagnostic::of_source(error).unwrap().1.code];
        }
    };
    let compiled = motionseq::compile(&Sources::new(source, Disk), &Options::default());
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(compiled.timelines.is_empty(), compiled.diagnostics.has_errors());
    let mut codes: Vec<Code> = compiled.diagnostics.iter().map(|diagnostic| diagnostic.code).collect();
    codes.dedup();
    codes
}

#[test]
fn examples_are_wrong_and_right_as_they_say() {
    let mut strange = Vec::new();
    for &code in Code::ALL {
        let (wrong, right) = code.example();
        // Examples too long for a page.
        let more = if code == Code::SourceTooLarge { (64 << 20) + 1 } else { 70_000 };
        let wrong = wrong.replace('…', &"x".repeat(more)).into_bytes();
        let wrong = match wrong.windows(2).position(|bytes| bytes == br"\x") {
            Some(at) => {
                let byte = u8::from_str_radix(std::str::from_utf8(&wrong[at + 2..at + 4]).unwrap(), 16).unwrap();
                [&wrong[..at], &[byte], &wrong[at + 4..]].concat()
            }
            None => wrong,
        };
        let kind = match code.name() {
            name if name.starts_with("config-") => Kind::Config,
            name if name.starts_with("board-") && code != Code::BoardFile => Kind::Board,
            _ => Kind::Script,
        };
        let (wrong, right) = (codes_of(&wrong, kind), codes_of(right.as_bytes(), kind));
        if wrong != [code] || !right.is_empty() {
            strange.push((code, wrong, right));
        }
        assert!(code.explanation().len() > 60 && code.explanation().ends_with('.'), "{code} is not explained");
    }
    assert!(strange.is_empty(), "codes whose examples have other errors: {strange:?}");
}

#[test]
fn explain_prints_the_table_and_each_row() {
    let all = stdout(&run(&["explain"]));
    assert_eq!(all.lines().count(), Code::ALL.len());
    for code in Code::ALL {
        let output = run(&["explain", code.name()]);
        assert_eq!(output.status.code(), Some(0));
        let text = stdout(&output);
        assert!(
            text.contains(code.title()) && text.contains("Wrong:\n    ") && text.contains("Right:\n    "),
            "{text}"
        );
        assert!(all.contains(code.name()));
        assert_eq!(text.contains("# allow: "), code.severity() == Severity::Warning || text.contains("`# allow"));
    }
    // A code that was divided is explained by those that replace it.
    let text = stdout(&run(&["explain", "arguments"]));
    for code in ["missing-argument", "unexpected-argument", "block"] {
        assert!(text.contains(&format!("error {code}: ")), "{text}");
    }
    let output = run(&["explain", "clsh"]);
    assert_eq!(
        (output.status.code(), stderr(&output).as_str()),
        (Some(2), "error: unknown code `clsh`; did you mean `motionseq explain clash`?\n")
    );
}

#[test]
fn explain_prints_the_same_as_data() {
    let codes = |args: &[&str]| -> Vec<Value> {
        let mut json: Value = serde_json::from_str(&stdout(&run(&[args, &["--format", "json"]].concat()))).unwrap();
        serde_json::from_value(json["codes"].take()).unwrap()
    };
    let all = codes(&["explain"]);
    let names: Vec<&str> = all.iter().map(|row| row["code"].as_str().unwrap()).collect();
    assert_eq!(names, Code::ALL.iter().map(|code| code.name()).collect::<Vec<_>>());
    let [clash] = &codes(&["explain", "clash"])[..] else { panic!("one code") };
    let (wrong, right) = Code::Clash.example();
    assert_eq!((&clash["wrong"], &clash["right"]), (&wrong.into(), &right.into()));
    assert_eq!((&clash["severity"], &clash["title"]), (&"error".into(), &Code::Clash.title().into()));
    assert_eq!(codes(&["explain", "arguments"]).len(), 7);
    assert_eq!(run(&["explain", "clsh", "--format", "json"]).status.code(), Some(2));
}

#[test]
fn a_comment_allows_every_warning_on_its_line_and_no_other() {
    for &code in Code::ALL.iter().filter(|code| code.severity() == Severity::Warning && **code != Code::Allow) {
        let (wrong, _) = code.example();
        // Put the comment on each line in turn: on one of them it allows the warning.
        let lines: Vec<&str> = wrong.lines().collect();
        let allowed = (0..lines.len()).filter(|&at| {
            let mut lines: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
            lines[at].push_str(&format!("  # allow: raw-frame, {code}"));
            codes(lines.join("\n").as_bytes()).is_empty()
        });
        assert_eq!(allowed.count(), 1, "{code}");
    }
    // Such a script passes even if warnings are denied, and even with more warnings than are kept.
    let many = script("allowed", &"raw 0x40 1  # allow: raw-frame\nwait 10ms\n".repeat(2_000));
    assert_eq!(run(&["check", "--deny", "warnings", &many]).status.code(), Some(0));
    for (comment, message) in [
        ("servo 2 1900 # allow: clash", "`clash` is an error"),
        ("servo 2 1900 # allow: arguments", "`arguments` is an error"),
        ("servo 2 1900 # allow: nonsense", "there is no warning `nonsense`"),
        ("servo 2 1900 # allow: tilt-range", "`limit servo 2 500..2500`"),
        ("# allow: raw-frame\nraw 0x04 0", "this comment is on a line of its own"),
        ("say \"# allow: raw-frame\"; raw 0x04 0", "raw-frame"),
    ] {
        let output = run(&["check", "--deny", "warnings", &script("not-allowed", comment)]);
        assert_eq!(output.status.code(), Some(1), "{comment}");
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
}

/// The limits that the help of `servo-speed` suggests.
fn suggested(text: &str) -> Vec<String> {
    let compiled = compiled(text);
    let sorted: Vec<_> = compiled.diagnostics.iter().collect();
    let late = sorted.iter().filter(|warning| warning.code == Code::ServoSpeed);
    let limits = late.flat_map(|warning| warning.help.split('`').filter(|part| part.starts_with("limit servo ")));
    let limits: std::collections::BTreeSet<&str> = limits.collect();
    limits.into_iter().map(str::to_owned).collect()
}

fn compiled(text: &str) -> motionseq::Compiled {
    let source = motionseq::source::Source::new("test.motion", text);
    let compiled = motionseq::compile(&source.into(), &motionseq::program::Options::default());
    assert!(!compiled.timelines.is_empty(), "{:?}\n{text}", compiled.diagnostics);
    compiled
}

#[test]
fn the_limit_that_servo_speed_suggests_silences_it() {
    // Single commands, a chain of them, moves (which may arrive late although they last long
    // enough), two servos at once.
    let chain: String = (0..40).map(|at| format!("servo 1 {}\nwait 90ms\n", 1_500 + (at * 37 % 11 - 5) * 90)).collect();
    let moves: String = (0..6)
        .map(|at| format!("servo 3 {} over 150ms ease in-expo\n", if at % 2 == 0 { 2_300 } else { 700 }))
        .collect();
    for text in [
        "servo 1 600\nwait 1s\nservo 1 2400\nwait 100ms\nservo 1 600\n".to_owned(),
        format!("servo 1 500\nwait 1s\n{chain}"),
        format!("servo 3 700\nwait 1s\n{moves}wait 20ms\nservo 3 1500\n"),
        "servos 600 600\nwait 1s\nservos 1400 1900\nwait 50ms\nservos 600 600\nwait 30ms\nservos 900 700\n".to_owned(),
    ] {
        let limits = suggested(&text);
        assert!(!limits.is_empty(), "{text}");
        let limited = limits.join("\n") + "\n" + &text;
        assert_eq!(suggested(&limited), Vec::<String>::new(), "{limited}");
    }
}
