//! What stands further down in a file: only messages need it.

use std::collections::HashMap;
use std::sync::Arc;

use super::calls::circles;
use crate::diagnostic::Diagnostics;
use crate::source::Source;
use crate::syntax::{self, Def, Lost, Statement};

/// The whole of a file that is run line by line. It is read when the first message needs it.
pub(super) struct Later<'s> {
    source: &'s Source,
    whole: Option<Whole<'s>>,
}

#[derive(Default)]
struct Whole<'s> {
    /// The `def`s at its top level, wherever they stand.
    defs: HashMap<&'s str, Arc<Def<'s>>>,
    /// The circle of calls that each `def` is in: two in one circle call each other, on whatever way.
    circles: HashMap<&'s str, usize>,
    lost: Lost<'s>,
}

impl<'s> Later<'s> {
    pub(super) fn new(source: &'s Source) -> Self {
        Later { source, whole: None }
    }

    /// The `def` with this name.
    pub(super) fn get(&mut self, name: &str) -> Option<Arc<Def<'s>>> {
        self.whole().defs.get(name).cloned()
    }

    /// Whether this name may have been lost with what cannot be read.
    pub(super) fn may_have_lost(&mut self, name: &str) -> bool {
        self.whole().lost.may_hold(name)
    }

    /// Whether two `def`s end up calling each other.
    pub(super) fn call_each_other(&mut self, one: &str, other: &str) -> bool {
        let circles = &self.whole().circles;
        circles.get(one).is_some_and(|circle| circles.get(other) == Some(circle))
    }

    fn whole(&mut self) -> &Whole<'s> {
        let source = self.source;
        self.whole.get_or_insert_with(|| Whole::read(source))
    }
}

impl<'s> Whole<'s> {
    fn read(source: &'s Source) -> Self {
        let Some(tree) = syntax::parse(source, &mut Diagnostics::default()) else { return Whole::default() };
        let mut defs: Vec<Arc<Def<'s>>> = Vec::new();
        for line in tree.body.lines() {
            defs.extend(line.statements().filter_map(|statement| match statement {
                Statement::Def(def) => Some(Arc::clone(def)),
                _ => None,
            }));
        }
        let circles = circles(&defs);
        Whole { defs: defs.into_iter().map(|def| (def.name.text, def)).collect(), circles, lost: tree.lost }
    }
}
