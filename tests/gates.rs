//! Gates under a simulated clock: when they open, what is sent while they are closed, and that every early end is a stop.

use crate::support::board::{OnBoard, board, state};
use crate::support::far::commands;
use motionseq::board::{Hundredths, Report, raspblock};
use motionseq::playback::{Cause, GateEnd, Input, Notice, Order, Outcome, Passage, Player, Stop};
use motionseq::program::Options;
use motionseq::source::{Disk, Source, Sources};
use motionseq::timeline::{Position, Timeline};
use motionseq::units::{Micros, Nanos};

const MS: Nanos = Nanos::from_millis(1);

fn timeline(script: &str) -> Timeline {
    motionseq::compile(&Source::new("test", script).into(), &Options::default())
        .timeline()
        .expect("the script compiles")
}

/// What happens at a time of the run.
#[derive(Clone, Copy, Debug)]
enum Event {
    Input(Input),
    /// The board reports this yaw, in degrees.
    Yaw(f64),
}

use Event::{Input as In, Yaw};

/// A run: what was sent in milliseconds, one command each, and how it ended.
struct Played {
    sent: Vec<(u64, String)>,
    notices: Vec<Notice>,
    outcome: Outcome,
}

impl Played {
    fn passages(&self) -> Vec<(usize, u64, GateEnd)> {
        let passages = self.notices.iter().filter_map(|notice| match notice {
            Notice::Passed(Passage { gate, took, end }) => Some((*gate, took.0 / MS.0, *end)),
            _ => None,
        });
        passages.collect()
    }

    /// When each of these commands was sent.
    fn times(&self, command: &str) -> Vec<u64> {
        self.sent.iter().filter(|(_, sent)| sent == command).map(|(at, _)| *at).collect()
    }
}

fn yaw(degrees: f64) -> Report {
    raspblock::report(Hundredths(1_200), Hundredths((degrees * 100.0).round() as i32))
}

/// Plays a timeline while these things happen, at times in milliseconds.
fn play(timeline: &Timeline, events: &[(u64, Event)]) -> Played {
    play_from(Player::new(timeline, MS * 50), events)
}

fn play_from(mut player: Player<'_>, events: &[(u64, Event)]) -> Played {
    let mut events = events.iter().map(|(at, event)| (MS * *at, *event)).peekable();
    let (mut sent, mut notices) = (Vec::new(), Vec::new());
    let (mut now, mut input) = (Nanos::ZERO, Input::Tick);
    for _ in 0..100_000 {
        let order = player.poll(now, input, &mut |notice| notices.push(notice));
        if let Some(outcome) = player.outcome() {
            return Played { sent, notices, outcome };
        }
        let until = match order {
            Order::Write => {
                sent.extend(commands(player.bytes()).iter().map(|command| (now.0 / MS.0, command.said())));
                input = Input::Wrote(player.bytes().len());
                continue;
            }
            // The shell continues it at once.
            Order::Halt { .. } | Order::Suspend => {
                input = Input::Tick;
                continue;
            }
            Order::Wait { until, .. } => until,
            Order::Pause { until } => {
                (now, input) = (until, Input::Tick);
                continue;
            }
            Order::Stay => Nanos::MAX,
            other => panic!("{other:?}"),
        };
        assert!(until >= now || player.is_gate_ending(), "a wait that does not wait");
        input = Input::Tick;
        match events.next_if(|(at, _)| *at <= until) {
            Some((at, event)) => {
                now = now.max(at);
                match event {
                    In(event) => input = event,
                    Yaw(degrees) => player.hear(now, yaw(degrees), &mut |notice| notices.push(notice)),
                }
            }
            None => {
                assert!(until < MS * 3_000_000, "nothing ends this run");
                now = until;
            }
        }
    }
    panic!("the run never ends");
}

const TURN: &str = "wait 200ms\nrocker z=20\nwait until turned > 10deg within 2s\nstop\nwait 100ms\nservo 1 1500\n";

