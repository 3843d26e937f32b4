//! The packets of the Maestro: a command byte with its top bit set, data bytes without it, and a CRC if the board wants one. In the
//! Pololu protocol, `AA` and the number of a device come first, and the command byte has no top bit.

use crate::board::frame::{BufferStart, Skip};

/// The command bytes of the compact protocol.
pub(super) mod command {
    pub(in crate::board::maestro) const TARGET: u8 = 0x84;
    pub(in crate::board::maestro) const SPEED: u8 = 0x87;
    pub(in crate::board::maestro) const ACCELERATION: u8 = 0x89;
    pub(in crate::board::maestro) const PWM: u8 = 0x8A;
    pub(in crate::board::maestro) const POSITION: u8 = 0x90;
    pub(in crate::board::maestro) const MOVING: u8 = 0x93;
    pub(in crate::board::maestro) const TARGETS: u8 = 0x9F;
    pub(in crate::board::maestro) const ERRORS: u8 = 0xA1;
    pub(in crate::board::maestro) const HOME: u8 = 0xA2;
    pub(in crate::board::maestro) const STOP_SCRIPT: u8 = 0xA4;
    pub(in crate::board::maestro) const RESTART: u8 = 0xA7;
    pub(in crate::board::maestro) const RESTART_WITH: u8 = 0xA8;
    pub(in crate::board::maestro) const SCRIPT_STATUS: u8 = 0xAE;
}

/// The byte before the number of a device.
const DEVICE: u8 = 0xAA;
/// The first byte of the Mini SSC protocol, which has no CRC and data bytes from 0 to 254.
pub(super) const MINI_SSC: u8 = 0xFF;
/// The bit that only command bytes have.
const TOP: u8 = 0x80;
/// The most targets in one packet: the largest board has 24 channels.
pub(super) const MAX_TARGETS: usize = 24;
/// The longest packet: a device number, 24 targets and a CRC.
pub(super) const LONGEST: usize = 3 + 2 + 2 * MAX_TARGETS + 1;

/// The parts of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Packet<'a> {
    /// The device number, in the Pololu protocol.
    pub(super) device: Option<u8>,
    /// The command byte of the compact protocol.
    pub(super) command: u8,
    pub(super) data: &'a [u8],
    /// The number of all its bytes.
    pub(super) length: usize,
}

/// The number of data bytes of a command; the first of them decides that of several targets. `None` for an unknown command.
fn data_length(command: u8, first: Option<u8>) -> Option<usize> {
    match command {
        command::MOVING | command::ERRORS | command::HOME | command::STOP_SCRIPT | command::SCRIPT_STATUS => Some(0),
        command::POSITION | command::RESTART => Some(1),
        MINI_SSC => Some(2),
        command::TARGET | command::SPEED | command::ACCELERATION | command::RESTART_WITH => Some(3),
        command::PWM => Some(4),
        command::TARGETS => match first {
            None => Some(1),
            Some(count) => {
                Some(usize::from(count)).filter(|count| (1..=MAX_TARGETS).contains(count)).map(|count| 2 + 2 * count)
            }
        },
        _ => None,
    }
}

/// Reads the packet at the start of some bytes.
///
/// # Errors
/// What is there instead.
pub(super) fn first(bytes: &[u8], has_crc: bool) -> Result<Packet<'_>, BufferStart> {
    let cut = |length| Err(BufferStart::Skip(length, Skip::Torn));
    let noise = || Err(BufferStart::Skip(next_start(bytes), Skip::Noise));
    let (device, command, head) = match *bytes {
        [DEVICE, device, ..] if device & TOP != 0 => return cut(1),
        [] | [DEVICE] | [DEVICE, _] => return Err(BufferStart::NeedMore),
        [DEVICE, _, command, ..] if command & TOP != 0 => return cut(2),
        [DEVICE, device, command, ..] => (Some(device), command | TOP, 3),
        [command, ..] => (None, command, 1),
    };
    let is_mini = device.is_none() && command == MINI_SSC;
    let Some(count) =
        data_length(command, bytes.get(head).copied()).filter(|_| device.is_none() || command != MINI_SSC)
    else {
        return noise();
    };
    let has_crc = has_crc && !is_mini;
    let end = head + count;
    let length = end + usize::from(has_crc);
    let belongs = |byte: &u8| if is_mini { *byte != MINI_SSC } else { byte & TOP == 0 };
    let rest = bytes.get(head..length.min(bytes.len())).unwrap_or_default();
    if let Some(at) = rest.iter().position(|byte| !belongs(byte)) {
        return cut(head + at);
    }
    let (Some(whole), Some(data)) = (bytes.get(..length), bytes.get(head..end)) else {
        return Err(BufferStart::NeedMore);
    };
    if has_crc && let [body @ .., found] = whole {
        let expected = crc(body);
        if *found != expected {
            return Err(BufferStart::Skip(length, Skip::Checksum { expected, found: *found }));
        }
    }
    Ok(Packet { device, command, data, length })
}

/// The number of bytes, at least one, up to the next byte that can start a packet.
pub(super) fn next_start(bytes: &[u8]) -> usize {
    bytes.iter().skip(1).position(|byte| byte & TOP != 0).map_or(bytes.len().max(1), |at| at + 1)
}

/// Appends a packet.
pub(super) fn emit(out: &mut Vec<u8>, (device, has_crc): (Option<u8>, bool), command: u8, data: &[u8]) {
    let start = out.len();
    match device {
        Some(device) => out.extend([DEVICE, device, command & !TOP]),
        None => out.push(command),
    }
    out.extend_from_slice(data);
    if has_crc {
        out.push(crc(out.get(start..).unwrap_or_default()));
    }
}

/// The CRC-7 of a packet, with the polynomial 0x91, low bit first.
fn crc(bytes: &[u8]) -> u8 {
    bytes
        .iter()
        .fold(0, |crc, byte| (0..8).fold(crc ^ byte, |crc, _| if crc & 1 == 1 { (crc ^ 0x91) >> 1 } else { crc >> 1 }))
}

/// A value in two bytes of seven bits, the low one first.
pub(super) fn split(value: i32) -> [u8; 2] {
    [value & 0x7F, value >> 7 & 0x7F].map(|bits| u8::try_from(bits).unwrap_or_default())
}

/// The value of two bytes of seven bits, the low one first.
pub(super) fn join(low: u8, high: u8) -> i32 {
    i32::from(high) << 7 | i32::from(low)
}
