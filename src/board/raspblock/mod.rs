//! The Yahboom Raspblock driver board: mecanum wheels, four servos, a buzzer.
//!
//! Source: the vendor's driver and programs of users; docs/protocol.md has the complete table.

mod codec;
mod frame;
mod geometry;
mod picture;
mod report;

use std::sync::{Arc, LazyLock};

use super::Text;
use super::family::Family;
use super::table::MAX_BAUD;
use super::table::{Ambiguity, Board, DefaultLimit, Limited, Resource, Simulation};
use super::verb::{Activity, Axis, Needs, Part, ResourceId, Sets, ValueForm, Verb};
use super::{Change, Command, Hundredths, Quantity, Replies, Report, VerbId};
use crate::units::Micros;
pub use geometry::{Geometry, Twist};

/// The rows of the verbs.
pub mod verb {
    use super::VerbId;

    /// One servo.
    pub(crate) const SERVO: VerbId = VerbId(0);
    /// Servos 1 and 2 in one frame.
    pub(crate) const SERVOS: VerbId = VerbId(1);
    /// The velocity of the robot. All zero is the stop.
    pub const ROCKER: VerbId = VerbId(2);
    /// The same, while the board keeps the heading.
    pub(crate) const YAW_HOLD: VerbId = VerbId(3);
    /// The speed of each wheel.
    pub(crate) const WHEELS: VerbId = VerbId(4);
    /// A displacement.
    pub(crate) const MOVE: VerbId = VerbId(5);
    /// A synonym of a rocker with all values zero.
    pub const STOP: VerbId = VerbId(6);
    /// The buzzer, on or off.
    pub(crate) const BUZZER: VerbId = VerbId(7);
    /// Mode and controller gains.
    pub(crate) const PID: VerbId = VerbId(8);
    /// A request for board data.
    pub(crate) const REQUEST: VerbId = VerbId(9);
    /// A frame with any function and any payload.
    pub(crate) const RAW: VerbId = VerbId(10);
}

/// The rows of the resources, in the order in which a state is restored.
mod resource {
    use super::ResourceId;

    pub(super) const GAINS: ResourceId = 0;
    pub(super) const SERVOS: [ResourceId; 4] = [1, 2, 3, 4];
    pub(super) const BUZZER: ResourceId = 5;
    pub(super) const DRIVE: ResourceId = 6;
}

/// What can be requested from the board (protocol row 0x05); the position is the byte on the wire.
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
const REPORT_START: i32 = 0;
const REPORT_STOP: i32 = 9;

/// The value of the mode in `pid position`.
const POSITION: i32 = 1;
/// The range of a tilt servo. Beyond it, the servo is damaged.
const TILT: (i32, i32) = (500, 1950);
const PULSE: (i32, i32) = (500, 2500);
const SPEED: (i32, i32) = (-25, 25);
const TURN: (i32, i32) = (-200, 200);
const DISPLACEMENT: (i32, i32) = (-65_535, 65_535);
const BYTE: (i32, i32) = (0, 255);
/// The usual 60° in 0.12 s, in µs of pulse width per second.
const SERVO_SPEED: u32 = 5_500;

/// The table of the board.
pub fn board() -> Arc<Board> {
    static BOARD: LazyLock<Arc<Board>> = LazyLock::new(|| Arc::new(table(false)));
    Arc::clone(&BOARD)
}

/// The same, but a `move` is read with the direction bits of older driver versions. Which version
/// the firmware of a board expects is unknown; we send the newest.
pub fn with_older_move() -> Arc<Board> {
    static BOARD: LazyLock<Arc<Board>> = LazyLock::new(|| Arc::new(table(true)));
    Arc::clone(&BOARD)
}

/// The row of the table of families.
pub(super) const FAMILY: Family = Family {
    word: "raspblock",
    usage: "board raspblock",
    example: "board raspblock",
    meaning: "the Yahboom Raspblock: mecanum wheels, four servos, a buzzer; the default",
    number: None,
    options: &[],
    make: |_, _| board(),
};

