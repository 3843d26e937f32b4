//! The documents are true: every example runs, and every list is complete.

use std::fs;
use std::process::Command;

use crate::support::board::board;
use crate::support::{Scratch, code, with_motionseq};
use motionseq::diagnostic::{Code, Severity};
use motionseq::program::{CURVES, FUNCTIONS, Options};
use motionseq::program::{Row, SETTINGS, Signature, signatures};
use motionseq::source::Source;
use motionseq::units::UNITS;

/// The fenced blocks of a document: the text after the fence, the first line, and the content.
fn blocks(document: &str) -> Vec<(String, usize, String)> {
    let text = fs::read_to_string(document).unwrap();
    let mut found = Vec::new();
    let mut open: Option<(String, usize, String)> = None;
    for (number, line) in text.lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(kind), None) => open = Some((kind.to_owned(), number + 1, String::new())),
            (Some(_), Some(_)) => found.extend(open.take()),
            (None, Some((_, _, block))) => {
                block.push_str(line);
                block.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{document} has a block that never ends");
    found
}

/// The README and all pages in docs/, in the order of their names.
fn documents() -> Vec<String> {
    let mut found = vec!["README.md".to_owned()];
    for folder in ["docs", "docs/language"] {
        let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        found.extend(
            paths
                .filter(|path| path.extension().is_some_and(|end| end == "md"))
                .map(|path| path.to_str().unwrap().to_owned()),
        );
    }
    found.sort();
    assert!(found.len() > 20);
    found
}

/// A document without its fenced blocks.
fn prose(document: &str) -> String {
    let text = fs::read_to_string(document).unwrap();
    let mut is_block = false;
    let outside = text.lines().filter(|line| {
        let is_fence = line.starts_with("```");
        is_block ^= is_fence;
        !is_block && !is_fence
    });
    outside.flat_map(|line| [line, "\n"]).collect()
}

#[test]
fn every_script_in_the_documents_compiles_as_described() {
    let mut seen = 0;
    for document in &documents() {
        for (kind, line, text) in blocks(document) {
            let compiles = match kind.as_str() {
                "motion" => true,
                "motion-error" => false,
                _ => continue,
            };
            seen += 1;
            let source = Source::new(document, text);
            let result = motionseq::compile(&source.clone().into(), &Options::default());
            let messages = crate::support::messages(&source.clone().into(), &result.diagnostics);
            assert_eq!(!result.timelines.is_empty(), compiles, "{document}:{line}\n{messages}");
        }
    }
    assert!(seen > 30);
}

/// Output whose measured values (decimals between spaces, such as `0.018` in `0.018 ms late`) are replaced: they differ in each run.
fn without_measurements(text: &str) -> String {
    let is_measured = |word: &str| {
        let number = word.trim_end_matches(['°', ',', ';']);
        number.contains('.') && number.parse::<f64>().is_ok()
    };
    let line = |line: &str| {
        line.split(' ').map(|word| if is_measured(word) { "N" } else { word }).collect::<Vec<_>>().join(" ")
    };
    text.trim_end().lines().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn every_console_block_shows_what_happens() {
    let mut seen = 0;
    for document in &documents() {
        for (kind, line, text) in blocks(document) {
            if kind != "console" {
                continue;
            }
            seen += 1;
            let (command, shown) = text.strip_prefix("$ ").unwrap().split_once('\n').unwrap();
            let output = with_motionseq("sh", env!("CARGO_MANIFEST_DIR").as_ref())
                .args(["-c", &format!("{{ {command}; }} 2>&1")])
                .output()
                .unwrap();
            let printed = crate::support::stdout(&output);
            assert_eq!(without_measurements(shown), without_measurements(&printed), "{document}:{line}: `{command}`");
        }
    }
    assert!(seen >= 3);
}

#[test]
fn measurements_are_the_only_words_that_may_differ() {
    let shown = "sent 22 frames in 1.500 s; turned 49.9° clockwise\n0.050000\tFF FE\tstop\n";
    assert_eq!(without_measurements(shown), "sent 22 frames in N s; turned N clockwise\n0.050000\tFF FE\tstop");
}

/// Each program of the page, and the output below it.
#[test]
fn the_programs_in_python_print_what_the_page_shows() {
    if !crate::support::host::has("subprocess") {
        return;
    }
    let folder = Scratch::new("python");
    let page = "docs/python-use.md";
    let blocks = blocks(page);
    let mut seen = 0;
    for (at, (kind, line, program)) in blocks.iter().enumerate() {
        if kind != "python" {
            continue;
        }
        seen += 1;
        let Some((_, _, shown)) = blocks.get(at + 1).filter(|(kind, _, _)| kind == "text") else {
            panic!("{page}:{line} has no output below it")
        };
        let output = with_motionseq("python3", &folder.0).args(["-c", program]).output().unwrap();
        let (printed, errors) = (crate::support::stdout(&output), crate::support::stderr(&output));
        assert_eq!(without_measurements(shown), without_measurements(&printed), "{page}:{line}\n{errors}");
    }
    assert!(seen > 5);
}

#[test]
fn the_readme_has_the_two_first_commands() {
    let first = "cargo run --release -- play scripts/hello.motion\ncargo test\n";
    assert!(blocks("README.md").iter().any(|(kind, _, text)| kind == "sh" && text == first));
    // The gate runs the same test command.
    assert!(fs::read_to_string(".ci/run").unwrap().lines().any(|line| line == "cargo test"));
}

#[test]
fn the_readme_is_short() {
    let words = prose("README.md").split_whitespace().count();
    assert!(words <= 1_300, "README.md has {words} words outside of its blocks, and at most 1,300 are allowed");
}

#[test]
fn no_document_shows_a_pattern() {
    for document in documents() {
        assert!(!fs::read_to_string(&document).unwrap().contains("[..]"), "{document}");
    }
}

/// The text of a line of Markdown without its code spans.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect()
}

