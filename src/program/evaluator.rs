//! Everything that decides what a value is at one place of a script: names, tempo, random numbers, and the calls that led
//! there.

use std::collections::HashSet;
use std::sync::Arc;

use super::functions::{self, Compute, below};
use super::joints::Joint;
use super::pending::Pending;
use super::scope::Scope;
use super::suggest::{list, suggest};
use super::tempo::Tempo;
use super::trace::Traces;
use super::value::{self, Quantity};
use crate::board::{Board, VerbId};
use crate::diagnostic::{Diagnostic, Diagnostics, bail, report};
use crate::random::SplitMix;
use crate::source::{Sources, Span};
use crate::syntax::{Binary, Expression, Lost, Name, Node, NodeKind, NumberShape, Value, ValueKind};

/// 2⁵³, the steps between 0 and 1 of a random number.
const TWO_53: f64 = 9_007_199_254_740_992.0;

pub(super) struct Evaluator<'s, 'd> {
    pub(super) diagnostics: &'d mut Diagnostics,
    /// The board of the robot that the line is run for.
    pub(super) board: &'d Arc<Board>,
    /// The robots that the script names, and the number of the one that the line is run for.
    pub(super) robots: Vec<Name<'s>>,
    pub(super) robot: usize,
    /// The boards of all robots, if the script names them.
    pub(super) boards: Vec<&'d Arc<Board>>,
    pub(super) scope: Scope<'s>,
    /// The joints so far.
    pub(super) joints: Vec<Joint>,
    pub(super) tempo: Tempo,
    pub(super) random: SplitMix,
    /// Whether a value since this was reset came from a random number or from the tempo.
    pub(super) varies: bool,
    pub(super) traces: Traces,
    /// Names whose definitions could not be read.
    pub(super) lost: Lost<'s>,
    /// What is completed at the end of the file that is run.
    pub(super) pending: Pending<'s>,
    /// Everything that was read, for messages.
    pub(super) sources: &'s Sources,
    /// Unknown words that were reported.
    pub(super) unknown: HashSet<Span>,
}

/// The place of an operator, with the steps that lead to its operands and itself.
#[derive(Clone, Copy)]
struct Operands<'e, 's> {
    span: Span,
    nodes: &'e [Node<'s>],
}

impl<'s, 'd> Evaluator<'s, 'd> {
    pub(super) fn new(diagnostics: &'d mut Diagnostics, board: &'d Arc<Board>, sources: &'s Sources) -> Self {
        Evaluator {
            diagnostics,
            board,
            robots: Vec::new(),
            robot: 0,
            boards: Vec::new(),
            scope: Scope::new(),
            joints: Vec::new(),
            tempo: Tempo::default(),
            random: SplitMix::default(),
            varies: false,
            traces: Traces::default(),
            lost: Lost::default(),
            pending: Pending::default(),
            sources,
            unknown: HashSet::new(),
        }
    }

    /// Reports something, with the calls that led here.
    pub(super) fn push(&mut self, diagnostic: Diagnostic) {
        let here = self.traces.here();
        self.diagnostics.push(self.traces.attach(diagnostic, here));
    }

    /// A value that must be a quantity; `None` if it is not, which is reported.
    pub(super) fn value(&mut self, value: &Value<'s>) -> Option<Quantity> {
        let quantity = match &value.kind {
            ValueKind::Number(shape, text) => self.number(*shape, text, value.span),
            ValueKind::Text(_) => bail!(self, InvalidArgument, value.span, "a number is needed here, not a string";
                help: "remove the quotation marks"),
            ValueKind::Word(word) => self.name(word, value.span),
            ValueKind::Expression(expression) => self.expression(expression),
        }?;
        if value.negative { self.negate(quantity, value.span) } else { Some(quantity) }
    }

