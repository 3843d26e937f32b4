//! `motionseq test`: compares scripts with their snapshots.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use motionseq::faults::Faults;
use motionseq::report;
use motionseq::verify::{Case, Job, Replace, Status};
use rayon::prelude::*;

use super::atomic_file::write_atomically;
use super::case_lines::{Shown, is_shown};
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::progress_bar::ProgressBar;
use super::review::Review;
use super::screen::{Screen, plural};
use super::script_files::{ScriptFiles, find_scripts};
use super::watch::Watch;
use super::{Deny, Options, repository};

/// Compare scripts with their snapshots
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq test                    # test all scripts in this folder\n  motionseq test --review           # show each change, and ask whether to accept it\n  motionseq test --bless scripts    # write snapshots; commit them with the scripts\n  motionseq test --play scripts     # also play the scripts on a virtual board\n  motionseq test --format github --junit report.xml\n\nThe snapshot of NAME.motion is NAME.motion.frames, in the same folder.\nA script that must not compile declares its error on its first line: # expect-error: CODE"
)]
pub(super) struct Test {
    /// Scripts or folders to test
    #[arg(default_value = ".", value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Test only the scripts whose path contains NAME
    #[arg(long, value_name = "NAME")]
    filter: Option<String>,
    /// Write snapshots that are missing or different
    #[arg(long)]
    bless: bool,
    /// Also remove snapshots without a script
    #[arg(long, requires = "bless")]
    prune: bool,
    /// Show each script that differs from its snapshot, and ask whether to write the snapshot
    #[arg(long, conflicts_with_all = ["bless", "format", "junit", "watch"])]
    review: bool,
    /// Also play each script on a virtual board, under a simulated clock, and check each `expect`
    #[arg(long)]
    play: bool,
    /// Simulate faults while playing: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7
    #[arg(long, value_name = "FAULTS", requires = "play")]
    fault: Option<Faults>,
    /// Fail on warnings and on snapshots without a script
    #[arg(long, value_enum, value_name = "WHAT")]
    deny: Option<Deny>,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
    #[arg(long, value_name = "FILE", help = "Also write a JUnit report to FILE")]
    junit: Option<PathBuf>,
    /// Test N scripts in parallel [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    #[command(flatten)]
    watch: Watch,
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

impl Test {
    /// Tests every script; fails if one of them does.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.watch.run(&self.paths, &self.options, screen, || self.run_once(screen))
    }

    fn run_once(&self, screen: &Screen) -> Exit {
        let found = self.find();
        if found.scripts.is_empty() && found.unreadable.is_empty() && !(self.prune && !found.orphans.is_empty()) {
            let paths: Vec<String> = self.paths.iter().map(|path| path.display().to_string()).collect();
            let with = self.filter.as_ref().map(|name| format!(" whose path contains `{name}`")).unwrap_or_default();
            screen.error(&format!("no .motion files{with} in {}", paths.join(", ")));
            return Exit::Script;
        }
        // Opened before any script runs, so that a wrong path is reported first.
        let inputs = Inputs::of(&found.scripts);
        let junit = match self.junit.as_deref().map(|path| output::whole(path, &inputs, self.force)).transpose() {
            Ok(junit) => junit,
            Err(error) => return output::exit(Err(error), self.junit.as_deref(), screen),
        };
        let faults = self.fault.clone().unwrap_or_default();
        let mut job = Job::new(self.options.of_library());
        job.bless = self.bless.then_some(write_atomically as Replace);
        job.deny = self.deny.is_some();
        (job.play, job.faults) = (self.play, faults);
        // Never more threads than scripts.
        let threads = self.jobs.map_or(0, |jobs| usize::from(jobs).min(found.scripts.len()));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let mut cases = match pool {
            Ok(pool) => {
                let progress = ProgressBar::new(screen, "scripts", found.scripts.len());
                pool.install(|| run(&job, &found, || progress.add(1)))
            }
            Err(error) => {
                screen.error(&format!("cannot start threads: {error}"));
                return Exit::Usage;
            }
        };
        let orphans = cases.split_off(cases.len() - found.orphans.len());
        if self.review {
            let paths = found.unreadable.iter().map(|(path, _)| path).chain(&found.scripts).chain(&found.orphans);
            let cases = paths.map(PathBuf::as_path).zip(cases.into_iter().chain(orphans)).collect();
            return Review { job: &job, shown: Shown::new(screen, self.options.all, false), screen }.run(cases);
        }
        cases.extend(if self.prune { found.orphans.iter().map(|orphan| prune(orphan)).collect() } else { orphans });
        let failed = cases.iter().filter(|case| !case.status.is_passed()).count();
        let written = self.print(&cases, screen).and_then(|()| io::stdout().flush());
        screen.note(&summary(&cases, failed));
        if let Some(mut file) = junit {
            let text = report::junit::cases(&repository().cases(&cases));
            let all = file.write_all(text.as_bytes()).and_then(|()| file.finish());
            if all.is_err() {
                return output::exit(all, self.junit.as_deref(), screen);
            }
        }
        match output::exit(written, None, screen) {
            Exit::Ok if failed > 0 => {
                let mut failed = cases.iter().filter(|case| !case.status.is_passed());
                let expects = failed.all(|case| case.status == Status::ExpectFailed);
                if expects { Exit::Expect } else { Exit::Script }
            }
            exit => exit,
        }
    }

