//! Arguments as values: numbers in range, pulse widths, words.

use super::super::joints;
use super::super::motion::Glide;
use super::super::suggest::{list, suggest};
use super::super::time::Time;
use super::super::value::{self, Quantity};
use super::super::words::Word;
use super::Arguments;
use crate::board::{Axis, Measure, ResourceId, Sets, Unit, ValueForm, Verb, VerbId};
use crate::diagnostic::{Diagnostic, bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Argument, Item, NumberShape, Value, ValueKind};

/// What a number must be, and what messages call it.
#[derive(Clone, Copy)]
pub(in crate::program) struct Bound<'t> {
    pub(in crate::program) what: &'t str,
    /// The smallest and the largest.
    pub(in crate::program) range: (i32, i32),
    pub(in crate::program) unit: Unit,
    /// How many values of the range are 1 in a script.
    pub(in crate::program) scale: i32,
    /// Why the range ends there; empty if that is obvious.
    pub(in crate::program) why: &'t str,
    /// The joint that angles belong to, by its number.
    pub(in crate::program) joint: Option<usize>,
}

impl<'t> From<&'t Axis> for Bound<'t> {
    fn from(axis: &'t Axis) -> Self {
        Bound { what: &axis.what, range: axis.range, unit: axis.unit, scale: axis.scale, why: &axis.why, joint: None }
    }
}

impl<'a, 's> Arguments<'_, 'a, 's, '_> {
    /// A value that may be a move: `B` or `A -> B`.
    pub(in crate::program) fn glide(&mut self, argument: &'a Argument<'s>, bound: Bound<'_>) -> Option<Glide> {
        let (from, to) = match &argument.item {
            Item::Arrow(ends) => (Some(&ends.0), &ends.1),
            _ => (None, self.one(argument)?),
        };
        let from = match from {
            None => None,
            Some(from) => Some(self.checked(from, bound)?),
        };
        Some(Glide { from, to: self.checked(to, bound)? })
    }

