//! The player with a simulated clock: what is sent when, and that every early end is a stop.

use crate::support::board::{OnBoard, board, say, state, stop};
use crate::support::far::commands;
use motionseq::board::{Hundredths, State, raspblock};
use motionseq::playback::{Cause, Input, Notice, Order, Outcome, Player, Stop};
use motionseq::program::Options;
use motionseq::source::{Disk, Source, Sources};
use motionseq::timeline::{Timeline, write_bin};
use motionseq::units::{Micros, Nanos};

const MS: Nanos = Nanos::from_millis(1);
const MAX_LATE: Nanos = Nanos::from_millis(50);

fn timeline(script: &str) -> Timeline {
    motionseq::compile(&Source::new("test", script).into(), &Options::default())
        .timeline()
        .expect("the script compiles")
}

/// A shipped script with the files that it uses.
fn shipped(path: &std::path::Path) -> Timeline {
    let compiled = motionseq::compile(&Sources::read(path, Disk).unwrap(), &Options::default());
    // No board reports in these tests; tests/sim.rs tests `expect`.
    Timeline { expects: Vec::new(), ..compiled.timeline().expect("the script compiles") }
}

fn rendered(timeline: &Timeline) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_bin(board(), timeline.items(), &mut bytes).unwrap();
    bytes
}

/// A simulated environment of a player.
struct World<F> {
    now: Nanos,
    /// What was written to the port, with the time; `None` for a flush.
    given: Vec<(Nanos, Vec<u8>)>,
    notices: Vec<Notice>,
    /// When the gate that is closed began to wait.
    waits_since: Option<Nanos>,
    /// Called at every order; returns what happens instead of it.
    meddle: F,
}

/// How long gates are closed in these tests.
const WAIT: Nanos = Nanos::from_millis(130);

impl<F: FnMut(Nanos, Order, usize) -> Option<(Nanos, Input)>> World<F> {
    fn run(meddle: F, timeline: &Timeline) -> (Self, Outcome) {
        Self::run_with(MAX_LATE, meddle, timeline)
    }

    fn run_with(max_late: Nanos, meddle: F, timeline: &Timeline) -> (Self, Outcome) {
        let mut world = World { now: Nanos::ZERO, given: Vec::new(), notices: Vec::new(), waits_since: None, meddle };
        let mut player = Player::new(timeline, max_late);
        let mut input = Input::Tick;
        for _ in 0..100_000 {
            let order = player.poll(world.now, input, &mut |notice| world.notices.push(notice));
            if let Some(outcome) = player.outcome() {
                return (world, outcome);
            }
            if let Some((now, other)) = (world.meddle)(world.now, order, world.given.len()) {
                world.now = now;
                if let (Order::Write, Input::Wrote(count)) = (order, other) {
                    world.given.push((now, player.bytes()[..count].to_vec()));
                }
                input = other;
                continue;
            }
            world.waits_since = player.closed_gate().map(|_| world.waits_since.unwrap_or(world.now));
            input = match order {
                Order::Wait { until, .. } if world.waits_since.is_some_and(|since| until >= since + WAIT) => {
                    world.now = world.now.max(world.waits_since.unwrap() + WAIT);
                    world.waits_since = None;
                    // Opens any gate.
                    player.answer(Some(Hundredths(99_999)));
                    player.hear(world.now, raspblock::report(Hundredths(0), Hundredths(0)), &mut |notice| {
                        world.notices.push(notice);
                    });
                    Input::Go
                }
                Order::Write => {
                    world.given.push((world.now, player.bytes().to_vec()));
                    Input::Wrote(player.bytes().len())
                }
                Order::Wait { until, .. } | Order::Pause { until } => {
                    assert!(until > world.now, "a wait that does not wait burns the processor");
                    world.now = until;
                    Input::Tick
                }
                Order::Halt { .. } | Order::Done | Order::Suspend => Input::Tick,
                other => panic!("nothing can end {other:?}"),
            };
        }
        panic!("the player never ends");
    }

