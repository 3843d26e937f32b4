//! What a script that is being written has written so far.

use std::fmt::Write as _;
use std::sync::Arc;

use super::curve::{Axes, MoveLimits};
use crate::board::{Activity, Board, Command, MAX_MOVING, ResourceId, Sets, VerbId};
use crate::units::Micros;

/// What the script has written so far.
#[derive(Clone, Debug)]
pub(super) struct ScriptState {
    pub(super) board: Arc<Board>,
    /// Of each resource, what it was last.
    last: Vec<Option<LastCommand>>,
    /// Of each resource that must be refreshed, when it was refreshed last, if it is active.
    refreshed: Vec<Option<Micros>>,
    /// A frame that is not interpreted is in the script, so that it ends with everything brought to rest.
    pub(super) has_raw: bool,
}

/// What a resource was last.
#[derive(Clone, Debug)]
struct LastCommand {
    /// In the words of the verb that sets it alone.
    command: Command,
    by: Channel,
    /// When the line that says it is due, and when it repeated_at last, perhaps again.
    written: Micros,
    repeated_at: Micros,
}

impl LastCommand {
    /// From when on a move of this channel may begin here. Its own repeats are looked at, those of another command are not.
    fn since(&self, channel: Channel) -> Micros {
        if self.by == channel { self.written } else { self.repeated_at }
    }
}

/// What a command sets: a verb, and the value of its index if it has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Channel {
    verb: VerbId,
    index: Option<i32>,
}

impl ScriptState {
    pub(super) fn new(board: Arc<Board>) -> Self {
        let count = board.resources.len();
        ScriptState { board, last: vec![None; count], refreshed: vec![None; count], has_raw: false }
    }

    fn last(&self, resource: ResourceId) -> Option<&LastCommand> {
        self.last.get(resource)?.as_ref()
    }

    /// What a resource was last.
    pub(super) fn command(&self, resource: ResourceId) -> Option<&Command> {
        self.last(resource).map(|last| &last.command)
    }

    /// The value of a channel, and from when on a move may begin there.
    pub(super) fn value(&self, channel: Channel) -> Option<(Micros, Axes)> {
        let board = Arc::clone(&self.board);
        let is_several = matches!(board.verb(channel.verb)?.sets, Sets::Parts(..));
        let resources = channel.resources(&board);
        let (mut since, mut axes) = (Micros::ZERO, Axes::default());
        for (at, resource) in resources.iter().enumerate() {
            let last = self.last(*resource)?;
            since = since.max(last.since(channel));
            if is_several {
                *axes.get_mut(at)? = *last.command.values().last()?;
            } else if last.command.verb() == channel.verb {
                axes = Channel::of(&board, &last.command)?.1;
            } else if !(last.command.is_zero() && board.is_rest(&last.command)) {
                // Behind the command that brings its resource to rest, every value is 0.
                return None;
            }
        }
        (!resources.is_empty()).then_some((since, axes))
    }

    /// Whether a value says nothing new. What stays active at zero is new behind another command, also at zero.
    pub(super) fn repeats(&self, channel: Channel, axes: Axes) -> bool {
        let last = |resource: &ResourceId| self.last(*resource).is_some_and(|last| last.by == channel);
        let is_new = channel.is_always_active(&self.board) && !channel.resources(&self.board).iter().all(last);
        !is_new && self.value(channel).is_some_and(|(_, written)| written == axes)
    }

    /// Takes in a command that is interpreted. What says nothing new is no line.
    pub(super) fn set(&mut self, at: Micros, command: &Command) {
        let board = Arc::clone(&self.board);
        let (by, repeats) = match Channel::of(&board, command) {
            Some((channel, axes)) => (channel, self.repeats(channel, axes)),
            None => (Channel { verb: command.verb(), index: None }, false),
        };
        board.each_part(command, |resource, part| {
            if let Some(refreshed) = self.refreshed.get_mut(resource).filter(|_| board.needs_refresh(resource)) {
                *refreshed = board.is_active(command).then_some(at);
            }
            if let Some(last) = self.last.get_mut(resource) {
                *last = match last.take() {
                    Some(old) if repeats => Some(LastCommand { repeated_at: at, ..old }),
                    _ => Some(LastCommand { command: part.clone(), by, written: at, repeated_at: at }),
                };
            }
        });
    }