/// What a request asks the virtual board for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Asked {
    /// Reports ten times per second from now on.
    Start,
    /// No more reports.
    Stop,
    /// One report.
    Once,
}

/// What a command requests, if it is a request.
pub fn asked(command: &Command) -> Option<Asked> {
    (command.verb() == verb::REQUEST).then(|| match command.value(0) {
        Some(REPORT_START) => Asked::Start,
        Some(REPORT_STOP) => Asked::Stop,
        _ => Asked::Once,
    })
}

/// The report of a board on a flat floor.
pub fn report(voltage: Hundredths, yaw: Hundredths) -> Report {
    Report::new(&[voltage, Hundredths(0), Hundredths(0), yaw])
}

/// Whether a board in this state accepts displacements.
pub(crate) fn is_in_position_mode(state: &super::State) -> bool {
    state.last(resource::GAINS).and_then(|gains| gains.value(0)) == Some(POSITION)
}

fn text(text: &'static str) -> Text {
    Text::Borrowed(text)
}

fn stop() -> Command {
    Command::new(verb::ROCKER, &[0, 0, 0])
}

fn buzzer(on: i32) -> Command {
    Command::new(verb::BUZZER, &[on])
}

fn request(query: i32) -> Command {
    Command::new(verb::REQUEST, &[query])
}

/// The table; `older`: with the direction bits of older driver versions.
fn table(older: bool) -> Board {
    let note = if older {
        "it is read with the direction bits of older driver versions"
    } else {
        "older driver versions set other direction bits: --older-move reads those"
    };
    Board {
        name: text("Raspblock"),
        line: text("raspblock"),
        baud: 115_200,
        max_baud: MAX_BAUD,
        resources: resources(),
        verbs: verbs(),
        limits: vec![DefaultLimit {
            limited: Limited { verb: verb::SERVO, index: Some(2), axis: None },
            range: TILT,
            why: text("a tilt servo is damaged there"),
            unless: text("if it is not a tilt servo"),
        }],
        quantities: vec![
            quantity("voltage", "voltage_v", "V", "{} V"),
            angle("pitch", "pitch_deg", "pitch {}°"),
            angle("roll", "roll_deg", "roll {}°"),
            turning(angle("yaw", "yaw_deg", "yaw {}°")),
        ]
        .into_iter()
        .map(Arc::new)
        .collect(),
        changes: vec![Change { quantity: turned(), of: YAW, circle: Hundredths(36_000) }],
        reporting: Some([request(REPORT_START), request(REPORT_STOP)]),
        hello: Vec::new(),
        goodbye: Vec::new(),
        stop: vec![stop(), stop(), stop(), buzzer(0)],
        without_stop: text(""),
        flushes: true,
        ambiguity: Some(Ambiguity { verb: verb::MOVE, note: text(note) }),
        foreign: [
            (&["forward", "drive", "go"][..], "rocker y=10 for 1s"),
            (&["beep"], "buzzer on for 200ms"),
            (&["turn", "spin", "rotate"], "rocker z=50 for 1s"),
        ]
        .into_iter()
        .flat_map(|(words, line)| words.iter().map(move |word| (text(word), text(line))))
        .collect(),
        picture: Some(picture::picture()),
        simulation: Simulation::Mecanum,
        codec: Arc::new(codec::Frames { older }),
        replies: Replies::Lines(report::LINE),
        feedback: None,
    }
}

/// The row of the heading in the table of quantities.
const YAW: usize = 3;

fn quantity(name: &'static str, key: &'static str, unit: &'static str, shown: &'static str) -> Quantity {
    let [name, key, unit, shown] = [name, key, unit, shown].map(text);
    Quantity { name, key, unit, shown, range: None, step: None, request: None, measures: None }
}

fn angle(name: &'static str, key: &'static str, shown: &'static str) -> Quantity {
    let range = Some((Hundredths(-18_000), Hundredths(18_000)));
    Quantity { range, ..quantity(name, key, "deg", shown) }
}

