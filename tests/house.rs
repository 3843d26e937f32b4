//! The structure of the source: each module imports only what it may, and nothing leaves its
//! module.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Every module and the modules that it may import, in the order of the data flow. ARCHITECTURE.md
/// gives the reasons.
const ROOMS: &[(&str, &[&str])] = &[
    ("units", &[]),
    ("source", &[]),
    ("diagnostic", &["source"]),
    ("syntax", &["units", "source", "diagnostic"]),
    ("board", &["units", "source", "diagnostic"]),
    ("clock", &["units"]),
    ("random", &[]),
    ("program", &["units", "source", "diagnostic", "syntax", "board", "random"]),
    ("timeline", &["units", "source", "diagnostic", "program", "board"]),
    ("diff", &["units", "program", "board", "timeline"]),
    ("link", &["units", "clock"]),
    ("playback", &["units", "source", "program", "timeline", "link", "board", "clock"]),
    ("sim", &["units", "board"]),
    ("faults", &["units", "board", "random", "link", "sim"]),
    ("serve", &["units", "board", "clock", "link", "playback", "sim", "faults"]),
    ("capture", &["units", "board", "program", "timeline"]),
    ("plot", &["units", "source", "diagnostic", "program", "timeline", "board", "sim"]),
    // `compile` is in the root of the library.
    (
        "verify",
        &[
            "units",
            "source",
            "diagnostic",
            "program",
            "timeline",
            "diff",
            "board",
            "playback",
            "sim",
            "faults",
            "compile",
        ],
    ),
    ("report", &["units", "source", "diagnostic", "diff", "verify"]),
];

/// Words that are allowed in only one place, and that place.
const AT_HOME: &[(&str, &str)] = &[
    ("pest", "src/syntax"),
    ("serialport::", "src/link/serial.rs"),
    ("mcap::", "src/cli/log/log_builder.rs"),
    ("resvg::", "src/plot/png.rs"),
    ("svg::node", "src/plot/canvas.rs src/plot/svg.rs"),
    ("miette::", "src/diagnostic/show.rs"),
    ("humantime::", "src/units.rs"),
    ("rtrb::", ""),
    ("signal_hook", "src/playback/os.rs"),
    ("unsafe ", "src/playback/os.rs src/link/serial.rs"),
    ("quick_xml::", "src/report/junit.rs"),
    (
        "std::fs",
        "src/source/files.rs src/verify/play.rs src/playback/go_lines.rs src/playback/guard.rs src/playback/os.rs src/link src/serve",
    ),
    ("std::thread", "src/syntax/read_ahead.rs src/serve"),
    ("libc::", "src/playback/os.rs src/link/serial.rs"),
    ("clock_gettime", "src/clock.rs"),
    ("toml::", "src/board/text"),
    ("strsim::", "src/program/suggest.rs"),
    ("rustix::", "src/clock.rs src/playback/os.rs src/playback/guard.rs src/link"),
    ("Instant::now", ""),
    ("thread::sleep", ""),
    ("println!", "src/syntax/foreign.rs"),
    ("print!", "src/syntax/foreign.rs"),
];

/// The Rust files of a folder and its subfolders.
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

/// The module of a file of the library; `None` for lib.rs and the binary.
fn room(path: &Path) -> Option<String> {
    let inside = path.strip_prefix("src").unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_str().unwrap();
    let name = first.strip_suffix(".rs").unwrap_or(first).to_owned();
    (!["lib", "main", "cli"].contains(&name.as_str())).then_some(name)
}

/// The code of a file without comments.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

/// Every module that a file imports as `crate::MODULE`, also inside `use crate::{…}`.
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
fn modules_import_only_what_they_may() {
    let mut used: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in files(Path::new("src")) {
        let Some(room) = room(&path) else { continue };
        let Some((_, may)) = ROOMS.iter().find(|(name, _)| *name == room) else {
            panic!("{} is in no room of the table", path.display());
        };
        let used = used.entry(room.clone()).or_default();
        for import in imports(&code(&path)) {
            assert!(
                import == room || may.contains(&import.as_str()),
                "{}: {room} must not import {import}",
                path.display()
            );
            used.insert(import);
        }
    }
    for (room, may) in ROOMS {
        let used = used.get(*room).unwrap_or_else(|| panic!("the room {room} is empty"));
        for import in *may {
            assert!(used.contains(*import), "{room} may import {import} but does not: remove that from the table");
        }
    }
}

