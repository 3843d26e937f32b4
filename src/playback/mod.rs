//! Plays a timeline: the only room that knows a clock and a port.
//!
//! [`Player`] decides and holds neither: time and everything that happens are its inputs, so tests play an hour in no time.
//! [`drive`] is the loop that asks it what to do and does it, under the real clock. A [`Guard`] is a second process that
//! stops the robot if this one cannot.

mod driver;
mod guard;
mod halt;
mod judge;
mod latency;
mod messages;
pub(crate) mod os;
mod player;
mod stop;
mod watch;

pub use crate::clock::now;
pub use driver::{Rig, drive};
pub use guard::{Guard, Guarded, Ward, frames, guard};
pub use halt::Stops;
pub use judge::{Found, Verdict};
pub use latency::lateness;
pub use messages::{Cause, Input, Notice, Order, Outcome, Stop};
pub use os::{Keys, Realtime, Signals, is_in_foreground};
pub use player::Player;
pub use watch::Fate;

pub(crate) use halt::Outbox;
pub(crate) use stop::stop_robot;
