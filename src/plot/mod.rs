//! Pictures of a timeline: what happens when, in lanes over time, and where the robot goes.
//!
//! [`plot`] gathers what there is to see, as data that others can draw as well; [`Plot::to_svg`] draws it.

mod lanes;
#[cfg(feature = "png")]
mod png;
mod path;
mod canvas;
mod svg;

use std::collections::BTreeMap;

use serde::Serialize;

use crate::board::Text;
use crate::diagnostic::{Diagnostic, Diagnostics, escaped};
use crate::sim::Pose;
use crate::source::{Lines, Sources, Span};
use crate::timeline::Timeline;
use crate::timeline::wire::{self, Wire};
use crate::units::Micros;

#[cfg(feature = "png")]
pub use png::{PngError, png};
pub use svg::Theme;

/// How many pieces of equal length the load of the line is measured in.
const PIECES: u32 = 720;

/// What there is to see of a timeline. All times count from its start; those that are written as numbers are microseconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plot {
    /// What the script is called.
    pub script: String,
    /// When it ends.
    #[serde(rename = "end_us")]
    pub end: Micros,
    /// How it counts in bars, if it does.
    pub bars: Option<Bars>,
    /// Its marks.
    pub marks: Vec<Moment>,
    /// Its `say`s.
    pub says: Vec<Moment>,
    /// Its `expect`s.
    pub expects: Vec<Stretch>,
    /// What `check` warns of, each where its command is sent first.
    pub warnings: Vec<Warning>,
    /// One a robot.
    pub tracks: Vec<Robot>,
}

/// Bars of one length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bars {
    /// When bar 1 begins; before the start for a part of a script.
    pub first_us: i64,
    /// How long a beat is.
    pub beat_us: f64,
    /// Beats in a bar.
    pub beats: u32,
}

impl Bars {
    /// How long a bar is.
    fn bar_us(&self) -> f64 {
        self.beat_us * f64::from(self.beats)
    }

    /// When bar 1 begins.
    #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
    fn begin(&self) -> f64 {
        self.first_us as f64
    }
}

/// Something that happens at a moment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Moment {
    /// When.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// What.
    pub text: String,
}

/// Something that lasts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Stretch {
    /// From when.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// Until when.
    #[serde(rename = "until_us")]
    pub until: Micros,
    /// What.
    pub text: String,
}

/// A warning.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// When the command is sent that it is about; `None` for one that sends nothing in this part.
    #[serde(rename = "t_us")]
    pub at: Option<Micros>,
    /// Its code.
    pub code: &'static str,
    /// What is wrong.
    pub message: String,
    /// The file, and the line in it.
    pub file: String,
    /// The line, counted from 1.
    pub line: usize,
}

/// What one robot does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Robot {
    /// Its name; `None` where the script names no robots.
    pub robot: Option<String>,
    /// How many frames it is sent.
    pub frames: usize,
    /// What it does, thing by thing; what is never used is not there.
    pub lanes: Vec<Lane>,
    /// How busy its line is.
    pub wire: Load,
    /// Where the virtual board goes, in its nominal units. Empty where it goes nowhere.
    pub path: Vec<Place>,
}

/// One thing over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lane {
    /// What it is.
    pub name: Text,
    /// Where on the robot, or what for; empty where the name says it.
    pub about: Text,
    /// What it shows.
    #[serde(flatten)]
    pub shows: Shows,
}

/// What a lane shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Shows {
    /// A value that stays until the next one.
    Curve {
        /// Its unit.
        unit: Text,
        /// What the values below and above zero, or the least and the largest, are called.
        ends: [Text; 2],
        /// The smallest and the largest value that the board takes.
        range: [f64; 2],
        /// The same as the script narrows it, if it does.
        limits: Option<[f64; 2]>,
        /// Times and values; `null` from where it is not known.
        points: Vec<(Micros, Option<f64>)>,
    },
    /// Something that is on or off.
    Spans {
        /// When it is on.
        spans: Vec<Stretch>,
        /// Whether it is drawn as strongly as a command.
        #[serde(skip)]
        is_strong: bool,
    },
    /// Things that happen.
    Ticks {
        /// When.
        ticks: Vec<Moment>,
    },
}