/// An angle that changes when the robot turns: at the nominal speed at most 200 degrees per second, with ten reports.
fn turning(angle: Quantity) -> Quantity {
    Quantity { step: Some(Hundredths(2_000)), ..angle }
}

/// The change of the heading, clockwise positive.
fn turned() -> Arc<Quantity> {
    Arc::new(turning(quantity("turned", "turned_deg", "deg", "turned {}°")))
}

fn resources() -> Vec<Resource> {
    let resource =
        |name: &'static str, key: &'static str, about| Resource { about: text(about), ..Resource::row(name, key) };
    let servo = |name, key, about| Resource { speed: Some(SERVO_SPEED), ..resource(name, key, about) };
    vec![
        Resource { is_exclusive: false, ..resource("the gains", "gains", "") },
        servo("servo 1", "servo_1", "pan"),
        servo("servo 2", "servo_2", "tilt"),
        servo("servo 3", "servo_3", ""),
        servo("servo 4", "servo_4", ""),
        Resource {
            rest: Some(buzzer(0)),
            activity: text("on"),
            idle: text("is off"),
            ..resource("the buzzer", "buzzer", "")
        },
        Resource {
            rest: Some(stop()),
            activity: text("running"),
            idle: text("is stopped"),
            drives: true,
            refresh: Some(Micros::from_millis(50)),
            ..resource("the drive", "drive", "")
        },
    ]
}

fn named(name: &'static str, what: &'static str, range: (i32, i32)) -> Axis {
    Axis { name: text(name), key: text(name), ..Axis::row(what, range) }
}

fn gains(name: &'static str, letters: &'static str) -> Axis {
    Axis { takes: ValueForm::List(text("a gain"), text(letters)), ..named(name, "gains", BYTE) }
}

/// A drive verb that can hold and move.
fn driving(verb: Verb) -> Verb {
    Verb { sets: Sets::One(resource::DRIVE), activity: Activity::Unless0, holds: true, moves: true, ..verb }
}

