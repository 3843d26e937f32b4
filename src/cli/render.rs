//! `motionseq render`: prints the frames of a script.

use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motionseq::program::list;
use motionseq::source::{Lines, Sources};
use motionseq::timeline::{Timeline, write_bin, write_hex, write_jsonl, write_listing, write_robot};

use super::Options;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::progress_bar::ProgressBar;
use super::robot_names;
use super::screen::{Screen, Warnings};
use super::selection::{Passes, Selection};

/// Print the frames of a script without sending them
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq render scripts/hello.motion\n  motionseq render scripts/hello.motion --format bin -o hello.bin\n  motionseq render scripts/dance.motion --from refrain --speed 0.5   # from a mark, at half speed\n  motionseq render pair.motion --robot left --format bin -o left.bin        # one of several robots"
)]
pub(super) struct Render {
    /// Script to read, or `-` for standard input
    file: PathBuf,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Listing)]
    format: Format,
    /// Print only the frames of this robot of the script
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
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
        let (sources, timelines) = match compiled {
            Ok((sources, selected)) => (sources, selected.timelines),
            Err(exit) => return exit,
        };
        let timelines = match self.chosen(&timelines) {
            Ok(timelines) => timelines,
            Err(why) => {
                screen.error(&why);
                return Exit::Usage;
            }
        };
        let written = match &self.output {
            None => self.write(&sources, timelines, screen, io::stdout().lock()),
            Some(path) => output::whole(path, &Inputs::of_sources(&sources), self.force).and_then(|mut file| {
                self.write(&sources, timelines, screen, &mut file)?;
                file.finish()
            }),
        };
        output::exit(written, self.output.as_deref(), screen)
    }

    /// The robots whose frames are printed.
    fn chosen<'t>(&self, timelines: &'t [Timeline]) -> Result<&'t [Timeline], String> {
        let chosen = robot_names::chosen(timelines, self.robot.as_deref())?;
        if self.format == Format::Bin && chosen.len() > 1 {
            let names = || chosen.iter().filter_map(|timeline| timeline.robot.as_deref());
            return Err(format!(
                "the bytes of {} go to different ports; choose one of the robots, for example `--robot {}`",
                list(names()),
                names().next().unwrap_or_default()
            ));
        }
        Ok(chosen)
    }

    fn write(&self, sources: &Sources, timelines: &[Timeline], screen: &Screen, out: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(64 * 1024, out);
        let lines = Lines::of(sources);
        let of_one = |timeline: &Timeline| timeline.events.len() + timeline.gates.len();
        // Frames printed on the terminal need no progress bar.
        let is_shown = self.output.is_some() || !io::stdout().is_terminal();
        let progress = is_shown.then(|| ProgressBar::new(screen, "frames", timelines.iter().map(of_one).sum()));
        for timeline in timelines {
            if matches!(self.format, Format::Listing | Format::Hex) {
                write_robot(timeline, &mut out)?;
            }
            let mut items = timeline.items();
            for _ in (0..of_one(timeline)).step_by(CHUNK) {
                let chunk = items.by_ref().take(CHUNK);
                match self.format {
                    Format::Listing => write_listing(timeline, chunk, &mut out)?,
                    Format::Hex => write_hex(&timeline.board, chunk, &mut out)?,
                    Format::Bin => write_bin(&timeline.board, chunk, &mut out)?,
                    Format::Jsonl => write_jsonl(timeline, chunk, &lines, &mut out)?,
                }
                if let Some(progress) = &progress {
                    progress.add(CHUNK);
                }
            }
        }
        out.flush()
    }
}
