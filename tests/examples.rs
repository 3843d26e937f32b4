//! The examples of the library work as described.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::support::far::{FarEnd, assert_stopped, bytes};
use crate::support::{run, stderr, stdout};

/// The path of an example, built with these tests.
fn example(name: &str) -> PathBuf {
    let built = Command::new(env!("CARGO")).args(["build", "--quiet", "--example", name]).status().unwrap();
    assert!(built.success());
    // The tests are in target/debug/deps.
    let tests = std::env::current_exe().unwrap();
    tests.parent().unwrap().parent().unwrap().join("examples").join(name)
}

#[test]
fn a_script_and_the_file_that_it_uses_are_compiled_in_memory() {
    let output = Command::new(example("compile")).output().unwrap();
    let text = stdout(&output);
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    assert!(text.starts_with("0.500000\tFF FE 02 03 02 05 DC E8\tservo 2 1500\tsample\n"), "{text}");
    assert!(text.ends_with("3.000000\tFF FE 03 08 01 00 00 00 00 00 00 01 0D\tstop\n"), "{text}");
}

#[test]
fn the_play_example_sends_what_render_prints() {
    let far = FarEnd::new();
    let output = Command::new(example("play")).args(["scripts/hello.motion", &far.path]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        stdout(&output).starts_with("0.500 s: servo 1 1500\n0.500 s: rocker x=10 y=0 z=50\n"),
        "{}",
        stdout(&output)
    );
    let rendered = run(&["render", "scripts/hello.motion", "--format", "bin"]);
    assert_eq!(bytes(&far.rest()), rendered.stdout);
}

#[test]
fn the_guard_of_the_play_example_stops_the_robot() {
    let far = FarEnd::new();
    let mut player = Command::new(example("play"))
        .args(["scripts/square.motion", &far.path])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    far.first();
    player.kill().unwrap();
    player.wait().unwrap();
    assert_stopped(&bytes(&far.rest()));
}

#[test]
fn the_play_example_refuses_a_missing_port() {
    let play = example("play");
    let run = |arguments: &[&str]| stderr(&Command::new(&play).args(arguments).output().unwrap());
    assert_eq!(run(&[]), "error: usage: play SCRIPT PORT\n");
    assert_eq!(run(&["scripts/hello.motion", "/no/such/port"]), "error: no such port\n");
}