/// The anchors that GitHub gives the headings of a document.
fn anchors(document: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for heading in prose(document).lines().filter(|line| line.starts_with('#')) {
        let title = heading.trim_start_matches('#').trim();
        let kept = title.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        let anchor: String = kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect();
        let repeats = found.iter().filter(|other| **other == anchor).count();
        found.push(if repeats == 0 { anchor } else { format!("{anchor}-{repeats}") });
    }
    found
}

#[test]
fn the_book_has_every_page() {
    let summary = fs::read_to_string("dist/book/SUMMARY.md").unwrap();
    for document in documents() {
        assert!(summary.contains(&format!("]({document})")), "dist/book/SUMMARY.md lacks {document}");
    }
    for target in summary.split("](").skip(1) {
        let (path, _) = target.split_once(')').unwrap();
        assert!(std::path::Path::new(path).exists(), "dist/book/SUMMARY.md has {path}");
    }
}

#[test]
fn every_hook_of_pre_commit_runs() {
    let hooks = fs::read_to_string(".pre-commit-hooks.yaml").unwrap();
    let folder = Scratch::new("hooks");
    folder.file("dance.motion", b"servo 1   1500\n");
    let entries: Vec<&str> = hooks.lines().filter_map(|line| line.trim().strip_prefix("entry: ")).collect();
    assert_eq!(entries.len(), 3);
    let run = |entry: &str, file: &[&str]| {
        let mut words = entry.split(' ');
        let output = with_motionseq(words.next().unwrap(), &folder.0).args(words).args(file).output().unwrap();
        code(&output)
    };
    // The test has no snapshot yet.
    let codes: Vec<i32> =
        entries.iter().map(|entry| run(entry, if entry.ends_with("test") { &[] } else { &["dance.motion"] })).collect();
    assert_eq!(codes, [0, 0, 1]);
    assert_eq!(fs::read_to_string(folder.path("dance.motion")).unwrap(), "servo 1 1500\n");
}

