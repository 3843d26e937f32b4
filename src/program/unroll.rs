//! Walks the tree and gives every command its time.

use super::arguments::{self, Arguments, blank_before_unit};
use super::commands::{self, Build, COMMANDS, Row, SETTINGS};
use super::suggest::{list, suggest};
use super::time::Time;
use super::value::not_yet;
use super::{Action, Program, Settings, Step};
use crate::board;
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::Span;
use crate::syntax::{Ast, Block, Command, Line, Moment, Name, Origin, Part, Start, Statement, ValueKind};

pub(super) fn unroll(ast: &Ast<'_>, diagnostics: &mut Diagnostics) -> Program {
    let mut unroll = Unroll {
        settings: Settings::default(),
        given: Vec::new(),
        begun: false,
        steps: Vec::new(),
        too_long: false,
        times_known: true,
        diagnostics,
    };
    let end = unroll.block(&ast.body, Time::ZERO, 0);
    let Unroll { settings, steps, begun, times_known, .. } = unroll;
    if !begun && !diagnostics.has_errors() {
        diagnostics.push(Diagnostic::new(
            Code::EmptyScript,
            Span::new(0, 0),
            "the script does nothing",
            "write a command, such as `servo 1 1500`",
        ));
    }
    Program { settings, steps, end, times_known }
}

struct Unroll<'d> {
    settings: Settings,
    /// Settings that were given, with their places.
    given: Vec<(&'static str, Span)>,
    /// Whether anything but a setting has come.
    begun: bool,
    steps: Vec<Step>,
    too_long: bool,
    /// Whether no error so far can have moved the commands behind it.
    times_known: bool,
    diagnostics: &'d mut Diagnostics,
}

