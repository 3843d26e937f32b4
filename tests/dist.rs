//! What a release is made of: the steps of the GitHub Action, the service, the Python module, and what `dist/build` refuses.

use std::fs;
use std::io::Read as _;
use std::os::unix::fs::symlink;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use rustix::process::{Pid, Signal, kill_process_group};

use crate::support::{Scratch, code, copy_program, program, stderr, stdout, with_motionseq};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn shell(folder: &Path, command: &str) -> Output {
    with_motionseq("bash", folder).args(["-ec", command]).output().unwrap()
}

/// A step of the action, as a job runs it in a repository.
fn step(name: &str, repository: &Path, variables: &[(&str, &str)]) -> Output {
    let mut command = with_motionseq(&format!("{ROOT}/dist/action/{name}"), repository);
    for (name, file) in [("GITHUB_PATH", "path"), ("GITHUB_STEP_SUMMARY", "summary"), ("RUNNER_TEMP", "temp")] {
        command.env(name, repository.join(".git").join(file));
    }
    command.env("GITHUB_WORKSPACE", repository).envs(variables.iter().copied()).output().unwrap()
}

#[test]
fn the_steps_of_the_action_check_and_test_a_repository() {
    let scratch = Scratch::new("action");
    let repository = scratch.0.as_path();
    fs::write(repository.join("nod.motion"), "servo 1 1500\nwait 1s\nservo 1 1600\n").unwrap();
    assert!(shell(repository, "git init -q . && motionseq test --bless && git add .").status.success());
    let good = step("test", repository, &[]);
    assert_eq!(code(&good), 0, "{}", stderr(&good));
    fs::write(repository.join("nod.motion"), "servo 1 1500\nwait 2s\nservo 1 1600\n").unwrap();
    fs::write(repository.join("bad.motion"), "servo 9 1500\n").unwrap();
    let check = step("check", repository, &[]);
    assert_eq!(code(&check), 1);
    assert!(stdout(&check).contains("::error file=bad.motion,line=1"), "{}", stdout(&check));
    let test = step("test", repository, &[("JUNIT", "report.xml")]);
    assert_eq!(code(&test), 1);
    assert!(stdout(&test).contains("::error file=nod.motion"), "{}", stdout(&test));
    assert!(fs::read_to_string(repository.join("report.xml")).unwrap().contains("<testsuite"));
    let summary = fs::read_to_string(repository.join(".git/summary")).unwrap();
    assert!(summary.contains("FAILED nod.motion") && summary.contains("1.000 s later"), "{summary}");
    fs::write(repository.join("bad.motion"), "rocker y=10\n").unwrap();
    assert_eq!(code(&step("check", repository, &[])), 0);
    assert_eq!(code(&step("check", repository, &[("DENY", "warnings")])), 1);
}

#[test]
fn the_action_installs_an_archive_with_the_right_sum() {
    let scratch = Scratch::new("action-install");
    let repository = scratch.0.as_path();
    fs::create_dir(repository.join("motionseq-0.1.0-x86_64-linux")).unwrap();
    copy_program(&repository.join("motionseq-0.1.0-x86_64-linux/motionseq"));
    assert!(shell(repository, "git init -q . && tar -czf a.tar.gz motionseq-*").status.success());
    let sum = stdout(&shell(repository, "sha256sum a.tar.gz | cut -d' ' -f1"));
    let installed = step("install", repository, &[("ARCHIVE", "a.tar.gz"), ("SHA256", sum.trim())]);
    assert_eq!(code(&installed), 0, "{}{}", stdout(&installed), stderr(&installed));
    assert!(stdout(&installed).starts_with("motionseq "));
    let path = fs::read_to_string(repository.join(".git/path")).unwrap();
    assert!(Path::new(path.trim()).join("motionseq").is_file());
    let wrong = step("install", repository, &[("ARCHIVE", "a.tar.gz"), ("SHA256", &"0".repeat(64))]);
    assert_eq!((code(&wrong), stdout(&wrong).contains("::error title=motionseq::a.tar.gz has the sum")), (1, true));
    // Without an archive, a program from the cache is taken as it is.
    let cached = step("install", repository, &[]);
    assert_eq!((code(&cached), stdout(&cached).starts_with("motionseq ")), (0, true), "{}", stderr(&cached));
    let key = stdout(&step("key", repository, &[]));
    assert!(key.trim().strip_prefix("key=").is_some_and(|sum| sum.len() == 64), "{key}");
    let absent = step("install", repository, &[("ARCHIVE", "b.tar.gz")]);
    assert_eq!((code(&absent), stdout(&absent).contains("::error title=motionseq::there is no archive")), (1, true));
}

/// The service, with the program of this build and a script in a folder.
fn service(folder: &Path) -> String {
    let unit = fs::read_to_string(format!("{ROOT}/dist/motionseq@.service")).unwrap();
    unit.replace("/usr/bin/motionseq", program())
        .replace("/etc/motionseq", folder.to_str().unwrap())
        .replace("/var/lib/motionseq", folder.to_str().unwrap())
}

