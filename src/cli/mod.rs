//! The command line: reads arguments, runs one command, returns an exit code. One file per command.

#![cfg_attr(not(target_os = "linux"), allow(dead_code, reason = "shared with the commands that need Linux"))]

mod atomic_file;
mod case_lines;
mod check;
mod color;
mod completions;
mod config;
mod decode;
mod diff;
mod exit;
mod explain;
mod family;
mod fixes;
mod fmt;
mod init;
mod joints;
mod man;
#[cfg_attr(not(feature = "mcap"), path = "mcap_frames_absent.rs")]
mod mcap_frames;
mod output;
mod plot;
mod progress_bar;
mod project;
mod render;
mod review;
mod robot_names;
mod screen;
mod script_files;
mod selection;
mod test;
mod unified_diff;
mod watch;

// The commands that need a serial port or a pseudo-terminal.
#[cfg(target_os = "linux")]
mod board;
#[cfg(target_os = "linux")]
mod display;
#[cfg(target_os = "linux")]
mod growing_file;
#[cfg(target_os = "linux")]
mod guard;
#[cfg(target_os = "linux")]
mod latency;
#[cfg(not(target_os = "linux"))]
mod linux_only;
#[cfg(target_os = "linux")]
mod log;
#[cfg(target_os = "linux")]
mod observer;
#[cfg(target_os = "linux")]
mod play;
#[cfg(target_os = "linux")]
mod port_opening;
#[cfg(target_os = "linux")]
mod ports;
#[cfg(target_os = "linux")]
mod record;
#[cfg(target_os = "linux")]
mod run_summary;
#[cfg(target_os = "linux")]
mod state_line;
#[cfg(target_os = "linux")]
mod tape;
#[cfg(target_os = "linux")]
mod watcher;
#[cfg(target_os = "linux")]
mod worker;

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc;
use std::thread;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use motionseq::Compiled;
use motionseq::diagnostic::Denied;
use motionseq::program::Speed;
use motionseq::report::Repository;
use motionseq::source::{Disk, Files as _, Source, SourceError, Sources};

use color::Color;
use exit::Exit;
#[cfg(not(target_os = "linux"))]
use linux_only::{board, latency, play, ports, record};
use project::{Config, ConfigOptions};
use screen::{Screen, Volume, Warnings};

/// Check, play and test timed motion scripts for robots on a serial line
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 100)]
#[cfg_attr(
    target_os = "linux",
    command(
        after_help = "Examples:\n  motionseq check scripts/hello.motion    # show errors and warnings\n  motionseq play scripts/hello.motion     # play on the built-in virtual board\n  motionseq help play                     # show the options of one command"
    )
)]
#[cfg_attr(
    not(target_os = "linux"),
    command(
        after_help = "Examples:\n  motionseq check scripts/hello.motion    # show errors and warnings\n  motionseq help check                    # show the options of one command"
    )
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Subcommand)]
enum Command {
    Check(check::Check),
    Render(render::Render),
    Play(play::Play),
    Plot(plot::Plot),
    Test(test::Test),
    Diff(diff::Diff),
    Fmt(fmt::Fmt),
    Init(init::Init),
    Config(config::Config),
    Explain(explain::Explain),
    Decode(decode::Decode),
    Joints(joints::Joints),
    Board(board::Board),
    Record(record::Record),
    Ports(ports::Ports),
    Latency(latency::Latency),
    Completions(completions::Completions),
    Man(man::Man),
    #[cfg(target_os = "linux")]
    #[command(name = guard::WORD, hide = true)]
    Guard(guard::Guard),
}

/// How messages look.
#[derive(Debug, Args)]
struct Output {
    /// Color output; `auto` colors it on a terminal, unless `NO_COLOR` is set
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto, value_name = "WHEN", help_heading = "Global options")]
    color: Color,
    /// Show only errors
    #[arg(short, long, global = true, help_heading = "Global options")]
    quiet: bool,
    /// Show more detail
    #[arg(short, long, global = true, conflicts_with = "quiet", help_heading = "Global options")]
    verbose: bool,
}

/// How scripts are compiled.
#[derive(Clone, Debug, Args)]
struct Options {
    /// Set a top-level `let` of the script to another value
    #[arg(long, value_name = "NAME=VALUE", value_parser = name_and_value, help_heading = "Compilation options")]
    set: Vec<(String, String)>,
    /// Refuse a script that sends more than N frames
    #[arg(long, value_name = "N", default_value_t = motionseq::program::Options::default().events, help_heading = "Compilation options")]
    max_events: usize,
    /// Show every warning, not only the first three of each code
    #[arg(long, help_heading = "Compilation options")]
    all: bool,
    #[command(flatten)]
    config: ConfigOptions,
}

/// Warnings that count as errors.
#[derive(Clone, Debug, Args)]
struct Deny {
    /// Fail on warnings: `warnings` for all, or the code of one, such as `left-running`
    #[arg(long, value_name = "WHAT", value_parser = denied(), hide_possible_values = true)]
    deny: Vec<Denied>,
}

/// Reads a word of `--deny`.
fn denied() -> impl TypedValueParser<Value = Denied> {
    let words = PossibleValuesParser::new(Denied::names().map(PossibleValue::new));
    words.try_map(|word| word.parse().map_err(|()| std::fmt::Error))
}

fn name_and_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) => Ok((name.trim().to_owned(), value.trim().to_owned())),
        None => Err(format!("write `{}=VALUE`", if text.is_empty() { "NAME" } else { text })),
    }
}

/// Adds the options of a command.
type AddOptions = fn(clap::Command) -> clap::Command;

