//! `record`, and `decode` into a script: a script that repeats what a program sent.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command as Client;
use std::sync::Arc;

use crate::support::board::{OnBoard, board, say};
use crate::support::host::{Host, frames, has, link, rocker, stop};
use crate::support::{messages, run, stderr};
use motionseq::board::Command;
use motionseq::capture::{Decoded, Reading, ScriptWriter, TimedDecoder, decode, to_script};
use motionseq::program::{Ease, Options};
use motionseq::source::{Disk, Source, Sources};
use motionseq::timeline::{Kind, Timeline, write_listing, write_snapshot};
use motionseq::units::{Micros, Nanos};
use proptest::prelude::*;
use rustix::process::Signal;

const BAUD: u32 = 115_200;
/// The maximum deviation of a folded recording from the sent values.
const SERVO_TOLERANCE: i32 = 5;
const DRIVE_TOLERANCE: i32 = 1;

/// Compiles a script; errors are shown.
fn compiled(text: &str) -> Timeline {
    let sources = Sources::from(Source::new("test.motion", text));
    let compiled = motionseq::compile(&sources, &Options::default().with_events(10_000_000));
    compiled
        .timelines
        .into_iter()
        .next()
        .unwrap_or_else(|| panic!("{}\n{text}", messages(&sources, &compiled.diagnostics)))
}

/// Records frames at times in microseconds, settled every 300 ms, as `record` does.
fn recorded(exact: bool, frames: &[(u64, Vec<u8>)]) -> String {
    let mut writer = ScriptWriter::new(Arc::clone(board()), exact, BAUD);
    let mut decoder = TimedDecoder::new(board(), BAUD);
    let (mut text, mut settled, mut last) = (String::new(), 0, 0);
    for (at, frame) in frames {
        while settled + 300_000 < *at {
            settled += 300_000;
            writer.settle(Micros(settled));
            text += &writer.settled();
            amend(&mut writer, &mut text);
            if writer.frames() > 0 {
                // The script must be valid if it ends here.
                compiled(&(text.clone() + &writer.tail()));
            }
        }
        decoder.feed(Micros(*at).nanos(), frame, |at, item| writer.take(at, item));
        last = *at;
    }
    writer.finish(Micros(last + 2_000));
    text += &writer.settled();
    amend(&mut writer, &mut text);
    text
}

/// The same frames without times, as `decode -o` writes them.
fn decoded_script(frames: &[(u64, Vec<u8>)], exact: bool) -> String {
    let bytes: Vec<u8> = frames.iter().flat_map(|(_, frame)| frame.clone()).collect();
    let mut out = Vec::new();
    to_script(&bytes[..], Reading::default(), exact, &mut out).unwrap();
    String::from_utf8(out).unwrap()
}

/// Replaces the note in the header of a recording, as `record` does in its file.
fn amend(writer: &mut ScriptWriter, text: &mut String) {
    if let Some((at, new)) = writer.amendment() {
        text.replace_range(at..at + new.len(), &new);
    }
}

fn sent(timeline: &Timeline) -> Vec<(u64, Vec<u8>)> {
    timeline.events.iter().map(|event| (event.at.0, event.command.to_frame())).collect()
}

/// When each frame starts on the line, and its bytes.
fn on_the_line(frames: &[(u64, Vec<u8>)]) -> Vec<(u64, Vec<u8>)> {
    let mut free = 0.0_f64;
    let begin = |(at, frame): &(u64, Vec<u8>)| {
        let begin = free.max(*at as f64);
        free = begin + frame.len() as f64 * 1e7 / f64::from(BAUD);
        (begin as u64, frame.clone())
    };
    frames.iter().map(begin).collect()
}

#[test]
fn an_exact_recording_sends_every_frame_of_the_script_again() {
    let mut scripts: Vec<(String, String)> = fs::read_dir("scripts")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "motion"))
        .map(|path| (path.display().to_string(), fs::read_to_string(&path).unwrap()))
        // Those for the Raspblock.
        .filter(|(_, text)| !text.contains("\nboard ") && !text.contains("\nrobots "))
        .collect();
    scripts.push(("raw".into(), "raw 0x40 1 2 3\nraw 2 4 9 9\nwait 1s\nbuzzer on\n+0.2s servo 1 1500".into()));
    scripts.push(("move".into(), "pid position speed=1,2 position=1,2,3 yaw=1,2,3\nmove x=5\nwait 1s\nstop".into()));
    assert!(scripts.len() > 8);
    for (name, text) in scripts {
        let sources = if Path::new(&name).exists() {
            Sources::read(Path::new(&name), Disk).unwrap()
        } else {
            Sources::from(Source::new("test.motion", text.as_str()))
        };
        let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
        let played = sent(&timeline);
        let again = sent(&compiled(&recorded(true, &played)));
        let begin_us = played[0].0;
        let frames = |sent: &[(u64, Vec<u8>)]| sent.iter().map(|(_, frame)| frame.clone()).collect::<Vec<_>>();
        assert_eq!(frames(&again), frames(&played), "{name}");
        for ((found_us, _), (received_us, _)) in on_the_line(&again).into_iter().zip(on_the_line(&played)) {
            assert!(found_us.abs_diff(received_us - begin_us) <= 20, "{name}: {found_us} {received_us}");
        }
    }
}