    /// The result of a calculation; `None` where it has none, which is reported.
    pub(super) fn expression(&mut self, expression: &Expression<'s>) -> Option<Quantity> {
        let mut stack: Vec<Quantity> = Vec::new();
        let mut at = 0;
        while let Some(node) = expression.nodes.get(at) {
            at += 1;
            let result = match node.kind {
                NodeKind::Number(shape, text) => self.number(shape, text, node.span)?,
                NodeKind::Text(_) => {
                    return self.kinds(node.span, "a string has no place in a calculation");
                }
                NodeKind::Name(name) => self.name(name, node.span)?,
                NodeKind::Negate => {
                    let operand = stack.pop()?;
                    self.negate(operand, node.span)?
                }
                NodeKind::Not => Quantity::Truth(!self.truth(stack.pop()?, node.span)?),
                NodeKind::Skip(operator, over) => {
                    let left = stack.pop()?;
                    let left = self.truth(left, node.span)?;
                    if left == (operator == Binary::Or) {
                        for skipped in expression.nodes.iter().skip(at).take(over) {
                            if let NodeKind::Name(name) = skipped.kind {
                                self.scope.touch(name);
                            }
                        }
                        at += over;
                        Quantity::Truth(left)
                    } else {
                        continue;
                    }
                }
                // The left side did not decide it, so the right one does.
                NodeKind::Binary(Binary::And | Binary::Or) => Quantity::Truth(self.truth(stack.pop()?, node.span)?),
                NodeKind::Binary(operator) => {
                    let right = stack.pop()?;
                    let left = stack.pop()?;
                    let nodes = expression.nodes.get(..at).unwrap_or_default();
                    self.binary(operator, left, right, Operands { span: node.span, nodes })?
                }
                NodeKind::Call(name, count) => {
                    let arguments = stack.split_off(stack.len().checked_sub(count)?);
                    self.call(name, &arguments, node)?
                }
            };
            stack.push(result);
        }
        stack.pop()
    }

    fn number(&mut self, shape: NumberShape, text: &str, span: Span) -> Option<Quantity> {
        // Nearly every number of a long script is one.
        if shape == NumberShape::Plain
            && let Some(number) = value::small(text)
        {
            return Some(Quantity::Number(number));
        }
        self.varies |= shape == NumberShape::Beats;
        value::number(shape, text, span, self.tempo).map_err(|diagnostic| self.push(*diagnostic)).ok()
    }

    /// The joint of the servo that a verb moves, by its number among the joints.
    pub(super) fn joint_of(&self, verb: VerbId, index: i32) -> Option<usize> {
        let is_own = |joint: &Joint| joint.robot == self.robot;
        let mut joints = self.joints.iter();
        joints.position(|joint| is_own(joint) && joint.limited.verb == verb && joint.limited.index == Some(index))
    }

    /// The joint of the robot that the line is run for with the name of a joint: each robot may have one.
    pub(super) fn own_joint(&self, number: usize) -> Option<usize> {
        let named = self.joints.get(number)?;
        if named.robot == self.robot {
            return Some(number);
        }
        self.joints.iter().position(|joint| joint.robot == self.robot && joint.name == named.name)
    }

    /// Whether a name is that of a joint, and none of this robot. Each robot has joints of its own.
    pub(super) fn is_joint_of_others(&mut self, name: &str) -> bool {
        match self.scope.value(name) {
            Some(Quantity::Joint(joint)) => self.own_joint(joint).is_none(),
            _ => false,
        }
    }

    /// Whether a name may have been lost with something that could not be read.
    pub(super) fn may_exist(&self, name: &str) -> bool {
        self.lost.may_hold(name) || self.pending.lost.may_hold(name)
    }

    pub(super) fn name(&mut self, name: &'s str, span: Span) -> Option<Quantity> {
        match name {
            "true" => return Some(Quantity::Truth(true)),
            "false" => return Some(Quantity::Truth(false)),
            _ => {}
        }
        if let Some(value) = self.scope.value(name) {
            return Some(value);
        }
        // Said where it could not be read.
        if self.may_exist(name) {
            return None;
        }
        self.unknown_name(name, span);
        None
    }

    fn negate(&mut self, quantity: Quantity, span: Span) -> Option<Quantity> {
        let message = || format!("{} cannot be negative", quantity.kind());
        match quantity {
            Quantity::Joint(joint) => self.no_number(joint, span, &message()),
            _ => quantity.negated().or_else(|| self.kinds(span, &message())),
        }
    }

    /// A condition.
    pub(super) fn truth(&mut self, quantity: Quantity, span: Span) -> Option<bool> {
        match quantity {
            Quantity::Truth(truth) => Some(truth),
            other => {
                bail!(self, Unit, span, "a condition is needed here, not {}", other.kind();
                    help: "compare it: `n > 0`, `n == 3`")
            }
        }
    }

