//! Commands for every part that a script uses: each becomes one command per part.

use std::collections::BTreeSet;

use super::{Action, Program, Step};
use crate::board::{self, Board, VerbId};
use crate::diagnostic::{Diagnostics, diagnostic};

/// Replaces each command for every part by one command for each part that the script uses, in the order of their numbers.
pub(super) fn expand(program: &mut Program, most: usize, diagnostics: &mut Diagnostics) {
    let board = &*program.board;
    if board.verbs.iter().all(|verb| verb.each.is_none()) {
        return;
    }
    let abort = program.abort.as_ref().map(|abort| abort.steps.as_slice()).unwrap_or_default();
    let used: BTreeSet<i32> = program.steps.iter().chain(abort).filter_map(|step| used(board, &step.action)).collect();
    let traces = &program.traces;
    let abort = program.abort.as_mut().map(|abort| &mut abort.steps);
    for steps in [Some(&mut program.steps), abort].into_iter().flatten() {
        let count = steps.iter().filter(|step| each(board, &step.action).is_some()).count();
        let Some(first) = steps.iter().find(|step| each(board, &step.action).is_some()) else { continue };
        let found = if used.is_empty() {
            diagnostic!(InvalidArgument, first.span, "this is for every servo that the script uses, and the script uses none";
                help: "write the number of a servo in place of `all`")
        } else if count.saturating_mul(used.len()) > most {
            diagnostic!(TooManyEvents, first.span, "the script sends more than {most} frames";
                help: "shorten it, or allow more with `--max-events`")
        } else {
            *steps = std::mem::take(steps).into_iter().flat_map(|step| expanded(board, step, &used)).collect();
            continue;
        };
        diagnostics.push(traces.attach(found, first.trace));
    }
}

/// The part that an action uses.
fn used(board: &Board, action: &Action) -> Option<i32> {
    let (verb, index) = match action {
        Action::Send(command) => (command.verb(), command.value(0)),
        Action::Hold(held) => (held.0.verb(), held.0.value(0)),
        Action::Go(going) => (going.motion.verb, going.motion.index),
        Action::Say(_) | Action::Expect(_) | Action::Gate(_) => return None,
    };
    index.filter(|_| board.verb(verb).is_some_and(board::Verb::is_indexed))
}

/// The verb that an action is replaced by, and its value.
fn each(board: &Board, action: &Action) -> Option<(VerbId, i32)> {
    let Action::Send(command) = action else { return None };
    Some((board.verb(command.verb())?.each?, command.value(1)?))
}

fn expanded(board: &Board, step: Step, used: &BTreeSet<i32>) -> Vec<Step> {
    let Some((verb, value)) = each(board, &step.action) else { return vec![step] };
    let send = |index: &i32| Action::Send(board::Command::new(verb, &[*index, value]));
    used.iter().map(|index| Step { action: send(index), ..step.clone() }).collect()
}
