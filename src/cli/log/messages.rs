//! The messages of a log: topics, their schemas and their fields.

use std::collections::BTreeMap;

use motionseq::board::{Board, Command, Report, Sets, State, Text, ValueForm, Verb};
use motionseq::sim::Pose;
use motionseq::units::{Micros, Nanos};
use serde::Serialize;

/// A topic and its messages.
pub(super) struct Topic {
    pub(super) name: &'static str,
    pub(super) schema: &'static str,
    /// A JSON schema.
    pub(super) shape: &'static str,
}

impl Topic {
    /// Whether its messages are about all robots, or say which one they are about.
    pub(super) fn is_shared(&self) -> bool {
        [MARKS.name, GATES.name, LOG.name, TRANSFORM.name].contains(&self.name)
    }
}

macro_rules! topic {
    ($name:literal, $schema:literal, $file:literal) => {
        Topic { name: $name, schema: $schema, shape: include_str!(concat!("../../../docs/schemas/log/", $file)) }
    };
}

pub(super) const FRAMES: Topic = topic!("/frames", "motionseq.Frame", "frame.json");
pub(super) const BOARD: Topic = topic!("/board", "motionseq.Board", "board.json");
pub(super) const POSITION: Topic = topic!("/position", "motionseq.Position", "position.json");
pub(super) const TELEMETRY: Topic = topic!("/telemetry", "motionseq.Telemetry", "telemetry.json");
pub(super) const LATENESS: Topic = topic!("/lateness", "motionseq.Lateness", "lateness.json");
pub(super) const MARKS: Topic = topic!("/marks", "motionseq.Mark", "mark.json");
pub(super) const GATES: Topic = topic!("/gates", "motionseq.Gate", "gate.json");
// These schemas are Foxglove's, for its panels.
pub(super) const LOG: Topic = topic!("/log", "foxglove.Log", "log.json");
pub(super) const POSE: Topic = topic!("/pose", "foxglove.PoseInFrame", "pose.json");
pub(super) const TRANSFORM: Topic = topic!("/tf", "foxglove.FrameTransform", "transform.json");

#[derive(Serialize)]
pub(super) struct FrameMessage<'a> {
    #[serde(rename = "t_us")]
    pub(super) at: Micros,
    pub(super) hex: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) command: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) wrong: Option<&'a str>,
}

/// The last commands of a board by name, without the time: for each exclusive resource its value, whether it is on, or its command
/// and the values of that command. Every key is always there, because tools that show tables and plots expect that: 0, an empty
/// text or `false` where no command applies.
#[derive(Clone, PartialEq, Serialize)]
pub(super) struct LastCommands(BTreeMap<Text, Value>);

#[derive(Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum Value {
    Number(i64),
    Text(String),
    Switch(bool),
}

impl LastCommands {
    pub(super) fn of(board: &Board, state: &State) -> Self {
        let mut told = BTreeMap::new();
        for (id, resource) in board.resources.iter().enumerate().filter(|(_, resource)| resource.is_exclusive) {
            let setters = || board.verbs.iter().filter(move |verb| sets(verb, id));
            for axis in setters().filter(|verb| verb.moves && !verb.is_indexed()).flat_map(|verb| &verb.axes) {
                told.insert(axis.key.clone(), Value::Number(0));
            }
            let command = state.last(id);
            let verb = command.and_then(|command| board.verb(command.verb())).or_else(|| setters().next());
            let Some(verb) = verb else { continue };
            let values = command.map(Command::values);
            let values = values.as_deref().unwrap_or_default();
            let value = match verb.axes.as_slice() {
                _ if verb.is_indexed() => Value::Number(values.last().copied().unwrap_or(0).into()),
                [axis] if matches!(axis.takes, ValueForm::Word(_)) => {
                    Value::Switch(values.last().is_some_and(|value| *value != 0))
                }
                axes => {
                    if verb.moves {
                        let moved = axes.iter().zip(values);
                        told.extend(moved.map(|(axis, value)| (axis.key.clone(), Value::Number((*value).into()))));
                    }
                    Value::Text(command.map(|command| board.show(command).to_string()).unwrap_or_default())
                }
            };
            told.insert(resource.key.clone(), value);
        }
        LastCommands(told)
    }
}

/// Whether a verb sets a resource by itself.
fn sets(verb: &Verb, id: usize) -> bool {
    match &verb.sets {
        Sets::One(one) => *one == id,
        Sets::Indexed(all) => all.contains(&id),
        _ => false,
    }
}

#[derive(Serialize)]
pub(super) struct BoardMessage<'a> {
    #[serde(rename = "t_us")]
    pub(super) at: Micros,
    #[serde(flatten)]
    pub(super) told: &'a LastCommands,
}

