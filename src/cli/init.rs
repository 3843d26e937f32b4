//! `motionseq init`: starts a project in an empty folder.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::program::Options;
use motionseq::source::Source;
use motionseq::timeline::write_snapshot;
use motionseq::verify::{SNAPSHOT, shell_word};

use super::exit::Exit;
use super::project::{Configs, NAME};
use super::screen::Screen;

/// Start a project in an empty folder
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq init && motionseq test     # in an empty folder, or in a new git repository\n  motionseq init show                  # creates the folder `show`\n\nIt writes motionseq.toml, a first script with its snapshot, and a workflow for GitHub."
)]
pub(super) struct Init {
    /// Folder to write to; it is created if it does not exist
    #[arg(default_value = ".", value_name = "DIR")]
    folder: PathBuf,
}

/// The first script.
const SCRIPT: &str = "first.motion";
/// The files, except the snapshot of the script.
const FILES: [(&str, &str); 3] = [
    (NAME, include_str!("init/motionseq.toml")),
    (SCRIPT, include_str!("init/first.motion")),
    (".github/workflows/motionseq.yml", include_str!("../../docs/ci/github.yml")),
];
/// How many entries of a folder are named.
const SHOWN: usize = 3;

impl Init {
    /// Writes the files, or nothing.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let folder = &self.folder;
        let refuse = |why: &str| {
            screen.error(&format!("cannot start a project in {}: {why}", folder.display()));
            Exit::Usage
        };
        match entries(folder) {
            Ok(found) if found.is_empty() => {}
            Ok(found) => return refuse(&format!("it contains {}; choose an empty folder", named(&found))),
            Err(error) => return refuse(&error.to_string()),
        }
        let mut written = Written::default();
        if let Err(error) = write_project(folder, &mut written) {
            written.remove();
            return refuse(&format!("{error}; nothing was written"));
        }
        for path in &written.files {
            screen.note(&format!("wrote {}", path.strip_prefix(".").unwrap_or(path).display()));
        }
        if let Some(above) = Configs::above(folder) {
            screen.note(&format!("of {above}, only the limits apply here"));
        }
        let is_inside = |folder: &Path| folder.ancestors().skip(1).any(|above| above.join(".git").exists());
        if !folder.join(".git").exists() && folder.canonicalize().is_ok_and(|folder| is_inside(&folder)) {
            screen
                .note("GitHub reads workflows only in the folder `.github` at the root of a repository: move it there");
        }
        let there = folder.display().to_string();
        let go = if there == "." { String::new() } else { format!("cd {} && ", shell_word(&there)) };
        screen.note(&format!("next: {go}motionseq test && motionseq play {SCRIPT}"));
        Exit::Ok
    }
}

/// What is in a folder, except that of git; a folder that does not exist is empty.
fn entries(folder: &Path) -> io::Result<Vec<String>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let names: io::Result<Vec<_>> = entries.map(|entry| entry.map(|entry| entry.file_name())).collect();
    let names = names?.into_iter().filter(|name| name != ".git");
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    Ok(names)
}

/// `a, b, c and 4 more`.
fn named(entries: &[String]) -> String {
    let shown = entries.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    match entries.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// What was created, in this order.
#[derive(Default)]
struct Written {
    files: Vec<PathBuf>,
    folders: Vec<PathBuf>,
}

impl Written {
    /// Creates a folder and those above it.
    fn folder(&mut self, path: &Path) -> io::Result<()> {
        if path.as_os_str().is_empty() || path.is_dir() {
            return Ok(());
        }
        if let Some(above) = path.parent() {
            self.folder(above)?;
        }
        fs::create_dir(path)?;
        self.folders.push(path.to_owned());
        Ok(())
    }

    /// Creates a file.
    fn file(&mut self, path: PathBuf, text: &[u8]) -> io::Result<()> {
        self.folder(path.parent().unwrap_or(Path::new("")))?;
        let mut file = OpenOptions::new().write(true).create_new(true).open(&path)?;
        self.files.push(path);
        file.write_all(text)?;
        file.sync_all()
    }

    /// Removes everything again.
    fn remove(self) {
        for file in self.files {
            let _ = fs::remove_file(file);
        }
        for folder in self.folders.into_iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

fn write_project(folder: &Path, written: &mut Written) -> io::Result<()> {
    for (path, text) in FILES {
        written.file(folder.join(path), text.as_bytes())?;
        if path == SCRIPT {
            written.file(folder.join(format!("{path}{SNAPSHOT}")), &snapshot(text)?)?;
        }
    }
    Ok(())
}

/// The snapshot of the first script.
fn snapshot(script: &str) -> io::Result<Vec<u8>> {
    let compiled = motionseq::compile(&Source::new(SCRIPT, script).into(), &Options::default());
    if compiled.timelines.is_empty() {
        return Err(io::Error::other("the first script does not compile"));
    }
    let mut text = Vec::new();
    write_snapshot(SCRIPT, &compiled.timelines, &mut text)?;
    Ok(text)
}
