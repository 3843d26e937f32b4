//! What a script can say to a board, as data: a [`Board`] is a table of resources, verbs and axes, with the codec of its frames.
//!
//! A family of boards is such a table, in a folder of its own; nothing outside of that folder knows its words. This room knows what
//! goes over the wire and nothing else: neither times nor ports.
//!
//! - [`Board`] says what there is; [`Verb`] is one command, [`Axis`] one value of it, [`Resource`] what it sets.
//! - [`Command`] is a verb with its values; [`Board::encode`] and [`Board::decode`] are the two ways to its bytes.
//! - [`Decoder`] finds frames in a stream and says what it skipped.
//! - [`State`] is what a board was last told.

mod command;
mod decoder;
mod frame;
mod picture;
mod quantity;
pub mod raspblock;
mod rules;
mod state;
mod table;

pub use command::{Command, MAX_MOVING, Values, VerbId};
pub use decoder::{Decoder, Frame, Item};
pub use frame::{FrameError, Front, Hex, Skip};
pub use quantity::{Hundredths, MAX_QUANTITIES, Quantity, Report, ReportDecoder, ReportItem, ReportLine};
pub use rules::Notation;
pub use state::State;
pub use table::{
    Activity, Axis, Board, Codec, Ambiguity, Lane, LaneKind, Limited, Needs, NotACommand, OutOfRange, Part, Picture,
    DefaultLimit, Resource, ResourceId, Sets, Shown, Simulation, Takes, Unit, Verb,
};

/// A string of a table: that of a family which is built in, or one that was read from a file.
pub type Text = std::borrow::Cow<'static, str>;

/// What every text says of a board that no frames reach; docs/safety.md has the test.
pub const ON_SILENCE: &str = "what the board does when frames stop is unknown; docs/safety.md has a test for it";
