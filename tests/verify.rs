//! `test` and `check --format`: scripts against their snapshots, and the reports for other
//! programs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::support::{code, motionseq, stderr, stdout};

/// A folder of scripts, removed at the end.
struct Repository(PathBuf);

impl Repository {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("motionseq-verify-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        Repository(folder)
    }

    fn file(&self, name: &str, text: &str) -> &Self {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
        self
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).unwrap()
    }

    fn run(&self, args: &[&str]) -> Output {
        motionseq(args).current_dir(&self.0).output().unwrap()
    }
}

impl Drop for Repository {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const DANCE: &str = "def nod(depth = 200us) {\n  servo 2 (1500us + depth)\n  wait 200ms\n  servo 2 1500\n}\n\
    repeat 2 {\n  nod()\n  wait 100ms\n}\n";

/// A repository with a script, a used file and a script that must not compile, all blessed.
fn blessed(name: &str) -> Repository {
    let repository = Repository::new(name);
    repository
        .file("dance.motion", DANCE)
        .file("lib/phrases.motion", "def bow() { servo 2 1700 }\n")
        .file("more/bow.motion", "servo 2 1700\n")
        .file("more/never.motion", "# expect-error: out-of-range\nservo 1 3000\n");
    let output = repository.run(&["test", "--bless"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(stderr(&output), "4 scripts: 4 passed (2 blessed), 0 failed\n");
    repository
}

#[test]
fn the_shipped_scripts_match_their_snapshots() {
    let output = crate::support::run(&["test", "--play", "scripts"]);
    assert_eq!(code(&output), 0, "{}", stdout(&output));
    assert_eq!(stderr(&output), "23 scripts: 23 passed, 0 failed\n");
    // The shipped scripts have no warnings.
    for entry in fs::read_dir("scripts").unwrap().map(|entry| entry.unwrap().path()) {
        if entry.extension().is_some_and(|extension| extension == "motion") {
            let output = crate::support::run(&["check", "--deny", "warnings", entry.to_str().unwrap()]);
            assert_eq!(code(&output), 0, "{}", stderr(&output));
        }
    }
}

#[test]
fn what_is_blessed_passes_and_a_changed_pulse_width_fails_at_its_line() {
    let repository = blessed("changed");
    let snapshot = repository.read("dance.motion.frames");
    assert!(snapshot.starts_with(
        "# motionseq frames 3\n# dance.motion\n# board\traspblock\n0.000000\tFF FE 02 03 02 06 A4 B1\tservo 2 1700\n"
    ));
    // Phrases and scripts that must not compile have no snapshots.
    assert!(!repository.0.join("lib/phrases.motion.frames").exists());
    assert!(!repository.0.join("more/never.motion.frames").exists());
    let output = repository.run(&["test"]);
    assert_eq!((code(&output), stdout(&output).as_str()), (0, ""));

    repository.file("dance.motion", &DANCE.replace("200us", "250us"));
    let output = repository.run(&["test", "--junit", "report.xml"]);
    assert_eq!(code(&output), 1);
    assert_eq!(
        stdout(&output),
        "FAILED dance.motion: differs from its snapshot\n  \
         at 0.000 s (dance.motion:2, nod, pass 1): servo 2 1700 -> 1750, the same once more at 0.300 s\n  \
         if the change is intended: motionseq test --bless dance.motion\n"
    );
    assert_eq!(stderr(&output), "4 scripts: 3 passed, 1 failed\n");
    let report = repository.read("report.xml");
    assert!(report.contains("tests=\"4\"") && report.contains("failures=\"1\""), "{report}");
    assert!(
        report.contains("<testcase name=\"dance.motion\"") && report.contains("servo 2 1700 -&gt; 1750"),
        "{report}"
    );
    // Checking changes nothing.
    assert_eq!(repository.read("dance.motion.frames"), snapshot);
    assert_eq!(code(&repository.run(&["test", "--bless", "dance.motion"])), 0);
    assert_eq!(code(&repository.run(&["test"])), 0);
}

#[test]
fn every_format_reports_the_same() {
    let repository = blessed("forms");
    repository.file("dance.motion", &DANCE.replace("200us", "250us")).file("worse.motion", "servo 1 3000\n");
    let output = repository.run(&["test", "--format", "json"]);
    assert_eq!(code(&output), 1);
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(
        (json["version"].as_u64(), json["passed"].as_u64(), json["failed"].as_u64()),
        (Some(1), Some(3), Some(2))
    );
    assert_eq!(json["cases"][0]["problems"][0]["line"], 2);
    assert_eq!(json["cases"][4]["problems"][0]["code"], "out-of-range");
    let tap = stdout(&repository.run(&["test", "--format", "tap"]));
    assert!(tap.starts_with("TAP version 13\n1..5\nnot ok 1 - dance.motion: differs from its snapshot\n# at 0.000 s"));
    assert!(tap.contains("\nok 4 - more/never.motion: ok, fails as expected\nnot ok 5 - worse.motion:"), "{tap}");
    let github = stdout(&repository.run(&["test", "--format", "github"]));
    assert!(github.contains("::error file=dance.motion,line=2,title=difference::at 0.000 s"), "{github}");
    assert!(github.contains("::error file=worse.motion,line=1,title=out-of-range::"), "{github}");
    // The order does not depend on the number of threads.
    let one = stdout(&repository.run(&["test", "--jobs", "1"]));
    let many = stdout(&repository.run(&["test", "--jobs", "8"]));
    assert_eq!(one, many);
}

#[test]
fn a_used_file_is_named_from_the_folder_of_the_script() {
    let repository = Repository::new("used");
    repository.file("lib/p.motion", "def bow() { servo 2 1700 }\n").file("b.motion", "use \"lib/p.motion\"\nbow()\n");
    assert_eq!(code(&repository.run(&["test", "--bless"])), 0);
    repository.file("lib/p.motion", "def bow() { servo 2 1600 }\n");
    let output = stdout(&repository.run(&["test", "--format", "github"]));
    assert!(output.starts_with("::error file=lib/p.motion,line=1,title=difference::"), "{output}");
    // The same on every machine and in every folder.
    let output = stdout(&repository.run(&["render", "b.motion", "--format", "jsonl"]));
    assert!(output.contains("\"file\":\"lib/p.motion\""), "{output}");
}

#[test]
fn missing_orphaned_and_broken_snapshots_are_reported_with_a_fix() {
    let repository = blessed("broken");
    fs::remove_file(repository.0.join("dance.motion.frames")).unwrap();
    repository
        .file("gone.motion.frames", "# motionseq frames 1\n")
        .file("more/bow.motion.frames", "# motionseq frames 1\n0.0");
    let output = repository.run(&["test"]);
    assert_eq!(code(&output), 1);
    let text = stdout(&output);
    assert!(
        text.contains("dance.motion.frames is missing; write it with `motionseq test --bless dance.motion`"),
        "{text}"
    );
    assert!(text.contains("more/bow.motion.frames:2: snapshot: the frame is missing"), "{text}");
    assert!(text.contains("warning: gone.motion.frames: is a snapshot without a script\n"), "{text}");
    assert_eq!(stderr(&output), "4 scripts: 2 passed, 2 failed, 1 snapshot without a script\n");
    assert!(
        stdout(&repository.run(&["test", "--format", "json"]))
            .contains("\"passed\": 2,\n  \"failed\": 2,\n  \"orphans\": 1")
    );
    assert!(
        stdout(&repository.run(&["test", "--format", "tap"]))
            .contains("ok 5 - gone.motion.frames: is a snapshot without a script # SKIP")
    );
    assert!(!stdout(&repository.run(&["test", "-q"])).contains("gone.motion.frames"));
    let github = stdout(&repository.run(&["test", "--format", "github"]));
    assert!(github.contains("::warning file=gone.motion.frames,title=orphan::"), "{github}");
    // `--bless` fixes both, and creates nothing else.
    assert_eq!(code(&repository.run(&["test", "--bless"])), 0);
    let names = |folder: &Path| {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&repository.0.join("more")), ["bow.motion", "bow.motion.frames", "never.motion"]);
    // A newer snapshot than this program knows is not overwritten.
    repository.file("more/bow.motion.frames", "# motionseq frames 9\n");
    assert!(
        stdout(&repository.run(&["test"]))
            .contains("version 9 is too new: this motionseq reads versions up to 3, so update it\n")
    );
    assert_eq!(code(&repository.run(&["test", "--bless"])), 1);
    assert_eq!(repository.read("more/bow.motion.frames"), "# motionseq frames 9\n");
}

#[test]
fn a_script_that_expects_an_error_must_have_it() {
    let repository = Repository::new("expected");
    for (text, words) in [
        ("# expect-error: out-of-range\nservo 1 1500\n", "expected the error `out-of-range`, but the script compiles"),
        ("# expect-error: clash\nservo 1 3000\n", "expected the error `clash`, but found `out-of-range`"),
        ("# expect-error:\nservo 1 3000\n", "the code of the error is missing; write `# expect-error: out-of-range`"),
        ("# expect-error: nonsense\nservo 1 3000\n", "unknown code `nonsense`"),
    ] {
        repository.file("x.motion", text);
        let output = repository.run(&["test"]);
        assert_eq!(code(&output), 1);
        assert!(stdout(&output).contains(words), "{}", stdout(&output));
    }
}

#[test]
fn link_cycles_and_folders_without_scripts_are_reported() {
    let repository = blessed("links");
    std::os::unix::fs::symlink("..", repository.0.join("more/round")).unwrap();
    let output = repository.run(&["test"]);
    assert_eq!(code(&output), 1);
    assert!(
        stdout(&output)
            .contains("FAILED more/round: cannot be read\n  more/round: unreadable: the link forms a cycle with ."),
        "{}",
        stdout(&output)
    );
    // The reports for programs contain the same.
    for (format, words) in [
        ("json", "\"verdict\": \"cannot be read\""),
        ("tap", "not ok 1 - more/round: cannot be read"),
        ("github", "::error file=more/round,title=unreadable::"),
    ] {
        let output = repository.run(&["test", "--format", format]);
        assert!(code(&output) == 1 && stdout(&output).contains(words), "{}", stdout(&output));
    }
    let empty = Repository::new("empty");
    let output = empty.run(&["test"]);
    assert_eq!((code(&output), stderr(&output).as_str()), (1, "error: no .motion files in .\n"));
    let output = empty.run(&["test", "nothere"]);
    assert_eq!((code(&output), stderr(&output).as_str()), (1, "1 script: 0 passed, 1 failed\n"));
    assert!(stdout(&output).contains("nothere: unreadable: no such file or directory"), "{}", stdout(&output));
    // Names that start with a dot are skipped.
    let output = empty.file(".git/x.motion", "nonsense").run(&["test"]);
    assert!(stderr(&output).contains("no .motion files"));
}

#[test]
fn a_bless_that_cannot_write_leaves_what_was_there() {
    let repository = blessed("full");
    let before = repository.read("dance.motion.frames");
    repository.file("dance.motion", &DANCE.replace("200us", "250us"));
    // The maximum file size is zero.
    let shell = format!("ulimit -f 0; exec {} test --bless", env!("CARGO_BIN_EXE_motionseq"));
    let output = std::process::Command::new("sh").args(["-c", &shell]).current_dir(&repository.0).output().unwrap();
    assert_ne!(output.status.code(), Some(0));
    assert_eq!(repository.read("dance.motion.frames"), before);
}

#[test]
fn ten_thousand_scripts_pass() {
    let repository = Repository::new("many");
    for number in 0..10_000 {
        repository.file(&format!("{}/{number}.motion", number / 1_000), "servo 1 1500\n");
    }
    assert_eq!(code(&repository.run(&["test", "--bless", "-q"])), 0);
    let output = repository.run(&["test"]);
    assert_eq!(stderr(&output), "10000 scripts: 10000 passed, 0 failed\n");
}

const CHECKUP: &str = "# rehearse: unplug@1s\non abort { servo 1 1500 }\nservo 1 1500\nwait 1500ms\nexpect voltage > 10V \"charge it\"\nservo 1 1900\n";

#[test]
fn expectations_are_judged_and_frames_sent_on_abort_are_a_snapshot() {
    let repository = Repository::new("played");
    repository.file("checkup.motion", CHECKUP).file("dance.motion", "servo 1 1500\nrocker y=10 for 1s\n");
    assert_eq!(code(&repository.run(&["test", "--bless"])), 0);
    // Without its snapshot a rehearsal fails, and describes what would be sent.
    let output = repository.run(&["test", "--play"]);
    assert_eq!(code(&output), 1);
    assert!(
        stdout(&output).contains("checkup.motion.unplug@1s.frames is missing; write it with `motionseq test --play --bless checkup.motion`; frames sent then: `stop`, `stop`, `stop`, `buzzer off`, `servo 1 1500`"),
        "{}",
        stdout(&output)
    );
    assert_eq!(code(&repository.run(&["test", "--play", "--bless"])), 0);
    assert_eq!(
        repository.read("checkup.motion.unplug@1s.frames"),
        "# motionseq frames 3\n# checkup.motion unplug@1s\n# board\traspblock\n\
         1.000000\tFF FE 03 08 01 00 00 00 00 00 00 01 0D\tstop\tabort\n\
         1.020000\tFF FE 03 08 01 00 00 00 00 00 00 01 0D\tstop\tabort\n\
         1.040000\tFF FE 03 08 01 00 00 00 00 00 00 01 0D\tstop\tabort\n\
         1.040000\tFF FE 04 01 00 05\tbuzzer off\tabort\n\
         1.040000\tFF FE 02 03 01 05 DC E7\tservo 1 1500\tabort\n\
         # end\t1.040000\tframes\t5\tbaud\t115200\n"
    );
    let output = repository.run(&["test", "--play"]);
    assert_eq!((code(&output), stdout(&output).as_str()), (0, ""), "{}", stderr(&output));
    // An empty battery: exit code 7, and a JUnit file with the line and the value.
    let output = repository.run(&["test", "--play", "--fault", "battery=6.5V@1s", "--junit", "report.xml"]);
    assert_eq!(code(&output), 7, "{}", stdout(&output));
    let words =
        "checkup.motion:5: expect: at 1.500000 s: `expect voltage &gt; 10V` failed: the board reports 6.50 (charge it)";
    assert!(repository.read("report.xml").contains(words), "{}", repository.read("report.xml"));
    let github = stdout(&repository.run(&["test", "--play", "--fault", "silent", "--format", "github"]));
    assert!(github.starts_with("::error file=checkup.motion,line=5,title=expect::"), "{github}");
    // If there are differences too, the exit code is the 1 of a failing script.
    repository.file("dance.motion", "servo 1 1600\nrocker y=10 for 1s\n");
    assert_eq!(code(&repository.run(&["test", "--play", "--fault", "battery=6.5V"])), 1);
    // Another `on abort` is described by the frames that are sent.
    repository.file("checkup.motion", &CHECKUP.replace("abort { servo 1 1500", "abort { servo 1 1700"));
    let output = repository.run(&["test", "--play", "checkup.motion"]);
    assert_eq!(code(&output), 1);
    assert!(
        stdout(&output).contains("with unplug@1s: on abort, at 1.040 s: servo 1 1500 -> 1700")
            || stdout(&output).contains("with unplug@1s: at 1.040 s: servo 1 1500 -> 1700"),
        "{}",
        stdout(&output)
    );
    // A newer version is not overwritten, a displacement in progress is not at rest, and a raw
    // frame is shown as it is.
    repository.file("checkup.motion.unplug@1s.frames", "# motionseq frames 9\n");
    assert_eq!(code(&repository.run(&["test", "--play", "--bless", "checkup.motion"])), 1);
    assert_eq!(repository.read("checkup.motion.unplug@1s.frames"), "# motionseq frames 9\n");
    repository
        .file("moving.motion", "pid position speed=0,0 position=0,0,0 yaw=0,0,0\nmove y=1000\nwait 1s\n")
        .file("raw.motion", "raw 0x04 0x01\nraw 3 8\n");
    assert_eq!(code(&repository.run(&["test", "--bless", "moving.motion", "raw.motion"])), 0);
    assert_eq!(code(&repository.run(&["test", "raw.motion"])), 0);
    let output = repository.run(&["test", "--play", "moving.motion"]);
    assert!(stdout(&output).contains("the robot is moving at the end; add a `wait`"), "{}", stdout(&output));
    // A line that only resembles a rehearsal, one that rehearses nothing, and a snapshot that is no
    // longer used.
    for (line, words) in [
        ("#Rehearse: unplug@1s", "odd.motion:1: play: write `# rehearse: unplug@4s`"),
        ("# rehearse unplug@1s", "odd.motion:1: play: write `# rehearse: unplug@4s`"),
        ("# rehearse: unplug@1h", "odd.motion:1: play: unplug@1h does not end this script early"),
        (
            "# nothing",
            "odd.motion.silent.frames: orphan: no `# rehearse:` line of the script uses it: git rm odd.motion.silent.frames",
        ),
    ] {
        repository.file("odd.motion", &format!("{line}\nservo 1 1500\n")).file("odd.motion.silent.frames", "");
        let output = repository.run(&["test", "--play", "odd.motion"]);
        assert!(stdout(&output).contains(words), "{}", stdout(&output));
    }
    std::fs::remove_file(repository.0.join("odd.motion.silent.frames")).unwrap();
    // A pipe is not a snapshot, and is not waited for.
    assert!(
        std::process::Command::new("mkfifo").arg(repository.0.join("odd.motion.frames")).status().unwrap().success()
    );
    assert!(stdout(&repository.run(&["test", "odd.motion"])).contains("it is not a regular file"));
    std::fs::remove_file(repository.0.join("odd.motion.frames")).unwrap();
    // An unknown fault lists the known ones.
    repository.file("odd.motion", "# rehearse: fire\nservo 1 1500\n");
    let output = repository.run(&["test", "--play", "odd.motion"]);
    assert!(stdout(&output).contains("odd.motion:1: play: unknown fault `fire`; write drop=5%"), "{}", stdout(&output));
    assert_eq!(code(&repository.run(&["test", "--fault", "silent"])), 2);
    // A port that is lost or stalls during a rehearsal is reported at its line.
    let output = repository.run(&["test", "--play", "--fault", "stall@500ms", "dance.motion"]);
    assert!(stdout(&output).contains("with stall@500ms: the port stopped accepting bytes at"), "{}", stdout(&output));
}

#[test]
fn check_reports_the_same_in_every_format() {
    let repository = Repository::new("check");
    repository.file("sub dir/x.motion", "servo 1 3000\nlet ä = 1\nservo 2 1900\n").file("ok.motion", "servo 1 1500\n");
    let args = ["check", "ok.motion", "sub dir/x.motion", "--format"];
    let json = repository.run(&[&args[..], &["json"]].concat());
    assert_eq!(code(&json), 1);
    let json: serde_json::Value = serde_json::from_str(&stdout(&json)).unwrap();
    assert_eq!(json["errors"], 2);
    let first = &json["findings"][0];
    assert_eq!(
        (first["file"].as_str(), first["line"].as_u64(), first["column"].as_u64()),
        (Some("sub dir/x.motion"), Some(1), Some(9))
    );
    assert_eq!((first["code"].as_str(), first["severity"].as_str()), (Some("out-of-range"), Some("error")));
    // Columns count characters.
    assert_eq!(
        (json["findings"][1]["column"].as_u64(), json["findings"][1]["end_column"].as_u64()),
        (Some(5), Some(6))
    );
    let github = stdout(&repository.run(&[&args[..], &["github"]].concat()));
    assert!(github.starts_with(
        "::error file=sub dir/x.motion,line=1,endLine=1,col=9,endColumn=13,title=out-of-range::pulse width 3000 is"
    ));
    let sarif: serde_json::Value =
        serde_json::from_str(&stdout(&repository.run(&[&args[..], &["sarif"]].concat()))).unwrap();
    assert_eq!(sarif["version"], "2.1.0");
    let result = &sarif["runs"][0]["results"][0];
    assert_eq!(result["ruleId"], "out-of-range");
    assert_eq!(result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"], "sub%20dir/x.motion");
    assert_eq!(result["locations"][0]["physicalLocation"]["region"]["startColumn"], 9);
    // Every code that a script can have is a rule.
    let rules = sarif["runs"][0]["tool"]["driver"]["rules"].as_array().unwrap();
    assert!(rules.iter().any(|rule| rule["id"] == "left-running") && rules.len() > 30);
    assert_eq!(code(&repository.run(&["check", "ok.motion", "--format", "sarif"])), 0);
    // A folder means every script in it, except those that expect an error.
    repository
        .file("never.motion", "# expect-error: clash\nservo 1 1000\nservo 1 2000\n")
        .file("lib/p.motion", "def bow() { stop }\n");
    assert_eq!(code(&repository.run(&["check", "never.motion"])), 1);
    let output = repository.run(&["check", "--deny", "warnings", "."]);
    assert_eq!((code(&output), stderr(&output).matches("out-of-range\n\n").count()), (1, 1), "{}", stderr(&output));
    assert!(!stderr(&output).contains("unused") && !stderr(&output).contains("clash\n"), "{}", stderr(&output));
    assert!(stderr(&output).contains("never.motion: ok, fails with `clash` as expected"), "{}", stderr(&output));
    // A missing file is reported.
    let output = repository.run(&["check", "gone.motion", "--format", "github"]);
    assert_eq!(code(&output), 1);
    assert!(stdout(&output).starts_with("::error file=gone.motion,line=1,"), "{}", stdout(&output));
}

#[test]
fn a_file_name_is_bytes() {
    use std::os::unix::ffi::OsStrExt as _;
    let repository = Repository::new("bytes");
    let name = |bytes: &[u8]| repository.0.join(std::ffi::OsStr::from_bytes(bytes));
    fs::write(name(b"wrong-\xFF.motion"), "servo 1 3000\n").unwrap();
    fs::write(name(b"right-\xFF.motion"), "# rehearse: unplug@1s\nrocker y=5 for 2s\n").unwrap();
    fs::create_dir(name(b"more\xFE")).unwrap();
    fs::write(name(b"more\xFE/gone\xFF.motion.frames"), "").unwrap();
    let check = repository.run(&["check", "."]);
    assert_eq!(code(&check), 1, "{}", stderr(&check));
    assert!(stderr(&check).contains("wrong-\u{FFFD}.motion: 1 error"), "{}", stderr(&check));
    assert!(stderr(&check).contains("right-\u{FFFD}.motion: ok"), "{}", stderr(&check));
    let output = repository.run(&["test", "--play", "--bless"]);
    let text = stdout(&output);
    assert_eq!(code(&output), 1);
    assert!(text.contains("FAILED wrong-\u{FFFD}.motion: does not compile"), "{text}");
    assert!(text.contains("more\u{FFFD}/gone\u{FFFD}.motion.frames: is a snapshot without a script"), "{text}");
    assert!(name(b"right-\xFF.motion.frames").exists() && name(b"right-\xFF.motion.unplug@1s.frames").exists());
    fs::remove_file(name(b"wrong-\xFF.motion")).unwrap();
    assert_eq!(code(&repository.run(&["test", "--play"])), 0);
    // An unused snapshot of a rehearsal is found too; naming a snapshot tests its script.
    fs::copy(name(b"right-\xFF.motion.frames"), name(b"right-\xFF.motion.silent.frames")).unwrap();
    let output = repository.run(&["test", "--play"]);
    assert!(stdout(&output).contains("right-\u{FFFD}.motion.silent.frames: orphan"), "{}", stdout(&output));
    let mut diff = motionseq(&["diff"]);
    diff.args([name(b"right-\xFF.motion"), name(b"right-\xFF.motion.frames")]);
    assert_eq!(code(&diff.output().unwrap()), 0);
}

#[test]
fn annotations_point_at_files_of_the_repository() {
    let repository = Repository::new("places");
    repository.file(".git/HEAD", "").file("robots/a b.motion", "servo 1 3000\n").file("top.motion", "servo 1 3000\n");
    let robots = repository.0.join("robots");
    let run = |args: &[&str], workspace: Option<&str>| {
        let mut command = motionseq(args);
        command.current_dir(&robots).env_remove("GITHUB_WORKSPACE");
        if let Some(workspace) = workspace {
            command.env("GITHUB_WORKSPACE", workspace);
        }
        stdout(&command.output().unwrap())
    };
    let root = repository.0.to_str().unwrap();
    for workspace in [None, Some(root), Some("")] {
        for script in
            ["a b.motion", "./a b.motion", "../robots/a b.motion", robots.join("a b.motion").to_str().unwrap()]
        {
            let github = run(&["check", "--format", "github", script], workspace);
            assert!(github.starts_with("::error file=robots/a b.motion,line=1,"), "{script}: {github}");
            let github = run(&["test", "--format", "github", script], workspace);
            assert!(github.starts_with("::error file=robots/a b.motion,line=1,"), "{script}: {github}");
            let sarif = run(&["check", "--format", "sarif", script], workspace);
            assert!(sarif.contains("\"uri\": \"robots/a%20b.motion\""), "{script}: {sarif}");
            run(&["test", "--junit", "../report.xml", script], workspace);
            assert!(
                repository.read("report.xml").contains("name=\"robots/a b.motion\""),
                "{}",
                repository.read("report.xml")
            );
        }
        let github = run(&["check", "--format", "github", "../top.motion"], workspace);
        assert!(github.starts_with("::error file=top.motion,line=1,"), "{github}");
    }
    // A workspace has precedence over a repository inside it.
    fs::create_dir_all(robots.join(".git")).unwrap();
    let github = run(&["check", "--format", "github", "a b.motion"], Some(root));
    assert!(github.starts_with("::error file=robots/a b.motion,"), "{github}");
    // A missing file too; other formats keep the names that they were given.
    let github = run(&["check", "--format", "github", "./gone.motion"], Some(root));
    assert!(github.starts_with("::error file=robots/gone.motion,"), "{github}");
    assert!(run(&["check", "--format", "json", "../top.motion"], None).contains("\"file\": \"../top.motion\""));
}

/// Characters that are invisible or that XML forbids, which results show escaped.
const HIDDEN: &str = "a\u{202E}\u{1b}[1m\u{FFFE}\u{2028}z.motion";
const SHOWN: &str = r"a\u{202e}\u{1b}[1m\u{fffe}\u{2028}z.motion";

#[test]
fn names_with_hidden_characters_are_shown_escaped() {
    let repository = Repository::new("hidden");
    let used = "nested\u{FFFF}.motion";
    repository.file(HIDDEN, "servo 1 3000\n").file(used, "use \"no\u{FFFE}pe.motion\"\nservo 1 1500\n");
    fs::write(repository.0.join("line\nend.motion"), "servo 1 3000\n").unwrap();
    for args in [
        &["test", "--format", "tap", "--junit", "report.xml"][..],
        &["test", "--format", "github"],
        &["check", ".", "--format", "github"],
    ] {
        let text =
            stdout(&repository.run(args)) + &fs::read_to_string(repository.0.join("report.xml")).unwrap_or_default();
        assert!(text.contains(SHOWN) || text.contains(&SHOWN.replace('\\', "\\\\")), "{args:?}: {text}");
        let hidden =
            text.chars().find(|c| (c.is_control() && *c != '\n') || "\u{202E}\u{FFFE}\u{FFFF}\u{2028}".contains(*c));
        assert_eq!(hidden, None, "{args:?}: {text}");
        assert!(!text.contains("line\nend"), "{args:?}: {text}");
    }
}

#[test]
fn warnings_and_orphans_fail_where_they_are_denied() {
    let repository = Repository::new("denied");
    repository
        .file("fine.motion", "servo 1 1500\n")
        .file("left.motion", "rocker y=5\nwait 1s\n")
        .file("phrases.motion", "def bow() { stop }\n# allow: stop\n")
        .file("never.motion", "# expect-error: clash\nraw 4 0\nservo 1 1000\nservo 1 2000\n");
    assert_eq!(code(&repository.run(&["test", "--bless"])), 0);
    repository.file("gone.motion.frames", &repository.read("fine.motion.frames"));
    assert_eq!(code(&repository.run(&["test"])), 0);
    let output = repository.run(&["test", "--deny", "warnings", "--junit", "report.xml"]);
    let text = stdout(&output);
    assert_eq!(code(&output), 1);
    assert!(
        text.contains("FAILED left.motion: has warnings, and warnings are denied\n  left.motion:1: left-running: "),
        "{text}"
    );
    assert!(
        text.contains("FAILED phrases.motion: has warnings") && text.contains("phrases.motion:2: allow: "),
        "{text}"
    );
    assert!(text.contains("FAILED gone.motion.frames: is a snapshot without a script"), "{text}");
    assert!(!text.contains("fine.motion") && !text.contains("never.motion"), "{text}");
    assert_eq!(stderr(&output), "4 scripts: 2 passed, 3 failed, 1 snapshot without a script\n");
    let junit = repository.read("report.xml");
    assert!(junit.contains("failures=\"3\"") && !junit.contains("<skipped"), "{junit}");
    let json: serde_json::Value =
        serde_json::from_str(&stdout(&repository.run(&["test", "--deny", "warnings", "--format", "json"]))).unwrap();
    assert_eq!((&json["passed"], &json["failed"], &json["orphans"]), (&2.into(), &3.into(), &1.into()));
    let tap = stdout(&repository.run(&["test", "--deny", "warnings", "--format", "tap"]));
    assert!(tap.matches("\nnot ok ").count() == 3 && !tap.contains("# SKIP"), "{tap}");
    let github = stdout(&repository.run(&["test", "--deny", "warnings", "--format", "github"]));
    assert!(github.contains("::error file=gone.motion.frames,title=orphan::"), "{github}");
    // They are written all the same.
    fs::remove_file(repository.0.join("left.motion.frames")).unwrap();
    assert_eq!(code(&repository.run(&["test", "--deny", "warnings", "--bless", "left.motion"])), 1);
    assert!(repository.0.join("left.motion.frames").exists());
}

#[test]
fn every_format_explains_how_to_bless_a_change() {
    let repository = blessed("hint");
    repository.file("dance.motion", &DANCE.replace("200us", "250us"));
    let hint = "if the change is intended: motionseq test --bless dance.motion";
    for (args, count) in [
        (&["test"][..], 1),
        (&["test", "--format", "tap"], 1),
        (&["test", "--format", "github"], 1),
        (&["test", "-q", "--junit", "/dev/stdout", "--format", "tap"], 2),
    ] {
        let text = stdout(&repository.run(args));
        assert_eq!(text.matches(hint).count(), count, "{args:?}: {text}");
    }
}

#[test]
fn a_byte_order_mark_hides_no_expected_error() {
    let repository = Repository::new("bom");
    repository.file("never.motion", "\u{FEFF}# expect-error: out-of-range\nservo 1 3000\n");
    let output = repository.run(&["test"]);
    assert_eq!((code(&output), stderr(&output).as_str()), (0, "1 script: 1 passed, 0 failed\n"), "{}", stdout(&output));
    assert_eq!(code(&repository.run(&["check", "."])), 0);
}

#[test]
fn counts_are_those_of_all_findings_and_rules_explain_themselves() {
    let repository = Repository::new("counts");
    repository.file("many.motion", &"servoo\n".repeat(700)).file("few.motion", "servo 1 3000\nraw 4 0\n");
    let output = repository.run(&["check", "many.motion", "few.motion", "gone.motion", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&json["errors"], &json["warnings"], &json["left_out"]), (&702.into(), &1.into(), &200.into()));
    assert_eq!(json["findings"].as_array().unwrap().len(), 503);
    let output = repository.run(&["check", "few.motion", "--format", "sarif"]);
    let sarif: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    for rule in sarif["runs"][0]["tool"]["driver"]["rules"].as_array().unwrap() {
        let text = |name: &str| rule[name]["text"].as_str().unwrap_or_default().len();
        assert!(text("help") > 20 && text("fullDescription") > 10 && text("shortDescription") > 5, "{rule}");
    }
}

#[test]
fn the_schema_of_a_frame_has_every_kind() {
    let schema: serde_json::Value =
        serde_json::from_str(&fs::read_to_string("docs/schemas/frame.json").unwrap()).unwrap();
    let known = schema["properties"]["kind"]["enum"].as_array().unwrap();
    for kind in motionseq::timeline::Kind::ALL {
        let word = kind.word().unwrap_or("command");
        assert!(known.iter().any(|known| known == word), "{word}");
    }
}
