//! Pictures of boards that are described by a file: one lane for each value that a script uses, with
//! its name, its unit and its range as the script writes them.

use std::sync::Arc;

use crate::support::{Scratch, run, stderr, stdout};
use motionseq::board::{Board, Sets, text};
use motionseq::diagnostic::Diagnostics;
use motionseq::plot::{Lane, Shows, plot};
use motionseq::program::Options;
use motionseq::source::{Source, Sources};
use motionseq::units::Micros;
use serde_json::{Value, json};

/// A board with a value of each kind.
const BOARD: &str = r#"
name = "Demo"
baud = 115200
hello = ['V\n']
goodbye = ['X\n']
[verb.servo]
axes = [{ name = "n", range = "0..31", index = true }, { name = "us", range = "500..2500", unit = "us", decimals = 2 }]
moves = true
send = '#{n}P{us}\r'
[verb.pan]
axes = [{ name = "angle", range = "-90..90", unit = "deg" }]
moves = true
send = 'P{angle}\n'
[verb.drive]
axes = [{ name = "left", range = "-255..255" }, { name = "right", range = "-255..255" }]
holds = true
rest = 'M 0 0\n'
refresh = "100ms"
send = 'M {left} {right}\n'
[verb.spin]
axes = [{ name = "turn", range = "-1..1", decimals = 2 }]
resource = "drive"
holds = true
send = 'S {turn}\n'
[verb.arm]
axes = [{ name = "height", range = "0..200" }]
send = 'A{height}\n'
[verb.left_gripper_finger]
axes = [{ name = "n", range = "1..2", index = true }, { name = "force", range = "0..9" }]
send = 'F{n},{force}\n'
[verb.led]
axes = [{ name = "n", range = "1..4", index = true }, { name = "state", words = { off = 0, on = 1 } }]
send = 'L{n}{state}\n'
[verb.grip]
axes = [{ name = "state", words = { open = 0, half = 1, closed = 2 } }]
send = 'H{state}\n'
[verb.relax]
axes = [{ name = "n", range = "0..31", index = true }]
resource = "servo"
send = 'R{n}\n'
[verb.home]
send = 'Z\n'
"#;

