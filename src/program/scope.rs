//! Names and their values. `let`, parameters, `repeat … as`, `def` and marks share one namespace.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use smallvec::SmallVec;

use super::suggest::suggest;
use super::template;
use super::value::Quantity;
use crate::source::Span;
use crate::syntax::{Block, Def, Expression, Item, Name, NodeKind, Origin, Start, Statement, Value, ValueKind};

/// A name and its value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binding<'s> {
    pub(super) name: &'s str,
    pub(super) value: Quantity,
    /// Where it was named.
    pub(super) span: Span,
    /// Whether anything has used it.
    used: bool,
    /// Whether a warning is wanted where nothing does: a `let` of the main script.
    watched: bool,
    kind: Kind,
}

/// What gave a name its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A `let`.
    Let,
    /// A parameter.
    Parameter,
    /// The `as` of a `repeat`.
    Counter,
    /// A `mark`.
    Mark,
    /// A `joint`.
    Joint,
}

/// A `def`, with what it sees.
#[derive(Clone, Debug)]
pub(super) struct Phrase<'s> {
    pub(super) def: Arc<Def<'s>>,
    /// The place of each parameter.
    pub(super) parameters: Arc<HashMap<&'s str, usize>>,
    /// How many of the top-level names stand above it.
    globals: usize,
    /// How many of the `def`s stand above it.
    pub(super) above: usize,
    used: bool,
    watched: bool,
}

/// Where the names of a block begin; given back when it ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    block: usize,
    locals: usize,
    top: bool,
}

/// What was visible before a call; given back when it ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    mark: Mark,
    floor: usize,
    in_phrase: bool,
    globals: usize,
    phrases: usize,
    main: bool,
}

/// Everything that can be seen at one place.
#[derive(Debug, Default)]
pub(super) struct Scope<'s> {
    globals: Vec<Binding<'s>>,
    /// Where each top-level name is among them. A name is given there once.
    global: BTreeMap<&'s str, usize>,
    locals: Vec<Binding<'s>>,
    /// Where each name is among the locals, the newest last.
    local: HashMap<&'s str, SmallVec<[usize; 2]>>,
    phrases: Vec<Phrase<'s>>,
    by_name: BTreeMap<&'s str, usize>,
    /// The `let`s of blocks that have ended, and whether anything ever used them.
    ended: BTreeMap<Span, (&'s str, bool)>,
    /// Whether names go to the top level.
    top: bool,
    /// Where the names of this block begin among the locals.
    block: usize,
    /// Where the names of this call begin among the locals.
    floor: usize,
    /// Whether this is the body of a phrase.
    in_phrase: bool,
    /// How many names were compared with unknown ones.
    compared: usize,
    /// One more than the index of the newest local that was used since this was reset.
    pub(super) newest: usize,
    /// How many top-level names and phrases are visible.
    visible: usize,
    visible_phrases: usize,
    /// Whether what is named now is in the main script.
    pub(super) main: bool,
}

impl<'s> Scope<'s> {
    pub(super) fn new() -> Self {
        Scope { top: true, main: true, ..Scope::default() }
    }

    /// The value of a name.
    pub(super) fn value(&mut self, name: &str) -> Option<Quantity> {
        let visible = if self.top { self.globals.len() } else { self.visible };
        let found = match self.local_since(self.floor, name) {
            Some(at) => {
                self.newest = self.newest.max(at + 1);
                self.locals.get_mut(at)?
            }
            None => {
                let at = self.global.get(name).copied().filter(|&at| at < visible)?;
                self.globals.get_mut(at)?
            }
        };
        found.used = true;
        Some(found.value)
    }

    /// Where the newest of the locals with this name is, if it is not before `since`.
    fn local_since(&self, since: usize, name: &str) -> Option<usize> {
        self.local.get(name)?.last().copied().filter(|&at| at >= since)
    }

    /// Where the value of a name was defined.
    pub(super) fn defined_at(&self, name: &str) -> Option<Span> {
        let visible = if self.top { self.globals.len() } else { self.visible };
        let local = self.local_since(self.floor, name).and_then(|at| self.locals.get(at));
        let global = || self.global.get(name).filter(|at| **at < visible).and_then(|at| self.globals.get(*at));
        local.or_else(global).map(|binding| binding.span)
    }

    /// Whether a name is the number of a pass of a `repeat`.
    pub(super) fn is_counter(&self, name: &str) -> bool {
        let local = self.local_since(self.floor, name).and_then(|at| self.locals.get(at));
        local.is_some_and(|binding| binding.kind == Kind::Counter)
    }

    /// Counts the name of a value as used.
    pub(super) fn touch_value(&mut self, name: &str) {
        let _ = self.value(name);
    }

    /// Counts a name as used, of a value or of a phrase.
    pub(super) fn touch(&mut self, name: &str) {
        self.touch_value(name);
        let _ = self.phrase(name);
    }

