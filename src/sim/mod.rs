//! The virtual board: takes bytes as a real one does, keeps what it was told, and says what it received.

mod served;

use crate::board::{Command, Decoder, Item, NotACommand, Skip, State};

pub use served::serve;

/// A board that exists only here. It decodes strictly and knows no clock.
#[derive(Debug, Default)]
pub struct VirtualBoard {
    decoder: Decoder,
    received: Received,
}

/// What a board has received.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// All bytes.
    pub bytes: u64,
    /// Frames that were understood.
    pub frames: u64,
    /// Whole frames that say nothing the board knows.
    pub not_understood: u64,
    /// Bytes that belong to no frame.
    pub skipped: u64,
    /// The first thing that was wrong, with its position in the stream.
    pub first_fault: Option<(u64, Fault)>,
    /// What the board was last told.
    pub state: State,
}

/// What was wrong with received bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// Bytes that are no frame.
    #[error(transparent)]
    Skipped(Skip),
    /// A frame that is no command.
    #[error(transparent)]
    NotACommand(NotACommand),
}

impl VirtualBoard {
    /// A board that was just switched on.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes off the line.
    pub fn receive(&mut self, bytes: &[u8]) {
        let VirtualBoard { decoder, received } = self;
        decoder.feed(bytes, |item| received.take(item));
    }

    /// The line is closed: what was cut off counts as skipped.
    pub fn finish(mut self) -> Received {
        let VirtualBoard { decoder, received } = &mut self;
        decoder.finish(|item| received.take(item));
        self.received
    }
}

impl Received {
    fn take(&mut self, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                let at = self.bytes;
                self.bytes += frame.bytes().len() as u64;
                match Command::decode(frame) {
                    Ok(command) => {
                        self.frames += 1;
                        self.state.apply(&command);
                    }
                    Err(error) => {
                        self.not_understood += 1;
                        self.fault(at, Fault::NotACommand(error));
                    }
                }
            }
            Item::Skipped { at, bytes, why } => {
                self.bytes += bytes.len() as u64;
                self.skipped += bytes.len() as u64;
                self.fault(at, Fault::Skipped(why));
            }
        }
    }

    fn fault(&mut self, at: u64, fault: Fault) {
        self.first_fault.get_or_insert((at, fault));
    }
}
