//! The bus of Feetech STS servos: its packets against those of the maker's library, its answers, its virtual servos, and programs of
//! others that drive them.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command as Process, Output};
use std::sync::Arc;

use motionseq::board::sts::{self, Packet, instruction};
use motionseq::board::{
    Board, BufferStart, Command, Decoder, Family, Frame, Hundredths, Item, Report, ReportDecoder, ReportItem, Verb,
};
use motionseq::capture::{Reading, to_script};
use motionseq::faults::{Faults, Faulty};
use motionseq::program::Options;
use motionseq::sim::{Device, ServoSetup, Settings};
use motionseq::source::Source;
use motionseq::units::Micros;
use proptest::prelude::*;

use crate::support::host::{Host, frames, has, link};
use crate::support::{Scratch, code, run, script, stderr, stdout};

fn board() -> Arc<Board> {
    Family::board("sts").unwrap()
}

fn command(board: &Board, word: &str, values: &[i32]) -> Command {
    board.command_named(word, values).unwrap_or_else(|error| panic!("{word} {values:?}: {error}"))
}

/// Each frame of the maker's library: its variant, its command, and its bytes.
fn vectors() -> Vec<(&'static str, Vec<&'static str>, Vec<u8>)> {
    let lines = include_str!("vectors/feetech.tsv").lines().filter(|line| !line.starts_with('#'));
    let vector = |line: &'static str| {
        let columns: Vec<&str> = line.split('\t').collect();
        let bytes = columns[2].split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
        (columns[0], columns[1].split(' ').collect(), bytes)
    };
    lines.map(vector).collect()
}

/// What a script contains for a frame of the library; empty if it contains nothing.
fn in_script(words: &[&str]) -> String {
    let number = |word: &str| word.rsplit('=').next().unwrap().parse::<i32>().unwrap();
    match words[0] {
        "torque" if number(words[1]) > 253 => String::new(),
        "torque" => format!("torque {} {}", number(words[1]), if number(words[2]) == 1 { "on" } else { "off" }),
        "goal" => format!("servo {} {}", number(words[1]), number(words[2])),
        "move" => {
            let id = number(words[1]);
            format!("accel {id} {}; speed {id} {}; servo {id} {}", number(words[2]), number(words[5]), number(words[3]))
        }
        "sync-goal" => {
            let goals = words[1..].iter().map(|goal| format!("servo {}", goal.replace('=', " ")));
            goals.collect::<Vec<_>>().join("; ")
        }
        _ => String::new(),
    }
}

#[test]
fn every_frame_of_the_makers_library_is_read() {
    let (board, vectors) = (board(), vectors());
    assert_eq!(vectors.len(), 126);
    for (variant, words, bytes) in vectors.iter().filter(|(variant, ..)| *variant == "sts") {
        let said = format!("{variant} {words:?}");
        let frame = Frame::new(&board, bytes).unwrap_or_else(|error| panic!("{said}: {error}"));
        let command = board.decode(frame.bytes()).unwrap_or_else(|error| panic!("{said}: {error}"));
        assert_eq!(board.to_frame(&command), *bytes, "{said}");
        let wanted = in_script(words);
        let shown: Vec<String> =
            board.in_script(command).iter().map(|command| board.show(command).to_string()).collect();
        match words[0] {
            "position?" => assert_eq!(shown.join("; "), format!("\"get position\" {}", words[1])),
            _ if wanted.is_empty() => assert!(shown.len() == 1 && shown[0].starts_with('"'), "{said}: {shown:?}"),
            _ => assert_eq!(shown.join("; "), wanted, "{said}"),
        }
    }
}

/// The packets of scripts, worked out by hand from the maker's description.
#[test]
fn the_lines_of_a_script_become_these_bytes() {
    let board = board();
    for (word, values, bytes) in [
        ("servo", vec![1, 2_089], "FF FF FE 07 83 2A 02 01 29 08 19"),
        ("torque", vec![1, 1], "FF FF FE 06 83 28 01 01 01 4D"),
        ("torque", vec![253, 0], "FF FF FE 06 83 28 01 FD 00 52"),
        ("speed", vec![6, 2_400], "FF FF FE 07 83 2E 02 06 60 09 D8"),
        ("accel", vec![6, 50], "FF FF FE 06 83 29 01 06 32 16"),
        ("\"get position\"", vec![1], "FF FF 01 04 02 38 02 BE"),
        ("\"get voltage\"", vec![1], "FF FF 01 04 02 3E 01 B9"),
        ("\"get mode\"", vec![1], "FF FF 01 04 02 21 01 D6"),
        ("\"get settings\"", vec![1], "FF FF 01 04 02 29 07 C8"),
    ] {
        let command = command(&board, word, &values);
        let frame = board.to_frame(&command);
        assert_eq!(motionseq::board::Hex(&frame).to_string(), bytes, "{word} {values:?}");
        assert_eq!(board.decode(&frame).unwrap(), command);
    }
}

