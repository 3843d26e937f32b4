//! The one table of commands and settings. A new one is one row here and the function that reads its arguments.

use crate::board::{self, Gains, MAX_PAYLOAD, Mode, Payload, Query, Ranged, Speed, TiltPulseWidth};
use crate::diagnostic::{Code, Diagnostic};
use crate::syntax::{Item, Value, ValueKind};

use super::Settings;
use super::arguments::{self, Arguments};
use super::time::Time;
use super::value::{self, Quantity};

/// One row of the table.
#[derive(Debug)]
pub struct Row {
    /// The word that a line starts with.
    pub name: &'static str,
    /// What stands behind it.
    pub usage: &'static str,
    /// A line that works.
    pub example: &'static str,
    /// Whether `for D` may stand behind it.
    pub holds: bool,
    /// Whether `over D` may stand behind it.
    pub moves: bool,
    /// What it does.
    pub(super) build: Build,
}

/// What a row does with its arguments.
#[derive(Debug)]
pub(super) enum Build {
    /// Makes one command to the board.
    Send(fn(&mut Arguments<'_, '_>) -> Option<board::Command>),
    /// Changes a setting.
    Set(fn(&mut Arguments<'_, '_>, &mut Settings) -> Option<()>),
    /// Passes time.
    Wait,
    /// Writes a line on the screen.
    Say,
    /// The language has it; this version does not.
    Later,
}

impl Row {
    const fn send(
        name: &'static str,
        usage: &'static str,
        example: &'static str,
        build: fn(&mut Arguments<'_, '_>) -> Option<board::Command>,
    ) -> Row {
        Row { name, usage, example, holds: false, moves: false, build: Build::Send(build) }
    }

    const fn set(
        name: &'static str,
        usage: &'static str,
        example: &'static str,
        build: fn(&mut Arguments<'_, '_>, &mut Settings) -> Option<()>,
    ) -> Row {
        Row { name, usage, example, holds: false, moves: false, build: Build::Set(build) }
    }

    const fn other(name: &'static str, usage: &'static str, example: &'static str, build: Build) -> Row {
        Row { name, usage, example, holds: false, moves: false, build }
    }

    const fn later(name: &'static str) -> Row {
        Row { name, usage: "", example: "", holds: false, moves: false, build: Build::Later }
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
}

/// What a line may start with.
pub const COMMANDS: &[Row] = &[
    Row::send("servo", "servo N PULSE", "servo 1 1500", servo).moving(),
    Row::send("servos", "servos PAN TILT", "servos 1500 1500", servos).moving(),
    Row::send("rocker", "rocker x=RIGHT y=FORWARD z=CLOCKWISE", "rocker x=10 z=50", rocker).holding().moving(),
    Row::send("yawhold", "yawhold x=RIGHT y=FORWARD", "yawhold y=10", yaw_hold).holding().moving(),
    Row::send("wheels", "wheels A B C D", "wheels 8 -8 -8 8", wheels).holding().moving(),
    Row::send("move", "move x=RIGHT y=FORWARD z=CLOCKWISE", "move y=100", displace),
    Row::send("stop", "stop", "stop", stop),
    Row::send("buzzer", "buzzer on|off", "buzzer on for 200ms", buzzer).holding(),
    Row::send(
        "pid",
        "pid speed|position speed=P,I position=P,I,D yaw=P,I,D",
        "pid speed speed=200,150 position=20,0,20 yaw=12,2,5",
        pid,
    ),
    Row::send("request", "request WHAT", "request voltage", request),
    Row::send("raw", "raw FUNCTION BYTE BYTE …", "raw 0x04 0x01", raw),
    Row::other("say", "say \"TEXT\"", "say \"here I go\"", Build::Say),
    Row::other("wait", "wait TIME", "wait 0.5s", Build::Wait),
    Row::later("expect"),
    Row::later("mark"),
    Row::later("repeat"),
    Row::later("together"),
    Row::later("on"),
    Row::later("use"),
    Row::later("def"),
    Row::later("let"),
    Row::later("if"),
    Row::later("else"),
];

/// What may stand before every command.
pub const SETTINGS: &[Row] = &[
    Row::set("language", "language 1", "language 1", language),
    Row::set("rate", "rate FREQUENCY", "rate 50hz", rate),
    Row::set("refresh", "refresh TIME|off", "refresh 50ms", refresh),
    Row::set("baud", "baud SPEED", "baud 115200", baud),
    Row::later("tempo"),
    Row::later("meter"),
    Row::later("seed"),
    Row::later("limit"),
    Row::later("robots"),
];

/// The row of a word.
pub(super) fn find(name: &str) -> Option<&'static Row> {
    COMMANDS.iter().chain(SETTINGS).find(|row| row.name == name)
}

