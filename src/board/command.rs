//! Every command of the protocol table as a typed value, and the way to and from its bytes.

use std::fmt;

use super::frame::{self, Frame, MAX_PAYLOAD, Payload};
use super::number::{Displacement, OutOfRange, PulseWidth, ServoIndex, Speed, TiltPulseWidth, TurnRate};

/// What the host can say to the board. Each variant is one row of the protocol table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Function 0x01: mode and controller gains.
    Pid(Mode, Gains),
    /// Function 0x02, length 4: pan and tilt servo (1 and 2) in one frame.
    Servos {
        /// Pulse width of servo 1, horizontal.
        pan: PulseWidth,
        /// Pulse width of servo 2, vertical.
        tilt: TiltPulseWidth,
    },
    /// Function 0x02, length 3: one servo.
    Servo {
        /// Which one.
        index: ServoIndex,
        /// Its pulse width.
        pulse: PulseWidth,
    },
    /// Function 0x03, kind 0x01: speed of the whole robot. All zero is the stop.
    Rocker {
        /// To the right.
        x: Speed,
        /// Forward.
        y: Speed,
        /// Clockwise.
        z: TurnRate,
    },
    /// Function 0x03, kind 0x02: each wheel. A front right, B rear right, C rear left, D front left.
    Wheels([Speed; 4]),
    /// Function 0x03, kind 0x03: drive while the board keeps the heading.
    YawHold {
        /// To the right.
        x: Speed,
        /// Forward.
        y: Speed,
    },
    /// Function 0x03, kind 0x04: a displacement; needs [`Mode::Position`].
    Move {
        /// To the right.
        x: Displacement,
        /// Forward.
        y: Displacement,
        /// Clockwise.
        z: Displacement,
    },
    /// Function 0x04: the buzzer, on or off.
    Buzzer(bool),
    /// Function 0x05: ask for board data.
    Request(Query),
    /// Any function with any payload; not interpreted.
    Raw {
        /// The function byte.
        function: u8,
        /// The payload.
        payload: Payload,
    },
}

/// What the board controls: speeds or positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Speed mode, 0.
    Speed,
    /// Position mode, 1; `move` needs it.
    Position,
}

/// Controller gains, each 0-255 (protocol row 0x01).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gains {
    /// Speed P and I.
    pub speed: [u8; 2],
    /// Position P, I and D.
    pub position: [u8; 3],
    /// Yaw P, I and D.
    pub yaw: [u8; 3],
}

/// What can be asked of the board (protocol row 0x05).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Query(u8);

/// Names of the requests; the index is the byte on the wire.
const QUERIES: [&str; 10] = [
    "report-start",
    "encoder-1",
    "encoder-2",
    "encoder-3",
    "encoder-4",
    "voltage",
    "pitch",
    "roll",
    "yaw",
    "report-stop",
];

impl Query {
    /// Every request's name.
    pub const NAMES: &[&str] = &QUERIES;

    /// Reports ten times a second, from now on.
    pub const REPORT_START: Query = Query(0);
    /// No more of them.
    pub const REPORT_STOP: Query = Query(9);

    /// The request with this name.
    pub fn named(name: &str) -> Option<Query> {
        let at = QUERIES.iter().position(|&query| query == name)?;
        u8::try_from(at).ok().map(Query)
    }

    fn from_wire(byte: u8) -> Option<Query> {
        (usize::from(byte) < QUERIES.len()).then_some(Query(byte))
    }

    /// The name, as scripts write it.
    pub fn name(self) -> &'static str {
        QUERIES.get(usize::from(self.0)).copied().unwrap_or_default()
    }
}

impl Mode {
    /// The mode with this name.
    pub fn named(name: &str) -> Option<Mode> {
        match name {
            "speed" => Some(Mode::Speed),
            "position" => Some(Mode::Position),
            _ => None,
        }
    }

    /// The name, as scripts write it.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Speed => "speed",
            Mode::Position => "position",
        }
    }
}

/// A frame that is whole but says nothing that the protocol table knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotACommand {
    /// No row has this function, kind and length.
    #[error("no command has this function and length")]
    Unknown,
    /// A value is outside its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The values are fine, but the frame is not the one that carries them (a wrong direction byte, say).
    #[error("the bytes are not those that carry this command")]
    Inconsistent,
    /// A `move` whose direction only [`MovePacking::Older`] explains.
    #[error("a move, as older copies of the driver pack it; --older-move reads it")]
    OlderMove,
}

/// How the direction of a `move` is packed. Copies of the maker's driver differ, and which one the firmware of a board expects is
/// unknown; we send the newest, and read what is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MovePacking {
    /// A negative x sets bit 2, a negative y bit 1, and a z that is not negative bit 0.
    #[default]
    Newest,
    /// Bits 0, 1 and 2 for x, y and z, each set where the value is not negative.
    Older,
}

