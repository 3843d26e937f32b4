//! A scriptable motion sequencer for the Yahboom Raspblock: timed scripts in, exact frames out.
//!
//! Data flows one way: **text → syntax → program → timeline → playback → link**.
//!
//! - [`source`] holds a script's text, [`diagnostic`] what is wrong with it.
//! - [`syntax`] reads text into a tree; [`program`] gives its words meaning and its commands exact times; [`timeline`] lays
//!   them out as sorted frames in whole microseconds.
//! - [`board`] is what can be said to a board, as a table, and the frames that carry it. It knows neither times nor ports.
//!
//! ```
//! use motionseq::source::Source;
//! use motionseq::units::Micros;
//!
//! let source = Source::new("hello.motion", "at 0.5s servo 1 1500; rocker x=10 z=50\nat 1.5s stop\n");
//! let compiled = motionseq::compile(&source.into(), &motionseq::program::Options::default());
//! let timeline = compiled.timeline.expect("the script has no errors");
//!
//! let first = &timeline.events()[0];
//! assert_eq!(first.at, Micros(500_000));
//! let board = &timeline.board;
//! assert_eq!(board.show(&first.command).to_string(), "servo 1 1500");
//! assert_eq!(board.to_frame(&first.command), [0xFF, 0xFE, 0x02, 0x03, 0x01, 0x05, 0xDC, 0xE7]);
//! ```

pub mod board;
pub mod capture;
#[cfg(all(feature = "player", target_os = "linux"))]
mod clock;
pub mod diagnostic;
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

use diagnostic::{Code, Diagnostic, Diagnostics};
use program::{Options, Time};
use source::{Sources, Span};
use timeline::Timeline;

/// What became of a script.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// Its timeline; `None` where there is any error.
    pub timeline: Option<Timeline>,
    /// Its errors and warnings.
    pub diagnostics: Diagnostics,
}

/// Compiles a script: the same text gives the same bytes on every machine. Files that it uses are read on the way, and are
/// in `sources` afterwards.
pub fn compile(sources: &Sources, options: &Options) -> Compiled {
    let mut diagnostics = Diagnostics::default();
    let timeline = stages(sources, options, &mut diagnostics);
    Compiled { timeline: timeline.filter(|_| !diagnostics.has_errors()), diagnostics }
}

fn stages(sources: &Sources, options: &Options, diagnostics: &mut Diagnostics) -> Option<Timeline> {
    let script = syntax::read(sources.main(), diagnostics)?;
    let mut program = program::program(script, sources, options, diagnostics);
    if !diagnostics.has_errors() {
        let program = program.at_speed(options.speed);
        if program.end > Time::LONGEST {
            let help = "play it faster, or only a part of it; a script is at most 24 hours long";
            let message = "at this speed the script is longer than 24 hours";
            diagnostics.push(Diagnostic::new(Code::TooLong, Span::new(0, 0), message, help));
            return None;
        }
        return Some(timeline::timeline(program, options.events, diagnostics));
    }
    // All errors at once, but none that is only there because something else is missing.
    if program.times_known {
        timeline::order(&mut program, diagnostics);
    }
    None
}