#[test]
fn the_service_stops_the_robot_at_sigterm_to_its_group() {
    let scratch = Scratch::new("service");
    let folder = scratch.0.as_path();
    fs::write(folder.join("show.motion"), "say \"ready\"\nrocker y=10 for 60s\n").unwrap();
    let unit = service(folder);
    let start = unit.lines().find_map(|line| line.strip_prefix("ExecStart=")).unwrap().replace("%i", "show");
    let mut words = start.split(' ');
    let mut player = Command::new(words.next().unwrap());
    player.args(words).current_dir(folder).process_group(0).stderr(Stdio::piped()).stdin(Stdio::null());
    let mut player = player.spawn().unwrap();
    let mut errors = player.stderr.take().unwrap();
    let mut journal = Vec::new();
    let mut buffer = [0; 1];
    while !String::from_utf8_lossy(&journal).contains("ready\n") {
        assert_eq!(errors.read(&mut buffer).unwrap(), 1, "{}", String::from_utf8_lossy(&journal));
        journal.extend_from_slice(&buffer);
    }
    kill_process_group(Pid::from_child(&player), Signal::TERM).unwrap();
    errors.read_to_end(&mut journal).unwrap();
    assert_eq!(player.wait().unwrap().code(), Some(143));
    let journal = String::from_utf8(journal).unwrap();
    assert!(journal.contains("stop: sent"), "{journal}");
    assert!(journal.chars().all(|c| c == '\n' || !c.is_control()), "{journal:?}");
    assert!(
        fs::read_to_string(folder.join("show.json")).unwrap().contains("\"SIGTERM\"") || journal.contains("SIGTERM")
    );
    for line in
        ["Restart=no", "DynamicUser=yes", "SupplementaryGroups=dialout", "WatchdogSec=0", "SuccessExitStatus=143"]
    {
        assert!(unit.lines().any(|other| other == line), "{line}");
    }
}

#[test]
fn systemd_finds_no_fault_in_the_service() {
    let scratch = Scratch::new("systemd");
    let path = scratch.0.join("motionseq@show.service");
    fs::write(&path, service(&scratch.0).replace("Documentation=man:motionseq-play(1)\n", "")).unwrap();
    let Ok(output) = Command::new("systemd-analyze").args(["verify", "--man=no"]).arg(&path).output() else {
        println!("skipped: there is no systemd-analyze");
        return;
    };
    let said = stderr(&output);
    let about_it: Vec<&str> = said.lines().filter(|line| line.contains("motionseq")).collect();
    assert!(output.status.success() && about_it.is_empty(), "{said}");
}

#[test]
fn the_python_package_finds_its_program() {
    let scratch = Scratch::new("python");
    let folder = scratch.0.as_path();
    fs::create_dir(folder.join("bin")).unwrap();
    copy_program(&folder.join("bin/motionseq"));
    symlink(format!("{ROOT}/dist/python/motionseq"), folder.join("motionseq")).unwrap();
    // As `pip install --target` lays it out; a symbolic link is not followed.
    let python = |args: &[&str]| {
        let mut python = Command::new("python3");
        python.args(args).env("PYTHONPATH", folder).env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap()
    };
    let version = python(&["-m", "motionseq", "--version"]);
    assert_eq!((code(&version), stdout(&version).starts_with("motionseq ")), (0, true), "{}", stderr(&version));
    let path = python(&["-c", "import motionseq; print(motionseq.path())"]);
    assert!(stdout(&path).trim().ends_with("/bin/motionseq"), "{}", stderr(&path));
    assert_eq!(code(&python(&["-m", "motionseq", "check", "/no/such.motion"])), 1);
}

#[test]
fn a_build_refuses_what_it_cannot_build_and_leaves_nothing() {
    let scratch = Scratch::new("build");
    let folder = scratch.0.as_path();
    let copy =
        format!("git init -q . && mkdir dist && cp {ROOT}/dist/build dist/ && cp {ROOT}/Cargo.toml . && git add .");
    assert!(shell(folder, &copy).status.success());
    let tools = Scratch::new("build-tools");
    let link = "for tool in bash dirname git realpath; do ln -s $(command -v $tool) $TOOLS/$tool; done";
    let shell = |folder: &Path, command: &str| {
        with_motionseq("bash", folder).args(["-ec", command]).env("TOOLS", &tools.0).output().unwrap()
    };
    assert!(shell(folder, link).status.success());
    let before = stdout(&shell(folder, "find . -path ./.git -prune -o -print | sort"));
    for (command, status, message) in [
        ("dist/build armv6l", 2, "unknown architecture `armv6l`; write x86_64 or aarch64"),
        ("PATH=$TOOLS bash dist/build", 1, "`cargo` is missing; install Rust"),
        ("dist/build --quick", 1, "this is not a git checkout"),
        (
            "git -c user.name=x -c user.email=x@x commit -qm x && touch new && dist/build --quick",
            1,
            "the working tree has changes",
        ),
        ("rm new && dist/build --quick --output dist", 2, "is not empty"),
    ] {
        let output = shell(folder, command);
        let said = stderr(&output);
        assert_eq!(code(&output), status, "{command}: {said}");
        assert!(said.contains(message) && said.lines().count() == 1, "{command}: {said}");
    }
    assert_eq!(stdout(&shell(folder, "find . -path ./.git -prune -o -print | sort")), before);
}
