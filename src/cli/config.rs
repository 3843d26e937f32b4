//! `motionseq config`: shows the configuration that applies, and where each value comes from.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use motionseq::diagnostic::escaped;
use serde_json::{Value, json};

use super::exit::Exit;
use super::output;
use super::project::{Config as Settings, ConfigOptions, NAME, VIRTUAL, ValueSource};
use super::screen::Screen;

/// Show the configuration that applies, and where each value comes from
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq config                          # what applies in this folder\n  motionseq config scripts/dance.motion     # what applies to a script\n  motionseq config --format json | jq '.settings[] | select(.source != \"default\")'\n\nThe nearest motionseq.toml applies: the one in the folder of the script, or else in the first folder above it that has one.\nAn option of the command line overrides a variable of the environment, and that overrides the file."
)]
pub(super) struct Config {
    /// Script or folder that it applies to [default: this folder]
    #[arg(value_name = "PATH")]
    path: Option<PathBuf>,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Toml)]
    format: Format,
    #[command(flatten)]
    options: ConfigOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// One `KEY = VALUE` per line, with its source as a comment
    Toml,
    /// One JSON object
    Json,
}

/// One line: a key, its value, and where that comes from.
struct Row {
    key: String,
    value: Value,
    source: ValueSource,
    /// What else a user should know.
    note: &'static str,
}

impl Config {
    /// Prints every key.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.print(screen).unwrap_or_else(|exit| exit)
    }

    fn print(&self, screen: &Screen) -> Result<Exit, Exit> {
        let path = self.path.as_deref().unwrap_or(Path::new("."));
        let kind = path.metadata().map_err(|error| {
            screen.error(&format!("cannot read {}: {error}", path.display()));
            Exit::Usage
        })?;
        let folder = if kind.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
        let configs = self.options.configs();
        let config = configs.of_folder(folder, screen)?;
        let not_used = configs.not_used(folder, &config);
        let rows = rows(&config);
        let text = match self.format {
            Format::Toml => toml(&config, &not_used, &rows),
            Format::Json => json(&config, &not_used, &rows),
        };
        Ok(output::exit(io::stdout().lock().write_all(text.as_bytes()), None, screen))
    }
}

/// Every key with its value.
fn rows(config: &Settings) -> Vec<Row> {
    let row = |key: &str, set: Option<(&Value, usize)>, usual: Value, note: &'static str| {
        let source = set.map(|(_, line)| ValueSource::File(config.place(line)));
        let value = set.map_or(usual, |(value, _)| value.clone());
        let note = if source.is_some() { "" } else { note };
        Row { key: key.to_owned(), value, source: source.unwrap_or(ValueSource::Default), note }
    };
    let port = config.port(None);
    let name = port.path.as_deref().map_or(VIRTUAL.into(), |path| path.display().to_string());
    let mut rows = vec![
        Row { key: "port".to_owned(), value: name.into(), source: port.source, note: "" },
        row("paths", config.paths.as_ref().map(|set| (&set.written, set.line)), json!(["."]), ""),
        row("exclude", config.exclude.as_ref().map(|set| (&set.written, set.line)), json!([]), ""),
        row("deny", config.deny.as_ref().map(|set| (&set.written, set.line)), json!([]), ""),
        row(
            "play.max-late",
            config.max_late.as_ref().map(|set| (&set.written, set.line)),
            json!("50ms"),
            "; 1s on the virtual board",
        ),
    ];
    for config in config.with_those_above() {
        rows.extend(config.limits.iter().map(|(name, set)| Row {
            key: format!("limits.{name}"),
            value: set.written.clone(),
            source: ValueSource::File(config.place(set.line)),
            note: "",
        }));
    }
    rows
}

fn toml(config: &Settings, not_used: &[String], rows: &[Row]) -> String {
    let mut lines = match config.path {
        Some(_) => vec![format!("# {}", config.name)],
        None if not_used.is_empty() => {
            vec![format!("# no {NAME} in this folder or above; `motionseq init` writes one into an empty folder")]
        }
        None => Vec::new(),
    };
    lines.extend(config.with_those_above().skip(1).map(|above| format!("# {}: only its limits", above.name)));
    lines.extend(not_used.iter().map(|name| format!("# not used: {name}")));
    let settings: Vec<String> = rows.iter().map(|row| format!("{} = {}", row.key, of_toml(&row.value))).collect();
    let width = settings.iter().map(|setting| setting.chars().count()).max().unwrap_or(0);
    let with_source = |(setting, row): (&String, &Row)| format!("{setting:<width$}  # {}{}", row.source, row.note);
    lines.extend(settings.iter().zip(rows).map(with_source));
    lines.iter().map(|line| escaped(line) + "\n").collect()
}

/// A value with a space after each comma.
fn of_toml(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("[{}]", list.iter().map(of_toml).collect::<Vec<_>>().join(", ")),
        value => value.to_string(),
    }
}

fn json(config: &Settings, not_used: &[String], rows: &[Row]) -> String {
    let setting = |row: &Row| {
        let (source, place) = match &row.source {
            ValueSource::Option => ("command line", None),
            ValueSource::Environment(name) => ("environment", Some(name.clone())),
            ValueSource::File(place) => ("file", Some(place.clone())),
            ValueSource::Default => ("default", None),
        };
        json!({"key": row.key, "value": row.value, "source": source, "place": place})
    };
    let settings: Vec<Value> = rows.iter().map(setting).collect();
    let file = config.path.as_ref().map(|_| &config.name);
    let above: Vec<&String> = config.with_those_above().skip(1).map(|above| &above.name).collect();
    format!("{:#}\n", json!({"version": 1, "file": file, "above": above, "not_used": not_used, "settings": settings}))
}
