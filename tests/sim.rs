//! The virtual board: kinematics against closed forms, battery, reports, silence, faults; and
//! `expect` with reports in any pieces.

use crate::support::board::{OnBoard, board};
use motionseq::board::{Command, Hundredths, Report, ReportDecoder, ReportItem};
use motionseq::faults::{Faults, Faulty};
use motionseq::playback::{Cause, Found, Input, Notice, Order, Player, Verdict};
use motionseq::program::Options;
use motionseq::sim::{Device, Pose, Settings};
use motionseq::source::{Disk, Source, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};
use motionseq::verify::{Answers, Rehearsal, rehearse};
use proptest::prelude::*;

fn timeline(text: &str) -> Timeline {
    let compiled = motionseq::compile(&Source::new("x.motion", text).into(), &Options::default());
    compiled.timelines.into_iter().next().unwrap_or_else(|| panic!("{text}: {:?}", compiled.diagnostics))
}

/// The pose of the robot after a script.
fn pose(text: &str) -> Pose {
    rehearse(&timeline(text), Settings::default(), Faults::default(), &Answers::default()).received.pose
}

fn is_near(pose: Pose, x: f64, y: f64, yaw: f64) {
    let near = |one: f64, two: f64| (one - two).abs() < 0.2;
    assert!(near(pose.x_cm, x) && near(pose.y_cm, y) && near(pose.yaw_deg, yaw), "{pose:?} is not {x} {y} {yaw}");
}

#[test]
fn lines_squares_spins_and_circles_are_what_geometry_says() {
    is_near(pose("rocker y=10 for 2s"), 0.0, 20.0, 0.0);
    is_near(pose("rocker x=-5 for 2s"), -10.0, 0.0, 0.0);
    is_near(pose("yawhold x=3 y=4 for 1s"), 3.0, 4.0, 0.0);
    // A square of lines ends at its start, and so does one that turns by 90° at each corner.
    is_near(pose("rocker y=10 for 1s\nrocker x=10 for 1s\nrocker y=-10 for 1s\nrocker x=-10 for 1s"), 0.0, 0.0, 0.0);
    is_near(pose("repeat 4 { rocker y=10 for 1s\n rocker z=90 for 1s }"), 0.0, 0.0, 360.0);
    // A spin stays in place and returns to its heading.
    is_near(pose("rocker z=120 for 3s"), 0.0, 0.0, 360.0);
    // Forward and turning right is a circle: after half of it, a diameter to the right, 2 · v / ω.
    let radius = 10.0 / (30.0_f64).to_radians();
    is_near(pose("rocker y=10 z=30 for 6s"), 2.0 * radius, 0.0, 180.0);
    is_near(pose("rocker y=10 z=30 for 3s"), radius, radius, 90.0);
    // Moving right and turning right, it goes back.
    is_near(pose("rocker x=10 z=30 for 3s"), radius, -radius, 90.0);
}

#[test]
fn wheels_and_rocker_agree() {
    // The vendor's examples: forward, spin to the left, slide to the left.
    is_near(pose("wheels 2 2 2 2 for 5s"), 0.0, 10.0, 0.0);
    is_near(pose("wheels 2 -2 2 -2 for 5s"), -10.0, 0.0, 0.0);
    let lever = Settings::default().geometry.lever_cm;
    is_near(pose("wheels 2 2 -2 -2 for 5s"), 0.0, 0.0, -(2.0 / lever).to_degrees() * 5.0);
    // FR, RR, RL, FL of x=3 y=5, by the mapping of the protocol table.
    let straight = pose("rocker x=3 y=5 for 3s");
    is_near(pose("wheels 2 8 2 8 for 3s"), straight.x_cm, straight.y_cm, 0.0);
}

#[test]
fn a_displacement_goes_where_the_robot_looks_and_needs_position_mode() {
    let pid = "pid position speed=0,0 position=0,0,0 yaw=0,0,0\n";
    is_near(pose(&format!("{pid}move x=10 y=20\nwait 2s")), 10.0, 20.0, 0.0);
    is_near(pose(&format!("rocker z=90 for 1s\n{pid}move y=20\nwait 2s\nmove z=-90\nwait 2s")), 20.0, 0.0, 0.0);
    // Not there yet: 20 cm take 0.8 s.
    let half = pose(&format!("{pid}move y=20\nwait 400ms"));
    assert!((9.0..12.0).contains(&half.y_cm), "{half:?}");
}

