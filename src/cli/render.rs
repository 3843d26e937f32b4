//! `motionseq render`: prints the frames of a script.

use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motionseq::source::{Lines, Sources};
use motionseq::timeline::{Timeline, write_bin, write_hex, write_jsonl, write_listing};

use super::Options;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::progress_bar::ProgressBar;
use super::screen::{Screen, Warnings};
use super::selection::{Passes, Selection};

/// Print the frames of a script without sending them
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq render scripts/hello.motion\n  motionseq render scripts/hello.motion --format bin -o hello.bin\n  motionseq render scripts/dance.motion --from refrain --speed 0.5   # from a mark, at half speed"
)]
pub(super) struct Render {
    /// Script to read, or `-` for standard input
    file: PathBuf,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Listing)]
    format: Format,
    /// Write to FILE instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    selection: Selection<Passes>,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Time in seconds, frame and command, separated by tabs
    Listing,
    /// Time in seconds and frame, separated by a tab
    Hex,
    /// The bytes of the frames
    Bin,
    /// One JSON object per line, with the line of the script
    Jsonl,
}

/// How many frames are written between two updates of the progress bar.
const CHUNK: usize = 16_384;

impl Render {
    /// Compiles the script and writes its frames.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let compiled = self.selection.compile(&self.file, &self.options, Warnings::First, screen);
        let (sources, timeline) = match compiled {
            Ok((sources, selected)) => (sources, selected.timelines.into_iter().next()),
            Err(exit) => return exit,
        };
        let Some(timeline) = timeline else { return Exit::Script };
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
        let (board, count) = (&timeline.board, timeline.events.len() + timeline.gates.len());
        // Frames printed on the terminal need no progress bar.
        let is_shown = self.output.is_some() || !io::stdout().is_terminal();
        let progress = is_shown.then(|| ProgressBar::new(screen, "frames", count));
        let mut items = timeline.items();
        for _ in (0..count).step_by(CHUNK) {
            let chunk = items.by_ref().take(CHUNK);
            match self.format {
                Format::Listing => write_listing(timeline, chunk, &mut out)?,
                Format::Hex => write_hex(board, chunk, &mut out)?,
                Format::Bin => write_bin(board, chunk, &mut out)?,
                Format::Jsonl => write_jsonl(timeline, chunk, &lines, &mut out)?,
            }
            if let Some(progress) = &progress {
                progress.add(CHUNK);
            }
        }
        out.flush()
    }
}
