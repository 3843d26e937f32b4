//! Reads the axes of a verb.

use toml::de::DeValue;

use super::build::AxisRow;
use super::reader::{Reader, Rows, Value, is_name};
use super::template::Field;
use crate::board::{AngleScale, Measure};
use crate::source::Span;

/// The most values of an index, and the most axes of a verb.
const MAX_INDEX: i64 = 256;
const MAX_AXES: usize = 16;
const MAX_WORDS: usize = 256;
/// The range of values with few enough to compare one by one.
const FEW: i64 = 16;

const OF_AXIS: &[&str] = &["name", "range", "index", "words", "unit", "deg", "decimals"];

impl Reader<'_> {
    pub(super) fn axes(&mut self, value: &Value<'_>) -> Option<Vec<AxisRow>> {
        let Some(list) = value.get_ref().as_array() else {
            return self.wrong(
                self.span(value),
                "a list of axes is needed here",
                "write `axes = [{ name = \"us\", range = \"500..2500\" }]`",
            );
        };
        if list.len() > MAX_AXES {
            return self.wrong(self.span(value), format!("a verb has at most {MAX_AXES} axes"), "split the verb");
        }
        let axes: Vec<_> = list.iter().enumerate().map(|(at, value)| self.axis(at, value)).collect();
        let axes: Vec<AxisRow> = axes.into_iter().collect::<Option<_>>()?;
        for (at, axis) in axes.iter().enumerate() {
            if axes.iter().take(at).any(|other| other.field.name == axis.field.name) {
                let name = &axis.field.name;
                return self.wrong(axis.span, format!("two axes are called `{name}`"), "give one of them another name");
            }
        }
        Some(axes)
    }

    fn axis(&mut self, at: usize, value: &Value<'_>) -> Option<AxisRow> {
        let span = self.span(value);
        let Some(table) = value.get_ref().as_table() else {
            return self.wrong(span, "an axis is a table", "write `{ name = \"us\", range = \"500..2500\" }`");
        };
        let rows = self.rows(table, OF_AXIS, "an axis");
        let name = self.needed(&rows, "name", ("the axis", span), "name = \"us\"")?;
        let text = self.text(name, "name = \"us\"")?;
        if !is_name(text) || (self.is_reserved)(text) && !is_unit(text) {
            return self.wrong(
                self.span(name),
                format!("`{text}` cannot be the name of an axis"),
                "write a word that the language does not use, such as `\"power\"`",
            );
        }
        let is_index = self.flag(&rows, "index")?;
        if is_index && at > 0 {
            return self.wrong(span, "an index comes first", "move this axis to the front");
        }
        let decimals = match rows.get("decimals") {
            None => 0,
            Some((_, value)) => u32::try_from(self.integer(value, (0, 6), "the number of decimals")?).ok()?,
        };
        let words = match rows.get("words") {
            None => None,
            Some((_, value)) => Some(self.words(value)?),
        };
        self.check_axis(&rows, is_index, words.is_some(), span)?;
        let range = match &words {
            Some(words) => {
                let values = || words.iter().map(|(_, value)| *value);
                (values().min()?, values().max()?)
            }
            None => {
                let value = self.needed(&rows, "range", (&format!("the axis `{text}`"), span), "range = \"0..100\"")?;
                self.range(value, decimals)?
            }
        };
        let count = i64::from(range.1) - i64::from(range.0) + 1;
        if is_index && count > MAX_INDEX {
            return self.wrong(
                rows.get("range").map_or(span, |(span, _)| *span),
                format!("an index has at most {MAX_INDEX} values"),
                "narrow the range",
            );
        }
        let values = match &words {
            Some(words) => words.iter().map(|(_, value)| *value).collect(),
            None if count <= FEW && decimals == 0 => (range.0..=range.1).collect(),
            None => Vec::new(),
        };
        let measure = self.measure(&rows)?;
        let angle = match rows.get("deg") {
            None => None,
            Some((_, value)) => Some(self.angle(value, range, decimals)?),
        };
        let field = Field { name: text.to_owned(), range, decimals, values };
        Some(AxisRow { field, span, is_index, words, measure, angle })
    }

    /// What the keys of an axis need of each other.
    fn check_axis(&mut self, rows: &Rows<'_, '_>, is_index: bool, has_words: bool, span: Span) -> Option<()> {
        let given = |key: &str| rows.get(key).map(|(span, _)| *span);
        if has_words || is_index {
            let kind = if is_index { "an index" } else { "an axis with `words`" };
            let extra = ["decimals", "unit", "deg"].into_iter().chain(has_words.then_some("range"));
            if let Some((key, span)) = extra.into_iter().find_map(|key| Some((key, given(key)?))) {
                return self.wrong(span, format!("{kind} has no `{key}`"), format!("remove `{key}`"));
            }
        }
        if is_index && has_words {
            return self.wrong(span, "an index is a number", "remove `words`, and give it a `range`");
        }
        Some(())
    }

    /// The words of an axis with their values.
    fn words(&mut self, value: &Value<'_>) -> Option<Vec<(String, i32)>> {
        let Some(table) = value.get_ref().as_table().filter(|table| !table.is_empty()) else {
            return self.wrong(
                self.span(value),
                "a table of words is needed here",
                "write `words = { off = 0, on = 1 }`",
            );
        };
        if table.len() > MAX_WORDS {
            let message = format!("an axis has at most {MAX_WORDS} words");
            return self.wrong(self.span(value), message, "give it a `range` instead");
        }
        let mut words: Vec<(String, i32)> = Vec::new();
        let mut rows: Vec<_> = table.iter().collect();
        rows.sort_by_key(|(key, _)| key.span().start);
        for (key, value) in rows {
            let (word, span): (&str, Span) = (key.get_ref(), self.span(key));
            let is_word = is_name(&word.replace('-', "_")) && !word.ends_with('-');
            if !is_word || MODIFIERS.contains(&word) {
                return self.wrong(
                    span,
                    format!("`{word}` cannot be a word of an axis"),
                    "write small letters, digits, `_` and `-`",
                );
            }
            let number = self.integer(value, (i32::MIN.into(), i32::MAX.into()), "the value of a word")?;
            let number = i32::try_from(number).ok()?;
            if let Some((other, _)) = words.iter().find(|(_, other)| *other == number) {
                let message = format!("`{other}` and `{word}` have the same value, so they cannot be distinguished");
                return self.wrong(self.span(value), message, "give one of them another value");
            }
            words.push((word.to_owned(), number));
        }
        Some(words)
    }

    /// A range such as `0..31` or `-0.5..0.5`, in units of the last decimal place.
    fn range(&mut self, value: &Value<'_>, decimals: u32) -> Option<(i32, i32)> {
        let text = self.text(value, "range = \"0..100\"")?;
        let span = self.span(value);
        let Some((least, most)) = text.split_once("..") else {
            return self.wrong(
                span,
                format!("`{text}` is not a range"),
                "write the smallest and the largest value: `range = \"0..100\"`",
            );
        };
        let (Some(low), Some(high)) = (scaled(least.trim(), decimals), scaled(most.trim(), decimals)) else {
            let help = if decimals == 0 {
                "write whole numbers, or add `decimals = 2`"
            } else {
                "write numbers with at most as many decimals as `decimals` says"
            };
            return self.wrong(span, format!("`{text}` is not a range of numbers with {decimals} decimals"), help);
        };
        if low > high {
            return self.wrong(
                span,
                format!("the range `{text}` is empty"),
                format!("write the smaller value first: `\"{most}..{least}\"`"),
            );
        }
        if low == high {
            return self.wrong(
                span,
                format!("the range `{text}` has only one value"),
                "write the value into `send`, and remove the axis",
            );
        }
        Some((low, high))
    }

    fn measure(&mut self, rows: &Rows<'_, '_>) -> Option<Measure> {
        let Some((_, value)) = rows.get("unit") else { return Some(Measure::Number) };
        match self.text(value, "unit = \"us\"")? {
            "us" => Some(Measure::Micros),
            "deg" => Some(Measure::Degrees),
            other => self.wrong(
                self.span(value),
                format!("unknown unit `{other}`"),
                "write `\"us\"` or `\"deg\"`, or remove `unit`",
            ),
        }
    }

    /// The angles at the ends of the range.
    fn angle(&mut self, value: &Value<'_>, (least, most): (i32, i32), decimals: u32) -> Option<AngleScale> {
        let number = |value: &Value<'_>| match value.get_ref() {
            DeValue::Integer(number) => number.as_str().parse::<f64>().ok(),
            DeValue::Float(number) => number.as_str().parse::<f64>().ok(),
            _ => None,
        };
        let numbers: Vec<Option<f64>> =
            value.get_ref().as_array().map(|list| list.iter().map(number).collect()).unwrap_or_default();
        let [Some(from), Some(to)] = *numbers.as_slice() else {
            return self.wrong(
                self.span(value),
                "two angles are needed here",
                "write those of the ends of the range: `deg = [0, 180]`",
            );
        };
        if !(from.abs() <= 36_000.0 && to.abs() <= 36_000.0 && from < to) {
            return self.wrong(self.span(value), "the first angle is the smaller one", "write `deg = [0, 180]`");
        }
        let per_one = f64::from(10_i32.pow(decimals));
        let values = (f64::from(least) / per_one, f64::from(most) / per_one);
        Some(AngleScale { degrees: (from, to), values })
    }
}

/// Words that follow arguments in a script.
const MODIFIERS: [&str; 3] = ["for", "over", "ease"];

/// Whether a word that the language uses may all the same be the name of an axis.
fn is_unit(word: &str) -> bool {
    matches!(word, "us" | "deg" | "s" | "ms" | "m" | "h")
}

/// A decimal number in units of its last decimal place.
fn scaled(text: &str, decimals: u32) -> Option<i32> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let decimals = usize::try_from(decimals).ok()?;
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let is_fine = !whole.is_empty() && is_number(whole) && is_number(part) && part.len() <= decimals;
    let number: i64 = format!("{whole}{part:0<decimals$}").parse().ok().filter(|_| is_fine)?;
    i32::try_from(sign * number).ok()
}
