//! The default picture of a family: a lane for each value that can move, one for each switch, and
//! one for all other commands.

use super::Text;
use super::table::{Activity, Board, Lane, LaneKind, Limited, Picture, Sets, Shown, ValueForm, Verb};
use super::{Command, VerbId};

/// What a lane shows.
#[derive(PartialEq)]
enum LaneSource {
    /// A value of a verb: the verb, its index, and the position of the value.
    Value(VerbId, Option<i32>, usize),
    /// A verb whose only value is on or off.
    Switch(VerbId),
    Rest,
}

impl Board {
    /// The lanes of the board and how commands appear in them.
    pub fn picture(&self) -> Picture {
        let derived = || Picture { lanes: lanes(self).map(|of| lane(self, &of)).collect(), draw };
        self.picture.clone().unwrap_or_else(derived)
    }
}

fn lanes(board: &Board) -> impl Iterator<Item = LaneSource> {
    board.verbs().flat_map(|(id, verb)| of_verb(id, verb)).chain([LaneSource::Rest])
}

fn of_verb(id: VerbId, verb: &Verb) -> Vec<LaneSource> {
    if is_switch(verb) {
        return vec![LaneSource::Switch(id)];
    }
    if !verb.moves || matches!(verb.sets, Sets::Parts(..)) {
        return Vec::new();
    }
    let indices = verb.indices().map_or_else(|| vec![None], |indices| indices.map(Some).collect());
    let axes = 0..verb.moving().len();
    indices.into_iter().flat_map(|index| axes.clone().map(move |axis| LaneSource::Value(id, index, axis))).collect()
}

/// Whether a verb switches something on and off.
fn is_switch(verb: &Verb) -> bool {
    verb.activity == Activity::Unless0
        && matches!(verb.axes.as_slice(), [axis] if matches!(axis.takes, ValueForm::Word(_)))
}

fn lane(board: &Board, of: &LaneSource) -> Lane {
    let word = |id: &VerbId| board.verb(*id).map(|verb| verb.word.clone()).unwrap_or_default();
    match of {
        LaneSource::Rest => {
            Lane { name: "other".into(), about: Text::default(), kind: LaneKind::Ticks { is_motion: false } }
        }
        LaneSource::Switch(id) => {
            let kind = LaneKind::Spans { text: "on".into(), is_strong: true };
            Lane { name: word(id), about: Text::default(), kind }
        }
        LaneSource::Value(id, index, axis) => {
            let limited = Limited { verb: *id, index: *index, axis: Some(*axis) };
            let row = board.axis(limited);
            let resource = board.occupied(*id, *index).first().and_then(|resource| board.resource(*resource));
            let kind = LaneKind::Curve {
                unit: row.map_or("", |axis| axis.unit.symbol()).into(),
                ends: Default::default(),
                range: row.map(|axis| axis.range).unwrap_or_default(),
                limited: vec![limited, Limited { axis: None, ..limited }],
                group: None,
                shows_rest: false,
            };
            let about = resource.map(|resource| resource.about.clone()).unwrap_or_default();
            Lane { name: board.limited_name(limited).into(), about, kind }
        }
    }
}

fn draw(board: &Board, command: &Command) -> Vec<(usize, Shown)> {
    let mut shown = Vec::new();
    let mut parts = Vec::new();
    board.each_part(command, |_, part| parts.push(part.clone()));
    for (lane, of) in lanes(board).enumerate() {
        if of == LaneSource::Rest && shown.is_empty() {
            shown.push((lane, Shown::Tick));
        }
        for part in &parts {
            match of {
                LaneSource::Switch(id) if id == part.verb() => shown.push((lane, Shown::Switch(!part.is_zero()))),
                LaneSource::Value(id, index, axis)
                    if id == part.verb() && (index.is_none() || part.value(0) == index) =>
                {
                    let value = part.value(axis + usize::from(index.is_some()));
                    shown.push((lane, Shown::Value(value.map(f64::from))));
                }
                _ => {}
            }
        }
    }
    shown
}
