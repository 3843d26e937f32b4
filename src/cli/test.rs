//! `motionseq test`: holds scripts against their snapshots.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motionseq::diagnostic::escaped;
use motionseq::report;
use motionseq::verify::{Case, Job, Verdict, find};

use super::Options;
use super::exit::Exit;
use super::output;
use super::screen::{Screen, plural};

/// Compare every script with its snapshot, and say what has changed
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq test                    every *.motion below this folder\n  motionseq test --bless scripts    write their snapshots (NAME.motion.frames), to be kept in git\n  motionseq test --junit report.xml --format github\n\nA script that must not compile says so on its first line: # expect-error: CODE"
)]
pub(super) struct Test {
    /// Folders and scripts
    #[arg(default_value = ".", value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Write the snapshots that are missing or differ
    #[arg(long)]
    bless: bool,
    /// How results are printed
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
    /// Write a report in the form of `JUnit`, too
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Compile so many scripts at once [default: one for each processor]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people: what failed, and what has changed
    Human,
    /// One JSON object
    Json,
    /// Test Anything Protocol
    Tap,
    /// Annotations of a `GitHub` workflow
    Github,
}

/// How many changes of one script people are shown without `-v`.
const SHOWN: usize = 20;

impl Test {
    /// Tests; fails if any script does.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let found = find(&self.paths);
        for orphan in &found.orphans {
            screen.warning(&format!("{} is the snapshot of a script that is not there", orphan.display()));
        }
        for (path, why) in &found.unreadable {
            screen.error(&format!("cannot look into {}: {why}", path.display()));
        }
        if found.scripts.is_empty() {
            let paths: Vec<String> = self.paths.iter().map(|path| path.display().to_string()).collect();
            screen.error(&format!("there is no *.motion in {}", paths.join(", ")));
            return Exit::Script;
        }
        let job = Job { options: self.options.of_library(), bless: self.bless };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.jobs.unwrap_or(0)).build();
        let cases = match pool {
            Ok(pool) => pool.install(|| job.run(&found.scripts)),
            Err(error) => {
                screen.error(&format!("cannot start threads: {error}"));
                return Exit::Usage;
            }
        };
        let failed = cases.iter().filter(|case| !case.verdict.is_passed()).count();
        let written = self.print(&cases, screen).and_then(|()| io::stdout().flush());
        screen.note(&summary(&cases, failed));
        if let Some(path) = &self.junit
            && let Err(error) = fs::write(path, report::cases_junit(&cases))
        {
            screen.error(&format!("cannot write {}: {error}", path.display()));
            return Exit::Usage;
        }
        match output::exit(written, None, screen) {
            Exit::Ok if failed > 0 || !found.unreadable.is_empty() => Exit::Script,
            exit => exit,
        }
    }

    fn print(&self, cases: &[Case], screen: &Screen) -> io::Result<()> {
        let text = match self.format {
            Format::Human => human(cases, screen),
            Format::Json => report::cases_json(cases),
            Format::Tap => report::cases_tap(cases),
            Format::Github => report::cases_github(cases),
        };
        io::stdout().lock().write_all(text.as_bytes())
    }
}

fn human(cases: &[Case], screen: &Screen) -> String {
    let mut lines = Vec::new();
    for case in cases {
        if case.verdict.is_passed() && !screen.is_verbose() {
            continue;
        }
        let mark = if case.verdict.is_passed() { "" } else { "FAILED " };
        lines.push(format!("{mark}{}: {}", case.name, case.verdict.words()));
        let shown = if screen.is_verbose() { usize::MAX } else { SHOWN };
        lines.extend(case.problems.iter().take(shown).map(|problem| format!("  {}", report::located(problem))));
        let more = case.problems.len().saturating_sub(shown) + case.left_out;
        if more > 0 {
            lines.push(format!("  and {} more", plural(more, "change")));
        }
        if case.verdict == Verdict::Differs {
            lines.push(format!("  if that is meant: motionseq test --bless {}", case.name));
        }
    }
    lines.iter().map(|line| escaped(line) + "\n").collect()
}

/// `12 scripts: 10 passed, 2 failed`.
fn summary(cases: &[Case], failed: usize) -> String {
    let blessed = cases.iter().filter(|case| case.verdict == Verdict::Blessed).count();
    let blessed = if blessed > 0 { format!(" ({blessed} blessed)") } else { String::new() };
    format!("{}: {} passed{blessed}, {failed} failed", plural(cases.len(), "script"), cases.len() - failed)
}
