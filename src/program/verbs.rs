//! The arguments of a verb of the board, read as its table says.

use smallvec::SmallVec;

use super::arguments::{Arguments, Bound};
use super::evaluator::Evaluator;
use super::lints;
use super::motion::{Glide, Motion};
use crate::board::{Axis, Command, Sets, ValueForm, Values, Verb, VerbId};
use crate::diagnostic::{bail, report};
use crate::source::Span;
use crate::syntax::{Argument, Item, Value, ValueKind};

/// The arguments of a verb.
pub(super) enum Parsed {
    /// One command.
    Command(Command),
    /// A command that may go somewhere over a time.
    Motion(Motion),
}

/// Reads the arguments of a verb; what is wrong is reported.
pub(super) fn read(args: &mut Arguments<'_, '_, '_, '_>, id: VerbId, verb: &Verb) -> Option<Parsed> {
    if let Some(is) = &verb.is {
        return Some(Parsed::Command(is.clone()));
    }
    if verb.takes_names {
        args.in_order(verb.axes.iter().map(|axis| &*axis.key))?;
    }
    if verb.moves && args.may_go() {
        return motion(args, id, verb).map(Parsed::Motion);
    }
    let mut values = Values::new();
    let mut is_whole = true;
    for (at, axis) in verb.axes.iter().enumerate() {
        let joint = joint(args.eval, (id, verb), at, values.first().copied());
        is_whole &= one(args, (axis, joint), &mut values).is_some();
        if !is_whole && is_angle_unknown(args, verb) {
            return None;
        }
    }
    has_axis(args, verb)?;
    if !is_whole {
        return None;
    }
    let command = Command::new(id, &values);
    lints::raw_frame::check(verb, args.command.span, args.eval);
    Some(Parsed::Command(command))
}

fn motion(args: &mut Arguments<'_, '_, '_, '_>, id: VerbId, verb: &Verb) -> Option<Motion> {
    let mut index = None;
    if let Some(axis) = verb.axes.first().filter(|_| verb.is_indexed()) {
        let value = args.next()?;
        index = Some(args.index(value, axis));
        if index == Some(None) && is_angle_unknown(args, verb) {
            return None;
        }
    }
    let first = index.flatten();
    let mut glides: SmallVec<[Glide; 1]> = SmallVec::new();
    for (at, axis) in verb.moving().iter().enumerate() {
        let joint = joint(args.eval, (id, verb), at + usize::from(verb.is_indexed()), first);
        let argument = if axis.name.is_empty() { Some(args.next_argument()?) } else { args.named(&axis.name) };
        match argument {
            // One with a name may be left out.
            None => glides.push(Glide::default()),
            Some(argument) => glides.extend(args.glide(argument, Bound { joint, ..axis.into() })),
        }
    }
    has_axis(args, verb)?;
    if glides.len() < verb.moving().len() {
        return None;
    }
    let index = match index {
        None => None,
        Some(index) => Some(index?),
    };
    Some(Motion::new(id, index, glides))
}

/// The joint that the angles of a value belong to, by its number: the first value after an index, or the value of a part.
fn joint(eval: &Evaluator<'_, '_>, (id, verb): (VerbId, &Verb), at: usize, index: Option<i32>) -> Option<usize> {
    match &verb.sets {
        _ if eval.joints.is_empty() => None,
        Sets::Indexed(_) if at == 1 => eval.joint_of(id, index?),
        Sets::Parts(parts, _) => parts.get(at).and_then(|part| eval.joint_of(part.verb, part.index)),
        _ => None,
    }
}

/// Whether angles may belong to a joint that is unknown after a wrong index. Then the values are not read.
fn is_angle_unknown(args: &mut Arguments<'_, '_, '_, '_>, verb: &Verb) -> bool {
    let is_unknown = verb.is_indexed() && !args.eval.joints.is_empty();
    if is_unknown {
        args.skip();
    }
    is_unknown
}

