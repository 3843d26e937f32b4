//! Faults injected between the program and the system, one at a time: the program always ends, and
//! the robot is stopped.
//!
//! strace makes the Nth call of a thread fail, in the player and in the guard; a preloaded library
//! sends many signals, another one sets the clock; the shell removes output and descriptors. The
//! tests check what a board and a user notice.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::board::{OnBoard, board, state, stop};
use crate::support::far::commands;
use crate::support::{motionseq, rendered, stderr};
use motionseq::link::Pty;
use rustix::fs::OFlags;
use rustix::process::{Pid, Signal, kill_process};

/// The maximum duration of a run. The program promises much less, but not under strace on a shared
/// machine.
const LIMIT: Duration = Duration::from_secs(20);
/// The number of parallel runs: they mostly sleep.
const WORKERS: usize = 4;
/// More than the calls of one kind that a thread makes in such a short run.
const BOUND: usize = 100;
/// 220 ms with a refreshed drive, a servo and the buzzer; ends at rest.
const SCRIPT: &str = "\
    rocker x=10; servo 1 1500; buzzer on\nwait 60ms\nrocker x=11\nwait 20ms\nrocker x=12\nwait 70ms\nservo 1 1600\n\
    wait 50ms\nstop; buzzer off\nwait 20ms\n";
/// 19 kB to record, and 50 kB of output with `-v`; no frame may be dropped.
const LOUD: &str = "\
    baud 4000000\nbuzzer on\nrepeat 600 {\nservo 1 1500; servo 2 1000; servo 3 1500; servo 4 2000\nwait 500us\n}\nbuzzer off\n";