#[test]
fn a_gate_opens_with_the_report_that_matches_and_the_script_continues_from_there() {
    let reports = [(150, Yaw(3.0)), (330, Yaw(8.0)), (430, Yaw(13.0)), (530, Yaw(13.01))];
    let run = play(&timeline(TURN), &reports);
    assert_eq!(run.outcome.cause, Cause::Finished);
    assert_eq!(run.passages(), [(0, 330, GateEnd::Matched(Hundredths(1_001)))]);
    // Refreshed every 50 ms while it waits, and stopped at once.
    assert_eq!(run.times("rocker x=0 y=0 z=20"), [200, 250, 300, 350, 400, 450, 500]);
    assert_eq!((run.times("stop"), run.times("servo 1 1500")), (vec![530], vec![630]));
    // The time of the script is that of a run without a gate.
    assert_eq!((run.outcome.at, run.outcome.extra), (Micros(300_000), 6));
}

#[test]
fn only_a_report_after_the_gate_began_counts() {
    let script = timeline("wait 200ms\nwait until yaw > 10deg within 1s\nservo 1 1500\n");
    let run = play(&script, &[(150, Yaw(20.0)), (400, Yaw(20.0))]);
    assert_eq!(run.passages(), [(0, 200, GateEnd::Matched(Hundredths(2_000)))]);
}

#[test]
fn turned_goes_on_across_the_ends_of_the_scale() {
    let script = timeline("wait 200ms\nrocker z=20\nwait until turned > 355deg within 9s\nstop\n");
    // Three quarters of a turn in steps of 90 degrees, then another 86.
    let reports = [(150, 170.0), (300, -100.0), (400, -10.0), (500, 80.0), (600, 166.0)];
    let run = play(&script, &reports.map(|(at, degrees)| (at, Yaw(degrees))));
    assert_eq!(run.passages(), [(0, 400, GateEnd::Matched(Hundredths(35_600)))]);
    // Counterclockwise is negative, and no way to go around.
    let script = timeline("wait 200ms\nrocker z=-20\nwait until turned < -20deg within 9s\nstop\n");
    let run = play(&script, &[(150, Yaw(-175.0)), (300, Yaw(175.0)), (400, Yaw(164.9))]);
    assert_eq!(run.passages(), [(0, 200, GateEnd::Matched(Hundredths(-2_010)))]);
}

#[test]
fn without_a_report_before_it_turned_counts_from_the_first() {
    let script = timeline("rocker z=20\nwait until turned > 5deg within 2s\nstop\n");
    let run = play(&script, &[(100, Yaw(50.0)), (200, Yaw(54.0)), (300, Yaw(56.0))]);
    assert_eq!(run.passages(), [(0, 300, GateEnd::Matched(Hundredths(600)))]);
}

/// Reports often enough that the board is not silent, and one that matches at a time in milliseconds.
fn reports_until(last: u64) -> Vec<(u64, Event)> {
    let mut reports = vec![(150, Yaw(0.0)), (600, Yaw(1.0)), (1_000, Yaw(2.0)), (1_500, Yaw(3.0)), (1_900, Yaw(4.0))];
    reports.push((last, Yaw(30.0)));
    reports
}

#[test]
fn a_report_at_the_deadline_opens_a_gate_and_a_later_one_does_not() {
    let in_time = play(&timeline(TURN), &reports_until(2_200));
    assert_eq!(in_time.passages(), [(0, 2_000, GateEnd::Matched(Hundredths(3_000)))]);
    let late = play(&timeline(TURN), &reports_until(2_201));
    let Cause::Gate(Passage { gate: 0, took, end: GateEnd::TimedOut(Some(seen)) }) = late.outcome.cause else {
        panic!("{:?}", late.outcome)
    };
    assert_eq!((took, seen.least, seen.most), (MS * 2_000, Hundredths(100), Hundredths(400)));
    let words = "the values were 1.00deg to 4.00deg, the last 4.00deg";
    assert_eq!(GateEnd::TimedOut(Some(seen)).words("deg"), words);
    assert_stopped(&late);
}

#[test]
fn a_gate_that_may_continue_does_so_at_its_deadline() {
    let script = timeline("wait go within 300ms or continue\nservo 1 1500\n");
    let run = play(&script, &[]);
    assert_eq!((run.outcome.cause, run.times("servo 1 1500")), (Cause::Finished, vec![300]));
    assert_eq!(run.passages(), [(0, 300, GateEnd::Continued(None))]);
}