/// All commands of the verbs of scripts: every number of a servo with the least and the most value, and every value for some servos.
fn every_command(board: &Board, mut take: impl FnMut(&Verb, Command)) {
    for (id, verb) in board.verbs().filter(|(_, verb)| verb.is_in_scripts() && verb.each.is_none()) {
        let (least, most) = verb.axes[1].range;
        for servo in 0..=253 {
            let all = [0, 1, 6, 253].contains(&servo);
            let values: BTreeSet<i32> = if all { (least..=most).collect() } else { [least, most].into() };
            for value in values {
                take(verb, board.command(id, &[servo, value]).unwrap());
            }
        }
    }
}

/// The registers that a packet writes: the address of the first, and the bytes.
fn written<'f>(packet: &Packet<'f>) -> Vec<(u8, &'f [u8])> {
    match (packet.instruction, packet.parameters) {
        (instruction::SYNC_WRITE, [address, size, all @ ..]) => {
            all.chunks(usize::from(*size) + 1).map(|data| (*address, &data[1..])).collect()
        }
        (instruction::WRITE | instruction::LATER, [address, data @ ..]) => vec![(*address, data)],
        (instruction::READ, _) => Vec::new(),
        other => panic!("no command of a script sends {other:?}"),
    }
}

/// A wrong byte in the settings of a servo lasts, and 128 as torque makes the present position the center.
#[test]
fn no_command_writes_a_setting_that_lasts() {
    let board = board();
    let check = |command: &Command| {
        let frame = board.to_frame(command);
        let packet = sts::packet(&frame).unwrap();
        for (address, data) in written(&packet) {
            let is_safe = matches!((address, data), (40, [0 | 1]) | (41, [_]) | (42 | 46, [_, _]));
            assert!(is_safe, "{} writes {data:02X?} at {address}", board.show(command));
        }
        assert_eq!(board.decode(&frame).as_ref(), Ok(command));
    };
    let mut count = 0;
    every_command(&board, |_, command| {
        count += 1;
        check(&command);
    });
    assert!(count > 30_000);
    // What a script makes of the packets of other programs: every address, and every value of the torque.
    for address in 0..=255 {
        for value in 0..=255 {
            let data = [value, 7, value, 0, 0, value, 8];
            for size in 1..=data.len() {
                let parameters: Vec<i32> = [1, address].into_iter().chain(data[..size].iter().copied()).collect();
                let written = command(&board, "\"write\"", &parameters);
                let size = i32::try_from(size).unwrap();
                let all: Vec<i32> = [address, size, 1].into_iter().chain(parameters[2..].iter().copied()).collect();
                let all = command(&board, "\"sync write\"", &all);
                let found = board.in_script(written.clone()).into_iter().chain(board.in_script(all.clone()));
                found.filter(|command| *command != written && *command != all).for_each(|command| check(&command));
            }
        }
    }
}

#[test]
fn the_corners_of_every_verb_are_read_as_they_are_written() {
    let board = board();
    for (id, verb) in board.verbs().filter(|(_, verb)| verb.each.is_none()) {
        let values: Vec<Vec<i32>> = match &*verb.word {
            "\"ping\"" | "\"action\"" | "\"reset\"" => vec![vec![0], vec![254]],
            "\"read\"" => vec![vec![0, 0, 1], vec![254, 255, 255]],
            "\"write\"" | "\"write later\"" => vec![vec![0, 0, 0], [&[254, 255], &[255; 252][..]].concat()],
            "\"sync read\"" => vec![vec![0, 1, 0], [&[56, 2], &[253; 251][..]].concat()],
            "\"sync write\"" => vec![vec![0, 1, 0, 0], vec![42, 2, 1, 2, 3, 2, 3, 4]],
            _ => {
                let ends = verb.axes.iter().map(|axis| [axis.range.0, axis.range.1]);
                ends.fold(vec![Vec::new()], |all, ends| {
                    all.iter().flat_map(|before| ends.map(|end| [&before[..], &[end]].concat())).collect()
                })
            }
        };
        for values in values {
            let command = board.command(id, &values).unwrap();
            let frame = board.to_frame(&command);
            assert!(frame.len() <= board.codec.longest());
            let read = board.decode(&frame).unwrap_or_else(|error| panic!("{}: {error}", board.show(&command)));
            assert_eq!(board.to_frame(&read), frame, "{}", board.show(&command));
            assert!(read.verb() <= command.verb(), "{}", board.show(&command));
        }
    }
}

