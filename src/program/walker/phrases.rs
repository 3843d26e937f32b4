//! Names and phrases: `let`, `def` and calls.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::super::calls::calls_of;
use super::super::scope;
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::words;
use super::{Frame, Walker};
use crate::diagnostic::Code;
use crate::syntax::{Call, Def, Let, Name};

impl<'s> Walker<'s, '_> {
    pub(super) fn let_(&mut self, each: &Let<'s>) -> Option<()> {
        let set = self.sets.iter_mut().find(|set| set.name == each.name.text);
        let value = match set.filter(|_| self.eval.scope.main && self.eval.scope.is_top()) {
            Some(set) => {
                set.used = true;
                // What it replaces still uses its names.
                scope::names_in(&each.value, &mut |name| self.eval.scope.touch_value(name));
                self.eval.expression(&set.value)
            }
            None => self.eval.expression(&each.value),
        };
        let free = self.eval.is_free(each.name);
        // Also where its value is wrong, so that its users are not told that it does not exist.
        if free.is_some() {
            match value {
                Some(value) => self.eval.scope.bind(each.name, value, true),
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
            if twice || words::is_reserved(self.eval.board, parameter.name.text) || !words::is_name(parameter.name.text)
            {
                let message = format!("`{}` cannot be the name of this parameter", parameter.name.text);
                let help = "give each parameter a name of its own, in small letters, that is no word of the language";
                return self.eval.refuse(Code::Name, parameter.name.span, message, help);
            }
        }
        // Called or not, it uses the names that stand above it.
        scope::names_of_def(def, &mut |name| self.eval.scope.touch_value(name));
        let weight = self.bounds.of_block(&def.body, &self.eval);
        let number = self.eval.scope.define(def, parameters);
        self.bounds.define(number, weight);
        self.eval.check_words(&def.body, true);
        self.check_calls(def)
    }

    /// A body may call only what stands above its `def`. What it calls in vain is reported here, called or not.
    pub(super) fn check_calls(&mut self, def: &Def<'s>) -> Option<()> {
        let mut fine = Some(());
        for call in calls_of(&def.body) {
            let visible = call.text != def.name.text && self.eval.scope.phrase(call.text).is_some();
            if visible {
                continue;
            }
            fine = None;
            let below = self.eval.later.get(call.text);
            match below {
                Some(below) => match self.cycle(def, &below) {
                    Some(cycle) => {
                        let message = format!("`{}` ends up calling itself: {cycle}", def.name.text);
                        self.eval.report(Code::Recursion, call.span, message, "use `repeat`; a script always ends");
                    }
                    None => {
                        let message = format!("`{}` stands below this `def`", call.text);
                        let help = "move it above: a body sees only what stands above its `def`";
                        self.eval.report(Code::UnknownName, call.span, message, help);
                    }
                },
                None => self.eval.unknown_call(call),
            }
        }
        fine
    }

    /// How calls lead from `def` over `next` back to `def`, if they do.
    pub(super) fn cycle(&mut self, def: &Def<'s>, next: &Arc<Def<'s>>) -> Option<String> {
        const SHOWN: usize = 8;
        if !self.eval.later.call_each_other(def.name.text, next.name.text) {
            return None;
        }
        // Paths are kept as the place each name was reached from, so that long chains stay cheap.
        let mut reached: Vec<(Arc<Def<'s>>, Option<usize>)> = vec![(Arc::clone(next), None)];
        let mut seen: HashSet<&str> = HashSet::from([next.name.text]);
        let mut at = 0;
        while let Some((current, _)) = reached.get(at) {
            // The first circles are shown whole; of very many long ones only where they begin.
            if !self.bounds.may_search() {
                return Some(format!("{} → {} → …", def.name.text, next.name.text));
            }
            let current = Arc::clone(current);
            if current.name.text == def.name.text {
                let mut path = vec![def.name.text];
                let mut back = reached.get(at)?.1;
                while let Some(index) = back {
                    let (on_the_way, before) = reached.get(index)?;
                    path.push(on_the_way.name.text);
                    back = *before;
                }
                path.push(def.name.text);
                path.reverse();
                if path.len() > SHOWN {
                    path.splice(SHOWN / 2..path.len() - SHOWN / 2, ["…"]);
                }
                return Some(path.join(" → "));
            }
            for call in calls_of(&current.body) {
                if let Some(callee) = self.eval.later.get(call.text)
                    && seen.insert(callee.name.text)
                {
                    reached.push((callee, Some(at)));
                }
            }
            at += 1;
        }
        None
    }

    pub(super) fn call(&mut self, call: &Call<'s>, start: Time, frame: &Frame) -> Option<Time> {
        let Some(phrase) = self.eval.scope.phrase(call.name.text) else {
            // Inside a phrase it was reported where the phrase is defined.
            if !self.eval.scope.in_phrase() {
                self.eval.unknown_call(Name { span: call.span, ..call.name });
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
            let value = self.eval.expression(&given.value);
            match at.and_then(|at| values.get_mut(at)) {
                Some(slot @ None) => *slot = value,
                Some(Some(_)) => {
                    let span = given.name.map_or(given.value.span, |name| name.span);
                    let message = "this parameter is given twice";
                    let help = "keep one of the two";
                    return self.eval.refuse(Code::Arguments, span, message, help);
                }
                None => {
                    let span = given.name.map_or(given.value.span, |name| name.span);
                    let message = format!("`{}` has no such parameter", call.name.text);
                    return self.eval.refuse(Code::Arguments, span, message, signature(&phrase.def));
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
                    let message = format!("`{}` needs a value for `{}`", call.name.text, parameter.name.text);
                    self.eval.refuse(Code::Arguments, call.span, message, signature(&phrase.def))
                }
            };
            match value {
                Some(value) => self.eval.scope.bind(parameter.name, value, false),
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
    format!("it is called as `{}({})`", def.name.text, parameters.collect::<Vec<_>>().join(", "))
}
