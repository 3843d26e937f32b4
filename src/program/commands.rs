//! The words of the language that a line may start with, besides those of the board and the settings. A new one is one row here.

use super::Settings;
use super::arguments::Arguments;
use crate::board::{Board, Verb, VerbId};

/// One row of the table.
#[derive(Debug)]
pub struct Row {
    /// The word that a line starts with.
    pub name: &'static str,
    /// What stands behind it.
    pub usage: &'static str,
    /// A line that works.
    pub example: &'static str,
    /// What it does, in a few words.
    pub meaning: &'static str,
    /// Whether a block stands behind it.
    pub block: bool,
    /// What it does.
    pub(super) build: Build,
}

/// How a line looks that starts with a word.
#[derive(Clone, Copy, Debug)]
pub struct Signature<'t> {
    /// The word.
    pub name: &'t str,
    /// What stands behind it.
    pub usage: &'t str,
    /// A line that works.
    pub example: &'t str,
    /// What it does, in a few words.
    pub meaning: &'t str,
    /// Whether `for D` may stand behind it.
    pub holds: bool,
    /// Whether `over D` may stand behind it.
    pub moves: bool,
    /// Whether a block stands behind it.
    pub block: bool,
}

impl<'t> Signature<'t> {
    /// That of a verb.
    pub fn of(verb: &'t Verb) -> Self {
        let Verb { word, usage, example, meaning, holds, moves, .. } = verb;
        Signature { name: word, usage, example, meaning, holds: *holds, moves: *moves, block: false }
    }

    /// How it is written, for messages.
    pub(super) fn how(&self) -> String {
        if self.usage == self.example {
            return format!("write `{}`", self.usage);
        }
        format!("write `{}`, for example `{}`", self.usage, self.example)
    }
}

/// What a word is that a line starts with.
#[derive(Clone, Copy, Debug)]
pub(super) enum Word<'t> {
    /// A verb of the board.
    Verb(VerbId, &'t Verb),
    /// A word of the language.
    Row(&'static Row),
}

impl<'t> Word<'t> {
    #[inline]
    pub(super) fn signature(self) -> Signature<'t> {
        match self {
            Word::Verb(_, verb) => Signature::of(verb),
            Word::Row(row) => row.signature(),
        }
    }
}

/// The arguments of a command, for the functions of the table.
pub(super) type Args<'r, 'a, 's, 'd> = Arguments<'r, 'a, 's, 'd>;

/// What a row does with its arguments.
#[derive(Debug)]
pub(super) enum Build {
    /// Changes a setting.
    Set(fn(&mut Args<'_, '_, '_, '_>, &mut Settings) -> Option<()>),
    /// Passes time.
    Wait,
    /// Writes a line on the screen.
    Say,
    /// Judges what the board reports.
    Expect,
    /// Names the moment.
    Mark,
    /// Runs its block several times.
    Repeat,
    /// Starts each statement of its block at the start.
    Together,
    /// Takes over the names of another file.
    Use,
    /// What is sent when something ends a run early.
    Abort,
    /// The language has it; this version does not.
    Later,
}

impl Row {
    pub(super) const fn new(
        name: &'static str,
        usage: &'static str,
        example: &'static str,
        meaning: &'static str,
        build: Build,
    ) -> Row {
        Row { name, usage, example, meaning, block: false, build }
    }

    pub(super) const fn later(name: &'static str) -> Row {
        Row::new(name, "", "", "", Build::Later)
    }

    /// How a line with it looks.
    pub fn signature(&self) -> Signature<'static> {
        let Row { name, usage, example, meaning, block, .. } = *self;
        Signature { name, usage, example, meaning, holds: false, moves: false, block }
    }

    const fn with_block(self) -> Row {
        Row { block: true, ..self }
    }
}

/// What a line may start with.
pub const COMMANDS: &[Row] = &[
    Row::new(
        "say",
        "say \"TEXT\"",
        "say \"here I go\"",
        "shows a line while playing; `{NAME}` puts in a value, `{{` and `}}` are braces; sends nothing",
        Build::Say,
    ),
    Row::new("wait", "wait TIME", "wait 0.5s", "passes time", Build::Wait),
    Row::new("mark", "mark NAME", "mark bow", "names the moment, for `at` below it", Build::Mark),
    Row::new(
        "repeat",
        "repeat N { … }",
        "repeat 4 { buzzer on for 100ms }",
        "runs its block N times; `every TIME` starts passes that far apart, `as NAME` counts them from 0",
        Build::Repeat,
    )
    .with_block(),
    Row::new(
        "together",
        "together { … }",
        "together { servo 1 900; servo 2 900 }",
        "starts each statement of its block at the start",
        Build::Together,
    )
    .with_block(),
    Row::new(
        "use",
        "use \"FILE\"",
        "use \"lib/phrases.motion\"",
        "takes over the `let`s and `def`s of another file",
        Build::Use,
    ),
    Row::new(
        "on",
        "on abort { … }",
        "on abort { servos 1500 1500 }",
        "what is sent when something ends a run early, after the stop",
        Build::Abort,
    )
    .with_block(),
    Row::new(
        "expect",
        "expect QUANTITY SIGN VALUE",
        "expect voltage > 10V within 2s \"charge me\"",
        "what the board should report: voltage, pitch, roll or yaw, with `<` `<=` `>` `>=` `==` or `in A..B`; the newest report counts, or with `within` the first that fits; sends nothing",
        Build::Expect,
    ),
    Row::later("def"),
    Row::later("let"),
    Row::later("if"),
    Row::later("else"),
];

/// What a word is.
pub(super) fn find<'t>(board: &'t Board, name: &str) -> Option<Word<'t>> {
    let row = || COMMANDS.iter().chain(super::settings::SETTINGS).find(|row| row.name == name);
    board.find(name).map(|(id, verb)| Word::Verb(id, verb)).or_else(|| row().map(Word::Row))
}

/// Everything that a line of a script for this board may start with, but for settings: the verbs of the board first.
#[expect(clippy::redundant_closure_for_method_calls, reason = "the method alone would ask for a static board")]
pub fn signatures(board: &Board) -> impl Iterator<Item = Signature<'_>> {
    board.verbs.iter().map(Signature::of).chain(COMMANDS.iter().map(|row| row.signature()))
}
