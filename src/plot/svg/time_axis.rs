//! Everything above the lanes and the lines through them: title, marks, seconds, bars.

use std::fmt::Write as _;

use super::super::canvas::{Anchor, fit, number, point, round_step, width};
use super::super::labels::{self, Room};
use super::{AS_AT_THE_START, LEFT, Picture, ROWS, SOFT, TEXT, WIDTH, rows, tooltip, turned};

/// From this step, in seconds, times are shown as on a clock.
const CLOCK: f64 = 30.0;
/// The minimum distance between lines of marks, in pixels.
const NEAR: f64 = 5.0;

impl Picture<'_> {
    pub(super) fn head(&mut self) {
        let plot = self.plot;
        self.y = 30.0;
        let title = fit(&plot.script, 21.0, WIDTH - 40.0);
        self.canvas.text((16.0, self.y), "title", Anchor::Start, &title);
        let frames: usize = plot.tracks.iter().map(|track| track.frames).sum();
        let plural = if frames == 1 { "" } else { "s" };
        let mut facts = format!("{} s, {frames} frame{plural}", plot.end);
        if let Some(bars) = plot.bars {
            let _ = write!(facts, ", {} bpm, {} beats per bar", number(60e6 / bars.beat_us), bars.beats);
        }
        for track in plot.tracks.iter().filter(|track| !track.goes_away()) {
            let Some(end) = track.path.last() else { continue };
            let turned =
                turned(end).map_or_else(|| format!("and ends {AS_AT_THE_START}"), |by| format!("in total {by}"));
            let name = track.robot.as_ref().map(|name| format!("{name} ")).unwrap_or_default();
            let _ = write!(facts, ", {name}turns on the spot, {turned}");
        }
        self.y += 20.0;
        self.canvas.text((16.0, self.y), "soft", Anchor::Start, &fit(&facts, SOFT * 0.9, WIDTH - 32.0));
        self.y += 12.0;
    }

    /// The names of marks, in as many rows as they need.
    pub(super) fn marks(&mut self) {
        let marks = &self.plot.marks;
        if marks.is_empty() {
            return;
        }
        let texts: Vec<(f64, &str)> = marks.iter().map(|mark| (self.x(mark.at), mark.text.as_str())).collect();
        let room = Room { right: WIDTH - 12.0, rows: ROWS, size: TEXT, has_symbols: false };
        let placed = labels::place(&texts, &room);
        let top = self.y;
        self.name("marks", top + 15.0);
        if placed.hidden > 0 {
            let plural = if placed.hidden == 1 { "" } else { "s" };
            self.y += 16.0;
            let text = format!("and {} more label{plural}", placed.hidden);
            self.canvas.text((LEFT + 4.0, self.y - 1.0), "soft", Anchor::Start, &text);
        }
        self.y += 6.0 + rows(placed.rows);
        let bottom = self.y;
        for label in placed.shown.iter().rev() {
            let y = bottom - 7.0 - rows(label.row);
            if label.row > 0 {
                self.canvas.path("leader", &down(label.x, y - 8.0, bottom), None);
            }
            self.canvas.text((label.at, y), "label", label.anchor, &label.text);
        }
    }

    /// Seconds, and bars if the script counts in bars.
    pub(super) fn axis(&mut self) {
        let step = self.step();
        self.name(if step < CLOCK { "seconds" } else { "time" }, self.y + 14.0);
        for (count, t_us) in self.every(0.0, step * 1e6) {
            let text = clock(count * step, step);
            // Keep the last one inside the picture.
            let x = self.at(t_us).min(WIDTH - 4.0 - width(&text, SOFT) / 2.0);
            self.canvas.text((x, self.y + 14.0), "soft", Anchor::Middle, &text);
        }
        self.y += 20.0;
        let Some(bars) = self.plot.bars else { return };
        self.name("bars", self.y + 13.0);
        // Skip bars until there is room for a number.
        let bars_us = self.wide(bars.bar_us(), 34.0);
        for (count, t_us) in self.every(bars.begin(), bars_us) {
            let bar = count * bars_us / bars.bar_us() + 1.0;
            self.canvas.text((self.at(t_us), self.y + 13.0), "soft", Anchor::Middle, &number(bar));
        }
        self.y += 18.0;
    }

    /// The lines through all lanes: seconds, or bars and beats; marks.
    pub(super) fn through(&mut self, top: f64, bottom: f64) {
        let lines = |picture: &Self, begin: f64, each: f64| {
            let mut path = String::new();
            for (_, t_us) in picture.every(begin, each) {
                path.push_str(&down(picture.at(t_us), top, bottom));
            }
            path
        };
        match self.plot.bars {
            None => self.canvas.path("grid", &lines(self, 0.0, self.step() * 1e6), None),
            Some(bars) => {
                if self.wide(bars.beat_us, 8.0) <= bars.beat_us {
                    self.canvas.path("grid", &lines(self, bars.begin(), bars.beat_us), None);
                }
                self.canvas.path("bar", &lines(self, bars.begin(), self.wide(bars.bar_us(), 6.0)), None);
            }
        }
        let mut last = f64::NEG_INFINITY;
        for gate in &self.plot.gates {
            let x = self.x(gate.at);
            if x - last >= NEAR {
                last = x;
                let band = format!("M{} {}h6V{}h-6z", number(x - 3.0), number(top), number(bottom));
                let tooltip = format!("{} at {} s", tooltip(&gate.text), gate.at);
                self.canvas.path("gate", &band, Some(&tooltip));
            }
        }
        last = f64::NEG_INFINITY;
        for mark in &self.plot.marks {
            let x = self.x(mark.at);
            // Lines closer than this would merge.
            if x - last >= NEAR {
                last = x;
                let tooltip = format!("{} at {} s", tooltip(&mark.text), mark.at);
                self.canvas.path("mark", &down(x, top, bottom), Some(&tooltip));
            }
        }
    }

    /// The time between two ticks in seconds.
    fn step(&self) -> f64 {
        time_step(self.end / 1e6 * 64.0 / (self.right - LEFT))
    }

    /// A time interval, doubled until it is at least this many pixels wide.
    fn wide(&self, mut length_us: f64, least: f64) -> f64 {
        while self.at(length_us) - LEFT < least {
            length_us *= 2.0;
        }
        length_us
    }

    /// Times at a fixed interval that are inside the picture, with their index.
    fn every(&self, begin: f64, each: f64) -> impl Iterator<Item = (f64, f64)> + use<> {
        let end = self.end;
        let first = libm::ceil((0.0 - begin) / each).max(0.0);
        let counts = std::iter::successors(Some(first), |count| Some(count + 1.0));
        counts.map(move |count| (count, begin + count * each)).take_while(move |(_, t_us)| *t_us <= end)
    }
}

