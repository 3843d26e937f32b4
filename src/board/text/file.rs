//! Reads the file of a text board, and reports every mistake in it.

use toml::de::{DeTable, DeValue};

use super::build::{self, AxisRow, FileRows, Line, VerbRow};
use super::reader::{Key, Reader, Value, is_name};
use super::template::{Field, Template};
use crate::board::{Board, MAX_MOVING};
use crate::diagnostic::{Code, Diagnostics};
use crate::source::{Source, Span};
use crate::units::Micros;

/// The longest file in bytes.
pub const MAX_FILE: usize = 1 << 20;
/// The most verbs: a row is a byte, and some rows are for lines without a verb.
const MAX_VERBS: usize = 100;

const KEYS: &[&str] = &["name", "baud", "verb", "hello", "goodbye", "stop"];
const OF_VERB: &[&str] = &["axes", "send", "moves", "holds", "rest", "refresh", "resource", "meaning"];

/// Reads a board. `name` is the path of the file as a script writes it; `is_reserved` says whether a
/// word belongs to the language. `None` if the file is wrong, which is reported.
pub fn read(
    source: &Source,
    name: &str,
    is_reserved: &dyn Fn(&str) -> bool,
    diagnostics: &mut Diagnostics,
) -> Option<Board> {
    let errors = diagnostics.errors();
    let mut reader = Reader { source, is_reserved, diagnostics };
    if source.text().len() > MAX_FILE {
        let help = "a board is described in a few lines; is this the right file?";
        reader.report(Code::BoardValue, reader.at(0..0), "the file of a board is at most 1 MiB", help);
        return None;
    }
    let (table, wrong) = DeTable::parse_recoverable(source.text());
    for error in &wrong {
        let span = reader.at(error.span().unwrap_or(0..0));
        let help = if error.message().contains("duplicate") {
            "each key and each table may be there once: merge the two, or rename one"
        } else {
            "write `KEY = VALUE`, and strings in quotation marks: `send = 'L{state}\\n'`"
        };
        reader.report(Code::BoardSyntax, span, error.message().trim(), help);
    }
    if !wrong.is_empty() {
        return None;
    }
    let rows = reader.file(table.get_ref());
    let rows = rows.filter(|_| reader.diagnostics.errors() == errors)?;
    let board = build::board(&rows, name, reader.diagnostics);
    board.filter(|_| diagnostics.errors() == errors)
}

