//! The lateness of frames at write(2): plays a script over a pty and prints percentiles in
//! nanoseconds.
//!
//!     lateness [--frames N] [--step-us N] [--realtime] [--no-guard]
//!     lateness --arm|--raspblock [--frames N] [--realtime]
//!     lateness --robots N [--frames N] [--step-us N] [--full] PROGRAM
//!
//! `--arm` moves six bus servos at 50 Hz and reads them; `--raspblock` moves four servos at 50 Hz and
//! gets reports. Both play on a virtual board, and print the lateness that the player notes.
//!
//! `--robots N` plays a script for N robots with the program, each over a pty of its own, and prints
//! the skew of the frames that are due together, as the far ends see them; with `--full`, every robot
//! gets as many frames as its line carries. `late` is how many frames of the worst robot came more than
//! 5 ms after the first of their group; `behind`, how many came more than 5 ms later than its
//! earliest frame, on its own clock. This is the limit of the warning `wire-late`.
//!
//! `benches/playback.py` compares it with its peers. Its own link takes a timestamp at the start of
//! each write.
#![allow(clippy::unwrap_used, clippy::indexing_slicing, clippy::expect_used)]

use std::fmt::Write as _;
use std::io;
use std::os::fd::BorrowedFd;
use std::process::Command;
use std::sync::Arc;
use std::thread;

use motionseq::faults::{Faults, Faulty};
use motionseq::link::{Link, Pty, Serial};
use motionseq::playback::{Guard, GuardConfig, Notice, Player, Realtime, Session, Signals, guard, now};
use motionseq::program::Options;
use motionseq::serve::BoardThread;
use motionseq::sim::{Device, Settings};
use motionseq::source::{Lines, Source, Sources};
use motionseq::timeline::Timeline;
use motionseq::timeline::wire::LATE;
use motionseq::units::Nanos;

/// The argument that makes this program the guard.
const GUARD: &str = "guard";
const MAX_LATE: Nanos = Nanos::from_millis(1_000);

/// Bytes of the frame of one servo.
const FRAME: usize = 8;

/// Records when the write of each frame began. After a stall, one write contains several frames.
/// Memory is allocated before the first.
struct Stamped {
    port: Serial,
    stamps: Vec<Nanos>,
}

impl Link for Stamped {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let began = now();
        let taken = self.port.write(bytes)?;
        self.stamps.extend(std::iter::repeat_n(began, taken / FRAME));
        Ok(taken)
    }
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.port.read(buffer)
    }
    fn discard(&mut self) -> io::Result<()> {
        self.port.discard()
    }
    fn descriptor(&self) -> BorrowedFd<'_> {
        self.port.descriptor()
    }
}

fn start_guard(timeline: &Timeline, port: BorrowedFd<'_>, realtime: bool) -> Guard {
    let mut program = Command::new("/proc/self/exe");
    program.arg(GUARD);
    let mut ward = GuardConfig::of(timeline);
    (ward.max_late, ward.realtime) = (MAX_LATE, realtime);
    Guard::start(program, port, &ward).unwrap()
}

/// Moves all servos of a board back and forth at 50 Hz, while an `expect` waits for reports.
fn servos(is_arm: bool, frames: u64, realtime: bool) {
    let (board, last, ends) = if is_arm { ("sts", 6, ["1500", "2500"]) } else { ("raspblock", 4, ["900", "1700"]) };
    let never = if is_arm { "position 1 > 20000" } else { "voltage > 99V" };
    let mut text = format!("board {board}\n");
    for servo in 1..=last {
        writeln!(text, "limit servo {servo} {}..{}\nat 0s servo {servo} {}", ends[0], ends[1], ends[0]).unwrap();
    }
    // All settings come first.
    let mut lines: Vec<&str> = text.lines().collect();
    lines.sort_by_key(|line| line.starts_with("at "));
    let mut text = lines.join("\n") + "\n";
    let steps = frames / last;
    for step in 0..steps {
        for servo in 1..=last {
            let value = if step % 2 == 0 { ends[1] } else { ends[0] };
            writeln!(text, "at {}ms servo {servo} {value}", 500 + step * 20).unwrap();
        }
    }
    // Never true, so that reports are needed until the end.
    writeln!(text, "at 500ms expect {never} within {}ms", steps * 20).unwrap();
    let sources = Sources::from(Source::new("lateness", text));
    let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
    let pty = Pty::open().unwrap();
    let port = Serial::open(pty.path(), timeline.baud).unwrap();
    let device = Device::new(Arc::clone(&timeline.board), Settings::default());
    let far = BoardThread::start(Faulty::new(device, Faults::default()), pty, timeline.baud, |_, _| {}).unwrap();
    let guard = start_guard(&timeline, port.descriptor(), realtime);
    let realtime = realtime && Realtime::ask().priority.is_ok();
    let mut session =
        Session::new(Player::new(&timeline, MAX_LATE), port, Signals::catch().unwrap(), Lines::of(&sources));
    (session.guard, session.realtime) = (Some(guard), realtime);
    let mut late = Vec::with_capacity(timeline.events.len());
    let mut reports = 0_u64;
    let start = now();
    far.begin(start);
    session.play(start, |notice| match notice {
        Notice::Sent { late: one, .. } => late.push(one.0),
        Notice::Report(_) => reports += 1,
        _ => {}
    });
    let Session { link, guard, .. } = session;
    guard.into_iter().for_each(Guard::goodbye);
    drop(link);
    assert!(reports > 0 && late.len() as u64 > steps * (last - 1), "{reports} reports, {} frames", late.len());
    let last = late.last().copied().unwrap();
    print(late, last);
}

