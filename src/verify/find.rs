//! Finds scripts, and snapshots that have lost theirs.

use std::path::{Path, PathBuf};

use walkdir::{DirEntry, WalkDir};

use super::SNAPSHOT;

/// The files below some paths.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Every script, sorted by name, each folder's files together.
    pub scripts: Vec<PathBuf>,
    /// Snapshots whose script is not there.
    pub orphans: Vec<PathBuf>,
    /// What could not be looked into, and why.
    pub unreadable: Vec<(PathBuf, String)>,
}

/// Finds the scripts below each path: `*.motion` in folders, and any file that is named itself; a snapshot that is
/// named stands for its script. Links are followed, but not
/// round in a circle; names that begin with a dot are passed over.
pub fn find(paths: &[PathBuf]) -> Found {
    let mut found = Found::default();
    for path in paths {
        let is_hidden = |entry: &DirEntry| {
            entry.depth() > 0 && entry.file_name().to_str().is_some_and(|name| name.starts_with('.'))
        };
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

impl Found {
    fn take(&mut self, path: &Path, is_named: bool) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        // `dance.motion.frames`, and `dance.motion.unplug@4s.frames` of a rehearsal.
        let stem = name.strip_suffix(SNAPSHOT);
        let script = stem.and_then(|stem| {
            let rehearsed = || stem.rfind(".motion.").and_then(|at| stem.get(..at + ".motion".len()));
            Some(stem).filter(|script| script.ends_with(".motion")).or_else(rehearsed)
        });
        if let Some(script) = script.map(|script| path.with_file_name(script)) {
            if !script.exists() {
                self.orphans.push(path.to_owned());
            } else if is_named {
                self.scripts.push(script);
            }
        } else if name.ends_with(".motion") || is_named {
            self.scripts.push(path.to_owned());
        }
    }
}