#[test]
fn a_robot_that_drives_at_a_gate_needs_reports() {
    for script in [TURN.to_owned(), TURN.replace("within 2s", "within 2s or continue")] {
        let run = play(&timeline(&script), &[(150, Yaw(0.0)), (400, Yaw(1.0))]);
        let Cause::Gate(Passage { end: GateEnd::Silent, took, .. }) = run.outcome.cause else {
            panic!("{:?}", run.outcome)
        };
        assert_eq!(took, MS * 700);
        assert_stopped(&run);
    }
    // At rest, it may be silent until the deadline.
    let script = timeline("wait until yaw > 10deg within 2s\nservo 1 1500\n");
    let run = play(&script, &[(1_900, Yaw(20.0))]);
    assert_eq!(run.outcome.cause, Cause::Finished);
}

/// After an early end: the stop, and the board at rest.
fn assert_stopped(run: &Played) {
    let stops = run.sent.iter().rev().take_while(|(_, sent)| sent != "rocker x=0 y=0 z=20");
    let mut stops: Vec<&str> = stops.map(|(_, sent)| sent.as_str()).collect();
    stops.reverse();
    assert!(stops.starts_with(&["stop", "stop", "stop", "buzzer off"]), "{stops:?}");
    assert_eq!(run.outcome.stop, Stop::Sent);
}

#[test]
fn a_go_counts_only_while_a_gate_waits_for_it() {
    let script = timeline("wait 100ms\nwait go\nservo 1 1500\nwait go\nservo 1 1600\n");
    let run = play(&script, &[(50, In(Input::Go)), (400, In(Input::Go)), (900, In(Input::Go))]);
    assert_eq!((run.times("servo 1 1500"), run.times("servo 1 1600")), (vec![400], vec![900]));
    assert_eq!(run.passages(), [(0, 300, GateEnd::Go), (1, 500, GateEnd::Go)]);
}

#[test]
fn what_is_written_before_a_gate_is_shown_before_it() {
    let script = timeline("say \"one\"\nmark first\nwait go\nsay \"two\"\nmark second\n");
    let run = play(&script, &[(400, In(Input::Go))]);
    let order = run.notices.iter().filter_map(|notice| match notice {
        Notice::Say { cue, .. } => Some(format!("say {cue}")),
        Notice::Marked { mark } => Some(format!("mark {mark}")),
        Notice::Passed(_) => Some("open".to_owned()),
        _ => None,
    });
    assert_eq!(order.collect::<Vec<_>>(), ["mark 0", "say 0", "open", "mark 1", "say 1"]);
}

#[test]
fn the_drive_is_refreshed_once_more_if_its_next_frame_would_come_too_late() {
    // The next scripted frame is a refresh 50 ms after the gate.
    let script = timeline("rocker z=20\nwait go within 1s\nwait 120ms\nstop\n");
    let run = play(&script, &[(80, In(Input::Go))]);
    assert_eq!(run.times("rocker x=0 y=0 z=20"), [0, 50, 80, 130, 180]);
    // Here it is soon enough.
    let script = timeline("rocker z=20\nwait 40ms\nwait go within 1s\nwait 120ms\nstop\n");
    let run = play(&script, &[(60, In(Input::Go))]);
    assert_eq!(run.times("rocker x=0 y=0 z=20"), [0, 50, 70, 120, 170]);
}

#[test]
fn a_pause_stops_the_robot_and_the_time_of_a_gate() {
    let script = timeline("rocker z=20\nwait go within 300ms\nstop\n");
    let pause = [(100, In(Input::Pause)), (5_000, In(Input::Go)), (5_100, In(Input::Resume))];
    let run = play(&script, &[pause.as_slice(), &[(5_290, In(Input::Go))]].concat());
    assert_eq!(run.outcome.cause, Cause::Finished);
    // A go in the pause does not count.
    assert_eq!(run.passages(), [(0, 290, GateEnd::Go)]);
    // Nothing is sent between the stop of the pause and its end.
    let drives = run.times("rocker x=0 y=0 z=20");
    assert_eq!(drives, [0, 50, 5_100, 5_150, 5_200, 5_250]);
    // The rest of the limit passes after the pause.
    let run = play(&script, &[pause.as_slice(), &[(5_301, In(Input::Go))]].concat());
    assert_eq!(run.outcome.cause, Cause::Gate(Passage { gate: 0, took: MS * 300, end: GateEnd::TimedOut(None) }));
}