/// How busy the line is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Load {
    /// Its speed in bits a second.
    pub baud: u32,
    /// How long a piece of time is.
    pub piece_us: f64,
    /// How much of what it carries leaves in each piece, in percent.
    pub percent: Vec<f64>,
    /// Frames that leave more than 5 ms after they are due.
    pub late: Vec<Late>,
}

/// A frame that leaves late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Late {
    /// When it is due.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// By how much.
    #[serde(rename = "late_us")]
    pub late: Micros,
}

/// Where the robot is, from where it started.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// When.
    #[serde(rename = "t_us")]
    pub at: Micros,
    /// To the right, in cm.
    pub x_cm: f64,
    /// Forward, in cm.
    pub y_cm: f64,
    /// Turned clockwise, in degrees.
    pub yaw_deg: f64,
}

impl Place {
    fn new(at: Micros, pose: Pose) -> Self {
        // A micrometre more or less says nothing.
        let [x_cm, y_cm, yaw_deg] = [pose.x_cm, pose.y_cm, pose.yaw_deg].map(|value| libm::round(value * 1e4) / 1e4);
        Place { at, x_cm, y_cm, yaw_deg }
    }
}

/// Gathers what there is to see of a timeline.
pub fn plot(timeline: &Timeline, sources: &Sources, diagnostics: &Diagnostics) -> Plot {
    let moment = |at: Micros, text: &str| Moment { at, text: escaped(text) };
    let bars = timeline.bars.map(|bars| Bars {
        first_us: bars.first_us,
        beat_us: bars.tempo.beat().in_micros(),
        beats: bars.tempo.beats(),
    });
    Plot {
        script: escaped(sources.main().name()),
        end: timeline.end,
        bars,
        marks: timeline.marks.iter().map(|mark| moment(mark.at, &mark.name)).collect(),
        says: timeline.cues.iter().map(|cue| moment(cue.at, &cue.text)).collect(),
        expects: timeline
            .expects
            .iter()
            .map(|due| Stretch { at: due.at, until: due.until, text: escaped(&due.expect.to_string()) })
            .collect(),
        warnings: warnings(timeline, sources, diagnostics),
        tracks: vec![robot(timeline)],
    }
}

impl Robot {
    /// Whether it ever leaves the place where it starts, turning aside.
    fn goes_away(&self) -> bool {
        self.path.iter().any(|place| libm::hypot(place.x_cm, place.y_cm) > 1.0)
    }
}

impl Plot {
    /// The same as JSON, on one line. Fields may be added, and never change their meaning.
    pub fn to_json(&self) -> String {
        // Numbers and texts cannot fail.
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}

fn robot(timeline: &Timeline) -> Robot {
    Robot {
        robot: None,
        frames: timeline.events.len(),
        lanes: lanes::lanes(timeline),
        wire: load(timeline),
        path: path::path(timeline),
    }
}

/// Warnings, each where the first frame is that comes from its place in the script.
fn warnings(timeline: &Timeline, sources: &Sources, diagnostics: &Diagnostics) -> Vec<Warning> {
    let mut places: BTreeMap<u32, Option<Micros>> = diagnostics.iter().map(|found| (found.span.start, None)).collect();
    let mut meet = |at: Micros, span: Span| {
        for (_, first) in places.range_mut(span.start..span.end.max(span.start.saturating_add(1))) {
            first.get_or_insert(at);
        }
    };
    for event in &timeline.events {
        meet(event.at, event.span);
    }
    timeline.cues.iter().for_each(|cue| meet(cue.at, cue.span));
    timeline.expects.iter().for_each(|due| meet(due.at, due.span));
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

/// How busy the line is.
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
            // Ends where the piece ends, or the frame; what leaves behind the end counts for the last piece.
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

/// How much time a picture shows: something, also of a script that takes none or next to none.
fn shown(end: Micros) -> Micros {
    if end == Micros::ZERO { Micros::SECOND } else { end.max(Micros::from_millis(1)) }
}
