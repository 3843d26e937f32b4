//! Any text compiles or says why not; what it sends is in order, reads back, and can be drawn.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::plot::{Theme, plot};
use motionseq::program::Options;
use motionseq::source::{Source, Sources};
use motionseq::timeline::Timeline;

fuzz_target!(|text: &str| {
    // Millions of passes are tested elsewhere; here they only take time.
    if text.split(|c: char| !c.is_ascii_digit()).any(|digits| digits.len() > 4) {
        return;
    }
    let sources = Sources::from(Source::new("x.motion", text));
    // Few frames, so that a run is short.
    let compiled = motionseq::compile(&sources, &Options::default().with_events(10_000));
    assert_eq!(compiled.timelines.is_empty(), compiled.diagnostics.has_errors());
    for diagnostic in &compiled.diagnostics {
        let _ = sources.place(diagnostic.span);
        assert!(!diagnostic.message.is_empty() && !diagnostic.help.is_empty());
    }
    for timeline in &compiled.timelines {
        check(timeline);
    }
    let picture = plot(&compiled.timelines, &sources, &compiled.diagnostics);
    assert!(picture.to_svg(Theme::Auto).len() < 8_000_000 && !picture.to_json().is_empty());
});

/// What holds for the timeline of every robot.
fn check(timeline: &Timeline) {
    let board = &timeline.board;
    // The hello of a board comes before everything else.
    let after = timeline.events.get(board.hello.len()..).unwrap_or_default();
    assert!(after.is_sorted_by_key(|event| (event.at, event.rank(board))));
    for event in &timeline.events {
        let bytes = board.to_frame(&event.command);
        // A raw frame may be that of a command.
        assert_eq!(board.to_frame(&board.decode_or_raw(&bytes).expect("a frame")), bytes);
        assert!(event.at <= timeline.end);
    }
}
