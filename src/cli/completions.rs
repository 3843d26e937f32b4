//! `motionseq completions`: static completion scripts, and the answers of the program when a shell asks it.

use std::ffi::{OsStr, OsString};
use std::io::{self, Write};
use std::path::Path;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Arg, Args, Command, CommandFactory};
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter as _};
use clap_complete::env::Shells;
use clap_complete::{CompleteEnv, Shell};
use motionseq::diagnostic::{Code, Diagnostics};
use motionseq::program::Options;
use motionseq::source::{Disk, Files as _, Sources};
use motionseq::syntax::{Statement, parse};

use super::Cli;
use super::exit::Exit;
use super::output;
#[cfg(target_os = "linux")]
use super::port_opening::AUTO;
#[cfg(target_os = "linux")]
use super::project::VIRTUAL;
use super::screen::Screen;

/// The variable that names the shell that asks.
const ASKS: &str = "COMPLETE";
/// The longest script whose marks are completed, in frames. A longer one takes too long.
const EVENTS: usize = 1_000_000;
/// The commands whose arguments are scripts.
const SCRIPT_COMMANDS: [&str; 8] = ["check", "render", "play", "plot", "test", "diff", "fmt", "config"];

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  source <(COMPLETE=bash motionseq)                  # in ~/.bashrc; also completes marks, names and ports\n  motionseq completions bash > ~/.local/share/bash-completion/completions/motionseq\n  motionseq completions zsh > ~/.zfunc/_motionseq    # a folder in $fpath"
)]
pub(super) struct Completions {
    /// Shell to complete in
    shell: Shell,
}

impl Completions {
    /// Prints the script.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        // Written to memory first, because clap_complete panics if it cannot write.
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut completed(), "motionseq", &mut text);
        output::exit(io::stdout().lock().write_all(&text), None, screen)
    }
}

/// Answers a shell that asks for completions; returns whether one does.
pub(super) fn answer() -> bool {
    let Some(shell) = std::env::var_os(ASKS) else { return false };
    let name = Path::new(&shell).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    // Another program may use this variable for something else.
    if Shells::builtins().completer(&name).is_none() {
        return false;
    }
    let is_bash = name == "bash";
    // Several installed versions have one name.
    let answers = CompleteEnv::with_factory(|| with_completers(is_bash)).bin("motionseq").completer("motionseq");
    let answered = answers.try_complete(std::env::args_os(), std::env::current_dir().ok().as_deref());
    answered.unwrap_or_else(|error| error.exit())
}

/// The command line without hidden commands, and with the values of arguments that parse any string.
fn completed() -> Command {
    let whole = Cli::command();
    let commands: Vec<Command> = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned().collect();
    // clap takes only static names of values; this runs once.
    let names: Vec<&'static str> = commands.iter().map(|command| &*command.get_name().to_owned().leak()).collect();
    let commands = commands.into_iter().map(|command| match command.get_name() {
        "explain" => command.mut_arg("code", |code| code.value_parser(PossibleValuesParser::new(codes()))),
        "man" => command.mut_arg("command", |name| name.value_parser(PossibleValuesParser::new(names.clone()))),
        _ => command,
    });
    Command::new("motionseq").args(whole.get_arguments().cloned()).subcommands(commands)
}

/// The same with what only the program can complete: marks, names, ports and scripts. Options are offered once a `-` is typed.
fn with_completers(is_bash: bool) -> Command {
    let has_word = std::env::args_os().last().is_some_and(|word| !word.is_empty());
    let shown = move |argument: Arg| if argument.is_positional() { argument } else { argument.hide(!has_word) };
    completed().disable_help_flag(!has_word).mut_args(shown).mut_subcommands(|command| {
        let has_scripts = SCRIPT_COMMANDS.contains(&command.get_name());
        command.disable_help_flag(!has_word).mut_args(shown).mut_args(|argument| match argument.get_id().as_str() {
            "from" | "to" => argument.add(ArgValueCompleter::new(marks)),
            "set" => argument.add(ArgValueCompleter::new(names)),
            "robot" => argument.add(ArgValueCompleter::new(robots)),
            #[cfg(target_os = "linux")]
            "port" => argument.add(ArgValueCompleter::new(ports)),
            "file" | "files" | "path" | "paths" | "old" | "new" if has_scripts => {
                argument.add(ArgValueCompleter::new(move |word: &OsStr| scripts(word, is_bash)))
            }
            _ => argument,
        })
    })
}

