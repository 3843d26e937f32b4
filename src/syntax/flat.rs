//! Flat lines, read by hand: a start time, one word, and arguments that are numbers, words or NAME=NUMBER. Nearly all lines of a
//! long script are flat, and reading them with the rules of the whole language would take twenty times as long.
//!
//! What is read here is read exactly as those rules would read it; all other lines are left to them, with their
//! mistakes. A property test at the end of this file holds that.

use std::borrow::Cow;

use super::ast::{
    Argument, Command, Item, Line, LineRef, Moment, Name, NumberShape, Origin, Part, Start, Statement, Value, ValueKind,
};
use crate::source::Span;
use crate::units::time_unit;

/// How many arguments there is room for at once.
const USUAL: usize = 3;
/// The most digits before and after a point, as in the grammar.
const MAX_DIGITS: usize = 15;

/// Reads one line of a text, which may end in a comment and its line break. `offset` is the place of its first byte. `None` is an empty
/// line.
pub(super) fn line(text: &str, offset: usize) -> Result<Option<Line<'_>>, NotFlat> {
    Reader { text, at: 0, offset }.line()
}

impl<'b, 's> LineRef<'b, 's> {
    /// Its tree.
    pub fn read(self) -> Cow<'b, Line<'s>> {
        let (text, at) = match self {
            LineRef::Flat(text, at) => (text, at as usize),
            LineRef::Tree(line) => return Cow::Borrowed(line),
        };
        Cow::Owned(line(text, at).ok().flatten().unwrap_or_else(|| {
            // It was read before; were it not read again, it must not pass in silence.
            let span = self.span();
            let command = Command { head: Name { text, span }, arguments: Vec::new(), block: None, span };
            Line { start: None, parts: vec![Part { robots: Vec::new(), statement: Statement::Command(command) }], span }
        }))
    }
}

/// A line that is left to the rules of the whole language.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct NotFlat;

struct Reader<'s> {
    text: &'s str,
    at: usize,
    offset: usize,
}

