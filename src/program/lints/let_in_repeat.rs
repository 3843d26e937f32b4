//! `let x = x + 1` in a `repeat`.

use super::super::evaluator::Evaluator;
use crate::diagnostic::diagnostic;
use crate::syntax::{Let, Node, NodeKind};

/// The name is new in each pass, and the `x` on the right is always the one outside of the `repeat`.
pub(in crate::program) fn check(each: &Let<'_>, eval: &mut Evaluator<'_, '_>) {
    // Once is enough, and one pass alone is no mistake.
    if eval.traces.pass() != 2 {
        return;
    }
    let name = each.name.text;
    let is_own = |node: &Node<'_>| node.kind == NodeKind::Name(name);
    let (repeat, outer) = (eval.traces.latest(), eval.scope.defined_at(name));
    let Some(outer) = outer.filter(|outer| each.value.nodes.iter().any(is_own) && outer.start < repeat.start) else {
        return;
    };
    let (_, statement) = eval.statement_around(repeat);
    let head = statement.split('{').next().unwrap_or_default().trim();
    let counted = if head.contains(" as ") { head.to_owned() } else { format!("{head} as i") };
    let diagnostic = diagnostic!(LetInRepeat, each.name.span,
        "`{name}` is new in each pass, and always starts from the same value";
        help: "count the passes, `{counted} {{ … }}`, and calculate `{name}` from that number");
    eval.push(diagnostic.related(outer, "the value on the right"));
}
