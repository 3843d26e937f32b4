//! Ports, terminals and signals as other programs left them, and as this one leaves them.

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader, Read as _, Write};
use std::os::unix::fs::symlink;
use std::os::unix::process::CommandExt as _;
use std::process::{ChildStderr, Command, Stdio};

use motionseq::link::Pty;
use rustix::process::{Pid, Signal, WaitOptions, kill_process};

use crate::support::far::{FarEnd, assert_stopped, bytes, end, start};
use crate::support::host::{Host, frames, link, rocker};
use crate::support::{motionseq, run, script, stderr};

/// Whether a terminal is in exclusive mode.
fn is_exclusive(path: &str) -> bool {
    let code = "import fcntl,os,sys\nfd=os.open(sys.argv[1],os.O_RDWR|os.O_NOCTTY)\n\
                print(int.from_bytes(fcntl.ioctl(fd,0x80045440,bytes(4)),'little'))";
    let output = Command::new("python3").args(["-c", code, path]).output().unwrap();
    // An ordinary user may not even open it.
    !output.status.success() || crate::support::stdout(&output).trim() != "0"
}

#[test]
fn the_port_is_free_after_every_end_of_a_run() {
    let short = script("exclusive", "servo 1 1500\n");
    let long = script("exclusive-long", "rocker x=10\nwait 1h\n");
    let pty = Pty::open().unwrap();
    let path = pty.path().to_str().unwrap();
    for _ in 0..2 {
        let output = run(&["play", &short, "--port", path]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(!is_exclusive(path));
    }
    for signal in [Signal::INT, Signal::KILL] {
        let far = FarEnd::new();
        // Keeps the far end open after the player ends.
        let held = File::options().read(true).write(true).open(&far.path).unwrap();
        let child = start(&["play", &long, "--port", &far.path]);
        far.first();
        kill_process(Pid::from_child(&child), signal).unwrap();
        child.wait_with_output().unwrap();
        assert!(!is_exclusive(&far.path), "{signal:?}");
        drop(held);
    }
}

#[test]
fn a_board_outlives_a_client_that_was_killed_and_had_its_port_to_itself() {
    let mut host = Host::start("to-itself", &[]);
    let code = "import fcntl,os,sys,termios,time\nfd=os.open(sys.argv[1],os.O_RDWR|os.O_NOCTTY)\n\
                fcntl.ioctl(fd,termios.TIOCEXCL)\nprint('open',flush=True)\ntime.sleep(60)";
    let mut client = Command::new("python3").args(["-c", code]).arg(&host.path).stdout(Stdio::piped()).spawn().unwrap();
    host.says("has opened the port");
    let mut said = [0; 5];
    std::io::Read::read_exact(client.stdout.as_mut().unwrap(), &mut said).unwrap();
    client.kill().unwrap();
    client.wait().unwrap();
    host.says("the port is closed");
    let mut port = host.open();
    port.write_all(&rocker(5)).unwrap();
    drop(port);
    host.says("the port is closed");
    assert_eq!(frames(&host.end().0).len(), 1);
}

#[test]
fn a_result_never_goes_to_the_port_or_to_a_terminal() {
    let path = script("to-the-port", "rocker x=10\nwait 100ms\nstop\n");
    let far = FarEnd::new();
    let (alias, other) = (link("alias"), Pty::open().unwrap());
    symlink(&far.path, &alias).unwrap();
    for option in ["--record", "--report", "--log"] {
        for place in [far.path.as_str(), alias.to_str().unwrap(), other.path().to_str().unwrap()] {
            let output = run(&["play", &path, "--port", &far.path, option, place]);
            assert_eq!(output.status.code(), Some(2), "{option} {place}: {}", stderr(&output));
            assert!(stderr(&output).contains("it is a terminal or a serial port"), "{}", stderr(&output));
        }
    }
    let other = other.path().to_str().unwrap();
    for args in [&["render", &path, "-o", other][..], &["record", "--link", "/tmp/never", "-o", other]] {
        let output = run(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
    }
    // A device that accepts everything is written in place.
    let output = run(&["play", &path, "--port", &far.path, "--record", "/dev/null"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(fs::metadata("/dev/null").is_ok_and(|meta| !meta.is_file()));
    fs::remove_file(alias).unwrap();
}

#[test]
fn the_link_of_a_living_program_stays_and_a_stale_one_is_replaced() {
    let living = Pty::open().unwrap();
    let path = link("living");
    symlink(living.path(), &path).unwrap();
    for command in ["board", "record"] {
        let output = run(&[command, "--link", path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
        assert!(stderr(&output).contains("of another program, which is running"), "{}", stderr(&output));
        assert_eq!(fs::read_link(&path).unwrap(), living.path());
    }
    // It ends, and another terminal gets its number.
    let number = living.path().to_owned();
    drop(living);
    let mut others = vec![Pty::open().unwrap()];
    while !others.iter().any(|other| other.path() == number) && others.len() < 64 {
        others.push(Pty::open().unwrap());
    }
    let host = Host::start_at("board", path.clone(), &[]);
    assert!(fs::read_link(&path).unwrap() != number || others.iter().all(|other| other.path() != number));
    host.end();
}

#[test]
fn a_long_path_is_a_path_for_a_link_too() {
    let folder = link(&format!("{}/{}", "a".repeat(60), "b".repeat(60)));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("board");
    let host = Host::start_at("board", path.clone(), &[]);
    let output = run(&["board", "--link", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    host.end();
    fs::remove_dir_all(folder.parent().unwrap()).unwrap();
}

#[test]
fn a_report_from_before_the_run_makes_no_expect_hold() {
    let path = script("before", "wait 200ms\nexpect voltage > 1V\n");
    let pty = Pty::open().unwrap();
    let held = File::options().read(true).write(true).open(pty.path()).unwrap();
    rustix::io::write(&pty, b"{A0:0:0:1200}#{A0:0:0:1200}#").unwrap();
    let output = run(&["play", &path, "--port", pty.path().to_str().unwrap()]);
    drop(held);
    assert_eq!(output.status.code(), Some(7), "{}", stderr(&output));
    assert!(stderr(&output).contains("the board reported nothing"), "{}", stderr(&output));
}

#[test]
fn the_board_end_of_a_pseudo_terminal_is_refused() {
    let output = run(&["play", "scripts/hello.motion", "--port", "/dev/ptmx"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("nothing is connected to it"), "{}", stderr(&output));
}

/// Starts the program from a parent that has ignored or blocked some signals.
fn start_from(parent: &str, args: &[&str]) -> std::process::Child {
    let code = format!(
        "import os,signal,sys\n[signal.signal(s,signal.SIG_DFL) for s in (signal.SIGHUP,signal.SIGINT,signal.SIGQUIT)]\n\
         {parent}\nos.execvp(sys.argv[1],sys.argv[1:])"
    );
    let mut command = Command::new("python3");
    command.args(["-c", &code, env!("CARGO_BIN_EXE_motionseq")]).args(args).args(["--max-late", "5s"]);
    command.current_dir(env!("CARGO_MANIFEST_DIR")).env_remove("MOTIONSEQ_PORT");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn signals_that_were_blocked_end_a_run_all_the_same() {
    let long = script("was-blocked", "rocker x=10\nwait 1h\n");
    let far = FarEnd::new();
    let blocked =
        "signal.pthread_sigmask(signal.SIG_BLOCK,{signal.SIGINT,signal.SIGTERM,signal.SIGHUP,signal.SIGQUIT})";
    let child = start_from(blocked, &["play", &long, "--port", &far.path]);
    let mut received = far.first();
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let (code, text) = end(child);
    received.extend(bytes(&far.rest()));
    assert_eq!(code, 143, "{text}");
    assert_stopped(&received);
}

#[test]
fn signals_that_were_ignored_stay_so_and_a_port_that_hangs_up_counts() {
    let long = script("was-ignored", "refresh 20ms\nrocker x=10\nwait 1h\n");
    let ignored = "[signal.signal(s,signal.SIG_IGN) for s in (signal.SIGHUP,signal.SIGINT)]";
    for last in [Some(Signal::TERM), None] {
        let far = FarEnd::new();
        let child = start_from(ignored, &["play", &long, "--port", &far.path]);
        let mut received = far.first();
        for signal in [Signal::HUP, Signal::INT] {
            kill_process(Pid::from_child(&child), signal).unwrap();
        }
        // It keeps driving.
        for _ in 0..10 {
            received.extend(far.first());
        }
        let code = match last {
            Some(signal) => {
                kill_process(Pid::from_child(&child), signal).unwrap();
                143
            }
            None => 3,
        };
        if last.is_some() {
            received.extend(bytes(&far.rest()));
            assert_stopped(&received);
        } else {
            drop(far);
        }
        assert_eq!(end(child).0, code);
    }
}

#[test]
fn hints_can_be_followed() {
    let output = run(&["play", "scripts/hello.motion", "--port", "/dev/no-such-port"]);
    assert!(stderr(&output).contains("list the ports with `motionseq ports`"), "{}", stderr(&output));
    let output = run(&["test", "no-such-folder"]);
    let text = crate::support::stdout(&output) + &stderr(&output);
    assert!(text.contains("no-such-folder") && text.contains("no such file or directory"), "{text}");
    // A name that looks like an option is shown so that the command line works.
    let folder = link("hints");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("-x.motion"), "servo 1 1500\n").unwrap();
    let in_folder = |args: &[&str]| motionseq(args).current_dir(&folder).output().unwrap();
    let text = crate::support::stdout(&in_folder(&["test"]));
    assert!(text.contains("motionseq test --bless ./-x.motion"), "{text}");
    assert_eq!(in_folder(&["test", "--bless", "./-x.motion"]).status.code(), Some(0));
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_forbidden_port_names_the_group_of_its_node() {
    let pty = Pty::open().unwrap();
    let path = pty.path();
    let is_root = rustix::process::geteuid().is_root();
    if !is_root {
        // The owner could open it in any mode, and there is no other user.
        return;
    }
    let group = |gid| {
        std::os::unix::fs::chown(path, Some(0), Some(gid)).unwrap();
        fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o660)).unwrap();
        let copy = link("forbidden-program");
        crate::support::copy_program(&copy);
        let mut player = Command::new("setpriv");
        player.args(["--reuid=65534", "--regid=65534", "--clear-groups"]).arg(&copy);
        player.args(["play", "-", "--port"]).arg(path).current_dir("/").stdin(Stdio::piped()).stderr(Stdio::piped());
        let mut child = player.spawn().unwrap();
        child.stdin.take().unwrap().write_all(b"servo 1 1500\n").unwrap();
        let output = child.wait_with_output().unwrap();
        fs::remove_file(copy).unwrap();
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        stderr(&output)
    };
    let groups = fs::read_to_string("/etc/group").unwrap();
    let named = |name: &str| {
        let line = groups.lines().find(|line| line.starts_with(&format!("{name}:"))).unwrap();
        line.split(':').nth(2).unwrap().parse().unwrap()
    };
    assert!(group(named("dialout")).contains("usermod -aG dialout $USER"));
    assert!(group(named("tty")).contains("usermod -aG tty $USER"));
    assert!(!group(0).contains("usermod"));
}

/// Plays with `--wait`, and returns the player once it waits, with the line that says so.
fn waiting(path: &std::path::Path, script: &str) -> (std::process::Child, BufReader<ChildStderr>) {
    waits(&mut motionseq(&["play", script, "--wait", "1h", "--port", path.to_str().unwrap()]))
}

/// The same with a command that was set up.
fn waits(player: &mut Command) -> (std::process::Child, BufReader<ChildStderr>) {
    let mut child = player.stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    assert!(line.contains("waiting up to"), "{line}");
    (child, said)
}

#[test]
fn a_run_waits_for_a_port_that_is_not_there_yet() {
    let script = script("waits", "rocker x=10\nwait 100ms\nstop\n");
    let (far, path) = (FarEnd::new(), link("waits-for"));
    let (mut child, mut said) = waiting(&path, &script);
    symlink(&far.path, &path).unwrap();
    let received = bytes(&far.rest());
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    assert!(rest.contains(&format!("playing on {}", path.display())), "{rest}");
    assert!(received.starts_with(&rocker(10)), "{received:?}");
    fs::remove_file(path).unwrap();
}

#[test]
fn a_signal_ends_the_wait_for_a_port() {
    let script = script("waits-no-more", "rocker x=10\nwait 100ms\nstop\n");
    for (signal, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let (mut child, mut said) = waiting(&link("never-there"), &script);
        kill_process(Pid::from_child(&child), signal).unwrap();
        let mut rest = String::new();
        said.read_to_string(&mut rest).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code), "{rest}");
        assert!(rest.contains("nothing was sent"), "{rest}");
    }
}

#[test]
fn a_wait_for_a_port_is_suspended_and_continued() {
    let script = script("suspended", "servo 1 1500\n");
    let (far, path) = (FarEnd::new(), link("suspended-for"));
    // In a group of its own, which its parent could continue as a shell does.
    let mut player = motionseq(&["play", &script, "--wait", "1h", "--port", path.to_str().unwrap()]);
    let (mut child, mut said) = waits(player.process_group(0));
    kill_process(Pid::from_child(&child), Signal::TSTP).unwrap();
    rustix::process::waitpid(Some(Pid::from_child(&child)), WaitOptions::UNTRACED).unwrap().unwrap();
    let stat = fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    assert!(stat.contains(") T "), "{stat}");
    kill_process(Pid::from_child(&child), Signal::CONT).unwrap();
    symlink(&far.path, &path).unwrap();
    let received = bytes(&far.rest());
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    assert_eq!(received, crate::support::rendered(&script));
    fs::remove_file(path).unwrap();
}

#[test]
fn a_wait_that_is_over_is_a_port_that_cannot_be_opened() {
    let path = link("never-there-either");
    for command in [
        &["play", "scripts/hello.motion", "--port", path.to_str().unwrap()][..],
        &["record", "--link", "/tmp/never", "--port", path.to_str().unwrap()],
    ] {
        let output = run(&[command, &["--wait", "10ms"]].concat());
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        assert!(
            stderr(&output).contains("waiting up to 10") && stderr(&output).contains("no such port; nothing was sent"),
            "{}",
            stderr(&output)
        );
    }
    // What is not a port does not become one.
    let output = run(&["play", "scripts/hello.motion", "--port", "scripts/hello.motion", "--wait", "1h"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    // The virtual board is there at once.
    let output = run(&["play", "scripts/hello.motion", "--wait", "1h"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}
