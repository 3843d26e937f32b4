//! Where the texts of scripts come from.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use super::{MAX_SOURCE, Source, SourceError, UseError, describe};

/// A source of scripts: the [`Disk`], [`Memory`], or any other store of texts by path, such as an
/// editor.
pub trait Files: Send + Sync {
    /// Resolves `name` in the script at `from` to a path for [`read`](Self::read). A file has only
    /// one path, no matter how scripts name it. `main` is the main script; files outside of its
    /// folder are refused. A script without a path has an empty one.
    ///
    /// # Errors
    /// Why the file does not exist, or that it is outside of the folder.
    fn resolve(&self, main: &Path, from: &Path, name: &str) -> Result<PathBuf, UseError>;

    /// Reads a script.
    ///
    /// # Errors
    /// Why the script cannot be read or is not UTF-8 text.
    fn read(&self, path: &Path) -> Result<Source, SourceError>;
}

/// The files of this computer. Names are relative to the folder of the script that uses them;
/// symbolic links are followed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Files for Disk {
    fn resolve(&self, main: &Path, from: &Path, name: &str) -> Result<PathBuf, UseError> {
        if Path::new(name).is_absolute() {
            return Err(UseError::Outside(name.to_owned()));
        }
        let missing = |error: io::Error| UseError::Missing { name: name.to_owned(), cause: describe(&error) };
        let here = |path| Path::new(".").join(folder(path));
        // Resolve links first, so that none leads out of the folder.
        let path = here(from).join(name).canonicalize().map_err(missing)?;
        let root = here(main).canonicalize().map_err(missing)?;
        match path.strip_prefix(root) {
            Ok(inside) if inside.as_os_str().is_empty() => {
                Err(UseError::Missing { name: name.to_owned(), cause: FOLDER.to_owned() })
            }
            Ok(inside) => Ok(folder(main).join(inside)),
            Err(_) => Err(UseError::Outside(name.to_owned())),
        }
    }

    /// Reads a regular file.
    ///
    /// Never blocks and never reads more than [`MAX_SOURCE`] bytes: pipes, devices and folders are
    /// refused before they are opened.
    fn read(&self, path: &Path) -> Result<Source, SourceError> {
        let name = shown(path);
        let unreadable = |error: &io::Error| SourceError::Unreadable { name: name.clone(), cause: describe(error) };
        let data = path.metadata().map_err(|error| unreadable(&error))?;
        if data.is_dir() {
            return Err(SourceError::Unreadable { name, cause: FOLDER.to_owned() });
        }
        if !data.is_file() {
            return Err(SourceError::Unreadable {
                name,
                cause: "it is not a regular file; to read a script from a pipe, write `-` and pipe it in".into(),
            });
        }
        if data.len() > MAX_SOURCE {
            return Err(SourceError::TooLarge(name));
        }
        let file = File::open(path).map_err(|error| unreadable(&error))?;
        let source = Source::read_from(name, file)?;
        Ok(source.at(path))
    }
}

/// Texts in memory, by paths with `/` separators, for editors, web pages and tests. A URI is not a
/// path.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    texts: BTreeMap<PathBuf, String>,
}

impl Memory {
    /// Adds a text, and replaces one with the same path.
    pub fn insert(&mut self, path: impl AsRef<Path>, text: impl Into<String>) {
        self.texts.insert(plain(path.as_ref()), text.into());
    }
}

impl<P: AsRef<Path>, T: Into<String>> FromIterator<(P, T)> for Memory {
    fn from_iter<I: IntoIterator<Item = (P, T)>>(texts: I) -> Self {
        let mut memory = Memory::default();
        texts.into_iter().for_each(|(path, text)| memory.insert(path, text));
        memory
    }
}

impl<P: AsRef<Path>, T: Into<String>, const N: usize> From<[(P, T); N]> for Memory {
    fn from(texts: [(P, T); N]) -> Self {
        texts.into_iter().collect()
    }
}

