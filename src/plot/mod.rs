//! Draws what the robots of a script do: what happens when, in lanes over time, and their paths.
//!
//! [`plot`] collects the data, which other programs can draw as well; [`Plot::to_svg`] draws it.

mod canvas;
mod labels;
mod lanes;
mod path;
#[cfg(feature = "png")]
mod png;
mod svg;

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::board::Text;
use crate::diagnostic::{Diagnostic, Diagnostics, escaped};
use crate::program::Awaited;
use crate::sim::Pose;
use crate::source::{Lines, Sources, Span};
use crate::timeline::wire::{self, Wire};
use crate::timeline::{Expectation, Gate, Timeline};
use crate::units::Micros;

#[cfg(feature = "png")]
pub use png::{PngError, png};
pub use svg::Theme;

/// The number of equal intervals in which the load of the line is measured.
const PIECES: u32 = 720;

/// The data of a picture. Times count from the start of the script, and those with a suffix `_us`
/// are in microseconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plot {
    /// The name of the script.
    pub script: String,
    /// The end of the script.
    #[serde(rename = "end_us")]
    pub end: Micros,
    /// The bars of the script, if it counts in bars.
    pub bars: Option<Bars>,
    /// The marks.
    pub marks: Vec<Moment>,
    /// The texts of `say`.
    pub says: Vec<Moment>,
    /// The `expect`s.
    pub expects: Vec<Stretch>,
    /// The gates, at which the clock of the script stops.
    pub gates: Vec<Moment>,
    /// The warnings of `check`, each at the first frame of its command.
    pub warnings: Vec<Warning>,
    /// The robots.
    pub tracks: Vec<Robot>,
}

/// A grid of equal bars.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bars {
    /// The start of bar 1 in microseconds; negative for a clip that starts later.
    pub first_us: i64,
    /// The length of a beat in microseconds.
    pub beat_us: f64,
    /// Beats in a bar.
    pub beats: u32,
}

impl Bars {
    /// The length of a bar in microseconds.
    fn bar_us(&self) -> f64 {
        self.beat_us * f64::from(self.beats)
    }

    /// The start of bar 1 in microseconds.
    #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
    fn begin(&self) -> f64 {
        self.first_us as f64
    }
}

/// An event at a moment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Moment {
    /// The time.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// The text.
    pub text: String,
}

/// An event with a duration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Stretch {
    /// The start.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// The end.
    #[serde(rename = "until_us")]
    pub until: Micros,
    /// The text.
    pub text: String,
}

/// A warning.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// The time of its command; `None` if the command sends nothing in this clip.
    #[serde(rename = "t_us")]
    pub at: Option<Micros>,
    /// Its code.
    pub code: &'static str,
    /// The message.
    pub message: String,
    /// The name of the file.
    pub file: String,
    /// The line, counted from 1.
    pub line: usize,
}

/// The data of one robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Robot {
    /// Its name; `None` where the script names no robots.
    pub robot: Option<String>,
    /// The number of its frames.
    pub frames: usize,
    /// Its lanes; unused ones are left out.
    pub lanes: Vec<Lane>,
    /// The load of its line.
    pub wire: Load,
    /// The path of the virtual board in nominal units; empty if it does not move.
    pub path: Vec<Place>,
}

/// One value or state over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lane {
    /// Its name.
    pub name: Text,
    /// Its place on the robot, or its purpose; empty if the name says it.
    pub about: Text,
    /// Its data.
    #[serde(flatten)]
    pub shows: Shows,
}

/// The data of a lane.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Shows {
    /// A value that stays until the next one.
    Curve {
        /// Its unit.
        unit: Text,
        /// The labels of values below and above zero, or of the smallest and the largest.
        ends: [Text; 2],
        /// The smallest and the largest value that the board takes.
        range: [f64; 2],
        /// The range that the script sets with `limit`, if it does.
        limits: Option<[f64; 2]>,
        /// Times and values; `null` where the value is unknown.
        points: Vec<(Micros, Option<f64>)>,
        /// Whether it is a position, which is drawn on the scale of its range. Other values are
        /// drawn as distances from zero.
        #[serde(skip)]
        is_position: bool,
    },
    /// A state that is on or off.
    Spans {
        /// The times when it is on.
        spans: Vec<Stretch>,
        /// Whether it is drawn as prominently as a command.
        #[serde(skip)]
        is_strong: bool,
        /// Whether the texts are words of the script, which are drawn in the spans.
        #[serde(skip)]
        has_words: bool,
    },
    /// Moments.
    Ticks {
        /// The moments.
        ticks: Vec<Moment>,
    },
}

