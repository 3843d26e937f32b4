//! `motionseq diff`: shows what changed between two scripts or snapshots.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use motionseq::diff::{Change, Words, diff_all, diff_all_scripts};
use motionseq::program::list;
use motionseq::report::json::{self, LocatedChange};
use motionseq::source::{Disk, Lines, Place, Sources, read_file};
use motionseq::timeline::{Note, Snapshot, Timeline, gate_notes, is_snapshot, read_snapshots};
use motionseq::verify::{SNAPSHOT, shell_word};

use super::color::painted;
use super::exit::Exit;
use super::family;
use super::output::{self, Format};
use super::screen::{Screen, plural};
use super::{Options, read};

/// Show what changed between two scripts or snapshots
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq diff old.motion new.motion\n  motionseq diff dance.motion.frames dance.motion   # what changed since the snapshot\n  motionseq diff --format json old.motion new.motion\n\nThe exit code is 1 if the two differ. Two scripts are also compared by their `mark`, `say` and `expect`, which a snapshot does not\ncontain. The first 50 changes and the totals are shown; `-v` shows all."
)]
pub(super) struct Diff {
    /// Old script or snapshot (NAME.motion.frames), or `-` for standard input
    old: PathBuf,
    /// New script or snapshot
    new: PathBuf,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
    #[command(flatten)]
    options: Options,
}

/// How many changes are shown without `-v`.
const SHOWN: usize = 50;

/// One side of a comparison.
struct Side {
    /// What each robot sends.
    sent: Vec<Snapshot>,
    /// The script, unless it is a snapshot.
    script: Option<(Sources, Vec<Timeline>)>,
}

impl Diff {
    /// Compares, and prints the changes.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        if self.old.as_os_str() == "-" && self.new.as_os_str() == "-" {
            screen.error("standard input can be read only once: write a file name for one of the two");
            return Exit::Usage;
        }
        match (self.side(&self.old, &self.new, screen), self.side(&self.new, &self.old, screen)) {
            (Ok(old), Ok(new)) => match differences(&old.sent, &new.sent) {
                None => self.compare(&old, &new, screen),
                Some(why) => {
                    let [old, new] = [&self.old, &self.new].map(|path| path.display());
                    screen.error(&format!("{old} and {new} cannot be compared: {why}"));
                    Exit::Script
                }
            },
            (Err(exit), _) | (_, Err(exit)) => exit,
        }
    }

    /// Reads one side. A snapshot on standard input names files as if it were in the folder of the other side.
    fn side(&self, path: &Path, other: &Path, screen: &Screen) -> Result<Side, Exit> {
        // A file named like a snapshot is one, even if its content is damaged.
        if let Some(script) = path.to_string_lossy().strip_suffix(SNAPSHOT) {
            let text = read_file(path, 2 << 30).map_err(|error| {
                screen.error(&format!("cannot read {}: {error}", path.display()));
                Exit::Script
            })?;
            return snapshot((&path.display().to_string(), path), &text, Some(script), screen);
        }
        let source = read(path, screen)?;
        if is_snapshot(source.text().as_bytes()) {
            let from = source.path().unwrap_or(other);
            return snapshot((source.name(), from), source.text().as_bytes(), None, screen);
        }
        let sources = Sources::new(source, Disk);
        let timelines = self.options.compile(&sources, screen)?.timelines;
        if timelines.is_empty() {
            return Err(Exit::Script);
        }
        let sent = timelines.iter().map(Snapshot::of).collect();
        Ok(Side { sent, script: Some((sources, timelines)) })
    }

    fn compare(&self, old: &Side, new: &Side, screen: &Screen) -> Exit {
        let has_notes = old.script.is_some() && new.script.is_some();
        let (was, is) = (Lookup::of(old, has_notes), Lookup::of(new, has_notes));
        let old_place = |change: &Change| was.as_ref()?.place(change, change.old?);
        let new_place = |change: &Change| is.as_ref()?.place(change, change.new?);
        let line = |change: &Change| {
            let place = new_place(change).or_else(|| old_place(change))?;
            Some((place.file, place.line, change.new.is_some()))
        };
        let changes = match (&old.script, &new.script) {
            (Some((_, old)), Some((_, new))) => diff_all_scripts(old, new, line),
            _ => diff_all(&old.sent, &new.sent, line),
        };
        let words = |change: &Change| {
            let origin = change.new.and_then(|at| is.as_ref()?.origin(change, at));
            let origin = origin.or_else(|| change.old.and_then(|at| was.as_ref()?.origin(change, at)));
            change.parts(origin.as_deref())
        };
        let written = if self.format == Format::Json {
            let located = |change| LocatedChange {
                change,
                old: old_place(change),
                new: new_place(change),
                message: words(change).to_string(),
            };
            let names = [&self.old, &self.new].map(|path| path.to_string_lossy());
            let text = json::changes([&names[0], &names[1]], &changes.iter().map(located).collect::<Vec<_>>());
            io::stdout().lock().write_all(text.as_bytes())
        } else if changes.is_empty() {
            let frames = plural(new.sent.iter().map(|sent| sent.moments.len()).sum(), "frame");
            screen.note(&format!("no difference: both send the same {frames}"));
            Ok(())
        } else {
            print(&changes, words, screen)
        };
        match output::exit(written, None, screen) {
            Exit::Ok if !changes.is_empty() => Exit::Script,
            exit => exit,
        }
    }
}

