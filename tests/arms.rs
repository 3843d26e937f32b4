//! Servos on a bus, played under a simulated clock on the virtual bus: the start, the stop, and torque.

use std::collections::VecDeque;
use std::fs;
use std::process::Command as Process;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use crate::support::host::Host;
use crate::support::script;
use crate::support::{stderr, stdout};
use motionseq::board::{Decoder, Item, ServoSet, State};
use motionseq::faults::{Faults, Faulty};
use motionseq::playback::{Cause, Input, Notice, Order, Outcome, Player, ServoFault, ServoFaultKind, Stop, Why};
use motionseq::program::Options;
use motionseq::sim::{Device, ServoSetup, Settings};
use motionseq::source::{Disk, Source, Sources};
use motionseq::timeline::{Clip, Position, Timeline, clip, write_bin};
use motionseq::units::{Micros, Nanos};
use rustix::process::{Pid, Signal, kill_process};

const MAX_LATE: Nanos = Nanos::from_millis(50);

fn timeline(text: &str) -> Timeline {
    let compiled = motionseq::compile(&Source::new("test", text).into(), &Options::default());
    compiled.timelines.into_iter().next().unwrap_or_else(|| panic!("{text}: {:?}", compiled.diagnostics))
}

fn shipped(path: &str) -> Timeline {
    let path = format!("{}/scripts/{path}", env!("CARGO_MANIFEST_DIR"));
    let sources = Sources::read(path.as_ref(), Disk).unwrap();
    motionseq::compile(&sources, &Options::default()).timeline().unwrap()
}

/// A virtual bus, and what was sent to it.
struct Bus {
    board: Faulty,
    now: Nanos,
    /// Each frame with its time.
    sent: Vec<(Nanos, Vec<u8>)>,
    notices: Vec<(Nanos, Notice)>,
    /// A servo that does not answer from a time on.
    mute: Option<(u8, Nanos)>,
    /// What happens, and when.
    inputs: VecDeque<(Nanos, Input)>,
    /// What the operator does each time a paused run waits.
    keys: VecDeque<Input>,
    /// A servo with error bits in the answer with its position.
    flags: Option<u8>,
    /// Whether each answer comes twice, the second time later.
    echo: bool,
    late: VecDeque<(Nanos, Vec<u8>)>,
    /// A time at which the computer stalls, and for how long.
    stall: Option<(Nanos, Nanos)>,
    /// When the port accepts nothing, from and until a time.
    blocked: Option<(Nanos, Nanos)>,
}

impl Bus {
    fn new(timeline: &Timeline, faults: &str, place: impl Fn(i32) -> u16) -> Self {
        let setup = |servo: i32| {
            let mut setup = ServoSetup::new(u8::try_from(servo).unwrap());
            setup.position = place(servo);
            setup
        };
        let mut settings = Settings::default();
        settings.servos = Some(timeline.servos().iter().map(setup).collect());
        let faults = if faults.is_empty() { Faults::default() } else { faults.parse().unwrap() };
        Bus::of(Faulty::new(Device::new(Arc::clone(&timeline.board), settings), faults))
    }

    fn of(board: Faulty) -> Self {
        Bus {
            board,
            now: Nanos::ZERO,
            sent: Vec::new(),
            notices: Vec::new(),
            mute: None,
            inputs: VecDeque::new(),
            keys: VecDeque::new(),
            blocked: None,
            stall: None,
            flags: None,
            echo: false,
            late: VecDeque::new(),
        }
    }

    /// Plays a timeline with an input at a time.
    fn ended_at(&mut self, timeline: &Timeline, at: Nanos, input: Input) -> Outcome {
        self.inputs.push_back((at, input));
        self.play(timeline)
    }

