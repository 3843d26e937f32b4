//! `--log`: the events of a run, as a file that other tools read.
#![cfg(feature = "mcap")]

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::host::{Host, has, link, rocker, stop};
use crate::support::{motionseq, run, stderr, stdout};
use mcap::read::{LinearReader, Options};
use mcap::records::Record;
use motionseq::source::{Source, Sources};
use rustix::process::Signal;
use serde_json::Value;

/// A message: its topic, its time in nanoseconds since 1970, and its content.
type Message = (String, u64, Value);

/// Reads a log up to where it was truncated.
fn messages(path: &Path) -> Vec<Message> {
    let bytes = fs::read(path).unwrap();
    let mut topics = std::collections::BTreeMap::new();
    let mut found = Vec::new();
    let mut take = |record: Record<'_>| match record {
        Record::Channel(channel) => {
            assert_eq!(channel.message_encoding, "json");
            topics.insert(channel.id, channel.topic);
        }
        Record::Message { header, data } => {
            found.push((topics[&header.channel_id].clone(), header.log_time, serde_json::from_slice(&data).unwrap()));
        }
        _ => {}
    };
    for record in LinearReader::new_with_options(&bytes, Options::IgnoreEndMagic.into()).unwrap() {
        match record {
            Ok(Record::Chunk { header, data }) => {
                mcap::read::ChunkReader::new(header, &data).unwrap().map(Result::unwrap).for_each(&mut take);
            }
            Ok(record) => take(record),
            // An incomplete record.
            Err(_) => break,
        }
    }
    // Tools expect this of every log, within a chunk and from one to the next.
    assert!(found.is_sorted_by_key(|(_, time, _)| *time), "messages are not in the order of time");
    let keys = |message: &Value| message.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let states: Vec<_> = found.iter().filter(|(topic, ..)| topic == "/board").map(|(.., state)| keys(state)).collect();
    assert!(
        states.windows(2).all(|pair| pair[0] == pair[1]) && states.iter().all(|keys| keys.len() == 14),
        "{states:?}"
    );
    found
}

/// Records of metadata: their names and fields.
type Facts = BTreeMap<String, BTreeMap<String, String>>;

/// The metadata of a log, and the names and texts of its attachments.
fn about(path: &Path) -> (Facts, Vec<(String, String)>) {
    let bytes = fs::read(path).unwrap();
    let (mut metadata, mut attachments) = (BTreeMap::new(), Vec::new());
    for record in LinearReader::new_with_options(&bytes, Options::IgnoreEndMagic.into()).unwrap() {
        match record.unwrap() {
            Record::Metadata(facts) => {
                metadata.insert(facts.name, facts.metadata);
            }
            Record::Attachment { header, data, .. } => {
                attachments.push((header.name, String::from_utf8(data.to_vec()).unwrap()));
            }
            _ => {}
        }
    }
    (metadata, attachments)
}

fn of<'m>(messages: &'m [Message], topic: &str) -> Vec<&'m Value> {
    messages.iter().filter(|(of, ..)| of == topic).map(|(.., message)| message).collect()
}

fn texts<'m>(messages: &'m [Message], topic: &str, field: &str) -> Vec<&'m str> {
    of(messages, topic).into_iter().filter_map(|message| message[field].as_str()).collect()
}

/// The path of a temporary file.
fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("motionseq-log-{}-{name}", std::process::id()))
}

/// Plays a script with a log.
fn played(name: &str, script: &str, more: &[&str]) -> (Vec<Message>, String, Option<i32>) {
    let (script_path, log) = (file(&format!("{name}.motion")), file(&format!("{name}.mcap")));
    fs::write(&script_path, script).unwrap();
    let args = ["play", script_path.to_str().unwrap(), "--log", log.to_str().unwrap(), "--progress", "none"];
    let output = run(&[&args[..], more].concat());
    let messages = messages(&log);
    fs::remove_file(script_path).unwrap();
    fs::remove_file(log).unwrap();
    (messages, stderr(&output), output.status.code())
}

const SCRIPT: &str = "request report-start\nat 0.2s {\n  mark bow\n  servo 1 1000 -> 2000 over 0.3s\n}\nat 0.6s rocker x=20 z=-5\n+0.1s stop\nsay \"done\"\nat 0.8s mark end\n";