    fn bytes(&self) -> Vec<u8> {
        self.given.iter().flat_map(|(_, bytes)| bytes.clone()).collect()
    }
}

const SCRIPT: &str =
    "servo 1 1500; servo 3 1000; rocker x=10\nsay \"go\"\nwait 120ms\nstop\nbuzzer on for 100ms\nwait 50ms";

#[test]
fn frames_due_together_are_one_write_at_their_time() {
    let timeline = timeline(SCRIPT);
    let (world, outcome) = World::run(|_, _, _| None, &timeline);
    assert_eq!(world.bytes(), rendered(&timeline));
    let writes: Vec<(u64, usize)> =
        world.given.iter().map(|(at, bytes)| (at.0 / MS.0, commands(bytes).len())).collect();
    assert_eq!(writes, [(0, 3), (50, 1), (100, 1), (120, 2), (220, 1)]);
    assert!(world.notices.contains(&Notice::Say { cue: 0, report: None }));
    assert_eq!(
        (outcome.cause, outcome.stop, outcome.sent, outcome.at),
        (Cause::Finished, Stop::NotNeeded, 8, Micros(270_000))
    );
}

#[test]
fn many_marks_at_one_moment_delay_no_frame_and_are_all_reported() {
    let marks: String = (0..1_000).map(|number| format!("mark m{number}\nsay \"x\"\n")).collect();
    let timeline = timeline(&format!("servo 1 1500\nwait 1ms\n{marks}wait 1ms\nservo 2 1500\n"));
    let mut player = Player::new(&timeline, Nanos::from_millis(50));
    let (mut now, mut input, mut times) = (Nanos::ZERO, Input::Tick, Vec::new());
    let (mut marked, mut said) = (Vec::new(), Vec::new());
    loop {
        let mut count = 0;
        let order = player.poll(now, input, &mut |notice| match notice {
            Notice::Marked { mark } => {
                count += 1;
                marked.push(mark);
            }
            Notice::Say { cue, .. } => {
                count += 1;
                said.push(cue);
            }
            _ => {}
        });
        assert!(count <= 64, "{count} at once");
        input = match order {
            Order::Write => {
                times.push(now);
                Input::Wrote(player.bytes().len())
            }
            Order::Wait { until, .. } => {
                assert!(until > now, "it waits");
                now = until;
                Input::Tick
            }
            Order::Done => break,
            other => panic!("{other:?}"),
        };
    }
    assert_eq!(times, [Nanos::ZERO, Nanos::from_millis(2)]);
    let all: Vec<usize> = (0..1_000).collect();
    assert_eq!((marked, said), (all.clone(), all));
    assert_eq!(player.outcome().unwrap().cause, Cause::Finished);
}