/// The modules of the library and of the binary: the path of each, and its code without tests.
struct Modules(BTreeMap<Vec<String>, String>);

impl Modules {
    fn read() -> Self {
        Modules(files(Path::new("src")).iter().map(|path| (module(path), of_modules(&code(path)))).collect())
    }

    /// The re-exports of a module: each name, and its original path.
    fn exports(&self, module: &[String]) -> BTreeMap<String, Vec<String>> {
        let code = self.0.get(module).map_or("", String::as_str);
        let paths = uses(code).filter(|(is_export, ..)| *is_export).flat_map(|(_, _, paths)| paths);
        // A path of one part is the module's own.
        paths.filter(|path| path.len() > 1).filter_map(|path| Some((path.last()?.clone(), path))).collect()
    }

    /// The module that a path refers to from another one. Re-exports are followed.
    fn target(&self, from: &[String], path: &[String]) -> Vec<String> {
        let mut at = if path.first().is_some_and(|first| first == "crate") { Vec::new() } else { from.to_vec() };
        let mut rest = path.iter().skip_while(|part| ["crate", "self"].contains(&part.as_str())).peekable();
        while rest.next_if(|part| *part == "super").is_some() {
            at.pop();
        }
        while let Some(part) = rest.next_if(|part| self.0.contains_key(&[&at[..], &[(*part).clone()]].concat())) {
            at.push(part.clone());
        }
        match rest.next().and_then(|name| self.exports(&at).remove(name)) {
            Some(original) if self.target(&at, &original) != at => self.target(&at, &original),
            _ => at,
        }
    }

    /// The modules of the same top-level module that a module imports. Its submodules do not count.
    fn imports(&self, module: &[String]) -> BTreeSet<Vec<String>> {
        let code = &self.0[module];
        let own: Vec<(usize, usize)> =
            uses(code).filter(|(is_export, ..)| *is_export).map(|(_, (from, to), _)| (from, to)).collect();
        let mut found = BTreeSet::new();
        for start in ["super::", "crate::"].iter().flat_map(|word| code.match_indices(word)).map(|(at, _)| at) {
            let before = code[..start].chars().next_back();
            let is_inside = before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':');
            if is_inside || own.iter().any(|(from, to)| (*from..*to).contains(&start)) {
                continue;
            }
            found.extend(paths(code, start).0.iter().map(|path| self.target(module, path)));
        }
        found.retain(|target| target.first() == module.first() && !target.starts_with(module));
        found
    }
}

/// The path of a file's module: `["program", "unroll"]` for `src/program/unroll/mod.rs`.
fn module(path: &Path) -> Vec<String> {
    let inside = path.strip_prefix("src").unwrap().with_extension("");
    let parts = inside.components().map(|part| part.as_os_str().to_str().unwrap().to_owned());
    parts.filter(|part| !["mod", "lib", "main"].contains(&part.as_str())).collect()
}

/// Code without tests and string literals.
fn of_modules(code: &str) -> String {
    let code = code.split("#[cfg(test)]\nmod ").next().unwrap().replace("\\\"", "");
    code.split('"').step_by(2).collect::<Vec<_>>().join("\"\"")
}

/// Every `use`, whether it is public, its position, and the paths that it names.
fn uses(code: &str) -> impl Iterator<Item = (bool, (usize, usize), Vec<Vec<String>>)> {
    code.match_indices("use ").filter_map(|(at, word)| {
        let line = code[..at].rsplit('\n').next().unwrap();
        let is_export = line.trim_start().starts_with("pub");
        (is_export || line.trim().is_empty()).then(|| {
            let (paths, end) = paths(code, at + word.len());
            (is_export, (at, end), paths)
        })
    })
}

