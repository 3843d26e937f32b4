//! Reads the parts of a TOML file, and reports those that have another form.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::{Source, Span};

/// Reads one file.
pub(super) struct Reader<'r> {
    pub(super) source: &'r Source,
    pub(super) is_reserved: &'r dyn Fn(&str) -> bool,
    pub(super) diagnostics: &'r mut Diagnostics,
}

pub(super) type Key<'s> = Spanned<std::borrow::Cow<'s, str>>;
pub(super) type Value<'s> = Spanned<DeValue<'s>>;
/// The keys of a table with their values.
pub(super) type Rows<'t, 's> = BTreeMap<&'t str, (Span, &'t Value<'s>)>;

impl Reader<'_> {
    pub(super) fn report(&mut self, code: Code, span: Span, message: impl Into<String>, help: impl Into<String>) {
        self.diagnostics.push(Diagnostic::new(code, span, message, help));
    }

    pub(super) fn wrong<T>(&mut self, span: Span, message: impl Into<String>, help: impl Into<String>) -> Option<T> {
        self.report(Code::BoardValue, span, message, help);
        None
    }

    /// The place of some bytes of the file.
    pub(super) fn at(&self, bytes: Range<usize>) -> Span {
        let (base, Span { start, end }) = (self.source.base(), Span::new(bytes.start, bytes.end));
        Span { start: start.saturating_add(base), end: end.saturating_add(base) }
    }

    pub(super) fn span<T>(&self, spanned: &Spanned<T>) -> Span {
        self.at(spanned.span())
    }

    /// The known keys of a table. Others are reported.
    pub(super) fn rows<'t, 's>(&mut self, table: &'t DeTable<'s>, known: &[&str], of: &str) -> Rows<'t, 's> {
        let mut rows = Rows::new();
        for (key, value) in table {
            let (word, span): (&str, Span) = (key.get_ref(), self.span(key));
            if known.contains(&word) {
                rows.insert(word, (span, value));
            } else {
                let help = format!("the keys of {of} are {}", known.join(", "));
                self.report(Code::BoardKey, span, format!("unknown key `{word}`"), help);
            }
        }
        rows
    }

    pub(super) fn needed<'t, 's>(
        &mut self,
        rows: &Rows<'t, 's>,
        key: &str,
        of: (&str, Span),
        line: &str,
    ) -> Option<&'t Value<'s>> {
        let value = rows.get(key).map(|(_, value)| *value);
        if value.is_none() {
            let (of, span) = of;
            self.report(Code::BoardKey, span, format!("{of} has no `{key}`"), format!("add `{line}`"));
        }
        value
    }

    pub(super) fn text<'v>(&mut self, value: &'v Value<'_>, example: &str) -> Option<&'v str> {
        let text = value.get_ref().as_str();
        text.or_else(|| {
            self.wrong(self.span(value), "a string is needed here", format!("write it in quotation marks: `{example}`"))
        })
    }

    pub(super) fn flag(&mut self, rows: &Rows<'_, '_>, key: &str) -> Option<bool> {
        let Some((_, value)) = rows.get(key) else { return Some(false) };
        let flag = value.get_ref().as_bool();
        flag.or_else(|| {
            self.wrong(self.span(value), "`true` or `false` is needed here", format!("write `{key} = true`"))
        })
    }

    pub(super) fn integer(&mut self, value: &Value<'_>, range: (i64, i64), what: &str) -> Option<i64> {
        let (least, most) = range;
        let number = value.get_ref().as_integer();
        let number = number.and_then(|number| i64::from_str_radix(number.as_str(), number.radix()).ok());
        let number = number.filter(|number| (least..=most).contains(number));
        number.or_else(|| {
            self.wrong(
                self.span(value),
                format!("{what} is a whole number from {least} to {most}"),
                "write a number in this range",
            )
        })
    }
}

/// Whether a name of the language has these letters.
pub(super) fn is_name(word: &str) -> bool {
    let is_letter = |c: u8| c.is_ascii_lowercase() || c == b'_';
    word.len() <= 40
        && word.bytes().next().is_some_and(is_letter)
        && word.bytes().all(|c| is_letter(c) || c.is_ascii_digit())
}