/// Why a tilt servo's range ends early.
const TILT_LIMIT: &str = "a tilt servo driven further is damaged";

fn servo(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let index = args.next()?;
    let index = args.whole(index, "a servo number");
    let pulse = args.next()?;
    let span = pulse.span;
    let pulse = args.pulse(pulse, "a pulse width", "");
    let (index, pulse): (board::ServoIndex, board::PulseWidth) = (index?, pulse?);
    if index.get() == 2 && pulse.get() > TiltPulseWidth::MAX {
        args.diagnostics.push(Diagnostic::new(
            Code::TiltRange,
            span,
            format!("servo 2 is the tilt servo, and does not survive {pulse} µs"),
            format!("stay at or below {} unless another servo is connected there", TiltPulseWidth::MAX),
        ));
    }
    Some(board::Command::Servo { index, pulse })
}

fn servos(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let pan = args.next()?;
    let pan = args.pulse(pan, "the pan pulse width", "");
    let tilt = args.next()?;
    let tilt = args.pulse(tilt, "the tilt pulse width", TILT_LIMIT);
    Some(board::Command::Servos { pan: pan?, tilt: tilt? })
}

fn rocker(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let [x, y] = speeds(args);
    let z = axis(args, "z", "the turning speed z");
    no_axis(args)?;
    Some(board::Command::Rocker { x: x?, y: y?, z: z? })
}

fn yaw_hold(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let [x, y] = speeds(args);
    no_axis(args)?;
    Some(board::Command::YawHold { x: x?, y: y? })
}

fn displace(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let x = axis(args, "x", "the displacement x");
    let y = axis(args, "y", "the displacement y");
    let z = axis(args, "z", "the displacement z");
    no_axis(args)?;
    Some(board::Command::Move { x: x?, y: y?, z: z? })
}

fn speeds(args: &mut Arguments<'_, '_>) -> [Option<Speed>; 2] {
    [axis(args, "x", "the speed x"), axis(args, "y", "the speed y")]
}

/// One axis; left out it is 0.
fn axis<const MIN: i32, const MAX: i32>(
    args: &mut Arguments<'_, '_>,
    name: &str,
    what: &str,
) -> Option<Ranged<MIN, MAX>> {
    match args.named(name) {
        None => Ranged::new(0).ok(),
        Some(argument) => {
            let value = args.one(argument)?;
            args.ranged(value, what)
        }
    }
}

/// An axis without its name, or no axis at all, is a mistake.
fn no_axis(args: &mut Arguments<'_, '_>) -> Option<()> {
    let named = args.command.arguments.iter().any(|argument| argument.name.is_some());
    if named {
        return Some(());
    }
    // Reports that more is needed where nothing was given.
    let value = args.next()?;
    let row = args.row;
    args.diagnostics.push(Diagnostic::new(
        Code::Arguments,
        value.span,
        format!("`{}` wants each value with its axis", row.name),
        format!("write `{}`, for example `{}`", row.usage, row.example),
    ));
    // The rest of them would only repeat it.
    while args.more() {
        args.next();
    }
    None
}

fn wheels(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let mut wheel = |what| {
        let value = args.next()?;
        args.ranged(value, what)
    };
    let [a, b, c, d] = [
        wheel("the speed of wheel A"),
        wheel("the speed of wheel B"),
        wheel("the speed of wheel C"),
        wheel("the speed of wheel D"),
    ];
    Some(board::Command::Wheels([a?, b?, c?, d?]))
}

// The table wants a function that may fail.
#[expect(clippy::unnecessary_wraps, reason = "the table's signature")]
fn stop(_: &mut Arguments<'_, '_>) -> Option<board::Command> {
    Some(board::Command::STOP)
}

fn buzzer(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let value = args.next()?;
    let word = args.word(value, &["on", "off"])?;
    Some(board::Command::Buzzer(word == "on"))
}

fn pid(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let mode = args.next()?;
    let mode = args.word(mode, &["speed", "position"]).and_then(Mode::named);
    let speed = gains(args, "speed");
    let position = gains(args, "position");
    let yaw = gains(args, "yaw");
    Some(board::Command::Pid(mode?, Gains { speed: speed?, position: position?, yaw: yaw? }))
}

/// A named list of exactly `N` gains, each a byte.
fn gains<const N: usize>(args: &mut Arguments<'_, '_>, name: &'static str) -> Option<[u8; N]> {
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
    let bytes: Vec<u8> = values.iter().filter_map(|value| args.byte(*value, "a gain")).collect();
    if values.len() != N {
        args.diagnostics.push(Diagnostic::new(
            Code::Arguments,
            argument.span,
            format!("`{name}` has {N} gains"),
            format!("write `{name}={letters}`, each 0 to 255"),
        ));
    }
    bytes.try_into().ok()
}

