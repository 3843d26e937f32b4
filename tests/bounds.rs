//! Scripts with very many names and mistakes: lookups must not search everything. With linear
//! searches, each of these tests would take minutes.

use std::fmt::Write as _;
use std::process::Command;

use motionseq::diagnostic::Code;
use motionseq::program::Options;
use motionseq::source::{Source, Sources};

/// The codes of a script's errors and warnings, each once, and the number of errors.
fn check(text: String) -> (Vec<Code>, usize) {
    let compiled = motionseq::compile(&Sources::from(Source::new("x.motion", text)), &Options::default());
    let mut codes: Vec<Code> = compiled.diagnostics.iter().map(|diagnostic| diagnostic.code).collect();
    codes.sort_unstable();
    codes.dedup();
    (codes, compiled.diagnostics.errors())
}

/// A text of `count` parts with a prefix and a suffix.
fn parts(before: &str, count: usize, part: impl Fn(usize) -> String, after: &str) -> String {
    let mut text = before.to_owned();
    for at in 0..count {
        let _ = write!(text, "{}", part(at));
    }
    text + after
}

#[test]
fn names_of_one_block() {
    const MANY: usize = 60_000;
    for text in [
        parts("{\n", MANY, |at| format!("let a{at} = {at}\nwait (a{at} * 1us / {MANY})\n"), "stop\n}\n"),
        parts("{\n", MANY, |at| format!("mark a{at}\n"), "at a7 stop\n}\n"),
        parts("stop\n", MANY, |at| format!("let a{at} = {at}\nwait (a{at} * 1us / {MANY})\n"), ""),
        parts("stop\n", MANY, |at| format!("mark a{at}\n"), ""),
        parts("stop\n{\n", MANY, |at| format!("{{\nmark a{at}\n}}\n"), "}\n"),
    ] {
        assert_eq!(check(text), (vec![], 0));
    }
}

#[test]
fn unknown_names() {
    const MANY: usize = 20_000;
    let lets = parts("", MANY, |at| format!("let name_{at} = {at}\n"), "");
    let defs = parts("", MANY, |at| format!("def name_{at}() {{ stop }}\n"), "");
    for (before, line) in [
        (&lets, "servo 1 (nmae_{} + 1)\n"),
        (&lets, "at nmae_{} stop\n"),
        (&lets, "let other_{} = nmae_{}\n"),
        (&lets, "servo 1 other_{}\n"),
        (&defs, "nmae_{}()\n"),
        (&defs, "nmae_{} 5\n"),
        (&String::new(), "let other_{} = nothing_{}\n"),
    ] {
        let (codes, errors) = check(parts(before, MANY, |at| line.replace("{}", &at.to_string()), ""));
        assert!(matches!(codes.as_slice(), [Code::UnknownName | Code::UnknownWord]), "{line}: {codes:?}");
        assert_eq!(errors, MANY, "{line}");
    }
}

#[test]
fn chains_and_circles_of_defs() {
    const MANY: usize = 30_000;
    let first = "def f0() { stop }\n";
    let above = parts(first, MANY, |at| format!("def f{}() {{ f{at}() }}\n", at + 1), "stop\n");
    assert_eq!(check(above), (vec![Code::Unused], 0));
    let below =
        parts("", MANY, |at| format!("def f{at}() {{ f{}() }}\n", at + 1), &format!("def f{MANY}() {{ stop }}\n"));
    assert_eq!(check(below), (vec![Code::UnknownName], MANY));
    let circle = parts("", MANY, |at| format!("def f{at}() {{ f{}() }}\n", (at + 1) % MANY), "");
    assert_eq!(check(circle), (vec![Code::Recursion], MANY - 1));
}

#[test]
fn parameters() {
    const MANY: usize = 300_000;
    let head = parts("def f(", MANY, |at| format!("p{at} = 1,\n"), "last = 2) { servo 1 (1500 + last) }\n");
    let call = parts("f(\n", MANY, |at| format!("p{at} = 2,\n"), "last = 3)\n");
    assert_eq!(check(head.clone() + &call), (vec![], 0));
    assert_eq!(check(head + "f()\n"), (vec![], 0));
}

#[test]
fn holds_that_end_at_one_moment() {
    const MANY: usize = 100_000;
    let text = parts("together {\n", MANY, |_| "buzzer on for 1s\nat 1s say \"a\"\n".to_owned(), "}\n");
    assert_eq!(check(text), (vec![Code::Clash], MANY));
}

/// A move to the current value sends nothing, but still counts.
#[test]
fn moves_that_send_nothing() {
    for passes in ["33000000", "(33000 * 1000)"] {
        let text = format!("repeat {passes} {{ servo 1 1500 -> 1500 over 1us }}\n");
        assert_eq!(check(text), (vec![Code::TooManyEvents], 1));
    }
    // A command without duration is one frame, not a move.
    let text = "repeat 1200000 { servo 1 1500\nwait 5ms }\nrepeat 400000 { rocker x=1 for 5ms\nwait 5ms }\n";
    assert_eq!(check(text.to_owned()), (vec![], 0));
}

/// A line of a block takes as little memory as one outside of all blocks: at most 200 bytes.
#[test]
fn memory_of_the_lines_of_a_block() {
    const PAIRS: usize = 250_000;
    const LINE: usize = 200;
    // The program, its stacks, and what the allocator reserves for a thread.
    const ITSELF: usize = 256 << 20;
    let lines = |before: &str, after: &str| {
        parts(before, PAIRS, |at| format!("servo 1 {}\nwait 1ms  # {at}\n", 1_000 + at % 1_000), after)
    };
    for (name, text) in [
        ("repeat", lines("repeat 2 {\n", "}\n")),
        ("def", lines("def f() {\n", "}\nf()\n")),
        ("if", lines("if 1 > 0 {\n", "} else {\nstop\n}\n")),
        ("deep", lines("repeat 1 {\ntogether {\nstop\n{\n", "}\n}\n}\n")),
    ] {
        let path = std::env::temp_dir().join(format!("motionseq-memory-{name}-{}.motion", std::process::id()));
        std::fs::write(&path, &text).unwrap();
        let shell = format!("ulimit -v {}; exec \"$0\" check \"$1\"", (ITSELF + 2 * PAIRS * LINE) >> 10);
        let mut shell_command = Command::new("sh");
        let output = shell_command.args(["-c", &shell, env!("CARGO_BIN_EXE_motionseq")]).arg(&path).output().unwrap();
        std::fs::remove_file(&path).unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", said.chars().take(2_000).collect::<String>());
    }
}
