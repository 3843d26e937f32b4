//! What comes from outside of the script: the files that it uses, and `--set`.

use std::path::PathBuf;
use std::sync::Arc;

use super::super::text_board;
use super::super::time::Time;
use super::super::words;
use super::commands::At;
use super::{Frame, Set, Walker};
use crate::board::Board;
use crate::diagnostic::{bail, diagnostic, report};
use crate::source::{Source, Sources, Span};
use crate::syntax::{self, Block, Let, Statement, Value, ValueKind};

/// How deep files may use each other.
const MAX_DEPTH: usize = 16;

/// Files that were used, and those that are being read, the script itself first.
pub(super) struct Files {
    loaded: Vec<PathBuf>,
    loading: Vec<(PathBuf, Span)>,
}

impl Files {
    pub(super) fn of(sources: &Sources) -> Self {
        let main = sources.main_path().map(|path| (path, Span::default()));
        Files { loaded: Vec::new(), loading: main.into_iter().collect() }
    }
}

/// A string without its quotation marks.
fn unquoted(text: &str) -> &str {
    text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text)
}

impl<'s> Walker<'s, '_> {
    /// Binds the value of each `--set NAME=VALUE` to its name. The last one of a name wins.
    pub(super) fn read_sets(&mut self, sets: &[(String, String)]) {
        for (name, value) in sets {
            let source = Source::new(format!("--set {name}"), format!("{name}={value}"));
            let Some(source) = self.add(source, Span::default()) else { continue };
            if let Some(Let { name, value, span }) = syntax::parse_set(source, self.eval.diagnostics) {
                self.sets.retain(|set| set.name != name.text);
                self.sets.push(Set { name: name.text, value, span, used: false });
            }
        }
    }

    /// Adds a file to those that were read; `None` if that is too much, which is reported at `span`.
    fn add(&mut self, source: Source, span: Span) -> Option<&'s Source> {
        self.eval.sources.add(source).or_else(|| {
            bail!(self.eval, SourceTooLarge, span, "all files together are larger than 64 MiB";
                help: "use fewer or shorter files")
        })
    }

    /// Takes the names of another file.
    pub(super) fn use_(&mut self, at: At<'_, 's>) -> Option<Time> {
        let mut args = at.args(&mut self.eval)?;
        let value = args.next()?;
        args.finish()?;
        if !at.frame.top {
            return self.eval.top_level("use", at.command.span);
        }
        let used = self.try_use(value);
        // The names that it would have defined are not reported as unknown.
        self.eval.lost.any |= used.is_none();
        used.map(|()| at.start)
    }

    fn try_use(&mut self, value: &Value<'s>) -> Option<()> {
        let path = self.resolve_used(value)?;
        if self.files.loaded.contains(&path) {
            return Some(());
        }
        if self.files.loading.len() > MAX_DEPTH {
            bail!(self.eval, Use, value.span, "`use` is nested more than {MAX_DEPTH} deep";
                help: "use fewer files in each other");
        }
        let errors = self.eval.diagnostics.errors();
        let source = match self.eval.sources.load(&path) {
            Ok(source) => source,
            Err(error) => {
                bail!(self.eval, Use, value.span, "{}", error.to_string();
                    help: "check the name of the file, and whether it is a script");
            }
        };
        let source = self.add(source, value.span)?;
        let mut tree = syntax::parse(source, self.eval.diagnostics)?;
        self.eval.lost.add(std::mem::take(&mut tree.lost));
        self.files.loading.push((path.clone(), value.span));
        let main = std::mem::replace(&mut self.eval.scope.main, false);
        let outer = std::mem::take(&mut self.eval.pending);
        self.eval.lost.add(outer.lost.clone());
        tree.body.lines().for_each(|line| self.eval.pending.read(&line));
        self.check_used(&tree.body);
        let is_fine = self.eval.diagnostics.errors() == errors;
        if is_fine {
            self.lines(tree.body.places(), &mut Frame { top: true, ..Frame::default() });
        }
        let pending = std::mem::replace(&mut self.eval.pending, outer);
        pending.complete(self.eval.sources, self.eval.diagnostics);
        self.eval.scope.main = main;
        self.files.loading.pop();
        self.files.loaded.push(path);
        // No name of a file with a mistake is known.
        is_fine.then_some(())
    }

    /// The file that a `use` names, which must not be one that is being read.
    fn resolve_used(&mut self, value: &Value<'s>) -> Option<PathBuf> {
        let ValueKind::Text(quoted) = value.kind else {
            bail!(self.eval, InvalidArgument, value.span, "`use` needs the name of a file";
                help: "write its name in quotation marks: `use \"lib/phrases.motion\"`");
        };
        let name = unquoted(quoted);
        let path = self.resolve("use", name, value.span, |name| {
            [format!("{name}.motion"), format!("lib/{name}"), format!("lib/{name}.motion")]
        });
        let path = match path {
            Ok(path) => path,
            Err((message, help)) => bail!(self.eval, Use, value.span, "{message}"; help: "{help}"),
        };
        let Some(at) = self.files.loading.iter().position(|(loading, _)| *loading == path) else { return Some(path) };
        let message = format!("{name} uses itself");
        let mut diagnostic =
            diagnostic!(Use, value.span, "{message}"; help: "move what both files need into a third file");
        for (_, span) in self.files.loading.iter().skip(at + 1) {
            diagnostic = diagnostic.related(*span, "used here");
        }
        self.eval.push(diagnostic);
        None
    }

    /// The path of a file that a line names; if it cannot be used, a message and what to do.
    fn resolve(
        &self,
        word: &str,
        name: &str,
        span: Span,
        near: impl Fn(&str) -> [String; 3],
    ) -> Result<PathBuf, (String, String)> {
        // It would work on one system only.
        if name.contains('\\') {
            let message = "the parts of a file name are separated by `/`".to_owned();
            return Err((message, format!("write `{word} \"{}\"`, on Windows too", name.replace('\\', "/"))));
        }
        let sources = self.eval.sources;
        let resolve = |name: &str| sources.resolve(sources.file(span), name);
        resolve(name).map_err(|error| {
            // The most common mistakes: a missing ending, or a missing folder.
            let help = match near(name).iter().find(|near| resolve(near).is_ok()) {
                Some(near) => format!("did you mean `{word} \"{near}\"`?"),
                None => "name a file in the folder of the main script, or in a folder inside it".to_owned(),
            };
            (error.to_string(), help)
        })
    }

    /// Reads the file of a text board.
    pub(super) fn text_board(&mut self, value: &Value<'s>) -> Option<Arc<Board>> {
        let ValueKind::Text(quoted) = value.kind else { return None };
        let name = unquoted(quoted);
        let path = self.resolve("board", name, value.span, |name| {
            [format!("{name}.toml"), format!("boards/{name}"), format!("boards/{name}.toml")]
        });
        let source = match path.map(|path| self.eval.sources.load(&path)) {
            Ok(Ok(source)) => source,
            Ok(Err(error)) => bail!(self.eval, BoardFile, value.span, "{}", error.to_string();
                help: "check the name of the file, and whether it describes a board"),
            Err((message, help)) => bail!(self.eval, BoardFile, value.span, "{message}"; help: "{help}"),
        };
        let source = self.add(source, value.span)?;
        text_board(source, name, self.eval.diagnostics)
    }

    /// Reports what a used file must not contain.
    fn check_used(&mut self, body: &Block<'s>) {
        for line in body.lines() {
            for part in &line.parts {
                let allowed = match &part.statement {
                    Statement::Let(_) | Statement::Def(_) => true,
                    Statement::Command(command) => words::is_use(command.head.text),
                    _ => false,
                };
                if !allowed || line.start.is_some() {
                    let help = match &part.statement {
                        Statement::Command(command) if words::setting(command.head.text).is_some() => {
                            "write it before the first command of the main script; `tempo` and `meter` may also come first in a `def`"
                        }
                        _ => "move it into a `def`, or into the script that uses this file",
                    };
                    report!(self.eval, Use, part.statement.span(),
                        "a used file may contain only `use`, `let` and `def`";
                        help: "{help}");
                }
            }
        }
    }
}
