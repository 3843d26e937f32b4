//! The Pololu Maestro: its frames against those of the maker's library, its virtual board, and runs that read from it.

use std::fs;
use std::io::Read as _;
use std::process::{Command as Process, Stdio};
use std::sync::Arc;

use motionseq::board::{Board, BufferStart, Command, Decoder, Family, Frame, Hundredths, Item, NotACommand, Report};
use motionseq::link::Pty;
use motionseq::playback::{Cause, Input, Notice, Order, Player, Stop};
use motionseq::program::Options;
use motionseq::sim::{Device, Settings};
use motionseq::source::Source;
use motionseq::timeline::Timeline;
use motionseq::units::Nanos;
use rustix::process::{Pid, Signal, kill_process};

use crate::support::far::FarEnd;
use crate::support::host::{Host, frames, has};
use crate::support::{Scratch, code, motionseq, rendered, run, script, stderr, stdout};

fn board(line: &str) -> Arc<Board> {
    Family::board(line).unwrap()
}

fn timeline(text: &str) -> Timeline {
    motionseq::compile(&Source::new("test", text).into(), &Options::default()).timeline().expect("the script compiles")
}

/// Each frame of the maker's library: its protocol, its command, and its bytes.
fn vectors() -> Vec<(&'static str, Vec<&'static str>, Vec<u8>)> {
    let lines = include_str!("vectors/maestro.tsv").lines().filter(|line| !line.starts_with('#'));
    let vector = |line: &'static str| {
        let columns: Vec<&str> = line.split('\t').collect();
        let bytes = columns[2].split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
        (columns[0], columns[1].split(' ').collect(), bytes)
    };
    lines.map(vector).collect()
}

/// The board that a protocol of the vectors needs.
fn board_of(protocol: &str) -> Arc<Board> {
    board(match protocol {
        "compact-crc" => "maestro 24 crc on",
        "pololu-12" => "maestro 24 device 12",
        "pololu-7-crc" => "maestro 24 device 7 crc on",
        _ => "maestro 24",
    })
}

#[test]
fn every_frame_of_the_makers_library_is_read() {
    let vectors = vectors();
    assert_eq!(vectors.len(), 619);
    for (protocol, words, bytes) in &vectors {
        let board = board_of(protocol);
        let said = format!("{protocol} {words:?}");
        let frame = Frame::new(&board, bytes).unwrap_or_else(|error| panic!("{said}: {error}"));
        let decoded = board.decode(frame.bytes());
        let number = |at: usize| words[at].parse::<i32>().unwrap();
        let wanted = match words[0] {
            "target" if number(2) == 0 => format!("servo {} off", number(1)),
            "target" if (256..=16_320).contains(&number(2)) => {
                format!("servo {} {}", number(1), f64::from(number(2)) / 4.0)
            }
            "target" => {
                assert!(matches!(decoded, Err(NotACommand::OutOfRange(_))), "{said}: {decoded:?}");
                continue;
            }
            "speed" => format!("\"set speed\" {} {}", number(1), number(2)),
            "accel" => format!("\"set acceleration\" {} {}", number(1), number(2)),
            "home" => "home".to_owned(),
            "position?" => format!("\"get position\" {}", number(1)),
            "moving?" => "\"get moving state\"".to_owned(),
            "errors?" => "\"get errors\"".to_owned(),
            "targets" => {
                let shown = board.show(&decoded.clone().unwrap()).to_string();
                assert!(shown.starts_with("\"set targets\" "), "{said}: {shown}");
                shown
            }
            _ => {
                assert!(matches!(decoded, Err(NotACommand::NotInScripts(_))), "{said}: {decoded:?}");
                continue;
            }
        };
        let command = decoded.unwrap_or_else(|error| panic!("{said}: {error}"));
        assert_eq!(board.show(&command).to_string(), wanted, "{said}");
        assert_eq!(board.to_frame(&command), *bytes, "{said}");
    }
}

