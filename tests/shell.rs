//! Completions in a real bash, and manual pages as groff reads them.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::{code, run, stderr, stdout, with_motionseq};

/// A folder with scripts, an unrelated file and a folder.
fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("motionseq-shell-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(folder.join("sub")).unwrap();
    let script = "let depth = 200us\nlet pace = 1s\nlet wide = depth * 2\nmark bow\nservo 1 1500\nwait 1s\nmark back\nrepeat 2 {\nmark twice\nwait 1s\n}\nstop\n";
    fs::write(folder.join("dance.motion"), script).unwrap();
    fs::write(folder.join("my show.motion"), "mark intro\nstop\n").unwrap();
    fs::write(folder.join("notes.txt"), "").unwrap();
    folder
}

/// The words that bash offers for the last of these words.
fn offered(folder: &Path, words: &[&str]) -> Vec<String> {
    let shell = r#"
        source <(COMPLETE=bash motionseq)
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
        [[ $(complete -p motionseq) == *"-F _clap_complete_motionseq "* ]] || exit 1
        _clap_complete_motionseq "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD-1]}"
        ((${#COMPREPLY[@]})) && printf '%s\n' "${COMPREPLY[@]}"
        exit 0
    "#;
    let mut bash = with_motionseq("bash", folder);
    bash.args(["--norc", "--noprofile", "-c", shell, "bash", "motionseq"]).args(words);
    let output = bash.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", crate::support::stderr(&output));
    stdout(&output).lines().map(str::to_owned).collect()
}

#[test]
fn bash_completes_commands_codes_and_values() {
    let folder = scratch("values");
    let commands = offered(&folder, &[""]);
    assert!(commands.contains(&"check".to_owned()) && commands.contains(&"play".to_owned()), "{commands:?}");
    assert!(!commands.iter().any(|word| word.starts_with('-') || word.starts_with("complete-")), "{commands:?}");
    assert_eq!(offered(&folder, &["explain", "cla"]), ["clash"]);
    assert_eq!(offered(&folder, &["man", "pl"]), ["play", "plot"]);
    assert_eq!(offered(&folder, &["completions", "ba"]), ["bash"]);
    assert_eq!(offered(&folder, &["render", "--format", "js"]), ["jsonl"]);
    assert_eq!(offered(&folder, &["render", "dance.motion", "--color", "a"]), ["auto", "always"]);
    assert_eq!(offered(&folder, &["play", "dance.motion", "--set", ""]), ["depth=", "pace=", "wide="]);
    assert_eq!(offered(&folder, &["check", "dance.motion", "--set", "wi"]), ["wide="]);
}

#[test]
fn bash_completes_scripts_and_options() {
    let folder = scratch("scripts");
    let sorted = |words: &[&str]| {
        let mut found = offered(&folder, words);
        found.sort();
        found
    };
    for command in ["check", "render", "play", "plot", "test", "diff", "fmt", "config"] {
        assert_eq!(sorted(&[command, ""]), ["dance.motion", "my\\ show.motion", "sub/"], "{command}");
        assert_eq!(sorted(&[command, "da"]), ["dance.motion"], "{command}");
    }
    assert_eq!(sorted(&["check", "dance.motion", "my"]), ["my\\ show.motion"]);
    assert_eq!(sorted(&["play", "--fr"]), ["--from"]);
    assert_eq!(sorted(&["play", "dance.motion", "--re"]), ["--realtime", "--record", "--report"]);
    // A file of any kind is the value of an option.
    assert!(sorted(&["play", "dance.motion", "--report", "no"]).contains(&"notes.txt".to_owned()));
}

#[test]
fn bash_completes_the_marks_of_the_script() {
    let folder = scratch("marks");
    // A mark that occurs more than once is not accepted as a time.
    assert_eq!(offered(&folder, &["play", "dance.motion", "--from", ""]), ["bow", "back"]);
    assert_eq!(
        offered(&folder, &["play", "--from", "ba", "dance.motion"]),
        ["dance.motion"],
        "the last word is completed"
    );
    assert_eq!(offered(&folder, &["render", "dance.motion", "--to", "ba"]), ["back"]);
    assert_eq!(offered(&folder, &["play", r"my\ show.motion", "--from", ""]), ["intro"]);
    assert_eq!(offered(&folder, &["play", "'my show.motion'", "--from", ""]), ["intro"]);
    // Without a script, or with one that does not compile, nothing is offered and nothing is printed.
    fs::write(folder.join("broken.motion"), "mark a\nservoo\n").unwrap();
    for words in [&["play", "--from", ""][..], &["play", "broken.motion", "--from", ""]] {
        assert_eq!(offered(&folder, words), [""; 0], "{words:?}");
    }
}

#[test]
fn the_static_scripts_know_commands_and_values() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = stdout(&run(&["completions", shell]));
        assert!(["explain", "max-late"].iter().all(|word| script.contains(word)), "{shell}");
    }
    // A package has the other kind, which finds the program in PATH.
    let mut asked = with_motionseq("motionseq", Path::new("."));
    let registration = stdout(&asked.env("COMPLETE", "zsh").output().unwrap());
    assert!(registration.contains("#compdef motionseq") && !registration.contains("target"), "{registration}");
}

/// Every command with a manual page.
fn commands() -> Vec<String> {
    let help = stdout(&run(&["--help"]));
    let rows = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = rows.filter(|row| !row.starts_with("   ")).map(|row| row.split_whitespace().next().unwrap().to_owned());
    names.filter(|name| name != "help").collect()
}

#[test]
fn manual_pages_are_valid_and_complete() {
    let groff = Command::new("groff").arg("--version").output().is_ok();
    assert!(groff || std::env::var_os("CI").is_none(), "CI has groff");
    let commands = commands();
    assert!(commands.len() > 12, "{commands:?}");
    for name in std::iter::once("").chain(commands.iter().map(String::as_str)) {
        let args: Vec<&str> = ["man", name].into_iter().filter(|word| !word.is_empty()).collect();
        let page = stdout(&run(&args));
        for section in ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "ENVIRONMENT", "EXAMPLES"] {
            assert!(page.contains(&format!("\n.SH {section}\n")), "{name}: {section}\n{page}");
        }
        assert!(!page.contains('`') && page.contains(".nf\n"), "{page}");
        if groff {
            let mut child = Command::new("groff");
            child.args(["-man", "-Tutf8", "-ww", "-z"]).stdin(Stdio::piped()).stderr(Stdio::piped());
            let mut child = child.spawn().unwrap();
            std::io::Write::write_all(&mut child.stdin.take().unwrap(), page.as_bytes()).unwrap();
            let output = child.wait_with_output().unwrap();
            assert_eq!(crate::support::stderr(&output), "", "{name}");
        }
    }
}