/// A temporary folder, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let name = format!("motionseq-inject-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn script(&self, text: &str) -> String {
        let path = self.path("x.motion");
        fs::write(&path, text).unwrap();
        path
    }

    fn pipe(&self) -> String {
        let path = self.path("pipe");
        assert!(works(Command::new("mkfifo").arg(&path)));
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Whether a test must be skipped because a tool is missing. In CI, it fails instead.
fn is_missing(tool: &str, is_there: bool) -> bool {
    assert!(is_there || std::env::var_os("CI").is_none(), "{tool} is not installed, or may not be used here");
    if !is_there {
        eprintln!("skipped: {tool} is not installed, or may not be used here");
    }
    !is_there
}

fn works(command: &mut Command) -> bool {
    let silent = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    silent.status().is_ok_and(|status| status.success())
}

/// Opens a file, a pipe or a port without blocking.
fn open(path: &str, write: bool) -> File {
    let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits().cast_signed();
    File::options().read(true).write(write).custom_flags(flags).open(path).unwrap()
}

/// A port whose far end records what it receives, and answers, so that there is something to read.
struct Port {
    path: String,
    reads: Receiver<Vec<u8>>,
    /// Keeps the far end open before a player starts, and reserves the name of the port.
    held: File,
}

impl Port {
    fn new() -> Self {
        let pty = Pty::open().unwrap();
        let path = pty.path().to_str().unwrap().to_owned();
        let held = open(&path, true);
        let (sender, reads) = mpsc::channel();
        thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(count @ 1..) = pty.read(&mut buffer) {
                let _ = rustix::io::write(&pty, b"{A-120:35:9000:1187}#");
                if sender.send(buffer[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        Port { path, reads, held }
    }

    /// Everything received until player and guard have both closed the port.
    fn received(self) -> Result<Vec<u8>, String> {
        drop(self.held);
        let mut all = Vec::new();
        loop {
            match self.reads.recv_timeout(LIMIT) {
                Ok(read) => all.extend(read),
                Err(RecvTimeoutError::Disconnected) => return Ok(all),
                Err(RecvTimeoutError::Timeout) => return Err("a process still holds the port".into()),
            }
        }
    }
}

fn finish(command: &mut Command) -> Result<Output, String> {
    end_of(command.stdin(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap())
}

/// Waits for the end of a child, and of all processes that have its standard error open. If it
/// hangs, kills it and what it traces.
fn end_of(child: Child) -> Result<Output, String> {
    let id = Pid::from_child(&child);
    let (sender, output) = mpsc::channel();
    thread::spawn(move || sender.send(child.wait_with_output()));
    output.recv_timeout(LIMIT).map(Result::unwrap).map_err(|_| {
        for process in tracees(id).into_iter().chain([id]) {
            let _ = kill_process(process, Signal::KILL);
        }
        "it hangs".into()
    })
}

fn tracees(tracer: Pid) -> Vec<Pid> {
    let line = format!("TracerPid:\t{}\n", tracer.as_raw_nonzero());
    let processes = fs::read_dir("/proc").unwrap().filter_map(|entry| entry.unwrap().file_name().into_string().ok());
    processes
        .filter(|name| fs::read_to_string(format!("/proc/{name}/status")).is_ok_and(|text| text.contains(&line)))
        .filter_map(|name| Pid::from_raw(name.parse().ok()?))
        .collect()
}

/// The exit code as a shell reports it.
fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or_else(|| 128 + output.status.signal().unwrap())
}

/// Whether docs/cli.md documents this exit code; 137 is that of a player that its guard has killed.
fn is_documented(code: i32) -> bool {
    let page = fs::read_to_string("docs/cli.md").unwrap();
    code == 137 || page.lines().any(|row| row.starts_with(&format!("| {code} |")))
}

/// The text after `… s into the run; stop: ` of each such line.
fn closing_lines(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.split_once(" s into the run; stop: ")).map(|(_, stop)| stop).collect()
}

/// The number of warnings that the recording is not complete.
fn warnings(text: &str) -> usize {
    text.matches("the recording is incomplete").count()
}

/// Whether `some` is a subsequence of `all`.
fn is_part(some: &[motionseq::board::Command], all: &[motionseq::board::Command]) -> bool {
    let mut rest = all.iter();
    some.iter().all(|command| rest.any(|other| other == command))
}

/// Whether a run was complete: its bytes are the rendered ones. A refresh that was superseded by
/// the next frame is left out, and reported if possible.
fn is_whole(received: &[u8], rendered: &[u8], text: Option<&str>) -> bool {
    let (came, planned) = (commands(received), commands(rendered));
    let missing = planned.len().saturating_sub(came.len());
    let is_said = text.is_none_or(|text| text.contains(&format!(", {missing} dropped in ")));
    received == rendered || is_said && is_part(&came, &planned)
}

/// The target of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum To {
    Port,
    Recording,
}

/// One fault at a time: in the first call of every thread, in the second, and so on until no thread
/// makes as many calls.
#[derive(Clone, Copy, Debug)]
struct Plan<'p> {
    /// The call; with a `?` if not every system has it.
    call: &'p str,
    error: &'p str,
    /// The suffix after N in strace's `when=`: empty (once), `+` (from then on), or `+3` (every
    /// third).
    then: &'p str,
    /// Only calls on this.
    to: Option<To>,
}

/// The result of a run.
struct Run {
    output: Output,
    received: Vec<u8>,
    recording: Vec<u8>,
    /// The calls that failed.
    injected: Vec<String>,
    trace: String,
}

impl Plan<'_> {
    fn run(&self, n: usize, script: &str) -> Result<Run, String> {
        let (port, folder) = (Port::new(), Folder::new());
        let (trace, recording) = (folder.path("trace"), folder.path("recording"));
        // Slow is not late here. A permanent failure may also end as late, and then ends sooner.
        let max_late = if self.then.is_empty() { "2s" } else { "500ms" };
        let player = motionseq(&["play", script, "--max-late", max_late, "--port", &port.path, "--record", &recording]);
        let mut strace = Command::new("strace");
        strace.args(["-f", "-qq", "-s", "8", "-o", &trace, "-e", &format!("trace={}", self.call)]);
        strace.args(["-e", &format!("inject={}:error={}:when={n}{}", self.call, self.error, self.then)]);
        if let Some(to) = self.to {
            strace.args(["-P", if to == To::Port { &port.path } else { &recording }]);
        }
        strace.arg(player.get_program()).args(player.get_args()).current_dir(env!("CARGO_MANIFEST_DIR"));
        // Cargo sets it, and the loader would search every folder of it for every library.
        let outcome = finish(strace.env_remove("LD_LIBRARY_PATH"));
        let trace = fs::read_to_string(trace).unwrap_or_default();
        let hangs = |error| format!("{self:?} {n}: {error}\n{}", tail(&trace));
        let (output, received) = (outcome.map_err(hangs)?, port.received().map_err(hangs)?);
        let recording = fs::read(recording).unwrap_or_default();
        Ok(Run { output, received, recording, injected: injected(&trace), trace })
    }

    /// Runs it for every N. Returns the number of runs, and the failures.
    fn sweep(&self, script: &str) -> (usize, Vec<String>) {
        let (rendered, mut wrong) = (rendered(script), Vec::new());
        for n in 1..=BOUND {
            let run = match self.run(n, script) {
                Ok(run) => run,
                Err(hangs) => return (n, [wrong, vec![hangs]].concat()),
            };
            if let Err(error) = self.check(&run, &rendered) {
                wrong.push(format!("{self:?} {n}: {error}\n{}", run.evidence()));
            }
            if run.injected.is_empty() {
                if n == 1 && !self.call.starts_with('?') {
                    wrong.push(format!("{self:?}: no thread makes this call, so nothing was tested"));
                }
                return (n, wrong);
            }
        }
        wrong.push(format!("{self:?}: the number of calls has no bound"));
        (BOUND, wrong)
    }

    /// Checks a run against the promises of the program. Returns the broken one.
    fn check(&self, run: &Run, rendered: &[u8]) -> Result<(), &'static str> {
        let (code, text, is_once) = (code(&run.output), stderr(&run.output), self.then.is_empty());
        let closing = closing_lines(&text);
        match closing[..] {
            [] if code == 0 || code == 2 && !run.received.is_empty() => run.check_whole(rendered, code == 0, &text),
            _ if code == 0 => Err("a closing line after a complete run"),
            // A program that a signal kills prints nothing; here that is the loader, or the runtime
            // before `main`.
            [] if run.received.is_empty()
                && text.is_empty()
                && !run.is_mute()
                && run.output.status.signal().is_none() =>
            {
                Err("refused without a message")
            }
            [] if run.received.is_empty() => Ok(()),
            _ if self.error == "EINTR" && is_once => Err("an interrupted call ends the run"),
            _ if !is_documented(code) => Err("this exit code is not documented"),
            ["NOT SENT - cut the power"] if is_once => Err("a single fault costs the stop"),
            ["NOT SENT - cut the power"] => Ok(()),
            ["sent"] => run.check_stopped(rendered),
            [] if run.is_mute() => run.check_stopped(rendered),
            _ => Err("not one closing line"),
        }
    }
}

