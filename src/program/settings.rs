//! What each setting changes: one function per setting, which reads its arguments.

use std::sync::Arc;

use super::Settings;
use super::arguments::{self, Arguments, Bound, text_of};
use super::joint_setting;
use super::joints;
use super::limits::Limit;
use super::lints;
use super::suggest::list;
use super::time::Time;
use super::value::Quantity;
use super::words::Setting;
use crate::board::{
    Activity, Axis, Board, FAMILIES, Family, FamilyNumber, Limited, Measure, OptionValue, ResourceId, Sets, Unit,
    ValueForm, Verb,
};
use crate::diagnostic::{bail, diagnostic};
use crate::syntax::{Argument, Item, NumberShape, Value, ValueKind};
use crate::units::Micros;

/// The times that a soft start may take.
pub const SOFT_START: std::ops::RangeInclusive<Micros> = Micros::from_millis(100)..=Micros::from_millis(60_000);

/// Reads the arguments of a setting; `None` if they are wrong, which is reported.
pub(super) fn set(setting: Setting, args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    match setting {
        Setting::Language => language(args),
        // The walker chooses the board and the robots.
        Setting::Board | Setting::Robots => None,
        Setting::Tempo => tempo(args, settings),
        Setting::Meter => meter(args, settings),
        Setting::Rate => rate(args, settings),
        Setting::Refresh => refresh(args, settings),
        Setting::Baud => baud(args, settings),
        Setting::Seed => seed(args, settings),
        Setting::Soft => soft(args, settings),
        Setting::Limit => limit(args, settings),
        Setting::Joint => joint_setting::joint(args, settings),
    }
}

fn language(args: &mut Arguments<'_, '_, '_, '_>) -> Option<()> {
    let value = args.next()?;
    let version = args.number(value, "the version of the language")?;
    if (version - 1.0).abs() < f64::EPSILON {
        return Some(());
    }
    bail!(args.eval, LanguageVersion, value.span, "this motionseq reads version 1 of the language, not {version}";
        help: "update motionseq, or write `language 1` if the script was written for it")
}

/// Reads the family after `board`, with its number and its options.
pub(super) fn family<'a, 's>(value: &'a Value<'s>, args: &mut Arguments<'_, 'a, 's, '_>) -> Option<Arc<Board>> {
    let words: Vec<&str> = FAMILIES.iter().map(|family| family.word).collect();
    let family = Family::named(args.word(value, &words)?)?;
    let (usage, example) = (family.usage, family.example);
    let number = match &family.number {
        None => None,
        Some(FamilyNumber { what, values, .. }) => {
            let Some(value) = args.next_value() else {
                bail!(args.eval, MissingArgument, args.command.span, "`board {}` needs {what}", family.word;
                    help: "write `{usage}`, for example `{example}`");
            };
            args.next_argument();
            let (least, most) = (values.first().copied()?, values.last().copied()?);
            let number = args.integer(value, what, (least, most))?;
            if !values.contains(&number) {
                let values: Vec<String> = values.iter().map(ToString::to_string).collect();
                bail!(args.eval, OutOfRange, value.span, "{what} cannot be {number}";
                    help: "write one of {}", list(values.iter().map(String::as_str)));
            }
            Some(number)
        }
    };
    let mut values = vec![None; family.options.len()];
    while args.more() {
        let word = args.next()?;
        let words: Vec<&str> = family.options.iter().map(|option| option.word).collect();
        if words.is_empty() {
            bail!(args.eval, UnexpectedArgument, word.span, "`board {}` takes no arguments", family.word;
                help: "write `{usage}`");
        }
        let found = args.word(word, &words)?;
        let row = words.iter().position(|word| *word == found)?;
        let place = values.get_mut(row)?;
        if place.is_some() {
            bail!(args.eval, DuplicateArgument, word.span, "`{found}` is given twice"; help: "keep one of the two");
        }
        let Some(value) = args.next_value() else {
            bail!(args.eval, MissingArgument, word.span, "the value after `{found}` is missing";
                help: "write `{usage}`");
        };
        args.next_argument();
        *place = Some(match family.options.get(row)?.value {
            OptionValue::Number(what, range) => args.integer(value, what, range)?,
            OptionValue::Switch => i32::from(args.word(value, &["on", "off"])? == "on"),
        });
    }
    Some((family.make)(number, &values))
}

fn rate(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    match args.eval.value(value)? {
        Quantity::Hertz(rate) if (1.0..=200.0).contains(&rate) => {
            settings.period = Time::from_millis(1_000).over_number(rate)?;
        }
        Quantity::Number(rate) => return without_unit(args, value, rate, "hz"),
        Quantity::Hertz(_) => {
            bail!(args.eval, OutOfRange, value.span, "the rate is out of range (1hz to 200hz)";
                help: "write a rate such as `rate 50hz`");
        }
        other => {
            bail!(args.eval, Unit, value.span, "a frequency is needed here, not {}", other.kind();
                help: "write a rate such as `rate 50hz`");
        }
    }
    Some(())
}

