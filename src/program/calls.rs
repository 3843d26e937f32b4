//! Which `def`s call each other.

use std::collections::HashMap;
use std::sync::Arc;

use crate::syntax::{Block, Def, Name, Statement};

/// How many names a message shows of a circle of calls.
const SHOWN: usize = 8;
/// How many calls are followed in search of circles. Only a file of tens of thousands of mistaken `def`s has more.
const MAX_FOLLOWED: usize = 20_000_000;

/// Every phrase that a block calls, at any depth.
pub(super) fn calls_of<'s>(block: &Block<'s>) -> Vec<Name<'s>> {
    let mut found = Vec::new();
    block.visit(&mut |line| {
        found.extend(line.statements().filter_map(|statement| match statement {
            Statement::Call(call) => Some(call.name),
            _ => None,
        }));
    });
    found
}

/// The `def`s of a file, and the calls between them.
pub(super) struct Calls<'f, 's> {
    defs: &'f [Arc<Def<'s>>],
    /// The place of each name among the `def`s.
    places: HashMap<&'s str, usize>,
    /// The `def`s that each one calls.
    callees: Vec<Vec<usize>>,
    /// The last search that reached each `def`, and the `def` that it came from.
    reached: Vec<(usize, usize)>,
    searches: usize,
    followed: usize,
}

impl<'f, 's> Calls<'f, 's> {
    pub(super) fn of(defs: &'f [Arc<Def<'s>>]) -> Self {
        let places: HashMap<_, _> = defs.iter().enumerate().map(|(at, def)| (def.name.text, at)).collect();
        let to = |call: &Name<'s>| places.get(call.text).copied();
        let calls = defs.iter().map(|def| calls_of(&def.body).iter().filter_map(to).collect()).collect();
        Calls { defs, places, callees: calls, reached: vec![(0, 0); defs.len()], searches: 0, followed: 0 }
    }

    /// The `def` with this name.
    pub(super) fn def(&self, name: &str) -> Option<&'f Def<'s>> {
        self.places.get(name).and_then(|at| self.defs.get(*at)).map(|def| &**def)
    }

    /// The shortest circle of calls from `def` over `next` back to `def`, in words.
    pub(super) fn circle(&mut self, def: &str, next: &str) -> Option<String> {
        let (end, first) = (*self.places.get(def)?, *self.places.get(next)?);
        self.searches += 1;
        *self.reached.get_mut(first)? = (self.searches, end);
        let mut queue = vec![first];
        let mut done = 0;
        while let Some(at) = queue.get(done).copied().filter(|at| *at != end) {
            done += 1;
            for &to in self.callees.get(at)? {
                self.followed += 1;
                let reached = self.reached.get_mut(to).filter(|_| self.followed <= MAX_FOLLOWED)?;
                if reached.0 != self.searches {
                    *reached = (self.searches, at);
                    queue.push(to);
                }
            }
        }
        queue.get(done)?;
        let mut path = vec![def];
        let mut at = end;
        while path.len() == 1 || at != end {
            at = self.reached.get(at)?.1;
            path.push(self.defs.get(at)?.name.text);
        }
        path.reverse();
        if path.len() > SHOWN {
            path.splice(SHOWN / 2..path.len() - SHOWN / 2, ["…"]);
        }
        Some(path.join(" → "))
    }
}
