//! `--family`, and files that say which board they are for: recordings, snapshots, and the files of text boards.

use std::fs;
use std::io::Write as _;

use crate::support::host::{Host, link};
use crate::support::{Scratch, code, motionseq, stderr, stdout, with_motionseq};

const DEMO: &str = r#"name = "Demo"
baud = 9600
[verb.servo]
axes = [{ name = "n", range = "0..3", index = true }, { name = "us", range = "500..2500", unit = "us" }]
moves = true
send = '#{n}P{us}\r'
[verb.drive]
axes = [{ name = "left", range = "-255..255" }, { name = "right", range = "-255..255" }]
holds = true
rest = 'M 0 0\n'
refresh = "100ms"
send = 'M {left} {right}\n'
"#;

const SCRIPT: &[u8] = b"board \"demo.toml\"\nservo 1 1500\ndrive 100 -50 for 500ms\nservo 1 1500 -> 1900 over 1s\n";

/// A folder with the file of a board, and a script for it.
fn demo(name: &str) -> Scratch {
    let folder = Scratch::new(&format!("families-{name}"));
    folder.file("demo.toml", DEMO.as_bytes());
    folder.file("dance.motion", SCRIPT);
    folder
}

/// Runs the program in a folder; its exit code and what it says must be these.
fn says(folder: &Scratch, args: &[&str], exit: i32, words: &str) {
    let output = folder.run(args);
    let (out, text) = (stdout(&output), stderr(&output));
    assert!(code(&output) == exit && (out.contains(words) || text.contains(words)), "{args:?}: {out}\n{text}");
}

fn text(folder: &Scratch, name: &str) -> String {
    fs::read_to_string(folder.0.join(name)).unwrap()
}

#[test]
fn a_wrong_family_is_refused() {
    let folder = demo("wrong");
    folder.file("run.bin", b"#1P1500\r");
    folder.file("broken.toml", b"name = \"Demo\"\nbad = 1\n");
    let decode = |family| ["decode", "run.bin", "--family", family];
    says(&folder, &decode("nosuch"), 2, "write one of `raspblock`");
    says(&folder, &decode("raspblock 12"), 2, "write `raspblock`\n");
    says(&folder, &decode("a\"b.toml"), 2, "a script cannot name this file");
    says(&folder, &decode("missing.toml"), 1, "cannot read missing.toml: no such file or directory");
    says(&folder, &decode("broken.toml"), 1, "unknown key `bad`");
    says(&folder, &decode("broken.toml"), 1, "broken.toml:2:1");
    says(&folder, &["decode", "run.bin", "--family", "demo.toml", "--older-move"], 2, "only for the board `raspblock`");
    let fast = ["board", "--link", "link", "--family", "maestro 6", "--baud", "250000"];
    says(&folder, &fast, 2, "the board `maestro 6` takes at most 200000 baud, not 250000");
    for command in ["board", "record"] {
        for option in [["--battery", "11V"], ["--report-every", "1s"]] {
            let args = [&[command, "--link", "link", "--family", "demo.toml"][..], &option].concat();
            says(
                &folder,
                &args,
                2,
                "has no effect: the virtual board `\"demo.toml\"` has no battery, and sends no reports by itself",
            );
        }
    }
}

