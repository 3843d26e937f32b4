//! `motionseq check`: shows the errors and warnings of scripts.

use std::collections::HashSet;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use motionseq::Compiled;
use motionseq::diagnostic::{Denied, Diagnostic, Diagnostics};
use motionseq::report::{self, Finding, Totals};
use motionseq::source::{Disk, Lines, Source, Sources};
use motionseq::timeline::{Timeline, wire};
use motionseq::verify::{expectation, expected_error};

use super::atomic_file::replace;
use super::exit::Exit;
use super::fixes::{Corrected, STDIN};
use super::output;
use super::project::{Config, ConfigError};
use super::screen::{Screen, Warnings, plural};
use super::script_files::find_scripts;
use super::unified_diff::unified_diff;
use super::watch::Watch;
use super::{Deny, Options, read_source, repository};

/// Show the errors and warnings of scripts
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq check scripts/hello.motion\n  motionseq check --deny warnings .         # all scripts in this folder; fail on warnings\n  motionseq check --diff .                  # show what `--fix` would correct\n  motionseq check --fix .                   # correct it\n  motionseq check -v scripts/dance.motion   # also show the load on the serial line\n  motionseq check --watch scripts           # again after each change\n  motionseq check --format sarif . > motionseq.sarif\n  motionseq check --stdin-filename scripts/dance.motion - < draft.motion"
)]
pub(super) struct Check {
    /// Scripts or folders to check, or `-` for standard input [default: `paths` of motionseq.toml, else this folder]
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Fix errors that have only one correction, in the scripts and the files they use; print standard input as corrected, and change no file that it uses
    #[arg(long, conflicts_with = "watch")]
    fix: bool,
    /// Change no file; show what `--fix` would change, and fail if it would change anything
    #[arg(long, conflicts_with = "format")]
    diff: bool,
    #[command(flatten)]
    deny: Deny,
    /// Output format; all formats except `human` go to standard output
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
    /// Treat standard input as the file at PATH: messages show this name, and `use` looks in its folder
    #[arg(long, value_name = "PATH")]
    stdin_filename: Option<PathBuf>,
    #[command(flatten)]
    watch: Watch,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Messages with the lines of the script
    Human,
    /// One line for each message
    Concise,
    /// One JSON object
    Json,
    /// GitHub Actions annotations
    Github,
    /// GitLab code quality
    Gitlab,
    /// SARIF 2.1.0, for code scanning
    Sarif,
}

/// What the scripts have shown.
struct Results {
    exit: Exit,
    findings: Vec<Finding>,
    totals: Totals,
    /// The errors of configurations. One is the error of all scripts that it applies to.
    config_errors: Vec<Arc<ConfigError>>,
}

/// A script that was checked.
struct Checked {
    sources: Sources,
    compiled: Compiled,
    /// Whether it is from a folder.
    is_found: bool,
    /// The warnings that fail it, and the reason.
    denied: (Denied, String),
}

impl Results {
    /// Adds a file that cannot be read.
    fn fail(&mut self, findings: Vec<Finding>) {
        self.totals.errors += findings.len();
        self.findings.extend(findings);
        self.exit = Exit::Script;
    }

    /// The exit code, which a wrong configuration decides.
    fn exit(&self) -> Exit {
        if self.config_errors.is_empty() { self.exit } else { Exit::Usage }
    }
}

