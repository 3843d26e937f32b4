//! Flat lines, read by hand: a start time, one word, and arguments that are numbers, words or NAME=NUMBER. Nearly all lines of a
//! long script are flat, and reading them with the rules of the whole language would take twenty times as long.
//!
//! What is read here is read exactly as those rules would read it; whatever is not plainly flat is left to them, with all of
//! its mistakes. A property test at the end of this file holds that.

use super::ast::{
    Argument, Command, Item, Line, Moment, Name, NumberShape, Origin, Part, Start, Statement, Value, ValueKind,
};
use crate::source::Span;

/// Words that begin a statement of another kind.
const OTHERS: &[&str] = &["at", "def", "else", "if", "let", "use"];
/// Words that a number belongs to although a blank stands between.
const BEATS: &[&str] = &["beat", "beats", "bar", "bars"];
/// The units that make a number a time.
const TIMES: &[&str] = &["us", "ms", "min", "s", "m", "h"];
/// The most digits before and behind a point, as in the grammar.
const MAX_DIGITS: usize = 15;

/// Reads one line of a text, which may end in a comment and its line break. `offset` is the place of its first byte. `Some(None)` is an empty
/// line; `None` is one that is not flat.
pub(super) fn line(text: &str, offset: usize) -> Option<Option<Line<'_>>> {
    Reader { text, at: 0, offset }.line()
}

struct Reader<'s> {
    text: &'s str,
    at: usize,
    offset: usize,
}

