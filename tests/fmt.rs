//! `fmt`: what it changes, and what it never changes.

use std::fs;
use std::io::Write;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::support::{Scratch, motionseq, run, script, stderr, stdout};
use motionseq::diagnostic::Diagnostics;
use motionseq::program::Options;
use motionseq::source::{Disk, Files as _, Source, Sources};
use motionseq::syntax;
use proptest::prelude::*;

fn formatted(source: &Source) -> Option<String> {
    syntax::format(source, &mut Diagnostics::default())
}

/// The meaning of a script: its frames and texts, or its errors without their places.
fn meaning(source: Source) -> String {
    let compiled = motionseq::compile(&Sources::from(source), &Options::default());
    match compiled.timelines.first() {
        Some(timeline) => {
            let frames: Vec<_> = timeline
                .events
                .iter()
                .chain(&timeline.abort)
                .map(|event| (event.at, &event.command, event.kind))
                .collect();
            let said: Vec<_> = timeline.cues.iter().map(|cue| (cue.at, &cue.text)).collect();
            format!("{frames:?} {said:?} {}", timeline.end)
        }
        None => {
            // Formatting may move the line that a message names, and change the spaces of one that it quotes.
            let message = |text: &str| {
                let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
                match text.split_once(" on line ") {
                    Some((before, after)) => {
                        format!("{before}{}", after.trim_start_matches(|c: char| c.is_ascii_digit()))
                    }
                    None => text,
                }
            };
            let errors = compiled.diagnostics.iter().map(|error| format!("{} {}", error.code, message(&error.message)));
            errors.collect::<Vec<_>>().join("\n")
        }
    }
}

/// Every comment, in order, and the number of lines that are not empty.
fn comments_and_lines(text: &str) -> (Vec<String>, usize) {
    // A `#` in a string counts too, on both sides, with all spaces after it.
    let comments = text.lines().filter_map(|line| Some(line.split_once('#')?.1));
    let comments = comments.map(|comment| comment.split_whitespace().collect::<Vec<_>>().join(" "));
    (comments.collect(), text.lines().filter(|line| !line.trim_start_matches('\u{FEFF}').trim().is_empty()).count())
}

fn is_kept(path: &str, text: &str) {
    let source = |text: &str| Disk.read(Path::new(path)).unwrap().with_text(text);
    let once = formatted(&source(text)).unwrap();
    assert_eq!(formatted(&source(&once)).unwrap(), once, "{path}: twice is once");
    assert_eq!(meaning(source(&once)), meaning(source(text)), "{path}");
    assert_eq!(comments_and_lines(&once), comments_and_lines(text), "{path}");
    assert!(once.is_empty() || once.ends_with('\n') && !once.ends_with("\n\n"), "{path}");
}

#[test]
fn formatted_scripts_look_like_this() {
    let _alone = crate::support::one_glob_at_a_time();
    insta::with_settings!({ snapshot_path => "fmt", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("fmt/*.motion", |path| {
            let source = Disk.read(path).unwrap();
            insta::assert_snapshot!("fmt", formatted(&source).unwrap());
        });
    });
}

/// Every readable script of the project.
fn scripts() -> Vec<PathBuf> {
    let folders = ["scripts", "scripts/lib", "tests/frames", "tests/trees", "tests/fmt"];
    let files =
        folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|extension| extension == "motion")).collect()
}

#[test]
fn formatting_never_changes_what_a_script_sends() {
    let mut count = 0;
    for path in scripts() {
        let Ok(source) = Disk.read(&path) else { continue };
        if formatted(&source).is_some() {
            is_kept(path.to_str().unwrap(), source.text());
            count += 1;
        }
    }
    assert!(count > 150, "only {count} scripts were looked at");
}

