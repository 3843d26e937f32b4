//! `board` and `record` as other programs see them: a port at a path.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread::{self, JoinHandle};

use rustix::process::{Pid, Signal, kill_process};
use serialport::SerialPort;

use super::board::{OnBoard, say};
use super::motionseq;

/// A running board.
pub(crate) struct Host {
    pub(crate) child: Child,
    errors: BufReader<ChildStderr>,
    /// Reads what it prints, so that it does not block.
    printed: Option<JoinHandle<String>>,
    pub(crate) path: PathBuf,
}

impl Host {
    /// Starts a board, and waits for its link.
    pub(crate) fn start(name: &str, more: &[&str]) -> Self {
        Host::start_at("board", link(name), more)
    }

    /// The same with another command, which also needs a link.
    pub(crate) fn start_at(what: &str, path: PathBuf, more: &[&str]) -> Self {
        let mut command = motionseq(&[what, "--link", path.to_str().unwrap()]);
        let mut child = command.args(more).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let errors = BufReader::new(child.stderr.take().unwrap());
        let mut output = child.stdout.take().unwrap();
        let printed = Some(thread::spawn(move || {
            let mut text = String::new();
            output.read_to_string(&mut text).unwrap();
            text
        }));
        let mut host = Host { child, errors, printed, path };
        assert!(host.line().contains("leads to"));
        host
    }

    /// The next line that it prints.
    pub(crate) fn line(&mut self) -> String {
        let mut line = String::new();
        self.errors.read_line(&mut line).unwrap();
        line
    }

    /// Waits until it prints this.
    pub(crate) fn says(&mut self, words: &str) {
        loop {
            let line = self.line();
            assert!(!line.is_empty(), "it never said {words}");
            if line.contains(words) {
                return;
            }
        }
    }

    pub(crate) fn open(&self) -> Box<dyn SerialPort> {
        serialport::new(self.path.to_str().unwrap(), 115_200).timeout(std::time::Duration::from_secs(5)).open().unwrap()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Ends it as Ctrl-C does. Returns its output and its messages.
    pub(crate) fn end(self) -> (String, String) {
        self.end_with(0)
    }

    /// The same with another exit code.
    pub(crate) fn end_with(mut self, code: i32) -> (String, String) {
        self.signal(Signal::INT);
        let mut said = String::new();
        self.errors.read_to_string(&mut said).unwrap();
        assert_eq!(self.child.wait().unwrap().code(), Some(code), "{said}");
        assert!(fs::symlink_metadata(&self.path).is_err(), "the link is gone");
        (self.printed.take().unwrap().join().unwrap(), said)
    }
}

/// A failing test leaves no board running.
impl Drop for Host {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A unique path.
pub(crate) fn link(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("motionseq-host-{}-{name}", std::process::id()));
    let _ = fs::remove_file(&path);
    path
}

/// The second column of a listing: the frames in hex.
pub(crate) fn frames(listing: &str) -> Vec<&str> {
    listing.lines().filter(|line| !line.contains("skipped")).map(|line| line.split('\t').nth(1).unwrap()).collect()
}

pub(crate) fn stop() -> Vec<u8> {
    say("stop", &[]).to_frame()
}

pub(crate) fn rocker(x: i32) -> Vec<u8> {
    say("rocker", &[x, 0, 0]).to_frame()
}

/// A request for the quantity with this number in the protocol.
pub(crate) fn request(number: i32) -> Vec<u8> {
    say("request", &[number]).to_frame()
}

/// Whether Python has this module; in CI it must.
pub(crate) fn has(module: &str) -> bool {
    let found = Command::new("python3")
        .args(["-c", &format!("import {module}")])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    let found = found.is_ok_and(|status| status.success());
    assert!(found || std::env::var_os("CI").is_none(), "CI lacks Python's {module}");
    if !found {
        eprintln!("skipped: Python has no {module}");
    }
    found
}
