//! Any text gets a tree or an error, and every place that is named is a place in the text.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::diagnostic::Diagnostics;
use motionseq::source::Source;
use motionseq::syntax::parse;

fuzz_target!(|text: &str| {
    let source = Source::new("x.motion", text);
    let mut diagnostics = Diagnostics::default();
    let tree = parse(&source, &mut diagnostics);
    assert!(tree.is_some() || diagnostics.has_errors());
    for diagnostic in &diagnostics {
        assert!(diagnostic.span.start <= diagnostic.span.end && diagnostic.span.end as usize <= text.len() + 1);
        assert!(!diagnostic.message.is_empty() && !diagnostic.help.is_empty());
    }
});