/// The rows, in the order of [`verb`].
#[expect(clippy::too_many_lines, reason = "a table")]
fn verbs() -> Vec<Verb> {
    let speed = |name, what| named(name, what, SPEED);
    vec![
        Verb {
            axes: vec![
                Axis {
                    takes: ValueForm::Index,
                    why: text("it comes first, then the pulse width: `servo 1 1500`"),
                    ..Axis::row("a servo number", (1, 4))
                },
                Axis::pulse("a pulse width", PULSE),
            ],
            sets: Sets::Indexed(resource::SERVOS.to_vec()),
            moves: true,
            tolerance: 5,
            ..Verb::row("servo", "servo N PULSE", "servo 1 1500", "one servo, N 1-4, to a pulse width of 500-2500 µs")
        },
        Verb {
            axes: vec![
                Axis::pulse("the pan pulse width", PULSE),
                Axis {
                    why: text("a tilt servo driven further is damaged"),
                    ..Axis::pulse("the tilt pulse width", TILT)
                },
            ],
            frames: text("the servos together"),
            sets: Sets::Parts(
                [1, 2].map(|index| Part { verb: verb::SERVO, index }).into(),
                resource::SERVOS.iter().copied().take(2).collect(),
            ),
            moves: true,
            tolerance: 5,
            ..Verb::row(
                "servos",
                "servos PAN TILT",
                "servos 1500 1500",
                "servo 1 and 2 in one frame, 500-2500 and 500-1950 µs",
            )
        },
        Verb {
            axes: vec![speed("x", "the speed x"), speed("y", "the speed y"), named("z", "the turning speed z", TURN)],
            alias: Some(verb::STOP),
            ..driving(Verb::row(
                "rocker",
                "rocker x=RIGHT y=FORWARD z=CLOCKWISE",
                "rocker x=10 z=50",
                "the whole robot's speed: x to the right and y forward -25..25, z clockwise -200..200; an axis left out is 0",
            ))
        },
        Verb {
            axes: vec![speed("x", "the speed x"), speed("y", "the speed y")],
            activity: Activity::Always,
            ..driving(Verb::row(
                "yawhold",
                "yawhold x=RIGHT y=FORWARD",
                "yawhold y=10",
                "the same, while the board keeps the heading; it stays active at zero",
            ))
        },
        Verb {
            axes: [
                ("wheel_a", "the speed of wheel A"),
                ("wheel_b", "the speed of wheel B"),
                ("wheel_c", "the speed of wheel C"),
                ("wheel_d", "the speed of wheel D"),
            ]
            .map(|(key, what)| Axis { key: text(key), ..Axis::row(what, SPEED) })
            .into(),
            ..driving(Verb::row(
                "wheels",
                "wheels A B C D",
                "wheels 8 -8 -8 8",
                "each wheel -25..25: A front right, B rear right, C rear left, D front left",
            ))
        },
        Verb {
            axes: vec![
                named("x", "the displacement x", DISPLACEMENT),
                named("y", "the displacement y", DISPLACEMENT),
                named("z", "the displacement z", DISPLACEMENT),
            ],
            sets: Sets::One(resource::DRIVE),
            activity: Activity::Passing,
            needs: Some(Needs {
                resource: resource::GAINS,
                value: POSITION,
                message: text("`move` needs the board in position mode"),
                what: text("pid position"),
                line: text("pid position speed=200,150 position=20,0,20 yaw=12,2,5"),
            }),
            ..Verb::row(
                "move",
                "move x=RIGHT y=FORWARD z=CLOCKWISE",
                "move y=100",
                "a displacement, each -65535..65535; needs `pid position` before it",
            )
        },
        Verb {
            sets: Sets::One(resource::DRIVE),
            is: Some(stop()),
            ..Verb::row("stop", "stop", "stop", "the drive stops")
        },
        Verb {
            axes: vec![Axis::words("on or off", &[("on", 1), ("off", 0)])],
            sets: Sets::One(resource::BUZZER),
            activity: Activity::Unless0,
            holds: true,
            ..Verb::row("buzzer", "buzzer on|off", "buzzer on for 200ms", "the buzzer")
        },
        Verb {
            axes: vec![
                Axis::words("the mode", &[("speed", 0), ("position", POSITION)]),
                gains("speed", "P,I"),
                gains("position", "P,I,D"),
                gains("yaw", "P,I,D"),
            ],
            sets: Sets::One(resource::GAINS),
            ..Verb::row(
                "pid",
                "pid speed|position speed=P,I position=P,I,D yaw=P,I,D",
                "pid speed speed=200,150 position=20,0,20 yaw=12,2,5",
                "mode and controller gains, each 0-255",
            )
        },
        Verb {
            frames: text("the requests"),
            axes: vec![Axis::words(
                "what is asked for",
                &std::array::from_fn::<_, 10, _>(|at| {
                    (QUERIES.get(at).copied().unwrap_or_default(), i32::try_from(at).unwrap_or_default())
                }),
            )],
            ..Verb::row(
                "request",
                "request WHAT",
                "request voltage",
                "asks the board for data: report-start, report-stop, encoder-1 to encoder-4, voltage, pitch, roll, yaw",
            )
        },
        Verb {
            axes: vec![
                Axis { takes: ValueForm::Byte, ..Axis::row("the function byte", BYTE) },
                Axis { takes: ValueForm::Bytes(frame::MAX_PAYLOAD), ..Axis::row("a payload byte", BYTE) },
            ],
            frames: text("the raw frames"),
            sets: Sets::Opaque(vec![
                (codec::DRIVE_FUNCTION, resource::DRIVE),
                (codec::BUZZER_FUNCTION, resource::BUZZER),
            ]),
            ..Verb::row(
                "raw",
                "raw FUNCTION BYTE BYTE …",
                "raw 0x04 0x01",
                "a frame of any function and payload, bytes 0-255; header, length and checksum are added",
            )
        },
    ]
}