#[test]
fn bytes_for_a_text_board_are_decoded() {
    let folder = demo("decode");
    folder.file("run.bin", b"#1P1500\rM 100 -50\nM 0 0\n");
    folder.file("hex.txt", b"23 31 50 31 35 30 30 0D\n4D 20 31 20 32 0A\n");
    let decode = |file: &str, more: &[&str]| [&["decode", file, "--family", "demo.toml"][..], more].concat().join(" ");
    let decode = |file, more: &[&str], exit, words| {
        let line = decode(file, more);
        says(&folder, &line.split(' ').collect::<Vec<_>>(), exit, words);
    };
    decode("run.bin", &[], 0, "8\t4D 20 31 30 30 20 2D 35 30 0A\tdrive 100 -50\n");
    decode("hex.txt", &[], 0, "8\t4D 20 31 20 32 0A\tdrive 1 2\n");
    decode("run.bin", &["-o", "x.motion"], 0, "3 frames in 24 bytes");
    let head: Vec<String> = text(&folder, "x.motion").lines().take(3).map(str::to_owned).collect();
    assert!(head[0].starts_with("# Recorded by motionseq ") && head[1] == "board \"demo.toml\"" && head[2].is_empty());
    says(&folder, &["check", "x.motion"], 0, "x.motion");
    decode("run.bin", &["-o", "y.motion", "--baud", "19200", "--exact"], 0, "3 frames");
    assert!(text(&folder, "y.motion").contains("\nboard \"demo.toml\"\nrefresh off\nbaud 19200\n\n"));
    assert_eq!(folder.run(&["render", "y.motion", "--format", "bin"]).stdout, b"#1P1500\rM 100 -50\nM 0 0\n");
    // The file of the board is an input.
    decode("run.bin", &["-o", "demo.toml"], 2, "this run reads it");
    assert_eq!(text(&folder, "demo.toml"), DEMO);
}

#[test]
fn a_script_names_its_board_as_seen_from_its_folder() {
    let folder = demo("folders");
    folder.file("run.bin", b"M 100 -50\nM 0 0\n");
    fs::create_dir_all(folder.0.join("boards")).unwrap();
    fs::create_dir_all(folder.0.join("show")).unwrap();
    folder.file("boards/deep.toml", DEMO.as_bytes());
    let decode = |file, script, words| says(&folder, &["decode", "run.bin", "--family", file, "-o", script], 0, words);
    decode("show/../boards/deep.toml", "x.motion", "2 frames");
    assert!(text(&folder, "x.motion").contains("\nboard \"boards/deep.toml\"\n"));
    decode("boards/deep.toml", "show/x.motion", "copy boards/deep.toml next to the script");
    assert!(text(&folder, "show/x.motion").contains("\nboard \"deep.toml\"\n"));
    fs::copy(folder.0.join("boards/deep.toml"), folder.0.join("show/deep.toml")).unwrap();
    says(&folder, &["check", "x.motion", "show/x.motion"], 0, "");
}

#[test]
fn a_snapshot_says_which_board_it_is_for() {
    let folder = demo("snapshot");
    says(&folder, &["test", "--bless"], 0, "1 passed (1 blessed)");
    says(&folder, &["test", "--play"], 0, "1 passed");
    assert!(text(&folder, "dance.motion.frames").contains("\n# board\t\"demo.toml\"\n"));
    let diff = |old, new| ["diff", old, new];
    says(&folder, &diff("dance.motion.frames", "dance.motion"), 0, "no difference");
    says(&folder, &["decode", "dance.motion.frames"], 0, "\tdrive 100 -50\n");
    says(&folder, &["decode", "dance.motion.frames", "-o", "again.motion"], 0, "frames");
    assert!(text(&folder, "again.motion").contains("\nboard \"demo.toml\"\n"));
    says(&folder, &["check", "again.motion"], 0, "");
    folder.file("old.motion", SCRIPT);
    folder.file("dance.motion", &[SCRIPT, b"servo 2 900\n"].concat());
    says(&folder, &diff("dance.motion.frames", "dance.motion"), 1, "servo 2 900");
    says(&folder, &["test", "dance.motion"], 1, "servo 2 900");
    // Another board, and the same one with another file.
    folder.file("other.motion", b"servo 1 1500\n");
    let words = "dance.motion.frames and other.motion cannot be compared: one is for the board `\"demo.toml\"`, the other for `raspblock`";
    says(&folder, &diff("dance.motion.frames", "other.motion"), 1, words);
    fs::create_dir_all(folder.0.join("new")).unwrap();
    folder.file("new/demo.toml", DEMO.replace("M {left}", "N {left}").as_bytes());
    folder.file("new/dance.motion", SCRIPT);
    says(&folder, &diff("old.motion", "new/dance.motion"), 1, "the file of the board `\"demo.toml\"` is not the same");
    folder.file("new/demo.toml", DEMO.as_bytes());
    says(&folder, &diff("old.motion", "new/dance.motion"), 0, "no difference");
    // A snapshot from another program has no folder.
    let snapshot = fs::File::open(folder.0.join("dance.motion.frames")).unwrap();
    let mut piped = with_motionseq("motionseq", &std::env::temp_dir());
    piped.args(["diff", "-", &folder.path("old.motion")]).stdin(snapshot);
    assert_eq!(code(&piped.output().unwrap()), 0);
    // A script for one board with the snapshot of another.
    folder.file("dance.motion", b"servo 1 1500\n");
    says(&folder, &["test", "dance.motion"], 1, "this is a snapshot for the board `\"demo.toml\"`, not `raspblock`");
    fs::remove_file(folder.0.join("demo.toml")).unwrap();
    let words =
        "dance.motion.frames is for the board `\"demo.toml\"`: demo.toml cannot be used: no such file or directory";
    says(&folder, &diff("dance.motion.frames", "other.motion"), 1, words);
    folder.file("x.frames", b"# motionseq frames 3\n# x\n# board\tspaceship 9\n");
    says(
        &folder,
        &diff("x.frames", "other.motion"),
        1,
        "x.frames is for the board `spaceship 9`: this motionseq does not",
    );
}