#[test]
fn frames_are_found_however_the_stream_is_cut() {
    let board = board();
    let all: Vec<Vec<u8>> =
        vectors().into_iter().filter(|(variant, ..)| *variant == "sts").map(|(.., bytes)| bytes).collect();
    let stream = all.concat();
    let noisy: Vec<u8> = all.iter().flat_map(|frame| [&[0xFF, 0x00, 0x7E, 0xFF][..], frame].concat()).collect();
    for (stream, is_noisy) in [(stream, false), (noisy, true)] {
        for size in [1, 2, 3, 5, 7, 64, 1_000] {
            let mut decoder = Decoder::new(&board);
            let mut found = Vec::new();
            let mut take = |item: Item<'_>| match item {
                Item::Frame(frame) => found.push(frame.bytes().to_vec()),
                other => assert!(is_noisy, "{size}: {other:?}"),
            };
            stream.chunks(size).for_each(|chunk| decoder.feed(chunk, &mut take));
            decoder.finish(&mut take);
            assert_eq!(found, all, "{size}");
        }
    }
}

#[test]
fn a_frame_that_is_cut_hides_none_after_it() {
    let board = board();
    let whole = board.to_frame(&command(&board, "servo", &[3, 2_048]));
    for count in 1..whole.len() {
        let mut decoder = Decoder::new(&board);
        let mut found = Vec::new();
        // A servo that waits for the rest takes the start of the next frame for it.
        let stream = [&whole[..count], &whole, &whole].concat();
        let mut take = |item: Item<'_>| found.extend(matches!(item, Item::Frame(_)).then_some(()));
        decoder.feed(&stream, &mut take);
        decoder.finish(&mut take);
        assert_eq!(found.len(), 2, "{count} bytes");
    }
    let start = |bytes: &[u8]| board.codec.front(bytes, false);
    assert_eq!(start(&[0xFF, 0xFF, 1, 4, 2]), BufferStart::NeedMore);
    assert!(matches!(start(&[0xFF, 0xFF, 1, 1, 2]), BufferStart::Skip(..)), "a length that no packet has");
    assert!(matches!(start(&[0xFF, 0xFF, 1, 4, 9]), BufferStart::Skip(..)), "an unknown instruction");
}

/// The items that a decoder finds after a request for the position of servo 3, in pieces of some size.
fn heard(bytes: &[u8], size: usize) -> (Vec<ReportItem>, bool) {
    let board = board();
    let mut decoder = ReportDecoder::new(&board);
    decoder.ask(&command(&board, "\"get position\"", &[3]));
    let mut items = Vec::new();
    bytes.chunks(size).for_each(|piece| decoder.feed(piece, |item| items.push(item)));
    items.retain(|item| *item != ReportItem::Malformed);
    (items, decoder.is_waiting())
}

fn answer(id: u8, errors: u8, bytes: &[u8]) -> Vec<u8> {
    let mut answer = Vec::new();
    sts::emit_answer(&mut answer, id, errors, bytes);
    answer
}

#[test]
fn only_the_answer_of_the_servo_that_was_asked_counts() {
    let right = answer(3, 0, &[0x29, 0x08]);
    assert_eq!(right, [0xFF, 0xFF, 3, 4, 0, 0x29, 0x08, 0xC7]);
    let position = ReportItem::Report(Report::of(3, Hundredths(208_900)));
    let mut wrong_sum = right.clone();
    wrong_sum[7] ^= 1;
    let mut other_length = right.clone();
    other_length[3] = 5;
    for size in [1, 3, 100] {
        let found = |parts: &[&[u8]]| heard(&parts.concat(), size);
        assert_eq!(found(&[&right]), (vec![position], false));
        assert_eq!(found(&[&right, &right]), (vec![position], false), "twice");
        for wrong in [&answer(4, 0, &[0x29, 0x08]), &wrong_sum, &other_length, &answer(3, 0, &[]), &vec![0xFF; 70]] {
            assert_eq!(found(&[wrong]), (Vec::new(), true), "{wrong:02X?}");
            assert_eq!(found(&[wrong, &right]), (vec![position], false), "{wrong:02X?}");
        }
        for count in 1..right.len() {
            assert_eq!(found(&[&right[..count]]), (Vec::new(), true));
            assert_eq!(found(&[&right[..count], &right]), (vec![position], false), "{count} bytes, and then all");
        }
        assert_eq!(found(&[&[0xFF, 0xFF, 3, 4], &[7; 200], &right]), (vec![position], false), "noise");
        let flags = ReportItem::Flags(3, 0x20);
        assert_eq!(found(&[&answer(3, 0x20, &[0x29, 0x08])]), (vec![flags, position], false));
        let below = ReportItem::Report(Report::of(3, Hundredths(-100)));
        assert_eq!(found(&[&answer(3, 0, &[0x01, 0x80])]), (vec![below], false), "the sign is in the top bit");
    }
}

