//! The layout of every frame: header, function, length, payload, checksum; and how to find frames
//! in a stream.

use crate::board::frame::{BufferStart, FrameError, Skip};

/// The two bytes that every frame starts with.
pub(super) const HEADER: [u8; 2] = [0xFF, 0xFE];
/// The longest payload in bytes: the length field is one byte.
pub(super) const MAX_PAYLOAD: usize = 255;
/// The longest frame in bytes.
pub(super) const MAX_FRAME: usize = OVERHEAD + MAX_PAYLOAD;
/// The length of header, function, length and checksum in bytes.
pub(super) const OVERHEAD: usize = 5;
/// The number of zeros that resynchronize a receiver after any truncated frame except one of `raw`,
/// whatever length it read. The longest payload has 9 bytes, and a frame that was truncated after
/// its header becomes one of function 0 and length 0.
pub(super) const ZEROS: usize = 12;
/// The same for any frame.
pub(super) const MOST_ZEROS: usize = MAX_PAYLOAD + 2;

/// The function bytes.
pub(super) mod function {
    pub(in super::super) const PID: u8 = 0x01;
    pub(in super::super) const SERVO: u8 = 0x02;
    pub(in super::super) const DRIVE: u8 = 0x03;
    pub(in super::super) const BUZZER: u8 = 0x04;
    pub(in super::super) const REQUEST: u8 = 0x05;
}

/// The payload lengths of a function in the protocol table; `None` for unknown functions.
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

/// Appends a frame to `out`: header, `function`, length, payload, checksum. The table allows at
/// most [`MAX_PAYLOAD`] bytes of payload; more are dropped.
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

/// The low 8 bits of function + length + all payload bytes; the header is not included.
fn checksum(summed: &[u8]) -> u8 {
    summed.iter().fold(0, |sum, &byte| sum.wrapping_add(byte))
}

/// The longest payload for which a frame of an unknown function is read to its end, whatever it
/// contains. The longest payload of a command has 9 bytes.
const PLAUSIBLE: u8 = 32;

pub(super) fn front(rest: &[u8], in_zeros: bool) -> BufferStart {
    let zeros = zeros_of(rest);
    let (function, length) = match *rest {
        [0, ..] if in_zeros || zeros >= ZEROS => return BufferStart::Skip(zeros, Skip::Zeros),
        [0, ..] if zeros == rest.len() => return BufferStart::NeedMore,
        [first, second, ..] if [first, second] != HEADER => {
            let noise = next_start(rest);
            // Zeros that are a run of resynchronizing zeros, or may become one, do not belong to
            // the noise.
            let is_stop = |at: &usize| {
                let rest = rest.get(*at..).unwrap_or_default();
                zeros_of(rest) >= ZEROS || zeros_of(rest) == rest.len()
            };
            return BufferStart::Skip((zeros.max(1)..noise).find(is_stop).unwrap_or(noise), Skip::Noise);
        }
        [first] if first != HEADER[0] => return BufferStart::Skip(1, Skip::Noise),
        [_, _, function, length, ..] => (function, length),
        _ => return BufferStart::NeedMore,
    };
    if known_lengths(function).is_some_and(|lengths| !lengths.contains(&length)) {
        return BufferStart::Skip(next_start(rest), Skip::Length { function, length });
    }
    let whole = OVERHEAD + usize::from(length);
    if length > PLAUSIBLE && known_lengths(function).is_none() {
        let inside = rest.get(..whole).unwrap_or(rest);
        if let Some(start) = command_inside(inside) {
            return BufferStart::Skip(start, Skip::Torn);
        }
    }
    let Some(frame) = rest.get(..whole) else {
        return BufferStart::NeedMore;
    };
    match check(frame) {
        Ok(()) => BufferStart::Frame(whole),
        Err(FrameError::Checksum { expected, found }) => {
            BufferStart::Skip(next_start(frame), Skip::Checksum { expected, found })
        }
        Err(_) => BufferStart::Skip(1, Skip::Noise),
    }
}

/// The number of zeros at the front.
fn zeros_of(rest: &[u8]) -> usize {
    rest.iter().take_while(|byte| **byte == 0).count()
}

/// The start of a command's frame inside a frame with an implausible length, if there is a complete
/// one. It is the one that ends first, so that the result does not depend on how the stream is
/// split into reads.
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

/// The number of bytes, at least one, up to the next byte that can start a frame.
pub(super) fn next_start(rest: &[u8]) -> usize {
    let starts = |at: &usize| match rest.get(*at..) {
        Some([first, second, ..]) => [*first, *second] == HEADER,
        Some([first]) => *first == HEADER[0],
        _ => false,
    };
    (1..rest.len()).find(starts).unwrap_or(rest.len())
}
