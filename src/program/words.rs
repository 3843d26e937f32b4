//! The words of the language that a line may start with, besides those of a board: one row each, with how it is written and
//! where it may stand. A new one is a row here, and the function that runs it: in `walker/commands.rs` for a command, in
//! `settings.rs` for a setting.

use super::functions;
use crate::board::{Board, FAMILIES, Verb, VerbId};
use crate::syntax::{Argument, Command};
use crate::units::Unit;

/// One row of the tables.
#[derive(Debug)]
pub struct Row {
    /// The word that a line starts with.
    pub name: &'static str,
    /// How it is written, with its arguments.
    pub usage: &'static str,
    /// A line that works.
    pub example: &'static str,
    /// What it does, in a few words.
    pub meaning: &'static str,
    /// Whether it has a block.
    pub block: bool,
    /// Whether it cannot be joined to other commands.
    pub(super) alone: bool,
    /// Whether a setting may also come first in a block.
    pub(super) in_block: bool,
    /// Whether a setting may be given more than once.
    pub(super) repeats: bool,
    /// Whether its word may also be a name.
    pub(super) is_name: bool,
    /// Which function runs it.
    pub(super) does: Operation,
}

/// What a row does with its arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    /// Changes a setting.
    Set(Setting),
    /// Passes time.
    Wait,
    /// Waits for a report of the board.
    WaitUntil,
    /// Waits for the operator.
    WaitGo,
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
    /// `let`, where the grammar could not read it as one.
    Let,
    /// Another statement that the grammar could not read as what it is: what it should look like, and what to write.
    Malformed(&'static str, &'static str),
}

/// Which setting a row changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Setting {
    Language,
    Robots,
    Board,
    Tempo,
    Meter,
    Rate,
    Refresh,
    Baud,
    Seed,
    Soft,
    Limit,
    Joint,
}

impl Setting {
    /// Whether all robots share it.
    pub(super) fn is_shared(self) -> bool {
        matches!(self, Setting::Language | Setting::Robots | Setting::Tempo | Setting::Meter | Setting::Seed)
    }
}

impl Operation {
    /// Whether it is run for each robot that its line is for. Everything else is run once.
    pub(super) fn is_per_robot(self) -> bool {
        matches!(self, Operation::Say | Operation::Expect)
    }
}

/// How a line looks that starts with a word.
#[derive(Clone, Copy, Debug)]
pub struct Signature<'t> {
    /// The word.
    pub name: &'t str,
    /// How it is written, with its arguments.
    pub usage: &'t str,
    /// A line that works.
    pub example: &'t str,
    /// What it does, in a few words.
    pub meaning: &'t str,
    /// Whether `for D` may follow it.
    pub holds: bool,
    /// Whether `over D` may follow it.
    pub moves: bool,
    /// Whether it has a block.
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

impl Row {
    const fn new(
        name: &'static str,
        usage: &'static str,
        example: &'static str,
        meaning: &'static str,
        does: Operation,
    ) -> Row {
        Row {
            name,
            usage,
            example,
            meaning,
            block: false,
            alone: false,
            in_block: false,
            repeats: false,
            is_name: false,
            does,
        }
    }

    /// A word that is reserved, and does nothing at the start of a line.
    const fn reserved(name: &'static str, does: Operation) -> Row {
        Row::new(name, "", "", "", does)
    }

    const fn block(self) -> Row {
        Row { block: true, ..self }
    }

    const fn alone(self) -> Row {
        Row { alone: true, ..self }
    }

    const fn in_block(self) -> Row {
        Row { in_block: true, ..self }
    }

    const fn repeats(self) -> Row {
        Row { repeats: true, ..self }
    }

    const fn may_be_a_name(self) -> Row {
        Row { is_name: true, ..self }
    }

    /// How a line with it looks.
    pub fn signature(&self) -> Signature<'static> {
        let Row { name, usage, example, meaning, block, .. } = *self;
        Signature { name, usage, example, meaning, holds: false, moves: false, block }
    }
}