/// The load of the line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Load {
    /// Its speed in bits per second.
    pub baud: u32,
    /// The length of an interval in microseconds.
    pub piece_us: f64,
    /// The share of the capacity that is used in each interval, in percent.
    pub percent: Vec<f64>,
    /// Frames that leave more than 5 ms late.
    pub late: Vec<Late>,
}

/// A frame that leaves late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Late {
    /// When it is due.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// Its delay.
    #[serde(rename = "late_us")]
    pub late: Micros,
}

/// A pose of the robot, relative to its start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// The time.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// To the right, in cm.
    pub x_cm: f64,
    /// Forward, in cm.
    pub y_cm: f64,
    /// The rotation, clockwise in degrees.
    pub yaw_deg: f64,
}

impl Place {
    fn new(at: Micros, pose: Pose) -> Self {
        // Round to a micrometre, so that noise does not appear in the data.
        let [x_cm, y_cm, yaw_deg] = [pose.x_cm, pose.y_cm, pose.yaw_deg].map(|value| libm::round(value * 1e4) / 1e4);
        Place { at, x_cm, y_cm, yaw_deg }
    }
}

/// Collects the data of a picture: one timeline for each robot of the script.
pub fn plot(timelines: &[Timeline], sources: &Sources, diagnostics: &Diagnostics) -> Plot {
    let moment = |at: Micros, text: &str| Moment { at, text: escaped(text) };
    let first = timelines.first();
    let bars = first.and_then(|timeline| timeline.bars).map(|bars| Bars {
        first_us: bars.first_us,
        beat_us: bars.tempo.beat().in_micros(),
        beats: bars.tempo.beats(),
    });
    // What several robots say at the same time is drawn once.
    let mut said = BTreeSet::new();
    let cues = timelines.iter().flat_map(|timeline| &timeline.cues).map(|cue| moment(cue.at, &cue.text.to_string()));
    let is_new = |say: &Moment| timelines.len() == 1 || said.insert((say.at, say.text.clone()));
    let mut says: Vec<Moment> = cues.filter(is_new).collect();
    says.sort_by_key(|say| say.at);
    Plot {
        script: escaped(sources.main().name()),
        end: timelines.iter().map(|timeline| timeline.end).max().unwrap_or_default(),
        bars,
        marks: first.iter().flat_map(|timeline| &*timeline.marks).map(|mark| moment(mark.at, &mark.name)).collect(),
        says,
        expects: expects(timelines),
        gates: gates(timelines),
        warnings: warnings(timelines, sources, diagnostics),
        tracks: timelines.iter().map(robot).collect(),
    }
}

/// The `expect`s of all robots. Those of some robots begin with their names.
fn expects(timelines: &[Timeline]) -> Vec<Stretch> {
    if let [timeline] = timelines {
        let stretch =
            |due: &Expectation| Stretch { at: due.at, until: due.until, text: escaped(&due.expect.to_string()) };
        return timeline.expects.iter().map(stretch).collect();
    }
    let mut found: BTreeMap<(Micros, Micros, String), Vec<&str>> = BTreeMap::new();
    for timeline in timelines {
        for due in &timeline.expects {
            let names = found.entry((due.at, due.until, due.expect.to_string())).or_default();
            names.extend(timeline.robot.as_deref().filter(|name| !names.contains(name)));
        }
    }
    let stretch = |((at, until, text), names): (_, Vec<&str>)| {
        let text = if names.len() == timelines.len() { text } else { format!("{}: {text}", names.join(", ")) };
        Stretch { at, until, text: escaped(&text) }
    };
    found.into_iter().map(stretch).collect()
}

