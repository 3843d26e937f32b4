//! `motionseq fmt`: sets scripts evenly.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::diagnostic::Diagnostics;
use motionseq::syntax;

use super::atomic_file::write_atomically;
use super::exit::Exit;
use super::output;
use super::read;
use super::screen::{Screen, Warnings, plural};

/// Format scripts: blanks, indentation, comments below each other; never what is sent
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq fmt scripts/*.motion\n  motionseq fmt --check scripts/*.motion    for CI: change nothing, fail if anything would change\n  motionseq fmt - < draft.motion            to standard output\n\nLines stay lines and comments stay. A script that cannot be read is left as it is."
)]
pub(super) struct Fmt {
    /// The scripts, or `-` for standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Change nothing; say which scripts would change, and fail if there are any
    #[arg(long)]
    check: bool,
}

impl Fmt {
    /// Formats every file; fails if one cannot be read, or with `--check` if one would change.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        if self.files.iter().filter(|file| file.as_os_str() == "-").count() > 1 {
            screen.error("standard input can be read only once: give `-` once");
            return Exit::Usage;
        }
        let mut exit = Exit::Ok;
        let (mut changed, mut failed) = (0_usize, 0_usize);
        for file in &self.files {
            match self.file(file, screen) {
                Ok(is_changed) => changed += usize::from(is_changed),
                Err(cause) => (exit, failed) = (cause, failed + 1),
            }
        }
        let unchanged = plural(self.files.len(), "script");
        screen.note(&match (self.check, changed) {
            (_, 0) if failed > 0 => format!("{unchanged} looked at, {failed} cannot be formatted"),
            (_, 0) => format!("{unchanged} looked at, nothing to change"),
            (true, _) => format!("{unchanged} looked at, {changed} would change: motionseq fmt FILE"),
            (false, _) => format!("{unchanged} looked at, {changed} formatted"),
        });
        if exit == Exit::Ok && self.check && changed > 0 { Exit::Script } else { exit }
    }

    /// Formats a file; says whether that changes it.
    fn file(&self, path: &Path, screen: &Screen) -> Result<bool, Exit> {
        let source = read(path, screen)?;
        let mut diagnostics = Diagnostics::default();
        let Some(text) = syntax::format(&source, &mut diagnostics) else {
            screen.diagnostics(&source.into(), &diagnostics, Warnings::First, false);
            return Err(Exit::Script);
        };
        let is_changed = text != source.text();
        if path.as_os_str() == "-" && !self.check {
            let written = io::stdout().lock().write_all(text.as_bytes());
            return match output::exit(written, None, screen) {
                Exit::Ok => Ok(is_changed),
                failed => Err(failed),
            };
        }
        if is_changed && self.check {
            screen.note(&format!("{} would change", source.name()));
        } else if is_changed && let Err(error) = write_atomically(path, text.as_bytes()) {
            screen.error(&format!("cannot write {}: {error}; it is as it was", path.display()));
            return Err(Exit::Usage);
        }
        Ok(is_changed)
    }
}
