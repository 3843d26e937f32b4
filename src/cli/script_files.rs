//! Finds scripts, and snapshots that have lost theirs.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use walkdir::{DirEntry, WalkDir};

/// The files below some paths.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ScriptFiles {
    /// Every script, sorted by name, each folder's files together.
    pub(super) scripts: Vec<PathBuf>,
    /// Snapshots whose script is not there.
    pub(super) orphans: Vec<PathBuf>,
    /// What could not be looked into, and why.
    pub(super) unreadable: Vec<(PathBuf, String)>,
}

/// Finds the scripts below each path: `*.motion` in folders, and any file that is named itself; a snapshot that is
/// named stands for its script. Links are followed, but not
/// round in a circle; names that begin with a dot are passed over.
pub(super) fn find_scripts(paths: &[PathBuf]) -> ScriptFiles {
    let mut found = ScriptFiles::default();
    for path in paths {
        let is_hidden = |entry: &DirEntry| entry.depth() > 0 && entry.file_name().as_encoded_bytes().starts_with(b".");
        let walk = WalkDir::new(path).follow_links(true).sort_by_file_name();
        for entry in walk.into_iter().filter_entry(|entry| !is_hidden(entry)) {
            match entry {
                Ok(entry) if entry.file_type().is_dir() => {}
                Ok(entry) => {
                    // `./dance.motion` is `dance.motion` to whoever reads it.
                    let path = entry.path().strip_prefix(".").unwrap_or(entry.path());
                    found.take(path, entry.depth() == 0);
                }
                Err(error) => {
                    let at = error.path().unwrap_or(path);
                    let at = at.strip_prefix("./").unwrap_or(at).to_owned();
                    let why = match error.loop_ancestor() {
                        Some(ancestor) => format!("the link leads back to {}", ancestor.display()),
                        None if error.io_error().is_some_and(|error| error.kind() == ErrorKind::NotFound) => {
                            "there is nothing with this name".to_owned()
                        }
                        None => error.io_error().map_or_else(|| error.to_string(), ToString::to_string),
                    };
                    found.unreadable.push((at, why));
                }
            }
        }
    }
    let mut seen = std::collections::HashSet::new();
    found.scripts.retain(|script| seen.insert(script.clone()));
    found
}

impl ScriptFiles {
    fn take(&mut self, path: &Path, is_named: bool) {
        // A name is bytes: not all of them are UTF-8.
        let name = path.file_name().unwrap_or_default();
        let script = script_of(name).map(|script| path.with_file_name(script));
        if let Some(script) = script {
            if !script.exists() {
                self.orphans.push(path.to_owned());
            } else if is_named {
                self.scripts.push(script);
            }
        } else if name.as_encoded_bytes().ends_with(b".motion") || is_named {
            self.scripts.push(path.to_owned());
        }
    }
}

/// The name of the script that a snapshot belongs to, if a name is one: `dance.motion` of `dance.motion.frames`, and of
/// `dance.motion.unplug@4s.frames` of a rehearsal.
fn script_of(name: &OsStr) -> Option<&OsStr> {
    let is = |name: &OsStr, end: &str| Path::new(name).extension().is_some_and(|extension| extension == end);
    let mut stem = Some(name).filter(|name| is(name, "frames")).and_then(|name| Path::new(name).file_stem());
    while let Some(script) = stem.filter(|stem| !is(stem, "motion")) {
        // Without a dot in it, nothing is left to take off.
        stem = Path::new(script).file_stem().filter(|shorter| *shorter != script);
    }
    stem
}