    fn play(&mut self, timeline: &Timeline) -> Outcome {
        let mut player = Player::new(timeline, MAX_LATE);
        let start = self.now;
        let mut input = Input::Tick;
        for _ in 0..200_000 {
            let (now, notices) = (self.now - start, &mut self.notices);
            let order = player.poll(now, input, &mut |notice| notices.push((now, notice)));
            if let Some(outcome) = player.outcome() {
                return outcome;
            }
            input = match order {
                Order::Write if self.blocked.is_some_and(|(from, until)| (from..until).contains(&now)) => {
                    match self.inputs.pop_front_if(|(at, _)| *at <= now) {
                        Some((_, input)) => input,
                        None => Input::Blocked,
                    }
                }
                Order::Write => {
                    let bytes = player.bytes().to_vec();
                    let mut decoder = Decoder::new(&timeline.board);
                    decoder.feed(&bytes, |item| match item {
                        Item::Frame(frame) => self.sent.push((now, frame.bytes().to_vec())),
                        other => panic!("{other:?}"),
                    });
                    self.board.receive(self.now.micros_up(), &bytes);
                    Input::Wrote(bytes.len())
                }
                Order::Wait { until, .. } => {
                    let next = self.board.next_due().map(Micros::nanos).filter(|next| *next > self.now);
                    let input_at = self.inputs.front().map_or(Nanos::MAX, |(at, _)| start + *at);
                    let opens = self.blocked.map_or(Nanos::MAX, |(_, until)| start + until);
                    let opens = if opens > self.now { opens } else { Nanos::MAX };
                    self.now = (start + until).min(next.unwrap_or(Nanos::MAX)).min(input_at).min(opens).max(self.now);
                    if let Some((_, takes)) = self.stall.take_if(|(at, _)| start + *at <= self.now) {
                        self.now += takes;
                    }
                    self.board.poll(self.now.micros());
                    let mut bytes = self.board.replies();
                    if self.mute.is_some_and(|(id, from)| self.now >= from && bytes.get(2) == Some(&id)) {
                        bytes.clear();
                    }
                    // The position of a servo is an answer of eight bytes.
                    if self.flags.is_some_and(|id| bytes.len() == 8 && bytes[2] == id) {
                        bytes[4] = 32;
                        bytes[7] = bytes[7].wrapping_sub(32);
                    }
                    if self.echo && !bytes.is_empty() {
                        self.late.push_back((self.now + ms(7), bytes.clone()));
                    }
                    while let Some((_, late)) = self.late.pop_front_if(|(at, _)| *at <= self.now) {
                        bytes.extend(late);
                    }
                    let (now, notices) = (self.now - start, &mut self.notices);
                    player.receive(now, &bytes, &mut |notice| notices.push((now, notice)));
                    self.inputs.pop_front_if(|(at, _)| *at <= now).map_or(Input::Tick, |(_, input)| input)
                }
                Order::Pause { until } => {
                    self.now = self.now.max(start + until);
                    Input::Tick
                }
                Order::Halt { .. } => Input::Tick,
                Order::Stay => self.keys.pop_front().expect("a key"),
                other => panic!("{other:?} is not expected"),
            };
        }
        panic!("the run does not end");
    }

    fn wait(&mut self, time: Nanos) {
        self.now += time;
        self.board.poll(self.now.micros());
    }

    /// Where a servo is, without asking the bus.
    fn position(&self, servo: i32) -> i32 {
        let board = Arc::clone(self.board.device().family());
        let mut copy = Faulty::new(self.board.device().clone(), Faults::default());
        let request = board.command(board.feedback.as_ref().unwrap().position, &[servo]).unwrap();
        copy.receive(self.now.micros(), &board.to_frame(&request));
        copy.poll(self.now.micros() + Micros::from_millis(5));
        // Another answer may come before it.
        let answer = copy.replies();
        let [.., low, high, _] = answer[..] else { panic!("no answer") };
        i32::from(u16::from_le_bytes([low, high]))
    }

    /// The commands that were sent, as scripts write them.
    fn said(&self, timeline: &Timeline) -> Vec<String> {
        let board = &timeline.board;
        self.sent.iter().map(|(_, frame)| board.show(&board.decode(frame).unwrap()).to_string()).collect()
    }

    /// The targets that a servo got, with their times.
    fn targets(&self, timeline: &Timeline, servo: i32) -> Vec<(Nanos, i32)> {
        let board = &timeline.board;
        let commands = self.sent.iter().map(|(at, frame)| (*at, board.decode(frame).unwrap()));
        let verb = board.feedback.as_ref().unwrap().verb;
        let mine = commands.filter(|(_, command)| command.verb() == verb && command.value(0) == Some(servo));
        mine.map(|(at, command)| (at, command.value(1).unwrap())).collect()
    }
}

fn ms(millis: u64) -> Nanos {
    Nanos::from_millis(millis)
}

