//! Formatting changes nothing that is sent, and a formatted script is left as it is.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::diagnostic::Diagnostics;
use motionseq::program::Options;
use motionseq::source::{Source, Sources};
use motionseq::syntax::format;

/// What a script is to anybody but its author.
fn meaning(text: &str) -> String {
    let sources = Sources::from(Source::new("x.motion", text));
    let compiled = motionseq::compile(&sources, &Options::default().with_events(1_000));
    match compiled.timelines.first() {
        Some(timeline) => {
            let frames: Vec<_> = timeline.events.iter().map(|event| (event.at, &event.command, event.kind)).collect();
            format!("{frames:?} {:?}", timeline.cues.iter().map(|cue| (cue.at, &cue.text)).collect::<Vec<_>>())
        }
        None => {
            let errors = compiled.diagnostics.iter().filter(|error| error.is_error());
            errors.map(|error| error.code.name()).collect::<Vec<_>>().join(" ")
        }
    }
}

fuzz_target!(|text: &str| {
    // Millions of passes are tested elsewhere; here they only take time.
    if text.split(|c: char| !c.is_ascii_digit()).any(|digits| digits.len() > 4) {
        return;
    }
    let formatted = |text: &str| format(&Source::new("x.motion", text), &mut Diagnostics::default());
    let Some(once) = formatted(text) else { return };
    let twice = formatted(&once).unwrap_or_else(|| panic!("cannot be read any more:\n{once}"));
    assert_eq!(twice, once, "formatted twice");
    assert_eq!(meaning(&once), meaning(text), "formatted:\n{once}");
});
