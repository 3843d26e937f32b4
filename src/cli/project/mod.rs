//! The configuration of a project: `motionseq.toml`, found upward from each script.

mod read;
mod settings;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use clap::Args;
use motionseq::diagnostic::Diagnostics;
use motionseq::report::{self, Finding};
use motionseq::source::{Source, read_file};

use super::exit::Exit;
use super::screen::{Screen, Warnings};
#[cfg(target_os = "linux")]
pub(super) use read::max_late;
#[cfg(target_os = "linux")]
pub(super) use settings::ChosenPort;
pub(super) use settings::{Config, Source as ValueSource};

/// The name of the file.
pub(super) const NAME: &str = "motionseq.toml";
/// The name of the virtual board as a port.
pub(super) const VIRTUAL: &str = "virtual";
/// The longest file that is read, in bytes.
const MOST: u64 = 1 << 20;

/// Which configuration applies.
#[derive(Clone, Debug, Default, Args)]
pub(super) struct ConfigOptions {
    /// Use this configuration file instead of the nearest motionseq.toml
    #[arg(long, value_name = "FILE", help_heading = "Configuration options")]
    config: Option<PathBuf>,
    /// Ignore every motionseq.toml
    #[arg(long, conflicts_with = "config", help_heading = "Configuration options")]
    isolated: bool,
}

/// Why there is no configuration.
#[derive(Debug)]
pub(super) enum ConfigError {
    /// It cannot be read.
    Unreadable(String),
    /// It is wrong.
    Wrong(Box<(Source, Diagnostics)>),
}

impl ConfigError {
    /// Shows it. Nothing is compiled, because a limit might be missing.
    pub(super) fn show(&self, screen: &Screen) -> Exit {
        match self {
            ConfigError::Unreadable(why) => screen.error(why),
            ConfigError::Wrong(wrong) => {
                let (source, found) = &**wrong;
                screen.diagnostics(&source.clone().into(), found, Warnings::First, false);
            }
        }
        Exit::Usage
    }

    /// The same as findings.
    pub(super) fn findings(&self) -> Vec<Finding> {
        match self {
            ConfigError::Unreadable(why) => vec![Finding::unreadable(NAME, why.clone())],
            ConfigError::Wrong(wrong) => report::findings(&wrong.0.clone().into(), &wrong.1),
        }
    }
}

/// What applies to a folder, or why that is unknown.
pub(super) type Found = Result<Arc<Config>, Arc<ConfigError>>;

/// The configurations of this run, each read once.
#[derive(Debug)]
pub(super) struct Configs {
    options: ConfigOptions,
    /// By folder, as scripts name it. The path is the folder with links resolved.
    folders: Mutex<BTreeMap<PathBuf, (Found, PathBuf)>>,
    /// By path of the configuration file.
    files: Mutex<BTreeMap<PathBuf, Found>>,
}

impl ConfigOptions {
    /// The configurations that these options choose.
    pub(super) fn configs(&self) -> Arc<Configs> {
        Arc::new(Configs { options: self.clone(), folders: Mutex::default(), files: Mutex::default() })
    }

    /// These options for another run of this program.
    pub(super) fn arguments(&self) -> Vec<OsString> {
        let file = self.config.iter().flat_map(|file| ["--config".into(), file.clone().into_os_string()]);
        file.chain(self.isolated.then(|| "--isolated".into())).collect()
    }

    /// What applies to a script, or to standard input, which has no path; an error is shown.
    pub(super) fn of_script(&self, script: Option<&Path>, screen: &Screen) -> Result<Arc<Config>, Exit> {
        self.configs().of_script(script.unwrap_or(Path::new("")), screen)
    }
}

impl Configs {
    /// What applies to a script; an error is shown.
    pub(super) fn of_script(&self, script: &Path, screen: &Screen) -> Result<Arc<Config>, Exit> {
        self.of_folder(folder_of(script), screen)
    }

    /// What applies to a script; an error is not shown.
    pub(super) fn found_for(&self, script: &Path) -> Found {
        self.found(folder_of(script)).0
    }

    /// What applies to the scripts in a folder; an error is shown.
    pub(super) fn of_folder(&self, folder: &Path, screen: &Screen) -> Result<Arc<Config>, Exit> {
        self.found(folder).0.map_err(|error| error.show(screen))
    }

    /// What a command searches: the named paths, else `paths` of the configuration, else the current folder; an error is shown.
    pub(super) fn searched(&self, named: &[PathBuf], screen: &Screen) -> Result<Vec<PathBuf>, Exit> {
        if !named.is_empty() {
            return Ok(named.to_owned());
        }
        let config = self.of_folder(Path::new(""), screen)?;
        Ok(config.paths.as_ref().map_or_else(|| vec![PathBuf::from(".")], |paths| paths.value.clone()))
    }

    /// Whether a file or a folder is excluded from searches.
    pub(super) fn is_excluded(&self, path: &Path, is_folder: bool) -> bool {
        let (found, folder) = self.found(folder_of(path));
        // An error is shown for the scripts of that folder.
        found.is_ok_and(|config| config.excludes(&folder.join(path.file_name().unwrap_or_default()), is_folder))
    }

    /// The configuration files in a folder and above it that do not apply there, as messages name them.
    pub(super) fn not_used(&self, folder: &Path, used: &Config) -> Vec<String> {
        let (_, resolved) = self.found(folder);
        let here = std::env::current_dir().unwrap_or_default();
        let is_used = |path: &PathBuf| used.with_those_above().any(|config| config.path.as_ref() == Some(path));
        let others = upward(&resolved).filter_map(Result::ok).filter(|path| !is_used(path));
        others.map(|path| from_here(&here, &path).display().to_string()).collect()
    }

