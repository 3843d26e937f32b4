//! Feetech STS bus servos, as in the SO-100 and SO-101 arms.
//!
//! Source: Feetech's memory table and library. Not tried on hardware.

mod codec;
mod packet;
mod reply;

use std::sync::Arc;

use super::family::Family;
use super::table::{Board, Feedback, Preparation, Resource, Simulation};
use super::verb::{AngleScale, Axis, Forbidden, Measure, ResourceId, Sets, Unit, ValueForm, Verb};
use super::{Command, Hundredths, Quantity, Replies, Text};
use crate::units::Micros;
pub use codec::{emit_answer, packet};
pub use packet::{BROADCAST, Packet, instruction};

/// The rows of the verbs.
mod verb {
    use crate::board::VerbId;

    pub(super) const SERVO: VerbId = VerbId(0);
    pub(super) const TORQUE: VerbId = VerbId(1);
    // Row 2 is the torque of all servos, which is sent as that of each.
    pub(super) const SPEED: VerbId = VerbId(3);
    pub(super) const ACCEL: VerbId = VerbId(4);
    // No script contains the following.
    pub(super) const POSITION: VerbId = VerbId(5);
    pub(super) const VOLTAGE: VerbId = VerbId(6);
    pub(super) const MODE: VerbId = VerbId(7);
    pub(super) const SETTINGS: VerbId = VerbId(8);
    pub(super) const PING: VerbId = VerbId(9);
    pub(super) const READ: VerbId = VerbId(10);
    pub(super) const WRITE: VerbId = VerbId(11);
    pub(super) const WRITE_LATER: VerbId = VerbId(12);
    pub(super) const ACTION: VerbId = VerbId(13);
    pub(super) const RESET: VerbId = VerbId(14);
    pub(super) const SYNC_READ: VerbId = VerbId(15);
    pub(super) const SYNC_WRITE: VerbId = VerbId(16);
}

/// The registers of a servo, by their addresses. None below 40 is ever written.
pub mod register {
    /// How the servo is driven: 0 for positions, 1 as a wheel, 2 by PWM, 3 by steps.
    pub const MODE: u8 = 33;
    /// 0 without torque, 1 with it; 128 makes the present position the center.
    pub const TORQUE: u8 = 40;
    /// The acceleration, in steps of 100 per second squared; 0 for the most.
    pub const ACCELERATION: u8 = 41;
    /// The target position, in two bytes.
    pub const GOAL: u8 = 42;
    /// The speed on the way to the target, in two bytes.
    pub const SPEED: u8 = 46;
    /// The present position, in two bytes, with its sign in the top bit.
    pub const POSITION: u8 = 56;
    /// The voltage, in tenths of a volt.
    pub const VOLTAGE: u8 = 62;
}

/// The highest identifier of a servo.
const LAST: i32 = 253;
/// The largest position, in steps of which a turn has 4,096.
const LAST_STEP: i32 = 4_095;
/// The angles of the smallest and the largest position; 0 is the center.
const ANGLES: (f64, f64) = (-180.0, 179.912_109_375);
/// The speed of an STS3215 without load at 7.4 V, 60° in 0.222 s, in steps per second.
const SERVO_SPEED: u32 = 3_000;
/// How long a soft start takes unless a script sets it.
const SOFT: Micros = Micros::from_millis(2_000);
/// How near a servo is to its target that has followed a move: 5°, with a load.
const NEAR: i32 = 57;
/// The most bytes of a packet that only other programs send.
const MOST_BYTES: usize = 254;

/// The row of the table of families.
pub(super) const FAMILY: Family = Family {
    word: "sts",
    usage: "board sts",
    example: "board sts",
    meaning: "Feetech STS bus servos, as in the SO-100 and SO-101 arms, numbered from 0 to 253",
    number: None,
    options: &[],
    make: |_, _| board(),
};