mod function {
    pub(super) const PID: u8 = 0x01;
    pub(super) const SERVO: u8 = 0x02;
    pub(super) const DRIVE: u8 = 0x03;
    pub(super) const BUZZER: u8 = 0x04;
    pub(super) const REQUEST: u8 = 0x05;
}

mod kind {
    pub(super) const ROCKER: u8 = 0x01;
    pub(super) const WHEELS: u8 = 0x02;
    pub(super) const YAW_HOLD: u8 = 0x03;
    pub(super) const MOVE: u8 = 0x04;
}

/// Direction bits of rocker, yaw hold and move, as the vendor's driver sets them.
mod direction {
    pub(super) const X_NEGATIVE: u8 = 0b100;
    pub(super) const Y_NEGATIVE: u8 = 0b010;
    pub(super) const Z_NOT_NEGATIVE: u8 = 0b001;
}

/// The payload length that a function of the protocol table has; `None` for functions it does not know.
pub(super) fn known_lengths(function: u8) -> Option<&'static [u8]> {
    match function {
        function::PID => Some(&[9]),
        function::SERVO => Some(&[3, 4]),
        function::DRIVE => Some(&[8]),
        function::BUZZER | function::REQUEST => Some(&[1]),
        _ => None,
    }
}

/// How many zeros bring a receiver back in step that was cut off inside the frame of any command but `raw`, whatever length it
/// trusts. The longest payload has 9 bytes, and a frame that was cut right behind its header becomes one of function 0 and length 0.
pub(super) const ZEROS: usize = 12;
/// The same for any frame at all.
pub const MOST_ZEROS: usize = MAX_PAYLOAD + 2;

/// How many zeros must follow a flush of a line that carries these commands, before a stop: a flush can cut a frame, and a receiver
/// that waits for the rest of it would take the stop for that.
pub fn zeros_behind_flush<'a>(commands: impl IntoIterator<Item = &'a Command>) -> usize {
    let raw = commands.into_iter().filter_map(|command| match command {
        Command::Raw { payload, .. } => Some(payload.bytes().len() + 2),
        _ => None,
    });
    raw.fold(ZEROS, usize::max)
}

impl Command {
    /// The all-zero rocker: the drive stops.
    pub const STOP: Command = Command::Rocker { x: Speed::ZERO, y: Speed::ZERO, z: TurnRate::ZERO };

    /// Appends the frame that carries this command.
    pub fn encode(&self, out: &mut Vec<u8>) {
        match self {
            Command::Pid(mode, gains) => {
                let mode = match mode {
                    Mode::Speed => 0,
                    Mode::Position => 1,
                };
                let [sp, si] = gains.speed;
                let [pp, pi, pd] = gains.position;
                let [yp, yi, yd] = gains.yaw;
                frame::emit(out, function::PID, &[mode, sp, si, pp, pi, pd, yp, yi, yd]);
            }
            Command::Servos { pan, tilt } => {
                let [pan_high, pan_low] = pan.magnitude();
                let [tilt_high, tilt_low] = tilt.magnitude();
                frame::emit(out, function::SERVO, &[pan_high, pan_low, tilt_high, tilt_low]);
            }
            Command::Servo { index, pulse } => {
                let [_, index] = index.magnitude();
                let [high, low] = pulse.magnitude();
                frame::emit(out, function::SERVO, &[index, high, low]);
            }
            Command::Rocker { x, y, z } => {
                let magnitudes = [x.magnitude(), y.magnitude(), z.magnitude()];
                let signs = direction_of(x.is_negative(), y.is_negative(), z.is_negative());
                emit_drive(out, kind::ROCKER, magnitudes, signs);
            }
            Command::Move { x, y, z } => {
                let magnitudes = [x.magnitude(), y.magnitude(), z.magnitude()];
                let signs = direction_of(x.is_negative(), y.is_negative(), z.is_negative());
                emit_drive(out, kind::MOVE, magnitudes, signs);
            }
            Command::YawHold { x, y } => {
                // The z bit is always 0 here, so z counts as negative.
                let signs = direction_of(x.is_negative(), y.is_negative(), true);
                let magnitudes = [x.magnitude(), y.magnitude(), [0, 0]];
                emit_drive(out, kind::YAW_HOLD, magnitudes, signs);
            }
            Command::Wheels(wheels) => {
                let [a, b, c, d] = wheels.map(|wheel| wheel.magnitude()[1]);
                let bits = wheels.iter().zip([1, 2, 4, 8]);
                let signs = bits.filter(|(wheel, _)| wheel.is_negative()).fold(0, |signs, (_, bit)| signs | bit);
                emit_drive(out, kind::WHEELS, [[a, b], [c, d], [0, 0]], signs);
            }
            Command::Buzzer(on) => frame::emit(out, function::BUZZER, &[u8::from(*on)]),
            Command::Request(query) => frame::emit(out, function::REQUEST, &[query.0]),
            Command::Raw { function, payload } => frame::emit(out, *function, payload.bytes()),
        }
    }