/// What a line may start with.
pub const COMMANDS: &[Row] = &[
    Row::new(
        "say",
        "say \"TEXT\"",
        "say \"here I go\"",
        "shows a line while playing; `{NAME}` puts in a value, `{{` and `}}` are braces; sends nothing",
        Operation::Say,
    ),
    Row::new("wait", "wait TIME", "wait 0.5s", "passes time", Operation::Wait).alone(),
    Row::new(
        "wait until",
        "wait until QUANTITY OPERATOR VALUE within TIME",
        "wait until turned > 90deg within 4s",
        "a gate: stops the clock of the script until a report of the board matches; after TIME the run fails, or continues with `or continue`",
        Operation::WaitUntil,
    )
    .alone(),
    Row::new(
        "wait go",
        "wait go",
        "wait go \"next scene?\" within 30s or continue",
        "a gate: stops the clock of the script until the operator presses Enter or `g`, or sends a line with `--go stdin`",
        Operation::WaitGo,
    )
    .alone(),
    Row::new("mark", "mark NAME", "mark bow", "names the moment, for `at` below it", Operation::Mark).alone(),
    Row::new(
        "repeat",
        "repeat N { … }",
        "repeat 4 { buzzer on for 100ms }",
        "runs its block N times; `every TIME` starts passes that far apart, `as NAME` counts them from 0",
        Operation::Repeat,
    )
    .block(),
    Row::new(
        "together",
        "together { … }",
        "together { servo 1 900; servo 2 900 }",
        "starts each statement of its block at the start",
        Operation::Together,
    )
    .block(),
    Row::new(
        "use",
        "use \"FILE\"",
        "use \"lib/phrases.motion\"",
        "takes over the `let`s and `def`s of another file",
        Operation::Use,
    )
    .alone(),
    Row::new(
        "on",
        "on abort { … }",
        "on abort { servos 1500 1500 }",
        "what is sent when something ends a run early, after the stop",
        Operation::Abort,
    )
    .block()
    .alone(),
    Row::new(
        "expect",
        "expect QUANTITY SIGN VALUE",
        "expect voltage > 10V within 2s \"charge me\"",
        "what the board should report: voltage, pitch, roll or yaw, with `<` `<=` `>` `>=` `==` or `in A..B`; the newest report counts, or with `within` the first that fits; sends nothing",
        Operation::Expect,
    ),
    Row::reserved(
        "def",
        Operation::Malformed(
            "a `def` is a name, parameters in parentheses and a block",
            "write `def nod(depth = 200us) { … }`",
        ),
    ),
    Row::reserved("let", Operation::Let),
    Row::reserved(
        "if",
        Operation::Malformed(
            "an `if` is a condition and a block",
            "write `if n > 0 { … }`, with its `{` on the same line",
        ),
    ),
    Row::reserved(
        "else",
        Operation::Malformed("an `else` follows the `}` of its `if`", "write `if n > 0 { … } else { … }`"),
    ),
];

/// The settings, which precede every command.
pub const SETTINGS: &[Row] = &[
    Row::new(
        "language",
        "language 1",
        "language 1",
        "the version of the language that the script is written for",
        Operation::Set(Setting::Language),
    ),
    Row::new(
        "robots",
        "robots NAME, NAME",
        "robots left, right",
        "the names of the robots, at most 8: `left:` before a command, call or block binds it to one of them, and `left, right:` to several; everything else is for all",
        Operation::Set(Setting::Robots),
    ),
    Row::new(
        "board",
        "board FAMILY",
        "board raspblock",
        "the board that the script is for: a family, or a text board in quotation marks, such as `board \"my-robot.toml\"`; before all other settings except `language` and `robots`",
        Operation::Set(Setting::Board),
    )
    .may_be_a_name(),
    Row::new(
        "tempo",
        "tempo BPM",
        "tempo 120bpm",
        "how many beats a minute; also first in a block; 120bpm where it is not given",
        Operation::Set(Setting::Tempo),
    ).in_block(),
    Row::new(
        "meter",
        "meter BEATS/NOTE",
        "meter 3/4",
        "how many beats a bar; also first in a block; 4/4 where it is not given",
        Operation::Set(Setting::Meter),
    ).in_block(),
    Row::new("rate", "rate FREQUENCY", "rate 50hz", "samples a second of moves, 1-200hz", Operation::Set(Setting::Rate)),
    Row::new(
        "refresh",
        "refresh TIME|off",
        "refresh 50ms",
        "how often a drive frame is sent again while it holds, 10ms-1s",
        Operation::Set(Setting::Refresh),
    ),
    Row::new("baud", "baud SPEED", "baud 115200", "the speed of the serial line", Operation::Set(Setting::Baud)),
    Row::new(
        "seed",
        "seed N",
        "seed 7",
        "which random numbers there are, a whole number; 0 where it is not given",
        Operation::Set(Setting::Seed),
    ),
    Row::new(
        "soft",
        "soft TIME",
        "soft 2s",
        "how long the servos take from where they are to their first positions, before the script begins, 100ms-60s; only for boards that report positions; 2s on a bus of servos, otherwise none",
        Operation::Set(Setting::Soft),
    )
    .may_be_a_name(),
    Row::new(
        "limit",
        "limit servo N MIN..MAX",
        "limit servo 2 900..1700",
        "limits a range, for servo 2 in place of 500..1950: also `limit rocker x -12..12`, `yawhold`, `wheels`; breaking it is an error; `limit servo 2 speed 3000us` says how many µs of pulse width a servo goes in a second, for the warning `servo-speed`",
        Operation::Set(Setting::Limit),
    ).repeats(),
    Row::new(
        "joint",
        "joint NAME servo N [zero P] [reversed] [A..B]",
        "joint elbow servo 1 zero 1400us reversed -60deg..70deg",
        "names a servo: the name may be written wherever its number may; its degrees count from `zero`, or from the middle, in the other direction with `reversed`; A..B, in degrees or in the unit of the servo, narrows its range; one for each servo",
        Operation::Set(Setting::Joint),
    ).repeats().may_be_a_name(),
];

