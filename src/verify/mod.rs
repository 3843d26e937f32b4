//! Tests scripts: compiles them, compares them with their snapshots, plays them, and returns the results. Prints nothing.

mod answers;
mod play;
mod rehearse;

use std::borrow::Borrow;
use std::io;
use std::path::{Path, PathBuf};

use crate::diagnostic::{Code, Denied, Diagnostic, Diagnostics};
use crate::diff::{Change, Words, diff_all};
use crate::faults::Faults;
use crate::program::Options;
use crate::source::{Disk, Lines, Source, Sources, read_file};
use crate::timeline::{NamedBoard, Snapshot, Timeline, read_snapshots, write_snapshot};
use crate::units::Micros;

pub use answers::Answers;
pub use rehearse::{Rehearsal, rehearse, rehearse_together};

/// The extension that makes the name of a snapshot from the name of its script.
pub const SNAPSHOT: &str = ".frames";
/// The start of a script that must not compile, followed by the code of its error.
const EXPECT: &str = "# expect-error:";
/// The code of a difference from the snapshot.
const DIFFERENCE: &str = "difference";
/// The code of a problem that sums up others.
pub const TOTAL: &str = "total";
/// The code of a snapshot that a newer version wrote.
const NEWER: &str = "newer-snapshot";
/// The longest snapshot that is read, in bytes.
const MOST: u64 = 2 << 30;
/// The most problems of one script that are kept.
const KEPT: usize = 200;

/// The result of one script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// Its path.
    pub name: String,
    /// Whether it passed, and how.
    pub status: Status,
    /// The problems, most important first.
    pub problems: Vec<Problem>,
    /// How many more problems there are.
    pub left_out: usize,
}

/// Whether a script passed, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// It sends the same as its snapshot.
    Same,
    /// Its snapshot was written, because it was missing or different.
    Blessed,
    /// It sends nothing: a file of phrases, for other scripts.
    Phrases,
    /// It does not compile, as it declares.
    ExpectedError,
    /// It differs from its snapshot.
    Differs,
    /// It has no snapshot.
    NoSnapshot,
    /// Its snapshot cannot be read or written.
    BadSnapshot,
    /// It does not compile.
    DoesNotCompile,
    /// It declares an error, but compiles or has another error.
    NotAsExpected,
    /// An `expect` failed, or a gate did not open.
    ExpectFailed,
    /// Playing it failed.
    PlaysDifferently,
    /// It cannot be read.
    Unreadable,
    /// It has warnings, and warnings are denied.
    Denied,
    /// It is a snapshot without a script.
    Orphan,
    /// It is a snapshot without a script, and warnings are denied.
    DeniedOrphan,
    /// It was a snapshot without a script, and was removed.
    Pruned,
    /// It is a snapshot without a script, and was not removed.
    Kept,
}

/// One problem of a script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The file.
    pub file: String,
    /// The line, counted from 1; 0 if the problem is not about one line.
    pub line: usize,
    /// The code of an error of the script, or one such as `difference` or `snapshot`.
    pub code: &'static str,
    /// What is wrong, in words.
    pub message: String,
    /// The same words in parts, if it is a difference from the snapshot.
    pub change: Option<Words>,
}

impl Problem {
    /// The message, with its position unless the message contains it.
    pub fn located(&self) -> String {
        let Problem { file, line, code, message, .. } = self;
        match *code {
            DIFFERENCE | TOTAL => message.clone(),
            code if *line > 0 => format!("{file}:{line}: {code}: {message}"),
            code => format!("{file}: {code}: {message}"),
        }
    }
}

impl Status {
    /// Whether the script passed.
    pub fn is_passed(self) -> bool {
        matches!(
            self,
            Status::Same
                | Status::Blessed
                | Status::Phrases
                | Status::ExpectedError
                | Status::Orphan
                | Status::Pruned
                | Status::Kept
        )
    }

