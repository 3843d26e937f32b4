//! When output is colored, and how wide help is on a terminal that does not know its size.

use std::process::Command;

use crate::support::{COLORS, Scratch, code, motionseq, program, run, stderr, stdout};

/// Two scripts that differ.
fn scratch(name: &str) -> Scratch {
    let scratch = Scratch::new(&format!("colors-{name}"));
    scratch.file("old.motion", b"servo 1 1500\nwait 1s\nbuzzer on for 100ms\nwait 1s\nstop\n");
    scratch.file("new.motion", b"servo 1 1600\nwait 1s\nwait 1s\nrocker x=10 for 1s\n");
    scratch
}

#[test]
fn variables_of_other_programs_are_followed_and_the_option_decides() {
    let scratch = scratch("variables");
    let escapes = |args: &[&str], variables: &[(&str, &str)]| {
        let output = motionseq(args).current_dir(&scratch.0).envs(variables.iter().copied()).output().unwrap();
        (stdout(&output) + &stderr(&output)).contains('\u{1b}')
    };
    // A difference, an error of a script, help, and a message about a wrong option.
    for args in
        [&["diff", "old.motion", "new.motion"][..], &["check", "none.motion"], &["check", "-h"], &["fmt", "--x"]]
    {
        for (variables, is_colored) in [
            (&[][..], false),
            (&[("CLICOLOR", "1")], false),
            (&[("CLICOLOR_FORCE", "1")], true),
            (&[("FORCE_COLOR", "1")], true),
            (&[("FORCE_COLOR", "")], false),
            (&[("FORCE_COLOR", "1"), ("NO_COLOR", "1")], false),
            (&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], false),
        ] {
            assert_eq!(escapes(args, variables), is_colored, "{args:?} {variables:?}");
            assert!(!escapes(&[args, &["--color", "never"]].concat(), variables), "{args:?} {variables:?}");
            assert!(escapes(&[args, &["--color=always"]].concat(), variables), "{args:?} {variables:?}");
            assert!(escapes(&[&["--color", "always"], args].concat(), variables), "{args:?} {variables:?}");
        }
    }
}

/// Text without the sequences of colors.
fn plain(text: &str) -> String {
    let mut parts = text.split("\u{1b}[");
    let first = parts.next().unwrap().to_owned();
    parts.fold(first, |text, part| text + part.split_once('m').unwrap().1)
}

#[test]
fn old_values_are_red_and_new_ones_green() {
    let scratch = scratch("values");
    let colored = |args: &[&str]| {
        let run = |color| motionseq(&[args, &["--color", color]].concat()).current_dir(&scratch.0).output().unwrap();
        let (with, without) = (stdout(&run("always")), stdout(&run("never")));
        // Color changes nothing else.
        assert_eq!(plain(&with), without);
        with.replace("\u{1b}[31m", "<red>").replace("\u{1b}[32m", "<green>").replace("\u{1b}[0m", "</>")
    };
    let shown = colored(&["diff", "old.motion", "new.motion"]);
    assert!(shown.contains("servo 1 <red>1500</> -> <green>1600</>\n"), "{shown}");
    assert!(shown.contains("<red>buzzer on</> is removed"), "{shown}");
    assert!(shown.contains("</> is added"), "{shown}");
    assert_eq!(code(&motionseq(&["test", "--bless", "."]).current_dir(&scratch.0).output().unwrap()), 0);
    std::fs::copy(scratch.path("new.motion"), scratch.path("old.motion")).unwrap();
    let shown = colored(&["test", "-v"]);
    assert!(shown.contains("new.motion: <green>ok</>\n"), "{shown}");
    assert!(shown.contains("<red>FAILED</> old.motion: differs from its snapshot\n"), "{shown}");
    assert!(shown.contains("servo 1 <red>1500</> -> <green>1600</>\n"), "{shown}");
    std::fs::write(scratch.path("new.motion"), "servo  1 1600\n").unwrap();
    let shown = colored(&["fmt", "--diff", "new.motion"]);
    assert!(shown.contains("<red>-servo  1 1600</>\n<green>+servo 1 1600</>\n"), "{shown}");
}

#[test]
fn a_terminal_without_a_size_has_80_columns() {
    let widest = |columns: &str, args: &[&str]| {
        let terminal = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/terminal.py");
        let mut command = Command::new("python3");
        command.arg(terminal).arg(columns).arg("--").arg(program()).args(args);
        command.env_remove("COLUMNS").current_dir(env!("CARGO_MANIFEST_DIR"));
        for name in COLORS {
            command.env_remove(name);
        }
        let output = command.env("NO_COLOR", "1").output().unwrap();
        let shown = stdout(&output);
        assert!(shown.starts_with("exit "), "{shown}{}", stderr(&output));
        shown.lines().skip(3).map(|line| line.trim_end().chars().count()).max().unwrap()
    };
    assert!((70..=80).contains(&widest("0", &["help", "ports"])));
    assert!((81..=100).contains(&widest("120", &["help", "play"])));
    assert!((60..=80).contains(&widest("0", &["check", "tests/messages/after.motion"])));
}

#[test]
fn a_pipe_gets_no_colors() {
    assert!(!stdout(&run(&["help"])).contains('\u{1b}'));
}