fn board() -> Arc<Board> {
    let ids = || 0..=LAST;
    let named = |what: &'static str, key: &'static str| {
        ids().map(move |id| Resource::row(format!("{what}servo {id}"), format!("{key}_{id}")))
    };
    let servo = |resource| Resource { speed: Some(SERVO_SPEED), ..resource };
    Arc::new(Board {
        name: text("STS bus"),
        line: text("sts"),
        baud: 1_000_000,
        max_baud: 1_000_000,
        resources: named("", "servo")
            .map(servo)
            .chain(named("the speed of ", "speed"))
            .chain(named("the acceleration of ", "accel"))
            .collect(),
        verbs: verbs(),
        limits: Vec::new(),
        quantities: ids().map(position).chain(ids().map(voltage)).map(Arc::new).collect(),
        changes: Vec::new(),
        reporting: None,
        hello: Vec::new(),
        goodbye: Vec::new(),
        stop: Vec::new(),
        without_stop: text("servos with torque hold their position"),
        flushes: false,
        ambiguity: None,
        foreign: vec![(text("goal"), text("servo 1 2048")), (text("move"), text("servo 1 2048 over 2s"))],
        picture: None,
        simulation: Simulation::Servos,
        codec: Arc::new(codec::Packets),
        replies: Replies::Answers(reply::ANSWERS),
        feedback: Some(Feedback {
            verb: verb::SERVO,
            position: verb::POSITION,
            value: step,
            preparation: Some(Preparation {
                mode: verb::MODE,
                mode_words,
                settings: (verb::SETTINGS, [verb::SPEED, verb::ACCEL]),
                enable: verb::TORQUE,
                soft: SOFT,
            }),
            holds: Some(NEAR),
        }),
    })
}

fn text(text: &'static str) -> Text {
    Text::Borrowed(text)
}

/// A reported position in steps.
#[expect(clippy::unnecessary_wraps, reason = "as the table of the board has it")]
fn step(position: Hundredths) -> Option<i32> {
    Some(position.0 / 100)
}

/// What a mode other than 0 means.
fn mode_words(mode: i32) -> String {
    let mode = match mode {
        1 => "wheel mode",
        2 => "PWM mode",
        3 => "step mode",
        other => return format!("is in the unknown mode {other}, not in position mode"),
    };
    format!("is in {mode}, not in position mode")
}

/// The quantity that a request reads.
fn quantity_row(request: &Command) -> Option<u16> {
    let id = u16::try_from(request.value(0)?).ok()?;
    match request.verb() {
        verb::POSITION => Some(id),
        verb::VOLTAGE => Some(id + u16::try_from(LAST + 1).ok()?),
        _ => None,
    }
}

fn position(id: i32) -> Quantity {
    Quantity {
        name: format!("position {id}").into(),
        key: format!("position_{id}_steps").into(),
        unit: text(""),
        shown: format!("position {id}: {{}}").into(),
        range: Some((Hundredths(-3_276_700), Hundredths(3_276_700))),
        step: None,
        request: Some(Command::new(verb::POSITION, &[id])),
        measures: Some((verb::SERVO, id)),
    }
}

fn voltage(id: i32) -> Quantity {
    Quantity {
        name: format!("voltage {id}").into(),
        key: format!("voltage_{id}_v").into(),
        unit: text("V"),
        shown: format!("voltage {id}: {{}} V").into(),
        range: Some((Hundredths(0), Hundredths(2_550))),
        step: None,
        request: Some(Command::new(verb::VOLTAGE, &[id])),
        measures: None,
    }
}

