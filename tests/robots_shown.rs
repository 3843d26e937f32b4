//! Listings, snapshots and differences of scripts for several robots.

use std::sync::Arc;

use serde_json::Value;

use motionseq::board::Family;
use motionseq::diff::diff_all_scripts;
use motionseq::program::Options;
use motionseq::source::Source;
use motionseq::timeline::{NamedBoard, Snapshot, Timeline, is_snapshot, read_snapshot, read_snapshots, write_snapshot};

use crate::support::board::board;
use crate::support::{Scratch, code, stderr, stdout};

/// Two robots of two families.
const PAIR: &str = "\
robots left, arm
arm: board sts
left: servo 1 1500
arm: torque 1 on
wait 20ms
arm: servo 1 2048
wait 80ms
left: wait until yaw > 90deg within 4s
left: servo 1 1500 -> 1600 over 40ms
on abort { left: servo 1 1000 }
";

/// Its snapshot, by hand. The checksum of a Raspblock is the sum of the bytes after `FF FE`: 02+03+01+05+DC = E7. That of a bus servo is
/// the inverted sum after `FF FF`: FE+06+83+28+01+01+01 = B2, inverted 4D. 2048 is 0800, its low byte first.
const KEPT: &str = "\
# motionseq frames 3
# pair.motion
# robot\tleft\traspblock
# robot\tarm\tsts
# frames\tleft
0.000000\tFF FE 05 01 00 06\trequest report-start\tauto\tleft
0.000000\tFF FE 02 03 01 05 DC E7\tservo 1 1500\t\tleft
# gate\t0.100000\twait until yaw > 90deg within 4s
# move\t0.100000\t0.140000\tlinear\t2
0.120000\tFF FE 02 03 01 06 0E 1A\tservo 1 1550\tsample\tleft
0.140000\tFF FE 02 03 01 06 40 4C\tservo 1 1600\tsample\tleft
0.140000\tFF FE 05 01 09 0F\trequest report-stop\tauto\tleft
# on abort
0.000000\tFF FE 02 03 01 03 E8 F1\tservo 1 1000\tabort\tleft
# end\t0.140000\tframes\t6\tbaud\t115200
# frames\tarm
0.000000\tFF FF FE 06 83 28 01 01 01 4D\ttorque 1 on\t\tarm
0.020000\tFF FF FE 07 83 2A 02 01 00 08 42\tservo 1 2048\t\tarm
# gate\t0.100000\tleft: wait until yaw > 90deg within 4s
# end\t0.140000\tframes\t2\tbaud\t1000000
";

fn timelines(text: &str) -> Vec<Timeline> {
    let compiled = motionseq::compile(&Source::new("pair.motion", text).into(), &Options::default());
    assert!(!compiled.timelines.is_empty(), "{:?}", compiled.diagnostics);
    compiled.timelines
}

fn kept(timelines: &[Timeline]) -> String {
    let mut text = Vec::new();
    write_snapshot("pair.motion", timelines, &mut text).unwrap();
    String::from_utf8(text).unwrap()
}

fn robots(timelines: &[Timeline]) -> Vec<NamedBoard> {
    timelines.iter().map(Timeline::named_board).collect()
}

#[test]
fn a_snapshot_has_a_part_for_each_robot() {
    let pair = timelines(PAIR);
    assert_eq!(kept(&pair), KEPT);
    assert!(is_snapshot(KEPT.as_bytes()));
    let read = read_snapshots(&robots(&pair), KEPT.as_bytes()).unwrap();
    assert_eq!(read, pair.iter().map(Snapshot::of).collect::<Vec<_>>());
    let again: Vec<Timeline> = read.iter().map(Snapshot::timeline).collect();
    assert_eq!(kept(&again), KEPT);
    assert_eq!(Snapshot::robots(KEPT.as_bytes()), [(Some("left"), Some("raspblock")), (Some("arm"), Some("sts"))]);
    // A script with one named robot has the same format, and one without a name has none of it.
    let one = timelines("robots left\nservo 1 1500\n");
    assert!(kept(&one).contains("# robot\tleft\traspblock\n# frames\tleft\n"), "{}", kept(&one));
    assert_eq!(read_snapshots(&robots(&one), kept(&one).as_bytes()).unwrap(), [Snapshot::of(&one[0])]);
    let none = kept(&timelines("servo 1 1500\n"));
    assert_eq!(
        none,
        "# motionseq frames 3\n# pair.motion\n# board\traspblock\n\
         0.000000\tFF FE 02 03 01 05 DC E7\tservo 1 1500\n# end\t0.000000\tframes\t1\tbaud\t115200\n"
    );
}

