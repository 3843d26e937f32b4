//! The setting `joint`.

use super::Settings;
use super::arguments::{Arguments, Bound};
use super::joints::{Joint, usual_zero};
use super::scope::Kind;
use super::suggest::suggest;
use super::value::Quantity;
use crate::board::{Axis, Board, Limited, ResourceId, ValueForm, Verb, VerbId};
use crate::diagnostic::{bail, diagnostic};
use crate::syntax::{Item, Name, Value};

/// The words before and for the options of a joint.
const ZERO: &str = "zero";
const REVERSED: &str = "reversed";

/// What a joint moves.
struct Servo {
    limited: Limited,
    resource: ResourceId,
}

/// Reads `joint NAME VERB N [zero P] [reversed] [A..B]`, and defines the name.
pub(super) fn joint(args: &mut Arguments<'_, '_, '_, '_>, settings: &mut Settings) -> Option<()> {
    let argument = args.next_argument()?;
    let Some(name) = argument.bare_word() else {
        bail!(args.eval, InvalidArgument, argument.span, "the name of a joint starts with a letter";
            help: "{}", args.row().how());
    };
    if movable(args.eval.board).any(|(_, verb)| verb.word == name.text) {
        let line = args.eval.rewritten(args.command.span, &[(name.span, format!("elbow {}", name.text))]);
        bail!(args.eval, MissingArgument, name.span, "the name of the joint is missing";
            help: "write the name first, such as `{line}`");
    }
    if !args.eval.is_joint_of_others(name.text) {
        args.eval.is_free(name)?;
    }
    let read = servo(args, name, settings).and_then(|servo| options(args, name, &servo));
    if read.is_none() {
        // A name with a wrong definition is not reported as unknown.
        args.eval.lost.names.insert(name.text);
    }
    let own = args.eval.joints.iter().filter(|joint| joint.robot == args.eval.robot);
    settings.joints = own.cloned().collect();
    read
}

/// Reads the verb and its index.
fn servo(args: &mut Arguments<'_, '_, '_, '_>, name: Name<'_>, settings: &Settings) -> Option<Servo> {
    let board = args.eval.board;
    let words: Vec<&str> = movable(board).map(|(_, verb)| &*verb.word).collect();
    if words.is_empty() {
        bail!(args.eval, InvalidArgument, args.command.span, "the board {} has no command that moves a numbered servo", board.name;
            help: "remove the line");
    }
    let value = args.next()?;
    let word = args.word(value, &words)?;
    let (id, verb) = movable(board).find(|(_, verb)| verb.word == word)?;
    let axis = verb.axes.first()?;
    let is_option = |word: Name<'_>| [ZERO, REVERSED].contains(&word.text);
    if args.next_word().is_some_and(is_option) || args.peek().is_some_and(|next| matches!(next.item, Item::Range(_))) {
        bail!(args.eval, MissingArgument, value.span, "{} is missing after `{word}`", axis.what;
            help: "write `joint {} {word} {} …`", name.text, axis.range.0);
    }
    let index = args.next()?;
    let index = args.integer(index, &axis.what, axis.range)?;
    let resource = board.occupied(id, Some(index)).first().copied()?;
    let has_names = verb.moving().first().is_some_and(|axis| !verb.label(axis).is_empty());
    let limited = Limited { verb: id, index: Some(index), axis: has_names.then_some(0) };
    if let Some(first) = settings.joints.iter().find(|joint| joint.resource == resource) {
        let diagnostic = diagnostic!(SettingPlace, args.command.span, "`{word} {index}` has two joints: `{}` and `{}`",
            first.name, name.text; help: "keep one of the two");
        let first = first.span;
        args.eval.push(diagnostic.label("again here").related(first, "first joint"));
        return None;
    }
    let mut limits = settings.limits.iter().filter(|limit| limit.limited == limited);
    if let Some(limit) = limits.find_map(|limit| limit.span) {
        let diagnostic = diagnostic!(SettingPlace, args.command.span, "the joint `{}` comes after the limit of `{word} {index}`",
            name.text; help: "move the `joint` line up: the angles of the limit depend on it");
        args.eval.push(diagnostic.related(limit, "limited here"));
        return None;
    }
    Some(Servo { limited, resource })
}

/// The verbs that move a servo with an index.
fn movable(board: &Board) -> impl Iterator<Item = (VerbId, &Verb)> {
    let is_number = |axis: &Axis| axis.takes == ValueForm::Number;
    let moves = move |verb: &Verb| verb.moves && verb.is_indexed() && verb.moving().first().is_some_and(is_number);
    board.verbs().filter(move |(_, verb)| moves(verb) && verb.is_in_scripts())
}

/// Reads the options, and defines the joint.
fn options<'s>(args: &mut Arguments<'_, '_, 's, '_>, name: Name<'s>, servo: &Servo) -> Option<()> {
    let Servo { limited, resource } = *servo;
    let axis = args.eval.board.axis(limited)?;
    let bound = Bound::from(axis);
    let (mut zero, mut is_reversed, mut range) = (None, false, None);
    while let Some(argument) = args.peek() {
        args.next_argument();
        let word = argument.bare_word().map_or("", |word| word.text);
        match (&argument.item, word) {
            (Item::Range(ends), _) if range.is_none() => range = Some((argument, ends)),
            (_, ZERO) if zero.is_none() => zero = Some(read_zero(args, bound)?),
            (_, REVERSED) if !is_reversed => is_reversed = true,
            (Item::Range(_), _) | (_, ZERO | REVERSED) => {
                let what = if word.is_empty() { "the range".to_owned() } else { format!("`{word}`") };
                bail!(args.eval, DuplicateArgument, argument.span, "{what} is given twice"; help: "keep one of the two");
            }
            _ => {
                let help = match suggest(word, [ZERO, REVERSED]) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => args.row().how(),
                };
                bail!(args.eval, UnexpectedArgument, argument.span, "`joint` does not take `{}`", args.eval.written(argument.span);
                    help: "{help}");
            }
        }
    }
    let zero = zero.unwrap_or_else(|| usual_zero(axis));
    let number = args.eval.joints.len();
    let (text, span, robot) = (name.text.to_owned(), args.command.span, args.eval.robot);
    if !args.eval.is_joint_of_others(name.text) {
        args.eval.scope.bind(name, Quantity::Joint(number), Kind::Joint);
    }
    args.eval.joints.push(Joint { name: text, robot, span, limited, resource, zero, is_reversed, range: None });
    if let Some((argument, ends)) = range {
        let bound = Bound { joint: Some(number), ..bound };
        let range = args.range(ends, argument.span, (bound, "the range of a joint"))?;
        args.eval.joints.get_mut(number)?.range = Some(range);
    }
    Some(())
}

/// Reads the value after `zero`, as a script writes it.
fn read_zero(args: &mut Arguments<'_, '_, '_, '_>, bound: Bound<'_>) -> Option<f64> {
    let value: &Value<'_> = args.next()?;
    let zero = args.checked(value, Bound { what: "the zero", why: "", ..bound })?;
    Some(zero / f64::from(bound.scale.max(1)))
}