/// The lines of a script as the maker's library sends them: worked out from the guide by hand.
#[test]
fn the_lines_of_a_script_become_these_bytes() {
    let listing = |text: &str| stdout(&run(&["render", &script("maestro-bytes", text)]));
    assert_eq!(
        listing(
            "board maestro 6\nservo 0 1500\nservo 5 1500.25us\noutput 2 on\noutput 3 off\nservo 1 off\nwait 10ms\nhome\n"
        ),
        "0.000000\tAA 0C 21\t\"hello\"\tauto\n\
         0.000000\t84 00 70 2E\tservo 0 1500\n\
         0.000000\t84 05 71 2E\tservo 5 1500.25\n\
         0.000000\t84 02 58 36\toutput 2 on\n\
         0.000000\t84 03 08 27\toutput 3 off\n\
         0.000000\t84 01 00 00\tservo 1 off\n\
         0.010000\tA2\thome\n"
    );
    assert_eq!(
        listing("board maestro 12 device 7 crc on\nservo 5 1499.75us\n"),
        "0.000000\tAA 07 21 08\t\"hello\"\tauto\n0.000000\tAA 07 04 05 6F 2E 0F\tservo 5 1499.75\n"
    );
}

#[test]
fn the_corners_of_every_verb_are_read_as_they_are_written() {
    for line in ["maestro 6", "maestro 12 crc on", "maestro 18 device 0", "maestro 24 device 127 crc on"] {
        let board = board(line);
        for (id, verb) in board.verbs() {
            let mut values: Vec<Vec<i32>> = vec![Vec::new()];
            for axis in &verb.axes {
                let (least, most) = axis.range;
                let mut with = Vec::new();
                for before in &values {
                    with.extend([least, most].map(|value| [&before[..], &[value]].concat()));
                }
                values = with;
            }
            if verb.word == "\"set targets\"" {
                // The number of channels, the first, and two bytes for each.
                values = vec![vec![1, 0, 0, 0], vec![2, 3, 127, 127, 112, 46]];
            }
            for values in values {
                let Ok(command) = board.command(id, &values) else { continue };
                let frame = board.to_frame(&command);
                let read = board.decode(&frame).unwrap_or_else(|error| panic!("{}: {error}", board.show(&command)));
                assert_eq!(board.to_frame(&read), frame, "{}", board.show(&command));
                assert!(read.verb() <= command.verb() || verb.word == "\"hello\"", "{}", board.show(&command));
                assert!(frame.len() <= board.codec.longest());
            }
        }
    }
}

#[test]
fn frames_are_found_however_the_stream_is_cut() {
    for protocol in ["compact", "compact-crc", "pololu-12", "pololu-7-crc"] {
        let board = board_of(protocol);
        let all: Vec<Vec<u8>> =
            vectors().into_iter().filter(|(of, ..)| *of == protocol).map(|(.., bytes)| bytes).collect();
        let stream = all.concat();
        for size in [1, 2, 3, 5, 7, 64] {
            let mut decoder = Decoder::new(&board);
            let mut found = Vec::new();
            for chunk in stream.chunks(size) {
                decoder.feed(chunk, |item| match item {
                    Item::Frame(frame) => found.push(frame.bytes().to_vec()),
                    other => panic!("{protocol}, {size}: {other:?}"),
                });
            }
            assert_eq!(found, all, "{protocol}, {size}");
        }
    }
}

/// Gives bytes to a virtual board; returns its answers.
fn give(device: &mut Device, bytes: &[u8]) -> Vec<u8> {
    let mut decoder = Decoder::new(&Arc::clone(device.family()));
    decoder.feed(bytes, |item| device.take(item));
    device.replies().concat()
}

