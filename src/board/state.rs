//! What the board was last told.

use super::command::{Command, Gains, Mode};
use super::number::{PulseWidth, ServoIndex};

/// The last value of each thing, as far as commands said. A raw frame is not interpreted, but one with the drive's
/// function makes the drive unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct State {
    servos: [Option<PulseWidth>; 4],
    drive: Option<Command>,
    buzzer: Option<bool>,
    pid: Option<(Mode, Gains)>,
    /// Whether the last frame for the drive, and for the buzzer, was one that is not understood.
    is_unclear: [bool; 2],
}

impl State {
    /// Takes in one command.
    pub fn apply(&mut self, command: &Command) {
        match command {
            Command::Pid(mode, gains) => self.pid = Some((*mode, *gains)),
            Command::Servos { pan, tilt } => {
                let [first, second, ..] = &mut self.servos;
                *first = Some(*pan);
                *second = PulseWidth::new(tilt.get()).ok();
            }
            Command::Servo { index, pulse } => {
                let slot = usize::try_from(index.get() - 1).unwrap_or_default();
                if let Some(servo) = self.servos.get_mut(slot) {
                    *servo = Some(*pulse);
                }
            }
            Command::Buzzer(on) => {
                self.buzzer = Some(*on);
                self.is_unclear[1] = false;
            }
            Command::Raw { .. } if command.is_drive() => {
                self.drive = None;
                self.is_unclear[0] = true;
            }
            Command::Raw { .. } if command.is_buzzer() => self.is_unclear[1] = true,
            drive if drive.is_drive() => {
                self.drive = Some(drive.clone());
                self.is_unclear[0] = false;
            }
            _ => {}
        }
    }

    /// The pulse width of a servo, if it was ever told one.
    pub fn servo(&self, index: ServoIndex) -> Option<PulseWidth> {
        let slot = usize::try_from(index.get() - 1).ok()?;
        self.servos.get(slot).copied().flatten()
    }

    /// The last drive command.
    pub fn drive(&self) -> Option<&Command> {
        self.drive.as_ref()
    }

    /// Whether the buzzer is on, if it was ever told.
    pub fn buzzer(&self) -> Option<bool> {
        self.buzzer
    }

    /// The mode of the last `pid`.
    pub fn mode(&self) -> Option<Mode> {
        self.pid.map(|(mode, _)| mode)
    }

    /// The commands that bring a board to this state again, the drive last. What stands or is silent is left out.
    pub fn commands(&self) -> impl Iterator<Item = Command> {
        let pid = self.pid.map(|(mode, gains)| Command::Pid(mode, gains));
        let servos = self.servos.iter().zip(1..).filter_map(|(pulse, index)| {
            Some(Command::Servo { index: ServoIndex::new(index).ok()?, pulse: (*pulse)? })
        });
        let buzzer = (self.buzzer == Some(true)).then_some(Command::Buzzer(true));
        let drive = self.drive.clone().filter(Command::keeps_driving);
        pid.into_iter().chain(servos).chain(buzzer).chain(drive)
    }

    /// Whether all that a program has sent ends in rest, however the board takes what no correct program sends: its last frame for the
    /// drive, if there was one, is known as a stop, and that for the buzzer does not turn it on. A `move` may go on for any time.
    pub fn surely_at_rest(&self) -> bool {
        self.at_rest() && self.is_unclear == [false; 2] && !matches!(self.drive, Some(Command::Move { .. }))
    }

    /// Whether nothing moves and nothing sounds: the drive does not keep driving and the buzzer is not on.
    pub fn at_rest(&self) -> bool {
        !self.drive.as_ref().is_some_and(Command::keeps_driving) && self.buzzer != Some(true)
    }
}