    /// How many bytes its frame has.
    pub fn frame_length(&self) -> usize {
        let payload = match self {
            Command::Pid(..) => 9,
            Command::Servos { .. } => 4,
            Command::Servo { .. } => 3,
            Command::Rocker { .. } | Command::Wheels(_) | Command::YawHold { .. } | Command::Move { .. } => 8,
            Command::Buzzer(_) | Command::Request(_) => 1,
            Command::Raw { payload, .. } => payload.bytes().len(),
        };
        frame::OVERHEAD + payload
    }

    /// The frame that carries this command, in a vector of its own.
    pub fn to_frame(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.frame_length());
        self.encode(&mut out);
        out
    }

    /// Reads a frame. Strict: what it accepts, [`encode`](Self::encode) gives back byte for byte.
    pub fn decode(frame: Frame<'_>) -> Result<Command, NotACommand> {
        let command = Self::read(frame)?;
        if command.to_frame() == frame.bytes() { Ok(command) } else { Err(NotACommand::Inconsistent) }
    }

    /// Reads a frame of a program whose driver packs the direction of a `move` in one of two ways.
    pub fn decode_as(frame: Frame<'_>, packing: MovePacking) -> Result<Command, NotACommand> {
        match (Self::older_move(frame), packing) {
            (Some(older), MovePacking::Older) => older,
            (Some(Ok(_)), MovePacking::Newest) => Self::decode(frame).map_err(|_| NotACommand::OlderMove),
            _ => Self::decode(frame),
        }
    }

    /// A `move` in the older packing; `None` for any other frame.
    fn older_move(frame: Frame<'_>) -> Option<Result<Command, NotACommand>> {
        let (function::DRIVE, &[kind::MOVE, xh, xl, yh, yl, zh, zl, signs]) = (frame.function(), frame.payload())
        else {
            return None;
        };
        let axis = |bytes: [u8; 2], bit: u8| {
            let is_negative = signs & bit == 0;
            let value = Displacement::from_wire(bytes, is_negative)?;
            // Zero is not negative.
            if is_negative && bytes == [0, 0] { Err(NotACommand::Inconsistent) } else { Ok(value) }
        };
        let read = || {
            if signs > 0b111 {
                return Err(NotACommand::Inconsistent);
            }
            Ok(Command::Move { x: axis([xh, xl], 1)?, y: axis([yh, yl], 2)?, z: axis([zh, zl], 4)? })
        };
        Some(read())
    }

    /// Reads a frame that is known to be whole, whatever it says: what is no command becomes [`Command::Raw`].
    pub fn decode_or_raw(frame: Frame<'_>) -> Command {
        Self::decode(frame).unwrap_or_else(|_| Self::raw(frame))
    }

    /// The frame as a raw one, whatever it says.
    pub fn raw(frame: Frame<'_>) -> Command {
        Command::Raw { function: frame.function(), payload: Payload::of(frame) }
    }

    fn read(frame: Frame<'_>) -> Result<Command, NotACommand> {
        Ok(match (frame.function(), frame.payload()) {
            (function::PID, &[mode, sp, si, pp, pi, pd, yp, yi, yd]) => {
                let mode = match mode {
                    0 => Mode::Speed,
                    1 => Mode::Position,
                    _ => return Err(NotACommand::Unknown),
                };
                let gains = Gains { speed: [sp, si], position: [pp, pi, pd], yaw: [yp, yi, yd] };
                Command::Pid(mode, gains)
            }
            (function::SERVO, &[ph, pl, th, tl]) => Command::Servos {
                pan: PulseWidth::from_wire([ph, pl], false)?,
                tilt: TiltPulseWidth::from_wire([th, tl], false)?,
            },
            (function::SERVO, &[index, high, low]) => Command::Servo {
                index: ServoIndex::from_wire([0, index], false)?,
                pulse: PulseWidth::from_wire([high, low], false)?,
            },
            (function::DRIVE, &[kind, xh, xl, yh, yl, zh, zl, signs]) => {
                let x = ([xh, xl], signs & direction::X_NEGATIVE != 0);
                let y = ([yh, yl], signs & direction::Y_NEGATIVE != 0);
                let z = ([zh, zl], signs & direction::Z_NOT_NEGATIVE == 0);
                match kind {
                    kind::ROCKER => Command::Rocker {
                        x: Speed::from_wire(x.0, x.1)?,
                        y: Speed::from_wire(y.0, y.1)?,
                        z: TurnRate::from_wire(z.0, z.1)?,
                    },
                    kind::MOVE => Command::Move {
                        x: Displacement::from_wire(x.0, x.1)?,
                        y: Displacement::from_wire(y.0, y.1)?,
                        z: Displacement::from_wire(z.0, z.1)?,
                    },
                    kind::YAW_HOLD => {
                        Command::YawHold { x: Speed::from_wire(x.0, x.1)?, y: Speed::from_wire(y.0, y.1)? }
                    }
                    kind::WHEELS => {
                        let wheel = |byte, bit| Speed::from_wire([0, byte], signs & bit != 0);
                        Command::Wheels([wheel(xh, 1)?, wheel(xl, 2)?, wheel(yh, 4)?, wheel(yl, 8)?])
                    }
                    _ => return Err(NotACommand::Unknown),
                }
            }
            (function::BUZZER, &[on @ (0 | 1)]) => Command::Buzzer(on == 1),
            (function::REQUEST, &[query]) => Command::Request(Query::from_wire(query).ok_or(NotACommand::Unknown)?),
            _ => return Err(NotACommand::Unknown),
        })
    }

    /// Whether it is a command to the drive. A raw frame with the drive's function is one.
    pub fn is_drive(&self) -> bool {
        match self {
            Command::Rocker { .. } | Command::Wheels(_) | Command::YawHold { .. } | Command::Move { .. } => true,
            Command::Raw { function, .. } => *function == function::DRIVE,
            _ => false,
        }
    }

    /// Whether it is a command to the buzzer, or a raw frame with its function.
    pub fn is_buzzer(&self) -> bool {
        match self {
            Command::Buzzer(_) => true,
            Command::Raw { function, .. } => *function == function::BUZZER,
            _ => false,
        }
    }

    /// Whether nothing is left of `older` once the board has this one: both set the same drive or the same servos.
    pub fn overtakes(&self, older: &Command) -> bool {
        match (older, self) {
            (Command::Servo { index, .. }, Command::Servo { index: newer, .. }) => index == newer,
            (Command::Servo { index, .. }, Command::Servos { .. }) => index.get() <= 2,
            (Command::Servos { .. }, Command::Servos { .. }) => true,
            _ => older.is_drive() && self.is_drive(),
        }
    }

    /// Whether the drive stays active until the next drive command: a rocker or wheels that are not zero, and any yaw hold,
    /// because at zero it still keeps the heading.
    pub fn keeps_driving(&self) -> bool {
        match self {
            Command::Rocker { x, y, z } => !(x.is_zero() && y.is_zero() && z.is_zero()),
            Command::Wheels(wheels) => !wheels.iter().all(|wheel| wheel.is_zero()),
            Command::YawHold { .. } => true,
            _ => false,
        }
    }
}

