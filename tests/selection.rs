//! Clips of a script, other speeds, and loops: what `render` and `play` have in common.

use crate::support::board::{OnBoard, board};
use crate::support::{run, script, stderr, stdout};
use motionseq::board::{Command, State};
use motionseq::playback::{Cause, Input, Notice, Order, Player};
use motionseq::program::{Options, Speed};
use motionseq::source::Source;
use motionseq::timeline::{Clip, Kind, Position, Timeline, clip, passes, state_after};
use motionseq::units::{Micros, Nanos};

fn compiled(text: &str, speed: Speed) -> Timeline {
    let options = Options::default().with_speed(speed);
    motionseq::compile(&Source::new("x.motion", text).into(), &options).timeline().expect("the script compiles")
}

fn timeline(text: &str) -> Timeline {
    compiled(text, Speed::NORMAL)
}

/// Time, command and kind of each frame.
fn frames(timeline: &Timeline) -> Vec<(u64, String, Kind)> {
    timeline.events.iter().map(|event| (event.at.0, event.command.said(), event.kind)).collect()
}

const SHOW: &str = "\
pid speed speed=1,2 position=3,4,5 yaw=6,7,8
servos 1500 1500
servo 3 1000 -> 2000 over 2s ease in-out-sine
mark turn
rocker y=10 z=20 for 2s
buzzer on
mark nod
repeat 3 { servo 2 1700 over 300ms
servo 2 1500 over 300ms }
rocker y=-5
wait 1s
buzzer off
mark bow
servo 3 1200 over 500ms
rocker y=0 -> 8 over 400ms
wait 500ms
stop
";

#[test]
fn a_clip_from_any_time_restores_the_state_of_the_whole_run() {
    let whole = timeline(SHOW);
    for from in (1..whole.end.0).step_by(37_000).map(Micros).chain(whole.marks.iter().map(|mark| mark.at)) {
        let cut = clip(&whole, &Clip::new(Position::before(&whole, from), None, Micros::SECOND), &State::default());
        let mut there = State::default();
        for event in whole.events.iter().take_while(|event| event.at < from) {
            there.apply(board(), &event.command);
        }
        // The lead-in, without the commands at exactly that time.
        let count = cut.events.iter().take_while(|event| event.kind == Kind::Auto).count();
        let mut state = State::default();
        for event in &cut.events[..count] {
            state.apply(board(), &event.command);
        }
        // The lead-in does not restore what the drive and the buzzer get at exactly that time.
        let anew: Vec<&Command> =
            whole.events.iter().filter(|event| event.at == from).map(|event| &event.command).collect();
        let is_anew = |command: &Command| {
            anew.iter().any(|new| {
                let is_buzzer = |command: &Command| command.said().starts_with("buzzer");
                command.is_drive() && new.is_drive() || is_buzzer(command) && is_buzzer(new)
            })
        };
        let restored: Vec<Command> = state.commands(board()).cloned().collect();
        let wanted: Vec<Command> = there.commands(board()).filter(|command| !is_anew(command)).cloned().collect();
        assert_eq!(restored, wanted, "{from}");
        // The servos come first and get the lead-in; the drive starts when they have arrived.
        let drives = cut.events[..count].iter().find(|event| event.command.is_drive());
        assert!(drives.is_none_or(|event| event.at == Micros::SECOND && event.at == cut.end - (whole.end - from)));
        // Afterwards, the same frames at the same distances.
        let rest: Vec<_> = whole.events.iter().filter(|event| event.at >= from).collect();
        let by = cut.end - (whole.end - from);
        assert_eq!(rest.len(), cut.events.len() - count);
        for (event, other) in rest.iter().zip(&cut.events[count..]) {
            assert_eq!((event.at - from + by, &event.command), (other.at, &other.command));
        }
        let mut end = State::default();
        cut.events.iter().for_each(|event| end.apply(board(), &event.command));
        assert!(end.at_rest(board()), "{from}");
    }
}

#[test]
fn a_clip_to_any_time_leaves_nothing_running() {
    let whole = timeline(SHOW);
    for to in (1..whole.end.0).step_by(53_000).map(Micros) {
        let cut = clip(
            &whole,
            &Clip::new(Position::default(), Some(Position::before(&whole, to)), Micros::ZERO),
            &State::default(),
        );
        assert_eq!(cut.end, to);
        assert!(state_after(&cut).at_rest(board()), "{to}");
        assert!(cut.events.is_sorted_by_key(|event| event.at) && cut.events.iter().all(|event| event.at <= to));
    }
    assert_eq!(clip(&whole, &Clip::default(), &State::default()), whole);
}