impl<'s> Reader<'s> {
    fn line(&mut self) -> Result<Option<Line<'s>>, NotFlat> {
        self.spaces();
        if self.is_end() {
            return Ok(None);
        }
        let from = self.at;
        let start = self.start()?;
        let head = self.name();
        if head.text.is_empty() || is_other(head.text) {
            return Err(NotFlat);
        }
        let mut arguments: Vec<Argument<'s>> = Vec::with_capacity(USUAL);
        let mut span = head.span;
        while self.continues()? {
            let argument = self.argument().ok_or(NotFlat)?;
            span.end = argument.span.end;
            arguments.push(argument);
        }
        let statement = Statement::Command(Command { head, arguments, block: None, span });
        let whole = Span { start: self.span(from).start, ..span };
        Ok(Some(Line { start, parts: vec![Part { robots: Vec::new(), statement }], span: whole }))
    }

    /// `at T` or `+D`, if the line begins with one.
    fn start(&mut self) -> Result<Option<Start<'s>>, NotFlat> {
        if self.peek() == b'+' {
            self.at += 1;
            self.spaces();
            let value = self.time()?;
            return Ok(Some(Start::After(value)));
        }
        if !self.text.as_bytes().get(self.at..).is_some_and(|rest| matches!(rest, [b'a', b't', b' ' | b'\t', ..])) {
            return Ok(None);
        }
        self.at += 2;
        self.spaces();
        let value = self.time()?;
        let span = value.span;
        Ok(Some(Start::At(Moment { origin: Origin::Value(value), offsets: Vec::new(), span })))
    }

    /// A number, and the spaces after it.
    fn time(&mut self) -> Result<Value<'s>, NotFlat> {
        let value = self.number(self.at).ok_or(NotFlat)?;
        if self.continues()? { Ok(value) } else { Err(NotFlat) }
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

    /// A word that begins with this name; there may be more of it after a `-`.
    fn word(&mut self, name: Span) -> Option<Value<'s>> {
        while self.peek() == b'-' {
            self.at += 1;
            if self.skip(is_word) == 0 {
                return None;
            }
        }
        let span = Span { end: self.here(), ..name };
        Some(Value { negative: false, kind: ValueKind::Word(self.slice(span)), span })
    }

    /// A number with its letters; its minus is at `from`, if it has one.
    fn number(&mut self, from: usize) -> Option<Value<'s>> {
        let begin = self.at;
        if !(1..=MAX_DIGITS).contains(&self.skip(|byte| byte.is_ascii_digit())) {
            return None;
        }
        if self.peek() == b'.' {
            self.at += 1;
            if !(1..=MAX_DIGITS).contains(&self.skip(|byte| byte.is_ascii_digit())) {
                return None;
            }
        }
        let unit = self.at;
        self.skip(|byte| byte.is_ascii_alphabetic());
        let letters = self.text.get(unit..self.at)?;
        let shape = if letters.is_empty() {
            if self.is_before_beats() {
                return None;
            }
            NumberShape::Plain
        } else if time_unit(letters).is_some() {
            NumberShape::Duration
        } else if letters.starts_with('x') {
            return None;
        } else {
            NumberShape::Plain
        };
        let text = self.text.get(begin..self.at)?;
        Some(Value { negative: from != begin, kind: ValueKind::Number(shape, text), span: self.span(from) })
    }

    /// Whether the number that ends here is one of beats or bars, which follow a space.
    fn is_before_beats(&self) -> bool {
        let rest = self.text.get(self.at..).unwrap_or_default().trim_start_matches([' ', '\t']);
        let rest = rest.strip_prefix("beat").or(rest.strip_prefix("bar"));
        rest.is_some_and(|rest| !rest.strip_prefix('s').unwrap_or(rest).bytes().next().is_some_and(is_word))
    }

    fn name(&mut self) -> Name<'s> {
        let from = self.at;
        if !self.peek().is_ascii_digit() {
            self.skip(is_word);
        }
        let span = self.span(from);
        Name { text: self.slice(span), span }
    }

    fn spaces(&mut self) {
        self.skip(|byte| matches!(byte, b' ' | b'\t'));
    }

    /// Skips bytes of a kind; returns their number.
    fn skip(&mut self, is_one: impl Fn(u8) -> bool) -> usize {
        let rest = self.text.as_bytes().get(self.at..).unwrap_or_default();
        let count = rest.iter().position(|byte| !is_one(*byte)).unwrap_or(rest.len());
        self.at += count;
        count
    }

    /// The byte here; a line feed at the end of the text.
    fn peek(&self) -> u8 {
        self.text.as_bytes().get(self.at).copied().unwrap_or(b'\n')
    }

    /// Whether the line ends here, or the rest of it is a comment.
    fn is_end(&self) -> bool {
        match self.peek() {
            b'\n' | b'#' => true,
            b'\r' => self.text.as_bytes().get(self.at + 1) == Some(&b'\n'),
            _ => false,
        }
    }

    /// After a word or a number: whether more follows in this line, after a space, which is skipped.
    fn continues(&mut self) -> Result<bool, NotFlat> {
        let from = self.at;
        self.spaces();
        if self.is_end() {
            return Ok(false);
        }
        if self.at > from { Ok(true) } else { Err(NotFlat) }
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

/// Whether a word begins a statement of another kind.
fn is_other(word: &str) -> bool {
    matches!(word, "at" | "def" | "else" | "if" | "let" | "use")
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use pest::Parser as _;
    use proptest::prelude::*;

    use super::super::ast::Ast;
    use super::super::build::Builder;
    use super::super::grammar::{Grammar, Rule};
    use super::super::{parse, scan};
    use crate::diagnostic::{Diagnostic, Diagnostics};
    use crate::source::Source;
    use crate::units::{UNITS, time_unit};

    /// What flat lines are made of, and what makes lines that only look flat.
    #[expect(clippy::too_many_lines, reason = "a list")]
    fn fragment() -> impl Strategy<Value = String> {
        let words = [
            "at",
            "servo",
            "rocker",
            "x",
            "buzzer",
            "on",
            "in-out-sine",
            "for",
            "bar",
            "beats",
            "beat",
            "def",
            "let",
            "if",
            "else",
            "use",
            "not",
            "and",
            "min",
            "Up",
            "_a1",
            "a-",
            "stop",
            "near",
        ];
        let numbers = [
            "0",
            "1",
            "1500",
            "0.5s",
            "10ms",
            "2min",
            "1m30s",
            "90deg",
            "9us",
            "3mi",
            "0x1F",
            "1.",
            ".5",
            "1.2.3",
            "1e3",
            "007",
            "1234567890123456",
            "0.1234567890123456",
            "3/4",
            "5_0",
            "7x",
            "12V",
            "4m",
        ];
        let signs = [
            " ",
            "  ",
            "\t",
            "=",
            "-",
            "->",
            "..",
            ",",
            ";",
            ":",
            "(",
            ")",
            "{",
            "}",
            "\"",
            "#",
            "# allow: raw-frame",
            "+",
            "*",
            "<",
            "==",
            "é",
            "µs",
            "\r",
            "\u{1}",
            "\\",
        ];
        prop_oneof![
            4 => prop::sample::select(words.to_vec()).prop_map(str::to_owned),
            4 => prop::sample::select(numbers.to_vec()).prop_map(str::to_owned),
            6 => Just(" ".to_owned()),
            3 => prop::sample::select(signs.to_vec()).prop_map(str::to_owned),
        ]
    }

    fn script() -> impl Strategy<Value = String> {
        let soup = prop::collection::vec(fragment(), 0..10).prop_map(|parts| parts.concat());
        let flat = (
            prop_oneof![Just(String::new()), "at [0-9]{1,3}(\\.[0-9]{1,2})?(s|ms|m) ", "\\+ ?[0-9]{1,2}ms "],
            "[a-z]{2,6}",
            "( [xyz]=-?[0-9]{1,3}| -?[0-9]{1,4}| [a-z]{1,3}| [a-z]{2}-[a-z]{3}){0,4}",
            prop_oneof![Just(""), Just("  # why"), Just(" "), Just("#")],
        );
        let flat = flat.prop_map(|(start, head, arguments, comment)| format!("{start}{head}{arguments}{comment}"));
        let line = prop_oneof![2 => soup, 3 => flat];
        let ends = prop_oneof![8 => Just("\n"), 2 => Just("\r\n"), 1 => Just("")];
        prop::collection::vec((line, ends), 0..8)
            .prop_map(|lines| lines.into_iter().fold(String::new(), |text, (line, end)| text + &line + end))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

        /// Lines, spans and errors are those of the grammar, in whichever way each line is read.
        #[test]
        fn flat_lines_are_read_as_the_grammar_reads_them(text in script()) {
            let source = Source::new("x.motion", text.as_str());
            let mut found = Diagnostics::default();
            let tree = parse(&source, &mut found);
            let mut expected = Diagnostics::default();
            let grammar = scan::scan(&source, &mut expected).map(|mut scanned| {
                scanned.blocks.clear();
                let outline = scanned.outline(scanned.whole().range);
                let mut builder = Builder::new(&scanned, &outline, &mut expected);
                match Grammar::parse(Rule::script, &outline.text) {
                    Ok(pairs) => builder.add(pairs),
                    Err(error) => builder.unreadable(&error),
                }
                builder.finish()
            });
            let tree = tree.map(|Ast { body, lost }| (body.lines().map(Cow::into_owned).collect(), lost));
            prop_assert_eq!(tree, grammar);
            let sorted = |all: &Diagnostics| all.iter().cloned().collect::<Vec<Diagnostic>>();
            prop_assert_eq!(sorted(&found), sorted(&expected));
        }
    }

    #[test]
    fn the_grammar_names_every_unit_of_time() {
        let grammar = include_str!("../../grammar/motion.pest");
        let rule = grammar.lines().find_map(|line| line.strip_prefix("time_unit = @{ ")?.strip_suffix(" }")).unwrap();
        let mut named: Vec<&str> = rule.split(" | ").map(|name| name.trim_matches('"')).collect();
        let mut units: Vec<&str> =
            UNITS.iter().map(|unit| unit.name).filter(|name| time_unit(name).is_some()).collect();
        named.sort_unstable();
        units.sort_unstable();
        assert_eq!(named, units);
    }

    /// The test above would say nothing if no line were flat.
    #[test]
    fn usual_lines_are_flat() {
        for line in [
            "servo 1 1500",
            "at 0.5s rocker x=10 z=-50 for 1s  # a turn\n",
            "+10ms buzzer on\r\n",
            "servo 1 90deg over 2s ease in-out-sine",
        ] {
            assert!(matches!(super::line(line, 0), Ok(Some(_))), "{line}");
        }
        for line in
            ["let a = 5", "servo 1 (a)", "at 1 beat stop", "stop; stop", "repeat 2 {", "say \"a\"", "servo 1 1 -> 2"]
        {
            assert!(super::line(line, 0).is_err(), "{line}");
        }
    }
}
