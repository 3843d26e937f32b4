//! Names and phrases: `let`, `def` and calls.

use std::collections::HashMap;
use std::sync::Arc;

use super::super::calls::calls_of;
use super::super::lints;
use super::super::pending::Used;
use super::super::scope::{self, Kind};
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::words;
use super::{Frame, Walker};
use crate::diagnostic::{bail, report};
use crate::syntax::{Call, Def, Let, Name, Node, NodeKind};

impl<'s> Walker<'s, '_> {
    pub(super) fn let_(&mut self, each: &Let<'s>) -> Option<()> {
        lints::let_in_repeat::check(each, &mut self.eval);
        let set = self.sets.iter_mut().find(|set| set.name == each.name.text);
        let value = match set.filter(|_| self.eval.scope.main && self.eval.scope.is_top()) {
            Some(set) => {
                set.used = true;
                // The value that is replaced still uses its names.
                scope::names_in(&each.value, &mut |name| self.eval.scope.touch_value(name));
                self.eval.expression(&set.value)
            }
            None => self.eval.expression(&each.value),
        };
        let free = self.eval.is_free(each.name);
        // A name with a wrong value is not reported as unknown.
        if free.is_some() {
            match value {
                Some(value) => self.eval.scope.bind(each.name, value, Kind::Let),
                None => {
                    self.eval.lost.names.insert(each.name.text);
                }
            }
        }
        value?;
        free
    }

    pub(super) fn def(&mut self, def: &Arc<Def<'s>>, frame: &Frame) -> Option<()> {
        if !frame.top {
            return self.eval.top_level("def", def.span);
        }
        self.eval.is_free(def.name)?;
        let mut parameters = HashMap::with_capacity(def.parameters.len());
        for (at, parameter) in def.parameters.iter().enumerate() {
            let twice = parameters.insert(parameter.name.text, at).is_some();
            if twice
                || self.eval.robot_number(parameter.name.text).is_some()
                || words::is_reserved(self.eval.board, parameter.name.text)
                || !words::is_name(parameter.name.text)
            {
                bail!(self.eval, Name, parameter.name.span,
                    "`{}` cannot be the name of this parameter", parameter.name.text;
                    help: "choose another name: lower-case letters, digits and `_`, not a word of the language or a robot, and each name once");
            }
        }
        // Called or not, it uses the names above it.
        scope::names_of_def(def, &mut |name| self.eval.scope.touch_value(name));
        let cost = self.bounds.of_block(&def.body, &self.eval);
        let number = self.eval.scope.define(def, parameters);
        self.bounds.define(number, cost);
        self.eval.check_words(&def.body, true);
        self.check_calls(def)
    }

    /// A body may call only phrases above its `def`. Other calls are reported here, even if it is never called.
    fn check_calls(&mut self, def: &Def<'s>) -> Option<()> {
        let mut fine = Some(());
        for call in calls_of(&def.body) {
            if call.text == def.name.text || self.eval.scope.phrase(call.text).is_none() {
                fine = None;
                self.eval.unknown_call(call, Used::CallIn(def.name.text));
            }
        }
        fine
    }

    pub(super) fn call(&mut self, call: &Call<'s>, start: Time, frame: &Frame) -> Option<Time> {
        let Some(phrase) = self.eval.scope.phrase(call.name.text) else {
            // In a phrase, it was reported where the phrase is defined.
            if !self.eval.scope.in_phrase() {
                self.eval.unknown_call(Name { span: call.span, ..call.name }, Used::Call);
            }
            return None;
        };
        let parameters = &phrase.def.parameters;
        let mut values: Vec<Option<Quantity>> = vec![None; parameters.len()];
        let mut next = 0;
        for given in &call.arguments {
            let at = match given.name {
                Some(name) => phrase.parameters.get(name.text).copied(),
                None => Some(next),
            };
            next += usize::from(given.name.is_none());
            if let [Node { kind: NodeKind::Text(_), span }] = given.value.nodes.as_slice() {
                let parameter = at.and_then(|at| parameters.get(at)).map_or("n", |parameter| parameter.name.text);
                bail!(self.eval, InvalidArgument, *span, "a phrase cannot take a string";
                    help: "write a number for `{parameter}`, and choose with `if {parameter} == 1 {{ … }}` in the `def`");
            }
            let value = self.eval.expression(&given.value);
            match at.and_then(|at| values.get_mut(at)) {
                Some(slot @ None) => *slot = value,
                Some(Some(_)) => {
                    let span = given.name.map_or(given.value.span, |name| name.span);
                    bail!(self.eval, DuplicateArgument, span, "this parameter is given twice"; help: "keep one of the two");
                }
                None => {
                    let span = given.name.map_or(given.value.span, |name| name.span);
                    bail!(self.eval, UnexpectedArgument, span, "`{}` does not have this parameter", call.name.text;
                        help: "{}", signature(&phrase.def));
                }
            }
            value?;
        }
        self.bounds.allow(self.bounds.of_phrase(phrase.above), call.span, &mut self.eval)?;
        let outside = self.eval.scope.enter(&phrase);
        self.eval.traces.enter(call.span, 0);
        let mut complete = true;
        for (parameter, value) in parameters.iter().zip(values) {
            let value = match (value, &parameter.default) {
                (Some(value), _) => Some(value),
                (None, Some(default)) => self.eval.expression(default),
                (None, None) => {
                    let (name, parameter) = (call.name.text, parameter.name.text);
                    report!(self.eval, MissingArgument, call.span, "`{name}` needs a value for `{parameter}`";
                        help: "{}", signature(&phrase.def));
                    None
                }
            };
            match value {
                Some(value) => self.eval.scope.bind(parameter.name, value, Kind::Parameter),
                None => complete = false,
            }
        }
        let end = if complete { Some(self.body(&phrase.def.body, frame.inside(start)).latest) } else { None };
        self.eval.traces.leave();
        self.eval.scope.leave(outside);
        end
    }
}

/// How a phrase is called.
fn signature(def: &Def<'_>) -> String {
    let parameters = def.parameters.iter().map(|parameter| match parameter.default {
        Some(_) => format!("{} = …", parameter.name.text),
        None => parameter.name.text.to_owned(),
    });
    format!("call it as `{}({})`", def.name.text, parameters.collect::<Vec<_>>().join(", "))
}
