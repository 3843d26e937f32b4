//! Several robots of one script, played: over ports, on virtual boards, and under a simulated clock. What ends the run of one stops
//! all.

use std::fs;
use std::io::Write as _;
use std::process::{Child, Stdio};

use motionseq::faults::Faults;
use motionseq::playback::{Cause, Conductor, Input, Notice, Order, Player, Standing};
use motionseq::program::Options;
use motionseq::sim::Settings;
use motionseq::source::Source;
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};
use motionseq::verify::{Answers, Rehearsal, rehearse_together};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::desk::at_terminal;
use crate::support::far::{FarEnd, STOP, assert_at_rest, assert_stopped, bytes, end, start};

use crate::support::{Scratch, code, motionseq, run, script, stderr, stdout};

/// Two robots that drive for longer than every test, with a frame at least every 10 ms.
const DRIVING: &str =
    "robots left, right\nrefresh 10ms\nrocker x=10; buzzer on; servo 1 1000 -> 2000 over 1h\nstop; buzzer off\n";

fn timelines(text: &str) -> Vec<Timeline> {
    let compiled = motionseq::compile(&Source::new("test", text).into(), &Options::default());
    assert!(!compiled.diagnostics.has_errors(), "{:?}", compiled.diagnostics);
    compiled.timelines
}

/// Two ports, and the options that give them to the two robots.
fn two_ports() -> ([FarEnd; 2], [String; 4]) {
    let far = [FarEnd::new(), FarEnd::new()];
    let [left, right] = [&far[0].path, &far[1].path];
    let options = ["--port".into(), format!("left={left}"), "--port".into(), format!("right={right}")];
    (far, options)
}

fn play(script: &str, options: &[String]) -> Child {
    let mut args = vec!["play", script];
    args.extend(options.iter().map(String::as_str));
    start(&args)
}

/// Starts a run on two ports, and waits until both robots have got some frames.
fn start_both(text: &str, name: &str) -> (Child, [FarEnd; 2], [Vec<u8>; 2]) {
    let (far, options) = two_ports();
    let child = play(&script(name, text), &options);
    let received = [far[0].first(), far[1].first()];
    (child, far, received)
}

fn rest(far: &FarEnd, mut received: Vec<u8>) -> Vec<u8> {
    received.extend(bytes(&far.rest()));
    received
}

/// The closing lines.
fn errors(text: &str) -> Vec<&str> {
    text.lines().filter(|line| line.starts_with("error: ")).collect()
}

#[test]
fn each_port_gets_what_render_shows_for_its_robot() {
    let (far, options) = two_ports();
    let child = play("scripts/duet.motion", &options);
    let got = [bytes(&far[0].rest()), bytes(&far[1].rest())];
    let (exit, text) = end(child);
    assert_eq!(exit, 0, "{text}");
    for (robot, got) in ["left", "right"].into_iter().zip(got) {
        let rendered = run(&["render", "scripts/duet.motion", "--robot", robot, "--format", "bin"]).stdout;
        assert!(!rendered.is_empty() && got == rendered, "{robot}: {text}");
    }
}

#[test]
fn a_robot_whose_port_hangs_up_stops_the_other() {
    let (child, [left, right], [_, received]) = start_both(DRIVING, "hang-up");
    drop(left);
    let received = rest(&right, received);
    let (exit, text) = end(child);
    assert_eq!(exit, 3, "{text}");
    assert_stopped(&received);
    // The robot that may be moving is named last.
    let [second, first] = errors(&text)[..] else { panic!("{text}") };
    assert!(
        first.starts_with("error: left: the port hung up at ") && first.ends_with("NOT SENT - cut the power"),
        "{text}"
    );
    assert!(
        second.starts_with("error: right: stopped together with left at ") && second.ends_with("stop: sent"),
        "{text}"
    );
}

#[test]
fn a_signal_stops_all_robots() {
    for (signal, expected) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let (child, far, [one, two]) = start_both(DRIVING, "signals");
        kill_process(Pid::from_child(&child), signal).unwrap();
        let received = [rest(&far[0], one), rest(&far[1], two)];
        let (exit, text) = end(child);
        assert_eq!(exit, expected, "{text}");
        let [left, right] = &received;
        assert_stopped(left);
        assert_stopped(right);
        assert_eq!(errors(&text).iter().filter(|line| line.ends_with("; stop: sent")).count(), 2, "{text}");
    }
}