#[test]
fn a_packet_that_is_cut_sends_every_channel_home() {
    for (line, cut, errors) in [
        ("maestro 6", &[0x84, 0x00][..], 16),
        ("maestro 6", &[0x7F], 16),
        ("maestro 6", &[0xAA], 16),
        ("maestro 6 crc on", &[0x84, 0, 0x70, 0x2E, 0x00], 8),
    ] {
        let mut device = Device::new(board(line), Settings::default());
        let family = Arc::clone(device.family());
        let frame = |word: &str, values: &[i32]| family.to_frame(&family.command_named(word, values).unwrap());
        let (position, errors_of) = (frame("\"get position\"", &[0]), frame("\"get errors\"", &[]));
        give(&mut device, &frame("servo", &[0, 6_000]));
        assert_eq!(give(&mut device, &position), 6_000_u16.to_le_bytes(), "{line}");
        assert_eq!(give(&mut device, &errors_of), [0, 0], "{line}");
        give(&mut device, &[cut, &frame("servo", &[1, 4_000])].concat());
        assert_eq!(give(&mut device, &position), [0, 0], "{line} {cut:02X?}");
        assert_eq!(give(&mut device, &frame("\"get position\"", &[1])), 4_000_u16.to_le_bytes());
        // The errors are cleared as they are read.
        assert_eq!(give(&mut device, &errors_of), [errors, 0], "{line} {cut:02X?}");
        assert_eq!(give(&mut device, &errors_of), [0, 0]);
        assert_eq!(device.received().homes, 1);
    }
}

#[test]
fn a_channel_with_a_speed_moves_until_it_is_there() {
    let mut device = Device::new(board("maestro 12"), Settings::default());
    let ms = |ms: u64| motionseq::units::Micros::from_millis(ms);
    // 84 03 20 1F: channel 3 to 4000 quarters; 87 03 0A 00: at most 10 quarters in 10 ms; then to 5000.
    give(&mut device, &[0x84, 3, 0x20, 0x1F, 0x87, 3, 10, 0, 0x84, 3, 0x08, 0x27]);
    device.poll(ms(500));
    assert_eq!(give(&mut device, &[0x90, 3, 0x93]), [0x94, 0x11, 1]);
    device.poll(ms(1_001));
    assert_eq!(give(&mut device, &[0x90, 3, 0x93]), [0x88, 0x13, 0]);
    // 9F 02 03 …: channels 3 and 4 at once.
    give(&mut device, &[0x87, 3, 0, 0, 0x9F, 2, 3, 0x70, 0x2E, 0x20, 0x1F]);
    assert_eq!(give(&mut device, &[0x90, 3, 0x90, 4]), [0x70, 0x17, 0xA0, 0x0F]);
}

#[test]
fn an_end_completes_the_frame_that_has_begun_and_sends_nothing_else() {
    let timeline =
        timeline("board maestro 6\nservo 0 1500\nservo 1 1500\nwait 1s\nservo 0 1600\non abort { servo 5 1200 }\n");
    let whole: Vec<u8> =
        timeline.events.iter().take(3).flat_map(|event| timeline.board.to_frame(&event.command)).collect();
    for taken in 0..=whole.len() {
        let mut player = Player::new(&timeline, Nanos::from_millis(50));
        let mut none = |_| {};
        assert_eq!(player.poll(Nanos::ZERO, Input::Tick, &mut none), Order::Write);
        assert_eq!(player.bytes(), whole);
        let mut sent = whole[..taken].to_vec();
        let mut order = player.poll(Nanos::ZERO, Input::Wrote(taken), &mut none);
        let mut input = Input::Signal(2);
        let mut now = Nanos::from_millis(1);
        for _ in 0..20 {
            order = player.poll(now, input, &mut none);
            input = match order {
                Order::Write => {
                    sent.extend(player.bytes());
                    Input::Wrote(player.bytes().len())
                }
                Order::Pause { until } => {
                    now = until;
                    Input::Tick
                }
                Order::Halt { discards } => {
                    assert!(!discards);
                    Input::Tick
                }
                _ => Input::Tick,
            };
        }
        assert_eq!(order, Order::Done);
        let outcome = player.outcome().unwrap();
        assert_eq!((outcome.cause, outcome.stop), (Cause::Signal(2), Stop::NotDefined));
        // Whole frames of the script, and then only `on abort`.
        let frames = [3, 7, 11, 11].into_iter().find(|end| *end >= taken).filter(|_| taken > 0).unwrap_or(0);
        let abort = timeline.board.to_frame(&timeline.abort[0].command);
        assert_eq!(sent, [&whole[..frames], &abort].concat(), "{taken} bytes were taken");
    }
}