#[test]
fn a_folded_recording_of_a_script_says_its_moves() {
    let script = "servos 1500 1500
servo 1 2000 over 1s ease in-out-sine
servo 1 1200 over 700ms ease out-quad
wait 500ms
together {
  rocker x=0 -> 20 y=0 -> -10 z=0 -> 180 over 2s ease in-quad
  servo 3 1000 -> 2000 over 1s ease out-bounce
  servos 1500 1500 over 1s
}
rocker x=5 y=5 for 1s";
    let text = recorded(false, &sent(&compiled(script)));
    // What starts together starts together again, although the line carries one frame after the
    // other.
    assert_eq!(
        lines(&text),
        [
            "servos 1500 1500; servo 1 2000 over 1s ease in-out-sine",
            "servo 1 1200 over 0.7s ease out-quad",
            "wait 0.5s",
            "together {",
            "  rocker x=0 -> 20 y=0 -> -10 z=0 -> 180 over 2s ease in-quad",
            "  servo 3 1000 -> 2000 over 1s ease out-bounce",
            "  servos 1500 1500 over 1s",
            "}",
            // The last value of the move is on the line first.
            "+1ms rocker x=5 y=5 for 999ms",
        ],
        "{text}"
    );
}

/// The lines of a recording below its header.
fn lines(text: &str) -> Vec<&str> {
    text.lines().skip(1).filter(|line| !line.is_empty()).collect()
}

/// A channel and its values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lane {
    Servo(i32),
    Servos,
    Rocker,
}

impl Lane {
    fn command(self, [a, b, c]: [i32; 3]) -> Command {
        match self {
            Lane::Servo(index) => say("servo", &[index, a]),
            Lane::Servos => say("servos", &[a, b]),
            Lane::Rocker => say("rocker", &[a, b, c]),
        }
    }

    /// Values in range, from three numbers from 0 to 1, with room for easings that overshoot.
    fn values(self, parts: [f64; 3]) -> [i32; 3] {
        let [a, b, c] = parts;
        let at = |least: f64, most: f64, part: f64| (least + (most - least) * part).round() as i32;
        match self {
            Lane::Servo(_) => [at(1_050.0, 1_950.0, a), 0, 0],
            Lane::Servos => [at(1_050.0, 1_950.0, a), at(900.0, 1_550.0, b), 0],
            Lane::Rocker => [at(-13.0, 13.0, a), at(-13.0, 13.0, b), at(-100.0, 100.0, c)],
        }
    }
}

/// A phase of a program.
#[derive(Clone, Debug)]
struct Act {
    lane: Lane,
    to: [f64; 3],
    /// By an easing; `None` for a jump or random values.
    how: Option<Ease>,
    steps: u64,
    step: u64,
    jitter: u64,
    pause: u64,
    /// Whether it starts together with the previous phase, as in a program with threads.
    is_parallel: bool,
    seed: u64,
}

fn act() -> impl Strategy<Value = Act> {
    let lane = prop_oneof![(1..=3).prop_map(Lane::Servo), Just(Lane::Servos), Just(Lane::Rocker)];
    let ease = prop::sample::select(Ease::names()).prop_map(|name| Ease::named(&name));
    let how = prop_oneof![3 => ease, 1 => Just(None)];
    let step = prop::sample::select(vec![2_000_u64, 5_000, 10_000, 20_000, 33_000, 90_000]);
    let pause = prop_oneof![Just(0), Just(3_000), 10_000..400_000_u64, 600_000..1_500_000_u64];
    let to = [0.0..1.0, 0.0..1.0, 0.0..1.0];
    let when = (step, 0..800_u64, pause, any::<bool>());
    (lane, to, how, 1..60_u64, when, any::<u64>()).prop_map(
        |(lane, to, how, steps, (step, jitter, pause, is_parallel), seed)| Act {
            lane,
            to,
            how,
            steps,
            step,
            jitter,
            pause,
            is_parallel,
            seed,
        },
    )
}

/// The frames of a program with these phases, and the values that it sent.
fn program(acts: &[Act]) -> Vec<(u64, Lane, [i32; 3])> {
    let (mut frames, mut now, mut begin) = (Vec::new(), 0, 0);
    let mut last: Vec<(Lane, [i32; 3])> = Vec::new();
    for act in acts {
        let before = now;
        now = if act.is_parallel { begin } else { now };
        begin = now;
        let from = last.iter().rev().find(|(lane, _)| *lane == act.lane);
        let from = from.map_or_else(|| act.lane.values([0.5; 3]), |(_, values)| *values);
        let to = act.lane.values(act.to);
        let mut seed = act.seed;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31)
        };
        for step in 1..=act.steps {
            let values = match act.how {
                Some(ease) => {
                    let far = ease.at(step as f64 / act.steps as f64);
                    [0, 1, 2]
                        .map(|axis| (f64::from(from[axis]) + f64::from(to[axis] - from[axis]) * far).round() as i32)
                }
                None => act.lane.values([random(), random(), random()]),
            };
            now += act.step;
            let at = now + (random() * act.jitter as f64) as u64;
            frames.push((at, act.lane, values));
            last.push((act.lane, values));
        }
        now = before.max(now + act.pause + 1_000);
    }
    frames.sort_by_key(|(at, ..)| *at);
    frames
}

