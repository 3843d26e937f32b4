//! What became of scripts, as text for other programs.

use std::fmt::Write;
use std::io;

use quick_xml::Writer;
use quick_xml::events::BytesText;
use serde::Serialize;

use super::{Repository, data, property};
use crate::diagnostic::escaped;
use crate::verify::{Case, Problem, TOTAL, Verdict};

/// One JSON object: the version of its form, the counts, and every case with its problems.
pub fn cases_json(cases: &[Case]) -> String {
    #[derive(Serialize)]
    struct Document<'a> {
        version: u32,
        passed: usize,
        failed: usize,
        orphans: usize,
        cases: Vec<Row<'a>>,
    }
    #[derive(Serialize)]
    struct Row<'a> {
        file: &'a str,
        passed: bool,
        verdict: &'static str,
        problems: Vec<Trouble<'a>>,
        left_out: usize,
    }
    #[derive(Serialize)]
    struct Trouble<'a> {
        file: &'a str,
        line: Option<usize>,
        code: &'static str,
        message: &'a str,
    }
    let line = |problem: &'_ Problem| Some(problem.line).filter(|line| *line > 0);
    let rows = cases.iter().map(|case| Row {
        file: &case.name,
        passed: case.verdict.is_passed(),
        verdict: case.verdict.words(),
        problems: case
            .problems
            .iter()
            .map(|problem| Trouble {
                file: &problem.file,
                line: line(problem),
                code: problem.code,
                message: &problem.message,
            })
            .collect(),
        left_out: case.left_out,
    });
    let failed = cases.iter().filter(|case| !case.verdict.is_passed()).count();
    let orphans = cases.iter().filter(|case| case.verdict.is_orphan()).count();
    let passed = cases.iter().filter(|case| case.verdict.is_passed() && !case.verdict.is_orphan()).count();
    let document = Document { version: 1, passed, failed, orphans, cases: rows.collect() };
    // Strings and numbers cannot fail to be written.
    serde_json::to_string_pretty(&document).unwrap_or_default() + "\n"
}

/// The same cases, with the paths of a repository.
pub fn cases_in(repository: &Repository, cases: &[Case]) -> Vec<Case> {
    let mut cases = cases.to_vec();
    for case in &mut cases {
        case.name = repository.path(&case.name);
        for problem in &mut case.problems {
            problem.file = repository.path(&problem.file);
        }
    }
    cases
}

/// The Test Anything Protocol, version 13.
pub fn cases_tap(cases: &[Case]) -> String {
    let mut text = format!("TAP version 13\n1..{}\n", cases.len());
    for (case, number) in cases.iter().zip(1..) {
        let ok = if case.verdict.is_passed() { "ok" } else { "not ok" };
        // `#` begins a directive, and a line end would end the line.
        let name = escaped(&case.name).replace('\\', "\\\\").replace('#', "\\#");
        let skipped = if case.verdict == Verdict::Orphan { " # SKIP there is no script" } else { "" };
        let _ = writeln!(text, "{ok} {number} - {name}: {}{skipped}", case.verdict.words());
        for problem in &case.problems {
            let _ = writeln!(text, "# {}", escaped(&located(problem)));
        }
        if case.left_out > 0 {
            let _ = writeln!(text, "# and {} more", case.left_out);
        }
        if let Some(hint) = case.hint() {
            let _ = writeln!(text, "# {}", escaped(&hint));
        }
    }
    text
}

/// What `GitHub` shows at the lines of a pull request.
pub fn cases_github(cases: &[Case]) -> String {
    let mut text = String::new();
    for case in cases {
        let mut hint = case.hint();
        for problem in &case.problems {
            let level = match (case.verdict, problem.code) {
                (Verdict::Orphan, _) => "warning",
                (_, TOTAL) => "notice",
                _ => "error",
            };
            let line = if problem.line > 0 { format!(",line={}", problem.line) } else { String::new() };
            let file = property(&problem.file);
            // Once for each script.
            let hint = hint.take().map(|hint| format!("\n{hint}")).unwrap_or_default();
            let message = data(&format!("{}{hint}", problem.message));
            let _ = writeln!(text, "::{level} file={file}{line},title={}::{message}", problem.code);
        }
    }
    text
}

/// A `JUnit` file, as Jenkins and `GitLab` read it.
pub fn cases_junit(cases: &[Case]) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 4);
    // Nothing can fail that is written to a vector.
    let _ = junit(cases, &mut writer);
    let text = String::from_utf8_lossy(writer.get_ref());
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{text}\n")
}

fn junit(cases: &[Case], xml: &mut Writer<Vec<u8>>) -> io::Result<()> {
    let count = |is: fn(&Case) -> bool| cases.iter().filter(|case| is(case)).count().to_string();
    let tests = cases.len().to_string();
    let failures = count(|case| !case.verdict.is_passed());
    let skipped = count(|case| case.verdict == Verdict::Orphan);
    // Jenkins' schema allows `skipped` of a suite, and not of all suites together.
    let suites = [("name", "motionseq"), ("tests", &*tests), ("failures", &*failures), ("errors", "0")];
    let suite = [
        ("name", "motionseq test"),
        ("tests", &*tests),
        ("skipped", &*skipped),
        ("errors", "0"),
        ("failures", &*failures),
    ];
    xml.create_element("testsuites").with_attributes(suites).write_inner_content(|xml| {
        xml.create_element("testsuite")
            .with_attributes(suite)
            .write_inner_content(|xml| cases.iter().try_for_each(|case| junit_case(case, xml)))?;
        Ok(())
    })?;
    Ok(())
}

fn junit_case(case: &Case, xml: &mut Writer<Vec<u8>>) -> io::Result<()> {
    let name = escaped(&case.name);
    let test = xml.create_element("testcase").with_attributes([("name", &*name), ("classname", "motion")]);
    if case.verdict == Verdict::Orphan {
        // Jenkins' schema has no words for why.
        return test.write_inner_content(|xml| xml.create_element("skipped").write_empty().map(drop)).map(drop);
    }
    if case.verdict.is_passed() {
        return test.write_empty().map(drop);
    }
    let lines = case.problems.iter().map(located).chain(case.hint());
    let lines: Vec<String> = lines.map(|line| escaped(&line)).collect();
    let code = case.problems.first().map_or("", |problem| problem.code);
    let failure = [("message", case.verdict.words()), ("type", code)];
    let write = |xml: &mut Writer<Vec<u8>>| {
        let element = xml.create_element("failure").with_attributes(failure);
        element.write_text_content(BytesText::new(&lines.join("\n"))).map(drop)
    };
    test.write_inner_content(write).map(drop)
}

/// A problem with its place before it, where its words do not name it.
pub fn located(problem: &Problem) -> String {
    match problem.code {
        "difference" | TOTAL => problem.message.clone(),
        code if problem.line > 0 => format!("{}:{}: {code}: {}", problem.file, problem.line, problem.message),
        code => format!("{}: {code}: {}", problem.file, problem.message),
    }
}