#[test]
fn the_scripts_that_are_shipped_are_formatted() {
    let paths: Vec<_> = scripts().into_iter().filter(|path| path.starts_with("scripts")).collect();
    let mut args = vec!["fmt", "--check"];
    args.extend(paths.iter().map(|path| path.to_str().unwrap()));
    let output = run(&args);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn files_are_replaced_whole_and_keep_their_mode_and_links() {
    let path = script("fmt", "servo   1 1500\n");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
    let link = format!("{path}.link.motion");
    let _ = fs::remove_file(&link);
    symlink(&path, &link).unwrap();
    let output = run(&["fmt", "--check", &link]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("is not formatted"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(&path).unwrap(), "servo   1 1500\n");
    assert_eq!(run(&["fmt", &link]).status.code(), Some(0));
    assert_eq!(fs::read_to_string(&path).unwrap(), "servo 1 1500\n");
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    assert_eq!(run(&["fmt", "--check", &link]).status.code(), Some(0));
    // An unreadable script stays unchanged, and its errors are shown; the others are formatted.
    let broken = script("fmt-broken", "servo   1 1500\n{\n");
    let other = script("fmt-other", "stop;stop\n");
    let output = run(&["fmt", &broken, &other]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("unclosed"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(&broken).unwrap(), "servo   1 1500\n{\n");
    assert_eq!(fs::read_to_string(&other).unwrap(), "stop; stop\n");
    assert_eq!(run(&["fmt", "/no/such.motion"]).status.code(), Some(1));
    assert_eq!(run(&["fmt", "-", "-"]).status.code(), Some(2));
}

#[test]
fn standard_input_goes_to_standard_output() {
    let mut child = motionseq(&["fmt", "-"]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"at 1s servo  1   1500").unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stdout(&output).as_str()), (Some(0), "at 1s servo 1 1500\n"));
}

#[test]
fn a_difference_shows_what_would_change() {
    let scratch = Scratch::new("fmt-difference");
    let formatted = scratch.file("a.motion", b"servo 1 1500\n");
    let text = "wait   1s\nstop\nstop\nstop\nstop\nstop\nstop\nservo  1 1500";
    let other = scratch.file("b.motion", text.as_bytes());
    let output = motionseq(&["fmt", "--diff", "."]).current_dir(&scratch.0).output().unwrap();
    let shown = "\
--- b.motion
+++ b.motion
@@ -1,8 +1,8 @@
-wait   1s
+wait 1s
 stop
 stop
 stop
 stop
 stop
 stop
-servo  1 1500
\\ No newline at end of file
+servo 1 1500
";
    assert_eq!((output.status.code(), stdout(&output).as_str()), (Some(1), shown));
    assert_eq!(fs::read_to_string(&other).unwrap(), text);
    let output = run(&["fmt", "--diff", &formatted]);
    assert_eq!((output.status.code(), stdout(&output)), (Some(0), String::new()));
    // Lines that are far apart are in parts of their own, with three lines around them.
    scratch.file("b.motion", text.replace("stop\n", "stop\nstop\n").as_bytes());
    let output = motionseq(&["fmt", "--diff", "b.motion"]).current_dir(&scratch.0).output().unwrap();
    let parts: Vec<String> = stdout(&output).lines().filter(|line| line.starts_with("@@")).map(str::to_owned).collect();
    assert_eq!(parts, ["@@ -1,4 +1,4 @@", "@@ -11,4 +11,4 @@"]);
}

#[test]
fn a_folder_is_all_scripts_below_it() {
    let scratch = Scratch::new("fmt-folder");
    fs::create_dir_all(scratch.0.join("sub")).unwrap();
    scratch.file("a.motion", b"servo  1 1500\n");
    scratch.file("sub/b.motion", b"stop;stop\n");
    scratch.file("notes.txt", b"servo  1\n");
    // A test case that cannot be read is no failure.
    scratch.file("wrong.motion", b"# expect-error: unclosed\n{\n");
    let fmt = |args: &[&str]| motionseq(&[&["fmt"], args].concat()).current_dir(&scratch.0).output().unwrap();
    let output = fmt(&["--check", "."]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("3 scripts checked, 2 not formatted"), "{}", stderr(&output));
    assert_eq!(fmt(&["."]).status.code(), Some(0));
    assert_eq!(fs::read_to_string(scratch.path("a.motion")).unwrap(), "servo 1 1500\n");
    assert_eq!(fs::read_to_string(scratch.path("sub/b.motion")).unwrap(), "stop; stop\n");
    assert_eq!(fs::read_to_string(scratch.path("notes.txt")).unwrap(), "servo  1\n");
    assert_eq!(fmt(&["--check", "."]).status.code(), Some(0));
    fs::create_dir_all(scratch.0.join("empty")).unwrap();
    assert_eq!(fmt(&["empty"]).status.code(), Some(1));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Adding spaces, comments and empty lines to a script does not change the result.
    #[test]
    fn spaces_and_comments_change_nothing(which in 0..1_000_usize, seed in prop::collection::vec(0..8_u8, 1..200)) {
        let scripts = scripts();
        let path = &scripts[which % scripts.len()];
        let Ok(source) = Disk.read(path) else { return Ok(()) };
        let mut seeds = seed.iter().cycle();
        let mut text = String::new();
        let mut is_text = false;
        for c in source.text().chars() {
            is_text ^= c == '"';
            let seed = *seeds.next().unwrap();
            match c {
                ' ' if !is_text && seed < 3 => text.push_str(&"   "[..=usize::from(seed)]),
                '\n' if seed == 0 => text.push_str(" # more\n"),
                '\n' if seed == 1 => text.push_str("\n\n\n"),
                '\n' if seed == 2 => text.push_str("  \r\n\t"),
                '{' if !is_text && seed == 3 => text.push_str("{\n"),
                c => text.push(c),
            }
            is_text &= c != '\n';
        }
        let spoiled = source.with_text(text.clone());
        if formatted(&spoiled).is_some() {
            is_kept(path.to_str().unwrap(), &text);
        }
    }
}
