//! The documents are true: every example runs, and every list is complete.

use std::fs;
use std::process::Command;

use crate::support::board::board;
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

const DOCUMENTS: &[&str] = &["README.md", "docs/language.md", "docs/safety.md", "docs/ci.md", "docs/rehearsal.md"];

#[test]
fn every_script_in_the_documents_compiles_as_described() {
    let mut seen = 0;
    for document in DOCUMENTS {
        for (kind, line, text) in blocks(document) {
            let compiles = match kind.as_str() {
                "motion" => true,
                "motion-error" => false,
                _ => continue,
            };
            seen += 1;
            let source = Source::new(*document, text);
            let result = motionseq::compile(&source.clone().into(), &Options::default());
            let messages = crate::support::messages(&source.clone().into(), &result.diagnostics);
            assert_eq!(result.timeline.is_some(), compiles, "{document}:{line}\n{messages}");
        }
    }
    assert!(seen > 5);
}

/// Whether a line of output matches one of the document; `[..]` matches any text.
fn fits(shown: &str, line: &str) -> bool {
    let mut rest = line;
    let mut parts = shown.split("[..]");
    let Some(tail) = rest.strip_prefix(parts.next().unwrap()) else { return false };
    rest = tail;
    let parts: Vec<&str> = parts.collect();
    for (at, part) in parts.iter().enumerate() {
        let found =
            if at + 1 == parts.len() { rest.ends_with(part).then(|| rest.len() - part.len()) } else { rest.find(part) };
        let Some(found) = found else { return false };
        rest = rest.get(found + part.len()..).unwrap();
    }
    rest.is_empty()
}

#[test]
fn every_console_block_shows_what_happens() {
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_motionseq")).parent().unwrap().to_str().unwrap();
    let path = format!("{program}:{}", std::env::var("PATH").unwrap());
    let mut seen = 0;
    for document in DOCUMENTS {
        for (kind, line, text) in blocks(document) {
            if kind != "console" {
                continue;
            }
            seen += 1;
            let (command, shown) = text.strip_prefix("$ ").unwrap().split_once('\n').unwrap();
            let output = Command::new("sh")
                .args(["-c", &format!("{{ {command}; }} 2>&1")])
                .env("PATH", &path)
                .env_remove("MOTIONSEQ_PORT")
                .current_dir(env!("CARGO_MANIFEST_DIR"))
                .output()
                .unwrap();
            let printed = crate::support::stdout(&output);
            let shown: Vec<&str> = shown.trim_end().lines().collect();
            let printed: Vec<&str> = printed.trim_end().lines().collect();
            let same =
                shown.len() == printed.len() && shown.iter().zip(&printed).all(|(shown, line)| fits(shown, line));
            assert!(
                same,
                "{document}:{line} shows\n{}\nbut `{command}` prints\n{}",
                shown.join("\n"),
                printed.join("\n")
            );
        }
    }
    assert_eq!(seen, 3);
}

#[test]
fn patterns_fit_only_what_they_should() {
    assert!(
        fits("a [..] c", "a b c")
            && fits("[..]", "")
            && fits("plain", "plain")
            && fits("1.[..] s; [..] late", "1.5 s; 0 late")
    );
    assert!(!fits("a [..] c", "a b d") && !fits("plain", "plainer") && !fits("[..]x", "y"));
}

#[test]
fn the_readme_begins_with_two_commands_that_work() {
    let (_, _, text) = blocks("README.md").into_iter().find(|(kind, _, _)| kind == "sh").unwrap();
    assert_eq!(text, "cargo run --release -- play scripts/hello.motion\ncargo test\n");
    // The gate runs the same test command.
    assert!(fs::read_to_string(".ci/run").unwrap().lines().any(|line| line == "cargo test"));
}

fn rows<'t>(table: impl Iterator<Item = Signature<'t>>) -> String {
    let runs = table.filter(|row| !row.usage.is_empty());
    let escape = |text: &str| text.replace('|', "\\|");
    runs.map(|row| format!("| `{}` | {} | `{}` |\n", escape(row.usage), escape(row.meaning), escape(row.example)))
        .collect()
}

/// The tables of the reference, printed from those of the code.
fn tables() -> [(&'static str, String); 5] {
    let commands = format!("| command | what it does | for example |\n|---|---|---|\n{}", rows(signatures(board())));
    let settings = format!(
        "| setting | what it does | for example |\n|---|---|---|\n{}",
        rows(SETTINGS.iter().map(Row::signature))
    );
    let units = UNITS.iter().map(|unit| format!("| `{}` | {} |\n", unit.name, unit.meaning));
    let units = format!("| unit | means |\n|---|---|\n{}", units.collect::<String>());
    let curves = CURVES.iter().map(|curve| {
        let name = curve.name;
        format!("| `in-{name}` `out-{name}` `in-out-{name}` | {} |\n", curve.meaning)
    });
    let easings = format!(
        "| easing | its curve |\n|---|---|\n| `linear` | straight; the default |\n{}",
        curves.collect::<String>()
    );
    let functions = FUNCTIONS.iter().map(|function| format!("| `{}` | {} |\n", function.usage, function.meaning));
    let functions = format!("| function | gives |\n|---|---|\n{}", functions.collect::<String>());
    [("commands", commands), ("settings", settings), ("units", units), ("easings", easings), ("functions", functions)]
}

/// `UPDATE_DOCS=1 cargo test --test docs` rewrites the tables.
#[test]
fn the_tables_of_the_reference_are_those_of_the_code() {
    let path = "docs/language.md";
    let text = fs::read_to_string(path).unwrap();
    let mut wanted = text.clone();
    for (name, table) in tables() {
        let begin = format!("<!-- table: {name} -->\n");
        let from = wanted.find(&begin).unwrap_or_else(|| panic!("{path} has no table of {name}")) + begin.len();
        let to = from + wanted[from..].find("<!-- end -->").unwrap();
        wanted.replace_range(from..to, &format!("\n{table}\n"));
    }
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(path, &wanted).unwrap();
    }
    assert_eq!(text, wanted, "run `UPDATE_DOCS=1 cargo test --test docs` and look at what changed");
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
        "# Errors and warnings\n\n`motionseq explain CODE` prints the same. A code never changes its meaning. A comment `# allow: CODE` at the end of a line \
         keeps that warning back on this line; errors cannot be allowed.\n\n{}",
        rows.collect::<String>()
    );
    let wanted = wanted.trim_end().to_owned() + "\n";
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write("docs/codes.md", &wanted).unwrap();
    }
    let text = fs::read_to_string("docs/codes.md").unwrap_or_default();
    assert_eq!(text, wanted, "run `UPDATE_DOCS=1 cargo test --test docs` and look at what changed");
}