    fn kinds<T>(&mut self, span: Span, message: &str) -> Option<T> {
        bail!(self, Unit, span, "{message}";
            help: "`+`, `-`, `%` and comparisons need two values of one kind; `*` takes at most one unit, and `/` the same kind twice or a divisor without a unit")
    }

    /// Refuses a calculation with a joint.
    fn no_number<T>(&mut self, joint: usize, span: Span, message: &str) -> Option<T> {
        let example = self.joints.get(joint).map(|joint| joint.example(self.board)).unwrap_or_default();
        bail!(self, Unit, span, "{message}";
            help: "a joint is a servo, not a number: write its name where the number of the servo may be, as in `{example}`")
    }

    fn mismatch<T>(&mut self, left: Quantity, right: Quantity, at: Operands<'_, 's>) -> Option<T> {
        let operator = self.written(at.span).split('(').next().unwrap_or_default();
        let message = format!("`{operator}` cannot combine {} and {}", left.kind(), right.kind());
        if let (Quantity::Joint(joint), _) | (_, Quantity::Joint(joint)) = (left, right) {
            return self.no_number(joint, at.span, &message);
        }
        // `1500 + 200us`: the unit of the one is what the other lacks.
        if let [.., a, b, _] = at.nodes
            && let Some((number, other)) = lacking((left, a), (right, b)).or_else(|| lacking((right, b), (left, a)))
            && let Some(unit) = unit_of(self.written(other))
        {
            let whole = a.span.to(b.span);
            let text = self.rewritten(whole, &[(number, format!("{}{unit}", self.written(number)))]);
            bail!(self, Unit, at.span, "{message}"; write: whole => "{text}");
        }
        self.kinds(at.span, &message)
    }

    fn arithmetic<T>(&mut self, span: Span, message: &str) -> Option<T> {
        bail!(self, Arithmetic, span, "{message}"; help: "change the numbers, or exclude this case with `if`")
    }

    /// A float that is a number.
    fn finite(&mut self, number: f64, span: Span) -> Option<f64> {
        if number.is_finite() {
            return Some(number);
        }
        self.arithmetic(span, "the result is not a number")
    }

    #[expect(clippy::too_many_lines, reason = "a table of operators and kinds")]
    fn binary(&mut self, operator: Binary, left: Quantity, right: Quantity, at: Operands<'_, 's>) -> Option<Quantity> {
        use Quantity::{Moment, Number, Time, Truth};
        let span = at.span;
        match operator {
            Binary::Less | Binary::LessOrEqual | Binary::Greater | Binary::GreaterOrEqual | Binary::Equal => {
                let (less, more) = match (left, right) {
                    (Truth(left), Truth(right)) if operator == Binary::Equal => (left != right, false),
                    _ => match (below(left, right), below(right, left)) {
                        (Some(less), Some(more)) => (less, more),
                        _ => {
                            return self.mismatch(left, right, at);
                        }
                    },
                };
                Some(Truth(match operator {
                    Binary::Less => less,
                    Binary::LessOrEqual => !more,
                    Binary::Greater => more,
                    Binary::GreaterOrEqual => !less,
                    _ => !less && !more,
                }))
            }
            Binary::Multiply => match (left, right) {
                (Time(time), Number(number)) | (Number(number), Time(time)) => {
                    self.exact(time.by_number(number), span).map(Time)
                }
                _ => {
                    let Some(((a, left_unit), (b, right_unit))) = left.float().zip(right.float()) else {
                        return self.mismatch(left, right, at);
                    };
                    let unit = match (left, right) {
                        (_, Number(_)) => left_unit,
                        (Number(_), _) => right_unit,
                        _ => {
                            return self.mismatch(left, right, at);
                        }
                    };
                    self.finite(a * b, span).map(unit)
                }
            },
            Binary::Divide => self.divide(left, right, at),
            Binary::Remainder => match (left, right) {
                (Time(_), Time(super::Time::ZERO)) => self.by_zero(span),
                (Time(left), Time(right)) => self.exact(left.remainder(right), span).map(Time),
                _ => {
                    let (a, b, unit) = self.same(left, right, at)?;
                    if b == 0.0 {
                        return self.by_zero(span);
                    }
                    self.finite(remainder(a, b), span).map(unit)
                }
            },
            _ => {
                let plus = operator == Binary::Add;
                let sum = |a: super::Time, b| if plus { a.checked_plus(b) } else { a.checked_minus(b) };
                match (left, right) {
                    (Time(a), Time(b)) => self.exact(sum(a, b), span).map(Time),
                    (Moment(a), Time(b)) => self.exact(sum(a, b), span).map(Moment),
                    (Time(a), Moment(b)) if plus => self.exact(sum(a, b), span).map(Moment),
                    (Moment(a), Moment(b)) if !plus => self.exact(sum(a, b), span).map(Time),
                    _ => {
                        let (a, b, unit) = self.same(left, right, at)?;
                        self.finite(if plus { a + b } else { a - b }, span).map(unit)
                    }
                }
            }
        }
    }

