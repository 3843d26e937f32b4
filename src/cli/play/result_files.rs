//! The result files of a run: `--record`, `--report` and `--log`.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Instant;

use clap::Args;
use motionseq::source::Sources;
use motionseq::timeline::Timeline;

use super::super::atomic_file::AtomicFile;
use super::super::exit::Exit;
use super::super::growing_file::Created;
use super::super::log::{self, About, Log};
use super::super::output::Force;
use super::super::screen::{PATIENCE, Screen};
use super::super::worker::Worker;
use super::super::{growing_file, output};
use super::observers::{Files, Recording};
use super::port::system;

/// The result files that are requested.
#[derive(Debug, Args)]
pub(super) struct ResultPaths {
    /// Write to FILE the bytes that the port accepted; of several robots, each to a file with its name: `run.left.bin`
    #[arg(long, value_name = "FILE", help_heading = "Result files")]
    record: Option<PathBuf>,
    /// Write a JSON report of the run to FILE
    #[arg(long, value_name = "FILE", help_heading = "Result files")]
    report: Option<PathBuf>,
    /// Write an MCAP log for Foxglove to FILE, or to a new file in a folder; never overwrites a log
    #[arg(long, value_name = "FILE", help_heading = "Result files")]
    log: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

/// The open result files. Their old content is kept until [`start`](ResultFiles::start).
pub(super) struct ResultFiles<'p> {
    recordings: Vec<(PathBuf, File)>,
    /// The file is `None` if the report replaces it when it is complete.
    report: Option<(&'p Path, Option<AtomicFile>)>,
    log: Option<(&'p Path, Created)>,
}

impl<'p> ResultFiles<'p> {
    /// Opens the requested files, which must be different files.
    pub(super) fn open(
        paths: &'p ResultPaths,
        robots: &[Timeline],
        sources: &Sources,
        screen: &Screen,
    ) -> Result<Self, Exit> {
        let inputs = output::Inputs::of_sources(sources);
        let ResultPaths { record, report, log, force } = paths;
        let names = robots.iter().filter_map(|timeline| timeline.robot.as_deref());
        let records: Vec<PathBuf> = match record {
            Some(path) if !growing_file::takes_everything(path) && names.clone().next().is_some() => {
                names.map(|name| of_robot(path, name)).collect()
            }
            // A device takes the bytes of all.
            Some(path) => robots.iter().map(|_| path.clone()).collect(),
            None => Vec::new(),
        };
        let others = [("--report", report), ("--log", log)];
        let others = others.iter().filter_map(|(option, path)| Some((*option, path.as_ref()?)));
        let mut places: Vec<(&str, PathBuf)> = Vec::new();
        for (option, path) in records.iter().map(|path| ("--record", path)).chain(others) {
            let place = growing_file::place(path);
            if let Some((other, _)) = places.iter().find(|(_, other)| *other == place) {
                return Err(refused(screen, path, &io::Error::other(format!("it is also the file of `{other}`"))));
            }
            places.extend((!growing_file::takes_everything(path)).then_some((option, place)));
        }
        let is_script =
            |path: &&PathBuf| ["motion", "frames"].iter().any(|of| path.extension().is_some_and(|is| is == *of));
        if let Some(path) = records.iter().find(is_script).filter(|path| record.as_ref() != Some(path)) {
            let why = "a recording has bytes, and this is the name of a script or of a snapshot";
            return Err(refused(screen, path, &io::Error::other(why)));
        }
        let mut recordings = Vec::new();
        for path in records {
            let opened = open_one(Some(&path), screen, |path| growing_file::open(path, &inputs, *force))?;
            recordings.extend(opened.map(|(path, file)| (path.to_owned(), file)));
        }
        Ok(ResultFiles {
            recordings,
            report: open_one(report.as_deref(), screen, |path| {
                output::whole(path, &inputs, *force).map(|file| file.is_in_place().then_some(file))
            })?,
            log: open_one(log.as_deref(), screen, |path| log::create(path, &log::name_of(sources), &inputs))?,
        })
    }

    /// Discards the old content of the files, and starts the threads that write them.
    pub(super) fn start(
        self,
        robots: &[Timeline],
        sources: &Sources,
        ports: &[Option<&Path>],
        screen: &Screen,
    ) -> Result<(Files, Option<Report>), Exit> {
        let ResultFiles { recordings, report, log } = self;
        for (path, file) in &recordings {
            growing_file::begin(file).map_err(|error| refused(screen, path, &error))?;
        }
        let log = log.map(|(path, created)| {
            let about = About::new(ports).with_scripts(sources);
            let robots = robots.iter().map(|timeline| (timeline.robot.clone(), Arc::clone(&timeline.board)));
            let log = Log::start(created, about, robots.collect(), *screen);
            log.map(|log| (log, sources.clone())).map_err(|error| refused(screen, path, &error))
        });
        let log = log.transpose()?;
        let failed = |error: io::Error| system(screen, &error);
        let recordings = recordings.into_iter().map(|(_, file)| Recording::start(file));
        let recordings = recordings.collect::<io::Result<_>>().map_err(failed)?;
        let report = report.map(|(path, file)| Report::start(path, file)).transpose().map_err(failed)?;
        Ok((Files { recordings, log }, report))
    }
}

/// The file of one of several robots: `run.left.bin` of `run.bin`.
fn of_robot(path: &Path, name: &str) -> PathBuf {
    let mut file = path.file_stem().unwrap_or_default().to_owned();
    file.push(".");
    file.push(name);
    if let Some(extension) = path.extension() {
        file.push(".");
        file.push(extension);
    }
    path.with_file_name(file)
}

fn refused(screen: &Screen, path: &Path, error: &io::Error) -> Exit {
    screen.error(&format!("cannot write {}: {error}; nothing was sent", path.display()));
    Exit::Usage
}

/// Opens a requested file, or reports why it cannot be opened.
fn open_one<'p, T>(
    path: Option<&'p Path>,
    screen: &Screen,
    open: impl FnOnce(&Path) -> io::Result<T>,
) -> Result<Option<(&'p Path, T)>, Exit> {
    let Some(path) = path else { return Ok(None) };
    open(path).map(|opened| Some((path, opened))).map_err(|error| refused(screen, path, &error))
}

/// The thread that writes a report. Started before the first frame, because it may be impossible later.
pub(super) struct Report {
    pub(super) path: PathBuf,
    writer: Worker<String, io::Result<()>>,
}

impl Report {
    fn start(path: &Path, file: Option<AtomicFile>) -> io::Result<Self> {
        let place = path.to_owned();
        let writer = Worker::start("report", 1, move |texts: &Receiver<String>| {
            let Ok(text) = texts.recv() else { return Ok(()) };
            let mut file = file.map_or_else(|| AtomicFile::begin(&place), Ok)?;
            file.write_all(text.as_bytes())?;
            file.finish()
        })?;
        Ok(Report { path: path.to_owned(), writer })
    }

    /// Starts to write the report. The returned function waits for the file, at most [`PATIENCE`].
    pub(super) fn write(mut self, text: String) -> impl FnOnce() -> io::Result<()> {
        let until = Instant::now() + PATIENCE;
        // If the thread has failed, its end reports it.
        self.writer.send(text);
        move || {
            let (written, _) = self.writer.end(until.saturating_duration_since(Instant::now()), "it");
            written.map_err(io::Error::other)?
        }
    }
}