impl Files for Memory {
    fn resolve(&self, main: &Path, from: &Path, name: &str) -> Result<PathBuf, UseError> {
        let path = plain(&folder(from).join(name));
        let root = plain(folder(main));
        let is_inside = path.strip_prefix(root).is_ok_and(|inside| !inside.starts_with(".."));
        if Path::new(name).has_root() || !is_inside {
            return Err(UseError::Outside(name.to_owned()));
        }
        if self.texts.contains_key(&path) {
            return Ok(path);
        }
        Err(UseError::Missing { name: name.to_owned(), cause: MISSING.to_owned() })
    }

    fn read(&self, path: &Path) -> Result<Source, SourceError> {
        let (name, path) = (shown(path), plain(path));
        let Some(text) = self.texts.get(&path) else {
            return Err(SourceError::Unreadable { name, cause: MISSING.to_owned() });
        };
        if text.len() as u64 > MAX_SOURCE {
            return Err(SourceError::TooLarge(name));
        }
        Ok(Source::new(name, text.as_str()).at(path))
    }
}

/// The message for a folder.
const FOLDER: &str = "it is a folder; name a script in it";
/// Linux's message for a missing file.
const MISSING: &str = "no such file or directory";

/// The folder of a file; empty for the current folder.
fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// The name of a file in messages: the same on every system.
fn shown(path: &Path) -> String {
    path.display().to_string().replace(std::path::MAIN_SEPARATOR, "/")
}

/// A path without `.`, and with `..` only at its start.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(plain.components().next_back(), Some(Component::Normal(_))) => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
}

/// Reads a regular file of at most `most` bytes from the disk.
///
/// # Errors
/// The system's errors; and if the file is not a regular one or is too long.
pub fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    // Check before opening: opening a named pipe waits for its writer.
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("it is not a regular file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(io::Error::other(format!("it is longer than {most} bytes")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_memory_are_taken_as_those_on_disk() {
        let memory = Memory::from([("show/a.motion", "stop"), ("./show/lib/b.motion", "stop"), ("c.motion", "stop")]);
        let (main, lib) = (Path::new("show/a.motion"), Path::new("show/lib/b.motion"));
        let resolve = |from, name| memory.resolve(main, from, name);
        assert_eq!(resolve(main, "lib/b.motion").as_deref(), Ok(lib));
        assert_eq!(resolve(main, "./lib/../lib/b.motion").as_deref(), Ok(lib));
        assert_eq!(resolve(lib, "../a.motion").as_deref(), Ok(main));
        for outside in ["../c.motion", "/show/a.motion", "../../../c.motion"] {
            assert_eq!(resolve(main, outside), Err(UseError::Outside(outside.to_owned())));
        }
        assert!(matches!(resolve(main, "b.motion"), Err(UseError::Missing { .. })));
        assert_eq!(memory.read(lib).unwrap().text(), "stop");
        assert!(matches!(memory.read(Path::new("d.motion")), Err(SourceError::Unreadable { .. })));
        // Texts may also be above the folder where paths begin.
        let above = Memory::from([("../a.motion", "stop"), ("../b.motion", "stop"), ("../../c.motion", "stop")]);
        let main = Path::new("../a.motion");
        assert_eq!(above.resolve(main, main, "x/../b.motion").as_deref(), Ok(Path::new("../b.motion")));
        assert!(matches!(above.resolve(main, main, "../c.motion"), Err(UseError::Outside(_))));
        assert_eq!(above.read(Path::new("x/../../b.motion")).unwrap().text(), "stop");
    }

    #[test]
    fn a_folder_is_not_a_script() {
        let main = Path::new("x.motion");
        for name in [".", "src/.."] {
            let error = Disk.resolve(main, main, name).unwrap_err();
            assert_eq!(error, UseError::Missing { name: name.to_owned(), cause: FOLDER.to_owned() });
        }
    }
}
