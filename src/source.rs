//! A script's text and places in it.
//!
//! A [`Source`] is always valid UTF-8 of at most [`MAX_SOURCE`] bytes, so every offset fits a `u32`.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// The longest script that is read, in bytes. Nothing beyond it is ever read.
pub const MAX_SOURCE: u64 = 64 << 20;

/// A half-open range of bytes, `start..end`, in a [`Source`].
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
}

impl Source {
    /// A source from text in memory. `name` is what messages call it.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Source { name: name.into(), text: text.into() }
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
        Self::read_from(name, file)
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
            Ok(text) => Ok(Source { name, text }),
            Err(error) => {
                // Everything before the bad byte is unchanged by the lossy copy, so its offset still fits.
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes().get(at).copied().unwrap_or_default();
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                Err(SourceError::NotUtf8 { lossy: Source { name, text }, at, byte })
            }
        }
    }

    /// What messages call this text: the path as it was given, or `-`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The text of a span; empty where the span is not one of this source.
    pub fn slice(&self, span: Span) -> &str {
        self.text.get(span.range()).unwrap_or_default()
    }

    /// The number of the line, counted from 1, that holds the byte at `offset`.
    pub fn line(&self, offset: u32) -> usize {
        let before = self.text.as_bytes().get(..offset as usize).unwrap_or(self.text.as_bytes());
        before.iter().filter(|&&byte| byte == b'\n').count() + 1
    }
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
