//! Where the virtual robot is, in the nominal units of its [`Geometry`], in closed form between two commands.

use crate::board::Command;
use crate::board::raspblock::{Geometry, Twist};

/// The position of the robot, seen from above. It starts at the origin and faces along y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// To the right of the start, in cm.
    pub x_cm: f64,
    /// Forward of the start, in cm.
    pub y_cm: f64,
    /// Turned clockwise, in degrees; not wrapped.
    pub yaw_deg: f64,
}

impl Pose {
    /// The position after this number of seconds at a constant speed: on a line or an arc.
    #[must_use]
    pub fn after(self, twist: Twist, seconds: f64) -> Pose {
        let turned = (twist.z * seconds).to_radians();
        // Along the axes of the body: the integral of a rotating vector.
        let (along, across) = if turned.abs() < 1e-9 {
            (seconds, 0.0)
        } else {
            (seconds * libm::sin(turned) / turned, seconds * (1.0 - libm::cos(turned)) / turned)
        };
        // Clockwise: forward turns to the right.
        let forward = twist.y * along - twist.x * across;
        let right = twist.x * along + twist.y * across;
        let yaw = self.yaw_deg.to_radians();
        let (sin, cos) = (libm::sin(yaw), libm::cos(yaw));
        Pose {
            x_cm: self.x_cm + right * cos + forward * sin,
            y_cm: self.y_cm - right * sin + forward * cos,
            yaw_deg: self.yaw_deg + twist.z * seconds,
        }
    }
}

/// The state of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drive {
    /// It moves at this speed.
    Holds(Twist),
    /// It moves to a position in the remaining time, in seconds.
    Moves { to: Pose, left: f64 },
}

/// The moving robot.
#[derive(Clone, Debug)]
pub(super) struct Body {
    geometry: Geometry,
    pose: Pose,
    drive: Drive,
}

impl Body {
    pub(super) fn new(geometry: Geometry) -> Self {
        Body { geometry, pose: Pose::default(), drive: Drive::Holds(Twist::default()) }
    }

    pub(super) fn pose(&self) -> Pose {
        self.pose
    }

    /// Advances the time.
    pub(super) fn pass(&mut self, seconds: f64) {
        match &mut self.drive {
            Drive::Holds(twist) => self.pose = self.pose.after(*twist, seconds),
            Drive::Moves { to, left } => {
                let part = if seconds >= *left { 1.0 } else { seconds / *left };
                let go = |from: f64, to: f64| if part >= 1.0 { to } else { from + (to - from) * part };
                self.pose = Pose {
                    x_cm: go(self.pose.x_cm, to.x_cm),
                    y_cm: go(self.pose.y_cm, to.y_cm),
                    yaw_deg: go(self.pose.yaw_deg, to.yaw_deg),
                };
                *left -= seconds;
                if part >= 1.0 {
                    self.stop();
                }
            }
        }
    }

    /// Takes a command. Commands that do not drive change nothing, and neither does a displacement outside of position mode.
    pub(super) fn take(&mut self, command: &Command, is_in_position_mode: bool) {
        if let Some(twist) = self.geometry.twist(command) {
            self.drive = Drive::Holds(twist);
        } else if let Some([x, y, z]) = Geometry::displacement(command).filter(|_| is_in_position_mode) {
            let (cm_s, deg_s) = self.geometry.move_speed;
            let left = (libm::hypot(x, y) / cm_s).max(z.abs() / deg_s);
            // The present heading decides which way is forward.
            let straight = self.pose.after(Twist { x, y, z: 0.0 }, 1.0);
            let to = Pose { yaw_deg: self.pose.yaw_deg + z, ..straight };
            self.drive = if left > 0.0 { Drive::Moves { to, left } } else { Drive::Holds(Twist::default()) };
        }
    }

    pub(super) fn stop(&mut self) {
        self.drive = Drive::Holds(Twist::default());
    }

    /// The load of the motors: 0 at rest, 1 at full speed forward.
    pub(super) fn load(&self) -> f64 {
        match self.drive {
            Drive::Holds(Twist { x, y, z }) => {
                let turning = z.to_radians().abs() * self.geometry.lever_cm;
                ((x.abs() + y.abs() + turning) / (25.0 * self.geometry.cm_s)).min(2.0)
            }
            Drive::Moves { .. } => 1.0,
        }
    }

    /// Whether it moves.
    pub(super) fn moves(&self) -> bool {
        self.holds() || matches!(self.drive, Drive::Moves { .. })
    }

    /// Whether a speed applies, which ends when frames stop.
    pub(super) fn holds(&self) -> bool {
        matches!(self.drive, Drive::Holds(twist) if twist != Twist::default())
    }
}
