//! Encodes and decodes the commands of the Maestro.

use super::packet::{self, MINI_SSC, Packet, command};
use super::verb;
use crate::board::frame::{BufferStart, FrameError, Skip};
use crate::board::{Board, Codec, Command, NotACommand, VerbId};

/// The targets of a digital output, in quarters of a microsecond: 6000 and more are high.
const HIGH: i32 = 7_000;
const LOW: i32 = 5_000;
/// The device number of a new board, which the first packet addresses.
const USUAL_DEVICE: u8 = 12;

/// The protocol: compact, or with a device number; with a CRC or without.
#[derive(Debug)]
pub(super) struct Packets {
    pub(super) device: Option<u8>,
    pub(super) has_crc: bool,
}

impl Packets {
    fn first<'a>(&self, bytes: &'a [u8]) -> Result<Packet<'a>, BufferStart> {
        packet::first(bytes, self.has_crc)
    }
}

/// What a board does with a packet.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reaction {
    /// Channels from this one on get targets, in quarters of a microsecond; 0 for no pulses.
    Targets(i32, Vec<i32>),
    /// A channel goes to its target at this speed, in quarters of a microsecond per 10 ms; 0 for at once.
    Speed(i32, i32),
    /// All channels go home.
    Home,
    /// It answers with the position of a channel.
    Position(i32),
    /// It answers whether a servo moves.
    Moving,
    /// It answers with its errors, and clears them.
    Errors,
    /// Nothing that matters here.
    Nothing,
}

/// What a board does with a command.
pub fn reaction(command: &Command) -> Reaction {
    let values = command.values();
    let channel = values.first().copied().unwrap_or_default();
    if let Some((channel, value)) = target(command) {
        return Reaction::Targets(channel, vec![value]);
    }
    match command.verb() {
        verb::TARGETS => {
            let bytes: Vec<u8> = values.iter().filter_map(|byte| u8::try_from(*byte).ok()).collect();
            let (first, pairs) = (values.get(1).copied().unwrap_or_default(), bytes.get(2..).unwrap_or_default());
            let targets = pairs.chunks(2).filter_map(|pair| Some(packet::join(*pair.first()?, *pair.get(1)?)));
            Reaction::Targets(first, targets.collect())
        }
        verb::SPEED => Reaction::Speed(channel, values.get(1).copied().unwrap_or_default()),
        verb::HOME => Reaction::Home,
        verb::POSITION => Reaction::Position(channel),
        verb::MOVING => Reaction::Moving,
        verb::ERRORS | verb::HELLO => Reaction::Errors,
        _ => Reaction::Nothing,
    }
}

/// The target that a command sets, with its channel.
fn target(command: &Command) -> Option<(i32, i32)> {
    let (channel, value) = (command.value(0)?, command.value(1)?);
    match command.verb() {
        verb::SERVO => Some((channel, value)),
        verb::OFF => Some((channel, 0)),
        verb::OUTPUT => Some((channel, if value == 0 { LOW } else { HIGH })),
        _ => None,
    }
}

impl Codec for Packets {
    fn encode(&self, _: &Board, command: &Command, out: &mut Vec<u8>) {
        let values = command.values();
        let byte = |value: &i32| u8::try_from(*value).unwrap_or_default();
        let channel = values.first().map_or(0, byte);
        let mut emit = |number, data: &[u8]| packet::emit(out, (self.device, self.has_crc), number, data);
        let pair = |value: i32| {
            let [low, high] = packet::split(value);
            [channel, low, high]
        };
        if let Some((_, value)) = target(command) {
            return emit(command::TARGET, &pair(value));
        }
        let value = values.get(1).copied().unwrap_or_default();
        match command.verb() {
            verb::HOME => emit(command::HOME, &[]),
            verb::SPEED => emit(command::SPEED, &pair(value)),
            verb::ACCELERATION => emit(command::ACCELERATION, &pair(value)),
            verb::POSITION => emit(command::POSITION, &[channel]),
            verb::MOVING => emit(command::MOVING, &[]),
            verb::ERRORS => emit(command::ERRORS, &[]),
            verb::TARGETS => emit(command::TARGETS, &values.iter().map(byte).collect::<Vec<u8>>()),
            // The first packet of a run: `AA` sets the baud rate.
            _ => {
                let device = self.device.unwrap_or(USUAL_DEVICE);
                packet::emit(out, (Some(device), self.has_crc), command::ERRORS, &[]);
            }
        }
    }

