//! Warnings that need the order in time, one file each: when each is given, and what it says.

pub(super) mod left_running;
pub(super) mod long_hold;
pub(super) mod servo_speed;