#[test]
fn reports_in_a_pause_open_nothing_but_a_turn_in_it_counts() {
    let reports = [(150, Yaw(0.0)), (300, In(Input::Pause)), (1_000, Yaw(9.0)), (1_100, Yaw(12.0))];
    let run = play(&timeline(TURN), &[reports.as_slice(), &[(2_000, In(Input::Resume)), (2_100, Yaw(12.5))]].concat());
    assert_eq!(run.passages(), [(0, 200, GateEnd::Matched(Hundredths(1_250)))]);
}

#[test]
fn a_gate_is_a_step_and_needs_its_own_go() {
    let script = timeline("servo 1 1500\nwait go\nservo 1 1600\n");
    // The gate is shown, and waits for another step. Its time does not count.
    let steps = [100, 200, 9_000, 9_100].map(|at| (at, In(Input::Step)));
    let run =
        play_from(Player::new(&script, MS * 50).paused(), &[steps.as_slice(), &[(9_200, In(Input::Resume))]].concat());
    assert_eq!((run.times("servo 1 1500")[0], run.times("servo 1 1600")[0]), (100, 9_100));
    assert_eq!(run.passages(), [(0, 0, GateEnd::Go)]);
    // So a step ends a gate at which the run was paused, and a resumed run waits at a gate that is a step.
    let script = timeline("wait go within 3s\nservo 1 1600\n");
    let run = play(&script, &[(700, In(Input::Pause)), (5_000, In(Input::Step)), (6_000, In(Input::Resume))]);
    assert_eq!((run.outcome.cause, run.passages()), (Cause::Finished, vec![(0, 700, GateEnd::Go)]));
    let run = play_from(
        Player::new(&script, MS * 50).paused(),
        &[(100, In(Input::Step)), (500, In(Input::Resume)), (900, In(Input::Go))],
    );
    assert_eq!(run.passages(), [(0, 400, GateEnd::Go)]);
}

#[test]
fn a_second_pause_inside_of_a_pause_changes_no_time() {
    let script = timeline("wait go within 3s or continue\nservo 1 1600\n");
    // The first pause; another one, as Ctrl-Z begins it; and the end of both.
    let run = play(&script, &[(700, In(Input::Pause)), (5_000, In(Input::Suspend)), (9_000, In(Input::Resume))]);
    assert_eq!(run.passages(), [(0, 3_000, GateEnd::Continued(None))]);
}

#[test]
fn a_run_that_ends_at_a_gate_names_it() {
    let script = timeline("servo 1 1500\nwait go\nservo 1 1600\n");
    let run = play(&script, &[(700, In(Input::Quit))]);
    assert_eq!(run.passages(), [(0, 700, GateEnd::Stopped)]);
    assert_eq!(run.outcome.place, Some(script.gates[0].span));
}

#[test]
fn a_gate_that_opens_late_is_late() {
    let script = timeline("rocker z=20\nwait go within 1s or continue\nstop\n");
    for input in [Input::Go, Input::Tick] {
        let mut player = Player::new(&script, MS * 50);
        let mut none = |_| {};
        assert_eq!(player.poll(Nanos::ZERO, Input::Tick, &mut none), Order::Write);
        let count = player.bytes().len();
        player.poll(Nanos::ZERO, Input::Wrote(count), &mut none);
        // The machine slept past the limit of the gate: the robot may have stopped, and must not start again.
        assert_eq!(player.poll(MS * 1_500, input, &mut none), Order::Halt { discards: true });
    }
}

#[test]
fn a_go_while_the_port_is_blocked_is_not_lost() {
    let script = timeline("rocker z=20\nwait go within 1s\nstop\n");
    let mut player = Player::new(&script, MS * 50);
    let mut none = |_| {};
    player.poll(Nanos::ZERO, Input::Tick, &mut none);
    player.poll(Nanos::ZERO, Input::Wrote(player.bytes().len()), &mut none);
    assert_eq!(player.poll(MS * 50, Input::Tick, &mut none), Order::Write);
    let count = player.bytes().len();
    assert!(matches!(player.poll(MS * 51, Input::Blocked, &mut none), Order::Wait { writable: true, .. }));
    player.poll(MS * 52, Input::Go, &mut none);
    player.poll(MS * 53, Input::Wrote(count), &mut none);
    assert_eq!(player.closed_gate(), None);
}