/// Commands that other programs start often.
const FREQUENT: [(&str, AddOptions); 5] = [
    ("check", check::Check::augment_args),
    ("render", render::Render::augment_args),
    ("play", play::Play::augment_args),
    ("test", test::Test::augment_args),
    ("fmt", fmt::Fmt::augment_args),
];

/// Reads the command line. For a frequent command, only its own options are built: those of all commands take a third of the time
/// of a short run.
fn parse() -> Result<Cli, clap::Error> {
    let name = std::env::args_os().nth(1);
    let frequent = FREQUENT.iter().find(|(word, _)| name.as_ref().is_some_and(|name| name == word));
    let motionseq = match frequent {
        None => Cli::command(),
        Some((name, options)) => {
            let motionseq = Output::augment_args(clap::Command::new("motionseq").max_term_width(100));
            motionseq.subcommand(options(clap::Command::new(*name)))
        }
    };
    let mut motionseq = motionseq.color(Color::in_arguments().choice());
    if screen::is_terminal_of_unknown_size() {
        motionseq = motionseq.term_width(screen::WIDTH);
    }
    let matches = motionseq.try_get_matches_from_mut(std::env::args_os())?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut motionseq))
}

/// Runs the program.
pub(crate) fn main() -> ExitCode {
    if completions::answer() {
        return Exit::Ok.into();
    }
    let cli = match parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Printing fails on a closed terminal, which must not panic.
            let _ = error.print();
            return if error.use_stderr() { Exit::Usage.into() } else { Exit::Ok.into() };
        }
    };
    let volume = match (cli.output.quiet, cli.output.verbose) {
        (true, _) => Volume::Quiet,
        (_, true) => Volume::Verbose,
        _ => Volume::Normal,
    };
    let screen = Screen::new(cli.output.color, volume);
    let exit = match cli.command {
        Command::Check(check) => check.run(&screen),
        Command::Render(render) => render.run(&screen),
        Command::Plot(plot) => plot.run(&screen),
        Command::Play(play) => play.run(&screen),
        Command::Test(test) => test.run(&screen),
        Command::Diff(diff) => diff.run(&screen),
        Command::Fmt(fmt) => fmt.run(&screen),
        Command::Init(init) => init.run(&screen),
        Command::Config(config) => config.run(&screen),
        Command::Explain(explain) => explain.run(&screen),
        Command::Decode(decode) => decode.run(&screen),
        Command::Joints(joints) => joints.run(&screen),
        Command::Board(board) => board.run(&screen),
        Command::Record(record) => record.run(&screen),
        Command::Latency(latency) => latency.run(&screen),
        Command::Ports(ports) => ports.run(&screen),
        Command::Completions(completions) => completions.run(&screen),
        Command::Man(man) => man.run(&screen),
        #[cfg(target_os = "linux")]
        Command::Guard(guard) => guard.run(&screen),
    };
    Screen::is_written(screen::PATIENCE);
    exit.into()
}

impl Options {
    /// These options as the library takes them, with the limits of a configuration.
    fn of_library(&self, config: &Config) -> motionseq::program::Options {
        let options = motionseq::program::Options::default().with_events(self.max_events);
        options.with_set(self.set.clone()).with_limits(config.limits())
    }

    /// Which warnings are shown: all with `--all`, or else `usual`.
    fn warnings(&self, usual: Warnings) -> Warnings {
        if self.all { Warnings::All } else { usual }
    }

    /// Compiles a script and shows its errors and warnings.
    fn compile(&self, sources: &Sources, screen: &Screen) -> Result<Compiled, Exit> {
        let config = self.config.of_script(sources.main().path(), screen)?;
        Ok(self.compile_at(sources, screen, (Speed::NORMAL, Warnings::First), &config))
    }

    /// Compiles a script at another speed and shows its errors and warnings.
    fn compile_at(
        &self,
        sources: &Sources,
        screen: &Screen,
        (speed, warnings): (Speed, Warnings),
        config: &Config,
    ) -> Compiled {
        let options = self.of_library(config).with_speed(speed);
        let compiled = motionseq::compile(sources, &options);
        screen.diagnostics(sources, &compiled.diagnostics, self.warnings(warnings), false);
        compiled
    }
}

/// What paths in annotations are relative to: `GITHUB_WORKSPACE`, else the repository of this folder, else this folder.
fn repository() -> Repository {
    let here = std::env::current_dir().and_then(|here| here.canonicalize()).unwrap_or_default();
    let workspace = std::env::var_os("GITHUB_WORKSPACE").filter(|path| !path.is_empty());
    let workspace = workspace.and_then(|path| PathBuf::from(path).canonicalize().ok());
    let repository = here.ancestors().find(|folder| folder.join(".git").exists()).map(PathBuf::from);
    let roots = workspace.into_iter().chain(repository).chain([here.clone()]).collect();
    Repository::new(roots, here)
}

/// Starts a thread and waits until it runs, because it can still run out of memory as it starts.
fn start_thread(name: &str, work: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let (up, is_up) = mpsc::channel();
    thread::Builder::new().name(name.to_owned()).spawn(move || {
        let _ = up.send(());
        work();
    })?;
    is_up.recv().map_err(io::Error::other)
}

/// Reads a script; `-` is standard input, which can have the name of a file.
fn read_source(path: &Path, stdin_name: Option<&Path>) -> Result<Source, SourceError> {
    match stdin_name {
        _ if path.as_os_str() != "-" => Disk.read(path),
        None => Source::read_from("<stdin>", io::stdin().lock()),
        Some(name) => Ok(Source::read_from(name.display().to_string(), io::stdin().lock())?.at(name)),
    }
}

/// Reads a script, or shows why it cannot be read.
fn read(path: &Path, screen: &Screen) -> Result<Source, Exit> {
    read_source(path, None).map_err(|error| {
        screen.unreadable(error);
        Exit::Script
    })
}
