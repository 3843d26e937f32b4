//! `motionseq plot`: draws the timeline of a script.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::slice;

use clap::{Args, ValueEnum};
use motionseq::plot::{Plot as Plotted, Theme, plot};

use super::Options;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::robot_names;
use super::screen::{Screen, Warnings};
use super::selection::{Passes, Selection};
use super::watch::Watch;

/// Draw the timeline of a script and the path of the robot
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq plot scripts/dance.motion -o dance.svg\n  motionseq plot scripts/dance.motion -o dance.png --theme dark --width 2400\n  motionseq plot scripts/dance.motion -o spin.html --from spin --to refrain\n  motionseq plot scripts/dance.motion -o dance.html --watch   # again after each change; the page reloads itself\n  motionseq plot scripts/duet.motion -o left.svg --robot left   # one of several robots\n  motionseq plot scripts/dance.motion --format json | jq '.tracks[0].lanes[0]'\n\nThe picture has one lane for each value that the script sets, and lanes for marks, `say`, `expect`, the load of the serial line\nand warnings. Dashed lines are the limits of the script. The path of a Raspblock is seen from above, in nominal units."
)]
pub(super) struct Plot {
    /// Script to read, or `-` for standard input
    file: PathBuf,
    /// Write to FILE instead of standard output; the extension sets the format
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Output format [default: from the extension of FILE, or svg]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Colors; `auto` follows the viewer's settings, and is light in a PNG
    #[arg(long, value_enum, default_value_t = Colours::Auto)]
    theme: Colours,
    /// Width of a PNG in pixels, from 300 to 6000
    #[arg(long, value_name = "PIXELS", default_value_t = 1_200, value_parser = clap::value_parser!(u32).range(300..=6_000))]
    width: u32,
    /// Draw only this robot of the script
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    #[command(flatten)]
    watch: Watch,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    selection: Selection<Passes>,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Vector graphics
    Svg,
    /// Bitmap
    Png,
    /// Self-contained web page
    Html,
    /// The data of the picture, for your own plots
    Json,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Colours {
    Auto,
    Light,
    Dark,
}

impl Plot {
    /// Compiles the script and draws it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        if self.watch.watch && self.output.is_none() {
            screen.error("`--watch` draws the same file again; write its name: `-o picture.svg`");
            return Exit::Usage;
        }
        self.watch.run(slice::from_ref(&self.file), &self.options, screen, |_| self.run_once(screen))
    }

    fn run_once(&self, screen: &Screen) -> Exit {
        let Some(format) = self.format.or_else(|| self.output.as_deref().map_or(Some(Format::Svg), of_ending)) else {
            let name = self.output.as_deref().unwrap_or(Path::new("")).display();
            screen.error(&format!(
                "unknown extension of `{name}`; use .svg, .png, .html or .json, or add `--format svg`"
            ));
            return Exit::Usage;
        };
        if format == Format::Png && self.output.is_none() && io::stdout().is_terminal() {
            screen.error("a PNG cannot be shown on a terminal; write it to a file: `-o picture.png`");
            return Exit::Usage;
        }
        let compiled = self.selection.compile(&self.file, &self.options, Warnings::First, screen);
        let (sources, selected) = match compiled {
            Ok(compiled) => compiled,
            Err(exit) => return exit,
        };
        let timelines = match robot_names::chosen(&selected.timelines, self.robot.as_deref()) {
            Ok(timelines) => timelines,
            Err(why) => {
                screen.error(&why);
                return Exit::Usage;
            }
        };
        let plotted = plot(timelines, &sources, &selected.diagnostics);
        let picture = match self.picture(&plotted, format) {
            Ok(picture) => picture,
            Err(why) => {
                screen.error(&why);
                return Exit::Failed;
            }
        };
        let written = match &self.output {
            None => io::stdout().lock().write_all(&picture),
            Some(path) => output::whole(path, &Inputs::of_sources(&sources), self.force).and_then(|mut file| {
                file.write_all(&picture)?;
                file.finish()
            }),
        };
        output::exit(written, self.output.as_deref(), screen)
    }

    fn picture(&self, plotted: &Plotted, format: Format) -> Result<Vec<u8>, String> {
        let theme = match self.theme {
            Colours::Auto => Theme::Auto,
            Colours::Light => Theme::Light,
            Colours::Dark => Theme::Dark,
        };
        match format {
            Format::Svg => Ok(plotted.to_svg(theme).into_bytes()),
            Format::Html => Ok(self.page(plotted.to_html(theme)).into_bytes()),
            Format::Json => Ok(plotted.to_json().into_bytes()),
            #[cfg(feature = "png")]
            Format::Png => motionseq::plot::png(plotted, theme, self.width).map_err(|error| error.to_string()),
            #[cfg(not(feature = "png"))]
            Format::Png => {
                Err("this motionseq was built without the cargo feature `png`; write an SVG: `-o picture.svg`"
                    .to_owned())
            }
        }
    }
}

impl Plot {
    /// A page that loads itself again while its file is watched.
    fn page(&self, page: String) -> String {
        let (charset, refresh) = ("<meta charset=\"utf-8\">", "<meta http-equiv=\"refresh\" content=\"1\">");
        if self.watch.watch { page.replacen(charset, &format!("{charset}\n{refresh}"), 1) } else { page }
    }
}

fn of_ending(path: &Path) -> Option<Format> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    Some(match ending.as_str() {
        "svg" => Format::Svg,
        "png" => Format::Png,
        "html" | "htm" => Format::Html,
        "json" => Format::Json,
        _ => return None,
    })
}
