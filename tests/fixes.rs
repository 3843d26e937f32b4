//! `check --fix` and `check --diff`: what they change, and what they never do; the formats that carry the corrections.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::process::{Output, Stdio};

use serde_json::Value;

use crate::support::{Scratch, code, motionseq, stderr, stdout, with_motionseq};

/// A folder with a script and a file that it uses. Each has an error that `--fix` fixes and text that must stay as it is.
fn scratch(name: &str) -> Scratch {
    let scratch = Scratch::new(&format!("fixes-{name}"));
    fs::create_dir_all(scratch.0.join("lib")).unwrap();
    scratch.file("main.motion", "use \"lib/moves.motion\"\r\n  Servo   1 1500   # größer\nnod()".as_bytes());
    scratch.file("lib/moves.motion", b"def nod() {\n\tservo 2 1500\n\twait 200 ms\n}\n\n");
    scratch
}

const FIXED: [&str; 2] = [
    "use \"lib/moves.motion\"\r\n  servo   1 1500   # größer\nnod()",
    "def nod() {\n\tservo 2 1500\n\twait 200ms\n}\n\n",
];

fn texts(scratch: &Scratch) -> [String; 2] {
    ["main.motion", "lib/moves.motion"].map(|name| fs::read_to_string(scratch.0.join(name)).unwrap())
}

fn check(scratch: &Scratch, args: &[&str]) -> Output {
    motionseq(&[&["check"], args].concat()).current_dir(&scratch.0).output().unwrap()
}

