//! Which `def`s call each other.

use std::collections::HashMap;
use std::sync::Arc;

use crate::syntax::{Block, Def, Name, Statement};

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

/// Numbers the circles of calls (Kosaraju's algorithm): along the calls, each `def` is listed behind all that it reaches; against
/// them, from the last one listed on, it reaches exactly those of its circle.
pub(super) fn circles<'s>(defs: &[Arc<Def<'s>>]) -> HashMap<&'s str, usize> {
    let places: HashMap<&str, usize> = defs.iter().enumerate().map(|(at, def)| (def.name.text, at)).collect();
    let mut calls = vec![Vec::new(); defs.len()];
    let mut callers = vec![Vec::new(); defs.len()];
    for (at, def) in defs.iter().enumerate() {
        for to in calls_of(&def.body).iter().filter_map(|call| places.get(call.text).copied()) {
            if let (Some(calls), Some(callers)) = (calls.get_mut(at), callers.get_mut(to)) {
                calls.push(to);
                callers.push(at);
            }
        }
    }
    let mut seen = vec![false; defs.len()];
    let mut listed = Vec::new();
    for at in 0..defs.len() {
        reach(at, &calls, &mut seen, &mut listed);
    }
    let mut seen = vec![false; defs.len()];
    let mut circles = HashMap::new();
    for (number, at) in listed.into_iter().rev().enumerate() {
        let mut circle = Vec::new();
        reach(at, &callers, &mut seen, &mut circle);
        circles.extend(circle.into_iter().filter_map(|at| Some((defs.get(at)?.name.text, number))));
    }
    circles
}

/// Lists what can be reached from a place and was not seen before, each behind all that it reaches.
fn reach(from: usize, ways: &[Vec<usize>], seen: &mut [bool], listed: &mut Vec<usize>) {
    // What is on the way, with how many of its ways were gone.
    let mut path = Vec::new();
    let mut next = Some(from);
    loop {
        if let Some(at) = next.take()
            && let Some(seen @ false) = seen.get_mut(at)
        {
            *seen = true;
            path.push((at, 0));
        }
        let Some((at, gone)) = path.last_mut() else { return };
        next = ways.get(*at).and_then(|ways| ways.get(*gone)).copied();
        *gone += 1;
        if next.is_none() {
            listed.push(*at);
            path.pop();
        }
    }
}
