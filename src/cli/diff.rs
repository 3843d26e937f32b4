//! `motionseq diff`: what has changed between two scripts or snapshots.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::source::{Lines, Sources};
use motionseq::timeline::{Moment, Timeline, diff, is_snapshot, read_snapshot};

use super::exit::Exit;
use super::output;
use super::screen::{Screen, plural};
use super::{Options, read};

/// Show what has changed between two scripts or snapshots, in the words of the script
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq diff old.motion new.motion\n  motionseq diff dance.motion.frames dance.motion\n\nExit code 1 means that they differ. At most 50 changes are shown; -v shows all."
)]
pub(super) struct Diff {
    /// What it was: a script, or a snapshot (`NAME.motion.frames`)
    old: PathBuf,
    /// What it is
    new: PathBuf,
    #[command(flatten)]
    options: Options,
}

/// How many changes are shown without `-v`.
const SHOWN: usize = 50;

/// One side of a comparison.
struct Side {
    moments: Vec<Moment>,
    /// The script, where it is one.
    script: Option<(Sources, Timeline)>,
}

impl Diff {
    /// Compares, and prints the changes.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match (self.side(&self.old, screen), self.side(&self.new, screen)) {
            (Ok(old), Ok(new)) => compare(&old, &new, screen),
            (Err(exit), _) | (_, Err(exit)) => exit,
        }
    }

    fn side(&self, path: &Path, screen: &Screen) -> Result<Side, Exit> {
        let source = read(path, screen)?;
        if is_snapshot(source.text().as_bytes()) {
            let moments = read_snapshot(source.text().as_bytes()).map_err(|error| {
                screen.error(&format!("{} is no snapshot: {error}", source.name()));
                Exit::Script
            })?;
            return Ok(Side { moments, script: None });
        }
        let sources = Sources::from(source);
        let timeline = self.options.compile(&sources, screen, false).timeline.ok_or(Exit::Script)?;
        let moments = timeline.events().iter().map(Moment::from).collect();
        Ok(Side { moments, script: Some((sources, timeline)) })
    }
}

fn compare(old: &Side, new: &Side, screen: &Screen) -> Exit {
    let changes = diff(&old.moments, &new.moments).changes;
    if changes.is_empty() {
        screen.note(&format!("both send the same {}", plural(new.moments.len(), "frame")));
        return Exit::Ok;
    }
    let (old, new) = (old.origins(), new.origins());
    let shown = if screen.is_verbose() { changes.len() } else { SHOWN };
    let mut out = io::stdout().lock();
    let written = changes.iter().take(shown).try_for_each(|change| {
        let place = change.new.and_then(&new).or_else(|| change.old.and_then(&old));
        writeln!(out, "{}", change.words(place.as_deref()))
    });
    if let Some(more) = changes.len().checked_sub(shown).filter(|more| *more > 0) {
        screen.note(&format!("{} more; -v shows them", plural(more, "change")));
    }
    match output::exit(written, None, screen) {
        Exit::Ok => Exit::Script,
        failed => failed,
    }
}

impl Side {
    /// Says where a frame comes from.
    fn origins(&self) -> impl Fn(usize) -> Option<String> {
        let script = self.script.as_ref().map(|(sources, timeline)| (sources, timeline, Lines::of(sources)));
        move |at| {
            let (sources, timeline, lines) = script.as_ref()?;
            Some(timeline.origin(timeline.events().get(at)?, sources, lines))
        }
    }
}
