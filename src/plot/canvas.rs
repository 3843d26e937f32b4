//! A canvas for shapes and text. Curves are reduced to what is visible.

use svg::Node;
use svg::node::Text;
use svg::node::element::{Element, Title};

/// The shapes drawn so far.
#[derive(Default)]
pub(super) struct Canvas {
    pub(super) nodes: Vec<Element>,
}

/// Which end of a text is at its position.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Canvas {
    fn add(&mut self, element: Element) {
        self.nodes.push(element);
    }

    /// Adds a text. Markup in it is escaped.
    pub(super) fn text(&mut self, (x, y): (f64, f64), class: &str, anchor: Anchor, text: &str) {
        let mut element = Element::new("text");
        element.assign("x", number(x));
        element.assign("y", number(y));
        element.assign("class", class);
        match anchor {
            Anchor::Start => {}
            Anchor::Middle => element.assign("text-anchor", "middle"),
            Anchor::End => element.assign("text-anchor", "end"),
        }
        element.append(Text::new(text));
        self.add(element);
    }

    /// Adds a path with an optional tooltip.
    pub(super) fn path(&mut self, class: &str, path: &str, tooltip: Option<&str>) {
        if path.is_empty() {
            return;
        }
        let mut element = Element::new("path");
        element.assign("class", class);
        element.assign("d", path);
        if let Some(tooltip) = tooltip {
            element.append(Title::new(tooltip));
        }
        self.add(element);
    }

    /// Adds a rectangle from its top left corner, width and height.
    pub(super) fn area(&mut self, class: &str, [x, y, width, height]: [f64; 4], tooltip: Option<&str>) {
        let path = format!("M{} {}h{}v{}h-{}z", number(x), number(y), number(width), number(height), number(width));
        self.path(class, &path, tooltip);
    }

    pub(super) fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        self.path(class, &format!("M{}L{}", point(from), point(to)), None);
    }
}

/// Formats a number rounded to a tenth, as short as possible.
pub(super) fn number(value: f64) -> String {
    let tenths = libm::round(value * 10.0) / 10.0;
    // Avoid `-0`.
    if tenths == 0.0 { "0".to_owned() } else { format!("{tenths}") }
}

pub(super) fn point((x, y): (f64, f64)) -> String {
    format!("{} {}", number(x), number(y))
}

/// The approximate width of a text at a font size in pixels. Letters of the font are 0.6 of it on
/// average; East Asian ones are square.
pub(super) fn width(text: &str, size: f64) -> f64 {
    text.chars().map(|letter| if u32::from(letter) < 0x1100 { 0.6 } else { 1.0 }).sum::<f64>() * size
}

/// Shortens a text to the available width; empty if nothing meaningful is left.
pub(super) fn fit(text: &str, size: f64, room: f64) -> String {
    if width(text, size) <= room {
        return text.to_owned();
    }
    let mut fitted = String::new();
    for letter in text.chars() {
        fitted.push(letter);
        if width(&fitted, size) + size > room {
            fitted.pop();
            break;
        }
    }
    let fitted = fitted.trim_end();
    if fitted.chars().count() < 2 { String::new() } else { format!("{fitted}…") }
}

/// Converts values, each of which stays until the next one, to step curves. If several points share
/// a pixel column, only the first, the lowest, the highest and the last are kept. `None` is a gap.
pub(super) fn steps(points: impl Iterator<Item = (f64, Option<f64>)>, end: f64) -> Vec<Vec<(f64, f64)>> {
    let mut runs: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut run: Vec<(f64, f64)> = Vec::new();
    let mut column: Vec<(f64, f64)> = Vec::new();
    let flush = |column: &mut Vec<(f64, f64)>, run: &mut Vec<(f64, f64)>| {
        if column.len() > 4 {
            let by_height = |left: &usize, right: &usize| {
                let height = |at: &usize| column.get(*at).map_or(0.0, |point| point.1);
                height(left).total_cmp(&height(right))
            };
            let least = (0..column.len()).min_by(by_height).unwrap_or(0);
            let most = (0..column.len()).max_by(by_height).unwrap_or(0);
            let mut kept = [0, least.min(most), least.max(most), column.len() - 1].to_vec();
            kept.dedup();
            run.extend(kept.into_iter().filter_map(|at| column.get(at)));
            column.clear();
        }
        run.append(column);
    };
    for (x, y) in points {
        let is_same = column.last().is_some_and(|(last, _)| libm::floor(*last) == libm::floor(x));
        if !is_same || y.is_none() {
            flush(&mut column, &mut run);
        }
        match y {
            Some(y) => column.push((x, y)),
            None => {
                if let Some((_, y)) = run.last().copied() {
                    run.push((x, y));
                    runs.push(std::mem::take(&mut run));
                }
            }
        }
    }
    flush(&mut column, &mut run);
    if let Some((_, y)) = run.last().copied() {
        run.push((end, y));
        runs.push(run);
    }
    runs
}

/// A path of horizontal and vertical lines.
pub(super) fn stairs(run: &[(f64, f64)]) -> String {
    let mut path = String::new();
    let mut last: Option<(String, String)> = None;
    for (x, y) in run {
        let (x, y) = (number(*x), number(*y));
        match &last {
            None => path = format!("M{x} {y}"),
            Some((before_x, before_y)) => {
                if x != *before_x {
                    path.push('H');
                    path.push_str(&x);
                }
                if y != *before_y {
                    path.push('V');
                    path.push_str(&y);
                }
            }
        }
        last = Some((x, y));
    }
    path
}

/// A step of 1, 2 or 5 times a power of ten that is at least this large.
pub(super) fn round_step(least: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(least.max(1e-9))));
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| *step >= least).unwrap_or(power * 10.0)
}
