//! The texts of a script and places in them.
//!
//! A [`Source`] is always valid UTF-8 of at most [`MAX_SOURCE`] bytes. A script may use other files; each has a range of
//! offsets of its own, so that a [`Span`] says which file it is in, and still is two `u32`.

mod files;
mod lines;

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elsa::FrozenVec;

pub use files::{Disk, Files, Memory, read_file};
pub use lines::{Encoding, Lines, Place, Position};

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
    texts: FrozenVec<Box<Source>>,
    files: Arc<dyn Files>,
}

/// A script that can use no other files.
impl From<Source> for Sources {
    fn from(main: Source) -> Self {
        Sources::new(main, Memory::default())
    }
}

impl Sources {
    /// A script, and where the files are that it uses.
    pub fn new(main: Source, files: impl Files + 'static) -> Self {
        let texts = FrozenVec::new();
        texts.push(Box::new(main));
        Sources { texts, files: Arc::new(files) }
    }

    /// Reads a script; the files that it uses are read from the same place.
    ///
    /// # Errors
    /// Those of [`Files::read`].
    pub fn read(path: &Path, files: impl Files + 'static) -> Result<Self, SourceError> {
        Ok(Sources::new(files.read(path)?.at(path), files))
    }

    /// The script itself.
    pub fn main(&self) -> &Source {
        // `new` has put it there.
        self.texts.get(0).unwrap_or(&EMPTY)
    }

    /// Every file, the script itself first.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.texts.iter()
    }

    /// Adds a file; `None` where all of them together are longer than [`MAX_SOURCE`].
    pub fn add(&self, source: Source) -> Option<&Source> {
        let last = self.texts.iter().last().unwrap_or(&EMPTY);
        // One byte between two files, so that the end of one is not the start of the next.
        let base = last.end().checked_add(1)?;
        let end = u32::try_from(source.text.len()).ok()?.checked_add(base)?;
        if u64::from(end) > MAX_SOURCE {
            return None;
        }
        Some(self.texts.push_get(Box::new(Source { base, ..source })))
    }

    /// The file that holds a span.
    pub fn file(&self, span: Span) -> &Source {
        self.texts.iter().find(|file| (file.base..=file.end()).contains(&span.start)).unwrap_or(self.main())
    }

    /// The path of the file that `name` means in `from`.
    pub(crate) fn resolve(&self, from: &Source, name: &str) -> Result<PathBuf, UseError> {
        let path = |source: &Source| source.path.clone().unwrap_or_default();
        self.files.resolve(&path(self.main()), &path(from), name)
    }

    /// The path of the script itself, as files that it uses would name it; `None` where none can.
    pub(crate) fn main_path(&self) -> Option<PathBuf> {
        let name = self.main().path.as_deref()?.file_name()?.to_str()?;
        self.resolve(self.main(), name).ok()
    }

    /// Reads a file at a path that [`resolve`](Self::resolve) has found.
    pub(crate) fn load(&self, path: &Path) -> Result<Source, SourceError> {
        Ok(self.files.read(path)?.at(path))
    }

    /// Where a span begins. Counts lines from the start of its file; [`Lines`] is for many of them.
    pub fn place(&self, span: Span) -> Place<'_> {
        let file = self.file(span);
        Place { file: file.name(), line: file.line(span.start) }
    }
}

static EMPTY: Source = Source { name: String::new(), text: String::new(), path: None, base: 0 };

impl Source {
    /// A source from text in memory. `name` is what messages call it.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Source { name: name.into(), text: text.into(), path: None, base: 0 }
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

    /// The same at a path: names of files that it uses are taken from the folder of that.
    #[must_use]
    pub fn at(self, path: impl Into<PathBuf>) -> Self {
        Source { path: Some(path.into()), ..self }
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
    pub(crate) fn base(&self) -> u32 {
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

/// Why a file cannot be used by another.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
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
#[non_exhaustive]
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