/// A vertical line.
fn down(x: f64, top: f64, bottom: f64) -> String {
    format!("M{}V{}", point((x, top)), number(bottom))
}

/// A round step between times that is at least this many seconds.
fn time_step(least: f64) -> f64 {
    let steps = [60.0, 120.0, 300.0, 600.0, 900.0, 1_800.0, 3_600.0, 7_200.0, 10_800.0, 21_600.0, 43_200.0, 86_400.0];
    if least <= 30.0 {
        return match round_step(least) {
            step if step == 20.0 || step == 50.0 => 30.0,
            step => step,
        };
    }
    steps.into_iter().find(|step| *step >= least).unwrap_or(86_400.0)
}

/// A time in seconds, or as on a clock if that is shorter.
fn clock(seconds: f64, step: f64) -> String {
    if step < CLOCK {
        // As many decimals as the step has.
        let short = format!("{seconds:.6}");
        let short = short.trim_end_matches('0').trim_end_matches('.');
        return short.to_owned();
    }
    let [hours, minutes, rest] = [seconds / 3_600.0, seconds / 60.0 % 60.0, seconds % 60.0].map(libm::floor);
    if hours > 0.0 { format!("{hours}:{minutes:02}:{rest:02}") } else { format!("{minutes}:{rest:02}") }
}