#[test]
fn nothing_moves_before_every_servo_has_answered_and_holds_where_it_is() {
    let timeline = timeline("board sts\nsoft 1s\nspeed 2 1500\nservo 1 1000\nservo 2 3000\n");
    let mut bus = Bus::new(&timeline, "", |servo| if servo == 1 { 1_500 } else { 2_500 });
    let outcome = bus.play(&timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Finished, Stop::NotNeeded));
    let said = bus.said(&timeline);
    let start = [
        "\"get mode\" 1",
        "\"get settings\" 1",
        "\"get position\" 1",
        "\"get mode\" 2",
        "\"get settings\" 2",
        "\"get position\" 2",
        "servo 1 1500",
        "torque 1 on",
        "speed 2 1500",
        "servo 2 2500",
        "torque 2 on",
    ];
    assert_eq!(said[..start.len()], start);
    // The first frames by hand: `FF FF id 04 02 21 01 sum` asks for register 33.
    assert_eq!(bus.sent[0].1, [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x21, 0x01, 0xD6]);
    assert_eq!(bus.sent[2].1, [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x38, 0x02, 0xBE]);
    let kept: Vec<Notice> = bus.notices.iter().map(|(_, notice)| *notice).collect();
    assert!(kept.contains(&Notice::Kept { servo: 1, values: [Some(0), Some(0)] }));
    assert!(kept.contains(&Notice::Kept { servo: 2, values: [None, Some(0)] }), "the script sets one of them");
    let soft = kept.iter().find_map(|notice| match notice {
        Notice::SoftStart { servos, takes, is_longer } => Some((*servos, *takes, *is_longer)),
        _ => None,
    });
    assert_eq!(soft, Some((2, ms(1_000), false)));
    bus.wait(ms(2_000));
    assert_eq!((bus.position(1), bus.position(2)), (1_000, 3_000));
}

#[test]
fn what_the_port_got_without_the_unscripted_frames_is_what_render_prints() {
    let timeline = shipped("arm.motion");
    let mut bus = Bus::new(&timeline, "", |servo| 1_900 + u16::try_from(servo).unwrap() * 50);
    let outcome = bus.play(&timeline);
    assert_eq!((outcome.cause, outcome.sent, outcome.dropped), (Cause::Finished, timeline.events.len(), 0));
    let board = &timeline.board;
    let mut unscripted: Vec<Vec<u8>> = Vec::new();
    for (_, notice) in &bus.notices {
        if let Notice::Unscripted { command, .. } = notice {
            unscripted.push(board.to_frame(&command.command()));
        }
    }
    assert_eq!(outcome.extra, unscripted.len());
    let mut rest: Vec<Vec<u8>> = bus.sent.iter().map(|(_, frame)| frame.clone()).collect();
    for frame in unscripted {
        let at = rest.iter().position(|sent| *sent == frame).expect("it was sent");
        rest.remove(at);
    }
    let mut rendered = Vec::new();
    write_bin(board, timeline.items(), &mut rendered).unwrap();
    assert_eq!(rest.concat(), rendered);
}

#[test]
fn from_any_pose_no_step_is_above_the_speed_limit_of_its_joint() {
    let timeline = shipped("boards/on-arm.motion");
    // 240 degrees per second, in steps.
    let limit = 240.0 * 4_096.0 / 360.0;
    for seed in 0..40_u64 {
        let place = |servo: i32| {
            let mixed = (seed * 6 + u64::try_from(servo).unwrap() + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            // The ends of the range, too.
            [0, 4_095, 2_048].get(usize::try_from(seed).unwrap()).copied().unwrap_or((mixed >> 52) as u16)
        };
        let mut bus = Bus::new(&timeline, "", place);
        let outcome = bus.play(&timeline);
        assert_eq!(outcome.cause, Cause::Finished);
        for servo in 1..=6 {
            let targets = bus.targets(&timeline, servo);
            assert_eq!(targets[0].1, i32::from(place(servo)), "it holds first");
            for ((before, from), (now, to)) in targets.iter().copied().zip(targets.iter().copied().skip(1)) {
                // Rounded values, at least 20 ms apart.
                let seconds = ((now - before).0 as f64 / 1e9).max(0.02);
                let step = f64::from((to - from).abs());
                assert!(step <= limit * seconds + 1.0, "pose {seed}, servo {servo}: {step} steps in {seconds} s");
            }
        }
    }
}

#[test]
fn a_soft_start_takes_longer_if_a_speed_limit_needs_it() {
    let timeline = timeline("board sts\nsoft 100ms\nlimit servo 1 speed 400\nservo 1 2448\n");
    let mut bus = Bus::new(&timeline, "", |_| 2_048);
    bus.play(&timeline);
    let soft = bus.notices.iter().find_map(|(_, notice)| match notice {
        Notice::SoftStart { takes, is_longer, .. } => Some((*takes, *is_longer)),
        _ => None,
    });
    // 400 steps at most 400 steps per second: the peak of in-out-sine is pi/2 of the mean.
    let (takes, is_longer) = soft.unwrap();
    assert!(is_longer && takes > ms(1_570) && takes < ms(1_900), "{takes:?}");
}

#[test]
fn a_stop_at_any_moment_holds_every_joint_where_it_is() {
    // Jumps, moves, and a servo that is still on its way from a jump.
    let text = "board sts\nsoft 400ms\nservo 1 1000\nservo 2 3000\nservo 3 2048\nwait 100ms\nservo 1 3000\n+50ms servo 2 500\nservo 3 3000 over 400ms\nwait 500ms\n";
    let timeline = timeline(text);
    for cut in (0..1_600).step_by(7) {
        let mut bus = Bus::new(&timeline, "", |servo| if servo == 1 { 1_400 } else { 2_600 });
        let outcome = bus.ended_at(&timeline, ms(cut), Input::Signal(2));
        if outcome.cause == Cause::Finished {
            continue;
        }
        // Before the first target, nothing has moved.
        let stop = if bus.targets(&timeline, 1).is_empty() { Stop::NotNeeded } else { Stop::Held };
        assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(2), stop), "cut at {cut} ms");
        assert!(bus.now <= ms(cut) + ms(100), "cut at {cut} ms, done at {:?}", bus.now);
        let there = [1, 2, 3].map(|servo| bus.position(servo));
        bus.wait(ms(1_000));
        for (servo, before) in (1..).zip(there) {
            // What is left of the last step of a move.
            let way = (bus.position(servo) - before).abs();
            assert!(way <= 60, "cut at {cut} ms: servo {servo} turned {way} steps after the stop");
        }
    }
}

