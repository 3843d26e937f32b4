//! The packets of the bus: two bytes FF, an identifier, the number of the bytes that follow, an instruction, its parameters, and a
//! sum. Answers have the error bits of the servo in place of the instruction.

use crate::board::frame::{BufferStart, Skip};

/// Both bytes at the start of a packet.
pub(super) const HEADER: u8 = 0xFF;
/// The identifier that addresses all servos.
pub const BROADCAST: u8 = 0xFE;
/// The longest packet: a length byte of 255.
pub(super) const LONGEST: usize = 4 + 255;

/// The instructions.
pub mod instruction {
    /// Asks whether a servo is there.
    pub const PING: u8 = 0x01;
    /// Asks for registers: the first address, and the number of bytes.
    pub const READ: u8 = 0x02;
    /// Writes registers: the first address, and the bytes.
    pub const WRITE: u8 = 0x03;
    /// The same at the next action.
    pub const LATER: u8 = 0x04;
    /// Carries out what was written for later.
    pub const ACTION: u8 = 0x05;
    /// Restores the settings of a new servo.
    pub const RESET: u8 = 0x06;
    /// Asks several servos for registers: the first address, the number of bytes, and the servos.
    pub const SYNC_READ: u8 = 0x82;
    /// Writes registers of several servos: the first address, the number of bytes, and for each servo its number and the bytes.
    pub const SYNC_WRITE: u8 = 0x83;
}

/// The parts of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<'a> {
    /// The servo, or 254 for all.
    pub id: u8,
    /// The instruction; in an answer, the error bits.
    pub instruction: u8,
    /// What follows it.
    pub parameters: &'a [u8],
}

/// Whether an instruction may have this number of parameters, of which these first ones are known.
fn may_have(instruction: u8, count: usize, known: &[u8]) -> bool {
    match instruction {
        instruction::PING | instruction::ACTION | instruction::RESET => count == 0,
        instruction::READ => count == 2,
        instruction::WRITE | instruction::LATER => count >= 2,
        instruction::SYNC_READ => count >= 3,
        instruction::SYNC_WRITE => {
            count >= 4
                && known.get(1).is_none_or(|size| *size > 0 && (count - 2).is_multiple_of(usize::from(*size) + 1))
        }
        _ => false,
    }
}

/// Reads the packet at the start of some bytes, with the number of its bytes.
///
/// # Errors
/// What is there instead.
pub(super) fn first(bytes: &[u8]) -> Result<(Packet<'_>, usize), BufferStart> {
    let noise = || Err(BufferStart::Skip(next_start(bytes), Skip::Noise));
    match bytes {
        [] | [HEADER] | [HEADER, HEADER] => return Err(BufferStart::NeedMore),
        [HEADER, HEADER, HEADER, ..] => return Err(BufferStart::Skip(1, Skip::Noise)),
        [HEADER, HEADER, ..] => {}
        _ => return noise(),
    }
    let Some(size) = bytes.get(3) else { return Err(BufferStart::NeedMore) };
    let Some(count) = usize::from(*size).checked_sub(2) else { return noise() };
    let Some(instruction) = bytes.get(4) else { return Err(BufferStart::NeedMore) };
    let known = bytes.get(5..bytes.len().min(5 + count)).unwrap_or_default();
    if !may_have(*instruction, count, known) {
        return noise();
    }
    let Some(whole) = bytes.get(..4 + usize::from(*size)) else { return Err(BufferStart::NeedMore) };
    parse(whole).map(|packet| (packet, whole.len())).map_err(|(expected, found)| {
        // Another packet may start inside of one that was cut off.
        BufferStart::Skip(next_start(bytes), Skip::Checksum { expected, found })
    })
}

/// Reads bytes that have the length of a packet.
///
/// # Errors
/// The sum of the bytes, and the one that is in the packet.
pub(super) fn parse(whole: &[u8]) -> Result<Packet<'_>, (u8, u8)> {
    let [_, _, body @ .., found] = whole else { return Err((0, 0)) };
    let expected = sum(body);
    match body {
        [id, _, instruction, parameters @ ..] if expected == *found => {
            Ok(Packet { id: *id, instruction: *instruction, parameters })
        }
        _ => Err((expected, *found)),
    }
}

/// The number of bytes, at least one, up to the next byte that can start a packet.
pub(super) fn next_start(bytes: &[u8]) -> usize {
    bytes.iter().skip(1).position(|byte| *byte == HEADER).map_or(bytes.len().max(1), |at| at + 1)
}

/// Appends a packet.
pub(super) fn emit(out: &mut Vec<u8>, id: u8, instruction: u8, parameters: &[u8]) {
    out.extend([HEADER, HEADER]);
    let start = out.len();
    out.extend([id, u8::try_from(parameters.len() + 2).unwrap_or(u8::MAX), instruction]);
    out.extend_from_slice(parameters);
    out.push(sum(out.get(start..).unwrap_or_default()));
}

/// The inverted sum of the bytes between the header and the sum.
fn sum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
}