#[test]
fn no_output_replaces_the_file_of_a_board() {
    let folder = demo("inputs");
    for args in [
        &["render", "dance.motion", "-o", "demo.toml"][..],
        &["test", "dance.motion", "--junit", "demo.toml"],
        &["play", "dance.motion", "--report", "demo.toml"],
        &["play", "dance.motion", "--record", "demo.toml"],
    ] {
        says(&folder, args, 2, "demo.toml: this run reads it; choose another file");
    }
    let path = folder.path("link");
    says(&folder, &["record", "--link", &path, "--family", "demo.toml", "-o", "demo.toml"], 2, "this run reads it");
    assert_eq!(text(&folder, "demo.toml"), DEMO);
}

#[test]
fn a_program_finds_a_virtual_board_of_its_family() {
    let folder = demo("board");
    let mut host = Host::start("families", &["--family", &folder.path("demo.toml")]);
    let mut port = host.open();
    host.says("has opened the port");
    port.write_all(b"#2P700\rM 7 -8\nM 0 0\n").unwrap();
    drop(port);
    host.says("the port is closed");
    let (listing, said) = host.end();
    assert!(listing.contains("\tservo 2 700\n") && listing.contains("\tdrive 7 -8\n"), "{listing}");
    assert!(said.contains("the virtual board received 3 frames") && !said.contains("the robot moved"), "{said}");
}

