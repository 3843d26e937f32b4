//! Phrases that are not plain English, or that say less than the field's own word, in any text that a person reads: messages, help,
//! comments, names of tests, pages. Each has the words to write instead.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A phrase, and what to write instead.
const DENIED: &[(&str, &str)] = &[
    ("stands in", "is in, contains"),
    ("stand in", "are in, contain"),
    ("stands at", "is at"),
    ("stands before", "is before"),
    ("stands behind", "is after"),
    ("stands between", "is between"),
    ("stands there", "is there"),
    ("stands still", "is stopped"),
    ("stands first", "comes first"),
    ("behind the", "after the"),
    ("behind a", "after a"),
    ("behind it", "after it"),
    ("behind its", "after its"),
    ("what is none", "anything that is not"),
    ("that is none", "that is not"),
    ("so many", "N, this number of"),
    ("so much", "this much"),
    ("so often", "N times"),
    ("so long", "as long"),
    ("nobody", "nothing, no program, unknown"),
    ("somebody", "a person, the user"),
    ("whoever", "the code that, the program that"),
    ("blanks", "spaces"),
    ("a blank", "a space"),
    ("mend", "fix"),
    ("mends", "fixes"),
    ("mended", "fixed"),
    ("is told", "gets, is sent, is set to"),
    ("was told", "got, was sent, was set to"),
    ("are told", "get, are sent"),
    ("be told", "be sent, be set to"),
    ("told by", "reported by"),
    ("tells of", "reports"),
    ("take away", "remove"),
    ("takes away", "removes"),
    ("taken away", "removed"),
    ("goes on", "continues"),
    ("go on", "continue"),
    ("went on", "continued"),
    ("at its place", "there"),
    ("nothing is called", "unknown name"),
    ("half of them", "median"),
    ("as far as the system allows", "if permitted"),
    ("hangs on", "is connected to, depends on"),
    ("reckon", "compute"),
    ("in vain", "without effect"),
    ("lies ahead", "is in the future"),
];

/// Folders and files that people read.
const READ: &[&str] = &[
    "src",
    "tests",
    "benches",
    "examples",
    "grammar",
    "scripts",
    "docs",
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
];

/// Every text file below a path, but for generated ones and captures.
fn files(path: &Path, found: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in path.read_dir().unwrap() {
            files(&entry.unwrap().path(), found);
        }
        return;
    }
    let is_text = path.extension().and_then(|extension| extension.to_str()).is_some_and(|extension| {
        ["rs", "md", "motion", "pest", "py", "sh", "mjs", "json", "yml", "snap"].contains(&extension)
    });
    if is_text && !path.ends_with("tests/words.rs") {
        found.push(path.to_owned());
    }
}

/// A text in one line, as it is read: without the marks of comments, and with the offset at which each of its lines begins.
fn flowing(text: &str) -> (String, Vec<usize>) {
    let (mut flowing, mut begins) = (String::new(), Vec::new());
    for line in text.lines() {
        begins.push(flowing.len());
        let line = line.trim().trim_start_matches(['/', '!', '#', '*']).trim_end_matches('\\');
        flowing.push_str(line.trim());
        flowing.push(' ');
    }
    (flowing.to_lowercase(), begins)
}

/// Where a phrase is in a text, as whole words. A word in quotation marks is a quotation.
fn places<'t>(text: &'t str, phrase: &'t str) -> impl Iterator<Item = usize> + 't {
    let is_part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || "_`-\"".contains(c));
    text.match_indices(phrase).map(|(at, _)| at).filter(move |at| {
        let (before, after) = (&text[..*at], &text[at + phrase.len()..]);
        !is_part(before.chars().next_back()) && !is_part(after.chars().next())
    })
}

#[test]
fn texts_are_plain_english() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = Vec::new();
    for path in READ {
        files(&root.join(path), &mut paths);
    }
    paths.sort();
    assert!(paths.len() > 300);
    let mut found = String::new();
    for path in paths {
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        let (text, begins) = flowing(&text);
        for (phrase, instead) in DENIED {
            for at in places(&text, phrase) {
                let line = begins.partition_point(|begin| *begin <= at);
                let name = path.strip_prefix(root).unwrap().display();
                writeln!(found, "{name}:{line}: `{phrase}`: write `{instead}`").unwrap();
            }
        }
    }
    assert!(found.is_empty(), "{found}");
}

#[test]
fn a_phrase_is_found_across_lines_and_as_whole_words() {
    let (text, begins) = flowing("/// What stands\n/// in it, and who\nlet mending = \"a\";\n");
    assert_eq!(places(&text, "stands in").collect::<Vec<_>>(), [5]);
    assert_eq!(places(&text, "mend").count(), 0);
    assert_eq!(begins[1], 12);
}
