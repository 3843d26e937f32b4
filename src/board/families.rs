//! The table of the families that a script chooses by a word.

use std::sync::Arc;

use super::family::{Family, OptionValue};
use super::table::Board;
use super::{maestro, raspblock, sts};

/// All families, the default first.
pub const FAMILIES: &[Family] = &[raspblock::FAMILY, maestro::FAMILY, sts::FAMILY];

impl Family {
    /// The family with this word.
    pub fn named(word: &str) -> Option<&'static Family> {
        FAMILIES.iter().find(|family| family.word == word)
    }

    /// A board of the family with the usual options.
    pub fn usual(&self) -> Arc<Board> {
        (self.make)(None, &[])
    }

    /// The board that this text chooses, as a script writes it after the word `board`; `None` if no
    /// family is written like this.
    pub fn board(text: &str) -> Option<Arc<Board>> {
        let mut words = text.split_ascii_whitespace();
        let family = Family::named(words.next()?)?;
        let mut rest: Vec<&str> = words.collect();
        let mut number = None;
        if let Some(takes) = &family.number
            && let Some(first) = rest.first().and_then(|first| first.parse().ok())
        {
            number = Some(first).filter(|first| takes.values.contains(first));
            number?;
            rest.remove(0);
        }
        if family.number.is_some() && number.is_none() {
            return None;
        }
        let mut values = vec![None; family.options.len()];
        for pair in rest.chunks(2) {
            let [word, value] = pair else { return None };
            let row = family.options.iter().position(|option| option.word == *word)?;
            let place = values.get_mut(row).filter(|place| place.is_none())?;
            *place = Some(match &family.options.get(row)?.value {
                OptionValue::Number(_, (least, most)) => {
                    value.parse().ok().filter(|value: &i32| (least..=most).contains(&value))?
                }
                OptionValue::Switch => i32::from(["off", "on"].iter().position(|word| word == value)? == 1),
            });
        }
        Some((family.make)(number, &values))
    }
}