#[test]
fn a_servo_that_is_mute_at_a_stop_is_named() {
    let timeline = timeline(
        "board sts\nservo 1 1000\nservo 2 3000\nwait 100ms\nservo 1 3000\nservo 2 1000\nwait 1s\non abort { torque all off }\n",
    );
    let mut bus = Bus::new(&timeline, "", |_| 2_048);
    bus.mute = Some((2, ms(2_050)));
    let outcome = bus.ended_at(&timeline, ms(2_300), Input::Signal(15));
    let missing: ServoSet = [2].into_iter().collect();
    assert_eq!((outcome.stop, outcome.missing, outcome.aborted), (Stop::NotHeld, missing, true));
    let said = bus.said(&timeline);
    let asked = said.iter().filter(|said| *said == "\"get position\" 2").count();
    assert_eq!(asked, 3, "once before the script, and twice at the stop");
    assert_eq!(said[said.len() - 2..], ["torque 1 off", "torque 2 off"]);
}

#[test]
fn a_limp_servo_is_not_held() {
    let timeline = timeline("board sts\nservo 1 2048\nservo 2 2048\nwait 100ms\ntorque 1 off\nwait 1s\n");
    let mut bus = Bus::new(&timeline, "", |_| 2_000);
    let outcome = bus.ended_at(&timeline, ms(2_500), Input::Signal(2));
    assert_eq!(outcome.stop, Stop::Held);
    let said = bus.said(&timeline);
    let off = said.iter().position(|said| said == "torque 1 off").unwrap();
    assert!(said[off + 1..].iter().all(|said| !said.ends_with(" 1") && !said.starts_with("servo 1")), "{said:?}");
    assert_eq!(said[off + 1], "\"get position\" 2");
}

#[test]
fn torque_comes_back_where_the_servo_is() {
    let timeline = timeline(
        "board sts\nservo 1 3000\nwait 100ms\ntorque 1 off\nwait 500ms\ntorque 1 on\nwait 100ms\nservo 1 2500 -> 2400 over 100ms\n",
    );
    let mut bus = Bus::new(&timeline, "", |_| 3_000);
    let outcome = bus.play(&timeline);
    assert_eq!(outcome.cause, Cause::Finished);
    let said = bus.said(&timeline);
    let on = said.iter().rposition(|said| said == "torque 1 on").unwrap();
    assert_eq!(said[on - 2], "\"get position\" 1");
    let goal =
        bus.targets(&timeline, 1).into_iter().map(|(_, goal)| goal).find(|goal| ![3_000].contains(goal)).unwrap();
    assert_eq!(said[on - 1], format!("servo 1 {goal}"));
    assert!((2_450..=2_550).contains(&goal), "it has fallen for half a second: {goal}");
    let why =
        bus.notices.iter().filter(|(_, notice)| matches!(notice, Notice::Unscripted { why: Why::Torque, .. })).count();
    assert_eq!(why, 2);
}

