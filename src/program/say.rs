//! The text of a `say`.

use std::fmt;
use std::ops::Range;

use super::evaluator::Evaluator;
use super::expect::Measured;
use super::template::{Piece, pieces};
use super::value::Quantity;
use crate::board::Report;
use crate::diagnostic::bail;
use crate::source::Span;
use crate::syntax::{Value, ValueKind};

/// A line to show, with the values that are known only while the script plays.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SayText {
    /// As it is shown, but with `{voltage}` and the like as they are written.
    text: String,
    /// Where these are, in order, and what they are.
    live: Vec<(Range<usize>, Measured)>,
}

impl SayText {
    /// The line with the values of a report, each with its unit; `?` without a report.
    pub fn with(&self, report: Option<&Report>) -> String {
        let mut text = self.text.clone();
        for (place, measured) in self.live.iter().rev() {
            let value = match report.and_then(|report| measured.of(report)) {
                Some(value) => format!("{value}{}", measured.unit()),
                None => "?".to_owned(),
            };
            text.replace_range(place.clone(), &value);
        }
        text
    }

    /// The rows of the quantities that it shows.
    pub fn rows(&self) -> impl Iterator<Item = usize> {
        self.live.iter().map(|(_, measured)| measured.row())
    }

    /// Whether it shows what the board reports.
    pub(super) fn is_live(&self) -> bool {
        !self.live.is_empty()
    }

    /// How much memory it needs, in bytes.
    pub(super) fn size(&self) -> usize {
        self.text.len() + self.live.len() * size_of::<(Range<usize>, Measured)>()
    }
}

/// As it is shown, but with live values as they are written.
impl fmt::Display for SayText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// The text of a `say`: escapes undone, values inserted.
pub(super) fn say<'s>(value: &Value<'s>, eval: &mut Evaluator<'s, '_>) -> Option<SayText> {
    let span = value.span;
    let ValueKind::Text(quoted) = value.kind else {
        bail!(eval, InvalidArgument, value.span, "`say` needs a string";
            help: "write it in quotation marks: `say \"here I go\"`");
    };
    let mut said = SayText { text: String::with_capacity(quoted.len()), live: Vec::new() };
    for piece in pieces(quoted) {
        match piece {
            Piece::Char(c) => said.text.push(c),
            Piece::LoneBackslash => {
                bail!(eval, InvalidArgument, value.span, "a `\\` in a string must precede `\"` or `\\`";
                    help: "write `\\\\` for a backslash");
            }
            Piece::Name(name) => match (eval.scope.value(name), reported(name, eval)) {
                (Some(Quantity::Joint(joint)), _) => {
                    said.text.push_str(eval.joints.get(joint).map_or(name, |joint| &joint.name));
                }
                (Some(found), _) => said.text.push_str(&found.to_string()),
                (None, Some(measured)) => {
                    let start = said.text.len();
                    said.text.push('{');
                    said.text.push_str(name);
                    said.text.push('}');
                    said.live.push((start..said.text.len(), measured));
                }
                (None, None) => {
                    let others = eval.boards.iter().any(|board| Measured::reported(board, name).is_some());
                    if others {
                        bail!(eval, UnknownName, span, "there are no reports of `{name}`";
                            help: "name the robots that report it: `left: say …`");
                    }
                    return unknown(&format!("unknown name `{name}`"), span, eval);
                }
            },
            Piece::Unclosed => return unknown("a `{` in this string has no `}`", span, eval),
        }
    }
    Some(said)
}

/// The quantity with a name, which may contain a joint in place of a number: `position elbow`.
fn reported(name: &str, eval: &mut Evaluator<'_, '_>) -> Option<Measured> {
    let joint = name.split_once(' ').and_then(|(quantity, joint)| {
        let Some(Quantity::Joint(joint)) = eval.scope.value(joint) else { return None };
        Some(format!("{quantity} {}", eval.joints.get(eval.own_joint(joint)?)?.limited.index?))
    });
    Measured::reported(eval.board, joint.as_deref().unwrap_or(name))
}

fn unknown<T>(message: &str, span: Span, eval: &mut Evaluator<'_, '_>) -> Option<T> {
    bail!(eval, UnknownName, span, "{message}";
        help: "write the name of a `let` between `{{` and `}}`; to show braces, write `{{{{` and `}}}}`")
}
