//! `--log`: the thread that writes a log. Playing and serving never wait for it.

use std::fs::File;
use std::io;
use std::path::{MAIN_SEPARATOR, Path};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use motionseq::board::{Board, Command, OwnedItem, Report};
use motionseq::playback::{GateEnd, now};
use motionseq::sim::Pose;
use motionseq::source::Sources;
use motionseq::units::{Micros, Nanos};

use super::exit::Exit;
use super::growing_file::{self, Created};
use super::observer::Event;
use super::output::{self, Inputs};
use super::screen::Screen;
use super::worker::Worker;

#[cfg(feature = "mcap")]
mod log_builder;
#[cfg_attr(not(feature = "mcap"), path = "absent.rs")]
mod log_writer;
#[cfg(feature = "mcap")]
mod messages;
mod run;

pub(super) use run::TimelineLog;

/// How many entries may wait to be written.
const ROOM: usize = 16 * 1024;
/// How long the end waits for a file that takes no bytes.
const PATIENCE: Duration = Duration::from_millis(500);

/// A log that is being written.
pub(super) struct Log {
    /// An empty file is removed when the log has ended.
    created: Created,
    screen: Screen,
    /// Returns at its end why the log is not complete.
    worker: Worker<(Nanos, usize, Entry), Option<String>>,
    /// The number of the robot that entries are about.
    pub(super) robot: usize,
    /// Time 0, on the clock of [`now`].
    begin: Nanos,
}

/// Creates the file of a log. In a folder, it gets the name of what is logged, and the time: `dance-20261128T205110Z.mcap`.
pub(super) fn create(path: &Path, name: &str, inputs: &Inputs) -> io::Result<Created> {
    let is_folder = path.as_os_str().as_encoded_bytes().ends_with(MAIN_SEPARATOR.to_string().as_bytes());
    if !is_folder && !path.is_dir() {
        return growing_file::create(path, inputs);
    }
    let time = humantime::format_rfc3339_seconds(SystemTime::now()).to_string().replace(['-', ':'], "");
    for number in 1..=MOST_IN_A_SECOND {
        let more = if number == 1 { String::new() } else { format!("-{number}") };
        match growing_file::create_new(&path.join(format!("{name}-{time}{more}.mcap"))) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            created => return created,
        }
    }
    Err(io::Error::other("it has a thousand logs of this second"))
}