fn request(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let value = args.next()?;
    let word = args.word(value, Query::NAMES)?;
    Query::named(word).map(board::Command::Request)
}

fn raw(args: &mut Arguments<'_, '_>) -> Option<board::Command> {
    let function = args.next()?;
    let function = args.byte(function, "the function byte");
    let mut payload = Vec::new();
    let mut complete = true;
    while args.more() {
        let byte = args.next().and_then(|value| args.byte(value, "a payload byte"));
        complete &= byte.is_some();
        payload.extend(byte);
    }
    let length = payload.len();
    let Some(payload) = Payload::new(payload) else {
        args.diagnostics.push(Diagnostic::new(
            Code::OutOfRange,
            args.command.span,
            format!("a frame carries at most {MAX_PAYLOAD} bytes, and these are {length}"),
            "split it into several frames",
        ));
        return None;
    };
    let function = function.filter(|_| complete)?;
    args.diagnostics.push(Diagnostic::new(
        Code::RawFrame,
        args.command.span,
        "nothing checks what this frame makes the robot do",
        "use the command that sends it, if there is one",
    ));
    Some(board::Command::Raw { function, payload })
}

fn language(args: &mut Arguments<'_, '_>, _: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let version: Ranged<0, { i32::MAX }> = args.whole(value, "the version of the language")?;
    if version.get() == 1 {
        return Some(());
    }
    args.diagnostics.push(Diagnostic::new(
        Code::LanguageVersion,
        value.span,
        format!("this motionseq reads version 1 of the language, not {version}"),
        "update motionseq, or write `language 1` if the script was written for it",
    ));
    None
}

fn rate(args: &mut Arguments<'_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    match value::read(value, args.diagnostics)? {
        Quantity::Hertz(rate) if (1.0..=200.0).contains(&rate) => settings.rate = rate,
        Quantity::Hertz(_) => {
            args.diagnostics.push(Diagnostic::new(
                Code::OutOfRange,
                value.span,
                "a rate is from 1 to 200 hz",
                "write a rate such as `rate 50hz`",
            ));
            return None;
        }
        other => {
            args.diagnostics.push(Diagnostic::new(
                Code::Unit,
                value.span,
                format!("a frequency is needed here, not {}", other.kind()),
                "write a rate such as `rate 50hz`",
            ));
            return None;
        }
    }
    Some(())
}

fn refresh(args: &mut Arguments<'_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    if let ValueKind::Word(_) = value.kind {
        args.word(value, &["off"])?;
        settings.refresh = None;
        return Some(());
    }
    let interval = arguments::time(value, args.diagnostics)?;
    if !(Time::from_millis(10)..=Time::from_millis(1_000)).contains(&interval) {
        args.diagnostics.push(Diagnostic::new(
            Code::OutOfRange,
            value.span,
            "a refresh interval is from 10 ms to 1 s",
            "write an interval such as `refresh 50ms`, or `refresh off`",
        ));
        return None;
    }
    settings.refresh = Some(interval);
    Some(())
}

fn baud(args: &mut Arguments<'_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let baud: Ranged<1_200, 4_000_000> = args.whole(value, "the speed of the line")?;
    settings.baud = u32::try_from(baud.get()).ok()?;
    Some(())
}

/// The words of a `say`, with its escapes undone.
pub(super) fn say(args: &mut Arguments<'_, '_>) -> Option<String> {
    let value = args.next()?;
    let ValueKind::Text(quoted) = value.kind else {
        args.diagnostics.push(Diagnostic::new(
            Code::Arguments,
            value.span,
            "`say` needs a text",
            "write it between quotation marks: `say \"here I go\"`",
        ));
        return None;
    };
    let inner = quoted.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(quoted);
    let mut text = String::with_capacity(inner.len());
    let mut chars = inner.chars();
    while let Some(c) = chars.next() {
        match c {
            '\\' => {
                if let Some(escaped @ ('"' | '\\')) = chars.next() {
                    text.push(escaped);
                } else {
                    args.diagnostics.push(Diagnostic::new(
                        Code::Arguments,
                        value.span,
                        "a `\\` in a text stands before `\"` or `\\` only",
                        "write `\\\\` for a backslash",
                    ));
                    return None;
                }
            }
            '{' | '}' => {
                args.diagnostics.push(value::not_yet(value.span, "a value put into a text with `{ }`"));
                return None;
            }
            _ => text.push(c),
        }
    }
    Some(text)
}