    fn divide(&mut self, left: Quantity, right: Quantity, at: Operands<'_, 's>) -> Option<Quantity> {
        use Quantity::{Number, Time};
        let span = at.span;
        match (left, right) {
            (_, Number(0.0)) => self.by_zero(span),
            (Time(left), Time(right)) => match left.over(right) {
                Some(ratio) => Some(Number(ratio)),
                None => self.by_zero(span),
            },
            (Time(time), Number(number)) => self.exact(time.over_number(number), span).map(Time),
            (_, Number(b)) if left.float().is_some() => {
                let (a, unit) = left.float()?;
                self.finite(a / b, span).map(unit)
            }
            _ => {
                let (a, b, _) = self.same(left, right, at)?;
                if b == 0.0 {
                    return self.by_zero(span);
                }
                self.finite(a / b, span).map(Number)
            }
        }
    }

    /// Refuses a number where a time is needed.
    pub(super) fn needs_unit<T>(&mut self, number: f64, span: Span) -> Option<T> {
        bail!(self, Unit, span, "a time needs a unit";
            help: "write `{number}s` for seconds or `{number}ms` for milliseconds")
    }

    fn by_zero(&mut self, span: Span) -> Option<Quantity> {
        self.arithmetic(span, "this divides by zero")
    }

    pub(super) fn exact<T>(&mut self, time: Option<T>, span: Span) -> Option<T> {
        let message = "the result, or an intermediate result, is too large for a time, which is at most 292 years";
        time.or_else(|| self.arithmetic(span, message))
    }

    /// The floats of two quantities of one kind, and their unit.
    #[expect(clippy::type_complexity, reason = "a unit is the way back to a quantity")]
    fn same(
        &mut self,
        left: Quantity,
        right: Quantity,
        at: Operands<'_, 's>,
    ) -> Option<(f64, f64, fn(f64) -> Quantity)> {
        if std::mem::discriminant(&left) == std::mem::discriminant(&right)
            && let (Some((a, unit)), Some((b, _))) = (left.float(), right.float())
        {
            return Some((a, b, unit));
        }
        self.mismatch(left, right, at)
    }

