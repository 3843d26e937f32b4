//! The paths of the robots, seen from above. Several robots start side by side, in the order of `robots`.

use std::fmt::Write as _;

use super::super::canvas::{Anchor, Canvas, fit, number, point, round_step, width};
use super::super::{Place, Robot};
use super::end_words;
use crate::units::Micros;

/// The distance between two drawings of the robot on its path, in pixels.
const APART: f64 = 46.0;
/// The maximum number of places of a path.
const MOST: usize = 20_000;
/// The maximum number of marks.
const MARKS: usize = 100;
/// The distance between a place and a name beside it, in pixels.
const BESIDE: f64 = 10.0;
/// The smallest area shown, in cm.
const LEAST_CM: f64 = 20.0;

/// The path of one robot.
pub(super) struct Way<'p> {
    /// The name and the number of the robot; `None` for the only robot of a script.
    robot: Option<(&'p str, usize)>,
    path: &'p [Place],
    /// The distance of its start from that of the first robot, to the right.
    start_cm: f64,
}

impl Way<'_> {
    /// The class of a shape in the color of the robot.
    fn class(&self, class: &str, colored: &str) -> String {
        self.robot.map_or_else(|| class.to_owned(), |(_, number)| format!("{class} {colored}-{number}"))
    }

    /// The smallest and the largest value of its places and its start.
    fn range(&self, of: fn(&Place) -> f64) -> (f64, f64) {
        let values = || self.path.iter().map(of);
        (values().fold(0.0, f64::min), values().fold(0.0, f64::max))
    }
}

/// The paths of the robots that drive. Their starts are far enough apart to see equal paths.
pub(super) fn ways<'p>(robots: &'p [Robot]) -> Vec<Way<'p>> {
    let driving = robots.iter().enumerate().filter(|(_, track)| track.goes_away());
    let way = |(number, track): (usize, &'p Robot)| Way {
        robot: track.robot.as_deref().filter(|_| robots.len() > 1).map(|name| (name, number)),
        path: &track.path,
        start_cm: 0.0,
    };
    let mut ways: Vec<Way<'p>> = driving.map(way).collect();
    let extent = |of: fn(&Place) -> f64| {
        let extents = ways.iter().map(|way| way.range(of)).map(|(low, high)| high - low);
        extents.fold(0.0, f64::max)
    };
    let (wide, high) = (extent(|place| place.x_cm), extent(|place| place.y_cm));
    let apart_cm = round_step((wide / 3.0).max(high / 6.0).max(LEAST_CM));
    ways.iter_mut().fold(0.0, |start_cm, way| {
        way.start_cm = start_cm;
        start_cm + apart_cm
    });
    ways
}