#[test]
fn a_run_is_in_its_log_from_the_line_of_the_script_to_the_frame_on_the_wire() {
    let (messages, said, code) = played("run", SCRIPT, &[]);
    assert_eq!(code, Some(0), "{said}");

    // The frames of the listing were sent, in the same order and at the same times.
    let script = file("listing.motion");
    fs::write(&script, SCRIPT).unwrap();
    let listing = stdout(&run(&["render", script.to_str().unwrap()]));
    fs::remove_file(script).unwrap();
    let rows: Vec<Vec<&str>> = listing.lines().map(|line| line.split('\t').collect()).collect();
    assert!(rows.len() > 15);
    let frames = of(&messages, "/frames");
    let late = of(&messages, "/lateness");
    assert_eq!((frames.len(), late.len()), (rows.len(), rows.len()));
    for ((row, frame), late) in rows.iter().zip(&frames).zip(&late) {
        assert_eq!(frame["hex"], row[1]);
        let at = (row[0].parse::<f64>().unwrap() * 1e6).round();
        assert_eq!(late["script_us"].as_f64().unwrap(), at, "{late}");
        assert!(late["late_us"].as_f64().unwrap() >= 0.0 && frame["t_us"].as_f64().unwrap() >= at, "{frame} {late}");
        assert!(late["file"].as_str().unwrap().ends_with("run.motion"));
    }
    assert_eq!((&frames[0]["command"], &late[0]["line"]), (&Value::from("request report-start"), &Value::from(1)));
    let (first, last) = (&late[1], &late[late.len() - 1]);
    assert_eq!((&first["line"], &last["line"]), (&Value::from(4), &Value::from(7)));

    // The state follows, with the values that a plot needs.
    let board = of(&messages, "/board");
    let pulses: Vec<i64> =
        board.iter().filter_map(|state| state["servo_1"].as_i64()).filter(|pulse| *pulse > 0).collect();
    assert_eq!((pulses[0], pulses[pulses.len() - 1]), (1000, 2000));
    assert!(pulses.is_sorted());
    let driving = board.iter().find(|state| state["x"] == 20).unwrap();
    assert_eq!((&board[0]["servo_1"], &board[0]["drive"], &board[0]["buzzer"]), (&0.into(), &"".into(), &false.into()));
    assert_eq!((&driving["z"], &driving["drive"]), (&Value::from(-5), &Value::from("rocker x=20 y=0 z=-5")));
    assert_eq!((&board[board.len() - 1]["x"], &board[board.len() - 1]["wheel_a"]), (&Value::from(0), &Value::from(0)));

    assert_eq!(texts(&messages, "/marks", "name"), ["bow", "end"]);
    assert_eq!(of(&messages, "/marks")[0]["script_us"], 200_000);
    assert_eq!(texts(&messages, "/log", "message"), ["done", "everything was sent"]);
    assert_eq!(of(&messages, "/log")[0]["line"], 8);
    let reports = of(&messages, "/telemetry");
    assert!(reports.len() > 3 && reports.iter().all(|report| report["voltage_v"].as_f64().unwrap() > 10.0));

    // All topics use one clock: the mark is at the start of the move, also by the time of the log.
    let time = |topic: &str, at: usize| messages.iter().filter(|(of, ..)| of == topic).nth(at).unwrap().1;
    assert!(time("/marks", 0) <= time("/frames", 1));
    assert_eq!(time("/marks", 1) - time("/marks", 0), 600_000_000);
}

#[test]
fn a_run_that_ends_early_has_its_stop_and_its_reason_in_the_log() {
    let script = "mark go\nrocker x=20\nat 0.9s mark never\nat 0.1s request report-start\nat 0.5s expect voltage > 90V\nat 1s stop\n";
    let (messages, said, code) = played("early", script, &[]);
    assert_eq!(code, Some(7), "{said}");
    let commands = texts(&messages, "/frames", "command");
    assert_eq!(commands[commands.len() - 4..], ["stop", "stop", "stop", "buzzer off"]);
    let log = of(&messages, "/log");
    let [.., judged, reason] = &log[..] else { panic!("{log:?}") };
    assert!(judged["message"].as_str().unwrap().starts_with("expect voltage > 90V:"), "{judged}");
    assert_eq!((&judged["level"], &judged["line"]), (&Value::from(4), &Value::from(5)));
    // The other mark was not reached, although the stop took longer.
    assert_eq!(texts(&messages, "/marks", "name"), ["go"]);
    assert!(said.contains(reason["message"].as_str().unwrap()) && reason["level"] == 4, "{reason} {said}");
}