#[test]
fn a_port_that_accepts_few_bytes_at_once_gets_all_in_order() {
    let timeline = timeline(SCRIPT);
    let mut full = false;
    let meddle = |now, order, _| match order {
        Order::Write if full => {
            full = false;
            Some((now, Input::Blocked))
        }
        Order::Write => {
            full = true;
            Some((now + Micros(100).nanos(), Input::Wrote(1)))
        }
        Order::Wait { writable: true, .. } => Some((now + Micros(100).nanos(), Input::Tick)),
        _ => None,
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(world.bytes(), rendered(&timeline));
    assert_eq!((outcome.cause, outcome.sent), (Cause::Finished, 8));
}

/// After an early end: three stops 20 ms apart, buzzer off, nothing else, and the board at rest.
fn assert_stopped<F: FnMut(Nanos, Order, usize) -> Option<(Nanos, Input)>>(world: &World<F>, before: usize) {
    let end = &world.given[before..];
    let frames: Vec<String> = end.iter().flat_map(|(_, bytes)| commands(bytes)).map(|command| command.said()).collect();
    assert_eq!(frames[..4], ["stop", "stop", "stop", "buzzer off"]);
    // Afterwards only `on abort`, which never drives.
    assert!(frames[4..].iter().all(|frame| frame.starts_with("servo") || frame.starts_with("buzzer")), "{frames:?}");
    assert_eq!(end[1].0 - end[0].0, MS * 20);
    assert_eq!(end[2].0 - end[1].0, MS * 20);
    assert!(state(&commands(&world.bytes())).at_rest(board()));
}

/// Every cause of an early end except a blocked port, and the reported cause.
const ENDS: [(Input, Cause); 6] = [
    (Input::Signal(2), Cause::Signal(2)),
    (Input::HungUp, Cause::Lost(None)),
    (Input::Failed(Some(5)), Cause::Lost(Some(5))),
    (Input::Unguarded, Cause::Unguarded),
    (Input::Panicked, Cause::Panicked),
    (Input::Signal(15), Cause::Signal(15)),
];

/// Injects one input after this many writes.
fn once(cut: usize, input: Input) -> impl FnMut(Nanos, Order, usize) -> Option<(Nanos, Input)> {
    let mut done = false;
    move |now, order, given| {
        let now_is_the_time = given == cut && !done && !matches!(order, Order::Halt { discards: true });
        now_is_the_time.then(|| {
            done = true;
            (now, input)
        })
    }
}

/// The shipped scripts for the Raspblock. tests/arms.rs has the other one.
fn scripts() -> impl Iterator<Item = std::path::PathBuf> {
    std::fs::read_dir("scripts")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "motion"))
        .filter(|path| {
            let text = std::fs::read_to_string(path).unwrap();
            !text.contains("\nboard ") && !text.contains("\nrobots ")
        })
}

#[test]
fn every_script_cut_at_every_frame_leaves_the_board_at_rest() {
    for path in scripts() {
        let timeline = shipped(&path);
        let (all, _) = World::run(|_, _, _| None, &timeline);
        for cut in 0..all.given.len() {
            // The short script below has every cause at every frame; here they take turns.
            let (input, cause) = ENDS[cut % ENDS.len()];
            let (world, outcome) = World::run(once(cut, input), &timeline);
            assert_eq!((outcome.cause, outcome.stop), (cause, Stop::Sent), "{} cut at {cut}", path.display());
            assert_stopped(&world, cut);
        }
    }
    let timeline = timeline(SCRIPT);
    for cut in 0..5 {
        for (input, cause) in ENDS {
            let (world, outcome) = World::run(once(cut, input), &timeline);
            assert_eq!((outcome.cause, outcome.stop), (cause, Stop::Sent));
            assert_stopped(&world, cut);
        }
    }
}