impl Run {
    /// Whether messages could not be written.
    fn is_mute(&self) -> bool {
        self.injected.iter().any(|call| call.starts_with("write(2,"))
    }

    /// A complete run, with exit 0 if its recording is also complete.
    fn check_whole(&self, rendered: &[u8], is_fine: bool, text: &str) -> Result<(), &'static str> {
        let is_complete = self.recording == self.received;
        match warnings(text) {
            _ if !is_whole(&self.received, rendered, (!self.is_mute()).then_some(text)) => {
                Err("an incomplete run with exit 0")
            }
            _ if !self.received.starts_with(&self.recording) => Err("the recording holds what was not sent"),
            0 if !is_complete && !self.is_mute() => Err("no message that the recording is not complete"),
            0 if !is_fine && !self.is_mute() => Err("exit 2 without a message"),
            1 if is_fine => Err("exit 0 with a recording that is not complete"),
            0 => Ok(()),
            // It may have become complete after the fault.
            1 if !self.injected.is_empty() => Ok(()),
            _ => Err("an extra warning about the recording"),
        }
    }

    /// The robot is stopped, and does nothing else after the first stop.
    fn check_stopped(&self, rendered: &[u8]) -> Result<(), &'static str> {
        let came = commands(&self.received);
        let at = came.iter().position(|command| *command == stop()).unwrap_or(came.len());
        match state(&came).at_rest(board()) {
            _ if !is_part(&came[..at], &commands(rendered)) => Err("what came before the stop is not of the script"),
            _ if came[at..].iter().any(OnBoard::keeps_driving) => Err("it drives after the stop"),
            true => Ok(()),
            false => Err("it does not end at rest"),
        }
    }

    /// Everything known about the run.
    fn evidence(&self) -> String {
        let frames: Vec<String> = commands(&self.received).iter().map(OnBoard::said).collect();
        let injected = &self.injected[..self.injected.len().min(3)];
        let (code, text, trace) = (code(&self.output), stderr(&self.output), tail(&self.trace));
        format!("exit {code}, injected {injected:#?}\nreceived {}\nsaid {text}{trace}\n", frames.join(", "))
    }
}

fn tail(trace: &str) -> String {
    let lines: Vec<&str> = trace.lines().collect();
    lines[lines.len().saturating_sub(15)..].join("\n")
}

