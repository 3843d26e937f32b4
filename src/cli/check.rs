//! `motionseq check`: shows the errors and warnings of scripts.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use motionseq::diagnostic::{Diagnostic, Diagnostics};
use motionseq::report::{self, Finding, Totals};
use motionseq::source::{Disk, Lines, Source, Sources};
use motionseq::timeline::{Timeline, wire};
use motionseq::verify::{expectation, expected_error};

use super::exit::Exit;
use super::output;
use super::screen::{Screen, Warnings, plural};
use super::script_files::find_scripts;
use super::{Deny, Options, read, read_source, repository};

/// Show the errors and warnings of scripts
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq check scripts/hello.motion\n  motionseq check --deny warnings .         # all scripts in this folder; fail on warnings\n  motionseq check -v scripts/dance.motion   # also show the load on the serial line\n  motionseq check --format sarif . > motionseq.sarif"
)]
pub(super) struct Check {
    /// Scripts or folders to check, or `-` for standard input [default: `paths` of motionseq.toml, else this folder]
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    deny: Deny,
    /// Output format; all formats except `human` go to standard output
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Messages with the lines of the script
    Human,
    /// One JSON object
    Json,
    /// GitHub Actions annotations
    Github,
    /// SARIF 2.1.0, for code scanning
    Sarif,
}

impl Check {
    /// Checks every file; fails if one of them does.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.check(screen).unwrap_or_else(|exit| exit)
    }

    #[expect(clippy::too_many_lines, reason = "one format after the other")]
    fn check(&self, screen: &Screen) -> Result<Exit, Exit> {
        if self.files.iter().filter(|file| file.as_os_str() == "-").count() > 1 {
            screen.error("standard input can be read only once: write `-` once");
            return Err(Exit::Usage);
        }
        let configs = self.options.config.configs();
        let paths = configs.searched(&self.files, screen)?;
        let mut exit = Exit::Ok;
        let mut findings = Vec::new();
        let mut totals = Totals::default();
        // A script in a folder that declares its error is a test case, and passes if it has that error.
        let (folders, files): (Vec<_>, Vec<_>) = paths.into_iter().partition(|path| path.is_dir());
        let found = find_scripts(&folders, &configs);
        if !folders.is_empty() && found.scripts.is_empty() && found.unreadable.is_empty() {
            let folders: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
            screen.error(&format!("no .motion files in {}", folders.join(", ")));
            exit = Exit::Script;
        }
        for (path, why) in &found.unreadable {
            screen.error(&format!("cannot read {}: {why}", path.display()));
            findings.push(Finding::unreadable(&path.display().to_string(), why.clone()));
            totals.errors += 1;
            exit = Exit::Script;
        }
        let files = files.iter().map(|file| (file, false)).chain(found.scripts.iter().map(|file| (file, true)));
        for (file, is_found) in files {
            let source = match self.read(file, screen) {
                Ok(source) => source,
                Err(found) => {
                    totals.errors += found.len();
                    findings.extend(found);
                    exit = Exit::Script;
                    continue;
                }
            };
            let sources = Sources::new(source, Disk);
            let config = configs.of_script(sources.main().path().unwrap_or(Path::new("")), screen)?;
            let compiled = motionseq::compile(&sources, &self.options.of_library(&config));
            let (denied, who) = config.denied(&self.deny.deny);
            if let Some(expected) = expected_error(sources.main()).filter(|_| is_found)
                && expectation(expected, &compiled.diagnostics).is_ok()
            {
                screen.note(&format!("{}: ok, fails with `{expected}` as expected", sources.main().name()));
                continue;
            }
            if self.format == Format::Human {
                screen.diagnostics(
                    &sources,
                    &compiled.diagnostics,
                    self.options.warnings(Warnings::First),
                    denied.is_any(),
                );
            } else {
                findings.extend(report::findings(&sources, &compiled.diagnostics));
                totals.add(&compiled.diagnostics);
            }
            match compiled.timeline {
                Some(timeline) if denied.count(&compiled.diagnostics) == 0 => {
                    let sends = match timeline.events.len() {
                        0 => "sends nothing".to_owned(),
                        count => format!("{} in {:.3} s", plural(count, "frame"), timeline.end),
                    };
                    screen.note(&format!("{}: ok, {sends}", sources.main().name()));
                    if screen.is_verbose() {
                        for line in load(&timeline, &sources) {
                            screen.note(&line);
                        }
                    }
                }
                Some(_) => {
                    screen.error(&format!("{}: has warnings, which {who} forbids", sources.main().name()));
                    exit = Exit::Script;
                }
                None => exit = Exit::Script,
            }
        }
        if matches!(self.format, Format::Github | Format::Sarif) {
            let repository = repository();
            for finding in &mut findings {
                finding.file = repository.path(&finding.file);
            }
        }
        let text = match self.format {
            Format::Human => return Ok(exit),
            Format::Json => report::json::findings(&findings, totals),
            Format::Github => report::github::findings(&findings),
            Format::Sarif => report::sarif::findings(&findings),
        };
        match output::exit(io::stdout().lock().write_all(text.as_bytes()), None, screen) {
            Exit::Ok => Ok(exit),
            failed => Err(failed),
        }
    }

    /// Reads a script. If it cannot be read, the reason is shown or returned as a finding.
    fn read(&self, file: &Path, screen: &Screen) -> Result<Source, Vec<Finding>> {
        if self.format == Format::Human {
            return read(file, screen).map_err(|_| Vec::new());
        }
        read_source(file).map_err(|error| {
            let words = error.to_string();
            match Diagnostic::of_source(error) {
                None => vec![Finding::unreadable(&file.display().to_string(), words)],
                Some((source, diagnostic)) => {
                    let mut diagnostics = Diagnostics::default();
                    diagnostics.push(diagnostic);
                    report::findings(&Sources::from(source), &diagnostics)
                }
            }
        })
    }
}

/// The most lines shown for the load.
const SHOWN: usize = 60;

/// The load on the serial line: bytes per second, with equal seconds on one line, and the frame that waits longest.
fn load(timeline: &Timeline, sources: &Sources) -> Vec<String> {
    let wire::Load { seconds: load, worst } = wire::load(timeline);
    let capacity = wire::Wire::new(timeline.baud).capacity();
    let mut lines = vec![format!("  load on the serial line ({capacity} bytes/s):")];
    let mut second = 0;
    let groups: Vec<&[u64]> = load.chunk_by(|one, two| one == two).collect();
    for group in groups.iter().take(SHOWN) {
        let bytes = group.first().copied().unwrap_or(0);
        let until = second + group.len();
        let when = if group.len() == 1 { format!("{second} s") } else { format!("{second}-{until} s") };
        lines.push(format!("  {when:>13}  {bytes:>6} bytes/s  {:>3} %", bytes * 100 / capacity.max(1)));
        second = until;
    }
    if groups.len() > SHOWN {
        let busiest = load.iter().enumerate().max_by_key(|(at, bytes)| (**bytes, std::cmp::Reverse(*at)));
        let (at, bytes) = busiest.map_or((0, 0), |(at, bytes)| (at, *bytes));
        lines.push(format!("  and {} s more; the busiest second is at {at} s with {bytes} bytes", load.len() - second));
    }
    if let Some((at, late)) = worst
        && let Some(event) = timeline.events.get(at)
    {
        let origin = timeline.origin(event, sources, &Lines::of(sources));
        let (late, when) = (late.in_millis(), event.at);
        let said = timeline.board.show(&event.command);
        lines.push(format!("  longest wait: {late:.3} ms, `{said}` at {when:.3} s ({origin})"));
    }
    lines
}
