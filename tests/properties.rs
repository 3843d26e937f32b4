//! Properties of all scripts.

use crate::support::board::{OnBoard, board};
use motionseq::board::State;
use motionseq::program::Options;
use motionseq::source::{Source, Span};
use motionseq::timeline::Kind;
use motionseq::{Compiled, compile};
use proptest::prelude::*;

fn compiled(text: &str) -> Compiled {
    compile(&Source::new("test", text).into(), &Options::default())
}

/// A line that compiles on its own.
fn line() -> impl Strategy<Value = String> {
    let time = prop_oneof![Just(0), 1..2_000_u32].prop_map(|ms| format!("{ms}ms"));
    let command = prop_oneof![
        (1..=4, 500..=2500).prop_map(|(n, pulse)| format!("servo {n} {pulse}")),
        (500..=2500, 500..=1950).prop_map(|(pan, tilt)| format!("servos {pan} {tilt}")),
        (-25..=25, -25..=25, -200..=200).prop_map(|(x, y, z)| format!("rocker x={x} y={y} z={z}")),
        (-25..=25, -25..=25).prop_map(|(x, y)| format!("yawhold x={x} y={y}")),
        (-25..=25, -25..=25, 1..2_000).prop_map(|(a, b, ms)| format!("wheels {a} {b} 0 1 for {ms}ms")),
        Just("stop".to_owned()),
        Just("buzzer on".to_owned()),
        (1..2_000).prop_map(|ms| format!("buzzer on for {ms}ms")),
        Just("request voltage".to_owned()),
        Just("raw 0x40 1 2 3".to_owned()),
        Just("say \"hello\"".to_owned()),
        (500..=2500, 500..=2500, 1..800, prop::sample::select(motionseq::program::Ease::names())).prop_map(
            |(from, to, ms, ease)| {
                // Far from the ends of the range, so that no easing overshoots it.
                let inside = |pulse: i32| 1100 + (pulse - 500) / 3;
                format!("servo 1 {} -> {} over {ms}ms ease {ease}", inside(from), inside(to))
            }
        ),
        (-20..=20, 1..800).prop_map(|(y, ms)| format!("rocker x=0 -> 5 y={y} -> 0 z=0 -> 9 over {ms}ms")),
        (0..4, 1..300).prop_map(|(n, ms)| format!("repeat {n} as i {{ servo 2 (1000 + i * 10); wait_a({ms}ms) }}")),
        (0..5, 100..900).prop_map(|(n, ms)| format!("repeat {n} every {ms}ms {{ buzzer on for 50ms }}")),
        Just("together { servo 3 random(1000, 2000)\n+1 beat servo 3 pick(900, 1800) }".to_owned()),
        (0..3).prop_map(|n| format!("if random(0, 2) < {n} {{ servo 4 1000 }} else {{ wheels 1 2 3 4 for 1 beat }}")),
    ];
    let start = prop_oneof![
        3 => time.clone().prop_map(|time| format!("wait {time}\n")),
        1 => time.clone().prop_map(|time| format!("at {time} ")),
        1 => time.prop_map(|time| format!("+{time} ")),
    ];
    (start, command).prop_map(|(start, command)| format!("{start}{command}\n"))
}

/// A line that does something else each time it runs.
fn varying() -> impl Strategy<Value = String> {
    prop::sample::select(vec![
        "wait (pass * 100ms)\n",
        "+10ms servo 1 (1300 + pass * 20)\n",
        "let here = near + pass\nservo 3 here\n",
        "servo 4 near\n",
        "wait (1s / 3)\n",
        "+0.1us buzzer on for (10ms + pass * 1ms)\n",
        "wait random(10ms, 20ms)\n",
        "servo 3 pick(900, 1800)\n",
        "{\ntempo 70bpm\n+1 beat stop\n}\n",
        "if pass == 1 { servo 1 near }\nwait 20ms\n",
        "if pass == 1 { let near = 1700 }\nservo 1 near\nwait 20ms\n",
        "if pass == 2 { let unused = 1 } else { let near = 1250 }\nwait (near * 10us)\n",
        "wait 1 beat\n",
    ])
    .prop_map(str::to_owned)
}

/// Tokens of the language, mostly in the wrong order.
fn soup() -> impl Strategy<Value = String> {
    let word = prop::sample::select(vec![
        "servo",
        "rocker",
        "at",
        "wait",
        "for",
        "over",
        "if",
        "else",
        "let",
        "def",
        "repeat",
        "stop",
        "say",
        "x=",
        "1500",
        "-8",
        "0.5s",
        "1m30s",
        "2 beats",
        "bar 2",
        "0x1F",
        "90deg",
        "9999999999999999999",
        "->",
        "..",
        ",",
        ";",
        "{",
        "}",
        "(",
        ")",
        "+",
        "-",
        "*",
        "/",
        "=",
        "==",
        ":",
        "\"text\"",
        "\"",
        "\\",
        "# comment",
        "\n",
        "\r\n",
        "\r",
        "\t",
        "\0",
        "\u{1b}",
        "µs",
        "\u{202e}",
        "é",
        "@",
        "not ",
        "at 1s",
        "raw",
    ]);
    prop::collection::vec((word, prop::bool::ANY), 0..60).prop_map(|words| {
        words
            .into_iter()
            .map(|(word, has_space)| if has_space { format!("{word} ") } else { word.to_owned() })
            .collect()
    })
}