    /// The status in a few words.
    pub fn words(self) -> &'static str {
        match self {
            Status::Same => "ok",
            Status::Blessed => "blessed",
            Status::Phrases => "ok, sends nothing",
            Status::ExpectedError => "ok, fails as expected",
            Status::Differs => "differs from its snapshot",
            Status::NoSnapshot => "has no snapshot",
            Status::BadSnapshot => "has an invalid snapshot",
            Status::DoesNotCompile => "does not compile",
            Status::NotAsExpected => "does not fail as expected",
            Status::ExpectFailed => "an `expect` or a gate failed",
            Status::PlaysDifferently => "failed when played",
            Status::Unreadable => "cannot be read",
            Status::Denied => "has warnings, and warnings are denied",
            Status::Orphan | Status::DeniedOrphan => "is a snapshot without a script",
            Status::Pruned => "removed, because it had no script",
            Status::Kept => "has no script, and is kept",
        }
    }

    /// Whether it is a snapshot without a script.
    pub fn is_orphan(self) -> bool {
        matches!(self, Status::Orphan | Status::DeniedOrphan | Status::Pruned | Status::Kept)
    }
}

/// Replaces a file, all of it or nothing.
pub type Replace = fn(&Path, &[u8]) -> io::Result<()>;

/// How scripts are tested.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Job {
    /// How scripts are compiled.
    pub options: Options,
    /// Writes snapshots that are missing or different; `None` keeps them.
    pub bless: Option<Replace>,
    /// Whether each script is also played, on a virtual board under a simulated clock.
    pub play: bool,
    /// The faults while playing.
    pub faults: Faults,
    /// The warnings that fail a script.
    pub deny: Denied,
}

impl Job {
    /// A job that only compares.
    pub fn new(options: Options) -> Self {
        Job { options, ..Job::default() }
    }

    /// Tests one script.
    pub fn case(&self, script: &Path) -> Case {
        let name = script.display().to_string();
        let case = |status, problems| Case::new(&name, status, problems);
        let sources = match Sources::read(script, Disk) {
            Ok(sources) => sources,
            Err(error) => return Case::unreadable(script, &error.to_string()),
        };
        let compiled = crate::compile(&sources, &self.options);
        let lines = Lines::of(&sources);
        match (expected_error(sources.main()), compiled.timelines.as_slice()) {
            (Some(expected), _) => {
                let wrong = expectation(expected, &compiled.diagnostics);
                let wrong: Vec<Problem> =
                    wrong.err().into_iter().map(|message| problem(&name, 1, "expect-error", message)).collect();
                case(if wrong.is_empty() { Status::ExpectedError } else { Status::NotAsExpected }, wrong)
            }
            (None, []) => {
                let errors = compiled.diagnostics.iter().filter(|diagnostic| diagnostic.is_error());
                case(Status::DoesNotCompile, errors.map(|error| found(error, &lines)).collect())
            }
            (None, timelines) => {
                let (mut status, mut problems) = if timelines.iter().all(is_phrases) {
                    (Status::Phrases, Vec::new())
                } else {
                    self.compare_and_play(script, timelines, &sources, &lines)
                };
                if self.deny.count(&compiled.diagnostics) > 0 {
                    status = if status.is_passed() { Status::Denied } else { status };
                    let denied = compiled.diagnostics.iter().filter(|warning| self.deny.contains(warning.code));
                    problems.extend(denied.map(|warning| found(warning, &lines)));
                }
                case(status, problems)
            }
        }
    }

    /// Compares a script with its snapshot, and plays it if requested.
    fn compare_and_play(
        &self,
        script: &Path,
        timelines: &[Timeline],
        sources: &Sources,
        lines: &Lines<'_>,
    ) -> (Status, Vec<Problem>) {
        let (mut status, mut problems) = self.compare(script, timelines, sources, lines);
        if self.play {
            let played = self.play(script, timelines, sources, lines);
            if status.is_passed() && !played.is_empty() {
                let expects = played.iter().all(|problem| [play::EXPECT, play::GATE].contains(&problem.code));
                status = if expects { Status::ExpectFailed } else { Status::PlaysDifferently };
            }
            problems.extend(played);
        }
        (status, problems)
    }