#[test]
fn the_guards_of_a_killed_player_stop_all_robots() {
    for _ in 0..8 {
        let (mut child, far, [one, two]) = start_both(DRIVING, "killed-together");
        kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
        child.wait().unwrap();
        assert_stopped(&rest(&far[0], one));
        assert_stopped(&rest(&far[1], two));
        let text = stderr(&child.wait_with_output().unwrap());
        let lines = errors(&text);
        for robot in ["left", "right"] {
            let begin = format!("error: {robot}: motionseq was killed");
            assert!(lines.iter().any(|line| line.starts_with(&begin) && line.ends_with("stop: sent")), "{text}");
        }
    }
}

/// The guards of a player: the children of its threads.
fn guards(player: &Child) -> Vec<Pid> {
    let tasks = fs::read_dir(format!("/proc/{}/task", player.id())).unwrap();
    let children = tasks.filter_map(|task| fs::read_to_string(task.unwrap().path().join("children")).ok());
    let all: Vec<String> =
        children.flat_map(|all| all.split_whitespace().map(str::to_owned).collect::<Vec<_>>()).collect();
    all.iter().map(|id| Pid::from_raw(id.parse().unwrap()).unwrap()).collect()
}

#[test]
fn a_killed_guard_stops_all_robots() {
    let (child, far, [one, two]) = start_both(DRIVING, "guard-of-one");
    let guards = guards(&child);
    assert_eq!(guards.len(), 2);
    kill_process(guards[0], Signal::KILL).unwrap();
    let received = [rest(&far[0], one), rest(&far[1], two)];
    let (exit, text) = end(child);
    assert_eq!(exit, 101, "{text}");
    let [left, right] = &received;
    assert_stopped(left);
    assert_stopped(right);
    assert!(text.contains("the guard of this run was lost") && text.contains("stopped together with"), "{text}");
}

#[test]
fn the_guards_of_a_player_that_hangs_stop_all_robots() {
    let (far, options) = two_ports();
    let long = script("hung-together", DRIVING);
    let mut all = options.to_vec();
    all.extend(["--max-late".to_owned(), "100ms".to_owned()]);
    let mut child = play(&long, &all);
    let received = [far[0].first(), far[1].first()];
    kill_process(Pid::from_child(&child), Signal::STOP).unwrap();
    let [one, two] = received;
    assert_stopped(&rest(&far[0], one));
    assert_stopped(&rest(&far[1], two));
    child.wait().unwrap();
}