#[test]
fn what_a_program_sends_to_a_text_board_is_recorded() {
    let folder = demo("record");
    let (toml, script) = (folder.path("demo.toml"), folder.path("new.motion"));
    let args = ["--family", &toml, "-o", &script];
    let mut host = Host::start_at("record", link("families-record"), &args);
    let mut port = host.open();
    host.says("has opened the port");
    port.write_all(b"#2P700\rM 7 -8\n").unwrap();
    std::thread::sleep(std::time::Duration::from_millis(200));
    port.write_all(b"M 0 0\n").unwrap();
    drop(port);
    host.says("the port is closed");
    host.end();
    let written = text(&folder, "new.motion");
    assert!(written.contains("\nboard \"demo.toml\"\n\n") && written.contains("drive 7 -8 for "), "{written}");
    let output = motionseq(&["check", &script]).output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

/// The calibration of an arm.
const CALIBRATION: &str = r#"{
  "Wrist Roll": {"id": 5, "drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095},
  "shoulder_pan": {"id": 1, "drive_mode": 1, "homing_offset": -12, "range_min": 700, "range_max": 3400},
  "3rd": {"id": 2, "drive_mode": 0, "homing_offset": 100, "range_min": 900, "range_max": 901},
  "stop": {"id": 253, "drive_mode": 0, "homing_offset": 0, "range_min": 10, "range_max": 20}
}"#;

#[test]
fn a_calibration_becomes_joints() {
    let folder = demo("joints");
    folder.file("arm.json", CALIBRATION.as_bytes());
    let output = folder.run(&["joints", "arm.json"]);
    let lines = "joint shoulder_pan servo 1 zero 2050 reversed 700..3400\n\
        joint _3rd servo 2 zero 900.5 900..901\n\
        joint wrist_roll servo 5 zero 2047.5 0..4095\n\
        joint stop_ servo 253 zero 15 10..20\n";
    assert_eq!((stdout(&output), stderr(&output), code(&output)), (lines.to_owned(), String::new(), 0));
    let mut child = motionseq(&["joints", "-"]).stdin(std::process::Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(CALIBRATION.as_bytes()).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn a_wrong_calibration_prints_nothing() {
    let folder = demo("joints-wrong");
    let entry = r#"{"id": 1, "drive_mode": 0, "homing_offset": 0, "range_min": 700, "range_max": 3400}"#;
    let with = |old: &str, new: &str| format!("{{\"elbow\": {}}}", entry.replace(old, new));
    let cases = [
        ("{".to_owned(), "this is not JSON: EOF while parsing"),
        (format!("{{\"elbow\": {entry}}} more"), "this is not JSON: trailing characters at line 1"),
        ("[]".to_owned(), "is a JSON object with one entry for each motor"),
        ("{}".to_owned(), "contains no motor"),
        ("{\"elbow\": 3}".to_owned(), "`elbow` is not an object with `id`"),
        (format!("{{\"-\": {entry}}}"), "the name `-` has no letter or digit"),
        (with("\"id\": 1, ", ""), "`elbow` has no `id`"),
        (with("\"id\": 1", "\"id\": 254"), "`id` of `elbow` is 254, and must be from 0 to 253"),
        (with("\"id\": 1", "\"id\": -1"), "`id` of `elbow` is -1"),
        (with("\"id\": 1", "\"id\": 1.5"), "`id` of `elbow` is not a whole number"),
        (with("\"id\": 1", "\"id\": \"1\""), "`id` of `elbow` is not a whole number"),
        (with("\"drive_mode\": 0", "\"drive_mode\": 2"), "`drive_mode` of `elbow` is 2, and must be from 0 to 1"),
        (with("\"drive_mode\": 0", "\"drive_mode\": false"), "`drive_mode` of `elbow` is not a whole number"),
        (with("\"homing_offset\": 0", "\"homing_offset\": null"), "`homing_offset` of `elbow` is not a whole number"),
        (with("3400", "4096"), "`range_max` of `elbow` is 4096, and must be from 0 to 4095"),
        (with("3400", "600"), "`range_min` of `elbow` is 700, and must be less than `range_max`, 600"),
        (with("3400", "700"), "must be less than `range_max`, 700"),
        (format!("{{\"b\": {entry}, \"a\": {entry}}}"), "have the same `id`, 1"),
        (
            format!("{{\"a b\": {entry}, \"A-B\": {}}}", entry.replace("\"id\": 1", "\"id\": 2")),
            "would have the same name in a script, `a_b`",
        ),
    ];
    for (text, words) in cases {
        folder.file("arm.json", text.as_bytes());
        let output = folder.run(&["joints", "arm.json"]);
        let (out, error) = (stdout(&output), stderr(&output));
        assert!(out.is_empty() && code(&output) == 1 && error.contains(words), "{text}: {out}\n{error}");
        assert!(error.contains("arm.json: "), "{error}");
    }
    says(&folder, &["joints", "nosuch.json"], 1, "cannot read nosuch.json");
    says(&folder, &["joints"], 2, "<FILE>");
    says(&folder, &["joints", "arm.json", "more"], 2, "unexpected argument");
}
