//! Words that are not where they belong, or that nothing is called.

use super::evaluator::Evaluator;
use super::pending::{Unknown, Used};
use super::suggest::{list, suggest};
use super::words::{self, COMMANDS, SETTINGS, Word};
use crate::board::Board;
use crate::diagnostic::{Code, bail, report};
use crate::source::Span;
use crate::syntax::{Block, Command, Item, Name, Statement, Value, ValueKind};

impl<'s> Evaluator<'s, '_> {
    pub(super) fn top_level<T>(&mut self, word: &str, span: Span) -> Option<T> {
        bail!(self, TopLevel, span, "`{word}` stands at the top level only"; help: "move it out of the block")
    }

    /// Reports unknown words in a block that may never run. Calls in a phrase are checked where it is defined.
    pub(super) fn check_words(&mut self, block: &Block<'s>, in_phrase: bool) {
        block.visit(&mut |line| {
            for statement in line.statements() {
                match statement {
                    Statement::Command(command) if words::find(self.board, command.head.text).is_none() => {
                        self.unknown_word(command);
                    }
                    Statement::Call(call) if !in_phrase && self.scope.phrase(call.name.text).is_none() => {
                        self.unknown_call(Name { span: call.span, ..call.name }, Used::Call);
                    }
                    _ => {}
                }
            }
        });
    }

    pub(super) fn unknown_word(&mut self, command: &Command<'s>) {
        let word = command.head.text;
        // Said once, however often it is run; looking for a word that is near takes its time.
        if !self.unknown.insert(command.head.span) {
            return;
        }
        if word == "at" {
            report!(self, StartTime, command.head.span, "a line has one start time, and this is a second one";
                help: "keep one of the two, or add them up: `at 1s + 2s stop`");
            return;
        }
        if self.scope.phrase(word).is_some() {
            report!(self, Syntax, command.head.span, "`{word}` is a `def`, and is called with parentheses";
                help: "write `{word}(…)`, with no blank before the `(`");
            return;
        }
        let help = self.suggestion(word);
        report!(self, UnknownWord, command.head.span, "there is no command `{word}`"; help: "{help}");
    }

    /// Reports a call of an unknown phrase. `servo(1, 1500)` is how other languages write a command.
    pub(super) fn unknown_call(&mut self, call: Name<'s>, used: Used<'s>) {
        let name = call.text;
        let may_exist = self.may_exist(name);
        if (may_exist && used == Used::Call) || !self.unknown.insert(call.span) {
            return;
        }
        let (code, message, help) = match words::find(self.board, name).map(Word::signature) {
            Some(row) if !row.usage.is_empty() => {
                let message = format!("`{name}` is a command, and is written without parentheses and commas");
                (Code::Syntax, message, row.how())
            }
            _ => (Code::UnknownWord, format!("nothing is called `{name}`"), self.suggestion(name)),
        };
        self.report_unknown(code, Unknown { name: call, used, may_exist }, message, help);
    }

    /// `let` with anything behind it that is not a name, `=` and a value.
    pub(super) fn malformed_let<T>(&mut self, command: &Command<'s>) -> Option<T> {
        let help = self.mended_let(command);
        bail!(self, Syntax, command.span, "a `let` is a name, `=` and its value"; help: "{help}")
    }

    /// `let a 5`, as it was most likely meant; the name is meant to exist.
    fn mended_let(&mut self, command: &Command<'s>) -> String {
        let [first, rest @ ..] = command.arguments.as_slice() else { return "write `let depth = 300us`".to_owned() };
        let Item::One(Value { kind: ValueKind::Word(name), .. }) = first.item else {
            return "a name begins with a small letter: write `let depth = 300us`".to_owned();
        };
        self.lost.names.insert(name);
        let value = rest.first().zip(rest.last()).map(|(from, to)| Span { start: from.span.start, end: to.span.end });
        let value = value.map_or("300us", |span| self.sources.file(span).slice(span).trim());
        format!("write `let {name} = {}`", value.trim_start_matches(['=', ':']).trim())
    }
}

/// The names of the commands that this version runs.
fn runnable(board: &Board) -> impl Iterator<Item = &str> {
    let rows = COMMANDS.iter().filter(|row| !row.usage.is_empty()).map(|row| row.name);
    board.verbs.iter().map(|verb| &*verb.word).chain(rows)
}

/// How many phrases of a script are listed.
const PHRASES: usize = 12;

impl Evaluator<'_, '_> {
    /// What to write instead of a word that nothing is called.
    fn suggestion(&mut self, word: &str) -> String {
        // What other languages call it.
        let elsewhere = match word {
            "sleep" | "delay" | "pause" => Some("wait 0.5s"),
            "print" | "echo" | "log" => Some("say \"here I go\""),
            "var" | "const" => Some("let n = 3"),
            "parallel" | "both" | "sync" => Some("together { … }"),
            "elif" | "elseif" => Some("else if … { … }"),
            "for" => Some("repeat 4 as i { … }"),
            "while" | "loop" => Some("repeat 4 { … }"),
            "import" | "include" => Some("use \"lib/phrases.motion\""),
            "function" | "fn" => Some("def nod() { … }"),
            _ => None,
        };
        if let Some(near) = self.scope.near(word, true) {
            return format!("did you mean `{near}(…)`?");
        }
        let of_board = self.board.foreign.iter().find(|(foreign, _)| foreign == word);
        if let Some(line) = elsewhere.or(of_board.map(|(_, line)| &**line)) {
            return format!("did you mean `{line}`?");
        }
        // `servo1 1500`
        let (name, digits) =
            word.split_at_checked(word.trim_end_matches(|c: char| c.is_ascii_digit()).len()).unwrap_or((word, ""));
        if !digits.is_empty() && words::find(self.board, name).is_some() {
            return format!("did you mean `{name} {digits}`?");
        }
        let rows = COMMANDS.iter().chain(SETTINGS).map(|row| row.name);
        let verbs = self.board.verbs.iter().map(|verb| &*verb.word);
        match suggest(word, verbs.chain(rows)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => {
                let phrases: Vec<&str> = self.scope.phrase_names().take(PHRASES + 1).collect();
                if phrases.is_empty() {
                    return format!("the commands are {}", list(runnable(self.board)));
                }
                let shown = list(phrases.iter().copied().take(PHRASES));
                let more = if phrases.len() > PHRASES { " and others" } else { "" };
                format!("the phrases of this script are {shown}{more}; the commands are {}", list(runnable(self.board)))
            }
        }
    }
}