/// Reports a bare number where a unit is needed. Only a number in the source is corrected: a name may have another value in the next call.
fn without_unit(args: &mut Arguments<'_, '_, '_, '_>, value: &Value<'_>, number: f64, unit: &str) -> Option<()> {
    let (setting, written) = (args.row().name, args.eval.written(value.span));
    if let ValueKind::Number(NumberShape::Plain, _) = value.kind {
        bail!(args.eval, Unit, value.span, "a {setting} needs the unit `{unit}`";
            help: "write `{setting} {number}{unit}`"; fix: value.span => "{number}{unit}")
    }
    bail!(args.eval, Unit, value.span, "a {setting} needs the unit `{unit}`"; help: "write `{setting} ({written} * 1{unit})`")
}

fn refresh(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    if let ValueKind::Word(_) = value.kind {
        args.word(value, &["off"])?;
        settings.refresh.fill(None);
        return Some(());
    }
    let interval = arguments::time(value, args.eval)?;
    if !(Time::from_millis(10)..=Time::from_millis(1_000)).contains(&interval) {
        bail!(args.eval, OutOfRange, value.span, "the refresh interval is out of range (10ms to 1s)";
            help: "write an interval such as `refresh 50ms`, or `refresh off`");
    }
    lints::slow_refresh::check(interval, value.span, args.eval);
    // Only what needs it is refreshed.
    settings.refresh.iter_mut().flatten().for_each(|refresh| *refresh = interval);
    Some(())
}

fn baud(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let most = i32::try_from(args.eval.board.max_baud).unwrap_or(i32::MAX);
    let baud = args.integer(value, "the speed of the line", (1_200, most))?;
    settings.baud = u32::try_from(baud).ok()?;
    Some(())
}

fn tempo(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    match args.eval.value(value)? {
        Quantity::Tempo(bpm) if (1.0..=1_000.0).contains(&bpm) => {
            settings.tempo = settings.tempo.at(bpm)?;
            settings.has_tempo = true;
        }
        Quantity::Number(bpm) => return without_unit(args, value, bpm, "bpm"),
        Quantity::Tempo(_) => {
            bail!(args.eval, OutOfRange, value.span, "the tempo is out of range (1bpm to 1000bpm)";
                help: "write a tempo such as `tempo 120bpm`");
        }
        other => {
            bail!(args.eval, Unit, value.span, "a tempo is needed here, not {}", other.kind();
                help: "write a tempo such as `tempo 120bpm`");
        }
    }
    Some(())
}

fn meter(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
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
        bail!(args.eval, InvalidArgument, value.span, "a meter is two numbers with a `/` between them, each from 1 to 64";
            help: "write `meter 3/4` for three beats per bar");
    };
    settings.tempo = settings.tempo.of(beats);
    settings.has_tempo = true;
    Some(())
}

fn seed(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let seed = args.integer(value, "a seed", (0, i32::MAX))?;
    settings.seed = u64::try_from(seed).ok()?;
    Some(())
}

fn soft(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let value = args.next()?;
    let takes = arguments::time(value, args.eval)?;
    if args.eval.board.feedback.is_none() {
        bail!(args.eval, WrongBoard, args.command.span, "{} reports no positions, so that nothing is known to start softly from",
            args.eval.board.name; help: "remove the line");
    }
    if !SOFT_START.contains(&takes.micros()) || takes < Time::ZERO {
        bail!(args.eval, OutOfRange, value.span, "the time of a soft start is out of range (100ms to 60s)";
            help: "write a time such as `soft 2s`");
    }
    settings.soft = Some(takes.micros());
    Some(())
}

/// What a `limit` is for.
fn limited(args: &mut Arguments<'_, '_, '_, '_>) -> Option<Limited> {
    let board = args.eval.board;
    let thing = args.next()?;
    let word = if let ValueKind::Word(word) = thing.kind { word } else { "" };
    if let Some((_, verb)) = board.find(word)
        && let Sets::Parts(parts, _) = &verb.sets
    {
        let range = args.next_argument().and_then(range_text).unwrap_or_else(|| "900..1700".to_owned());
        let limited = |part: &crate::board::Part| Limited { verb: part.verb, index: Some(part.index), axis: None };
        let names: Vec<String> = parts.iter().map(|part| board.limited_name(limited(part))).collect();
        let lines: Vec<String> = names.iter().map(|name| format!("`limit {name} {range}`")).collect();
        bail!(args.eval, InvalidArgument, thing.span, "`{word}` sets {}, which have one limit each", names.join(" and ");
            help: "write {}", lines.join(" and "));
    }
    let words: Vec<&str> = limitable(board).map(|verb| &*verb.word).collect();
    let word = args.word(thing, &words)?;
    let (id, verb) = board.find(word)?;
    let mut limited = Limited { verb: id, index: None, axis: None };
    if let Some(axis) = verb.axes.first().filter(|axis| axis.takes == ValueForm::Index) {
        if let Some(range) = args.peek().and_then(range_text) {
            bail!(args.eval, MissingArgument, args.command.span, "{} is missing after `{word}`", axis.what;
                help: "write `limit {word} {} {range}`", axis.range.0);
        }
        let index = args.next()?;
        limited.index = Some(args.index_or_joint(index, id, axis)?);
    }
    let names: Vec<&str> = verb.moving().iter().map(|axis| verb.label(axis)).filter(|name| !name.is_empty()).collect();
    if names.is_empty() {
        return Some(limited);
    }
    let argument = args.next_argument()?;
    let given = argument.bare_word().map(|word| word.text);
    limited.axis = names.iter().position(|name| Some(*name) == given);
    if limited.axis.is_none() {
        let message = match given {
            Some(given) => format!("`{word}` has no axis `{given}`"),
            None => format!("the axis of `{word}` is missing"),
        };
        let range = if given.is_some() { args.next_argument() } else { Some(argument) };
        let range = range.and_then(range_text).unwrap_or_else(|| "-12..12".to_owned());
        bail!(args.eval, InvalidArgument, argument.span, "{message}";
            help: "its axes are {}: write `limit {word} {} {range}`", list(names.iter().copied()), names.first().unwrap_or(&"x"));
    }
    Some(limited)
}

