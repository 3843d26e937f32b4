//! How the robot is drawn: its servos, the velocity of its body, and its wheels if a script sets
//! them.

use super::geometry::Geometry;
use super::{PULSE, SPEED, TURN, text, verb};
use crate::board::Text;
use crate::board::table::{Lane, LaneKind, Limited, Picture, Shown};
use crate::board::{Board, Command};

/// The rows of the lanes.
const SERVO_1: usize = 0;
const BODY: usize = 4;
const WHEELS: usize = 7;
const MOVES: usize = 11;
const OTHER: usize = 12;
const YAW_HOLD: usize = 13;
const BUZZER: usize = 14;

pub(super) fn picture() -> Picture {
    let limited = |verb, axis| Limited { verb, index: None, axis };
    let servos = [("servo 1", "pan"), ("servo 2", "tilt"), ("servo 3", ""), ("servo 4", "")];
    let servos = (1..).zip(servos).map(|(index, (name, about))| {
        let limited = Limited { verb: verb::SERVO, index: Some(index), axis: None };
        curve((name, about), "µs", ["", ""], PULSE, vec![limited], None)
    });
    let [rocker, yaw_hold] = [verb::ROCKER, verb::YAW_HOLD];
    let body = [
        ("sideways", "cm/s", ["left", "right"], SPEED, vec![limited(rocker, Some(0)), limited(yaw_hold, Some(0))]),
        ("forward", "cm/s", ["back", "forward"], SPEED, vec![limited(rocker, Some(1)), limited(yaw_hold, Some(1))]),
        ("turn", "°/s", ["left", "right"], TURN, vec![limited(rocker, Some(2))]),
    ];
    let body = (1..)
        .zip(body)
        .map(|(group, (name, unit, ends, range, limited))| curve((name, ""), unit, ends, range, limited, Some(group)));
    let wheels =
        [("wheel A", "front right"), ("wheel B", "rear right"), ("wheel C", "rear left"), ("wheel D", "front left")];
    let wheels = wheels.map(|name| curve(name, "", ["", ""], SPEED, vec![limited(verb::WHEELS, None)], Some(0)));
    let plain = |name, kind| Lane { name: text(name), about: text(""), kind };
    let rest = [
        plain("move", LaneKind::Ticks { is_motion: true }),
        plain("other", LaneKind::Ticks { is_motion: false }),
        plain("yaw hold", LaneKind::Spans { text: text("the board keeps the heading"), is_strong: false }),
        plain("buzzer", LaneKind::Spans { text: text("on"), is_strong: true }),
    ];
    Picture { lanes: servos.chain(body).chain(wheels).chain(rest).collect(), draw }
}

#[expect(clippy::too_many_arguments, reason = "a row of the table")]
fn curve(
    (name, about): (&'static str, &'static str),
    unit: &'static str,
    ends: [&'static str; 2],
    range: (i32, i32),
    limited: Vec<Limited>,
    group: Option<u8>,
) -> Lane {
    let ends: [Text; 2] = ends.map(text);
    // A script that only stops the drive shows this lane, which most other scripts have too.
    let shows_rest = name == "forward";
    let range = (f64::from(range.0), f64::from(range.1));
    let kind = LaneKind::Curve { unit: text(unit), ends, range, limited, group, shows_rest };
    Lane { name: text(name), about: text(about), kind }
}

fn draw(board: &Board, command: &Command) -> Vec<(usize, Shown)> {
    let value = |value: i32| Shown::Value(Some(f64::from(value)));
    match command.verb() {
        verb::SERVO | verb::SERVOS => {
            let mut shown = Vec::new();
            board.each_part(command, |_, part| {
                let lane = part.value(0).and_then(|index| usize::try_from(index - 1).ok());
                shown.extend(lane.zip(part.value(1)).map(|(lane, pulse)| (SERVO_1 + lane, value(pulse))));
            });
            shown
        }
        verb::BUZZER => vec![(BUZZER, Shown::Switch(!command.is_zero()))],
        _ if board.is_drive(command) => {
            let mut shown = vec![(YAW_HOLD, Shown::Switch(command.verb() == verb::YAW_HOLD))];
            let twist = Geometry::default().twist(command);
            // The board decides how fast a displacement is.
            let body = twist.map_or([None; 3], |twist| [twist.x, twist.y, twist.z].map(Some));
            shown.extend((BODY..).zip(body.map(Shown::Value)));
            let wheels = match command.verb() {
                verb::WHEELS => [0, 1, 2, 3].map(|wheel| command.value(wheel).map(f64::from)),
                _ if board.is_active(command) || twist.is_none() => [None; 4],
                _ => [Some(0.0); 4],
            };
            shown.extend((WHEELS..).zip(wheels.map(Shown::Value)));
            match command.verb() {
                verb::MOVE => shown.push((MOVES, Shown::Tick)),
                verb::RAW => shown.push((OTHER, Shown::Tick)),
                _ => {}
            }
            shown
        }
        _ => vec![(OTHER, Shown::Tick)],
    }
}
