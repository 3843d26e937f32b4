//! Draws a plot: lanes over time, a band of them for each robot, and the paths of the robots next to them.

use std::fmt::Write as _;

use svg::Node;
use svg::node::element::{Element, Style};

use self::curve::{about_zero, reading};
use super::canvas::{Anchor, Canvas, fit, number, point, width};
use super::labels::{self, Room};
use super::{Lane, Moment, Place, Plot, Robot, Shows, Stretch, shown};
use crate::board::Text;
use crate::units::Micros;

mod curve;
mod time_axis;
mod top_view;

/// The colours of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Theme {
    /// Dark on light.
    Light,
    /// Light on dark.
    Dark,
    /// As set on the reader's screen.
    Auto,
}

/// The width of a picture, the start of its lanes, and their end without and with a path next to
/// them, in pixels.
const WIDTH: f64 = 1_200.0;
const LEFT: f64 = 128.0;
const RIGHT: f64 = 1_184.0;
const RIGHT_WITH_TOP_VIEW: f64 = 868.0;
/// Heights of lanes, and the gap between them, in pixels.
const PLACE: f64 = 84.0;
const DRIVE: f64 = 64.0;
const PLAIN: f64 = 44.0;
const ROW: f64 = 26.0;
const MORE_ROW: f64 = 16.0;
const WIRE: f64 = 48.0;
const GAP: f64 = 7.0;
/// Font sizes of names, of texts, and of secondary texts, in pixels.
const NAME: f64 = 14.0;
const TEXT: f64 = 13.0;
const SOFT: f64 = 12.0;
/// The maximum number of tooltips per lane, and of warnings shown as text.
const MAX_TOOLTIPS: usize = 400;
const WORDS: usize = 8;
/// The maximum number of rows of labels.
const ROWS: usize = 8;

impl Plot {
    /// Draws the plot as SVG, 1200 pixels wide. Equal plots give equal bytes.
    pub fn to_svg(&self, theme: Theme) -> String {
        let has_top_view = self.tracks.iter().any(Robot::goes_away);
        let right = if has_top_view { RIGHT_WITH_TOP_VIEW } else { RIGHT };
        #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
        let end = shown(self.end).0 as f64;
        let mut picture = Picture {
            plot: self,
            canvas: Canvas::default(),
            backgrounds: Canvas::default(),
            right,
            end,
            y: 0.0,
            bottom: 0.0,
            side_bottom: 0.0,
        };
        picture.draw();
        let Picture { canvas, y, side_bottom, .. } = picture;
        let height = libm::ceil(y.max(side_bottom) + 12.0);
        let mut root = Element::new("svg");
        root.assign("xmlns", "http://www.w3.org/2000/svg");
        root.assign("width", number(WIDTH));
        root.assign("height", number(height));
        root.assign("viewBox", format!("0 0 {} {}", number(WIDTH), number(height)));
        root.assign("role", "img");
        root.append(svg::node::element::Title::new(self.script.as_str()));
        root.append(Style::new(style(theme, self.tracks.len())));
        let mut paper = Canvas::default();
        paper.area("paper", [0.0, 0.0, WIDTH, height], None);
        for node in paper.nodes.into_iter().chain(canvas.nodes) {
            root.append(node);
        }
        format!("{root}\n")
    }

    /// Draws the plot in an HTML page that loads nothing else.
    pub fn to_html(&self, theme: Theme) -> String {
        let mut title = Element::new("title");
        title.append(svg::node::Text::new(self.script.as_str()));
        let [paper, dark] = ["#ffffff", "#11151b"];
        let page = match theme {
            Theme::Light => format!("body {{ background: {paper}; }}"),
            Theme::Dark => format!("body {{ background: {dark}; }}"),
            Theme::Auto => format!(
                "body {{ background: {paper}; }}\n@media (prefers-color-scheme: dark) {{ body {{ background: {dark}; }} }}"
            ),
        };
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"color-scheme\" content=\"light dark\">\n{title}\n<style>\n{page}\nsvg {{ max-width: 100%; height: auto; display: block; margin: auto; }}\n</style>\n{}</html>\n",
            self.to_svg(theme)
        )
    }
}