/// Shifts every span of a result.
fn moved(span: Span, by: u32) -> Span {
    if span == Span::default() { span } else { Span { start: span.start + by, end: span.end + by } }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A timeline is sorted, in range, refreshed only while it drives, and ends at rest.
    #[test]
    fn timelines_are_sound(lines in prop::collection::vec(line(), 1..20)) {
        let text = format!("seed 3\ndef wait_a(time) {{ wait time }}\n{}", lines.concat());
        let result = compiled(&text);
        prop_assert_eq!(format!("{:?}", result), format!("{:?}", compiled(&text)), "the same every time");
        if let Some(timeline) = result.timeline() {
            let events = &timeline.events;
            prop_assert!(events.is_sorted_by_key(|event| (event.at, event.rank(board()))));
            prop_assert!(events.iter().all(|event| event.at <= timeline.end));
            let mut state = State::default();
            for event in events {
                let bytes = event.command.to_frame();
                prop_assert_eq!(board().decode_or_raw(&bytes).unwrap(), event.command.clone());
                if event.kind == Kind::Sample && !event.command.is_drive() {
                    let mut same = state.clone();
                    same.apply(board(), &event.command);
                    prop_assert!(same != state, "a sample says something new");
                }
                if event.kind == Kind::Refresh {
                    prop_assert!(state.has(board(), &event.command), "a refresh repeats what was sent last");
                    prop_assert!(event.command.keeps_driving());
                }
                state.apply(board(), &event.command);
                prop_assert!(!text.get(event.span.range()).unwrap().is_empty());
            }
            prop_assert!(state.at_rest(board()));
        }
    }

    /// Lines of a `repeat` may be evaluated only once; the frames must not differ.
    #[test]
    fn a_repeat_is_its_lines_written_out(
        lines in prop::collection::vec(prop_oneof![4 => line(), 1 => varying()], 1..6),
        passes in 0..5_usize,
        setting in prop::sample::select(vec!["", "tempo 90bpm\n", "limit servo 1 1200..1800\n"]),
    ) {
        let start = format!("{setting}seed 3\ndef wait_a(time) {{ wait time }}\nlet near = 1300\nstop\n");
        let body = lines.concat();
        let repeated = compiled(&format!("{start}repeat {passes} as pass {{\n{body}}}\nstop\nbuzzer off\n"));
        let written: Vec<_> = (0..passes).map(|pass| format!("{{\nlet pass = {pass}\n{body}}}\n")).collect();
        let written = written.concat();
        let written = compiled(&format!("{start}{written}stop\nbuzzer off\n"));
        let sent = |compiled: &Compiled| {
            let timeline = compiled.timelines.first()?;
            let frames = timeline.events.iter().map(|event| (event.at, event.command.clone(), event.kind));
            Some((frames.collect::<Vec<_>>(), timeline.end))
        };
        prop_assert_eq!(sent(&repeated), sent(&written));
    }

    /// Nothing panics, and every message has a place in the text and a help.
    #[test]
    fn every_text_gets_an_answer(text in soup()) {
        let result = compiled(&text);
        prop_assert_eq!(result.timelines.is_empty(), result.diagnostics.has_errors());
        for diagnostic in &result.diagnostics {
            prop_assert!(diagnostic.span.end as usize <= text.len() + 1, "{diagnostic:?}");
            prop_assert!(!diagnostic.help.is_empty() && !diagnostic.message.is_empty());
            prop_assert!(diagnostic.message != "this cannot be read", "the grammar and the scan disagree");
        }
    }

    /// A long script is read in pieces. After a long comment, the result is the same, at later
    /// lines.
    #[test]
    fn where_a_script_is_cut_does_not_matter(text in soup(), length in 4_000..4_600_usize) {
        prop_assume!(!text.starts_with('\r'));
        let comment = format!("#{}\n", "-".repeat(length));
        let by = u32::try_from(comment.len()).unwrap();
        let here = compiled(&text);
        let there = compiled(&format!("{comment}{text}"));
        let spans = |result: &Compiled, by: u32| -> Vec<_> {
            result.diagnostics.iter().map(|diagnostic| (diagnostic.code, moved(diagnostic.span, by), diagnostic.message.clone())).collect()
        };
        prop_assert_eq!(spans(&here, by), spans(&there, 0));
    }
}

#[test]
fn an_else_is_never_cut_off() {
    for length in 4_000..4_100 {
        let text =
            format!("#{}\nif false {{ servo 1 1000 }}\n\n# why\n  else {{ servo 1 2000 }}\n", "-".repeat(length));
        let timeline = compiled(&text).timeline().expect("the else belongs to its if");
        assert_eq!(timeline.events[0].command.said(), "servo 1 2000");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let text = std::fs::read_to_string("scripts/wander.motion").unwrap();
    let one = format!("{:?}", compiled(&text).timeline().unwrap());
    let many: Vec<_> = (0..8)
        .map(|_| {
            std::thread::spawn({
                let text = text.clone();
                move || format!("{:?}", compiled(&text).timeline().unwrap())
            })
        })
        .collect();
    for other in many {
        assert_eq!(one, other.join().unwrap());
    }
}
