//! The player under a clock that jumps: what is sent when, and that every early end is a stop.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use motionseq::board::{Command, Decoder, Item, State};
use motionseq::playback::{Cause, Input, Notice, Order, Outcome, Player, Stop};
use motionseq::program::Options;
use motionseq::source::Source;
use motionseq::timeline::{Timeline, write_bin};

const MS: u64 = 1_000_000;
const MAX_LATE: u64 = 50 * MS;

fn timeline(script: &str) -> Timeline {
    motionseq::compile(&Source::new("test", script).into(), &Options::default()).timeline.expect("the script compiles")
}

/// A script that is shipped, with the files that it uses.
fn shipped(path: &std::path::Path) -> Timeline {
    motionseq::compile(&Source::read(path).unwrap().into(), &Options::default()).timeline.expect("the script compiles")
}

fn rendered(timeline: &Timeline) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_bin(timeline.events(), &mut bytes).unwrap();
    bytes
}

/// The commands in a stream; whatever is cut or garbled is passed over, as a board would.
fn commands(bytes: &[u8]) -> Vec<Command> {
    let mut found = Vec::new();
    let mut decoder = Decoder::new();
    let mut take = |item: Item<'_>| {
        if let Item::Frame(frame) = item {
            found.push(Command::decode_or_raw(frame));
        }
    };
    decoder.feed(bytes, &mut take);
    decoder.finish(&mut take);
    found
}

/// What a world without time and port does to a player.
struct World<F> {
    now: u64,
    /// What the port was given, with the time; `None` where it was flushed.
    given: Vec<(u64, Vec<u8>)>,
    notices: Vec<Notice>,
    /// Asked at every order: what happens instead of what was ordered.
    meddle: F,
}