#[test]
fn a_robot_that_the_script_does_not_have_is_read_too() {
    let arm = timelines(PAIR).remove(1);
    let read = read_snapshots(&[arm.named_board()], KEPT.as_bytes()).unwrap();
    assert_eq!((read.len(), read[0].robot.as_deref(), read[1].robot.as_deref()), (2, Some("left"), Some("arm")));
}

#[test]
fn a_truncated_snapshot_of_several_robots_is_refused() {
    let robots = robots(&timelines(PAIR));
    let lines: Vec<&str> = KEPT.split_inclusive('\n').collect();
    for count in 0..lines.len() {
        let text = lines[..count].concat();
        assert!(read_snapshots(&robots, text.as_bytes()).is_err(), "{count} lines");
    }
    assert!(read_snapshots(&robots, KEPT.trim_end().as_bytes()).is_err());
    // Nor may any line of a frame be missing or be twice.
    for at in (0..lines.len()).filter(|at| !lines[*at].starts_with('#')) {
        for with in [0, 2] {
            let mut other = lines.clone();
            other.splice(at..=at, std::iter::repeat_n(lines[at], with));
            assert!(read_snapshots(&robots, other.concat().as_bytes()).is_err(), "line {at}, {with} times");
        }
    }
}

#[test]
fn a_wrong_snapshot_of_several_robots_says_what_is_wrong() {
    let robots = robots(&timelines(PAIR));
    for (from, to, message) in [
        ("abort\tleft", "abort", "line 14: the name of the robot is missing"),
        ("abort\tleft", "abort\tarm", "line 14: the frame is for the robot `arm`, among those of `left`"),
        ("abort\tleft", "abort\tleft\tx", "line 14: there is something after the robot"),
        ("# frames\tarm", "# frames\tleft", "line 16: the frames of the robot `arm` come next, not those of `left`"),
        ("# frames\tleft\n", "", "line 5: the line before the frames of a robot is missing"),
        (
            "# end\t0.140000\tframes\t6\tbaud\t115200\n",
            "",
            "line 15: the frames of the robot `left` are truncated: their last line is missing",
        ),
        ("frames\t6", "frames\t7", "line 16: found 6 frames instead of 7"),
        ("# robot\tarm\tsts\n", "", "line 15: there is a line after the end"),
        ("# robot\tarm\tsts", "# robot\tleft\traspblock", "line 4: the robot `left` is named twice"),
        ("# robot\tarm\tsts", "# robot\tarm", "line 4: a robot needs its name and its board"),
        (
            "# robot\tarm\tsts",
            "# robot\tarm\tmaestro 6",
            "line 4: this is a snapshot for the robot `arm` with the board `maestro 6`, not `sts`",
        ),
        (
            "# robot\tarm\tsts",
            "# robot\tgone\t\"gone.toml\"",
            "line 4: the script has no robot `gone`, and this motionseq does not know its board `\"gone.toml\"`",
        ),
        ("# robot\tarm\tsts", "# board\tsts", "line 4: the board of a robot is in the line with its name"),
        ("# on abort", "# robot\tx\tsts", "line 13: robots are named before all frames"),
        ("\tleft: wait until", "\t: wait until", "line 19: a gate needs its time and its line as a script writes it"),
        ("frames 3", "frames 4", "line 1: version 4 is too new: this motionseq reads versions up to 3, so update it"),
    ] {
        let text = KEPT.replacen(from, to, 1);
        assert_ne!(text, KEPT, "{from}");
        assert_eq!(read_snapshots(&robots, text.as_bytes()).unwrap_err().to_string(), message, "{from} {to}");
    }
}