    /// The names that can be seen, for suggestions.
    pub(super) fn names(&self) -> impl Iterator<Item = &'s str> {
        let visible = if self.top { self.globals.len() } else { self.visible };
        let locals = self.locals.get(self.floor..).unwrap_or_default();
        locals.iter().chain(self.globals.get(..visible).unwrap_or_default()).map(|binding| binding.name)
    }

    /// Where this name was given in this very block, or, at the top level, to a phrase.
    pub(super) fn taken(&self, name: &str) -> Option<Span> {
        if !self.top {
            let at = self.local_since(self.block, name)?;
            return self.locals.get(at).map(|binding| binding.span);
        }
        let binding = || self.global.get(name).and_then(|&at| self.globals.get(at)).map(|binding| binding.span);
        let phrase = self.by_name.get(name).and_then(|&at| self.phrases.get(at)).map(|phrase| phrase.def.name.span);
        phrase.or_else(binding)
    }

    /// Where a mark would hide this name: marks live as long as the pass or call that contains them. A call does not see its
    /// caller's names, and may hide those at the top level.
    pub(super) fn hidden_by_mark(&self, name: &str) -> Option<Span> {
        let local = self.local_since(self.floor, name).and_then(|at| self.locals.get(at));
        let global = || self.global.get(name).and_then(|&at| self.globals.get(at)).filter(|_| !self.in_phrase);
        local.or_else(global).map(|binding| binding.span)
    }

    /// Gives a name in this block. A `let` of the main script that is never used gets a warning.
    pub(super) fn bind(&mut self, name: Name<'s>, value: Quantity, kind: Kind) {
        let watched = kind == Kind::Let && self.main;
        let binding = Binding { name: name.text, value, span: name.span, used: false, watched, kind };
        if self.top {
            self.global.insert(name.text, self.globals.len());
            self.globals.push(binding);
            self.visible = self.globals.len();
        } else {
            self.push_local(binding);
        }
    }

    fn push_local(&mut self, binding: Binding<'s>) {
        self.local.entry(binding.name).or_default().push(self.locals.len());
        self.locals.push(binding);
    }

    /// Adds a phrase. It sees the names and phrases above it.
    pub(super) fn define(&mut self, def: &Arc<Def<'s>>, parameters: HashMap<&'s str, usize>) -> usize {
        let above = self.phrases.len();
        let (globals, watched) = (self.globals.len(), self.main);
        let parameters = Arc::new(parameters);
        self.phrases.push(Phrase { def: Arc::clone(def), parameters, globals, above, used: false, watched });
        self.by_name.insert(def.name.text, above);
        self.visible_phrases = self.phrases.len();
        above
    }

    /// The phrase with this name, if it can be seen from here.
    pub(super) fn phrase(&mut self, name: &str) -> Option<Phrase<'s>> {
        let at = self.phrase_number(name)?;
        let phrase = self.phrases.get_mut(at)?;
        phrase.used = true;
        Some(phrase.clone())
    }

    /// The number of the phrase with this name, if it can be seen from here.
    pub(super) fn phrase_number(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied().filter(|&at| at < self.visible_phrases)
    }

    /// Whether this is the body of a phrase.
    pub(super) fn in_phrase(&self) -> bool {
        self.in_phrase
    }

    /// Whether names go to the top level now.
    pub(super) fn is_top(&self) -> bool {
        self.top
    }

    /// The names of the phrases that can be seen, in the order of letters.
    pub(super) fn phrase_names(&self) -> impl Iterator<Item = &'s str> {
        self.by_name.iter().filter(|(_, at)| **at < self.visible_phrases).map(|(name, _)| *name)
    }

    /// The name that is meant by `word`, of values or of phrases. Of a script with very many names and mistakes, only the first
    /// mistakes are compared with them all.
    pub(super) fn near(&mut self, word: &str, phrases: bool) -> Option<&'s str> {
        const MOST: usize = 500_000;
        let count = if phrases { self.visible_phrases } else { self.locals.len() + self.globals.len() };
        self.compared = self.compared.saturating_add(count);
        if self.compared > MOST {
            return None;
        }
        if phrases { suggest(word, self.phrase_names()) } else { suggest(word, self.names().chain(["true", "false"])) }
    }

    /// How many names of blocks there are now.
    pub(super) fn locals(&self) -> usize {
        self.locals.len()
    }

    /// Begins a block.
    pub(super) fn open(&mut self) -> Mark {
        let mark = Mark { block: self.block, locals: self.locals.len(), top: self.top };
        self.block = self.locals.len();
        self.top = false;
        mark
    }

    /// Ends a block: its names are forgotten, but marks are only local to a pass or a call (`forget_marks`).
    pub(super) fn close(&mut self, mark: Mark, forget_marks: bool) {
        let ended = self.locals.split_off(mark.locals);
        for binding in &ended {
            // Each goes with the newest of its name.
            self.local.get_mut(binding.name).and_then(SmallVec::pop);
        }
        for binding in ended.iter().filter(|binding| binding.watched) {
            let (_, used) = self.ended.entry(binding.span).or_insert((binding.name, false));
            *used |= binding.used;
        }
        self.block = mark.block;
        self.top = mark.top;
        let marks = ended.into_iter().filter(|binding| !forget_marks && binding.kind == Kind::Mark);
        if self.top {
            for mark in marks {
                self.global.insert(mark.name, self.globals.len());
                self.globals.push(mark);
            }
            self.visible = self.globals.len();
        } else {
            marks.for_each(|mark| self.push_local(mark));
        }
    }

    /// Begins the body of a phrase: it knows only the names above it, never the caller's.
    pub(super) fn enter(&mut self, phrase: &Phrase<'s>) -> Frame {
        let mark = self.open();
        let frame = Frame {
            mark,
            floor: self.floor,
            in_phrase: self.in_phrase,
            globals: self.visible,
            phrases: self.visible_phrases,
            main: self.main,
        };
        self.in_phrase = true;
        self.main = phrase.watched;
        self.floor = self.locals.len();
        self.visible = phrase.globals;
        self.visible_phrases = phrase.above;
        frame
    }

    /// Ends the body of a phrase.
    pub(super) fn leave(&mut self, frame: Frame) {
        self.close(frame.mark, true);
        self.floor = frame.floor;
        self.in_phrase = frame.in_phrase;
        self.visible = frame.globals;
        self.visible_phrases = frame.phrases;
        self.main = frame.main;
    }

    /// Names of the main script that nothing has used.
    pub(super) fn unused(&self) -> Vec<(&'s str, Span)> {
        let values = self.globals.iter().filter(|binding| binding.watched && !binding.used);
        let phrases = self.phrases.iter().filter(|phrase| phrase.watched && !phrase.used);
        let ended = self.ended.iter().filter(|(_, (_, used))| !used).map(|(span, (name, _))| (*name, *span));
        values
            .map(|binding| (binding.name, binding.span))
            .chain(ended)
            .chain(phrases.map(|phrase| (phrase.def.name.text, phrase.def.name.span)))
            .collect()
    }
}

