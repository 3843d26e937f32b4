//! `motionseq plot`: a picture of what a script does.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use motionseq::plot::{Plot as Plotted, Theme, plot};

use super::Script;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::screen::{Screen, Warnings};
use super::selection::{Passes, Selection};

/// Draw what a script does: when, and where the robot goes
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq plot scripts/dance.motion -o dance.svg\n  motionseq plot scripts/dance.motion -o dance.png --theme dark --width 2400\n  motionseq plot scripts/dance.motion --from spin --to refrain -o spin.html\n  motionseq plot scripts/dance.motion --format json | jq '.tracks[0].lanes[0]'\n\nEach thing that the script uses has a lane: pulse widths with the limits of the board and of the script (dashed), speeds,\nthe buzzer, marks, `say` and `expect`, how busy the line is, and what `check` warns of. Beside them is the way that the\nvirtual board would drive, from above, in its nominal units."
)]
pub(super) struct Plot {
    #[command(flatten)]
    script: Script,
    #[command(flatten)]
    selection: Selection<Passes>,
    /// Write to this file instead of standard output; its ending says the format: .svg, .png, .html or .json
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// What is written [default: what the ending of the file says, or svg]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// The colours; `auto` follows the screen of whoever looks at it, and is light in a PNG
    #[arg(long, value_enum, default_value_t = Colours::Auto)]
    theme: Colours,
    /// How many pixels wide a PNG is, from 300 to 6000
    #[arg(long, value_name = "PIXELS", default_value_t = 1_200, value_parser = clap::value_parser!(u32).range(300..=6_000))]
    width: u32,
    #[command(flatten)]
    force: Force,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A drawing that any browser shows
    Svg,
    /// A picture of pixels
    Png,
    /// A page with the drawing in it
    Html,
    /// The same as data, for plots of your own
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
        let Some(format) = self.format.or_else(|| self.output.as_deref().map_or(Some(Format::Svg), of_ending)) else {
            let name = self.output.as_deref().unwrap_or(Path::new("")).display();
            screen.error(&format!("`{name}` says no format: end it in .svg, .png, .html or .json, or give --format"));
            return Exit::Usage;
        };
        if format == Format::Png && self.output.is_none() && io::stdout().is_terminal() {
            screen.error("a PNG is nothing for a terminal: write it to a file, such as `-o picture.png`");
            return Exit::Usage;
        }
        let compiled = self.selection.compile(&self.script.file, &self.script.options, Warnings::First, screen);
        let (sources, selected) = match compiled {
            Ok(compiled) => compiled,
            Err(exit) => return exit,
        };
        let plotted = plot(&selected.timeline, &sources, &selected.diagnostics);
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
            Format::Html => Ok(plotted.to_html(theme).into_bytes()),
            Format::Json => Ok(plotted.to_json().into_bytes()),
            #[cfg(feature = "png")]
            Format::Png => motionseq::plot::png(plotted, theme, self.width).map_err(|error| error.to_string()),
            #[cfg(not(feature = "png"))]
            Format::Png => {
                Err("this motionseq was built without pixels, the cargo feature `png`; .svg works".to_owned())
            }
        }
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
