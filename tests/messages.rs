//! What a new user types, and what the message says: one file in `tests/messages` for each case. A line `#= TEXT` holds a text that
//! the messages of the script contain, as a terminal shows them.

use std::fmt::Write as _;
use std::path::Path;

use motionseq::diagnostic::{Code, Diagnostic, Edit};
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
        write!(said, "line {}: {}: {diagnostic}", place.line, diagnostic.code).unwrap();
        if let Some(label) = &diagnostic.label {
            write!(said, " [{label}]").unwrap();
        }
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

/// What is said about a script, as data.
fn diagnostics(sources: &Sources) -> Vec<Diagnostic> {
    motionseq::compile(sources, &Options::default()).diagnostics.iter().cloned().collect()
}

/// Scripts with mistakes: the example of each code, and the scripts of two folders.
fn scripts_with_mistakes() -> Vec<String> {
    let examples = Code::ALL.iter().map(|code| code.example().0.to_owned());
    let folders = ["tests/messages", "tests/frames"].map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
    let entries = folders.iter().flat_map(|folder| folder.read_dir().unwrap()).map(|entry| entry.unwrap().path());
    let scripts = entries.filter(|path| path.extension().is_some_and(|extension| extension == "motion"));
    examples.chain(scripts.filter_map(|path| std::fs::read_to_string(path).ok())).collect()
}

#[test]
fn each_fix_removes_its_error() {
    let mut remaining = String::new();
    let mut count = 0;
    for text in scripts_with_mistakes() {
        let sources = Sources::from(Source::new("case", text));
        for found in diagnostics(&sources) {
            let Some(fix) = &found.fix else { continue };
            count += 1;
            let fixed = fix.apply(sources.main()).unwrap();
            let is_same = |other: &Diagnostic| {
                (other.code, &other.message, other.span.start) == (found.code, &found.message, found.span.start)
            };
            if diagnostics(&Sources::from(Source::new("case", fixed.clone()))).iter().any(is_same) {
                writeln!(remaining, "{}: {}\n{fixed}", found.code, found.message).unwrap();
            }
        }
    }
    assert!(remaining.is_empty(), "{remaining}");
    assert!(count > 150, "{count}");
}

#[test]
fn fixes_come_to_an_end() {
    for text in scripts_with_mistakes() {
        let mut source = Source::new("case", text.clone());
        let is_fixed = (0..20).any(|_| {
            let found = diagnostics(&source.clone().into());
            let (fixed, count) = Edit::apply_all(found.iter().filter_map(|found| found.fix.as_ref()), &source);
            source = source.with_text(fixed);
            count == 0
        });
        assert!(is_fixed, "{text}\nbecomes\n{}", source.text());
    }
}

/// The characters of a text that are in comments.
fn commented(text: &str) -> usize {
    let of_line = |line: &str| {
        let mut in_string = false;
        let is_code = |c: &char| {
            in_string ^= *c == '"';
            *c != '#' || in_string
        };
        line.chars().skip_while(is_code).count()
    };
    text.lines().map(of_line).sum()
}

#[test]
fn a_fix_changes_nothing_else_and_hides_nothing_in_a_comment() {
    let mut count = 0;
    for text in scripts_with_mistakes() {
        let source = Source::new("case", text.clone());
        let found = diagnostics(&source.clone().into());
        for fix in found.iter().filter_map(|found| found.fix.as_ref()) {
            count += 1;
            let fixed = fix.apply(&source).unwrap();
            let (before, after) = (&text[..fix.span.range().start], &text[fix.span.range().end..]);
            assert_eq!(fixed, [before, &fix.text, after].concat());
            let (line, rest) = (before.lines().last().unwrap_or_default(), &text[before.len()..]);
            let starts = (before.is_empty() || before.ends_with('\n') || line.trim().is_empty())
                && ["//", "/*", "--"].iter().any(|sign| rest.starts_with(sign));
            assert!(starts || commented(&fixed) <= commented(&text), "{text}\nbecomes\n{fixed}");
        }
    }
    assert!(count > 150, "{count}");
}