#[test]
fn a_pass_of_gates_alone_can_be_repeated() {
    let script = timeline("servo 1 1500\nwait go\nservo 1 1600\nwait go\n");
    let goes = [100, 200, 300, 400, 500].map(|at| (at, In(Input::Go)));
    let run = play_from(
        Player::new(&script, MS * 50).again_and_again(&script),
        &[goes.as_slice(), &[(600, In(Input::Quit))]].concat(),
    );
    assert_eq!((run.times("servo 1 1500"), run.times("servo 1 1600")), (vec![0, 200, 400], vec![100, 300, 500]));
    // Gates count like frames.
    let gate = timeline("wait go\n");
    assert!(motionseq::timeline::passes(&gate, &gate, 100_000_000, 10_000_000).is_none());
}

#[test]
fn reports_from_before_a_gate_are_read_before_it_closes() {
    let script = timeline("wait 100ms\nwait until yaw > 3deg within 1s\n");
    let mut player = Player::new(&script, MS * 50);
    assert_eq!(player.poll(Nanos::ZERO, Input::Tick, &mut |_| {}), Order::Write);
    assert!(!player.judges_at(MS * 99) && player.judges_at(MS * 100));
}

#[test]
fn every_pass_has_its_own_gates() {
    let script = timeline("servo 1 1500\nwait go\nservo 1 1600\nwait 100ms\n");
    let events = [(100, In(Input::Go)), (500, In(Input::Go)), (900, In(Input::Go)), (950, In(Input::Quit))];
    let run = play_from(Player::new(&script, MS * 50).again_and_again(&script), &events);
    assert_eq!((run.times("servo 1 1500"), run.times("servo 1 1600")), (vec![0, 200, 600], vec![100, 500, 900]));
}

#[test]
fn the_end_of_the_lines_fails_a_gate_that_waits_for_one() {
    let script = timeline("wait go\nservo 1 1500\n");
    let run = play(&script, &[(100, In(Input::GoEnded))]);
    let passage = Passage { gate: 0, took: MS * 100, end: GateEnd::InputEnded };
    assert_eq!(run.outcome.cause, Cause::Gate(passage));
}

/// Every cause of an early end except a blocked port.
const ENDS: [Input; 6] =
    [Input::Signal(2), Input::HungUp, Input::Failed(Some(5)), Input::Unguarded, Input::Panicked, Input::Quit];

#[test]
fn every_script_cut_at_every_gate_ends_at_rest() {
    let mut gates = 0;
    for entry in std::fs::read_dir("scripts").unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "motion") {
            continue;
        }
        let sources = Sources::read(&path, Disk).unwrap();
        let timelines = motionseq::compile(&sources, &Options::default()).timelines;
        assert!(!timelines.is_empty(), "{} does not compile", path.display());
        // Several robots are played together: tests of those have their gates.
        let Ok([timeline]) = <[Timeline; 1]>::try_from(timelines) else { continue };
        let timeline = Timeline { expects: Vec::new(), ..timeline };
        for gate in 0..timeline.gates.len() {
            gates += 1;
            for end in ENDS {
                let outcome = cut_at_gate(&timeline, gate, end);
                assert_eq!(outcome.stop, Stop::Sent, "{} at gate {gate}", path.display());
            }
        }
    }
    assert!(gates >= 4, "{gates} gates");
}

