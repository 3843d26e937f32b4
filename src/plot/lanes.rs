//! Collects what a robot does, lane by lane.

use super::{Lane, Moment, Shows, Stretch};
use crate::board::{Board, Command, LaneKind, Limited, Shown};
use crate::diagnostic::escaped;
use crate::program::Limit;
use crate::timeline::Timeline;
use crate::units::Micros;

/// The data of a lane while it is collected.
enum LaneData {
    /// Values, each of which stays until the next one.
    Curve(Vec<(Micros, Option<f64>)>),
    Spans(Vec<Stretch>, bool),
    Ticks(Vec<Moment>),
}

impl LaneData {
    fn take(&mut self, at: Micros, shown: &Shown, said: impl Fn() -> String) {
        match (self, shown) {
            (LaneData::Curve(points), Shown::Value(_) | Shown::Rest) => {
                let value = if let Shown::Value(value) = shown { *value } else { Some(0.0) };
                match points.last() {
                    Some((_, last)) if *last == value => {}
                    None if value.is_none() || *shown == Shown::Rest => {}
                    // Keep a value that is replaced at the same moment: it was sent.
                    _ => points.push((at, value)),
                }
            }
            (LaneData::Spans(spans, is_on), Shown::Switch(on)) => change(spans, is_on, at, on.then(said)),
            (LaneData::Spans(spans, is_on), Shown::Word(word)) => {
                change(spans, is_on, at, word.as_ref().map(|word| escaped(word)));
            }
            (LaneData::Ticks(ticks), _) => ticks.push(Moment { at, text: said() }),
            _ => {}
        }
    }

    fn is_flat(&self) -> bool {
        match self {
            LaneData::Curve(points) => points.iter().all(|(_, value)| value.is_none_or(|value| value == 0.0)),
            LaneData::Spans(spans, _) => spans.is_empty(),
            LaneData::Ticks(ticks) => ticks.is_empty(),
        }
    }

    fn is_empty(&self) -> bool {
        if let LaneData::Curve(points) = self { points.is_empty() } else { self.is_flat() }
    }
}

/// Ends the last span if it is on, and begins one with this text, unless they are the same.
fn change(spans: &mut Vec<Stretch>, is_on: &mut bool, at: Micros, text: Option<String>) {
    let last = spans.last_mut().filter(|_| *is_on);
    if last.as_ref().map(|last| &last.text) == text.as_ref() {
        return;
    }
    if let Some(last) = last {
        last.until = at;
    }
    *is_on = text.is_some();
    spans.extend(text.map(|text| Stretch { at, until: at, text }));
}

/// The lanes that a timeline uses.
pub(super) fn lanes(timeline: &Timeline) -> Vec<Lane> {
    let board = &timeline.board;
    let picture = board.picture();
    let lane_data = |lane: &crate::board::Lane| match lane.kind {
        LaneKind::Curve { .. } => LaneData::Curve(Vec::new()),
        LaneKind::Spans { .. } => LaneData::Spans(Vec::new(), false),
        LaneKind::Ticks { .. } => LaneData::Ticks(Vec::new()),
    };
    let mut data: Vec<LaneData> = picture.lanes.iter().map(lane_data).collect();
    for event in &timeline.events {
        for (lane, shown) in (picture.draw)(board, &event.command) {
            if let (Some(lane_data), Some(lane)) = (data.get_mut(lane), picture.lanes.get(lane)) {
                lane_data.take(event.at, &shown, || said(board, lane, &event.command));
            }
        }
    }
    for lane_data in &mut data {
        if let LaneData::Spans(spans, true) = lane_data
            && let Some(last) = spans.last_mut()
        {
            last.until = timeline.end.max(last.at);
        }
    }
    let is_used = used(&picture.lanes, &data);
    let lanes = picture.lanes.iter().zip(data).zip(is_used).filter(|(_, is_used)| *is_used);
    lanes.map(|((lane, lane_data), _)| finished(lane, lane_data, timeline)).collect()
}

