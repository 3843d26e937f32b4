//! `record`, and `decode` into a script: what a program sent, as a script that sends it again.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod support;

use std::fs;
use std::path::Path;

use motionseq::board::{Command, DEFAULT_BAUD, PulseWidth, ServoIndex, Speed, TiltPulseWidth, TurnRate};
use motionseq::capture::{DRIVE_TOLERANCE, SERVO_TOLERANCE, Scribe, TimedDecoder};
use motionseq::program::{Ease, Options};
use motionseq::source::{Source, Sources};
use motionseq::timeline::{Event, Kind, Timeline};
use proptest::prelude::*;
use support::messages;

/// A script, compiled; errors are shown.
fn compiled(text: &str) -> Timeline {
    let sources = Sources::from(Source::new("test.motion", text));
    let compiled = motionseq::compile(&sources, &Options { events: 10_000_000, ..Options::default() });
    compiled.timeline.unwrap_or_else(|| panic!("{}\n{text}", messages(&sources, &compiled.diagnostics)))
}

/// Frames at times in microseconds, as a recording; settled every 400 ms, as `record` does it.
fn recorded(exact: bool, frames: &[(u64, Vec<u8>)]) -> String {
    let mut scribe = Scribe::new(exact, DEFAULT_BAUD);
    let mut decoder = TimedDecoder::new(DEFAULT_BAUD);
    let (mut text, mut settled_us, mut last_us) = (String::new(), 0, 0);
    for (at_us, frame) in frames {
        while settled_us + 400_000 < *at_us {
            settled_us += 400_000;
            scribe.settle(settled_us);
            text += &scribe.settled();
            if scribe.frames() > 0 {
                // At any time, the script could end here.
                compiled(&(text.clone() + &scribe.tail()));
            }
        }
        decoder.feed(at_us * 1_000, frame, |at_us, item| scribe.take(at_us, item));
        last_us = *at_us;
    }
    scribe.finish(last_us + 2_000);
    text + &scribe.settled()
}

fn sent(timeline: &Timeline) -> Vec<(u64, Vec<u8>)> {
    timeline.events().iter().map(|event| (event.at_us, event.command.to_frame())).collect()
}