#[test]
fn a_pause_at_every_frame_of_every_script_changes_nothing_but_the_time() {
    for path in scripts() {
        let timeline = shipped(&path);
        if !timeline.gates.is_empty() {
            // tests/gates.rs has pauses at gates, where the refreshes depend on the time.
            continue;
        }
        let (all, _) = World::run(|_, _, _| None, &timeline);
        let pauses = |cut| [(cut, Input::Suspend, 1), (cut, Input::Pause, 0)];
        for (cut, how, sleeps) in (1..all.given.len()).flat_map(pauses) {
            let mut suspend = once(cut, how);
            let at_rest = std::cell::Cell::new(0);
            let meddle = |now, order, given| match order {
                Order::Suspend => {
                    at_rest.set(at_rest.get() + 1);
                    // The shell continues it an hour later.
                    Some((now + MS * 3_600_000, Input::Tick))
                }
                Order::Stay => Some((now + MS, Input::Resume)),
                _ => suspend(now, order, given),
            };
            let (world, outcome) = World::run(meddle, &timeline);
            assert_eq!(at_rest.get(), sleeps);
            assert_eq!(
                (outcome.cause, outcome.stop),
                (Cause::Finished, Stop::NotNeeded),
                "{} at {cut}",
                path.display()
            );
            assert_eq!(outcome.at, timeline.end);
            // The earlier writes, the stop, the commands that restore the state, and the rest of
            // the script.
            let mut state = State::default();
            let mut expected: Vec<Vec<u8>> = Vec::new();
            for (_, bytes) in &all.given[..cut] {
                for command in commands(bytes) {
                    state.apply(board(), &command);
                }
                expected.push(bytes.clone());
            }
            let stops = [stop(), stop(), stop(), say("buzzer", &[0])];
            expected.extend(stops.iter().map(OnBoard::to_frame));
            // The zeros that resynchronize a receiver after a flush.
            expected[cut].splice(0..0, [0; 12]);
            let restored: Vec<u8> = state.commands(board()).flat_map(OnBoard::to_frame).collect();
            expected.extend((!restored.is_empty()).then_some(restored));
            expected.extend(all.given[cut..].iter().map(|(_, bytes)| bytes.clone()));
            let given: Vec<Vec<u8>> = world.given.iter().map(|(_, bytes)| bytes.clone()).collect();
            assert_eq!(given, expected, "{} at {cut}", path.display());
            // All remaining frames are delayed by the same time.
            let rest = world.given.iter().rev().zip(all.given.iter().rev()).take(all.given.len() - cut);
            let shifts: Vec<Nanos> = rest.map(|((at, _), (due, _))| *at - *due).collect();
            assert!(shifts.windows(2).all(|pair| pair[0] == pair[1]), "{shifts:?}");
        }
    }
}

#[test]
fn the_state_at_a_pause_is_restored_afterwards() {
    let timeline = timeline(
        "pid speed speed=1,2 position=3,4,5 yaw=6,7,8\nservos 1400 1600\nbuzzer on\nrocker x=10 for 1s\nbuzzer off",
    );
    let mut suspend = once(3, Input::Suspend);
    let meddle = |now, order, given| match order {
        Order::Stay => Some((now, Input::Resume)),
        _ => suspend(now, order, given),
    };
    let (world, _) = World::run(meddle, &timeline);
    // The write after the four of the stop.
    let again: Vec<String> = commands(&world.given[7].1).iter().map(OnBoard::said).collect();
    let expected = [
        "pid speed speed=1,2 position=3,4,5 yaw=6,7,8",
        "servo 1 1400",
        "servo 2 1600",
        "buzzer on",
        "rocker x=10 y=0 z=0",
    ];
    assert_eq!(again, expected);
    assert!(world.notices.contains(&Notice::Resumed { at: Micros(100_000) }));
}

#[test]
fn every_end_of_a_run_also_ends_a_pause() {
    let timeline = timeline(SCRIPT);
    for (input, cause) in ENDS {
        // During the stop of the pause, and afterwards.
        for at_stop in [true, false] {
            let mut suspend = once(2, Input::Suspend);
            let meddle = |now, order, given| match order {
                Order::Stay => Some((now, input)),
                Order::Pause { .. } if at_stop && given == 3 => Some((now, input)),
                _ => suspend(now, order, given),
            };
            let (world, outcome) = World::run(meddle, &timeline);
            assert_eq!((outcome.cause, outcome.stop), (cause, Stop::Sent));
            assert_stopped(&world, if at_stop { 3 } else { 6 });
        }
    }
}

#[test]
fn a_run_whose_robot_cannot_be_stopped_does_not_sleep() {
    let timeline = timeline(SCRIPT);
    let mut suspend = once(2, Input::Suspend);
    let meddle = |now, order, given| match order {
        Order::Write if given == 2 => suspend(now, order, given).or(Some((now, Input::Blocked))),
        Order::Suspend => panic!("it must not sleep"),
        _ => suspend(now, order, given),
    };
    let (_, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(20), Stop::NotSent));
}