/// The values that a command sends to a lane.
fn given(command: &Command, lane: Lane) -> Option<[i32; 3]> {
    let values = command.values();
    match (command.said().split(' ').next()?, lane) {
        ("servo", Lane::Servo(of)) if values[0] == of => Some([values[1], 0, 0]),
        ("servos", Lane::Servo(index @ (1 | 2))) => Some([values[usize::try_from(index).ok()? - 1], 0, 0]),
        ("rocker" | "stop", Lane::Rocker) => Some([values[0], values[1], values[2]]),
        _ => None,
    }
}

/// Microseconds between two samples of a move.
const SAMPLE: u64 = 20_000;
/// A frame waits for others on the line, and a time is rounded: up to a millisecond each.
const SLACK: u64 = 2_000;

/// The minimum and maximum of each value between two times.
fn held(values: &[(u64, [i32; 3])], from: u64, to: u64) -> Option<([i32; 3], [i32; 3])> {
    let first = values.partition_point(|(at, _)| *at <= from).saturating_sub(1);
    let end = values.partition_point(|(at, _)| *at <= to);
    let all = values.get(first..end)?.iter().map(|(_, values)| *values);
    let both = |one: [i32; 3], two: [i32; 3], of: fn(i32, i32) -> i32| [0, 1, 2].map(|axis| of(one[axis], two[axis]));
    all.map(|values| (values, values)).reduce(|one, two| (both(one.0, two.0, i32::min), both(one.1, two.1, i32::max)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 120 } else { 3_000 }))]

    #[test]
    fn a_folded_recording_differs_by_at_most_the_tolerance(acts in prop::collection::vec(act(), 1..8)) {
        let program = program(&acts);
        let frames: Vec<_> =
            program.iter().map(|(at, lane, values)| (*at, lane.command(*values).to_frame())).collect();
        let text = recorded(false, &frames);
        let folded = compiled(&text);
        let received = on_the_line(&frames);
        let begin_us = received[0].0;
        let end = received.last().unwrap().0 - begin_us;
        // Every command that is not part of a move is a frame of the program, in the same order.
        let mut rest = received.iter();
        for event in folded.events.iter().filter(|event| event.kind == Kind::Command && event.at.0 <= end) {
            let frame = event.command.to_frame();
            let found = rest.find(|(at, sent)| *sent == frame && (at - begin_us).abs_diff(event.at.0) <= 4_000);
            prop_assert!(found.is_some(), "{} at {} was not sent\n{text}", event.command.said(), event.at);
        }
        for lane in [Lane::Servo(1), Lane::Servo(2), Lane::Servo(3), Lane::Rocker] {
            let tolerance = if lane == Lane::Rocker { DRIVE_TOLERANCE } else { SERVO_TOLERANCE };
            let sent = program.iter().zip(&received).filter_map(|((_, of, values), (at, _))| {
                Some((at - begin_us, given(&of.command(*values), lane)?))
            });
            let sent: Vec<(u64, [i32; 3])> = sent.collect();
            let events = folded.events.iter().filter(|event| event.kind != Kind::Refresh);
            let again: Vec<_> = events.filter_map(|event| Some((event.at.0, given(&event.command, lane)?))).collect();
            let Some((first, _)) = sent.first().copied() else {
                prop_assert!(again.is_empty(), "{lane:?} was never given anything\n{text}");
                continue;
            };
            for at in (first..=end).step_by(1_000) {
                let [here, there] = [&sent, &again].map(|values| held(values, at, at));
                let [soon_here, soon_there] = [&sent, &again].map(|values| held(values, at.saturating_sub(SLACK), at + SAMPLE + SLACK));
                let is_near = [(here, soon_there), (there, soon_here)].into_iter().any(|(one, other)| {
                    one.zip(other).is_some_and(|((one, _), (least, most))| {
                        (0..3).all(|axis| (least[axis] - tolerance..=most[axis] + tolerance).contains(&one[axis]))
                    })
                });
                prop_assert!(is_near, "{lane:?} at {at} us was {soon_here:?} and is {soon_there:?}\n{text}");
            }
        }
    }
}

/// A recording in progress, and its file.
fn recording(name: &str, more: &[&str]) -> (Host, PathBuf) {
    let path = link(&format!("{name}.motion"));
    let host = Host::start_at("record", link(name), &[&["-o", path.to_str().unwrap()], more].concat());
    (host, path)
}

/// The content of a completed recording.
fn text_of(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    fs::remove_file(path).unwrap();
    text
}

