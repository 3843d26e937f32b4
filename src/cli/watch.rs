//! `--watch`: runs a command again after each change of its files.

use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::sleep;
use std::time::{Duration, SystemTime};

use clap::Args;
use motionseq::source::{Disk, Files, Source, SourceError, Sources, UseError};
use motionseq::verify::SNAPSHOT;

use super::Options;
use super::exit::Exit;
use super::project::Config;
use super::screen::{Screen, plural};
use super::script_files::find_scripts;

/// Whether a command runs again after each change.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct Watch {
    /// Run again after each change of a script or of a file that it uses, until Ctrl-C
    #[arg(long)]
    pub(super) watch: bool,
}

/// The interval between two looks at the files.
const INTERVAL: Duration = Duration::from_millis(200);

/// What shows that a file has changed; `None` if it does not exist.
type State = Option<(SystemTime, u64)>;

/// The scripts in some paths, every file that they use or name, and their snapshots.
#[derive(Debug, PartialEq, Eq)]
struct Watched(Vec<(PathBuf, State)>);

/// Notes every file that a script asks for, also those that do not exist yet.
#[derive(Clone, Debug, Default)]
struct NotedFiles(Arc<Mutex<Vec<PathBuf>>>);

impl NotedFiles {
    fn note(&self, path: PathBuf) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(path);
    }
}

impl Files for NotedFiles {
    fn resolve(&self, main: &Path, from: &Path, name: &str) -> Result<PathBuf, UseError> {
        Disk.resolve(main, from, name).inspect_err(|_| self.note(from.with_file_name(name)))
    }

    fn read(&self, path: &Path) -> Result<Source, SourceError> {
        self.note(path.to_owned());
        Disk.read(path)
    }
}

impl Watched {
    fn of(paths: &[PathBuf], options: &Options) -> Self {
        let configs = options.config.configs();
        let scripts = find_scripts(paths, &configs).scripts;
        let noted = NotedFiles::default();
        for script in &scripts {
            let folder = script.parent().unwrap_or(Path::new(""));
            configs.candidates(folder).into_iter().for_each(|path| noted.note(path));
            noted.note(script.clone());
            let mut snapshot = script.clone().into_os_string();
            snapshot.push(SNAPSHOT);
            noted.note(snapshot.into());
            if let Ok(source) = Disk.read(script) {
                // Limits do not matter for what a script uses.
                motionseq::compile(&Sources::new(source, noted.clone()), &options.of_library(&Config::default()));
            }
        }
        let mut all = std::mem::take(&mut *noted.0.lock().unwrap_or_else(PoisonError::into_inner));
        all.extend(paths.iter().filter(|path| !path.is_dir()).cloned());
        all.sort_unstable();
        all.dedup();
        Watched(all.into_iter().map(|path| (path.clone(), state(&path))).collect())
    }

    /// How many of them exist.
    fn existing(&self) -> usize {
        self.0.iter().filter(|(_, state)| state.is_some()).count()
    }

    /// A file that has changed, or is new in `paths`.
    fn changed(&self, paths: &[PathBuf], options: &Options) -> Option<PathBuf> {
        let known = |path: &Path| self.0.binary_search_by(|(other, _)| other.as_path().cmp(path)).is_ok();
        let has_changed = |(path, before): &&(PathBuf, State)| state(path) != *before;
        let changed = self.0.iter().find(has_changed).map(|(path, _)| path.clone());
        let all = || find_scripts(paths, &options.config.configs()).scripts;
        changed.or_else(|| all().into_iter().find(|script| !known(script)))
    }
}

fn state(path: &Path) -> State {
    path.metadata().ok().map(|meta: Metadata| (meta.modified().unwrap_or(SystemTime::UNIX_EPOCH), meta.len()))
}

impl Watch {
    /// Runs once or, with `--watch`, again after each change of the scripts in `paths`; that ends only with a signal.
    pub(super) fn run(self, paths: &[PathBuf], options: &Options, screen: &Screen, run: impl Fn() -> Exit) -> Exit {
        if !self.watch {
            return run();
        }
        if paths.iter().any(|path| path.as_os_str() == "-") {
            screen.error("standard input cannot be watched; write the name of a file");
            return Exit::Usage;
        }
        loop {
            // Looked at before the run, so that a change during it is not missed.
            let watched = Watched::of(paths, options);
            run();
            screen.note(&format!("watching {}; Ctrl-C ends", plural(watched.existing(), "file")));
            let changed = loop {
                sleep(INTERVAL);
                if let Some(changed) = watched.changed(paths, options) {
                    break changed;
                }
            };
            screen.clear();
            screen.note(&format!("{} changed", changed.display()));
        }
    }
}
