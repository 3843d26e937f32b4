//! Encodes and decodes the commands of the bus.

use super::packet::{self, BROADCAST, Packet, instruction};
use super::{register, verb};
use crate::board::frame::{BufferStart, FrameError, Skip};
use crate::board::{Board, Codec, Command, NotACommand, VerbId};

/// The protocol of the bus.
#[derive(Debug)]
pub(super) struct Packets;

/// The verbs that write a register of one servo, with the register and the number of its bytes.
const WRITES: [(VerbId, u8, u8); 4] = [
    (verb::SERVO, register::GOAL, 2),
    (verb::TORQUE, register::TORQUE, 1),
    (verb::SPEED, register::SPEED, 2),
    (verb::ACCEL, register::ACCELERATION, 1),
];

/// The verbs that read registers of one servo, with the first register and the number of bytes.
pub(super) const READS: [(VerbId, u8, u8); 4] = [
    (verb::POSITION, register::POSITION, 2),
    (verb::VOLTAGE, register::VOLTAGE, 1),
    (verb::MODE, register::MODE, 1),
    (verb::SETTINGS, register::ACCELERATION, 7),
];

/// The verbs that only other programs send: their values are the identifier and the parameters, except that the packets for several
/// servos have no identifier.
const OTHERS: [(VerbId, u8); 8] = [
    (verb::PING, instruction::PING),
    (verb::READ, instruction::READ),
    (verb::WRITE, instruction::WRITE),
    (verb::WRITE_LATER, instruction::LATER),
    (verb::ACTION, instruction::ACTION),
    (verb::RESET, instruction::RESET),
    (verb::SYNC_READ, instruction::SYNC_READ),
    (verb::SYNC_WRITE, instruction::SYNC_WRITE),
];

/// The packet of a frame; `None` if it is not one.
pub fn packet(frame: &[u8]) -> Option<Packet<'_>> {
    packet::first(frame).ok().filter(|(_, length)| *length == frame.len()).map(|(packet, _)| packet)
}

/// Appends the answer of a servo: its error bits, and bytes of its registers.
pub fn emit_answer(out: &mut Vec<u8>, id: u8, errors: u8, bytes: &[u8]) {
    packet::emit(out, id, errors, bytes);
}

fn byte(value: i32) -> u8 {
    u8::try_from(value).unwrap_or_default()
}

/// The command of a script that writes these bytes to a register of a servo, if there is one.
fn written(board: &Board, id: u8, address: u8, data: &[u8]) -> Result<Command, NotACommand> {
    let (verb, _, _) = WRITES
        .iter()
        .find(|(_, at, size)| *at == address && usize::from(*size) == data.len())
        .ok_or(NotACommand::Unknown)?;
    let value = match *data {
        [value] => value.into(),
        [low, high] => u16::from_le_bytes([low, high]).into(),
        _ => return Err(NotACommand::Unknown),
    };
    board.command(*verb, &[id.into(), value])
}

/// The same for a block of registers: what a packet sets that writes several at once.
fn all_written(board: &Board, id: u8, address: u8, data: &[u8]) -> Vec<Command> {
    // A target comes after what decides how the servo gets there.
    let mut found = Vec::new();
    for (verb, at, size) in WRITES.iter().rev() {
        let Some(from) = at.checked_sub(address).map(usize::from) else { continue };
        let bytes = data.get(from..from + usize::from(*size)).unwrap_or_default();
        found.extend(written(board, id, *at, bytes).ok().filter(|command| command.verb() == *verb));
    }
    found
}

