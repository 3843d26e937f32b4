//! What a script that is being written has said so far.

use std::fmt::Write as _;
use std::sync::Arc;

use super::curve::{Axes, MoveLimits};
use crate::board::{Activity, Board, Command, MAX_MOVING, ResourceId, Sets, VerbId};
use crate::units::Micros;

/// What the script has said so far.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub(super) board: Arc<Board>,
    /// Of each resource, what it was told.
    told: Vec<Option<Told>>,
    /// Of each resource that must be fed, when it was fed last, if it is active.
    fed: Vec<Option<Micros>>,
    /// A frame that is not interpreted is in the script, so that it ends with everything brought to rest.
    pub(super) has_raw: bool,
}

/// What a resource was told.
#[derive(Clone, Debug)]
struct Told {
    /// In the words of the verb that sets it alone.
    command: Command,
    by: Thing,
    /// When the line that says it is due, and when it came last, perhaps again.
    said: Micros,
    came: Micros,
}

impl Told {
    /// From when on a move of this thing may begin here. Its own repeats are looked at, those of another command are not.
    fn since(&self, thing: Thing) -> Micros {
        if self.by == thing { self.said } else { self.came }
    }
}

/// What a command sets: a verb, and the value of its index if it has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Thing {
    verb: VerbId,
    index: Option<i32>,
}

impl Known {
    pub(super) fn new(board: Arc<Board>) -> Self {
        let count = board.resources.len();
        Known { board, told: vec![None; count], fed: vec![None; count], has_raw: false }
    }

    fn told(&self, resource: ResourceId) -> Option<&Told> {
        self.told.get(resource)?.as_ref()
    }

    /// What a resource was told.
    pub(super) fn command(&self, resource: ResourceId) -> Option<&Command> {
        self.told(resource).map(|told| &told.command)
    }

    /// The value of a thing, and from when on a move may begin there.
    pub(super) fn value(&self, thing: Thing) -> Option<(Micros, Axes)> {
        let board = Arc::clone(&self.board);
        let is_several = matches!(board.verb(thing.verb)?.sets, Sets::Parts(..));
        let resources = thing.resources(&board);
        let (mut since, mut axes) = (Micros::ZERO, Axes::default());
        for (at, resource) in resources.iter().enumerate() {
            let told = self.told(*resource)?;
            since = since.max(told.since(thing));
            if is_several {
                *axes.get_mut(at)? = *told.command.values().last()?;
            } else if told.command.verb() == thing.verb {
                axes = Thing::of(&board, &told.command)?.1;
            } else if !(told.command.is_zero() && board.is_rest(&told.command)) {
                // Behind the command that brings its resource to rest, every value is 0.
                return None;
            }
        }
        (!resources.is_empty()).then_some((since, axes))
    }

    /// Whether a value says nothing new. What stays active at zero is new behind another command, also at zero.
    pub(super) fn repeats(&self, thing: Thing, axes: Axes) -> bool {
        let told = |resource: &ResourceId| self.told(*resource).is_some_and(|told| told.by == thing);
        let is_new = thing.is_always_active(&self.board) && !thing.resources(&self.board).iter().all(told);
        !is_new && self.value(thing).is_some_and(|(_, said)| said == axes)
    }

    /// Takes in a command that is interpreted. What says nothing new is no line.
    pub(super) fn set(&mut self, at: Micros, command: &Command) {
        let board = Arc::clone(&self.board);
        let (by, repeats) = match Thing::of(&board, command) {
            Some((thing, axes)) => (thing, self.repeats(thing, axes)),
            None => (Thing { verb: command.verb(), index: None }, false),
        };
        board.each_part(command, |resource, part| {
            if let Some(fed) = self.fed.get_mut(resource).filter(|_| board.is_fed(resource)) {
                *fed = board.is_active(command).then_some(at);
            }
            if let Some(told) = self.told.get_mut(resource) {
                *told = match told.take() {
                    Some(old) if repeats => Some(Told { came: at, ..old }),
                    _ => Some(Told { command: part.clone(), by, said: at, came: at }),
                };
            }
        });
    }