/// A script as the data of its lanes, and as the texts and the tooltips of its picture.
fn drawn(name: &str, script: &str) -> (Vec<Value>, String) {
    let folder = Scratch::new(&format!("family-{name}"));
    folder.file("demo.toml", BOARD.as_bytes());
    let script = folder.file("x.motion", format!("board \"demo.toml\"\n{script}").as_bytes());
    let [data, svg] = ["json", "svg"].map(|format| {
        let output = run(&["plot", &script, "--format", format]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stdout(&output)
    });
    let data: Value = serde_json::from_str(&data).unwrap();
    (data["tracks"][0]["lanes"].as_array().unwrap().clone(), svg)
}

fn names(lanes: &[Value]) -> Vec<&str> {
    lanes.iter().map(|lane| lane["name"].as_str().unwrap()).collect()
}

#[test]
fn a_lane_is_a_value_that_the_script_uses() {
    let script = "limit servo 3 900..2100\nservo 3 1500\nservo 31 1500.25\npan -10\narm 40\nleft_gripper_finger 2 5\n\
        wait 1s\ndrive 100 -50 for 1s\narm 120\nwait 1s\n";
    let (lanes, svg) = drawn("lanes", script);
    let finger = "left_gripper_finger 2";
    assert_eq!(names(&lanes), ["servo 3", "servo 31", "pan", "drive left", "drive right", "arm", finger]);
    let of = |key: &str| lanes.iter().map(|lane| lane[key].clone()).collect::<Vec<_>>();
    assert_eq!(of("unit"), ["µs", "µs", "°", "", "", "", ""]);
    assert_eq!(of("about"), ["", "", "", "", "", "height", "force"]);
    assert_eq!(lanes[0]["range"], json!([500.0, 2500.0]));
    assert_eq!(lanes[0]["limits"], json!([900.0, 2100.0]));
    assert_eq!(lanes[1]["points"], json!([[0, 1500.25]]));
    assert_eq!(lanes[2]["range"], json!([-90.0, 90.0]));
    // A value without a move stays until the next command, and the end of a hold is 0.
    assert_eq!(lanes[3]["points"], json!([[1_000_000, 100.0], [2_000_000, 0.0]]));
    assert_eq!(lanes[4]["points"], json!([[1_000_000, -50.0], [2_000_000, 0.0]]));
    assert_eq!(lanes[5]["points"], json!([[0, 40.0], [2_000_000, 120.0]]));
    // A long name is shortened before its index.
    for text in [">1500.25<", ">limit 2100<", ">-90<", ">height<", ">left_gri… 2<"] {
        assert!(svg.contains(text), "{text}: {svg}");
    }
    assert!(!svg.contains("top view") && !svg.contains("Raspblock"));
}

#[test]
fn verbs_of_one_resource_end_the_values_of_each_other() {
    let (lanes, _) = drawn("shared", "drive 100 50\nwait 1s\nspin 0.25 for 2s\nwait 1s\n");
    assert_eq!(names(&lanes), ["drive left", "drive right", "spin"]);
    assert_eq!(lanes[0]["points"], json!([[0, 100.0], [1_000_000, null], [3_000_000, 0.0]]));
    assert_eq!(lanes[2]["points"], json!([[1_000_000, 0.25], [3_000_000, 0.0]]));
}

#[test]
fn words_are_switches_or_spans_with_their_words() {
    let (lanes, svg) =
        drawn("words", "led 2 on\ngrip open\nwait 2s\nled 2 off\ngrip half\nwait 2s\ngrip closed\nhome\n");
    // What the board is greeted with is no command of the script.
    assert_eq!(names(&lanes), ["led 2", "grip", "other"]);
    let span = |at: u32, until: u32, text: &str| json!({"t_us": at, "until_us": until, "text": text});
    assert_eq!(lanes[0]["spans"], json!([span(0, 2_000_000, "on")]));
    let spans = [span(0, 2_000_000, "open"), span(2_000_000, 4_000_000, "half"), span(4_000_000, 4_000_000, "closed")];
    assert_eq!(lanes[1]["spans"], json!(spans));
    assert_eq!(lanes[2]["ticks"], json!([{"t_us": 4_000_000, "text": "home"}]));
    assert!(svg.contains(">half</text>") && svg.contains("<title>half, 2 s to 4 s</title>"), "{svg}");
    assert!(!svg.contains(">on</text>"));
}

/// The board of the file, with commands after which values are unknown: `home` for all, and `relax`
/// for one servo.
fn forgetful() -> Board {
    let mut diagnostics = Diagnostics::default();
    let board = text::read(&Source::new("demo.toml", BOARD), "demo.toml", &|_| false, &mut diagnostics);
    let mut board = board.unwrap_or_else(|| panic!("{diagnostics:?}"));
    let all: Vec<usize> = (0..board.resources.len()).collect();
    for verb in board.verbs.iter_mut().filter(|verb| verb.word == "home" || verb.word == "relax") {
        verb.forgets = true;
        if verb.word == "home" {
            verb.sets = Sets::All(all.clone());
        }
    }
    board
}

/// The lanes of a script on a board, and its warnings.
fn plotted(board: Board, script: &str) -> (Vec<Lane>, Vec<String>) {
    let sources = Sources::from(Source::new("x.motion", script));
    let compiled = motionseq::compile(&sources, &Options::default().with_board(Arc::new(board)));
    let timeline = compiled.timelines.into_iter().next().unwrap_or_else(|| panic!("{:?}", compiled.diagnostics));
    let mut picture = plot(&[timeline], &sources, &compiled.diagnostics);
    let warnings = compiled.diagnostics.iter().map(|found| format!("{}; {}", found.message, found.help)).collect();
    (picture.tracks.remove(0).lanes, warnings)
}

/// The values of a curve with their times in milliseconds.
fn points(lane: &Lane) -> Vec<(u64, Option<f64>)> {
    let Shows::Curve { points, .. } = &lane.shows else { panic!("{lane:?}") };
    points.iter().map(|(at, value)| (at.0 / 1_000, *value)).collect()
}

#[test]
fn a_curve_ends_where_its_value_becomes_unknown() {
    let script = "servo 3 1500\nservo 4 900\nled 1 on\nwait 1s\nrelax 3\nwait 1s\nhome\nwait 1s\nservo 3 1600\n";
    let (lanes, _) = plotted(forgetful(), script);
    let names: Vec<&str> = lanes.iter().map(|lane| &*lane.name).collect();
    assert_eq!(names, ["servo 3", "servo 4", "led 1", "other"]);
    assert_eq!(points(&lanes[0]), [(0, Some(1500.0)), (1_000, None), (3_000, Some(1600.0))]);
    assert_eq!(points(&lanes[1]), [(0, Some(900.0)), (2_000, None)]);
    let Shows::Spans { spans, .. } = &lanes[2].shows else { panic!("{lanes:?}") };
    assert_eq!(spans[0].until, Micros::from_millis(2_000));
    let Shows::Ticks { ticks } = &lanes[3].shows else { panic!("{lanes:?}") };
    assert_eq!(ticks.iter().map(|tick| tick.text.as_str()).collect::<Vec<_>>(), ["relax 3", "home"]);
}

#[test]
fn a_servo_that_is_late_is_reported_in_its_unit() {
    // 5500 µs per second, with values in hundredths of a µs: 1000 µs take 182 ms.
    let (_, warnings) = plotted(forgetful(), "servo 3 1000\nwait 1s\nservo 3 2000\nwait 150ms\nservo 3 1000\n");
    let [warning] = warnings.as_slice() else { panic!("{warnings:?}") };
    assert!(warning.starts_with("servo 3 needs about 181 ms from 1000 to 2000 µs, "), "{warning}");
    assert!(warning.ends_with("faster than 5500 µs per second, set `limit servo 3 speed 6700us`"), "{warning}");
    // After pulses were off, the position is unknown.
    let script = "servo 3 1000\nwait 1s\nservo 3 2000\nrelax 4\nwait 150ms\nrelax 3\nwait 1ms\nservo 3 1000\n";
    assert_eq!(plotted(forgetful(), script).1, [""; 0]);

    let mut board = forgetful();
    let (pan, _) = board.find("pan").unwrap();
    let resource = board.occupied(pan, None)[0];
    board.resources[resource].speed = Some(300);
    let (_, warnings) = plotted(board, "pan -90\nwait 1s\npan 90\nwait 500ms\npan -90\n");
    let [warning] = warnings.as_slice() else { panic!("{warnings:?}") };
    assert!(warning.starts_with("the pan needs about 600 ms from -90 to 90°, "), "{warning}");
    assert!(warning.contains("300° per second"), "{warning}");
}

#[test]
fn the_lanes_of_many_servos_are_as_they_are_numbered() {
    let board = forgetful();
    let picture = board.picture();
    let (servo, _) = board.find("servo").unwrap();
    let lanes = |index: i32| (picture.draw)(&board, &board.command(servo, &[index, 150_000]).unwrap());
    for index in 0..32 {
        let [(lane, _)] = lanes(index)[..] else { panic!("{:?}", lanes(index)) };
        assert_eq!(picture.lanes[lane].name, format!("servo {index}"));
    }
}