    fn check(&self, bytes: &[u8]) -> Result<(), FrameError> {
        match self.first(bytes) {
            Ok(packet) if packet.length == bytes.len() => Ok(()),
            Ok(_) | Err(BufferStart::NeedMore) => Err(FrameError::Length),
            Err(BufferStart::Skip(_, Skip::Checksum { expected, found })) => {
                Err(FrameError::Checksum { expected, found })
            }
            Err(_) => Err(FrameError::NoHeader),
        }
    }

    fn decode(&self, board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
        let packet = self.first(frame).ok().filter(|packet| packet.length == frame.len());
        let packet = packet.ok_or(NotACommand::Unknown)?;
        let say = |verb: VerbId, values: &[i32]| board.command(verb, values);
        let is_hello = (packet.device, packet.command) == (Some(USUAL_DEVICE), command::ERRORS);
        match (packet.device, self.device) {
            (Some(_), None) if is_hello => return say(verb::HELLO, &[]),
            (Some(_), None) => {
                return Err(NotACommand::OtherReading(
                    "a packet with a device number, which `board maestro N device D` reads",
                ));
            }
            (None, Some(_)) if packet.command != MINI_SSC => {
                return Err(NotACommand::OtherReading(
                    "a packet of the compact protocol, which `board maestro N` without `device` reads",
                ));
            }
            (Some(sent), Some(device)) if sent != device => {
                return Err(NotACommand::OtherReading("a packet for another device number"));
            }
            _ => {}
        }
        let nothing = |what| Err(NotACommand::NotInScripts(what));
        match (packet.command, packet.data) {
            (command::TARGET, &[channel, 0, 0]) => say(verb::OFF, &[channel.into(), 0]),
            (command::TARGET, &[channel, low, high]) => say(verb::SERVO, &[channel.into(), packet::join(low, high)]),
            (command::HOME, _) => say(verb::HOME, &[]),
            (command::SPEED, &[channel, low, high]) => say(verb::SPEED, &[channel.into(), packet::join(low, high)]),
            (command::ACCELERATION, &[channel, low, high]) => {
                say(verb::ACCELERATION, &[channel.into(), packet::join(low, high)])
            }
            (command::POSITION, &[channel]) => say(verb::POSITION, &[channel.into()]),
            (command::MOVING, _) => say(verb::MOVING, &[]),
            (command::ERRORS, _) => say(verb::ERRORS, &[]),
            (command::TARGETS, data) => say(verb::TARGETS, &data.iter().copied().map(i32::from).collect::<Vec<i32>>()),
            (command::PWM, _) => nothing("this sets the PWM output"),
            (command::STOP_SCRIPT, _) => nothing("this stops the script inside the board"),
            (command::RESTART | command::RESTART_WITH, _) => nothing("this starts the script inside the board"),
            (command::SCRIPT_STATUS, _) => nothing("this asks whether the script inside the board runs"),
            (MINI_SSC, _) => nothing("this sets a servo by the Mini SSC protocol"),
            _ => Err(NotACommand::Unknown),
        }
    }

    fn other_reading(&self, board: &Board, frame: &[u8]) -> Option<Command> {
        let [channel, target] = *self.decode(board, frame).ok()?.values().as_slice() else { return None };
        let output = |value| board.command(verb::OUTPUT, &[channel, value]).ok();
        output(i32::from(target == HIGH)).filter(|output| board.to_frame(output) == frame)
    }

    fn front(&self, bytes: &[u8], _: bool) -> BufferStart {
        self.first(bytes).map_or_else(|start| start, |packet| BufferStart::Frame(packet.length))
    }

    fn next_start(&self, bytes: &[u8]) -> usize {
        packet::next_start(bytes)
    }

    fn longest(&self) -> usize {
        packet::LONGEST
    }
}
