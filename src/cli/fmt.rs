//! `motionseq fmt`: formats scripts.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::diagnostic::Diagnostics;
use motionseq::syntax;
use motionseq::verify::{expectation, expected_error};

use super::atomic_file::replace;
use super::exit::Exit;
use super::output;
use super::project::ConfigOptions;
use super::read;
use super::screen::{Screen, Warnings, plural};
use super::script_files::find_scripts;
use super::unified_diff::unified_diff;

/// Format scripts without changing what they send
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq fmt .                          # all scripts in this folder\n  motionseq fmt --check scripts/*.motion   # for CI: change no file, fail if one is not formatted\n  motionseq fmt --diff .                   # show what would change\n  motionseq fmt - < draft.motion           # format standard input to standard output\n\nLine breaks and comments are kept. A script with syntax errors is not changed."
)]
pub(super) struct Fmt {
    /// Scripts or folders to format, or `-` for standard input [default: `paths` of motionseq.toml, else this folder]
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Change no file; list the scripts that are not formatted, and fail if there are any
    #[arg(long)]
    check: bool,
    /// Change no file; show what would change, and fail if anything would
    #[arg(long)]
    diff: bool,
    #[command(flatten)]
    config: ConfigOptions,
}

impl Fmt {
    /// Formats every file; fails if one cannot be read, or with `--check` or `--diff` if one would change.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let configs = self.config.configs();
        let paths = match configs.searched(&self.files, screen) {
            Ok(paths) => paths,
            Err(exit) => return exit,
        };
        if self.files.iter().filter(|file| file.as_os_str() == "-").count() > 1 {
            screen.error("standard input can be read only once: write `-` once");
            return Exit::Usage;
        }
        let mut exit = Exit::Ok;
        let (mut changed, mut failed) = (0_usize, 0_usize);
        let (folders, mut files): (Vec<_>, Vec<_>) = paths.into_iter().partition(|path| path.is_dir());
        let found = find_scripts(&folders, &configs);
        for (path, why) in &found.unreadable {
            screen.error(&format!("cannot read {}: {why}", path.display()));
            exit = Exit::Script;
        }
        let named = files.len();
        files.extend(found.scripts);
        if files.is_empty() && exit == Exit::Ok {
            let folders: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
            screen.error(&format!("no .motion files in {}", folders.join(", ")));
            return Exit::Script;
        }
        for (at, file) in files.iter().enumerate() {
            // A wrong configuration may have lost what it excludes.
            if let Err(exit) = configs.of_script(file, screen) {
                return exit;
            }
            match self.file(file, at >= named, screen) {
                Ok(is_changed) => changed += usize::from(is_changed),
                Err(cause) => (exit, failed) = (cause, failed + 1),
            }
        }
        let scripts = plural(files.len(), "script");
        let is_dry = self.check || self.diff;
        let what = match (is_dry, changed) {
            (_, 0) if failed == 0 => "all formatted".to_owned(),
            (true, _) => format!("{changed} not formatted"),
            (false, _) => format!("{changed} formatted"),
        };
        let failed = if failed > 0 { format!(", {failed} cannot be formatted") } else { String::new() };
        let how = if is_dry && changed > 0 { "; format with `motionseq fmt FILE`" } else { "" };
        screen.note(&format!("{scripts} checked, {what}{failed}{how}"));
        if exit == Exit::Ok && is_dry && changed > 0 { Exit::Script } else { exit }
    }

    /// Formats a file; returns whether that changes it. A script in a folder that declares its error is a test case.
    fn file(&self, path: &Path, is_found: bool, screen: &Screen) -> Result<bool, Exit> {
        let source = read(path, screen)?;
        let mut diagnostics = Diagnostics::default();
        let Some(text) = syntax::format(&source, &mut diagnostics) else {
            let expected = expected_error(&source).filter(|_| is_found);
            if expected.is_some_and(|expected| expectation(expected, &diagnostics).is_ok()) {
                return Ok(false);
            }
            screen.diagnostics(&source.into(), &diagnostics, Warnings::First, false);
            return Err(Exit::Script);
        };
        let is_changed = text != source.text();
        if is_changed && self.check {
            screen.note(&format!("{} is not formatted", source.name()));
        }
        let printed = if self.diff {
            unified_diff(source.name(), source.text(), &text, screen)
        } else if self.check {
            return Ok(is_changed);
        } else if path.as_os_str() == "-" {
            text
        } else if is_changed && let Err(error) = replace(path, source.text().as_bytes(), text.as_bytes()) {
            screen.error(&format!("cannot write {}: {error}; the file is unchanged", path.display()));
            return Err(Exit::Usage);
        } else {
            return Ok(is_changed);
        };
        match output::exit(io::stdout().lock().write_all(printed.as_bytes()), None, screen) {
            Exit::Ok => Ok(is_changed),
            failed => Err(failed),
        }
    }
}
