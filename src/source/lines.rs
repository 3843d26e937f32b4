//! Positions in a text as people and editors count them: lines, and columns in three encodings.

use std::fmt;

use super::{Source, Sources, Span};

/// A line of a file, shown as `FILE:LINE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place<'s> {
    /// The name of the file in messages.
    pub file: &'s str,
    /// The line number, counted from 1.
    pub line: usize,
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// The unit of a column. The names are those of the Language Server Protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// Bytes.
    Utf8,
    /// UTF-16 code units, as editors and JavaScript count.
    Utf16,
    /// Characters (Unicode scalar values).
    Utf32,
}

/// A position in a file, counted from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Position {
    /// The line number. Lines end with `\n`.
    pub line: u32,
    /// The distance from the start of the line, in units of an [`Encoding`].
    pub column: u32,
}

/// An index of all files that finds lines and columns without scanning the text again.
#[derive(Debug)]
pub struct Lines<'s> {
    files: Vec<Index<'s>>,
}

/// The index of one file.
#[derive(Debug)]
struct Index<'s> {
    source: &'s Source,
    /// The offsets of the lines' first bytes, counted as in spans.
    starts: Vec<u32>,
    /// The characters before each block of [`BLOCK`] bytes; empty if the text is ASCII.
    blocks: Vec<Count>,
}

/// The length of a block in bytes: at most this much is scanned to find a column.
const BLOCK: usize = 512;

/// The characters in a range of bytes.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    chars: u32,
    /// Characters that take two code units in UTF-16.
    wide: u32,
}

impl Count {
    fn add(self, bytes: &[u8]) -> Count {
        bytes.iter().fold(self, |count, byte| Count {
            // Count all bytes except those that continue a character.
            chars: count.chars + u32::from(byte & 0xC0 != 0x80),
            wide: count.wide + u32::from(*byte >= 0xF0),
        })
    }
}

impl<'s> Lines<'s> {
    /// Reads every file once. Files that a script uses are known after its compilation; an index
    /// that was built before does not contain them.
    pub fn of(sources: &'s Sources) -> Self {
        Lines { files: sources.iter().map(Index::of).collect() }
    }

    /// The file that contains an offset.
    fn file(&self, offset: u32) -> Option<&Index<'s>> {
        let at = self.files.partition_point(|file| file.source.base <= offset).checked_sub(1)?;
        self.files.get(at).filter(|file| offset <= file.source.end())
    }

    /// The line where a span begins; line 0 of an empty name if this index does not contain its
    /// file.
    pub fn place(&self, span: Span) -> Place<'s> {
        match self.file(span.start) {
            Some(file) => Place { file: &file.source.name, line: file.line(span.start) },
            None => Place { file: "", line: 0 },
        }
    }

    /// The line and column of an offset. An offset inside a character counts as the start of the
    /// character.
    pub fn position(&self, offset: u32, encoding: Encoding) -> Position {
        self.file(offset).map(|file| file.position(offset, encoding)).unwrap_or_default()
    }
}

impl<'s> Index<'s> {
    fn of(source: &'s Source) -> Self {
        let text = source.text.as_bytes();
        let after_newline = text.iter().zip(1u32..).filter(|(byte, _)| **byte == b'\n').map(|(_, at)| at);
        let starts = std::iter::once(0).chain(after_newline).map(|at| source.base.saturating_add(at)).collect();
        let mut blocks = Vec::new();
        if !source.text.is_ascii() {
            let mut before = Count::default();
            for block in text.chunks(BLOCK) {
                blocks.push(before);
                before = before.add(block);
            }
            blocks.push(before);
        }
        Index { source, starts, blocks }
    }

    /// The number, counted from 1, of the line that contains an offset.
    fn line(&self, offset: u32) -> usize {
        self.starts.partition_point(|&at| at <= offset)
    }

    fn position(&self, offset: u32, encoding: Encoding) -> Position {
        let local = (offset.saturating_sub(self.source.base) as usize).min(self.source.text.len());
        let line = self.line(offset).saturating_sub(1);
        let start = self.starts.get(line).map_or(0, |start| start.saturating_sub(self.source.base) as usize);
        let units = |at: usize| self.units(self.source.text.floor_char_boundary(at), encoding);
        Position { line: u32::try_from(line).unwrap_or(u32::MAX), column: units(local).saturating_sub(units(start)) }
    }

    /// The number of units of an encoding before an offset in the text.
    fn units(&self, at: usize, encoding: Encoding) -> u32 {
        let block = at / BLOCK;
        match (encoding, self.blocks.get(block)) {
            (Encoding::Utf8, _) | (_, None) => u32::try_from(at).unwrap_or(u32::MAX),
            (encoding, Some(before)) => {
                let rest = self.source.text.as_bytes().get(block * BLOCK..at).unwrap_or_default();
                let Count { chars, wide } = before.add(rest);
                if encoding == Encoding::Utf16 { chars + wide } else { chars }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::source::Memory;

    proptest! {
        /// Positions equal those of a linear scan, in every file.
        #[test]
        fn positions_are_those_of_the_text(texts in prop::collection::vec("[a-c\n\réµ→𝄞]{0,1500}", 1..3)) {
            let sources = Sources::new(Source::new("x", texts[0].as_str()), Memory::default());
            for text in texts.iter().skip(1) {
                sources.add(Source::new("y", text.as_str())).unwrap();
            }
            let lines = Lines::of(&sources);
            for source in sources.iter() {
                for (at, _) in source.text().char_indices().chain([(source.text().len(), ' ')]) {
                    let before = source.text().get(..at).unwrap();
                    let line = before.rsplit('\n').next().unwrap();
                    let offset = source.base() + u32::try_from(at).unwrap();
                    let column = |encoding| usize::try_from(lines.position(offset, encoding).column).unwrap();
                    prop_assert_eq!(lines.position(offset, Encoding::Utf8).line as usize, before.matches('\n').count());
                    prop_assert_eq!(column(Encoding::Utf8), line.len());
                    prop_assert_eq!(column(Encoding::Utf16), line.encode_utf16().count());
                    prop_assert_eq!(column(Encoding::Utf32), line.chars().count());
                }
            }
        }
    }

    #[test]
    fn an_offset_inside_a_character_is_its_start() {
        let sources = Sources::from(Source::new("x", "é𝄞z"));
        let lines = Lines::of(&sources);
        let column = |offset| lines.position(offset, Encoding::Utf16).column;
        assert_eq!([0, 1, 2, 3, 5, 6, 7].map(column), [0, 0, 1, 1, 1, 3, 4]);
    }

    #[test]
    fn an_index_contains_the_files_of_its_creation() {
        let sources = Sources::from(Source::new("x", "stop"));
        let early = Lines::of(&sources);
        let span = Span::new(5, 6);
        sources.add(Source::new("y", "stop")).unwrap();
        assert_eq!(early.place(span), Place { file: "", line: 0 });
        assert_eq!(Lines::of(&sources).place(span), Place { file: "y", line: 1 });
    }
}