/// No bytes.
const NOTHING: [u8; 0] = [];

/// Virtual servos with these numbers.
struct Bus {
    board: Faulty,
    now: Micros,
}

impl Bus {
    fn new(ids: impl IntoIterator<Item = u8>, faults: &str) -> Self {
        let mut settings = Settings::default();
        settings.servos = Some(ids.into_iter().map(ServoSetup::new).collect());
        let faults = if faults.is_empty() { Faults::default() } else { faults.parse().unwrap() };
        Bus { board: Faulty::new(Device::new(board(), settings), faults), now: Micros::ZERO }
    }

    /// Sends a packet; gives nothing, because every answer takes time.
    fn send(&mut self, id: u8, instruction: u8, parameters: &[u8]) {
        let frame = answer(id, instruction, parameters);
        self.board.receive(self.now, &frame);
        assert!(self.board.replies().is_empty());
    }

    /// Sends a command of a script.
    fn say(&mut self, word: &str, values: &[i32]) {
        let family = board();
        self.board.receive(self.now, &family.to_frame(&command(&family, word, values)));
    }

    /// Lets microseconds pass; gives what was answered.
    fn wait(&mut self, time: u64) -> Vec<u8> {
        self.now += Micros(time);
        self.board.poll(self.now);
        self.board.replies()
    }

    /// Sends a packet, and gives the answers within 20 ms.
    fn ask(&mut self, id: u8, instruction: u8, parameters: &[u8]) -> Vec<u8> {
        self.send(id, instruction, parameters);
        self.wait(20_000)
    }

    /// Registers of a servo. The question takes no time.
    fn read(&self, id: u8, address: u8, count: u8) -> Vec<u8> {
        let mut now = Bus { board: Faulty::new(self.copy(), Faults::default()), now: self.now };
        let reply = now.ask(id, instruction::READ, &[address, count]);
        reply[5..reply.len() - 1].to_vec()
    }

    fn copy(&self) -> Device {
        self.board.device().clone()
    }

    fn position(&self, id: u8) -> u16 {
        u16::from_le_bytes(self.read(id, 56, 2).try_into().unwrap())
    }
}

#[test]
fn a_servo_answers_half_a_millisecond_later_if_it_is_there() {
    let mut bus = Bus::new(1..=6, "");
    bus.send(1, instruction::PING, &[]);
    // Six bytes at 1 Mbaud take 60 µs.
    assert_eq!(bus.board.next_due(), Some(Micros(560)));
    assert_eq!(bus.wait(559), NOTHING);
    assert_eq!(bus.wait(1), [0xFF, 0xFF, 1, 2, 0, 0xFC]);
    assert_eq!(bus.ask(7, instruction::PING, &[]), NOTHING);
    assert_eq!(bus.ask(1, instruction::READ, &[3, 2]), [0xFF, 0xFF, 1, 4, 0, 9, 3, 0xEE]);
    assert_eq!(bus.ask(1, instruction::READ, &[56, 2]), [0xFF, 0xFF, 1, 4, 0, 0, 8, 0xF2]);
    assert_eq!(bus.ask(1, instruction::READ, &[200, 2]), answer(1, 0, &[0, 0]), "registers that do not exist");
    assert_eq!(bus.ask(2, instruction::WRITE, &[40, 1]), answer(2, 0, &[]));
    assert_eq!(bus.ask(3, instruction::LATER, &[42, 0, 4]), answer(3, 0, &[]));
    // Packets for all have no answer, except for those that ask.
    assert_eq!(bus.ask(254, instruction::ACTION, &[]), NOTHING);
    assert_eq!(bus.ask(254, instruction::WRITE, &[40, 0]), NOTHING);
    assert_eq!(bus.ask(254, instruction::SYNC_WRITE, &[42, 2, 1, 0, 8]), NOTHING);
    assert_eq!(bus.ask(254, instruction::PING, &[]), (1..=6).flat_map(|id| answer(id, 0, &[])).collect::<Vec<u8>>());
    let all = bus.ask(254, instruction::SYNC_READ, &[62, 1, 5, 9, 2]);
    assert_eq!(all, [answer(5, 0, &[74]), answer(2, 0, &[74])].concat(), "in the order of the question");
    // A servo that gets another number answers with the old one.
    assert_eq!(bus.ask(6, instruction::WRITE, &[5, 9]), answer(6, 0, &[]));
    assert_eq!(bus.ask(9, instruction::PING, &[]), answer(9, 0, &[]));
}

