//! `motionseq test`: compares scripts with their snapshots.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use motionseq::diagnostic::escaped;
use motionseq::faults::Faults;
use motionseq::report;
use motionseq::verify::{Case, Job, Replace, Status, shortened};
use rayon::prelude::*;

use super::atomic_file::write_atomically;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::progress_bar::ProgressBar;
use super::project::Configs;
use super::screen::{Screen, plural};
use super::script_files::find_scripts;
use super::{Deny, Options, repository};

/// Compare scripts with their snapshots
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq test                    # test all scripts in this folder\n  motionseq test --bless scripts    # write snapshots; commit them with the scripts\n  motionseq test --play scripts     # also play the scripts on a virtual board\n  motionseq test --format github --junit report.xml\n\nThe snapshot of NAME.motion is NAME.motion.frames, in the same folder.\nA script that must not compile declares its error on its first line: # expect-error: CODE"
)]
pub(super) struct Test {
    /// Scripts or folders to test [default: `paths` of motionseq.toml, else this folder]
    #[arg(value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Write snapshots that are missing or different
    #[arg(long)]
    bless: bool,
    /// Also play each script on a virtual board, under a simulated clock, and check each `expect`
    #[arg(long)]
    play: bool,
    /// Simulate faults while playing: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7
    #[arg(long, value_name = "FAULTS", requires = "play")]
    fault: Option<Faults>,
    #[command(flatten)]
    deny: Deny,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
    #[arg(long, value_name = "FILE", help = "Also write a JUnit report to FILE")]
    junit: Option<PathBuf>,
    /// Test N scripts in parallel [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    force: Force,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Failed scripts and what changed
    Human,
    /// One JSON object
    Json,
    /// Test Anything Protocol, version 13
    Tap,
    /// GitHub Actions annotations
    Github,
}

/// How many changes of one script are shown without `-v`.
const SHOWN: usize = 20;

impl Test {
    /// Tests every script; fails if one of them does.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.test(screen).unwrap_or_else(|exit| exit)
    }

    fn test(&self, screen: &Screen) -> Result<Exit, Exit> {
        let configs = self.options.config.configs();
        let paths = configs.searched(&self.paths, screen)?;
        let found = find_scripts(&paths, &configs);
        if found.scripts.is_empty() && found.unreadable.is_empty() {
            let paths: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
            screen.error(&format!("no .motion files in {}", paths.join(", ")));
            return Err(Exit::Script);
        }
        // Opened before any script runs, so that a wrong path is reported first.
        let inputs = Inputs::of(&found.scripts);
        let junit = match self.junit.as_deref().map(|path| output::whole(path, &inputs, self.force)).transpose() {
            Ok(junit) => junit,
            Err(error) => return Err(output::exit(Err(error), self.junit.as_deref(), screen)),
        };
        let jobs: Result<Vec<(&PathBuf, Job)>, Exit> =
            found.scripts.iter().map(|script| Ok((script, self.job(script, &configs, screen)?))).collect();
        let jobs = jobs?;
        let orphans: Result<Vec<Case>, Exit> = found
            .orphans
            .iter()
            .map(|orphan| {
                let is_denied = configs.of_script(orphan, screen)?.denied(&self.deny.deny).0.is_all();
                Ok(Case::orphan(orphan, is_denied))
            })
            .collect();
        let mut cases: Vec<Case> = found.unreadable.iter().map(|(path, why)| Case::unreadable(path, why)).collect();
        // Never more threads than scripts.
        let threads = self.jobs.map_or(0, |jobs| usize::from(jobs).min(found.scripts.len()));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        match pool {
            Ok(pool) => {
                let progress = ProgressBar::new(screen, "scripts", jobs.len());
                cases.extend(pool.install(|| run(&jobs, || progress.add(1))));
            }
            Err(error) => {
                screen.error(&format!("cannot start threads: {error}"));
                return Err(Exit::Usage);
            }
        }
        cases.extend(orphans?);
        let failed = cases.iter().filter(|case| !case.status.is_passed()).count();
        let written = self.print(&cases, screen).and_then(|()| io::stdout().flush());
        screen.note(&summary(&cases, failed));
        if let Some(mut file) = junit {
            let text = report::junit::cases(&repository().cases(&cases));
            let all = file.write_all(text.as_bytes()).and_then(|()| file.finish());
            if all.is_err() {
                return Err(output::exit(all, self.junit.as_deref(), screen));
            }
        }
        Ok(match output::exit(written, None, screen) {
            Exit::Ok if failed > 0 => {
                let mut failed = cases.iter().filter(|case| !case.status.is_passed());
                let expects = failed.all(|case| case.status == Status::ExpectFailed);
                if expects { Exit::Expect } else { Exit::Script }
            }
            exit => exit,
        })
    }

    /// How a script is tested, with the configuration that applies to it.
    fn job(&self, script: &Path, configs: &Configs, screen: &Screen) -> Result<Job, Exit> {
        let config = configs.of_script(script, screen)?;
        let mut job = Job::new(self.options.of_library(&config));
        job.bless = self.bless.then_some(write_atomically as Replace);
        job.deny = config.denied(&self.deny.deny).0;
        (job.play, job.faults) = (self.play, self.fault.clone().unwrap_or_default());
        Ok(job)
    }

    fn print(&self, cases: &[Case], screen: &Screen) -> io::Result<()> {
        let text = match self.format {
            Format::Human => human(cases, screen, self.options.all),
            Format::Json => report::json::cases(cases),
            Format::Tap => report::tap::cases(cases),
            Format::Github => report::github::cases(&repository().cases(cases)),
        };
        io::stdout().lock().write_all(text.as_bytes())
    }
}