/// The gates, which all robots share. Those that wait for reports of some robots begin with their names.
fn gates(timelines: &[Timeline]) -> Vec<Moment> {
    let Some(first) = timelines.first() else { return Vec::new() };
    let gate = |(index, gate): (usize, &Gate)| {
        // The timelines of the other robots have the whole line.
        let all = timelines.iter().filter_map(|timeline| timeline.gates.get(index));
        let whole = all.map(|gate| &gate.gate).find(|gate| matches!(gate.awaited, Awaited::Others(_)));
        Moment { at: gate.at, text: escaped(&whole.unwrap_or(&gate.gate).to_string()) }
    };
    first.gates.iter().enumerate().map(gate).collect()
}

impl Robot {
    /// Whether the robot leaves its starting position; rotation does not count.
    fn goes_away(&self) -> bool {
        self.path.iter().any(|place| libm::hypot(place.x_cm, place.y_cm) > 1.0)
    }
}

impl Plot {
    /// The data as JSON, on one line. Fields may be added; existing ones never change their
    /// meaning.
    pub fn to_json(&self) -> String {
        // Serializing numbers and strings cannot fail.
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}

fn robot(timeline: &Timeline) -> Robot {
    Robot {
        robot: timeline.robot.as_deref().map(escaped),
        frames: timeline.events.len(),
        lanes: lanes::lanes(timeline),
        wire: load(timeline),
        path: path::path(timeline),
    }
}

/// The warnings, each with the time of the first frame of its command.
fn warnings(timelines: &[Timeline], sources: &Sources, diagnostics: &Diagnostics) -> Vec<Warning> {
    let mut places: BTreeMap<u32, Option<Micros>> = diagnostics.iter().map(|found| (found.span.start, None)).collect();
    let mut meet = |at: Micros, span: Span| {
        for (_, first) in places.range_mut(span.start..span.end.max(span.start.saturating_add(1))) {
            *first = Some(first.map_or(at, |first| first.min(at)));
        }
    };
    for timeline in timelines {
        timeline.events.iter().for_each(|event| meet(event.at, event.span));
        timeline.cues.iter().for_each(|cue| meet(cue.at, cue.span));
        timeline.expects.iter().for_each(|due| meet(due.at, due.span));
        timeline.gates.iter().for_each(|gate| meet(gate.at, gate.span));
    }
    let lines = Lines::of(sources);
    let warning = |found: &Diagnostic| {
        let place = lines.place(found.span);
        Warning {
            at: places.get(&found.span.start).copied().flatten(),
            code: found.code.name(),
            message: escaped(&found.message),
            file: escaped(place.file),
            line: place.line,
        }
    };
    diagnostics.iter().filter(|found| !found.is_error()).map(warning).collect()
}

/// The load of the line.
fn load(timeline: &Timeline) -> Load {
    let line = Wire::new(timeline.baud);
    #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
    let piece_us = shown(timeline.end).0 as f64 / f64::from(PIECES);
    let mut busy_us = vec![0.0; PIECES as usize];
    let mut late = Vec::new();
    for (event, departure, late_by) in wire::departures(timeline, &timeline.events) {
        if late_by > wire::LATE {
            late.push(Late { at: event.at, late: late_by });
        }
        let [mut from, until] = [departure.begins, departure.left].map(|ticks| line.in_micros(ticks) / piece_us);
        while from < until {
            // The interval ends, or the frame does. Frames after the end count for the last
            // interval.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "held in range")]
            let piece = from.clamp(0.0, f64::from(PIECES - 1)) as u32;
            let end = if piece + 1 == PIECES { until } else { until.min(f64::from(piece) + 1.0) };
            if let Some(busy) = busy_us.get_mut(piece as usize) {
                *busy += (end - from) * 100.0;
            }
            from = if end > from { end } else { until };
        }
    }
    let percent = busy_us.iter().map(|busy: &f64| libm::round(busy.min(100.0) * 100.0) / 100.0).collect();
    Load { baud: timeline.baud, piece_us, percent, late }
}

/// The time that a picture covers: more than zero, even for an empty script.
fn shown(end: Micros) -> Micros {
    if end == Micros::ZERO { Micros::SECOND } else { end.max(Micros::from_millis(1)) }
}