#[test]
fn a_second_ctrl_z_at_a_pause_sleeps_again() {
    let timeline = timeline(SCRIPT);
    let mut suspend = once(2, Input::Suspend);
    let mut sleeps = 0;
    let meddle = |now, order, given| match order {
        Order::Suspend => {
            sleeps += 1;
            None
        }
        Order::Stay if sleeps < 2 => Some((now, Input::Suspend)),
        Order::Stay => Some((now, Input::Resume)),
        _ => suspend(now, order, given),
    };
    let (_, outcome) = World::run(meddle, &timeline);
    assert_eq!((sleeps, outcome.cause), (2, Cause::Finished));
}

#[test]
fn a_second_signal_skips_nothing() {
    let timeline = timeline(SCRIPT);
    let meddle = |now, order, given| {
        (given > 0 && !matches!(order, Order::Write | Order::Halt { .. })).then_some((now + MS, Input::Signal(15)))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(15), Stop::Sent));
    assert_stopped(&world, 1);
}

#[test]
fn the_queue_is_discarded_before_the_stop() {
    let timeline = timeline(SCRIPT);
    let mut orders = Vec::new();
    let meddle = |now, order, given| {
        orders.push(order);
        (orders.len() == 2).then_some((now, Input::Signal(2))).filter(|_| given == 1)
    };
    World::run(meddle, &timeline);
    let write = orders.iter().rposition(|order| *order == Order::Halt { discards: true }).unwrap();
    assert_eq!(orders[write + 1], Order::Write);
}

#[test]
fn a_frame_that_is_too_late_is_not_sent() {
    let timeline = timeline("servo 1 1500\nat 100ms servo 1 1600\nat 101ms servo 1 1700");
    // The machine is suspended during the second frame and most of the allowed lateness.
    let meddle = |now, order, _| {
        matches!(order, Order::Wait { until, .. } if until == MS * 100 && now < until)
            .then_some((MS * 151, Input::Tick))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(outcome.cause, Cause::Late(MS * 51));
    assert_eq!(world.given[0].1, commands(&world.given[0].1)[0].to_frame());
    assert_stopped(&world, 1);
    // The place is that of the frame that was not sent.
    assert_eq!(outcome.place.unwrap().start, 22);
}

#[test]
fn a_superseded_refresh_is_dropped_and_reported() {
    let timeline = timeline("refresh 10ms\nrocker x=10 for 60ms");
    // 45 ms late at the first refresh: four are due at once, and only the newest is sent.
    let meddle = |now, order, given| {
        (given == 1 && matches!(order, Order::Wait { .. }) && now == Nanos::ZERO).then_some((MS * 45, Input::Tick))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    let dropped: Vec<_> = world
        .notices
        .iter()
        .filter_map(|notice| match notice {
            Notice::Dropped { event } => Some(timeline.events[*event].at.0 / 1_000),
            _ => None,
        })
        .collect();
    assert_eq!(dropped, [10, 20, 30]);
    assert_eq!((outcome.cause, outcome.dropped, outcome.sent), (Cause::Finished, 3, 4));
    // The written and the dropped frames together are the rendered ones.
    assert_eq!(world.bytes().len() + 3 * 13, rendered(&timeline).len());
}

#[test]
fn of_several_due_samples_of_a_resource_only_the_newest_is_sent() {
    let timeline = timeline("together {\nservo 1 1000 -> 2000 over 100ms\nservo 3 1000 -> 2000 over 100ms\n}");
    // Suspended until 70 ms: the samples at 20, 40 and 60 ms of each servo are due.
    let meddle = |now, order, given| {
        (given == 1 && matches!(order, Order::Wait { .. }) && now == Nanos::ZERO).then_some((MS * 70, Input::Tick))
    };
    let (world, outcome) = World::run_with(MAX_LATE * 2, meddle, &timeline);
    let sent: Vec<String> = commands(&world.given[1].1).iter().map(OnBoard::said).collect();
    assert_eq!(sent, ["servo 1 1600", "servo 3 1600"]);
    assert_eq!((outcome.cause, outcome.dropped), (Cause::Finished, 4));
    let dropped = world.notices.iter().filter(|notice| matches!(notice, Notice::Dropped { .. })).count();
    assert_eq!(dropped, 4);
}

#[test]
fn samples_of_one_servo_are_superseded_by_both_in_one_frame() {
    let timeline = timeline("servo 2 1500 -> 1600 over 50ms\nwait 1ms\nservos 900 900\nservo 3 900");
    let meddle = |now, order, given| {
        (given == 1 && matches!(order, Order::Wait { .. }) && now == Nanos::ZERO).then_some((MS * 70, Input::Tick))
    };
    let (world, outcome) = World::run_with(MAX_LATE * 2, meddle, &timeline);
    let sent: Vec<String> = commands(&world.given[1].1).iter().map(OnBoard::said).collect();
    assert_eq!((sent, outcome.dropped), (vec!["servos 900 900".to_owned(), "servo 3 900".to_owned()], 3));
}

#[test]
fn a_command_is_never_dropped() {
    let timeline =
        timeline("servo 1 1500\nwait 10ms\nservo 1 1600\nwait 10ms\nservos 1700 1700\nrocker x=1\nwait 1ms\nstop");
    let meddle = |now, order, given| {
        (given == 1 && matches!(order, Order::Wait { .. }))
            .then_some((MS * 40, Input::Tick))
            .filter(|_| now == Nanos::ZERO)
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((world.bytes(), outcome.dropped), (rendered(&timeline), 0));
}

#[test]
fn a_port_that_stops_taking_bytes_ends_the_run() {
    let timeline = timeline(SCRIPT);
    let meddle = |now, order, given| (given >= 1 && order == Order::Write).then_some((now, Input::Blocked));
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop, outcome.sent), (Cause::Stalled, Stop::NotSent, 3));
    // The player gives up: the stop has half a second.
    assert!(world.now < MS * 700);
}

#[test]
fn a_port_that_takes_bytes_again_after_the_flush_gets_the_stop() {
    let timeline = timeline(SCRIPT);
    let mut flushed = false;
    let meddle = |now, order, given| {
        flushed |= order == Order::Halt { discards: true };
        (given >= 1 && !flushed && order == Order::Write).then_some((now, Input::Blocked))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Stalled, Stop::Sent));
    assert_stopped(&world, 1);
}