/// Plays until a gate has waited for a while, ends the run there, and checks that the board is at rest.
fn cut_at_gate(timeline: &Timeline, gate: usize, end: Input) -> Outcome {
    let mut player = Player::new(timeline, MS * 50);
    let (mut now, mut input, mut bytes, mut closed) = (Nanos::ZERO, Input::Tick, Vec::new(), Nanos::MAX);
    loop {
        let before = player.closed_gate();
        let order = player.poll(now, input, &mut |_| {});
        if let Some(outcome) = player.outcome() {
            assert!(state(&commands(&bytes)).at_rest(board()));
            return outcome;
        }
        if player.closed_gate() != before {
            closed = now;
        }
        input = Input::Tick;
        match order {
            Order::Write => {
                bytes.extend_from_slice(player.bytes());
                input = Input::Wrote(player.bytes().len());
            }
            Order::Wait { .. } if player.closed_gate() == Some(gate) && now > closed + MS * 120 => input = end,
            Order::Wait { until, .. } => {
                now = until.min(now + MS * 60);
                // Earlier gates open.
                if player.closed_gate().is_some_and(|closed| closed < gate) {
                    input = Input::Go;
                    player.answer(Some(Hundredths(99_999)));
                }
                if player.closed_gate().is_some() {
                    player.hear(now, yaw(0.0), &mut |_| {});
                }
            }
            Order::Pause { until } => now = until,
            _ => {}
        }
    }
}

#[test]
fn a_flood_of_reports_delays_no_refresh_and_opens_no_gate_by_itself() {
    let flood = (0..5_000).map(|number| (150 + number / 10, Yaw(f64::from(u32::try_from(number % 10).unwrap()))));
    let mut flood: Vec<(u64, Event)> = flood.collect();
    flood.push((700, Yaw(40.0)));
    let run = play(&timeline(TURN), &flood);
    assert_eq!(run.passages().len(), 1);
    let drives = run.times("rocker x=0 y=0 z=20");
    assert!(drives.windows(2).all(|pair| pair[1] - pair[0] <= 50), "{drives:?}");
}

#[test]
fn a_machine_that_slept_at_a_gate_sends_nothing_late() {
    let script = timeline("rocker z=20\nwait go within 1s\nstop\n");
    let mut player = Player::new(&script, MS * 50);
    let mut none = |_| {};
    assert_eq!(player.poll(Nanos::ZERO, Input::Tick, &mut none), Order::Write);
    let count = player.bytes().len();
    assert_eq!(
        player.poll(Nanos::ZERO, Input::Wrote(count), &mut none),
        Order::Wait { until: MS * 50, writable: false }
    );
    // 700 ms later, the frame that was due after 50 ms is not sent.
    assert_eq!(player.poll(MS * 700, Input::Tick, &mut none), Order::Halt { discards: true });
}

#[test]
fn a_part_skips_the_gates_before_it() {
    let script =
        timeline("wait go\nservo 1 1500\nwait 1s\nmark a\nwait go\nmark b\nservo 1 1600\nwait go\nservo 1 1700\n");
    let cut = |from: Position, to: Option<Position>| {
        let clip = motionseq::timeline::Clip::new(from, to, Micros::ZERO);
        let cut = motionseq::timeline::clip(&script, &clip, &motionseq::board::State::default());
        let events = cut.events.iter().map(|event| board().show(&event.command).to_string()).collect::<Vec<_>>();
        (cut.gates.iter().map(|gate| gate.next.events).collect::<Vec<_>>(), events)
    };
    let all = |commands: &[&str]| commands.iter().map(ToString::to_string).collect::<Vec<_>>();
    let position = |name: &str| {
        let mark = script.marks.iter().find(|mark| mark.name == name).unwrap();
        Position { at: mark.at, gates: mark.gates }
    };
    let before = Position::before(&script, Micros::SECOND);
    let commands = ["servo 1 1500", "servo 1 1600", "servo 1 1700"];
    assert_eq!(cut(position("a"), None), (vec![1, 2], all(&commands)));
    assert_eq!(cut(before, None), (vec![1, 2], all(&commands)));
    // The gate between the marks is not part of it. The first frame brings the servo to where it was.
    assert_eq!(cut(position("b"), None), (vec![2], all(&commands)));
    assert_eq!(cut(Position::default(), Some(position("a"))), (vec![0], all(&commands[..1])));
    assert_eq!(cut(Position::default(), Some(position("b"))), (vec![0, 1], all(&commands[..1])));
}

#[test]
fn the_same_answers_give_the_same_bytes() {
    let events = [(400, In(Input::Go)), (900, In(Input::Go))];
    let script = timeline("rocker z=20\nwait go within 1s\nservo 1 1500 -> 1900 over 200ms\nwait go within 1s\nstop\n");
    let [first, second] = [(); 2].map(|()| play(&script, &events).sent);
    assert_eq!(first, second);
}