#[test]
fn a_board_without_frames_stops_by_itself() {
    let silent = "refresh off\nrocker y=10 for 3s";
    is_near(pose(silent), 0.0, 5.0, 0.0);
    let mut settings = Settings::default();
    settings.silence = None;
    is_near(
        rehearse(&timeline(silent), settings, Faults::default(), &Answers::default()).received.pose,
        0.0,
        30.0,
        0.0,
    );
    let mut settings = Settings::default();
    settings.silence = Some(Micros(40_000));
    // Shorter than the refresh interval of 50 ms: four fifths of the distance.
    is_near(
        rehearse(&timeline("rocker y=10 for 1s"), settings, Faults::default(), &Answers::default()).received.pose,
        0.0,
        8.0,
        0.0,
    );
}

/// The reports of a board that gets these commands at these times, until a time.
fn reports(faults: &Faults, commands: &[(u64, &str)], until: u64) -> Vec<(u64, Report)> {
    let device = Device::new(std::sync::Arc::clone(crate::support::board::board()), Settings::default());
    let mut board = Faulty::new(device, faults.clone());
    let mut decoder = ReportDecoder::new(crate::support::board::board());
    let mut found = Vec::new();
    let mut commands = commands.iter().peekable();
    for now in (0..=until).step_by(10_000) {
        while let Some((_, text)) = commands.next_if(|(at, _)| *at <= now) {
            let command: Command = timeline(&format!("{text}\n")).events[0].command.clone();
            board.receive(Micros(now), &command.to_frame());
        }
        board.poll(Micros(now));
        decoder.feed(&board.replies(), |item| {
            if let ReportItem::Report(report) = item {
                found.push((now, report));
            }
        });
    }
    found
}

#[test]
fn it_reports_ten_times_a_second_between_start_and_stop_and_once_when_asked() {
    let found =
        reports(&Faults::default(), &[(50_000, "request report-start"), (560_000, "request report-stop")], 1_000_000);
    let times: Vec<u64> = found.iter().map(|(at, _)| *at).collect();
    assert_eq!(times, [150_000, 250_000, 350_000, 450_000, 550_000]);
    assert_eq!(reports(&Faults::default(), &[(20_000, "request voltage")], 500_000).len(), 1);
    // The yaw wraps around; the battery voltage drops while it drives, and recovers afterwards.
    let drive = [
        (0, "request report-start"),
        (0, "rocker z=200"),
        (400_000, "rocker z=200"),
        (800_000, "rocker z=200"),
        (1_000_000, "stop"),
    ];
    let found = reports(&Faults::default(), &drive, 2_000_000);
    let newest = found.last().unwrap().1;
    assert_eq!(newest.value(3), Some(Hundredths(-16_000)));
    let driving = found.iter().find(|(at, _)| *at == 500_000).unwrap().1;
    assert!(
        driving.value(0) < Some(Hundredths(1_160)) && newest.value(0) > Some(Hundredths(1_195)),
        "{driving:?} {newest:?}"
    );
}

#[test]
fn faults_are_read_and_happen_the_same_way_every_time() {
    for text in [
        "drop=101%",
        "drop=5",
        "battery=6V@",
        "unplug",
        "unplug@4",
        "noise",
        "",
        "stall@99999999999999999999s",
        "unplug@18446744073709551615s1000ms",
        "unplug@25h",
        "stall@1s1s",
        "stall@1day",
        "battery=1e9V",
    ] {
        assert!(text.parse::<Faults>().is_err(), "{text}");
    }
    let faults: Faults = "drop=20%, garble=10%, seed=3".parse().unwrap();
    // Requested repeatedly, because a request may be lost too.
    let start: Vec<_> = (0..10).map(|at| (at * 10_000, "request report-start")).collect();
    let (once, twice) = (reports(&faults, &start, 20_000_000), reports(&faults, &start, 20_000_000));
    assert_eq!(once, twice);
    // Of 200 reports a fifth is dropped, and a tenth of the rest garbled; some of those are still
    // reports.
    assert!((110..190).contains(&once.len()), "{}", once.len());
    let silent = "silent".parse().unwrap();
    assert_eq!(reports(&silent, &start, 2_000_000), []);
    let battery = "battery=6.5V@1s".parse().unwrap();
    let found = reports(&battery, &start, 2_000_000);
    assert!(found.len() > 15);
    assert!(found.iter().all(|(at, report)| (report.value(0) == Some(Hundredths(650))) == (*at >= 1_000_000)));
    // Frames to the board are lost too.
    let lossy = "drop=50%".parse().unwrap();
    let rehearsal = rehearse(&timeline("rocker y=10 for 5s"), Settings::default(), lossy, &Answers::default());
    let Rehearsal { received, given, .. } = rehearsal;
    assert_eq!(given, 101);
    assert!((30..70).contains(&received.lost) && received.frames + received.lost == 101, "{received:?}");
}