#[test]
fn a_lost_port_is_reported_as_not_stopped() {
    let timeline = timeline(SCRIPT);
    let (world, outcome) = World::run(
        |now, order, given| (given >= 1 && order == Order::Write).then_some((now, Input::Failed(Some(5)))),
        &timeline,
    );
    assert_eq!((outcome.cause, outcome.stop), (Cause::Lost(Some(5)), Stop::NotSent));
    assert_eq!(world.given.len(), 1);

    let (_, outcome) =
        World::run(|now, order, _| matches!(order, Order::Wait { .. }).then_some((now, Input::HungUp)), &timeline);
    assert_eq!(outcome.cause, Cause::Lost(None));
}

#[test]
fn a_write_that_fails_once_still_stops_the_robot() {
    let timeline = timeline(SCRIPT);
    let mut failures = 2;
    let meddle = |now, order, given| {
        (given >= 1 && order == Order::Write && failures > 0).then(|| {
            failures -= 1;
            (now, Input::Failed(Some(5)))
        })
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Lost(Some(5)), Stop::Sent));
    let frames: Vec<String> = commands(&world.bytes()).iter().skip(3).map(OnBoard::said).collect();
    assert_eq!(frames, ["stop", "stop", "stop", "buzzer off"]);
}

#[test]
fn on_abort_follows_the_stop_at_its_times() {
    let script = "rocker x=10 for 1s\non abort { buzzer on for 200ms; servo 1 1000 -> 2000 over 40ms }";
    let timeline = timeline(script);
    let meddle = |now, order, given| {
        (given == 1 && !matches!(order, Order::Write | Order::Halt { .. })).then_some((now, Input::Signal(2)))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(outcome.stop, Stop::Sent);
    let sent: Vec<(u64, String)> = world
        .given
        .iter()
        .flat_map(|(at, bytes)| commands(bytes).into_iter().map(move |command| (at.0 / MS.0, command.said())))
        .collect();
    let sent: Vec<(u64, &str)> = sent.iter().map(|(at, command)| (*at, command.as_str())).collect();
    assert_eq!(
        sent,
        [
            (0, "rocker x=10 y=0 z=0"),
            (0, "stop"),
            (20, "stop"),
            (40, "stop"),
            (40, "buzzer off"),
            (40, "buzzer on"),
            (40, "servo 1 1000"),
            (60, "servo 1 1500"),
            (80, "servo 1 2000"),
            (240, "buzzer off"),
        ]
    );
    // A run that ends normally sends none of it.
    let (world, _) = World::run(|_, _, _| None, &timeline);
    assert_eq!(world.bytes(), rendered(&timeline));
}

#[test]
fn a_machine_that_stalls_during_the_stop_still_sends_all_of_it() {
    let timeline = timeline(SCRIPT);
    let mut signal = once(2, Input::Signal(2));
    let meddle = |now, order, given| match order {
        Order::Pause { until } => Some((until + MS * 10_000, Input::Tick)),
        _ => signal(now, order, given),
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(outcome.stop, Stop::Sent);
    let frames: Vec<String> = commands(&world.bytes()).iter().rev().take(4).map(OnBoard::said).collect();
    assert_eq!(frames, ["buzzer off", "stop", "stop", "stop"]);
}

#[test]
fn on_abort_does_not_follow_a_stop_that_was_not_sent() {
    let timeline = timeline("rocker x=10 for 1s\non abort { buzzer on for 200ms }");
    let meddle = |now, order, given| (given >= 1 && order == Order::Write).then_some((now, Input::Failed(Some(5))));
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.stop, world.given.len()), (Stop::NotSent, 1));
}

