//! `expect`: what the board should report, and the criterion that `wait until` shares.

use std::fmt;
use std::sync::Arc;

use super::arguments::{self, Arguments, Bound};
use super::joints;
use super::suggest::list;
use super::time::Time;
use super::value::Quantity;
use crate::board::{self, Hundredths, Limited, Report};
use crate::diagnostic::{bail, report};
use crate::syntax::{Item, Value, ValueKind};

/// What a report should contain.
#[derive(Clone, Debug, PartialEq)]
pub struct Expect {
    /// The value, and what it should be.
    pub criterion: Criterion,
    /// The time in which a report must match; `None` if the newest report must match.
    pub within: Option<Time>,
    /// The reason that the script gives.
    pub why: Option<String>,
}

/// A value of a report, and what it should be.
#[derive(Clone, Debug, PartialEq)]
pub struct Criterion {
    /// Which of its values.
    pub measured: Measured,
    /// What it should be.
    pub wanted: Condition,
}

/// A value of a report, or its change since a moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Measured {
    /// The row of the value in the table of the board.
    row: usize,
    quantity: Arc<board::Quantity>,
    /// How it changes, if the change is measured.
    change: Option<board::Change>,
}

/// What a value should be, in volts or degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Condition {
    /// `<`
    Less(f64),
    /// `<=`
    AtMost(f64),
    /// `>`
    Greater(f64),
    /// `>=`
    AtLeast(f64),
    /// `==`, to the hundredth.
    Equal(f64),
    /// `in A..B`, both included.
    In(f64, f64),
}

impl Measured {
    /// The quantities of a board, and their changes.
    pub fn all(board: &board::Board) -> Vec<Measured> {
        let quantities = board.quantities.iter().enumerate();
        let values = quantities.map(|(row, quantity)| Measured { row, quantity: Arc::clone(quantity), change: None });
        let changes = board.changes.iter().map(|change| Measured {
            row: change.of,
            quantity: Arc::clone(&change.quantity),
            change: Some(change.clone()),
        });
        values.chain(changes).collect()
    }

    /// The quantity of a board with this name.
    pub(super) fn reported(board: &board::Board, name: &str) -> Option<Measured> {
        let row = board.quantities.iter().position(|quantity| quantity.name == name)?;
        Some(Measured { row, quantity: Arc::clone(board.quantities.get(row)?), change: None })
    }

    /// Its name, as scripts write it.
    pub fn name(&self) -> &str {
        &self.quantity.name
    }

    /// Its unit, as scripts write it.
    pub fn unit(&self) -> &str {
        &self.quantity.unit
    }

    /// The row of the quantity in the table of the board; of a change, of the one that changes.
    pub fn row(&self) -> usize {
        self.row
    }

    /// Its value in a report, if the report has it; of a change, the value that changes.
    pub fn of(&self, report: &Report) -> Option<Hundredths> {
        report.value(self.row)
    }

    /// How it changes, if it is the change of a value since a moment.
    pub fn change(&self) -> Option<&board::Change> {
        self.change.as_ref()
    }

    /// The smallest and the largest value that the board reports.
    pub(super) fn range(&self) -> Option<(Hundredths, Hundredths)> {
        self.quantity.range
    }

    /// How far it may change from one report to the next.
    pub(super) fn step(&self) -> Option<Hundredths> {
        self.quantity.step
    }

    /// What it is compared with, and an example of a range.
    fn sample(&self) -> (&'static str, &'static str) {
        match self.unit() {
            "V" => ("a voltage", "9V..12.6V"),
            "deg" => ("an angle", "-5deg..5deg"),
            "us" => ("a pulse width", "1490us..1510us"),
            _ => ("a number", "0..10"),
        }
    }
}

