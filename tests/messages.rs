//! What a new user types, and what the message says: one file in `tests/messages` for each case. A line `#= TEXT` holds a text that
//! the messages of the script contain, as a terminal shows them.

use std::fmt::Write as _;
use std::path::Path;

use motionseq::program::Options;
use motionseq::source::{Lines, Source, Sources};

/// Everything that is said about a script: place, code, message, labels and help.
fn said(text: &str) -> String {
    let sources = Sources::from(Source::new("case", text));
    let compiled = motionseq::compile(&sources, &Options::default());
    let lines = Lines::of(&sources);
    let mut said = String::new();
    for diagnostic in &compiled.diagnostics {
        let place = lines.place(diagnostic.span);
        write!(said, "line {}: {}: {}", place.line, diagnostic.code, diagnostic.message).unwrap();
        for related in &diagnostic.related {
            write!(said, " [line {}: {}]", lines.place(related.span).line, related.label).unwrap();
        }
        writeln!(said, "; {}", diagnostic.help).unwrap();
    }
    said
}

#[test]
fn a_message_shows_what_to_write() {
    let mut wrong = String::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/messages");
    let mut paths: Vec<_> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() > 40);
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        let said = said(&text);
        let wanted: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("#= ")).collect();
        assert!(!wanted.is_empty(), "{} has no `#= TEXT`", path.display());
        for want in wanted.iter().filter(|want| !said.contains(**want)) {
            writeln!(wrong, "{}: no `{want}` in\n{said}", path.file_name().unwrap().display()).unwrap();
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
