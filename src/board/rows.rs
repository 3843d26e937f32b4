//! Rows of the table of a board with nothing special, from which the families make theirs.

use super::Text;
use super::table::Resource;
use super::verb::{Activity, Axis, Sets, Unit, ValueForm, Verb};

impl Resource {
    /// A resource without a rest.
    pub(super) fn row(name: impl Into<Text>, key: impl Into<Text>) -> Self {
        Resource {
            name: name.into(),
            key: key.into(),
            about: Text::default(),
            rest: None,
            activity: Text::default(),
            idle: Text::default(),
            drives: false,
            refresh: None,
            is_exclusive: true,
            speed: None,
        }
    }
}

impl Axis {
    /// A positional number.
    pub(super) fn row(what: impl Into<Text>, range: (i32, i32)) -> Self {
        Axis {
            name: Text::default(),
            what: what.into(),
            key: Text::default(),
            range,
            scale: 1,
            takes: ValueForm::Number,
            unit: Unit::default(),
            why: Text::default(),
        }
    }

    /// A positional pulse width.
    pub(super) fn pulse(what: impl Into<Text>, range: (i32, i32)) -> Self {
        Axis { unit: Unit::pulse_width(), ..Axis::row(what, range) }
    }

    /// One of these words, with their values.
    pub(super) fn words(what: impl Into<Text>, words: &[(&'static str, i32)]) -> Self {
        let values = || words.iter().map(|(_, value)| *value);
        let range = (values().min().unwrap_or_default(), values().max().unwrap_or_default());
        let words = words.iter().map(|(word, value)| (Text::Borrowed(*word), *value)).collect();
        Axis { takes: ValueForm::Word(words), ..Axis::row(what, range) }
    }
}

impl Verb {
    /// A command without values that sets nothing.
    pub(super) fn row(
        word: impl Into<Text>,
        usage: impl Into<Text>,
        example: impl Into<Text>,
        meaning: impl Into<Text>,
    ) -> Self {
        Verb {
            word: word.into(),
            usage: usage.into(),
            example: example.into(),
            meaning: meaning.into(),
            axes: Vec::new(),
            sets: Sets::Nothing,
            activity: Activity::Still,
            holds: false,
            moves: false,
            needs: None,
            forbidden: None,
            each: None,
            asks: false,
            frames: Text::default(),
            is: None,
            alias: None,
            forgets: false,
            uses_as: Text::default(),
            takes_names: false,
            tolerance: 1,
        }
    }
}
