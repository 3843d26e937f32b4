//! Encodes and decodes every command of the protocol table.

use super::frame::{self, MAX_PAYLOAD, MOST_ZEROS, OVERHEAD, ZEROS, function};
use super::verb;
use crate::board::frame::{BufferStart, FrameError};
use crate::board::{Board, Codec, Command, NotACommand, VerbId};

mod kind {
    pub(super) const ROCKER: u8 = 0x01;
    pub(super) const WHEELS: u8 = 0x02;
    pub(super) const YAW_HOLD: u8 = 0x03;
    pub(super) const MOVE: u8 = 0x04;
}

/// The function bytes of raw frames that can change the drive and the buzzer.
pub(super) const DRIVE_FUNCTION: i32 = 0x03;
pub(super) const BUZZER_FUNCTION: i32 = 0x04;

/// Direction bits of rocker, yaw hold and move, as the vendor's driver sets them.
mod direction {
    pub(super) const X_NEGATIVE: u8 = 0b100;
    pub(super) const Y_NEGATIVE: u8 = 0b010;
    pub(super) const Z_NOT_NEGATIVE: u8 = 0b001;
}

/// The codec; `older`: the direction bits of a `move` are read as in older versions of the driver.
#[derive(Debug)]
pub(super) struct Frames {
    pub(super) older: bool,
}

impl Codec for Frames {
    fn encode(&self, _: &Board, command: &Command, out: &mut Vec<u8>) {
        encode(command, out);
    }

    fn length(&self, _: &Board, command: &Command) -> usize {
        length(command)
    }

    fn check(&self, bytes: &[u8]) -> Result<(), FrameError> {
        frame::check(bytes)
    }

    fn decode(&self, board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
        if self.older { decode_older(board, frame) } else { decode(board, frame) }
    }

    fn raw(&self, board: &Board, frame: &[u8]) -> Option<Command> {
        raw(board, frame)
    }

    fn front(&self, bytes: &[u8], in_zeros: bool) -> BufferStart {
        frame::front(bytes, in_zeros)
    }

    fn next_start(&self, bytes: &[u8]) -> usize {
        frame::next_start(bytes)
    }

    fn longest(&self) -> usize {
        frame::MAX_FRAME
    }

    fn resync(&self, command: Option<&Command>) -> usize {
        match command {
            None => MOST_ZEROS,
            Some(command) if command.verb() == verb::RAW => (command.len() + 1).max(ZEROS),
            Some(_) => ZEROS,
        }
    }
}

/// Appends the frame of a command.
fn encode(command: &Command, out: &mut Vec<u8>) {
    let values = command.values();
    let [a, b, c, d] = [0, 1, 2, 3].map(|at| values.get(at).copied().unwrap_or_default());
    let bytes = values.iter().copied().map(byte);
    match command.verb() {
        verb::SERVO => {
            let [high, low] = magnitude(b);
            frame::emit(out, function::SERVO, [byte(a), high, low]);
        }
        verb::SERVOS => frame::emit(out, function::SERVO, [magnitude(a), magnitude(b)].concat()),
        verb::ROCKER => emit_drive(out, kind::ROCKER, [a, b, c], direction_of(a, b, c)),
        verb::MOVE => emit_drive(out, kind::MOVE, [a, b, c], direction_of(a, b, c)),
        // The z bit is always 0 in this frame, which encodes a negative z.
        verb::YAW_HOLD => emit_drive(out, kind::YAW_HOLD, [a, b, 0], direction_of(a, b, -1)),
        verb::WHEELS => {
            let [ma, mb, mc, md] = [a, b, c, d].map(|wheel| magnitude(wheel)[1]);
            let bits = [a, b, c, d].into_iter().zip([1, 2, 4, 8]);
            let signs = bits.filter(|(wheel, _)| *wheel < 0).fold(0, |signs, (_, bit)| signs | bit);
            frame::emit(out, function::DRIVE, [kind::WHEELS, ma, mb, mc, md, 0, 0, signs]);
        }
        verb::BUZZER => frame::emit(out, function::BUZZER, bytes),
        verb::PID => frame::emit(out, function::PID, bytes),
        verb::REQUEST => frame::emit(out, function::REQUEST, bytes),
        _ => frame::emit(out, byte(a), bytes.skip(1)),
    }
}

/// The length of a command's frame in bytes.
fn length(command: &Command) -> usize {
    let payload = match command.verb() {
        verb::SERVO => 3,
        verb::SERVOS => 4,
        verb::ROCKER | verb::MOVE | verb::YAW_HOLD | verb::WHEELS => 8,
        verb::RAW => command.len() - 1,
        _ => command.len(),
    };
    OVERHEAD + payload.min(MAX_PAYLOAD)
}

/// Decodes a frame. Strict: [`encode`] returns the same bytes for the result.
fn decode(board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
    match (decode_as_is(board, frame), older_move(board, frame)) {
        (Err(_), Some(Ok(_))) => Err(NotACommand::OtherReading(
            "a `move` with the direction bits of older driver versions; --older-move reads it",
        )),
        (read, _) => read,
    }
}