#[test]
fn what_comes_during_an_answer_is_lost() {
    let mut bus = Bus::new([1, 2], "");
    let lost = |bus: &Bus| bus.board.device().received().lost;
    bus.say("torque", &[1, 1]);
    bus.send(1, instruction::READ, &[56, 2]);
    bus.wait(499);
    bus.say("speed", &[1, 100]);
    bus.wait(1);
    bus.say("speed", &[1, 200]);
    bus.send(2, instruction::PING, &[]);
    bus.wait(79);
    bus.say("speed", &[1, 300]);
    assert_eq!(bus.wait(1), answer(1, 0, &[0, 8]));
    assert_eq!((lost(&bus), bus.read(1, 46, 1)), (3, vec![100]));
    bus.say("speed", &[1, 99]);
    assert_eq!((lost(&bus), bus.read(1, 46, 1)), (3, vec![99]));
    assert_eq!(bus.wait(10_000), NOTHING, "a question that was lost has no answer");
}

#[test]
fn a_servo_moves_only_with_torque_and_at_a_limited_speed() {
    let mut bus = Bus::new([1], "");
    bus.say("servo", &[1, 3_000]);
    bus.wait(1_000_000);
    assert_eq!(bus.position(1), 2_048, "without torque");
    bus.say("torque", &[1, 1]);
    bus.wait(100_000);
    assert_eq!(bus.position(1), 2_348, "3000 steps per second");
    assert_eq!(bus.read(1, 58, 2), 3_000_u16.to_le_bytes());
    assert_eq!(bus.read(1, 66, 1), [1]);
    bus.say("speed", &[1, 500]);
    bus.wait(200_000);
    assert_eq!(bus.position(1), 2_448);
    bus.wait(5_000_000);
    assert_eq!((bus.position(1), bus.read(1, 66, 1)), (3_000, vec![0]));
    // Its own limits.
    bus.ask(1, instruction::WRITE, &[9, 0xE8, 0x03, 0xD0, 0x07]);
    bus.wait(5_000_000);
    assert_eq!(bus.position(1), 2_000);
    // 128 as torque makes the position the center.
    bus.ask(1, instruction::WRITE, &[40, 128]);
    assert_eq!((bus.read(1, 40, 1), bus.board.device().received().fell.len()), (vec![1], 0));
    // What only the servo writes.
    bus.ask(1, instruction::WRITE, &[3, 1, 1]);
    bus.ask(1, instruction::WRITE, &[62, 1]);
    assert_eq!((bus.read(1, 3, 2), bus.read(1, 62, 1)), (vec![9, 3], vec![74]));
}

#[test]
fn a_servo_falls_when_its_torque_goes_off() {
    let mut bus = Bus::new([1, 2, 3], "servo=3:0");
    bus.wait(100_000);
    assert_eq!(bus.position(1), 2_048, "it rests until it has had torque");
    for id in [1, 2, 3] {
        bus.say("torque", &[id, 1]);
    }
    for id in [3, 2] {
        bus.say("torque", &[id, 0]);
    }
    bus.wait(500_000);
    assert_eq!([1, 2, 3].map(|id| bus.position(id)), [2_048, 1_548, 0]);
    assert_eq!(bus.board.device().received().fell, [2]);
    // Torque holds it where it is.
    bus.say("torque", &[2, 1]);
    bus.wait(500_000);
    assert_eq!(bus.position(2), 1_548);
    bus.say("torque", &[2, 0]);
    bus.wait(10_000_000);
    assert_eq!((bus.position(2), bus.board.device().received().fell.clone()), (0, vec![2]));
}

#[test]
fn a_wheel_turns() {
    let mut bus = Bus::new([1], "servo=1:wheel,servo=1:4000");
    assert_eq!(bus.read(1, 33, 1), [1]);
    bus.say("torque", &[1, 1]);
    bus.say("speed", &[1, 1_000]);
    bus.wait(200_000);
    assert_eq!(bus.position(1), 104, "4200 of 4096 steps");
    // Backward: the sign is in the top bit.
    bus.send(1, instruction::WRITE, &[46, 0xE8, 0x83]);
    bus.wait(200_000);
    assert_eq!(bus.position(1), 4_000);
    bus.say("torque", &[1, 0]);
    bus.wait(1_000_000);
    assert!(bus.position(1) == 4_000 && bus.board.device().received().fell.is_empty());
}

