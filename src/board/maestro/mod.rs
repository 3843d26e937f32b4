//! The Pololu Maestro servo controllers with 6, 12, 18 and 24 channels.
//!
//! Source: Pololu's user's guide and library. Not tried on hardware.

mod codec;
mod packet;
mod reply;

use std::sync::Arc;

use super::family::{Family, FamilyNumber, FamilyOption, OptionValue};
use super::table::{Board, DefaultLimit, Feedback, Limited, Resource, Simulation};
use super::verb::{Axis, ResourceId, Sets, ValueForm, Verb};
use super::{Command, Hundredths, Quantity, Replies, Text};
pub use codec::{Reaction, reaction};

/// The rows of the verbs.
mod verb {
    use crate::board::VerbId;

    pub(super) const SERVO: VerbId = VerbId(0);
    pub(super) const OFF: VerbId = VerbId(1);
    pub(super) const OUTPUT: VerbId = VerbId(2);
    pub(super) const HOME: VerbId = VerbId(3);
    // No script contains the following.
    pub(super) const SPEED: VerbId = VerbId(4);
    pub(super) const ACCELERATION: VerbId = VerbId(5);
    pub(super) const TARGETS: VerbId = VerbId(6);
    pub(super) const POSITION: VerbId = VerbId(7);
    pub(super) const MOVING: VerbId = VerbId(8);
    pub(super) const ERRORS: VerbId = VerbId(9);
    pub(super) const HELLO: VerbId = VerbId(10);
}

/// The row of the quantity `moving`. That of the position of channel 0 follows.
const MOVING_ROW: u16 = 0;
/// The numbers of channels of the four boards.
const CHANNELS: [i32; 4] = [6, 12, 18, 24];
/// Values are in quarters of a microsecond.
const QUARTERS: i32 = 4;
/// The pulse widths that the boards accept, in µs: the one with 6 channels, and the others.
const PULSE_OF_6: (i32, i32) = (64, 3_280);
const PULSE: (i32, i32) = (64, 4_080);
/// What a channel of a new board accepts, in µs.
const USUAL: (i32, i32) = (992, 2_000);
/// The largest value of two bytes of seven bits.
const MOST: i32 = 16_383;
/// The usual 60° in 0.12 s, in µs of pulse width per second.
const SERVO_SPEED: u32 = 5_500;

/// The row of the table of families.
pub(super) const FAMILY: Family = Family {
    word: "maestro",
    usage: "board maestro N [device D] [crc on]",
    example: "board maestro 12",
    meaning: "a Pololu Maestro with N channels (6, 12, 18 or 24), numbered from 0",
    number: Some(FamilyNumber { what: "the number of channels", values: &CHANNELS }),
    options: &[
        FamilyOption { word: "device", value: OptionValue::Number("a device number", (0, 127)) },
        FamilyOption { word: "crc", value: OptionValue::Switch },
    ],
    make,
};

fn make(channels: Option<i32>, options: &[Option<i32>]) -> Arc<Board> {
    let option = |at: usize| options.get(at).copied().flatten();
    let device = option(0).and_then(|device| u8::try_from(device).ok());
    let has_crc = option(1) == Some(1);
    let channels = channels.unwrap_or(24);
    let of_device = device.map(|device| format!(" device {device}")).unwrap_or_default();
    let line = format!("maestro {channels}{of_device}{}", if has_crc { " crc on" } else { "" });
    let last = channels - 1;
    let limited = |at: i32| Limited { verb: verb::SERVO, index: Some(at), axis: None };
    Arc::new(Board {
        name: text("Maestro"),
        line: line.into(),
        baud: 115_200,
        max_baud: 200_000,
        resources: (0..channels).map(channel).collect(),
        verbs: verbs(last),
        limits: (0..channels).map(limited).map(usual).collect(),
        quantities: [moving()].into_iter().chain((0..channels).map(position)).map(Arc::new).collect(),
        changes: Vec::new(),
        reporting: None,
        hello: vec![Command::new(verb::HELLO, &[])],
        goodbye: Vec::new(),
        stop: Vec::new(),
        without_stop: text("servos hold their last position"),
        // Bytes after a truncated packet are an error, which sends every channel home.
        flushes: false,
        ambiguity: None,
        foreign: ["speed", "accel", "acceleration"].map(|word| (text(word), text("servo 0 1900 over 2s"))).into(),
        picture: None,
        simulation: Simulation::Channels,
        codec: Arc::new(codec::Packets { device, has_crc }),
        replies: Replies::Answers(reply::ANSWERS),
        feedback: Some(Feedback {
            verb: verb::SERVO,
            position: verb::POSITION,
            value: quarters,
            preparation: None,
            holds: None,
        }),
    })
}

