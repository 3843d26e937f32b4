//! `motionseq.toml`: which file applies, what it rejects, and that it changes no byte; `motionseq config` and `motionseq init`.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Output, Stdio};

use crate::support::{Scratch, code, stderr, stdout, with_motionseq};
use motionseq::board::raspblock;
use motionseq::diagnostic::Code;
use motionseq::program::{Options, ProjectLimit, limit_items};
use motionseq::source::Source;

/// A folder with these files.
fn folder(name: &str, files: &[(&str, &str)]) -> Scratch {
    let scratch = Scratch::new(&format!("project-{name}"));
    for (path, text) in files {
        let path = scratch.0.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    scratch
}

/// Runs the program in a folder, and returns the exit code and both outputs.
fn run(folder: &Path, args: &[&str]) -> (i32, String, String) {
    let output = with_motionseq("motionseq", folder).args(args).output().unwrap();
    (code(&output), stdout(&output), stderr(&output))
}

fn with_input(folder: &Path, args: &[&str], input: &str) -> Output {
    let mut command = with_motionseq("motionseq", folder);
    let mut child =
        command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

const LIMITS: &str = "[limits]\nservo-2 = \"900..1700\"\nrocker-y = \"-10..10\"\n";

#[test]
fn a_limit_binds_every_script_below_the_file() {
    let scratch = folder(
        "limits",
        &[
            ("motionseq.toml", LIMITS),
            ("show/wide.motion", "limit servo 2 500..2500\nservo 2 1800\n"),
            ("show/move.motion", "servo 2 1000 -> 1750 over 1s\n"),
            ("show/both.motion", "servos 1500 1800\n"),
            ("show/drive.motion", "rocker y=11 for 1s\n"),
            // The bytes of `servo 2 1900`.
            ("show/raw.motion", "raw 0x02 0x02 0x07 0x6C\n"),
            ("show/narrow.motion", "limit servo 2 1000..1200\nservo 2 1300\n"),
            ("show/stop.motion", "stop\nservo 2 1700; rocker y=-10 for 1s\n"),
        ],
    );
    for (script, wrong) in [
        ("wide", "1800 is outside of the limit 900..1700 of servo 2, set in motionseq.toml:2"),
        ("move", " is outside of the limit 900..1700 of servo 2, set in motionseq.toml:2"),
        ("both", "1800 is outside of the limit 900..1700 of servo 2, set in motionseq.toml:2"),
        ("drive", "11 is outside of the limit -10..10 of rocker y, set in motionseq.toml:3"),
        ("raw", "1900 is outside of the limit 900..1700 of servo 2, set in motionseq.toml:2"),
        // The limit of the script is the narrower one.
        ("narrow", "1300 is outside of the limit 1000..1200"),
    ] {
        let script = format!("show/{script}.motion");
        for command in [&["check"][..], &["render"], &["play"], &["plot"], &["test"], &["diff", "show/stop.motion"]] {
            let (code, out, err) = run(&scratch.0, &[command, &[&script]].concat());
            let text = (out + &err).replace("\n  │ ", " ");
            assert_eq!(code, 1, "{command:?} {script}: {text}");
            assert!(text.contains(wrong), "{command:?} {script}: {text}");
        }
    }
    assert_eq!(run(&scratch.0, &["check", "show/stop.motion"]).0, 0);
    // A wider limit of the file does not lift the default limit.
    fs::write(scratch.0.join("motionseq.toml"), "[limits]\nservo-2 = \"500..2500\"\n").unwrap();
    let tilt = scratch.file("tilt.motion", b"servo 2 2000\n");
    assert!(run(&scratch.0, &["check", &tilt]).2.contains("outside of the limit 500..1950"));
}

#[test]
fn nothing_is_formatted_where_the_configuration_is_wrong() {
    let text = "servo  1   1500\n";
    let wrong = "exclude = [\"drafts\"]\nprot = \"x\"\n";
    let scratch = folder("fmt", &[("motionseq.toml", wrong), ("drafts/d.motion", text)]);
    assert_eq!(run(&scratch.0, &["fmt", "drafts"]).0, 2);
    assert_eq!(fs::read_to_string(scratch.0.join("drafts/d.motion")).unwrap(), text);
}

#[test]
fn the_file_changes_no_byte() {
    let text = "rate 50hz\nservo 2 1000 -> 1600 over 1s\nrocker y=5 for 200ms\n";
    let with = folder("with", &[("motionseq.toml", LIMITS), ("a.motion", text)]);
    let without = folder("without", &[("a.motion", text)]);
    for args in [&["render", "a.motion"][..], &["render", "--isolated", "a.motion"], &["plot", "a.motion"]] {
        assert_eq!(run(&with.0, args).1, run(&without.0, args).1, "{args:?}");
    }
    for scratch in [&with, &without] {
        assert_eq!(run(&scratch.0, &["test", "--bless"]).0, 0);
    }
    let snapshot = |scratch: &Scratch| fs::read(scratch.0.join("a.motion.frames")).unwrap();
    assert_eq!(snapshot(&with), snapshot(&without));
}

#[test]
fn the_nearest_file_applies_and_options_replace_it() {
    let scratch = folder(
        "nearest",
        &[
            ("motionseq.toml", LIMITS),
            ("x.motion", "servo 2 1800\n"),
            ("inner/motionseq.toml", "deny = [\"left-running\"]\n"),
            ("inner/x.motion", "servo 2 1800\n"),
            ("inner/deep/x.motion", "servo 2 1800\n"),
            ("inner/deep/use.motion", "use \"lib/low.motion\"\nlow()\n"),
            ("inner/deep/lib/motionseq.toml", "[limits]\nservo-1 = \"900..1000\"\n"),
            ("inner/deep/lib/low.motion", "def low() { servo 1 1500 }\n"),
            ("strict.toml", "[limits]\nservo-2 = \"1500..1500\"\n"),
        ],
    );
    let check = |folder: &str, args: &[&str]| {
        let (code, _, err) = run(&scratch.0.join(folder), &[&["check"], args].concat());
        (code, err)
    };
    assert_eq!(check("", &["x.motion"]).0, 1);
    // The limits of all files above apply; nothing else of them does.
    for script in ["inner/x.motion", "inner/deep/x.motion"] {
        let (code, messages) = check("", &[script]);
        assert!(
            code == 1 && messages.replace("\n  │ ", " ").contains("set in motionseq.toml:"),
            "{script}: {messages}"
        );
    }
    // That of the script applies, also to the files that it uses.
    assert_eq!(check("", &["inner/deep/use.motion"]).0, 0);
    // `..` is the folder above, not a part of a name.
    assert_eq!(check("inner", &["../x.motion"]).0, 1);
    assert_eq!(check("", &["--isolated", "x.motion"]).0, 0);
    let (code, messages) = check("inner", &["--config", "../strict.toml", "x.motion"]);
    let messages = messages.replace("\n  │ ", " ");
    assert!(code == 1 && messages.contains("set in ../strict.toml:2"), "{messages}");
    // Standard input is a script of the current folder.
    for (folder, code) in [("", 1), ("inner/deep", 1)] {
        let output = with_input(&scratch.0.join(folder), &["render", "-"], "servo 2 1800\n");
        assert_eq!(output.status.code(), Some(code), "{folder}");
    }
    let (code, text, _) = run(&scratch.0, &["config", "inner/deep/x.motion"]);
    let first: Vec<&str> = text.lines().take(2).collect();
    assert_eq!((code, first), (0, vec!["# inner/motionseq.toml", "# motionseq.toml: only its limits"]));
    assert!(text.contains("# inner/motionseq.toml:1\n") && text.contains("# motionseq.toml:2\n"), "{text}");
}

#[test]
fn mistakes_are_shown_at_their_places_and_nothing_is_compiled() {
    let scratch = folder("mistakes", &[("x.motion", "servo 1 1500\n"), ("motionseq.toml", "")]);
    for (text, place, code, words) in [
        ("prot = \"/dev/serial0\"", "1:1", "config-key", "did you mean `port`?"),
        ("[limit]", "1:2", "config-key", "did you mean `limits`?"),
        ("[play]\nmaxlate = \"5ms\"", "2:1", "config-key", "did you mean `max-late`?"),
        ("[limits]\nsevro-2 = \"900..1700\"", "2:1", "config-key", "did you mean `servo-2`?"),
        ("[limits]\n\"servo 2\" = \"900..1700\"", "2:1", "config-key", "did you mean `servo-2`?"),
        ("rate = \"50hz\"", "1:1", "config-key", "`rate` is a setting of a script"),
        ("port = 3", "1:8", "config-value", "text is needed here, not a number"),
        ("paths = \"scripts\"", "1:9", "config-value", "a list is needed here, not text"),
        ("paths = []", "1:9", "config-value", "the list is empty"),
        ("exclude = [\"a\", true]", "1:17", "config-value", "text is needed here"),
        ("exclude = [\"a{\"]", "1:12", "config-value", "is not a pattern"),
        ("limits = 5", "1:10", "config-value", "write `[limits]` on a line of its own"),
        ("deny = [\"left-runing\"]", "1:9", "config-value", "did you mean `left-running`?"),
        ("deny = [\"clash\"]", "1:9", "config-value", "`clash` is an error"),
        ("play.max-late = \"11s\"", "1:17", "config-value", "write 10s or less"),
        ("[limits]\nservo-2 = \"40..1700\"", "2:12", "config-value", "within the range of the board, 500..2500"),
        ("[limits]\nsts-servo-2 = \"40..5000\"", "2:16", "config-value", "within the range of the board, 0..4095"),
        ("[limits]\nservo-2 = \"1700..900\"", "2:12", "config-value", "write `900..1700`"),
        ("[limits]\nservo-2 = \"900..wide\"", "2:12", "config-value", "a range is needed here"),
        ("[limits]\nservo-2 = \"900..1700\\nseed 5\"", "2:11", "config-value", "a range is needed here"),
        ("[limits]\nservo-2 = \"speed 3000us\"", "2:12", "config-value", "a range is needed here"),
        ("port = /dev/serial0", "1:8", "config-syntax", "quot"),
        ("port = \"virtual\"\nport = \"virtual\"", "2:1", "config-syntax", "duplicate key"),
    ] {
        fs::write(scratch.0.join("motionseq.toml"), text).unwrap();
        let (exit, out, err) = run(&scratch.0, &["render", "x.motion"]);
        assert_eq!((exit, out.as_str()), (2, ""), "{text}: {err}");
        let start = format!("{code}\n");
        assert!(err.starts_with(&start), "{text}: {err}");
        assert!(err.contains(&format!("[motionseq.toml:{place}]")), "{text}: {err}");
        assert!(err.replace("\n        ", " ").contains(words), "{text}: {err}");
    }
    // Every mistake is shown, and every other command stops too.
    fs::write(scratch.0.join("motionseq.toml"), "a = 1\nb = 2\nport = 3\n").unwrap();
    for command in [&["check"][..], &["test"], &["config"], &["play", "x.motion"], &["diff", "x.motion", "x.motion"]] {
        let (exit, _, err) = run(&scratch.0, command);
        assert_eq!(exit, 2, "{command:?}");
        assert!(err.ends_with("motionseq.toml: 3 errors; motionseq explain config-key\n"), "{command:?}: {err}");
    }
}

#[test]
fn a_file_that_cannot_be_read_is_an_error() {
    let scratch = folder("unreadable", &[("x.motion", "servo 1 1500\n")]);
    let path = scratch.0.join("motionseq.toml");
    let check = |args: &[&str]| {
        let (code, _, err) = run(&scratch.0, &[&["check", "x.motion"], args].concat());
        (code, err)
    };
    fs::create_dir(&path).unwrap();
    let why = "error: cannot read motionseq.toml: it is a folder; `--isolated` ignores it\n";
    assert_eq!(check(&[]), (2, why.to_owned()));
    assert_eq!(check(&["--isolated"]).0, 0);
    fs::remove_dir(&path).unwrap();
    fs::write(&path, b"port = \"\xFF\"\n").unwrap();
    let (code, err) = check(&[]);
    assert!(code == 2 && err.starts_with("not-utf8\n") && err.contains("[motionseq.toml:1:9]"), "{err}");
    fs::File::create(&path).unwrap().set_len(100 << 20).unwrap();
    assert!(check(&[]).1.contains("it is longer than 1048576 bytes"));
    fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink("nowhere", &path).unwrap();
    assert!(check(&[]).1.contains("no such file or directory"));
    fs::remove_file(&path).unwrap();
    let why = "error: cannot read none.toml: no such file or directory\n";
    assert_eq!(check(&["--config", "none.toml"]), (2, why.to_owned()));
    // An empty file sets nothing; a byte order mark and Windows line ends are no mistakes.
    for text in ["", "\u{FEFF}port = \"virtual\"\r\n"] {
        fs::write(&path, text).unwrap();
        assert_eq!(check(&[]).0, 0, "{text:?}");
    }
}

#[test]
fn denied_warnings_fail_check_and_test() {
    let scratch = folder(
        "deny",
        &[
            ("motionseq.toml", "deny = [\"left-running\"]\n"),
            ("a.motion", "rocker x=5\nwait 2s\n"),
            ("b.motion", "raw 0x04 1\n"),
        ],
    );
    assert_eq!(run(&scratch.0, &["test", "--bless", "b.motion"]).0, 0);
    let (code, _, err) = run(&scratch.0, &["check", "a.motion"]);
    assert!(code == 1 && err.ends_with("a.motion: has warnings, which `deny` in motionseq.toml:1 forbids\n"), "{err}");
    assert_eq!(run(&scratch.0, &["check", "b.motion"]).0, 0);
    let (code, out, _) = run(&scratch.0, &["test", "--bless"]);
    assert!(code == 1 && out.contains("a.motion: has warnings") && !out.contains("b.motion"), "{out}");
    // The option adds to the file, and takes codes as well.
    assert_eq!(run(&scratch.0, &["check", "b.motion", "--deny", "raw-frame"]).0, 1);
    assert_eq!(run(&scratch.0, &["check", "a.motion", "--deny", "raw-frame"]).0, 1);
    assert_eq!(run(&scratch.0, &["--quiet", "check", "a.motion", "--isolated"]).0, 0);
    let (code, _, err) = run(&scratch.0, &["check", "a.motion", "--deny", "left-runing"]);
    assert!(code == 2 && err.contains("'left-running'"), "{err}");
}

#[test]
fn a_search_respects_the_file_and_gitignore() {
    let script = "servo 1 1500\n";
    let scratch = folder(
        "search",
        &[
            ("motionseq.toml", "paths = [\"show\"]\nexclude = [\"drafts\", \"*.old.motion\"]\n"),
            (".gitignore", "build/\n"),
            ("top.motion", script),
            ("show/a.motion", script),
            ("show/b.old.motion", script),
            ("show/drafts/c.motion", "servoo\n"),
            ("show/drafts/motionseq.toml", "wrong\n"),
            ("show/build/d.motion", script),
            ("show/.hidden/e.motion", script),
        ],
    );
    let found = |folder: &str, args: &[&str]| {
        let (_, _, err) = run(&scratch.0.join(folder), &[&["check"], args].concat());
        err.lines()
            .filter_map(|line| line.strip_suffix(": ok, 1 frame in 0.000 s").map(str::to_owned))
            .collect::<Vec<_>>()
    };
    // `.gitignore` counts in a git repository, as for git.
    assert_eq!(found("", &[]), ["show/a.motion", "show/build/d.motion"]);
    fs::create_dir(scratch.0.join(".git")).unwrap();
    assert_eq!(found("", &[]), ["show/a.motion"]);
    assert_eq!(found("", &["."]), ["show/a.motion", "top.motion"]);
    assert_eq!(found("show/drafts/..", &[]), ["a.motion"]);
    // What is named is read.
    assert_eq!(found("", &["show/b.old.motion", "show/build"]), ["show/b.old.motion", "show/build/d.motion"]);
    assert_eq!(found("", &["--isolated", "."]), ["show/a.motion", "show/b.old.motion", "top.motion"]);
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::ffi::OsStrExt as _;
        let name = std::ffi::OsStr::from_bytes(b"z\xFF.motion");
        fs::write(scratch.0.join("show").join(name), script).unwrap();
        assert_eq!(found("", &[]), ["show/a.motion", "show/z\u{FFFD}.motion"]);
    }
    let (code, _, err) = run(&scratch.0, &["test"]);
    assert!(code == 1 && err.starts_with("2 scripts: "), "{err}");
}

#[test]
fn play_says_which_port_it_uses_and_where_it_comes_from() {
    let scratch =
        folder("port", &[("motionseq.toml", "\nport = \"/dev/no-such-port\"\n"), ("x.motion", "servo 1 1500\n")]);
    let play = |args: &[&str], variable: Option<&str>| {
        let mut command = with_motionseq("motionseq", &scratch.0);
        command.args(["play", "x.motion"]).args(args);
        variable.map(|port| command.env("MOTIONSEQ_PORT", port));
        let output = command.output().unwrap();
        (code(&output), stderr(&output))
    };
    let (code, err) = play(&[], None);
    assert_eq!(code, 3);
    assert!(err.starts_with("error: cannot open port /dev/no-such-port: "), "{err}");
    assert!(err.contains("the port is from motionseq.toml:2; `--port virtual` plays on the virtual board"), "{err}");
    for (args, variable, first) in [
        (&["--port", "virtual"][..], None, "playing on the built-in virtual board"),
        (&[], Some(""), "playing on the built-in virtual board (port from MOTIONSEQ_PORT)"),
        (&[], Some("virtual"), "playing on the built-in virtual board (port from MOTIONSEQ_PORT)"),
        (&["--isolated"], None, "no --port: playing on the built-in virtual board"),
    ] {
        let (code, err) = play(args, variable);
        assert_eq!((code, err.lines().next()), (0, Some(first)), "{args:?} {variable:?}");
    }
    let far = crate::support::far::FarEnd::new();
    fs::write(scratch.0.join("motionseq.toml"), format!("port = \"{}\"\n", far.path)).unwrap();
    let (code, err) = play(&[], None);
    assert_eq!(code, 0, "{err}");
    assert!(err.starts_with(&format!("playing on {} (port from motionseq.toml:1)\n", far.path)), "{err}");
    assert!(!far.first().is_empty());
}

#[test]
fn config_shows_every_key_and_its_source() {
    let text = "port = \"/dev/serial0\"\npaths = [\n  \"show\",\n  \"lib\",\n]\n[play]\nmax-late = \"20ms\"\n[limits]\nservo-2 = \"900us..1700us\"\n";
    let scratch = folder("config", &[("motionseq.toml", text), ("show/x.motion", "")]);
    let (code, out, _) = run(&scratch.0.join("show"), &["config"]);
    let shown = [
        "# ../motionseq.toml",
        "port = \"/dev/serial0\"              # ../motionseq.toml:1",
        "paths = [\"show\", \"lib\"]            # ../motionseq.toml:2",
        "exclude = []                       # default",
        "deny = []                          # default",
        "play.max-late = \"20ms\"             # ../motionseq.toml:7",
        "limits.servo-2 = \"900us..1700us\"   # ../motionseq.toml:9",
    ];
    let lines: Vec<String> = shown.iter().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    let found: Vec<String> = out.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    assert_eq!((code, found), (0, lines));
    // What it prints is itself a configuration with the same values.
    fs::write(scratch.0.join("again.toml"), &out).unwrap();
    let (code, again, err) = run(&scratch.0, &["config", "--config", "again.toml"]);
    assert_eq!(code, 0, "{err}");
    let keys = |text: &str| {
        text.lines().filter_map(|line| Some(line.split_once("  #")?.0.trim().to_owned())).collect::<Vec<_>>()
    };
    assert_eq!(keys(&again), keys(&out));
    let output = with_motionseq("motionseq", &scratch.0)
        .args(["config", "show/x.motion", "--format", "json"])
        .env("MOTIONSEQ_PORT", "/dev/ttyUSB0")
        .output()
        .unwrap();
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&json["version"], &json["file"]), (&1.into(), &"motionseq.toml".into()));
    let port =
        serde_json::json!({"key": "port", "value": "/dev/ttyUSB0", "source": "environment", "place": "MOTIONSEQ_PORT"});
    assert_eq!(json["settings"][0], port);
    let limit = serde_json::json!({"key": "limits.servo-2", "value": "900us..1700us", "source": "file", "place": "motionseq.toml:9"});
    assert_eq!(json["settings"][5], limit);
    let (code, _, err) = run(&scratch.0, &["config", "none"]);
    assert!(code == 2 && err.starts_with("error: cannot read none: "), "{err}");
}

