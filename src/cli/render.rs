//! `motionseq render`: what would be sent, without sending it.

use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motionseq::source::{Lines, Sources};
use motionseq::timeline::{Timeline, write_bin, write_hex, write_jsonl, write_listing};

use super::Script;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::progress_bar::ProgressBar;
use super::screen::{Screen, Warnings};
use super::selection::{Passes, Selection};

/// Print the frames that a script sends, without sending them
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq render scripts/hello.motion\n  motionseq render scripts/hello.motion --format bin -o hello.bin\n  motionseq render show.motion --from bow --to 20s --speed 0.5 --loop 2"
)]
pub(super) struct Render {
    #[command(flatten)]
    script: Script,
    #[command(flatten)]
    selection: Selection<Passes>,
    /// How frames are written
    #[arg(long, value_enum, default_value_t = Format::Listing)]
    format: Format,
    /// Write to this file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Seconds, frame and command, separated by TABs
    Listing,
    /// Seconds and frame, separated by a TAB
    Hex,
    /// The bytes, one frame after another
    Bin,
    /// One JSON object a line, with the place in the script
    Jsonl,
}

/// How many frames are written between two looks at the clock.
const CHUNK: usize = 16_384;

impl Render {
    /// Compiles the script and writes its frames.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let compiled = self.selection.compile(&self.script.file, &self.script.options, Warnings::First, screen);
        let (sources, timeline) = match compiled {
            Ok((sources, selected)) => (sources, selected.timeline),
            Err(exit) => return exit,
        };
        let written = match &self.output {
            None => self.write(&sources, &timeline, screen, io::stdout().lock()),
            Some(path) => output::whole(path, &Inputs::of_sources(&sources), self.force).and_then(|mut file| {
                self.write(&sources, &timeline, screen, &mut file)?;
                file.finish()
            }),
        };
        output::exit(written, self.output.as_deref(), screen)
    }

    fn write(&self, sources: &Sources, timeline: &Timeline, screen: &Screen, out: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(64 * 1024, out);
        let lines = Lines::of(sources);
        let frames = timeline.events.len();
        // Frames that are printed on the terminal show themselves how far it is.
        let is_shown = self.output.is_some() || !io::stdout().is_terminal();
        let progress = is_shown.then(|| ProgressBar::new(screen, "frames", frames));
        for events in timeline.events.chunks(CHUNK) {
            match self.format {
                Format::Listing => write_listing(&timeline.board, events, &mut out)?,
                Format::Hex => write_hex(&timeline.board, events, &mut out)?,
                Format::Bin => write_bin(&timeline.board, events, &mut out)?,
                Format::Jsonl => write_jsonl(&timeline.board, events, &lines, &mut out)?,
            }
            if let Some(progress) = &progress {
                progress.add(events.len());
            }
        }
        out.flush()
    }
}