fn style(theme: Theme, robots: usize) -> String {
    const LIGHT: &str = include_str!("light.css");
    const DARK: &str = include_str!("dark.css");
    let [light, dark] = [LIGHT_ROBOTS, DARK_ROBOTS].map(|colors| robot_style(colors, robots));
    match theme {
        Theme::Light => format!("\n{LIGHT}{light}"),
        Theme::Dark => format!("\n{LIGHT}{DARK}{dark}"),
        Theme::Auto => format!("\n{LIGHT}{light}@media (prefers-color-scheme: dark) {{\n{DARK}{dark}}}\n"),
    }
}

/// The colors of several robots and their paths, in the order of `robots`.
const LIGHT_ROBOTS: [&str; 8] =
    ["#0b5cad", "#c26a00", "#00795f", "#b0307f", "#5b3c88", "#7a6a00", "#b3261e", "#3d4653"];
const DARK_ROBOTS: [&str; 8] = ["#6db3ff", "#f0a23c", "#4fd1bd", "#f28fc9", "#c7a6f5", "#d8cf5a", "#ff8a7a", "#c3cad4"];

/// The style of several robots. One robot has the colors of a picture without names.
fn robot_style(colors: [&str; 8], robots: usize) -> String {
    let style = |(robot, color): (usize, &str)| {
        format!(".road-{robot}, .start-{robot} {{ stroke: {color}; }}\n.robot-{robot} {{ fill: {color}; }}\n")
    };
    colors.into_iter().enumerate().take(if robots < 2 { 0 } else { robots }).map(style).collect()
}

struct Picture<'p> {
    plot: &'p Plot,
    canvas: Canvas,
    /// The backgrounds of the lanes.
    backgrounds: Canvas,
    /// The end of the lanes in pixels.
    right: f64,
    /// The time that the lanes cover, in microseconds.
    end: f64,
    /// The current vertical position, and the bottom of the last lane.
    y: f64,
    bottom: f64,
    /// The bottom of the picture next to the lanes.
    side_bottom: f64,
}

