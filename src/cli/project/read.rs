//! The text of a configuration file as settings, and every mistake in it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ignore::gitignore::{Gitignore, GitignoreBuilder};
use motionseq::board::{Board, FAMILIES, Family, Limited, Measure};
use motionseq::diagnostic::{Code, Denied, Diagnostic, Diagnostics};
use motionseq::program::{ProjectLimit, limit_items, suggest};
use motionseq::source::{Source, SourceError, Span};
use motionseq::units::{Micros, Nanos, NotATime};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::ConfigError;
use super::settings::{Config, Setting};

/// The keys of the file.
const KEYS: [&str; 6] = ["port", "paths", "exclude", "deny", "play", "limits"];
/// Settings of a script that a user may expect in the file.
const OF_SCRIPTS: [&str; 6] = ["rate", "tempo", "seed", "meter", "refresh", "baud"];

/// Reads a configuration file. Its paths and patterns are relative to `base`.
pub(super) fn read(source: Source, path: &Path, base: &Path) -> Result<Config, ConfigError> {
    let config = Config { path: Some(path.to_owned()), name: source.name().to_owned(), ..Config::default() };
    let mut reader = Reader { source: &source, base, config, found: Diagnostics::default() };
    let (table, errors) = DeTable::parse_recoverable(source.text());
    for error in &errors {
        let span = error.span().map_or(Span::default(), |span| Span::new(span.start, span.end));
        let help = "write `KEY = \"TEXT\"` or `KEY = [\"TEXT\"]`; `motionseq explain config-syntax` has an example";
        reader.found.push(Diagnostic::new(Code::ConfigSyntax, span, error.message().trim(), help));
    }
    if errors.is_empty() {
        reader.file(table.get_ref());
    }
    let Reader { config, found, .. } = reader;
    if found.has_errors() { Err(ConfigError::Wrong(Box::new((source, found)))) } else { Ok(config) }
}

/// A file that is not UTF-8.
pub(super) fn not_text(error: SourceError) -> ConfigError {
    let words = error.to_string();
    let Some((source, mut diagnostic)) = Diagnostic::of_source(error) else { return ConfigError::Unreadable(words) };
    "save the file as UTF-8 in your editor".clone_into(&mut diagnostic.help);
    let mut found = Diagnostics::default();
    found.push(diagnostic);
    ConfigError::Wrong(Box::new((source, found)))
}

/// Reads a time for `--max-late`.
pub(in super::super) fn max_late(text: &str) -> Result<Nanos, String> {
    match text.parse::<Micros>() {
        Ok(time) if time < Micros::from_millis(1) => Err("too short; write 1ms or more".into()),
        Ok(time) if time <= Micros::from_millis(10_000) => Ok(time.nanos()),
        Ok(_) | Err(NotATime::TooLong) => Err("too long; write 10s or less".into()),
        Err(_) => Err("write a time such as 50ms or 1s".into()),
    }
}

struct Reader<'s> {
    source: &'s Source,
    base: &'s Path,
    config: Config,
    found: Diagnostics,
}

type Key<'s> = Spanned<std::borrow::Cow<'s, str>>;
type Value<'s> = Spanned<DeValue<'s>>;

fn span_of<T>(spanned: &Spanned<T>) -> Span {
    let span = spanned.span();
    Span::new(span.start, span.end)
}

