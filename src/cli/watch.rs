//! `--watch`: runs a command again after each change of its files.

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::sleep;
use std::time::{Duration, SystemTime};

use clap::Args;
use motionseq::source::{Disk, Files, Source, SourceError, Sources, UseError};
use motionseq::verify::snapshot_of;

use super::Options;
use super::exit::Exit;
use super::project::{Config, Configs};
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

/// The scripts in some paths, every file that they use or name, their snapshots, and the files that configure them.
#[derive(Debug)]
struct Watched {
    files: Vec<(PathBuf, State)>,
    paths: Vec<PathBuf>,
    configs: Arc<Configs>,
}

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
        let mut all = files_of(&scripts, options);
        let folders = scripts.iter().filter_map(|script| script.parent());
        let folders = folders.chain(paths.iter().map(PathBuf::as_path)).chain([Path::new("")]);
        for folder in folders.collect::<BTreeSet<_>>() {
            all.extend(configs.candidates(folder));
        }
        all.extend(paths.iter().filter(|path| !path.is_dir()).cloned());
        all.sort_unstable();
        all.dedup();
        let files = all.into_iter().map(|path| (path.clone(), state(&path))).collect();
        Watched { files, paths: paths.to_owned(), configs }
    }

    /// How many of them exist.
    fn existing(&self) -> usize {
        self.files.iter().filter(|(_, state)| state.is_some()).count()
    }

    /// A file that has changed, or a script that is new.
    fn changed(&self) -> Option<PathBuf> {
        let known = |path: &Path| self.files.binary_search_by(|(other, _)| other.as_path().cmp(path)).is_ok();
        let has_changed = |(path, before): &&(PathBuf, State)| state(path) != *before;
        let changed = self.files.iter().find(has_changed).map(|(path, _)| path.clone());
        let all = || find_scripts(&self.paths, &self.configs).scripts;
        changed.or_else(|| all().into_iter().find(|script| !known(script)))
    }
}

/// Some scripts, their snapshots, and every file that they use or name.
pub(super) fn files_of(scripts: &[PathBuf], options: &Options) -> Vec<PathBuf> {
    let noted = NotedFiles::default();
    for script in scripts {
        noted.note(script.clone());
        noted.note(snapshot_of(script));
        if let Ok(source) = Disk.read(script) {
            // Limits do not matter for what a script uses.
            motionseq::compile(&Sources::new(source, noted.clone()), &options.of_library(&Config::default()));
        }
    }
    std::mem::take(&mut *noted.0.lock().unwrap_or_else(PoisonError::into_inner))
}

fn state(path: &Path) -> State {
    path.metadata().ok().map(|meta: Metadata| (meta.modified().unwrap_or(SystemTime::UNIX_EPOCH), meta.len()))
}

impl Watch {
    /// Runs a command for the named paths, or else for those that the configuration searches. With `--watch`, runs it again after
    /// each change; that ends only with a signal.
    pub(super) fn run(
        self,
        named: &[PathBuf],
        options: &Options,
        screen: &Screen,
        run: impl Fn(&[PathBuf]) -> Exit,
    ) -> Exit {
        let searched = || options.config.configs().searched(named, screen);
        if !self.watch {
            return searched().map_or_else(|exit| exit, |paths| run(&paths));
        }
        if named.iter().any(|path| path.as_os_str() == "-") {
            screen.error("standard input cannot be watched; write the name of a file");
            return Exit::Usage;
        }
        loop {
            // Looked at before the run, so that a change during it is not missed.
            let paths = searched();
            let watched = Watched::of(paths.as_ref().map_or(named, Vec::as_slice), options);
            if let Ok(paths) = paths {
                run(&paths);
            }
            screen.note(&format!("watching {}; Ctrl-C ends", plural(watched.existing(), "file")));
            let changed = loop {
                sleep(INTERVAL);
                if let Some(changed) = watched.changed() {
                    break changed;
                }
            };
            screen.clear();
            screen.note(&format!("{} changed", changed.display()));
        }
    }
}
