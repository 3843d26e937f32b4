//! Plays a timeline: the only room that knows a clock and a port.
//!
//! [`Player`] decides and holds neither: time and everything that happens are its inputs, so tests play an hour in no time.
//! [`drive`] is the loop that asks it what to do and does it, under the real clock.

mod driver;
mod os;
mod player;

pub use driver::drive;
pub use os::Signals;
pub use player::{Cause, Input, Notice, Order, Outcome, Player, Stop};