#[test]
fn a_gate_is_in_the_log_with_the_time_that_it_was_closed() {
    let script = "wait 0.3s\nrocker z=50\nwait until turned > 20deg within 5s\nstop\nmark turned_enough\n";
    let (messages, said, code) = played("gate", script, &[]);
    assert_eq!(code, Some(0), "{said}");
    let gates = of(&messages, "/gates");
    assert_eq!(gates.len(), 1);
    let gate = &gates[0];
    assert_eq!(
        (&gate["gate"], &gate["end"], &gate["opened"]),
        (&Value::from("wait until turned > 20deg within 5s"), &Value::from("matched"), &Value::from(true))
    );
    let took = gate["took_us"].as_u64().unwrap();
    assert!(gate["script_us"] == 300_000 && took > 300_000, "{gate}");
    // The clock of the script continues where it stopped.
    let mark = &of(&messages, "/marks")[0];
    assert!(mark["script_us"] == 300_000 && mark["t_us"].as_u64().unwrap() >= 300_000 + took, "{mark}");
    let log = texts(&messages, "/log", "message");
    assert!(log[1].starts_with("turned > 20deg after "), "{log:?}");
}

#[test]
fn each_pass_of_a_loop_is_in_the_log() {
    let (messages, said, code) =
        played("loop", "mark go\nservo 1 1500\nat 0.2s servo 1 1600\nwait 100ms\n", &["--loop", "2"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(of(&messages, "/frames").len(), 4);
    assert_eq!(texts(&messages, "/marks", "name").len(), 2);
}

/// What a program sends to a board, right and wrong, is in the log of `board` and of `record`.
fn logged(what: &str) -> Vec<Message> {
    let log = file(&format!("{what}.mcap"));
    let script = file(&format!("{what}-result.motion"));
    let more = ["--log", log.to_str().unwrap(), "-o", script.to_str().unwrap()];
    let more = if what == "record" { &more[..] } else { &more[..2] };
    let mut host = Host::start_at(what, link(&format!("log-{what}")), more);
    let mut port = host.open();
    port.write_all(&[0xFF, 0xFE, 5, 1, 0, 6]).unwrap();
    port.write_all(&rocker(20)).unwrap();
    port.write_all(&[0xFF, 0xFE, 4, 1, 1, 9]).unwrap();
    // The answer comes after the board has read everything.
    port.read_exact(&mut [0; 4]).unwrap();
    port.write_all(&stop()).unwrap();
    drop(port);
    host.says("is closed");
    host.end();
    let messages = messages(&log);
    fs::remove_file(log).unwrap();
    let _ = fs::remove_file(script);
    messages
}

#[test]
fn a_board_and_a_recording_log_what_comes() {
    for what in ["board", "record"] {
        let messages = logged(what);
        assert_eq!(
            texts(&messages, "/frames", "command"),
            ["request report-start", "rocker x=20 y=0 z=0", "stop"],
            "{what}"
        );
        let wrong: Vec<&str> = texts(&messages, "/frames", "wrong");
        assert_eq!(wrong, ["checksum 0x09 instead of 0x06"], "{what}");
        assert_eq!(texts(&messages, "/board", "drive"), ["", "rocker x=20 y=0 z=0", "stop"]);
        assert!(!of(&messages, "/telemetry").is_empty() && !of(&messages, "/pose").is_empty(), "{what}");
        let lines = texts(&messages, "/log", "message");
        assert_eq!(
            (lines[0], lines[lines.len() - 1]),
            ("a program has opened the port", "the program has closed the port")
        );
        assert!(lines.contains(&"FF FE 04 01 01 09: checksum 0x09 instead of 0x06"), "{lines:?}");
    }
}

/// What was found, and when: in the log, in what is printed, and in the script, from the first frame on.
#[test]
fn the_log_the_listing_and_the_script_have_the_same_frames_at_the_same_times() {
    let (log, script) = (file("same.mcap"), file("same.motion"));
    let more = ["--exact", "--format", "jsonl", "--log", log.to_str().unwrap(), "-o", script.to_str().unwrap()];
    let host = Host::start_at("record", link("log-same"), &more);
    let mut port = host.open();
    // Five frames in a row, with noise between them, and one that is cut.
    let frames = [rocker(20), vec![7, 7], rocker(21), vec![0xFF, 0xFE, 4, 1, 1, 9], rocker(22), rocker(23), stop()];
    port.write_all(&[&frames.concat()[..], &[0xFF, 0xFE, 3]].concat()).unwrap();
    drop(port);
    let (printed, _) = host.end();
    let (messages, text) = (messages(&log), fs::read_to_string(&script).unwrap());
    fs::remove_file(log).unwrap();
    fs::remove_file(script).unwrap();

    let logged: Vec<(u64, String)> = of(&messages, "/frames")
        .iter()
        .map(|frame| (frame["t_us"].as_u64().unwrap(), frame["hex"].as_str().unwrap().replace(' ', "")))
        .collect();
    let objects = printed.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let printed: Vec<(u64, String)> = objects
        .map(|object| {
            let hex = object["frame"].as_str().or(object["skipped"].as_str()).unwrap();
            (object["t_us"].as_u64().unwrap(), hex.to_owned())
        })
        .collect();
    // The log and the script have what the end has cut, too; there it is not printed.
    let (cut, whole) = logged.split_last().unwrap();
    assert_eq!((whole, cut.1.as_str()), (&printed[..], "FFFE03"));
    assert_eq!(printed.len(), 7, "{printed:?}");
    assert!(text.contains("skipped 3, FF FE 03: the stream ends inside a frame"), "{text}");
    let moved: Vec<u64> = printed.iter().filter(|(_, hex)| hex.starts_with("FFFE0308")).map(|(at, _)| *at).collect();
    let sources = Sources::from(Source::new("same.motion", text.as_str()));
    let script = motionseq::compile(&sources, &motionseq::program::Options::default()).timeline().unwrap();
    let sent: Vec<u64> = script.events.iter().map(|event| event.at.0).collect();
    let times: Vec<u64> = moved.iter().map(|at| at - moved[0]).collect();
    assert_eq!(sent, times, "{text}");
    // A frame of 13 bytes after another, as the line carries them: 1,128.5 us.
    assert!((1_128..=1_129).contains(&(moved[3] - moved[2])), "{moved:?}");
}

#[test]
fn a_log_can_be_read_when_its_program_was_killed() {
    let log = file("killed.mcap");
    let host = Host::start("log-killed", &["--log", log.to_str().unwrap()]);
    let mut port = host.open();
    port.write_all(&rocker(20)).unwrap();
    // It is on disk soon, whatever happens then.
    let begun = std::time::Instant::now();
    while messages(&log).iter().all(|(topic, ..)| topic != "/frames") {
        assert!(begun.elapsed().as_secs() < 60, "nothing is on disk");
        std::thread::yield_now();
    }
    host.signal(Signal::KILL);
    drop((port, host));
    let messages = messages(&log);
    assert_eq!(texts(&messages, "/frames", "command"), ["rocker x=20 y=0 z=0"]);
    // Every reader accepts it as complete.
    let bytes = fs::read(&log).unwrap();
    assert_eq!(mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count(), messages.len());
    if has("mcap") && has("jsonschema") {
        let read = Command::new("python3").args(["tests/clients/log.py", log.to_str().unwrap()]).output().unwrap();
        assert!(read.status.success() && stdout(&read).contains("/frames 1\n"), "{}", stderr(&read));
    }
    fs::remove_file(log).unwrap();
}

#[test]
fn a_full_disk_is_reported_and_changes_nothing_else() {
    let output = run(&["play", "scripts/hello.motion", "--log", "/dev/full", "--progress", "none"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("sent 22 frames"), "{said}");
    assert!(said.contains("the log /dev/full is incomplete: No space left on device"), "{said}");
    let script = file("full.motion");
    for what in ["board", "record"] {
        let more = ["--log", "/dev/full", "-o", script.to_str().unwrap()];
        let mut host =
            Host::start_at(what, link(&format!("full-{what}")), &more[..if what == "board" { 2 } else { 4 }]);
        host.open().write_all(&stop()).unwrap();
        host.says("is closed");
        let said = host.end_with(2).1;
        assert!(said.contains("the log /dev/full is incomplete"), "{said}");
    }
    assert!(fs::read_to_string(&script).unwrap().contains("stop"));
    fs::remove_file(script).unwrap();
}

#[test]
fn a_log_is_never_another_file_of_the_run() {
    let before = fs::read("scripts/hello.motion").unwrap();
    for (args, why) in [
        (&["--log", "scripts/hello.motion"][..], "this run reads it"),
        (
            &["--log", "/tmp/motionseq-log-same", "--report", "/tmp/motionseq-log-same"],
            "it is also the file of `--report`",
        ),
        (&["--log", "/tmp/no such folder/x.mcap"], "No such file"),
    ] {
        let output = run(&[&["play", "scripts/hello.motion"], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let said = stderr(&output);
        assert!(said.contains(why) && said.contains("nothing was sent"), "{said}");
    }
    let _ = fs::remove_file("/tmp/motionseq-log-same");
    assert_eq!(fs::read("scripts/hello.motion").unwrap(), before);
}

#[test]
fn pythons_reader_reads_it_and_every_message_matches_its_schema() {
    if !(has("mcap") && has("jsonschema")) {
        return;
    }
    let log = file("python.mcap");
    let script = file("python.motion");
    fs::write(&script, SCRIPT).unwrap();
    let output = run(&["play", script.to_str().unwrap(), "--log", log.to_str().unwrap(), "--progress", "none"]);
    assert_eq!(output.status.code(), Some(0));
    let read = Command::new("python3").args(["tests/clients/log.py", log.to_str().unwrap()]).output().unwrap();
    let expected = messages(&log);
    fs::remove_file(log).unwrap();
    fs::remove_file(script).unwrap();
    assert!(read.status.success(), "{}", stderr(&read));
    let counted = stdout(&read);
    for topic in ["/board", "/frames", "/lateness", "/log", "/marks", "/telemetry"] {
        assert!(counted.contains(&format!("{topic} {}\n", of(&expected, topic).len())), "{topic} of {counted}");
    }
}

/// Where the robot of a script is at the end: in the frame of the floor, as a transform, and in the units of the virtual board.
#[test]
fn the_pose_of_the_virtual_board_is_in_the_log_of_a_run_as_foxglove_has_it() {
    // Forward, to the right, and a quarter turn clockwise.
    let script = "rocker y=20 for 0.5s\nrocker x=10 for 0.5s\nrocker z=90 for 1s\nwait 0.3s\n";
    let (messages, said, code) = played("pose", script, &[]);
    assert_eq!(code, Some(0), "{said}");
    let (poses, transforms, positions) = (of(&messages, "/pose"), of(&messages, "/tf"), of(&messages, "/position"));
    assert!(poses.len() > 10 && poses.len() == transforms.len() && poses.len() == positions.len());
    let (pose, transform, position) = (poses[poses.len() - 1], transforms[poses.len() - 1], positions[poses.len() - 1]);
    assert_eq!(
        (&pose["frame_id"], &transform["parent_frame_id"], &transform["child_frame_id"]),
        (&"odom".into(), &"odom".into(), &"base_link".into())
    );
    assert_eq!(
        (&pose["pose"]["position"], &pose["pose"]["orientation"]),
        (&transform["translation"], &transform["rotation"])
    );
    assert_eq!(pose["timestamp"], transform["timestamp"]);
    let number = |value: &Value| value.as_f64().unwrap();
    let (x, y) = (number(&pose["pose"]["position"]["x"]), number(&pose["pose"]["position"]["y"]));
    // 10 cm forward and 5 cm to the right, which is negative; a quarter turn clockwise. Frames may be some milliseconds late.
    assert!((0.09..0.13).contains(&x) && (-0.08..-0.04).contains(&y), "{pose}");
    let turned = 2.0 * number(&pose["pose"]["orientation"]["z"]).atan2(number(&pose["pose"]["orientation"]["w"]));
    assert!((-1.9..-1.4).contains(&turned), "{pose}");
    let is_near = |cm: &Value, metres: f64| (number(cm) / 100.0 - metres).abs() < 1e-9;
    assert!(is_near(&position["y_cm"], x) && is_near(&position["x_cm"], -y), "{pose} {position}");
    assert!((turned.to_degrees() + number(&position["yaw_deg"])).abs() < 1e-6, "{pose} {position}");
}

#[test]
fn a_log_says_what_made_it_and_has_the_scripts() {
    let log = file("about.mcap");
    let output = run(&["play", "scripts/greeting.motion", "--speed", "8", "--log", log.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let (metadata, attachments) = about(&log);
    fs::remove_file(log).unwrap();
    let run = &metadata["motionseq"];
    assert_eq!((&*run["version"], &*run["port"]), (env!("CARGO_PKG_VERSION"), "virtual board"));
    let arguments: Vec<String> = serde_json::from_str(&run["arguments"]).unwrap();
    assert_eq!(arguments[..4], ["play", "scripts/greeting.motion", "--speed", "8"]);
    let result = &metadata["result"];
    assert_eq!((&*result["exit"], &*result["cause"]), ("0", "everything was sent"));
    let files = ["scripts/greeting.motion", "scripts/lib/phrases.motion"];
    let read = files.map(|name| (name.to_owned(), fs::read_to_string(name).unwrap()));
    assert_eq!(attachments, read);
}

#[test]
fn in_a_folder_each_run_has_a_log_of_its_own() {
    let folder = file("folder");
    fs::create_dir(&folder).unwrap();
    let names = || {
        let mut names: Vec<String> =
            fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    let place = format!("{}/", folder.display());
    let play = |more: &[&str]| run(&[&["play", "scripts/hello.motion", "--speed", "8"], more].concat());
    // A run that does not begin leaves nothing.
    let refused = play(&["--log", &place, "--port", "/dev/no-such-port"]);
    assert_eq!((refused.status.code(), names().len()), (Some(3), 0), "{}", stderr(&refused));
    for place in [&place, folder.to_str().unwrap(), &place] {
        let output = play(&["--log", place]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(stderr(&output).contains(&format!("writing the log {}", folder.display())), "{}", stderr(&output));
    }
    let found = names();
    assert_eq!(found.len(), 3, "{found:?}");
    for name in &found {
        let time = name.strip_prefix("hello-").and_then(|rest| rest.strip_suffix(".mcap")).unwrap();
        assert!(time.len() >= 16 && time[8..].starts_with('T') && time[15..].starts_with('Z'), "{name}");
    }
    // A script without a name.
    let mut piped =
        motionseq(&["play", "-", "--log", &place]).stdin(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    piped.stdin.take().unwrap().write_all(b"servo 1 1500\n").unwrap();
    assert!(piped.wait().unwrap().success());
    assert_eq!(names().iter().filter(|name| name.starts_with("stdin-2")).count(), 1, "{:?}", names());
    let output = play(&["--log", &format!("{place}none/")]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn decode_reads_the_frames_of_a_log() {
    let (log, cut) = (file("decode.mcap"), file("decode-cut.mcap"));
    let path = log.to_str().unwrap();
    assert_eq!(run(&["play", "scripts/hello.motion", "--log", path]).status.code(), Some(0));
    let columns = |text: &str| -> Vec<String> {
        text.lines().map(|line| line.split('\t').skip(1).take(2).collect::<Vec<_>>().join("\t")).collect()
    };
    let rendered = columns(&stdout(&run(&["render", "scripts/hello.motion"])));
    let decoded = run(&["decode", path]);
    assert_eq!((decoded.status.code(), columns(&stdout(&decoded))), (Some(0), rendered.clone()));
    let times: Vec<f64> =
        stdout(&decoded).lines().map(|line| line.split('\t').next().unwrap().parse().unwrap()).collect();
    assert!(times.is_sorted() && times[0] >= 0.5 && times[0] < 3.0, "{times:?}");
    // Without its end.
    let bytes = fs::read(&log).unwrap();
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    assert!(!stderr(&decoded).contains("ends early"), "{}", stderr(&decoded));
    let early = run(&["decode", cut.to_str().unwrap()]);
    assert_eq!(early.status.code(), Some(0));
    assert!(stderr(&early).contains("the log ends early"), "{}", stderr(&early));
    let decoded = columns(&stdout(&early));
    assert!(!decoded.is_empty() && rendered.starts_with(&decoded), "{decoded:?}");
    // A log of another program.
    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    other.add_channel(0, "/camera", "json", &BTreeMap::new()).unwrap();
    other.finish().unwrap();
    fs::write(&cut, other.into_inner().into_inner()).unwrap();
    let refused = run(&["decode", cut.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("without the topic `/frames`"), "{}", stderr(&refused));
    // A compressed chunk: its bytes are not needed to see that.
    let body = [&[0; 28][..], &4_u32.to_le_bytes(), b"zstd", &[0; 8]].concat();
    let chunk = [&[6][..], &u64::try_from(body.len()).unwrap().to_le_bytes(), &body].concat();
    fs::write(&cut, [mcap::MAGIC, &chunk].concat()).unwrap();
    let refused = run(&["decode", cut.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("it is compressed (zstd)"), "{}", stderr(&refused));
    fs::remove_file(log).unwrap();
    fs::remove_file(cut).unwrap();
}

#[test]
fn the_layout_for_foxglove_shows_topics_and_fields_of_the_log() {
    fn strings(value: &Value, found: &mut Vec<String>) {
        match value {
            Value::String(text) => found.push(text.clone()),
            Value::Array(values) => values.iter().for_each(|value| strings(value, found)),
            Value::Object(fields) => {
                found.extend(fields.keys().cloned());
                fields.values().for_each(|value| strings(value, found));
            }
            _ => {}
        }
    }
    let layout: Value = serde_json::from_str(&fs::read_to_string("docs/foxglove-layout.json").unwrap()).unwrap();
    let mut found = Vec::new();
    strings(&layout, &mut found);
    let shapes =
        fs::read_dir("docs/schemas/log").unwrap().map(|entry| fs::read_to_string(entry.unwrap().path()).unwrap());
    let shapes: String = shapes.collect();
    let page = fs::read_to_string("docs/logs.md").unwrap();
    let paths: Vec<&String> = found.iter().filter(|text| text.starts_with('/')).collect();
    assert!(paths.len() > 10, "{paths:?}");
    for path in paths {
        let (topic, field) = path.split_once('.').map_or((path.as_str(), None), |(topic, field)| (topic, Some(field)));
        assert!(page.contains(&format!("| `{topic}` |")), "{path}");
        assert!(field.is_none_or(|field| shapes.contains(&format!("\"{field}\": {{"))), "{path}");
    }
    // Every panel has a place.
    let panels = layout["configById"].as_object().unwrap();
    let placed = layout["layout"].to_string();
    assert!(panels.keys().all(|panel| placed.contains(&format!("\"{panel}\""))), "{placed}");
}

/// The checks of `mcap doctor`, and that command itself where it is installed.
#[test]
fn a_doctor_finds_nothing() {
    let folder = file("doctor");
    fs::create_dir(&folder).unwrap();
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let (whole, early, killed) = (path("whole.mcap"), path("early.mcap"), path("killed.mcap"));
    let (script, failing) = (path("a.motion"), path("b.motion"));
    fs::write(&script, SCRIPT).unwrap();
    fs::write(&failing, "rocker x=20\nat 0.5s expect voltage > 90V\nat 1s stop\n").unwrap();
    assert_eq!(run(&["play", &script, "--log", &whole, "--loop", "2"]).status.code(), Some(0));
    assert_eq!(run(&["play", &failing, "--log", &early]).status.code(), Some(7));
    let host = Host::start("log-doctor", &["--log", &killed]);
    let mut port = host.open();
    port.write_all(&rocker(20)).unwrap();
    while !messages(Path::new(&killed)).iter().any(|(topic, ..)| topic == "/frames") {
        std::thread::yield_now();
    }
    host.signal(Signal::KILL);
    drop((port, host));
    let (metadata, _) = about(Path::new(&killed));
    assert!(metadata.contains_key("motionseq") && !metadata.contains_key("result"), "{metadata:?}");
    if has("mcap") {
        let output =
            Command::new("python3").args(["tests/clients/doctor.py", &whole, &early, &killed]).output().unwrap();
        assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
    }
    for log in [&whole, &early, &killed] {
        let Ok(output) = Command::new("mcap").args(["doctor", "--strict-message-order", log]).output() else {
            println!("skipped: there is no mcap command");
            break;
        };
        assert!(output.status.success() && stderr(&output).is_empty(), "{log}: {}", stderr(&output));
    }
    fs::remove_dir_all(folder).unwrap();
}