#[test]
fn what_is_wrong_with_a_servo_ends_the_run_before_anything_moves() {
    let timeline = shipped("arm.motion");
    for (fault, kind) in [
        ("silent", ServoFaultKind::Silent),
        ("other", ServoFaultKind::Silent),
        ("sum", ServoFaultKind::Silent),
        ("late", ServoFaultKind::Silent),
        ("wheel", ServoFaultKind::Mode(1)),
        ("lost", ServoFaultKind::Position(motionseq::board::Hundredths(500_000))),
        ("error", ServoFaultKind::Flags(32)),
    ] {
        let mut bus = Bus::new(&timeline, &format!("servo=4:{fault}"), |_| 2_048);
        let outcome = bus.play(&timeline);
        assert_eq!(outcome.cause, Cause::Servo(ServoFault { servo: 4, kind }), "{fault}");
        assert_eq!((outcome.stop, outcome.sent, outcome.aborted), (Stop::NotNeeded, 0, false));
        assert!(bus.said(&timeline).iter().all(|said| said.starts_with("\"get ")), "{fault}: only questions");
    }
    for fault in ["twice", "slow", "700"] {
        let mut bus = Bus::new(&timeline, &format!("servo=4:{fault}"), |_| 2_048);
        assert_eq!(bus.play(&timeline).cause, Cause::Finished, "{fault}");
    }
}

#[test]
fn a_pause_in_the_soft_start_begins_it_again() {
    let timeline = timeline("board sts\nsoft 1s\nservo 1 3000\nwait 100ms\n");
    let mut bus = Bus::new(&timeline, "", |_| 2_000);
    bus.keys = [Input::Resume].into();
    let outcome = bus.ended_at(&timeline, ms(400), Input::Pause);
    assert_eq!(outcome.cause, Cause::Finished);
    let asked = bus.said(&timeline).iter().filter(|said| *said == "\"get mode\" 1").count();
    assert_eq!(asked, 2, "before the pause, and after it");
    let targets = bus.targets(&timeline, 1);
    assert!(targets.windows(2).all(|pair| (pair[1].1 - pair[0].1).abs() <= 60), "{targets:?}");
    assert_eq!(targets.last().unwrap().1, 3_000);
}

#[test]
fn the_soft_start_is_the_first_step_of_a_paused_run() {
    let timeline = timeline(
        "board sts\nsoft 200ms\nservo 1 3000\nwait 100ms\ntorque 1 off\nwait 100ms\ntorque 1 on\nwait 100ms\n",
    );
    let mut bus = Bus::new(&timeline, "", |_| 2_900);
    // Paused at once, then four steps.
    bus.keys = [Input::Step, Input::Step, Input::Step, Input::Step, Input::Quit].into();
    let outcome = bus.ended_at(&timeline, Nanos::ZERO, Input::Pause);
    assert_eq!(outcome.cause, Cause::Quit);
    let said = bus.said(&timeline);
    let soft = said.iter().position(|said| said == "servo 1 3000").unwrap();
    assert!(said[..soft].contains(&"torque 1 on".to_owned()));
    let rest: Vec<&str> =
        said[soft + 1..].iter().map(String::as_str).filter(|said| !said.starts_with("servo")).collect();
    assert_eq!(rest, ["torque 1 off", "\"get position\" 1", "torque 1 on"], "each step sends its commands: {said:?}");
}

#[test]
fn a_part_begins_softly_at_its_first_position() {
    let whole =
        timeline("board sts\nsoft 500ms\nservo 1 1000\nwait 1s\nservo 1 3000 over 2s\nwait 1s\nservo 1 2000 over 1s\n");
    let from = Position::before(&whole, Micros::from_millis(2_000));
    let part = clip(&whole, &Clip::new(from, None, Micros::from_millis(1_000)), &State::default());
    let mut bus = Bus::new(&part, "", |_| 1_900);
    let outcome = bus.play(&part);
    assert_eq!(outcome.cause, Cause::Finished);
    let targets = bus.targets(&part, 1);
    // Half of the way from 1000 to 3000 is at 2 s.
    let began = bus.notices.iter().find(|(_, notice)| *notice == Notice::Began).unwrap().0;
    let (_, first) = *targets.iter().find(|(at, _)| *at >= began).unwrap();
    assert!((1_980..=2_040).contains(&first), "{first}");
    assert!(targets.windows(2).all(|pair| (pair[1].1 - pair[0].1).abs() <= 40), "{targets:?}");
    assert!(began < ms(600), "without the lead-in: {began:?}");
}

