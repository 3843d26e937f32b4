//! The content of a log, as an MCAP file for Foxglove and other tools.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::rc::Rc;
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions, Writer};
use motionseq::board::{Board, Hex, Item, OwnedItem, State};
use motionseq::capture::TimedDecoder;
use motionseq::units::{Micros, Nanos};
use serde::Serialize;

use super::messages::{
    BOARD, BoardMessage, FRAMES, FrameMessage, GATES, GateMessage, LATENESS, LOG, LastCommands, LatenessMessage,
    LogMessage, MARKS, MarkMessage, POSE, POSITION, PoseMessage, PositionMessage, TELEMETRY, TRANSFORM,
    TelemetryMessage, Topic, TransformMessage, micros,
};
use super::{About, Entry, Level, LoggedRobot};

/// A log. It is built in memory, piece by piece, and its owner writes the pieces to a file.
pub(super) struct LogBuilder {
    /// The robot that entries are about now, and the others, in the order of the script.
    robot: Robot,
    others: Vec<Robot>,
    writer: Writer<NoSeek<Pieces>>,
    pieces: Pieces,
    /// The channel of each topic that has messages, and the number of its messages.
    channels: BTreeMap<String, (u16, u32)>,
    /// Time 0, on the clock of the entries and since 1970.
    begin: Nanos,
    begin_since_1970: Nanos,
    /// Messages that wait for earlier ones, with their times since 1970.
    waiting: Vec<Waiting>,
    /// The time of the last message in the file.
    newest: Nanos,
}