/// The same, with the direction bits of a `move` as in older versions of the driver.
fn decode_older(board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
    older_move(board, frame).unwrap_or_else(|| decode_as_is(board, frame))
}

fn decode_as_is(board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
    let command = read(board, frame)?;
    if board.to_frame(&command) == frame { Ok(command) } else { Err(NotACommand::Inconsistent) }
}

/// A `move` with the direction bits of older driver versions: bits 0, 1 and 2 for x, y and z, set
/// if the value is not negative. `None` for any other frame.
fn older_move(board: &Board, frame: &[u8]) -> Option<Result<Command, NotACommand>> {
    let Some((function::DRIVE, &[kind::MOVE, xh, xl, yh, yl, zh, zl, signs])) = frame::parts(frame) else {
        return None;
    };
    let axes = [([xh, xl], 1), ([yh, yl], 2), ([zh, zl], 4)];
    // The older driver counts zero as not negative.
    let is_wrong = signs > 0b111 || axes.iter().any(|(bytes, bit)| signs & bit == 0 && *bytes == [0, 0]);
    if is_wrong {
        return Some(Err(NotACommand::Inconsistent));
    }
    Some(board.command(verb::MOVE, &axes.map(|(bytes, bit)| signed(bytes, signs & bit == 0))))
}

/// Any frame as a raw one.
fn raw(board: &Board, frame: &[u8]) -> Option<Command> {
    let (function, payload) = frame::parts(frame)?;
    let values: Vec<i32> = std::iter::once(function).chain(payload.iter().copied()).map(i32::from).collect();
    board.command(verb::RAW, &values).ok()
}

fn read(board: &Board, frame: &[u8]) -> Result<Command, NotACommand> {
    let say = |verb: VerbId, values: &[i32]| board.command(verb, values);
    let (function, payload) = frame::parts(frame).ok_or(NotACommand::Unknown)?;
    match (function, payload) {
        (function::PID, &[0 | 1, ..]) if payload.len() == 9 => {
            let values: Vec<i32> = payload.iter().copied().map(i32::from).collect();
            say(verb::PID, &values)
        }
        (function::SERVO, &[ph, pl, th, tl]) => say(verb::SERVOS, &[signed([ph, pl], false), signed([th, tl], false)]),
        (function::SERVO, &[index, high, low]) => say(verb::SERVO, &[index.into(), signed([high, low], false)]),
        (function::DRIVE, &[kind, xh, xl, yh, yl, zh, zl, signs]) => {
            let x = signed([xh, xl], signs & direction::X_NEGATIVE != 0);
            let y = signed([yh, yl], signs & direction::Y_NEGATIVE != 0);
            let z = signed([zh, zl], signs & direction::Z_NOT_NEGATIVE == 0);
            match kind {
                kind::ROCKER => say(verb::ROCKER, &[x, y, z]),
                kind::MOVE => say(verb::MOVE, &[x, y, z]),
                kind::YAW_HOLD => say(verb::YAW_HOLD, &[x, y]),
                kind::WHEELS => {
                    let wheel = |byte, bit| signed([0, byte], signs & bit != 0);
                    say(verb::WHEELS, &[wheel(xh, 1), wheel(xl, 2), wheel(yh, 4), wheel(yl, 8)])
                }
                _ => Err(NotACommand::Unknown),
            }
        }
        (function::BUZZER, &[on @ (0 | 1)]) => say(verb::BUZZER, &[on.into()]),
        (function::REQUEST, &[query]) => say(verb::REQUEST, &[query.into()]).map_err(|_| NotACommand::Unknown),
        _ => Err(NotACommand::Unknown),
    }
}

/// A value from its sign and its magnitude, high byte first.
fn signed(magnitude: [u8; 2], is_negative: bool) -> i32 {
    let value = i32::from(u16::from_be_bytes(magnitude));
    if is_negative { -value } else { value }
}

/// The magnitude in two bytes, high byte first. Every range of the table fits.
fn magnitude(value: i32) -> [u8; 2] {
    let [_, _, high, low] = value.unsigned_abs().to_be_bytes();
    [high, low]
}

/// A value whose range in the table is within 0 to 255.
fn byte(value: i32) -> u8 {
    magnitude(value)[1]
}

fn direction_of(x: i32, y: i32, z: i32) -> u8 {
    let bit = |set: bool, bit: u8| if set { bit } else { 0 };
    bit(x < 0, direction::X_NEGATIVE) | bit(y < 0, direction::Y_NEGATIVE) | bit(z >= 0, direction::Z_NOT_NEGATIVE)
}

fn emit_drive(out: &mut Vec<u8>, kind: u8, values: [i32; 3], signs: u8) {
    let [[xh, xl], [yh, yl], [zh, zl]] = values.map(magnitude);
    frame::emit(out, function::DRIVE, [kind, xh, xl, yh, yl, zh, zl, signs]);
}