#[test]
fn a_maestro_starts_softly_where_its_channels_have_positions() {
    let first = timeline("board maestro 6\nservo 0 1200\nwait 500ms\n");
    let second = timeline("board maestro 6\nsoft 500ms\nservo 0 1800\nservo 1 1500\nwait 100ms\n");
    let mut settings = Settings::default();
    settings.baud = Some(first.baud);
    let board = Faulty::new(Device::new(Arc::clone(&first.board), settings), Faults::default());
    let mut bus = Bus::of(board);
    assert_eq!(bus.play(&first).cause, Cause::Finished);
    bus.sent.clear();
    assert_eq!(bus.play(&second).cause, Cause::Finished);
    let said = bus.said(&second);
    assert_eq!(
        said[..3],
        ["\"hello\"", "\"get position\" 0", "\"get position\" 1"],
        "nothing moves before the answers"
    );
    let targets = bus.targets(&second, 0);
    assert!(targets.len() > 20 && targets.windows(2).all(|pair| (pair[1].1 - pair[0].1).abs() <= 160), "{targets:?}");
    assert_eq!(targets.last().unwrap().1, 1_800 * 4);
    assert_eq!(bus.targets(&second, 1).len(), 1, "a channel without pulses has no position to start from");
}

/// Runs `play` on a virtual bus, and does something to it once the servo is on its way.
fn ended_by(name: &str, end: impl FnOnce(Pid)) -> (String, String) {
    let board = Host::start(name, &["--family", "sts"]);
    let long = script(name, "board sts\nspeed 1 300\nservo 1 2048\nwait 100ms\nservo 1 100\nwait 10s\n");
    let child = Process::new(env!("CARGO_BIN_EXE_motionseq"))
        .args(["play", &long, "--no-soft", "--max-late", "500ms", "--port", board.path.to_str().unwrap(), "--verbose"])
        .stderr(fs::File::create(format!("{long}.log")).unwrap())
        .spawn()
        .unwrap();
    let printed = || fs::read_to_string(format!("{long}.log")).unwrap();
    while !printed().contains("servo 1 100") {
        thread::sleep(Duration::from_millis(5));
    }
    end(Pid::from_child(&child));
    let mut child = child;
    child.wait().unwrap();
    while !printed().contains("s into the run") {
        thread::sleep(Duration::from_millis(5));
    }
    let (listing, _) = board.end();
    (listing, printed())
}

#[test]
fn the_guard_holds_a_servo_on_its_way() {
    for (name, signal, why) in [
        ("arm-killed", Signal::KILL, "motionseq was killed"),
        ("arm-hung", Signal::STOP, "motionseq hung"),
        ("arm-stopped", Signal::TERM, "terminated (SIGTERM)"),
    ] {
        let (listing, log) = ended_by(name, |player| kill_process(player, signal).unwrap());
        let line = log.lines().last().unwrap();
        assert!(line.contains(why) && line.ends_with("; servos with torque hold their position"), "{log}");
        let frames: Vec<&str> = listing.lines().filter_map(|line| line.split('\t').nth(2)).collect();
        let sent = frames.iter().position(|frame| *frame == "servo 1 100").unwrap();
        assert_eq!(frames[sent + 1], "\"get position\" 1", "{listing}");
        let held = frames[sent + 2].strip_prefix("servo 1 ").expect("a target").parse::<i32>().unwrap();
        assert!((100..2_048).contains(&held), "{listing}");
        assert_eq!(frames.len(), sent + 3, "nothing comes after it: {listing}");
    }
}

