//! Plays a timeline.
//!
//! [`Player`] decides what to send. It has no clock and no port: time and events are its inputs, so tests run without waiting, on
//! every system. On Linux, with the feature `player`, a `Session` is the loop that carries out its orders under the real clock, and a
//! `Guard` is a second process that stops the robot if this one cannot.

mod conductor;
mod gate;
mod halt;
mod hold;
mod judge;
mod messages;
mod outbox;
mod player;

#[cfg(all(feature = "player", target_os = "linux"))]
mod company;
#[cfg(all(feature = "player", target_os = "linux"))]
mod controls;
#[cfg(all(feature = "player", target_os = "linux"))]
mod go_lines;
#[cfg(all(feature = "player", target_os = "linux"))]
mod guard;
#[cfg(all(feature = "player", target_os = "linux"))]
mod latency;
#[cfg(all(feature = "player", target_os = "linux"))]
pub(crate) mod os;
#[cfg(all(feature = "player", target_os = "linux"))]
mod session;
#[cfg(all(feature = "player", target_os = "linux"))]
mod stop;
#[cfg(all(feature = "player", target_os = "linux"))]
mod watchdog;

pub use conductor::Conductor;
pub use gate::{GateEnd, Passage, Seen};
pub use halt::Stops;
pub use judge::{Found, Verdict};
pub use messages::{
    Cause, Input, Notice, Order, Outcome, Piece, ServoFault, ServoFaultKind, ShortCommand, Standing, Stop, Why,
};
pub use player::Player;

#[cfg(all(feature = "player", target_os = "linux"))]
mod real {
    pub use super::company::{Company, Seat};
    pub use super::go_lines::GoLines;
    pub(crate) use super::guard::Heartbeat;
    pub use super::guard::{Guard, GuardConfig, Guarded, guard};
    pub use super::latency::lateness;
    pub use super::os::{Keys, Realtime, Signals, is_in_foreground};
    pub(crate) use super::outbox::Outbox;
    pub use super::session::Session;
    pub(crate) use super::stop::stop_robot;
    pub use super::watchdog::PlayerFailure;
    pub use crate::clock::now;
}
#[cfg(all(feature = "player", target_os = "linux"))]
pub use real::*;