impl Condition {
    /// Whether a value fits.
    pub fn fits(self, value: Hundredths) -> bool {
        // The quotient is the float nearest to the decimal, like a literal.
        let exact = value.number();
        match self {
            Condition::Less(bound) => exact < bound,
            Condition::AtMost(bound) => exact <= bound,
            Condition::Greater(bound) => exact > bound,
            Condition::AtLeast(bound) => exact >= bound,
            #[expect(clippy::float_cmp, reason = "both are whole")]
            Condition::Equal(bound) => f64::from(value.0) == libm::round(bound * 100.0),
            Condition::In(low, high) => low <= exact && exact <= high,
        }
    }
}

impl Criterion {
    /// A criterion as [`Display`](fmt::Display) writes it, and what follows it.
    pub(super) fn parse<'t>(board: &board::Board, text: &'t str) -> Option<(Criterion, &'t str)> {
        let after = |measured: Measured| {
            let rest = text.strip_prefix(measured.name())?.strip_prefix(' ')?;
            Some((measured, rest))
        };
        let (measured, text) = Measured::all(board).into_iter().find_map(after)?;
        let (sign, text) = text.split_once(' ')?;
        let (bound, rest) = text.split_at(text.find(' ').unwrap_or(text.len()));
        let number =
            |bound: &str| bound.strip_suffix(measured.unit())?.parse::<f64>().ok().filter(|number| number.is_finite());
        let wanted = match sign {
            "<" => Condition::Less(number(bound)?),
            "<=" => Condition::AtMost(number(bound)?),
            ">" => Condition::Greater(number(bound)?),
            ">=" => Condition::AtLeast(number(bound)?),
            "==" => Condition::Equal(number(bound)?),
            "in" => {
                let (low, high) = bound.split_once("..")?;
                Condition::In(number(low)?, number(high)?)
            }
            _ => return None,
        };
        Some((Criterion { measured, wanted }, rest))
    }
}

/// As a script writes it: `voltage > 10V`.
impl fmt::Display for Criterion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (self.measured.name(), self.measured.unit());
        match self.wanted {
            Condition::Less(bound) => write!(f, "{name} < {bound}{unit}"),
            Condition::AtMost(bound) => write!(f, "{name} <= {bound}{unit}"),
            Condition::Greater(bound) => write!(f, "{name} > {bound}{unit}"),
            Condition::AtLeast(bound) => write!(f, "{name} >= {bound}{unit}"),
            Condition::Equal(bound) => write!(f, "{name} == {bound}{unit}"),
            Condition::In(low, high) => write!(f, "{name} in {low}{unit}..{high}{unit}"),
        }
    }
}

/// As a script writes it: `voltage > 10V within 2s`.
impl fmt::Display for Expect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.criterion)?;
        match self.within {
            Some(within) => write!(f, " within {within}"),
            None => Ok(()),
        }
    }
}

/// Reads the arguments of `expect`.
pub(super) fn expect(args: &mut Arguments<'_, '_, '_, '_>) -> Option<Expect> {
    let criterion = criterion(args)?;
    let why = why(args).ok()?;
    let within = within(args).ok()?;
    if let (Some(change), None) = (criterion.measured.change(), within) {
        let name = change.quantity.name.as_ref();
        bail!(args.eval, MissingArgument, args.command.span, "`{name}` is a change, which takes time";
            help: "write the time: `expect {criterion} within 2s`");
    }
    Some(Expect { criterion, within, why })
}