    /// What is not interpreted may have changed anything, but it is state whether it is for a resource that must be refreshed.
    pub(super) fn raw(&mut self, raw: &Command) {
        self.has_raw = true;
        let board = Arc::clone(&self.board);
        for (resource, found) in board.resources.iter().enumerate() {
            if found.is_exclusive && !found.needs_refresh {
                self.forget(resource);
            }
        }
        board.touches(raw).iter().for_each(|resource| self.forget(*resource));
    }

    /// Nobody knows a resource any more.
    pub(super) fn forget(&mut self, resource: ResourceId) {
        if let Some(last) = self.last.get_mut(resource) {
            *last = None;
        }
        self.stop_refreshing(resource);
    }

    /// The resources that are active and must be refreshed, when each was refreshed last, and the command that stops it.
    pub(super) fn refreshed(&self) -> Vec<(ResourceId, Micros, Command)> {
        let refreshed = self.refreshed.iter().enumerate();
        refreshed.filter_map(|(resource, refreshed)| Some((resource, (*refreshed)?, self.board.rest(resource)?.clone()))).collect()
    }

    /// What was refreshed until now is not refreshed any more.
    pub(super) fn stop_refreshing(&mut self, resource: ResourceId) {
        if let Some(refreshed) = self.refreshed.get_mut(resource) {
            *refreshed = None;
        }
    }
}

impl Channel {
    /// What a command moves, and where to.
    pub(super) fn of(board: &Board, command: &Command) -> Option<(Channel, Axes)> {
        let verb = board.verb(command.verb()).filter(|verb| verb.moves)?;
        let offset = usize::from(verb.is_indexed());
        let mut axes = Axes::default();
        for (at, place) in axes.iter_mut().enumerate().take(verb.moving().len().min(MAX_MOVING)) {
            *place = command.value(at + offset)?;
        }
        Some((Channel { verb: command.verb(), index: command.value(0).filter(|_| verb.is_indexed()) }, axes))
    }

    /// What it sets.
    fn resources(self, board: &Board) -> &[ResourceId] {
        board.occupied(self.verb, self.index)
    }

    fn is_always_active(self, board: &Board) -> bool {
        board.verb(self.verb).is_some_and(|verb| verb.activity == Activity::Always)
    }

    /// What it may be given; beyond a default limit only where the script widens that.
    pub(super) fn move_limits(self, board: &Board, is_wide: bool) -> MoveLimits {
        let mut limits = MoveLimits { ranges: [(0, 0); MAX_MOVING], tolerance: 0, saves_frames: false };
        let Some(verb) = board.verb(self.verb) else { return limits };
        limits.tolerance = verb.tolerance;
        for (at, (range, axis)) in limits.ranges.iter_mut().zip(verb.moving()).enumerate() {
            let is_of_it = |limit: &&crate::board::DefaultLimit| {
                let limited = limit.limited;
                (limited.verb, limited.index) == (self.verb, self.index) && limited.axis.is_none_or(|axis| axis == at)
            };
            let default = board.limits.iter().find(is_of_it).filter(|_| !is_wide);
            *range = default.map_or(axis.range, |limit| limit.range);
        }
        limits
    }

    /// Whether both are moved by the same motors.
    pub(super) fn meets(self, board: &Board, other: Channel) -> bool {
        let others = other.resources(board);
        self == other || self.resources(board).iter().any(|resource| others.contains(resource))
    }

    /// The command that moves it from one value to another; `written` is the value that the script has given it before.
    pub(super) fn moved(self, board: &Board, written: Option<Axes>, from: Axes, to: Axes) -> String {
        let Some(verb) = board.verb(self.verb) else { return String::new() };
        let mut text = verb.word.to_string();
        if let Some(index) = self.index {
            let _ = write!(text, " {index}");
        }
        for (at, axis) in verb.moving().iter().enumerate() {
            let of = |axes: Axes| axes.get(at).copied().unwrap_or_default();
            let name = if axis.name.is_empty() { String::new() } else { format!("{}=", axis.name) };
            let is_said = written.is_some_and(|written| of(written) == of(from));
            let start = if is_said { String::new() } else { format!("{} -> ", of(from)) };
            let _ = write!(text, " {name}{start}{}", of(to));
        }
        text
    }
}