#[test]
fn a_port_is_for_one_robot_and_must_be_named() {
    let far = FarEnd::new();
    let other = FarEnd::new();
    let script = script("ports-of-two", "robots left, right\nservo 1 1500\n");
    let scratch = Scratch::new("ports-of-two");
    let link = scratch.path("link");
    std::os::unix::fs::symlink(&far.path, &link).unwrap();
    let cases = [
        (vec![far.path.clone()], 2, format!("write `--port left={}`", far.path)),
        (vec![format!("lft={}", far.path)], 2, "the script has no robot `lft`; did you mean `left`?".into()),
        (vec![format!("left={}", far.path), format!("left={}", other.path)], 2, "given twice for left".into()),
        (vec![format!("left={}", far.path), format!("right={link}")], 2, "are one port".into()),
        (vec![format!("left={}", far.path), "right=/dev/missing".into()], 3, "cannot open port /dev/missing".into()),
    ];
    for (ports, expected, words) in cases {
        let mut args = vec!["play", &script];
        args.extend(ports.iter().flat_map(|port| ["--port", port]));
        let output = run(&args);
        let text = stderr(&output);
        assert_eq!(code(&output), expected, "{ports:?}: {text}");
        assert!(text.contains(&words), "{ports:?}: {text}");
    }
    // A program that opened the port has not written to it.
    assert!(far.reads.try_recv().is_err() && other.reads.try_recv().is_err());
    let output = run(&["play", "scripts/hello.motion", "--port", &far.path, "--port", &other.path]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}

#[test]
fn variables_name_the_port_of_each_robot() {
    let far = FarEnd::new();
    let script = script("variable-of-one", "robots left, right\nservo 1 1600\n");
    let output = motionseq(&["play", &script]).env("MOTIONSEQ_PORT_RIGHT", &far.path).output().unwrap();
    let text = stderr(&output);
    assert_eq!(code(&output), 0, "{text}");
    assert!(text.contains("left: no --port left=PATH: playing on a built-in virtual board"), "{text}");
    assert!(text.contains(&format!("right: playing on {} (port from MOTIONSEQ_PORT_RIGHT)", far.path)), "{text}");
    assert_at_rest(&bytes(&far.rest()));
}

#[test]
fn the_first_cause_gives_the_exit_code() {
    let cases = [
        ("left: stall@300ms", "wait 1s\n", 6, "left: the port stopped accepting bytes"),
        ("right: unplug@300ms", "wait 1s\n", 3, "right: the port hung up"),
        (
            "right: battery=6.5V",
            "expect voltage > 10V within 300ms \"charge it\"\nwait 2s\n",
            7,
            "right: `expect voltage > 10V within 0.3s` failed",
        ),
        (
            "left: silent",
            "left: wait until yaw > 500deg within 3s\n",
            7,
            "left: `wait until yaw > 500deg within 3s` failed: the board has reported nothing",
        ),
    ];
    for (number, (faults, lines, expected, words)) in cases.into_iter().enumerate() {
        let text = format!("robots left, right\nrocker x=5\n{lines}stop\n");
        let script = script(&format!("first-cause-{number}"), &text);
        let output = run(&["play", &script, "--fault", faults, "--max-late", "500ms"]);
        let text = stderr(&output);
        assert_eq!(code(&output), expected, "{faults}: {text}");
        let begin = format!("error: {words}");
        assert!(errors(&text).iter().any(|line| line.starts_with(&begin)), "{faults}: {text}");
        assert!(text.contains("stopped together with"), "{faults}: {text}");
    }
}

#[test]
fn the_report_has_the_result_of_each_robot() {
    let scratch = Scratch::new("report-of-two");
    let script = script("report-of-two", "robots left, right\nservo 1 1500\nleft: servo 2 1500\nwait 100ms\n");
    let (report, bin) = (scratch.path("report.json"), scratch.path("run.bin"));
    let output = run(&["play", &script, "--report", &report, "--record", &bin]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: Value = serde_json::from_str(&fs::read_to_string(report).unwrap()).unwrap();
    assert_eq!((&report["exit"], &report["frames"]["sent"], &report["robot"]), (&0.into(), &3.into(), &Value::Null));
    let robots = report["robots"].as_array().unwrap();
    let sent = |robot: &Value| (robot["robot"].as_str().unwrap().to_owned(), robot["frames"]["sent"].as_u64().unwrap());
    assert_eq!(robots.iter().map(sent).collect::<Vec<_>>(), [("left".to_owned(), 2), ("right".to_owned(), 1)]);
    assert_eq!(fs::read(scratch.path("run.left.bin")).unwrap().len(), 16);
    assert_eq!(fs::read(scratch.path("run.right.bin")).unwrap().len(), 8);
}

fn together(text: &str, faults: [&str; 2]) -> Vec<Rehearsal> {
    let timelines = timelines(text);
    let faults = faults.map(|faults| if faults.is_empty() { Faults::default() } else { faults.parse().unwrap() });
    rehearse_together(&timelines, &Settings::default(), &faults, &Answers::default())
}

#[test]
fn a_gate_of_one_robot_stops_the_clock_of_all() {
    let text =
        "robots left, right\nleft: { rocker z=45\n wait until turned > 45deg within 5s\n stop }\nright: servo 1 1500\n";
    let [left, right] = &together(text, ["", ""])[..] else { panic!() };
    assert!(left.outcome.cause == Cause::Finished && right.outcome.cause == Cause::Finished);
    let (waited, other) = (left.passages[0].took, right.passages[0].took);
    assert!(waited > Nanos::from_millis(900) && waited < Nanos::from_millis(1_500), "{waited:?}");
    // Both continue at the same time; each noticed the beginning at once.
    assert_eq!(waited, other);
}

#[test]
fn the_reports_of_all_named_robots_must_match_at_the_same_time() {
    // The right robot turns half as fast.
    let text = "robots left, right\nleft: rocker z=90; right: rocker z=45\nleft, right: wait until turned > 45deg within 5s\nstop\n";
    let [left, right] = &together(text, ["", ""])[..] else { panic!() };
    assert_eq!((left.outcome.cause, right.outcome.cause), (Cause::Finished, Cause::Finished));
    assert!(left.passages[0].took > Nanos::from_millis(900), "{:?}", left.passages);
    assert_eq!(left.passages[0].took, right.passages[0].took);
    // One that cannot match fails the run of all.
    let never = text.replace("right: rocker z=45", "right: rocker z=1");
    let [left, right] = &together(&never, ["", ""])[..] else { panic!() };
    assert!(matches!(
        (left.outcome.cause, right.outcome.cause),
        (Cause::Other { robot: 1 } | Cause::Gate(_), Cause::Gate(_)) | (Cause::Gate(_), Cause::Other { robot: 0 })
    ));
    assert!(left.received.state.at_rest(&timelines(text)[0].board));
}

#[test]
fn every_cut_of_one_robot_ends_all_at_rest() {
    let text = fs::read_to_string("scripts/duet.motion").unwrap();
    let timelines = timelines(&text);
    let end = timelines[0].end;
    for cut in (0..).map(|step| Micros::from_millis(37) * step).take_while(|cut| *cut < end) {
        for which in 0..2 {
            let mut faults = [Faults::default(), Faults::default()];
            faults[which] = format!("unplug@{}us", cut.0).parse().unwrap();
            let rehearsals = rehearse_together(&timelines, &Settings::default(), &faults, &Answers::default());
            let (gone, other) = (&rehearsals[which], &rehearsals[1 - which]);
            assert_eq!(gone.outcome.cause, Cause::Lost(None), "{cut:?}");
            assert_eq!(other.outcome.cause, Cause::Other { robot: which }, "{cut:?}");
            assert!(other.is_at_rest(&timelines[1 - which]), "{cut:?}: {:?}", other.received.state);
            let first = other.aborted.first().expect("a stop was sent");
            assert_eq!(timelines[1 - which].board.to_frame(&first.command), STOP, "{cut:?}");
        }
    }
}

#[test]
fn a_rehearsal_of_one_robot_keeps_what_all_send() {
    let scratch = Scratch::new("rehearse-two");
    let text = "# rehearse: left: unplug@500ms\nrobots left, right\nrocker x=5 for 1s\non abort { servos 1500 1500 }\n";
    scratch.file("two.motion", text.as_bytes());
    let bless = scratch.run(&["test", "--play", "--bless", "."]);
    assert_eq!(code(&bless), 0, "{}", stdout(&bless));
    let kept = fs::read_to_string(scratch.path("two.motion.left.unplug@500ms.frames")).unwrap();
    let right = kept.split("# frames\tright\n").nth(1).unwrap();
    assert!(right.contains("\tservos 1500 1500\tabort\tright\n"), "{kept}");
    let again = scratch.run(&["test", "--play", "."]);
    assert_eq!(code(&again), 0, "{}", stdout(&again));
    scratch.file("two.motion", text.replace("servos 1500 1500", "servos 1500 1600").as_bytes());
    let differs = scratch.run(&["test", "--play", "."]);
    assert_eq!(code(&differs), 1);
    assert!(stdout(&differs).contains("with left: unplug@500ms: "), "{}", stdout(&differs));
}

/// Two players and their conductor on one clock. Each player is polled in turn.
struct Pair<'t> {
    players: Vec<Player<'t>>,
    conductor: Conductor,
    /// The frames so far: the robot, when, and its index.
    sent: Vec<(usize, Nanos, usize)>,
}

impl<'t> Pair<'t> {
    fn new(timelines: &'t [Timeline]) -> Self {
        let player = |timeline| Player::new(timeline, Nanos::from_millis(50)).together();
        Pair { players: timelines.iter().map(player).collect(), conductor: Conductor::new(2), sent: Vec::new() }
    }

    /// Gives one input to one robot, and does what its player orders until it waits. A frame reaches the port at once.
    fn act(&mut self, robot: usize, now: Nanos, mut input: Input) {
        loop {
            let Pair { players, sent, .. } = self;
            let order = players[robot].poll(now, input, &mut |notice| {
                if let Notice::Sent { event, .. } = notice {
                    sent.push((robot, now, event));
                }
            });
            input = match order {
                Order::Write => Input::Wrote(players[robot].bytes().len()),
                Order::Halt { .. } => Input::Tick,
                _ => break,
            };
        }
        let standing = self.players[robot].standing(now);
        self.conductor.hear(robot, standing);
    }

    /// What the conductor decides; the second robot hears of it 2 ms after the first.
    fn conduct(&mut self, now: Nanos, input: Input) {
        let mut orders = Vec::new();
        self.conductor.poll(now, input, &mut |robot, input| orders.push((robot, input)));
        for (robot, input) in orders {
            let late = if robot == 0 { Nanos::ZERO } else { Nanos::from_millis(2) };
            self.act(robot, now + late, input);
        }
    }

    /// Lets the clock run up to a time, in steps of 1 ms.
    fn run(&mut self, from: u64, to: u64) {
        for millis in from..to {
            let now = Nanos::from_millis(millis);
            for robot in 0..2 {
                self.act(robot, now, Input::Tick);
            }
            self.conduct(now, Input::Tick);
        }
    }
}

#[test]
fn after_a_pause_all_clocks_are_the_same() {
    let text = "robots left, right\nservo 1 1000 -> 2000 over 2s\n";
    let timelines = timelines(text);
    let mut pair = Pair::new(&timelines);
    pair.run(0, 503);
    // The second robot pauses 2 ms after the first.
    pair.conduct(Nanos::from_millis(503), Input::Pause);
    pair.run(506, 900);
    assert!(matches!(pair.players[0].standing(Nanos::from_millis(900)), Standing::Paused { .. }));
    let before = pair.sent.len();
    pair.conduct(Nanos::from_millis(900), Input::Resume);
    pair.run(903, 1_200);
    let now = Nanos::from_millis(1_200);
    assert_eq!(pair.players[0].script_time(now), pair.players[1].script_time(now));
    let sent = |robot: usize| pair.sent.iter().filter(move |(of, ..)| *of == robot).map(|(_, at, event)| (*at, *event));
    assert!(pair.sent.len() > before + 10);
    // The frames after the pause leave at the same times.
    let last: Vec<_> = sent(0).filter(|(at, _)| *at > Nanos::from_millis(950)).collect();
    assert_eq!(last, sent(1).filter(|(at, _)| *at > Nanos::from_millis(950)).collect::<Vec<_>>());
}

#[test]
fn nothing_is_sent_before_all_are_ready() {
    // An arm is read before time 0, and this one does not answer; the other robot must not move meanwhile.
    let text = "robots base, arm\narm: board sts\nbase: rocker x=10 for 1s\narm: servo 1 2048\n";
    let timelines = timelines(text);
    let mut pair = Pair::new(&timelines);
    pair.run(0, 200);
    assert!(pair.sent.iter().all(|(robot, ..)| *robot != 0), "{:?}", pair.sent);
    let base = &mut pair.players[0];
    assert!(matches!(base.outcome().map(|outcome| outcome.cause), None | Some(Cause::Other { robot: 1 })));
}

#[test]
fn a_step_is_the_next_time_of_any_robot() {
    let text = "robots left, right\nleft: servo 1 1500\nwait 1s\nright: servo 1 1600\nwait 1s\nservo 2 1500\n";
    let timelines = timelines(text);
    let mut pair = Pair::new(&timelines);
    pair.players =
        timelines.iter().map(|timeline| Player::new(timeline, Nanos::from_millis(50)).together().paused()).collect();
    pair.run(0, 5);
    let mut steps = Vec::new();
    for step in 0..3 {
        let before = pair.sent.len();
        pair.conduct(Nanos::from_millis(10 + 10 * step), Input::Step);
        pair.run(13 + 10 * step, 15 + 10 * step);
        steps.push(pair.sent.iter().skip(before).map(|(robot, ..)| *robot).collect::<Vec<_>>());
    }
    assert_eq!(steps, [vec![0], vec![1], vec![0, 1]]);
    let at = |pair: &Pair<'_>| {
        pair.players.iter().map(|player| player.script_time(Nanos::from_millis(60))).collect::<Vec<_>>()
    };
    assert_eq!(at(&pair), [Nanos::from_millis(2_000); 2]);
}

