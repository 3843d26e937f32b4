//! What a robot does, lane by lane.

use super::{Lane, Moment, Shows, Stretch};
use crate::board::{Board, Command, LaneKind, Limited, Shown};
use crate::program::Limit;
use crate::timeline::Timeline;
use crate::units::Micros;

/// What a lane shows, as it comes.
enum Course {
    /// Values that stay until the next one.
    Curve(Vec<(Micros, Option<f64>)>),
    Spans(Vec<Stretch>, bool),
    Ticks(Vec<Moment>),
}

impl Course {
    fn take(&mut self, at: Micros, shown: &Shown, said: impl Fn() -> String) {
        match (self, shown) {
            (Course::Curve(points), Shown::Value(value)) => match points.last_mut() {
                Some((_, last)) if last == value => {}
                None if value.is_none() => {}
                // What is replaced at the same moment stays: it was sent.
                _ => points.push((at, *value)),
            },
            (Course::Spans(spans, is_on), Shown::Switch(on)) => match (std::mem::replace(is_on, *on), on) {
                (false, true) => spans.push(Stretch { at, until: at, text: said() }),
                (true, false) => {
                    if let Some(last) = spans.last_mut() {
                        last.until = at;
                    }
                }
                _ => {}
            },
            (Course::Ticks(ticks), _) => ticks.push(Moment { at, text: said() }),
            _ => {}
        }
    }

    fn is_flat(&self) -> bool {
        match self {
            Course::Curve(points) => points.iter().all(|(_, value)| value.is_none_or(|value| value == 0.0)),
            Course::Spans(spans, _) => spans.is_empty(),
            Course::Ticks(ticks) => ticks.is_empty(),
        }
    }

    fn is_empty(&self) -> bool {
        if let Course::Curve(points) = self { points.is_empty() } else { self.is_flat() }
    }
}

/// The lanes of what is used.
pub(super) fn lanes(timeline: &Timeline) -> Vec<Lane> {
    let board = &timeline.board;
    let picture = board.picture();
    let course = |lane: &crate::board::Lane| match lane.kind {
        LaneKind::Curve { .. } => Course::Curve(Vec::new()),
        LaneKind::Spans { .. } => Course::Spans(Vec::new(), false),
        LaneKind::Ticks { .. } => Course::Ticks(Vec::new()),
    };
    let mut courses: Vec<Course> = picture.lanes.iter().map(course).collect();
    for event in &timeline.events {
        for (lane, shown) in (picture.draw)(board, &event.command) {
            if let (Some(course), Some(lane)) = (courses.get_mut(lane), picture.lanes.get(lane)) {
                course.take(event.at, &shown, || said(board, lane, &event.command));
            }
        }
    }
    for course in &mut courses {
        if let Course::Spans(spans, true) = course
            && let Some(last) = spans.last_mut()
        {
            last.until = timeline.end.max(last.at);
        }
    }
    let is_used = used(&picture.lanes, &courses);
    let lanes = picture.lanes.iter().zip(courses).zip(is_used).filter(|(_, is_used)| *is_used);
    lanes.map(|((lane, course), _)| finished(lane, course, timeline)).collect()
}

/// What is said of a stretch or a moment.
fn said(board: &Board, lane: &crate::board::Lane, command: &Command) -> String {
    match &lane.kind {
        LaneKind::Spans { text, .. } => text.to_string(),
        _ => board.show(command).to_string(),
    }
}

/// Which lanes are shown: those of a group together, where any of them is not zero all the time.
fn used(lanes: &[crate::board::Lane], courses: &[Course]) -> Vec<bool> {
    let group = |lane: &crate::board::Lane| match lane.kind {
        LaneKind::Curve { group, .. } => group,
        _ => None,
    };
    let moving: Vec<u8> =
        lanes.iter().zip(courses).filter(|(_, course)| !course.is_flat()).filter_map(|(lane, _)| group(lane)).collect();
    // What stands is not worth a lane, but a robot that was told to stand is worth one.
    let is_told = lanes.iter().zip(courses).any(|(lane, course)| group(lane).is_some() && !course.is_empty());
    let happens = |(lane, course): (&crate::board::Lane, &Course)| {
        matches!(lane.kind, LaneKind::Ticks { is_motion: true }) && !course.is_empty()
    };
    let stands = is_told && moving.is_empty() && !lanes.iter().zip(courses).any(happens);
    let is_used = |(lane, course): (&crate::board::Lane, &Course)| match lane.kind {
        LaneKind::Curve { group: Some(group), shows_rest, .. } => moving.contains(&group) || stands && shows_rest,
        _ => !course.is_empty(),
    };
    lanes.iter().zip(courses).map(is_used).collect()
}

fn finished(lane: &crate::board::Lane, course: Course, timeline: &Timeline) -> Lane {
    let shows = match (course, &lane.kind) {
        (Course::Curve(points), LaneKind::Curve { unit, ends, range, limited, .. }) => {
            let limits = &timeline.limits;
            let limit = limits.iter().find(|limit| limit.span.is_some() && limited.contains(&limit.limited));
            let limits = limit.map(|limit| [limit.low, limit.high]);
            let range = proper_range(timeline, limited, *range);
            Shows::Curve { unit: unit.clone(), ends: ends.clone(), range, limits, points }
        }
        (Course::Spans(spans, _), kind) => {
            Shows::Spans { spans, is_strong: matches!(kind, LaneKind::Spans { is_strong: true, .. }) }
        }
        (Course::Ticks(ticks), _) => Shows::Ticks { ticks },
        (Course::Curve(_), _) => Shows::Ticks { ticks: Vec::new() },
    };
    Lane { name: lane.name.clone(), about: lane.about.clone(), shows }
}

/// The range of what is limited where a script sets no limit, unless it widens that.
fn proper_range(timeline: &Timeline, limited: &[Limited], range: (i32, i32)) -> [f64; 2] {
    let [low, high] = [f64::from(range.0), f64::from(range.1)];
    let proper = limited.iter().find_map(|limited| timeline.board.proper_limit(*limited));
    let Some(proper) = proper else { return [low, high] };
    let (least, most) = (f64::from(proper.range.0), f64::from(proper.range.1));
    let of_it = |limit: &&Limit| limit.limited == proper.limited;
    let is_wider = |limit: &Limit| (limit.low < least, limit.high > most);
    let (is_lower, is_higher) = timeline.limits.iter().find(of_it).map(is_wider).unwrap_or_default();
    [if is_lower { low } else { least }, if is_higher { high } else { most }]
}