#[test]
fn a_servo_at_another_known_position_moves_smoothly() {
    let whole = timeline("servo 1 1000\nwait 1s\nservo 1 2000\nwait 1s\n");
    let asked = Clip::new(Position::before(&whole, Micros(500_000)), None, Micros(100_000));
    // The position is unknown: the command is sent once, and the servo gets the lead-in.
    let first = clip(&whole, &asked, &State::default());
    assert_eq!(
        frames(&first)[..2],
        [(0, "servo 1 1000".into(), Kind::Auto), (600_000, "servo 1 2000".into(), Kind::Command)]
    );
    // After the first pass it is at 2000: in-out-sine over 100 ms, at 20 ms 2000 - 1000 · (1 -
    // cos(π/5)) / 2 = 1905.
    let again = clip(&whole, &asked, &state_after(&first));
    let found = frames(&again);
    let steps: Vec<(u64, &str)> = found.iter().map(|(at, command, _)| (*at, command.as_str())).collect();
    assert_eq!(
        steps,
        [
            (20_000, "servo 1 1905"),
            (40_000, "servo 1 1655"),
            (60_000, "servo 1 1345"),
            (80_000, "servo 1 1095"),
            (100_000, "servo 1 1000"),
            (600_000, "servo 1 2000")
        ]
    );
}

#[test]
fn passes_follow_each_other_exactly() {
    let whole = timeline("servo 1 1000\nwait 333333us\nservo 1 1100\nwait 1us\n");
    let all = passes(&whole, &whole, 1_000, 10_000_000).unwrap();
    assert_eq!((all.events.len(), all.end), (2_000, Micros(333_334_000)));
    for (at, event) in all.events.iter().enumerate() {
        let pass = u64::try_from(at / 2).unwrap();
        assert_eq!(event.at, Micros(pass * 333_334 + if at % 2 == 0 { 0 } else { 333_333 }));
    }
    assert!(passes(&whole, &whole, 10_000_000, 10_000_000).is_none());
    assert!(passes(&whole, &whole, u64::MAX, 10_000_000).is_none());
}

#[test]
fn at_another_speed_commands_and_moves_are_scaled_and_refreshes_are_not() {
    let text = "servo 1 1000 -> 1100 over 100ms\nrocker x=5 for 100ms\nmark end\nwait 100ms\n";
    let half = compiled(text, Speed::of("0.5").unwrap());
    assert_eq!((half.end, half.marks[0].at), (Micros(600_000), Micros(400_000)));
    let found = frames(&half);
    let kind = |kind| found.iter().filter(|(_, _, found)| *found == kind).map(|(at, ..)| *at).collect::<Vec<_>>();
    // Steps every 20 ms, ten of them and not five; refreshes every 50 ms.
    assert_eq!(
        kind(Kind::Sample),
        [0, 20_000, 40_000, 60_000, 80_000, 100_000, 120_000, 140_000, 160_000, 180_000, 200_000]
    );
    assert_eq!(kind(Kind::Refresh), [250_000, 300_000, 350_000]);
    assert_eq!(kind(Kind::Command), [200_000, 400_000]);
    // Exact: a third of the speed and three times the duration.
    let third = compiled("wait 100ms\nservo 1 1000\n", Speed::of("3").unwrap());
    assert_eq!(third.events[0].at, Micros(33_333));
    for wrong in ["0.09", "10.001", "11", "", "x", "1.0000", "-1", "1e1", "0"] {
        assert_eq!(Speed::of(wrong), None, "{wrong}");
    }
}

