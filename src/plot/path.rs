//! The path of a robot, computed by the virtual board.

use std::sync::Arc;

use super::Place;
use crate::board::{Command, Simulation};
use crate::sim::{Device, Pose, Settings};
use crate::timeline::Timeline;
use crate::units::Micros;

/// The maximum number of places, not counting corners, and the minimum distance and rotation
/// between two of them.
const PLACES: u64 = 4_000;
const NEAR_CM: f64 = 0.5;
const NEAR_DEG: f64 = 2.0;
/// The minimum time between two samples.
const LOOK: Micros = Micros::from_millis(20);

/// The poses of the robot from start to end; empty if it does not move.
pub(super) fn path(timeline: &Timeline) -> Vec<Place> {
    let Timeline { board, events, end, .. } = timeline;
    if board.simulation != Simulation::Mecanum {
        return Vec::new();
    }
    let mut path = PathTracer {
        board: Device::new(Arc::clone(board), Settings::default()),
        look: Micros(end.0 / PLACES).max(LOOK),
        now: Micros::ZERO,
        places: vec![Place::new(Micros::ZERO, Pose::default())],
        last: None,
    };
    let drives = |command: &Command| board.is_drive(command) || board.is_needed(command.verb());
    for event in events.iter().filter(|event| drives(&event.command)) {
        path.pass(event.at);
        path.turns(&event.command);
        path.board.poll(event.at);
        path.board.obey(&event.command);
    }
    path.pass(*end);
    let PathTracer { board, mut places, .. } = path;
    let last = Place::new(*end, board.received().pose);
    if places.len() == 1 && is_near(&Place::new(Micros::ZERO, Pose::default()), &last, 0.01) {
        return Vec::new();
    }
    places.push(last);
    places
}

struct PathTracer {
    board: Device,
    look: Micros,
    now: Micros,
    places: Vec<Place>,
    last: Option<Command>,
}

impl PathTracer {
    /// Adds a place at a new command, because the path may have a corner there.
    fn turns(&mut self, command: &Command) {
        if self.last.as_ref() == Some(command) {
            return;
        }
        self.last = Some(command.clone());
        let place = Place::new(self.now, self.board.received().pose);
        if self.places.last().is_none_or(|last| !is_near(last, &place, 0.01)) {
            self.places.push(place);
        }
    }

    /// Advances the time, and samples the pose.
    fn pass(&mut self, to: Micros) {
        while self.now < to {
            self.now = (self.now + self.look).min(to);
            self.board.poll(self.now);
            let place = Place::new(self.now, self.board.received().pose);
            if self.places.last().is_none_or(|last| !is_near(last, &place, 1.0)) {
                self.places.push(place);
            }
        }
    }
}

fn is_near(left: &Place, right: &Place, part: f64) -> bool {
    libm::hypot(left.x_cm - right.x_cm, left.y_cm - right.y_cm) < NEAR_CM * part
        && (left.yaw_deg - right.yaw_deg).abs() < NEAR_DEG * part
}
