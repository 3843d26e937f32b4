//! The texts of a script and positions in them.
//!
//! A [`Source`] is always valid UTF-8 of at most [`MAX_SOURCE`] bytes. A script may use other
//! files. Each has its own range of offsets, so that a [`Span`] identifies its file and still is
//! only two `u32`.

mod files;
mod lines;

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elsa::FrozenVec;

pub use files::{Disk, Files, Memory, read_file};
pub use lines::{Encoding, Lines, Place, Position};

/// The maximum size of a script in bytes. No more is ever read.
pub const MAX_SOURCE: u64 = 64 << 20;

/// A half-open range of bytes, `start..end`, in [`Sources`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// Offset of the first byte.
    pub start: u32,
    /// Offset after the last byte.
    pub end: u32,
}

impl Span {
    /// The span from `start` to `end`. Offsets beyond `u32` saturate.
    pub fn new(start: usize, end: usize) -> Self {
        let clamp = |offset| u32::try_from(offset).unwrap_or(u32::MAX);
        Span { start: clamp(start), end: clamp(end) }
    }

    /// The smallest span that contains both.
    #[must_use]
    pub fn to(self, other: Span) -> Span {
        Span { start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    /// The same range as a range of indices.
    pub fn range(self) -> std::ops::Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A text with its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    name: String,
    text: String,
    /// The file it was read from, if any.
    path: Option<PathBuf>,
    /// The offset of its first byte.
    base: u32,
}

/// A script and the files that it uses, in the order in which they were first used.
#[derive(Clone)]
pub struct Sources {
    texts: FrozenVec<Box<Source>>,
    files: Arc<dyn Files>,
}

/// A script that cannot use other files.
impl From<Source> for Sources {
    fn from(main: Source) -> Self {
        Sources::new(main, Memory::default())
    }
}

impl Sources {
    /// A script, and the store of the files that it uses.
    pub fn new(main: Source, files: impl Files + 'static) -> Self {
        let texts = FrozenVec::new();
        texts.push(Box::new(main));
        Sources { texts, files: Arc::new(files) }
    }

    /// Reads a script. The files that it uses are read from the same store.
    ///
    /// # Errors
    /// Those of [`Files::read`].
    pub fn read(path: &Path, files: impl Files + 'static) -> Result<Self, SourceError> {
        Ok(Sources::new(files.read(path)?.at(path), files))
    }

    /// The main script.
    pub fn main(&self) -> &Source {
        // `new` has added it.
        self.texts.get(0).unwrap_or(&EMPTY)
    }

    /// All files, the main script first.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.texts.iter()
    }

    /// Adds a file; `None` if all files together exceed [`MAX_SOURCE`].
    pub fn add(&self, source: Source) -> Option<&Source> {
        let last = self.texts.iter().last().unwrap_or(&EMPTY);
        // One byte separates two files, so that the end of one is not the start of the next.
        let base = last.end().checked_add(1)?;
        let end = u32::try_from(source.text.len()).ok()?.checked_add(base)?;
        if u64::from(end) > MAX_SOURCE {
            return None;
        }
        Some(self.texts.push_get(Box::new(Source { base, ..source })))
    }

    /// The file that contains a span.
    pub fn file(&self, span: Span) -> &Source {
        self.texts.iter().find(|file| (file.base..=file.end()).contains(&span.start)).unwrap_or(self.main())
    }

    /// Resolves `name` in `from` to a path.
    pub(crate) fn resolve(&self, from: &Source, name: &str) -> Result<PathBuf, UseError> {
        let path = |source: &Source| source.path.clone().unwrap_or_default();
        self.files.resolve(&path(self.main()), &path(from), name)
    }

    /// The path of the main script as other files would name it; `None` if none can.
    pub(crate) fn main_path(&self) -> Option<PathBuf> {
        let name = self.main().path.as_deref()?.file_name()?.to_str()?;
        self.resolve(self.main(), name).ok()
    }

    /// Reads a file at a path from [`resolve`](Self::resolve).
    pub(crate) fn load(&self, path: &Path) -> Result<Source, SourceError> {
        Ok(self.files.read(path)?.at(path))
    }

    /// The line where a span begins. Counts lines from the start of the file; use [`Lines`] for
    /// many spans.
    pub fn place(&self, span: Span) -> Place<'_> {
        let file = self.file(span);
        Place { file: file.name(), line: file.line(span.start) }
    }
}