#[test]
fn the_second_pass_of_a_loop_needs_torque() {
    let limp = script("arm-loop", "board sts\nservo 1 2048\nwait 1s\ntorque 1 off\nwait 1s\n");
    let run = |args: &[&str]| Process::new(env!("CARGO_BIN_EXE_motionseq")).args(args).output().unwrap();
    assert!(run(&["render", &limp]).status.success());
    let looped = run(&["render", &limp, "--loop", "2"]);
    assert_eq!(looped.status.code(), Some(1));
    assert!(stderr(&looped).contains("servo 1 has no torque"), "{}", stderr(&looped));
    for option in ["--no-soft", "--soft=1s"] {
        let other = script("arm-other", "servo 1 1500\n");
        let refused = run(&["play", &other, option]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(stderr(&refused).contains("is only for boards that report the positions"), "{}", stderr(&refused));
    }
    let soft = stdout(&run(&["render", &limp, "--soft", "5s"]));
    assert_eq!(soft, stdout(&run(&["render", &limp])), "render shows no soft start");
}

#[test]
fn error_bits_name_the_servo_that_has_them() {
    let timeline = shipped("arm.motion");
    let mut bus = Bus::new(&timeline, "", |_| 2_048);
    // The bits come with the last answer of servo 6, its position.
    bus.flags = Some(6);
    let outcome = bus.play(&timeline);
    assert_eq!(outcome.cause, Cause::Servo(ServoFault { servo: 6, kind: ServoFaultKind::Flags(32) }));
}

#[test]
fn an_end_in_a_paused_soft_start_sends_on_abort() {
    let timeline = timeline("board sts\nsoft 1s\nservo 1 3000\nwait 1s\non abort { torque all off }\n");
    let mut bus = Bus::new(&timeline, "", |_| 2_000);
    bus.keys = [Input::Quit].into();
    let outcome = bus.ended_at(&timeline, ms(500), Input::Pause);
    assert_eq!((outcome.cause, outcome.stop, outcome.aborted), (Cause::Quit, Stop::Held, true));
    assert_eq!(bus.said(&timeline).last().unwrap(), "torque 1 off");
}

#[test]
fn steps_and_then_the_rest_keep_the_time_of_the_script() {
    let timeline =
        timeline("board sts\nsoft 100ms\nservo 1 2100\nwait 1s\nservo 1 2200\nwait 1s\nservo 1 2300\nwait 1s\n");
    let mut bus = Bus::new(&timeline, "", |_| 2_048);
    bus.keys = [Input::Step, Input::Step, Input::Step, Input::Resume].into();
    let outcome = bus.ended_at(&timeline, Nanos::ZERO, Input::Pause);
    assert_eq!((outcome.cause, outcome.at), (Cause::Finished, Micros::from_millis(3_000)));
    let targets = bus.targets(&timeline, 1);
    let last = targets.last().unwrap();
    let before = targets.iter().rev().find(|(_, target)| *target == 2_200).unwrap();
    assert_eq!(last.1, 2_300);
    assert!((ms(950)..ms(1_050)).contains(&(last.0 - before.0)), "a second after the second target: {targets:?}");
}

#[test]
fn a_pause_while_the_port_takes_nothing_loses_no_torque() {
    // The port accepts nothing when the torque comes back; then the run is paused.
    let timeline = timeline(
        "board sts\nsoft 100ms\nservo 1 2100\nwait 100ms\ntorque 1 off\nwait 300ms\ntorque 1 on\nwait 500ms\n",
    );
    let mut bus = Bus::new(&timeline, "", |_| 2_100);
    bus.play(&timeline);
    let began = bus.notices.iter().find(|(_, notice)| *notice == Notice::Began).unwrap().0;
    let board = &timeline.board;
    let on =
        bus.sent.iter().rposition(|(_, frame)| board.show(&board.decode(frame).unwrap()).to_string() == "torque 1 on");
    let at = bus.sent[on.unwrap()].0;
    assert!(at > began + ms(400));
    for before in [ms(0), Nanos(1)] {
        let mut bus = Bus::new(&timeline, "", |_| 2_100);
        bus.blocked = Some((at - before, at + ms(20)));
        bus.keys = [Input::Resume].into();
        bus.inputs = [(at, Input::Pause)].into();
        let outcome = bus.play(&timeline);
        assert_eq!(outcome.cause, Cause::Finished);
        let said = bus.said(&timeline);
        let on = said.iter().rposition(|said| said == "torque 1 on").unwrap();
        assert!(said[on - 1].starts_with("servo 1 ") && said[on - 2] == "\"get position\" 1", "{said:?}");
        bus.wait(ms(1_000));
        let there = bus.position(1);
        bus.wait(ms(1_000));
        assert_eq!(bus.position(1), there, "it holds");
    }
}

#[test]
fn a_silent_servo_does_not_delay_the_stop_of_the_others() {
    let timeline = timeline(
        "board sts\nsoft 100ms\nservo 1 1000\nservo 2 1000\nservo 3 1000\nwait 1s\nservo 1 3000\nservo 2 3000\nservo 3 3000\nwait 1s\n",
    );
    let mut bus = Bus::new(&timeline, "", |_| 1_000);
    bus.mute = Some((1, ms(1_300)));
    let outcome = bus.ended_at(&timeline, ms(1_400), Input::Signal(2));
    assert_eq!(outcome.stop, Stop::NotHeld);
    for servo in [2, 3] {
        let (at, _) = *bus.targets(&timeline, servo).last().unwrap();
        assert!(at < ms(1_400) + ms(30), "servo {servo} is held at {at:?}");
    }
}

#[test]
fn an_old_answer_is_not_taken_for_one_of_the_stop() {
    let timeline = timeline(
        "board sts\nsoft 100ms\nservo 1 1000\nwait 1s\nservo 1 3000\nexpect position 1 > 4000 within 900ms\nwait 1s\n",
    );
    // Each answer is delivered again 7 ms later.
    for cut in (1_250..1_500).step_by(3) {
        let mut bus = Bus { echo: true, ..Bus::new(&timeline, "", |_| 1_000) };
        let outcome = bus.ended_at(&timeline, ms(cut), Input::Signal(2));
        assert_eq!(outcome.stop, Stop::Held);
        let (_, held) = *bus.targets(&timeline, 1).last().unwrap();
        assert!((bus.position(1) - held).abs() < 60, "cut at {cut} ms: held at {held}, is at {}", bus.position(1));
    }
}

#[test]
fn a_soft_start_waits_for_a_slow_servo() {
    let timeline = timeline("board sts\nsoft 100ms\nspeed 1 200\nservo 1 2448\nwait 10ms\n");
    let mut bus = Bus::new(&timeline, "", |_| 2_048);
    bus.play(&timeline);
    assert!((bus.position(1) - 2_448).abs() < 10, "it is there when the script begins: {}", bus.position(1));
}

#[test]
fn a_second_pass_does_not_begin_at_the_torque_of_the_first() {
    let text = "board sts\nservo 1 1000\nwait 1s\nservo 1 3000\nwait 1s\ntorque 1 off\nwait 1s\ntorque 1 on\nwait 1s\n";
    let whole = timeline(text);
    let from = Position::before(&whole, Micros::from_millis(500));
    let asked = Clip::new(from, None, Micros::from_millis(1_000));
    let first = clip(&whole, &asked, &State::default());
    let again = clip(&whole, &asked, &motionseq::timeline::state_after(&first));
    let mut bus = Bus::new(&again, "", |_| 1_000);
    bus.play(&again);
    let (_, script) = bus.targets(&again, 1).into_iter().partition::<Vec<_>, _>(|(_, target)| *target == 1_000);
    assert!(
        script.iter().all(|(_, target)| *target > 900),
        "no value of the torque is taken for a position: {script:?}"
    );
}

#[test]
fn questions_and_frames_do_not_meet_on_the_wire() {
    let moves = |to: u16| (1..=6).map(|servo| format!("  servo {servo} {to} over 1s\n")).collect::<String>();
    let first = (1..=6).map(|servo| format!("servo {servo} 1500\n")).collect::<String>();
    let text = format!(
        "board sts\n{first}at 100ms together {{\n{}}}\nat 100ms expect position 3 > 4000 within 2s\nat 1.2s together {{\n{}}}\n",
        moves(2_500),
        moves(1_500)
    );
    let timeline = timeline(&text);
    let mut bus = Bus::new(&timeline, "", |_| 1_500);
    let outcome = bus.play(&timeline);
    assert!(matches!(outcome.cause, Cause::Expect(_)), "{outcome:?}");
    let asked = bus.notices.iter().filter(|(_, notice)| matches!(notice, Notice::Asked { .. })).count();
    assert!(asked >= 15, "ten times per second: {asked}");
    let received = bus.board.device().received();
    assert_eq!((received.lost, received.first_fault), (0, None), "nothing is sent during an answer");
}

#[test]
fn a_soft_start_does_not_catch_up_after_a_stall() {
    let timeline = timeline("board sts\nsoft 1s\nservo 1 3000\nwait 1s\n");
    let mut bus = Bus::new(&timeline, "", |_| 1_000);
    bus.stall = Some((ms(500), ms(200)));
    let outcome = bus.play(&timeline);
    assert!(matches!(outcome.cause, Cause::Late(late) if late > ms(150)), "{outcome:?}");
    let targets = bus.targets(&timeline, 1);
    assert!(targets.windows(2).all(|pair| (pair[1].1 - pair[0].1).abs() <= 70), "no step makes up for it: {targets:?}");
}
