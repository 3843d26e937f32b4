//! The state of a virtual board, its position and its reports.

use std::sync::Arc;

use super::channels::Channels;
use super::motion::Body;
use super::servos::Servos;
use super::{Fault, Received, ServoFault, ServoSetup, Settings};
use crate::board::raspblock::{self, Asked};
use crate::board::sts::BROADCAST;
use crate::board::{Board, Command, Frame, Hundredths, Item, Report, Simulation, Skip, State};
use crate::units::Micros;

/// The voltage drop at full speed, and the loss of voltage per second at full speed.
const SAG: f64 = 0.45;
const DRAIN: f64 = 0.000_5;

/// A board without faults.
#[derive(Clone, Debug)]
pub struct Device {
    board: Arc<Board>,
    settings: Settings,
    /// What it has received, and the effects.
    received: Received,
    /// Reports and answers to send.
    replies: Vec<Vec<u8>>,
    body: Body,
    channels: Channels,
    servos: Servos,
    /// The time since it was switched on.
    now: Micros,
    /// When the last drive frame came.
    fed: Micros,
    /// When the next report is due.
    next_report: Option<Micros>,
    /// The loss of the battery, in volts.
    drained: f64,
}

impl Device {
    /// A board of a family, switched on at time 0.
    pub fn new(of: Arc<Board>, mut settings: Settings) -> Self {
        settings.report_every = settings.report_every.max(Micros(1));
        let channels = if of.simulation == Simulation::Channels { of.resources.len() } else { 0 };
        let servos = match (of.simulation, settings.servos.take()) {
            (Simulation::Servos, Some(servos)) => servos,
            (Simulation::Servos, None) => (0..BROADCAST).map(ServoSetup::new).collect(),
            _ => Vec::new(),
        };
        Device {
            servos: Servos::new(servos, settings.baud.unwrap_or(of.baud)),
            board: of,
            received: Received::default(),
            replies: Vec::new(),
            channels: Channels::new(channels),
            body: Body::new(settings.geometry),
            settings,
            now: Micros::ZERO,
            fed: Micros::ZERO,
            next_report: None,
            drained: 0.0,
        }
    }

    /// Its family.
    pub fn family(&self) -> &Arc<Board> {
        &self.board
    }

    /// Replaces the battery by one with this voltage at rest.
    pub fn set_battery(&mut self, at_rest: Hundredths) {
        self.settings.battery = at_rest;
    }

    /// Gives a servo of a bus a fault.
    pub fn set_fault(&mut self, servo: u8, fault: ServoFault) {
        self.servos.set_fault(servo, fault);
    }

    /// Advances the time, which never decreases.
    pub fn poll(&mut self, now: Micros) {
        while self.now < now {
            let stops = self.settings.silence.filter(|_| self.body.holds()).map(|silence| self.fed + silence);
            let next = [stops, self.next_report].into_iter().flatten().min().unwrap_or(now).clamp(self.now, now);
            self.pass(next);
            if stops.is_some_and(|stops| stops <= next) {
                self.body.stop();
            }
            if let Some(due) = self.next_report.filter(|due| *due <= next) {
                self.next_report = Some(due + self.settings.report_every);
                self.send_report();
            } else if next == now {
                break;
            }
        }
        self.replies.extend(self.servos.said(self.now));
    }

    fn pass(&mut self, to: Micros) {
        #[expect(clippy::cast_precision_loss, reason = "a day in microseconds fits")]
        let seconds = (to - self.now).0 as f64 / 1e6;
        self.drained += DRAIN * self.body.load() * seconds;
        self.body.pass(seconds);
        self.channels.pass(seconds);
        self.servos.pass(seconds);
        self.now = to;
        self.received.pose = self.body.pose();
    }

    /// When it next has something to do, since it was switched on.
    pub fn next_due(&self) -> Option<Micros> {
        [self.next_report, self.servos.next_due()].into_iter().flatten().min()
    }

    /// Its report now.
    pub fn report(&self) -> Report {
        let hundredths = |value: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "held in range")]
            Hundredths(libm::round(value * 100.0).clamp(-1e9, 1e9) as i32)
        };
        let voltage = f64::from(self.settings.battery.0) / 100.0 - self.drained - SAG * self.body.load();
        let yaw = self.body.pose().yaw_deg;
        // Wrapped to ±180°; the floor is level.
        let yaw = yaw - 360.0 * libm::floor((yaw + 180.0) / 360.0);
        raspblock::report(hundredths(voltage.max(0.0)), hundredths(yaw))
    }

    /// Takes what it sends: reports, and answers to requests.
    pub fn replies(&mut self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.replies)
    }

    fn send_report(&mut self) {
        let line = self.board.report_line(&self.report());
        self.replies.push(line.into_bytes());
    }

    /// What it has received so far, and the effects.
    pub fn received(&self) -> &Received {
        &self.received
    }

    /// The line is closed.
    pub fn finish(self) -> Received {
        Received { moves: self.body.moves(), ..self.received }
    }

    /// Takes an item of the line.
    pub fn take(&mut self, item: Item<'_>) {
        match item {
            // A line of one wire carries one thing at a time.
            Item::Frame(frame) if self.servos.is_talking(self.now) => self.miss(frame),
            Item::Frame(frame) => {
                let at = self.received.bytes;
                self.received.bytes += frame.bytes().len() as u64;
                match self.board.decode(frame.bytes()) {
                    Ok(command) => self.obey(&command),
                    Err(error) => {
                        self.received.not_understood += 1;
                        self.fault(at, Fault::NotACommand(error));
                    }
                }
            }
            Item::Skipped { at, bytes, why } => {
                self.received.bytes += bytes.len() as u64;
                if why.is_wrong() {
                    self.received.skipped += bytes.len() as u64;
                    self.fault(at, Fault::Skipped(why));
                    self.stumble(why);
                }
            }
        }
    }

    /// Counts a frame on the line that did not arrive.
    pub fn miss(&mut self, frame: Frame<'_>) {
        self.received.bytes += frame.bytes().len() as u64;
        self.received.lost += 1;
    }

    /// Carries out a command.
    pub fn obey(&mut self, command: &Command) {
        self.received.frames += 1;
        self.received.state.apply(&self.board, command);
        if self.board.is_drive(command) {
            self.fed = self.now;
        }
        if self.board.simulation == Simulation::Channels {
            let answer = self.channels.take(command);
            self.replies.extend(Some(answer).filter(|answer| !answer.is_empty()));
        }
        if self.board.simulation == Simulation::Servos {
            self.servos.take(self.now, &self.board.to_frame(command), &mut self.received.fell);
        }
        if self.board.simulation == Simulation::Mecanum {
            self.body.take(command, raspblock::is_in_position_mode(&self.received.state));
            match raspblock::asked(command) {
                Some(Asked::Start) => self.next_report = Some(self.now + self.settings.report_every),
                Some(Asked::Stop) => self.next_report = None,
                Some(Asked::Once) => self.send_report(),
                None => {}
            }
        }
    }

    /// What a board does that takes bytes for an error.
    fn stumble(&mut self, why: Skip) {
        if self.board.simulation == Simulation::Channels {
            self.channels.stumble(why);
            self.received.homes += 1;
            self.received.state = State::new(&self.board);
        }
    }

    fn fault(&mut self, at: u64, fault: Fault) {
        self.received.first_fault.get_or_insert((at, fault));
    }
}