/// The calls that strace made fail. A call during which another thread ran takes two lines.
fn injected(trace: &str) -> Vec<String> {
    let (mut begun, mut found) = (HashMap::new(), Vec::new());
    for (thread, line) in trace.lines().filter_map(|line| line.split_once(' ')) {
        let line = line.trim_start();
        let call = if line.starts_with("<... ") { begun.remove(thread).unwrap_or(line) } else { line };
        if line.ends_with("<unfinished ...>") {
            begun.insert(thread, line);
        }
        if line.ends_with("(INJECTED)") {
            found.push(call.to_owned());
        }
    }
    found
}

/// Calls, errors, suffixes of N, and targets: every combination is tested.
type Rows<'r> = &'r [(&'r [&'r str], &'r [&'r str], &'r [&'r str], Option<To>)];

/// Tests all combinations, several runs at once.
fn sweep(rows: Rows<'_>) {
    if is_missing("strace", works(Command::new("strace").args(["-o", "/dev/null", "true"]))) {
        return;
    }
    let mut plans = Vec::new();
    for (calls, errors, ways, to) in rows {
        for (call, error) in calls.iter().flat_map(|call| errors.iter().map(move |error| (call, error))) {
            plans.extend(ways.iter().map(|then| Plan { call, error, then, to: *to }));
        }
    }
    let folder = Folder::new();
    let script = folder.script(SCRIPT);
    let (next, runs, wrong) = (AtomicUsize::new(0), AtomicUsize::new(0), Mutex::new(Vec::new()));
    thread::scope(|scope| {
        for _ in 0..WORKERS {
            scope.spawn(|| {
                while let Some(plan) = plans.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let (count, found) = plan.sweep(&script);
                    runs.fetch_add(count, Ordering::Relaxed);
                    wrong.lock().unwrap().extend(found);
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    eprintln!("{} runs of {} plans", runs.into_inner(), plans.len());
    assert!(wrong.is_empty(), "{} runs broke a promise:\n\n{}", wrong.len(), wrong.join("\n"));
}

const EACH: &[&str] = &["EIO", "EINTR", "EAGAIN", "ENOSPC"];

#[test]
fn any_call_for_files_may_fail_once() {
    sweep(&[(&["read", "openat", "?open", "close", "ioctl", "flock"], EACH, &[""], None)]);
}

#[test]
fn any_call_that_waits_or_sends_may_fail_once() {
    sweep(&[(&["write", "ppoll", "?poll", "clock_nanosleep", "sendto", "recvfrom"], EACH, &[""], None)]);
}

#[test]
fn any_call_for_the_port_may_fail_once() {
    let calls = ["write", "read", "ppoll", "ioctl", "openat", "?open", "flock", "close"];
    sweep(&[(&calls, EACH, &[""], Some(To::Port))]);
}

#[test]
fn the_port_may_fail_again_while_it_gets_the_stop() {
    sweep(&[(&["write"], &["EIO", "EINTR", "EAGAIN"], &["+", "+2", "+3", "+4", "+5"], Some(To::Port))]);
}

#[test]
fn a_permanent_failure_does_not_hang() {
    let errors = ["EIO", "EINTR", "EAGAIN"];
    sweep(&[
        (&["ppoll", "clock_nanosleep", "sendto", "recvfrom"], &errors, &["+"], None),
        (&["ppoll", "read", "ioctl"], &errors, &["+"], Some(To::Port)),
    ]);
}

#[test]
fn a_recording_that_fails_changes_no_motion() {
    sweep(&[(&["write"], EACH, &["", "+"], Some(To::Recording))]);
}

#[test]
fn missing_resources_are_refused_before_the_first_frame_or_not_needed() {
    sweep(&[
        (&["?clone3", "?clone", "execve", "mmap", "mlockall"], &["ENOMEM"], &[""], None),
        (&["socketpair", "fcntl", "pidfd_open", "?dup2", "setsockopt"], &["EMFILE"], &[""], None),
        (&["statx", "ftruncate", "wait4", "getpeername"], &["EIO", "EINTR"], &[""], None),
    ]);
}

/// Plays the script with a library loaded into the program; the run must be complete.
fn assert_whole_with(port: Port, variables: &[(&str, &str)]) {
    let folder = Folder::new();
    let script = folder.script(SCRIPT);
    let mut player = motionseq(&["play", &script, "--port", &port.path]);
    let output = finish(player.envs(variables.iter().copied())).unwrap();
    let text = stderr(&output);
    assert_eq!((code(&output), closing_lines(&text)), (0, vec![]), "{variables:?}: {text}");
    let received = port.received().unwrap();
    assert!(is_whole(&received, &rendered(&script), Some(&text)), "{text}: {:?}", commands(&received));
}

#[test]
fn a_storm_of_signals_changes_nothing() {
    if is_missing("cc", works(Command::new("cc").arg("--version"))) {
        return;
    }
    let folder = Folder::new();
    let (storm, log) = (folder.path("storm.so"), folder.path("log"));
    assert!(works(Command::new("cc").args(["-shared", "-fPIC", "-o", &storm, "tests/inject/storm.c"])));
    // Signals hit another place each time.
    for every in ["1000", "200"].repeat(5) {
        assert_whole_with(Port::new(), &[("LD_PRELOAD", &storm), ("STORM_US", every), ("STORM_LOG", &log)]);
        let counts = fs::read_to_string(&log).unwrap();
        assert!(counts.lines().any(|count| count.parse::<u32>().unwrap() > 10), "it did not storm: {counts}");
        fs::remove_file(&log).unwrap();
    }
}

#[test]
fn a_clock_that_is_set_changes_nothing() {
    let found = Command::new("find").args(["/usr/lib", "-name", "libfaketime.so.1"]).output().unwrap().stdout;
    let found = String::from_utf8(found).unwrap();
    if is_missing("libfaketime", !found.is_empty()) {
        return;
    }
    let folder = Folder::new();
    let (file, next) = (folder.path("time"), folder.path("next"));
    // The wall clock can be set; the monotonic clock cannot.
    let mut all = vec![("LD_PRELOAD", found.lines().next().unwrap()), ("FAKETIME_NO_CACHE", "1")];
    all.extend([("FAKETIME_DONT_FAKE_MONOTONIC", "1"), ("DONT_FAKE_MONOTONIC", "1")]);
    let date = Command::new("date").arg("+%Y").envs(all.clone()).env("FAKETIME", "2001-01-01 00:00:00").output();
    assert_eq!(date.unwrap().stdout, b"2001\n", "no clock is set");
    for how in [("FAKETIME_TIMESTAMP_FILE", file.as_str()), ("FAKETIME", "+0 x10"), ("FAKETIME", "-30d x0.1")] {
        fs::write(&file, "+0").unwrap();
        let mut port = Port::new();
        let (sender, reads) = mpsc::channel();
        let came = std::mem::replace(&mut port.reads, reads);
        thread::scope(|scope| {
            // Set the clock whenever a frame has arrived.
            scope.spawn(|| {
                for (read, offset) in came.into_iter().zip(["+5h", "-9h", "+0", "-400d", "+9000h"].iter().cycle()) {
                    fs::write(&next, offset).unwrap();
                    fs::rename(&next, &file).unwrap();
                    sender.send(read).unwrap();
                }
                drop(sender);
            });
            let begin = Instant::now();
            assert_whole_with(port, &[&all[..], &[how]].concat());
            assert!(begin.elapsed() >= Duration::from_millis(220), "it ended too early");
        });
    }
}

/// A file system of 16 kB; `None` if none can be created.
struct SmallDisk(Folder);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = Folder::new();
        let mut mount = Command::new("mount");
        works(mount.args(["-t", "tmpfs", "-o", "size=16k", "none"]).arg(&folder.0)).then_some(SmallDisk(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        works(Command::new("umount").arg(&self.0.0));
    }
}

/// Runs the program in a shell, with text before and after it.
fn in_shell(before: &str, player: &Command, after: &str) -> Output {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("{before} exec \"$@\" {after}"), "sh"]);
    finish(shell.arg(player.get_program()).args(player.get_args())).unwrap()
}

/// Plays with its output redirected, and a recording to a file. Returns the output, if it can be
/// read.
fn output_to(place: &str, record: &str) -> String {
    result_to(place, "--record", record, 0)
}

/// The same when the recording cannot be complete.
fn no_output_to(place: &str, record: &str) -> String {
    result_to(place, "--record", record, 2)
}

/// The same with another result file and exit code.
fn result_to(place: &str, option: &str, record: &str, exit: i32) -> String {
    let (port, folder) = (Port::new(), Folder::new());
    let path = folder.script(LOUD);
    let player = motionseq(&["play", "-v", &path, "--port", &port.path, option, record]);
    let output = in_shell("", &player, place);
    let text = stderr(&output);
    assert_eq!((code(&output), closing_lines(&text)), (exit, vec![]), "{place} {record}: {text}");
    assert!(port.received().unwrap() == rendered(&path), "{place} {record}: the motion differs");
    text
}

#[test]
fn output_that_cannot_be_written_changes_no_motion() {
    for place in [">/dev/full", "2>/dev/full", ">&-", "2>&-", "<&- >&- 2>&-", ">/dev/full 2>&1"] {
        assert_eq!(warnings(&output_to(place, "/dev/null")), 0, "{place}");
        let text = no_output_to(place, "/dev/full");
        assert_eq!(warnings(&text), usize::from(!place.contains("2>")), "{place}: {text}");
    }
    assert_eq!(warnings(&no_output_to(">/dev/full", "/dev/stdout")), 1);
    let Some(disk) = SmallDisk::new() else {
        return eprintln!("no small file system can be mounted here, so only /dev/full was");
    };
    let full = disk.0.path("x");
    assert_eq!(warnings(&no_output_to("", &full)), 1);
    assert_eq!(fs::metadata(&full).unwrap().len(), 16_384);
    let text = result_to("", "--log", &disk.0.path("log"), 2);
    assert!(text.contains("is incomplete: No space left on device"), "{text}");
    output_to(&format!("2>{full}"), "/dev/null");
    no_output_to(&format!(">{full} 2>&1"), &disk.0.path("y"));
}

#[test]
fn readers_that_go_away_change_no_motion() {
    let (port, folder) = (Port::new(), Folder::new());
    let (path, pipe) = (folder.script(LOUD), folder.pipe());
    let reader = open(&pipe, false);
    let mut player = motionseq(&["play", "-v", &path, "--port", &port.path, "--record", &pipe]);
    let mut child = player.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut all = port.reads.recv_timeout(LIMIT).unwrap();
    drop((reader, child.stdout.take(), child.stderr.take()));
    // The recording is not complete.
    assert_eq!(code(&end_of(child).unwrap()), 2);
    all.extend(port.received().unwrap());
    assert!(all == rendered(&path), "the motion differs");
    // A pipe whose reader is gone before the start, and a closed descriptor, are refused.
    for record in [pipe.as_str(), "/dev/fd/9"] {
        let port = Port::new();
        let output = in_shell("exec 9>&-;", &motionseq(&["play", &path, "--port", &port.path, "--record", record]), "");
        assert!(code(&output) == 2 && stderr(&output).contains("nothing was sent"), "{}", stderr(&output));
        assert_eq!(port.received().unwrap(), b"");
    }
}

#[test]
fn a_recording_or_a_log_that_hangs_hides_no_closing_line() {
    for option in ["--record", "--log"] {
        let (port, folder) = (Port::new(), Folder::new());
        let (path, pipe) = (folder.script("rocker x=10\nwait 1h\nstop\n"), folder.pipe());
        // A full pipe whose reader does not read.
        let mut full = open(&pipe, true);
        while full.write(&[0; 4096]).is_ok() {}
        let mut player = motionseq(&["play", &path, "--port", &port.path, option, &pipe]);
        let child = player.stderr(Stdio::piped()).spawn().unwrap();
        port.reads.recv_timeout(LIMIT).unwrap();
        kill_process(Pid::from_child(&child), Signal::INT).unwrap();
        let output = end_of(child).unwrap();
        let text = stderr(&output);
        assert_eq!((code(&output), closing_lines(&text)), (130, vec!["sent"]), "{option}: {text}");
    }
}

#[test]
fn too_few_descriptors_are_refused_or_enough() {
    for limit in 3..=18 {
        let (port, folder) = (Port::new(), Folder::new());
        let path = folder.script(SCRIPT);
        let (recording, log) = (folder.path("recording"), folder.path("log"));
        let player = motionseq(&["play", &path, "--port", &port.path, "--record", &recording, "--log", &log]);
        let output = in_shell(&format!("ulimit -n {limit};"), &player, "");
        let (code, text, received) = (code(&output), stderr(&output), port.received().unwrap());
        match code {
            0 => assert!(is_whole(&received, &rendered(&path), Some(&text)), "{limit}: {text}"),
            _ => assert!(received.is_empty() && !text.is_empty(), "{limit}: exit {code}, {text}, {received:02X?}"),
        }
    }
}
