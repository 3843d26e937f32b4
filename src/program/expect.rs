//! `expect`: what the board should report.

use std::fmt;

use super::arguments;
use super::commands::Args;
use super::suggest::list;
use super::time::Time;
use super::value::Quantity;
use crate::board::{Hundredths, Report};
use crate::diagnostic::{Code, Diagnostic};
use crate::syntax::{Item, Value, ValueKind};

/// What a report says, and what is wanted of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Expect {
    /// Which of its values.
    pub measured: Measured,
    /// What is wanted.
    pub wanted: Wanted,
    /// How long a report may take that fits; `None` where the newest one must.
    pub within: Option<Time>,
    /// What the script says why.
    pub why: Option<String>,
}

/// A value of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Of the battery, in volts.
    Voltage,
    /// In degrees.
    Pitch,
    /// In degrees.
    Roll,
    /// In degrees.
    Yaw,
}

/// What is wanted of a value, in volts or degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
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
    const ALL: [(&str, Measured); 4] =
        [("voltage", Measured::Voltage), ("pitch", Measured::Pitch), ("roll", Measured::Roll), ("yaw", Measured::Yaw)];

    /// Its name, as scripts write it.
    pub fn name(self) -> &'static str {
        Measured::ALL.iter().find(|(_, measured)| *measured == self).map_or("", |(name, _)| name)
    }

    /// Its unit, as scripts write it.
    pub fn unit(self) -> &'static str {
        if self == Measured::Voltage { "V" } else { "deg" }
    }

    /// Its value in a report.
    pub fn of(self, report: &Report) -> Hundredths {
        match self {
            Measured::Voltage => report.voltage,
            Measured::Pitch => report.pitch,
            Measured::Roll => report.roll,
            Measured::Yaw => report.yaw,
        }
    }
}

impl Wanted {
    /// Whether a value fits.
    pub fn fits(self, value: Hundredths) -> bool {
        // The quotient is the float nearest to the decimal, as a literal is.
        let exact = f64::from(value.0) / 100.0;
        match self {
            Wanted::Less(bound) => exact < bound,
            Wanted::AtMost(bound) => exact <= bound,
            Wanted::Greater(bound) => exact > bound,
            Wanted::AtLeast(bound) => exact >= bound,
            #[expect(clippy::float_cmp, reason = "both are whole")]
            Wanted::Equal(bound) => f64::from(value.0) == libm::round(bound * 100.0),
            Wanted::In(low, high) => low <= exact && exact <= high,
        }
    }
}

/// As a script says it: `voltage > 10V within 2s`.
impl fmt::Display for Expect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (self.measured.name(), self.measured.unit());
        match self.wanted {
            Wanted::Less(bound) => write!(f, "{name} < {bound}{unit}")?,
            Wanted::AtMost(bound) => write!(f, "{name} <= {bound}{unit}")?,
            Wanted::Greater(bound) => write!(f, "{name} > {bound}{unit}")?,
            Wanted::AtLeast(bound) => write!(f, "{name} >= {bound}{unit}")?,
            Wanted::Equal(bound) => write!(f, "{name} == {bound}{unit}")?,
            Wanted::In(low, high) => write!(f, "{name} in {low}{unit}..{high}{unit}")?,
        }
        match self.within {
            Some(within) => write!(f, " within {within}"),
            None => Ok(()),
        }
    }
}

/// Reads what stands behind `expect`.
#[expect(clippy::too_many_lines, reason = "one line, read from left to right")]
pub(super) fn expect(args: &mut Args<'_, '_, '_, '_>) -> Option<Expect> {
    let names = Measured::ALL.map(|(name, _)| name);
    // `expect voltage = 10V`.
    if let Some(named) = names.iter().find_map(|name| args.named(name)) {
        let help =
            format!("to compare, write `==`, or better a range: `expect voltage in {}`", sample(Measured::Voltage));
        args.context.report(Diagnostic::new(Code::Arguments, named.span, "nothing is compared here", help));
        return None;
    }
    let value = args.next()?;
    let name = args.word(value, &names)?;
    let (_, measured) = Measured::ALL.into_iter().find(|(other, _)| *other == name)?;
    let sign = args.next_argument()?;
    let wanted = match &sign.item {
        Item::Comparison(sign) => {
            let value = args.next()?;
            let bound = bound(args, value, measured)?;
            match sign.text {
                "<" => Wanted::Less(bound),
                "<=" => Wanted::AtMost(bound),
                ">" => Wanted::Greater(bound),
                ">=" => Wanted::AtLeast(bound),
                _ => Wanted::Equal(bound),
            }
        }
        Item::One(Value { kind: ValueKind::Word("in"), negative: false, .. }) => {
            let range = args.next_argument()?;
            let Item::Range(ends) = &range.item else {
                let help = format!("write both ends with `..` between them: `expect {name} in {}`", sample(measured));
                args.context.report(Diagnostic::new(Code::Arguments, range.span, "`in` needs a range", help));
                return None;
            };
            let (low, high) = (bound(args, &ends.0, measured)?, bound(args, &ends.1, measured)?);
            if low > high {
                let help = "the smaller value stands first";
                args.context.report(Diagnostic::new(Code::OutOfRange, range.span, "nothing is in this range", help));
                return None;
            }
            Wanted::In(low, high)
        }
        _ => {
            let help = format!("write {} or `in`, such as `expect voltage > 10V`", list(["<", "<=", ">", ">=", "=="]));
            args.context.report(Diagnostic::new(Code::Arguments, sign.span, "nothing is compared here", help));
            return None;
        }
    };
    let why = match args.more().then(|| args.next()).flatten() {
        None => None,
        Some(Value { kind: ValueKind::Text(text), .. }) => {
            let inner = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text);
            Some(inner.replace("\\\"", "\"").replace("\\\\", "\\"))
        }
        Some(other) => {
            let help = "write why between quotation marks, or take it away: `expect voltage > 10V \"charge me\"`";
            args.context.report(Diagnostic::new(Code::Arguments, other.span, "nothing else stands here but why", help));
            return None;
        }
    };
    let within = match args.behind("within") {
        None => None,
        Some(operand) => {
            let value = args.one(operand)?;
            let time = arguments::time(value, args.context)?;
            if time <= Time::ZERO {
                let help = "write a time such as `within 2s`, or leave it out";
                let message = "`within` needs a time above zero";
                args.context.report(Diagnostic::new(Code::OutOfRange, value.span, message, help));
                return None;
            }
            Some(time)
        }
    };
    Some(Expect { measured, wanted, within, why })
}

fn sample(measured: Measured) -> &'static str {
    if measured == Measured::Voltage { "9V..12.6V" } else { "-5deg..5deg" }
}

/// Volts for the voltage, degrees for the rest.
fn bound<'a, 's>(args: &mut Args<'_, 'a, 's, '_>, value: &'a Value<'s>, measured: Measured) -> Option<f64> {
    match (args.context.value(value)?, measured) {
        (Quantity::Volts(bound), Measured::Voltage)
        | (Quantity::Degrees(bound), Measured::Pitch | Measured::Roll | Measured::Yaw) => Some(bound),
        (other, _) => {
            let (name, unit) = (measured.name(), measured.unit());
            let what = if measured == Measured::Voltage { "a voltage" } else { "an angle" };
            let help = match other {
                Quantity::Number(number) => format!("write `{number}{unit}`"),
                _ => format!("write it with its unit, such as `expect {name} in {}`", sample(measured)),
            };
            let message = format!("`{name}` is compared with {what}, not with {}", other.kind());
            args.context.report(Diagnostic::new(Code::Unit, value.span, message, help));
            None
        }
    }
}