#[test]
fn one_robot_and_several_are_told_apart() {
    let several = robots(&timelines(PAIR));
    let wrong = |error: Result<Vec<Snapshot>, _>| match error {
        Err(motionseq::timeline::SnapshotError { why, .. }) => why,
        Ok(read) => panic!("{read:?}"),
    };
    assert_eq!(
        read_snapshot(board(), KEPT.as_bytes()).unwrap_err().why,
        "this is a snapshot of the robots `left` and `arm`, and the script names no robots"
    );
    let one = kept(&timelines("robots only\nservo 1 1500\n"));
    assert_eq!(
        read_snapshot(board(), one.as_bytes()).unwrap_err().why,
        "this is a snapshot of the robot `only`, and the script names no robots"
    );
    let none = kept(&timelines("servo 1 1500\n"));
    for text in [none.as_str(), "# motionseq frames 2\n# x\n# end\t0.000000\tframes\t0\tbaud\t115200\n"] {
        assert_eq!(
            wrong(read_snapshots(&several, text.as_bytes())),
            "this is a snapshot of a script that names no robots, and the script has the robots `left` and `arm`"
        );
    }
    let sts: [NamedBoard; 1] = [(Some(Arc::from("only")), Family::board("sts").unwrap())];
    assert!(read_snapshots(&sts, one.as_bytes()).is_err());
}

#[test]
fn a_difference_begins_with_its_robots() {
    let words = |old: &str, new: &str| {
        let changes = diff_all_scripts(&timelines(old), &timelines(new), |change| change.new);
        changes.iter().map(|change| change.words(None)).collect::<Vec<_>>()
    };
    let both = "robots left, right\nmark go\nleft: servo 1 1500\nright: servo 1 1500\nwait 1s\nservo 2 1500\n";
    assert_eq!(words(both, both), Vec::<String>::new());
    assert_eq!(
        words(both, &both.replace("right: servo 1 1500", "right: servo 1 1600")),
        ["right: at 0.000 s: servo 1 1500 -> 1600"]
    );
    // What both do alike is one line, and so is what belongs to no robot.
    assert_eq!(
        words(both, &both.replace("servo 2 1500", "servo 2 1600").replace("mark go", "mark start")),
        ["left, right: at 0.000 s: mark go -> mark start", "left, right: at 1.000 s: servo 2 1500 -> 1600"]
    );
    assert_eq!(words(both, &both.replace("left, right", "left, right, third"))[0], "robot `third` is added");
    assert_eq!(words(&both.replace("left, right", "left, right, third"), both)[0], "robot `third` is removed");
    // The order of the names means nothing.
    assert_eq!(words(both, &both.replace("left, right", "right, left")), Vec::<String>::new());
}