/// The name of a script in the name of its log.
pub(super) fn name_of(sources: &Sources) -> String {
    let stem = sources.main().path().and_then(Path::file_stem);
    stem.map_or_else(|| "stdin".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// How many logs of one name may begin in a second.
const MOST_IN_A_SECOND: u32 = 1_000;

/// Something that happened.
#[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "only a log reads them"))]
pub(super) enum Entry {
    /// Time 0 since the start of 1970.
    Begin { since_1970: Nanos },
    /// Bytes went to the board at this time.
    Bytes(Box<[u8]>),
    /// Frames went to the board, and bytes that are not frames, each at its time.
    Items(Arc<[(Micros, OwnedItem)]>),
    /// A frame of the script was written to the port, with its lateness.
    Late { script: Micros, late: Nanos, command: Command, place: Option<Spot> },
    /// The board has reported.
    Report(Report),
    /// The position of the robot of a virtual board.
    Pose(Pose),
    /// A mark of the script was passed.
    Mark { name: String, script: Micros },
    /// A gate of the script has ended.
    Gate { script: Micros, gate: String, took: Micros, end: GateEnd },
    /// A line for the reader.
    Line { level: Level, text: String, place: Option<Spot> },
    /// How it ended.
    Result(Facts),
}

/// Names and values.
type Facts = Vec<(&'static str, String)>;

/// The name of a robot, if the script names its robots, and its board.
pub(super) type LoggedRobot = (Option<Arc<str>>, Arc<Board>);

/// What a log is about: it is written first.
#[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "only a log reads them"))]
pub(super) struct About {
    /// Now, since 1970.
    started: Nanos,
    facts: Facts,
    /// The names and texts of the script and of the files that it uses.
    scripts: Vec<(String, String)>,
}

impl About {
    /// About this command, on these ports; without one, on the virtual board.
    pub(super) fn new(ports: &[Option<&Path>]) -> Self {
        let arguments: Vec<String> = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into()).collect();
        let arguments = serde_json::to_string(&arguments).unwrap_or_default();
        let name =
            |port: Option<&Path>| port.map_or_else(|| "virtual board".to_owned(), |port| port.display().to_string());
        let port = ports.iter().copied().map(name).collect::<Vec<_>>().join(", ");
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let facts = vec![("version", version), ("arguments", arguments), ("port", port)];
        About { started: since_1970(), facts, scripts: Vec::new() }
    }

    /// With a script and the files that it uses.
    pub(super) fn with_scripts(mut self, sources: &Sources) -> Self {
        self.facts.push(("script", sources.main().name().to_owned()));
        self.scripts = sources.iter().map(|source| (source.name().to_owned(), source.text().to_owned())).collect();
        self
    }
}

/// Now, since 1970.
fn since_1970() -> Nanos {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Nanos(u64::try_from(now.as_nanos()).unwrap_or(u64::MAX))
}

/// A file and a line.
pub(super) type Spot = (String, usize);

/// The level of a line.
#[derive(Clone, Copy, Debug)]
pub(super) enum Level {
    Info,
    Warning,
    Error,
}

impl Log {
    /// Starts the log of a command that is asked for, next to another result, or reports why it cannot.
    pub(super) fn open(
        path: Option<&Path>,
        beside: Option<&File>,
        what: (&str, About),
        board: Arc<Board>,
        screen: &Screen,
    ) -> Result<Option<Self>, Exit> {
        let Some(path) = path else { return Ok(None) };
        let (name, about) = what;
        let created = match beside {
            Some(other) if growing_file::is_at(path, other) => Err(io::Error::other("it is the file of -o")),
            _ => create(path, name, &Inputs::default()),
        };
        let robots = vec![(None, board)];
        let started = created.and_then(|created| Log::start(created, about, robots, *screen));
        started.map(Some).map_err(|error| output::exit(Err(error), Some(path), screen))
    }

    /// Starts a log in a file. Time 0 is now.
    pub(super) fn start(created: Created, about: About, robots: Vec<LoggedRobot>, screen: Screen) -> io::Result<Self> {
        if let Some(why_not) = log_writer::WHY_NOT {
            return Err(io::Error::other(why_not));
        }
        if created.is_named {
            screen.note(&format!("writing the log {}", created.path().display()));
        }
        let file = created.file.try_clone()?;
        let name = format!("the log {}", created.path().display());
        let write = move |entries: &_| log_writer::write((file, name), robots, about, screen, entries);
        let worker = Worker::start("log", ROOM, write)?;
        let mut log = Log { created, screen, worker, robot: 0, begin: Nanos::ZERO };
        log.begin(now());
        Ok(log)
    }

    /// Sets time 0, on the clock of [`now`].
    pub(super) fn begin(&mut self, begin: Nanos) {
        self.begin = begin;
        self.put(begin, Entry::Begin { since_1970: since_1970() - (now() - begin) });
    }

    /// Adds what happened at a time on the clock of [`now`].
    pub(super) fn put(&mut self, at: Nanos, entry: Entry) {
        self.worker.send((at, self.robot, entry));
    }

    /// Adds what happened at a time since time 0.
    pub(super) fn put_since_begin(&mut self, time: Micros, entry: Entry) {
        self.put(self.begin + time.nanos(), entry);
    }

    /// Adds what happened at a board that other programs use, at a time since time 0.
    pub(super) fn take(&mut self, time: Micros, event: &Event) {
        let at = self.begin + time.nanos();
        match event {
            Event::Came(items) => self.put(at, Entry::Items(Arc::clone(items))),
            Event::Report(report) => self.put(at, Entry::Report(*report)),
            Event::Passed(seen) => {
                if let Some(pose) = seen.as_ref().and_then(|seen| seen.pose) {
                    self.put(at, Entry::Pose(pose));
                }
            }
            Event::Opened => self.line(at, Level::Info, "a program has opened the port"),
            Event::Closed => self.line(at, Level::Info, "the program has closed the port"),
            Event::Behind(bytes, Micros(delay)) => {
                let text =
                    format!("the program has sent more than the line can carry: {bytes} bytes wait for {delay} us");
                self.line(at, Level::Warning, text);
            }
            Event::Unread(bytes) => {
                self.line(at, Level::Warning, format!("{bytes} bytes of the program were not read"));
            }
            Event::SetUp(settings) => {
                self.line(at, Level::Warning, format!("the program has set its line to {settings}"));
            }
        }
    }

    /// Adds a line.
    pub(super) fn line(&mut self, at: Nanos, level: Level, text: impl Into<String>) {
        self.put(at, Entry::Line { level, text: text.into(), place: None });
    }

    /// Ends the log with the result of the command, and warns if it is not complete. Returns whether it is.
    pub(super) fn end(mut self, result: Exit, cause: &str) -> bool {
        let facts = vec![("exit", result.code().to_string()), ("cause", cause.to_owned())];
        self.put(now(), Entry::Result(facts));
        let Log { created, screen, worker, .. } = self;
        let (failed, lost) = worker.end(PATIENCE, "it");
        let lost = (lost > 0).then(|| format!("{lost} entries came faster than they could be written"));
        let why_not = failed.unwrap_or_else(Some).or(lost);
        if let Some(why) = &why_not {
            let path = created.path().display();
            screen.warning(&format!("the log {path} is incomplete: {why}; this affects only the log"));
        }
        why_not.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_of_the_same_second_have_different_names() {
        let folder = std::env::temp_dir().join(format!("motionseq-log-names-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let created: Vec<Created> = (0..8).map(|_| create(&folder, "dance", &Inputs::default()).unwrap()).collect();
        let names: Vec<&str> = created.iter().map(|one| one.path().file_name().unwrap().to_str().unwrap()).collect();
        assert!(names.iter().any(|name| name.ends_with("Z-2.mcap")), "{names:?}");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 8);
        drop(created);
        // Nothing was written to them.
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
        std::fs::remove_dir(folder).unwrap();
    }
}