#[test]
fn a_run_without_end_does_not_drift_and_comes_to_rest_when_it_is_ended() {
    let whole = timeline("servo 1 1000\nwait 100ms\nrocker y=5 for 233333us\nwait 1us\n");
    let mut player = Player::new(&whole, Nanos::from_millis(1_000)).again_and_again(&whole);
    let (mut now, mut input, mut sent, mut newest) = (Nanos::ZERO, Input::Tick, Vec::new(), 0);
    let outcome = loop {
        let order = player.poll(now, input, &mut |notice| {
            if let Notice::Pass { pass } = notice {
                newest = pass;
            }
        });
        if let Some(outcome) = player.outcome() {
            break outcome;
        }
        input = Input::Tick;
        match order {
            Order::Write => {
                sent.push((now, player.bytes().to_vec()));
                input = Input::Wrote(player.bytes().len());
            }
            Order::Wait { until, .. } | Order::Pause { until } => now = until.max(now),
            _ => {}
        }
        if newest == 5_000 && input == Input::Tick {
            input = Input::Signal(2);
            newest += 1;
        }
    };
    assert_eq!(outcome.cause, Cause::Signal(2));
    let servos: Vec<Nanos> = sent.iter().filter(|(_, bytes)| bytes[2] == 0x02).map(|(at, _)| *at).collect();
    assert!(servos.len() >= 4_999);
    for (pass, at) in servos.iter().enumerate() {
        assert_eq!(*at, Micros(333_334).nanos() * u64::try_from(pass).unwrap());
    }
}

