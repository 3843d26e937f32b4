//! Where the virtual robot is, in the nominal units of its [`Geometry`], in closed form between two commands.

use crate::board::Command;
use crate::board::raspblock::{Geometry, Twist};

/// Where the robot is, seen from above; it starts at the origin and looks along y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// To the right of where it started, in cm.
    pub x_cm: f64,
    /// Before where it started, in cm.
    pub y_cm: f64,
    /// Turned clockwise, in degrees; not wrapped.
    pub yaw_deg: f64,
}

impl Pose {
    /// Where it is after so many seconds at an even speed: a line or a part of a circle.
    #[must_use]
    pub fn after(self, twist: Twist, seconds: f64) -> Pose {
        let turned = (twist.z * seconds).to_radians();
        // Along the body's own axes: the integral of a turning vector.
        let (along, across) = if turned.abs() < 1e-9 {
            (seconds, 0.0)
        } else {
            (seconds * libm::sin(turned) / turned, seconds * (1.0 - libm::cos(turned)) / turned)
        };
        // Clockwise: what was forward turns to the right.
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

/// What the drive does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drive {
    /// It goes on at this speed.
    Holds(Twist),
    /// It moves to a place in a time that is left, in seconds.
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

    /// Lets time pass.
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

    /// Takes a command; what does not drive changes nothing, and nor does a displacement in another mode than that for positions.
    pub(super) fn take(&mut self, command: &Command, is_in_position_mode: bool) {
        if let Some(twist) = self.geometry.twist(command) {
            self.drive = Drive::Holds(twist);
        } else if let Some([x, y, z]) = Geometry::displacement(command).filter(|_| is_in_position_mode) {
            let (cm_s, deg_s) = self.geometry.move_speed;
            let left = (libm::hypot(x, y) / cm_s).max(z.abs() / deg_s);
            // Where it looks now decides which way is forward.
            let straight = self.pose.after(Twist { x, y, z: 0.0 }, 1.0);
            let to = Pose { yaw_deg: self.pose.yaw_deg + z, ..straight };
            self.drive = if left > 0.0 { Drive::Moves { to, left } } else { Drive::Holds(Twist::default()) };
        }
    }

    pub(super) fn stop(&mut self) {
        self.drive = Drive::Holds(Twist::default());
    }

    /// How hard the motors work: 0 at rest, 1 at full speed ahead.
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

    /// Whether a speed is held, which the board ends when frames stop coming.
    pub(super) fn holds(&self) -> bool {
        matches!(self.drive, Drive::Holds(twist) if twist != Twist::default())
    }
}