    /// A number as a value of the board, which is not rounded, but in range when it is.
    pub(in crate::program) fn checked(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<f64> {
        let number = self.measure(value, bound)?;
        self.in_range(number, value.span, bound)?;
        Some(number)
    }

    /// A number in its unit, rounded to a whole one.
    pub(in crate::program) fn ranged(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<i32> {
        let number = self.measure(value, bound)?;
        self.in_range(number, value.span, bound)
    }

    /// A number as a value of the board, which is not rounded.
    fn measure(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<f64> {
        let quantity = self.eval.value(value)?;
        Some(self.converted(quantity, value.span, bound)? * f64::from(bound.scale))
    }

    /// A whole number: an index, a count or a byte is never rounded. `what` names it in messages.
    pub(in crate::program) fn integer(&mut self, value: &'a Value<'s>, what: &str, range: (i32, i32)) -> Option<i32> {
        self.whole(value, Bound { what, range, unit: Unit::default(), scale: 1, why: "", joint: None })
    }

    /// An index, such as the number of a servo.
    pub(in crate::program) fn index(&mut self, value: &'a Value<'s>, axis: &Axis) -> Option<i32> {
        if let ValueKind::Word(name) = value.kind
            && let Some(help) = self.wrong_index(name, value.span, axis)
        {
            self.eval.push(help);
            return None;
        }
        let number = match (self.eval.value(value)?, self.word) {
            (Quantity::Joint(joint), Word::Verb(id, _)) => return self.index_of(joint, id, value.span),
            (other, _) => self.bare(other, value.span, &axis.what)?,
        };
        let is_in_range = (f64::from(axis.range.0)..=f64::from(axis.range.1)).contains(&number);
        if !is_in_range && let Some(diagnostic) = self.swapped(value, axis) {
            self.eval.push(diagnostic);
            self.skip();
            return None;
        }
        self.whole_number(number, value.span, axis.into())
    }

    /// The index of a verb in a line that is not a command of this verb.
    pub(in crate::program) fn index_or_joint(&mut self, value: &'a Value<'s>, id: VerbId, axis: &Axis) -> Option<i32> {
        match self.eval.value(value)? {
            Quantity::Joint(joint) => self.index_of(joint, id, value.span),
            other => {
                let number = self.bare(other, value.span, &axis.what)?;
                self.whole_number(number, value.span, Bound { why: "", ..axis.into() })
            }
        }
    }

    /// The index of a joint for a verb; `None` if it is a joint of another, which is reported.
    pub(in crate::program) fn index_of(&mut self, joint: usize, id: VerbId, span: Span) -> Option<i32> {
        let board = self.eval.board;
        let Some(own) = self.eval.own_joint(joint) else { return self.no_joint(joint, span) };
        let (joint, verb) = (self.eval.joints.get(own)?, board.verb(id)?);
        if joint.fits(board, id, verb) {
            return joint.limited.index;
        }
        let own = board.verb(joint.limited.verb).map_or("", |verb| &verb.word);
        let diagnostic = diagnostic!(InvalidArgument, span, "`{}` is a joint of `{own}`, not of `{}`", joint.name, verb.word;
            help: "write a number, or a joint of `{}`", verb.word);
        let diagnostic = diagnostic.related(joint.span, "its joint");
        self.eval.push(diagnostic);
        None
    }

    /// Reports a joint that only another robot has.
    fn no_joint<T>(&mut self, joint: usize, span: Span) -> Option<T> {
        let (joint, robot) = (self.eval.joints.get(joint)?, self.eval.robots.get(self.eval.robot)?.text);
        let diagnostic = diagnostic!(UnknownName, span, "there is no joint `{}`", joint.name;
            help: "define it: `{robot}: joint {} …`", joint.name);
        let diagnostic = diagnostic.related(joint.span, "a joint of another robot");
        self.eval.push(diagnostic);
        None
    }

    /// What is said of a name as an index: a name of a resource, or the number of a pass, which is 0 in the first.
    fn wrong_index(&mut self, name: &'s str, span: Span, axis: &Axis) -> Option<Diagnostic> {
        let line = |text: String, args: &Self| args.eval.rewritten(args.command.span, &[(span, text)]);
        let is_word =
            |axis: &Axis| matches!(&axis.takes, ValueForm::Word(words) if words.iter().any(|(word, _)| word == name));
        if let Word::Verb(_, Verb { axes, .. }) = self.word
            && axes.iter().any(is_word)
        {
            return Some(diagnostic!(MissingArgument, span, "{} is missing before `{name}`", axis.what;
                help: "{}", self.row().how()));
        }
        match self.eval.scope.value(name) {
            Some(Quantity::Number(0.0)) if self.eval.scope.is_counter(name) && axis.range.0 == 1 => {
                let line = line(format!("({name} + 1)"), self);
                Some(diagnostic!(OutOfRange, span, "`{name}` is 0 in the first pass, and {} starts at 1", axis.what;
                    help: "write `({name} + 1)`: `{line}`"; fix: span => "({name} + 1)"))
            }
            Some(_) => None,
            None => {
                let Word::Verb(_, Verb { sets: Sets::Indexed(resources), .. }) = self.word else { return None };
                let board = self.eval.board;
                let is_named = |id: &ResourceId| board.resource(*id).is_some_and(|found| found.about == name);
                let index = axis.range.0 + i32::try_from(resources.iter().position(is_named)?).ok()?;
                let resource = board.resource(*resources.iter().find(|id| is_named(id))?)?;
                let line = line(index.to_string(), self);
                Some(
                    diagnostic!(InvalidArgument, span, "`{}` takes a number: {name} is {}", self.row().name, resource.name;
                    help: "write `{line}`"; fix: span => "{index}"),
                )
            }
        }
    }

    /// What is said of an index after its value: `servo 1500 1`.
    fn swapped(&self, value: &'a Value<'s>, axis: &Axis) -> Option<Diagnostic> {
        let Word::Verb(_, Verb { axes, .. }) = self.word else { return None };
        let [_, other] = axes.as_slice() else { return None };
        let bare = |value: &Value<'_>| match value.kind {
            ValueKind::Number(NumberShape::Plain, text) if !value.negative => text.parse::<i32>().ok(),
            _ => None,
        };
        let is_in = |number: i32, (least, most): (i32, i32)| (least..=most).contains(&number);
        let first = bare(value).filter(|first| !is_in(*first, axis.range) && is_in(*first, other.range))?;
        let next = self.positional.as_slice().first()?;
        let Item::One(second) = &next.item else { return None };
        // Where both would be valid in either place, the first is just out of range.
        let second = bare(second).filter(|second| is_in(*second, axis.range) && !is_in(*second, other.range))?;
        let whole = value.span.to(next.span);
        let edits = [(value.span, second.to_string()), (next.span, first.to_string())];
        let line = self.eval.rewritten(self.command.span, &edits);
        Some(diagnostic!(OutOfRange, whole, "{} comes first, and then {}", axis.what, other.what;
            help: "write `{line}`"; fix: whole => "{second} {first}"))
    }

    /// The same of a value that has been computed.
    pub(in crate::program) fn whole_of(
        &mut self,
        quantity: Quantity,
        span: Span,
        what: &str,
        range: (i32, i32),
    ) -> Option<i32> {
        let number = self.bare(quantity, span, what)?;
        self.whole_number(number, span, Bound { what, range, unit: Unit::default(), scale: 1, why: "", joint: None })
    }

    /// The same, with a reason for the range.
    pub(in crate::program) fn whole(&mut self, value: &'a Value<'s>, bound: Bound<'_>) -> Option<i32> {
        let number = self.number(value, bound.what)?;
        self.whole_number(number, value.span, bound)
    }

    fn whole_number(&mut self, number: f64, span: Span, bound: Bound<'_>) -> Option<i32> {
        let (what, (least, most)) = (bound.what, bound.range);
        if libm::trunc(number) != number {
            bail!(self.eval, NotWhole, span, "{what} must be a whole number, not {number}";
                help: "write one from {least} to {most}, or round it: `round(…)`");
        }
        self.in_range(number, span, bound)
    }

    /// The ends of a range as values of the board, in the order of their angles if both are angles.
    pub(in crate::program) fn ends(
        &mut self,
        ends: &'a (Value<'s>, Value<'s>),
        bound: Bound<'_>,
    ) -> Option<(f64, f64)> {
        let (low, high) = (self.eval.value(&ends.0)?, self.eval.value(&ends.1)?);
        let mut end = |quantity: Quantity, span| {
            let value = self.converted(quantity, span, bound)? * f64::from(bound.scale);
            let is_angle = matches!(quantity, Quantity::Degrees(_));
            // A command with this angle sends the rounded value.
            Some((if is_angle { libm::round(value) } else { value }, is_angle))
        };
        let ((low, is_angle), (high, is_angle_too)) = (end(low, ends.0.span)?, end(high, ends.1.span)?);
        let is_turned = is_angle && is_angle_too && self.is_reversed(bound.joint);
        Some(if is_turned { (high, low) } else { (low, high) })
    }

    /// A range within the one of the board, as values of the board; `what` names it in messages.
    pub(in crate::program) fn range(
        &mut self,
        ends: &'a (Value<'s>, Value<'s>),
        span: Span,
        (bound, what): (Bound<'_>, &str),
    ) -> Option<(f64, f64)> {
        let (low, high) = self.ends(ends, bound)?;
        if low > high {
            let (written_low, written_high) = (self.eval.written(ends.0.span), self.eval.written(ends.1.span));
            bail!(self.eval, OutOfRange, span, "the smaller value of {what} comes first";
                write: span => "{written_high}..{written_low}");
        }
        let (min, max) = (f64::from(bound.range.0), f64::from(bound.range.1));
        if !(min <= low && high <= max) {
            let [min, max] = [min, max].map(|value| value / f64::from(bound.scale));
            bail!(self.eval, OutOfRange, span, "{what} must be within the range of the board, {min}..{max}";
                help: "narrow the range");
        }
        Some((low, high))
    }

    /// Whether larger angles of a joint are smaller values.
    pub(in crate::program) fn is_reversed(&self, joint: Option<usize>) -> bool {
        joint.and_then(|joint| self.eval.joints.get(joint)).is_some_and(|joint| joint.is_reversed)
    }

    /// A number in a unit: a bare one, a time if the unit is microseconds, or an angle if the unit or the joint says what that is.
    pub(in crate::program) fn converted(&mut self, quantity: Quantity, span: Span, bound: Bound<'_>) -> Option<f64> {
        let unit = bound.unit;
        match (quantity, unit) {
            (Quantity::Degrees(degrees), _) if bound.joint.is_some() && joints::slope(unit).is_some() => {
                self.angle_of_joint(degrees, span, bound)
            }
            (Quantity::Number(number), _) => Some(number),
            (Quantity::Time(time), Unit { measure: Measure::Micros, .. }) => Some(time.in_micros()),
            (Quantity::Degrees(degrees), Unit { angle: Some(scale), .. }) => {
                let found = scale.value(degrees);
                if found.is_none() {
                    let (least, most) = scale.degrees;
                    let other =
                        if unit.measure == Measure::Micros { ", or a pulse width such as `1500us`" } else { "" };
                    report!(self.eval, OutOfRange, span,
                        "angle {degrees}deg is out of range ({least}deg to {most}deg)";
                        help: "write an angle from `{least}deg` to `{most}deg`{other}");
                }
                found
            }
            (Quantity::Degrees(degrees), Unit { measure: Measure::Degrees, .. }) => Some(degrees),
            (other, Unit { measure, angle }) => {
                let help = match (measure, angle) {
                    (Measure::Micros, Some(_)) => {
                        "write microseconds, such as `1500` or `1500us`, or degrees, such as `90deg`"
                    }
                    (Measure::Micros, None) => "write microseconds, such as `1500` or `1500us`",
                    (Measure::Degrees, _) | (_, Some(_)) => "write the bare number, or degrees, such as `90deg`",
                    (Measure::Number, None) => "write the bare number",
                };
                self.wrong_unit(span, bound.what, other, help);
                None
            }
        }
    }

    /// The value of an angle of a joint, within the range of the board.
    fn angle_of_joint(&mut self, degrees: f64, span: Span, bound: Bound<'_>) -> Option<f64> {
        let joint = self.eval.joints.get(bound.joint?)?;
        let value = joint.value(degrees, bound.unit)?;
        let (least, most) = bound.range;
        let scale = f64::from(bound.scale);
        if value::round(value * scale).is_some_and(|value| (least..=most).contains(&value)) {
            return Some(value);
        }
        let (least, most) = joint.angles(f64::from(least) / scale, f64::from(most) / scale, bound.unit)?;
        // Tenths of a degree inside of the range; what is almost a tenth is one.
        let tenths = |angle: f64| libm::round(angle * 1e6) / 1e5;
        let (least, most) = (libm::ceil(tenths(least)) / 10.0, libm::floor(tenths(most)) / 10.0);
        let diagnostic = diagnostic!(OutOfRange, span,
            "angle {degrees}deg is out of range ({least}deg to {most}deg from the zero of `{}`)", joint.name;
            help: "write an angle from `{least}deg` to `{most}deg`");
        let diagnostic = diagnostic.related(joint.span, "its joint");
        self.eval.push(diagnostic);
        None
    }

    /// One of these words.
    pub(in crate::program) fn word<'w>(&mut self, value: &'a Value<'s>, words: &[&'w str]) -> Option<&'w str> {
        let found = match &value.kind {
            ValueKind::Word(word) | ValueKind::Text(word) | ValueKind::Number(_, word) if !value.negative => *word,
            _ => "this",
        };
        if let Some(word) = words.iter().find(|&&word| word == found) {
            return Some(word);
        }
        let is_time = found.starts_with(|c: char| c.is_ascii_digit()) && Time::parse(found).is_some();
        if let (true, true, [word, ..]) = (is_time, self.row().holds, words) {
            let text = format!("{word} for {found}");
            let line = self.eval.rewritten(self.command.span, &[(value.span, text.clone())]);
            bail!(self.eval, InvalidArgument, value.span, "`{word}` is missing after `{}`", self.row().name;
                help: "write `{line}`"; fix: value.span => "{text}");
        }
        let help = match suggest(found, words.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("write one of {}", list(words.iter().copied())),
        };
        bail!(self.eval, InvalidArgument, value.span, "`{}` does not take `{found}`", self.row().name; help: "{help}")
    }