/// The paths that start at a position (`a::{b, c::d}` are two), and their end.
fn paths(code: &str, mut at: usize) -> (Vec<Vec<String>>, usize) {
    let space = |at: usize| at + code[at..].len() - code[at..].trim_start().len();
    let mut path = Vec::new();
    loop {
        at = space(at);
        if code[at..].starts_with('{') {
            let mut found = Vec::new();
            at = space(at + 1);
            while !code[at..].starts_with('}') {
                let (inner, end) = paths(code, at);
                found.extend(inner.into_iter().map(|rest| [&path[..], &rest[..]].concat()));
                // The name after `as` is an alias.
                at = space(end + code[end..].find([',', '}']).unwrap());
                at = space(at + usize::from(code[at..].starts_with(',')));
            }
            return (found, at + 1);
        }
        let name: String = code[at..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        at += name.len();
        path.push(name);
        match code[at..].strip_prefix("::") {
            Some(_) => at += 2,
            None => return (vec![path], at),
        }
    }
}

/// The cycles of a graph, each with all its nodes.
fn circles(graph: &BTreeMap<Vec<String>, BTreeSet<Vec<String>>>) -> BTreeSet<Vec<String>> {
    let reach = |from: &Vec<String>| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
        while let Some(at) = next.pop() {
            next.extend(graph.get(at).into_iter().flatten().filter(|target| seen.insert((*target).clone())));
        }
        seen
    };
    let reached: BTreeMap<_, _> = graph.keys().map(|from| (from, reach(from))).collect();
    let circle = |from: &Vec<String>| {
        let all = reached[from].iter().filter(|other| reached.get(other).is_some_and(|back| back.contains(from)));
        all.map(|path| path.join("::")).collect::<Vec<_>>()
    };
    graph.keys().map(circle).filter(|circle| !circle.is_empty()).collect()
}

#[test]
fn files_of_a_module_have_no_import_cycle() {
    let modules = Modules::read();
    let graph = modules.0.keys().map(|module| (module.clone(), modules.imports(module))).collect();
    assert_eq!(circles(&graph), BTreeSet::new());
}

#[test]
fn the_binary_uses_the_library_as_anybody_would() {
    for path in files(Path::new("src/cli")) {
        let imports = imports(&code(&path));
        assert!(imports.is_empty(), "{} reaches into the crate: {imports:?}", path.display());
    }
}

#[test]
fn the_binary_decodes_a_stream_of_frames_once() {
    let decodes = |path: &PathBuf| ["TimedDecoder::", " Decoder::"].iter().any(|word| code(path).contains(word));
    let found: Vec<PathBuf> = files(Path::new("src/cli")).into_iter().filter(decodes).collect();
    // What a program sends is decoded in the watcher; what `play` has sent, in its log.
    assert_eq!(found, ["src/cli/log/log_builder.rs", "src/cli/watcher.rs"].map(PathBuf::from));
}

#[test]
fn the_language_half_needs_little() {
    let output = std::process::Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--no-default-features",
            "-e",
            "normal,build",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let text = crate::support::stdout(&output);
    let crates: BTreeSet<&str> = text.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!((10..=50).contains(&crates.len()), "{}: {crates:?}", crates.len());
    for unwanted in ["serialport", "rustix", "quick-junit", "rayon", "ignore", "clap", "signal-hook"] {
        assert!(!crates.contains(unwanted), "{unwanted}");
    }
}

#[test]
fn restricted_words_stay_in_their_files() {
    for path in files(Path::new("src")).into_iter().filter(|path| room(path).is_some()) {
        let code = code(&path);
        for (word, home) in AT_HOME {
            let at_home = home.split(' ').any(|home| !home.is_empty() && path.starts_with(home));
            assert!(at_home || !code.contains(word), "{}: `{word}` belongs to {home:?}", path.display());
        }
    }
}

/// Words and numbers of the Raspblock's protocol: only its table, its device and the examples of
/// codes may contain them. Its `servos` is an ordinary word, too.
const OF_THE_RASPBLOCK: &[&str] =
    &["rocker", "wheels", "yawhold", "yaw_hold", "buzzer", "pid", "0xfe", "1950", "115200"];
const AT_HOME_THERE: &[&str] =
    &["src/board/raspblock", "src/board/maestro", "src/board/sts", "src/diagnostic/codes.rs"];
/// Places where a word means something else: a process ID.
const MEANS_ANOTHER: &[(&str, &str)] = &[("pid", "src/playback/os.rs")];