impl Reader<'_> {
    fn file(&mut self, table: &DeTable<'_>) {
        for (key, value) in table {
            match key.get_ref().as_ref() {
                "port" => self.port(value),
                "paths" => self.paths(value),
                "exclude" => self.exclude(value),
                "deny" => self.deny(value),
                "play" => self.table(key, value, |reader, key, value| match key.get_ref().as_ref() {
                    "max-late" => reader.max_late(value),
                    _ => reader.unknown(key, &["max-late"], "[play]"),
                }),
                "limits" => self.table(key, value, Self::limit),
                word if OF_SCRIPTS.contains(&word) => {
                    let help = format!("write `{word}` into the script: the file never changes what a script sends");
                    let message = format!("`{word}` is a setting of a script");
                    self.found.push(Diagnostic::new(Code::ConfigKey, span_of(key), message, help));
                }
                _ => self.unknown(key, &KEYS, "the file"),
            }
        }
    }

    /// Reports a key that does not exist.
    fn unknown(&mut self, key: &Key<'_>, known: &[&str], place: &str) {
        let word: &str = key.get_ref();
        let help = match suggest(word, known.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("the keys of {place} are {}", known.join(", ")),
        };
        self.found.push(Diagnostic::new(Code::ConfigKey, span_of(key), format!("unknown key `{word}`"), help));
    }

    fn wrong(&mut self, span: Span, message: impl Into<String>, help: impl Into<String>) {
        self.found.push(Diagnostic::new(Code::ConfigValue, span, message, help));
    }

    fn table(&mut self, key: &Key<'_>, value: &Value<'_>, mut each: impl FnMut(&mut Self, &Key<'_>, &Value<'_>)) {
        let Some(table) = value.get_ref().as_table() else {
            let message = format!("a table is needed here, not {}", kind(value));
            self.wrong(span_of(value), message, format!("write `[{}]` on a line of its own", key.get_ref()));
            return;
        };
        for (key, value) in table {
            each(self, key, value);
        }
    }

    fn text<'v>(&mut self, value: &'v Value<'_>, example: &str) -> Option<&'v str> {
        let text = value.get_ref().as_str();
        if text.is_none() {
            let message = format!("text is needed here, not {}", kind(value));
            self.wrong(span_of(value), message, format!("write it in quotation marks: `{example}`"));
        }
        text
    }

    /// The strings of a list. Anything else in it is reported.
    fn list<'v>(&mut self, value: &'v Value<'_>, example: &str) -> Option<Vec<(&'v str, Span)>> {
        let Some(array) = value.get_ref().as_array() else {
            let message = format!("a list is needed here, not {}", kind(value));
            self.wrong(span_of(value), message, format!("write it in brackets: `{example}`"));
            return None;
        };
        Some(array.iter().filter_map(|value| Some((self.text(value, example)?, span_of(value)))).collect())
    }

    fn setting<T>(&self, of: &Value<'_>, value: T) -> Setting<T> {
        let span = span_of(of);
        Setting { value, written: shown(of.get_ref()), line: self.source.line(span.start) }
    }

    fn port(&mut self, value: &Value<'_>) {
        let Some(text) = self.text(value, "port = \"/dev/serial0\"") else { return };
        if text.is_empty() {
            self.wrong(span_of(value), "the port is empty", "write `\"virtual\"` for the virtual board");
            return;
        }
        // A word, such as `virtual`, means what it means as the value of `--port`.
        let path = if text.contains('/') { self.base.join(text) } else { PathBuf::from(text) };
        let port = (text != super::VIRTUAL).then_some(path);
        self.config.port = Some(self.setting(value, port));
    }

    fn paths(&mut self, value: &Value<'_>) {
        let Some(list) = self.list(value, "paths = [\"scripts\"]") else { return };
        if list.is_empty() {
            self.wrong(span_of(value), "the list is empty", "name a folder, or remove the line");
            return;
        }
        let here = std::env::current_dir().unwrap_or_default();
        let paths: Vec<PathBuf> = list.iter().map(|(path, _)| super::from_here(&here, &self.base.join(path))).collect();
        self.config.paths = Some(self.setting(value, paths));
    }

    fn exclude(&mut self, value: &Value<'_>) {
        let Some(list) = self.list(value, "exclude = [\"drafts\"]") else { return };
        let mut patterns = GitignoreBuilder::new(self.base);
        for (pattern, span) in list {
            if let Err(error) = patterns.add_line(None, pattern) {
                let why = error.to_string();
                self.wrong(
                    span,
                    format!("`{pattern}` is not a pattern: {why}"),
                    "write it as in a .gitignore: `drafts`, `*.old.motion`",
                );
            }
        }
        let exclude = patterns.build().unwrap_or_else(|error| {
            self.wrong(span_of(value), format!("these patterns cannot be used: {error}"), "write fewer patterns");
            Gitignore::empty()
        });
        self.config.exclude = Some(self.setting(value, exclude));
    }

    fn deny(&mut self, value: &Value<'_>) {
        let Some(list) = self.list(value, "deny = [\"warnings\"]") else { return };
        let mut denied = Denied::default();
        for (name, span) in list {
            match name.parse() {
                Ok(more) => denied = denied.and(&more),
                Err(()) if Code::named(name).is_some() => {
                    self.wrong(span, format!("`{name}` is an error, not a warning"), "errors always fail; remove it");
                }
                Err(()) => {
                    let help = match suggest(name, Denied::names()) {
                        Some(near) => format!("did you mean `{near}`?"),
                        None => "write `warnings` for all, or codes; `motionseq explain` lists them".to_owned(),
                    };
                    self.wrong(span, format!("there is no warning `{name}`"), help);
                }
            }
        }
        self.config.deny = Some(self.setting(value, denied));
    }

    fn max_late(&mut self, value: &Value<'_>) {
        let Some(text) = self.text(value, "max-late = \"50ms\"") else { return };
        match max_late(text) {
            Ok(time) => self.config.max_late = Some(self.setting(value, time)),
            Err(help) => self.wrong(span_of(value), format!("`{text}` cannot be the lateness that ends a run"), help),
        }
    }

    fn limit(&mut self, key: &Key<'_>, value: &Value<'_>) {
        let boards: Vec<_> = FAMILIES.iter().map(|family| (family, family.usual())).collect();
        let items = limit_keys(&boards);
        let fitting: Vec<_> = items.iter().filter(|(_, (name, _))| name == key.get_ref().as_ref()).collect();
        let Some((_, (name, _))) = fitting.first() else {
            let names: Vec<&str> = items.iter().map(|(_, (name, _))| name.as_str()).collect();
            self.unknown(key, &names, "[limits]");
            return;
        };
        let Some(range) = self.text(value, &format!("{name} = \"LOW..HIGH\"")) else { return };
        let setting = self.setting(value, ());
        let read = |(board, (_, limited)): &&(&Arc<Board>, (String, Limited))| {
            ProjectLimit::read(board, *limited, range, self.config.place(setting.line))
        };
        // It applies to every board that has such a value, so one that accepts the range is enough.
        let found = fitting.iter().map(read).reduce(|first, next| if first.is_ok() { first } else { next.or(first) });
        match found {
            Some(Ok(limit)) => {
                let setting = Setting { value: limit, written: setting.written, line: setting.line };
                self.config.limits.push((name.clone(), setting));
            }
            Some(Err(error)) => self.wrong(self.inside(value, range, error.span), error.message, error.help),
            None => {}
        }
    }

    /// The place of a part of a text in quotation marks; the whole text if that contains escapes.
    fn inside(&self, value: &Value<'_>, text: &str, part: Span) -> Span {
        let whole = span_of(value);
        let (start, written) = (whole.range().start + 1, self.source.slice(whole));
        if written.get(1..).is_none_or(|written| !written.starts_with(text)) {
            return whole;
        }
        Span::new(start + part.range().start, start + part.range().end)
    }
}