/// When each frame begins on the line, and what it is.
fn on_the_line(frames: &[(u64, Vec<u8>)]) -> Vec<(u64, Vec<u8>)> {
    let mut free = 0.0_f64;
    let begin = |(at_us, frame): &(u64, Vec<u8>)| {
        let begin = free.max(*at_us as f64);
        free = begin + frame.len() as f64 * 1e7 / f64::from(DEFAULT_BAUD);
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
        .collect();
    scripts.push(("raw".into(), "raw 0x40 1 2 3\nraw 2 4 9 9\nwait 1s\nbuzzer on\n+0.2s servo 1 1500".into()));
    scripts.push(("move".into(), "pid position speed=1,2 position=1,2,3 yaw=1,2,3\nmove x=5\nwait 1s\nstop".into()));
    assert!(scripts.len() > 8);
    for (name, text) in scripts {
        let sources = if Path::new(&name).exists() {
            Sources::from(Source::read(Path::new(&name)).unwrap())
        } else {
            Sources::from(Source::new("test.motion", text.as_str()))
        };
        let timeline = motionseq::compile(&sources, &Options::default()).timeline.unwrap();
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
    let lines: Vec<&str> = text.lines().skip(1).collect();
    // Times are those of the line; what was said at one time stands behind each other there.
    assert_eq!(
        lines,
        [
            "at 0s servos 1500 1500",
            "at 0s servo 1 2000 over 1s ease in-out-sine",
            "at 1s servo 1 1200 over 0.7s ease out-quad",
            "at 2.2s stop",
            "at 2.2s rocker x=20 y=-10 z=180 over 2s ease in-quad",
            "at 2.200694s servos 1500 1500 over 1.001128s",
            "at 2.201128s servo 3 1000 -> 2000 over 1s ease out-bounce",
            "at 4.201128s rocker x=5 y=5 z=0",
            "at 5.2s stop",
        ],
        "{text}"
    );
}

/// A thing and its values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lane {
    Servo(i32),
    Servos,
    Rocker,
}

impl Lane {
    fn command(self, [a, b, c]: [i32; 3]) -> Command {
        let pulse = |pulse| PulseWidth::new(pulse).unwrap();
        match self {
            Lane::Servo(index) => Command::Servo { index: ServoIndex::new(index).unwrap(), pulse: pulse(a) },
            Lane::Servos => Command::Servos { pan: pulse(a), tilt: TiltPulseWidth::new(b).unwrap() },
            Lane::Rocker => {
                Command::Rocker { x: Speed::new(a).unwrap(), y: Speed::new(b).unwrap(), z: TurnRate::new(c).unwrap() }
            }
        }
    }

    /// Values inside what it takes, of three numbers from 0 to 1; room is left for easings that overshoot.
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

/// What a program does for a while.
#[derive(Clone, Debug)]
struct Act {
    lane: Lane,
    to: [f64; 3],
    /// How it gets there: by an easing, at once, or at random.
    how: Option<Ease>,
    steps: u64,
    step_us: u64,
    jitter_us: u64,
    pause_us: u64,
    seed: u64,
}

fn act() -> impl Strategy<Value = Act> {
    let lane = prop_oneof![(1..=3).prop_map(Lane::Servo), Just(Lane::Servos), Just(Lane::Rocker)];
    let ease = prop::sample::select(Ease::names()).prop_map(|name| Ease::named(&name));
    let how = prop_oneof![3 => ease, 1 => Just(None)];
    let step = prop::sample::select(vec![2_000_u64, 5_000, 10_000, 20_000, 33_000, 90_000]);
    let pause = prop_oneof![Just(0), Just(3_000), 10_000..400_000_u64, 600_000..900_000_u64];
    let to = [0.0..1.0, 0.0..1.0, 0.0..1.0];
    (lane, to, how, 1..60_u64, step, 0..800_u64, pause, any::<u64>()).prop_map(
        |(lane, to, how, steps, step_us, jitter_us, pause_us, seed)| Act {
            lane,
            to,
            how,
            steps,
            step_us,
            jitter_us,
            pause_us,
            seed,
        },
    )
}

/// The frames of a program that does all this, one act after another, with the values that it sent.
fn program(acts: &[Act]) -> Vec<(u64, Lane, [i32; 3])> {
    let (mut frames, mut now) = (Vec::new(), 0);
    let mut last: Vec<(Lane, [i32; 3])> = Vec::new();
    for act in acts {
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
            now += act.step_us;
            let at_us = now + (random() * act.jitter_us as f64) as u64;
            frames.push((at_us, act.lane, values));
            last.push((act.lane, values));
        }
        now += act.pause_us + 1_000;
    }
    frames
}

/// What an event gives a lane.
fn given(event: &Event, lane: Lane) -> Option<[i32; 3]> {
    match (&event.command, lane) {
        (Command::Servo { index, pulse }, Lane::Servo(of)) if index.get() == of => Some([pulse.get(), 0, 0]),
        (Command::Servos { pan, .. }, Lane::Servo(1)) => Some([pan.get(), 0, 0]),
        (Command::Servos { tilt, .. }, Lane::Servo(2)) => Some([tilt.get(), 0, 0]),
        (Command::Rocker { x, y, z }, Lane::Rocker) => Some([x.get(), y.get(), z.get()]),
        _ => None,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 120 } else { 3_000 }))]

    #[test]
    fn a_folded_recording_differs_by_at_most_the_tolerance(acts in prop::collection::vec(act(), 1..8)) {
        let program = program(&acts);
        let frames: Vec<_> =
            program.iter().map(|(at_us, lane, values)| (*at_us, lane.command(*values).to_frame())).collect();
        let text = recorded(false, &frames);
        let folded = compiled(&text);
        let received = on_the_line(&frames);
        let begin_us = received[0].0;
        for (index, (_, lane, values)) in program.iter().enumerate() {
            // Both servos in one frame are two things here.
            let parts = match lane {
                Lane::Servos => vec![(Lane::Servo(1), [values[0], 0, 0]), (Lane::Servo(2), [values[1], 0, 0])],
                _ => vec![(*lane, *values)],
            };
            let at_us = received[index].0 - begin_us;
            for (lane, values) in parts {
                let tolerance = if lane == Lane::Rocker { DRIVE_TOLERANCE } else { SERVO_TOLERANCE };
                let events = folded.events().iter().filter(|event| event.kind != Kind::Refresh).filter_map(|event| Some((event, given(event, lane)?)));
                // All that holds within a millisecond, and where a move is on, what comes next.
                let (mut least, mut most) = ([i32::MAX; 3], [i32::MIN; 3]);
                let mut before = None;
                let mut take = |values: [i32; 3]| for axis in 0..3 {
                    least[axis] = least[axis].min(values[axis]);
                    most[axis] = most[axis].max(values[axis]);
                };
                for (event, values) in events {
                    if event.at_us + 1_000 <= at_us {
                        before = Some(values);
                    } else {
                        let moves = event.kind == Kind::Sample;
                        if event.at_us <= at_us + 1_000 || moves {
                            take(values);
                        }
                        if event.at_us > at_us + 1_000 {
                            break;
                        }
                    }
                }
                if let Some(before) = before {
                    take(before);
                }
                for axis in 0..3 {
                    prop_assert!(
                        (least[axis] - tolerance..=most[axis] + tolerance).contains(&values[axis]),
                        "{lane:?} was given {values:?} at {at_us}, and is between {least:?} and {most:?}\n{text}"
                    );
                }
            }
        }
    }
}