/// The values of one axis of a verb that does not move, with the joint that its angles belong to.
fn one(args: &mut Arguments<'_, '_, '_, '_>, (axis, joint): (&Axis, Option<usize>), values: &mut Values) -> Option<()> {
    let bound = Bound { joint, ..axis.into() };
    let value = match &axis.takes {
        ValueForm::List(what, letters) => {
            values.extend(list(args, axis, what, letters)?);
            return Some(());
        }
        ValueForm::Bytes(most) => {
            values.extend(bytes(args, bound, *most)?);
            return Some(());
        }
        ValueForm::Number if !axis.name.is_empty() => match args.named(&axis.name) {
            None => 0,
            Some(argument) => {
                let value = args.one(argument)?;
                args.ranged(value, bound)?
            }
        },
        ValueForm::Number => {
            let value = args.next()?;
            args.ranged(value, bound)?
        }
        ValueForm::Index => {
            let value = args.next()?;
            args.index(value, axis)?
        }
        ValueForm::Byte => {
            let value = args.next()?;
            args.whole(value, bound)?
        }
        ValueForm::Word(words) => {
            let value = args.next()?;
            let known: Vec<&str> = words.iter().map(|(word, _)| &**word).collect();
            let found = args.word(value, &known)?;
            words.iter().find(|(word, _)| word == found)?.1
        }
    };
    values.push(value);
    Some(())
}

/// A named list of whole numbers, as many as there are letters.
fn list(args: &mut Arguments<'_, '_, '_, '_>, axis: &Axis, what: &str, letters: &str) -> Option<Values> {
    let Some(argument) = args.named(&axis.name) else {
        args.missing();
        return None;
    };
    let given: &[Value<'_>] = match &argument.item {
        Item::List(values) => values,
        Item::One(value) => std::slice::from_ref(value),
        _ => &[],
    };
    let bound = Bound { what, ..axis.into() };
    let values: Values = given.iter().filter_map(|value| args.whole(value, bound)).collect();
    let count = axis.count();
    if given.len() != count {
        let (name, called, (least, most)) = (&axis.name, &axis.what, axis.range);
        report!(args.eval, InvalidArgument, argument.span, "`{name}` needs {count} {called}";
            help: "write `{name}={letters}`, each {least} to {most}");
    }
    (values.len() == count && given.len() == count).then_some(values)
}

/// All that is left, as bytes.
fn bytes(args: &mut Arguments<'_, '_, '_, '_>, bound: Bound<'_>, most: usize) -> Option<Values> {
    let mut values = Values::new();
    let mut is_complete = true;
    while args.more() {
        let byte = match args.next() {
            Some(value) => args.whole(value, bound),
            None => None,
        };
        is_complete &= byte.is_some();
        values.extend(byte);
    }
    let length = values.len();
    if length > most {
        bail!(args.eval, OutOfRange, args.command.span, "a frame carries at most {most} bytes, not {length}";
            help: "split it into several frames");
    }
    is_complete.then_some(values)
}

/// Whether an argument is a number, a calculation or the name of a value, or a move between two of these.
fn is_value(argument: &Argument<'_>, args: &mut Arguments<'_, '_, '_, '_>) -> bool {
    let mut is_value = |value: &Value<'_>| match value.kind {
        ValueKind::Number(..) | ValueKind::Expression(_) => true,
        ValueKind::Word(name) => args.eval.scope.value(name).is_some(),
        ValueKind::Text(_) => false,
    };
    match &argument.item {
        Item::One(value) => is_value(value),
        Item::Arrow(ends) => is_value(&ends.0) && is_value(&ends.1),
        Item::Range(..) | Item::List(_) | Item::Comparison(_) => false,
    }
}

/// Reports values without their names, or no value at all, for a verb whose values all have names and may be omitted.
fn has_axis(args: &mut Arguments<'_, '_, '_, '_>, verb: &Verb) -> Option<()> {
    let is_optional = |axis: &Axis| !axis.name.is_empty() && axis.takes == ValueForm::Number;
    let is_given = || args.command.arguments.iter().any(|argument| argument.name.is_some());
    if verb.axes.is_empty() || !verb.axes.iter().all(is_optional) || is_given() {
        return Some(());
    }
    let first = args.next_argument()?;
    let mut given = vec![first.span];
    let mut are_values = is_value(first, args);
    while args.more() {
        let Some(argument) = args.next_argument() else { break };
        given.push(argument.span);
        are_values &= is_value(argument, args);
    }
    let name = args.row().name;
    if given.len() > verb.axes.len() || !are_values {
        bail!(args.eval, InvalidArgument, first.span, "`{name}` takes values with the names of their axes"; help: "{}", args.row().how());
    }
    let with_name = |(axis, span): (&Axis, &Span)| (*span, format!("{}={}", axis.name, args.eval.written(*span)));
    let edits: Vec<(Span, String)> = verb.axes.iter().zip(&given).map(with_name).collect();
    let whole = args.command.span;
    let line = args.eval.rewritten(whole, &edits);
    bail!(args.eval, InvalidArgument, first.span, "`{name}` takes values with the names of their axes"; write: whole => "{line}")
}