#[test]
fn a_go_opens_the_gate_of_all() {
    let script = script("go-of-two", "robots left, right\nservo 1 1500\nwait go \"next?\"\nservo 1 1600\n");
    let mut child = motionseq(&["play", &script, "--go", "stdin", "-q"]);
    child.stdin(Stdio::piped()).stderr(Stdio::piped());
    let mut child = child.spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"go\n").unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

#[test]
fn keys_pause_step_and_continue_all_robots() {
    let text = "robots left, right\nleft: servo 1 1500\nwait 1s\nright: servo 1 1600\nwait go \"next?\"\nwait 1s\nservo 2 1700\n";
    let script = script("keys-of-two", text);
    // Steps of one robot alone, a gate, and then on without steps.
    let steps = [
        "wait:0.000 s: paused",
        "key:\n",
        "wait:0.000 s: left: servo 1 1500",
        "key:\n",
        "wait:1.000 s: right: servo 1 1600",
        "key:\n",
        "wait:next?",
        "key:\n",
        "wait:go after",
        "key:\n",
        "wait:2.000 s: right: servo 2 1700",
    ];
    let text = at_terminal("120", &steps, &["play", &script, "--step"]);
    assert!(text.starts_with("exit") || text.contains("left: servo 2 1700"), "{text}");
    let steps = [
        "wait:next?",
        "key: ",
        "wait:paused",
        "key: ",
        "wait:continued",
        "wait:waiting for a go",
        "key:g",
        "wait:left: sent 2 frames",
    ];
    let text = at_terminal("120", &steps, &["play", &script]);
    assert!(text.starts_with("exit 0\nicanon True\necho True\n"), "{text}");
    assert!(text.contains("right: sent 2 frames"), "{text}");
}