/// Every file below a folder.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push(path.to_str().unwrap().to_owned());
        }
    }
    found.sort();
    found
}

#[test]
fn init_writes_a_project_that_passes_its_test() {
    let scratch = folder("init", &[("repository/.git/HEAD", ""), ("full/notes.txt", ""), ("file", "")]);
    let repository = scratch.0.join("repository");
    assert_eq!(run(&repository, &["init"]).0, 0);
    let names: Vec<String> = files(&repository)
        .iter()
        .map(|file| file.strip_prefix(&format!("{}/", repository.display())).unwrap().to_owned())
        .collect();
    assert_eq!(
        names,
        [".git/HEAD", ".github/workflows/motionseq.yml", "first.motion", "first.motion.frames", "motionseq.toml"]
    );
    for args in [
        &["test"][..],
        &["test", "--play"],
        &["check"],
        &["check", "--deny", "warnings"],
        &["fmt", "--check", "first.motion"],
    ] {
        let (code, out, err) = run(&repository, args);
        assert_eq!(code, 0, "{args:?}: {out}{err}");
    }
    // Each line that is a comment in the file is a valid setting.
    let text = fs::read_to_string(repository.join("motionseq.toml")).unwrap();
    let is_setting = |line: &str| line.strip_prefix("# ").is_some_and(|line| line.contains(" = "));
    let all: String = text
        .lines()
        .map(|line| if is_setting(line) { &line[2..] } else { line })
        .flat_map(|line| [line, "\n"])
        .collect();
    fs::write(repository.join("motionseq.toml"), all).unwrap();
    let (code, out, err) = run(&repository, &["config"]);
    assert_eq!(code, 0, "{err}");
    assert!(!out.contains("# default") && out.lines().count() == 8, "{out}");
    // It writes into no folder with content.
    let before = files(&scratch.0);
    for (folder, why) in [
        ("repository", "it contains .github, first.motion, first.motion.frames and 1 more; choose an empty folder"),
        ("full", "it contains notes.txt; choose an empty folder"),
        ("file", "Not a directory"),
    ] {
        let (code, _, err) = run(&scratch.0, &["init", folder]);
        assert_eq!((code, err.lines().count()), (2, 1), "{err}");
        assert!(err.starts_with(&format!("error: cannot start a project in {folder}: {why}")), "{err}");
    }
    assert_eq!(files(&scratch.0), before);
    let (code, _, err) = run(&scratch.0, &["init", "new/show"]);
    assert!(
        code == 0 && err.ends_with("next: cd new/show && motionseq test && motionseq play first.motion\n"),
        "{err}"
    );
}