    /// What is not interpreted may have changed anything, but it is known whether it is for a resource that must be fed.
    pub(super) fn raw(&mut self, raw: &Command) {
        self.has_raw = true;
        let board = Arc::clone(&self.board);
        for (resource, found) in board.resources.iter().enumerate() {
            if found.is_exclusive && !found.is_fed {
                self.forget(resource);
            }
        }
        board.touches(raw).iter().for_each(|resource| self.forget(*resource));
    }

    /// Nobody knows a resource any more.
    pub(super) fn forget(&mut self, resource: ResourceId) {
        if let Some(told) = self.told.get_mut(resource) {
            *told = None;
        }
        self.starve(resource);
    }

    /// The resources that are active and must be fed, when each was fed last, and the command that stops it.
    pub(super) fn fed(&self) -> Vec<(ResourceId, Micros, Command)> {
        let fed = self.fed.iter().enumerate();
        fed.filter_map(|(resource, fed)| Some((resource, (*fed)?, self.board.rest(resource)?.clone()))).collect()
    }

    /// What was fed until now is not fed any more.
    pub(super) fn starve(&mut self, resource: ResourceId) {
        if let Some(fed) = self.fed.get_mut(resource) {
            *fed = None;
        }
    }
}

impl Thing {
    /// What a command moves, and where to.
    pub(super) fn of(board: &Board, command: &Command) -> Option<(Thing, Axes)> {
        let verb = board.verb(command.verb()).filter(|verb| verb.moves)?;
        let offset = usize::from(verb.is_indexed());
        let mut axes = Axes::default();
        for (at, place) in axes.iter_mut().enumerate().take(verb.moving().len().min(MAX_MOVING)) {
            *place = command.value(at + offset)?;
        }
        Some((Thing { verb: command.verb(), index: command.value(0).filter(|_| verb.is_indexed()) }, axes))
    }

    /// What it sets.
    fn resources(self, board: &Board) -> &[ResourceId] {
        board.occupied(self.verb, self.index)
    }

    fn is_always_active(self, board: &Board) -> bool {
        board.verb(self.verb).is_some_and(|verb| verb.activity == Activity::Always)
    }

    /// What it may be given; beyond a proper limit only where the script widens that.
    pub(super) fn move_limits(self, board: &Board, is_wide: bool) -> MoveLimits {
        let mut limits = MoveLimits { ranges: [(0, 0); MAX_MOVING], tolerance: 0, saves_frames: false };
        let Some(verb) = board.verb(self.verb) else { return limits };
        limits.tolerance = verb.tolerance;
        for (at, (range, axis)) in limits.ranges.iter_mut().zip(verb.moving()).enumerate() {
            let is_of_it = |limit: &&crate::board::ProperLimit| {
                let limited = limit.limited;
                (limited.verb, limited.index) == (self.verb, self.index) && limited.axis.is_none_or(|axis| axis == at)
            };
            let proper = board.limits.iter().find(is_of_it).filter(|_| !is_wide);
            *range = proper.map_or(axis.range, |limit| limit.range);
        }
        limits
    }

    /// Whether both are moved by the same motors.
    pub(super) fn meets(self, board: &Board, other: Thing) -> bool {
        let others = other.resources(board);
        self == other || self.resources(board).iter().any(|resource| others.contains(resource))
    }

    /// The command that moves it from one value to another; `said` is the value that the script has given it before.
    pub(super) fn moved(self, board: &Board, said: Option<Axes>, from: Axes, to: Axes) -> String {
        let Some(verb) = board.verb(self.verb) else { return String::new() };
        let mut text = verb.word.to_string();
        if let Some(index) = self.index {
            let _ = write!(text, " {index}");
        }
        for (at, axis) in verb.moving().iter().enumerate() {
            let of = |axes: Axes| axes.get(at).copied().unwrap_or_default();
            let name = if axis.name.is_empty() { String::new() } else { format!("{}=", axis.name) };
            let is_said = said.is_some_and(|said| of(said) == of(from));
            let start = if is_said { String::new() } else { format!("{} -> ", of(from)) };
            let _ = write!(text, " {name}{start}{}", of(to));
        }
        text
    }
}