fn text(text: &'static str) -> Text {
    Text::Borrowed(text)
}

/// A reported position as a target; a channel without pulses has no position.
fn quarters(position: Hundredths) -> Option<i32> {
    Some(position.0 / 25).filter(|quarters| *quarters != 0)
}

fn channel(number: i32) -> Resource {
    let speed = Some(SERVO_SPEED);
    Resource { speed, ..Resource::row(format!("channel {number}"), format!("channel_{number}")) }
}

fn usual(limited: Limited) -> DefaultLimit {
    let (least, most) = USUAL;
    DefaultLimit {
        limited,
        range: (least * QUARTERS, most * QUARTERS),
        why: text("a channel of a new Maestro goes no further"),
        unless: text("if the servo and the settings of the channel allow it"),
    }
}

fn moving() -> Quantity {
    Quantity {
        name: text("moving"),
        key: text("moving"),
        unit: text(""),
        shown: text("moving {}"),
        range: Some((Hundredths(0), Hundredths(100))),
        step: None,
        request: Some(Command::new(verb::MOVING, &[])),
        measures: None,
    }
}

fn position(channel: i32) -> Quantity {
    Quantity {
        name: format!("position {channel}").into(),
        key: format!("position_{channel}_us").into(),
        unit: text("us"),
        shown: format!("position {channel}: {{}} µs").into(),
        range: Some((Hundredths(0), Hundredths(409_575))),
        step: None,
        request: Some(Command::new(verb::POSITION, &[channel])),
        measures: Some((verb::SERVO, channel)),
    }
}

/// The rows, in the order of [`verb`].
#[expect(clippy::too_many_lines, reason = "a table")]
fn verbs(last: i32) -> Vec<Verb> {
    let all: Vec<ResourceId> = (0..).take(usize::try_from(last + 1).unwrap_or_default()).collect();
    let pulse = if last < 6 { PULSE_OF_6 } else { PULSE };
    let index = || Axis {
        takes: ValueForm::Index,
        why: text("channels are numbered from 0, as on the board"),
        ..Axis::row("a channel", (0, last))
    };
    let of_channel = || Sets::Indexed(all.clone());
    let number = |what: &'static str| Axis::row(what, (0, MOST));
    let hidden =
        |word: &'static str, meaning: &'static str| Verb { frames: text(word), ..Verb::row(word, word, word, meaning) };
    vec![
        Verb {
            axes: vec![
                index(),
                Axis { scale: QUARTERS, ..Axis::pulse("a pulse width", (pulse.0 * QUARTERS, pulse.1 * QUARTERS)) },
            ],
            sets: of_channel(),
            moves: true,
            uses_as: text("a servo"),
            tolerance: 5 * QUARTERS,
            ..Verb::row(
                "servo",
                "servo N PULSE",
                "servo 0 1500",
                "the servo on channel N to a pulse width, in quarters of a µs",
            )
        },
        Verb {
            axes: vec![index(), Axis::words("off", &[("off", 0)])],
            sets: of_channel(),
            forgets: true,
            uses_as: text("a servo"),
            ..Verb::row("servo", "servo N off", "servo 0 off", "no more pulses: most servos go limp")
        },
        Verb {
            axes: vec![index(), Axis::words("on or off", &[("on", 1), ("off", 0)])],
            sets: of_channel(),
            uses_as: text("an output"),
            ..Verb::row("output", "output N on|off", "output 3 on", "a channel that is set up as a digital output")
        },
        Verb {
            sets: Sets::All(all.clone()),
            forgets: true,
            frames: text("home"),
            ..Verb::row("home", "home", "home", "every channel does what its setting says; a new board ends the pulses")
        },
        Verb { axes: vec![index(), number("a speed")], ..hidden("\"set speed\"", "limits the speed of a channel") },
        Verb {
            axes: vec![index(), number("an acceleration")],
            ..hidden("\"set acceleration\"", "limits the acceleration of a channel")
        },
        Verb {
            axes: vec![Axis { takes: ValueForm::Bytes(2 + 2 * packet::MAX_TARGETS), ..Axis::row("a byte", (0, 127)) }],
            sets: Sets::All(all),
            forgets: true,
            ..hidden("\"set targets\"", "sets several channels at once")
        },
        Verb { axes: vec![index()], ..hidden("\"get position\"", "asks for the position of a channel") },
        hidden("\"get moving state\"", "asks whether a servo moves"),
        hidden("\"get errors\"", "asks for the errors, and clears them"),
        hidden("\"hello\"", "asks for the errors; its first byte sets the speed of the line"),
    ]
}
