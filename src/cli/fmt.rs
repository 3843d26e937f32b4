//! `motionseq fmt`: formats scripts.

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

/// Format scripts without changing what they send
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq fmt scripts/*.motion\n  motionseq fmt --check scripts/*.motion   # for CI: change no file, fail if one is not formatted\n  motionseq fmt - < draft.motion           # format standard input to standard output\n\nLine breaks and comments are kept. A script with syntax errors is not changed."
)]
pub(super) struct Fmt {
    /// Scripts to format, or `-` for standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Change no file; list the scripts that are not formatted, and fail if there are any
    #[arg(long)]
    check: bool,
}

impl Fmt {
    /// Formats every file; fails if one cannot be read, or with `--check` if one would change.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        if self.files.iter().filter(|file| file.as_os_str() == "-").count() > 1 {
            screen.error("standard input can be read only once: write `-` once");
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
        let scripts = plural(self.files.len(), "script");
        screen.note(&match (self.check, changed) {
            (_, 0) if failed > 0 => format!("{scripts} checked, {failed} cannot be formatted"),
            (_, 0) => format!("{scripts} checked, all formatted"),
            (true, _) => format!("{scripts} checked, {changed} not formatted; format with `motionseq fmt FILE`"),
            (false, _) => format!("{scripts} checked, {changed} formatted"),
        });
        if exit == Exit::Ok && self.check && changed > 0 { Exit::Script } else { exit }
    }

    /// Formats a file; returns whether that changes it.
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
            screen.note(&format!("{} is not formatted", source.name()));
        } else if is_changed && let Err(error) = write_atomically(path, text.as_bytes()) {
            screen.error(&format!("cannot write {}: {error}; the file is unchanged", path.display()));
            return Err(Exit::Usage);
        }
        Ok(is_changed)
    }
}
