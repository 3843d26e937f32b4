//! Unknown words at the start of a statement, and words that are not allowed there.

use super::evaluator::Evaluator;
use super::pending::{Unknown, Used};
use super::robots::RobotSet;
use super::suggest::{list, suggest};
use super::words::{self, COMMANDS, SETTINGS, is_name};
use crate::board::{Board, FAMILIES};
use crate::diagnostic::{Code, bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Argument, Block, Command, Item, Name, Statement, Value, ValueKind, foreign};

impl<'s> Evaluator<'s, '_> {
    pub(super) fn top_level<T>(&mut self, word: &str, span: Span) -> Option<T> {
        bail!(self, TopLevel, span, "`{word}` is not allowed inside a block"; help: "move it out of the block")
    }

    /// Whether a word is a command, of any robot.
    pub(super) fn is_known(&self, word: &str) -> bool {
        words::find(self.board, word).is_some() || self.boards.iter().any(|board| board.find(word).is_some())
    }

    /// Reports unknown words in a block that may never run. The calls in a phrase are checked where it is defined.
    pub(super) fn check_words(&mut self, block: &Block<'s>, in_phrase: bool) {
        block.visit(&mut |line| {
            line.parts.iter().for_each(|part| self.check_robots(&part.robots));
            for statement in line.statements() {
                match statement {
                    Statement::Command(command) if !self.is_known(command.head.text) => {
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

    /// Reports a word that is not a command of the current robot, which is one of several that the line is for.
    pub(super) fn unknown_command(&mut self, command: &Command<'s>, robots: RobotSet) {
        let word = command.head.text;
        let knows = |robot: &usize| self.boards.get(*robot).is_some_and(|board| board.find(word).is_some());
        let knowing: RobotSet = (0..self.boards.len()).filter(knows).collect();
        if !knowing.meets(RobotSet::ALL) {
            return self.unknown_word(command);
        }
        let names = self.robot_names(if knowing.meets(robots) { knowing.and(robots) } else { knowing });
        let line = self.written(command.span).lines().next().unwrap_or_default();
        report!(self, WrongBoard, command.head.span, "there is no command `{word}` on the {}", self.board.name;
            help: "write it only for robots that have it: `{names}: {line}`");
    }

    pub(super) fn unknown_word(&mut self, command: &Command<'s>) {
        let word = command.head.text;
        // Said once, however often it is run; looking for a word that is near takes its time.
        if !self.unknown.insert(command.head.span) {
            return;
        }
        if self.robot_without_colon(command) {
            return;
        }
        if word == "at" {
            return self.start_time_inside(command);
        }
        if self.scope.phrase(word).is_some() {
            return self.phrase_without_parentheses(command);
        }
        let head = command.head.span;
        let (start, statement) = self.text_from(head);
        if let Some(found) = foreign::statement(statement, start) {
            return self.foreign(word, head, found);
        }
        let small = word.to_lowercase();
        if small != word && words::find(self.board, &small).is_some() {
            let line = self.rewritten(command.span, &[(head, small.clone())]);
            return report!(self, UnknownWord, head, "commands are written in lower case";
                help: "write `{line}`"; fix: head => "{small}");
        }
        if self.of_other_board(word, head) {
            return;
        }
        let help = self.suggestion(word);
        report!(self, UnknownWord, head, "there is no command `{word}`"; help: "{help}");
    }

    /// `at 1s at 2s stop`, or `left: at 1s stop`.
    fn start_time_inside(&mut self, command: &Command<'s>) {
        let head = command.head.span;
        let (_, line) = self.statement_around(head);
        let names = line.split_once(':').map(|(names, _)| names.trim());
        let is_robot = |name: &str| self.robot_number(name).is_some();
        let Some(names) = names.filter(|names| names.split(',').all(|name| is_robot(name.trim()))) else {
            report!(self, StartTime, head, "a line has only one start time";
                help: "keep one of the two, or add them up: `at 1s + 2s stop`");
            return;
        };
        report!(self, StartTime, head, "the start time comes before the names of the robots";
            help: "write `at 1s {names}: stop`");
    }

    /// Reports a command of another family of boards; returns whether it is one.
    fn of_other_board(&mut self, word: &str, span: Span) -> bool {
        let found = FAMILIES.iter().find(|family| family.usual().find(word).is_some());
        let Some(family) = found else { return false };
        let (this, other) = (&self.board.name, &family.usual().name);
        report!(self, WrongBoard, span, "`{word}` is a command of the {other}, and this script is for the {this}";
            help: "write a command of the {this}, or choose the other board at the start of the script: `{}`", family.example);
        true
    }

    /// A phrase that is called like a command: `nod 2`.
    fn phrase_without_parentheses(&mut self, command: &Command<'s>) {
        let (word, head) = (command.head.text, command.head.span);
        let value = |argument: &Argument<'_>| {
            let written = self.written(argument.span);
            written.strip_prefix('(').and_then(|written| written.strip_suffix(')')).unwrap_or(written)
        };
        let values: Vec<&str> = command.arguments.iter().map(value).collect();
        let end = command.arguments.last().map_or(head, |last| last.span);
        let is_value = |argument: &Argument<'_>| match &argument.item {
            Item::One(Value { kind: ValueKind::Word(name), .. }) => self.scope.value(name).is_some(),
            Item::One(value) => !matches!(value.kind, ValueKind::Text(_)),
            _ => false,
        };
        if !command.arguments.iter().all(is_value) {
            report!(self, Call, head, "the phrase `{word}` is called with parentheses";
                help: "write its values between parentheses, with commas: `{word}(…)`");
            return;
        }
        report!(self, Call, head, "the phrase `{word}` is called with parentheses";
            write: head.to(end) => "{word}({})", values.join(", "));
    }

    /// A word that other languages use.
    fn foreign(&mut self, word: &str, span: Span, found: foreign::Foreign) {
        // The name that `function nod() {` defines is not reported as unknown, too.
        let (_, statement) = self.text_from(span);
        let name = statement.split_once(' ').and_then(|(_, rest)| rest.split(['(', ' ', '{', '\n']).next());
        if let Some(name) = name.filter(|name| is_name(name) && found.help.contains("`def ")) {
            self.lost.names.insert(name);
        }
        if !found.origin.is_empty() {
            return self.push(found.diagnostic());
        }
        let diagnostic = diagnostic!(UnknownWord, span, "there is no command `{word}`"; help: "{}", found.help);
        self.push(found.fixed(diagnostic));
    }

    /// The text of a file from a place, and where that is.
    fn text_from(&self, span: Span) -> (usize, &'s str) {
        let source = self.sources.file(span);
        let start = span.range().start;
        (start, source.text().get(start - source.base() as usize..).unwrap_or_default())
    }

    /// Reports a call of an unknown phrase. `servo(1, 1500)` is how other languages write a command.
    pub(super) fn unknown_call(&mut self, call: Name<'s>, used: Used<'s>) {
        let name = call.text;
        let may_exist = self.may_exist(name);
        if (may_exist && used == Used::Call) || !self.unknown.insert(call.span) {
            return;
        }
        let (start, statement) = self.text_from(call.span);
        if let Some(found) = foreign::statement(statement, start) {
            return self.foreign(name, call.span, found);
        }
        let is_command = words::find(self.board, name).is_some_and(|word| !word.signature().usage.is_empty());
        if is_command && used == Used::Call {
            // The call, up to its closing bracket.
            return report!(self, Call, call.span, "the command `{name}` is written without parentheses and commas";
                write: call.span => "{}", as_command(self.written(call.span)));
        }
        let help = self.suggestion(name);
        let unknown = Unknown { name: call, used, may_exist };
        self.report_unknown(Code::UnknownWord, unknown, format!("there is no phrase `{name}`"), help);
    }

    /// `let` without a name, `=` and a value.
    pub(super) fn malformed_let<T>(&mut self, command: &Command<'s>) -> Option<T> {
        let help = self.corrected_let(command);
        bail!(self, Syntax, command.span, "a `let` is a name, `=` and a value"; help: "{help}")
    }

    /// `let a 5`, as it was most likely meant. The name is not reported as unknown afterwards.
    fn corrected_let(&mut self, command: &Command<'s>) -> String {
        let [first, rest @ ..] = command.arguments.as_slice() else { return "write `let depth = 300us`".to_owned() };
        let Item::One(Value { kind: ValueKind::Word(name), .. }) = first.item else {
            return "a name begins with a lower-case letter: write `let depth = 300us`".to_owned();
        };
        self.lost.names.insert(name);
        // `let pan position = 2`.
        let written = self.written(command.span);
        let several = written.split_once(char::is_whitespace).and_then(|(_, rest)| rest.split_once('='));
        let several =
            several.map(|(names, value)| (names.split_whitespace().collect::<Vec<_>>().join("_"), value.trim()));
        if let Some((names, value)) = several.filter(|(names, _)| is_name(names)) {
            return format!("a name has no spaces: `let {names} = {value}`");
        }
        let value = rest.first().zip(rest.last()).map(|(from, to)| Span { start: from.span.start, end: to.span.end });
        let value = value.map_or("300us", |span| self.sources.file(span).slice(span).trim());
        format!("write `let {name} = {}`", value.trim_start_matches(['=', ':']).trim())
    }
}

/// The names of the commands that this version runs.
fn runnable(board: &Board) -> impl Iterator<Item = &str> {
    let rows = COMMANDS.iter().filter(|row| !row.usage.is_empty() && !row.name.contains(' ')).map(|row| row.name);
    let verbs = board.verbs.iter().filter(|verb| verb.is_in_scripts()).map(|verb| &*verb.word);
    // Variants of a verb follow each other.
    let mut last = "";
    verbs.filter(move |word| std::mem::replace(&mut last, word) != *word).chain(rows)
}

/// `servo(1, 1500)` as a command: `servo 1 1500`.
fn as_command(call: &str) -> String {
    let (name, values) = call.split_once('(').unwrap_or((call, ""));
    let values = values.strip_suffix(')').unwrap_or(values);
    let (mut depth, mut parts) = (0_usize, vec![String::new()]);
    for c in values.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(part) = parts.last_mut() {
            part.push(c);
        }
    }
    let argument = |part: &String| {
        let part = part.trim();
        match part.split_once('=').map(|(name, value)| (name.trim(), value.trim())) {
            Some((name, value)) if !name.contains(' ') && !value.starts_with('=') => format!("{name}={value}"),
            _ if part.contains(' ') && !part.starts_with(['(', '"']) => format!("({part})"),
            _ => part.to_owned(),
        }
    };
    let parts: Vec<String> = parts.iter().map(argument).filter(|part| !part.is_empty()).collect();
    [name.to_owned()].into_iter().chain(parts).collect::<Vec<_>>().join(" ")
}

/// How many phrases of a script are listed.
const PHRASES: usize = 12;

impl Evaluator<'_, '_> {
    /// What to write instead of an unknown word.
    fn suggestion(&mut self, word: &str) -> String {
        if let Some(near) = self.scope.near(word, true) {
            return format!("did you mean `{near}(…)`?");
        }
        if let Some((_, line)) = self.board.foreign.iter().find(|(foreign, _)| foreign == word) {
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
