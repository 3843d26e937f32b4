//! `motionseq test --review`: shows changed scripts one by one, and asks what to do with each.

use std::ffi::OsString;
use std::fs;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process;

use motionseq::diagnostic::{Diagnostics, escaped};
use motionseq::plot::{Theme, plot};
use motionseq::source::{Disk, Files as _, Source, Sources};
use motionseq::timeline::{Snapshot, Timeline, read_snapshots};
use motionseq::verify::{Case, Job, Replace, Status, snapshot_of};

use super::Options;
use super::atomic_file::write_atomically;
use super::case_lines::{Shown, exit_of, is_shown};
use super::exit::Exit;
use super::family;
use super::project::VIRTUAL;
use super::screen::{Screen, plural};

/// What the user wants to do with a script.
enum Choice {
    Accept,
    Skip,
    Pictures,
    Play,
    Quit,
}

/// The question, with the keys.
const QUESTION: &str = "[a]ccept, [s]kip, [p]ictures, [v]irtual board, [q]uit? ";

/// A script, how it is tested, and the result.
pub(super) struct Tested<'t> {
    pub(super) script: &'t Path,
    pub(super) job: &'t Job,
    pub(super) case: Case,
}

/// A review in progress.
pub(super) struct Review<'r> {
    pub(super) shown: Shown,
    pub(super) screen: &'r Screen,
    pub(super) options: &'r Options,
}

impl Review<'_> {
    /// Shows the scripts that differ from their snapshots or have none. Without a terminal, only lists them. Fails if one of them is
    /// left, or if another case has failed.
    pub(super) fn run(&self, tested: Vec<Tested<'_>>, others: &[Case]) -> Exit {
        let is_pending = |tested: &Tested<'_>| matches!(tested.case.status, Status::Differs | Status::NoSnapshot);
        let (pending, rest): (Vec<_>, Vec<_>) = tested.into_iter().partition(is_pending);
        let others: Vec<&Case> = rest.iter().map(|tested| &tested.case).chain(others).collect();
        let failed = others.iter().filter(|case| !case.status.is_passed()).count();
        for case in others.iter().filter(|case| is_shown(case, self.screen)) {
            print(&self.shown.lines(case));
        }
        let failed_too = if failed > 0 { format!(", {failed} failed") } else { String::new() };
        let exit_of_others = exit_of(others.iter().copied());
        let exit = |left: usize| if left > 0 { Exit::Script } else { exit_of_others };
        if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
            for Tested { case, .. } in &pending {
                print(&self.shown.lines(case));
            }
            self.screen.note(&format!("{} to review{failed_too}", plural(pending.len(), "script")));
            return exit(pending.len());
        }
        let (count, mut accepted, mut skipped) = (pending.len(), 0, 0);
        let mut pictures = None;
        for (number, tested) in (1..).zip(pending) {
            match self.ask(tested, number, count, &mut pictures) {
                Choice::Accept => accepted += 1,
                Choice::Quit => break,
                _ => skipped += 1,
            }
        }
        if let Some(folder) = pictures {
            // The pictures were only for this review.
            let _ = fs::remove_dir_all(folder);
        }
        let left = count - accepted - skipped;
        let left = if left > 0 { format!(", {left} not reviewed") } else { String::new() };
        self.screen.note(&format!("{accepted} accepted, {skipped} skipped{left}{failed_too}"));
        exit(count - accepted)
    }

    /// Asks about one script until the answer is final.
    fn ask(&self, tested: Tested<'_>, number: usize, count: usize, pictures: &mut Option<PathBuf>) -> Choice {
        let Tested { script, job, mut case } = tested;
        print(&[vec![format!("({number} of {count}) {}", escaped(&case.name))], self.shown.lines(&case)].concat());
        loop {
            match self.choice() {
                Choice::Accept => {
                    // Accept only what was shown.
                    let now = job.case(script);
                    if now != case {
                        self.screen.note(&format!("{} has changed since:", case.name));
                        case = now;
                        print(&self.shown.lines(&case));
                        continue;
                    }
                    let mut job = job.clone();
                    job.bless = Some(write_atomically as Replace);
                    let blessed = job.case(script);
                    print(&self.shown.lines(&blessed));
                    return if blessed.status.is_passed() { Choice::Accept } else { Choice::Skip };
                }
                Choice::Pictures => match draw((script, job), number, pictures, self.screen) {
                    Ok(paths) => print(&paths),
                    Err(error) => self.screen.error(&format!("cannot draw {}: {error}", case.name)),
                },
                Choice::Play => self.play(script),
                choice => return choice,
            }
        }
    }

    /// Reads an answer. The end of the input quits.
    fn choice(&self) -> Choice {
        loop {
            self.screen.prompt(QUESTION);
            let mut answer = String::new();
            if io::stdin().read_line(&mut answer).unwrap_or(0) == 0 {
                return Choice::Quit;
            }
            match answer.trim().to_lowercase().as_str() {
                "a" | "accept" => return Choice::Accept,
                "s" | "skip" => return Choice::Skip,
                "p" | "pictures" => return Choice::Pictures,
                "v" => return Choice::Play,
                "q" | "quit" => return Choice::Quit,
                _ => self.screen.ask("type one of the letters a, s, p, v and q, and Enter"),
            }
        }
    }

    /// Plays a script as `motionseq play` does, always on the virtual board.
    fn play(&self, script: &Path) {
        let played = std::env::current_exe().and_then(|program| {
            let mut play = process::Command::new(program);
            play.args(["play", self.screen.color_option(), "--port", VIRTUAL]).args(self.options.config.arguments());
            for (name, value) in &self.options.set {
                play.arg("--set").arg(format!("{name}={value}"));
            }
            play.arg("--max-events").arg(self.options.max_events.to_string());
            play.arg("--").arg(script).status()
        });
        if let Err(error) = played {
            self.screen.error(&format!("cannot play it: {error}"));
        }
    }
}

