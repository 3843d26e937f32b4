//! The words of a change in parts, so that a display can show old and new values in colors.

use std::fmt;
use std::ops::Add;

/// A part of the words of a change.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// Words about the change.
    Text(String),
    /// What was there before.
    Old(String),
    /// What is there now.
    New(String),
}

impl Part {
    /// Its text.
    pub fn text(&self) -> &str {
        let (Part::Text(text) | Part::Old(text) | Part::New(text)) = self;
        text
    }
}

/// The words of a change. As text, they have no colors.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Words(Vec<Part>);

impl Words {
    /// Its parts, in order.
    pub fn parts(&self) -> &[Part] {
        &self.0
    }

    pub(super) fn old(text: impl Into<String>) -> Self {
        Words(vec![Part::Old(text.into())])
    }

    pub(super) fn new(text: impl Into<String>) -> Self {
        Words(vec![Part::New(text.into())])
    }

    /// `1500 -> 1600`.
    pub(super) fn change(old: impl Into<String>, new: impl Into<String>) -> Self {
        Words::old(old) + " -> " + Words::new(new)
    }

    /// All of them, with a space in between.
    pub(super) fn joined(all: impl IntoIterator<Item = Words>) -> Self {
        all.into_iter().reduce(|words, more| words + " " + more).unwrap_or_default()
    }
}

impl From<String> for Words {
    fn from(text: String) -> Self {
        Words(vec![Part::Text(text)])
    }
}

impl From<&str> for Words {
    fn from(text: &str) -> Self {
        Words::from(text.to_owned())
    }
}

impl<W: Into<Words>> Add<W> for Words {
    type Output = Words;

    fn add(mut self, more: W) -> Words {
        self.0.extend(more.into().0);
        self
    }
}

impl fmt::Display for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|part| f.write_str(part.text()))
    }
}