#[test]
fn a_raw_frame_in_on_abort_is_followed_by_a_stop() {
    let timeline = timeline("servo 1 1500\nwait 1s\non abort { raw 0x04 1 }");
    let meddle = |now, order, given| {
        (given == 1 && !matches!(order, Order::Write | Order::Halt { .. })).then_some((now, Input::Signal(2)))
    };
    let (world, _) = World::run(meddle, &timeline);
    let sent: Vec<String> = commands(&world.bytes()).iter().map(OnBoard::said).collect();
    assert_eq!(sent[5..], ["buzzer on", "stop", "buzzer off"]);
}

#[test]
fn steps_of_a_pause_play_all_but_the_drive_and_resuming_restores_the_current_state() {
    let timeline =
        timeline("rocker x=10\nwait 100ms\nservo 1 1000\nwait 10s\nrocker y=5\nservo 2 1200\nwait 10s\nstop");
    let mut player = Player::new(&timeline, MAX_LATE);
    let mut sent = Vec::new();
    let (mut now, mut input) = (Nanos::ZERO, Input::Tick);
    // Pauses after 50 ms, plays three steps, resumes, and quits at 19 s of the script.
    let mut keys = [Input::Pause, Input::Step, Input::Step, Input::Resume].into_iter();
    let outcome = loop {
        let order = player.poll(now, input, &mut |_| {});
        if let Some(outcome) = player.outcome() {
            break outcome;
        }
        input = Input::Tick;
        match order {
            Order::Write => {
                sent.extend(commands(player.bytes()).iter().map(|command| (now.0 / MS.0, command.said())));
                input = Input::Wrote(player.bytes().len());
            }
            Order::Wait { until, .. } if until > MS * 60 && keys.len() == 4 => {
                now = MS * 60;
                input = keys.next().unwrap();
            }
            Order::Wait { .. } if player.script_time(now) >= MS * 19_000 => input = Input::Quit,
            Order::Wait { until, .. } | Order::Pause { until } => now = until.max(now),
            Order::Stay => input = keys.next().unwrap(),
            _ => {}
        }
    };
    let sent: Vec<(u64, &str)> = sent.iter().map(|(at, command)| (*at, command.as_str())).collect();
    let at = sent.iter().position(|(_, command)| *command == "servo 1 1000").unwrap();
    // The stop of the pause; the two steps, immediately; the current state, servos first.
    assert_eq!(sent[at - 1].1, "buzzer off");
    assert_eq!(
        sent[at..at + 5].iter().map(|(_, command)| *command).collect::<Vec<_>>(),
        ["servo 1 1000", "servo 2 1200", "servo 1 1000", "servo 2 1200", "rocker x=0 y=5 z=0"]
    );
    assert!(sent[at + 4].0 < 200, "{sent:?}");
    // Afterwards, the script continues on time: ten seconds of refreshes remain, nine until the
    // end.
    let refreshes = sent[at + 5..].iter().filter(|(_, command)| *command == "rocker x=0 y=5 z=0").count();
    assert!((175..=180).contains(&refreshes), "{refreshes}");
    assert_eq!((outcome.cause, outcome.stop), (Cause::Quit, Stop::Sent));
    assert!((Micros(19_000_000)..Micros(19_100_000)).contains(&outcome.at), "{outcome:?}");
    assert!(sent.ends_with(&[(sent[sent.len() - 1].0, "buzzer off")]));
}

