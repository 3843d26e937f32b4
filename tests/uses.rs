//! `use` and `--set`: input from outside of a script.

use std::fs;
use std::path::{Path, PathBuf};

use motionseq::program::Options;
use motionseq::source::{Files, Memory, Source, SourceError, Sources, UseError};

use crate::support::{run, stderr, stdout};

/// A temporary folder for one test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, &str)]) -> Self {
        let folder = std::env::temp_dir().join(format!("motionseq-uses-{name}-{}", std::process::id()));
        for (file, text) in files {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        Folder(folder)
    }

    /// The listing of a script, or its messages without the name of this folder.
    fn render(&self, file: &str) -> String {
        let output = run(&["render", self.0.join(file).to_str().unwrap()]);
        let text = format!("{}{}", stdout(&output), stderr(&output));
        text.replace(&format!("{}/", self.0.display()), "")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const PHRASES: &str = "let far = 1000us\ndef look(to = far) { servo 1 to }\n";

#[test]
fn names_of_a_used_file_are_available() {
    let folder = Folder::new(
        "plain",
        &[
            ("main.motion", "use \"lib/phrases.motion\"\nlook()\nwait 1s\nlook(to = far + 500us)\n"),
            ("lib/phrases.motion", PHRASES),
        ],
    );
    assert_eq!(
        folder.render("main.motion"),
        "0.000000\tFF FE 02 03 01 03 E8 F1\tservo 1 1000\n1.000000\tFF FE 02 03 01 05 DC E7\tservo 1 1500\n"
    );
}

#[test]
fn a_file_name_is_relative_to_its_user_and_counts_once() {
    // A diamond: both a and b use phrases, which is next to them.
    let folder = Folder::new(
        "diamond",
        &[
            ("main.motion", "use \"lib/a.motion\"\nuse \"lib/b.motion\"\na()\nb()\n"),
            ("lib/a.motion", "use \"phrases.motion\"\ndef a() { look() }\n"),
            ("lib/b.motion", "use \"../lib/./phrases.motion\"\ndef b() { wait 1s\nlook(to = 2000) }\n"),
            ("lib/phrases.motion", PHRASES),
        ],
    );
    assert_eq!(folder.render("main.motion").lines().count(), 2, "{}", folder.render("main.motion"));
}

#[test]
fn files_that_use_each_other_are_shown() {
    let folder = Folder::new(
        "cycle",
        &[
            ("main.motion", "use \"a.motion\"\nstop\n"),
            ("a.motion", "use \"b.motion\"\n"),
            ("b.motion", "use \"a.motion\"\n"),
            ("self.motion", "use \"self.motion\"\nstop\n"),
        ],
    );
    let text = folder.render("main.motion");
    assert!(
        text.contains("a.motion uses itself") && text.contains("b.motion:1:5") && text.contains("a.motion:1:5"),
        "{text}"
    );
    assert!(folder.render("self.motion").contains("self.motion uses itself"), "{}", folder.render("self.motion"));
}

#[test]
fn nothing_outside_of_the_folder_is_read() {
    let folder = Folder::new(
        "outside",
        &[
            ("secret.motion", PHRASES),
            (
                "in/main.motion",
                "use \"../secret.motion\"\nuse \"link.motion\"\nuse \"/etc/hostname\"\nuse \"../in/ok.motion\"\nlook()\n",
            ),
            ("in/ok.motion", PHRASES),
        ],
    );
    std::os::unix::fs::symlink("../secret.motion", folder.0.join("in/link.motion")).unwrap();
    let text = folder.render("in/main.motion");
    for name in ["../secret.motion", "link.motion", "/etc/hostname"] {
        assert!(text.contains(&format!("{name} is outside of the main script's folder")), "{name}: {text}");
    }
    assert_eq!(text.matches("\n  × ").count(), 3, "{text}");
}

#[test]
fn unusable_files_are_refused_with_a_reason() {
    let folder = Folder::new(
        "wrong",
        &[
            (
                "main.motion",
                "use \"missing.motion\"\nuse \"folder\"\nuse moves\n{\n  use \"lib.motion\"\n}\nuse \"does.motion\"\nuse \"broken.motion\"\nuse \"near\"\nstop\n",
            ),
            ("folder/x", ""),
            ("lib/near.motion", PHRASES),
            ("lib.motion", PHRASES),
            ("does.motion", "let a = 1\nservo 1 1500\ntempo 90bpm\n"),
            ("broken.motion", "def nod() { servo 1 @ }\n"),
        ],
    );
    let text = folder.render("main.motion");
    for words in [
        "missing.motion cannot be used: no such file",
        "it is a folder",
        "the name of a file needs quotation marks",
        "`use` is not allowed inside a block",
        "a used file may contain only `use`, `let` and `def`",
        "does.motion:2:1",
        "does.motion:3:1",
        "broken.motion:1:21",
        "did you mean `use \"lib/near.motion\"`?",
    ] {
        assert!(text.contains(words), "{words} is not in:\n{text}");
    }
}

#[test]
fn a_setting_in_a_used_file_is_the_only_mistake() {
    let folder = Folder::new(
        "used-setting",
        &[
            ("main.motion", "use \"u.motion\"\nservo 1 a\nf()\n"),
            ("u.motion", "tempo 100bpm\nlet a = 1500\ndef f() { stop }\n"),
        ],
    );
    let text = folder.render("main.motion");
    assert!(
        text.contains("before the first command of the main script") && text.contains("first in a `def`"),
        "{text}"
    );
    assert!(!text.contains("unknown name"), "{text}");
}

#[test]
fn blocks_of_a_used_file_may_have_a_tempo() {
    let body = "  tempo 60bpm\n  wait 1 beat\n  servo 1 1000\n  repeat 2 {\n    meter 3/4\n    wait 1 bar\n  }\n  servo 1 1100\n";
    let files = [
        ("main.motion", "use \"u.motion\"\nlate()\nwait 1 beat\nservo 1 1200\n"),
        ("u.motion", &*format!("def late() {{\n{body}}}\n")),
        ("wrong.motion", "use \"u_wrong.motion\"\nlate()\n"),
        ("u_wrong.motion", "def late() {\n  wait 1s\n  tempo 60bpm\n  { rate 20hz }\n}\n"),
    ];
    let folder = Folder::new("tempo", &files);
    let text = folder.render("main.motion");
    let lines: Vec<_> = text.lines().map(|line| line.split('\t').next().unwrap_or_default()).collect();
    assert_eq!(lines, ["1.000000", "7.000000", "7.500000"], "{text}");
    let text = folder.render("wrong.motion");
    assert!(
        text.contains("`tempo` comes after a command") && text.contains("the setting `rate` is inside a block"),
        "{text}"
    );
}

#[test]
fn one_name_in_two_files_shows_both() {
    let folder = Folder::new(
        "names",
        &[
            ("main.motion", "use \"a.motion\"\nuse \"b.motion\"\nnod()\n"),
            ("a.motion", "def nod() { servo 1 1000 }\n"),
            ("b.motion", "def nod() { servo 1 2000 }\n"),
        ],
    );
    let text = folder.render("main.motion");
    assert!(
        text.contains("the name `nod` is defined twice")
            && text.contains("b.motion:1:5")
            && text.contains("a.motion:1:5"),
        "{text}"
    );
}

#[test]
fn a_mistake_in_a_used_file_shows_the_call() {
    let folder =
        Folder::new("calls", &[("main.motion", "use \"lib.motion\"\nlook(to = 9999)\n"), ("lib.motion", PHRASES)]);
    let text = folder.render("main.motion");
    assert!(
        text.contains("pulse width 9999 is out of range")
            && text.contains("lib.motion:2:30")
            && text.contains("called here")
            && text.contains("main.motion:2:1"),
        "{text}"
    );
}

#[test]
fn files_use_each_other_at_most_16_deep() {
    let files: Vec<(String, String)> = (0..20)
        .map(|n| {
            (format!("f{n}.motion"), if n == 19 { PHRASES.to_owned() } else { format!("use \"f{}.motion\"\n", n + 1) })
        })
        .collect();
    let mut all: Vec<(&str, &str)> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    all.push(("main.motion", "use \"f0.motion\"\nlook()\n"));
    all.push(("less.motion", "use \"f4.motion\"\nlook()\n"));
    let folder = Folder::new("deep", &all);
    assert!(folder.render("main.motion").contains("more than 16 deep"));
    assert_eq!(folder.render("less.motion").lines().count(), 1, "{}", folder.render("less.motion"));
}

#[test]
fn each_file_knows_its_own_defs_below() {
    let folder = Folder::new(
        "below",
        &[
            ("main.motion", "use \"lib.motion\"\nlast()\ndef last() { stop }\n"),
            ("lib.motion", "def first() { second() }\ndef second() { last() }\n"),
        ],
    );
    let said = folder.render("main.motion");
    for words in ["`second` is defined below this `def`", "there is no phrase `last`", "`last` is defined further down"]
    {
        assert_eq!(said.matches(words).count(), 1, "{words}: {said}");
    }
}

#[test]
fn set_replaces_a_top_level_let_from_outside() {
    let folder = Folder::new(
        "set",
        &[
            (
                "main.motion",
                "let to = 1000\nlet twice = to + to\nservo 1 twice\n{\n  let to = 700\n  wait 1s\n  servo 1 to\n}\n",
            ),
            ("names.motion", "let a = 1\nstop\n"),
        ],
    );
    let main = folder.0.join("main.motion");
    let with = |set: &str| run(&["render", "--set", set, main.to_str().unwrap()]);
    let changed = stdout(&with("to=600us * 2 / 1us"));
    assert!(changed.contains("servo 1 2400") && changed.contains("servo 1 700"), "{changed}");
    for (set, words) in [
        ("nothing=5", "the script has no top-level `let nothing`"),
        ("to=5s", "pulse width 10000000 is out of range"),
        ("to=@", "cannot be read"),
        ("to=1\nservo 2 1000", "this cannot be read as a value"),
        ("to=1; stop", "this cannot be read as a value"),
        ("to=1;", "error"),
        ("to=1 # one", "this cannot be read as a value"),
        ("to=1 2", "cannot be read"),
        ("to=", "cannot be read as a value"),
        ("to=1 let y = 2", "`let` cannot be read here"),
        ("to=[1, 2]", "there are no lists"),
        ("to=(1", "this `(` is still open at the end of the file"),
        ("to=1, 2", "`,` cannot be read here"),
        ("to={ stop }", "this cannot be read as a value"),
        ("to=servo 1 1500", "cannot be read"),
        ("2x=5", "this is not the name of a value"),
        ("let to=5", "this is not the name of a value"),
        ("to # old=5", "this is not the name of a value"),
        ("to(=5", "this `(` is still open at the end of the file"),
        ("=5", "this is not the name of a value"),
        ("tö=5", "this is not the name of a value"),
        ("wait=5s", "the script has no top-level `let wait`"),
        ("To=5", "did you mean `to`?"),
    ] {
        let output = with(set);
        assert_eq!(output.status.code(), Some(1), "{set}");
        assert!(stderr(&output).contains(words), "{set}: {}", stderr(&output));
    }
    assert_eq!(with("to").status.code(), Some(2));
    // The replaced value uses other names.
    let used = folder.0.join("used.motion");
    fs::write(&used, "let a = 1000\nlet b = a\nservo 1 b\n").unwrap();
    let output = run(&["check", "--deny", "warnings", "--set", "b=1500", used.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

/// An editor, which has only texts.
struct Editor(Memory);

impl Files for Editor {
    fn resolve(&self, main: &Path, from: &Path, name: &str) -> Result<PathBuf, UseError> {
        self.0.resolve(main, from, name)
    }

    fn read(&self, path: &Path) -> Result<Source, SourceError> {
        Ok(Source::new(path.display().to_string(), self.0.read(path)?.text()))
    }
}

#[test]
fn texts_of_an_editor_are_used() {
    let compiled = |texts: &[(&str, &str)]| {
        let editor = Editor(texts.iter().copied().collect());
        let sources = Sources::read(Path::new("show/a.motion"), editor).unwrap();
        motionseq::compile(&sources, &Options::default())
    };
    let fine = compiled(&[
        ("show/a.motion", "use \"lib/b.motion\"\nb()\n"),
        ("show/lib/b.motion", "use \"../c.motion\"\ndef b() { c() }\n"),
        ("show/c.motion", "def c() { stop }\n"),
    ]);
    assert_eq!(fine.timelines.first().map(|timeline| timeline.events.len()), Some(1), "{:?}", fine.diagnostics);
    let circle =
        compiled(&[("show/a.motion", "use \"lib/b.motion\"\nstop\n"), ("show/lib/b.motion", "use \"../a.motion\"\n")]);
    let messages: Vec<&str> = circle.diagnostics.iter().map(|found| found.message.as_str()).collect();
    assert_eq!(messages, ["../a.motion uses itself"]);
}
