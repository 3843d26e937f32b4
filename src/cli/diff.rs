//! `motionseq diff`: shows what changed between two scripts or snapshots.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::board::raspblock;
use motionseq::diff::{Change, diff, diff_scripts};
use motionseq::source::{Disk, Lines, Sources, read_file};
use motionseq::timeline::{Note, Snapshot, Timeline, is_snapshot, read_snapshot};
use motionseq::verify::{SNAPSHOT, shell_word};

use super::exit::Exit;
use super::output;
use super::screen::{Screen, plural};
use super::{Options, read};

/// Show what changed between two scripts or snapshots
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq diff old.motion new.motion\n  motionseq diff dance.motion.frames dance.motion   # what changed since the snapshot\n\nThe exit code is 1 if the two differ. Two scripts are also compared by their `mark`, `say` and `expect`, which a snapshot does not\ncontain. The first 50 changes and the totals are shown; `-v` shows all."
)]
pub(super) struct Diff {
    /// Old script or snapshot (NAME.motion.frames), or `-` for standard input
    old: PathBuf,
    /// New script or snapshot
    new: PathBuf,
    #[command(flatten)]
    options: Options,
}

/// How many changes are shown without `-v`.
const SHOWN: usize = 50;

/// One side of a comparison.
struct Side {
    sent: Snapshot,
    /// The script, unless it is a snapshot.
    script: Option<(Sources, Timeline)>,
}

impl Diff {
    /// Compares, and prints the changes.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        if self.old.as_os_str() == "-" && self.new.as_os_str() == "-" {
            screen.error("standard input can be read only once: write a file name for one of the two");
            return Exit::Usage;
        }
        match (self.side(&self.old, screen), self.side(&self.new, screen)) {
            (Ok(old), Ok(new)) => compare(&old, &new, screen),
            (Err(exit), _) | (_, Err(exit)) => exit,
        }
    }

    fn side(&self, path: &Path, screen: &Screen) -> Result<Side, Exit> {
        // A file named like a snapshot is one, even if its content is damaged.
        if let Some(script) = path.to_string_lossy().strip_suffix(SNAPSHOT) {
            let text = read_file(path, 2 << 30).map_err(|error| {
                screen.error(&format!("cannot read {}: {error}", path.display()));
                Exit::Script
            })?;
            return snapshot(&path.display().to_string(), &text, Some(script), screen);
        }
        let source = read(path, screen)?;
        if is_snapshot(source.text().as_bytes()) {
            return snapshot(source.name(), source.text().as_bytes(), None, screen);
        }
        let sources = Sources::new(source, Disk);
        let timeline = self.options.compile(&sources, screen)?.timeline.ok_or(Exit::Script)?;
        let sent = Snapshot::of(&timeline);
        Ok(Side { sent, script: Some((sources, timeline)) })
    }
}

fn snapshot(name: &str, text: &[u8], script: Option<&str>, screen: &Screen) -> Result<Side, Exit> {
    let sent = read_snapshot(&raspblock::board(), text).map_err(|error| {
        let fix = script.map(|script| format!("; write it again with `motionseq test --bless {}`", shell_word(script)));
        screen.error(&format!("{name} is not a snapshot: {error}{}", fix.unwrap_or_default()));
        Exit::Script
    })?;
    Ok(Side { sent, script: None })
}

fn compare(old: &Side, new: &Side, screen: &Screen) -> Exit {
    let (was, is) = (old.places(), new.places());
    let line = |change: &Change| {
        let place = change.new.and_then(|at| is(change.aborts, at, false));
        let place = place.or_else(|| change.old.and_then(|at| was(change.aborts, at, false)));
        place.map(|place| (place, change.new.is_some()))
    };
    let changes = match (&old.script, &new.script) {
        (Some((_, old)), Some((_, new))) => diff_scripts(old, new, line),
        _ => diff(&old.sent, &new.sent, line),
    };
    if changes.is_empty() {
        screen.note(&format!("no difference: both send the same {}", plural(new.sent.moments.len(), "frame")));
        return Exit::Ok;
    }
    let (totals, listed): (Vec<&Change>, Vec<&Change>) = changes.iter().partition(|change| change.what.is_total());
    let shown = if screen.is_verbose() { listed.len() } else { SHOWN };
    let mut out = io::stdout().lock();
    let written = listed.iter().take(shown).chain(&totals).try_for_each(|change| {
        let place = change.new.and_then(|at| is(change.aborts, at, true));
        let place = place.or_else(|| change.old.and_then(|at| was(change.aborts, at, true)));
        writeln!(out, "{}", change.words(place.as_deref()))
    });
    if let Some(more) = listed.len().checked_sub(shown).filter(|more| *more > 0) {
        screen.note(&format!("{}; `-v` shows all", plural(more, "more change")));
    }
    match output::exit(written, None, screen) {
        Exit::Ok => Exit::Script,
        failed => failed,
    }
}

impl Side {
    /// Returns the line that a frame or a note comes from and, for a frame, if asked, the calls and passes that led there.
    fn places(&self) -> impl Fn(bool, usize, bool) -> Option<String> {
        let script = self.script.as_ref().map(|(sources, timeline)| {
            let notes: [Vec<Note>; 2] = [false, true].map(|aborts| timeline.notes(aborts));
            (sources, timeline, Lines::of(sources), notes)
        });
        move |aborts, at, way| {
            let (sources, timeline, lines, notes) = script.as_ref()?;
            let events = timeline.frames(aborts);
            let Some(event) = events.get(at) else {
                let [run, abort] = notes;
                let note = (if aborts { abort } else { run }).get(at - events.len())?;
                return Some(lines.place(note.span).to_string());
            };
            Some(if way { timeline.origin(event, sources, lines) } else { lines.place(event.span).to_string() })
        }
    }
}