    fn compare(
        &self,
        script: &Path,
        timelines: &[Timeline],
        sources: &Sources,
        lines: &Lines<'_>,
    ) -> (Status, Vec<Problem>) {
        let snapshot = snapshot_of(script);
        let name = snapshot.display().to_string();
        let new: Vec<Snapshot> = timelines.iter().map(Snapshot::of).collect();
        let robots: Vec<NamedBoard> = timelines.iter().map(Timeline::named_board).collect();
        let script_name = shell_word(&script.display().to_string());
        let command = format!("motionseq test --bless {script_name}");
        match (read_all(&robots, &snapshot, &command), self.bless) {
            (Ok(None), None) => {
                let message = format!("{name} is missing; write it with `{command}`");
                (Status::NoSnapshot, vec![problem(&script.display().to_string(), 0, "snapshot", message)])
            }
            // An old format has fewer details.
            (Ok(Some(old)), write) if all_do_the_same(&old, &new) && (old == new || write.is_none()) => {
                (Status::Same, Vec::new())
            }
            (Err(wrong), None) => (Status::BadSnapshot, vec![wrong]),
            // Never overwrite the snapshot of a newer version.
            (Err(wrong), _) if wrong.code == NEWER => (Status::BadSnapshot, vec![wrong]),
            (_, Some(write)) => bless(script, &snapshot, timelines, write),
            (Ok(Some(old)), None) => {
                let timeline = |change: &Change| {
                    timelines.iter().find(|timeline| timeline.robot.as_ref() == change.robots.first())
                };
                let event = |change: &Change| timeline(change)?.frames(change.aborts).get(change.new?);
                let gate = |change: &Change| {
                    let Timeline { gates, events, .. } = timeline(change)?;
                    gates.get(change.new?.checked_sub(events.len())?)
                };
                let span = |change: &Change| {
                    event(change).map(|event| event.span).or_else(|| gate(change).map(|gate| gate.span))
                };
                let place = |change: &Change| span(change).map(|span| lines.place(span));
                let line = |change: &Change| place(change).map(|place| (place.file, place.line));
                let changes = diff_all(&old, &new, line);
                let is_total = |change: &Change| change.what.is_total();
                let sums_up = !changes.iter().all(is_total);
                let problems = changes.into_iter().map(|change| {
                    let origin = event(&change).zip(timeline(&change));
                    let origin = origin.map(|(event, timeline)| timeline.origin(event, sources, lines));
                    let origin = origin.or_else(|| place(&change).map(|place| place.to_string()));
                    let (file, line) = line(&change).unwrap_or((sources.main().name(), 0));
                    let code = if sums_up && is_total(&change) { TOTAL } else { DIFFERENCE };
                    let words = change.parts(origin.as_deref());
                    Problem { change: Some(words.clone()), ..problem(file, line, code, words.to_string()) }
                });
                (Status::Differs, problems.collect())
            }
        }
    }
}

/// Whether all robots do the same.
fn all_do_the_same(old: &[Snapshot], new: &[Snapshot]) -> bool {
    let is_same = |new: &Snapshot| old.iter().any(|old| old.robot == new.robot && old.does_the_same(new));
    old.len() == new.len() && new.iter().all(is_same)
}

