//! The one table of settings. A new one is one row here and the function that reads its arguments.

use super::Settings;
use super::arguments::{self, text_of};
use super::commands::{Args, Build, Row};
use super::limits::{Limit, Limited};
use super::suggest::list;
use super::time::Time;
use super::value::Quantity;
use crate::board::{ON_SILENCE, Ranged, ServoIndex};
use crate::diagnostic::{Code, Diagnostic};
use crate::syntax::{Argument, Item, NumberShape, Value, ValueKind};

/// What may stand before every command.
pub const SETTINGS: &[Row] = &[
    Row::new(
        "language",
        "language 1",
        "language 1",
        "the version of the language that the script is written for",
        Build::Set(language),
    ),
    Row::new(
        "tempo",
        "tempo BPM",
        "tempo 120bpm",
        "how many beats a minute; also first in a block; 120bpm where it is not given",
        Build::Set(tempo),
    ),
    Row::new(
        "meter",
        "meter BEATS/NOTE",
        "meter 3/4",
        "how many beats a bar; also first in a block; 4/4 where it is not given",
        Build::Set(meter),
    ),
    Row::new("rate", "rate FREQUENCY", "rate 50hz", "samples a second of moves, 1-200hz", Build::Set(rate)),
    Row::new(
        "refresh",
        "refresh TIME|off",
        "refresh 50ms",
        "how often a drive frame is sent again while it holds, 10ms-1s",
        Build::Set(refresh),
    ),
    Row::new("baud", "baud SPEED", "baud 115200", "the speed of the serial line", Build::Set(baud)),
    Row::new(
        "seed",
        "seed N",
        "seed 7",
        "which random numbers there are, a whole number; 0 where it is not given",
        Build::Set(seed),
    ),
    Row::new(
        "limit",
        "limit servo N MIN..MAX",
        "limit servo 2 900..1700",
        "limits a range, for servo 2 in place of 500..1950: also `limit rocker x -12..12`, `yawhold`, `wheels`; breaking it is an error; `limit servo 2 speed 3000us` says how many µs of pulse width a servo goes in a second, for the warning `servo-speed`",
        Build::Set(limit),
    ),
    Row::later("robots"),
];

fn language(args: &mut Args<'_, '_, '_, '_>, _: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let version = args.number(value, "the version of the language")?;
    if (version - 1.0).abs() < f64::EPSILON {
        return Some(());
    }
    args.context.report(Diagnostic::new(
        Code::LanguageVersion,
        value.span,
        format!("this motionseq reads version 1 of the language, not {version}"),
        "update motionseq, or write `language 1` if the script was written for it",
    ));
    None
}