    /// The scripts to test.
    fn find(&self) -> ScriptFiles {
        let mut found = find_scripts(&self.paths);
        if let Some(name) = &self.filter {
            let has = |path: &Path| path.to_string_lossy().contains(name.as_str());
            found.scripts.retain(|script| has(script));
            found.orphans.retain(|orphan| has(orphan));
        }
        found
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

/// Tests every script on the threads of the pool. The order is that of `found`: first unreadable paths, then scripts, then
/// snapshots without a script. `done` is called after each script, from any thread.
fn run(job: &Job, found: &ScriptFiles, done: impl Fn() + Sync) -> Vec<Case> {
    let mut cases: Vec<Case> = found.unreadable.iter().map(|(path, why)| Case::unreadable(path, why)).collect();
    cases.par_extend(found.scripts.par_iter().map(|script| {
        let case = job.case(script);
        done();
        case
    }));
    cases.extend(found.orphans.iter().map(|orphan| Case::orphan(orphan, job.deny)));
    cases
}

/// Removes a snapshot without a script, if motionseq has written it.
fn prune(orphan: &Path) -> Case {
    let removed = if output::is_ours(orphan) {
        fs::remove_file(orphan)
    } else {
        Err(io::Error::other("it was not written by motionseq, so it was not removed"))
    };
    match removed {
        Ok(()) => Case::pruned(orphan),
        Err(error) => Case::unreadable(orphan, &error.to_string()),
    }
}

fn human(cases: &[Case], screen: &Screen, all: bool) -> String {
    let shown = Shown::new(screen, all, true);
    let cases = cases.iter().filter(|case| is_shown(case, screen));
    cases.flat_map(|case| shown.lines(case)).map(|line| line + "\n").collect()
}

/// `12 scripts: 10 passed, 2 failed`.
fn summary(cases: &[Case], failed: usize) -> String {
    let pruned = cases.iter().filter(|case| case.status == Status::Pruned).count();
    let orphans = cases.iter().filter(|case| case.status.is_orphan()).count() - pruned;
    let count = cases.len() - orphans - pruned;
    let passed = cases.iter().filter(|case| case.status.is_passed() && !case.status.is_orphan()).count();
    let orphans =
        if orphans > 0 { format!(", {} without a script", plural(orphans, "snapshot")) } else { String::new() };
    let blessed = cases.iter().filter(|case| case.status == Status::Blessed).count();
    let blessed = if blessed > 0 { format!(" ({blessed} blessed)") } else { String::new() };
    let pruned = if pruned > 0 { format!(", {} removed", plural(pruned, "snapshot")) } else { String::new() };
    format!("{}: {passed} passed{blessed}, {failed} failed{orphans}{pruned}", plural(count, "script"))
}