/// The commands of a script, without their times.
fn commands(text: &str) -> Vec<&str> {
    let lines = text.lines().map(|line| line.split("  #").next().unwrap_or(line).trim());
    let lines = lines.map(|line| if line.starts_with('+') { line.split_once(' ').unwrap().1 } else { line });
    let is_other = |line: &&str| {
        let first = line.split(' ').next().unwrap_or_default();
        matches!(first, "" | "#" | "wait" | "mark" | "together" | "{" | "}" | "limit" | "refresh")
    };
    lines.flat_map(|line| line.split("; ")).filter(|line| !is_other(line)).collect()
}

#[test]
fn an_owners_program_is_recorded_and_its_script_sends_the_same() {
    if !has("serial") {
        return;
    }
    let (mut host, path) = recording("exactly", &["--exact", "--format", "listing"]);
    let client = Client::new("python3").arg("tests/clients/owner.py").arg(&host.path).output().unwrap();
    assert!(client.status.success(), "{}", String::from_utf8_lossy(&client.stderr));
    host.says("the port is closed");
    let (listing, said) = host.end();
    let wrote: Vec<String> = String::from_utf8(client.stdout).unwrap().lines().map(str::to_owned).collect();
    assert_eq!(frames(&listing), wrote);
    assert!(said.contains(&format!("recorded {} frames as {0} lines", wrote.len())), "{said}");
    let text = text_of(&path);
    let again = compiled(&text);
    let sent: Vec<String> = again.events.iter().map(|event| hex(&event.command.to_frame())).collect();
    assert_eq!(sent, wrote);
    // Each at its time.
    let times = listing.lines().map(|line| line.split('\t').next().unwrap().parse::<f64>().unwrap());
    let times: Vec<f64> = times.collect();
    for (event, time) in again.events.iter().zip(&times) {
        let received_us = (time - times[0]) * 1e6;
        assert!((event.at.0 as f64 - received_us).abs() < 2.0, "{} {received_us}", event.at);
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

#[test]
fn a_folded_recording_of_an_owners_program_is_short() {
    if !has("serial") {
        return;
    }
    let (mut host, path) = recording("folded", &[]);
    let client = Client::new("python3").arg("tests/clients/owner.py").arg(&host.path).output().unwrap();
    assert!(client.status.success());
    host.says("the port is closed");
    host.end();
    let text = text_of(&path);
    let found = commands(&text);
    // A thousand wheel frames are one hold, and twenty successive servo frames are one move or
    // some.
    let wheels: Vec<_> = found.iter().filter(|command| command.starts_with("wheels")).collect();
    assert!(wheels.len() == 1 && wheels[0].starts_with("wheels 8 -8 8 -8 for 1."), "{text}");
    assert!(found.contains(&"request report-start") && found.contains(&"request report-stop"), "{text}");
    assert!(found.iter().any(|command| command.starts_with("buzzer on for ")), "{text}");
    assert!(found.len() < 40, "{text}");
    compiled(&text);
}

#[test]
fn a_kill_leaves_a_script_of_the_earlier_frames() {
    let (mut host, path) = recording("killed", &[]);
    let mut port = host.open();
    for x in 1..20 {
        port.write_all(&rocker(x)).unwrap();
    }
    // It is written while it continues.
    while !fs::read_to_string(&path).unwrap_or_default().contains("x=19") {}
    host.signal(Signal::KILL);
    host.child.wait().unwrap();
    let text = text_of(&path);
    assert!(text.contains("x=1 ") && compiled(&text).events.len() >= 19, "{text}");
    let _ = fs::remove_file(&host.path);
}

#[test]
fn bytes_pass_between_a_program_and_its_board_unchanged() {
    let mut board = Host::start("far", &["--battery", "11.5V"]);
    let (mut tap, path) = recording("near", &["--port", board.path.to_str().unwrap()]);
    let mut port = tap.open();
    let noise: Vec<u8> = (0..=255).collect();
    let request = say("request", &[5]).to_frame();
    for part in [&rocker(5)[..7], &rocker(5)[7..], &noise, &stop(), &request] {
        port.write_all(part).unwrap();
    }
    let mut reply = [0; 14];
    port.read_exact(&mut reply).unwrap();
    assert_eq!(&reply, b"{A0:0:0:1150}#");
    port.write_all(&rocker(7)).unwrap();
    drop(port);
    tap.says("has not stopped the robot");
    // Its answer shows that the board has read what came before.
    let mut port = tap.open();
    port.write_all(&request).unwrap();
    port.read_exact(&mut reply).unwrap();
    drop(port);
    // Nothing else can stop the robot then.
    let (_, said) = tap.end();
    assert!(said.contains("stop: sent"), "{said}");
    board.says("the port is closed");
    let (listing, _) = board.end();
    let found: Vec<&str> =
        listing.lines().filter_map(|line| line.split('\t').nth(2)).filter(|c| !c.is_empty()).collect();
    let expected = [
        "rocker x=5 y=0 z=0",
        "stop",
        "request voltage",
        "rocker x=7 y=0 z=0",
        "request voltage",
        "stop",
        "stop",
        "stop",
        "buzzer off",
    ];
    assert_eq!(found, expected, "{listing}");
    let skipped = listing.lines().find(|line| line.contains("skipped")).unwrap();
    assert!(skipped.contains("00 01 02 03") && skipped.contains("skipped 256"), "{listing}");
    let text = text_of(&path);
    assert!(text.contains("skipped") && text.contains("request voltage"), "{text}");
}

#[test]
fn the_loss_of_a_taps_board_is_reported() {
    let board = Host::start("gone", &[]);
    let (mut tap, path) = recording("told", &["--port", board.path.to_str().unwrap()]);
    let mut port = tap.open();
    port.write_all(&[stop(), say("request", &[8]).to_frame()].concat()).unwrap();
    port.read_exact(&mut [0; 14]).unwrap();
    board.end();
    tap.says("the port was lost");
    assert_eq!(tap.child.wait().unwrap().code(), Some(3));
    assert!(text_of(&path).contains("stop"));
    drop(port);
}

#[test]
fn a_recording_never_overwrites_a_file() {
    let path = link("there.motion");
    fs::write(&path, "stop\n").unwrap();
    let board = link("over");
    let output = run(&["record", "--link", board.to_str().unwrap(), "-o", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("it exists"), "{}", stderr(&output));
    assert_eq!(text_of(&path), "stop\n");
    // If nothing is recorded, no file is left.
    let output = run(&["record", "--link", board.to_str().unwrap(), "-o", path.to_str().unwrap(), "--port", "/dev/no"]);
    assert_eq!((output.status.code(), path.exists()), (Some(3), false), "{}", stderr(&output));
}

/// Commands at times in microseconds, folded.
fn folded(sent: &[(u64, Command)]) -> String {
    recorded(false, &sent.iter().map(|(at, command)| (*at, command.to_frame())).collect::<Vec<_>>())
}

#[test]
fn a_silence_of_the_program_is_not_a_stop() {
    let drive = || Lane::Rocker.command([5, 0, 0]);
    let halt = || say("stop", &[]);
    // Refreshed, but late once.
    let sent = [0, 100_000, 605_000, 700_000].map(|at| (at, drive())).into_iter().chain([(800_000, halt())]);
    let text = folded(&sent.collect::<Vec<_>>());
    assert_eq!(
        lines(&text),
        [
            "rocker x=5 for 0.8s",
            "# no drive frame for 0.505s before this line: what the board does then is unknown; this script keeps driving",
        ],
        "{text}"
    );
    // Sent once, as many programs do; the silence is mentioned once.
    let text = folded(&[(0, drive()), (1_200_000, halt()), (2_000_000, drive()), (3_250_000, halt())]);
    assert_eq!(
        lines(&text),
        [
            "rocker x=5 for 1.2s",
            "# no drive frame for 1.2s before this line: what the board does then is unknown; this script keeps driving",
            "wait 0.8s",
            "rocker x=5 for 1.25s",
        ],
        "{text}"
    );
    // To the end of the recording, past another command.
    let text = folded(&[(0, drive()), (3_000_000, Lane::Servo(1).command([1500, 0, 0])), (3_400_000, drive())]);
    assert_eq!(
        lines(&text),
        [
            "rocker x=5",
            "wait 3s",
            "mark part_2",
            "servo 1 1500",
            "wait 402ms",
            "# no drive frame for 3.4s before this line: what the board does then is unknown; this script keeps driving",
            "stop  # the recording ends here",
        ],
        "{text}"
    );
}

#[test]
fn a_drive_is_stopped_after_its_program_has_closed_the_port() {
    let drive = |writer: &mut ScriptWriter, at_ms: u64| {
        let mut decoder = TimedDecoder::new(board(), BAUD);
        decoder.feed(Micros::from_millis(at_ms).nanos(), &rocker(5), |at, item| writer.take(at, item));
    };
    let mut writer = ScriptWriter::new(Arc::clone(board()), false, BAUD);
    drive(&mut writer, 0);
    writer.closed(Micros::from_millis(900));
    writer.reopened(Micros::from_millis(5_000));
    drive(&mut writer, 6_000);
    // Programs that follow each other at once continue a hold.
    writer.closed(Micros::from_millis(6_200));
    writer.reopened(Micros::from_millis(6_300));
    drive(&mut writer, 6_400);
    writer.closed(Micros::from_millis(6_500));
    writer.finish(Micros::from_millis(6_600));
    let text = writer.settled();
    assert_eq!(
        lines(&text),
        [
            "rocker x=5 for 1.4s  # the program has closed its port",
            "wait 4.6s",
            "mark part_2",
            "# 5s: a program opened the port again",
            "rocker x=5 for 0.6s  # the recording ends here",
            "# 6.3s: a program opened the port again",
        ],
        "{text}"
    );
    compiled(&text);
}

#[test]
fn harmful_frames_are_left_out_and_noted() {
    let mut writer = ScriptWriter::new(Arc::clone(board()), false, BAUD);
    let mut decoder = TimedDecoder::new(board(), BAUD);
    let tilt = [0xFF, 0xFE, 2, 4, 0x05, 0xDC, 0x09, 0xC4, 0xB4];
    let unknown = [0xFF, 0xFE, 0x40, 1, 5, 0x46];
    let moves = say("move", &[5, 0, 0]);
    for part in [&tilt[..], &[1, 2, 3], &unknown, &moves.to_frame(), &stop()] {
        decoder.feed(Nanos::ZERO, part, |at, item| writer.take(at, item));
    }
    writer.finish(Micros::SECOND);
    let text = writer.settled();
    assert_eq!(
        lines(&text),
        [
            "# 0s: left out, FF FE 02 04 05 DC 09 C4 B4: 2500 is out of range (500 to 1950)",
            "# 0.001s: skipped 3, 01 02 03: no frame starts here",
            "+1ms raw 0x40 0x05; raw 0x03 0x04 0x00 0x05 0x00 0x00 0x00 0x00 0x01  # no command has this function and length; move x=5 y=0 z=0, with no `pid position` before it",
            "+2ms stop",
        ],
        "{text}"
    );
    compiled(&text);
}

#[test]
fn a_yaw_hold_at_zero_is_recorded_as_a_hold() {
    let zero = say("yawhold", &[0, 0]);
    // A stop, then the maker's "stabilize" for a second, a stop, and again until the recording
    // ends.
    let mut sent = vec![(0, say("stop", &[]))];
    sent.extend((1..=100).map(|time| (time * 10_000, zero.clone())));
    sent.push((1_010_000, say("stop", &[])));
    sent.extend((0..10).map(|time| (3_000_000 + time * 100_000, zero.clone())));
    let text = folded(&sent);
    assert_eq!(
        lines(&text),
        [
            "stop",
            "+10ms yawhold x=0 y=0 for 1s",
            "wait 1.99s",
            "mark part_2",
            "yawhold x=0 y=0 for 902ms  # the recording ends here",
        ],
        "{text}"
    );
    compiled(&text);
}

#[test]
fn a_move_after_wheels_at_zero_says_where_it_starts() {
    let zero = say("wheels", &[0; 4]);
    let ramp = (0..=50).map(|step| (step as u64 * 20_000, Lane::Rocker.command([step * 2 / 5, 0, 0])));
    let text = folded(&[(0, zero)].into_iter().chain(ramp.map(|(at, to)| (at + 10_000, to))).collect::<Vec<_>>());
    assert!(text.contains("rocker x=0 -> 20") || text.contains("stop\n"), "{text}");
    compiled(&text);
}

#[test]
fn a_recording_widens_the_limit_of_the_tilt_only_where_it_must() {
    let tilt = |at, pulse| (at, Lane::Servo(2).command([pulse, 0, 0]));
    for exact in [false, true] {
        // The first is in range, and was written long before the second comes.
        let sent = [tilt(0, 1_950), tilt(5_000_000, 1_951), tilt(9_000_000, 1_500)];
        let frames: Vec<_> = sent.iter().map(|(at, command)| (*at, command.to_frame())).collect();
        let wide = recorded(exact, &frames);
        assert_eq!(wide.lines().nth(1), Some("limit servo 2 500..2500"), "{wide}");
        compiled(&wide);
        let narrow = recorded(exact, &frames[..1]);
        assert!(!narrow.contains("limit"), "{narrow}");
        compiled(&narrow);
        let script = decoded_script(&frames, exact);
        assert_eq!(script.lines().nth(1), Some("limit servo 2 500..2500"), "{script}");
        compiled(&script);
    }
    // An easing that would exceed the limit is not used.
    let ease = Ease::named("out-back").unwrap();
    let way = |step: u64| 1_500.0 + 430.0 * ease.at(step as f64 / 50.0);
    let sent: Vec<_> = (0..=50).map(|step| tilt(step * 20_000, (way(step).round() as i32).min(1_950))).collect();
    let text = folded(&sent);
    assert!(!text.contains("limit"), "{text}");
    compiled(&text);
}

#[test]
fn a_recording_under_way_gets_the_limit_that_it_needs() {
    let (mut host, path) = recording("tilt", &[]);
    let mut port = host.open();
    let servo = |index, pulse| Lane::Servo(index).command([pulse, 0, 0]).to_frame();
    port.write_all(&servo(1, 1_500)).unwrap();
    // The first lines are written before the first command of the tilt servo.
    while !fs::read_to_string(&path).unwrap_or_default().contains("servo 1 1500") {}
    port.write_all(&servo(2, 2_000)).unwrap();
    drop(port);
    host.says("the port is closed");
    host.end();
    let text = text_of(&path);
    assert_eq!(text.lines().nth(1), Some("limit servo 2 500..2500"), "{text}");
    assert_eq!(commands(&text), ["servo 1 1500", "servo 2 2000"]);
    compiled(&text);
}

/// A value at a time in microseconds.
fn servo(at: u64, pulse: i32) -> (u64, Command) {
    (at, Lane::Servo(1).command([pulse, 0, 0]))
}

#[test]
fn a_recording_does_not_move_during_a_pause_of_the_program() {
    // After a constant value, the first value of a ramp is a jump.
    let ramp =
        |begin_us: u64, from: i32| (0..=20).map(move |step| servo(begin_us + step * 20_000, from + step as i32 * 5));
    let jump: Vec<_> = [servo(0, 1_500)].into_iter().chain(ramp(2_000_000, 1_900)).collect();
    let repeated = (0..100).map(|step| servo(step * 20_000, 1_500)).chain(ramp(2_000_000, 1_900)).collect();
    for sent in [jump, repeated] {
        let text = folded(&sent);
        assert_eq!(
            lines(&text),
            ["servo 1 1500", "wait 2s", "mark part_2", "servo 1 1900 -> 2000 over 0.4s"],
            "{text}"
        );
    }
    // A curve pauses for 90 ms in its middle.
    let pause = |step: u64| step * 20_000 + if step > 10 { 70_000 } else { 0 };
    let sent: Vec<_> = (0..=20).map(|step| servo(pause(step), 1_000 + step as i32 * 40)).collect();
    let again = compiled(&folded(&sent));
    let events: Vec<_> =
        again.events.iter().filter_map(|event| Some((event.at.0, given(&event.command, Lane::Servo(1))?))).collect();
    let (least, most) = held(&events, 200_000, 260_000).unwrap();
    assert!(1_395 <= least[0] && most[0] <= 1_405, "{events:?}");
}

#[test]
fn a_long_recording_of_any_shape_is_folded_in_time_that_grows_with_it() {
    // Tens of thousands of frames at the speed of the line, in which moves are searched in blocks
    // of thousands.
    let mut random = 7_u32;
    let mut random = move |most: u32| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        i32::try_from((random >> 8) % most).unwrap()
    };
    let shapes: [&mut dyn FnMut(i32) -> i32; 5] = [
        &mut |step| 1_500 + step % 2,
        &mut |step| 1_500 + step % 2 + if step % 1_000 == 999 { 100 } else { 0 },
        &mut |step| 1_000 + step / 40,
        &mut |_| 1_500 + random(14),
        &mut |step| 1_000 + step * 37 % 900,
    ];
    for shape in shapes {
        let sent: Vec<_> = (0..20_000).map(|step| servo(u64::try_from(step).unwrap() * 800, shape(step))).collect();
        let frames: Vec<_> = sent.iter().map(|(at, command)| (*at, command.to_frame())).collect();
        let mut writer = ScriptWriter::new(Arc::clone(board()), false, BAUD);
        let mut decoder = TimedDecoder::new(board(), BAUD);
        for (at, frame) in &frames {
            decoder.feed(Micros(*at).nanos(), frame, |at, item| writer.take(at, item));
        }
        writer.finish(Micros(20_000 * 800));
        assert!(writer.settled().lines().count() <= 20_002);
    }
}

/// A capture as a script, and the totals.
fn script_of(capture: &[u8], exact: bool, baud: Option<u32>) -> (String, Decoded) {
    let mut out = Vec::new();
    let decoded = to_script(capture, Reading::default().with_baud(baud), exact, &mut out).unwrap();
    (String::from_utf8(out).unwrap(), decoded)
}

#[test]
fn a_timed_listing_becomes_a_script_with_its_times_at_any_speed_of_the_line() {
    for (baud, gap) in [(9_600, 20_000), (115_200, 2_000), (1_000_000, 200)] {
        let lines = (0..200).map(|line| format!("at {}us servo {} {}\n", (line + 1) * gap, line % 4 + 1, 1_000 + line));
        let script = compiled(
            &(format!("baud {baud}\nservos 1500 1500\nbuzzer on\nrequest voltage\n") + &lines.collect::<String>()),
        );
        let (mut listing, mut snapshot) = (Vec::new(), Vec::new());
        write_listing(&script, script.items(), &mut listing).unwrap();
        write_snapshot("x.motion", std::slice::from_ref(&script), &mut snapshot).unwrap();
        for (capture, given) in [(&listing, Some(baud)), (&snapshot, None)] {
            let (text, _) = script_of(capture, true, given);
            let again = compiled(&text);
            assert_eq!((again.baud, sent(&again)), (baud, sent(&script)), "{text}");
            compiled(&script_of(capture, false, given).0);
        }
    }
    // One resource gets one value at a time.
    let coarse =
        "0.0\tFF FE 02 03 01 05 DC E7\n0.0\tFF FE 02 03 01 05 DD E8\n0.0\tFF FE 04 01 01 06\n0.0\tFF FE 04 01 00 05\n";
    let (text, _) = script_of(coarse.as_bytes(), false, None);
    assert_eq!(sent(&compiled(&text)).into_iter().map(|(at, _)| at).collect::<Vec<_>>(), [0, 1, 1, 2], "{text}");
}

#[test]
fn the_on_abort_part_of_a_snapshot_is_not_part_of_a_script() {
    let script = compiled("servo 1 1500\nwait 1s\nservo 1 1600\non abort { servo 1 1000; buzzer on for 100ms }");
    assert_eq!(script.abort.len(), 3);
    let mut snapshot = Vec::new();
    write_snapshot("x.motion", std::slice::from_ref(&script), &mut snapshot).unwrap();
    for exact in [false, true] {
        let (text, decoded) = script_of(&snapshot, exact, None);
        assert_eq!((sent(&compiled(&text)), decoded.frames, decoded.aborts), (sent(&script), 2, 3), "{text}");
    }
    let mut listing = Vec::new();
    let decoded = decode(&snapshot[..], Reading::default(), &mut listing).unwrap();
    assert_eq!((decoded.frames, decoded.aborts), (2, 3));
}

#[test]
fn noise_is_a_script_of_one_comment_that_sends_nothing() {
    let mut random = 1_u64;
    let noise = std::iter::repeat_with(|| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 56) as u8
    });
    let noise: Vec<u8> = noise.take(100_000).collect();
    for exact in [false, true] {
        let (text, decoded) = script_of(&noise, exact, None);
        assert_eq!((decoded.frames, decoded.skipped), (0, 100_000));
        assert_eq!(text.lines().filter(|line| line.contains("skipped 100000, ")).count(), 1, "{text}");
        assert!(text.len() < 500 && compiled(&text).events.is_empty(), "{text}");
    }
    let path = link("noise.motion");
    fs::write(&path, script_of(&noise, false, None).0).unwrap();
    for (command, says) in [("check", "ok, sends nothing"), ("play", "the script sends nothing"), ("render", "")] {
        let output = run(&[command, path.to_str().unwrap()]);
        let said = stderr(&output);
        assert!(output.status.success() && output.stdout.is_empty() && said.contains(says), "{command}: {said}");
    }
    fs::remove_file(&path).unwrap();
}