#[test]
fn the_documents_have_the_exit_codes_of_the_manual_page() {
    let page = stdout(&run(&["man"]));
    let (_, status) = page.split_once(".SH EXIT STATUS\n").unwrap();
    let (status, _) = status.split_once(".SH ").unwrap();
    let terms = status.lines().filter_map(|line| line.strip_prefix("\\fB")?.strip_suffix("\\fR"));
    let codes: BTreeSet<String> = terms.map(str::to_owned).collect();
    let document = fs::read_to_string("docs/cli.md").unwrap();
    let cells = document.lines().filter_map(|line| line.strip_prefix('|')?.split('|').next());
    let documented: BTreeSet<String> = cells.map(|cell| cell.trim().trim_matches('`').to_owned()).collect();
    assert!(codes.len() > 8 && codes.is_subset(&documented), "{codes:?} {documented:?}");
}

#[test]
fn frequent_commands_have_the_same_help_in_both_ways() {
    for command in ["check", "render", "play", "test", "fmt"] {
        let (one, all) = (run(&[command, "--help"]), run(&["help", command]));
        assert_eq!((code(&one), stdout(&one)), (0, stdout(&all)), "{command}");
        let (wrong, quiet) = (run(&[command, "--colour"]), run(&["-q", command, "--colour"]));
        assert_eq!((code(&wrong), stderr(&wrong)), (2, stderr(&quiet)), "{command}");
        assert!(stderr(&wrong).contains("--color"), "{}", stderr(&wrong));
    }
}
