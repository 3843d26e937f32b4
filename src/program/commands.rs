//! The one table of commands and settings. A new one is one row here and the function that reads its arguments.

use super::Settings;
use super::arguments::Arguments;
use super::motion::{Glide, Motion, Shape};
use crate::board::{self, Gains, MAX_PAYLOAD, Mode, Payload, Query, Ranged};
use crate::diagnostic::{Code, Diagnostic};
use crate::syntax::{Argument, Item, Value};

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
    /// Whether `for D` may stand behind it.
    pub holds: bool,
    /// Whether `over D` may stand behind it.
    pub moves: bool,
    /// Whether a block stands behind it.
    pub block: bool,
    /// What it does.
    pub(super) build: Build,
}

/// The arguments of a command, for the functions of the table.
pub(super) type Args<'r, 'a, 's, 'd> = Arguments<'r, 'a, 's, 'd>;

/// What a row does with its arguments.
#[derive(Debug)]
pub(super) enum Build {
    /// Makes one command to the board.
    Send(fn(&mut Args<'_, '_, '_, '_>) -> Option<board::Command>),
    /// Makes a command that may go somewhere over a time.
    Go(fn(&mut Args<'_, '_, '_, '_>) -> Option<Motion>),
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
        Row { name, usage, example, meaning, holds: false, moves: false, block: false, build }
    }

    pub(super) const fn later(name: &'static str) -> Row {
        Row::new(name, "", "", "", Build::Later)
    }

    /// How it is written, for messages.
    pub(super) fn how(&self) -> String {
        if self.usage == self.example {
            return format!("write `{}`", self.usage);
        }
        format!("write `{}`, for example `{}`", self.usage, self.example)
    }

    const fn holding(self) -> Row {
        Row { holds: true, ..self }
    }

    const fn moving(self) -> Row {
        Row { moves: true, ..self }
    }

    const fn with_block(self) -> Row {
        Row { block: true, ..self }
    }
}

