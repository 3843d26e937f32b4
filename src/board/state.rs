//! The last command that each resource of a board received.

use smallvec::SmallVec;

use super::command::{Command, MAX_MOVING, VerbId};
use super::servo_set::ServoSet;
use super::table::{Board, Resource};
use super::verb::{Axis, Part, ResourceId, Sets};

/// The last command of each resource, as the verb that sets only this resource. A frame that is not
/// interpreted makes its resource unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct State {
    last: Vec<LastCommand>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct LastCommand {
    command: Option<Command>,
    /// Whether the last frame for the resource was not understood.
    is_unclear: bool,
}

impl State {
    /// The state of a board that has received nothing. Later changes do not allocate.
    pub fn new(board: &Board) -> Self {
        State { last: vec![LastCommand::default(); board.resources.len()] }
    }

    /// Applies one command.
    pub fn apply(&mut self, board: &Board, command: &Command) {
        let verb = board.verb(command.verb());
        if verb.is_some_and(|verb| !verb.is_in_scripts()) {
            let in_script = board.codec.in_script(board, command);
            if !in_script.is_empty() {
                for command in &in_script {
                    self.apply(board, command);
                }
                return;
            }
        }
        if board.is_opaque(command) {
            for resource in board.touches(command) {
                self.set(board, *resource, LastCommand { command: None, is_unclear: true });
            }
            return;
        }
        if verb.is_some_and(|verb| verb.forgets) {
            for resource in board.occupies(command) {
                self.set(board, *resource, LastCommand::default());
            }
            return;
        }
        board.each_part(command, |resource, part| {
            self.set(board, resource, LastCommand { command: Some(part.clone()), is_unclear: false });
        });
    }

    fn set(&mut self, board: &Board, resource: ResourceId, last: LastCommand) {
        if self.last.is_empty() {
            self.last.resize(board.resources.len(), LastCommand::default());
        }
        if let Some(place) = self.last.get_mut(resource) {
            *place = last;
        }
    }

    /// The last command of a resource; `None` if there was none or it is unknown.
    pub fn last(&self, resource: ResourceId) -> Option<&Command> {
        self.last.get(resource)?.command.as_ref()
    }

    /// Whether a command would change nothing: it sets each of its resources to the value that the
    /// resource has.
    pub fn has(&self, board: &Board, command: &Command) -> bool {
        let mut has_all = !board.occupies(command).is_empty();
        board.each_part(command, |resource, part| has_all &= self.last(resource) == Some(part));
        has_all
    }

    /// The commands that bring a board to this state, in the order of its resources: first those
    /// without a rest command, then the active ones. Resources that are at rest, or come to rest by
    /// themselves, are left out.
    pub fn commands<'s>(&'s self, board: &'s Board) -> impl Iterator<Item = &'s Command> {
        let last = board.resources.iter().zip(&self.last).filter(|(resource, _)| resource.rest.is_none());
        let still = last.filter_map(|(_, last)| last.command.as_ref()).filter(|command| !board.is_active(command));
        still.chain(self.active(board).map(|(_, command)| command))
    }

    /// The active resources with their rest commands, the last resource first. If `is_unknown`,
    /// because a frame was sent that is not understood, all resources with a rest command.
    pub fn closing<'b>(
        &self,
        board: &'b Board,
        is_unknown: bool,
    ) -> impl Iterator<Item = (ResourceId, &'b Resource, &'b Command)> {
        let is_active = |resource| self.last(resource).is_some_and(|last| board.is_active(last));
        let all = board.resources.iter().enumerate().rev();
        let all = all.filter_map(|(id, resource)| Some((id, resource, resource.rest.as_ref()?)));
        all.filter(move |(id, ..)| is_unknown || is_active(*id))
    }

    /// The active resources with their last commands.
    pub fn active<'s>(&'s self, board: &'s Board) -> impl Iterator<Item = (ResourceId, &'s Command)> {
        let last = self.last.iter().enumerate();
        let last = last.filter_map(|(resource, last)| Some((resource, last.command.as_ref()?)));
        last.filter(|(_, command)| board.is_active(command))
    }

    /// The resources that are active, or unknown after a frame that is not understood.
    pub fn restless<'b>(&self, board: &'b Board) -> impl Iterator<Item = &'b Resource> {
        let is_active = |last: &LastCommand| last.command.as_ref().is_some_and(|command| board.is_active(command));
        let last = board.resources.iter().zip(&self.last).filter(|(resource, _)| resource.rest.is_some());
        last.filter(move |(_, last)| last.is_unclear || is_active(last)).map(|(resource, _)| resource)
    }

    /// Whether a resource that moves the robot is active, or unknown.
    pub fn drives(&self, board: &Board) -> bool {
        self.restless(board).any(|resource| resource.drives)
    }

    /// Whether the board is at rest, even if it interprets invalid frames in an unexpected way: the
    /// last frame of each resource with a rest command is understood and leaves it at rest.
    pub fn surely_at_rest(&self, board: &Board) -> bool {
        let last = || board.resources.iter().zip(&self.last).filter(|(resource, _)| resource.rest.is_some());
        let passes = |last: &LastCommand| last.command.as_ref().is_some_and(|command| board.is_passing(command));
        self.at_rest(board) && !last().any(|(_, last)| last.is_unclear || passes(last))
    }

    /// The servos that a stop of the board holds, because a target was their last command.
    pub fn held(&self, board: &Board) -> ServoSet {
        let verb = board.feedback.as_ref().filter(|feedback| feedback.holds.is_some()).map(|feedback| feedback.verb);
        let last = self.last.iter().filter_map(|last| last.command.as_ref());
        last.filter(|last| Some(last.verb()) == verb).filter_map(|last| last.value(0)).collect()
    }

    /// Whether no resource is active: nothing moves, nothing sounds.
    pub fn at_rest(&self, board: &Board) -> bool {
        self.active(board).next().is_none()
    }

    /// The known values of a verb: those of its last command, or 0 after the command that brings
    /// its resource to rest.
    pub fn values(&self, board: &Board, verb: VerbId, index: Option<i32>) -> SmallVec<[Option<i32>; MAX_MOVING]> {
        let Some(row) = board.verb(verb) else { return SmallVec::new() };
        if let Sets::Parts(parts, _) = &row.sets {
            let value = |part: &Part| self.values(board, part.verb, Some(part.index)).first().copied().flatten();
            return parts.iter().map(value).collect();
        }
        let resource = board.occupied(verb, index).first().copied();
        let last = resource.and_then(|resource| self.last(resource));
        let known = last.filter(|last| last.verb() == verb);
        let is_at_rest = last.is_some_and(|last| last.is_zero() && board.is_rest(last));
        let offset = usize::from(row.is_indexed());
        let at_rest = |axis: &Axis| Some(0).filter(|rest| is_at_rest && (axis.range.0..=axis.range.1).contains(rest));
        let value = |(at, axis)| known.map_or_else(|| at_rest(axis), |last| last.value(at + offset));
        row.moving().iter().enumerate().map(value).collect()
    }
}
