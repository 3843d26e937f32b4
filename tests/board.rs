//! The wire protocol: frames of the vendor's driver in both directions, and damaged streams.

use crate::support::board::{OnBoard, board, decoded as read};
use motionseq::board::{
    Command, Decoder, Frame, FrameError, Hundredths, Item, NotACommand, Report, ReportDecoder, ReportItem,
};
use motionseq::program::Options;
use motionseq::source::Source;
use proptest::prelude::*;

/// The vendor's frames: one command and its bytes per line.
fn vectors() -> Vec<(&'static str, Vec<u8>)> {
    include_str!("vectors/raspblock.tsv")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let (command, frame) = line.split_once('\t').unwrap();
            (command, hex(frame))
        })
        .collect()
}

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

/// Compiles a command as a script. A move needs position mode first, and servo 2 the board's full
/// range.
fn compiled(command: &str) -> Command {
    let mode = if command.starts_with("move") { "pid position speed=0,0 position=0,0,0 yaw=0,0,0\n" } else { "" };
    let source = Source::new("vector", format!("limit servo 2 500..2500\n{mode}{command}\n"));
    let compiled = motionseq::compile(&source.clone().into(), &Options::default());
    let events =
        compiled.timelines.into_iter().next().unwrap_or_else(|| panic!("{command}: {:?}", compiled.diagnostics)).events;
    events[usize::from(!mode.is_empty())].command.clone()
}

#[test]
fn every_vector_passes_both_ways() {
    let vectors = vectors();
    assert_eq!(vectors.len(), 295);
    for (text, bytes) in vectors {
        let frame = Frame::new(board(), &bytes).unwrap();
        let decoded = board().decode(frame.bytes()).unwrap();
        assert_eq!(decoded.to_frame(), bytes, "{text} encodes");
        // In the canonical notation, an all-zero rocker is `stop`.
        let notation = if text == "rocker x=0 y=0 z=0" { "stop" } else { text };
        assert_eq!(decoded.said(), notation, "the frame decodes");
        assert_eq!(compiled(text), decoded, "{text} compiles");
    }
}

/// `rocker x=10 z=50`, computed by hand from the protocol table: X 10 = 00 0A, Z 50 = 00 32, bit 0
/// is set because Z is not negative; 03 + 08 + 01 + 0A + 32 + 01 = 49.
static ROCKER: [u8; 13] = [0xFF, 0xFE, 0x03, 0x08, 0x01, 0x00, 0x0A, 0x00, 0x00, 0x00, 0x32, 0x01, 0x49];

#[test]
fn a_frame_is_taken_apart() {
    let frame = Frame::new(board(), &ROCKER).unwrap();
    assert_eq!(frame.bytes(), ROCKER);
    assert_eq!(frame.to_string(), "FF FE 03 08 01 00 0A 00 00 00 32 01 49");
}

#[test]
fn a_frame_is_put_together() {
    assert_eq!(compiled("rocker x=10 z=50").to_frame(), ROCKER);
}

#[test]
fn bytes_that_are_not_a_frame_are_refused_with_a_reason() {
    let mut wrong = ROCKER;
    wrong[12] = 0x48;
    assert_eq!(Frame::new(board(), &wrong), Err(FrameError::Checksum { expected: 0x49, found: 0x48 }));
    assert_eq!(Frame::new(board(), &ROCKER[..12]), Err(FrameError::Length));
    assert_eq!(Frame::new(board(), &ROCKER[1..]), Err(FrameError::NoHeader));
    assert_eq!(Frame::new(board(), &[0xFF, 0xFE]), Err(FrameError::Length));
    assert_eq!(Frame::new(board(), &[]), Err(FrameError::NoHeader));
}

/// Adds the envelope and the right checksum to a payload.
fn framed(function: u8, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xFF, 0xFE, function, u8::try_from(payload.len()).unwrap()];
    frame.extend_from_slice(payload);
    let sum = frame[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    frame.push(sum);
    frame
}

#[test]
fn invalid_commands_are_refused() {
    let decode = |function, payload: &[u8]| board().decode(&framed(function, payload));
    // Out of range: a servo at 499, a tilt at 1951, a wheel at 26.
    assert!(matches!(decode(0x02, &[1, 0x01, 0xF3]), Err(NotACommand::OutOfRange(_))));
    assert!(matches!(decode(0x02, &[0x05, 0xDC, 0x07, 0x9F]), Err(NotACommand::OutOfRange(_))));
    assert!(matches!(decode(0x03, &[2, 26, 0, 0, 0, 0, 0, 0]), Err(NotACommand::OutOfRange(_))));
    // A direction byte that the driver never sets: a negative zero, or unused bits.
    assert_eq!(decode(0x03, &[1, 0, 0, 0, 0, 0, 0, 0b101]), Err(NotACommand::Inconsistent));
    assert_eq!(decode(0x03, &[1, 0, 1, 0, 0, 0, 0, 0x81]), Err(NotACommand::Inconsistent));
    // A yaw hold has no z.
    assert_eq!(decode(0x03, &[3, 0, 1, 0, 0, 0, 7, 0]), Err(NotACommand::Inconsistent));
    // Unknown kinds, modes, requests and functions.
    assert_eq!(decode(0x03, &[5, 0, 0, 0, 0, 0, 0, 1]), Err(NotACommand::Unknown));
    assert_eq!(decode(0x01, &[2, 0, 0, 0, 0, 0, 0, 0, 0]), Err(NotACommand::Unknown));
    assert_eq!(decode(0x04, &[2]), Err(NotACommand::Unknown));
    assert_eq!(decode(0x05, &[10]), Err(NotACommand::Unknown));
    assert_eq!(decode(0x09, &[]), Err(NotACommand::Unknown));
}