#[test]
fn every_link_leads_somewhere() {
    let mut seen = 0;
    let others =
        ["ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "THIRD-PARTY.md"].map(str::to_owned);
    for document in documents().into_iter().chain(others) {
        let folder = std::path::Path::new(&document).parent().unwrap();
        // A link may start on one line and end on the next.
        let text: Vec<String> = prose(&document).lines().map(without_code).collect();
        for after in text.join(" ").split("](").skip(1) {
            let (target, _) = after.split_once(')').unwrap();
            if target.contains("://") {
                continue;
            }
            seen += 1;
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = if path.is_empty() { document.clone().into() } else { folder.join(path) };
            assert!(path.exists(), "{document} links to {target}, which is not there");
            let is_anchor = anchor.is_empty() || anchors(path.to_str().unwrap()).iter().any(|other| other == anchor);
            assert!(is_anchor, "{document} links to {target}, which has no such heading");
        }
    }
    assert!(seen > 80, "{seen}");
}

/// The long options in the help of a command.
fn options(command: &str) -> Vec<String> {
    let help = crate::support::stdout(&crate::support::run(&[command, "--help"]));
    let rows = help.lines().map(str::trim_start).filter(|line| line.starts_with('-'));
    let words = rows.flat_map(str::split_whitespace).filter_map(|word| word.strip_prefix("--"));
    let names = words.map(|word| word.chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect::<String>());
    names.filter(|name| !name.is_empty()).map(|name| format!("--{name}")).collect()
}

#[test]
fn every_command_and_every_option_is_on_the_page_of_the_command_line() {
    let page = fs::read_to_string("docs/cli.md").unwrap();
    let sections: Vec<(&str, &str)> = page.split("\n## ").filter_map(|section| section.split_once('\n')).collect();
    let section = |name: &str| sections.iter().find(|(title, _)| *title == name).map(|(_, text)| *text);
    let common = section("Options of several commands").unwrap();
    let help = crate::support::stdout(&crate::support::run(&["--help"]));
    let (_, commands) = help.split_once("Commands:\n").unwrap();
    let commands = commands.lines().take_while(|line| !line.is_empty());
    let commands: Vec<&str> = commands.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() > 10);
    for command in commands.into_iter().filter(|command| *command != "help") {
        let title = if matches!(command, "completions" | "man") { "completions and man" } else { command };
        let text = section(title).unwrap_or_else(|| panic!("docs/cli.md has no section `{title}`"));
        for option in options(command) {
            // `--help` shows options as `--port <PATH>`, and the page as `--port PATH`.
            let is_there = |text: &str| {
                text.match_indices(&option)
                    .any(|(at, _)| !text[at + option.len()..].starts_with(|c: char| c.is_ascii_lowercase() || c == '-'))
            };
            assert!(is_there(text) || is_there(common), "docs/cli.md does not have {option} of `{command}`");
        }
    }
}

fn rows<'t>(table: impl Iterator<Item = Signature<'t>>) -> String {
    let runs = table.filter(|row| !row.usage.is_empty());
    let escape = |text: &str| text.replace('|', "\\|");
    runs.map(|row| format!("| `{}` | {} | `{}` |\n", escape(row.usage), escape(row.meaning), escape(row.example)))
        .collect()
}

/// The tables of the reference: the page, the name, and the table as it is printed from that of the code.
fn tables() -> [(&'static str, &'static str, String); 5] {
    let commands = format!("| command | meaning | example |\n|---|---|---|\n{}", rows(signatures(board())));
    let settings =
        format!("| setting | meaning | example |\n|---|---|---|\n{}", rows(SETTINGS.iter().map(Row::signature)));
    let units = UNITS.iter().map(|unit| format!("| `{}` | {} |\n", unit.name, unit.meaning));
    let units = format!("| unit | meaning |\n|---|---|\n{}", units.collect::<String>());
    let curves = CURVES.iter().map(|curve| {
        let name = curve.name;
        format!("| `in-{name}` `out-{name}` `in-out-{name}` | {} |\n", curve.meaning)
    });
    let easings =
        format!("| easing | curve |\n|---|---|\n| `linear` | straight; the default |\n{}", curves.collect::<String>());
    let functions = FUNCTIONS.iter().map(|function| format!("| `{}` | {} |\n", function.usage, function.meaning));
    let functions = format!("| function | returns |\n|---|---|\n{}", functions.collect::<String>());
    [
        ("docs/language/commands.md", "commands", commands),
        ("docs/language/settings.md", "settings", settings),
        ("docs/language/values.md", "units", units),
        ("docs/language/moves.md", "easings", easings),
        ("docs/language/values.md", "functions", functions),
    ]
}

/// `UPDATE_DOCS=1 cargo test --test tests -- docs::` updates the tables.
#[test]
fn the_tables_of_the_reference_are_those_of_the_code() {
    let mut changed = Vec::new();
    for (path, name, table) in tables() {
        let text = fs::read_to_string(path).unwrap();
        let begin = format!("<!-- table: {name} -->\n");
        let from = text.find(&begin).unwrap_or_else(|| panic!("{path} has no table of {name}")) + begin.len();
        let to = from + text[from..].find("<!-- end -->").unwrap();
        let mut wanted = text.clone();
        wanted.replace_range(from..to, &format!("\n{table}\n"));
        if text != wanted {
            changed.push(name);
            if std::env::var_os("UPDATE_DOCS").is_some() {
                fs::write(path, &wanted).unwrap();
            }
        }
    }
    let none: Vec<&str> = Vec::new();
    assert_eq!(changed, none, "run `UPDATE_DOCS=1 cargo test --test tests -- docs::` and look at what changed");
}

