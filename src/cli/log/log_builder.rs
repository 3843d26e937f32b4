//! The content of a log: topics with their schemas, as an MCAP file for Foxglove and other tools.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::rc::Rc;
use std::sync::Arc;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};
use motionseq::board::{Board, Hex, Item, OwnedItem, Report, Sets, State, Text, ValueForm};
use motionseq::capture::TimedDecoder;
use motionseq::sim::Pose;
use motionseq::units::{Micros, Nanos};
use serde::Serialize;

use super::{Entry, Level};

/// A log. It is built in memory, piece by piece, and its owner writes the pieces to a file.
pub(super) struct LogBuilder {
    /// The family; it decides how a `move` is decoded.
    board: Arc<Board>,
    writer: Writer<NoSeek<Pieces>>,
    pieces: Pieces,
    /// The channel of each topic that has messages, and the number of its messages.
    channels: BTreeMap<&'static str, (u16, u32)>,
    /// Time 0, since 1970.
    begin: Nanos,
    /// For bytes with the time at which a port took them.
    decoder: TimedDecoder,
    state: State,
    shown: Option<LastCommands>,
}

/// What is written and not yet taken.
#[derive(Clone, Default)]
struct Pieces(Rc<RefCell<Vec<u8>>>);

impl Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A topic and its messages.
struct Topic {
    name: &'static str,
    schema: &'static str,
    /// A JSON schema.
    shape: &'static str,
}

const FRAMES: Topic =
    Topic { name: "/frames", schema: "motionseq.Frame", shape: include_str!("../../../docs/schemas/log/frame.json") };
const BOARD: Topic =
    Topic { name: "/board", schema: "motionseq.Board", shape: include_str!("../../../docs/schemas/log/board.json") };
const POSE: Topic =
    Topic { name: "/pose", schema: "motionseq.Pose", shape: include_str!("../../../docs/schemas/log/pose.json") };
const TELEMETRY: Topic = Topic {
    name: "/telemetry",
    schema: "motionseq.Telemetry",
    shape: include_str!("../../../docs/schemas/log/telemetry.json"),
};
const LATENESS: Topic = Topic {
    name: "/lateness",
    schema: "motionseq.Lateness",
    shape: include_str!("../../../docs/schemas/log/lateness.json"),
};
const MARKS: Topic =
    Topic { name: "/marks", schema: "motionseq.Mark", shape: include_str!("../../../docs/schemas/log/mark.json") };
/// This schema is Foxglove's, for its log panel.
const LOG: Topic =
    Topic { name: "/log", schema: "foxglove.Log", shape: include_str!("../../../docs/schemas/log/log.json") };

#[derive(Serialize)]
struct FrameMessage<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    hex: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    command: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wrong: Option<&'a str>,
}

/// The last commands of a board, without the time.
#[derive(Clone, PartialEq, Serialize)]
struct LastCommands(BTreeMap<Text, Value>);

#[derive(Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum Value {
    Number(i64),
    Text(String),
    Switch(bool),
}

#[derive(Serialize)]
struct BoardMessage<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    #[serde(flatten)]
    told: &'a LastCommands,
}

#[derive(Serialize)]
struct PoseMessage {
    #[serde(rename = "t_us")]
    at: Micros,
    x_cm: f64,
    y_cm: f64,
    yaw_deg: f64,
}

#[derive(Serialize)]
struct TelemetryMessage<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    #[serde(flatten)]
    values: BTreeMap<&'a str, f64>,
}

#[derive(Serialize)]
struct LatenessMessage<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    #[serde(rename = "script_us")]
    script: Micros,
    late_us: f64,
    command: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<usize>,
}

#[derive(Serialize)]
struct MarkMessage<'a> {
    #[serde(rename = "t_us")]
    at: Micros,
    #[serde(rename = "script_us")]
    script: Micros,
    name: &'a str,
}

#[derive(Serialize)]
struct LogMessage<'a> {
    timestamp: Timestamp,
    level: u8,
    message: &'a str,
    name: &'static str,
    file: &'a str,
    line: usize,
}