/// Reads `QUANTITY OPERATOR VALUE`.
pub(super) fn criterion(args: &mut Arguments<'_, '_, '_, '_>) -> Option<Criterion> {
    let all = Measured::all(args.eval.board);
    let command = args.row().name;
    if all.is_empty() {
        let name = &args.eval.board.name;
        bail!(args.eval, InvalidArgument, args.command.span, "the board {name} reports nothing, so `{command}` cannot read it";
            help: "remove the line, or wait for the operator with `wait go`");
    }
    // `expect voltage = 10V`.
    if let Some((measured, named)) = all.iter().find_map(|measured| Some((measured, args.named(measured.name())?))) {
        let name = measured.name();
        let written = args.eval.written(named.span);
        let value = written.split_once('=').map_or("", |(_, value)| value.trim());
        let unit = if value.ends_with(|c: char| c.is_ascii_digit()) { measured.unit() } else { "" };
        let write =
            |sign| args.eval.rewritten(args.command.span, &[(named.span, format!("{name} {sign} {value}{unit}"))]);
        if measured.unit().is_empty() {
            let line = write("==");
            bail!(args.eval, Comparison, named.span, "`=` does not compare"; help: "write `{line}`");
        }
        let line = write(">=");
        bail!(args.eval, Comparison, named.span, "`=` does not compare"; help: "write `==`, or rather one bound: `{line}`");
    }
    let measured = measured(args, &all)?;
    let name = measured.name();
    let operator = args.next_argument()?;
    let wanted = match &operator.item {
        Item::Comparison(sign) => {
            let value = args.next()?;
            let (bound, is_turned) = bound(args, value, &measured)?;
            match (sign.text, is_turned) {
                ("<", false) | (">", true) => Condition::Less(bound),
                ("<=", false) | (">=", true) => Condition::AtMost(bound),
                (">", false) | ("<", true) => Condition::Greater(bound),
                (">=", false) | ("<=", true) => Condition::AtLeast(bound),
                _ => Condition::Equal(bound),
            }
        }
        Item::One(Value { kind: ValueKind::Word("in"), negative: false, .. }) => {
            let range = args.next_argument()?;
            let Item::Range(ends) = &range.item else {
                bail!(args.eval, Comparison, range.span, "`in` needs a range";
                    help: "write both ends, with `..` between them: `{command} {name} in {}`", measured.sample().1);
            };
            let ((low, is_turned), (high, is_turned_too)) =
                (bound(args, &ends.0, &measured)?, bound(args, &ends.1, &measured)?);
            let (low, high) = if is_turned && is_turned_too { (high, low) } else { (low, high) };
            if low > high {
                bail!(args.eval, OutOfRange, range.span, "this range is empty";
                    help: "write the smaller value first");
            }
            Condition::In(low, high)
        }
        _ => {
            bail!(args.eval, Comparison, operator.span, "a comparison is needed here";
                help: "write {} or `in`, such as `{command} {name} in {}`", list(["<", "<=", ">", ">=", "=="]), measured.sample().1);
        }
    };
    Some(Criterion { measured, wanted })
}

/// Reads the name of a quantity, and the index after it if there are several with this word.
fn measured(args: &mut Arguments<'_, '_, '_, '_>, all: &[Measured]) -> Option<Measured> {
    let value = args.next()?;
    let mut words: Vec<&str> =
        all.iter().map(|measured| measured.name().split(' ').next().unwrap_or_default()).collect();
    words.dedup();
    if let ValueKind::Word(name) = value.kind
        && let Some(Quantity::Joint(joint)) = args.eval.scope.value(name)
        && let Some(own) = args.eval.own_joint(joint)
        && let Some(limited) = args.eval.joints.get(own).map(|joint| joint.limited)
        && let Some(of_joint) = all.iter().find(|measured| {
            measured.quantity.measures.map(|(verb, index)| (verb, Some(index))) == Some((limited.verb, limited.index))
        })
    {
        let word = of_joint.name().split(' ').next().unwrap_or_default();
        let line = args.eval.rewritten(args.command.span, &[(value.span, format!("{word} {name}"))]);
        bail!(args.eval, InvalidArgument, value.span, "`{name}` is a joint, not a quantity"; help: "write `{line}`");
    }
    let word = args.word(value, &words)?;
    let named = |name: &str| all.iter().find(|measured| measured.name() == name).cloned();
    if let Some(measured) = named(word) {
        return Some(measured);
    }
    let indices = all.iter().filter_map(|measured| measured.name().strip_prefix(word)?.trim().parse::<i32>().ok());
    let (least, most) = (indices.clone().min()?, indices.max()?);
    let Some(index) = args.next_value() else {
        let (line, span) = (args.eval.written(args.command.span), value.span);
        let line = line.replacen(word, &format!("{word} {least}"), 1);
        bail!(args.eval, MissingArgument, span, "the number after `{word}` is missing";
            help: "write one from {least} to {most}: `{line}`");
    };
    args.next_argument();
    let index = match args.eval.value(index)? {
        Quantity::Joint(joint) => {
            let mut verbs = all.iter().filter(|measured| measured.name().split(' ').next() == Some(word));
            match verbs.find_map(|measured| measured.quantity.measures) {
                Some((verb, _)) => args.index_of(joint, verb, index.span)?,
                None => args.eval.joints.get(args.eval.own_joint(joint)?)?.limited.index?,
            }
        }
        other => args.whole_of(other, index.span, &format!("a {word} number"), (least, most))?,
    };
    named(&format!("{word} {index}"))
}