/// The word of a gate that waits for a report.
pub(super) const UNTIL: &str = "until";

/// The words that change how a command runs, each with an example of its argument.
pub(super) const MODIFIERS: &[(&str, &str)] = &[
    ("for", "for 2s"),
    ("over", "over 2s"),
    ("ease", "ease in-out-sine"),
    ("within", "within 2s"),
    ("every", "every 1 beat"),
    ("as", "as i"),
];

/// The other words that cannot be names, because they could be read as one.
const RESERVED: &[&str] =
    &["at", "bar", "beat", "beats", "bars", "not", "and", "or", "true", "false", "off", "in", "abort"];

/// Whether a word is one that changes how a command runs.
pub(super) fn is_modifier(word: &str) -> bool {
    MODIFIERS.iter().any(|(modifier, _)| *modifier == word)
}

/// Whether a word may be a name by its letters.
pub(super) fn is_name(word: &str) -> bool {
    word.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
}

/// The name that a script can give to something with a name of another program: small letters and digits stay, everything else
/// becomes `_`. It is no word of the language or of a family of boards. `None` without letters and digits.
pub fn name_from(text: &str) -> Option<String> {
    let mut name = String::new();
    for c in text.chars().map(|c| c.to_ascii_lowercase()) {
        let is_kept = c.is_ascii_lowercase() || c.is_ascii_digit();
        if is_kept || !name.ends_with('_') {
            name.push(if is_kept { c } else { '_' });
        }
    }
    if !name.bytes().any(|byte| byte != b'_') {
        return None;
    }
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        name.insert(0, '_');
    }
    if is_of_language(&name) || FAMILIES.iter().any(|family| family.usual().find(&name).is_some()) {
        name.push('_');
    }
    Some(name)
}

/// Whether a word belongs to the language or is a command of the board.
pub(super) fn is_reserved(board: &Board, word: &str) -> bool {
    board.find(word).is_some() || is_of_language(word)
}

/// Whether a word belongs to the language.
pub(super) fn is_of_language(word: &str) -> bool {
    RESERVED.contains(&word)
        || is_modifier(word)
        || Unit::named(word).is_some()
        || row(word).is_some_and(|row| !row.is_name)
        || functions::find(word).is_some()
}

/// The row with this name.
fn row(name: &str) -> Option<&'static Row> {
    COMMANDS.iter().find(|row| row.name == name).or_else(|| setting(name))
}

/// What a word is.
pub(super) fn find<'t>(board: &'t Board, name: &str) -> Option<Word<'t>> {
    board.find(name).map(|(id, verb)| Word::Verb(id, verb)).or_else(|| row(name).map(Word::Row))
}

/// What a command is: by its first two words, such as `wait until`, or by its first word. `wait until` without a condition waits
/// for the time that is the value of `until`.
pub(super) fn of_command<'t>(board: &'t Board, command: &Command<'_>) -> Option<Word<'t>> {
    let first = find(board, command.head.text)?;
    let Word::Row(_) = first else { return Some(first) };
    let row = gate(command).filter(|row| command.arguments.len() > 1 || row.usage == row.name);
    Some(row.map_or(first, Word::Row))
}

/// The row of a command that is named by its first two words.
pub(super) fn gate(command: &Command<'_>) -> Option<&'static Row> {
    let second = command.arguments.first().and_then(Argument::bare_word)?;
    COMMANDS.iter().find(|row| row.name.split_once(' ') == Some((command.head.text, second.text)))
}

/// The setting with this name.
pub(super) fn setting(name: &str) -> Option<&'static Row> {
    SETTINGS.iter().find(|row| row.name == name)
}

/// Whether a word takes over the names of another file.
pub(super) fn is_use(name: &str) -> bool {
    COMMANDS.iter().any(|row| row.name == name && row.does == Operation::Use)
}

/// Everything that a line of a script for this board may start with, but for settings: the verbs of the board first.
#[expect(clippy::redundant_closure_for_method_calls, reason = "the method alone would ask for a static board")]
pub fn signatures(board: &Board) -> impl Iterator<Item = Signature<'_>> {
    board
        .verbs
        .iter()
        .filter(|verb| verb.is_in_scripts())
        .map(Signature::of)
        .chain(COMMANDS.iter().map(|row| row.signature()))
}
