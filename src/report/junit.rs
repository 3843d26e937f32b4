//! `JUnit` XML, as Jenkins and `GitLab` read it.

use std::io;

use quick_xml::Writer;
use quick_xml::events::BytesText;

use crate::diagnostic::escaped;
use crate::verify::{Case, Problem, Status};

/// The results of scripts.
pub fn cases(cases: &[Case]) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 4);
    // Writing to a vector cannot fail.
    let _ = suites(cases, &mut writer);
    let text = String::from_utf8_lossy(writer.get_ref());
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{text}\n")
}

fn suites(cases: &[Case], xml: &mut Writer<Vec<u8>>) -> io::Result<()> {
    let count = |is: fn(&Case) -> bool| cases.iter().filter(|case| is(case)).count().to_string();
    let tests = cases.len().to_string();
    let failures = count(|case| !case.status.is_passed());
    let skipped = count(|case| case.status == Status::Orphan);
    // Jenkins' schema allows `skipped` in a suite, but not in `testsuites`.
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
            .write_inner_content(|xml| cases.iter().try_for_each(|case| self::case(case, xml)))?;
        Ok(())
    })?;
    Ok(())
}

fn case(case: &Case, xml: &mut Writer<Vec<u8>>) -> io::Result<()> {
    let name = escaped(&case.name);
    let test = xml.create_element("testcase").with_attributes([("name", &*name), ("classname", "motion")]);
    if case.status == Status::Orphan {
        // Jenkins' schema allows no reason here.
        return test.write_inner_content(|xml| xml.create_element("skipped").write_empty().map(drop)).map(drop);
    }
    if case.status.is_passed() {
        return test.write_empty().map(drop);
    }
    let lines = case.problems.iter().map(Problem::located).chain(case.hint());
    let lines: Vec<String> = lines.map(|line| escaped(&line)).collect();
    let code = case.problems.first().map_or("", |problem| problem.code);
    let failure = [("message", case.status.words()), ("type", code)];
    let write = |xml: &mut Writer<Vec<u8>>| {
        let element = xml.create_element("failure").with_attributes(failure);
        element.write_text_content(BytesText::new(&lines.join("\n"))).map(drop)
    };
    test.write_inner_content(write).map(drop)
}