#[test]
fn the_played_frames_are_the_rendered_ones() {
    let path = script("show", SHOW);
    for options in [
        vec!["--from", "nod", "--to", "bow", "--speed", "4", "--lead-in", "50ms"],
        vec!["--to", "300ms", "--loop", "3"],
        vec!["--from", "turn", "--to", "2.2s", "--loop", "2", "--lead-in", "60ms"],
    ] {
        let record = format!("{path}.bin");
        let rendered = run(&[&["render", &path, "--format", "bin"], &options[..]].concat()).stdout;
        let output = run(&[&["play", &path, "--record", &record], &options[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        // A stalled machine may drop steps, and reports that.
        if !stderr(&output).contains("dropped") {
            assert_eq!(std::fs::read(&record).unwrap(), rendered, "{options:?}");
        }
        assert!(!rendered.is_empty());
    }
}

#[test]
fn invalid_times_and_marks_list_the_valid_ones() {
    let path = script("marks", "mark a\nrepeat 2 { mark inner\nwait 1s }\nservo 1 1500\nmark b\nwait 1s\n");
    for (options, words) in [
        (vec!["--from", "c"], "`c` is neither a time such as 1.5s nor a mark of the script; the marks are a, inner, b"),
        (
            vec!["--from", "inner"],
            "the mark `inner` occurs more than once, at 0.000, 1.000 s; write one of these times",
        ),
        (vec!["--from", "4s"], "`--from` is after the end of the script, which takes 3.000 s"),
        (vec!["--from", "b", "--to", "a"], "`--to` must be later than `--from`"),
        (vec!["--loop", "forever"], "write a number of passes, 1 or more"),
        (vec!["--from", "inf"], "`inf` is neither a time such as 1.5s nor a mark"),
        (vec!["--from", "2"], "`2` is neither a time such as 2s nor a mark"),
        (vec!["--from", "1s1s"], "`1s1s` is neither a time such as 1.5s nor a mark"),
        (vec!["--to", "1d"], "`1d` is neither a time such as 1.5s nor a mark"),
        (vec!["--lead-in", "1d"], "write a time such as 500ms, 1.5s or 1m30s"),
        (vec!["--lead-in", "1s1s"], "write the units of a time from long to short, each once, such as 1m30s"),
        (vec!["--loop", "99999999"], "99999999 passes take more than 24 hours or 10000000 frames"),
        (vec!["--loop", "0"], "write a number of passes, 1 or more"),
        (vec!["--speed", "20"], "write a number from 0.1 to 10 with at most three decimals"),
    ] {
        let output = run(&[&["render", &path], &options[..]].concat());
        assert_eq!((output.status.code(), stdout(&output)), (Some(2), String::new()), "{options:?}");
        assert!(stderr(&output).contains(words), "{options:?}: {}", stderr(&output));
    }
    let slow = script("slow-day", "wait 20h\nservo 1 1500\n");
    let output = run(&["render", &slow, "--speed", "0.5"]);
    assert!(
        output.status.code() == Some(1) && stderr(&output).contains("at this speed the script is longer than 24 hours")
    );
}

#[test]
fn a_report_contains_passes_dropped_frames_and_the_lateness_of_the_line() {
    let path = script("three-passes", "servo 1 1500\nwait 50ms\nservo 1 1600\nwait 50ms\n");
    let report = format!("{path}.json");
    let read = || -> serde_json::Value { serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap() };
    for (args, passes) in [(&["--loop", "3"][..], 3), (&[], 1), (&["--loop", "3", "--lead-in", "100ms"], 3)] {
        let output = run(&[&["play", &path, "--report", &report], args].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert_eq!(read()["passes"].as_u64(), Some(passes), "{args:?}");
    }
    // Ended in the second of three passes.
    let failing = script("second-pass", "servo 1 1500\nwait 50ms\nexpect voltage > 1V\nwait 150ms\n");
    let output = run(&["play", &failing, "--report", &report, "--loop", "3"]);
    assert_eq!(output.status.code(), Some(7), "{}", stderr(&output));
    assert_eq!(read()["passes"].as_u64(), Some(1));
    // 40 raw frames of 8 bytes at once, followed by the closing stop of 13: `buzzer off` waits for
    // 333 bytes of 86.8 us each.
    let busy = script("busy-line", &"raw 0x40 1 2 3\n".repeat(40));
    let output = run(&["play", &busy, "--report", &report]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(read()["lateness_us"]["line"].as_f64(), Some(28_907.0));
    let said = stderr(&output);
    assert!(said.contains("at 115200 baud, a frame waits up to 28.9 ms for the serial line"), "{said}");
}

#[test]
fn the_report_describes_the_run() {
    let path = script(
        "reported",
        "servo 2 1900  # allow: no-such\nwait 300ms\nexpect voltage > 11V\nexpect voltage < 5V \"never\"\n",
    );
    let report = format!("{path}.json");
    let output = run(&["play", &path, "--report", &report]);
    assert_eq!(output.status.code(), Some(7), "{}", stderr(&output));
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    assert_eq!(
        (json["reason"].as_str(), json["exit"].as_u64(), json["line"].as_u64()),
        (Some("expect"), Some(7), Some(4))
    );
    assert_eq!((json["stop"].as_str(), json["passes"].as_u64()), (Some("sent"), Some(1)));
    // The request for reports and the servo, of 6 and 8 bytes; 12 zeros, three stops of 13 and the
    // buzzer of 6.
    assert_eq!(
        (json["frames"]["sent"].as_u64(), json["frames"]["extra"].as_u64(), json["bytes"].as_u64()),
        (Some(2), Some(4), Some(71))
    );
    assert_eq!(
        (json["expects"][0]["passed"].as_bool(), json["expects"][1]["passed"].as_bool()),
        (Some(true), Some(false))
    );
    assert_eq!(json["expects"][1]["why"], "never");
    assert_eq!(json["asked"], serde_json::json!({ "from": null, "to": null, "speed": 1.0, "passes": 1 }));
    assert_eq!((&json["port"], &json["pauses"]), (&serde_json::Value::Null, &0.into()));
    assert!(json["elapsed_us"].as_u64() > json["end_us"].as_u64(), "{json}");
    assert_eq!(json["warnings"][0]["code"], "allow");
    assert!(json["lateness_us"]["max"].as_f64().unwrap() >= json["lateness_us"]["p50"].as_f64().unwrap());
    // A report that cannot be written is refused before anything moves; a full disk is a warning.
    assert_eq!(run(&["play", &path, "--report", "/no/such/folder/x"]).status.code(), Some(2));
    let output = run(&["play", &path, "--report", &report, "--record", &report]);
    assert!(output.status.code() == Some(2) && stderr(&output).contains("it is also the file of `--record`"));
    let output = run(&["play", &path, "--report", "/dev/full"]);
    assert_eq!(output.status.code(), Some(7));
    assert!(stderr(&output).contains("the report /dev/full is incomplete"), "{}", stderr(&output));
}

#[test]
fn latency_ends_with_what_to_do() {
    let output = run(&["latency", "--for", "400ms"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(text.starts_with("idle: ") && text.contains("\nbusy: "), "{text}");
    let last = text.lines().last().unwrap();
    assert!(["good:", "use --realtime:", "this machine stalls:"].iter().any(|words| last.starts_with(words)), "{text}");
    assert_eq!(run(&["latency", "--for", "1ms"]).status.code(), Some(2));
    let output = run(&["latency", "--for", "400ms", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    for measured in ["idle", "busy"] {
        let (count, lateness) = (&json[measured]["deadlines"], &json[measured]["lateness_ns"]);
        let rows = lateness["rows"].as_array().unwrap().iter().map(|row| row["count"].as_u64().unwrap());
        assert_eq!(Some(rows.sum()), count.as_u64(), "{json}");
        assert!(lateness["p50"].as_u64() <= lateness["max"].as_u64(), "{json}");
    }
    assert!(["good", "try-realtime", "stalls"].iter().any(|verdict| json["verdict"] == *verdict), "{json}");
}

/// The same errors as in a `repeat`.
#[test]
fn passes_are_checked_together() {
    let flood = script("flood", &("raw 0x04 0x00  # allow: raw-frame\n".repeat(40) + "wait 10ms\n"));
    let twice = script("twice", "servo 1 1000\nwait 1s\nservo 1 2000\n");
    let two_servos = script("two-servos", "servos 1000 1500\nwait 1s\nservo 2 1600\n");
    let drives = script("drives", "stop\nwait 1s\nrocker x=1\n");
    for (path, words) in [
        (&flood, "but leaves"),
        (&twice, "servo 1 gets two commands at 1.000000 s"),
        (&two_servos, "servo 2 gets two commands at 1.000000 s"),
        (&drives, "the drive gets two commands at 1.000000 s"),
    ] {
        assert_eq!(run(&["render", path]).status.code(), Some(0), "{path}");
        let output = run(&["render", path, "--loop", "100"]);
        assert_eq!((output.status.code(), stdout(&output)), (Some(1), String::new()), "{path}");
        assert!(stderr(&output).contains(words), "{path}: {}", stderr(&output));
    }
    for (name, text) in [
        ("hold", "rocker x=1 for 1s\n"),
        ("move", "servo 1 1000 -> 1500 over 1s\n"),
        ("wait", "servo 1 1000\nwait 1s\n"),
        ("other", "servo 1 1000\nwait 1s\nservo 2 1500\n"),
        ("left", "stop\nwait 100ms\nrocker x=1\nwait 100ms\n"),
        ("hold-at-the-seam", "rocker x=1 for 1s\nrocker x=2 for 1s\nwait 1s\nstop\n"),
    ] {
        let path = script(name, text);
        let output = run(&["render", &path, "--loop", "10"]);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
        let repeated = script(&format!("{name}-repeated"), &format!("repeat 10 {{\n{text}}}\n"));
        let output = run(&["check", &repeated]);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
    }
}

/// A command that the next pass replaces before the servo can have arrived gives the same warning
/// as in a `repeat`.
#[test]
fn servos_that_the_next_pass_sends_elsewhere() {
    let far = "servo 1 500\nwait 1s\nservo 1 2500\nwait 10ms\n";
    let moved = "servo 1 1000 -> 2000 over 1s\nservo 1 2000 -> 1000 over 1s\n";
    let jumps = "servo 1 1000 -> 2000 over 1s\nwait 1s\nservo 1 1500\nwait 20ms\n";
    let arrives = "servo 1 500\nwait 1s\nservo 1 2500\nwait 500ms\n";
    for (name, text, words) in [
        ("far", far, Some("servo 1 needs about 363 ms from 500 to 2500 µs, but its next command comes after 10 ms")),
        (
            "jumps",
            jumps,
            Some("servo 1 needs about 90 ms from 2000 to 1500 µs, but its next command comes after 20 ms"),
        ),
        ("moved", moved, None),
        ("arrives", arrives, None),
    ] {
        let once = script(name, text);
        let repeated = script(&format!("{name}-repeated"), &format!("repeat 10 {{\n{text}}}\n"));
        for (args, words) in [
            (&["render", &once][..], None),
            (&["render", &once, "--loop", "10"][..], words),
            (&["check", &repeated], words),
        ] {
            let output = run(args);
            let found = stderr(&output).split_whitespace().collect::<Vec<_>>().join(" ").replace(" │ ", " ");
            assert_eq!(output.status.code(), Some(0), "{args:?}: {found}");
            assert_eq!(found.matches("servo-speed").count() > 0, words.is_some(), "{args:?}: {found}");
            assert!(words.is_none_or(|words| found.contains(words)), "{args:?}: {found}");
        }
    }
    // Part of a move is not a jump.
    let output = run(&["render", &script("cut", moved), "--loop", "10", "--from", "500ms"]);
    assert_eq!((output.status.code(), stderr(&output).contains("servo-speed")), (Some(0), false));
}