#[test]
fn single_servos_have_faults() {
    let position = |fault: &str| {
        let mut bus = Bus::new([3, 4], fault);
        bus.ask(3, instruction::READ, &[56, 2])
    };
    let right = answer(3, 0, &[0, 8]);
    assert_eq!(position(""), right);
    assert_eq!(position("servo=4:silent"), right);
    assert_eq!(position("servo=9:silent"), right);
    assert_eq!(position("servo=3:silent"), NOTHING);
    assert_eq!(position("servo=3:twice"), [&right[..], &right].concat());
    assert_eq!(position("servo=3:other"), answer(4, 0, &[0, 8]));
    assert_eq!(position("servo=3:sum"), [&right[..7], &[!right[7]]].concat());
    assert_eq!(position("servo=3:error"), answer(3, 0x20, &[0, 8]));
    assert_eq!(position("servo=3:lost"), answer(3, 0, &5_000_u16.to_le_bytes()));
    assert_eq!(position("servo=3:700, servo=4:twice, servo=3:error"), answer(3, 0x20, &700_u16.to_le_bytes()));
    let mut late = Bus::new([3], "servo=3:late");
    late.send(3, instruction::PING, &[]);
    assert_eq!(late.wait(40_559), NOTHING);
    assert_eq!(late.wait(1), answer(3, 0, &[]));
    let mut slow = Bus::new([3], "servo=3:slow");
    slow.say("torque", &[3, 1]);
    slow.say("servo", &[3, 3_000]);
    slow.wait(1_000_000);
    assert_eq!(slow.position(3), 2_148);
}

#[test]
fn faults_of_servos_are_read_and_refused() {
    for wrong in [
        "servo=3",
        "servo=3:",
        "servo=254:silent",
        "servo=3:4096",
        "servo=3:-1",
        "servo=3:lame",
        "servo=3:silent,servo=3:silent",
        "servo=3:700,servo=3:800",
        "servo:silent",
    ] {
        let error = wrong.parse::<Faults>().unwrap_err().to_string();
        assert!(error.contains("servo=3:silent, twice, other, sum"), "{wrong}: {error}");
    }
    let refused = |args: &[&str], words: &str| {
        let output = run(args);
        assert!(code(&output) == 4 || code(&output) == 2, "{}", stderr(&output));
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    };
    let path = link("sts-refused");
    let link = path.to_str().unwrap();
    refused(&["board", "--link", link, "--fault", "servo=3:silent"], "has no servos that answer for themselves");
    refused(&["board", "--link", link, "--servos", "1..6"], "`--servos` has no effect");
    refused(&["record", "--link", link, "--family", "maestro 6", "--servos", "1"], "`--servos` has no effect");
    for wrong in ["0..254", "6..1", "1,,2", "", "a", "1..2..3"] {
        let args = ["board", "--link", link, "--family", "sts", "--servos", wrong];
        refused(&args, "write numbers from 0 to 253, such as 1..6 or 1,2,5");
    }
    let script = script("sts-fault", "servo 1 1500\n");
    refused(&["play", &script, "--fault", "servo=3:silent"], "`--fault servo=` has no effect");
}

#[test]
fn a_virtual_bus_has_the_servos_that_are_named() {
    let board = Host::start("sts-named", &["--family", "sts", "--servos", "7,9..10", "--fault", "servo=10:700"]);
    let mut port = board.open();
    let mut ask = |frame: &[u8], count: usize| {
        port.write_all(frame).unwrap();
        let mut answer = vec![0; count];
        port.read_exact(&mut answer).unwrap();
        answer
    };
    assert_eq!(ask(&answer(254, 1, &[]), 18), [7, 9, 10].map(|id| answer(id, 0, &[])).concat());
    assert_eq!(ask(&answer(10, 2, &[56, 2]), 8), answer(10, 0, &700_u16.to_le_bytes()));
    assert_eq!(ask(&answer(7, 3, &[40, 1]), 6), answer(7, 0, &[]));
    assert_eq!(ask(&answer(7, 3, &[40, 0]), 6), answer(7, 0, &[]));
    drop(port);
    let (listing, said) = board.end();
    assert_eq!(frames(&listing).len(), 4, "{listing}");
    assert!(listing.contains("\ttorque 7 off"), "{listing}");
    assert!(said.contains("servo 7 fell when its torque went off"), "{said}");
}