    /// The name of the nearest configuration file above a folder.
    pub(super) fn above(folder: &Path) -> Option<String> {
        let here = std::env::current_dir().ok()?;
        let file = nearest(folder.canonicalize().ok()?.parent()?).ok()??;
        Some(from_here(&here, &file).display().to_string())
    }

    /// The paths where a configuration for a folder is or would be.
    pub(super) fn candidates(&self, folder: &Path) -> Vec<PathBuf> {
        match &self.options {
            ConfigOptions { isolated: true, .. } => Vec::new(),
            ConfigOptions { config: Some(file), .. } => vec![file.clone()],
            _ => self.found(folder).1.ancestors().map(|folder| folder.join(NAME)).collect(),
        }
    }

    fn found(&self, folder: &Path) -> (Found, PathBuf) {
        let mut folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((found, resolved)) = folders.get(folder) {
            return (found.clone(), resolved.clone());
        }
        // An editor names files that do not exist yet.
        let existing = folder.ancestors().find(|folder| folder.as_os_str().is_empty() || folder.exists());
        let resolved = Path::new(".").join(existing.unwrap_or(folder)).canonicalize();
        let found = match (&self.options, &resolved) {
            (ConfigOptions { isolated: true, .. }, _) => Ok(Arc::default()),
            (ConfigOptions { config: Some(file), .. }, _) => self.file(file, None),
            (_, Err(error)) => Err(Arc::new(unreadable(folder, error))),
            (_, Ok(resolved)) => match nearest(resolved) {
                Ok(None) => Ok(Arc::default()),
                Ok(Some(file)) => self.file(&file, file.parent()),
                Err(error) => Err(Arc::new(unreadable(folder, &error))),
            },
        };
        let found = (found, resolved.unwrap_or_default());
        folders.insert(folder.to_owned(), found.clone());
        found
    }

    /// Reads a file, once. Its paths and patterns are relative to `base`, or to the current folder. The files above `base` count
    /// for their limits.
    fn file(&self, path: &Path, base: Option<&Path>) -> Found {
        let files = || self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = files().get(path) {
            return found.clone();
        }
        let above = base.and_then(Path::parent).and_then(|folder| match nearest(folder) {
            Ok(file) => file.map(|file| self.file(&file, file.parent())),
            Err(error) => Some(Err(Arc::new(unreadable(folder, &error)))),
        });
        let found = match (load(path, base), above) {
            (Err(error), _) => Err(Arc::new(error)),
            (Ok(_), Some(Err(error))) => Err(error),
            (Ok(config), Some(Ok(above))) => Ok(Arc::new(Config { above: Some(above), ..config })),
            (Ok(config), None) => Ok(Arc::new(config)),
        };
        files().insert(path.to_owned(), found.clone());
        found
    }
}

fn unreadable(folder: &Path, error: &io::Error) -> ConfigError {
    ConfigError::Unreadable(format!("cannot look for {NAME} in {}: {error}; `--isolated` ignores it", folder.display()))
}

/// The folder of a file; empty for the current folder.
fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// The configuration files that are found upward from a folder, nearest first. One that is a broken link counts, because it cannot be
/// read.
fn upward(folder: &Path) -> impl Iterator<Item = io::Result<PathBuf>> {
    folder.ancestors().map(|folder| folder.join(NAME)).filter_map(|path| match path.symlink_metadata() {
        Ok(_) => Some(Ok(path)),
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => None,
        Err(error) => Some(Err(error)),
    })
}

fn nearest(folder: &Path) -> io::Result<Option<PathBuf>> {
    upward(folder).next().transpose()
}

fn load(path: &Path, base: Option<&Path>) -> Result<Config, ConfigError> {
    let here = std::env::current_dir().unwrap_or_default();
    let name = from_here(&here, path).display().to_string();
    let bytes = read_file(path, MOST).map_err(|error| {
        let error = match error.kind() {
            _ if path.is_dir() => "it is a folder".to_owned(),
            ErrorKind::NotFound => "no such file or directory".to_owned(),
            _ => error.to_string(),
        };
        let help = if base.is_some() { "; `--isolated` ignores it" } else { "" };
        ConfigError::Unreadable(format!("cannot read {name}: {error}{help}"))
    })?;
    let source = match Source::read_from(name, bytes.as_slice()) {
        Ok(source) => source,
        Err(error) => return Err(read::not_text(error)),
    };
    read::read(source, path, base.unwrap_or(&here))
}

/// A path as it is named from a folder: `../motionseq.toml`. Paths with nothing in common stay as they are.
fn from_here(here: &Path, path: &Path) -> PathBuf {
    if !path.is_absolute() {
        return path.strip_prefix(".").unwrap_or(path).to_owned();
    }
    let common = here.ancestors().find(|folder| folder.parent().is_some() && path.starts_with(folder));
    let Some((common, rest)) = common.and_then(|common| Some((common, path.strip_prefix(common).ok()?))) else {
        return path.to_owned();
    };
    let up = here.strip_prefix(common).map_or(0, |below| below.components().count());
    let path = std::iter::repeat_n("..", up).collect::<PathBuf>().join(rest);
    if path.as_os_str().is_empty() { PathBuf::from(".") } else { path }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_named_from_the_current_folder() {
        let here = Path::new("/a/b");
        for (path, named) in [
            ("/a/b/motionseq.toml", "motionseq.toml"),
            ("/a/b", "."),
            ("/a/motionseq.toml", "../motionseq.toml"),
            ("/a/c/motionseq.toml", "../c/motionseq.toml"),
            ("/etc/motionseq.toml", "/etc/motionseq.toml"),
            ("c/motionseq.toml", "c/motionseq.toml"),
        ] {
            assert_eq!(from_here(here, Path::new(path)), Path::new(named), "{path}");
        }
    }
}
