//! The default picture of a family: a lane for each value of its commands, and one for all commands
//! without such a value.

use super::Text;
use super::table::{Board, Lane, LaneKind, Limited, Picture, Shown};
use super::verb::{Axis, ResourceId, Sets, ValueForm, Verb};
use super::{Command, VerbId};

impl Board {
    /// The lanes of the board and how commands appear in them.
    pub fn picture(&self) -> Picture {
        self.picture.clone().unwrap_or_else(|| Picture { lanes: lanes(self), draw })
    }
}

/// The lanes: for each verb and each of its resources, one per value.
fn lanes(board: &Board) -> Vec<Lane> {
    let mut lanes = Vec::new();
    for (id, verb) in board.verbs() {
        for (place, resource) in resources(verb).iter().enumerate() {
            let index = verb.indices().and_then(|mut indices| indices.nth(place));
            let about = board.resource(*resource).map(|resource| resource.about.clone()).unwrap_or_default();
            lanes.extend(values(verb).map(|(at, axis)| lane(board, (id, index, at), axis, &about)));
        }
    }
    lanes.push(Lane { name: "other".into(), about: Text::default(), kind: LaneKind::Ticks { is_motion: false } });
    lanes
}

/// The resources whose lanes show a verb; none, if its values do not stay.
fn resources(verb: &Verb) -> &[ResourceId] {
    match &verb.sets {
        _ if verb.forgets || !verb.is_in_scripts() || verb.axes.iter().any(|axis| axis.count() != 1) => &[],
        Sets::One(resource) => std::slice::from_ref(resource),
        Sets::Indexed(resources) => resources,
        _ => &[],
    }
}

/// The values of a verb that have a lane, with their positions after the index.
fn values(verb: &Verb) -> impl Iterator<Item = (usize, &Axis)> {
    let has_lane = |axis: &Axis| match &axis.takes {
        ValueForm::Number => true,
        ValueForm::Word(words) => words.len() > 1,
        _ => false,
    };
    verb.moving().iter().enumerate().filter(move |(_, axis)| has_lane(axis))
}

/// The number of lanes of a verb.
fn count(verb: &Verb) -> usize {
    resources(verb).len() * values(verb).count()
}

/// The place of a resource among those of a verb. They are usually consecutive.
fn place(verb: &Verb, resource: ResourceId) -> Option<usize> {
    let all = resources(verb);
    let guess = resource.checked_sub(*all.first()?);
    let guess = guess.filter(|place| all.get(*place) == Some(&resource));
    guess.or_else(|| all.iter().position(|other| *other == resource))
}

/// Whether a value is a switch, with the words `on` and `off`.
fn is_switch(words: &[(Text, i32)]) -> bool {
    words.iter().all(|(word, _)| word == "on" || word == "off")
}

fn lane(board: &Board, (verb, index, at): (VerbId, Option<i32>, usize), axis: &Axis, about: &Text) -> Lane {
    let limited = Limited { verb, index, axis: Some(at) };
    let kind = match &axis.takes {
        ValueForm::Word(words) if is_switch(words) => LaneKind::Spans { text: "on".into(), is_strong: true },
        ValueForm::Word(_) => LaneKind::Spans { text: Text::default(), is_strong: false },
        _ => LaneKind::Curve {
            unit: axis.unit.symbol().into(),
            ends: Default::default(),
            range: (axis.shown(axis.range.0), axis.shown(axis.range.1)),
            limited: vec![limited, Limited { axis: None, ..limited }],
            group: None,
            shows_rest: false,
        },
    };
    let is_alone = board.verb(verb).is_some_and(|verb| verb.moving().len() == 1);
    // `arm 40` sets a height: neither its word nor a unit says that.
    let says_more = matches!(&kind, LaneKind::Curve { unit, .. } if unit.is_empty()) && about.is_empty() && is_alone;
    let about = if says_more { axis.key.clone() } else { about.clone() };
    Lane { name: board.limited_name(limited).into(), about, kind }
}

fn draw(board: &Board, command: &Command) -> Vec<(usize, Shown)> {
    let mut shown = Vec::new();
    let Some(verb) = board.verb(command.verb()) else { return shown };
    // What a script cannot send is a greeting of the board.
    let mut is_visible = !verb.is_in_scripts();
    let mut set = |resource: ResourceId, part: Option<&Command>| {
        let mut first = 0;
        for (id, verb) in board.verbs() {
            if let Some(place) = place(verb, resource) {
                let lanes = first + place * values(verb).count()..;
                for (lane, (at, axis)) in lanes.zip(values(verb)) {
                    let at = at + usize::from(verb.is_indexed());
                    let change = change(board, resource, part, (id, at, axis));
                    is_visible |= part.is_some_and(|part| part.verb() == id) || change == Shown::Rest;
                    shown.push((lane, change));
                }
            }
            first += count(verb);
        }
    };
    if verb.forgets || board.is_opaque(command) {
        board.touches(command).iter().for_each(|resource| set(*resource, None));
    } else {
        board.each_part(command, |resource, part| set(resource, Some(part)));
    }
    if !is_visible {
        shown.push((board.verbs.iter().map(count).sum(), Shown::Tick));
    }
    shown
}

/// What a command for a resource changes in the lane of a value, which may be one of another verb.
/// Without a command, the value becomes unknown.
fn change(board: &Board, resource: ResourceId, part: Option<&Command>, of: (VerbId, usize, &Axis)) -> Shown {
    let (verb, at, axis) = of;
    let value = part.filter(|part| part.verb() == verb).and_then(|part| part.value(at));
    if let ValueForm::Word(words) = &axis.takes {
        let word = words.iter().find(|(word, of)| Some(*of) == value && word != "off").map(|(word, _)| word);
        return if is_switch(words) { Shown::Switch(word.is_some()) } else { Shown::Word(word.cloned()) };
    }
    let is_rest = part.is_some_and(|part| part.is_zero() && board.rest(resource) == Some(part));
    match value {
        None if is_rest && (axis.range.0..=axis.range.1).contains(&0) => Shown::Rest,
        _ => Shown::Value(value.map(|value| axis.shown(value))),
    }
}
