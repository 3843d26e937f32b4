//! The path of a robot, seen from above.

use std::fmt::Write as _;

use super::super::Place;
use super::super::canvas::{Anchor, Canvas, fit, number, point, round_step, width};
use super::end_words;
use crate::units::Micros;

/// The distance between two drawings of the robot on its path, in pixels.
const APART: f64 = 46.0;
/// The maximum number of places of a path.
const MOST: usize = 20_000;
/// The maximum number of marks.
const MARKS: usize = 100;
/// The smallest area shown, in cm.
const LEAST_CM: f64 = 20.0;

/// Draws a path into a square. Returns the position of its bottom.
pub(super) fn draw(canvas: &mut Canvas, [x, y, side]: [f64; 3], way: &[Place], marks: &[(&str, Micros)]) -> f64 {
    canvas.text((x, y + 11.0), "name", Anchor::Start, "top view");
    let top = y + 18.0;
    canvas.area("lane", [x, top, side, side], None);
    let map = Map::of(way, [x, top, side]);
    map.grid(canvas, [x, top, side]);
    let places: Vec<(f64, f64)> = way.iter().map(|place| map.place(place)).collect();
    let mut path = String::new();
    for place in thinned(&places) {
        path.push(if path.is_empty() { 'M' } else { 'L' });
        path.push_str(&point(place));
    }
    canvas.path("road", &path, None);
    if let (Some((sx, sy)), Some(end)) = (places.first(), way.last()) {
        canvas.path("start", &format!("M{}a6 6 0 1 0 12 0a6 6 0 1 0 -12 0z", point((sx - 6.0, *sy))), Some("start"));
        // Draw the robot along the path without overlaps, and at the end.
        let mut drawn = vec![(*sx, *sy), map.place(end)];
        for (place, at) in way.iter().zip(&places) {
            if drawn.iter().all(|other| apart(*at, *other) >= APART) {
                drawn.push(*at);
                canvas.path("body", &robot(*at, place.yaw_deg, 6.0), None);
            }
        }
        canvas.path("body", &robot(map.place(end), end.yaw_deg, 11.0), Some("end"));
        let hidden = names(canvas, [x, top, side], (&map, way), marks);
        let mut down = top + side + 17.0;
        let more = (hidden > 0).then(|| format!("and {hidden} more mark{}", if hidden == 1 { "" } else { "s" }));
        for line in more.into_iter().chain(end_words(end)) {
            canvas.text((x, down), "soft", Anchor::Start, &line);
            down += 16.0;
        }
        canvas.text(
            (x, down),
            "soft",
            Anchor::Start,
            &format!("○ start, ▲ end; grid {} cm, nominal", number(map.grid_cm)),
        );
        return down + 8.0;
    }
    top + side
}

fn apart(left: (f64, f64), right: (f64, f64)) -> f64 {
    libm::hypot(left.0 - right.0, left.1 - right.1)
}

/// The points of a line; of a very long path only some.
fn thinned(places: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut least = 0.3;
    loop {
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for place in places {
            if kept.last().is_none_or(|last| apart(*last, *place) >= least) {
                kept.push(*place);
            }
        }
        kept.extend(places.last());
        if kept.len() <= MOST || least > 100.0 {
            return kept;
        }
        least *= 2.0;
    }
}

/// Converts centimetres to pixels.
struct Map {
    /// The centre, in centimetres and in pixels.
    middle_cm: (f64, f64),
    middle: (f64, f64),
    /// Pixels per centimetre.
    scale: f64,
    grid_cm: f64,
}

impl Map {
    fn of(way: &[Place], [x, y, side]: [f64; 3]) -> Self {
        let range = |of: fn(&Place) -> f64| {
            let low = way.iter().map(of).fold(0.0, f64::min);
            let high = way.iter().map(of).fold(0.0, f64::max);
            (low, high)
        };
        let (left, right) = range(|place| place.x_cm);
        let (back, front) = range(|place| place.y_cm);
        let large = (right - left).max(front - back).max(LEAST_CM);
        Map {
            middle_cm: (f64::midpoint(left, right), f64::midpoint(back, front)),
            middle: (x + side / 2.0, y + side / 2.0),
            scale: (side - 56.0) / large,
            grid_cm: round_step(large / 5.0),
        }
    }

    fn place(&self, place: &Place) -> (f64, f64) {
        let (x, y) = self.middle_cm;
        (self.middle.0 + (place.x_cm - x) * self.scale, self.middle.1 - (place.y_cm - y) * self.scale)
    }

    /// Grid lines at round positions; one goes through the start.
    fn grid(&self, canvas: &mut Canvas, [x, y, side]: [f64; 3]) {
        let step = self.grid_cm * self.scale;
        let zero = self.place(&Place { at: Micros::ZERO, x_cm: 0.0, y_cm: 0.0, yaw_deg: 0.0 });
        let mut path = String::new();
        let first = |zero: f64, from: f64| zero - libm::floor((zero - from) / step) * step;
        let (mut across, mut down) = (first(zero.0, x), first(zero.1, y));
        while across <= x + side {
            let _ = write!(path, "M{}v{}", point((across, y)), number(side));
            across += step;
        }
        while down <= y + side {
            let _ = write!(path, "M{}h{}", point((x, down)), number(side));
            down += step;
        }
        canvas.path("grid", &path, None);
    }
}

/// The outline of the robot, pointing forward.
fn robot((x, y): (f64, f64), yaw_deg: f64, size: f64) -> String {
    let (sin, cos) = (libm::sin(yaw_deg.to_radians()), libm::cos(yaw_deg.to_radians()));
    let corner = |right: f64, ahead: f64| point((x + right * cos + ahead * sin, y + right * sin - ahead * cos));
    format!(
        "M{}L{}L{}L{}z",
        corner(0.0, size),
        corner(0.65 * size, -0.8 * size),
        corner(0.0, -0.4 * size),
        corner(-0.65 * size, -0.8 * size)
    )
}

/// The names of marks at the places where they are passed: beside, above or below, where there is
/// room. Returns the number of names without room.
fn names(canvas: &mut Canvas, [x, _, side]: [f64; 3], (map, way): (&Map, &[Place]), marks: &[(&str, Micros)]) -> usize {
    let mut taken: Vec<(f64, f64, f64)> = Vec::new();
    let mut hidden = marks.len().saturating_sub(MARKS);
    for (name, at) in marks.iter().take(MARKS) {
        let index = way.partition_point(|place| place.at <= *at).saturating_sub(1);
        let Some(place) = way.get(index) else { continue };
        let (px, py) = map.place(place);
        let name = fit(name, 12.0, side / 2.0);
        let wide = width(&name, 12.0);
        let sides = [0.0, -14.0, 14.0, -28.0, 28.0]
            .into_iter()
            .flat_map(|down| [px + 10.0, px - 10.0 - wide].map(|from| (from, py + down)));
        let found = sides.into_iter().find(|(from, y)| {
            let is_inside = *from >= x && from + wide <= x + side;
            is_inside
                && taken
                    .iter()
                    .all(|(left, right, other)| from > right || from + wide < *left || (y - other).abs() >= 14.0)
        });
        canvas.path("expect", &format!("M{}h5v5h-5z", point((px - 2.5, py - 2.5))), None);
        let Some((from, y)) = found else {
            hidden += 1;
            continue;
        };
        taken.push((from, from + wide, y));
        canvas.text((from, y + 4.0), "value", Anchor::Start, &name);
    }
    hidden
}
