//! The line's capacity against a line that is simulated byte by byte, and the resulting messages.

use std::collections::VecDeque;

use crate::support::{run, script, stderr};
use motionseq::Compiled;
use motionseq::diagnostic::Code;
use motionseq::program::Options;
use motionseq::source::Source;
use motionseq::timeline::wire::{Wire, load};
use motionseq::units::Micros;
use proptest::prelude::*;

fn compiled(text: &str) -> Compiled {
    motionseq::compile(&Source::new("x.motion", text).into(), &Options::default())
}

/// A line that takes one byte at a time from a queue. Times are in ticks of 1/(10⁶ · baud) s.
/// Returns for each byte its frame, its start and its end.
fn simulated(frames: &[(u64, usize)], baud: u64) -> Vec<(usize, u128, u128)> {
    let byte_time = 10 * 1_000_000_u128;
    let mut coming: VecDeque<(usize, u128, usize)> =
        frames.iter().enumerate().map(|(at, &(due, bytes))| (at, u128::from(due * baud), bytes)).collect();
    let mut queue = VecDeque::new();
    let mut sent = Vec::new();
    let mut now = 0;
    loop {
        while coming.front().is_some_and(|&(_, due, _)| due <= now) {
            let (at, _, bytes) = coming.pop_front().unwrap();
            queue.extend(std::iter::repeat_n(at, bytes));
        }
        match queue.pop_front() {
            Some(at) => {
                sent.push((at, now, now + byte_time));
                now += byte_time;
            }
            None => match coming.front() {
                Some(&(_, due, _)) => now = due,
                None => return sent,
            },
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_byte_leaves_when_a_real_line_would_send_it(
        gaps in prop::collection::vec((0u64..4_000, 1usize..32), 0..200),
        baud in prop::sample::select(vec![1_200u32, 9_600, 57_600, 115_200, 999_983, 4_000_000]),
    ) {
        let mut due = 0;
        let frames: Vec<(u64, usize)> = gaps.into_iter().map(|(gap, bytes)| { due += gap; (due, bytes) }).collect();
        let sent = simulated(&frames, u64::from(baud));
        let mut wire = Wire::new(baud);
        for (at, &(due, bytes)) in frames.iter().enumerate() {
            let departure = wire.send(Micros(due), bytes);
            let first = sent.iter().find(|(of, ..)| *of == at).unwrap();
            let last = sent.iter().rfind(|(of, ..)| *of == at).unwrap();
            prop_assert_eq!((u128::from(departure.begins), u128::from(departure.left)), (first.1, last.2));
        }
    }

    #[test]
    fn the_load_of_each_second_is_that_of_a_real_line(
        commands in prop::collection::vec((0u64..400, 1u8..5), 1..100),
        baud in prop::sample::select(vec![1_200u32, 9_600, 115_200]),
    ) {
        let mut text = format!("baud {baud}\n");
        for (at, (ms, servo)) in commands.iter().enumerate() {
            text.push_str(&format!("wait {ms}ms\nservo {servo} {}\nwait 1us\n", 1_000 + at));
        }
        let Some(timeline) = compiled(&text).timeline() else { return Ok(()) };
        let frames: Vec<(u64, usize)> =
            timeline.events.iter().map(|event| (event.at.0, crate::support::board::OnBoard::to_frame(&event.command).len())).collect();
        let second = 1_000_000 * u128::from(baud);
        let mut seconds: Vec<u64> = Vec::new();
        for (_, _, left) in simulated(&frames, u64::from(baud)) {
            let at = usize::try_from((left - 1) / second).unwrap();
            seconds.resize(seconds.len().max(at + 1), 0);
            seconds[at] += 1;
        }
        prop_assert_eq!(load(&timeline).seconds, seconds);
    }
}

/// `count` frames of 13 bytes (1,128.47 µs each at 115200 baud) that are due together.
fn together(count: usize) -> String {
    "raw 0x40 0 0 0 0 0 0 0 0  # allow: raw-frame\n".repeat(count)
}

#[test]
fn late_frames_are_reported_from_five_and_fifty_milliseconds() {
    let codes =
        |text: &str| -> Vec<Code> { compiled(text).diagnostics.iter().map(|diagnostic| diagnostic.code).collect() };
    // The n-th of them leaves (n - 1) · 1.12847 ms late: the fifth 4.514 ms, the sixth 5.642 ms,
    // the 45th 49.653 ms, the 46th 50.781 ms. Closing frames follow each script with a raw frame:
    // the stop is one more, and `buzzer off` the next; a pause frees the line for them.
    for (count, expected) in
        [(5, vec![]), (6, vec![Code::WireLate]), (45, vec![Code::WireLate]), (46, vec![Code::WireFull])]
    {
        assert_eq!(codes(&format!("{}wait 1s\n", together(count))), expected, "{count}");
    }
    let compiled = compiled(&format!("servo 1 1500\nwait 1s\n{}wait 1s\n", together(8)));
    let diagnostics = compiled.diagnostics.iter().collect::<Vec<_>>();
    assert_eq!(
        diagnostics[0].message,
        "`raw 0x40 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00` is due at 1.000000 s but leaves 7.9 ms late, because the line is busy; 2 more frames are late too"
    );
    // A single frame is never late, however slow the line.
    assert_eq!(codes("baud 1200\nservo 1 1500\nwait 1s\nservo 1 1600\n"), []);
    // What `on abort` sends has its own line budget.
    let abort = |count: usize| format!("on abort {{\n{}}}\nservo 1 1500\n", together(count));
    assert_eq!(codes(&abort(6)), [Code::WireLate]);
    assert_eq!(codes(&abort(46)), [Code::WireFull]);
}

#[test]
fn allowing_lateness_on_a_line_does_not_hide_that_of_others() {
    let six = |last: &str| format!("{}{last}wait 1s\n", together(5));
    let late = six("raw 0x40 1  # allow: raw-frame\n");
    let allowed = six("raw 0x40 1  # allow: raw-frame, wire-late\n");
    let path = |name: &str, text: &str| script(name, text);
    assert_eq!(run(&["check", "--deny", "warnings", &path("late", &late)]).status.code(), Some(1));
    assert_eq!(run(&["check", "--deny", "warnings", &path("allowed-late", &allowed)]).status.code(), Some(0));
    // An error cannot be allowed.
    let full = format!("{}raw 0x40 1  # allow: raw-frame, wire-full\nwait 1s\n", together(50));
    assert_eq!(run(&["check", &path("full", &full)]).status.code(), Some(1));
}

#[test]
fn check_v_shows_the_load_by_second() {
    let text = "rocker x=5 for 3s\nwait 1s\nservo 1 1000; servo 2 1500\n";
    let output = run(&["check", "-v", &script("load", text)]);
    let said = stderr(&output);
    // Twenty frames of 13 bytes per second; the command and the stop are one each; then two of 8
    // bytes, the second of which waits 0.694 ms for the first.
    for line in [
        "load on the serial line (11520 bytes/s):",
        "          0-3 s     260 bytes/s    2 %",
        "            3 s      13 bytes/s    0 %",
        "            4 s      16 bytes/s    0 %",
        "longest wait: 0.695 ms, `servo 2 1500` at 4.000 s",
    ] {
        assert!(said.contains(line), "{line:?} is not in\n{said}");
    }
    assert!(!stderr(&run(&["check", &script("load", text)])).contains("load on the serial line"));
}