#[test]
fn space_q_and_a_kill_leave_the_terminal_and_the_robots_in_order() {
    let script = script("ends-of-two", "robots left, right\nrocker y=10 z=20 for 60s\n");
    let text = at_terminal("120", &["wait:left: rocker x=0", "key:?q"], &["play", &script]);
    assert!(text.starts_with("exit 0\nicanon True\necho True\n"), "{text}");
    assert!(text.contains("left: stopped by q at") && text.contains("right: stopped by q at"), "{text}");
    for steps in [vec!["wait:left: rocker x=0", "key: ", "wait:paused", "kill"], vec!["wait:left: rocker x=0", "kill"]]
    {
        let text = at_terminal("120", &steps, &["play", &script]);
        assert!(text.starts_with("exit -9\nicanon True\necho True\n"), "{text}");
        assert!(text.contains("left: motionseq was killed") && text.contains("right: motionseq was killed"), "{text}");
    }
}

#[test]
fn a_robot_that_matches_early_and_does_not_drive_waits_for_the_other() {
    // Nothing happens to the left robot but its reports, for longer than a report stays new.
    let script =
        script("early-match", "robots left, right\nleft, right: wait until voltage < 7V within 9s\nservo 1 1500\n");
    let output = run(&[
        "play",
        &script,
        "--fault",
        "left: battery=6.5V",
        "--fault",
        "right: battery=6.5V@1500ms",
        "--max-late",
        "5s",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stderr(&output).contains("right: voltage < 7V after 1."), "{}", stderr(&output));
}

#[test]
fn a_port_for_one_robot_is_not_taken_for_all() {
    let script = script("common-port", "robots left, right\nservo 1 1500\n");
    let output = motionseq(&["play", &script]).env("MOTIONSEQ_PORT", "/dev/missing").output().unwrap();
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("MOTIONSEQ_PORT is for scripts with one robot"), "{}", stderr(&output));
    let output =
        motionseq(&["play", &script, "--port", "virtual"]).env("MOTIONSEQ_PORT", "/dev/missing").output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let output = run(&["play", &script, "--port", "left="]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("write `--port left=virtual`"), "{}", stderr(&output));
}

#[test]
fn a_robot_that_never_began_gets_no_on_abort() {
    let text = "robots base, arm\narm: board sts\nrate 50hz\nbase: rocker x=10 for 1s\narm: servo 1 2048\nbase: on abort { servos 1500 1500 }\n";
    let script = script("never-began", text);
    let output = run(&["play", &script, "--fault", "servo=1:silent"]);
    let text = stderr(&output);
    assert_eq!(code(&output), 3, "{text}");
    assert!(text.contains("error: arm: servo 1 does not answer"), "{text}");
    assert!(text.contains("base: sent 0 frames") && !text.contains("servo 1 at 1500"), "{text}");
}

#[test]
fn one_robot_with_a_name_is_played_like_one_without() {
    let script = script("solo", "robots solo\nservo 1 1500\nwait 300ms\nservo 1 1600\n");
    let text = at_terminal("120", &["wait:0.300 s"], &["play", &script]);
    assert!(text.starts_with("exit 0\n") && !text.contains("getting ready"), "{text}");
    let output = run(&["play", &script, "--port", "solo=virtual"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}
