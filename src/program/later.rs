//! What stands further down in a file: only messages need it.

use std::collections::HashMap;
use std::sync::Arc;

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

    fn whole(&mut self) -> &Whole<'s> {
        let source = self.source;
        self.whole.get_or_insert_with(|| Whole::read(source))
    }
}

impl<'s> Whole<'s> {
    fn read(source: &'s Source) -> Self {
        let Some(tree) = syntax::parse(source, &mut Diagnostics::default()) else { return Whole::default() };
        let parts = tree.body.lines.into_iter().flat_map(|line| line.parts);
        let defs = parts.filter_map(|part| match part.statement {
            Statement::Def(def) => Some((def.name.text, def)),
            _ => None,
        });
        Whole { defs: defs.collect(), lost: tree.lost }
    }
}