/// `docs/codes.md` is printed from the table of codes.
#[test]
fn every_code_is_in_the_documents() {
    let rows = Code::ALL.iter().map(|code| {
        let kind = if code.severity() == Severity::Error { "error" } else { "warning" };
        let (wrong, right) = code.example();
        format!(
            "## {code}\n\n{kind}: {}\n\n{}\n\nWrong:\n\n```text\n{wrong}```\n\nRight:\n\n```text\n{right}```\n\n",
            code.title(),
            code.explanation()
        )
    });
    let wanted = format!(
        "# Errors and warnings\n\n`motionseq explain CODE` prints the same text. A code never changes its meaning. A comment `# allow: CODE` at the end of a line \
         suppresses that warning on that line. Errors cannot be allowed.\n\n{}",
        rows.collect::<String>()
    );
    let wanted = wanted.trim_end().to_owned() + "\n";
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write("docs/codes.md", &wanted).unwrap();
    }
    let text = fs::read_to_string("docs/codes.md").unwrap_or_default();
    assert_eq!(text, wanted, "run `UPDATE_DOCS=1 cargo test --test tests -- docs::` and look at what changed");
}

#[test]
fn the_example_of_every_word_works() {
    for row in signatures(board())
        .chain(SETTINGS.iter().map(Row::signature))
        .filter(|row| !row.usage.is_empty() && row.name != "use")
    {
        let mode = match row.name {
            "move" => "pid position speed=0,0 position=0,0,0 yaw=0,0,0\n",
            "soft" => "board sts\n",
            _ => "",
        };
        let example = row.example.replace('…', "servo 1 1500");
        let source = Source::new("example", format!("{mode}{example}\nwait 1s\n"));
        let compiled = motionseq::compile(&source.into(), &Options::default());
        assert!(
            !compiled.timelines.is_empty(),
            "the example of `{}` does not compile: {:?}",
            row.name,
            compiled.diagnostics
        );
    }
}

#[test]
fn every_script_is_in_the_tour() {
    let text = fs::read_to_string("docs/tour.md").unwrap();
    for entry in fs::read_dir("scripts").unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        if name.ends_with(".frames") {
            continue;
        }
        let name = if entry.path().is_dir() { format!("{name}/") } else { name };
        assert!(text.contains(&format!("| `{name}` |")), "docs/tour.md has no row for {name}");
    }
}

#[test]
fn the_files_for_ci_are_the_ones_in_the_folder_and_their_commands_run() {
    let shown = blocks("docs/ci.md");
    let scratch = Scratch::new("ci");
    fs::write(scratch.0.join("x.motion"), "servo 1 1500\n").unwrap();
    let shell = |command: &str| with_motionseq("sh", &scratch.0).args(["-c", command]).output().unwrap();
    assert!(shell("git init -q . && motionseq test --bless && git add .").status.success());
    let mut ran = 0;
    for name in ["github.yml", "gitlab.yml", "pre-commit"] {
        let text = fs::read_to_string(format!("docs/ci/{name}")).unwrap();
        assert!(shown.iter().any(|(_, _, block)| *block == text), "docs/ci.md does not show docs/ci/{name}");
        if name == "pre-commit" {
            assert!(shell(&text).status.success());
            continue;
        }
        for command in text.lines().filter_map(|line| {
            line.trim_start()
                .trim_start_matches("- ")
                .strip_prefix("run: ")
                .or(Some(line.trim_start().trim_start_matches("- ")))
        }) {
            if command.starts_with("motionseq ") {
                ran += 1;
                let output = shell(command);
                assert!(output.status.success(), "{command}: {}", crate::support::stderr(&output));
            }
        }
    }
    assert_eq!(ran, 5);
}

#[test]
fn every_guarantee_names_a_test_that_is_there() {
    let text = fs::read_to_string("docs/safety.md").unwrap();
    let (_, table) = text.split_once("| guarantee | how it is tested |\n|---|---|\n").unwrap();
    let rows: Vec<&str> = table.lines().take_while(|line| line.starts_with('|')).collect();
    assert!(rows.len() > 8);
    for row in rows.iter().filter(|row| !row.contains("see [below]") && !row.contains("all of the above")) {
        let tests: Vec<&str> = row.split('`').filter(|word| word.starts_with("tests/")).collect();
        assert!(!tests.is_empty(), "{row}");
        assert!(tests.iter().all(|test| fs::exists(test).unwrap()), "{row}");
    }
}