impl Picture<'_> {
    #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
    fn x(&self, at: Micros) -> f64 {
        self.at(at.0 as f64)
    }

    fn at(&self, t_us: f64) -> f64 {
        LEFT + t_us / self.end * (self.right - LEFT)
    }

    fn draw(&mut self) {
        let plot = self.plot;
        self.head();
        self.marks();
        self.axis();
        let top = self.y;
        let head = self.canvas.nodes.len();
        for (number, track) in plot.tracks.iter().enumerate() {
            self.track(number, track);
        }
        self.top_view(top);
        if !plot.says.is_empty() {
            self.moments("say", &plot.says, ("say", DOT), &[]);
        }
        if !plot.expects.is_empty() {
            let expects: Vec<Moment> = plot.expects.iter().map(|due| moment(due.at, &due.text)).collect();
            self.moments("expect", &expects, ("expect", DIAMOND), &plot.expects);
        }
        if !plot.gates.is_empty() {
            self.moments("gate", &plot.gates, ("gate", BAR), &[]);
        }
        self.warnings();
        // Lines through all lanes are above the backgrounds and below the curves. Their length is
        // known only now.
        let front = self.canvas.nodes.split_off(head);
        self.canvas.nodes.append(&mut self.backgrounds.nodes);
        self.through(top, self.bottom);
        self.canvas.nodes.extend(front);
    }

    /// The band of a robot: its lanes, below its name.
    fn track(&mut self, number: usize, track: &Robot) {
        if let Some(robot) = &track.robot {
            self.y += 24.0;
            let is_in_top_view = track.goes_away() && self.plot.tracks.len() > 1;
            if is_in_top_view {
                self.canvas.area(&format!("body robot-{number}"), [16.0, self.y - 13.0, 13.0, 13.0], None);
            }
            let x = if is_in_top_view { 36.0 } else { 16.0 };
            self.canvas.text((x, self.y), "title", Anchor::Start, &fit(robot, 19.0, 400.0));
            self.y += 10.0;
        }
        for lane in &track.lanes {
            self.lane(lane);
        }
        self.wire(track);
    }

    /// The paths of all robots that drive.
    fn top_view(&mut self, top: f64) {
        let Plot { tracks, marks, .. } = self.plot;
        let ways = top_view::ways(tracks);
        if !ways.is_empty() {
            let x = self.right + 28.0;
            let marks: Vec<(&str, Micros)> = marks.iter().map(|mark| (mark.text.as_str(), mark.at)).collect();
            self.side_bottom = top_view::draw(&mut self.canvas, [x, top, WIDTH - 16.0 - x], &ways, &marks);
        }
    }

    fn name(&mut self, name: &str, y: f64) {
        self.canvas.text((16.0, y), "name", Anchor::Start, name);
    }

    fn lane(&mut self, lane: &Lane) {
        match &lane.shows {
            Shows::Curve { unit, ends, range, limits, points, is_position: is_place } => {
                let is_place = *is_place;
                let height = match ends {
                    _ if is_place => PLACE,
                    [end, _] if end.is_empty() => PLAIN,
                    _ => DRIVE,
                };
                let scale = if is_place { *range } else { about_zero(points, *limits) };
                let y = self.y;
                self.frame(&lane.name, height);
                let about = [&lane.about, unit].into_iter().map(|word| &**word).filter(|word| !word.is_empty());
                let about = about.collect::<Vec<_>>().join(", ");
                // In a low lane, the lower end of the scale is next to it.
                let end = if height > PLAIN { 0.0 } else { width(&reading(scale[0]), SOFT) };
                // Most words have narrow letters.
                let about = fit(&about, SOFT * 0.9, LEFT - 22.0 - end);
                if !about.is_empty() {
                    self.canvas.text((16.0, y + height / 2.0 + 17.0), "soft", Anchor::Start, &about);
                }
                self.curve(points, scale, *limits, (y, height), is_place);
                self.ends(ends, scale, (y, height), is_place);
                self.y += height + GAP;
            }
            Shows::Spans { spans, is_strong, has_words } => {
                let class = if *is_strong { "span" } else { "hold" };
                self.row(&lane.name, |picture, y| {
                    picture.stretches(class, spans, y + 6.0, ROW - 12.0);
                    if *has_words {
                        picture.words(spans, y + ROW / 2.0 + 4.5);
                    }
                });
            }
            Shows::Ticks { ticks } => self.moments(&lane.name, ticks, ("tick", BAR), &[]),
        }
    }

    /// The frame and the name of a lane.
    fn frame(&mut self, name: &str, height: f64) {
        self.name(&short(name), self.y + height / 2.0 + if height > ROW { 1.0 } else { 4.0 });
        self.backgrounds.area("lane", [LEFT, self.y, self.right - LEFT, height], None);
        self.bottom = self.y + height;
    }

    /// A low lane.
    fn row(&mut self, name: &str, draw: impl FnOnce(&mut Self, f64)) {
        let y = self.y;
        self.frame(name, ROW);
        draw(self, y);
        self.y += ROW + GAP;
    }

    /// The labels at the ends of a scale.
    fn ends(
        &mut self,
        [low_end, high_end]: &[Text; 2],
        [low, high]: [f64; 2],
        (y, height): (f64, f64),
        is_place: bool,
    ) {
        let mut say = |value: f64, y: f64, word: &str| {
            let text =
                if is_place || word.is_empty() { reading(value) } else { format!("{word} {}", number(value.abs())) };
            self.canvas.text((LEFT - 6.0, y), "soft", Anchor::End, &text);
        };
        say(high, y + 10.0, high_end);
        say(low, y + height, low_end);
    }

    /// Draws spans as boxes. Skips those that end in a pixel column that is already drawn.
    fn stretches(&mut self, class: &str, stretches: &[Stretch], y: f64, height: f64) {
        let mut last = f64::NEG_INFINITY;
        for (count, Stretch { at, until, text }) in (1..).zip(stretches) {
            let (from_x, until_x) = (self.x(*at), self.x(*until));
            if until_x - last >= 0.5 || count == stretches.len() {
                last = until_x;
                let tooltip = format!("{}, {at} s to {until} s", tooltip(text));
                self.canvas.area(class, [from_x, y, (until_x - from_x).max(1.5), height], Some(&tooltip));
            }
        }
    }

    /// Writes the texts of spans into those that are long enough.
    fn words(&mut self, spans: &[Stretch], y: f64) {
        for Stretch { at, until, text } in spans {
            let (from_x, until_x) = (self.x(*at), self.x(*until));
            if until_x - from_x >= width(text, SOFT) + 8.0 {
                self.canvas.text((from_x + 4.0, y), "value", Anchor::Start, text);
            }
        }
    }

    /// A lane of symbols with their labels, and bars below the symbols.
    fn moments(&mut self, name: &str, moments: &[Moment], (class, sign): (&str, Sign), bars: &[Stretch]) {
        let texts: Vec<(f64, &str)> = moments.iter().map(|moment| (self.x(moment.at), moment.text.as_str())).collect();
        let room = Room { right: self.right - 4.0, rows: ROWS, size: TEXT, has_symbols: true };
        let placed = labels::place(&texts, &room);
        let top = self.y;
        let row = |row: usize| top + ROW / 2.0 + rows(row);
        let last = placed.rows + usize::from(placed.hidden > 0);
        let height = ROW + rows(last - 1);
        self.frame(name, height);
        self.stretches("hold", bars, top + ROW - 6.0, 3.0);
        for label in placed.shown.iter().filter(|label| label.row > 0) {
            self.canvas.line("leader", (label.x, row(0)), (label.x, row(label.row) + 5.0));
        }
        // Moments in one pixel column share a symbol.
        let mut groups: Vec<(f64, Vec<&Moment>)> = Vec::new();
        for (moment, (x, _)) in moments.iter().zip(&texts) {
            match groups.last_mut() {
                Some((first, group)) if x - *first < 2.0 => group.push(moment),
                _ => groups.push((*x, vec![moment])),
            }
        }
        for (at, (x, group)) in groups.iter().enumerate() {
            let words = || {
                let lines = group.iter().take(10).map(|moment| format!("{} at {} s", tooltip(&moment.text), moment.at));
                lines.collect::<Vec<_>>().join("\n")
            };
            self.canvas.path(class, &sign(*x, row(0)), (at < MAX_TOOLTIPS).then(words).as_deref());
        }
        for label in placed.shown.iter().rev() {
            self.canvas.text((label.at, row(label.row) + 4.5), "text", label.anchor, &label.text);
        }
        if placed.hidden > 0 {
            let plural = if placed.hidden == 1 { "" } else { "s" };
            let text = format!("and {} more label{plural}", placed.hidden);
            self.canvas.text((LEFT + 8.0, row(last - 1) + 4.5), "soft", Anchor::Start, &text);
        }
        self.y += height + GAP;
    }

    /// The load of the line, and late frames.
    fn wire(&mut self, track: &Robot) {
        let (load, y) = (&track.wire, self.y);
        self.frame("wire", WIRE);
        self.canvas.text((16.0, y + WIRE / 2.0 + 17.0), "soft", Anchor::Start, &format!("{} baud", load.baud));
        self.canvas.text((LEFT - 6.0, y + 10.0), "soft", Anchor::End, "100 %");
        let bottom = y + WIRE;
        let mut path = String::new();
        let mut t_us = 0.0;
        for percent in &load.percent {
            let (from, until) = (self.at(t_us), self.at(t_us + load.piece_us));
            if *percent > 0.0 {
                // Make any load visible.
                let high = (percent / 100.0 * (WIRE - 2.0)).max(0.7);
                let _ = write!(
                    path,
                    "M{}V{}H{}V{}z",
                    point((from, bottom)),
                    number(bottom - high),
                    number(until),
                    number(bottom)
                );
            }
            t_us += load.piece_us;
        }
        self.canvas.path("load", &path, None);
        let mut last = f64::NEG_INFINITY;
        for (at, late) in load.late.iter().enumerate() {
            let x = self.x(late.at);
            if x - last < 3.0 {
                continue;
            }
            last = x;
            let tooltip = format!("due at {} s, leaves {:.0} ms late", late.at, late.late.in_millis());
            self.canvas.path("warn", &DOWN(x, y + 8.0), (at < MAX_TOOLTIPS).then_some(tooltip.as_str()));
        }
        if let Some(worst) = load.late.iter().map(|late| late.late).max() {
            let count = load.late.len();
            let plural = if count == 1 { "frame leaves" } else { "frames leave" };
            let text = format!("{count} {plural} late, up to {} ms", worst.0.div_ceil(1_000));
            self.canvas.text((LEFT + 8.0, y + 26.0), "late", Anchor::Start, &text);
        }
        self.y += WIRE + GAP;
    }

    fn warnings(&mut self) {
        let warnings = &self.plot.warnings;
        if warnings.is_empty() {
            return;
        }
        let mut placed: Vec<Moment> =
            warnings.iter().filter_map(|warning| Some(moment(warning.at?, warning.code))).collect();
        placed.sort_by_key(|warning| warning.at);
        self.moments("warnings", &placed, ("warn", UP), &[]);
        self.y = self.y.max(self.side_bottom);
        for warning in warnings.iter().take(WORDS) {
            self.y += 12.0;
            let text = format!("▲ {}:{} {}: {}", warning.file, warning.line, warning.code, warning.message);
            self.canvas.text((16.0, self.y), "alarm", Anchor::Start, &fit(&text, SOFT, WIDTH - 32.0));
            self.y += 6.0;
        }
        if warnings.len() > WORDS {
            self.y += 12.0;
            let more = format!("and {} more; `motionseq check --all` shows them", warnings.len() - WORDS);
            self.canvas.text((16.0, self.y), "alarm", Anchor::Start, &more);
        }
        self.y += GAP;
    }
}

