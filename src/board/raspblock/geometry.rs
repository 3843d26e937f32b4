//! How drive commands move the robot, in nominal units: mecanum kinematics.
//!
//! The maker of the board publishes neither units of speed nor the size of the robot. Here, one
//! unit of x and y is 1 cm/s, one unit of z is 1 °/s, one unit of `move` is 1 cm or 1°, and
//! [`Geometry::lever_cm`] is the distance of a wheel's contact point from the middle: half the
//! wheel base plus half the track.

use super::verb;
use crate::board::Command;

/// The nominal units and the size of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// One unit of x and y in cm/s.
    pub cm_s: f64,
    /// One unit of z in degrees per second.
    pub deg_s: f64,
    /// Half the wheel base plus half the track, in cm.
    pub lever_cm: f64,
    /// The speed of `move` in cm/s, and in degrees per second.
    pub move_speed: (f64, f64),
}

impl Default for Geometry {
    fn default() -> Self {
        Geometry { cm_s: 1.0, deg_s: 1.0, lever_cm: 17.0, move_speed: (25.0, 90.0) }
    }
}

/// The velocity of the body in its own frame of reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// To the right, in cm/s.
    pub x: f64,
    /// Forward, in cm/s.
    pub y: f64,
    /// Clockwise, in degrees per second.
    pub z: f64,
}

impl Geometry {
    /// The velocity that a drive command sets. `None` for a displacement and for commands that do
    /// not drive.
    pub(crate) fn twist(&self, command: &Command) -> Option<Twist> {
        let value = |at: usize| command.value(at).map(f64::from);
        let speed = |at: usize| Some(value(at)? * self.cm_s);
        Some(match command.verb() {
            verb::ROCKER => Twist { x: speed(0)?, y: speed(1)?, z: value(2)? * self.deg_s },
            verb::YAW_HOLD => Twist { x: speed(0)?, y: speed(1)?, z: 0.0 },
            verb::WHEELS => {
                let (front_right, rear_right, rear_left, front_left) = (speed(0)?, speed(1)?, speed(2)?, speed(3)?);
                // The inverse of FL = y + x + z, FR = y - x - z, RL = y - x + z, RR = y + x - z.
                let z = (front_left + rear_left - front_right - rear_right) / 4.0;
                Twist {
                    x: (front_left + rear_right - front_right - rear_left) / 4.0,
                    y: (front_left + rear_right + front_right + rear_left) / 4.0,
                    z: (z / self.lever_cm).to_degrees(),
                }
            }
            _ => return None,
        })
    }

    /// The displacement that a command requests: to the right and forward in cm, clockwise in
    /// degrees. `None` for other commands.
    pub fn displacement(command: &Command) -> Option<[f64; 3]> {
        let value = |at: usize| command.value(at).map(f64::from);
        let values = [value(0)?, value(1)?, value(2)?];
        (command.verb() == verb::MOVE).then_some(values)
    }
}