/// Reads a snapshot, by its name in messages and the path that the files it names are relative to.
fn snapshot((name, from): (&str, &Path), text: &[u8], script: Option<&str>, screen: &Screen) -> Result<Side, Exit> {
    let robots = family::robots_of_snapshot(name, from, text, screen)?;
    let sent = read_snapshots(&robots, text).map_err(|error| {
        let fix = script.map(|script| format!("; write it again with `motionseq test --bless {}`", shell_word(script)));
        screen.error(&format!("{name} is not a snapshot: {error}{}", fix.unwrap_or_default()));
        Exit::Script
    })?;
    Ok(Side { sent, script: None })
}

/// Why two sides cannot be compared: only one of them names robots, or a robot has different boards.
fn differences(old: &[Snapshot], new: &[Snapshot]) -> Option<String> {
    let names = |side: &'_ [Snapshot]| {
        let names: Vec<&str> = side.iter().filter_map(|robot| robot.robot.as_deref()).collect();
        if names.is_empty() { "no robots".to_owned() } else { list(names) }
    };
    let is_named = |side: &[Snapshot]| side.iter().any(|robot| robot.robot.is_some());
    if is_named(old) != is_named(new) {
        return Some(format!("one names {}, the other {}", names(old), names(new)));
    }
    let mut pairs = old.iter().filter_map(|was| Some((was, new.iter().find(|is| is.robot == was.robot)?)));
    pairs.find_map(|(was, is)| Some((was, difference(was, is)?))).map(|(was, why)| match &was.robot {
        Some(robot) => format!("of the robot `{robot}`, {why}"),
        None => why,
    })
}

/// Why two sides are for different boards; `None` if every command means the same on both.
fn difference(old: &Snapshot, new: &Snapshot) -> Option<String> {
    let (was, is) = (&old.board, &new.board);
    let sends_the_same = |side: &Snapshot| {
        let abort = side.more.iter().flat_map(|more| &more.abort);
        side.moments.iter().chain(abort).all(|moment| was.to_frame(&moment.command) == is.to_frame(&moment.command))
    };
    let has_same_table = (&was.name, &was.resources, &was.verbs) == (&is.name, &is.resources, &is.verbs);
    if Arc::ptr_eq(was, is) || has_same_table && sends_the_same(old) && sends_the_same(new) {
        return None;
    }
    Some(if was.line == is.line {
        format!("the file of the board `{}` is not the same for both", is.line)
    } else {
        format!("one is for the board `{}`, the other for `{}`", was.line, is.line)
    })
}

/// Prints the first changes and the totals, or with `-v` all.
fn print(changes: &[Change], words: impl Fn(&Change) -> Words, screen: &Screen) -> io::Result<()> {
    let (totals, listed): (Vec<&Change>, Vec<&Change>) = changes.iter().partition(|change| change.what.is_total());
    let shown = if screen.is_verbose() { listed.len() } else { SHOWN };
    let mut out = io::stdout().lock();
    for change in listed.iter().take(shown).chain(&totals) {
        writeln!(out, "{}", painted(&words(change), screen.colors_results()))?;
    }
    if let Some(more) = listed.len().checked_sub(shown).filter(|more| *more > 0) {
        screen.note(&format!("{}; `-v` shows all", plural(more, "more change")));
    }
    Ok(())
}

/// Finds the lines of one side.
struct Lookup<'s> {
    sources: &'s Sources,
    lines: Lines<'s>,
    robots: Vec<Robot<'s>>,
}

/// What one robot does.
struct Robot<'s> {
    timeline: &'s Timeline,
    /// The notes of the run and of `on abort`.
    notes: [Vec<Note>; 2],
}

impl<'s> Lookup<'s> {
    /// `None` for a snapshot, which has no lines. Without `has_notes`, gates are the only notes.
    fn of(side: &'s Side, has_notes: bool) -> Option<Self> {
        let (sources, timelines) = side.script.as_ref()?;
        let robot = |timeline: &'s Timeline| {
            let notes = if has_notes {
                [false, true].map(|aborts| timeline.notes(aborts))
            } else {
                [gate_notes(&timeline.gates), Vec::new()]
            };
            Robot { timeline, notes }
        };
        Some(Lookup { sources, lines: Lines::of(sources), robots: timelines.iter().map(robot).collect() })
    }

    /// The first robot of a change.
    fn robot(&self, change: &Change) -> Option<&Robot<'s>> {
        self.robots.iter().find(|robot| robot.timeline.robot.as_ref() == change.robots.first())
    }

    /// The line that a frame or a note of a change comes from.
    fn place(&self, change: &Change, at: usize) -> Option<Place<'s>> {
        let robot = self.robot(change)?;
        let events = robot.timeline.frames(change.aborts);
        let span = match events.get(at) {
            Some(event) => event.span,
            None => {
                let [run, abort] = &robot.notes;
                (if change.aborts { abort } else { run }).get(at - events.len())?.span
            }
        };
        Some(self.lines.place(span))
    }

    /// This line and, for a frame, the calls and passes that led there.
    fn origin(&self, change: &Change, at: usize) -> Option<String> {
        let timeline = self.robot(change)?.timeline;
        match timeline.frames(change.aborts).get(at) {
            Some(event) => Some(timeline.origin(event, self.sources, &self.lines)),
            None => Some(self.place(change, at)?.to_string()),
        }
    }
}