/// Every name that a block uses, whether it is run or not.
pub(super) fn names<'s>(block: &Block<'s>, found: &mut dyn FnMut(&'s str)) {
    block.visit(&mut |line| {
        match &line.start {
            Some(Start::After(value)) => names_of(value, found),
            Some(Start::At(moment)) => {
                match &moment.origin {
                    Origin::Value(value) => names_of(value, found),
                    Origin::Bar(count) => {
                        names_of(&count.0, found);
                        count.1.iter().for_each(|beat| names_of(beat, found));
                    }
                }
                moment.offsets.iter().for_each(|(_, value)| names_of(value, found));
            }
            None => {}
        }
        for statement in line.statements() {
            match statement {
                Statement::Block(_) => {}
                Statement::Let(each) => names_in(&each.value, found),
                Statement::Def(def) => names_of_def(def, found),
                Statement::Call(call) => {
                    found(call.name.text);
                    call.arguments.iter().for_each(|given| names_in(&given.value, found));
                }
                Statement::If(each) => each.arms.iter().for_each(|(condition, _)| names_in(condition, found)),
                Statement::Command(command) => {
                    for argument in &command.arguments {
                        match &argument.item {
                            Item::One(value) => names_of(value, found),
                            Item::Arrow(ends) | Item::Range(ends) => {
                                names_of(&ends.0, found);
                                names_of(&ends.1, found);
                            }
                            Item::List(list) => list.iter().for_each(|value| names_of(value, found)),
                            Item::Comparison(_) => {}
                        }
                    }
                }
            }
        }
    });
}

/// Every name that a `def` uses, in its body and as a default.
pub(super) fn names_of_def<'s>(def: &Def<'s>, found: &mut dyn FnMut(&'s str)) {
    let defaults = def.parameters.iter().filter_map(|parameter| parameter.default.as_ref());
    defaults.for_each(|default| names_in(default, found));
    names(&def.body, found);
}

fn names_of<'s>(value: &Value<'s>, found: &mut dyn FnMut(&'s str)) {
    match &value.kind {
        ValueKind::Word(word) => found(word),
        ValueKind::Expression(expression) => names_in(expression, found),
        // The names that a `say` puts in.
        ValueKind::Text(text) => template::names(text).for_each(found),
        ValueKind::Number(..) => {}
    }
}

/// Every name in an expression.
pub(super) fn names_in<'s>(expression: &Expression<'s>, found: &mut dyn FnMut(&'s str)) {
    for node in &expression.nodes {
        if let NodeKind::Name(name) = node.kind {
            found(name);
        }
    }
}
