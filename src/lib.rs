//! motionseq as a library: scripts with times become the frames of a robot's serial protocol, and a player sends them on time.
//!
//! # From a text to frames
//!
//! [`compile`] takes a script and returns a [`Timeline`], or what is wrong with it. The same text gives the same bytes on every
//! machine.
//!
//! ```
//! use motionseq::program::Options;
//! use motionseq::source::{Memory, Sources};
//! use motionseq::units::Micros;
//!
//! let files = Memory::from([
//!     ("hello.motion", "use \"lib/pose.motion\"\nat 0.5s pose(1500); rocker x=10 z=50\nat 1.5s stop\n"),
//!     ("lib/pose.motion", "def pose(pulse) { servo 1 pulse }\n"),
//! ]);
//! let sources = Sources::read("hello.motion".as_ref(), files)?;
//! let compiled = motionseq::compile(&sources, &Options::default());
//! assert!(compiled.diagnostics.iter().next().is_none());
//! let timeline = compiled.timeline().expect("the script has no errors");
//!
//! let first = &timeline.events[0];
//! assert_eq!(first.at, Micros::from_millis(500));
//! let board = &timeline.board;
//! assert_eq!(board.show(&first.command).to_string(), "servo 1 1500");
//! assert_eq!(board.to_frame(&first.command), [0xFF, 0xFE, 0x02, 0x03, 0x01, 0x05, 0xDC, 0xE7]);
//! # Ok::<(), motionseq::source::SourceError>(())
//! ```
//!
//! | module | what it is for |
//! |---|---|
//! | [`source`] | texts, from the disk ([`source::Disk`]), from memory or from your own [`source::Files`]; places in them, as bytes and as line and column in UTF-8, UTF-16 and characters |
//! | [`diagnostic`] | errors and warnings as data: a code, a place, a message, and a help that shows what to write |
//! | [`syntax`] | a script as a tree, and the formatter |
//! | [`program`] | the options of a compilation, and the tables of the language: commands, settings, units, functions, easings |
//! | [`timeline`] | every frame with its time and its place in the script; parts and passes; listings and snapshots |
//! | [`diff`] | what changed between two timelines, in the words of the script |
//! | [`board`] | what can be sent to a board, as data: its commands, their ranges, its frames and its reports |
//! | [`units`] | microseconds and nanoseconds, read and shown |
//! | [`plot`] | a timeline as a picture |
//! | [`capture`] | the bytes of another program as a listing, or as a script |
//! | [`verify`] | scripts compared with their snapshots, and rehearsed |
//! | [`report`] | results as JSON, `JUnit`, TAP, SARIF and annotations of `GitHub` |
//! | [`sim`] | a virtual board, as a device that knows no clock and no line |
//! | [`faults`] | the same on a line, with what goes wrong there on purpose |
//! | [`playback`] | the player, which knows no clock and no port; on Linux also the loop that drives it, and the guard that stops a robot whose player was killed |
//! | `link`, `serve` | on Linux: serial ports and pseudo-terminals; a board, virtual or real, that other programs open |
//!
//! # Features
//!
//! All of this but `link`, `serve` and the loop of the player builds on every system that Rust's standard library is there for,
//! WebAssembly included, with `default-features = false`. It needs no clock, no port, no thread and no file system: a script that
//! comes from [`source::Memory`] never touches one.
//!
//! | feature | what it adds |
//! |---|---|
//! | `player` | on Linux, `link`, `serve` and the loop of the player |
//! | `png` | pictures as PNG |
//! | `cli`, `mcap` | the program `motionseq`, and its logs |
//!
//! `examples/compile.rs` compiles a script in memory, `examples/play.rs` plays one on a robot, and `examples/wasm.rs` is the compiler
//! for web pages.

pub mod board;
pub mod capture;
#[cfg(all(feature = "player", target_os = "linux"))]
mod clock;
pub mod diagnostic;
pub mod diff;
pub mod faults;
#[cfg(all(feature = "player", target_os = "linux"))]
pub mod link;
pub mod playback;
pub mod plot;
pub mod program;
mod random;
pub mod report;
#[cfg(all(feature = "player", target_os = "linux"))]
pub mod serve;
pub mod sim;
pub mod source;
pub mod syntax;
pub mod timeline;
pub mod units;
pub mod verify;

use diagnostic::{Diagnostics, report};
use program::{Options, Time};
use source::{Sources, Span};
use timeline::Timeline;

/// What became of a script.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// What each robot does, in the order of `robots`, and one timeline where the script names no robots; empty where there is any
    /// error.
    pub timelines: Vec<Timeline>,
    /// Its errors and warnings.
    pub diagnostics: Diagnostics,
}

impl Compiled {
    /// The timeline of a script for one robot; `None` where there is any error, or where there are several robots.
    pub fn timeline(self) -> Option<Timeline> {
        <[Timeline; 1]>::try_from(self.timelines).ok().map(|[timeline]| timeline)
    }
}

/// Compiles a script: the same text gives the same bytes on every machine. Files that it uses are read on the way, and are
/// in `sources` afterwards: use new ones for each compilation.
pub fn compile(sources: &Sources, options: &Options) -> Compiled {
    let mut diagnostics = Diagnostics::default();
    let mut timelines = stages(sources, options, &mut diagnostics);
    if diagnostics.has_errors() {
        timelines.clear();
    }
    Compiled { timelines, diagnostics }
}

fn stages(sources: &Sources, options: &Options, diagnostics: &mut Diagnostics) -> Vec<Timeline> {
    let Some(script) = syntax::read(sources.main(), diagnostics) else { return Vec::new() };
    let mut programs = program::programs(script, sources, options, diagnostics);
    let is_correct = !diagnostics.has_errors();
    if is_correct {
        programs = programs.into_iter().map(|program| program.at_speed(options.speed)).collect();
        if programs.iter().any(|program| program.end > Time::LONGEST) {
            report!(diagnostics, TooLong, Span::new(0, 0), "at this speed the script is longer than 24 hours";
                help: "play it faster, or only a part of it; a script is at most 24 hours long");
            return Vec::new();
        }
    }
    // All errors at once, but none that is only there because something else is missing.
    for program in programs.iter_mut().filter(|program| is_correct || program.times_known) {
        timeline::order(program, sources, diagnostics);
    }
    if !is_correct {
        return Vec::new();
    }
    timeline::timelines(programs, options.events, diagnostics)
}