fn direction_of(x_negative: bool, y_negative: bool, z_negative: bool) -> u8 {
    let bit = |set: bool, bit: u8| if set { bit } else { 0 };
    bit(x_negative, direction::X_NEGATIVE)
        | bit(y_negative, direction::Y_NEGATIVE)
        | bit(!z_negative, direction::Z_NOT_NEGATIVE)
}

fn emit_drive(out: &mut Vec<u8>, kind: u8, magnitudes: [[u8; 2]; 3], signs: u8) {
    let [[xh, xl], [yh, yl], [zh, zl]] = magnitudes;
    frame::emit(out, function::DRIVE, &[kind, xh, xl, yh, yl, zh, zl, signs]);
}

/// The canonical notation: what a script would say to send exactly this frame.
impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Command::Pid(mode, gains) => {
                let [sp, si] = gains.speed;
                let [pp, pi, pd] = gains.position;
                let [yp, yi, yd] = gains.yaw;
                let mode = mode.name();
                write!(f, "pid {mode} speed={sp},{si} position={pp},{pi},{pd} yaw={yp},{yi},{yd}")
            }
            Command::Servos { pan, tilt } => write!(f, "servos {pan} {tilt}"),
            Command::Servo { index, pulse } => write!(f, "servo {index} {pulse}"),
            stop if *stop == Command::STOP => f.write_str("stop"),
            Command::Rocker { x, y, z } => write!(f, "rocker x={x} y={y} z={z}"),
            Command::Wheels([a, b, c, d]) => write!(f, "wheels {a} {b} {c} {d}"),
            Command::YawHold { x, y } => write!(f, "yawhold x={x} y={y}"),
            Command::Move { x, y, z } => write!(f, "move x={x} y={y} z={z}"),
            Command::Buzzer(on) => write!(f, "buzzer {}", if *on { "on" } else { "off" }),
            Command::Request(query) => write!(f, "request {}", query.name()),
            Command::Raw { function, payload } => {
                write!(f, "raw 0x{function:02X}")?;
                payload.bytes().iter().try_for_each(|byte| write!(f, " 0x{byte:02X}"))
            }
        }
    }
}