/// Tests every script on the threads of the pool, in this order. `done` is called after each script, from any thread.
fn run(jobs: &[(&PathBuf, Job)], done: impl Fn() + Sync) -> Vec<Case> {
    let case = |(script, job): &(&PathBuf, Job)| {
        let case = job.case(script);
        done();
        case
    };
    jobs.par_iter().map(case).collect()
}

fn human(cases: &[Case], screen: &Screen, all: bool) -> String {
    let mut lines = Vec::new();
    for case in cases {
        let orphan = case.status == Status::Orphan;
        let is_shown = !case.status.is_passed() || screen.is_verbose() || orphan && !screen.is_quiet();
        if !is_shown {
            continue;
        }
        let mark = match (orphan, case.status.is_passed()) {
            (true, _) => "warning: ",
            (_, true) => "",
            (_, false) => "FAILED ",
        };
        lines.push(format!("{mark}{}: {}", case.name, case.status.words()));
        let shown = if all || screen.is_verbose() { usize::MAX } else { SHOWN };
        let before = lines.len();
        lines.extend(shortened(&case.problems, shown).map(|problem| format!("  {}", problem.located())));
        let more = case.problems.len() - (lines.len() - before) + case.left_out;
        if more > 0 {
            let how = if case.left_out == 0 { "; -v shows them" } else { "" };
            lines.push(format!("  and {}{how}", more_of(more, case.status)));
        }
        lines.extend(case.hint().map(|hint| format!("  {hint}")));
    }
    lines.iter().map(|line| escaped(line) + "\n").collect()
}

/// `12 scripts: 10 passed, 2 failed`.
fn summary(cases: &[Case], failed: usize) -> String {
    let orphans = cases.iter().filter(|case| case.status.is_orphan()).count();
    let count = cases.len() - orphans;
    let passed = cases.iter().filter(|case| case.status.is_passed() && !case.status.is_orphan()).count();
    let orphans =
        if orphans > 0 { format!(", {} without a script", plural(orphans, "snapshot")) } else { String::new() };
    let blessed = cases.iter().filter(|case| case.status == Status::Blessed).count();
    let blessed = if blessed > 0 { format!(" ({blessed} blessed)") } else { String::new() };
    format!("{}: {passed} passed{blessed}, {failed} failed{orphans}", plural(count, "script"))
}

fn more_of(count: usize, status: Status) -> String {
    let word = if status == Status::Differs { "change" } else { "error" };
    plural(count, &format!("more {word}"))
}
