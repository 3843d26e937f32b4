//! `motionseq latency`: how well this machine keeps time.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use clap::Args;
use hdrhistogram::Histogram;
use motionseq::playback::{Signals, lateness};
use motionseq::units::{Micros, Nanos, NotATime};
use serde_json::{Value, json};

use super::exit::Exit;
use super::output::{self, Format};
use super::screen::Screen;

/// Measure how well this machine keeps time, idle and busy
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq latency\n  motionseq latency --for 60s --realtime\n  motionseq latency --format json > latency.json\n\nIt waits for deadlines 5 ms apart, in the same way as `play`: half of the time on an idle machine, half of the time with every\nprocessor busy. The last line says whether this machine is good enough, and what to do if it is not."
)]
pub(super) struct Latency {
    /// Measure for TIME, from 200ms to 1h
    #[arg(long = "for", value_name = "TIME", value_parser = time, default_value = "10s")]
    lasts: Micros,
    /// Use real-time priority and locked memory, if permitted
    #[arg(long)]
    realtime: bool,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

fn time(text: &str) -> Result<Micros, String> {
    let time: Result<Micros, NotATime> = text.parse();
    let range = Micros::from_millis(200)..=Micros::SECOND * 3_600;
    time.ok().filter(|time| range.contains(time)).ok_or_else(|| "write a time from 200ms to 1h, such as 10s".into())
}

/// The time between two deadlines: 200 per second, the highest sample rate of a move.
const INTERVAL: Nanos = Nanos::from_millis(5);
/// How long a drive frame takes at 115200 baud, and the default lateness that ends a run.
const FRAME: Nanos = Micros(1_128).nanos();
const LIMIT: Nanos = Nanos::from_millis(50);
/// The worst lateness of a good machine: half of the limit.
const NEAR: Nanos = Nanos::from_millis(25);
/// Upper ends of the rows of the histogram, and their names.
const ROWS: [(Nanos, &str); 9] = [
    (Micros(1).nanos(), "up to 1 µs"),
    (Micros(10).nanos(), "10 µs"),
    (Micros(100).nanos(), "100 µs"),
    (Micros(300).nanos(), "300 µs"),
    (FRAME, "1.128 ms, one frame"),
    (Nanos::from_millis(5), "5 ms"),
    (NEAR, "25 ms"),
    (LIMIT, "50 ms, the limit"),
    (Nanos::MAX, "more"),
];

impl Latency {
    /// Measures, and prints the results.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let Ok(signals) = Signals::catch() else {
            screen.error("cannot watch for Ctrl-C");
            return Exit::Failed;
        };
        let realtime = self.realtime && super::play::become_realtime(screen);
        let half = Nanos(self.lasts.nanos().0 / 2);
        screen.note(&format!("measuring: {half:.1} s idle, then {half:.1} s with every processor busy"));
        let mut measured = Vec::new();
        for busy in [false, true] {
            let load = Load::start(if busy { thread::available_parallelism().map_or(1, usize::from) } else { 0 });
            let Ok(mut found) = Histogram::<u64>::new_with_bounds(1, 60_000_000_000, 3) else { return Exit::Failed };
            lateness(INTERVAL, half, realtime, |late| found.saturating_record(late.0), || signals.pending().is_none());
            load.end();
            if let Some(signal) = signals.pending() {
                return Exit::Signal(signal);
            }
            measured.push(found);
        }
        let [idle, busy] = measured.as_slice() else { return Exit::Failed };
        let verdict = verdict(idle, busy, realtime);
        let text = match self.format {
            Format::Human => table(idle, "idle") + &table(busy, "busy") + verdict.words() + "\n",
            Format::Json => {
                let measured = json!({
                    "version": 1, "realtime": realtime, "idle": lateness_of(idle), "busy": lateness_of(busy),
                    "verdict": verdict.name(), "advice": verdict.words(),
                });
                format!("{measured:#}\n")
            }
        };
        output::exit(io::stdout().lock().write_all(text.as_bytes()), None, screen)
    }
}

/// Threads that keep processors busy.
struct Load {
    over: Arc<AtomicBool>,
    threads: Vec<thread::JoinHandle<()>>,
}

impl Load {
    fn start(count: usize) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let threads = (0..count).filter_map(|_| {
            let over = Arc::clone(&over);
            let work = move || {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            };
            thread::Builder::new().spawn(work).ok()
        });
        Load { threads: threads.collect(), over: Arc::clone(&over) }
    }

    fn end(self) {
        self.over.store(true, Ordering::Relaxed);
        for thread in self.threads {
            let _ = thread.join();
        }
    }
}