fn rate(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    match args.context.value(value)? {
        Quantity::Hertz(rate) if (1.0..=200.0).contains(&rate) => {
            settings.period = Time::from_millis(1_000).over_number(rate)?;
        }
        Quantity::Hertz(_) => {
            args.context.report(Diagnostic::new(
                Code::OutOfRange,
                value.span,
                "a rate is from 1 to 200 hz",
                "write a rate such as `rate 50hz`",
            ));
            return None;
        }
        other => {
            args.context.report(Diagnostic::new(
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

fn refresh(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    if let ValueKind::Word(_) = value.kind {
        args.word(value, &["off"])?;
        settings.refresh = None;
        return Some(());
    }
    let interval = arguments::time(value, args.context)?;
    if !(Time::from_millis(10)..=Time::from_millis(1_000)).contains(&interval) {
        args.context.report(Diagnostic::new(
            Code::OutOfRange,
            value.span,
            "a refresh interval is from 10 ms to 1 s",
            "write an interval such as `refresh 50ms`, or `refresh off`",
        ));
        return None;
    }
    if interval > Time::from_millis(500) {
        args.context.report(Diagnostic::new(
            Code::SlowRefresh,
            value.span,
            "a drive frame that is sent again so seldom may not keep the robot moving",
            format!("{ON_SILENCE}. Stay at or below `refresh 500ms`"),
        ));
    }
    settings.refresh = Some(interval);
    Some(())
}

fn baud(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let baud: Ranged<1_200, 4_000_000> = args.whole(value, "the speed of the line")?;
    settings.baud = u32::try_from(baud.get()).ok()?;
    Some(())
}

fn tempo(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    match args.context.value(value)? {
        Quantity::Tempo(bpm) if (1.0..=1_000.0).contains(&bpm) => {
            settings.tempo = settings.tempo.at(bpm)?;
            settings.has_tempo = true;
        }
        Quantity::Tempo(_) => {
            let help = "write a tempo such as `tempo 120bpm`";
            args.context.report(Diagnostic::new(Code::OutOfRange, value.span, "a tempo is from 1 to 1000 bpm", help));
            return None;
        }
        other => {
            let message = format!("a tempo is needed here, not {}", other.kind());
            args.context.report(Diagnostic::new(
                Code::Unit,
                value.span,
                message,
                "write a tempo such as `tempo 120bpm`",
            ));
            return None;
        }
    }
    Some(())
}

fn meter(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let beats = match value.kind {
        ValueKind::Number(NumberShape::Ratio, text) => {
            let (beats, note) = text.split_once('/').unwrap_or((text, ""));
            let beats = beats.parse().ok().filter(|beats| (1..=64).contains(beats));
            beats.filter(|_| note.parse().is_ok_and(|note: u32| (1..=64).contains(&note)))
        }
        _ => None,
    };
    let Some(beats) = beats else {
        args.context.report(Diagnostic::new(
            Code::Arguments,
            value.span,
            "a meter is two numbers with a `/` between them, each 1 to 64",
            "write `meter 3/4` for three beats a bar",
        ));
        return None;
    };
    settings.tempo = settings.tempo.of(beats);
    settings.has_tempo = true;
    Some(())
}

fn seed(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let seed = args.integer::<0, { i32::MAX }>(value, "a seed", "")?;
    settings.seed = u64::try_from(seed).ok()?;
    Some(())
}

/// What a `limit` is for.
fn limited(args: &mut Args<'_, '_, '_, '_>) -> Option<Limited> {
    let thing = args.next()?;
    if let ValueKind::Word("servos") = thing.kind {
        let range = args.next_argument().and_then(range_text).unwrap_or_else(|| "900..1700".to_owned());
        let help = format!("limit each of the two: `limit servo 1 {range}`, `limit servo 2 {range}`");
        let message = "`servos` is servo 1 and servo 2, which have a limit each";
        args.context.report(Diagnostic::new(Code::Arguments, thing.span, message, help));
        return None;
    }
    let thing = args.word(thing, &["servo", "rocker", "yawhold", "wheels"])?;
    match thing {
        "servo" => {
            let index = args.next()?;
            Some(Limited::Servo(args.whole(index, "a servo number")?))
        }
        "wheels" => Some(Limited::Wheels),
        _ => {
            let names: &[&str] = if thing == "rocker" { &["x", "y", "z"] } else { &["x", "y"] };
            let argument = args.next_argument()?;
            let word = arguments::bare_word(argument).map(|word| word.text);
            let Some(axis) = names.iter().position(|name| Some(*name) == word) else {
                let message = match word {
                    Some(word) => format!("`{thing}` has no axis `{word}`"),
                    None => format!("which axis of `{thing}` is limited is missing"),
                };
                let range = if word.is_some() { args.next_argument() } else { Some(argument) };
                let range = range.and_then(range_text).unwrap_or_else(|| "-12..12".to_owned());
                let help = format!("its axes are {}: `limit {thing} x {range}`", list(names.iter().copied()));
                args.context.report(Diagnostic::new(Code::Arguments, argument.span, message, help));
                return None;
            };
            Some(if thing == "rocker" { Limited::Rocker(axis) } else { Limited::YawHold(axis) })
        }
    }
}

/// A range as it was written.
fn range_text(argument: &Argument<'_>) -> Option<String> {
    match &argument.item {
        Item::Range(ends) => Some(format!("{}..{}", text_of(&ends.0)?, text_of(&ends.1)?)),
        _ => None,
    }
}

fn limit(args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let limited = limited(args)?;
    let argument = args.next_argument()?;
    if let (Limited::Servo(index), Item::One(Value { kind: ValueKind::Word("speed"), .. })) = (limited, &argument.item)
    {
        return servo_speed(index, args, settings);
    }
    let Item::Range(ends) = &argument.item else {
        let help = "write the smallest and the largest value with `..` between them: `limit servo 2 900..1700`";
        args.context.report(Diagnostic::new(Code::Arguments, argument.span, "a range is needed here", help));
        return None;
    };
    let (min, max) = limited.board_range();
    let mut bound = |value| match limited {
        Limited::Servo(_) => args.micros(value, "a pulse width"),
        _ => args.number(value, "a speed"),
    };
    let (low, high) = (bound(&ends.0)?, bound(&ends.1)?);
    if !(f64::from(min) <= low && low <= high && high <= f64::from(max)) {
        args.context.report(Diagnostic::new(
            Code::OutOfRange,
            argument.span,
            format!("a limit lies inside the board's own range, {min}..{max}, smaller value first"),
            "narrow the range; the smaller value stands first",
        ));
        return None;
    }
    let limit = Limit { limited, low, high, span: Some(args.command.span) };
    let first = settings.limits.iter().find(|other| other.limited == limited).and_then(|first| first.span);
    if let Some(first) = first {
        let diagnostic =
            Diagnostic::new(Code::SettingPlace, args.command.span, "this is limited twice", "keep one of the two");
        args.context.report(diagnostic.label("again here").related(first, "first limited here"));
        return None;
    }
    settings.limits.retain(|other| other.limited != limited);
    settings.limits.push(limit);
    Some(())
}

/// `limit servo N speed PULSE`: how far a servo goes in a second.
fn servo_speed(index: ServoIndex, args: &mut Args<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let speed = args.micros(value, "a speed")?;
    let range = 100.0..=100_000.0;
    let whole = super::value::round(speed).and_then(|speed| u32::try_from(speed).ok());
    let Some(speed) = whole.filter(|_| range.contains(&speed)) else {
        args.context.report(Diagnostic::new(
            Code::OutOfRange,
            value.span,
            "a servo's speed is 100 to 100000 µs of pulse width a second",
            "60° in 0.12 s is 5500: write `limit servo 2 speed 5500us`",
        ));
        return None;
    };
    let at = usize::try_from(index.get()).ok()?.checked_sub(1)?;
    *settings.servo_speeds.get_mut(at)? = speed;
    Some(())
}