/// Everything that a decoder finds in a stream: frames as hex, skipped bytes with their positions.
fn decoded(chunks: &[&[u8]]) -> Vec<String> {
    let mut found = Vec::new();
    let mut decoder = Decoder::new(board());
    let mut take = |item: Item<'_>| {
        found.push(match item {
            Item::Frame(frame) => frame.to_string(),
            Item::Skipped { at, bytes, why } => format!("{} at {at}: {why}", bytes.len()),
            other => panic!("{other:?}"),
        });
    };
    for chunk in chunks {
        decoder.feed(chunk, &mut take);
    }
    decoder.finish(&mut take);
    found
}

const ROCKER_HEX: &str = "FF FE 03 08 01 00 0A 00 00 00 32 01 49";

#[test]
fn the_decoder_continues_after_noise() {
    let stream = [&[0x00, 0xFF, 0x13][..], &ROCKER, &[0xFE], &ROCKER].concat();
    assert_eq!(
        decoded(&[&stream]),
        ["3 at 0: no frame starts here", ROCKER_HEX, "1 at 16: no frame starts here", ROCKER_HEX]
    );
}

#[test]
fn the_decoder_finds_the_frame_after_a_truncated_one() {
    // The truncated frame claims the first bytes of the next one, but its checksum is wrong.
    let stream = [&ROCKER[..7], &ROCKER].concat();
    let found = decoded(&[&stream]);
    assert_eq!(found, ["7 at 0: checksum 0x00 instead of 0x1F", ROCKER_HEX]);
}

#[test]
fn the_decoder_finds_the_frame_after_a_bad_checksum() {
    let mut bad = ROCKER;
    bad[12] = 0;
    assert_eq!(decoded(&[&bad, &ROCKER]), ["13 at 0: checksum 0x00 instead of 0x49", ROCKER_HEX]);
}

#[test]
fn an_implausible_length_delays_no_frame() {
    // A stop must not wait for 255 bytes that never come.
    let stream = [&[0xFF, 0xFE, 0x03, 0xFF][..], &ROCKER].concat();
    let mut decoder = Decoder::new(board());
    let mut frames = 0;
    decoder.feed(&stream, |item| frames += usize::from(matches!(item, Item::Frame(_))));
    assert_eq!(frames, 1);
    assert_eq!(decoded(&[&stream])[0], "4 at 0: function 0x03 has no payload of 255 bytes");
}

#[test]
fn a_stream_that_ends_inside_a_frame_is_cut() {
    assert_eq!(decoded(&[&ROCKER, &ROCKER[..5]]), [ROCKER_HEX, "5 at 13: the stream ends inside a frame"]);
    // A complete frame inside one with an implausible length is found.
    let stream = [&[0xFF, 0xFE, 0x40, 0xF0][..], &ROCKER].concat();
    assert_eq!(decoded(&[&stream]), ["4 at 0: truncated frame: another frame starts inside it", ROCKER_HEX]);
}

/// The frames of a stream, and the positions of all skipped bytes.
fn found(chunks: &[&[u8]]) -> (Vec<Vec<u8>>, Vec<u64>) {
    let (mut frames, mut skipped) = (Vec::new(), Vec::new());
    let mut decoder = Decoder::new(board());
    let mut take = |item: Item<'_>| match item {
        Item::Frame(frame) => frames.push(frame.bytes().to_vec()),
        Item::Skipped { at, bytes, .. } => skipped.extend(at..at + bytes.len() as u64),
        other => panic!("{other:?}"),
    };
    for chunk in chunks {
        decoder.feed(chunk, &mut take);
    }
    decoder.finish(&mut take);
    (frames, skipped)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The result does not depend on how a stream is split into reads, and covers every byte.
    #[test]
    fn reads_do_not_matter(parts in prop::collection::vec((0..295_usize, prop::collection::vec(any::<u8>(), 0..6)), 1..12), cut in 1..40_usize) {
        let vectors = vectors();
        let stream: Vec<u8> = parts.iter().flat_map(|(at, noise)| [noise.clone(), vectors[*at].1.clone()].concat()).collect();
        let whole = found(&[&stream]);
        let pieces: Vec<&[u8]> = stream.chunks(cut).collect();
        prop_assert_eq!(&whole, &found(&pieces));
        let frames: usize = whole.0.iter().map(Vec::len).sum();
        prop_assert_eq!(frames + whole.1.len(), stream.len());
    }

    /// Every complete frame is refused or decodes to a command that encodes to the same bytes.
    #[test]
    fn decoding_loses_nothing(function in 0..7_u8, payload in prop::collection::vec(any::<u8>(), 0..10)) {
        let bytes = framed(function, &payload);
        let frame = Frame::new(board(), &bytes).unwrap();
        if let Ok(command) = board().decode(frame.bytes()) {
            prop_assert_eq!(command.to_frame(), bytes.clone());
        }
        prop_assert_eq!(read(frame).to_frame(), bytes);
    }
}