/// Runs a program of `tests/clients` on a port.
fn client(name: &str, port: &Path) -> Output {
    let path = format!("{}/tests/clients/{name}", env!("CARGO_MANIFEST_DIR"));
    let output = Process::new("python3").args(["-W", "ignore", &path, port.to_str().unwrap()]).output().unwrap();
    assert!(output.status.success() && stdout(&output).ends_with("done\n"), "{}{}", stdout(&output), stderr(&output));
    output
}

#[test]
fn the_sdk_of_the_maker_drives_the_virtual_bus() {
    if !has("scservo_sdk") {
        return;
    }
    let board = Host::start("sts-sdk", &["--family", "sts"]);
    client("feetech.py", &board.path);
    let (listing, said) = board.end();
    assert!(listing.contains("\taccel 2 50; speed 2 2400; servo 2 2100"), "{listing}");
    assert!(!said.contains("did not reach") && !said.contains("ignored"), "{said}");
}

#[test]
fn lerobot_drives_the_virtual_bus_and_its_recording_moves_it_again() {
    if !has("lerobot") || !has("deepdiff") || !has("scservo_sdk") {
        return;
    }
    let folder = Scratch::new("sts-lerobot");
    let recorded = folder.path("arm.motion");
    let board = Host::start_at("record", link("sts-lerobot"), &["--family", "sts", "-o", &recorded]);
    client("lerobot.py", &board.path);
    let (_, said) = board.end();
    assert!(!said.contains("did not reach") && !said.contains("ignored"), "{said}");
    assert!(said.contains("servos 1, 2, 3, 4, 5, 6 fell when their torque went off"), "{said}");
    let text = fs::read_to_string(&recorded).unwrap();
    let checked = run(&["check", &recorded]);
    assert_eq!(code(&checked), 0, "{text}{}", stderr(&checked));
    let rendered = stdout(&run(&["render", &recorded]));
    for id in 1..=6 {
        assert!(text.contains(&format!("torque {id} on")) && text.contains(&format!("torque {id} off")), "{text}");
        let goals = rendered.lines().filter_map(|line| line.split(&format!("\tservo {id} ")).nth(1));
        let goals: Vec<i32> = goals.map(|goal| goal.split_whitespace().next().unwrap().parse().unwrap()).collect();
        assert_eq!((goals.first(), goals.last()), (Some(&2_048), Some(&2_448)), "{text}");
        // A move may begin on the other side of its start.
        assert!(goals.len() >= 10 && goals.windows(2).all(|pair| pair[1] >= pair[0] - 8), "{text}");
    }
    assert!(text.contains("over ") && !text.contains("read\""), "{text}");
}

/// A script that is made of the frames of a program.
fn decoded(name: &str, stream: &[(u64, Vec<u8>)], more: &[&str]) -> String {
    let folder = Scratch::new(name);
    let hex = |(at, frame): &(u64, Vec<u8>)| format!("{:.6}\t{}\t\n", *at as f64 / 1e6, motionseq::board::Hex(frame));
    let listing = folder.file("a.txt", stream.iter().map(hex).collect::<String>().as_bytes());
    let path = folder.path("b.motion");
    assert_eq!(code(&run(&[&["decode", &listing, "--family", "sts", "-o", &path], more].concat())), 0);
    let checked = run(&["check", &path]);
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(code(&checked), 0, "{text}{}", stderr(&checked));
    text
}