/// The tooltip of a span or a moment.
fn said(board: &Board, lane: &crate::board::Lane, command: &Command) -> String {
    match &lane.kind {
        LaneKind::Spans { text, .. } => text.to_string(),
        _ => board.show(command).to_string(),
    }
}

/// Which lanes are shown. A group is shown if any of its lanes is not always zero.
fn used(lanes: &[crate::board::Lane], data: &[LaneData]) -> Vec<bool> {
    let group = |lane: &crate::board::Lane| match lane.kind {
        LaneKind::Curve { group, .. } => group,
        _ => None,
    };
    let moving: Vec<u8> = lanes
        .iter()
        .zip(data)
        .filter(|(_, lane_data)| !lane_data.is_flat())
        .filter_map(|(lane, _)| group(lane))
        .collect();
    // Lanes that are always zero are hidden, unless stopping is all that the script does.
    let is_commanded = lanes.iter().zip(data).any(|(lane, lane_data)| group(lane).is_some() && !lane_data.is_empty());
    let happens = |(lane, lane_data): (&crate::board::Lane, &LaneData)| {
        matches!(lane.kind, LaneKind::Ticks { is_motion: true }) && !lane_data.is_empty()
    };
    let is_only_stopped = is_commanded && moving.is_empty() && !lanes.iter().zip(data).any(happens);
    let is_used = |(lane, lane_data): (&crate::board::Lane, &LaneData)| match lane.kind {
        LaneKind::Curve { group: Some(group), shows_rest, .. } => {
            moving.contains(&group) || is_only_stopped && shows_rest
        }
        _ => !lane_data.is_empty(),
    };
    lanes.iter().zip(data).map(is_used).collect()
}

fn finished(lane: &crate::board::Lane, lane_data: LaneData, timeline: &Timeline) -> Lane {
    let shows = match (lane_data, &lane.kind) {
        (LaneData::Curve(points), LaneKind::Curve { unit, ends, range, limited, .. }) => {
            let limits = &timeline.limits;
            let limit = limits.iter().find(|limit| limit.span.is_some() && limited.contains(&limit.limited));
            let scale = |limited| f64::from(timeline.board.axis(limited).map_or(1, |axis| axis.scale));
            let limits = limit.map(|limit| [limit.low, limit.high].map(|value| value / scale(limit.limited)));
            let range = default_range(timeline, limited, *range);
            let verb = limited.first().and_then(|limited| timeline.board.verb(limited.verb));
            let is_position = range[0] >= 0.0 || verb.is_some_and(|verb| verb.moves && !verb.holds);
            Shows::Curve { unit: unit.clone(), ends: ends.clone(), range, limits, points, is_position }
        }
        (LaneData::Spans(spans, _), kind) => {
            let (is_strong, has_words) = match kind {
                LaneKind::Spans { text, is_strong } => (*is_strong, text.is_empty()),
                _ => (false, false),
            };
            Shows::Spans { spans, is_strong, has_words }
        }
        (LaneData::Ticks(ticks), _) => Shows::Ticks { ticks },
        (LaneData::Curve(_), _) => Shows::Ticks { ticks: Vec::new() },
    };
    Lane { name: lane.name.clone(), about: lane.about.clone(), shows }
}

/// The range with default limits, unless the script widens it.
fn default_range(timeline: &Timeline, limited: &[Limited], (low, high): (f64, f64)) -> [f64; 2] {
    let default = limited.iter().find_map(|limited| timeline.board.default_limit(*limited));
    let Some(default) = default else { return [low, high] };
    let of_it = |limit: &&Limit| limit.limited == default.limited;
    let is_wider = |limit: &Limit| (limit.low < f64::from(default.range.0), limit.high > f64::from(default.range.1));
    let (is_lower, is_higher) = timeline.limits.iter().find(of_it).map(is_wider).unwrap_or_default();
    let Some(axis) = timeline.board.axis(default.limited) else { return [low, high] };
    let (least, most) = (axis.shown(default.range.0), axis.shown(default.range.1));
    [if is_lower { low } else { least }, if is_higher { high } else { most }]
}