/// The rows, in the order of [`verb`].
#[expect(clippy::too_many_lines, reason = "a table")]
fn verbs() -> Vec<Verb> {
    let index = || Axis { takes: ValueForm::Index, ..Axis::row("a servo number", (0, LAST)) };
    let on_or_off = || Axis::words("on or off", &[("on", 1), ("off", 0)]);
    let count = usize::try_from(LAST + 1).unwrap_or_default();
    let resources = |kind: usize| -> Vec<ResourceId> { (kind * count..(kind + 1) * count).collect() };
    let hidden =
        |word: &'static str, meaning: &'static str| Verb { frames: text(word), ..Verb::row(word, word, word, meaning) };
    let read = |word, meaning| Verb { axes: vec![index()], asks: true, ..hidden(word, meaning) };
    let bytes = |word, meaning| Verb {
        axes: vec![Axis { takes: ValueForm::Bytes(MOST_BYTES), ..Axis::row("a byte", (0, 255)) }],
        ..hidden(word, meaning)
    };
    let angle = AngleScale { degrees: ANGLES, values: (0.0, f64::from(LAST_STEP)) };
    let target = Axis {
        unit: Unit { measure: Measure::Number, angle: Some(angle) },
        why: text("a turn has 4096 steps, and 2048 is the center"),
        ..Axis::row("a position", (0, LAST_STEP))
    };
    vec![
        Verb {
            axes: vec![index(), target],
            sets: Sets::Indexed(resources(0)),
            moves: true,
            tolerance: 8,
            forbidden: Some(Forbidden {
                after: verb::TORQUE,
                value: 0,
                message: text("servo {} has no torque"),
                help: text(
                    "write `torque {} on` and `wait 1s` before it; where the servo is then is unknown, so begin with a \
                     start: `servo {} 2048 -> 2100 over 1s`",
                ),
                label: text("switched off here"),
            }),
            ..Verb::row(
                "servo",
                "servo N POSITION",
                "servo 1 2048",
                "a servo to a position, 0 to 4095 steps or an angle",
            )
        },
        Verb {
            axes: vec![index(), on_or_off()],
            sets: Sets::Indexed(resources(0)),
            ..Verb::row(
                "torque",
                "torque N on|off",
                "torque 1 off",
                "a servo holds where it is (on), or goes limp (off)",
            )
        },
        Verb {
            axes: vec![Axis::words("all", &[("all", 0)]), on_or_off()],
            sets: Sets::All(resources(0)),
            forgets: true,
            each: Some(verb::TORQUE),
            ..Verb::row(
                "torque",
                "torque all on|off",
                "torque all off",
                "the same for every servo that the script uses",
            )
        },
        Verb {
            axes: vec![
                index(),
                Axis {
                    why: text("0 would mean the highest speed or a stop, depending on another setting of the servo"),
                    ..Axis::row("a speed", (1, 3_400))
                },
            ],
            sets: Sets::Indexed(resources(1)),
            ..Verb::row(
                "speed",
                "speed N SPEED",
                "speed 1 1000",
                "the speed of a servo on its way, 1 to 3400 steps per second",
            )
        },
        Verb {
            axes: vec![index(), Axis::row("an acceleration", (0, 254))],
            sets: Sets::Indexed(resources(2)),
            ..Verb::row(
                "accel",
                "accel N ACCELERATION",
                "accel 1 50",
                "the acceleration of a servo, in 100 steps per second squared; 0 for the highest",
            )
        },
        read("\"get position\"", "asks for the position of a servo"),
        read("\"get voltage\"", "asks for the voltage of a servo"),
        read("\"get mode\"", "asks for the mode of a servo"),
        read("\"get settings\"", "asks for the speed and the acceleration of a servo"),
        Verb { asks: true, ..bytes("\"ping\"", "asks whether a servo is there") },
        Verb { asks: true, ..bytes("\"read\"", "asks for registers of a servo") },
        bytes("\"write\"", "writes registers of a servo"),
        bytes("\"write later\"", "writes registers of a servo at the next action"),
        bytes("\"action\"", "carries out what was written for later"),
        bytes("\"reset\"", "restores the settings of a new servo"),
        Verb { asks: true, ..bytes("\"sync read\"", "asks several servos for registers") },
        bytes("\"sync write\"", "writes registers of several servos"),
    ]
}