/// The height of rows of labels in pixels.
#[expect(clippy::cast_precision_loss, reason = "a few rows")]
fn rows(count: usize) -> f64 {
    count as f64 * MORE_ROW
}

fn moment(at: Micros, text: &str) -> Moment {
    Moment { at, text: text.to_owned() }
}

/// Shortens a text to the length of a tooltip.
fn tooltip(text: &str) -> String {
    const MOST: usize = 200;
    let cut: String = text.chars().take(MOST).collect();
    if cut.len() < text.len() { cut + "…" } else { cut }
}

/// The shape of a symbol around a point.
type Sign = fn(f64, f64) -> String;

const DOT: Sign = |x, y| format!("M{}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z", point((x - 4.0, y)));
const DIAMOND: Sign = |x, y| format!("M{}l5 5l-5 5l-5 -5z", point((x, y - 5.0)));
const BAR: Sign = |x, y| format!("M{}h2v16h-2z", point((x - 1.0, y - 8.0)));
const UP: Sign = |x, y| format!("M{}l5 9h-10z", point((x, y - 5.0)));
const DOWN: Sign = |x, y| format!("M{}l4 -7h-8z", point((x, y)));

/// A name that fits to the left of its lane: its first word is shortened, because the index and the
/// axis after it distinguish lanes.
fn short(name: &str) -> String {
    let room = LEFT - 22.0;
    let (first, rest) = name.split_at(name.find(' ').unwrap_or(name.len()));
    let first = fit(first, NAME, room - width(rest, NAME));
    if first.is_empty() { fit(name, NAME, room) } else { first + rest }
}

/// Describes the end of a path, for screen readers as well.
fn end_words(last: &Place) -> [String; 2] {
    let way = |value: f64, [ahead, back]: [&str; 2]| {
        let far = number(value.abs());
        (far != "0").then(|| format!("{far} cm {}", if value < 0.0 { back } else { ahead }))
    };
    let ways = [way(last.y_cm, ["forward", "back"]), way(last.x_cm, ["to the right", "to the left"])];
    let ways = ways.into_iter().flatten().collect::<Vec<_>>().join(", ");
    let ends = if ways.is_empty() { "ends at its start,".into() } else { format!("ends {ways},") };
    [ends, turned(last).map_or_else(|| AS_AT_THE_START.into(), |turned| format!("turned {turned}"))]
}

/// The end of a robot that has turned as much to one side as to the other.
const AS_AT_THE_START: &str = "facing as at the start";

/// `20° to the right`; `None` if it is not turned.
fn turned(end: &Place) -> Option<String> {
    let by = number(end.yaw_deg.abs());
    (by != "0").then(|| format!("{by}° to the {}", if end.yaw_deg < 0.0 { "left" } else { "right" }))
}