impl Reader<'_> {
    fn file(&mut self, table: &DeTable<'_>) -> Option<FileRows> {
        let start = self.at(0..0);
        let rows = self.rows(table, KEYS, "the file");
        let name = self.needed(&rows, "name", ("the file", start), "name = \"My robot\"");
        let name = name.and_then(|value| {
            let name = self.text(value, "name = \"My robot\"")?;
            let is_fine = !name.trim().is_empty() && name.len() <= 60 && !name.chars().any(char::is_control);
            let name = is_fine.then(|| name.to_owned());
            name.or_else(|| {
                self.wrong(
                    self.span(value),
                    "a name has 1 to 60 characters, without control characters",
                    "write `name = \"My robot\"`",
                )
            })
        });
        let baud = self.needed(&rows, "baud", ("the file", start), "baud = 115200");
        let baud = baud.and_then(|value| self.integer(value, (1_200, 4_000_000), "the speed of the line"));
        let mut lines = |key: &str| rows.get(key).map_or_else(|| Some(Vec::new()), |(_, value)| self.lines(value, key));
        let (hello, goodbye, stop) = (lines("hello"), lines("goodbye"), lines("stop"));
        let verbs = match rows.get("verb") {
            None => {
                let help = "add one: `[verb.servo]`, and below it `send = 'S{us}\\n'`";
                self.report(Code::BoardKey, start, "the board has no verb", help);
                None
            }
            Some((span, value)) => self.verbs(*span, value),
        };
        let baud = u32::try_from(baud?).ok()?;
        Some(FileRows { name: name?, baud, verbs: verbs?, hello: hello?, goodbye: goodbye?, stop: stop?, span: start })
    }

    /// Lines that are always the same: one string, or a list of strings.
    fn lines(&mut self, value: &Value<'_>, key: &str) -> Option<Vec<Line>> {
        let values: Vec<&Value<'_>> = match value.get_ref() {
            DeValue::Array(list) => list.iter().collect(),
            _ => vec![value],
        };
        if values.len() > MAX_VERBS {
            return self.wrong(self.span(value), format!("`{key}` has at most {MAX_VERBS} lines"), "write fewer lines");
        }
        values.into_iter().map(|value| self.line(value, &[], &format!("{key} = ['RESET\\n']"))).collect()
    }

    /// A template with its place.
    fn line(&mut self, value: &Value<'_>, fields: &[Field], example: &str) -> Option<Line> {
        let text = self.text(value, example)?;
        let whole = self.span(value);
        match Template::read(text, fields) {
            Ok(template) => Some(Line { template, span: whole }),
            Err(error) => {
                // In a string with escapes of TOML, the position is unknown.
                let written = self.source.slice(whole);
                let is_literal = written.get(1..).is_some_and(|written| written.starts_with(text));
                let start = value.span().start + 1;
                let part = self.at(start + error.at.start..start + error.at.end);
                let span = if is_literal { part } else { whole };
                self.report(Code::BoardTemplate, span, error.message, error.help);
                None
            }
        }
    }

    /// All verbs, in the order of the file.
    fn verbs(&mut self, span: Span, value: &Value<'_>) -> Option<Vec<VerbRow>> {
        let Some(table) = value.get_ref().as_table().filter(|table| !table.is_empty()) else {
            return self.wrong(span, "a verb is a table with its word", "write `[verb.servo]`");
        };
        let mut verbs: Vec<_> = table.iter().collect();
        verbs.sort_by_key(|(key, _)| key.span().start);
        if verbs.len() > MAX_VERBS {
            return self.wrong(span, format!("a board has at most {MAX_VERBS} verbs"), "remove some");
        }
        let rows: Vec<_> = verbs.into_iter().map(|(key, value)| self.verb(key, value)).collect();
        rows.into_iter().collect()
    }

    fn verb(&mut self, key: &Key<'_>, value: &Value<'_>) -> Option<VerbRow> {
        let (word, span): (&str, Span) = (key.get_ref(), self.span(key));
        if !is_name(word) {
            let help = "write small letters, digits and `_`, beginning with a letter: `[verb.servo]`";
            return self.wrong(span, format!("`{word}` cannot be the word of a command"), help);
        }
        if (self.is_reserved)(word) {
            let help = format!("choose another word: `[verb.{word}_it]`");
            return self.wrong(span, format!("`{word}` is a word of the language"), help);
        }
        let Some(table) = value.get_ref().as_table() else {
            return self.wrong(span, "a verb is a table", format!("write `[verb.{word}]` on a line of its own"));
        };
        let rows = self.rows(table, OF_VERB, "a verb");
        let axes = rows.get("axes").map_or_else(|| Some(Vec::new()), |(_, value)| self.axes(value));
        let (moves, holds) = (self.flag(&rows, "moves"), self.flag(&rows, "holds"));
        let send = self.needed(&rows, "send", (&format!("the verb `{word}`"), span), "send = '…\\n'");
        let (axes, (moves, holds)) = (axes?, (moves?, holds?));
        let fields: Vec<Field> = axes.iter().map(|axis| axis.field.clone()).collect();
        let send = send.and_then(|value| self.line(value, &fields, "send = 'L{state}\\n'"));
        let of_index: Vec<Field> = axes.iter().filter(|axis| axis.is_index).map(|axis| axis.field.clone()).collect();
        let rest = rows.get("rest").map(|(_, value)| self.line(value, &of_index, "rest = 'M 0 0\\n'"));
        let refresh = rows.get("refresh").map(|(_, value)| self.refresh(value));
        let resource = rows.get("resource").map(|(_, value)| self.resource(value));
        let meaning =
            rows.get("meaning").map(|(_, value)| self.text(value, "meaning = \"the lamp\"").map(str::to_owned));
        let send = send?;
        self.check_send(&send, &axes);
        self.check_moves(moves, &axes, rows.get("moves").map_or(span, |(span, _)| *span));
        Some(VerbRow {
            word: word.to_owned(),
            span,
            axes,
            send,
            moves,
            holds,
            rest: rest.map_or(Some(None), |rest| rest.map(Some))?,
            refresh: refresh.map_or(Some(None), |refresh| refresh.map(Some))?,
            resource: resource.map_or(Some(None), |resource| resource.map(Some))?,
            meaning: meaning.map_or(Some(String::new()), |meaning| meaning)?,
        })
    }

    /// A verb sends each of its axes once.
    fn check_send(&mut self, send: &Line, axes: &[AxisRow]) {
        for (at, axis) in axes.iter().enumerate() {
            let name = &axis.field.name;
            match send.template.axes().filter(|axis| *axis == at).count() {
                0 => self.report(
                    Code::BoardTemplate,
                    axis.span,
                    format!("`send` does not contain `{name}`"),
                    format!("write `{{{name}}}` in `send`, or remove the axis"),
                ),
                1 => {}
                _ => self.report(
                    Code::BoardTemplate,
                    send.span,
                    format!("`send` contains `{name}` twice"),
                    "write each axis once",
                ),
            }
        }
    }

    /// Only a few numbers can move.
    fn check_moves(&mut self, moves: bool, axes: &[AxisRow], span: Span) {
        let moving: Vec<&AxisRow> = axes.iter().filter(|axis| moves && !axis.is_index).collect();
        if moves && moving.is_empty() || moving.iter().any(|axis| axis.words.is_some()) {
            let help = "remove `moves`, or give the verb an axis with a `range`";
            self.report(Code::BoardValue, span, "only numbers can move", help);
        } else if moving.len() > MAX_MOVING {
            let message = format!("at most {MAX_MOVING} values can move together");
            self.report(Code::BoardValue, span, message, "remove `moves`");
        }
    }

    fn refresh(&mut self, value: &Value<'_>) -> Option<Micros> {
        let text = self.text(value, "refresh = \"100ms\"")?;
        let time = text.parse::<Micros>().ok();
        let time = time.filter(|time| (Micros::from_millis(10)..=Micros::from_millis(1_000)).contains(time));
        time.or_else(|| {
            self.wrong(
                self.span(value),
                format!("`{text}` is not an interval"),
                "write a time from 10ms to 1s, such as `\"100ms\"`",
            )
        })
    }

    fn resource(&mut self, value: &Value<'_>) -> Option<String> {
        let text = self.text(value, "resource = \"wheels\"")?;
        let name = is_name(text).then(|| text.to_owned());
        name.or_else(|| {
            self.wrong(
                self.span(value),
                format!("`{text}` cannot be the name of a resource"),
                "write a word such as `\"wheels\"`",
            )
        })
    }
}