/// Plays a script with telemetry in pieces at times. Returns the verdicts, and how it ended.
fn judged(script: &str, pieces: &[(u64, Vec<u8>)]) -> (Vec<Verdict>, Cause) {
    let timeline = timeline(script);
    let mut player = Player::new(&timeline, Nanos::from_millis(1_000));
    let mut decoder = ReportDecoder::new(board());
    let mut verdicts = Vec::new();
    let mut pieces = pieces.iter().peekable();
    let (mut now, mut input) = (Nanos::ZERO, Input::Tick);
    loop {
        let mut notify = |notice| {
            if let Notice::Judged(verdict) = notice {
                verdicts.push(verdict);
            }
        };
        let order = player.poll(now, input, &mut notify);
        if let Some(outcome) = player.outcome() {
            return (verdicts, outcome.cause);
        }
        input = Input::Tick;
        match order {
            Order::Write => input = Input::Wrote(player.bytes().len()),
            Order::Wait { until, .. } | Order::Pause { until } => {
                now = pieces.peek().map_or(until, |(at, _)| until.min(Micros(*at).nanos())).max(now);
                while let Some((_, bytes)) = pieces.next_if(|(at, _)| Micros(*at).nanos() <= now) {
                    decoder.feed(bytes, |item| {
                        if let ReportItem::Report(report) = item {
                            player.hear(now, report, &mut notify);
                        }
                    });
                }
            }
            _ => {}
        }
    }
}

fn line(voltage: i32) -> Vec<u8> {
    format!("{{A0:0:0:{voltage}}}#").into_bytes()
}

fn found(script: &str, pieces: &[(u64, Vec<u8>)]) -> Vec<Found> {
    judged(script, pieces).0.into_iter().map(|verdict| verdict.found).collect()
}

#[test]
fn an_expect_judges_the_newest_report_of_the_last_half_second() {
    let script = "wait 1s\nexpect voltage > 10V\n";
    assert_eq!(found(script, &[]), [Found::Nothing]);
    assert_eq!(found(script, &[(400_000, line(1_200))]), [Found::Stale(Nanos::from_millis(600))]);
    assert_eq!(found(script, &[(500_000, line(1_200))]), [Found::Passed(Hundredths(1_200))]);
    assert_eq!(found(script, &[(600_000, line(1_200)), (900_000, line(999))]), [Found::Failed(Hundredths(999))]);
    assert_eq!(found(script, &[(900_000, line(1_000))]), [Found::Failed(Hundredths(1_000))]);
    // Garbled reports do not count.
    assert_eq!(found(script, &[(900_000, b"{A0:0:0:12x0}#{A0:0:1200}#".to_vec())]), [Found::Nothing]);
    let (verdicts, cause) =
        judged("wait 1s\nexpect voltage > 10V\nwait 1s\nexpect voltage > 10V\n", &[(900_000, line(900))]);
    assert_eq!((verdicts.len(), cause), (1, Cause::Expect(verdicts[0])), "the first that fails ends the run");
}

#[test]
fn every_hundredth_of_a_volt_is_what_it_says() {
    for value in 700..1_300 {
        let volts = format!("{}.{:02}V", value / 100, value % 100);
        for (wanted, fits) in [
            (format!("> {volts}"), false),
            (format!(">= {volts}"), true),
            (format!("< {volts}"), false),
            (format!("<= {volts}"), true),
            (format!("== {volts}"), true),
            (format!("in {volts}..{volts}"), true),
        ] {
            let script = format!("wait 100ms\nexpect voltage {wanted}\n");
            let [found] = found(&script, &[(50_000, line(value))])[..] else { panic!("{wanted}") };
            assert_eq!(found.is_passed(), fits, "{wanted}: {found:?}");
        }
    }
}

#[test]
fn every_script_of_the_tests_is_played_as_it_is_rendered() {
    let mut count = 0;
    for entry in std::fs::read_dir("tests/frames").unwrap().map(|entry| entry.unwrap().path()) {
        let Ok(sources) = Sources::read(&entry, Disk) else { continue };
        let is_script = entry.extension().is_some_and(|extension| extension == "motion");
        let compiled = motionseq::compile(&sources, &Options::default());
        let Some(timeline) = compiled.timelines.first().filter(|timeline| is_script && timeline.expects.is_empty())
        else {
            continue;
        };
        let rehearsal = rehearse(timeline, Settings::default(), Faults::default(), &Answers::default());
        assert!(rehearsal.is_complete(timeline), "{}: {:?}", entry.display(), rehearsal.outcome);
        assert_eq!(rehearsal.outcome.dropped, 0, "{}", entry.display());
        count += 1;
    }
    assert!(count > 90, "{count}");
}