impl Codec for Packets {
    fn encode(&self, _: &Board, command: &Command, out: &mut Vec<u8>) {
        let values = command.values();
        let id = values.first().copied().map_or(0, byte);
        if let Some((_, address, size)) = WRITES.iter().find(|(verb, ..)| *verb == command.verb()) {
            let [low, high] =
                u16::try_from(values.get(1).copied().unwrap_or_default()).unwrap_or_default().to_le_bytes();
            let all = [*address, *size, id, low, high];
            // Packets for all servos are not answered, so that no answer collides with the next frame.
            let parameters = all.get(..3 + usize::from(*size)).unwrap_or_default();
            return packet::emit(out, BROADCAST, instruction::SYNC_WRITE, parameters);
        }
        if let Some((_, address, size)) = READS.iter().find(|(verb, ..)| *verb == command.verb()) {
            return packet::emit(out, id, instruction::READ, &[*address, *size]);
        }
        let bytes: Vec<u8> = values.iter().copied().map(byte).collect();
        match OTHERS.iter().find(|(verb, _)| *verb == command.verb()) {
            Some((_, number @ (instruction::SYNC_READ | instruction::SYNC_WRITE))) => {
                packet::emit(out, BROADCAST, *number, &bytes);
            }
            Some((_, number)) => packet::emit(out, id, *number, bytes.get(1..).unwrap_or_default()),
            // A script has one command for each servo instead.
            None => {}
        }
    }

    fn check(&self, bytes: &[u8]) -> Result<(), FrameError> {
        match packet::first(bytes) {
            Ok((_, length)) if length == bytes.len() => Ok(()),
            Ok(_) | Err(BufferStart::NeedMore) => Err(FrameError::Length),
            Err(BufferStart::Skip(_, Skip::Checksum { expected, found })) => {
                Err(FrameError::Checksum { expected, found })
            }
            Err(_) => Err(FrameError::NoHeader),
        }
    }

    fn decode(&self, board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
        let Packet { id, instruction, parameters } = packet(frame).ok_or(NotACommand::Unknown)?;
        let only = match (instruction, parameters) {
            (instruction::SYNC_WRITE, [address, _, id, data @ ..])
                if parameters.get(1).is_some_and(|size| usize::from(*size) == data.len()) =>
            {
                written(board, *id, *address, data).ok()
            }
            (instruction::READ, [address, count]) => {
                let row = READS.iter().find(|(_, at, size)| (at, size) == (address, count));
                row.and_then(|(verb, ..)| board.command(*verb, &[id.into()]).ok())
            }
            _ => None,
        };
        if let Some(command) = only.filter(|command| board.to_frame(command) == frame) {
            return Ok(command);
        }
        let (verb, _) = OTHERS.iter().find(|(_, number)| *number == instruction).ok_or(NotACommand::Unknown)?;
        let is_for_several = matches!(instruction, instruction::SYNC_READ | instruction::SYNC_WRITE);
        let head = (!is_for_several).then_some(id);
        let values: Vec<i32> = head.iter().chain(parameters).copied().map(i32::from).collect();
        let command = board.command(*verb, &values)?;
        if board.to_frame(&command) == frame { Ok(command) } else { Err(NotACommand::Inconsistent) }
    }

    fn in_script(&self, board: &Board, command: &Command) -> Vec<Command> {
        let values: Vec<u8> = command.values().into_iter().map(byte).collect();
        match (command.verb(), values.as_slice()) {
            (verb::WRITE, [id, address, data @ ..]) => all_written(board, *id, *address, data),
            (verb::SYNC_WRITE, [address, size, servos @ ..]) => {
                let each = servos.chunks(usize::from(*size) + 1).filter_map(<[u8]>::split_first);
                each.flat_map(|(id, data)| all_written(board, *id, *address, data)).collect()
            }
            _ => Vec::new(),
        }
    }

    fn front(&self, bytes: &[u8], _: bool) -> BufferStart {
        packet::first(bytes).map_or_else(|start| start, |(_, length)| BufferStart::Frame(length))
    }

    fn next_start(&self, bytes: &[u8]) -> usize {
        packet::next_start(bytes)
    }

    fn longest(&self) -> usize {
        packet::LONGEST
    }
}
