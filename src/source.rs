//! The texts of a script and places in them.
//!
//! A [`Source`] is always valid UTF-8 of at most [`MAX_SOURCE`] bytes. A script may use other files; each has a range of
//! offsets of its own, so that a [`Span`] says which file it is in, and still is two `u32`.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use elsa::FrozenVec;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

/// The longest script that is read, in bytes. Nothing beyond it is ever read.
pub const MAX_SOURCE: u64 = 64 << 20;

/// A half-open range of bytes, `start..end`, in one of [`Sources`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// Offset of the first byte.
    pub start: u32,
    /// Offset behind the last byte.
    pub end: u32,
}

impl Span {
    /// The span from `start` to `end`; offsets beyond `u32` are held at its end.
    pub fn new(start: usize, end: usize) -> Self {
        let clamp = |offset| u32::try_from(offset).unwrap_or(u32::MAX);
        Span { start: clamp(start), end: clamp(end) }
    }

    /// The smallest span that holds both.
    #[must_use]
    pub fn to(self, other: Span) -> Span {
        Span { start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    /// The same range as indices.
    pub fn range(self) -> std::ops::Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A named text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    name: String,
    text: String,
    /// The file it was read from, if it was one.
    path: Option<PathBuf>,
    /// The offset of its first byte.
    base: u32,
}

/// A script and the files that it uses, in the order in which they were reached.
#[derive(Clone)]
pub struct Sources {
    files: FrozenVec<Box<Source>>,
}

impl From<Source> for Sources {
    fn from(main: Source) -> Self {
        let files = FrozenVec::new();
        files.push(Box::new(main));
        Sources { files }
    }
}

impl Sources {
    /// The script itself.
    pub fn main(&self) -> &Source {
        // `From` has put it there.
        self.files.get(0).unwrap_or(&EMPTY)
    }

    /// Every file, the script itself first.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.files.iter()
    }

    /// Adds a file; `None` where all of them together are longer than [`MAX_SOURCE`].
    pub fn add(&self, source: Source) -> Option<&Source> {
        let last = self.files.iter().last().unwrap_or(&EMPTY);
        // One byte between two files, so that the end of one is not the start of the next.
        let base = last.end().checked_add(1)?;
        let end = u32::try_from(source.text.len()).ok()?.checked_add(base)?;
        if u64::from(end) > MAX_SOURCE {
            return None;
        }
        Some(self.files.push_get(Box::new(Source { base, ..source })))
    }

    /// The file that holds a span.
    pub fn file(&self, span: Span) -> &Source {
        self.files.iter().find(|file| (file.base..=file.end()).contains(&span.start)).unwrap_or(self.main())
    }

    /// The file that `name` means, said in `from`: relative to its folder, and inside the folder of the main script.
    pub fn resolve(&self, from: &Source, name: &str) -> Result<PathBuf, UseError> {
        let folder = |source: &Source| {
            source
                .path
                .as_deref()
                .and_then(Path::parent)
                .map(|folder| if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() })
        };
        let here = folder(from).unwrap_or_else(|| PathBuf::from("."));
        let root = folder(self.main()).unwrap_or_else(|| PathBuf::from("."));
        if Path::new(name).is_absolute() {
            return Err(UseError::Outside(name.to_owned()));
        }
        let missing = |error: io::Error| UseError::Missing { name: name.to_owned(), cause: describe(&error) };
        // Links are followed first, so that none leads out.
        let path = here.join(name).canonicalize().map_err(missing)?;
        let root = root.canonicalize().map_err(missing)?;
        if path.starts_with(&root) { Ok(path) } else { Err(UseError::Outside(name.to_owned())) }
    }

    /// What messages call a file: its path from the folder of the main script on, where that is known.
    pub fn name_of(&self, path: &Path) -> String {
        let main = self.main().path.as_deref().and_then(Path::parent);
        let inside = main.and_then(|main| {
            // A script that is named without a folder stands in this one.
            let folder = if main.as_os_str().is_empty() { Path::new(".") } else { main };
            Some((main, path.strip_prefix(folder.canonicalize().ok()?).ok()?.to_owned()))
        });
        match inside {
            Some((main, inside)) => main.join(inside).display().to_string(),
            None => path.display().to_string(),
        }
    }

    /// Where a span begins. Counts lines from the start of its file; [`Lines`] is for many of them.
    pub fn place(&self, span: Span) -> Place<'_> {
        let file = self.file(span);
        Place { file: file.name(), line: file.line(span.start) }
    }
}

/// Reads a regular file that is no longer than so many bytes.
pub fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    // Never waits for the writer of a named pipe.
    let file = File::options().read(true).custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed()).open(path)?;
    if !file.metadata()?.is_file() {
        return Err(io::Error::other("it is not a regular file"));
    }
    let mut bytes = Vec::new();
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(io::Error::other(format!("it is longer than {most} bytes")));
    }
    Ok(bytes)
}

