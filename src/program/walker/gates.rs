//! Gates: where they may be.

use super::super::cost;
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::words::Operation;
use super::super::{Action, gate, lints};
use super::Walker;
use super::commands::At;
use crate::diagnostic::bail;
use crate::syntax::Argument;

impl<'s> Walker<'s, '_> {
    /// A gate takes no time of the script.
    pub(super) fn gate(&mut self, at: At<'_, 's>) -> Option<Time> {
        let (span, name) = (at.command.span, at.row.name);
        let does = at.row.does;
        if let Some(word) = at.command.arguments.first().and_then(Argument::bare_word)
            && does == Operation::WaitGo
            && (self.eval.scope.value(word.text).is_some() || self.eval.scope.phrase(word.text).is_some())
        {
            let time = match self.eval.scope.value(word.text) {
                Some(Quantity::Time(_)) => format!("; to wait for that time, write `wait ({})`", word.text),
                _ => String::new(),
            };
            bail!(self.eval, AmbiguousWord, span, "`{}` is a name here", word.text;
                help: "to wait for the operator, give `{}` another name{time}", word.text);
        }
        let mut args = at.args(&mut self.eval)?;
        let gate = gate::gate(&mut args, does)?;
        args.finish()?;
        if self.in_abort {
            bail!(self.eval, Abort, span, "`{name}` is not allowed in `on abort`";
                help: "remove it: what is sent on abort does not wait");
        }
        if let Some(word) = at.frame.beside() {
            bail!(self.eval, GatePlace, span, "`{name}` is not allowed here, because of a `{word}`: what runs at the same time would not wait";
                help: "move it to a line of its own, before or after the line with the `{word}`");
        }
        if let Some(criterion) = gate.criterion() {
            lints::impossible_condition::check(criterion, span, &mut self.eval);
            lints::brief_condition::check(criterion, span, &mut self.eval);
            lints::early_expect::check_gate(criterion, at.start, span, &mut self.eval);
        }
        let length = gate.text.as_ref().map_or(0, String::len);
        self.keep(cost::GATE, 2 * length, span)?;
        self.program.has_gates = true;
        self.push(at.start, span, Action::Gate(Box::new(gate)));
        Some(at.start)
    }
}