impl<F: FnMut(u64, Order, usize) -> Option<(u64, Input)>> World<F> {
    fn run(meddle: F, timeline: &Timeline) -> (Self, Outcome) {
        let mut world = World { now: 0, given: Vec::new(), notices: Vec::new(), meddle };
        let mut player = Player::new(timeline, MAX_LATE);
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
            input = match order {
                Order::Write => {
                    world.given.push((world.now, player.bytes().to_vec()));
                    Input::Wrote(player.bytes().len())
                }
                Order::Wait { until, .. } | Order::Pause { until } => {
                    assert!(until > world.now, "a wait that does not wait burns the processor");
                    world.now = until;
                    Input::Tick
                }
                Order::Discard | Order::Done | Order::Suspend => Input::Tick,
                Order::Stay => panic!("nobody is there to end the pause"),
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
    let writes: Vec<(u64, usize)> = world.given.iter().map(|(at, bytes)| (at / MS, commands(bytes).len())).collect();
    assert_eq!(writes, [(0, 3), (50, 1), (100, 1), (120, 2), (220, 1)]);
    assert!(world.notices.contains(&Notice::Say { cue: 0 }));
    assert_eq!(
        (outcome.cause, outcome.stop, outcome.sent, outcome.at_us),
        (Cause::Finished, Stop::NotNeeded, 8, 270_000)
    );
}

#[test]
fn a_port_that_takes_little_at_once_gets_every_byte_in_order() {
    let timeline = timeline(SCRIPT);
    let mut full = false;
    let meddle = |now, order, _| match order {
        Order::Write if full => {
            full = false;
            Some((now, Input::Blocked))
        }
        Order::Write => {
            full = true;
            Some((now + MS / 10, Input::Wrote(1)))
        }
        Order::Wait { writable: true, .. } => Some((now + MS / 10, Input::Tick)),
        _ => None,
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(world.bytes(), rendered(&timeline));
    assert_eq!((outcome.cause, outcome.sent), (Cause::Finished, 8));
}

/// After an early end: three stops 20 ms apart, buzzer off, nothing else, and the board at rest.
fn assert_stopped<F: FnMut(u64, Order, usize) -> Option<(u64, Input)>>(world: &World<F>, before: usize) {
    let end = &world.given[before..];
    let frames: Vec<String> =
        end.iter().flat_map(|(_, bytes)| commands(bytes)).map(|command| command.to_string()).collect();
    assert_eq!(frames[..4], ["stop", "stop", "stop", "buzzer off"]);
    // Behind it only what the script's `on abort` says, which is never for the drive.
    assert!(frames[4..].iter().all(|frame| frame.starts_with("servo") || frame.starts_with("buzzer")), "{frames:?}");
    assert_eq!(end[1].0 - end[0].0, 20 * MS);
    assert_eq!(end[2].0 - end[1].0, 20 * MS);
    let mut state = State::default();
    for command in commands(&world.bytes()) {
        state.apply(&command);
    }
    assert!(state.at_rest());
}

#[test]
fn a_signal_at_any_frame_of_any_script_leaves_the_board_at_rest() {
    for path in std::fs::read_dir("scripts").unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file()) {
        let timeline = shipped(&path);
        let (all, _) = World::run(|_, _, _| None, &timeline);
        for cut in 0..all.given.len() {
            let mut sent = false;
            let meddle = |now, order, given| {
                let now_is_the_time = given == cut && !sent && !matches!(order, Order::Discard);
                now_is_the_time.then(|| {
                    sent = true;
                    (now, Input::Signal(2))
                })
            };
            let (world, outcome) = World::run(meddle, &timeline);
            assert_eq!(
                (outcome.cause, outcome.stop),
                (Cause::Signal(2), Stop::Sent),
                "{} cut at {cut}",
                path.display()
            );
            assert_stopped(&world, cut);
        }
    }
}

#[test]
fn a_second_signal_skips_nothing() {
    let timeline = timeline(SCRIPT);
    let meddle = |now, order, given| {
        (given > 0 && !matches!(order, Order::Write | Order::Discard)).then_some((now + MS, Input::Signal(15)))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(15), Stop::Sent));
    assert_stopped(&world, 1);
}

#[test]
fn what_is_queued_is_thrown_away_before_the_stop() {
    let timeline = timeline(SCRIPT);
    let mut orders = Vec::new();
    let meddle = |now, order, given| {
        orders.push(order);
        (orders.len() == 2).then_some((now, Input::Signal(2))).filter(|_| given == 1)
    };
    World::run(meddle, &timeline);
    let write = orders.iter().rposition(|order| *order == Order::Discard).unwrap();
    assert_eq!(orders[write + 1], Order::Write);
}

#[test]
fn a_frame_that_is_too_late_is_not_sent() {
    let timeline = timeline("servo 1 1500\nat 100ms servo 1 1600\nat 101ms servo 1 1700");
    // The machine sleeps through the second frame and most of the patience.
    let meddle = |now, order, _| {
        matches!(order, Order::Wait { until, .. } if until == 100 * MS && now < until)
            .then_some((151 * MS, Input::Tick))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(outcome.cause, Cause::Late(51 * MS));
    assert_eq!(world.given[0].1, commands(&world.given[0].1)[0].to_frame());
    assert_stopped(&world, 1);
    // The place is that of the frame that was not sent.
    assert_eq!(outcome.place.unwrap().start, 22);
}

#[test]
fn a_refresh_that_a_newer_drive_frame_has_overtaken_is_dropped_and_told() {
    let timeline = timeline("refresh 10ms\nrocker x=10 for 60ms");
    // 45 ms late at the first refresh: four of them are due at once, and only the newest is sent.
    let meddle = |now, order, given| {
        (given == 1 && matches!(order, Order::Wait { .. }) && now == 0).then_some((45 * MS, Input::Tick))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    let dropped: Vec<_> = world
        .notices
        .iter()
        .filter_map(|notice| match notice {
            Notice::Dropped { event } => Some(timeline.events()[*event].at_us / 1_000),
            _ => None,
        })
        .collect();
    assert_eq!(dropped, [10, 20, 30]);
    assert_eq!((outcome.cause, outcome.dropped, outcome.sent), (Cause::Finished, 3, 4));
    // What was given, with what was dropped, is what was rendered.
    assert_eq!(world.bytes().len() + 3 * 13, rendered(&timeline).len());
}

#[test]
fn a_port_that_stops_taking_bytes_ends_the_run() {
    let timeline = timeline(SCRIPT);
    let meddle = |now, order, given| (given >= 1 && order == Order::Write).then_some((now, Input::Blocked));
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop, outcome.sent), (Cause::Stalled, Stop::NotSent, 3));
    // It is given up: the stop has half a second.
    assert!(world.now < 700 * MS);
}

#[test]
fn a_port_that_takes_bytes_again_after_the_flush_gets_the_stop() {
    let timeline = timeline(SCRIPT);
    let mut flushed = false;
    let meddle = |now, order, given| {
        flushed |= order == Order::Discard;
        (given >= 1 && !flushed && order == Order::Write).then_some((now, Input::Blocked))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!((outcome.cause, outcome.stop), (Cause::Stalled, Stop::Sent));
    assert_stopped(&world, 1);
}

#[test]
fn a_port_that_is_gone_is_not_stopped_and_says_so() {
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
    let frames: Vec<String> = commands(&world.bytes()).iter().skip(3).map(ToString::to_string).collect();
    assert_eq!(frames, ["stop", "stop", "buzzer off"]);
}

#[test]
fn on_abort_follows_the_stop_at_its_times() {
    let script = "rocker x=10 for 1s\non abort { buzzer on for 200ms; servo 1 1000 -> 2000 over 40ms }";
    let timeline = timeline(script);
    let meddle = |now, order, given| {
        (given == 1 && !matches!(order, Order::Write | Order::Discard)).then_some((now, Input::Signal(2)))
    };
    let (world, outcome) = World::run(meddle, &timeline);
    assert_eq!(outcome.stop, Stop::Sent);
    let sent: Vec<(u64, String)> = world
        .given
        .iter()
        .flat_map(|(at, bytes)| commands(bytes).into_iter().map(move |command| (at / MS, command.to_string())))
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
    // A run that ends as it should sends nothing of it.
    let (world, _) = World::run(|_, _, _| None, &timeline);
    assert_eq!(world.bytes(), rendered(&timeline));
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
        (given == 1 && !matches!(order, Order::Write | Order::Discard)).then_some((now, Input::Signal(2)))
    };
    let (world, _) = World::run(meddle, &timeline);
    let sent: Vec<String> = commands(&world.bytes()).iter().map(ToString::to_string).collect();
    assert_eq!(sent[5..], ["buzzer on", "stop", "buzzer off"]);
}