#[derive(Serialize)]
struct Timestamp {
    sec: u64,
    nsec: u64,
}

impl LogBuilder {
    pub(super) fn new(board: Arc<Board>) -> io::Result<Self> {
        let pieces = Pieces::default();
        let options = WriteOptions::new()
            .library(concat!("motionseq ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            // The owner decides when a piece ends.
            .chunk_size(None)
            .disable_seeking(true);
        let writer = options.create(NoSeek::new(pieces.clone())).map_err(io::Error::other)?;
        Ok(LogBuilder {
            writer,
            pieces,
            channels: BTreeMap::new(),
            begin: Nanos::ZERO,
            decoder: TimedDecoder::of_times(&board),
            board,
            state: State::default(),
            shown: None,
        })
    }

    /// Adds what happened at a time since time 0.
    pub(super) fn take(&mut self, time: Nanos, entry: Entry) -> io::Result<()> {
        let at = time.micros();
        match entry {
            Entry::Begin { since_1970 } => {
                self.begin = since_1970;
                Ok(())
            }
            Entry::Bytes(bytes) => {
                let mut items = Vec::new();
                self.decoder.feed(time, &bytes, |at, item| items.push((at, OwnedItem::from(item))));
                self.items(&items)
            }
            Entry::Items(items) => self.items(&items),
            Entry::Late { script, late, command, place } => {
                let (file, line) = place.map_or((None, None), |(file, line)| (Some(file), Some(line)));
                let (late_us, file, command) = (micros(late), file.as_deref(), self.board.show(&command).to_string());
                self.write(&LATENESS, time, &LatenessMessage { at, script, late_us, command, file, line })
            }
            Entry::Report(report) => {
                let board = Arc::clone(&self.board);
                self.write(&TELEMETRY, time, &TelemetryMessage { at, values: values(&board, &report) })
            }
            Entry::Pose(Pose { x_cm, y_cm, yaw_deg }) => {
                self.write(&POSE, time, &PoseMessage { at, x_cm, y_cm, yaw_deg })
            }
            Entry::Mark { name, script } => self.write(&MARKS, time, &MarkMessage { at, script, name: &name }),
            Entry::Line { level, text, place } => {
                let Nanos(since_1970) = self.begin + time;
                let timestamp = Timestamp { sec: since_1970 / 1_000_000_000, nsec: since_1970 % 1_000_000_000 };
                let level = match level {
                    Level::Info => 2,
                    Level::Warning => 3,
                    Level::Error => 4,
                };
                let (file, line) = place.unwrap_or_default();
                let message = LogMessage { timestamp, level, message: &text, name: "motionseq", file: &file, line };
                self.write(&LOG, time, &message)
            }
        }
    }

    fn items(&mut self, items: &[(Micros, OwnedItem)]) -> io::Result<()> {
        items.iter().try_for_each(|(at, item)| self.item(*at, item.item()))
    }

    /// Adds a frame on the line to the board, or bytes that are not a frame, and the state of the board after it.
    fn item(&mut self, at: Micros, item: Item<'_>) -> io::Result<()> {
        let (time, board) = (at.nanos(), Arc::clone(&self.board));
        let (hex, command, wrong) = match item {
            Item::Frame(frame) => {
                let wrong = board.decode(frame.bytes()).err().map(|why| why.to_string());
                (frame.to_string(), board.decode_or_raw(frame.bytes()), wrong)
            }
            Item::Skipped { bytes, why, .. } => (Hex(bytes).to_string(), None, why.is_wrong().then(|| why.to_string())),
            _ => return Ok(()),
        };
        let says = command.as_ref().map(|command| board.show(command).to_string());
        let text = wrong.as_ref().map(|why| format!("{hex}: {why}"));
        self.write(&FRAMES, time, &FrameMessage { at, hex, command: says, wrong: wrong.as_deref() })?;
        if let Some(text) = text {
            self.take(time, Entry::Line { level: Level::Warning, text, place: None })?;
        }
        let Some(command) = command.filter(|_| wrong.is_none()) else { return Ok(()) };
        self.state.apply(&board, &command);
        let told = told(&board, &self.state);
        if self.shown.as_ref() != Some(&told) {
            self.write(&BOARD, time, &BoardMessage { at, told: &told })?;
            self.shown = Some(told);
        }
        Ok(())
    }

    fn write(&mut self, topic: &Topic, time: Nanos, message: &impl Serialize) -> io::Result<()> {
        let LogBuilder { writer, channels, begin, .. } = self;
        let (channel_id, sequence) = match channels.get_mut(topic.name) {
            Some((channel, count)) => {
                *count = count.saturating_add(1);
                (*channel, *count)
            }
            None => {
                let schema = writer.add_schema(topic.schema, "jsonschema", topic.shape.as_bytes());
                let channel =
                    schema.and_then(|schema| writer.add_channel(schema, topic.name, "json", &BTreeMap::new()));
                let channel = channel.map_err(io::Error::other)?;
                channels.insert(topic.name, (channel, 0));
                (channel, 0)
            }
        };
        let Nanos(log_time) = *begin + time;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &serde_json::to_vec(message)?).map_err(io::Error::other)
    }

    /// What was written since the last piece. The log can be read without further pieces.
    pub(super) fn piece(&mut self) -> io::Result<Vec<u8>> {
        self.writer.flush().map_err(io::Error::other)?;
        Ok(self.pieces.0.take())
    }

    /// The last piece, which completes the log.
    pub(super) fn last(mut self) -> io::Result<Vec<u8>> {
        let mut items = Vec::new();
        self.decoder.finish(|at, item| items.push((at, OwnedItem::from(item))));
        self.items(&items)?;
        self.writer.finish().map_err(io::Error::other)?;
        Ok(self.pieces.0.take())
    }
}

/// The last commands of a board by name: for each exclusive resource its value, whether it is on, or its command and the values of
/// that command.
fn told(board: &Board, state: &State) -> LastCommands {
    let mut told = BTreeMap::new();
    let number = |value: i32| Value::Number(value.into());
    let resources = board.resources.iter().enumerate().filter(|(_, resource)| resource.is_exclusive);
    for (id, resource) in resources {
        let Some(command) = state.last(id) else { continue };
        let Some(verb) = board.verb(command.verb()) else { continue };
        let values = command.values();
        match (verb.axes.as_slice(), values.as_slice()) {
            ([.., _], [.., value]) if verb.is_indexed() => {
                told.insert(resource.key.clone(), number(*value));
            }
            ([axis], [value]) if matches!(axis.takes, ValueForm::Word(_)) => {
                told.insert(resource.key.clone(), Value::Switch(*value != 0));
            }
            (axes, values) => {
                if board.rest(id) == Some(command) && command.is_zero() {
                    // After that, everything that moves this resource is at zero.
                    let others = board.verbs.iter().filter(|verb| verb.moves && verb.sets == Sets::One(id));
                    told.extend(others.flat_map(|verb| &verb.axes).map(|axis| (axis.key.clone(), number(0))));
                } else if verb.moves {
                    told.extend(axes.iter().zip(values).map(|(axis, value)| (axis.key.clone(), number(*value))));
                }
                told.insert(resource.key.clone(), Value::Text(board.show(command).to_string()));
            }
        }
    }
    LastCommands(told)
}

/// The values of a report, by name.
fn values<'b>(board: &'b Board, report: &Report) -> BTreeMap<&'b str, f64> {
    let quantities = board.quantities.iter().enumerate();
    quantities.map(|(row, quantity)| (&*quantity.key, report.value(row).number())).collect()
}

/// In microseconds.
fn micros(Nanos(nanos): Nanos) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a day of nanoseconds fits")]
    let nanos = nanos as f64;
    nanos / 1_000.0
}
