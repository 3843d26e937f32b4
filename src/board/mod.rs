//! Boards as data: a [`Board`] is a table of resources, verbs and axes, with the codec of its
//! frames.
//!
//! A family of boards is one such table in its own folder, and no code outside of that folder names
//! its commands. This module knows which bytes go over the wire; it knows neither times nor ports.
//!
//! - [`Board`] is the table; [`Verb`] is one command, [`Axis`] one value of it, [`Resource`] what
//!   it sets.
//! - [`Command`] is a verb with its values; [`Board::encode`] and [`Board::decode`] convert it to
//!   bytes and back.
//! - [`Decoder`] finds frames in a stream and reports the bytes that it skips.
//! - [`State`] is the last command of each resource.

mod command;
mod decoder;
mod families;
mod family;
mod frame;
pub mod maestro;
mod picture;
mod quantity;
pub mod raspblock;
mod reply_decoder;
mod rows;
mod rules;
mod state;
pub mod sts;
mod table;
pub mod text;
mod verb;

pub use command::{Command, MAX_MOVING, Values, VerbId};
pub use decoder::{Decoder, Frame, Item, OwnedItem};
pub use families::FAMILIES;
pub use family::{Family, FamilyNumber, FamilyOption, OptionValue};
pub use frame::{BufferStart, FrameError, Hex, Skip};
pub use quantity::{
    Answer, Answers, Change, Hundredths, MAX_VALUES, Quantity, Replies, Report, ReportItem, ReportLine,
};
pub use reply_decoder::ReportDecoder;
pub use rules::Notation;
pub use state::State;
pub use table::{
    Ambiguity, Board, Codec, DefaultLimit, Feedback, Lane, LaneKind, Limited, MAX_BAUD, NotACommand, OutOfRange,
    Picture, Preparation, Resource, Shown, Simulation,
};
pub use verb::{Activity, AngleScale, Axis, Forbidden, Measure, Needs, Part, ResourceId, Sets, Unit, ValueForm, Verb};

/// A string of a table: static in a built-in family, owned in one that was read from a file.
pub type Text = std::borrow::Cow<'static, str>;

/// The sentence about a board that gets no frames. docs/safety.md describes the test.
pub const ON_SILENCE: &str =
    "what the board does when frames stop arriving is unknown; docs/safety.md has a test for it";