/// Reads the reason at the end of a line, if there is one; `Err` if it is wrong, which is reported.
pub(super) fn why(args: &mut Arguments<'_, '_, '_, '_>) -> Result<Option<String>, ()> {
    match args.more().then(|| args.next()).flatten() {
        None => Ok(None),
        Some(Value { kind: ValueKind::Text(text), .. }) => {
            let inner = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text);
            Ok(Some(inner.replace("\\\"", "\"").replace("\\\\", "\\")))
        }
        Some(Value { kind: ValueKind::Word("in"), span, .. }) => {
            let line = args.eval.rewritten(args.command.span, &[(*span, "within".to_owned())]);
            report!(args.eval, UnexpectedArgument, *span, "a time limit needs `within`"; help: "write `{line}`"; fix: *span => "within");
            Err(())
        }
        Some(other) => {
            let example = args.row().example;
            report!(args.eval, UnexpectedArgument, other.span, "only a reason may follow the comparison";
                help: "write the reason in quotation marks, or remove it: `{example}`");
            Err(())
        }
    }
}

/// Reads `within TIME`, if it is there; `Err` if it is wrong, which is reported.
pub(super) fn within(args: &mut Arguments<'_, '_, '_, '_>) -> Result<Option<Time>, ()> {
    let Some(operand) = args.modified_by("within") else { return Ok(None) };
    let value = args.one(operand).ok_or(())?;
    let time = arguments::time(value, args.eval).ok_or(())?;
    if time <= Time::ZERO {
        report!(args.eval, OutOfRange, value.span, "`within` needs a time greater than zero";
            help: "write a time such as `within 2s`, or remove it");
        return Err(());
    }
    Ok(Some(time))
}

/// A value in the unit of the measured value, and whether larger angles are smaller values.
fn bound<'a, 's>(
    args: &mut Arguments<'_, 'a, 's, '_>,
    value: &'a Value<'s>,
    measured: &Measured,
) -> Option<(f64, bool)> {
    let (quantity, unit) = (args.eval.value(value)?, measured.unit());
    if let (Quantity::Degrees(_), Some((verb, index))) = (quantity, measured.quantity.measures)
        && let Some(axis) = args.eval.board.axis(Limited { verb, index: Some(index), axis: None })
        && (unit != "deg" && joints::slope(axis.unit).is_some())
    {
        let joint = args.eval.joint_of(verb, index);
        let bound = args.converted(quantity, value.span, Bound { joint, ..axis.into() })?;
        // The value that a command with this angle sends.
        let scale = f64::from(axis.scale);
        return Some((libm::round(bound * scale) / scale, args.is_reversed(joint)));
    }
    match (quantity, unit) {
        (Quantity::Volts(bound), "V") | (Quantity::Degrees(bound), "deg") | (Quantity::Number(bound), "") => {
            Some((bound, false))
        }
        (Quantity::Time(time), "us") => Some((time.in_micros(), false)),
        (other, unit) => {
            let (name, (what, _)) = (measured.name(), measured.sample());
            let help = match other {
                Quantity::Number(number) => format!("write `{number}{unit}`"),
                _ => format!("write it with the unit of {name}: `{unit}`"),
            };
            bail!(args.eval, Unit, value.span, "`{name}` is compared with {what}, not with {}", other.kind();
                help: "{help}")
        }
    }
}