/// The verbs that may be limited: those that set numbers of one resource, which stay until the next command.
pub(super) fn limitable(board: &Board) -> impl Iterator<Item = &Verb> {
    let is_number = |axis: &Axis| axis.takes == ValueForm::Number;
    board.verbs.iter().filter(move |verb| {
        let moving = verb.moving();
        matches!(verb.sets, Sets::One(_) | Sets::Indexed(_))
            && verb.activity != Activity::Passing
            && !moving.is_empty()
            && moving.iter().all(is_number)
    })
}

/// A range as it was written.
fn range_text(argument: &Argument<'_>) -> Option<String> {
    match &argument.item {
        Item::Range(ends) => Some(format!("{}..{}", text_of(&ends.0)?, text_of(&ends.1)?)),
        _ => None,
    }
}

fn limit(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let limited = limited(args)?;
    let argument = args.next_argument()?;
    let board = args.eval.board;
    let resource = board.occupied(limited.verb, limited.index).first().copied();
    let resource = resource.filter(|resource| board.resource(*resource).is_some_and(|found| found.speed.is_some()));
    if let (Some(resource), Item::One(Value { kind: ValueKind::Word("speed"), .. })) = (resource, &argument.item) {
        return speed(resource, board.axis(limited)?, args, settings);
    }
    let axis = board.axis(limited)?;
    let joint = limited.index.filter(|_| limited.axis.unwrap_or(0) == 0);
    let joint = joint.and_then(|index| args.eval.joint_of(limited.verb, index));
    let Item::Range(ends) = &argument.item else {
        bail!(args.eval, InvalidArgument, argument.span, "a range is needed here";
            help: "write the smallest and the largest value with `..` between them: `limit {} {}..{}`",
                board.limited_name(limited), axis.shown(axis.range.0), axis.shown(axis.range.1));
    };
    let (low, high) = args.range(ends, argument.span, (Bound { joint, ..axis.into() }, "a limit"))?;
    let limit = Limit { limited, low, high, span: Some(args.command.span) };
    let first = settings.limits.iter().find(|other| other.limited == limited).and_then(|first| first.span);
    if let Some(first) = first {
        let diagnostic =
            diagnostic!(SettingPlace, args.command.span, "there are two limits for this"; help: "keep one of the two");
        args.eval.push(diagnostic.label("again here").related(first, "first limited here"));
        return None;
    }
    settings.limits.retain(|other| other.limited != limited);
    settings.limits.push(limit);
    Some(())
}

/// `limit servo N speed SPEED`: how far a servo turns in a second, in its unit or in degrees.
fn speed(
    resource: ResourceId,
    axis: &Axis,
    args: &mut Arguments<'_, '_, '_, '_>,
    settings: &mut Settings,
) -> Option<()> {
    let value = args.next()?;
    let speed = match (args.eval.value(value)?, joints::slope(axis.unit)) {
        (Quantity::Degrees(degrees), Some((values, width))) => degrees * values / width,
        (other, _) => {
            let unit = Unit { angle: None, ..axis.unit };
            args.converted(other, value.span, Bound { what: "a speed", unit, ..axis.into() })?
        }
    };
    let is_pulse = axis.unit.measure == Measure::Micros;
    let range = if is_pulse { 100 } else { 1 }..=100_000;
    let whole = super::value::round(speed).and_then(|speed| u32::try_from(speed).ok());
    let Some(speed) = whole.filter(|speed| range.contains(speed)) else {
        if is_pulse {
            bail!(args.eval, OutOfRange, value.span, "the speed is out of range (100 to 100000 µs of pulse width per second)";
                help: "60° in 0.12 s is 5500: `limit servo 2 speed 5500us`");
        }
        let symbol = axis.unit.symbol();
        bail!(args.eval, OutOfRange, value.span, "the speed is out of range (1 to 100000{symbol} per second)";
            help: "write how far the servo turns in a second");
    };
    *settings.speeds.get_mut(resource)? = Some(speed);
    Some(())
}