/// The words in code, without those in comments and in prose, which is any string with a space in
/// it. `OneWord` counts as two.
fn words_of_code(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut add = |line: usize, code: &str| {
        let mut word = String::new();
        for letter in code.chars().chain([' ']) {
            let is_next = letter.is_uppercase() && word.ends_with(char::is_lowercase) && !word.starts_with('0');
            if (!letter.is_alphanumeric() || is_next) && !word.is_empty() {
                found.push((line, std::mem::take(&mut word).to_lowercase()));
            }
            if letter.is_alphanumeric() {
                word.push(letter);
            }
        }
    };
    let (mut line, mut rest) = (1, text);
    while let Some(at) = rest.find(['"', '/', '\'', '\n']) {
        let (code, from) = rest.split_at(at);
        add(line, code);
        let inner = &from[1..];
        let end = match &from[..1] {
            "\n" => {
                line += 1;
                0
            }
            "/" if inner.starts_with('/') => inner.find('\n').unwrap_or(inner.len()),
            "\"" => {
                let is_end = |(at, _): &(usize, &str)| {
                    inner[..*at].bytes().rev().take_while(|byte| *byte == b'\\').count() % 2 == 0
                };
                let end = inner.match_indices('"').find(is_end).map_or(inner.len(), |(at, _)| at);
                let string = &inner[..end];
                if !string.contains(' ') {
                    add(line, string);
                }
                line += string.matches('\n').count();
                (end + 1).min(inner.len())
            }
            // A character literal, not a lifetime.
            "'" if inner.starts_with('\\') => inner[2..].find('\'').map_or(0, |end| end + 3),
            "'" if inner.chars().nth(1) == Some('\'') => inner.chars().next().map_or(0, char::len_utf8) + 1,
            _ => 0,
        };
        rest = &inner[end..];
    }
    add(line, rest);
    found
}

#[test]
fn words_of_a_family_stay_in_its_folder() {
    for path in
        files(Path::new("src")).into_iter().filter(|path| !AT_HOME_THERE.iter().any(|home| path.starts_with(home)))
    {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap();
        let words = words_of_code(code);
        for (line, word) in &words {
            let word = word.trim_end_matches("i32").trim_end_matches("u32");
            let is_another = MEANS_ANOTHER.contains(&(word, path.to_str().unwrap()));
            let is_known = OF_THE_RASPBLOCK.contains(&word) && !is_another;
            assert!(!is_known, "{}:{line}: `{word}` is of the Raspblock", path.display());
        }
        // Also `115_200` and `yaw_hold`.
        for pair in words.windows(2) {
            let [first, second] = [&pair[0].1, &pair[1].1];
            let joined = [format!("{first}{second}"), format!("{first}_{second}")];
            let found = joined.iter().find(|word| OF_THE_RASPBLOCK.contains(&word.as_str()));
            assert_eq!(found, None, "{}:{}", path.display(), pair[0].0);
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
    let code = "let a = Command::YawHold; // rocker\nf(\"buzzer\", \"the buzzer\", '\"', \"a\\\"pid\", 0xFE, 115_200)";
    let words: Vec<String> = words_of_code(code).into_iter().map(|(_, word)| word).collect();
    assert_eq!(words, ["let", "a", "command", "yaw", "hold", "f", "buzzer", "a", "pid", "0xfe", "115", "200"]);
    assert_eq!(room(Path::new("src/syntax/build.rs")).as_deref(), Some("syntax"));
    assert_eq!(room(Path::new("src/cli/play.rs")), None);
    let path = |path: &str| path.split("::").map(String::from).collect::<Vec<_>>();
    let modules = [
        ("room", "mod one;\nmod two;\npub use one::{First, Other as Third};"),
        ("room::one", "use super::two::Second;"),
        ("room::two", "use std::fs;\nuse crate::{other::X, room::First};"),
        ("room::three", "fn x() { super::First::new(); }"),
        ("other", ""),
    ];
    let modules = Modules(modules.map(|(name, code)| (path(name), code.to_owned())).into());
    assert_eq!(modules.imports(&path("room::two")), [path("room::one")].into());
    assert_eq!(modules.imports(&path("room")), [].into());
    let graph = modules.0.keys().map(|module| (module.clone(), modules.imports(module))).collect();
    assert_eq!(circles(&graph), [vec!["room::one".to_owned(), "room::two".to_owned()]].into());
}
