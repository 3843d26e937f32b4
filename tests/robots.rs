//! Several robots: each gets what it would get from a script of its own.

use std::fmt::Write as _;

use motionseq::program::Options;
use motionseq::source::{Source, Sources};
use motionseq::timeline::Timeline;
use proptest::prelude::*;

const NAMES: [&str; 3] = ["left", "right", "middle"];

/// The first lines of every script. A move needs a last value.
const HEAD: &str = "let depth = 100us\ndef nod(by) {\nservo 2 (1500us + by) over 200ms\nservo 2 1500us over 200ms\n}\nservos 1500 1500\nstop\n";

/// A command, a block or a call, the time that it takes, and a random value that it draws.
#[derive(Clone, Debug)]
struct Statement {
    text: String,
    ms: u32,
    draws: Option<&'static str>,
}

/// Statements that start together, each for some of the robots; without names, for all.
#[derive(Clone, Debug)]
struct Line {
    wait_ms: u32,
    parts: Vec<(Vec<usize>, Statement)>,
    is_named: bool,
}

fn timelines(text: &str) -> Vec<Timeline> {
    let sources = Sources::from(Source::new("test", text));
    let compiled = motionseq::compile(&sources, &Options::default());
    let messages = crate::support::messages(&sources, &compiled.diagnostics);
    assert!(!compiled.timelines.is_empty(), "{text}\n{messages}");
    compiled.timelines
}

fn statement() -> impl Strategy<Value = Statement> {
    let lasting = (0..7_u32, 1..400_u32, 1..20_u32).prop_map(|(kind, ms, value)| match kind {
        0 => (format!("rocker x={value} for {ms}ms"), ms),
        1 => (format!("rocker y={value}"), 0),
        2 => (format!("servo 1 {} over {ms}ms ease in-out-sine", 1000 + value * 10), ms),
        3 => (format!("buzzer on for {ms}ms"), ms),
        4 => ("nod(depth)".to_owned(), 400),
        5 => (format!("repeat 3 as i {{\nservo 4 ({value} * 10 + 1000 + i * 50)\nwait {ms}ms\n}}"), 3 * ms),
        _ => (format!("together {{\nservo 3 1500\n+{ms}ms wheels {value} 0 0 {value} for 100ms\n}}"), ms + 100),
    });
    let lasting = lasting.prop_map(|(text, ms)| Statement { text, ms, draws: None });
    let random =
        Just(Statement { text: "servo 3 random(1000, 2000)".to_owned(), ms: 0, draws: Some("random(1000, 2000)") });
    prop_oneof![4 => lasting, 1 => random]
}

fn line(robots: usize) -> impl Strategy<Value = Line> {
    let who = prop::collection::vec(0..3_usize, robots);
    (20..200_u32, who, [statement(), statement()], any::<bool>()).prop_map(|(wait_ms, who, statements, is_named)| {
        let of = |part: usize| (0..who.len()).filter(|robot| who[*robot] == part).collect::<Vec<_>>();
        let parts: Vec<_> = statements.into_iter().enumerate().map(|(part, statement)| (of(part), statement)).collect();
        let parts: Vec<_> = parts.into_iter().filter(|(robots, _)| !robots.is_empty()).collect();
        let is_for_all = parts.first().is_some_and(|(robots, _)| robots.len() == who.len());
        Line { wait_ms, parts, is_named: is_named || !is_for_all }
    })
}

/// The script for all robots.
fn together(robots: usize, lines: &[Line]) -> String {
    let mut script = format!("robots {}\n{HEAD}", NAMES[..robots].join(", "));
    for Line { wait_ms, parts, is_named } in lines.iter().filter(|line| !line.parts.is_empty()) {
        let part = |(robots, statement): &(Vec<usize>, Statement)| {
            let names: Vec<&str> = robots.iter().map(|robot| NAMES[*robot]).collect();
            if *is_named { format!("{}: {}", names.join(", "), statement.text) } else { statement.text.clone() }
        };
        let parts: Vec<String> = parts.iter().map(part).collect();
        writeln!(script, "+{wait_ms}ms {}", parts.join("; ")).unwrap();
    }
    script + "wait 100ms\n"
}

/// The script for one of them: it waits while others do something, and draws what they draw.
fn alone(robot: usize, lines: &[Line]) -> String {
    let mut script = HEAD.to_owned();
    let mut draws = 0;
    for Line { wait_ms, parts, .. } in lines.iter().filter(|line| !line.parts.is_empty()) {
        let longest = parts.iter().map(|(_, statement)| statement.ms).max().unwrap();
        let mut own = 0;
        writeln!(script, "wait {wait_ms}ms").unwrap();
        for (robots, statement) in parts {
            if robots.contains(&robot) {
                writeln!(script, "{}", statement.text).unwrap();
                own = statement.ms;
            } else if let Some(value) = statement.draws {
                writeln!(script, "let drawn_{draws} = {value}").unwrap();
                draws += 1;
            }
        }
        if own < longest {
            writeln!(script, "wait {}ms", longest - own).unwrap();
        }
    }
    script + "wait 100ms\n"
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn each_robot_gets_the_frames_of_a_script_of_its_own(
        (robots, lines) in (2..=3_usize).prop_flat_map(|robots| (Just(robots), prop::collection::vec(line(robots), 1..12)))
    ) {
        let script = together(robots, &lines);
        let all = timelines(&script);
        prop_assert_eq!(all.len(), robots);
        for (robot, timeline) in all.iter().enumerate() {
            prop_assert_eq!(timeline.robot.as_deref(), Some(NAMES[robot]));
            let own = alone(robot, &lines);
            let expected = timelines(&own).remove(0);
            let frames = |timeline: &Timeline| -> Vec<_> {
                timeline.events.iter().map(|event| (event.at, event.command.clone(), event.kind)).collect()
            };
            prop_assert_eq!(frames(timeline), frames(&expected), "{}\nalone:\n{}", script, own);
            prop_assert_eq!(timeline.end, expected.end);
        }
    }
}