#[test]
fn render_prints_all_robots_or_one() {
    let folder = Scratch::new("robots-render");
    folder.file("pair.motion", PAIR.as_bytes());
    folder.file("one.motion", b"servo 1 1500\n");
    let listing = stdout(&folder.run(&["render", "pair.motion"]));
    let sections: Vec<&str> = listing.split("# robot\t").collect();
    let ([empty, left, arm], true) = (sections.as_slice(), sections.len() == 3) else { panic!("{listing}") };
    assert!(empty.is_empty() && left.starts_with("left\n0.000000\tFF FE") && arm.starts_with("arm\n0.000000\tFF FF"));
    assert_eq!(stdout(&folder.run(&["render", "pair.motion", "--robot", "arm"])), format!("# robot\t{arm}"));
    assert_eq!(
        stdout(&folder.run(&["render", "pair.motion", "--robot", "arm", "--format", "hex"])),
        "# robot\tarm\n0.000000\tFF FF FE 06 83 28 01 01 01 4D\n0.020000\tFF FF FE 07 83 2A 02 01 00 08 42\n"
    );
    let json = stdout(&folder.run(&["render", "pair.motion", "--format", "jsonl"]));
    let robots: Vec<bool> = json.lines().map(|line| line.contains("\"robot\":\"arm\"")).collect();
    assert_eq!((robots.len(), robots.iter().filter(|is_arm| **is_arm).count(), robots.is_sorted()), (9, 3, true));
    let bytes = folder.run(&["render", "pair.motion", "--robot", "arm", "--format", "bin"]).stdout;
    assert_eq!((bytes.len(), &bytes[..3]), (21, &[0xFF, 0xFF, 0xFE][..]));
    for (args, message) in [
        (&["pair.motion", "--format", "bin"][..], "choose one of the robots, for example `--robot left`"),
        (&["pair.motion", "--robot", "lefd"], "the script has no robot `lefd`; did you mean `left`?"),
        (&["pair.motion", "--robot", "other"], "the script has no robot `other`; the robots are `left` and `arm`"),
        (&["one.motion", "--robot", "left"], "this one has no line `robots`"),
        (&["pair.motion", "--soft", "1s", "--robot", "left", "--format", "bin", "--from", "nowhere"], "nowhere"),
    ] {
        let output = folder.run(&[&["render"], args].concat());
        assert_eq!((code(&output), output.stdout.len()), (2, 0), "{args:?}");
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
    // `--soft` is for the robots that report positions.
    assert_eq!(code(&folder.run(&["render", "pair.motion", "--soft", "1s"])), 0);
    assert_eq!(code(&folder.run(&["render", "one.motion", "--soft", "1s"])), 2);
}

#[test]
fn all_robots_have_the_same_lead_in_and_the_same_passes() {
    let folder = Scratch::new("robots-lead");
    folder.file(
        "x.motion",
        b"robots left, right\nleft: servo 1 1000\nright: rocker y=10\nwait 1s\nservo 2 1500\nleft: servo 1 2000\nright: stop\n",
    );
    let args = ["render", "x.motion", "--from", "510ms", "--lead-in", "300ms", "--loop", "2", "--robot"];
    let both = ["left", "right"].map(|robot| stdout(&folder.run(&[&args[..], &[robot]].concat())));
    // The drive waits for the servo of the other robot: a pass takes 0.300 s + 0.490 s.
    for listing in &both {
        for at in ["0.790000", "1.580000"] {
            assert!(listing.contains(&format!("{at}\tFF FE 02 03 02 05 DC E8\tservo 2 1500\t\t")), "{listing}");
        }
    }
    assert!(both[1].contains("\n0.300000\tFF FE 03 08 01 00 00 00 0A 00 00 01 17"), "{}", both[1]);
    assert!(!both[1].contains("\n0.000000\t"), "{}", both[1]);
}

#[test]
fn tests_compare_each_robot_with_its_part_of_the_snapshot() {
    let folder = Scratch::new("robots-test");
    folder.file("pair.motion", PAIR.as_bytes());
    assert_eq!(code(&folder.run(&["test", "--bless", "pair.motion"])), 0);
    assert_eq!(std::fs::read_to_string(folder.path("pair.motion.frames")).unwrap(), KEPT);
    assert_eq!(code(&folder.run(&["test", "pair.motion"])), 0);
    assert_eq!(code(&folder.run(&["diff", "pair.motion.frames", "pair.motion"])), 0);
    folder.file("pair.motion", PAIR.replace("2048", "2000").as_bytes());
    let said = "arm: at 0.020 s (pair.motion:6): servo 1 2048 -> 2000";
    let output = folder.run(&["test", "pair.motion"]);
    assert_eq!(code(&output), 1);
    assert!(stdout(&output).contains(&format!("\n  {said}\n")), "{}", stdout(&output));
    let output = folder.run(&["diff", "pair.motion.frames", "pair.motion"]);
    assert_eq!((code(&output), stdout(&output)), (1, format!("{said}\n")));
    let json = stdout(&folder.run(&["diff", "--format", "json", "pair.motion.frames", "pair.motion"]));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["changes"][0]["robots"], serde_json::json!(["arm"]));
    assert_eq!(json["changes"][0]["new"]["line"], 6);
    // Robots come and go.
    folder.file("pair.motion", PAIR.replace("left, arm", "left, arm, third").as_bytes());
    let output = folder.run(&["test", "pair.motion"]);
    assert!(stdout(&output).contains("\n  robot `third` is added\n"), "{}", stdout(&output));
    assert_eq!(code(&folder.run(&["test", "--bless", "pair.motion"])), 0);
    folder.file("pair.motion", PAIR.as_bytes());
    assert!(stdout(&folder.run(&["test", "pair.motion"])).contains("\n  robot `third` is removed\n"));
    // A script without `robots` is another thing.
    folder.file("pair.motion", b"servo 1 1500\n");
    folder.file("other.motion", PAIR.as_bytes());
    let output = folder.run(&["test", "pair.motion"]);
    let why = "this is a snapshot of the robots `left`, `arm` and `third`, and the script names no robots";
    assert!(stdout(&output).contains(why), "{}", stdout(&output));
    let output = folder.run(&["diff", "pair.motion", "other.motion"]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("one names no robots, the other `left` and `arm`"), "{}", stderr(&output));
    assert_eq!(code(&folder.run(&["test", "--bless", "pair.motion"])), 0);
    assert_eq!(code(&folder.run(&["test", "pair.motion"])), 0);
}

