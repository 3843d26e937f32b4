//! Names: which ones may be defined, what is said of unknown ones, and what was written at a place.

use super::evaluator::Evaluator;
use super::functions;
use super::pending::{Unknown, Used};
use super::value::Quantity;
use super::words::{is_name, is_reserved};
use crate::diagnostic::{Code, Diagnostic, MAX_ERRORS, bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Name, foreign};

/// The most characters of a script that a message repeats.
const LONGEST_SHOWN: usize = 200;

impl<'s> Evaluator<'s, '_> {
    /// Reports an unknown name. Errors beyond those that are kept are only counted.
    pub(super) fn report_unknown(&mut self, code: Code, unknown: Unknown<'s>, message: String, help: String) {
        let errors = self.diagnostics.errors();
        self.push(Diagnostic::new(code, unknown.name.span, message, help));
        if errors < MAX_ERRORS.min(self.diagnostics.errors()) {
            self.pending.add(code, unknown);
        }
    }

    /// The value of a name before a command: a mark, or a time.
    pub(super) fn moment_name(&mut self, name: &'s str, span: Span) -> Option<Quantity> {
        if let Some(value) = self.scope.value(name) {
            return Some(value);
        }
        if is_reserved(self.board, name) {
            return self.name(name, span);
        }
        if !self.may_exist(name) {
            let help = match self.scope.near(name, false) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!(
                    "write `mark {name}` on a line above, or a time: `at 1s …`; a mark in a `repeat` or `def` is known only there"
                ),
            };
            self.unknown_value(name, span, format!("there is no mark `{name}` here"), help);
        }
        None
    }

    fn unknown_value(&mut self, text: &'s str, span: Span, message: String, help: String) {
        let unknown = Unknown { name: Name { text, span }, used: Used::Value, may_exist: false };
        self.report_unknown(Code::UnknownName, unknown, message, help);
    }

    pub(super) fn unknown_name(&mut self, name: &'s str, span: Span) {
        // `repeat forever`, `wait until voltage > 10V`.
        let (start, statement) = self.statement_around(span);
        if let Some(found) = foreign::statement(statement, start) {
            return self.push(found.diagnostic());
        }
        if let Some(value) = foreign::value_named(name) {
            return report!(self, UnknownName, span, "unknown name `{name}`"; write: span => "{value}");
        }
        let help = match self.scope.near(name, false) {
            _ if self.robot_number(name).is_some() => {
                format!("`{name}` is a robot: write `{name}:` before a command, a call or a block")
            }
            Some(near) => format!("did you mean `{near}`?"),
            None => self.how_to_name(name, statement),
        };
        let message = if self.board.quantities.iter().any(|quantity| quantity.name == name) {
            format!("`{name}` is only known while the script plays")
        } else {
            format!("unknown name `{name}`")
        };
        self.unknown_value(name, span, message, help);
    }

    /// How to give a value to a name that has none.
    fn how_to_name(&self, name: &str, statement: &str) -> String {
        let is_measured = self.board.quantities.iter().any(|quantity| quantity.name == name);
        if is_measured && let Some(condition) = statement.strip_prefix("if ") {
            let condition = condition.split('{').next().unwrap_or_default().trim();
            return format!(
                "an `if` is decided before anything is sent; to end the script unless this is true, write `expect {condition}`"
            );
        }
        if is_measured {
            return format!(
                "reports come while the script runs: `expect {name} …` checks one, and `say \"{{{name}}}\"` shows it"
            );
        }
        if name.contains('-') {
            return format!("write a difference with spaces: `({})`", name.replace('-', " - "));
        }
        match u8::from_str_radix(name, 16) {
            Ok(byte) if name.len() == 2 && !is_name(name) => {
                return format!("write a hexadecimal number with `0x`: `0x{byte:02X}`");
            }
            Ok(byte) if name.len() == 2 => {
                return format!(
                    "write `let {name} = …` on a line above, or a hexadecimal number with `0x`: `0x{byte:02X}`"
                );
            }
            _ => {}
        }
        if name.starts_with(|c: char| c.is_ascii_uppercase()) {
            return format!("names begin with a lower-case letter: `let {} = …` on a line above", name.to_lowercase());
        }
        match functions::find(name) {
            Some(function) => format!("call the function with its arguments: `{}`", function.usage),
            None if is_reserved(self.board, name) => {
                format!("`{name}` is a word of the language and has no value; check what precedes it")
            }
            None => format!(
                "write `let {name} = …` on a line above, or `mark {name}` for a moment; a `def` knows only the names above it, and the names of a `repeat` or `def` are known only inside it"
            ),
        }
    }

    /// The text of a file from the statement that contains a place, and where that statement begins.
    pub(super) fn statement_around(&self, span: Span) -> (usize, &'s str) {
        let source = self.sources.file(span);
        let (base, text) = (source.base() as usize, source.text());
        let before = text.get(..span.range().start - base).unwrap_or_default();
        let start = before.rfind(['\n', '{', '}', ';']).map_or(0, |at| at + 1);
        let rest = text.get(start..).unwrap_or_default();
        let statement = rest.trim_start();
        (base + start + rest.len() - statement.len(), statement)
    }

    /// What was written at a place.
    pub(super) fn written(&self, span: Span) -> &'s str {
        self.sources.file(span).slice(span)
    }

    /// What was written at a place, on one line, with other texts at the places in it, which come in order. A long one is cut.
    pub(super) fn rewritten(&self, whole: Span, edits: &[(Span, String)]) -> String {
        let mut text = String::new();
        let mut at = whole.start;
        for (span, with) in edits {
            text.push_str(self.written(Span { start: at, end: span.start }));
            text.push_str(with);
            at = span.end;
        }
        text.push_str(self.written(Span { start: at, end: whole.end }));
        let mut text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        if let Some((end, _)) = text.char_indices().nth(LONGEST_SHOWN) {
            text.truncate(end);
            text.push('…');
        }
        text
    }

    pub(super) fn given_twice<T>(&mut self, name: Name<'s>, first: Span) -> Option<T> {
        let diagnostic = diagnostic!(Name, name.span, "the name `{}` is defined twice", name.text;
            help: "choose another name for one of the two");
        self.push(diagnostic.label("again here").related(first, "first defined here"));
        None
    }

    /// Whether a name may be given here; where not, that is reported.
    pub(super) fn is_free(&mut self, name: Name<'s>) -> Option<()> {
        let text = name.text;
        if is_reserved(self.board, text) {
            bail!(self, Name, name.span, "`{text}` is a word of the language";
                help: "choose another name, such as `my_{text}`");
        }
        if !is_name(text) {
            bail!(self, Name, name.span, "a name consists of lower-case letters, digits and `_`";
                write: name.span => "{}", text.to_lowercase().replace('-', "_"));
        }
        let robot = self.robots.iter().find(|robot| robot.text == text).map(|robot| robot.span);
        if let Some(first) = self.scope.taken(text).or(robot) {
            return self.given_twice(name, first);
        }
        Some(())
    }
}