/// Puts a text in the place of what a file holds, all of it or nothing.
pub fn replace_file(path: &Path, text: &[u8]) -> io::Result<()> {
    let mut file = Replacement::begin(path)?;
    file.write_all(text)?;
    file.finish()
}

/// What takes the place of a file once it is whole: until then it is another file beside it, which goes away if it never is. What is
/// no file, such as a pipe or `/dev/null`, is written to where it is, and so is a file whose owner could not be kept.
#[derive(Debug)]
pub struct Replacement {
    file: File,
    /// The file beside it, and the one whose place it takes.
    part: Option<(PathBuf, PathBuf)>,
}

impl Replacement {
    /// Begins one; a link leads to the file that is replaced. Owner, group and mode stay.
    pub fn begin(path: &Path) -> io::Result<Self> {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let old = path.metadata().ok();
        if old.as_ref().is_some_and(|old| !old.is_file()) {
            return Ok(Replacement { file: open_in_place(&path)?, part: None });
        }
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(name);
        let file = File::create(&part)?;
        let new = Replacement { file, part: Some((part, path)) };
        match old.map(|old| new.becomes(&old)) {
            None | Some(Ok(true)) => Ok(new),
            Some(Err(error)) => Err(error),
            Some(Ok(false)) => {
                let Some((_, path)) = new.part.clone() else { return Ok(new) };
                let file = open_in_place(&path)?;
                file.set_len(0)?;
                Ok(Replacement { file, part: None })
            }
        }
    }

    /// Gives it the mode, the owner and the group of another file; says whether it may have them.
    fn becomes(&self, old: &std::fs::Metadata) -> io::Result<bool> {
        let new = self.file.metadata()?;
        if (new.uid(), new.gid()) != (old.uid(), old.gid())
            && std::os::unix::fs::fchown(&self.file, Some(old.uid()), Some(old.gid())).is_err()
        {
            return Ok(false);
        }
        self.file.set_permissions(old.permissions())?;
        Ok(true)
    }

    /// Whether it is written to where it is.
    pub fn is_in_place(&self) -> bool {
        self.part.is_none()
    }

    /// It is whole.
    pub fn finish(mut self) -> io::Result<()> {
        let Some((part, path)) = &self.part else { return self.file.flush() };
        self.file.sync_all()?;
        std::fs::rename(part, path)?;
        self.part = None;
        Ok(())
    }
}

impl Write for Replacement {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Replacement {
    fn drop(&mut self) {
        if let Some((part, _)) = &self.part {
            let _ = std::fs::remove_file(part);
        }
    }
}

/// Opens a file to write to it, without waiting for the reader of a named pipe.
pub fn open_in_place(path: &Path) -> io::Result<File> {
    let flags = OFlags::NONBLOCK.bits().cast_signed();
    let file = File::options().write(true).create(true).truncate(false).custom_flags(flags).open(path)?;
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    Ok(file)
}

/// A line of a file, shown as `FILE:LINE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place<'s> {
    /// What messages call the file.
    pub file: &'s str,
    /// The line, counted from 1.
    pub line: usize,
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// Where every line of every file begins, so that a place is found without reading the text and without allocating.
#[derive(Debug)]
pub struct Lines<'s> {
    /// Each file and the offsets at which its lines begin.
    files: Vec<(&'s Source, Vec<u32>)>,
}

impl<'s> Lines<'s> {
    /// Reads every file once.
    pub fn of(sources: &'s Sources) -> Self {
        let starts = |source: &'s Source| {
            let behind_newline = source.text.bytes().zip(1u32..).filter(|(byte, _)| *byte == b'\n');
            std::iter::once(0)
                .chain(behind_newline.map(|(_, at)| at))
                .map(|at| source.base.saturating_add(at))
                .collect()
        };
        Lines { files: sources.iter().map(|source| (source, starts(source))).collect() }
    }

    /// Where a span begins.
    pub fn place(&self, span: Span) -> Place<'s> {
        let file = self.files.partition_point(|(source, _)| source.base <= span.start).saturating_sub(1);
        match self.files.get(file) {
            Some((source, starts)) => {
                Place { file: &source.name, line: starts.partition_point(|&at| at <= span.start) }
            }
            None => Place { file: "", line: 0 },
        }
    }
}

static EMPTY: Source = Source { name: String::new(), text: String::new(), path: None, base: 0 };