#[test]
fn init_leaves_nothing_half_made() {
    let scratch = Scratch::new("project-half");
    // The last file has a path that is too long for the system; the files before it can be written.
    let mut deep = scratch.0.clone();
    while deep.as_os_str().len() < 3_850 {
        deep.push("d".repeat(200));
    }
    deep.push("e".repeat(4_069 - deep.as_os_str().len() - 1));
    fs::create_dir_all(&deep).unwrap();
    let (code, _, err) = run(&scratch.0, &["init", deep.to_str().unwrap()]);
    assert!(code == 2 && err.ends_with("; nothing was written\n"), "{err}");
    assert_eq!(fs::read_dir(&deep).unwrap().count(), 0);
}

#[test]
fn a_program_that_uses_the_library_can_set_limits() {
    let board = raspblock::board();
    let items = limit_items(&board);
    let (_, limited) = items.iter().find(|(name, _)| name == "yawhold-y").unwrap();
    let limit = ProjectLimit::read(&board, *limited, "-5..5", "the fleet").unwrap();
    let options = Options::default().with_limits(vec![limit]);
    let compile = |text: &str| motionseq::compile(&Source::new("x", text).into(), &options);
    assert!(compile("yawhold y=5 for 1s\n").timeline().is_some());
    let compiled = compile("yawhold y=6 for 1s\n");
    let first = compiled.diagnostics.iter().next().unwrap();
    assert_eq!((first.code, compiled.timelines.is_empty()), (Code::Limit, true));
    assert!(first.message.ends_with("of yawhold y, set in the fleet"), "{}", first.message);
    let wrong = ProjectLimit::read(&board, *limited, "-5..1000", "the fleet").unwrap_err();
    assert_eq!((wrong.code, wrong.span.range()), (Code::OutOfRange, 0.."-5..1000".len()));
}

#[test]
fn a_limit_in_steps_is_for_the_servos_of_a_bus() {
    let scratch =
        folder("sts", &[("motionseq.toml", "[limits]\nsts-servo-2 = \"1000..3000\"\nspeed-2 = \"1..500\"\n")]);
    for (text, code) in [
        ("servo 2 900\n", 0),
        ("board sts\nservo 2 900\n", 1),
        ("board sts\nservo 2 2000\n", 0),
        ("board sts\nspeed 2 600\n", 1),
        ("board maestro 6\nservo 2 1000\n", 0),
    ] {
        fs::write(scratch.0.join("x.motion"), text).unwrap();
        let (exit, _, err) = run(&scratch.0, &["render", "x.motion"]);
        assert_eq!(exit, code, "{text}: {err}");
        assert!(code == 0 || err.contains("set in motionseq.toml:"), "{text}: {err}");
    }
}