/// The codes of errors and warnings, with their titles.
fn codes() -> impl Iterator<Item = PossibleValue> {
    Code::ALL.iter().map(|code| PossibleValue::new(code.name()).help(code.title()))
}

/// The candidates that begin with a word.
fn beginning(word: &OsStr, all: impl IntoIterator<Item = String>) -> Vec<CompletionCandidate> {
    let word = word.to_string_lossy();
    all.into_iter().filter(|candidate| candidate.starts_with(&*word)).map(CompletionCandidate::new).collect()
}

/// The script on the command line that is being typed.
fn script_typed() -> Option<Sources> {
    let words = std::env::args_os().skip_while(|word| word != "--").skip(3).map(|word| unquoted(&word));
    let is_script = |word: &OsString| Path::new(word).extension().is_some_and(|extension| extension == "motion");
    let script = words.filter(is_script).find(|word| Path::new(word).is_file())?;
    Some(Sources::new(Disk.read(Path::new(&script)).ok()?, Disk))
}

/// The marks of the script that `--from` and `--to` accept.
fn marks(word: &OsStr) -> Vec<CompletionCandidate> {
    let compiled = script_typed().map(|sources| motionseq::compile(&sources, &Options::default().with_events(EVENTS)));
    // All robots have the same marks.
    let Some(timeline) = compiled.as_ref().and_then(|compiled| compiled.timelines.first()) else { return Vec::new() };
    let names: Vec<&str> = timeline.marks.iter().map(|mark| mark.name.as_str()).collect();
    let is_unique = |name: &&str| names.iter().filter(|other| *other == name).take(2).count() == 1;
    beginning(word, names.iter().copied().filter(is_unique).map(str::to_owned))
}

/// The robots of the script.
fn robots(word: &OsStr) -> Vec<CompletionCandidate> {
    let compiled = script_typed().map(|sources| motionseq::compile(&sources, &Options::default().with_events(EVENTS)));
    let timelines = compiled.map(|compiled| compiled.timelines).unwrap_or_default();
    beginning(word, timelines.iter().filter_map(|timeline| Some(timeline.robot.as_ref()?.to_string())))
}

/// The top-level names of the script that `--set` accepts, each with its `=`.
fn names(word: &OsStr) -> Vec<CompletionCandidate> {
    let Some(sources) = script_typed() else { return Vec::new() };
    let Some(tree) = parse(sources.main(), &mut Diagnostics::default()) else { return Vec::new() };
    let mut lets = Vec::new();
    for line in tree.body.lines() {
        lets.extend(line.statements().filter_map(|statement| match statement {
            Statement::Let(named) => Some(format!("{}=", named.name.text)),
            _ => None,
        }));
    }
    beginning(word, lets)
}

/// The serial ports.
#[cfg(target_os = "linux")]
fn ports(word: &OsStr) -> Vec<CompletionCandidate> {
    let ports = motionseq::link::ports().unwrap_or_default();
    let ports = ports.into_iter().map(|port| port.path.display().to_string());
    let ports = beginning(word, ports.chain([AUTO, VIRTUAL].map(str::to_owned)));
    if ports.is_empty() { PathCompleter::any().complete(word) } else { ports }
}

/// Scripts and folders. bash inserts a candidate as it is, so spaces are escaped there.
fn scripts(word: &OsStr, is_bash: bool) -> Vec<CompletionCandidate> {
    let word = unquoted(word);
    let is_script = |path: &Path| path.is_dir() || path.extension().is_some_and(|extension| extension == "motion");
    let mut found = PathCompleter::any().filter(is_script).complete(&word);
    found.retain(|path| path.get_value() != ".");
    let escaped = |path: &OsStr| {
        let path = path.to_string_lossy();
        path.chars()
            .flat_map(|c| [Some('\\').filter(|_| " \t'\"\\$&;()<>|*?[]#`!".contains(c)), Some(c)])
            .flatten()
            .collect::<String>()
    };
    if !is_bash {
        return found;
    }
    found.into_iter().map(|path| CompletionCandidate::new(escaped(path.get_value()))).collect()
}

/// A word as the shell reads it.
fn unquoted(word: &OsStr) -> OsString {
    let Some(word) = word.to_str() else { return word.to_owned() };
    let mut characters = word.chars();
    let mut plain = String::new();
    while let Some(c) = characters.next() {
        match c {
            '\\' => plain.extend(characters.next()),
            '\'' | '"' => {}
            c => plain.push(c),
        }
    }
    plain.into()
}