impl Check {
    /// Checks every file; fails if one of them does.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let input = [PathBuf::from(STDIN)];
        let named = if self.files.is_empty() && self.stdin_filename.is_some() { &input } else { self.files.as_slice() };
        let check = |paths: &[PathBuf]| self.check(paths, screen).unwrap_or_else(|exit| exit);
        self.watch.run(named, &self.options, screen, check)
    }

    /// Whether standard input is read at most once, and has a name only then.
    fn check_stdin(&self, paths: &[PathBuf], screen: &Screen) -> Result<(), Exit> {
        let stdin = paths.iter().filter(|file| file.as_os_str() == STDIN).count();
        if stdin > 1 {
            screen.error("standard input can be read only once: write `-` once");
            return Err(Exit::Usage);
        }
        if stdin == 0 && self.stdin_filename.is_some() {
            screen.error("`--stdin-filename` is the name of standard input: write `-` as FILE");
            return Err(Exit::Usage);
        }
        Ok(())
    }

    fn check(&self, paths: &[PathBuf], screen: &Screen) -> Result<Exit, Exit> {
        self.check_stdin(paths, screen)?;
        let configs = self.options.config.configs();
        let mut results =
            Results { exit: Exit::Ok, findings: Vec::new(), totals: Totals::default(), config_errors: Vec::new() };
        // A script in a folder that declares its error is a test case, and passes if it has that error.
        let (folders, files): (Vec<_>, Vec<_>) = paths.iter().cloned().partition(|path| path.is_dir());
        let found = find_scripts(&folders, &configs);
        if !folders.is_empty() && found.scripts.is_empty() && found.unreadable.is_empty() {
            let folders: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
            screen.error(&format!("no .motion files in {}", folders.join(", ")));
            results.exit = Exit::Script;
        }
        for (path, why) in &found.unreadable {
            screen.error(&format!("cannot read {}: {why}", path.display()));
            results.fail(vec![Finding::unreadable(&path.display().to_string(), why.clone())]);
        }
        let files = files.iter().map(|file| (file, false)).chain(found.scripts.iter().map(|file| (file, true)));
        let mut files: Vec<_> = files.collect();
        // Standard input corrects no file, so the files that it uses come first.
        files.sort_by_key(|(file, _)| file.as_os_str() == STDIN);
        let corrected = Corrected::default();
        let mut input = None;
        for (file, is_found) in files {
            let source = match self.read(file, screen) {
                Ok(source) => source,
                Err(found) => {
                    results.fail(found);
                    continue;
                }
            };
            let config = match configs.found_for(source.path().unwrap_or(Path::new(""))) {
                Ok(config) => config,
                Err(error) => {
                    self.misconfigured(&error, &mut results, screen);
                    continue;
                }
            };
            let (sources, compiled) = self.compile(file, source, &corrected, &config);
            if file.as_os_str() == STDIN {
                input = Some(sources.main().text().to_owned());
            }
            if !self.diff {
                let denied = config.denied(&self.deny.deny);
                self.show(&Checked { sources, compiled, is_found, denied }, &mut results, screen);
            }
        }
        Ok(self.finish(results, input, corrected, screen))
    }

    /// Prints the findings and the corrected standard input, and writes or shows the corrections.
    fn finish(&self, mut results: Results, input: Option<String>, corrected: Corrected, screen: &Screen) -> Exit {
        let printed = self.print(&mut results.findings, results.totals, input.is_some());
        let printed = printed.and_then(|()| match input.filter(|_| self.fix && !self.diff) {
            Some(text) => io::stdout().lock().write_all(text.as_bytes()),
            None => Ok(()),
        });
        let written = match output::exit(printed, None, screen) {
            Exit::Ok if self.diff => show_changes(corrected, screen),
            Exit::Ok => write_changes(corrected, screen),
            failed => failed,
        };
        match written {
            Exit::Ok => results.exit(),
            // `--diff` shows changes.
            Exit::Script if results.exit() == Exit::Usage => Exit::Usage,
            failed => failed,
        }
    }

    /// Shows the error of a configuration, once.
    fn misconfigured(&self, error: &Arc<ConfigError>, results: &mut Results, screen: &Screen) {
        if results.config_errors.iter().any(|other| Arc::ptr_eq(other, error)) {
            return;
        }
        if self.format == Format::Human {
            error.show(screen);
        } else {
            results.fail(error.findings());
        }
        results.config_errors.push(Arc::clone(error));
    }

    /// Compiles a script, with `--fix` or `--diff` as corrected.
    fn compile(&self, file: &Path, source: Source, corrected: &Corrected, config: &Config) -> (Sources, Compiled) {
        let options = self.options.of_library(config);
        if self.fix || self.diff {
            return corrected.compile(file, source, &options);
        }
        let sources = Sources::new(source, Disk);
        let compiled = motionseq::compile(&sources, &options);
        (sources, compiled)
    }

    /// Shows the errors and warnings of one script.
    fn show(&self, checked: &Checked, results: &mut Results, screen: &Screen) {
        let Checked { sources, compiled: Compiled { timelines, diagnostics, .. }, is_found, denied } = checked;
        let (denied, who) = denied;
        let name = sources.main().name();
        if let Some(expected) = expected_error(sources.main()).filter(|_| *is_found)
            && expectation(expected, diagnostics).is_ok()
        {
            screen.note(&format!("{name}: ok, fails with `{expected}` as expected"));
            return;
        }
        if self.format == Format::Human {
            screen.diagnostics(sources, diagnostics, self.options.warnings(Warnings::First), denied.is_any());
            let fixable = diagnostics.iter().filter(|diagnostic| diagnostic.fix.is_some()).count();
            if fixable > 0 && !self.fix {
                screen.note(&format!("{} can be fixed with `--fix`", plural(fixable, "error")));
            }
        } else {
            results.findings.extend(report::findings(sources, diagnostics));
            results.totals.add(diagnostics);
        }
        match timelines.as_slice() {
            [first, ..] if denied.count(diagnostics) == 0 => {
                let sends = match timelines.iter().map(|timeline| timeline.events.len()).sum() {
                    0 => "sends nothing".to_owned(),
                    count => format!("{} in {:.3} s", plural(count, "frame"), first.end),
                };
                let robots = if first.robot.is_some() {
                    format!(" to {}", plural(timelines.len(), "robot"))
                } else {
                    String::new()
                };
                screen.note(&format!("{name}: ok, {sends}{robots}"));
                for timeline in timelines.iter().filter(|_| screen.is_verbose()) {
                    for line in load(timeline, sources) {
                        screen.note(&format!("{}{line}", timeline.prefix()));
                    }
                }
            }
            [_, ..] => {
                screen.error(&format!("{name}: has warnings, which {who} forbids"));
                results.exit = Exit::Script;
            }
            [] => results.exit = Exit::Script,
        }
    }

    /// Prints the findings in the selected format.
    fn print(&self, findings: &mut Vec<Finding>, totals: Totals, is_input: bool) -> io::Result<()> {
        if self.diff || self.format == Format::Human {
            return Ok(());
        }
        if matches!(self.format, Format::Github | Format::Gitlab | Format::Sarif) {
            let repository = repository();
            *findings = findings.drain(..).map(|finding| finding.with_paths(|path| repository.path(path))).collect();
        }
        if self.format != Format::Json {
            // An error in a file that several scripts use is one error.
            let mut seen = HashSet::new();
            findings.retain(|found| {
                seen.insert((found.file.clone(), found.line, found.column, found.code, found.message.clone()))
            });
        }
        let text = match self.format {
            Format::Human => String::new(),
            Format::Concise => report::concise::findings(findings),
            Format::Json => report::json::findings(findings, totals),
            Format::Github => report::github::findings(findings),
            Format::Gitlab => report::gitlab::findings(findings),
            Format::Sarif => report::sarif::findings(findings),
        };
        // Standard output is for the corrected text of standard input.
        if is_input && self.fix {
            return io::stderr().lock().write_all(text.as_bytes());
        }
        io::stdout().lock().write_all(text.as_bytes())
    }

    /// Reads a script. If it cannot be read, the reason is shown or returned as a finding.
    fn read(&self, file: &Path, screen: &Screen) -> Result<Source, Vec<Finding>> {
        let name = self.stdin_filename.as_deref().filter(|_| file.as_os_str() == STDIN);
        read_source(file, name).map_err(|error| {
            if self.format == Format::Human {
                screen.unreadable(error);
                return Vec::new();
            }
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

/// Shows what would be corrected; fails if anything would.
fn show_changes(corrected: Corrected, screen: &Screen) -> Exit {
    let files = corrected.into_files();
    let count: usize = files.values().map(|file| file.count).sum();
    let changes: String = files.values().map(|file| unified_diff(&file.name, &file.old, &file.new, screen)).collect();
    let printed = io::stdout().lock().write_all(changes.as_bytes());
    screen.note(&match count {
        0 => "no error would be fixed".to_owned(),
        count => format!("{} would be fixed", plural(count, "error")),
    });
    match output::exit(printed, None, screen) {
        Exit::Ok if count > 0 => Exit::Script,
        exit => exit,
    }
}

/// Writes the corrected files, and reports each.
fn write_changes(corrected: Corrected, screen: &Screen) -> Exit {
    let mut exit = Exit::Ok;
    for (path, file) in corrected.into_files() {
        let is_input = path.as_os_str() == STDIN;
        if !is_input && let Err(error) = replace(&path, file.old.as_bytes(), file.new.as_bytes()) {
            screen.error(&format!("cannot write {}: {error}; the file is unchanged", file.name));
            exit = Exit::Usage;
        } else {
            screen.note(&format!("fixed {} in {}", plural(file.count, "error"), file.name));
        }
    }
    exit
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
