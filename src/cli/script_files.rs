//! Finds scripts, and snapshots without a script.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ignore::{DirEntry, WalkBuilder};

use super::project::Configs;

/// The scripts and snapshots in some paths.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ScriptFiles {
    /// Scripts, sorted by name, folder by folder.
    pub(super) scripts: Vec<PathBuf>,
    /// Snapshots without a script.
    pub(super) orphans: Vec<PathBuf>,
    /// Paths that cannot be read, and why.
    pub(super) unreadable: Vec<(PathBuf, String)>,
}

/// Finds the scripts in each path: `*.motion` in folders, and each path that is a file itself; a snapshot counts as its script.
/// Follows links, except cycles. In folders, skips hidden files and what `.gitignore` or the configuration leaves out.
pub(super) fn find_scripts(paths: &[PathBuf], configs: &Arc<Configs>) -> ScriptFiles {
    let mut found = ScriptFiles::default();
    for path in paths {
        let configs = Arc::clone(configs);
        let is_folder = |entry: &DirEntry| entry.file_type().is_some_and(|kind| kind.is_dir());
        let is_searched =
            move |entry: &DirEntry| entry.depth() == 0 || !configs.is_excluded(entry.path(), is_folder(entry));
        let mut walk = WalkBuilder::new(path);
        walk.follow_links(true).sort_by_file_name(Ord::cmp).filter_entry(is_searched);
        for entry in walk.build() {
            match entry {
                Ok(entry) if is_folder(&entry) => {}
                Ok(entry) => {
                    // Show `./dance.motion` as `dance.motion`.
                    let path = entry.path().strip_prefix(".").unwrap_or(entry.path());
                    found.take(path, entry.depth() == 0);
                }
                Err(error) => {
                    let (at, why) = reason(&error, path);
                    found.unreadable.push((at.strip_prefix("./").unwrap_or(at).to_owned(), why));
                }
            }
        }
    }
    let mut seen = std::collections::HashSet::new();
    found.scripts.retain(|script| seen.insert(script.clone()));
    found
}

/// What cannot be read, and why.
fn reason<'e>(error: &'e ignore::Error, path: &'e Path) -> (&'e Path, String) {
    match error {
        ignore::Error::WithDepth { err, .. } | ignore::Error::WithLineNumber { err, .. } => reason(err, path),
        ignore::Error::WithPath { path, err } => reason(err, path),
        ignore::Error::Loop { ancestor, child } => {
            (child, format!("the link forms a cycle with {}", ancestor.display()))
        }
        ignore::Error::Io(error) if error.kind() == ErrorKind::NotFound => {
            (path, "no such file or directory".to_owned())
        }
        error => (path, error.to_string()),
    }
}

impl ScriptFiles {
    fn take(&mut self, path: &Path, is_named: bool) {
        // A name need not be UTF-8.
        let name = path.file_name().unwrap_or_default();
        let script = script_of(name).map(|script| path.with_file_name(script));
        if let Some(script) = script {
            // A link that leads nowhere is still the script.
            if script.symlink_metadata().is_err_and(|error| error.kind() == ErrorKind::NotFound) {
                self.orphans.push(path.to_owned());
            } else if is_named {
                self.scripts.push(script);
            }
        } else if name.as_encoded_bytes().ends_with(b".motion") || is_named {
            self.scripts.push(path.to_owned());
        }
    }
}

/// The name of the script of a snapshot: `dance.motion` for `dance.motion.frames`, and for `dance.motion.unplug@4s.frames` of a
/// rehearsal. `None` if it is not the name of a snapshot.
fn script_of(name: &OsStr) -> Option<&OsStr> {
    let is = |name: &OsStr, end: &str| Path::new(name).extension().is_some_and(|extension| extension == end);
    let mut stem = Some(name).filter(|name| is(name, "frames")).and_then(|name| Path::new(name).file_stem());
    while let Some(script) = stem.filter(|stem| !is(stem, "motion")) {
        // Without a dot there is no extension to remove.
        stem = Path::new(script).file_stem().filter(|shorter| *shorter != script);
    }
    stem
}