/// Plays a script for several robots, and prints the skew of frames that are due together.
fn robots(count: u64, frames: u64, step_us: u64, program: &str) {
    let names: Vec<String> = (1..=count).map(|robot| format!("r{robot}")).collect();
    let mut text = if count > 1 { format!("robots {}\n", names.join(", ")) } else { String::new() };
    for frame in 0..frames {
        writeln!(text, "at {}us servo 1 {}", 100_000 + frame * step_us, 1_000 + frame % 2).unwrap();
    }
    let path = std::env::temp_dir().join(format!("motionseq-robots-{}.motion", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let mut play = Command::new(program);
    play.arg("play").arg(&path).args(["-q", "--max-late", "1s"]);
    let mut far = Vec::new();
    for name in &names {
        let pty = Pty::open().unwrap();
        let port = pty.path().display().to_string();
        play.arg("--port").arg(if count > 1 { format!("{name}={port}") } else { port });
        far.push(thread::spawn(move || {
            // When each frame had come.
            let mut stamps = Vec::with_capacity(usize::try_from(frames).unwrap());
            let (mut buffer, mut bytes) = ([0; 4096], 0);
            while let Ok(count @ 1..) = pty.read(&mut buffer) {
                let came = now();
                bytes += count;
                stamps.extend(std::iter::repeat_n(came, bytes / FRAME - stamps.len()));
            }
            stamps
        }));
    }
    let status = play.status().unwrap();
    assert!(status.success(), "{status}");
    let stamps: Vec<Vec<Nanos>> = far.into_iter().map(|far| far.join().unwrap()).collect();
    std::fs::remove_file(path).unwrap();
    let mut skews = Vec::new();
    let mut late = vec![0_u64; stamps.len()];
    for frame in 0..usize::try_from(frames).unwrap() {
        let group: Vec<Nanos> = stamps.iter().map(|stamps| stamps[frame]).collect();
        let first = group.iter().min().unwrap();
        skews.push(group.iter().map(|came| came.0 - first.0).max().unwrap());
        let is_late = |came: &Nanos| came.0 - first.0 > LATE.nanos().0;
        late.iter_mut().zip(&group).for_each(|(late, came)| *late += u64::from(is_late(came)));
    }
    // Against the frame before: a single robot has no other to compare with.
    let steps = stamps.iter().map(|stamps| {
        let own = stamps.iter().zip(0_u64..).map(|(came, frame)| came.0 - frame * step_us * 1_000);
        let first = own.clone().min().unwrap();
        own.filter(|came| came - first > LATE.nanos().0).count()
    });
    let behind = steps.max().unwrap();
    let last = skews.last().copied().unwrap();
    print(skews, last);
    println!("late {} behind {behind}", late.iter().max().unwrap());
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if args.first().is_some_and(|word| word == GUARD) {
        guard(&args[1..]).unwrap();
        return;
    }
    let number = |name: &str, default: u64| {
        let at = args.iter().position(|arg| arg == name);
        at.map_or(default, |at| args[at + 1].parse().unwrap())
    };
    let has = |name: &str| args.iter().any(|arg| arg == name);
    if has("--arm") || has("--raspblock") {
        return servos(has("--arm"), number("--frames", 3_000), has("--realtime"));
    }
    let (frames, step_us) = (number("--frames", 5_000), number("--step-us", 5_000));
    if has("--robots") {
        // A frame of 8 bytes takes 694.4 us on a line with 115200 baud.
        let step_us = if has("--full") { 700 } else { step_us };
        return robots(number("--robots", 2), frames, step_us, args.last().unwrap());
    }

    let mut text = String::new();
    for frame in 0..frames {
        writeln!(text, "at {}us servo 1 {}", frame * step_us, 1_000 + frame % 2).unwrap();
    }
    let sources = Sources::from(Source::new("lateness", text));
    let timeline = motionseq::compile(&sources, &Options::default()).timeline().unwrap();
    let pty = Pty::open().unwrap();
    let port = Serial::open(pty.path(), timeline.baud).unwrap();
    let far = thread::spawn(move || {
        let mut buffer = [0; 4096];
        while pty.read(&mut buffer).is_ok_and(|count| count > 0) {}
    });
    let guard = (!has("--no-guard")).then(|| start_guard(&timeline, port.descriptor(), has("--realtime")));
    let realtime = has("--realtime") && Realtime::ask().priority.is_ok();
    let link = Stamped { port, stamps: Vec::with_capacity(timeline.events.len()) };
    let player = Player::new(&timeline, MAX_LATE);
    let mut session = Session::new(player, link, Signals::catch().unwrap(), Lines::of(&sources));
    (session.guard, session.realtime) = (guard, realtime);
    // Not in the future: the session sends the first frame immediately.
    let start = now();
    let outcome = session.play(start, |_| {});
    let Session { link: Stamped { port, stamps }, guard, .. } = session;
    guard.into_iter().for_each(Guard::goodbye);
    drop(port);
    far.join().unwrap();

    assert_eq!(outcome.sent, timeline.events.len(), "{outcome:?}");
    let due = timeline.events.iter().map(|event| start + event.at.nanos());
    let late: Vec<u64> =
        stamps.iter().zip(due).map(|(stamp, due)| stamp.0.checked_sub(due.0).expect("no frame is early")).collect();
    assert_eq!(late.len(), timeline.events.len());
    let last = late.last().copied().unwrap();
    print(late, last);
}

/// Prints percentiles, and that of the last frame.
fn print(mut late: Vec<u64>, last: u64) {
    late.sort_unstable();
    let percentile = |per_mille: usize| late[(late.len() - 1) * per_mille / 1_000];
    println!(
        "p50 {} p90 {} p99 {} max {} last {last}",
        percentile(500),
        percentile(900),
        percentile(990),
        percentile(1_000)
    );
}
