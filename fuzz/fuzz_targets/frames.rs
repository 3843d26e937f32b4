//! Every byte of a stream is in exactly one frame or skipped, however it is cut; `decode` never gives up, and what it writes as a script
//! compiles.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::board::{Board, Decoder, Family, Item, raspblock};
use motionseq::capture::{Reading, decode, to_script};
use motionseq::program::Options;
use motionseq::source::{Source, Sources};

/// What the decoder makes of a stream that comes in two pieces.
fn items(board: &Board, bytes: &[u8], cut: usize) -> (Vec<(bool, Vec<u8>)>, usize) {
    let mut found: Vec<(bool, Vec<u8>)> = Vec::new();
    let mut count = 0;
    let mut take = |item: Item<'_>| {
        let (is_frame, bytes) = match item {
            Item::Frame(frame) => (true, frame.bytes()),
            Item::Skipped { bytes, .. } => (false, bytes),
            _ => return,
        };
        count += bytes.len();
        match found.last_mut() {
            // Skipped bytes may come in pieces.
            Some((false, last)) if !is_frame => last.extend_from_slice(bytes),
            _ => found.push((is_frame, bytes.to_vec())),
        }
    };
    let mut decoder = Decoder::new(board);
    let (first, second) = bytes.split_at(cut);
    decoder.feed(first, &mut take);
    decoder.feed(second, &mut take);
    decoder.finish(&mut take);
    (found, count)
}

fuzz_target!(|input: (u16, Vec<u8>)| {
    let (cut, bytes) = input;
    for family in ["raspblock", "maestro 12", "maestro 6 device 12 crc on", "sts"] {
        let board = Family::board(family).expect("a family");
        let whole = items(&board, &bytes, 0);
        assert_eq!(whole.1, bytes.len(), "every byte once");
        assert_eq!(items(&board, &bytes, usize::from(cut).min(bytes.len())), whole);
        for (_, frame) in whole.0.iter().filter(|(is_frame, _)| *is_frame) {
            let command = board.decode_or_raw(frame);
            assert!(command.is_some() || board != raspblock::board(), "every frame of the Raspblock is a command");
            assert!(command.is_none_or(|command| &board.to_frame(&command) == frame));
        }
    }
    let mut listing = Vec::new();
    decode(bytes.as_slice(), Reading::default(), &mut listing).expect("nothing in a stream is fatal");
    assert!(String::from_utf8(listing).is_ok());
    for (family, exact) in [("raspblock", false), ("raspblock", true), ("sts", false), ("sts", true)] {
        let mut script = Vec::new();
        let reading = Reading::default().with_board(Family::board(family).expect("a family"));
        to_script(bytes.as_slice(), reading, exact, &mut script).expect("nothing in a stream is fatal");
        let script = String::from_utf8(script).expect("a script is text");
        let sources = Sources::from(Source::new("x.motion", script.as_str()));
        let compiled = motionseq::compile(&sources, &Options::default());
        // A packet for several servos becomes several frames, which may be more than the line carries.
        let is_full = |code: &str| family == "sts" && code == "wire-full";
        let is_right = compiled.diagnostics.iter().all(|found| !found.is_error() || is_full(found.code.name()));
        assert!(is_right, "{:?}\n{script}", compiled.diagnostics);
    }
});
