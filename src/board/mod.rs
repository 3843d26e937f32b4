//! The Raspblock driver board: typed commands and the frames that carry them.
//!
//! This room knows what goes over the wire and nothing else: neither times nor ports. A [`Command`] holds only values
//! that the board takes, so whatever can be built can be sent.
//!
//! - [`Command`] is plain meaning; [`Command::encode`] and [`Command::decode`] are the two ways to its bytes.
//! - [`Frame`] is a checked view of bytes; [`Decoder`] finds frames in a stream and says what it skipped.
//! - [`ReportDecoder`] reads what the board sends back.
//! - [`State`] is what the board was last told.

mod command;
mod decoder;
mod frame;
mod number;
mod report;
mod state;

pub use command::{Command, Gains, MOST_ZEROS, Mode, MovePacking, NotACommand, Query, zeros_behind_flush};
pub use decoder::{Decoder, Item, Skip};
pub use frame::{Frame, FrameError, HEADER, Hex, MAX_FRAME, MAX_PAYLOAD, Payload};
pub use number::{Displacement, OutOfRange, PulseWidth, Ranged, ServoIndex, Speed, TiltPulseWidth, TurnRate};
pub use report::{Hundredths, Report, ReportDecoder, ReportItem};
pub use state::State;

/// What every text says of a board that no frames reach; docs/safety.md has the test.
pub const ON_SILENCE: &str = "what the board does when frames stop is unknown; docs/safety.md has a test for it";

/// Speed of the serial line that the board expects, in bits a second (8N1: ten bits a byte).
pub const DEFAULT_BAUD: u32 = 115_200;