#[test]
fn every_rehearsal_comes_to_an_end() {
    let script = "on abort { servo 1 1500 }\nservo 1 1000 -> 1900 over 1s\nrocker y=5 for 1s\nexpect voltage > 1V within 500ms\n";
    let timeline = timeline(script);
    for faults in [
        "stall@0s",
        "unplug@0s",
        "stall@0s,unplug@0s",
        "drop=100%",
        "garble=100%",
        "silent",
        "battery=0V",
        "stall@1s,unplug@1010ms",
        "unplug@1h",
    ] {
        let rehearsal = rehearse(&timeline, Settings::default(), faults.parse().unwrap(), &Answers::default());
        let ends_early = rehearsal.outcome.cause != Cause::Finished;
        assert_eq!(ends_early, !rehearsal.aborted.is_empty(), "{faults}: {:?}", rehearsal.outcome);
        if ends_early {
            assert_eq!(rehearsal.aborted.last().unwrap().command.said(), "servo 1 1500", "{faults}");
        }
    }
}

#[test]
fn too_many_waiting_expects_do_not_compile() {
    let text = format!("together {{\n{}}}\n", "expect voltage > 1V within 1s\n".repeat(65));
    let compiled = motionseq::compile(&Source::new("x.motion", text).into(), &Options::default());
    assert_eq!(
        compiled.diagnostics.iter().next().unwrap().message,
        "more than 64 `expect`s wait for a report at the same time"
    );
}

#[test]
fn within_waits_for_the_first_matching_report() {
    let script = "wait 1s\nexpect voltage in 9.5V..10V within 1s\nservo 1 1500\n";
    // An earlier report does not count, and a later one is too late.
    assert_eq!(found(script, &[(900_000, line(1_000))]), [Found::NothingInTime]);
    assert_eq!(found(script, &[(900_000, line(1_000)), (2_000_001, line(1_000))]), [Found::NothingInTime]);
    assert_eq!(
        found(script, &[(1_100_000, line(1_001)), (1_500_000, line(1_000))]),
        [Found::Passed(Hundredths(1_000))]
    );
    assert_eq!(found(script, &[(1_100_000, line(1_001)), (1_500_000, line(949))]), [Found::Failed(Hundredths(949))]);
    // The timeline is not shortened.
    assert_eq!(
        timeline(script).events.iter().find(|event| event.command.said() == "servo 1 1500").unwrap().at,
        Micros(2_000_000)
    );
    for (wanted, fits) in
        [("== 10V", 1_000), ("<= 10V", 1_000), ("< 10V", 999), (">= 10V", 1_000), ("== 9.996V", 1_000)]
    {
        let script = format!("wait 1s\nexpect voltage {wanted}\n");
        assert_eq!(found(&script, &[(900_000, line(fits))]), [Found::Passed(Hundredths(fits))], "{wanted}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The verdicts do not depend on how the reports are split or what is between them.
    #[test]
    fn verdicts_do_not_depend_on_how_reports_are_cut(
        values in prop::collection::vec(900..1_100_i32, 1..20),
        noise in prop::collection::vec(prop::sample::select(vec!["", "noise", "{", "}#", "{A1:2}#", "#{A", "{A0:0:0:99999999999}#"]), 20),
        cuts in prop::collection::vec(1usize..12, 1..200),
    ) {
        let script = "wait 500ms\nexpect voltage > 10V within 1s\n";
        let whole: Vec<(u64, Vec<u8>)> = values.iter().map(|value| (600_000, line(*value))).collect();
        let mut stream: Vec<u8> = Vec::new();
        for (value, noise) in values.iter().zip(noise.iter().cycle()) {
            stream.extend(noise.bytes());
            stream.extend(line(*value));
        }
        let mut pieces = Vec::new();
        let mut rest = stream.as_slice();
        for cut in cuts.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (piece, after) = rest.split_at((*cut).min(rest.len()));
            pieces.push((600_000, piece.to_vec()));
            rest = after;
        }
        prop_assert_eq!(judged(script, &pieces), judged(script, &whole));
    }

    /// Noise without a report never passes.
    #[test]
    fn noise_never_passes(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let mut reports = 0;
        ReportDecoder::new(board()).feed(&bytes, |item| reports += u32::from(matches!(item, ReportItem::Report(_))));
        prop_assume!(reports == 0);
        prop_assert_eq!(found("wait 500ms\nexpect voltage >= 0V\n", &[(100_000, bytes)]), [Found::Nothing]);
    }
}