impl Unroll<'_> {
    /// Runs a block from `start` on; gives the time when everything in it has ended. The recursion is bounded by the depth
    /// of brackets.
    fn block(&mut self, block: &Block<'_>, start: Time, depth: usize) -> Time {
        let mut latest = start;
        let mut now = start;
        for line in &block.lines {
            if let Some(end) = self.line(line, start, now, depth) {
                now = end;
                latest = latest.max(end);
                self.check_length(end, line.span);
            } else {
                self.times_known = false;
            }
        }
        latest
    }

    /// Runs a line; gives the time when the longest of its parts has ended, or `None` where its start is wrong.
    fn line(&mut self, line: &Line<'_>, block: Time, now: Time, depth: usize) -> Option<Time> {
        let setting = line.parts.iter().find_map(|part| self.setting_in(line, part, depth));
        if let Some(in_place) = setting {
            if in_place {
                self.set(line);
            }
            return Some(now);
        }
        self.begun = true;
        let start = match &line.start {
            None => now,
            Some(start) => self.start(start, line, block, now)?,
        };
        let joined = line.parts.len() > 1;
        // Every part is looked at, so that every mistake in the line is found.
        let ends: Vec<_> = line.parts.iter().map(|part| self.part(part, joined, start, depth)).collect();
        ends.into_iter().try_fold(start, |latest, end| Some(latest.max(end?)))
    }

    /// When a line starts.
    fn start(&mut self, start: &Start<'_>, line: &Line<'_>, block: Time, now: Time) -> Option<Time> {
        match start {
            Start::After(value) => {
                self.no_unit_behind(*value, line)?;
                let delay = arguments::time(*value, self.diagnostics)?;
                if delay < Time::ZERO {
                    self.before_start(value.span);
                    return None;
                }
                Some(now.plus(delay))
            }
            Start::At(moment) => self.moment(moment, line, block),
        }
    }

    fn moment(&mut self, moment: &Moment<'_>, line: &Line<'_>, block: Time) -> Option<Time> {
        let mut at = match moment.origin {
            Origin::Bar(span) => {
                self.diagnostics.push(not_yet(span, "a time in bars"));
                return None;
            }
            Origin::Value(value) => match value.kind {
                ValueKind::Word(word) if commands::find(word).is_some() => {
                    self.diagnostics.push(Diagnostic::new(
                        Code::StartTime,
                        value.span,
                        "`at` needs a time before the command",
                        format!("for example `at 0.5s {word} …`"),
                    ));
                    return None;
                }
                ValueKind::Word(_) => {
                    self.diagnostics.push(not_yet(value.span, "a time from a mark"));
                    return None;
                }
                _ => {
                    self.no_unit_behind(value, line)?;
                    arguments::time(value, self.diagnostics)?
                }
            },
        };
        for &(away, value) in &moment.offsets {
            let offset = arguments::time(value, self.diagnostics)?;
            at = if away { at.minus(offset) } else { at.plus(offset) };
        }
        if at < Time::ZERO {
            self.before_start(moment.span);
            return None;
        }
        Some(block.plus(at))
    }

    /// `at 1 s stop`: the unit was read as a command.
    fn no_unit_behind(&mut self, value: crate::syntax::Value<'_>, line: &Line<'_>) -> Option<()> {
        let Some(Part { statement: Statement::Command(Command { head, .. }), .. }) = line.parts.first() else {
            return Some(());
        };
        match blank_before_unit(value, *head) {
            Some(diagnostic) => {
                self.diagnostics.push(diagnostic);
                None
            }
            None => Some(()),
        }
    }

    fn before_start(&mut self, span: Span) {
        self.diagnostics.push(Diagnostic::new(
            Code::StartTime,
            span,
            "nothing starts before its own block",
            "write a time from `0s` on",
        ));
    }

    fn check_length(&mut self, end: Time, span: Span) {
        if end > Time::LONGEST && !self.too_long {
            self.too_long = true;
            self.diagnostics.push(Diagnostic::new(
                Code::TooLong,
                span,
                "the script reaches beyond 24 hours here",
                "make it shorter; a script is at most 24 hours long",
            ));
        }
    }

    /// Runs one part of a line; gives the time when it has ended, or `None` where something in it is wrong.
    fn part(&mut self, part: &Part<'_>, joined: bool, start: Time, depth: usize) -> Option<Time> {
        if let Some(robot) = part.robots.first() {
            self.diagnostics.push(not_yet(robot.span, "a command for one of several robots"));
            return None;
        }
        match &part.statement {
            Statement::Block(block) => Some(self.block(block, start, depth + 1)),
            Statement::Call(call) => {
                self.call(*call);
                None
            }
            Statement::Later(later) => {
                self.diagnostics.push(not_yet(later.span, &format!("`{}`", later.what)));
                None
            }
            Statement::Command(command) => self.command(command, joined, start),
        }
    }

    fn command(&mut self, command: &Command<'_>, joined: bool, start: Time) -> Option<Time> {
        let Some(row) = commands::find(command.head.text) else {
            self.unknown(command);
            return None;
        };
        if let Build::Later = row.build {
            self.diagnostics.push(not_yet(command.head.span, &format!("`{}`", row.name)));
            return None;
        }
        if joined && matches!(row.build, Build::Wait) {
            self.diagnostics.push(Diagnostic::new(
                Code::Joined,
                command.span,
                "`wait` cannot be joined to other commands",
                "give it a line of its own; what `;` joins starts together and takes as long as its longest part",
            ));
            return None;
        }
        let mut args = Arguments::new(row, command, self.diagnostics)?;
        match row.build {
            Build::Send(build) => {
                let sent = build(&mut args);
                let hold = if row.holds { args.hold() } else { Ok(None) };
                let complete = args.finish();
                let hold = hold.ok()?;
                let end = hold.map_or(start, |hold| start.plus(hold));
                let (Some(sent), Some(())) = (sent, complete) else {
                    // A wrong value moves nothing behind it, but after a wrong `pid` nobody knows the mode.
                    return (row.name != "pid").then_some(end);
                };
                if sent == board::Command::Buzzer(false) && hold.is_some() {
                    self.diagnostics.push(Diagnostic::new(
                        Code::Arguments,
                        command.span,
                        "`buzzer off` takes no `for`",
                        "give the time a line of its own: `wait 2s`",
                    ));
                    return None;
                }
                self.push(start, command.span, Action::Send(sent, hold));
                Some(end)
            }
            Build::Wait => {
                let value = args.next()?;
                let time = arguments::time(value, args.diagnostics)?;
                if time < Time::ZERO {
                    args.diagnostics.push(Diagnostic::new(
                        Code::OutOfRange,
                        value.span,
                        "time cannot be taken back with `wait`",
                        "write `at TIME` to start a line at an earlier time",
                    ));
                    return None;
                }
                args.finish()?;
                Some(start.plus(time))
            }
            Build::Say => {
                let text = commands::say(&mut args);
                args.finish()?;
                self.push(start, command.span, Action::Say(text?));
                Some(start)
            }
            Build::Set(_) | Build::Later => None,
        }
    }

    fn push(&mut self, at: Time, span: Span, action: Action) {
        self.steps.push(Step { at, span, action });
    }

    /// `servo(1, 1500)` is how other languages write it.
    fn call(&mut self, call: Name<'_>) {
        let name = call.text;
        let diagnostic = match commands::find(name) {
            Some(row) if !row.usage.is_empty() => Diagnostic::new(
                Code::Syntax,
                call.span,
                format!("`{name}` is a command, and is written without parentheses and commas"),
                row.how(),
            ),
            _ => Diagnostic::new(Code::UnknownWord, call.span, format!("nothing is called `{name}`"), suggestion(name)),
        };
        self.diagnostics.push(diagnostic);
    }

    fn unknown(&mut self, command: &Command<'_>) {
        let word = command.head.text;
        if word == "at" {
            self.diagnostics.push(Diagnostic::new(
                Code::StartTime,
                command.head.span,
                "a line has one start time, and this is a second one",
                "keep one of the two, or add them up: `at 1s + 2s stop`",
            ));
            return;
        }
        let help = suggestion(word);
        self.diagnostics.push(Diagnostic::new(
            Code::UnknownWord,
            command.head.span,
            format!("there is no command `{word}`"),
            help,
        ));
    }

    /// Whether this part is a setting: `Some(true)` if it stands where it may, `Some(false)` if not, which is reported.
    fn setting_in(&mut self, line: &Line<'_>, part: &Part<'_>, depth: usize) -> Option<bool> {
        let Statement::Command(command) = &part.statement else {
            return None;
        };
        let row = SETTINGS.iter().find(|row| row.name == command.head.text)?;
        let wrong = |message: String, help: &str| Diagnostic::new(Code::SettingPlace, command.head.span, message, help);
        let name = row.name;
        let diagnostic = if let Build::Later = row.build {
            not_yet(command.head.span, &format!("the setting `{name}`"))
        } else if line.parts.len() > 1 || line.start.is_some() || !part.robots.is_empty() {
            wrong(
                format!("the setting `{name}` has no time and is not joined to anything"),
                "give it a line of its own, before the first command",
            )
        } else if depth > 0 || self.begun {
            wrong(
                format!("the setting `{name}` stands behind a command"),
                "put it before the first command of the script",
            )
        } else if let Some(&(_, first)) = self.given.iter().find(|(given, _)| *given == name) {
            wrong(format!("`{name}` is set twice"), "keep one of the two")
                .label("again here")
                .related(first, "first set here")
        } else {
            return Some(true);
        };
        self.diagnostics.push(diagnostic);
        Some(false)
    }

    fn set(&mut self, line: &Line<'_>) {
        let Some(Part { statement: Statement::Command(command), .. }) = line.parts.first() else {
            return;
        };
        let Some(row) = commands::find(command.head.text) else {
            return;
        };
        self.given.push((row.name, command.span));
        if let (Some(mut args), Build::Set(build)) = (Arguments::new(row, command, self.diagnostics), &row.build) {
            build(&mut args, &mut self.settings);
            args.finish();
        }
    }
}

/// The names of the commands that this version runs.
fn runnable() -> impl Iterator<Item = &'static str> {
    let runs = |row: &&Row| !matches!(row.build, Build::Later);
    COMMANDS.iter().filter(runs).map(|row| row.name)
}

/// What to write instead of a word that nothing is called.
fn suggestion(word: &str) -> String {
    // What other languages call it.
    let elsewhere = match word {
        "sleep" | "delay" | "pause" => Some("wait 0.5s"),
        "print" | "echo" | "log" => Some("say \"here I go\""),
        "forward" | "drive" | "go" => Some("rocker y=10 for 1s"),
        "beep" => Some("buzzer on for 200ms"),
        "turn" | "spin" | "rotate" => Some("rocker z=50 for 1s"),
        _ => None,
    };
    if let Some(line) = elsewhere {
        return format!("did you mean `{line}`?");
    }
    match suggest(word, COMMANDS.iter().chain(SETTINGS).map(|row| row.name)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("the commands are {}", list(runnable())),
    }
}