#[test]
fn a_recording_has_the_commands_in_packets_for_several_servos() {
    let goals = |a: u16, b: u16| {
        let [[a0, a1], [b0, b1]] = [a, b].map(u16::to_le_bytes);
        answer(254, instruction::SYNC_WRITE, &[42, 2, 1, a0, a1, 2, b0, b1])
    };
    let stream = [
        (0, answer(1, instruction::PING, &[])),
        (1_000, answer(1, instruction::READ, &[3, 2])),
        (2_000, answer(254, instruction::SYNC_READ, &[56, 2, 1, 2])),
        (3_000, answer(1, instruction::WRITE, &[21, 16])),
        (4_000, answer(1, instruction::WRITE, &[40, 0])),
        // Without torque, no goal.
        (5_000, goals(1_000, 1_000)),
        (6_000, answer(1, instruction::WRITE, &[40, 1])),
        (7_000, goals(1_100, 1_200)),
        (7_100, goals(1_101, 1_201)),
        (9_000, answer(2, instruction::WRITE, &[41, 50, 0xB0, 0x04, 0, 0, 0, 0])),
        (20_000, answer(1, instruction::WRITE, &[42, 0xFF, 0x7F])),
        // Torque and a target in one packet, and one servo twice.
        (25_000, answer(2, instruction::WRITE, &[40, 1, 60, 0, 4])),
        (27_000, answer(254, instruction::SYNC_WRITE, &[42, 2, 2, 1, 4, 2, 2, 4])),
        (30_000, answer(254, instruction::WRITE, &[40, 0])),
        (40_000, answer(1, instruction::WRITE, &[40, 128])),
    ];
    for more in [&[][..], &["--exact"]] {
        let text = decoded("sts-decoded", &stream, more);
        for line in [
            "torque 1 off",
            "torque 1 on",
            "servo 1 1100",
            "servo 2 1200",
            "servo 1 1101",
            "accel 2 50",
            "servo 2 1024",
            "servo 2 1026",
        ] {
            assert!(text.contains(line), "{line}: {text}");
        }
        assert!(text.contains("left out, servo 1 1000: servo 1 has no torque"), "{text}");
        assert!(text.contains("\"write\" 0x01 0x15 0x10") && text.contains("\"write\" 0x01 0x28 0x80"), "{text}");
        assert!(text.contains("\"write\" 0xFE 0x28 0x00") && text.contains("\"write\" 0x01 0x2A 0xFF 0x7F"), "{text}");
        assert!(!text.contains("speed 2"), "{text}");
        assert!(!more.is_empty() || !text.contains("read\"") && !text.contains("ping"), "{text}");
    }
}

/// Torque that goes off and on again in between ends a move.
#[test]
fn a_move_of_a_recording_does_not_cross_a_loss_of_torque() {
    let goal = |at: u64| {
        let [low, high] = u16::try_from(1_000 + at / 1_000).unwrap().to_le_bytes();
        (at, answer(1, instruction::WRITE, &[42, low, high]))
    };
    let torque = |at: u64, value: u8| (at, answer(1, instruction::WRITE, &[40, value]));
    let mut stream: Vec<_> = (0..20).map(|step| goal(step * 20_000)).collect();
    stream.extend([torque(385_000, 0), torque(390_000, 1)]);
    stream.extend((20..40).map(|step| goal(step * 20_000)));
    let text = decoded("sts-torque", &stream, &[]);
    assert_eq!(text.matches(" over ").count(), 2, "{text}");
}

/// A packet that writes somewhere around the registers of scripts.
fn packets() -> impl Strategy<Value = Vec<u8>> {
    let data = prop_oneof![Just(0_u8), Just(1), Just(2), Just(8), Just(128), any::<u8>()];
    let ids = prop::collection::vec(1_u8..4, 1..4);
    (38_u8..48, 1_usize..9, ids, prop::collection::vec(data, 24), any::<bool>()).prop_map(
        |(address, size, ids, data, is_for_several)| {
            if !is_for_several {
                return answer(ids[0], instruction::WRITE, &[&[address], &data[..size]].concat());
            }
            let mut all = vec![address, u8::try_from(size).unwrap()];
            for (id, data) in ids.iter().zip(data.chunks(8)) {
                all.push(*id);
                all.extend(&data[..size]);
            }
            answer(254, instruction::SYNC_WRITE, &all)
        },
    )
}

proptest! {
    #[test]
    fn every_recording_compiles(stream in prop::collection::vec((0_u64..4_000, packets()), 1..40), exact: bool) {
        let mut at = 0;
        let mut listing = String::new();
        for (later, frame) in &stream {
            at += later;
            listing += &format!("{:.6}\t{}\t\n", at as f64 / 1e6, motionseq::board::Hex(frame));
        }
        let mut script = Vec::new();
        to_script(listing.as_bytes(), Reading::default().with_board(board()), exact, &mut script).unwrap();
        let script = String::from_utf8(script).unwrap();
        let compiled = motionseq::compile(&Source::new("x.motion", script.as_str()).into(), &Options::default());
        prop_assert!(!compiled.timelines.is_empty(), "{:?}\n{script}", compiled.diagnostics);
    }
}

#[test]
fn a_script_plays_on_servos_that_it_names() {
    let path = script("sts-play", "board sts\ntorque 200 on\nservo 200 2048 -> 2100 over 200ms\nservo 17 2000\n");
    let output = run(&["test", "--bless", "--play", &path]);
    assert_eq!(code(&output), 0, "{}{}", stdout(&output), stderr(&output));
    let output = run(&["test", "--play", &path]);
    assert_eq!(code(&output), 0, "{}{}", stdout(&output), stderr(&output));
}