/// Draws paths into a square. Returns the position of its bottom.
pub(super) fn draw(canvas: &mut Canvas, [x, y, side]: [f64; 3], ways: &[Way<'_>], marks: &[(&str, Micros)]) -> f64 {
    canvas.text((x, y + 11.0), "name", Anchor::Start, "top view");
    let top = y + 18.0;
    canvas.area("lane", [x, top, side, side], None);
    let map = Map::of(ways, [x, top, side]);
    map.grid(canvas, [x, top, side]);
    let mut labels = Vec::new();
    // The robot along its path without overlaps, also with other robots, and at its start and its end.
    let ends =
        ways.iter().flat_map(|way| [way.path.first(), way.path.last()].map(|end| end.map(|end| map.place(way, end))));
    let mut drawn: Vec<(f64, f64)> = ends.flatten().collect();
    for way in ways {
        self::way(canvas, &map, way, &mut drawn);
        if let (Some((name, number)), Some(start)) = (way.robot, way.path.first()) {
            // Below its start.
            let (px, py) = map.place(way, start);
            let left = width(&fit(name, 12.0, side / 2.0), 12.0) / 2.0 + BESIDE;
            labels.push(Label { text: name, at: (px - left, py + 16.0), robot: Some(number) });
        }
    }
    // The names of marks are on the first path.
    for (way, is_first) in ways.iter().zip(std::iter::once(true).chain(std::iter::repeat(false))) {
        labels.extend(marks.iter().take(MARKS).filter_map(|(name, at)| {
            let index = way.path.partition_point(|place| place.at <= *at).saturating_sub(1);
            let at = map.place(way, way.path.get(index)?);
            Some(Label { text: if is_first { name } else { "" }, at, robot: None })
        }));
    }
    let hidden = self::labels(canvas, [x, top, side], &labels) + marks.len().saturating_sub(MARKS);
    let more = (hidden > 0).then(|| format!("and {hidden} more mark{}", if hidden == 1 { "" } else { "s" }));
    let mut down = top + side + 17.0;
    let mut line = |gap: f64, class: &str, text: &str| {
        canvas.text((x, down + gap), class, Anchor::Start, text);
        down += gap + 16.0;
    };
    if let Some(more) = &more {
        line(0.0, "soft", more);
    }
    for way in ways {
        if let Some((name, number)) = way.robot {
            line(6.0, &format!("name robot-{number}"), &fit(name, 14.0, side));
        }
        way.path.last().iter().flat_map(|end| end_words(end)).for_each(|words| line(0.0, "soft", &words));
    }
    line(
        if ways.len() > 1 { 6.0 } else { 0.0 },
        "soft",
        &format!("○ start, ▲ end; grid {} cm, nominal", number(map.grid_cm)),
    );
    if let Some(second) = ways.get(1) {
        line(0.0, "soft", &format!("drawn with starts {} cm apart", number(second.start_cm)));
    }
    down - 8.0
}

/// Draws one path, and the robot on it where nothing is drawn.
fn way(canvas: &mut Canvas, map: &Map, way: &Way<'_>, drawn: &mut Vec<(f64, f64)>) {
    let places: Vec<(f64, f64)> = way.path.iter().map(|place| map.place(way, place)).collect();
    let mut path = String::new();
    for place in thinned(&places) {
        path.push(if path.is_empty() { 'M' } else { 'L' });
        path.push_str(&point(place));
    }
    canvas.path(&way.class("road", "road"), &path, None);
    let (Some((sx, sy)), Some(end)) = (places.first(), way.path.last()) else { return };
    let name = way.robot.map(|(name, _)| format!("{name}: ")).unwrap_or_default();
    let [start, last] = ["start", "end"].map(|what| format!("{name}{what}"));
    let circle = format!("M{}a6 6 0 1 0 12 0a6 6 0 1 0 -12 0z", point((sx - 6.0, *sy)));
    canvas.path(&way.class("start", "start"), &circle, Some(&start));
    let body = way.class("body", "robot");
    for (place, at) in way.path.iter().zip(&places) {
        if drawn.iter().all(|other| apart(*at, *other) >= APART) {
            drawn.push(*at);
            canvas.path(&body, &robot(*at, place.yaw_deg, 6.0), None);
        }
    }
    canvas.path(&body, &robot(map.place(way, end), end.yaw_deg, 11.0), Some(&last));
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
    fn of(ways: &[Way<'_>], [x, y, side]: [f64; 3]) -> Self {
        let range = |ranges: &dyn Fn(&Way<'_>) -> (f64, f64)| {
            let join = |(low, high): (f64, f64), (left, right)| (low.min(left), high.max(right));
            ways.iter().map(ranges).fold((0.0, 0.0), join)
        };
        let (left, right) = range(&|way| {
            let (left, right) = way.range(|place| place.x_cm);
            (left + way.start_cm, right + way.start_cm)
        });
        let (back, front) = range(&|way| way.range(|place| place.y_cm));
        let large = (right - left).max(front - back).max(LEAST_CM);
        Map {
            middle_cm: (f64::midpoint(left, right), f64::midpoint(back, front)),
            middle: (x + side / 2.0, y + side / 2.0),
            scale: (side - 56.0) / large,
            grid_cm: round_step(large / 5.0),
        }
    }

    fn place(&self, way: &Way<'_>, place: &Place) -> (f64, f64) {
        self.point((place.x_cm + way.start_cm, place.y_cm))
    }

    fn point(&self, (x_cm, y_cm): (f64, f64)) -> (f64, f64) {
        let (x, y) = self.middle_cm;
        (self.middle.0 + (x_cm - x) * self.scale, self.middle.1 - (y_cm - y) * self.scale)
    }

    /// Grid lines at round positions; one goes through the start.
    fn grid(&self, canvas: &mut Canvas, [x, y, side]: [f64; 3]) {
        let step = self.grid_cm * self.scale;
        let zero = self.point((0.0, 0.0));
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

/// A name in the picture. A robot's name has its color; a mark has a square, and its name is empty on all paths
/// except the first.
struct Label<'p> {
    text: &'p str,
    at: (f64, f64),
    robot: Option<usize>,
}

/// Writes names beside, above or below their places, where there is room. Returns the number of marks without
/// room.
fn labels(canvas: &mut Canvas, [x, _, side]: [f64; 3], labels: &[Label<'_>]) -> usize {
    let mut taken: Vec<(f64, f64, f64)> = Vec::new();
    let mut hidden = 0;
    for Label { text, at: (px, py), robot } in labels {
        let (px, py) = (*px, *py);
        let name = fit(text, 12.0, side / 2.0);
        let wide = width(&name, 12.0);
        let sides = [0.0, -14.0, 14.0, -28.0, 28.0]
            .into_iter()
            .flat_map(|down| [px + BESIDE, px - BESIDE - wide].map(|from| (from, py + down)));
        let found = sides.into_iter().find(|(from, y)| {
            let is_inside = *from >= x && from + wide <= x + side;
            is_inside
                && taken
                    .iter()
                    .all(|(left, right, other)| from > right || from + wide < *left || (y - other).abs() >= 14.0)
        });
        if robot.is_none() {
            canvas.path("expect", &format!("M{}h5v5h-5z", point((px - 2.5, py - 2.5))), None);
        }
        if text.is_empty() {
            continue;
        }
        let Some((from, y)) = found else {
            hidden += usize::from(robot.is_none());
            continue;
        };
        taken.push((from, from + wide, y));
        let class = robot.map_or_else(|| "value".to_owned(), |number| format!("value robot-{number}"));
        canvas.text((from, y + 4.0), &class, Anchor::Start, &name);
    }
    hidden
}
