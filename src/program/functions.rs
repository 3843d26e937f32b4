//! The one table of functions. A new one is one row and the few lines that compute it.

use super::value::Quantity;

/// One row of the table.
#[derive(Debug)]
pub struct Function {
    /// Its name.
    pub name: &'static str,
    /// How it is written.
    pub usage: &'static str,
    /// What it gives.
    pub meaning: &'static str,
    /// The fewest and the most arguments.
    pub(super) count: (usize, usize),
    pub(super) compute: Compute,
}

/// How a function is computed.
#[derive(Debug)]
pub(super) enum Compute {
    /// From floats with one unit, which the result has too.
    Unit(fn(f64) -> f64),
    /// `abs(a)`, of a time too.
    Absolute,
    /// From a bare number to a bare number.
    Number(fn(f64) -> f64),
    /// From an angle in degrees, or a bare number in radians, to a bare number.
    Angle(fn(f64) -> f64),
    /// The smallest, or with `true` the largest.
    Extreme(bool),
    /// `choose(cond, a, b)`.
    Choose,
    /// `nth(i, a, b, …)`.
    Nth,
    /// `random(a, b)`.
    Random,
    /// `pick(a, b, …)`.
    Pick,
}

const MANY: usize = 1_000;

/// Every function.
pub const FUNCTIONS: &[Function] = &[
    row("min", "min(a, b, …)", "the smallest", (1, MANY), Compute::Extreme(false)),
    row("max", "max(a, b, …)", "the largest", (1, MANY), Compute::Extreme(true)),
    row("abs", "abs(a)", "without its minus", (1, 1), Compute::Absolute),
    row("round", "round(a)", "the nearest whole number, halves away from zero", (1, 1), Compute::Unit(libm::round)),
    row("floor", "floor(a)", "the next whole number below", (1, 1), Compute::Unit(libm::floor)),
    row("ceil", "ceil(a)", "the next whole number above", (1, 1), Compute::Unit(libm::ceil)),
    row("sqrt", "sqrt(a)", "the square root of a bare number", (1, 1), Compute::Number(libm::sqrt)),
    row("sin", "sin(a)", "the sine of an angle, in `deg` or radians", (1, 1), Compute::Angle(libm::sin)),
    row("cos", "cos(a)", "the cosine of an angle, in `deg` or radians", (1, 1), Compute::Angle(libm::cos)),
    row("choose", "choose(cond, a, b)", "a where cond is true, else b", (3, 3), Compute::Choose),
    row("nth", "nth(i, a, b, …)", "a for i = 0, b for i = 1, …", (2, MANY), Compute::Nth),
    row(
        "random",
        "random(a, b)",
        "a number from a up to b, not b itself; another one each time",
        (2, 2),
        Compute::Random,
    ),
    row("pick", "pick(a, b, …)", "one of them, another one each time", (1, MANY), Compute::Pick),
];

const fn row(
    name: &'static str,
    usage: &'static str,
    meaning: &'static str,
    count: (usize, usize),
    compute: Compute,
) -> Function {
    Function { name, usage, meaning, count, compute }
}

/// The function with this name.
pub(super) fn find(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.name == name)
}

/// The quantities of one kind compared: whether `left` is below `right`.
pub(super) fn below(left: Quantity, right: Quantity) -> Option<bool> {
    match (left, right) {
        (Quantity::Time(left), Quantity::Time(right)) | (Quantity::Moment(left), Quantity::Moment(right)) => {
            Some(left < right)
        }
        (Quantity::Truth(_), _) => None,
        _ if std::mem::discriminant(&left) == std::mem::discriminant(&right) => {
            Some(left.float()?.0 < right.float()?.0)
        }
        _ => None,
    }
}
