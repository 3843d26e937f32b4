//! How a script chooses a family, and what it may write after its word.

use std::sync::Arc;

use super::table::Board;

/// A family of boards.
#[derive(Debug)]
#[non_exhaustive]
pub struct Family {
    /// The word after `board` in a script.
    pub word: &'static str,
    /// The whole line.
    pub usage: &'static str,
    /// A valid line.
    pub example: &'static str,
    /// What it is, in a few words.
    pub meaning: &'static str,
    /// The number after the word, if the family needs one.
    pub number: Option<FamilyNumber>,
    /// Options, each a word and its value.
    pub options: &'static [FamilyOption],
    /// Makes a board from the number and the values of the options, in this order. A missing number
    /// is one that fits most scripts.
    pub make: fn(Option<i32>, &[Option<i32>]) -> Arc<Board>,
}

/// A number that a family needs.
#[derive(Debug)]
#[non_exhaustive]
pub struct FamilyNumber {
    /// Its name in messages, with an article.
    pub what: &'static str,
    /// Its possible values.
    pub values: &'static [i32],
}

/// An option of a family.
#[derive(Debug)]
#[non_exhaustive]
pub struct FamilyOption {
    /// Its word.
    pub word: &'static str,
    /// Its value.
    pub value: OptionValue,
}

/// The value of an option.
#[derive(Debug)]
#[non_exhaustive]
pub enum OptionValue {
    /// A whole number in this range.
    Number(&'static str, (i32, i32)),
    /// `on` or `off`, which are 1 and 0.
    Switch,
}
