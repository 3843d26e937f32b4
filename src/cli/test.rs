//! `motionseq test`: compares scripts with their snapshots.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use motionseq::faults::Faults;
use motionseq::report;
use motionseq::verify::{Case, Job, Replace, Status};
use rayon::prelude::*;

use super::atomic_file::write_atomically;
use super::case_lines::{Shown, exit_of, is_shown};
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::progress_bar::ProgressBar;
use super::project::Configs;
use super::review::{Review, Tested};
use super::screen::{Screen, plural};
use super::script_files::{ScriptFiles, find_scripts};
use super::watch::{Watch, files_of};
use super::{Deny, Options, repository};

/// Compare scripts with their snapshots
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq test                    # test all scripts in this folder\n  motionseq test --review           # show each change, and ask whether to accept it\n  motionseq test --bless scripts    # write snapshots; commit them with the scripts\n  motionseq test --play scripts     # also play the scripts on a virtual board\n  motionseq test --format github --junit report.xml\n\nThe snapshot of NAME.motion is NAME.motion.frames, in the same folder.\nA script that must not compile declares its error on its first line: # expect-error: CODE"
)]
pub(super) struct Test {
    /// Scripts or folders to test [default: `paths` of motionseq.toml, else this folder]
    #[arg(value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Test only the scripts whose path contains NAME
    #[arg(long, value_name = "NAME")]
    filter: Option<String>,
    /// Write snapshots that are missing or different
    #[arg(long, conflicts_with = "watch")]
    bless: bool,
    /// Also remove snapshots without a script
    #[arg(long, requires = "bless", conflicts_with = "filter")]
    prune: bool,
    /// Show each script that differs from its snapshot, and ask whether to write the snapshot
    #[arg(long, conflicts_with_all = ["bless", "format", "junit", "watch"])]
    review: bool,
    /// Also play each script on a virtual board, under a simulated clock, and check each `expect`
    #[arg(long)]
    play: bool,
    /// Simulate faults while playing: drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent, seed=7, servo=3:silent
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
        let test = |paths: &[PathBuf]| self.test(paths, screen).unwrap_or_else(|exit| exit);
        self.watch.run(&self.paths, &self.options, screen, test)
    }

    fn test(&self, paths: &[PathBuf], screen: &Screen) -> Result<Exit, Exit> {
        let configs = self.options.config.configs();
        let found = self.find(paths, &configs);
        let is_pruned = self.prune && !found.orphans.is_empty();
        if found.scripts.is_empty() && found.unreadable.is_empty() && !is_pruned {
            let paths: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
            let with = self.filter.as_ref().map(|name| format!(" whose path contains `{name}`")).unwrap_or_default();
            screen.error(&format!("no .motion files{with} in {}", paths.join(", ")));
            return Err(Exit::Script);
        }
        // Opened before any script runs, so that a wrong path is reported first.
        let inputs = self.inputs(&found.scripts);
        let junit = match self.junit.as_deref().map(|path| output::whole(path, &inputs, self.force)).transpose() {
            Ok(junit) => junit,
            Err(error) => return Err(output::exit(Err(error), self.junit.as_deref(), screen)),
        };
        let jobs: Result<Vec<(&PathBuf, Job)>, Exit> =
            found.scripts.iter().map(|script| Ok((script, self.job(script, &configs, screen)?))).collect();
        let jobs = jobs?;
        let orphans: Result<Vec<Case>, Exit> =
            found.orphans.iter().map(|orphan| self.orphan(orphan, &configs, screen)).collect();
        let orphans = orphans?;
        let mut cases: Vec<Case> = found.unreadable.iter().map(|(path, why)| Case::unreadable(path, why)).collect();
        let tested = self.in_parallel(&jobs, screen)?;
        if self.review {
            cases.extend(orphans);
            let tested = jobs.iter().zip(tested).map(|((script, job), case)| Tested { script, job, case }).collect();
            let shown = Shown::new(screen, self.options.all, false);
            return Ok(Review { shown, screen, options: &self.options }.run(tested, &cases));
        }
        cases.extend(tested);
        let pruned = || found.orphans.iter().map(|orphan| prune(orphan, paths)).collect();
        cases.extend(if self.prune { pruned() } else { orphans });
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
            Exit::Ok => exit_of(&cases),
            exit => exit,
        })
    }

    /// The files that no report may replace. Those that scripts use are looked up only if the report replaces something.
    fn inputs(&self, scripts: &[PathBuf]) -> Inputs {
        let is_report = |path: &Path| path.extension().is_some_and(|end| end == "xml");
        if self.junit.as_deref().is_some_and(|path| path.is_file() && !is_report(path)) {
            return Inputs::of(files_of(scripts, &self.options));
        }
        Inputs::of(scripts)
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

    /// A snapshot without a script.
    fn orphan(&self, path: &Path, configs: &Configs, screen: &Screen) -> Result<Case, Exit> {
        let is_denied = configs.of_script(path, screen)?.denied(&self.deny.deny).0.is_all();
        Ok(Case::orphan(path, is_denied))
    }

    /// The scripts to test.
    fn find(&self, paths: &[PathBuf], configs: &Arc<Configs>) -> ScriptFiles {
        let mut found = find_scripts(paths, configs);
        if let Some(name) = &self.filter {
            let has = |path: &Path| path.to_string_lossy().contains(name.as_str());
            found.scripts.retain(|script| has(script));
            found.orphans.retain(|orphan| has(orphan));
        }
        found
    }

    /// Tests every script, in this order, on some threads: never more than scripts.
    fn in_parallel(&self, jobs: &[(&PathBuf, Job)], screen: &Screen) -> Result<Vec<Case>, Exit> {
        let threads = self.jobs.map_or(0, |threads| usize::from(threads).min(jobs.len()));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| {
            screen.error(&format!("cannot start threads: {error}"));
            Exit::Usage
        })?;
        let progress = ProgressBar::new(screen, "scripts", jobs.len());
        let case = |(script, job): &(&PathBuf, Job)| {
            let case = job.case(script);
            progress.add(1);
            case
        };
        Ok(pool.install(|| jobs.par_iter().map(case).collect()))
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

/// Removes a snapshot without a script, if motionseq has written it and no link leads there.
fn prune(orphan: &Path, searched: &[PathBuf]) -> Case {
    let is_inside = |path: &PathBuf| Some(orphan.canonicalize().ok()?.starts_with(path.canonicalize().ok()?));
    let removed = if !output::is_ours(orphan) {
        Err(io::Error::other("motionseq did not write it"))
    } else if !searched.iter().filter_map(is_inside).any(|is_inside| is_inside) {
        Err(io::Error::other("a link leads out of the searched folder"))
    } else {
        fs::remove_file(orphan)
    };
    match removed {
        Ok(()) => Case::pruned(orphan),
        Err(error) => Case::kept(orphan, &error.to_string()),
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
