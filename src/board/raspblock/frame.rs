//! The envelope of every frame: header, function, length, payload, checksum; and how frames are found in a stream.

use crate::board::frame::{FrameError, Front, Skip};

/// The two bytes that every frame starts with.
pub(super) const HEADER: [u8; 2] = [0xFF, 0xFE];
/// The longest payload in bytes: the length field is one byte.
pub(super) const MAX_PAYLOAD: usize = 255;
/// The longest frame in bytes.
pub(super) const MAX_FRAME: usize = OVERHEAD + MAX_PAYLOAD;
/// Header, function, length and checksum.
pub(super) const OVERHEAD: usize = 5;
/// How many zeros bring a receiver back in step that was cut off inside the frame of any command but `raw`, whatever length it
/// trusts. The longest payload has 9 bytes, and a frame that was cut right after its header becomes one of function 0 and length 0.
pub(super) const ZEROS: usize = 12;
/// The same for any frame at all.
pub(super) const MOST_ZEROS: usize = MAX_PAYLOAD + 2;

/// The function bytes.
pub(super) mod function {
    pub(in super::super) const PID: u8 = 0x01;
    pub(in super::super) const SERVO: u8 = 0x02;
    pub(in super::super) const DRIVE: u8 = 0x03;
    pub(in super::super) const BUZZER: u8 = 0x04;
    pub(in super::super) const REQUEST: u8 = 0x05;
}

/// The payload length that a function of the protocol table has; `None` for functions it does not know.
fn known_lengths(function: u8) -> Option<&'static [u8]> {
    match function {
        function::PID => Some(&[9]),
        function::SERVO => Some(&[3, 4]),
        function::DRIVE => Some(&[8]),
        function::BUZZER | function::REQUEST => Some(&[1]),
        _ => None,
    }
}

/// Checks that `bytes` are exactly one frame.
pub(super) fn check(bytes: &[u8]) -> Result<(), FrameError> {
    let Some(body) = bytes.strip_prefix(&HEADER) else {
        return Err(FrameError::NoHeader);
    };
    let Some((&found, summed)) = body.split_last() else {
        return Err(FrameError::Length);
    };
    match *summed {
        [_, length, ref payload @ ..] if payload.len() == usize::from(length) => {}
        _ => return Err(FrameError::Length),
    }
    let expected = checksum(summed);
    if expected == found { Ok(()) } else { Err(FrameError::Checksum { expected, found }) }
}

/// The function byte and the payload of a frame.
pub(super) fn parts(frame: &[u8]) -> Option<(u8, &[u8])> {
    match frame {
        [_, _, function, _, payload @ .., _] => Some((*function, payload)),
        _ => None,
    }
}

/// Appends a whole frame to `out`: header, `function`, length, the payload's bytes, checksum. Of the payload at most [`MAX_PAYLOAD`] bytes
/// count; the table allows no more.
pub(super) fn emit(out: &mut Vec<u8>, function: u8, payload: impl IntoIterator<Item = u8>) {
    out.extend_from_slice(&HEADER);
    let summed = out.len();
    out.extend_from_slice(&[function, 0]);
    out.extend(payload.into_iter().take(MAX_PAYLOAD));
    let length = out.len() - summed - 2;
    if let Some(place) = out.get_mut(summed + 1) {
        *place = u8::try_from(length).unwrap_or(u8::MAX);
    }
    let sum = checksum(out.get(summed..).unwrap_or_default());
    out.push(sum);
}

/// Low 8 bits of function + length + every payload byte; the header is not in the sum.
fn checksum(summed: &[u8]) -> u8 {
    summed.iter().fold(0, |sum, &byte| sum.wrapping_add(byte))
}

/// The longest payload of a frame of an unknown function that is waited for whatever is inside it. The longest one of a command has
/// 9 bytes.
const PLAUSIBLE: u8 = 32;

pub(super) fn front(rest: &[u8], in_zeros: bool) -> Front {
    let zeros = zeros_of(rest);
    let (function, length) = match *rest {
        [0, ..] if in_zeros || zeros >= ZEROS => return Front::Skip(zeros, Skip::Zeros),
        [0, ..] if zeros == rest.len() => return Front::NeedMore,
        [first, second, ..] if [first, second] != HEADER => {
            let noise = next_start(rest);
            // Zeros that are as many as those of a stop, or may become so, are no part of it.
            let is_stop = |at: &usize| {
                let rest = rest.get(*at..).unwrap_or_default();
                zeros_of(rest) >= ZEROS || zeros_of(rest) == rest.len()
            };
            return Front::Skip((zeros.max(1)..noise).find(is_stop).unwrap_or(noise), Skip::Noise);
        }
        [first] if first != HEADER[0] => return Front::Skip(1, Skip::Noise),
        [_, _, function, length, ..] => (function, length),
        _ => return Front::NeedMore,
    };
    if known_lengths(function).is_some_and(|lengths| !lengths.contains(&length)) {
        return Front::Skip(next_start(rest), Skip::Length { function, length });
    }
    let whole = OVERHEAD + usize::from(length);
    if length > PLAUSIBLE && known_lengths(function).is_none() {
        let inside = rest.get(..whole).unwrap_or(rest);
        if let Some(start) = command_inside(inside) {
            return Front::Skip(start, Skip::Torn);
        }
    }
    let Some(frame) = rest.get(..whole) else {
        return Front::NeedMore;
    };
    match check(frame) {
        Ok(()) => Front::Frame(whole),
        Err(FrameError::Checksum { expected, found }) => {
            Front::Skip(next_start(frame), Skip::Checksum { expected, found })
        }
        Err(_) => Front::Skip(1, Skip::Noise),
    }
}

/// How many zeros are at the front.
fn zeros_of(rest: &[u8]) -> usize {
    rest.iter().take_while(|byte| **byte == 0).count()
}

/// Where the frame of a command starts inside what claims to be a longer frame, if a whole one does: the one that ends first, so that it
/// is the same one however the stream is cut into reads.
fn command_inside(claimed: &[u8]) -> Option<usize> {
    let ends = (1..claimed.len()).filter_map(|at| {
        let rest = claimed.get(at..).unwrap_or_default();
        let [first, second, function, length, ..] = *rest else { return None };
        let whole = OVERHEAD + usize::from(length);
        let is_command = [first, second] == HEADER
            && known_lengths(function).is_some_and(|lengths| lengths.contains(&length))
            && rest.get(..whole).is_some_and(|frame| check(frame).is_ok());
        is_command.then_some((at + whole, at))
    });
    ends.min().map(|(_, at)| at)
}

/// How many bytes to skip until the next one that can start a frame; at least one.
pub(super) fn next_start(rest: &[u8]) -> usize {
    let starts = |at: &usize| match rest.get(*at..) {
        Some([first, second, ..]) => [*first, *second] == HEADER,
        Some([first]) => *first == HEADER[0],
        _ => false,
    };
    (1..rest.len()).find(starts).unwrap_or(rest.len())
}