    /// A bare number.
    pub(in crate::program) fn number(&mut self, value: &'a Value<'s>, what: &str) -> Option<f64> {
        let quantity = self.eval.value(value)?;
        self.bare(quantity, value.span, what)
    }

    /// The same of a value that has been computed.
    fn bare(&mut self, quantity: Quantity, span: Span, what: &str) -> Option<f64> {
        match quantity {
            Quantity::Number(number) => Some(number),
            other => {
                self.wrong_unit(span, what, other, "write the bare number");
                None
            }
        }
    }

    fn wrong_unit(&mut self, span: Span, what: &str, found: Quantity, help: &str) {
        report!(self.eval, Unit, span, "{what} is needed here, not {}", found.kind(); help: "{help}");
    }

    fn in_range(&mut self, number: f64, span: Span, bound: Bound<'_>) -> Option<i32> {
        let Bound { what, range: (least, most), unit, scale, why, .. } = bound;
        let checked = value::round(number).filter(|number| (least..=most).contains(number));
        if checked.is_none() {
            let shown = |value: f64| value / f64::from(scale);
            let (number, least, most) = (shown(number), shown(least.into()), shown(most.into()));
            let is_angle = unit.angle.is_some_and(|scale| scale.value(number).is_some());
            let angle = is_angle.then(|| format!("for an angle, write `{number}deg`"));
            let because = match (angle, why) {
                (Some(angle), _) => format!("; {angle}"),
                (None, "") => String::new(),
                (None, why) => format!("; {why}"),
            };
            let symbol = unit.symbol();
            let space = if symbol.is_empty() { "" } else { " " };
            let what = what.strip_prefix("a ").or(what.strip_prefix("the ")).unwrap_or(what);
            report!(self.eval, OutOfRange, span, "{what} {number} is out of range ({least} to {most}{space}{symbol})";
                help: "write a value from {least} to {most}{because}");
        }
        checked
    }
}
