//! The channels of a virtual Maestro: their targets and positions, its errors and its answers.

use crate::board::maestro::{Reaction, reaction};
use crate::board::{Command, Skip};

/// The error bits for a wrong CRC and for any other packet that is not one.
const WRONG_CRC: u16 = 1 << 3;
const PROTOCOL: u16 = 1 << 4;
/// How often the board moves a channel that has a speed, in a second.
const STEPS: f64 = 100.0;

/// The channels of a board with factory settings: going home ends the pulses.
#[derive(Clone, Debug)]
pub(super) struct Channels {
    channels: Vec<Channel>,
    errors: u16,
}

/// A channel. Values are in quarters of a microsecond, 0 without pulses.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    target: i32,
    position: f64,
    /// The most it moves in a step; 0 for any.
    speed: i32,
}

impl Channel {
    fn set(&mut self, target: i32) {
        // A servo whose position is unknown goes to its target at once.
        if self.speed == 0 || self.position == 0.0 || target == 0 {
            self.position = target.into();
        }
        self.target = target;
    }

    fn pass(&mut self, seconds: f64) {
        let most = f64::from(self.speed) * STEPS * seconds;
        let way = f64::from(self.target) - self.position;
        self.position = if way.abs() <= most { self.target.into() } else { self.position + most.copysign(way) };
    }

    fn moves(&self) -> bool {
        self.position != f64::from(self.target)
    }
}

impl Channels {
    pub(super) fn new(count: usize) -> Self {
        Channels { channels: vec![Channel::default(); count], errors: 0 }
    }

    /// Advances the time.
    pub(super) fn pass(&mut self, seconds: f64) {
        self.channels.iter_mut().for_each(|channel| channel.pass(seconds));
    }

    /// Carries out a command; gives the answer, which may be empty.
    pub(super) fn take(&mut self, command: &Command) -> Vec<u8> {
        let row = |channel: i32| usize::try_from(channel).unwrap_or(usize::MAX);
        match reaction(command) {
            Reaction::Targets(first, targets) => {
                let channels = self.channels.iter_mut().skip(row(first));
                channels.zip(targets).for_each(|(channel, target)| channel.set(target));
            }
            Reaction::Speed(channel, speed) => {
                if let Some(channel) = self.channels.get_mut(row(channel)) {
                    channel.speed = speed;
                }
            }
            Reaction::Home => self.go_home(),
            Reaction::Position(channel) => {
                let position = self.channels.get(row(channel)).map_or(0.0, |channel| channel.position);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 16383")]
                return (libm::round(position) as u16).to_le_bytes().to_vec();
            }
            Reaction::Moving => return vec![u8::from(self.channels.iter().any(Channel::moves))],
            Reaction::Errors => return std::mem::take(&mut self.errors).to_le_bytes().to_vec(),
            _ => {}
        }
        Vec::new()
    }

    /// Bytes that are not a packet: an error, which sends every channel home.
    pub(super) fn stumble(&mut self, why: Skip) {
        self.errors |= if matches!(why, Skip::Checksum { .. }) { WRONG_CRC } else { PROTOCOL };
        self.go_home();
    }

    fn go_home(&mut self) {
        self.channels.iter_mut().for_each(|channel| channel.set(0));
    }
}
