//! What stands above the lanes and runs through them: the title, marks, seconds, bars.

use std::fmt::Write as _;

use super::super::sheet::{Anchor, fit, number, point, round_step, width};
use super::{LEFT, Picture, SOFT, TEXT, WIDTH, turned};
use crate::timeline::Seconds;

/// From which step on, in seconds, times are written as a clock shows them.
const CLOCK: f64 = 30.0;
/// How far apart lines of marks are at least.
const NEAR: f64 = 5.0;

impl Picture<'_> {
    pub(super) fn head(&mut self) {
        let plot = self.plot;
        self.y = 30.0;
        let title = fit(&plot.script, 21.0, WIDTH - 40.0);
        self.sheet.text((16.0, self.y), "title", Anchor::Start, &title);
        let frames: usize = plot.tracks.iter().map(|track| track.frames).sum();
        let plural = if frames == 1 { "" } else { "s" };
        let mut facts = format!("{} s, {frames} frame{plural}", short(plot.end_us));
        if let Some(bars) = plot.bars {
            let _ = write!(facts, ", {} beats a minute, {} beats a bar", number(60e6 / bars.beat_us), bars.beats);
        }
        for end in plot.tracks.iter().filter(|track| !track.goes_away()).filter_map(|track| track.path.last()) {
            facts.push_str(", turns on the spot, in the end by ");
            facts.push_str(&turned(end));
        }
        self.y += 20.0;
        self.sheet.text((16.0, self.y), "soft", Anchor::Start, &facts);
        self.y += 12.0;
    }

    /// The names of marks, each where there is room for it.
    pub(super) fn marks(&mut self) {
        let marks = &self.plot.marks;
        if marks.is_empty() {
            return;
        }
        self.name("marks", self.y + 15.0);
        let mut free = [LEFT, LEFT];
        for mark in marks {
            let x = self.x(mark.t_us);
            let name = fit(&mark.text, TEXT, 200.0);
            let wide = width(&name, TEXT);
            // The last ones stand to the left of their lines.
            let (from, anchor, at) = if x + wide > WIDTH - 12.0 {
                (x - wide - 4.0, Anchor::End, x - 4.0)
            } else {
                (x, Anchor::Start, x + 4.0)
            };
            let Some(row) = free.iter().position(|free| *free <= from) else { continue };
            if let Some(free) = free.get_mut(row) {
                *free = from + wide + 10.0;
            }
            #[expect(clippy::cast_precision_loss, reason = "0 or 1")]
            let y = self.y + 15.0 + row as f64 * 16.0;
            self.sheet.text((at, y), "label", anchor, &name);
        }
        let rows = if free.iter().skip(1).any(|free| *free > LEFT) { 2.0 } else { 1.0 };
        self.y += 6.0 + 16.0 * rows;
    }

    /// Seconds, and bars where the script counts in them.
    pub(super) fn axis(&mut self) {
        let step = time_step(self.end / 1e6 * 64.0 / (self.right - LEFT));
        self.name(if step < CLOCK { "seconds" } else { "time" }, self.y + 14.0);
        let mut k = 0.0;
        while k * step * 1e6 <= self.end {
            let seconds = k * step;
            let (x, text) = (self.at(seconds * 1e6), clock(seconds, step));
            // The last one must not be cut.
            let x = x.min(WIDTH - 4.0 - width(&text, SOFT) / 2.0);
            self.sheet.text((x, self.y + 14.0), "soft", Anchor::Middle, &text);
            k += 1.0;
        }
        self.y += 20.0;
        let Some(bars) = self.plot.bars else { return };
        let bar_us = bars.beat_us * f64::from(bars.beats);
        // As many bars at once as leave room for a number.
        let mut each = 1.0;
        while self.at(bar_us * each) - LEFT < 34.0 {
            each *= 2.0;
        }
        self.name("bars", self.y + 13.0);
        #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
        let first = bars.first_us as f64;
        let mut bar = libm::ceil(-first / bar_us / each).max(0.0) * each;
        while first + bar * bar_us <= self.end {
            let x = self.at(first + bar * bar_us);
            self.sheet.text((x, self.y + 13.0), "soft", Anchor::Middle, &number(bar + 1.0));
            bar += each;
        }
        self.y += 18.0;
    }

    /// The lines that run through all lanes: seconds, bars and beats, marks.
    pub(super) fn through(&mut self, top: f64, bottom: f64) {
        let mut path = String::new();
        let down = |x: f64, path: &mut String| {
            let _ = write!(path, "M{}V{}", point((x, top)), number(bottom));
        };
        match self.plot.bars {
            None => {
                let step = time_step(self.end / 1e6 * 64.0 / (self.right - LEFT));
                let mut k = 0.0;
                while k * step * 1e6 <= self.end {
                    down(self.at(k * step * 1e6), &mut path);
                    k += 1.0;
                }
                self.sheet.path("grid", &path, None);
            }
            Some(bars) => {
                let bar_us = bars.beat_us * f64::from(bars.beats);
                #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
                let first = bars.first_us as f64;
                for (class, length, least) in [("grid", bars.beat_us, 8.0), ("bar", bar_us, 6.0)] {
                    let mut each = length;
                    while class == "bar" && self.at(each) - LEFT < least {
                        each *= 2.0;
                    }
                    let mut path = String::new();
                    if self.at(each) - LEFT >= least {
                        let mut t_us = first + libm::ceil(-first / each).max(0.0) * each;
                        while t_us <= self.end {
                            down(self.at(t_us), &mut path);
                            t_us += each;
                        }
                    }
                    self.sheet.path(class, &path, None);
                }
            }
        }
        let mut last = f64::NEG_INFINITY;
        for mark in &self.plot.marks {
            let x = self.x(mark.t_us);
            // Lines that lie closer would be one area.
            if x - last >= NEAR {
                last = x;
                let mut path = String::new();
                down(x, &mut path);
                let tells = format!("{} at {} s", mark.text, short(mark.t_us));
                self.sheet.path("mark", &path, Some(&tells));
            }
        }
    }
}

/// A step between times in seconds that is at least so long, and that a clock has.
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

/// A time in seconds without zeros that say nothing.
pub(super) fn short(t_us: u64) -> String {
    let text = Seconds(t_us).to_string();
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A time as seconds, or as a clock shows it where that is shorter.
fn clock(seconds: f64, step: f64) -> String {
    if step < CLOCK {
        // As many places as the step has.
        let short = format!("{seconds:.6}");
        let short = short.trim_end_matches('0').trim_end_matches('.');
        return short.to_owned();
    }
    let [hours, minutes, rest] = [seconds / 3_600.0, seconds / 60.0 % 60.0, seconds % 60.0].map(libm::floor);
    if hours > 0.0 { format!("{hours}:{minutes:02}:{rest:02}") } else { format!("{minutes}:{rest:02}") }
}