/// A script that reads.
const READS: &str = "board maestro 6\nservo 0 1500\nservo 3 1200.5us\nwait 200ms\nexpect position 3 > 1200us\n\
    wait until position 0 in 1490us..1510us within 2s\nservo 0 1600 over 100ms\nwait until moving < 1 within 2s\nsay \"at {position 0}\"\n";

#[test]
fn positions_are_read_between_the_frames() {
    let path = script("maestro-reads", READS);
    let report = format!("{path}.json");
    let output = run(&["play", &path, "--report", &report, "--max-late", "5s"]);
    let text = stderr(&output);
    assert_eq!(code(&output), 0, "{text}");
    assert!(text.contains("expect position 3 > 1200us: the board reports 1200.50"), "{text}");
    assert!(text.contains("position 0 in 1490us..1510us after 0."), "{text}");
    assert!(text.contains(" for requests, stops, "), "{text}");
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(&report).unwrap()).unwrap();
    let unscripted = json["unscripted"].as_array().unwrap();
    assert!(unscripted.iter().any(|frame| frame["frame"] == "90 03" && frame["reason"] == "read"), "{json}");
    assert!(unscripted.iter().all(|frame| frame["frame"] != "90 01"), "only what the script uses is read: {json}");
    // Under a simulated clock, too.
    assert_eq!(code(&run(&["test", "--bless", "--play", &path])), 0);
    let output = run(&["test", "--play", &path]);
    assert_eq!(code(&output), 0, "{}", stdout(&output));
}

#[test]
fn a_board_that_does_not_answer_ends_only_a_run_that_reads() {
    let silent = |text: &str| {
        let output = run(&["play", &script("maestro-silent", text), "--fault", "silent", "--max-late", "5s"]);
        (code(&output), stderr(&output))
    };
    let (exit, text) = silent("board maestro 12\nservo 0 1500\n");
    assert!(exit == 0 && text.contains("the board does not answer") && text.contains("USB Dual Port"), "{text}");
    let (exit, text) = silent(READS);
    assert!(exit == 3 && text.contains("USB Chained"), "{text}");
    assert!(text.contains("error: the board does not answer, and the script needs its answers"), "{text}");
    assert!(text.ends_with("servos hold their last position\n"), "{text}");
}

/// Plays on a port whose far end answers the hello with these bytes.
fn answered(with: &[u8]) -> String {
    let pty = Pty::open().unwrap();
    let path = script("maestro-answered", "board maestro 6\nservo 0 1500\n");
    let args = ["play", &path, "--port", pty.path().to_str().unwrap(), "--max-late", "5s"];
    let child = motionseq(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut buffer = [0; 64];
    assert!(pty.read(&mut buffer).unwrap() > 0);
    pty.write(with).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 0);
    stderr(&output)
}

#[test]
fn errors_that_the_board_reports_are_shown() {
    let text = answered(&[0x10, 0x00]);
    assert!(text.contains("warning: the board reports a serial protocol error\n"), "{text}");
    let text = answered(&[0x21, 0x02, 0xFF, 0xFF]);
    assert!(text.contains("reports a serial signal error, a serial timeout, unknown errors (0x0221)\n"), "{text}");
    let text = answered(&[0, 0]);
    assert!(!text.contains("warning"), "{text}");
    // Half of an answer does not count.
    let text = answered(&[0]);
    assert!(text.contains("the board does not answer"), "{text}");
}

/// The commands in what a board got: whole frames, of which only the last may be cut off. A busy system may have made the
/// player drop samples.
fn commands(line: &str, got: &[u8]) -> Vec<String> {
    let board = board(line);
    let (mut decoder, mut found, mut skipped) = (Decoder::new(&board), Vec::new(), 0);
    let mut take = |item: Item<'_>| match item {
        Item::Frame(frame) => {
            assert_eq!(skipped, 0, "a frame after bytes that are not one: {got:02X?}");
            found.push(board.show(&board.decode(frame.bytes()).unwrap()).to_string());
        }
        _ => skipped += 1,
    };
    decoder.feed(got, &mut take);
    decoder.finish(&mut take);
    assert!(skipped <= 1, "{got:02X?}");
    found
}

