//! The state that a script has set so far while it is being written.

use std::fmt::Write as _;
use std::sync::Arc;

use super::curve::{Axes, MoveLimits};
use crate::board::{Activity, Board, Command, MAX_MOVING, ResourceId, Sets, VerbId};
use crate::units::Micros;

/// The state that the script has set so far.
#[derive(Clone, Debug)]
pub(super) struct ScriptState {
    pub(super) board: Arc<Board>,
    /// The last command of each resource.
    last: Vec<Option<LastCommand>>,
    /// For each active resource that must be refreshed, the time of its last frame.
    refreshed: Vec<Option<Micros>>,
    /// Whether the script contains a frame that is not interpreted, so that it ends by bringing
    /// everything to rest.
    pub(super) has_raw: bool,
    /// When the program last closed its port.
    pub(super) closed: Option<Micros>,
    /// The longest silence of an active resource that the script mentions.
    pub(super) longest_silence: Micros,
}

/// The last command of a resource.
#[derive(Clone, Debug)]
struct LastCommand {
    /// As the verb that sets only this resource.
    command: Command,
    by: Channel,
    /// The time of the line that sets it, and of its last frame, which may repeat it.
    written: Micros,
    repeated_at: Micros,
}

impl LastCommand {
    /// The earliest start of a move of this channel. A move may replace the channel's own repeats,
    /// but not those of another one.
    fn since(&self, channel: Channel) -> Micros {
        if self.by == channel { self.written } else { self.repeated_at }
    }
}

/// A verb, and the value of its index if it has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Channel {
    verb: VerbId,
    index: Option<i32>,
}

impl ScriptState {
    pub(super) fn new(board: Arc<Board>) -> Self {
        let count = board.resources.len();
        let (last, refreshed) = (vec![None; count], vec![None; count]);
        ScriptState { board, last, refreshed, has_raw: false, closed: None, longest_silence: Micros::ZERO }
    }

    fn last(&self, resource: ResourceId) -> Option<&LastCommand> {
        self.last.get(resource)?.as_ref()
    }

    /// The last command of a resource.
    pub(super) fn command(&self, resource: ResourceId) -> Option<&Command> {
        self.last(resource).map(|last| &last.command)
    }

    /// The value of a channel, and the earliest time when a move may start there.
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
                // After the command that brings the resource to rest, every value is 0.
                return None;
            }
        }
        (!resources.is_empty()).then_some((since, axes))
    }

    /// Whether a value changes nothing. For a verb that stays active at zero, every value after
    /// another verb is a change.
    pub(super) fn repeats(&self, channel: Channel, axes: Axes) -> bool {
        let last = |resource: &ResourceId| self.last(*resource).is_some_and(|last| last.by == channel);
        let is_new = channel.is_always_active(&self.board) && !channel.resources(&self.board).iter().all(last);
        !is_new && self.value(channel).is_some_and(|(_, written)| written == axes)
    }

    /// Applies a command that is interpreted. A command that changes nothing needs no line.
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

    /// A raw frame may have changed anything, but whether it concerns a resource that must be
    /// refreshed is known.
    pub(super) fn raw(&mut self, raw: &Command) {
        self.has_raw = true;
        let board = Arc::clone(&self.board);
        for (resource, found) in board.resources.iter().enumerate() {
            if found.is_exclusive && found.refresh.is_none() {
                self.forget(resource);
            }
        }
        board.touches(raw).iter().for_each(|resource| self.forget(*resource));
    }

    /// Makes the state of a resource unknown.
    pub(super) fn forget(&mut self, resource: ResourceId) {
        if let Some(last) = self.last.get_mut(resource) {
            *last = None;
        }
        self.stop_refreshing(resource);
    }

    /// The active resources that must be refreshed, the times of their last frames, and the
    /// commands that stop them.
    pub(super) fn refreshed(&self) -> Vec<(ResourceId, Micros, Command)> {
        let refreshed = self.refreshed.iter().enumerate();
        refreshed
            .filter_map(|(resource, refreshed)| Some((resource, (*refreshed)?, self.board.rest(resource)?.clone())))
            .collect()
    }

    /// Ends the refreshes of a resource.
    pub(super) fn stop_refreshing(&mut self, resource: ResourceId) {
        if let Some(refreshed) = self.refreshed.get_mut(resource) {
            *refreshed = None;
        }
    }
}

impl Channel {
    /// The channel that a command moves, and its target.
    pub(super) fn of(board: &Board, command: &Command) -> Option<(Channel, Axes)> {
        let verb = board.verb(command.verb()).filter(|verb| verb.moves)?;
        let offset = usize::from(verb.is_indexed());
        let mut axes = Axes::default();
        for (at, place) in axes.iter_mut().enumerate().take(verb.moving().len().min(MAX_MOVING)) {
            *place = command.value(at + offset)?;
        }
        Some((Channel { verb: command.verb(), index: command.value(0).filter(|_| verb.is_indexed()) }, axes))
    }

    /// The resources of the channel.
    pub(super) fn resources(self, board: &Board) -> &[ResourceId] {
        board.occupied(self.verb, self.index)
    }

    fn is_always_active(self, board: &Board) -> bool {
        board.verb(self.verb).is_some_and(|verb| verb.activity == Activity::Always)
    }

    /// The ranges of the channel. A default limit applies unless the script widens it, as `wide` says for each.
    pub(super) fn move_limits(self, board: &Board, wide: &[bool]) -> MoveLimits {
        let mut limits = MoveLimits { ranges: [(0, 0); MAX_MOVING], tolerance: 0, saves_frames: false };
        let Some(verb) = board.verb(self.verb) else { return limits };
        limits.tolerance = verb.tolerance;
        for (at, (range, axis)) in limits.ranges.iter_mut().zip(verb.moving()).enumerate() {
            let is_of_it = |limit: &&crate::board::DefaultLimit| {
                let limited = limit.limited;
                (limited.verb, limited.index) == (self.verb, self.index) && limited.axis.is_none_or(|axis| axis == at)
            };
            let default =
                board.limits.iter().zip(wide).find(|(limit, _)| is_of_it(limit)).filter(|(_, is_wide)| !**is_wide);
            *range = default.map_or(axis.range, |(limit, _)| limit.range);
        }
        limits
    }

    /// Whether both channels share a resource.
    pub(super) fn meets(self, board: &Board, other: Channel) -> bool {
        let others = other.resources(board);
        self == other || self.resources(board).iter().any(|resource| others.contains(resource))
    }

    /// The command that moves the channel from one value to another. `written` is the value that
    /// the script has set before.
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
            // A value without a name cannot be omitted.
            if is_said && !name.is_empty() && of(from) == 0 && of(to) == 0 {
                continue;
            }
            let start = if is_said { String::new() } else { format!("{} -> ", axis.shown(of(from))) };
            let _ = write!(text, " {name}{start}{}", axis.shown(of(to)));
        }
        text
    }
}
