//! The house holds: each room imports only what it may, and nothing leaves the room it belongs to.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Every room and the rooms that it may import, in the order of the flow. ARCHITECTURE.md says why.
const ROOMS: &[(&str, &[&str])] = &[
    ("source", &[]),
    ("diagnostic", &["source"]),
    ("syntax", &["source", "diagnostic"]),
    ("board", &[]),
    ("clock", &[]),
    ("random", &[]),
    ("program", &["source", "diagnostic", "syntax", "board", "random"]),
    ("timeline", &["source", "diagnostic", "program", "board"]),
    ("link", &["board", "clock"]),
    ("playback", &["source", "timeline", "link", "board", "clock"]),
    ("sim", &["board", "link", "clock", "random"]),
    ("capture", &["board", "program", "timeline"]),
    ("plot", &["source", "diagnostic", "program", "timeline", "board", "sim"]),
    // `compile` stands in the library's root.
    ("verify", &["source", "diagnostic", "program", "timeline", "board", "playback", "sim", "compile"]),
    ("report", &["source", "diagnostic", "verify"]),
];

/// Words that stay in one place, and that place.
const AT_HOME: &[(&str, &str)] = &[
    ("pest", "src/syntax"),
    ("serialport::", "src/link/serial.rs"),
    ("mcap::", "src/cli/log/book.rs"),
    ("resvg::", "src/plot/png.rs"),
    ("svg::node", "src/plot/sheet.rs src/plot/svg.rs"),
    ("miette::", "src/diagnostic/show.rs"),
    ("humantime::", "src/program/value.rs src/sim/faults.rs"),
    ("rtrb::", "src/link/recorder.rs"),
    ("signal_hook", "src/playback/os.rs"),
    ("unsafe ", "src/playback/os.rs"),
    ("libc::", "src/playback/os.rs"),
    ("clock_gettime", "src/clock.rs"),
    ("strsim::", "src/program/suggest.rs"),
    ("rustix::", "src/clock.rs src/playback/os.rs src/playback/guard.rs src/link src/source.rs"),
    ("Instant::now", ""),
    ("thread::sleep", ""),
    ("println!", ""),
    ("print!", ""),
];

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The room of a file of the library; `None` for lib.rs and for the binary.
fn room(path: &Path) -> Option<String> {
    let inside = path.strip_prefix("src").unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_str().unwrap();
    let name = first.strip_suffix(".rs").unwrap_or(first).to_owned();
    (!["lib", "main", "cli"].contains(&name.as_str())).then_some(name)
}

/// The code of a file, without comments.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

/// Every room that a file names as `crate::ROOM`, also inside `use crate::{…}`.
fn imports(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let names = match rest.strip_prefix('{') {
            Some(group) => group.split('}').next().unwrap().split(',').map(str::trim).collect(),
            None => vec![rest],
        };
        for name in names {
            found.insert(name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect());
        }
    }
    found
}

#[test]
fn rooms_import_only_what_they_may() {
    let mut seen = BTreeSet::new();
    for path in files(Path::new("src")) {
        let Some(room) = room(&path) else { continue };
        let Some((_, may)) = ROOMS.iter().find(|(name, _)| *name == room) else {
            panic!("{} is in no room of the table", path.display());
        };
        for import in imports(&code(&path)) {
            assert!(
                import == room || may.contains(&import.as_str()),
                "{}: {room} must not import {import}",
                path.display()
            );
        }
        seen.insert(room);
    }
    assert_eq!(seen.len(), ROOMS.len(), "a room of the table is empty");
}

#[test]
fn the_binary_uses_the_library_as_anybody_would() {
    for path in files(Path::new("src/cli")) {
        let imports = imports(&code(&path));
        assert!(imports.is_empty(), "{} reaches into the crate: {imports:?}", path.display());
    }
}

#[test]
fn words_stay_at_home() {
    for path in files(Path::new("src")).into_iter().filter(|path| room(path).is_some()) {
        let code = code(&path);
        for (word, home) in AT_HOME {
            let at_home = home.split(' ').any(|home| !home.is_empty() && path.starts_with(home));
            assert!(at_home || !code.contains(word), "{}: `{word}` belongs to {home:?}", path.display());
        }
    }
}

#[test]
fn files_stay_readable() {
    for path in files(Path::new("src")) {
        let lines = fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 550, "{} has {lines} lines", path.display());
    }
}

#[test]
fn every_test_in_this_file_sees_what_it_looks_for() {
    assert_eq!(
        imports("use crate::{board, link::Pty};\nlet x = crate::source::Span;"),
        ["board", "link", "source"].map(String::from).into()
    );
    assert_eq!(room(Path::new("src/syntax/build.rs")).as_deref(), Some("syntax"));
    assert_eq!(room(Path::new("src/cli/play.rs")), None);
}