/// A histogram with one row per range of lateness.
fn table(found: &Histogram<u64>, name: &str) -> String {
    let shown = |nanos: u64| Nanos(nanos).short();
    let mut text = format!(
        "{name}: {} deadlines; lateness: median {}, 99th percentile {}, worst {}\n",
        found.len(),
        shown(found.value_at_quantile(0.5)),
        shown(found.value_at_quantile(0.99)),
        shown(found.max())
    );
    let mut from = 0;
    for (to, name) in ROWS {
        let count = found.count_between(from, to.0.saturating_sub(1));
        from = to.0;
        let stars = "#".repeat(usize::try_from((count * 50).div_ceil(found.len().max(1))).unwrap_or(0));
        if count > 0 {
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {name:>18}  {count:>7}  {stars}");
        }
    }
    text
}

/// A histogram as data. Its rows are those of [`table`].
fn lateness_of(found: &Histogram<u64>) -> Value {
    let mut from = 0;
    let rows = ROWS.map(|(to, _)| {
        let count = found.count_between(from, to.0.saturating_sub(1));
        from = to.0;
        json!({ "below_ns": Some(to.0).filter(|_| to != Nanos::MAX), "count": count })
    });
    json!({
        "deadlines": found.len(),
        "lateness_ns": {
            "p50": found.value_at_quantile(0.5), "p99": found.value_at_quantile(0.99), "max": found.max(), "rows": rows,
        },
    })
}

/// Whether the machine is good enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Good,
    /// Good with real-time priority, perhaps.
    TryRealtime,
    Stalls,
}

fn verdict(idle: &Histogram<u64>, busy: &Histogram<u64>, realtime: bool) -> Verdict {
    let is_good = |found: &Histogram<u64>| found.value_at_quantile(0.99) < FRAME.0 && found.max() < NEAR.0;
    match (is_good(idle), is_good(busy)) {
        (true, true) => Verdict::Good,
        (true, false) if !realtime => Verdict::TryRealtime,
        _ => Verdict::Stalls,
    }
}

impl Verdict {
    /// The name in the JSON object.
    fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::TryRealtime => "try-realtime",
            Verdict::Stalls => "stalls",
        }
    }

    /// The verdict, and what to do.
    fn words(self) -> &'static str {
        match self {
            Verdict::Good => "good: frames are sent on time, also while other programs run",
            Verdict::TryRealtime => {
                "use --realtime: this machine keeps time only while it is idle; try `motionseq latency --realtime`"
            }
            Verdict::Stalls => {
                "this machine stalls: close other programs, use a machine that is not shared or virtual, or raise the limit, such as `play --max-late 200ms`; by default a frame later than 50 ms ends a run"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn histogram(values: &[(u64, u64)]) -> Histogram<u64> {
        let mut found = Histogram::new_with_bounds(1, 60_000_000_000, 3).unwrap();
        for (value, count) in values {
            found.saturating_record_n(*value, *count);
        }
        found
    }

    #[test]
    fn each_result_has_its_advice() {
        let good = histogram(&[(500, 990), (900_000, 10)]);
        let late = histogram(&[(500, 900), (4_000_000, 100)]);
        let stalls = histogram(&[(500, 999), (60_000_000, 1)]);
        assert_eq!(verdict(&good, &good, false), Verdict::Good);
        assert_eq!(verdict(&good, &late, false), Verdict::TryRealtime);
        assert_eq!(verdict(&good, &stalls, false), Verdict::TryRealtime);
        assert_eq!(verdict(&good, &late, true), Verdict::Stalls);
        assert_eq!(verdict(&late, &good, false), Verdict::Stalls);
        assert_eq!(verdict(&stalls, &stalls, true), Verdict::Stalls);
    }

    #[test]
    fn every_deadline_is_in_one_row() {
        let found = histogram(&[
            (500, 1),
            (5_000, 2),
            (50_000, 3),
            (200_000, 4),
            (1_000_000, 5),
            (2_000_000, 6),
            (10_000_000, 7),
            (30_000_000, 8),
            (90_000_000, 9),
        ]);
        let text = table(&found, "busy");
        assert!(text.starts_with("busy: 45 deadlines; lateness: median "), "{text}");
        let counts: Vec<&str> = text
            .lines()
            .skip(1)
            .map(|line| line.split('#').next().unwrap().split_whitespace().next_back().unwrap())
            .collect();
        assert_eq!(counts, ["1", "2", "3", "4", "5", "6", "7", "8", "9"], "{text}");
        let data = lateness_of(&found);
        let rows = data["lateness_ns"]["rows"].as_array().unwrap();
        assert_eq!(
            rows.iter().map(|row| row["count"].as_u64().unwrap()).collect::<Vec<_>>(),
            (1..=9).collect::<Vec<_>>()
        );
        assert_eq!((rows[0]["below_ns"].as_u64(), rows[8]["below_ns"].as_u64()), (Some(1_000), None));
    }
}