static EMPTY: Source = Source { name: String::new(), text: String::new(), path: None, base: 0 };

impl Source {
    /// A source from text in memory. `name` is its name in messages.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Source { name: name.into(), text: text.into(), path: None, base: 0 }
    }

    /// Reads text from `reader` to its end, at most [`MAX_SOURCE`] bytes.
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
                // The lossy copy does not change the bytes before the bad one, so its offset is
                // still right.
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes().get(at).copied().unwrap_or_default();
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                Err(SourceError::NotUtf8 { lossy: Source::new(name, text), at, byte })
            }
        }
    }

    /// The same source at a path. Names of files that it uses are relative to the folder of this
    /// path.
    #[must_use]
    pub fn at(self, path: impl Into<PathBuf>) -> Self {
        Source { path: Some(path.into()), ..self }
    }

    /// The same source with another name.
    #[must_use]
    pub fn named(self, name: &str) -> Self {
        Source { name: name.to_owned(), ..self }
    }

    /// The same source with another text.
    #[must_use]
    pub fn with_text(&self, text: impl Into<String>) -> Self {
        Source { text: text.into(), ..self.clone() }
    }

    /// The name in messages: the path as the user wrote it, or `-`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The file it was read from, if any.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The offset of its first byte.
    pub(crate) fn base(&self) -> u32 {
        self.base
    }

    /// The offset after its last byte.
    fn end(&self) -> u32 {
        self.base.saturating_add(u32::try_from(self.text.len()).unwrap_or(u32::MAX))
    }

    /// The text of a span; empty if the span is not in this source.
    pub fn slice(&self, span: Span) -> &str {
        let local = |offset: u32| offset.checked_sub(self.base).map(|offset| offset as usize);
        let range = local(span.start).zip(local(span.end));
        range.and_then(|(start, end)| self.text.get(start..end)).unwrap_or_default()
    }

    /// The number, counted from 1, of the line that contains the byte at `offset`.
    pub fn line(&self, offset: u32) -> usize {
        let offset = offset.saturating_sub(self.base) as usize;
        let before = self.text.as_bytes().get(..offset).unwrap_or(self.text.as_bytes());
        before.iter().filter(|&&byte| byte == b'\n').count() + 1
    }
}

/// Why a script cannot use a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UseError {
    /// The file does not exist.
    #[error("{name} cannot be used: {cause}")]
    Missing {
        /// The name as the script wrote it.
        name: String,
        /// The reason in words.
        cause: String,
    },
    /// The file is outside of the main script's folder.
    #[error("{0} is outside of the main script's folder")]
    Outside(String),
}

/// Why a file could not be read as a [`Source`].
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// The file cannot be read.
    #[error("cannot read {name}: {cause}")]
    Unreadable {
        /// The path as the user wrote it.
        name: String,
        /// The reason in words.
        cause: String,
    },
    /// The file is larger than [`MAX_SOURCE`]; its content is discarded.
    #[error("{0} is larger than 64 MiB")]
    TooLarge(String),
    /// The file is not UTF-8 text.
    #[error("{} is not UTF-8 text", lossy.name())]
    NotUtf8 {
        /// The text with its bad bytes replaced.
        lossy: Source,
        /// Offset of the first bad byte, in both the original and the replaced text.
        at: usize,
        /// That byte.
        byte: u8,
    },
}

/// The system's description of an error, without the number that Rust adds.
pub(crate) fn describe(error: &io::Error) -> String {
    let text = error.to_string();
    match text.find(" (os error") {
        Some(at) => text.get(..at).unwrap_or(&text).to_lowercase(),
        None => text,
    }
}
