//! The virtual board: takes bytes as a real one does, keeps what it was told, moves, and reports.
//!
//! It holds no clock: time is an input, so that the same board is behind a pseudo-terminal in real time (`serve`) and
//! under a clock that jumps. What the maker of the board does not publish is nominal here, and can be set ([`Settings`]). The device
//! itself never fails; what goes wrong ([`Faults`]) is put around it.

mod device;
mod faults;
mod motion;

use std::sync::Arc;

pub use crate::board::raspblock::{Geometry, Twist};
use crate::board::{Board, Decoder, Hundredths, Item, NotACommand, Report, Skip, State};
use crate::units::Micros;
use device::Device;
use faults::Dice;

pub use faults::{Faults, NotAFault, volts};
pub use motion::Pose;

/// What a board is like, and what goes wrong with it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Nominal units, and the size of the robot.
    pub geometry: Geometry,
    /// The battery's voltage at rest, in hundredths of a volt.
    pub battery: Hundredths,
    /// After how long without a drive frame the robot stops; `None` for never. The real board's is not published.
    pub silence: Option<Micros>,
    /// The time between two reports.
    pub report_every: Micros,
    /// What goes wrong.
    pub faults: Faults,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            geometry: Geometry::default(),
            battery: Hundredths(1_200),
            silence: Some(Micros::from_millis(500)),
            report_every: Micros::from_millis(100),
            faults: Faults::default(),
        }
    }
}

impl Settings {
    /// The usual board, and these faults.
    pub fn with_faults(faults: Faults) -> Self {
        Settings { faults, ..Settings::default() }
    }
}

/// A board that exists only here, with the faults of its settings around it. It decodes strictly.
#[derive(Debug)]
pub struct VirtualBoard {
    device: Device,
    faults: Faults,
    decoder: Decoder,
    /// For frames, and for reports: so that neither changes what befalls the other.
    dice: [Dice; 2],
    replies: Vec<u8>,
}

/// What a board has received, and what became of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Received {
    /// All bytes.
    pub bytes: u64,
    /// Frames that were understood.
    pub frames: u64,
    /// Whole frames that say nothing the board knows.
    pub not_understood: u64,
    /// Bytes that belong to no frame, but for the zeros of a stop.
    pub skipped: u64,
    /// The first thing that was wrong, with its position in the stream.
    pub first_fault: Option<(u64, Fault)>,
    /// Frames that a fault of the rehearsal has kept from the board, or spoiled.
    pub lost: u64,
    /// What the board was last told.
    pub state: State,
    /// Where the robot is.
    pub pose: Pose,
    /// Whether it moves: a speed holds, or a displacement is under way.
    pub moves: bool,
}

/// What was wrong with received bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// Bytes that are no frame.
    #[error(transparent)]
    Skipped(Skip),
    /// A frame that is no command.
    #[error(transparent)]
    NotACommand(NotACommand),
}

impl VirtualBoard {
    /// A board that is switched on at time 0.
    pub fn new(of: Arc<Board>, settings: Settings) -> Self {
        let Settings { geometry, battery, silence, report_every, faults } = settings;
        let decoder = Decoder::new(&of);
        let mut device = Device::new(of, geometry);
        (device.battery, device.silence, device.report_every) = (battery, silence, report_every.max(Micros(1)));
        let mut board = VirtualBoard {
            device,
            decoder,
            dice: [0, 1].map(|stream| Dice::new(faults.seed.wrapping_add(stream << 32))),
            replies: Vec::new(),
            faults,
        };
        board.poll(Micros::ZERO);
        board
    }

    /// Takes bytes off the line at a time since it was switched on.
    pub fn receive(&mut self, now: Micros, bytes: &[u8]) {
        self.poll(now);
        let VirtualBoard { device, faults, decoder, dice: [dice, _], .. } = self;
        decoder.feed(bytes, |item| match item {
            // A frame with a wrong bit has a wrong checksum.
            Item::Frame(frame) if dice.happens(faults.drop) || dice.happens(faults.garble) => {
                device.received.bytes += frame.bytes().len() as u64;
                device.received.lost += 1;
            }
            item => device.take(item),
        });
        self.reply();
    }

    /// Lets time pass. It never goes back.
    pub fn poll(&mut self, now: Micros) {
        if let Some((hundredths, from)) = self.faults.battery.take_if(|(_, from)| *from <= now) {
            // What it reports before that is of the old one.
            self.device.poll(from - Micros(1));
            self.device.battery = Hundredths(hundredths);
        }
        self.device.poll(now);
        self.reply();
    }

    /// Sends what it has to report, as far as that gets through.
    fn reply(&mut self) {
        let Faults { drop, garble, silent, .. } = self.faults;
        let [_, dice] = &mut self.dice;
        for report in std::mem::take(&mut self.device.reports) {
            let mut line = self.device.board.report_line(&report).into_bytes();
            if silent || dice.happens(drop) {
                continue;
            }
            if dice.happens(garble) {
                dice.garble(&mut line);
            }
            self.replies.extend(line);
        }
    }

    /// When it has something to do next, since it was switched on.
    pub fn next_due(&self) -> Option<Micros> {
        self.device.next_due()
    }

    /// What it has to send, which is taken from it.
    pub fn replies(&mut self) -> std::vec::Drain<'_, u8> {
        self.replies.drain(..)
    }

    /// What it has received so far, and what became of it.
    pub fn received(&self) -> &Received {
        &self.device.received
    }

    /// The family that it is of.
    pub fn family(&self) -> &Arc<Board> {
        &self.device.board
    }

    /// When its cable is pulled, if it is.
    pub fn unplugged(&self) -> Option<Micros> {
        self.faults.unplug
    }

    /// When it stops taking bytes, if it does.
    pub fn stalled(&self) -> Option<Micros> {
        self.faults.stall
    }

    /// What it would report now.
    pub fn report(&self) -> Report {
        self.device.report()
    }

    /// The line is closed: what was cut off counts as skipped.
    pub fn finish(mut self) -> Received {
        let VirtualBoard { device, decoder, .. } = &mut self;
        decoder.finish(|item| device.take(item));
        let moves = self.device.moves();
        Received { moves, ..self.device.received }
    }
}
