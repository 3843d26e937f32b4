//! Corrections of scripts and of the files that they use. They are in memory until all scripts are corrected.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motionseq::Compiled;
use motionseq::diagnostic::Edit;
use motionseq::program::Options;
use motionseq::source::{Disk, Files, Source, SourceError, Sources, UseError};
use motionseq::verify::expected_error;

/// The files of the disk as they will be: with their corrections.
#[derive(Clone, Debug, Default)]
pub(super) struct Corrected {
    files: Arc<Mutex<BTreeMap<PathBuf, Correction>>>,
}

/// The correction of one file.
#[derive(Clone, Debug)]
pub(super) struct Correction {
    /// The name of the file in messages.
    pub(super) name: String,
    /// The text as it was read.
    pub(super) old: String,
    /// The corrected text.
    pub(super) new: String,
    /// How many errors are fixed.
    pub(super) count: usize,
}

/// The key of standard input, which is no file, whatever its name in messages.
pub(super) const STDIN: &str = "-";

/// How many times a script is compiled at most. A correction can reveal another error.
const ROUNDS: usize = 100;

impl Corrected {
    /// Corrects a script and the files that it uses as far as possible, and returns how it compiles then. The error that a script
    /// declares stays: it is a test case. The key of the script is its path, or [`STDIN`], which corrects no file.
    pub(super) fn compile(&self, key: &Path, main: Source, options: &Options) -> (Sources, Compiled) {
        // Another script that uses this one may have corrected it.
        let mut main = self.corrected(key, main);
        let mut rounds = 0;
        loop {
            let sources = Sources::new(main.clone(), self.clone());
            let compiled = motionseq::compile(&sources, options);
            let expected = expected_error(sources.main());
            let errors = compiled.diagnostics.iter().filter(|error| Some(error.code.name()) != expected);
            let edits: Vec<&Edit> = errors.filter_map(|error| error.fix.as_ref()).collect();
            let mut is_done = true;
            let most = if key.as_os_str() == STDIN { 1 } else { usize::MAX };
            for (at, source) in sources.iter().enumerate().take(most) {
                let (text, count) = Edit::apply_all(edits.iter().copied(), source);
                if count == 0 || rounds == ROUNDS {
                    continue;
                }
                is_done = false;
                self.add(if at == 0 { key } else { source.path().unwrap_or(key) }, source, &text, count);
                if at == 0 {
                    main = main.with_text(text);
                }
            }
            if is_done {
                return (sources, compiled);
            }
            rounds += 1;
        }
    }

    /// The corrections by path, with links followed, or by [`STDIN`].
    pub(super) fn into_files(self) -> BTreeMap<PathBuf, Correction> {
        std::mem::take(&mut *self.files())
    }

    fn add(&self, key: &Path, source: &Source, text: &str, count: usize) {
        let mut files = self.files();
        let correction = files.entry(followed(key)).or_insert_with(|| Correction {
            name: source.name().to_owned(),
            old: source.text().to_owned(),
            new: String::new(),
            count: 0,
        });
        text.clone_into(&mut correction.new);
        correction.count += count;
    }

    /// A file with the corrections made so far.
    fn corrected(&self, key: &Path, source: Source) -> Source {
        match self.files().get(&followed(key)) {
            Some(correction) => source.with_text(correction.new.as_str()),
            None => source,
        }
    }

    fn files(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Correction>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A path with links followed, so that a file has only one.
fn followed(path: &Path) -> PathBuf {
    if path.as_os_str() == STDIN { path.to_owned() } else { path.canonicalize().unwrap_or_else(|_| path.to_owned()) }
}

impl Files for Corrected {
    fn resolve(&self, main: &Path, from: &Path, name: &str) -> Result<PathBuf, UseError> {
        Disk.resolve(main, from, name)
    }

    fn read(&self, path: &Path) -> Result<Source, SourceError> {
        Ok(self.corrected(path, Disk.read(path)?))
    }
}