/// The keys of `[limits]` for these boards. Where families measure a verb in different units, as `servo` in µs and in steps, the word of
/// the later family is in front: `sts-servo-1`.
fn limit_keys<'b>(boards: &'b [(&'static Family, Arc<Board>)]) -> Vec<(&'b Arc<Board>, (String, Limited))> {
    let mut measures: HashMap<String, Measure> = HashMap::new();
    let mut keys = Vec::new();
    for (family, board) in boards {
        for (name, limited) in limit_items(board) {
            let verb = board.verb(limited.verb).map(|verb| verb.word.to_string()).unwrap_or_default();
            let measure = board.axis(limited).map_or(Measure::Number, |axis| axis.unit.measure);
            let is_same = *measures.entry(verb).or_insert(measure) == measure;
            keys.push((board, (if is_same { name } else { format!("{}-{name}", family.word) }, limited)));
        }
    }
    keys
}

/// A text or a list of texts, as `config` shows it.
fn shown(value: &DeValue<'_>) -> serde_json::Value {
    match value {
        DeValue::Array(list) => list.iter().map(|value| shown(value.get_ref())).collect(),
        value => value.as_str().unwrap_or_default().into(),
    }
}

/// The type of a value, with its article.
fn kind(value: &Value<'_>) -> &'static str {
    match value.get_ref() {
        DeValue::String(_) => "text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