#[test]
fn frames_without_times_are_sent_at_an_interval_on_request() {
    let frames: Vec<u8> = (0..4).flat_map(|step| servo(0, 1_000 + step * 200).1.to_frame()).collect();
    let reading = || Reading::default().with_every(Some(Micros::from_millis(20)));
    let mut out = Vec::new();
    to_script(&frames[..], reading(), false, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert_eq!(
        lines(&text),
        ["servo 1 1000", "+20ms servo 1 1200", "+20ms servo 1 1400", "+20ms servo 1 1600"],
        "{text}"
    );
    // The times of a listing are not replaced.
    let mut out = Vec::new();
    let listing = "0.5\tFF FE 04 01 01 06\n0.9\tFF FE 04 01 00 05\n";
    assert!(to_script(listing.as_bytes(), reading(), false, &mut out).unwrap().is_timed);
    assert_eq!(lines(&String::from_utf8(out).unwrap()), ["buzzer on for 0.4s"]);
}

#[test]
fn the_listing_of_a_script_becomes_its_moves_again() {
    let moves = [
        "servo 1 1400 over 2s ease out-sine",
        "servo 1 1700 over 0.7s",
        "servo 1 1020 over 1s ease in-out-back",
        "servo 1 1760 over 0.5s ease out-quart",
        "servo 1 1297 over 510ms ease in-expo",
    ];
    let script = format!("servo 1 1500\nwait 0.5s\n{}\nrocker y=10 for 2s", moves.join("\n"));
    let timeline = compiled(&script);
    let mut listing = Vec::new();
    write_listing(&timeline, timeline.items(), &mut listing).unwrap();
    let (text, _) = script_of(&listing, false, None);
    let expected: Vec<&str> =
        ["servo 1 1500", "wait 0.5s"].into_iter().chain(moves).chain(["rocker y=10 for 2s"]).collect();
    assert_eq!(lines(&text), expected, "{text}");
    assert_eq!(sent(&compiled(&text)), sent(&timeline));
}

#[test]
fn a_part_can_be_edited_in_one_line() {
    let drive = |at_ms: u64, z: i32| (at_ms * 1_000, Lane::Rocker.command([0, 0, z]));
    // A turn, a pause, a servo that moves during a second turn.
    let mut all = vec![drive(0, 50), drive(2_000, 0), drive(4_000, 50), drive(6_000, 0)];
    all.extend((0..=50).map(|step| servo(4_500_000 + step * 20_000, 1_000 + step as i32 * 10)));
    all.sort_by_key(|(at, _)| *at);
    let text = folded(&all);
    let end = |text: &str| compiled(text).end;
    assert!(text.contains("\nrocker z=50 for 2s\n") && text.contains("\nwait 2s\n\nmark part_2\n"), "{text}");
    let longer = [("rocker z=50 for 2s", "rocker z=50 for 3s"), ("wait 2s", "wait 3s")];
    for (old, new) in longer {
        assert_eq!(end(&text.replacen(old, new, 1)), end(&text) + Micros::SECOND, "{text}");
    }
}
