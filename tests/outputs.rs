//! Output files: none overwrites what a run reads, or what it did not create.

use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use rustix::fs::OFlags;

use crate::support::host::link;
use crate::support::{motionseq, stderr};

/// A folder with scripts, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = link(&format!("outputs-{name}"));
        fs::create_dir_all(&path).unwrap();
        for (name, text) in [
            ("a.motion", "use \"lib.motion\"\nnod()\n"),
            ("b.motion", "servo 1 1600\n"),
            ("lib.motion", "def nod() { servo 1 1500 }\n"),
        ] {
            fs::write(path.join(name), text).unwrap();
        }
        let folder = Folder(path);
        assert_eq!(folder.run(&["test", "--bless", "a.motion", "b.motion"]).status.code(), Some(0));
        folder
    }

    fn run(&self, args: &[&str]) -> Output {
        motionseq(args).current_dir(&self.0).output().unwrap()
    }

    /// The content of every file.
    fn texts(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let entries = fs::read_dir(&self.0).unwrap().map(|entry| entry.unwrap().path());
        let mut texts: Vec<_> = entries.map(|path| (path.clone(), fs::read(&path).unwrap())).collect();
        texts.sort();
        texts
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn no_result_overwrites_an_input_of_the_run() {
    let folder = Folder::new("reads");
    symlink("lib.motion", folder.0.join("alias")).unwrap();
    fs::hard_link(folder.0.join("a.motion"), folder.0.join("twin.txt")).unwrap();
    let before = folder.texts();
    for args in [
        &["play", "a.motion", "--record", "a.motion"][..],
        &["play", "a.motion", "--log", "lib.motion"],
        &["play", "a.motion", "--report", "alias"],
        &["play", "a.motion", "--record", "twin.txt"],
        &["play", "a.motion", "--report", "a.motion.frames"],
        &["render", "a.motion", "-o", "a.motion"],
        &["render", "a.motion", "-o", "lib.motion", "--force"],
        &["render", "-o", "a.motion", "b.motion"],
        &["render", "a.motion", "-o", "../outputs-reads/alias"],
        &["plot", "a.motion", "-o", "alias", "--format", "svg"],
        &["decode", "a.motion.frames", "-o", "a.motion.frames"],
        &["test", "--junit", "a.motion", "b.motion"],
        &["test", "--junit", "a.motion.frames", "a.motion", "--force"],
    ] {
        let output = folder.run(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
        assert!(folder.texts() == before, "{args:?} has changed something: {}", stderr(&output));
    }
}

#[test]
fn only_force_overwrites_scripts_and_snapshots_of_others() {
    let folder = Folder::new("force");
    fs::write(folder.0.join("other.frames"), "mine\n").unwrap();
    for args in [
        &["render", "a.motion", "-o", "b.motion"][..],
        &["render", "a.motion", "-o", "other.frames"],
        &["plot", "a.motion", "-o", "b.motion", "--format", "json"],
        &["decode", "a.motion.frames", "-o", "b.motion"],
    ] {
        let before = folder.texts();
        let output = folder.run(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("--force"), "{}", stderr(&output));
        assert!(folder.texts() == before, "{args:?}");
        let output = folder.run(&[args, &["--force"]].concat());
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
        assert!(folder.texts() != before, "{args:?}");
        fs::write(folder.0.join("b.motion"), "servo 1 1600\n").unwrap();
    }
    // Files that motionseq wrote before, and empty files, need no `--force`.
    for name in ["new.motion", "new.motion"] {
        assert_eq!(folder.run(&["decode", "a.motion.frames", "-o", name]).status.code(), Some(0));
    }
    File::create(folder.0.join("empty.frames")).unwrap();
    assert_eq!(folder.run(&["render", "a.motion", "-o", "empty.frames"]).status.code(), Some(0));
}

#[test]
fn a_refused_recording_removes_only_its_own_files() {
    let folder = Folder::new("refused");
    File::create(folder.0.join("empty")).unwrap();
    symlink("empty", folder.0.join("to-empty")).unwrap();
    assert!(Command::new("mkfifo").arg(folder.0.join("pipe")).status().unwrap().success());
    // A pipe without a reader is also refused.
    let mut reader = File::options().read(true).write(true).open(folder.0.join("pipe")).unwrap();
    for place in ["empty", "to-empty", "pipe", "/dev/null", "new"] {
        let link = folder.0.join("board");
        let args = ["record", "--link", link.to_str().unwrap(), "-o", place, "--port", "/dev/no-such-port"];
        let output = folder.run(&args);
        assert_eq!(output.status.code(), Some(3), "{place}: {}", stderr(&output));
        let is_there = fs::symlink_metadata(folder.0.join(place)).is_ok();
        assert_eq!(is_there, place != "new", "{place}");
    }
    rustix::fs::fcntl_setfl(&reader, OFlags::NONBLOCK | OFlags::RDWR).unwrap();
    assert!(reader.read(&mut [0; 8]).is_err(), "nothing was written");
}

#[test]
fn an_older_log_stays_and_a_run_that_is_killed_leaves_no_empty_report() {
    let folder = Folder::new("logs");
    let log = ["play", "b.motion", "--log", "run.mcap"];
    assert_eq!(folder.run(&log).status.code(), Some(0));
    let before = folder.texts();
    let output = folder.run(&log);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("it exists"), "{}", stderr(&output));
    assert!(folder.texts() == before);
    // A short script would be done before it is killed.
    fs::write(folder.0.join("long.motion"), "say \"on\"\nwait 1h\nservo 1 1500\n").unwrap();
    let mut player = motionseq(&["play", "long.motion", "--report", "run.json", "--max-late", "5s"]);
    let mut child = player.current_dir(&folder.0).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let mut said = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("s: on") {
        assert!(std::io::BufRead::read_line(&mut said, &mut line).unwrap() > 0, "{line}");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let left: Vec<PathBuf> = folder.texts().into_iter().map(|(path, _)| path).collect();
    assert!(!left.iter().any(|path| path.to_str().unwrap().contains("run.json")), "{left:?}");
}

#[test]
fn owner_group_and_mode_stay() {
    let folder = Folder::new("owner");
    let is_root = rustix::process::geteuid().is_root();
    let own = |name: &str| {
        let path = folder.0.join(name);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        if is_root {
            std::os::unix::fs::chown(&path, Some(1_234), Some(1_235)).unwrap();
        }
    };
    let has = |name: &str| {
        let meta = Path::new(&folder.0).join(name).metadata().unwrap();
        (meta.mode() & 0o777, !is_root || (meta.uid(), meta.gid()) == (1_234, 1_235))
    };
    fs::write(folder.0.join("b.motion"), "servo   1    1700\n").unwrap();
    for name in ["b.motion", "b.motion.frames"] {
        own(name);
    }
    assert_eq!(folder.run(&["fmt", "b.motion"]).status.code(), Some(0));
    assert_eq!(folder.run(&["test", "--bless", "b.motion"]).status.code(), Some(0));
    assert_eq!(fs::read_to_string(folder.0.join("b.motion")).unwrap(), "servo 1 1700\n");
    assert_eq!((has("b.motion"), has("b.motion.frames")), ((0o640, true), (0o640, true)));
}