/// Reads the snapshot of some robots at a path, if there is one; `bless` is the command that writes it.
fn read_all(robots: &[NamedBoard], path: &Path, bless: &str) -> Result<Option<Vec<Snapshot>>, Problem> {
    let name = path.display().to_string();
    match read_file(path, MOST) {
        Ok(text) => read_snapshots(robots, &text).map(Some).map_err(|error| {
            if error.is_newer {
                return problem(&name, error.line, NEWER, error.why);
            }
            problem(&name, error.line, "snapshot", format!("{}; write it again with `{bless}`", error.why))
        }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(problem(&name, 0, "snapshot", error.to_string())),
    }
}

impl Case {
    fn new(name: &str, status: Status, problems: Vec<Problem>) -> Self {
        let all = problems.len();
        let problems: Vec<Problem> = shortened(problems, KEPT).collect();
        Case { name: name.to_owned(), status, left_out: all - problems.len(), problems }
    }

    /// A script or a folder that cannot be read.
    pub fn unreadable(path: &Path, why: &str) -> Self {
        let name = path.display().to_string();
        Case::new(&name, Status::Unreadable, vec![problem(&name, 0, "unreadable", why.to_owned())])
    }

    /// A snapshot without a script, which fails if warnings are denied.
    pub fn orphan(path: &Path, is_denied: bool) -> Self {
        let name = path.display().to_string();
        let message = format!("its script is missing; if you deleted it: git rm {}", shell_word(&name));
        let status = if is_denied { Status::DeniedOrphan } else { Status::Orphan };
        Case::new(&name, status, vec![problem(&name, 0, "orphan", message)])
    }

    /// A snapshot without a script that was removed.
    pub fn pruned(path: &Path) -> Self {
        Case::new(&path.display().to_string(), Status::Pruned, Vec::new())
    }

    /// A snapshot without a script that was not removed, and why.
    pub fn kept(path: &Path, why: &str) -> Self {
        let name = path.display().to_string();
        Case::new(&name, Status::Kept, vec![problem(&name, 0, "orphan", why.to_owned())])
    }

    /// The command that accepts the difference from the snapshot.
    pub fn hint(&self) -> Option<String> {
        let is_different = self.status == Status::Differs;
        is_different.then(|| format!("if the change is intended: motionseq test --bless {}", shell_word(&self.name)))
    }
}

/// The first `most` problems and, whatever their number, those that sum up others.
pub fn shortened<P: Borrow<Problem>>(problems: impl IntoIterator<Item = P>, most: usize) -> impl Iterator<Item = P> {
    let mut left = most;
    problems.into_iter().filter(move |problem| {
        let is_kept = problem.borrow().code == TOTAL || left > 0;
        left = left.saturating_sub(1);
        is_kept
    })
}

/// A name quoted for a shell.
pub fn shell_word(name: &str) -> String {
    // A name like an option gets a folder.
    let here = if name.starts_with('-') { format!("./{name}") } else { name.to_owned() };
    let name = here.as_str();
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/._-+,:@%".contains(&byte) || !byte.is_ascii();
    if !name.is_empty() && name.bytes().all(plain) {
        name.to_owned()
    } else {
        format!("'{}'", name.replace('\'', r"'\''"))
    }
}

/// An error or a warning of a script.
fn found(diagnostic: &Diagnostic, lines: &Lines<'_>) -> Problem {
    let place = lines.place(diagnostic.span);
    let message = format!("{diagnostic}; {}", diagnostic.help);
    problem(place.file, place.line, diagnostic.code.name(), message)
}

fn problem(file: &str, line: usize, code: &'static str, message: String) -> Problem {
    Problem { file: file.to_owned(), line, code, message, change: None }
}

/// The code of the error that a script declares on its first line.
pub fn expected_error(source: &Source) -> Option<&str> {
    let text = source.text();
    text.strip_prefix('\u{FEFF}').unwrap_or(text).lines().next()?.strip_prefix(EXPECT).map(str::trim)
}

/// Checks that a script has the declared error and no other; otherwise returns what is wrong.
pub fn expectation(expected: &str, diagnostics: &Diagnostics) -> Result<(), String> {
    if expected.is_empty() {
        return Err(format!("the code of the error is missing; write `{EXPECT} out-of-range`"));
    }
    if Code::named(expected).is_none() {
        return Err(format!("unknown code `{expected}`; list the codes with `motionseq explain`"));
    }
    let mut errors = diagnostics.iter().filter(|diagnostic| diagnostic.is_error()).map(|error| error.code.name());
    match errors.find(|found| *found != expected) {
        _ if !diagnostics.has_errors() => Err(format!("expected the error `{expected}`, but the script compiles")),
        Some(other) => Err(format!("expected the error `{expected}`, but found `{other}`")),
        None => Ok(()),
    }
}

/// Whether a script does nothing: it only defines phrases.
fn is_phrases(timeline: &Timeline) -> bool {
    timeline.events.is_empty() && timeline.cues.is_empty() && timeline.end == Micros::ZERO
}

/// The path of a script's snapshot.
pub fn snapshot_of(script: &Path) -> PathBuf {
    let mut name = script.as_os_str().to_owned();
    name.push(SNAPSHOT);
    PathBuf::from(name)
}

/// Writes a snapshot, all of it or nothing.
fn bless(script: &Path, snapshot: &Path, timelines: &[Timeline], write: Replace) -> (Status, Vec<Problem>) {
    let name = script.file_name().unwrap_or_default().to_string_lossy();
    let mut text = Vec::new();
    let written = write_snapshot(&name, timelines, &mut text).and_then(|()| write(snapshot, &text));
    match written {
        Ok(()) => (Status::Blessed, Vec::new()),
        Err(error) => {
            let message = format!("cannot write it: {error}; the old snapshot is unchanged");
            (Status::BadSnapshot, vec![problem(&snapshot.display().to_string(), 0, "snapshot", message)])
        }
    }
}