/// Plays a script that reads on a port whose far end answers each request with what `answer` makes of the right answer.
fn answering(name: &str, text: &str, answer: fn(&[u8]) -> Vec<u8>) -> (i32, String) {
    let pty = Pty::open().unwrap();
    let path = script(name, text);
    let args = ["play", &path, "--port", pty.path().to_str().unwrap(), "--max-late", "5s"];
    let child = motionseq(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut device = Device::new(board("maestro 6"), Settings::default());
    let mut decoder = Decoder::new(&board("maestro 6"));
    let mut buffer = [0; 256];
    while let Ok(count @ 1..) = pty.read(&mut buffer) {
        decoder.feed(&buffer[..count], |item| device.take(item));
        for reply in device.replies() {
            pty.write(&answer(&reply)).unwrap();
        }
    }
    let output = child.wait_with_output().unwrap();
    (code(&output), stderr(&output))
}

#[test]
fn answers_are_bounded_and_belong_to_their_request() {
    let text = "board maestro 6\nservo 0 1500\nwait 400ms\nexpect position 0 in 1499us..1501us\nexpect moving < 1\n";
    // Right, and with much more than was asked for.
    let (exit, said) = answering("maestro-right", text, <[u8]>::to_vec);
    assert_eq!(exit, 0, "{said}");
    let (exit, said) = answering("maestro-flood", text, |reply| [reply, &[7; 2_000]].concat());
    assert_eq!(exit, 0, "{said}");
    let late = "board maestro 6\nservo 0 1500\nwait 1s\nexpect position 0 > 0us\n";
    // Never more than a part.
    let (exit, said) = answering("maestro-part", late, |reply| reply[1..].to_vec());
    assert!(exit == 3 && said.contains("the board does not answer"), "{said}");
}

/// An answer that comes while half of a frame of ours has been written.
#[test]
fn an_answer_in_the_middle_of_our_frame_is_read() {
    let timeline =
        timeline("board maestro 6\nservo 0 1500\nwait 50ms\nservo 0 1600\nwait 1s\nexpect position 0 > 1400us\n");
    let mut player = Player::new(&timeline, Nanos::from_millis(500));
    let (mut input, mut sent, mut heard) = (Input::Tick, Vec::new(), Vec::new());
    for ms in 0..1_200 {
        let now = Nanos::from_millis(ms);
        while player.poll(now, input, &mut |_| {}) == Order::Write {
            // The port takes one byte at a time.
            sent.push(player.bytes()[0]);
            if sent.ends_with(&[0x21]) {
                player.receive(now, &[0, 0], &mut |_| {});
            }
            // To the newest request, in the middle of the frame `84 00 00 32`.
            if sent.ends_with(&[0x84, 0x00, 0x00]) {
                player.receive(now, &[0x70], &mut |notice| heard.push(notice));
                player.receive(now, &[0x17], &mut |notice| heard.push(notice));
            }
            input = Input::Wrote(1);
        }
        input = Input::Tick;
    }
    assert!(sent.windows(4).any(|bytes| bytes == [0x84, 0x00, 0x00, 0x32]), "{sent:02X?}");
    // 0x1770 quarters are 1500 µs.
    assert_eq!(heard, [Notice::Report(Report::of(1, Hundredths(150_000)))]);
}

/// Where nothing can be sent, the last line does not say that `on abort` was.
#[test]
fn a_port_that_hangs_up_gets_no_on_abort() {
    let timeline = timeline("board maestro 6\nservo 0 1500\nwait 1s\non abort { home }\n");
    for error in [Input::HungUp, Input::Failed(Some(5))] {
        let mut player = Player::new(&timeline, Nanos::from_millis(50));
        let (mut input, mut now, mut has_failed) = (Input::Tick, Nanos::ZERO, false);
        for _ in 0..200 {
            input = match player.poll(now, input, &mut |_| {}) {
                Order::Write if has_failed => error,
                Order::Write => Input::Wrote(player.bytes().len()),
                Order::Pause { until } => {
                    now = until;
                    Input::Tick
                }
                _ if !has_failed => {
                    has_failed = true;
                    error
                }
                _ => Input::Tick,
            };
        }
        let outcome = player.outcome().unwrap();
        assert!(
            matches!(outcome.cause, Cause::Lost(_)) && outcome.stop == Stop::NotDefined && !outcome.aborted,
            "{outcome:?}"
        );
    }
}

#[test]
fn a_late_answer_is_not_taken_for_the_answer_to_another_request() {
    let timeline =
        timeline("board maestro 6\nservo 0 1500\nwait 5s\nexpect position 0 > 0us\nexpect position 1 > 0us\n");
    let mut player = Player::new(&timeline, Nanos::from_millis(50));
    let mut reports = Vec::new();
    let mut asked = Vec::new();
    let mut input = Input::Tick;
    for ms in 0..1_000 {
        let now = Nanos::from_millis(ms);
        let mut note = |notice| match notice {
            Notice::Report(report) => reports.push(report.values().collect::<Vec<_>>()),
            Notice::Asked { quantity } => asked.push((ms, quantity)),
            _ => {}
        };
        while player.poll(now, input, &mut note) == Order::Write {
            input = Input::Wrote(player.bytes().len());
        }
        input = Input::Tick;
        match ms {
            // To the hello.
            2 => player.receive(now, &[0, 0], &mut note),
            // To the first request, too late.
            80 => player.receive(now, &[0x70, 0x17], &mut note),
            _ => {}
        }
    }
    assert!(reports.is_empty(), "{reports:?}");
    // The positions of the channels 0 and 1 in turn, not one while the answer to another is missing.
    assert!(
        asked.len() >= 4 && asked.windows(2).all(|pair| pair[0].1 != pair[1].1 && pair[1].0 - pair[0].0 >= 100),
        "{asked:?}"
    );
    assert!(asked[0].0 < 80 && asked[1].0 > 80, "{asked:?}");
}

#[test]
fn a_port_that_takes_no_more_ends_between_frames() {
    let moves: String = (0..24).map(|channel| format!("  servo {channel} 1000 -> 2000 over 20s\n")).collect();
    let text = format!("board maestro 24\nbaud 200000\nrate 200hz\ntogether {{\n{moves}}}\n");
    let path = script("maestro-stalled", &text);
    let pty = Pty::open().unwrap();
    let args = ["play", &path, "--port", pty.path().to_str().unwrap(), "--max-late", "200ms"];
    let mut child = motionseq(&args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(6), "{said}");
    assert!(said.ends_with("; servos hold their last position\n"), "{said}");
    let (mut got, mut buffer) = (Vec::new(), [0; 4096]);
    while let Ok(count @ 1..) = pty.read(&mut buffer) {
        got.extend(&buffer[..count]);
    }
    // The frame that the port has begun to take cannot be completed; nothing follows it.
    assert!(commands("maestro 24", &got).len() > 1_000);
}

/// After its player was killed, the guard sends nothing: what arrived is of the script.
#[test]
fn a_guard_sends_nothing_to_a_board_without_a_stop() {
    let path = script("maestro-killed", "board maestro 6\nservo 0 1000\nservo 0 2000 over 20s\non abort { home }\n");
    for signal in [Signal::KILL, Signal::STOP] {
        let far = FarEnd::new();
        let mut child = motionseq(&["play", &path, "--port", &far.path]).stderr(Stdio::piped()).spawn().unwrap();
        let mut got = far.first();
        while got.len() < 40 {
            got.extend(far.first());
        }
        kill_process(Pid::from_child(&child), signal).unwrap();
        let mut text = String::new();
        child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        child.wait().unwrap();
        got.extend(far.rest().into_iter().flat_map(|(_, bytes)| bytes));
        let sent = commands("maestro 6", &got);
        assert!(sent.len() < 900 && sent.iter().skip(1).all(|command| command.starts_with("servo 0 ")), "{sent:?}");
        assert!(text.ends_with("; servos hold their last position\n"), "{text}");
    }
}

#[test]
fn the_end_of_a_run_says_what_the_servos_do() {
    let path = script("maestro-ends", "board maestro 6\nservo 0 1000\nservo 0 2000 over 20s\n");
    let far = FarEnd::new();
    let mut child = motionseq(&["play", &path, "--port", &far.path]).stderr(Stdio::piped()).spawn().unwrap();
    let mut got = far.first();
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    got.extend(far.rest().into_iter().flat_map(|(_, bytes)| bytes));
    let sent = commands("maestro 6", &got);
    assert!(sent.iter().skip(1).all(|command| command.starts_with("servo 0 ")), "{sent:?}");
    assert!(text.ends_with("; servos hold their last position\n") && !text.contains("stop: "), "{text}");
}

#[test]
fn a_tap_sends_no_stop_either() {
    let far = FarEnd::new();
    let mut tap = Host::start_at(
        "record",
        crate::support::host::link("maestro-tap"),
        &["--family", "maestro 6", "--port", &far.path],
    );
    let mut port = tap.open();
    std::io::Write::write_all(&mut port, &[0x84, 0, 0x70, 0x2E]).unwrap();
    let mut got = far.first();
    while got.len() < 4 {
        got.extend(far.first());
    }
    drop(port);
    let (script, said) = {
        tap.signal(Signal::INT);
        let _ = tap.line();
        tap.end()
    };
    assert!(script.contains("board maestro 6\n") && script.contains("servo 0 1500\n"), "{script}");
    assert!(said.contains("servos hold their last position"), "{said}");
    got.extend(far.rest().into_iter().flat_map(|(_, bytes)| bytes));
    assert_eq!(got, [0x84, 0, 0x70, 0x2E]);
}

/// What motionseq itself sends becomes a script again, without its hello and its requests, and only the limits that it needs
/// are wider.
#[test]
fn a_recording_of_a_run_compiles_and_sends_the_same() {
    let folder = Scratch::new("maestro-again");
    let script = "board maestro 6\nlimit servo 3 992..2200\nservo 3 2200\nservo 0 1500.25us\nwait 100ms\nservo 1 off\n";
    let path = folder.file("a.motion", script.as_bytes());
    let listing = stdout(&run(&["render", &path]));
    // A program that asks, and sets a speed, in between.
    let asks = "0.050000\t90 03\t\n0.060000\t93\t\n0.070000\t87 00 10 00\t\n";
    let (first, last) = listing.split_at(listing.find("0.100000").unwrap());
    let times = folder.file("a.txt", format!("{first}{asks}{last}").as_bytes());
    let again = folder.path("b.motion");
    assert_eq!(code(&run(&["decode", &times, "--family", "maestro 6", "-o", &again])), 0);
    let checked = run(&["check", &again]);
    let text = fs::read_to_string(&again).unwrap();
    assert_eq!(code(&checked), 0, "{text}{}", stderr(&checked));
    assert_eq!(rendered(&again), rendered(&path), "{text}");
    assert!(text.contains("left out, 87 00 10 00: \"set speed\" 0 16") && !text.contains("\"get "), "{text}");
    assert_eq!(text.matches("limit ").collect::<Vec<_>>().len(), 1, "{text}");
    assert!(text.contains("\nlimit servo 3 64..3280"), "{text}");
}

#[test]
fn a_script_that_reads_moves_nothing_before_the_board_has_answered() {
    let timeline = timeline("board maestro 6\nservo 0 1500\nwait 1s\nexpect position 0 > 0us\n");
    let hello = timeline.board.to_frame(&timeline.events[0].command);
    for answer_at in [Some(120), None] {
        let mut player = Player::new(&timeline, Nanos::from_millis(50));
        let (mut input, mut sent) = (Input::Tick, Vec::new());
        for ms in 0..400 {
            let now = Nanos::from_millis(ms);
            if answer_at == Some(ms) {
                assert_eq!(sent, hello);
                player.receive(now, &[0, 0], &mut |_| {});
            }
            while player.poll(now, input, &mut |_| {}) == Order::Write {
                sent.extend(player.bytes());
                input = Input::Wrote(player.bytes().len());
            }
            input = Input::Tick;
        }
        if answer_at.is_some() {
            // The clock of the script began with the answer, so that nothing is late.
            assert!(player.outcome().is_none() && sent.starts_with(&[&hello[..], &[0x84, 0, 0x70, 0x2E]].concat()));
        } else {
            let outcome = player.outcome().unwrap();
            assert_eq!((outcome.cause, outcome.stop, sent), (Cause::Unanswered, Stop::NotDefined, hello.clone()));
        }
    }
}

/// A program that uses a library of others, which opens two ports of fixed names.
const DONKEY: &str = "import sys, serial
real = serial.Serial
ports = {'/dev/ttyACM0': sys.argv[1], '/dev/ttyACM2': sys.argv[2]}
serial.Serial = lambda path, *args, **more: real(ports[path], *args, **more)
from donkeycar.parts.actuator import Maestro
for channel in (0, 1, 11):
    servo = Maestro(channel)
    for pulse in (300, 370, 440):
        servo.set_pulse(pulse)
";

#[test]
fn a_library_of_others_drives_the_virtual_board() {
    if !has("donkeycar") {
        return;
    }
    let (other, board) = (Pty::open().unwrap(), Host::start("maestro-donkey", &["--family", "maestro 12"]));
    let mut python = Process::new("python3");
    python.args(["-W", "ignore", "-c", DONKEY, board.path.to_str().unwrap(), other.path().to_str().unwrap()]);
    let output = python.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let (listing, said) = board.end();
    // 300/4096 of a period at 60 Hz are 1220.7 µs: 4882 quarters.
    let of_channel = |channel: u8| {
        [[0x12, 0x26], [0x06, 0x2F], [0x79, 0x37]].map(|[low, high]| format!("84 {channel:02X} {low:02X} {high:02X}"))
    };
    assert_eq!(frames(&listing), [0, 1, 11].map(of_channel).concat(), "{said}");
    assert!(listing.contains("\tservo 0 1220.5") && listing.contains("\tservo 11 1790.25"), "{listing}");
}

#[test]
fn what_other_programs_send_in_another_protocol_is_explained() {
    let folder = Scratch::new("maestro-protocols");
    folder.file("pololu.bin", &[0xAA, 0x0C, 0x04, 0x00, 0x70, 0x2E]);
    folder.file("script.bin", &[0xA4]);
    folder.file("targets.bin", &[0x9F, 2, 3, 0x70, 0x2E, 0x20, 0x1F]);
    let decode = |file: &str, family: &str| {
        let output = run(&["decode", &folder.path(file), "--family", family]);
        stdout(&output) + &stderr(&output)
    };
    let said = decode("pololu.bin", "maestro 12");
    assert!(said.contains("a packet with a device number, which `board maestro N device D` reads"), "{said}");
    assert!(decode("pololu.bin", "maestro 12 device 12").contains("\tservo 0 1500\n"));
    assert!(decode("pololu.bin", "maestro 12 device 3").contains("a packet for another device number"));
    assert!(decode("script.bin", "maestro 12").contains("this stops the script inside the board"));
    assert!(decode("targets.bin", "maestro 12").contains("\"set targets\""));
}

#[test]
fn noise_delays_no_frame_and_is_no_frame() {
    let board = board("maestro 6");
    let start = |bytes: &[u8]| board.codec.front(bytes, false);
    assert_eq!(start(&[0x84, 0, 0x70]), BufferStart::NeedMore);
    assert!(matches!(start(&[0x12, 0x34, 0x84]), BufferStart::Skip(2, _)));
    assert!(matches!(start(&[0x84, 0, 0x84, 0]), BufferStart::Skip(2, _)));
    assert!(matches!(start(&[0x9F, 100, 0]), BufferStart::Skip(_, _)), "more channels than any board has");
    let command: Command = board.decode(&[0x84, 0, 0x70, 0x2E]).unwrap();
    assert_eq!(board.show(&command).to_string(), "servo 0 1500");
}