#[test]
fn the_first_script_is_the_one_in_the_folder() {
    let (_, _, shown) = blocks("README.md").into_iter().find(|(kind, _, _)| kind == "motion").unwrap();
    let lines = |text: &str| text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines(&shown), lines(&fs::read_to_string("scripts/hello.motion").unwrap()));
}

#[test]
fn the_pictures_are_current() {
    let page = "docs/pictures.md";
    let text = fs::read_to_string(page).unwrap();
    let commands: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("motionseq plot ")).collect();
    let pictures: Vec<(&str, &str)> = commands.iter().filter_map(|command| command.split_once(" -o ")).collect();
    assert_eq!(pictures.len(), 3);
    for (script, picture) in pictures {
        let drawn = crate::support::run(&["plot", script, "--format", "svg"]);
        if std::env::var_os("UPDATE_DOCS").is_some() {
            fs::write(picture, &drawn.stdout).unwrap();
        }
        let is_current = fs::read(picture).is_ok_and(|picture| picture == drawn.stdout);
        assert!(
            is_current,
            "{picture} is not what `plot` draws; `UPDATE_DOCS=1 cargo test --test tests -- docs::` draws it again"
        );
        let shown = picture.strip_prefix("docs/").unwrap();
        assert!(text.contains(&format!("]({shown})")), "{page} does not show {picture}");
    }
}

#[test]
fn every_crate_and_its_licence_is_listed() {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "-e",
            "normal",
            "--prefix",
            "none",
            "--format",
            "{p}|{l}",
            "--target",
            "x86_64-unknown-linux-gnu",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let mut used: Vec<String> = crate::support::stdout(&output)
        .lines()
        .filter(|line| !line.starts_with("motionseq "))
        .map(|line| {
            let (name, licence) = line.trim_end_matches(" (*)").split_once('|').unwrap();
            format!("| {} | {licence} |", name.split(' ').next().unwrap())
        })
        .collect();
    used.sort();
    used.dedup();
    assert!(used.len() > 20, "{}", crate::support::stderr(&output));
    let text = fs::read_to_string("THIRD-PARTY.md").unwrap();
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let head = text.split_inclusive("|---|---|\n").next().unwrap();
        fs::write("THIRD-PARTY.md", format!("{head}{}\n", used.join("\n"))).unwrap();
    }
    let is_row = |line: &&str| line.starts_with("| ") && !line.starts_with("| crate ");
    let listed: Vec<String> = text.lines().filter(is_row).map(str::to_owned).collect();
    assert_eq!(
        listed, used,
        "THIRD-PARTY.md is not what `cargo tree` says; `UPDATE_DOCS=1 cargo test --test tests -- docs::` updates it"
    );
}

/// What the board does when frames stop arriving is unknown. Every page that mentions it has the same sentence, and the program has the
/// same first half.
#[test]
fn every_document_uses_one_sentence_for_silence() {
    let plain = |path: &str| fs::read_to_string(path).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    let unknown = "hat the board does when frames stop arriving is unknown; ";
    let how = "to find out, play `scripts/silence.motion` as described in [Test your board](";
    assert!(fs::exists("scripts/silence.motion").unwrap());
    for path in
        ["README.md", "docs/cli.md", "docs/language/holds.md", "docs/python-use.md", "docs/python.md", "docs/safety.md"]
    {
        assert!(plain(path).contains(&format!("W{unknown}{how}")), "{path} does not say it");
    }
    for path in documents() {
        let text = plain(&path);
        for (at, _) in text.match_indices(unknown) {
            let rest = &text[at + unknown.len()..];
            let is_code = path == "docs/codes.md" && rest.starts_with("docs/safety.md has a test for it");
            assert!(is_code || rest.starts_with(how), "{path} says it in other words");
        }
    }
    assert_eq!(motionseq::board::ON_SILENCE, format!("w{unknown}docs/safety.md has a test for it"));
    let mut texts = documents();
    for folder in ["src/program", "src/capture", "src/diagnostic", "src/lints", "scripts"] {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten().filter(|entry| entry.path().is_file()) {
            texts.push(entry.path().to_str().unwrap().to_owned());
        }
    }
    for path in texts {
        let text = plain(&path);
        for claim in
            ["board stops by itself", "board may stop by itself", "stops by itself where", "real robot drives on"]
        {
            // The test in safety.md describes each possible outcome.
            let is_outcome = path == "docs/safety.md" && claim == "board stops by itself";
            assert!(is_outcome || !text.contains(claim), "{path} says `{claim}`");
        }
    }
}