#[derive(Serialize)]
pub(super) struct PositionMessage {
    #[serde(rename = "t_us")]
    at: Micros,
    x_cm: f64,
    y_cm: f64,
    yaw_deg: f64,
}

#[derive(Serialize)]
pub(super) struct PoseMessage {
    timestamp: Timestamp,
    frame_id: &'static str,
    pose: Placed,
}

#[derive(Serialize)]
pub(super) struct TransformMessage {
    timestamp: Timestamp,
    parent_frame_id: &'static str,
    child_frame_id: String,
    translation: Vector,
    rotation: Quaternion,
}

#[derive(Serialize)]
struct Placed {
    position: Vector,
    orientation: Quaternion,
}

#[derive(Serialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Serialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// The frame of the floor, whose origin is where the robot started, and that of the robot. Other tools expect these names.
const FLOOR: &str = "odom";
const ROBOT: &str = "base_link";

/// A pose in metres, with x forward, y to the left and z up, as Foxglove and ROS have it (REP 103, REP 105). The virtual board has
/// centimetres, x to the right, y forward, and turns clockwise.
fn placed(Pose { x_cm, y_cm, yaw_deg }: Pose) -> Placed {
    let half = -yaw_deg.to_radians() / 2.0;
    // `0.0 -` gives 0 for 0, not -0.
    let position = Vector { x: y_cm / 100.0, y: 0.0 - x_cm / 100.0, z: 0.0 };
    Placed { position, orientation: Quaternion { x: 0.0, y: 0.0, z: 0.0 + half.sin(), w: half.cos() } }
}

impl PositionMessage {
    pub(super) fn new(at: Micros, Pose { x_cm, y_cm, yaw_deg }: Pose) -> Self {
        PositionMessage { at, x_cm, y_cm, yaw_deg }
    }
}

impl PoseMessage {
    pub(super) fn new(timestamp: Timestamp, pose: Pose) -> Self {
        PoseMessage { timestamp, frame_id: FLOOR, pose: placed(pose) }
    }
}

impl TransformMessage {
    /// With the name of the robot, if the script names its robots.
    pub(super) fn new(timestamp: Timestamp, robot: Option<&str>, pose: Pose) -> Self {
        let Placed { position, orientation } = placed(pose);
        TransformMessage {
            timestamp,
            parent_frame_id: FLOOR,
            child_frame_id: robot.map_or_else(|| ROBOT.to_owned(), |robot| format!("{robot}/{ROBOT}")),
            translation: position,
            rotation: orientation,
        }
    }
}

#[derive(Serialize)]
pub(super) struct TelemetryMessage<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    #[serde(flatten)]
    values: BTreeMap<&'a str, f64>,
}

impl<'b> TelemetryMessage<'b> {
    /// The values of a report, by name.
    pub(super) fn new(at: Micros, board: &'b Board, report: &Report) -> Self {
        let quantity = |row: usize| board.quantities.get(row).map(|quantity| &*quantity.key);
        let values = report.values().filter_map(|(row, value)| Some((quantity(row)?, value.number()))).collect();
        TelemetryMessage { at, values }
    }
}

#[derive(Serialize)]
pub(super) struct LatenessMessage<'a> {
    #[serde(rename = "t_us")]
    pub(super) at: Micros,
    #[serde(rename = "script_us")]
    pub(super) script: Micros,
    pub(super) late_us: f64,
    pub(super) command: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) file: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) line: Option<usize>,
}

#[derive(Serialize)]
pub(super) struct MarkMessage<'a> {
    #[serde(rename = "t_us")]
    pub(super) at: Micros,
    #[serde(rename = "script_us")]
    pub(super) script: Micros,
    pub(super) name: &'a str,
}

#[derive(Serialize)]
pub(super) struct GateMessage<'a> {
    #[serde(rename = "t_us")]
    pub(super) at: Micros,
    #[serde(rename = "script_us")]
    pub(super) script: Micros,
    pub(super) gate: &'a str,
    #[serde(rename = "took_us")]
    pub(super) took: Micros,
    pub(super) end: &'static str,
    pub(super) opened: bool,
}

#[derive(Serialize)]
pub(super) struct LogMessage<'a> {
    pub(super) timestamp: Timestamp,
    pub(super) level: u8,
    pub(super) message: &'a str,
    pub(super) name: &'a str,
    pub(super) file: &'a str,
    pub(super) line: usize,
}

/// A time since 1970.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Timestamp {
    sec: u64,
    nsec: u64,
}

impl From<Nanos> for Timestamp {
    fn from(Nanos(since_1970): Nanos) -> Self {
        Timestamp { sec: since_1970 / 1_000_000_000, nsec: since_1970 % 1_000_000_000 }
    }
}

/// In microseconds.
pub(super) fn micros(Nanos(nanos): Nanos) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a day of nanoseconds fits")]
    let nanos = nanos as f64;
    nanos / 1_000.0
}
