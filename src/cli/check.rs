//! `motionseq check`: what is wrong with scripts.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use motionseq::source::Sources;

use super::exit::Exit;
use super::screen::{Screen, plural, seconds};
use super::{Options, read};

/// Check scripts: show every error and warning, send nothing
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq check scripts/hello.motion\n  motionseq check --deny warnings scripts/*.motion"
)]
pub(super) struct Check {
    /// The scripts, or `-` for standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Let warnings fail too
    #[arg(long, value_enum, value_name = "WHAT")]
    deny: Option<Deny>,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Deny {
    /// Every warning counts as an error
    Warnings,
}

impl Check {
    /// Checks every file; fails if any of them does.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let mut exit = Exit::Ok;
        for file in &self.files {
            let Ok(source) = read(file, screen) else {
                exit = Exit::Script;
                continue;
            };
            let sources = Sources::from(source);
            let compiled = self.options.compile(&sources, screen, self.deny.is_some());
            let denied = self.deny.is_some() && compiled.diagnostics.warnings() > 0;
            match compiled.timeline {
                Some(timeline) if !denied => {
                    let frames = plural(timeline.events().len(), "frame");
                    screen.note(&format!("{}: ok, {frames} in {} s", sources.main().name(), seconds(timeline.end_us)));
                }
                Some(_) => {
                    screen.error(&format!("{}: warnings are denied", sources.main().name()));
                    exit = Exit::Script;
                }
                None => exit = Exit::Script,
            }
        }
        exit
    }
}
