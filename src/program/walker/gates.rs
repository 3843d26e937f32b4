//! Gates: where they may be.

use super::super::cost;
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::words::Operation;
use super::super::{Action, Gate, gate, lints};
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
        let robots = at.frame.robots;
        if does == Operation::WaitUntil && !robots.is_named() && self.count() > 1 {
            let (line, names) = (self.eval.written(span), self.eval.robot_names(robots));
            let first = self.eval.robot_names(robots).split(',').next().unwrap_or_default().to_owned();
            bail!(self.eval, Robots, span, "several robots report, so this gate needs their names";
                help: "write `{first}: {line}`, or `{names}: {line}` if all must match at the same time");
        }
        if self.in_abort {
            bail!(self.eval, Abort, span, "`{name}` is not allowed in `on abort`";
                help: "remove it: what is sent on abort does not wait");
        }
        if let Some(word) = at.frame.beside() {
            bail!(self.eval, GatePlace, span, "`{name}` is not allowed here, because of a `{word}`: what runs at the same time would not wait";
                help: "move it to a line of its own, before or after the line with the `{word}`");
        }
        // Every robot waits, also at a gate that needs the reports of others.
        let (mut first, place, random) = (None, self.order, self.eval.random);
        self.for_each(robots, |walker| {
            let gate = walker.read_gate(at)?;
            first.get_or_insert_with(|| (gate.to_string(), gate.within));
            walker.push_gate(at, gate, place)
        })?;
        let (line, within) = first.unwrap_or_default();
        let line = format!("{}: {line}", self.eval.robot_names(robots));
        for robot in (0..self.count()).filter(|robot| !robots.contains(*robot)) {
            self.switch(robot);
            self.eval.random = random;
            let gate =
                if does == Operation::WaitGo { self.read_gate(at)? } else { Gate::of_others(line.clone(), within) };
            self.push_gate(at, gate, place)?;
        }
        self.has_gates = true;
        Some(at.start)
    }

    fn read_gate(&mut self, at: At<'_, 's>) -> Option<Gate> {
        let span = at.command.span;
        let mut args = at.args(&mut self.eval)?;
        let gate = gate::gate(&mut args, at.row.does)?;
        args.finish()?;
        if let Some(criterion) = gate.criterion() {
            lints::impossible_condition::check(criterion, span, &mut self.eval);
            lints::brief_condition::check(criterion, span, &mut self.eval);
            lints::early_expect::check_gate(criterion, at.start, span, &mut self.eval);
        }
        Some(gate)
    }

    /// Adds the gate of one robot. It has the same place in the order of unrolling for all.
    fn push_gate(&mut self, at: At<'_, 's>, gate: Gate, place: u32) -> Option<Time> {
        let length = gate.text.as_ref().map_or(0, String::len);
        self.keep(cost::GATE, 2 * length, at.command.span)?;
        self.order = place;
        self.push(at.start, at.command.span, Action::Gate(Box::new(gate)));
        Some(at.start)
    }
}
