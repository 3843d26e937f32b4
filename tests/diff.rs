//! What `diff` prints for an edit, and which snapshots it accepts.

use std::fs;

use crate::support::board::board;
use crate::support::{run, script, stderr, stdout};
use motionseq::diff::{Change, What, diff, diff_scripts};
use motionseq::program::Options;
use motionseq::source::{Disk, Lines, Source, Sources};
use motionseq::timeline::{Moment, Snapshot, Timeline, is_snapshot, read_snapshot, write_snapshot};
use motionseq::units::Micros;
use proptest::prelude::*;

/// The output for an edit, each change with its place as `diff` chooses it.
fn words(old: &str, new: &str) -> String {
    let side = |text: &str| {
        let sources = Sources::from(Source::new("x.motion", text));
        let timeline = motionseq::compile(&sources, &Options::default()).timeline().expect("the script compiles");
        (sources, timeline)
    };
    let (old, new) = (side(old), side(new));
    let span = |timeline: &Timeline, aborts: bool, at: usize| {
        let note = || timeline.notes(aborts).get(at - timeline.frames(aborts).len()).map(|note| note.span);
        timeline.frames(aborts).get(at).map(|event| event.span).or_else(note)
    };
    let origin = |side: &(Sources, Timeline), aborts: bool, at: Option<usize>| {
        let lines = Lines::of(&side.0);
        match side.1.frames(aborts).get(at?) {
            Some(event) => Some(side.1.origin(event, &side.0, &lines)),
            None => Some(lines.place(span(&side.1, aborts, at?)?).to_string()),
        }
    };
    let line = |change: &Change| {
        let (side, at) = if change.new.is_some() { (&new, change.new) } else { (&old, change.old) };
        Some((change.new.is_some(), Lines::of(&side.0).place(span(&side.1, change.aborts, at?)?).line))
    };
    let changes = diff_scripts(&old.1, &new.1, line);
    let lines = changes.iter().map(|change| {
        let place = origin(&new, change.aborts, change.new).or_else(|| origin(&old, change.aborts, change.old));
        change.words(place.as_deref()) + "\n"
    });
    lines.collect()
}

#[test]
fn every_edit_is_described_in_the_notation_of_the_script() {
    let _alone = crate::support::one_glob_at_a_time();
    insta::with_settings!({ snapshot_path => "diffs", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("diffs/*.txt", |path| {
            let text = fs::read_to_string(path).unwrap();
            let (old, new) = text.split_once("=== new\n").unwrap();
            insta::assert_snapshot!("diffs", words(old, new));
        });
    });
}

#[test]
fn a_script_and_its_snapshot_are_the_same() {
    for name in ["hello", "dance", "sweep", "checkup"] {
        let path = format!("scripts/{name}.motion");
        let sources = Sources::read(path.as_ref(), Disk).unwrap();
        let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
        let mut snapshot = Vec::new();
        write_snapshot(&path, std::slice::from_ref(&timeline), &mut snapshot).unwrap();
        assert!(is_snapshot(&snapshot) && snapshot.starts_with(b"# motionseq frames 3\n# scripts/"));
        let sent = Snapshot::of(&timeline);
        assert_eq!(read_snapshot(board(), &snapshot).unwrap(), sent);
        // Line ends of another system.
        let other = String::from_utf8(snapshot.clone()).unwrap().replace('\n', "\r\n");
        assert_eq!(read_snapshot(board(), other.as_bytes()).unwrap(), sent);
        // Version 1 was the listing alone.
        let first = String::from_utf8(snapshot).unwrap().replace("frames 3\n", "frames 1\n");
        let first = first.split("# on abort").next().unwrap().to_owned();
        let first = read_snapshot(board(), first.as_bytes()).unwrap();
        assert_eq!((first.moments, first.more), (sent.moments, None));
    }
}

