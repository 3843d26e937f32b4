//! The file of a text board is read without a panic, its errors point into it, and what a board that is accepted writes
//! is read as the same command, however the stream is cut.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::board::{Board, Decoder, Item};
use motionseq::diagnostic::Diagnostics;
use motionseq::program::text_board;
use motionseq::source::Source;

/// A frame for each verb, with every value at one end of its range.
fn frames(board: &Board) -> Vec<Vec<u8>> {
    let corner = |is_high: bool| {
        board.verbs().filter_map(move |(id, verb)| {
            let end = |(low, high): (i32, i32)| if is_high { high } else { low };
            let values: Vec<i32> = verb.axes.iter().map(|axis| end(axis.range)).collect();
            let command = board.command(id, &values).ok()?;
            let frame = board.to_frame(&command);
            let read = board.decode(&frame).expect("what it writes, it reads");
            assert_eq!(board.to_frame(&read), frame);
            Some(frame)
        })
    };
    corner(false).chain(corner(true)).collect()
}

fuzz_target!(|input: (u8, &str)| {
    let (cut, text) = input;
    let source = Source::new("robot.toml", text);
    let mut diagnostics = Diagnostics::default();
    let board = text_board(&source, "robot.toml", &mut diagnostics);
    for diagnostic in diagnostics.iter() {
        let (start, end) = (diagnostic.span.start as usize, diagnostic.span.end as usize);
        assert!(start <= end && end <= text.len() && text.is_char_boundary(start) && text.is_char_boundary(end));
    }
    let Some(board) = board else {
        assert!(diagnostics.has_errors());
        return;
    };
    let frames = frames(&board);
    let stream = frames.concat();
    let mut found = Vec::new();
    let mut decoder = Decoder::new(&board);
    for chunk in stream.chunks(usize::from(cut).max(1)) {
        decoder.feed(chunk, |item| match item {
            Item::Frame(frame) => found.push(frame.bytes().to_vec()),
            other => panic!("{other:?}"),
        });
    }
    assert_eq!(found, frames);
});