/// The reports in a stream, and the number of malformed ones.
fn reports(chunks: &[&[u8]]) -> (Vec<Report>, usize) {
    let (mut found, mut malformed) = (Vec::new(), 0);
    let mut decoder = ReportDecoder::new(board());
    for chunk in chunks {
        decoder.feed(chunk, |item| match item {
            ReportItem::Report(report) => found.push(report),
            ReportItem::Malformed => malformed += 1,
            other => panic!("{other:?}"),
        });
    }
    (found, malformed)
}

/// Voltage, pitch, roll and yaw.
fn report() -> Report {
    Report::new(&[1187, -120, 35, 9000].map(Hundredths))
}

#[test]
fn a_report_is_read_in_any_pieces() {
    let line = b"{A-120:35:9000:1187}#";
    assert_eq!(board().report_line(&report()).as_bytes(), line);
    assert_eq!(reports(&[line]), (vec![report()], 0));
    for cut in 0..line.len() {
        assert_eq!(reports(&[&line[..cut], &line[cut..]]), (vec![report()], 0), "cut at {cut}");
    }
    assert_eq!(reports(&[&[&line[..], line].concat()]), (vec![report(); 2], 0));
    assert_eq!(reports(&[b"\xFF\x00}#noise", line, b"###\n"]), (vec![report()], 0));
    assert_eq!(report().value(1).unwrap().to_string(), "-1.20");
    assert_eq!(Hundredths(-5).to_string(), "-0.05");
}

#[test]
fn a_malformed_report_is_skipped() {
    for line in [
        "{A1:2:3}#",
        "{A1:2:3:4:5}#",
        "{A1:2:x:4}#",
        "{A1::3:4}#",
        "{A1:2:3:4#",
        "{B1:2:3:4}#",
        "{A+1:2:3:4}#",
        "{A1:2:3:99999999999}#",
        "{}#",
        "{A 1:2:3:4}#",
    ] {
        assert_eq!(reports(&[line.as_bytes()]), (vec![], 1), "{line}");
    }
    // A truncated report ends where the next one starts, and one without an end delays nothing.
    assert_eq!(reports(&[b"{A1:2:{A-120:35:9000:1187}#"]), (vec![report()], 1));
    let endless = [b"{A".as_slice(), &[b'1'; 1000], b"{A-120:35:9000:1187}#"].concat();
    assert_eq!(reports(&[&endless]), (vec![report()], 1));
}

#[test]
fn a_header_inside_a_length_that_no_command_has_begins_a_frame() {
    // A frame that was truncated after its header, or after the function of a raw frame, claims the
    // next header as its function and length. Noise may claim any length.
    for torn in [&[0xFF, 0xFE][..], &[0xFF, 0xFE, 0x40], &[0xFF, 0xFE, 0x77, 200], &[0xFF, 0xFE, 0x77, 255, 1, 2, 3]] {
        let mut decoder = Decoder::new(board());
        let mut found = Vec::new();
        for byte in torn.iter().chain(&ROCKER) {
            decoder.feed(&[*byte], |item| {
                if let Item::Frame(frame) = item {
                    found.push(frame.bytes().to_vec());
                }
            });
        }
        // Immediately, not after as many bytes as were claimed.
        assert_eq!(found, [ROCKER.to_vec()], "{torn:02X?}");
        assert_eq!(decoded(&[torn, &ROCKER]).last().unwrap(), ROCKER_HEX);
    }
    // A frame of an unknown function with a plausible length is read as it is.
    let raw = [&[0xFF, 0xFE, 0x40, 13][..], &ROCKER].concat();
    let sum = raw[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    assert_eq!(decoded(&[&raw, &[sum]]).len(), 1);
}

#[test]
fn the_zeros_of_a_stop_are_not_a_fault() {
    let zeros = |count: usize, at: usize| format!("{count} at {at}: zeros that resynchronize a receiver");
    let hex = || ROCKER_HEX.to_owned();
    let expected =
        [hex(), zeros(12, 13), hex(), zeros(257, 38), hex(), "2 at 308: no frame starts here".to_owned(), hex()];
    assert_eq!(decoded(&[&ROCKER, &[0; 12], &ROCKER, &[0; 257], &ROCKER, &[0, 0], &ROCKER]), expected);
}