/// A message: its time, its topic, its robot and its content.
type Waiting = (Nanos, &'static Topic, Option<Arc<str>>, Vec<u8>);

/// What is known of a robot.
struct Robot {
    number: usize,
    /// Its name, if the script names its robots.
    name: Option<Arc<str>>,
    /// The family; it decides how a `move` is decoded.
    board: Arc<Board>,
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

impl LogBuilder {
    pub(super) fn new(robots: Vec<LoggedRobot>) -> io::Result<Self> {
        let pieces = Pieces::default();
        let options = WriteOptions::new()
            .library(concat!("motionseq ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            // The owner decides when a piece ends.
            .chunk_size(None)
            .disable_seeking(true);
        let writer = options.create(NoSeek::new(pieces.clone())).map_err(io::Error::other)?;
        let robot = |(number, (name, board)): (usize, LoggedRobot)| {
            let decoder = TimedDecoder::of_times(&board);
            Robot { number, name, board, decoder, state: State::default(), shown: None }
        };
        let mut robots = robots.into_iter().enumerate().map(robot);
        let first = robots.next().ok_or_else(|| io::Error::other("no robot to log"))?;
        Ok(LogBuilder {
            robot: first,
            others: robots.collect(),
            writer,
            pieces,
            channels: BTreeMap::new(),
            begin: Nanos::ZERO,
            begin_since_1970: Nanos::ZERO,
            waiting: Vec::new(),
            newest: Nanos::ZERO,
        })
    }

    /// Writes what the log is about: a record of metadata, and the scripts.
    pub(super) fn about(&mut self, about: About) -> io::Result<()> {
        let About { started, facts, scripts } = about;
        self.metadata("motionseq", facts)?;
        for (name, text) in scripts {
            let data = Cow::Owned(text.into_bytes());
            let script =
                Attachment { log_time: started.0, create_time: 0, name, media_type: "text/plain".into(), data };
            self.writer.attach(&script).map_err(io::Error::other)?;
        }
        Ok(())
    }

    fn metadata(&mut self, name: &str, facts: Vec<(&'static str, String)>) -> io::Result<()> {
        let metadata = facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata }).map_err(io::Error::other)
    }

    /// Adds what happened to a robot at a time on the clock of the entries.
    pub(super) fn take_of(&mut self, robot: usize, time: Nanos, entry: Entry) -> io::Result<()> {
        self.switch(robot);
        self.take(time, entry)
    }

    fn switch(&mut self, robot: usize) {
        if let Some(other) = self.others.iter_mut().find(|other| other.number == robot) {
            std::mem::swap(&mut self.robot, other);
        }
    }

    /// The same for the robot of the last entry.
    fn take(&mut self, time: Nanos, entry: Entry) -> io::Result<()> {
        let at = (time - self.begin).micros();
        match entry {
            Entry::Begin { since_1970 } => {
                (self.begin, self.begin_since_1970) = (time, since_1970);
                Ok(())
            }
            Entry::Bytes(bytes) => {
                let mut items = Vec::new();
                self.robot.decoder.feed(time - self.begin, &bytes, |at, item| items.push((at, OwnedItem::from(item))));
                self.items(&items)
            }
            Entry::Items(items) => self.items(&items),
            Entry::Late { script, late, command, place } => {
                let (file, line) = place.map_or((None, None), |(file, line)| (Some(file), Some(line)));
                let (late_us, file, command) =
                    (micros(late), file.as_deref(), self.robot.board.show(&command).to_string());
                self.put(&LATENESS, at, &LatenessMessage { at, script, late_us, command, file, line })
            }
            Entry::Report(report) => {
                let board = Arc::clone(&self.robot.board);
                self.put(&TELEMETRY, at, &TelemetryMessage::new(at, &board, &report))
            }
            Entry::Pose(pose) => {
                let timestamp = self.since_1970(at).into();
                self.put(&POSE, at, &PoseMessage::new(timestamp, pose))?;
                let robot = self.robot.name.clone();
                self.put(&TRANSFORM, at, &TransformMessage::new(timestamp, robot.as_deref(), pose))?;
                self.put(&POSITION, at, &PositionMessage::new(at, pose))
            }
            Entry::Mark { name, script } => self.put(&MARKS, at, &MarkMessage { at, script, name: &name }),
            Entry::Gate { script, gate, took, end } => {
                let message = GateMessage { at, script, gate: &gate, took, end: end.word(), opened: end.is_open() };
                self.put(&GATES, at, &message)
            }
            Entry::Line { level, text, place } => {
                let level = match level {
                    Level::Info => 2,
                    Level::Warning => 3,
                    Level::Error => 4,
                };
                let (file, line) = place.unwrap_or_default();
                let timestamp = self.since_1970(at).into();
                let robot = self.robot.name.clone();
                let name = robot.as_deref().unwrap_or("motionseq");
                let message = LogMessage { timestamp, level, message: &text, name, file: &file, line };
                self.put(&LOG, at, &message)
            }
            Entry::Result(facts) => self.metadata("result", facts),
        }
    }

    fn since_1970(&self, at: Micros) -> Nanos {
        self.begin_since_1970 + at.nanos()
    }

    fn items(&mut self, items: &[(Micros, OwnedItem)]) -> io::Result<()> {
        items.iter().try_for_each(|(at, item)| self.item(*at, item.item()))
    }

    /// Adds a frame on the line to the board, or bytes that are not a frame, and the state of the board after it.
    fn item(&mut self, at: Micros, item: Item<'_>) -> io::Result<()> {
        let board = Arc::clone(&self.robot.board);
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
        self.put(&FRAMES, at, &FrameMessage { at, hex, command: says, wrong: wrong.as_deref() })?;
        if let Some(text) = text {
            self.take(self.begin + at.nanos(), Entry::Line { level: Level::Warning, text, place: None })?;
        }
        let Some(command) = command.filter(|_| wrong.is_none()) else { return Ok(()) };
        self.robot.state.apply(&board, &command);
        let told = LastCommands::of(&board, &self.robot.state);
        if self.robot.shown.as_ref() != Some(&told) {
            self.put(&BOARD, at, &BoardMessage { at, told: &told })?;
            self.robot.shown = Some(told);
        }
        Ok(())
    }

    /// Adds a message, which waits for earlier ones.
    fn put(&mut self, topic: &'static Topic, at: Micros, message: &impl Serialize) -> io::Result<()> {
        let time = self.since_1970(at);
        // What is about all robots has one topic.
        let robot = self.robot.name.clone().filter(|_| !topic.is_shared());
        self.waiting.push((time, topic, robot, serde_json::to_vec(message)?));
        Ok(())
    }

    /// Writes the messages up to a time on the clock of the entries, or all, in the order of their times. One that is older than
    /// what was already written gets the time of the last one, because tools expect times in order; its `t_us` is exact.
    fn settle(&mut self, until: Option<Nanos>) -> io::Result<()> {
        self.waiting.sort_by_key(|(time, ..)| *time);
        let until = until.map(|until| self.since_1970((until - self.begin).micros()));
        let count = self.waiting.partition_point(|(time, ..)| until.is_none_or(|until| *time <= until));
        let mut ready = std::mem::take(&mut self.waiting);
        self.waiting = ready.split_off(count);
        for (time, topic, robot, message) in ready {
            self.newest = self.newest.max(time);
            let (channel_id, sequence) = self.channel(topic, robot.as_deref())?;
            let header = MessageHeader { channel_id, sequence, log_time: self.newest.0, publish_time: time.0 };
            self.writer.write_to_known_channel(&header, &message).map_err(io::Error::other)?;
        }
        Ok(())
    }

    /// The channel of a topic, and the number of its next message.
    fn channel(&mut self, topic: &Topic, robot: Option<&str>) -> io::Result<(u16, u32)> {
        let name = robot.map_or_else(|| topic.name.to_owned(), |robot| format!("/{robot}{}", topic.name));
        if let Some((channel, count)) = self.channels.get_mut(&name) {
            *count = count.saturating_add(1);
            return Ok((*channel, *count));
        }
        let schema = self.writer.add_schema(topic.schema, "jsonschema", topic.shape.as_bytes());
        let channel = schema.and_then(|schema| self.writer.add_channel(schema, &name, "json", &BTreeMap::new()));
        let channel = channel.map_err(io::Error::other)?;
        self.channels.insert(name, (channel, 0));
        Ok((channel, 0))
    }

    /// What was written since the last piece, with the messages up to a time on the clock of the entries. The log can be read
    /// without further pieces.
    pub(super) fn piece(&mut self, until: Nanos) -> io::Result<Vec<u8>> {
        self.settle(Some(until))?;
        self.writer.flush().map_err(io::Error::other)?;
        Ok(self.pieces.0.take())
    }

    /// The last piece, which completes the log.
    pub(super) fn last(mut self) -> io::Result<Vec<u8>> {
        for robot in 0..=self.others.len() {
            self.switch(robot);
            let mut items = Vec::new();
            self.robot.decoder.finish(|at, item| items.push((at, OwnedItem::from(item))));
            self.items(&items)?;
        }
        self.settle(None)?;
        self.writer.finish().map_err(io::Error::other)?;
        Ok(self.pieces.0.take())
    }
}