#[test]
fn every_form_of_a_gate_is_read_as_it_is_written() {
    let script = "wait go\nwait go \"{{x}} \u{202E}\u{FEFF}é\"\nwait go \"a \\\"b\\\" \\\\ c\" within 1m30s or continue\nwait until voltage > 6.5V within 2s\n\
        wait until voltage < 13V within 0.1s or continue\nwait until yaw >= -90deg within 2s \"why\"\n\
        wait until yaw <= 90.25deg within (1s / 3)\nwait until turned == 3deg within 2s or continue \"a \\\"b\\\"\"\n\
        wait until pitch in -5deg..5deg within 2s\nservo 1 1500\nwait go\n";
    let sources = Sources::from(Source::new("x.motion", script));
    let timeline = motionseq::compile(&sources, &Options::default()).timeline().expect("the script compiles");
    assert_eq!(timeline.gates.len(), 10);
    let mut text = Vec::new();
    write_snapshot("x.motion", std::slice::from_ref(&timeline), &mut text).unwrap();
    let read = read_snapshot(board(), &text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(read, Snapshot::of(&timeline));
    // A script of these lines is the same, but for escapes.
    let lines: String = timeline.gates.iter().map(|gate| format!("{}\n", gate.gate)).collect();
    let lines = lines.replace("\\u{202e}", "\u{202E}").replace("\\u{feff}", "\u{FEFF}");
    let again = motionseq::compile(&Source::new("x.motion", lines).into(), &Options::default()).timeline().unwrap();
    let gates = |timeline: &Timeline| timeline.gates.iter().map(|gate| gate.gate.to_string()).collect::<Vec<_>>();
    assert_eq!(gates(&again), gates(&timeline));
}

#[test]
fn invalid_snapshots_are_refused_with_line_and_reason() {
    let head = "# motionseq frames 2\n# x.motion\n";
    let newer = "# motionseq frames 3\n# x.motion\n";
    // A comment of an older format is a comment.
    assert!(
        read_snapshot(board(), format!("{head}# gate\tx\n# end\t0.000000\tframes\t0\tbaud\t1\n").as_bytes()).is_ok()
    );
    for gate in
        ["wait go within 0s", "wait go or continue", "wait until yaw > 5deg", "wait until yaw > infdeg within 1s"]
    {
        let text = format!("{newer}# gate\t0.000000\t{gate}\n# end\t0.000000\tframes\t0\tbaud\t1\n");
        assert!(read_snapshot(board(), text.as_bytes()).is_err(), "{gate}");
    }
    let good = "0.000000\tFF FE 02 03 01 05 DC E7\tservo 1 1500\n";
    let end = "# end\t0.000000\tframes\t1\tbaud\t115200\n";
    assert!(read_snapshot(board(), format!("{head}{good}{end}").as_bytes()).is_ok());
    let step = good.replace("1500\n", "1500\tsample\n");
    for (text, message) in [
        (String::new(), "line 1: expected `# motionseq frames 3`"),
        ("servo 1 1500\n".into(), "line 1: expected `# motionseq frames 3`"),
        (
            "# motionseq frames 4\n".into(),
            "line 1: version 4 is too new: this motionseq reads versions up to 3, so update it",
        ),
        ("# motionseq frames x\n".into(), "line 1: unknown version `x`"),
        (format!("{head}{good}{}", &good[..20]), "line 4: the command is missing"),
        (format!("{head}{}", good.trim_end()), "line 3: the file ends inside this line"),
        (format!("{head}{good}"), "line 3: the file is truncated: its last line is missing"),
        (format!("{head}{good}{good}{end}"), "line 5: found 2 frames instead of 1"),
        (format!("{head}{good}{end}{good}"), "line 5: there is a line after the end"),
        (
            format!("{head}{good}# end\t0.0\tframes\t1\n"),
            "line 4: the last line needs the end of the script, the number of frames and the speed of the line",
        ),
        (format!("{head}0.5\tFF\tstop\n"), "line 3: `0.5` is not a time with six decimals"),
        (format!("{head}{}", good.replace("DC", "DD")), "line 3: checksum E7 instead of E8"),
        (format!("{head}{}", good.replace("1500", "1501")), "line 3: the frame is `servo 1 1500`, not `servo 1 1501`"),
        (format!("{head}{}", good.replace("1500", "1500\todd")), "line 3: unknown kind of frame `odd`"),
        (
            format!("{head}{}", good.replace("1500\n", "1500\t\tleft\n")),
            "line 3: the frame is for the robot `left`, and the head names no robots",
        ),
        (
            format!("{newer}# gate\t1.000000\twait go\n# end\t0.000000\tframes\t0\tbaud\t115200\n"),
            "line 4: a gate is after the end of the script",
        ),
        (format!("{newer}# board\tmaestro\n"), "line 3: this is a snapshot for the board `maestro`, not `raspblock`"),
        (
            format!("{newer}# gate\t0.000000\twait for it\n"),
            "line 3: a gate needs its time and its line as a script writes it",
        ),
        (
            format!("{newer}{}# gate\t0.000000\twait go\n", good.replace("0.000000", "1.000000")),
            "line 4: its time is earlier than in the line above",
        ),
        (
            format!("{newer}# gate\t1.000000\twait go\n{good}{end}"),
            "line 4: its time is earlier than in the line above",
        ),
        (format!("{head}{step}{end}"), "line 4: the step at 0.000000 s belongs to no move"),
        (format!("{head}# move\t0.000000\t1.000000\tlinear\t2\n{step}{end}"), "line 5: a move has too few steps"),
        (
            format!("{head}# move\t0.000000\t1.000000\tlinaer\t2\n"),
            "line 3: a move needs its start, its end, its easing and its number of steps",
        ),
        (
            format!("{head}{}{good}", good.replace("0.000000", "1.000000")),
            "line 4: its time is earlier than in the line above",
        ),
    ] {
        assert_eq!(read_snapshot(board(), text.as_bytes()).unwrap_err().to_string(), message, "{text:?}");
    }
    assert_eq!(
        read_snapshot(board(), b"# motionseq frames 1\n\xFF\n").unwrap_err().to_string(),
        "line 2: not UTF-8 text"
    );
}

#[test]
fn the_command_compares_scripts_and_snapshots() {
    let (old, new) =
        (script("old", "servo 1 1500\nwait 1s\nservo 1 900\n"), script("new", "servo 1 1500\nwait 1s\nservo 1 950\n"));
    let output = run(&["diff", &old, &new]);
    assert_eq!(
        (output.status.code(), stdout(&output)),
        (Some(1), format!("at 1.000 s ({new}:3): servo 1 900 -> 950\n"))
    );
    let output = run(&["diff", &old, &old]);
    assert_eq!(
        (output.status.code(), stdout(&output), stderr(&output)),
        (Some(0), String::new(), "no difference: both send the same 2 frames\n".into())
    );
    let snapshot = script("snapshot", &format!("# motionseq frames 1\n# old\n{}", stdout(&run(&["render", &old]))));
    assert_eq!(run(&["diff", &snapshot, &old]).status.code(), Some(0));
    let output = run(&["diff", &snapshot, &new]);
    assert_eq!(stdout(&output), format!("at 1.000 s ({new}:3): servo 1 900 -> 950\n"));
    let broken = script("broken", "# motionseq frames 1\n0.0\n");
    let output = run(&["diff", &broken, &new]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("is not a snapshot: line 2: the frame is missing"), "{}", stderr(&output));
    assert_eq!(run(&["diff", &old, "/no/such/file"]).status.code(), Some(1));
    // A file named like a snapshot counts as one, even if it is empty.
    let empty = format!("{broken}.frames");
    fs::write(&empty, b"\0\xFF").unwrap();
    let output = run(&["diff", &empty, &new]);
    assert_eq!((output.status.code(), stdout(&output)), (Some(1), String::new()));
    assert!(
        stderr(&output).ends_with(&format!("write it again with `motionseq test --bless {broken}`\n")),
        "{}",
        stderr(&output)
    );
    assert_eq!(run(&["diff", "-", "-"]).status.code(), Some(2));
    assert_eq!(run(&["check", "-", "-"]).status.code(), Some(2));
}

#[test]
fn a_change_is_also_data() {
    let old = script("data-old", "servo 1 1500\nwait 1s\nrepeat 3 {\nservo 2 900\nwait 1s\n}\nbuzzer on for 1s\n");
    let new = script("data-new", "# edited\nservo 1 1500\nwait 1s\nrepeat 3 {\nservo 2 950\nwait 1s\n}\n");
    let json = |old: &str, new: &str| -> serde_json::Value {
        let output = run(&["diff", old, new, "--format", "json"]);
        assert_eq!(output.status.code(), Some(i32::from(old != new)), "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    let found = json(&old, &new);
    let place = |file: &str, line: u32| serde_json::json!({ "file": file, "line": line });
    let all = found["changes"].as_array().unwrap();
    // The first word of each line that is shown, and the kind.
    let human = stdout(&run(&["diff", &old, &new]));
    let shown: Vec<&str> = all.iter().map(|change| change["message"].as_str().unwrap()).collect();
    assert_eq!(shown.join("\n") + "\n", human);
    let of_kind = |kind: &str| all.iter().find(|change| change["kind"] == kind).unwrap();
    let changed = all.iter().find(|change| change["values"]["old"][0] == "servo" && change["values"]["old"][1] == "2");
    let changed = changed.unwrap();
    assert_eq!((&changed["old"], &changed["new"]), (&place(&old, 4), &place(&new, 5)));
    assert_eq!((&changed["values"]["old"][2], &changed["values"]["new"][2]), (&"900".into(), &"950".into()));
    assert_eq!((&changed["more"]["count"], &changed["more"]["other_values"]), (&2.into(), &false.into()));
    let removed = of_kind("removed");
    assert_eq!((&removed["old"], &removed["new"]), (&place(&old, 7), &serde_json::Value::Null));
    assert_eq!(removed["at_us"], 4_000_000);
    assert_eq!((&found["old"], &found["new"]), (&old.as_str().into(), &new.as_str().into()));
    assert_eq!(json(&old, &old)["changes"], serde_json::json!([]));
    // A snapshot has no lines.
    let snapshot =
        script("data-snapshot", &format!("# motionseq frames 1\n# old\n{}", stdout(&run(&["render", &old]))));
    let found = json(&snapshot, &new);
    assert!(found["changes"].as_array().unwrap().iter().all(|change| change["old"].is_null()), "{found}");
}

#[test]
fn the_totals_are_never_cut() {
    let text = |more: u32| {
        let lines = (0..100).map(|n| format!("servo 1 {}\nwait {}ms\n", 1_000 + 5 * n + more * (n + 1), 100 + n));
        format!("{}wait {}s\n", lines.collect::<String>(), 1 + more)
    };
    let (old, new) = (script("totals-old", &text(0)), script("totals-new", &text(1)));
    let output = run(&["diff", &old, &new]);
    let shown = stdout(&output);
    assert_eq!(shown.lines().count(), 50 + 1, "{shown}");
    assert!(shown.ends_with("\noverall: the script ends at 15.950 s -> 16.950 s\n"), "{shown}");
    assert_eq!(stderr(&output), "50 more changes; `-v` shows all\n");
    // In a test, too: of 300 changes, 200 are kept and 20 shown.
    let folder = std::env::temp_dir().join(format!("motionseq-totals-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("x.motion");
    let name = path.to_str().unwrap();
    fs::write(&path, text(0)).unwrap();
    assert_eq!(run(&["test", "--bless", name]).status.code(), Some(0));
    fs::write(&path, text(1)).unwrap();
    for (format, shown) in [("human", 20), ("json", 100), ("tap", 100), ("github", 100)] {
        let output = stdout(&run(&["test", "--format", format, name]));
        assert_eq!(output.matches(" -> ").count(), shown + 1, "{format}: {output}");
        assert!(output.contains("overall: the script ends at 15.950 s -> 16.950 s"), "{format}: {output}");
    }
    fs::remove_dir_all(folder).unwrap();
}

proptest! {
    /// Equal scripts are reported as equal, and different ones never are.
    #[test]
    fn a_difference_is_never_silent(
        old in prop::collection::vec((0u64..4, 1u8..4, 0u16..4, 0u64..3), 0..12),
        new in prop::collection::vec((0u64..4, 1u8..4, 0u16..4, 0u64..3), 0..12),
    ) {
        let text = |commands: &[(u64, u8, u16, u64)]| {
            let lines = commands.iter().map(|(wait, servo, pulse, over)| {
                let over = if *over > 0 { format!("900 -> {} over {}ms", 1_000 + pulse, 30 * over) } else { format!("{}", 1_000 + pulse) };
                format!("servo {servo} {over}\nwait {}ms\n", 10 * wait + 1)
            });
            format!("buzzer off\nwait 1ms\n{}", lines.collect::<Vec<_>>().concat())
        };
        let (old, new) = (text(&old), text(&new));
        let same = sent(&old) == sent(&new);
        prop_assert_eq!(words(&old, &new).is_empty(), same);
        prop_assert!(words(&old, &old).is_empty());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Shifted commands: the reported shift of each command is the real one.
    #[test]
    fn reported_times_are_true(
        commands in prop::collection::vec((1u64..8, 1u64..5, prop::sample::select(vec![0i64, 0, 0, 0, 100, 250, -50])), 1..25),
        one_lane in prop::bool::ANY,
    ) {
        // Each command has its own pulse width, and their order never changes.
        let (mut old_us, mut new_us) = (0, 0);
        let (mut before, mut after, mut moved) = (String::new(), String::new(), Vec::new());
        for (at, (gap, servo, later)) in commands.iter().enumerate() {
            let servo = if one_lane { 1 } else { *servo };
            old_us += gap * 100_000;
            new_us += (i64::try_from(gap * 100_000).unwrap() + later * 1_000).max(1_000);
            let pulse = 600 + at;
            before += &format!("at {old_us}us servo {servo} {pulse}\n");
            after += &format!("at {new_us}us servo {servo} {pulse}\n");
            moved.push((servo, old_us, new_us - i64::try_from(old_us).unwrap()));
        }
        let side = |text: &str| {
            let compiled = motionseq::compile(&Source::new("x.motion", text).into(), &Options::default());
            Snapshot::of(&compiled.timeline().unwrap())
        };
        let changes = diff(&side(&before), &side(&after), |change| change.new);
        // Sections at one pace are combined.
        prop_assume!(!changes.iter().any(|change| matches!(change.what, What::Scaled { .. }) && change.more.is_some()));
        for (at, (servo, old_us, by_us)) in moved.into_iter().enumerate() {
            let thing = format!("servo {servo}");
            let mut said = 0;
            for change in changes.iter().filter(|change| change.at <= Micros(old_us)) {
                if let What::Shifted { things, by, .. } = &change.what
                    && (things.is_empty() || things.contains(&thing))
                {
                    said = by.total_us;
                }
            }
            let mut scaled = 0;
            for change in changes.iter().filter(|change| change.at <= Micros(old_us)) {
                if let What::Scaled { lasts: [old, new], .. } = change.what {
                    let [old, new, since] = [old.0, new.0, (old_us - change.at.0).min(old.0)].map(i128::from);
                    scaled += i64::try_from(since * (new - old) / old).unwrap();
                }
            }
            for change in changes.iter().filter(|change| change.new == Some(at)) {
                if let What::Moved { by_us, .. } = change.what {
                    said = by_us;
                }
            }
            prop_assert!((said + scaled - by_us).abs() <= 2, "servo {} at {} us: {:#?}\n{}\n{}", servo, old_us, changes, before, after);
        }
    }
}

fn sent(text: &str) -> (Vec<Moment>, Micros) {
    let timeline = motionseq::compile(&Source::new("x.motion", text).into(), &Options::default()).timeline().unwrap();
    (timeline.events.iter().map(Moment::from).collect(), timeline.end)
}
