//! What a timeline uses of a board that reports the positions of its servos, and what it must ask for.

use std::collections::BTreeSet;

use super::Timeline;
use crate::board::{ServoSet, Verb, VerbId};

impl Timeline {
    /// The servos that the script sends commands to.
    pub fn servos(&self) -> ServoSet {
        let Some(feedback) = &self.board.feedback else { return ServoSet::default() };
        // Without a preparation, only positions matter.
        let is_one = |verb: VerbId| {
            verb == feedback.verb
                || feedback.preparation.is_some() && self.board.verb(verb).is_some_and(Verb::is_indexed)
        };
        let commands = self.events.iter().chain(&self.abort).map(|event| &event.command);
        commands.filter(|command| is_one(command.verb())).filter_map(|command| command.value(0)).collect()
    }

    /// The rows of the quantities that the board reports only if it is asked, and that expectations,
    /// gates and `say` lines need.
    pub fn asked(&self) -> BTreeSet<usize> {
        let expects = self.expects.iter().map(|expect| expect.expect.criterion.measured.row());
        let gates = self.gates.iter().filter_map(|gate| Some(gate.gate.criterion()?.measured.row()));
        let cues = self.cues.iter().flat_map(|cue| cue.text.rows());
        let is_asked = |row: &usize| self.board.quantities.get(*row).is_some_and(|found| found.request.is_some());
        expects.chain(gates).chain(cues).filter(is_asked).collect()
    }
}