fn check_input(scratch: &Scratch, args: &[&str], input: &str) -> Output {
    let mut command = motionseq(&[&["check"], args].concat());
    command.current_dir(&scratch.0).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn fixes_change_the_script_and_the_files_it_uses_and_nothing_else() {
    let scratch = scratch("all");
    let main = scratch.0.join("main.motion");
    fs::set_permissions(&main, fs::Permissions::from_mode(0o640)).unwrap();
    symlink("main.motion", scratch.0.join("link.motion")).unwrap();
    let output = check(&scratch, &["link.motion", "--fix"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("link.motion: ok, 2 frames"), "{said}");
    assert!(said.contains("fixed 1 error in link.motion\n"), "{said}");
    assert!(said.contains("fixed 1 error in lib/moves.motion\n"), "{said}");
    assert_eq!(texts(&scratch), FIXED);
    assert_eq!(fs::metadata(&main).unwrap().permissions().mode() & 0o777, 0o640);
    assert!(fs::symlink_metadata(scratch.0.join("link.motion")).unwrap().is_symlink());
    let output = check(&scratch, &["main.motion", "--fix"]);
    assert!(code(&output) == 0 && !stderr(&output).contains("fixed"), "{}", stderr(&output));
}

#[test]
fn a_difference_shows_the_fixes_and_changes_nothing() {
    let scratch = scratch("difference");
    let before = texts(&scratch);
    // The library is used twice, and fixed once.
    scratch.file("other.motion", b"use \"lib/moves.motion\"\nnod()\n");
    let output = check(&scratch, &["--diff", "main.motion", "other.motion"]);
    assert_eq!(code(&output), 1);
    let shown = "\
--- lib/moves.motion
+++ lib/moves.motion
@@ -1,5 +1,5 @@
 def nod() {
 \tservo 2 1500
-\twait 200 ms
+\twait 200ms
 }
\u{20}
--- main.motion
+++ main.motion
@@ -1,3 +1,3 @@
 use \"lib/moves.motion\"\r
-  Servo   1 1500   # größer
+  servo   1 1500   # größer
 nod()
\\ No newline at end of file
";
    assert_eq!(stdout(&output), shown);
    assert_eq!(stderr(&output), "2 errors would be fixed\n");
    assert_eq!(texts(&scratch), before);
    check(&scratch, &["--fix", "main.motion"]);
    let output = check(&scratch, &["--diff", "."]);
    assert_eq!((code(&output), stdout(&output)), (0, String::new()), "{}", stderr(&output));
}

#[test]
fn what_remains_is_reported_and_fails() {
    let scratch = scratch("remains");
    // The second mistake shows only after the first is fixed.
    scratch.file("rest.motion", b"Wait 200 ms\nservo 9 1500\n");
    let output = check(&scratch, &["rest.motion", "--fix", "--format", "concise"]);
    assert_eq!(code(&output), 1);
    assert_eq!(stdout(&output), "rest.motion:2:7: error[out-of-range]: servo number 9 is out of range (1 to 4)\n");
    assert_eq!(stderr(&output), "fixed 2 errors in rest.motion\n");
    assert_eq!(fs::read_to_string(scratch.0.join("rest.motion")).unwrap(), "wait 200ms\nservo 9 1500\n");
    let output = check(&scratch, &["main.motion"]);
    assert!(stderr(&output).contains("2 errors can be fixed with `--fix`"), "{}", stderr(&output));
}

#[test]
fn the_error_that_a_script_declares_stays() {
    let scratch = Scratch::new("fixes-declared");
    let text = "# expect-error: unit\nwait 200 ms\n";
    scratch.file("case.motion", text.as_bytes());
    for path in [".", "case.motion"] {
        check(&scratch, &["--fix", path]);
        assert_eq!(fs::read_to_string(scratch.0.join("case.motion")).unwrap(), text);
    }
}

#[test]
fn the_fixed_standard_input_is_on_standard_output() {
    let scratch = scratch("input");
    let output = check_input(&scratch, &["-", "--fix"], "Servo 1 1500");
    assert_eq!((code(&output), stdout(&output)), (0, "servo 1 1500".into()), "{}", stderr(&output));
    // What cannot be fixed is not lost, and messages are not in the text.
    let output = check_input(&scratch, &["-", "--fix", "--format", "concise"], "wait 5\nServo 1 1500\n");
    assert_eq!((code(&output), stdout(&output)), (1, "wait 5\nservo 1 1500\n".into()));
    assert!(stderr(&output).starts_with("<stdin>:1:6: error[unit]: a time needs a unit\n"), "{}", stderr(&output));
    let output = check_input(&scratch, &["-", "--diff"], "Servo 1 1500\n");
    assert_eq!(stdout(&output), "--- <stdin>\n+++ <stdin>\n@@ -1 +1 @@\n-Servo 1 1500\n+servo 1 1500\n");
    assert_eq!(code(&check_input(&scratch, &["-", "--diff", "--format", "json"], "")), 2);
}

#[test]
fn standard_input_can_have_the_name_of_a_file() {
    let scratch = scratch("name");
    let before = texts(&scratch);
    let text = "use \"moves.motion\"\nnod()\nServo 9 1500\n";
    for input in [&["-"][..], &[]] {
        let args = [&["--stdin-filename", "lib/main.motion", "--format", "concise"], input].concat();
        let output = check_input(&scratch, &args, text);
        let shown = stdout(&output);
        assert!(shown.contains("lib/main.motion:3:1: error[unknown-word]"), "{shown}");
        assert!(shown.contains("lib/moves.motion:3:7: error[unit]"), "{shown}");
    }
    // The file of that name stays.
    let output = check_input(&scratch, &["--stdin-filename", "main.motion", "-", "--fix"], "Servo 1 1500\n");
    assert_eq!((stdout(&output), texts(&scratch)), ("servo 1 1500\n".into(), before));
    assert_eq!(code(&check(&scratch, &["--stdin-filename", "x.motion", "main.motion"])), 2);
}

#[test]
fn standard_input_corrects_no_file() {
    let scratch = scratch("input-uses");
    let before = texts(&scratch);
    let text = "use \"moves.motion\"\nnod()\nServo 1 1500\n";
    let args = ["--fix", "--stdin-filename", "lib/main.motion", "--format", "concise", "-"];
    let output = check_input(&scratch, &args, text);
    assert_eq!((code(&output), stdout(&output)), (1, text.replace("Servo", "servo")));
    assert!(stderr(&output).contains("lib/moves.motion:3:7: error[unit]"), "{}", stderr(&output));
    assert!(stderr(&output).ends_with("fixed 1 error in lib/main.motion\n"), "{}", stderr(&output));
    assert_eq!(texts(&scratch), before);
    // A file that is named is corrected, in any order.
    for (name, files) in [("first", ["-", "lib/moves.motion"]), ("last", ["lib/moves.motion", "-"])] {
        let scratch = self::scratch(&format!("input-{name}"));
        scratch.file("lib/moves.motion", b"let a = 5 s\ndef nod() {\n  wait a\n}\n");
        let args = [&["--fix", "--stdin-filename", "lib/main.motion"], &files[..]].concat();
        let output = check_input(&scratch, &args, text);
        assert_eq!((code(&output), stdout(&output)), (0, text.replace("Servo", "servo")), "{}", stderr(&output));
        assert_eq!(texts(&scratch)[1], "let a = 5s\ndef nod() {\n  wait a\n}\n");
    }
}

#[test]
fn the_order_of_the_scripts_changes_nothing() {
    let main = "use \"lib.motion\"\nServo 1 1500\nnod()\n";
    // Only the main script, which calls the phrase, shows its error.
    let library = "let a = 5 s\ndef nod() {\n  wait 200 ms\n  wait a\n}\n";
    for (name, files) in [("main", ["main.motion", "lib.motion"]), ("library", ["lib.motion", "./main.motion"])] {
        let scratch = Scratch::new(&format!("fixes-order-{name}"));
        scratch.file("main.motion", main.as_bytes());
        scratch.file("lib.motion", library.as_bytes());
        let output = check(&scratch, &[&["--fix"], &files[..]].concat());
        let texts = ["main.motion", "lib.motion"].map(|name| fs::read_to_string(scratch.0.join(name)).unwrap());
        let fixed = [main.replace("Servo", "servo"), library.replace("200 ms", "200ms").replace("5 s", "5s")];
        assert_eq!(texts, fixed, "{}", stderr(&output));
        assert!(stderr(&output).contains("fixed 2 errors in lib.motion\n"), "{}", stderr(&output));
    }
}

#[test]
fn a_script_that_is_named_twice_is_fixed_once() {
    let scratch = Scratch::new("fixes-twice");
    scratch.file("a.motion", b"Servo 1 1500\nwait 200 ms\n");
    let output = check(&scratch, &["--fix", "a.motion", "./a.motion"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stderr(&output).ends_with("fixed 2 errors in a.motion\n"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(scratch.0.join("a.motion")).unwrap(), "servo 1 1500\nwait 200ms\n");
}

#[test]
fn a_read_only_file_stays() {
    let scratch = Scratch::new("fixes-read-only");
    let (path, text) = (scratch.0.join("a.motion"), "Servo   1 1500\n");
    scratch.file("a.motion", text.as_bytes());
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    let output = check(&scratch, &["--fix", "a.motion"]);
    let said = stderr(&output);
    assert!(said.contains("cannot write a.motion: permission denied; the file is unchanged"), "{said}");
    assert_eq!((code(&output), fs::read_to_string(&path).unwrap()), (2, text.to_owned()));
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o444);
}

#[test]
fn a_wrong_configuration_hides_no_finding_of_other_scripts() {
    let scratch = Scratch::new("fixes-configuration");
    for folder in ["wrong", "right"] {
        fs::create_dir_all(scratch.0.join(folder)).unwrap();
        scratch.file(&format!("{folder}/a.motion"), b"servo 9 1500\n");
    }
    scratch.file("wrong/b.motion", b"stop\n");
    scratch.file("wrong/motionseq.toml", b"deny = 5\n");
    scratch.file("right/motionseq.toml", b"");
    for files in [["wrong", "right"], ["right", "wrong"]] {
        let output = check(&scratch, &files);
        assert_eq!(code(&output), 2);
        assert_eq!(stderr(&output).matches("wrong/motionseq.toml:1").count(), 1, "{}", stderr(&output));
        assert!(stderr(&output).contains("servo number 9 is out of range"), "{}", stderr(&output));
        let output = check(&scratch, &[&["--format", "json"], &files[..]].concat());
        assert_eq!(code(&output), 2);
        let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
        let found = json["findings"].as_array().unwrap().iter();
        let mut places: Vec<_> = found.map(|found| (found["file"].as_str(), found["code"].as_str())).collect();
        places.sort();
        let wanted = [("right/a.motion", "out-of-range"), ("wrong/motionseq.toml", "config-value")];
        assert_eq!(places, wanted.map(|(file, code)| (Some(file), Some(code))));
        assert_eq!(json["errors"], 2, "{json}");
    }
}

/// What `--fix` makes of a text on standard input, and what it says.
fn fixed(scratch: &Scratch, text: &str) -> (String, String) {
    let output = check_input(scratch, &["--fix", "--format", "concise", "-"], text);
    (stdout(&output), stderr(&output))
}

#[test]
fn what_may_be_a_division_becomes_no_comment() {
    let scratch = Scratch::new("fixes-comment");
    for text in [
        "rocker y=10 // 2 for 1s\n",
        "let n = 4\nlet m = n // 2\n",
        "servo 1 1500 // pan\n",
        "servo 1 1500 -- pan\n",
        "servo 1 1500 /* pan */\n",
        "stop; // pan; servo 1 1500\n",
        "repeat 2 { // pan }\n",
        "repeat 2 {\n  wait 1s\n} // end\n",
        // What follows the comment, and what is in it, are no commands after a correction, either.
        "/* pan */ servo 1 1500\n",
        "/* pan */; servo 1 1500\n",
        "/* pan */ servo 1 1500 /* tilt */\n",
        "/* off:\nservo 1 1500\n*/\n",
    ] {
        let (is, said) = fixed(&scratch, text);
        assert!(is == text && said.contains("error["), "{text} becomes {is}{said}");
    }
    for (text, wanted) in [
        ("// pan\n", "# pan\n"),
        ("repeat 2 {\n  -- pan\n  wait 1s\n}\n", "repeat 2 {\n  # pan\n  wait 1s\n}\n"),
        ("/* pan */\nstop\n", "# pan\nstop\n"),
        ("// pan; servo 1 1500\n", "# pan; servo 1 1500\n"),
    ] {
        assert_eq!(fixed(&scratch, text).0, wanted);
    }
}

#[test]
fn only_a_number_in_the_source_gets_a_unit() {
    let scratch = Scratch::new("fixes-unit");
    for (text, written, meant) in [
        ("def slow(d) {\ntempo d\nwait 1 beat\n}\nslow(60)\nslow(120)\n", "tempo d", "tempo (d * 1bpm)"),
        ("rate (50 + 10)\nstop\n", "rate (50 + 10)", "rate ((50 + 10) * 1hz)"),
    ] {
        assert_eq!(fixed(&scratch, text).0, text);
        let said = stderr(&check_input(&scratch, &["-"], text));
        assert!(said.contains(&format!("write `{meant}`")), "{said}");
        // The help is right.
        let output = check_input(&scratch, &["-"], &text.replace(written, meant));
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    }
    assert_eq!(fixed(&scratch, "tempo 60\nrate 50\nstop\n").0, "tempo 60bpm\nrate 50hz\nstop\n");
}

#[test]
fn a_phrase_gets_parentheses_only_around_values() {
    let folder = Scratch::new("fix-phrase");
    for (call, fixed) in [("f 1500", Some("f(1500)")), ("f 1500 over 1s", None)] {
        let before = format!("def f(a) {{ servo 1 a }}\n{call}\n");
        let path = folder.file("x.motion", before.as_bytes());
        let output = with_motionseq("motionseq", &folder.0).args(["check", "--fix", "x.motion"]).output().unwrap();
        let after = fs::read_to_string(path).unwrap();
        assert_eq!(after, fixed.map_or(before.clone(), |fixed| before.replace(call, fixed)), "{}", stderr(&output));
    }
}

#[test]
fn axes_are_named_only_for_values() {
    let scratch = Scratch::new("fixes-axes");
    assert_eq!(fixed(&scratch, "let n = 4\nrocker n 10 for 1s\n").0, "let n = 4\nrocker x=n y=10 for 1s\n");
    let text = "rocker forward 10 for 1s\n";
    let (is, said) = fixed(&scratch, text);
    assert!(is == text && said.contains("takes values with the names of their axes"), "{is}{said}");
}

#[test]
fn reports_carry_the_fixes() {
    let scratch = scratch("reports");
    let json: Value = serde_json::from_str(&stdout(&check(&scratch, &["main.motion", "--format", "json"]))).unwrap();
    let fix = &json["findings"][0]["fix"];
    let edit = serde_json::json!({
        "file": "main.motion", "line": 2, "column": 3, "end_line": 2, "end_column": 8, "text": "servo",
    });
    assert_eq!(fix["edits"], serde_json::json!([edit]));
    assert_eq!(json["findings"][1]["fix"]["edits"][0]["file"], "lib/moves.motion");
    // Characters count, not bytes.
    let output = check_input(&scratch, &["-", "--format", "json"], "say \"grüße\"; buzzer on for 200 ms\n");
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(json["findings"][0]["fix"]["edits"][0]["column"], 28);
    let sarif: Value = serde_json::from_str(&stdout(&check(&scratch, &["main.motion", "--format", "sarif"]))).unwrap();
    let change = &sarif["runs"][0]["results"][0]["fixes"][0]["artifactChanges"][0];
    assert!(change["artifactLocation"]["uri"].as_str().unwrap().ends_with("main.motion"));
    assert_eq!(change["replacements"][0]["insertedContent"]["text"], "servo");
    assert_eq!(change["replacements"][0]["deletedRegion"]["startColumn"], 3);
}

#[test]
fn a_finding_of_gitlab_is_the_same_on_another_line() {
    let scratch = scratch("gitlab");
    let prints = |text: &str| -> Vec<String> {
        scratch.file("quality.motion", text.as_bytes());
        let output = check(&scratch, &["quality.motion", "--format", "gitlab"]);
        let rows: Vec<Value> = serde_json::from_str(&stdout(&output)).unwrap();
        assert!(rows.iter().all(|row| row["location"]["path"].as_str().unwrap().ends_with("quality.motion")));
        rows.iter().map(|row| row["fingerprint"].as_str().unwrap().to_owned()).collect()
    };
    let before = prints("servo 9 1500\nservo 9 1500\n");
    assert!(before.len() == 2 && before[0] != before[1], "{before:?}");
    assert_eq!(prints("servo 1 1500\nwait 1s\nservo 9 1500\nservo 9 1500\n"), before);
    // An error of a file that two scripts use is one finding.
    scratch.file("other.motion", b"use \"lib/moves.motion\"\nnod()\n");
    let output = check(&scratch, &["main.motion", "other.motion", "--format", "concise"]);
    assert_eq!(stdout(&output).matches("lib/moves.motion:3").count(), 1, "{}", stdout(&output));
}