/// Draws the snapshot and the script, and returns a line for each picture.
fn draw(
    (script, job): (&Path, &Job),
    number: usize,
    folder: &mut Option<PathBuf>,
    screen: &Screen,
) -> io::Result<Vec<String>> {
    let folder = match folder {
        Some(folder) => folder,
        None => {
            let new = std::env::temp_dir().join(format!("motionseq-review-{}", process::id()));
            fs::create_dir(&new)?;
            folder.insert(new)
        }
    };
    let name = script.file_stem().unwrap_or_default();
    let draw = |when: &str, timelines: &[Timeline], sources: &Sources, diagnostics: &Diagnostics| {
        let mut file = OsString::from(format!("{number}-"));
        file.push(name);
        file.push(format!(".{when}.svg"));
        let path = folder.join(file);
        fs::write(&path, plot(timelines, sources, diagnostics).to_svg(Theme::Auto))?;
        Ok::<_, io::Error>(format!("  {when}: {}", escaped(&path.display().to_string())))
    };
    let snapshot = snapshot_of(script);
    let mut lines = Vec::new();
    let old = fs::read(&snapshot).ok().and_then(|text| {
        let robots = family::robots_of_snapshot(&snapshot.display().to_string(), &snapshot, &text, screen).ok()?;
        read_snapshots(&robots, &text).ok()
    });
    if let Some(old) = old {
        let sources = Source::new(snapshot.display().to_string(), "").into();
        let timelines: Vec<Timeline> = old.iter().map(Snapshot::timeline).collect();
        lines.push(draw("old", &timelines, &sources, &Diagnostics::default())?);
    }
    let sources = Sources::new(Disk.read(script).map_err(io::Error::other)?, Disk);
    let compiled = motionseq::compile(&sources, &job.options);
    if compiled.timelines.is_empty() {
        return Err(io::Error::other("it no longer compiles"));
    }
    lines.push(draw("new", &compiled.timelines, &sources, &compiled.diagnostics)?);
    Ok(lines)
}

fn print(lines: &[String]) {
    let text: String = lines.iter().flat_map(|line| [line, "\n"]).collect();
    // A terminal that is gone ends the review at the next question.
    let _ = io::stdout().lock().write_all(text.as_bytes());
}
