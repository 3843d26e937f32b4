//! What a configuration file sets.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ignore::gitignore::Gitignore;
use motionseq::diagnostic::Denied;
use motionseq::program::ProjectLimit;
use motionseq::units::Nanos;
use serde_json::Value;

use super::VIRTUAL;

/// A value, and the line that sets it.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Setting<T> {
    /// What is used.
    pub(in super::super) value: T,
    /// As the file has it.
    pub(in super::super) written: Value,
    /// The line in the file, counted from 1.
    pub(in super::super) line: usize,
}

/// What a configuration file sets; the default is that of a project without one.
#[derive(Debug, Default)]
pub(in super::super) struct Config {
    /// The file.
    pub(in super::super) path: Option<PathBuf>,
    /// Its name in messages.
    pub(in super::super) name: String,
    /// The port of `play`; `None` as the value is the virtual board.
    pub(in super::super) port: Option<Setting<Option<PathBuf>>>,
    /// What is searched if no path is named.
    pub(in super::super) paths: Option<Setting<Vec<PathBuf>>>,
    /// What searches leave out.
    pub(in super::super) exclude: Option<Setting<Gitignore>>,
    /// The warnings that fail a script.
    pub(in super::super) deny: Option<Setting<Denied>>,
    /// The default of `play --max-late`.
    pub(in super::super) max_late: Option<Setting<Nanos>>,
    /// Limits of all scripts, each with its name and its line.
    pub(in super::super) limits: Vec<(String, Setting<ProjectLimit>)>,
    /// The next file above. Its limits apply, too.
    pub(in super::super) above: Option<Arc<Config>>,
}

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) enum Source {
    /// An option of the command line.
    Option,
    /// An environment variable.
    Environment(String),
    /// A line of the configuration file: `motionseq.toml:4`.
    File(String),
    /// Nothing sets it.
    Default,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Source::Option => "command line",
            Source::Environment(name) => name,
            Source::File(place) => place,
            Source::Default => "default",
        })
    }
}

/// The port of a run, and what chose it.
#[derive(Clone, Debug)]
pub(in super::super) struct ChosenPort {
    /// Its path; `None` for the virtual board.
    pub(in super::super) path: Option<PathBuf>,
    pub(in super::super) source: Source,
}

impl ChosenPort {
    /// ` (port from motionseq.toml:4)` if neither the command line nor the default chose it.
    pub(in super::super) fn origin(&self) -> String {
        match &self.source {
            Source::Option | Source::Default => String::new(),
            source => format!(" (port from {source})"),
        }
    }
}

/// The variable with the port.
const PORT: &str = "MOTIONSEQ_PORT";
/// The default of `--max-late`: on a real port, and on the virtual board.
const MAX_LATE: [Nanos; 2] = [Nanos::from_millis(50), Nanos::from_millis(1_000)];

/// The path of a port; `None` for the virtual board.
fn path(name: &Path) -> Option<PathBuf> {
    (!name.as_os_str().is_empty() && name != Path::new(VIRTUAL)).then(|| name.to_owned())
}

impl Config {
    /// The port of `play`: that of the command line, of the environment, or of this file.
    pub(in super::super) fn port(&self, asked: Option<&Path>) -> ChosenPort {
        if let Some(asked) = asked {
            return ChosenPort { path: path(asked), source: Source::Option };
        }
        if let Some(set) = std::env::var_os(PORT) {
            return ChosenPort { path: path(Path::new(&set)), source: Source::Environment(PORT.to_owned()) };
        }
        match &self.port {
            Some(set) => ChosenPort { path: set.value.clone(), source: Source::File(self.place(set.line)) },
            None => ChosenPort { path: None, source: Source::Default },
        }
    }

    /// The port of one of several robots: that of the command line, or of the environment.
    pub(in super::super) fn port_of(robot: &str, asked: Option<&Path>) -> ChosenPort {
        if let Some(asked) = asked {
            return ChosenPort { path: path(asked), source: Source::Option };
        }
        let variable = format!("{PORT}_{}", robot.to_uppercase());
        match std::env::var_os(&variable) {
            Some(set) => ChosenPort { path: path(Path::new(&set)), source: Source::Environment(variable) },
            None => ChosenPort { path: None, source: Source::Default },
        }
    }

    /// What is wrong if only a port for one robot is set, and a script has several: it would play on virtual boards.
    pub(in super::super) fn common_port(&self) -> Option<String> {
        let set = match &self.port {
            _ if std::env::var_os(PORT).is_some_and(|set| !set.is_empty() && set != VIRTUAL) => PORT.to_owned(),
            Some(set) if set.value.is_some() => format!("`port` in {}", self.place(set.line)),
            _ => return None,
        };
        Some(format!(
            "{set} is for scripts with one robot, and this one has several; write `--port NAME=PATH`, set {PORT}_NAME, or write `--port {VIRTUAL}`"
        ))
    }

    /// How late a frame may be without `--max-late`, on a real port or on the virtual board.
    pub(in super::super) fn max_late(&self, is_real: bool) -> Nanos {
        let [on_port, on_virtual] = MAX_LATE;
        let usual = if is_real { on_port } else { on_virtual };
        self.max_late.as_ref().map_or(usual, |set| set.value)
    }

    /// A line of the file, as messages name it.
    pub(in super::super) fn place(&self, line: usize) -> String {
        format!("{}:{line}", self.name)
    }

    /// The limits of this file and of those above, as the library takes them.
    pub(in super::super) fn limits(&self) -> Vec<ProjectLimit> {
        self.with_those_above().flat_map(|config| &config.limits).map(|(_, limit)| limit.value.clone()).collect()
    }

    /// This file and those above, nearest first.
    pub(in super::super) fn with_those_above(&self) -> impl Iterator<Item = &Config> {
        std::iter::successors(Some(self), |config| config.above.as_deref())
    }

    /// Whether a search leaves out a path, which has no links in it.
    pub(in super::super) fn excludes(&self, path: &Path, is_folder: bool) -> bool {
        self.exclude.as_ref().is_some_and(|exclude| exclude.value.matched(path, is_folder).is_ignore())
    }

    /// The warnings that fail a script, and what a message names as the reason: the command line, or else this file.
    pub(in super::super) fn denied(&self, asked: &[Denied]) -> (Denied, String) {
        let asked = asked.iter().fold(Denied::default(), Denied::and);
        let by_option = if asked.is_all() { "`--deny warnings`" } else { "`--deny`" }.to_owned();
        match &self.deny {
            Some(set) if !asked.is_any() => (set.value.clone(), format!("`deny` in {}", self.place(set.line))),
            Some(set) => (asked.and(&set.value), by_option),
            None => (asked, by_option),
        }
    }
}
