//! The peers of `benches/speed.py`, and measurements inside one process.
//!
//!     speed scripts FOLDER    writes the scripts of the benchmark, and the same events as JSON
//!     speed parse FOLDER      parses a million lines, compared with serde_json on the same events
//!     speed peer FILE         parses a JSON file in its own process
#![allow(clippy::unwrap_used, clippy::indexing_slicing, clippy::expect_used, clippy::panic)]

use std::fmt::Write as _;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use motionseq::diagnostic::Diagnostics;
use motionseq::source::{Disk, Files as _};
use motionseq::syntax;
use serde::Deserialize;

/// What the peer reads: one plain event.
#[derive(Deserialize)]
#[allow(dead_code, reason = "filled, as a program would, and dropped")]
struct Event {
    t: u64,
    kind: Kind,
    a: i32,
    b: i32,
    c: i32,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Servo,
    Rocker,
    Buzzer,
}

/// The passes of each side of a comparison; the medians are printed.
const PASSES: usize = 9;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).filter(|arg| *arg != "--bench").collect();
    match args[..] {
        ["scripts", folder] => write_scripts(Path::new(folder)),
        ["parse", folder] => parse(Path::new(folder)),
        ["peer", file] => {
            let bytes = fs::read(file).unwrap();
            println!("{} events", peer(&bytes).len());
        }
        _ => panic!("run benches/speed.py"),
    }
}

fn peer(json: &[u8]) -> Vec<Event> {
    serde_json::from_slice(json).unwrap()
}

/// Lines of one command each, a third each servo, rocker and buzzer, a fifth of them with a
/// comment, and the same events as JSON.
fn flat(count: u64) -> (String, String) {
    let (mut script, mut json) = (String::new(), String::from("["));
    for at in 0..count {
        let ms = at * 10;
        write!(script, "at {}.{:02}s ", ms / 1_000, ms % 1_000 / 10).unwrap();
        let turn = i32::try_from(at / 3 % 40).unwrap();
        let (kind, a, b, c) = match at % 3 {
            // No servo is moved too fast, and the last three end what was begun.
            0 => ("servo", 1 + turn % 4, 1_500 + turn, 0),
            1 if at + 3 >= count => ("rocker", 0, 0, 0),
            1 => ("rocker", turn - 20, 10 - turn % 20, turn),
            _ => ("buzzer", (turn % 2) & i32::from(at + 3 < count), 0, 0),
        };
        match kind {
            "servo" => write!(script, "servo {a} {b}").unwrap(),
            "rocker" => write!(script, "rocker x={a} y={b} z={c}").unwrap(),
            _ => write!(script, "buzzer {}", if a == 1 { "on" } else { "off" }).unwrap(),
        }
        script.push_str(if at % 5 == 0 { "  # the next bow\n" } else { "\n" });
        let comma = if at == 0 { "" } else { "," };
        write!(json, "{comma}{{\"t\":{ms},\"kind\":\"{kind}\",\"a\":{a},\"b\":{b},\"c\":{c}}}").unwrap();
    }
    json.push(']');
    (script, json)
}

/// Twenty lines of nested blocks that unroll to this many events, and a stop.
fn nested(events: u64) -> String {
    let outer = events / 1_000;
    format!(
        "# A bow of five commands, again and again.
let step = 5ms
let near = 1500
let far = 1540
repeat {outer} {{
    # A thousand of them are a dance.
    repeat 10 {{
        # Twenty bows.
        repeat 20 {{
            +step servo 1 near
            +step rocker x=10 y=-5 z=20
            +step buzzer on
            +step buzzer off
            +step servo 2 far
        }}
    }}
}}

+step stop
say \"that was it\"
"
    )
}

fn write_scripts(folder: &Path) {
    for count in [10_000, 100_000, 1_000_000, 2_000_000] {
        let (script, json) = flat(count);
        fs::write(folder.join(format!("flat-{count}.motion")), script).unwrap();
        fs::write(folder.join(format!("flat-{count}.json")), json).unwrap();
    }
    for count in [10_000, 100_000, 1_000_000, 2_000_000, 10_000_000] {
        fs::write(folder.join(format!("nested-{count}.motion")), nested(count)).unwrap();
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn parse(folder: &Path) {
    let source = Disk.read(&folder.join("flat-1000000.motion")).unwrap();
    let json = fs::read(folder.join("flat-1000000.json")).unwrap();
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..PASSES {
        let begin = Instant::now();
        let mut diagnostics = Diagnostics::default();
        let mut script = syntax::read(&source, &mut diagnostics).unwrap();
        let (mut lines, mut lost) = (0, syntax::Lost::default());
        while let Some(line) = script.next(&mut diagnostics, &mut lost) {
            lines += black_box(line).parts.len();
        }
        ours.push(begin.elapsed().as_secs_f64());
        assert!(lines == 1_000_000 && !diagnostics.has_errors());
        let begin = Instant::now();
        let events = peer(&json);
        theirs.push(begin.elapsed().as_secs_f64());
        drop(black_box(events));
    }
    println!("{} {}", median(ours), median(theirs));
}