impl Source {
    /// A source from text in memory. `name` is what messages call it.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Source { name: name.into(), text: text.into(), path: None, base: 0 }
    }

    /// Reads a regular file.
    ///
    /// Never blocks and never reads more than [`MAX_SOURCE`] bytes: a pipe, a device or a folder is refused before
    /// anything is read.
    pub fn read(path: &Path) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        let unreadable = |error: &io::Error| SourceError::Unreadable { name: name.clone(), cause: describe(error) };
        // Non-blocking, because opening a named pipe for reading would wait for its writer.
        let file = File::options()
            .read(true)
            .custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed())
            .open(path)
            .map_err(|error| unreadable(&error))?;
        let data = file.metadata().map_err(|error| unreadable(&error))?;
        if data.is_dir() {
            return Err(SourceError::Unreadable { name, cause: "it is a folder; name a script in it".into() });
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
        let source = Self::read_from(name, file)?;
        Ok(Source { path: Some(path.to_owned()), ..source })
    }

    /// Reads text from `reader` to its end, at most [`MAX_SOURCE`] bytes of it.
    pub fn read_from(name: impl Into<String>, reader: impl Read) -> Result<Self, SourceError> {
        let name = name.into();
        let mut bytes = Vec::new();
        if let Err(error) = reader.take(MAX_SOURCE + 1).read_to_end(&mut bytes) {
            return Err(SourceError::Unreadable { name, cause: describe(&error) });
        }
        if bytes.len() as u64 > MAX_SOURCE {
            return Err(SourceError::TooLarge(name));
        }
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Source::new(name, text)),
            Err(error) => {
                // Everything before the bad byte is unchanged by the lossy copy, so its offset still fits.
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes().get(at).copied().unwrap_or_default();
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                Err(SourceError::NotUtf8 { lossy: Source::new(name, text), at, byte })
            }
        }
    }

    /// The same with another name.
    #[must_use]
    pub fn named(self, name: &str) -> Self {
        Source { name: name.to_owned(), ..self }
    }

    /// The same file with another text.
    #[must_use]
    pub fn with_text(&self, text: impl Into<String>) -> Self {
        Source { text: text.into(), ..self.clone() }
    }

    /// What messages call this text: the path as it was given, or `-`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The file it was read from, if it was one.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The offset of its first byte.
    pub fn base(&self) -> u32 {
        self.base
    }

    /// The offset behind its last byte.
    fn end(&self) -> u32 {
        self.base.saturating_add(u32::try_from(self.text.len()).unwrap_or(u32::MAX))
    }

    /// The text of a span; empty where the span is not one of this source.
    pub fn slice(&self, span: Span) -> &str {
        let local = |offset: u32| offset.checked_sub(self.base).map(|offset| offset as usize);
        let range = local(span.start).zip(local(span.end));
        range.and_then(|(start, end)| self.text.get(start..end)).unwrap_or_default()
    }

    /// The number of the line, counted from 1, that holds the byte at `offset`.
    pub fn line(&self, offset: u32) -> usize {
        let offset = offset.saturating_sub(self.base) as usize;
        let before = self.text.as_bytes().get(..offset).unwrap_or(self.text.as_bytes());
        before.iter().filter(|&&byte| byte == b'\n').count() + 1
    }
}

impl Source {
    /// The line, and the column in characters, of the byte at `offset`; both counted from 1.
    pub fn line_and_column(&self, offset: u32) -> (usize, usize) {
        let local = offset.saturating_sub(self.base) as usize;
        let before = self.text.get(..local).unwrap_or(&self.text);
        let line = before.rsplit('\n').next().unwrap_or_default();
        (self.line(offset), line.chars().count() + 1)
    }
}

/// Why a file cannot be used by another.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UseError {
    /// It is not there.
    #[error("{name} cannot be used: {cause}")]
    Missing {
        /// The name as it was given.
        name: String,
        /// Why, in words.
        cause: String,
    },
    /// It lies outside of the folder of the main script.
    #[error("{0} lies outside of the folder of the main script")]
    Outside(String),
}

/// Why a file did not become a [`Source`].
#[derive(Clone, Debug, thiserror::Error)]
pub enum SourceError {
    /// The file cannot be read at all.
    #[error("cannot read {name}: {cause}")]
    Unreadable {
        /// The path as it was given.
        name: String,
        /// Why, in words.
        cause: String,
    },
    /// It is larger than [`MAX_SOURCE`]; nothing of it was kept.
    #[error("{0} is larger than 64 MiB")]
    TooLarge(String),
    /// It is no UTF-8 text.
    #[error("{} is not UTF-8 text", lossy.name())]
    NotUtf8 {
        /// The text with its bad bytes replaced.
        lossy: Source,
        /// Offset of the first bad byte, which fits the replaced text too.
        at: usize,
        /// That byte.
        byte: u8,
    },
}

/// The system's words for an error, without the number that Rust adds.
pub(crate) fn describe(error: &io::Error) -> String {
    let text = error.to_string();
    match text.find(" (os error") {
        Some(at) => text.get(..at).unwrap_or(&text).to_lowercase(),
        None => text,
    }
}