#[test]
fn the_example_of_every_word_works() {
    for row in signatures(board())
        .chain(SETTINGS.iter().map(Row::signature))
        .filter(|row| !row.usage.is_empty() && row.name != "use")
    {
        let mode = if row.name == "move" { "pid position speed=0,0 position=0,0,0 yaw=0,0,0\n" } else { "" };
        let example = row.example.replace('…', "servo 1 1500");
        let source = Source::new("example", format!("{mode}{example}\nwait 1s\n"));
        let compiled = motionseq::compile(&source.into(), &Options::default());
        assert!(
            compiled.timeline.is_some(),
            "the example of `{}` does not compile: {:?}",
            row.name,
            compiled.diagnostics
        );
    }
}

#[test]
fn every_script_is_in_the_readme() {
    let text = fs::read_to_string("README.md").unwrap();
    for entry in fs::read_dir("scripts").unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        if name.ends_with(".frames") {
            continue;
        }
        let name = if entry.path().is_dir() { format!("{name}/") } else { name };
        assert!(text.contains(&format!("| `{name}` |")), "README.md has no row for {name}");
    }
}

#[test]
fn the_files_for_ci_are_the_ones_in_the_folder_and_their_commands_run() {
    let shown = blocks("docs/ci.md");
    let folder = std::env::temp_dir().join(format!("motionseq-docs-ci-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("x.motion"), "servo 1 1500\n").unwrap();
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_motionseq")).parent().unwrap().to_str().unwrap();
    let path = format!("{program}:{}", std::env::var("PATH").unwrap());
    let shell = |command: &str| {
        let mut shell = Command::new("sh");
        shell.args(["-c", command]).env("PATH", &path).current_dir(&folder).output().unwrap()
    };
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
    fs::remove_dir_all(folder).unwrap();
    assert_eq!(ran, 4);
}

#[test]
fn every_promise_of_safety_names_a_test_that_is_there() {
    let text = fs::read_to_string("docs/safety.md").unwrap();
    let (_, table) = text.split_once("| promise | how it is tested |\n|---|---|\n").unwrap();
    let rows: Vec<&str> = table.lines().take_while(|line| line.starts_with('|')).collect();
    assert!(rows.len() > 8);
    for row in rows.iter().filter(|row| !row.contains("see below") && !row.contains("all of the above")) {
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
    let text = fs::read_to_string("README.md").unwrap();
    let commands: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("motionseq plot ")).collect();
    let pictures: Vec<(&str, &str)> = commands.iter().filter_map(|command| command.split_once(" -o ")).collect();
    assert_eq!(pictures.len(), 3);
    for (script, picture) in pictures {
        let drawn = crate::support::run(&["plot", script, "--format", "svg"]);
        if std::env::var_os("UPDATE_DOCS").is_some() {
            fs::write(picture, &drawn.stdout).unwrap();
        }
        let is_current = fs::read(picture).is_ok_and(|picture| picture == drawn.stdout);
        assert!(is_current, "{picture} is not what `plot` draws; `UPDATE_DOCS=1 cargo test --test docs` draws it anew");
        assert!(text.contains(&format!("]({picture})")), "README.md does not show {picture}");
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
        "THIRD-PARTY.md is not what `cargo tree` says; `UPDATE_DOCS=1 cargo test --test docs` writes it anew"
    );
}

/// What the board does when frames stop is unknown, and every document uses the same sentence for
/// it.
#[test]
fn every_document_uses_one_sentence_for_silence() {
    let plain = |path: &str| fs::read_to_string(path).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    let sentence = "hat the board does when frames stop is unknown; ";
    for path in [
        "README.md",
        "docs/language.md",
        "docs/python.md",
        "docs/safety.md",
        "docs/codes.md",
        "src/diagnostic/codes.rs",
    ] {
        let text = plain(path);
        assert!(text.contains(sentence) && text.contains("has a test for it"), "{path} does not say it");
    }
    assert_eq!(
        motionseq::board::ON_SILENCE,
        "what the board does when frames stop is unknown; docs/safety.md has a test for it"
    );
    let mut texts = vec!["README.md".to_owned()];
    for folder in ["docs", "src/program", "src/capture", "src/diagnostic", "src/lints", "scripts"] {
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