    #[expect(clippy::too_many_lines, reason = "a table of functions")]
    fn call(&mut self, name: &str, arguments: &[Quantity], node: &Node<'s>) -> Option<Quantity> {
        let span = node.span;
        let Some(function) = functions::find(name) else {
            let names = || functions::FUNCTIONS.iter().map(|function| function.name);
            let help = match suggest(name, names()) {
                Some(near) => format!("did you mean `{near}`?"),
                None if self.scope.phrase(name).is_some() => {
                    format!("`{name}` is a `def`, which has no value: call it on a line of its own")
                }
                None => format!("the functions are {}", list(names())),
            };
            bail!(self, UnknownName, span, "there is no function `{name}`"; help: "{help}");
        };
        let (fewest, most) = function.count;
        let count = arguments.len();
        if count < fewest {
            bail!(self, MissingArgument, span, "`{name}` needs {}, not {count}", values(fewest); help: "write `{}`", function.usage);
        }
        if count > most {
            bail!(self, UnexpectedArgument, span, "`{name}` takes {}, not {count}", values(most); help: "write `{}`", function.usage);
        }
        let first = *arguments.first()?;
        match function.compute {
            Compute::Absolute => match (first, first.float()) {
                (Quantity::Time(time), _) if time < super::Time::ZERO => Some(Quantity::Time(time.negated())),
                (_, Some((number, unit))) => Some(unit(libm::fabs(number))),
                (Quantity::Time(_), None) => Some(first),
                (_, None) => self.kinds(span, &format!("`{name}` needs a number, not {}", first.kind())),
            },
            Compute::Unit(compute) => match first.float() {
                Some((number, unit)) => self.finite(compute(number), span).map(unit),
                None => self.kinds(span, &format!("`{name}` needs a number, not {}", first.kind())),
            },
            Compute::Number(compute) => match first {
                Quantity::Number(number) => self.finite(compute(number), span).map(Quantity::Number),
                _ => self.kinds(span, &format!("`{name}` needs a bare number, not {}", first.kind())),
            },
            Compute::Angle(compute) => match first {
                Quantity::Number(radians) => self.finite(compute(radians), span).map(Quantity::Number),
                Quantity::Degrees(degrees) => {
                    self.finite(compute(degrees * (std::f64::consts::PI / 180.0)), span).map(Quantity::Number)
                }
                _ => self.kinds(span, &format!("`{name}` needs an angle, not {}", first.kind())),
            },
            Compute::Extreme(largest) => {
                let mut best = first;
                for &other in arguments.iter().skip(1) {
                    let (low, high) = if largest { (best, other) } else { (other, best) };
                    let Some(better) = below(low, high) else {
                        return self.mismatch(best, other, Operands { span, nodes: &[] });
                    };
                    if better {
                        best = other;
                    }
                }
                Some(best)
            }
            Compute::Choose => {
                let chosen = usize::from(!self.truth(first, span)?) + 1;
                arguments.get(chosen).copied()
            }
            Compute::Nth => {
                let chosen = match first {
                    Quantity::Joint(joint) => {
                        return self.no_number(joint, span, "the index of `nth` cannot be a joint");
                    }
                    Quantity::Number(index) if libm::floor(index) == index && index >= 0.0 => value::round(index),
                    _ => None,
                };
                let chosen = chosen.and_then(|index| usize::try_from(index).ok()?.checked_add(1));
                let found = chosen.and_then(|index| arguments.get(index).copied());
                if found.is_none() {
                    report!(self, OutOfRange, span, "`nth` has no value with the index {first}";
                        help: "count from 0 to {}, in whole numbers", arguments.len().saturating_sub(2));
                }
                found
            }
            Compute::Random => {
                self.varies = true;
                let at = Operands { span, nodes: &[] };
                let part = self.random.next() >> 11;
                let upper = *arguments.get(1)?;
                let width = self.binary(Binary::Subtract, upper, first, at)?;
                let step = match width {
                    Quantity::Time(time) => {
                        let step = time.scaled(i64::try_from(part).ok()?, 1 << 53);
                        Quantity::Time(self.exact(step, span)?)
                    }
                    #[expect(clippy::cast_precision_loss, reason = "53 bits fit a float")]
                    _ => self.binary(Binary::Multiply, width, Quantity::Number(part as f64 / TWO_53), at)?,
                };
                self.binary(Binary::Add, first, step, at)
            }
            Compute::Pick => {
                let count = u64::try_from(arguments.len()).ok()?;
                self.varies = true;
                let index = usize::try_from(self.random.next().checked_rem(count)?).ok()?;
                arguments.get(index).copied()
            }
        }
    }
}

/// The places of a number without a unit, and of the time that it is combined with.
fn lacking(number: (Quantity, &Node<'_>), time: (Quantity, &Node<'_>)) -> Option<(Span, Span)> {
    let is_literal = |node: &Node<'_>| matches!(node.kind, NodeKind::Number(..));
    let is_lacking = matches!((number.0, time.0), (Quantity::Number(_), Quantity::Time(_)));
    (is_lacking && is_literal(number.1) && is_literal(time.1)).then_some((number.1.span, time.1.span))
}

/// The unit that ends a number.
fn unit_of(number: &str) -> Option<&str> {
    let unit = number.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    (unit.len() < number.len() && !unit.is_empty() && !unit.contains(' ')).then_some(unit)
}

fn values(count: usize) -> String {
    if count == 1 { "1 value".to_owned() } else { format!("{count} values") }
}

/// The exact remainder of a division by `b`, which is not zero; it has the sign of `b`.
fn remainder(a: f64, b: f64) -> f64 {
    let rest = libm::fmod(a, b);
    if rest == 0.0 {
        // Not the `-0` that a negative dividend leaves.
        0.0
    } else if (rest < 0.0) == (b < 0.0) {
        rest
    } else {
        rest + b
    }
}