#[test]
fn a_board_of_a_file_has_its_stop_in_the_head() {
    let folder = Scratch::new("robots-file");
    let board = std::fs::read("scripts/boards/waveshare.toml").unwrap();
    folder.file("cart.toml", &board);
    folder.file(
        "x.motion",
        b"robots left, cart\ncart: board \"cart.toml\"\nleft: servo 1 1500\ncart: drive 0.2 0.2 for 100ms\n",
    );
    assert_eq!(code(&folder.run(&["test", "--bless", "x.motion"])), 0);
    let text = std::fs::read_to_string(folder.path("x.motion.frames")).unwrap();
    let head: Vec<&str> = text.lines().take(6).map(|line| line.get(..15).unwrap_or(line)).collect();
    let expected = [
        "# motionseq fra",
        "# x.motion",
        "# robot\tleft\tra",
        "# robot\tcart\t\"c",
        "# stop\t7B 22 54",
        "# frames\tleft",
    ];
    assert_eq!(head, expected);
    assert_eq!(code(&folder.run(&["diff", "x.motion.frames", "x.motion"])), 0);
    folder.file("x.motion.frames", text.replacen("# stop\t7B", "# stop\t7C", 1).as_bytes());
    let output = folder.run(&["test", "x.motion"]);
    assert!(stdout(&output).contains("x.motion.frames:5: snapshot: a stop sent `7C"), "{}", stdout(&output));
}

#[test]
fn the_frames_of_one_robot_are_decoded_and_those_of_several_are_refused() {
    let folder = Scratch::new("robots-decode");
    folder.file("pair.motion", PAIR.as_bytes());
    folder.file("pair.motion.frames", KEPT.as_bytes());
    for format in ["listing", "hex", "jsonl"] {
        for robot in ["left", "arm"] {
            let args = ["render", "pair.motion", "--robot", robot, "--format", format, "-o", "one.txt"];
            assert_eq!(code(&folder.run(&args)), 0);
            let family = if robot == "arm" { "sts" } else { "raspblock" };
            let output = folder.run(&["decode", "one.txt", "--family", family]);
            assert_eq!((code(&output), stdout(&output).contains("unknown")), (0, false), "{}", stdout(&output));
        }
        assert_eq!(code(&folder.run(&["render", "pair.motion", "--format", format, "-o", "both.txt"])), 0);
        let output = folder.run(&["decode", "both.txt", "-o", "new.motion"]);
        assert_eq!(code(&output), 1, "{format}");
        assert!(stderr(&output).contains("of several robots, such as `left` and `arm`"), "{}", stderr(&output));
        assert!(!std::path::Path::new(&folder.path("new.motion")).exists());
    }
    assert!(stderr(&folder.run(&["decode", "pair.motion.frames"])).contains("--robot left"));
}

#[test]
fn reports_for_programs_have_the_call_of_each_robot() {
    let scratch = Scratch::new("robots-findings");
    scratch.file("nods.motion", b"def nod(pan) {\n    servo 1 pan\n}\n");
    scratch.file(
        "main.motion",
        b"robots left, right\nright: limit servo 1 900..1700\nuse \"nods.motion\"\nleft: nod(5000)\nright: nod(1800)\n",
    );
    let check = |format| stdout(&scratch.run(&["check", "--format", format, "main.motion"]));
    let json: Value = serde_json::from_str(&check("json")).unwrap();
    let said = json["findings"].as_array().unwrap().iter().map(|finding| {
        let calls = finding["related"].as_array().unwrap().iter();
        let calls = calls.map(|place| format!("{}:{} {}", place["file"], place["line"], place["message"]));
        format!("{} {}", finding["message"], calls.collect::<Vec<_>>().join(", "))
    });
    assert_eq!(
        said.collect::<Vec<_>>(),
        [
            r#""right: 1800 is outside of the limit 900..1700" "main.motion":2 "limited here", "main.motion":5 "called here""#,
            r#""left: pulse width 5000 is out of range (500 to 2500 µs)" "main.motion":4 "called here""#,
        ]
    );
    let sarif: Value = serde_json::from_str(&check("sarif")).unwrap();
    let call = &sarif["runs"][0]["results"][1]["relatedLocations"][0];
    assert_eq!(call["message"]["text"], "called here");
    assert_eq!(call["physicalLocation"]["artifactLocation"]["uri"], "main.motion");
    assert_eq!(call["physicalLocation"]["region"]["startLine"], 4);
    let github = check("github");
    let left = github.lines().find(|line| line.contains("::left: ")).unwrap();
    assert!(
        left.starts_with("::error file=nods.motion,line=2,") && left.ends_with("%0Amain.motion:4: called here"),
        "{left}"
    );
}