impl<'s> Reader<'s> {
    fn line(&mut self) -> Option<Option<Line<'s>>> {
        self.blanks();
        if self.is_end() {
            return Some(None);
        }
        let from = self.at;
        let start = self.start()?;
        let head = self.name();
        if head.text.is_empty() || OTHERS.contains(&head.text) || !self.is_apart() {
            return None;
        }
        let mut arguments: Vec<Argument<'s>> = Vec::new();
        let mut span = head.span;
        self.blanks();
        while !self.is_end() {
            let argument = self.argument()?;
            if !self.is_apart() {
                return None;
            }
            span.end = argument.span.end;
            arguments.push(argument);
            self.blanks();
        }
        let statement = Statement::Command(Command { head, arguments, block: None, span });
        let whole = if start.is_some() { self.span(from).to(span) } else { span };
        let whole = Span { end: span.end, ..whole };
        Some(Some(Line { start, parts: vec![Part { robots: Vec::new(), statement }], span: whole }))
    }

    /// `at T` or `+D`, if the line begins with one; `None` where it is none of these two.
    fn start(&mut self) -> Option<Option<Start<'s>>> {
        if self.peek() == b'+' {
            self.at += 1;
            self.blanks();
            let value = self.time()?;
            return Some(Some(Start::After(value)));
        }
        if !self.text.as_bytes().get(self.at..).is_some_and(|rest| matches!(rest, [b'a', b't', b' ' | b'\t', ..])) {
            return Some(None);
        }
        self.at += 2;
        self.blanks();
        let value = self.time()?;
        let span = value.span;
        Some(Some(Start::At(Moment { origin: Origin::Value(value), offsets: Vec::new(), span })))
    }

    /// A number, and the blanks behind it.
    fn time(&mut self) -> Option<Value<'s>> {
        let from = self.at;
        let value = self.number(from)?;
        if !self.is_apart() {
            return None;
        }
        self.blanks();
        Some(value)
    }

    fn argument(&mut self) -> Option<Argument<'s>> {
        let byte = self.peek();
        if is_word(byte) && !byte.is_ascii_digit() {
            let name = self.name();
            if self.peek() != b'=' {
                return self.word(name.span).map(plain);
            }
            self.at += 1;
            let value = self.value()?;
            let span = name.span.to(value.span);
            return Some(Argument { name: Some(name), item: Item::One(value), span });
        }
        self.value().map(plain)
    }

    fn value(&mut self) -> Option<Value<'s>> {
        let from = self.at;
        if self.peek() == b'-' {
            self.at += 1;
        }
        let byte = self.peek();
        if byte.is_ascii_digit() {
            return self.number(from);
        }
        if !is_word(byte) {
            return None;
        }
        let name = self.name();
        let word = self.word(name.span)?;
        let span = self.span(from);
        Some(Value { negative: word.span != span, span, ..word })
    }

    /// A word that begins with this name; there may be more of it behind a `-`.
    fn word(&mut self, name: Span) -> Option<Value<'s>> {
        while self.peek() == b'-' {
            self.at += 1;
            let from = self.at;
            self.skip_word();
            if self.at == from {
                return None;
            }
        }
        let span = Span { end: self.here(), ..name };
        Some(Value { negative: false, kind: ValueKind::Word(self.slice(span)), span })
    }

    /// A number with its letters; its sign stands at `from`, if it has one.
    fn number(&mut self, from: usize) -> Option<Value<'s>> {
        let begin = self.at;
        let digits = |reader: &mut Self| {
            let from = reader.at;
            while reader.peek().is_ascii_digit() {
                reader.at += 1;
            }
            (1..=MAX_DIGITS).contains(&(reader.at - from)).then_some(())
        };
        digits(self)?;
        if self.peek() == b'.' {
            self.at += 1;
            digits(self)?;
        }
        let unit = self.at;
        while self.peek().is_ascii_alphabetic() {
            self.at += 1;
        }
        let letters = self.text.get(unit..self.at)?;
        let shape = if letters.is_empty() {
            if self.is_before_beats() {
                return None;
            }
            NumberShape::Plain
        } else if TIMES.contains(&letters) {
            NumberShape::Duration
        } else if letters.starts_with('x') {
            return None;
        } else {
            NumberShape::Plain
        };
        let text = self.text.get(begin..self.at)?;
        Some(Value { negative: from != begin, kind: ValueKind::Number(shape, text), span: self.span(from) })
    }

    /// Whether the number that ends here is one of beats or bars.
    fn is_before_beats(&self) -> bool {
        let rest = self.text.get(self.at..).unwrap_or_default();
        let word = rest.trim_start_matches([' ', '\t']);
        word.starts_with('b')
            && BEATS.contains(&word.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or_default())
    }

    fn name(&mut self) -> Name<'s> {
        let from = self.at;
        if !self.peek().is_ascii_digit() {
            self.skip_word();
        }
        let span = self.span(from);
        Name { text: self.slice(span), span }
    }

    fn skip_word(&mut self) {
        while is_word(self.peek()) {
            self.at += 1;
        }
    }

    fn blanks(&mut self) {
        while matches!(self.peek(), b' ' | b'\t') {
            self.at += 1;
        }
    }

    /// The byte here; a line feed at the end of the text.
    fn peek(&self) -> u8 {
        self.text.as_bytes().get(self.at).copied().unwrap_or(b'\n')
    }

    /// Whether the line ends here, or what is left of it is a comment.
    fn is_end(&self) -> bool {
        match self.peek() {
            b'\n' | b'#' => true,
            b'\r' => self.text.as_bytes().get(self.at + 1) == Some(&b'\n'),
            _ => false,
        }
    }

    /// Whether a word or a number ends here.
    fn is_apart(&self) -> bool {
        matches!(self.peek(), b' ' | b'\t') || self.is_end()
    }

    fn here(&self) -> u32 {
        self.span(self.at).end
    }

    fn span(&self, from: usize) -> Span {
        Span::new(self.offset + from, self.offset + self.at)
    }

    fn slice(&self, span: Span) -> &'s str {
        let std::ops::Range { start, end } = span.range();
        self.text.get(start - self.offset..end - self.offset).unwrap_or_default()
    }
}

fn plain(value: Value<'_>) -> Argument<'_> {
    Argument { name: None, span: value.span, item: Item::One(value) }
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}