/// What a line may start with.
pub const COMMANDS: &[Row] = &[
    Row::new(
        "servo",
        "servo N PULSE",
        "servo 1 1500",
        "one servo, N 1-4, to a pulse width of 500-2500 µs",
        Build::Go(servo),
    )
    .moving(),
    Row::new(
        "servos",
        "servos PAN TILT",
        "servos 1500 1500",
        "servo 1 and 2 in one frame, 500-2500 and 500-1950 µs",
        Build::Go(servos),
    )
    .moving(),
    Row::new(
        "rocker",
        "rocker x=RIGHT y=FORWARD z=CLOCKWISE",
        "rocker x=10 z=50",
        "the whole robot's speed: x to the right and y forward -25..25, z clockwise -200..200; an axis left out is 0",
        Build::Go(rocker),
    )
    .holding()
    .moving(),
    Row::new(
        "yawhold",
        "yawhold x=RIGHT y=FORWARD",
        "yawhold y=10",
        "the same, while the board keeps the heading; it stays active at zero",
        Build::Go(yaw_hold),
    )
    .holding()
    .moving(),
    Row::new(
        "wheels",
        "wheels A B C D",
        "wheels 8 -8 -8 8",
        "each wheel -25..25: A front right, B rear right, C rear left, D front left",
        Build::Go(wheels),
    )
    .holding()
    .moving(),
    Row::new(
        "move",
        "move x=RIGHT y=FORWARD z=CLOCKWISE",
        "move y=100",
        "a displacement, each -65535..65535; needs `pid position` before it",
        Build::Send(displace),
    ),
    Row::new("stop", "stop", "stop", "the drive stops", Build::Send(stop)),
    Row::new("buzzer", "buzzer on|off", "buzzer on for 200ms", "the buzzer", Build::Send(buzzer)).holding(),
    Row::new(
        "pid",
        "pid speed|position speed=P,I position=P,I,D yaw=P,I,D",
        "pid speed speed=200,150 position=20,0,20 yaw=12,2,5",
        "mode and controller gains, each 0-255",
        Build::Send(pid),
    ),
    Row::new(
        "request",
        "request WHAT",
        "request voltage",
        "asks the board for data: report-start, report-stop, encoder-1 to encoder-4, voltage, pitch, roll, yaw",
        Build::Send(request),
    ),
    Row::new(
        "raw",
        "raw FUNCTION BYTE BYTE …",
        "raw 0x04 0x01",
        "a frame of any function and payload, bytes 0-255; header, length and checksum are added",
        Build::Send(raw),
    ),
    Row::new(
        "say",
        "say \"TEXT\"",
        "say \"here I go\"",
        "shows a line while playing; `{NAME}` puts in a value; sends nothing",
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

/// The row of a word.
pub(super) fn find(name: &str) -> Option<&'static Row> {
    COMMANDS.iter().chain(super::settings::SETTINGS).find(|row| row.name == name)
}

/// Why a tilt servo's range ends early.
const TILT_LIMIT: &str = "a tilt servo driven further is damaged";

fn servo(args: &mut Args<'_, '_, '_, '_>) -> Option<Motion> {
    let index = args.next()?;
    let index =
        args.whole_because(index, "a servo number", "it stands first, and its pulse width behind it: `servo 1 1500`");
    let argument = args.next_argument()?;
    let glide = pulse::<500, 2500>(args, argument, "a pulse width", "");
    let (index, glide): (board::ServoIndex, Glide) = (index?, glide?);
    Some(Motion::new(Shape::Servo(index), [glide]))
}

fn servos(args: &mut Args<'_, '_, '_, '_>) -> Option<Motion> {
    let pan = args.next_argument()?;
    let pan = pulse::<500, 2500>(args, pan, "the pan pulse width", "");
    let tilt = args.next_argument()?;
    let tilt = pulse::<500, 1950>(args, tilt, "the tilt pulse width", TILT_LIMIT);
    Some(Motion::new(Shape::Servos, [pan?, tilt?]))
}

fn pulse<'a, 's, const MIN: i32, const MAX: i32>(
    args: &mut Args<'_, 'a, 's, '_>,
    argument: &'a Argument<'s>,
    what: &str,
    why: &str,
) -> Option<Glide> {
    args.glide::<MIN, MAX>(argument, |args, value| args.micros(value, what), what, [" µs", why])
}

fn rocker(args: &mut Args<'_, '_, '_, '_>) -> Option<Motion> {
    let x = axis::<-25, 25>(args, "x", "the speed x");
    let y = axis::<-25, 25>(args, "y", "the speed y");
    let z = axis::<-200, 200>(args, "z", "the turning speed z");
    no_axis(args)?;
    Some(Motion::new(Shape::Rocker, [x?, y?, z?]))
}

fn yaw_hold(args: &mut Args<'_, '_, '_, '_>) -> Option<Motion> {
    let x = axis::<-25, 25>(args, "x", "the speed x");
    let y = axis::<-25, 25>(args, "y", "the speed y");
    no_axis(args)?;
    Some(Motion::new(Shape::YawHold, [x?, y?]))
}

fn wheels(args: &mut Args<'_, '_, '_, '_>) -> Option<Motion> {
    let mut values = [None; 4];
    let names = ["the speed of wheel A", "the speed of wheel B", "the speed of wheel C", "the speed of wheel D"];
    for (value, what) in values.iter_mut().zip(names) {
        let argument = args.next_argument()?;
        *value = args.glide::<-25, 25>(argument, |args, value| args.number(value, what), what, ["", ""]);
    }
    let [a, b, c, d] = values;
    Some(Motion::new(Shape::Wheels, [a?, b?, c?, d?]))
}

/// One axis that may move; left out it is 0.
fn axis<const MIN: i32, const MAX: i32>(args: &mut Args<'_, '_, '_, '_>, name: &str, what: &str) -> Option<Glide> {
    match args.named(name) {
        None => Some(Glide { from: None, to: 0.0 }),
        Some(argument) => args.glide::<MIN, MAX>(argument, |args, value| args.number(value, what), what, ["", ""]),
    }
}

fn displace(args: &mut Args<'_, '_, '_, '_>) -> Option<board::Command> {
    let x = displacement(args, "x", "the displacement x");
    let y = displacement(args, "y", "the displacement y");
    let z = displacement(args, "z", "the displacement z");
    no_axis(args)?;
    Some(board::Command::Move { x: x?, y: y?, z: z? })
}

/// One axis of a displacement; left out it is 0.
fn displacement(args: &mut Args<'_, '_, '_, '_>, name: &str, what: &str) -> Option<board::Displacement> {
    match args.named(name) {
        None => Ranged::new(0).ok(),
        Some(argument) => {
            let value = args.one(argument)?;
            args.ranged(value, what)
        }
    }
}

/// An axis without its name, or no axis at all, is a mistake.
fn no_axis(args: &mut Args<'_, '_, '_, '_>) -> Option<()> {
    if args.command.arguments.iter().any(|argument| argument.name.is_some()) {
        return Some(());
    }
    // Reports that more is needed where nothing was given.
    let argument = args.next_argument()?;
    let row = args.row;
    let message = format!("`{}` wants each value with its axis", row.name);
    args.context.report(Diagnostic::new(Code::Arguments, argument.span, message, row.how()));
    // The rest of them would only repeat it.
    while args.more() {
        args.next_argument();
    }
    None
}

// The table wants a function that may fail.
#[expect(clippy::unnecessary_wraps, reason = "the table's signature")]
fn stop(_: &mut Args<'_, '_, '_, '_>) -> Option<board::Command> {
    Some(board::Command::STOP)
}

fn buzzer(args: &mut Args<'_, '_, '_, '_>) -> Option<board::Command> {
    let value = args.next()?;
    let word = args.word(value, &["on", "off"])?;
    Some(board::Command::Buzzer(word == "on"))
}

fn pid(args: &mut Args<'_, '_, '_, '_>) -> Option<board::Command> {
    let mode = args.next()?;
    let mode = args.word(mode, &["speed", "position"]).and_then(Mode::named);
    let speed = gains(args, "speed");
    let position = gains(args, "position");
    let yaw = gains(args, "yaw");
    Some(board::Command::Pid(mode?, Gains { speed: speed?, position: position?, yaw: yaw? }))
}

/// A named list of exactly `N` gains, each a byte.
fn gains<const N: usize>(args: &mut Args<'_, '_, '_, '_>, name: &'static str) -> Option<[u8; N]> {
    let letters = if N == 2 { "P,I" } else { "P,I,D" };
    let Some(argument) = args.named(name) else {
        args.missing();
        return None;
    };
    let values: &[Value<'_>] = match &argument.item {
        Item::List(values) => values,
        Item::One(value) => std::slice::from_ref(value),
        _ => &[],
    };
    let bytes: Vec<u8> = values.iter().filter_map(|value| args.byte(value, "a gain")).collect();
    if values.len() != N {
        args.context.report(Diagnostic::new(
            Code::Arguments,
            argument.span,
            format!("`{name}` has {N} gains"),
            format!("write `{name}={letters}`, each 0 to 255"),
        ));
    }
    bytes.try_into().ok()
}

fn request(args: &mut Args<'_, '_, '_, '_>) -> Option<board::Command> {
    let value = args.next()?;
    let word = args.word(value, Query::NAMES)?;
    Query::named(word).map(board::Command::Request)
}

fn raw(args: &mut Args<'_, '_, '_, '_>) -> Option<board::Command> {
    let function = args.next()?;
    let function = args.byte(function, "the function byte");
    let mut payload = Vec::new();
    let mut complete = true;
    while args.more() {
        let byte = match args.next() {
            Some(value) => args.byte(value, "a payload byte"),
            None => None,
        };
        complete &= byte.is_some();
        payload.extend(byte);
    }
    let length = payload.len();
    let Some(payload) = Payload::new(payload) else {
        args.context.report(Diagnostic::new(
            Code::OutOfRange,
            args.command.span,
            format!("a frame carries at most {MAX_PAYLOAD} bytes, and these are {length}"),
            "split it into several frames",
        ));
        return None;
    };
    let function = function.filter(|_| complete)?;
    args.context.report(Diagnostic::new(
        Code::RawFrame,
        args.command.span,
        "nothing checks what this frame makes the robot do",
        "use the command that sends it, or end the line with `# allow: raw-frame`",
    ));
    Some(board::Command::Raw { function, payload })
}
