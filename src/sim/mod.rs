//! The virtual board: takes bytes as a real one does, keeps what it was told, moves, and reports.
//!
//! It holds no clock: time is an input, so that the same board stands behind a pseudo-terminal in real time ([`serve`]) and
//! under a clock that jumps. What the maker of the board does not publish is nominal here, and can be set ([`Settings`]).

mod faults;
mod hosted;
mod motion;
mod served;

use crate::board::{Command, Decoder, Hundredths, Item, NotACommand, Query, Report, Skip, State};
use faults::Dice;
use motion::Body;

pub use faults::{Faults, NotAFault, volts};
pub use hosted::host;
pub use motion::{Geometry, Pose, Twist};
pub use served::{Served, serve};

/// What a board is like, and what goes wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Nominal units, and the size of the robot.
    pub geometry: Geometry,
    /// The battery's voltage at rest, in hundredths of a volt.
    pub battery: Hundredths,
    /// After how long without a drive frame the robot stops, in microseconds; `None` for never. The real board's is not published.
    pub silence_us: Option<u64>,
    /// What goes wrong.
    pub faults: Faults,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            geometry: Geometry::default(),
            battery: Hundredths(1_200),
            silence_us: Some(500_000),
            faults: Faults::default(),
        }
    }
}

/// Microseconds between two reports.
const REPORT_US: u64 = 100_000;
/// By how many volts the battery sags at full speed, and how many it loses then in a second.
const SAG: f64 = 0.45;
const DRAIN: f64 = 0.000_5;

/// A board that exists only here. It decodes strictly.
#[derive(Debug)]
pub struct VirtualBoard {
    settings: Settings,
    decoder: Decoder,
    received: Received,
    body: Body,
    /// For frames, and for reports: so that neither changes what befalls the other.
    dice: [Dice; 2],
    /// The time, in microseconds since it was switched on.
    now_us: u64,
    /// When the last drive frame came.
    fed_us: u64,
    /// When the next report is due.
    report_us: Option<u64>,
    /// What the battery has lost, in volts.
    drained: f64,
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
    /// Bytes that belong to no frame.
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
    pub fn new(settings: Settings) -> Self {
        VirtualBoard {
            decoder: Decoder::new(),
            received: Received::default(),
            body: Body::new(settings.geometry),
            dice: [0, 1].map(|stream| Dice::new(settings.faults.seed.wrapping_add(stream << 32))),
            now_us: 0,
            fed_us: 0,
            report_us: None,
            drained: 0.0,
            replies: Vec::new(),
            settings,
        }
    }

    /// Takes bytes off the line at a time, in microseconds since it was switched on.
    pub fn receive(&mut self, now_us: u64, bytes: &[u8]) {
        self.poll(now_us);
        let mut decoder = std::mem::take(&mut self.decoder);
        decoder.feed(bytes, |item| self.take(item));
        self.decoder = decoder;
    }

    /// Lets time pass. It never goes back.
    pub fn poll(&mut self, now_us: u64) {
        while self.now_us < now_us {
            let stops_us =
                self.settings.silence_us.filter(|_| self.body.holds()).map(|us| self.fed_us.saturating_add(us));
            let next =
                [stops_us, self.report_us].into_iter().flatten().min().unwrap_or(now_us).clamp(self.now_us, now_us);
            self.pass(next);
            if stops_us.is_some_and(|us| us <= next) {
                self.body.stop();
            }
            if let Some(due) = self.report_us.filter(|due| *due <= next) {
                self.report_us = Some(due + REPORT_US);
                self.reply();
            } else if next == now_us {
                break;
            }
        }
    }

    fn pass(&mut self, to_us: u64) {
        #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
        let seconds = (to_us - self.now_us) as f64 / 1e6;
        self.drained += DRAIN * self.body.load() * seconds;
        self.body.pass(seconds);
        self.now_us = to_us;
        self.received.pose = self.body.pose();
    }

    /// When it has something to do next, in microseconds since it was switched on.
    pub fn next_due(&self) -> Option<u64> {
        self.report_us
    }

    /// What it has to send, which is taken from it.
    pub fn replies(&mut self) -> std::vec::Drain<'_, u8> {
        self.replies.drain(..)
    }

    /// What it has received so far, and what became of it.
    pub fn received(&self) -> &Received {
        &self.received
    }

    /// What goes wrong with it.
    pub fn faults(&self) -> &Faults {
        &self.settings.faults
    }

    /// What it would report now.
    pub fn report(&self) -> Report {
        let rest = match self.settings.faults.battery {
            Some((hundredths, from_us)) if self.now_us >= from_us => hundredths,
            _ => self.settings.battery.0,
        };
        let hundredths = |value: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "held in range")]
            Hundredths(libm::round(value * 100.0).clamp(-1e9, 1e9) as i32)
        };
        let voltage = f64::from(rest) / 100.0 - self.drained - SAG * self.body.load();
        let yaw = self.body.pose().yaw_deg;
        // Wrapped to half a turn on either side; the floor is flat.
        let yaw = yaw - 360.0 * libm::floor((yaw + 180.0) / 360.0);
        Report {
            pitch: Hundredths(0),
            roll: Hundredths(0),
            yaw: hundredths(yaw),
            voltage: hundredths(voltage.max(0.0)),
        }
    }

    /// The line is closed: what was cut off counts as skipped.
    pub fn finish(mut self) -> Received {
        let mut decoder = std::mem::take(&mut self.decoder);
        decoder.finish(|item| self.take(item));
        self.received.moves = self.body.moves();
        self.received
    }

    fn reply(&mut self) {
        let Faults { drop, garble, silent, .. } = self.settings.faults;
        let mut line = self.report().to_string().into_bytes();
        let [_, dice] = &mut self.dice;
        if silent || dice.happens(drop) {
            return;
        }
        if dice.happens(garble) {
            dice.garble(&mut line);
        }
        self.replies.extend(line);
    }

    fn take(&mut self, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                let at = self.received.bytes;
                self.received.bytes += frame.bytes().len() as u64;
                let Faults { drop, garble, .. } = self.settings.faults;
                let [dice, _] = &mut self.dice;
                if dice.happens(drop) || dice.happens(garble) {
                    // A frame with a wrong bit has a wrong checksum.
                    self.received.lost += 1;
                    return;
                }
                match Command::decode(frame) {
                    Ok(command) => self.obey(&command),
                    Err(error) => {
                        self.received.not_understood += 1;
                        self.fault(at, Fault::NotACommand(error));
                    }
                }
            }
            Item::Skipped { at, bytes, why } => {
                self.received.bytes += bytes.len() as u64;
                self.received.skipped += bytes.len() as u64;
                self.fault(at, Fault::Skipped(why));
            }
        }
    }

    fn obey(&mut self, command: &Command) {
        self.received.frames += 1;
        self.received.state.apply(command);
        if command.is_drive() {
            self.fed_us = self.now_us;
        }
        self.body.take(command, self.received.state.mode());
        match command {
            Command::Request(Query::REPORT_START) => self.report_us = Some(self.now_us + REPORT_US),
            Command::Request(Query::REPORT_STOP) => self.report_us = None,
            Command::Request(_) => self.reply(),
            _ => {}
        }
    }

    fn fault(&mut self, at: u64, fault: Fault) {
        self.received.first_fault.get_or_insert((at, fault));
    }
}