/// A receiver that trusts every length, and looks for the next header only after the claimed frame.
#[derive(Default)]
struct Trusting {
    bytes: Vec<u8>,
    stops: usize,
}

impl Trusting {
    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.bytes.push(*byte);
            match self.bytes[..] {
                [0xFF] | [0xFF, 0xFE] | [0xFF, 0xFE, _] => {}
                [0xFF, 0xFE, _, length, ..] if self.bytes.len() < 5 + usize::from(length) => {}
                [0xFF, 0xFE, ..] => {
                    self.stops += usize::from(self.bytes == stop().to_frame());
                    self.bytes.clear();
                }
                [.., 0xFF] => self.bytes = vec![0xFF],
                _ => self.bytes.clear(),
            }
        }
    }
}

#[test]
fn a_receiver_that_trusts_lengths_is_synchronized_before_the_first_stop() {
    let raw = |length: usize| format!("raw 0x40 {}\nrocker x=10\nwait 1s\n", "0x11 ".repeat(length));
    let mut scripts =
        vec!["servo 1 1500; pid speed speed=1,2 position=3,4,5 yaw=6,7,8\nwheels 1 2 3 4\nwait 1s\n".to_owned()];
    scripts.extend([0, 1, 9, 10, 11, 100, 254, 255].map(raw));
    for script in scripts {
        let timeline = timeline(&script);
        // Ended while it drives: the stop follows the flush.
        let meddle = |now, order, given| match order {
            Order::Wait { .. } if given > 0 && now < MS * 500 => Some((MS * 500, Input::Signal(2))),
            _ => None,
        };
        let (world, _) = World::run(meddle, &timeline);
        let flushed = world.given.iter().position(|(_, bytes)| bytes.starts_with(&[0; 12])).unwrap();
        let bytes = |given: &[(Nanos, Vec<u8>)]| given.iter().flat_map(|(_, bytes)| bytes.clone()).collect::<Vec<u8>>();
        let (before, stop) = (bytes(&world.given[..flushed]), bytes(&world.given[flushed..]));
        assert!(!before.is_empty());
        for cut in 0..=before.len() {
            let mut once = Trusting::default();
            once.take(&before[..cut]);
            once.take(&stop);
            assert_eq!(once.stops, 3, "{script} cut at {cut}");
            // The player's stop is also truncated, by that of its guard.
            for second in 0..=stop.len() {
                let mut twice = Trusting::default();
                twice.take(&before[..cut]);
                twice.take(&stop[..second]);
                twice.stops = 0;
                twice.take(&stop);
                assert_eq!(twice.stops, 3, "{script} cut at {cut}, and its stop at {second}");
            }
        }
    }
}
