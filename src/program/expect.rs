//! `expect`: what the board should report.

use std::fmt;
use std::sync::Arc;

use super::arguments::{self, Arguments};
use super::suggest::list;
use super::time::Time;
use super::value::Quantity;
use crate::board::{self, Hundredths, Report};
use crate::diagnostic::bail;
use crate::syntax::{Item, Value, ValueKind};

/// A value of a report, and what it should be.
#[derive(Clone, Debug, PartialEq)]
pub struct Expect {
    /// Which of its values.
    pub measured: Measured,
    /// What it should be.
    pub wanted: Condition,
    /// The time in which a report must match; `None` if the newest report must match.
    pub within: Option<Time>,
    /// The reason that the script gives.
    pub why: Option<String>,
}

/// A value of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Measured {
    /// Its row in the table of the board.
    row: usize,
    quantity: Arc<board::Quantity>,
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
    /// Its name, as scripts write it.
    pub fn name(&self) -> &str {
        &self.quantity.name
    }

    /// Its unit, as scripts write it.
    pub fn unit(&self) -> &str {
        &self.quantity.unit
    }

    /// Its value in a report.
    pub fn of(&self, report: &Report) -> Hundredths {
        report.value(self.row)
    }

    /// What it is compared with, and an example of a range.
    fn sample(&self) -> (&'static str, &'static str) {
        match self.unit() {
            "V" => ("a voltage", "9V..12.6V"),
            "deg" => ("an angle", "-5deg..5deg"),
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

/// As a script writes it: `voltage > 10V within 2s`.
impl fmt::Display for Expect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (self.measured.name(), self.measured.unit());
        match self.wanted {
            Condition::Less(bound) => write!(f, "{name} < {bound}{unit}")?,
            Condition::AtMost(bound) => write!(f, "{name} <= {bound}{unit}")?,
            Condition::Greater(bound) => write!(f, "{name} > {bound}{unit}")?,
            Condition::AtLeast(bound) => write!(f, "{name} >= {bound}{unit}")?,
            Condition::Equal(bound) => write!(f, "{name} == {bound}{unit}")?,
            Condition::In(low, high) => write!(f, "{name} in {low}{unit}..{high}{unit}")?,
        }
        match self.within {
            Some(within) => write!(f, " within {within}"),
            None => Ok(()),
        }
    }
}

/// Reads the arguments of `expect`.
#[expect(clippy::too_many_lines, reason = "one line, read from left to right")]
pub(super) fn expect(args: &mut Arguments<'_, '_, '_, '_>) -> Option<Expect> {
    let board = args.eval.board;
    let all = board.quantities.iter().enumerate();
    let all: Vec<Measured> = all.map(|(row, quantity)| Measured { row, quantity: Arc::clone(quantity) }).collect();
    // `expect voltage = 10V`.
    if let Some((measured, named)) = all.iter().find_map(|measured| Some((measured, args.named(measured.name())?))) {
        let (name, (_, sample)) = (measured.name(), measured.sample());
        bail!(args.eval, Comparison, named.span, "`=` does not compare";
            help: "write `==`, or better a range: `expect {name} in {sample}`");
    }
    let value = args.next()?;
    let names: Vec<&str> = all.iter().map(Measured::name).collect();
    let name = args.word(value, &names)?;
    let measured = all.iter().find(|measured| measured.name() == name)?.clone();
    let operator = args.next_argument()?;
    let wanted = match &operator.item {
        Item::Comparison(sign) => {
            let value = args.next()?;
            let bound = bound(args, value, &measured)?;
            match sign.text {
                "<" => Condition::Less(bound),
                "<=" => Condition::AtMost(bound),
                ">" => Condition::Greater(bound),
                ">=" => Condition::AtLeast(bound),
                _ => Condition::Equal(bound),
            }
        }
        Item::One(Value { kind: ValueKind::Word("in"), negative: false, .. }) => {
            let range = args.next_argument()?;
            let Item::Range(ends) = &range.item else {
                bail!(args.eval, Comparison, range.span, "`in` needs a range";
                    help: "write both ends, with `..` between them: `expect {name} in {}`", measured.sample().1);
            };
            let (low, high) = (bound(args, &ends.0, &measured)?, bound(args, &ends.1, &measured)?);
            if low > high {
                bail!(args.eval, OutOfRange, range.span, "this range is empty";
                    help: "write the smaller value first");
            }
            Condition::In(low, high)
        }
        _ => {
            bail!(args.eval, Comparison, operator.span, "a comparison is needed here";
                help: "write {} or `in`, such as `expect voltage > 10V`", list(["<", "<=", ">", ">=", "=="]));
        }
    };
    let why = match args.more().then(|| args.next()).flatten() {
        None => None,
        Some(Value { kind: ValueKind::Text(text), .. }) => {
            let inner = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text);
            Some(inner.replace("\\\"", "\"").replace("\\\\", "\\"))
        }
        Some(other) => {
            bail!(args.eval, UnexpectedArgument, other.span, "only a reason may follow the comparison";
                help: "write the reason in quotation marks, or remove it: `expect voltage > 10V \"charge me\"`");
        }
    };
    let within = match args.modified_by("within") {
        None => None,
        Some(operand) => {
            let value = args.one(operand)?;
            let time = arguments::time(value, args.eval)?;
            if time <= Time::ZERO {
                bail!(args.eval, OutOfRange, value.span, "`within` needs a time greater than zero";
                    help: "write a time such as `within 2s`, or remove it");
            }
            Some(time)
        }
    };
    Some(Expect { measured, wanted, within, why })
}

/// A value in the unit of the measured value.
fn bound<'a, 's>(args: &mut Arguments<'_, 'a, 's, '_>, value: &'a Value<'s>, measured: &Measured) -> Option<f64> {
    match (args.eval.value(value)?, measured.unit()) {
        (Quantity::Volts(bound), "V") | (Quantity::Degrees(bound), "deg") | (Quantity::Number(bound), "") => {
            Some(bound)
        }
        (other, unit) => {
            let (name, (what, sample)) = (measured.name(), measured.sample());
            let help = match other {
                Quantity::Number(number) => format!("write `{number}{unit}`"),
                _ => format!("write it with a unit, such as `expect {name} in {sample}`"),
            };
            bail!(args.eval, Unit, value.span, "`{name}` is compared with {what}, not with {}", other.kind();
                help: "{help}")
        }
    }
}
