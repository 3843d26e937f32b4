//! `motionseq completions`: shell completions, and the hidden command that they call to complete marks.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;
use motionseq::diagnostic::Code;
use motionseq::program::Options;
use motionseq::source::{Disk, Sources};

use super::Cli;
use super::exit::Exit;
use super::output;
use super::screen::Screen;

/// The name of the command that lists the marks of a script.
pub(super) const MARKS: &str = "complete-marks";
/// The commands whose arguments are scripts.
const SCRIPT_COMMANDS: [&str; 8] = ["check", "render", "play", "plot", "test", "diff", "fmt", "config"];
/// The argument names of scripts in these commands.
const SCRIPT_ARGUMENTS: [&str; 6] = ["file", "files", "paths", "path", "old", "new"];

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq completions bash > ~/.local/share/bash-completion/completions/motionseq\n  motionseq completions zsh > ~/.zfunc/_motionseq    # a folder in $fpath\n  motionseq completions fish > ~/.config/fish/completions/motionseq.fish"
)]
pub(super) struct Completions {
    /// Shell to complete in
    shell: Shell,
}

impl Completions {
    /// Prints the script.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let text = script(self.shell);
        output::exit(io::stdout().lock().write_all(text.as_bytes()), None, screen)
    }
}

/// List the marks of a script; called by completion scripts
#[derive(Debug, Args)]
pub(super) struct Marks {
    file: PathBuf,
}

impl Marks {
    /// Prints the marks that `--from` and `--to` accept, one per line. Prints no errors, because a user is typing.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let Ok(sources) = Sources::read(&self.file, Disk) else { return Exit::Script };
        let Some(timeline) = motionseq::compile(&sources, &Options::default()).timeline else { return Exit::Script };
        let names: Vec<&str> = timeline.marks.iter().map(|mark| mark.name.as_str()).collect();
        let is_unique = |name: &&str| names.iter().filter(|other| *other == name).take(2).count() == 1;
        let unique: Vec<&str> = names.iter().copied().filter(is_unique).collect();
        let text = unique.join("\n") + if unique.is_empty() { "" } else { "\n" };
        output::exit(io::stdout().lock().write_all(text.as_bytes()), None, screen)
    }
}

/// The completion script of a shell.
fn script(shell: Shell) -> String {
    // Written to memory first, because clap_complete panics if it cannot write.
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut completed(), "motionseq", &mut text);
    let text = String::from_utf8_lossy(&text).into_owned();
    match shell {
        Shell::Bash => bash(&text),
        Shell::Zsh => zsh(&text),
        Shell::Fish => fish(&text),
        _ => text,
    }
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

/// The codes of errors and warnings, with their titles.
fn codes() -> impl Iterator<Item = PossibleValue> {
    Code::ALL.iter().map(|code| PossibleValue::new(code.name()).help(code.title()))
}

/// Adds a function that completes marks and scripts, and registers it.
fn bash(generated: &str) -> String {
    let functions = include_str!("completions/marks.bash")
        .replace("@OPTIONS@", &valued_options().into_iter().collect::<Vec<_>>().join("|"))
        .replace("@COMMANDS@", &SCRIPT_COMMANDS.join("|"));
    let generated = generated.replace("complete -F _motionseq ", "complete -F _motionseq_complete ");
    insert(&generated, &functions, "if [[ \"${BASH_VERSINFO[0]}\"")
}

/// Options of any command that take a value, except those that complete marks.
fn valued_options() -> BTreeSet<String> {
    let whole = completed();
    let arguments = whole.get_subcommands().flat_map(Command::get_arguments).chain(whole.get_arguments());
    let valued = arguments.filter(|argument| !argument.is_positional() && argument.get_action().takes_values());
    let names = valued.flat_map(|argument| {
        let (long, short) = (argument.get_long(), argument.get_short());
        long.map(|long| format!("--{long}")).into_iter().chain(short.map(|short| format!("-{short}")))
    });
    names.filter(|option| option != "--from" && option != "--to").collect()
}

/// Replaces the actions of marks and scripts, and adds the function for marks.
fn zsh(generated: &str) -> String {
    let is_script = |line: &str| {
        let name = line.trim_start_matches(['\'', '*', ':']).split(' ').next().unwrap_or_default();
        line.contains(" -- ") && SCRIPT_ARGUMENTS.contains(&name)
    };
    let lines = generated.lines().map(|line| {
        if line.contains(":TIME|MARK:") {
            line.replace(":_default'", ":_motionseq_marks'")
        } else if is_script(line) {
            let files = ":_files -g \"*.motion\"'";
            line.replace(":_files'", files).replace(":_default'", files)
        } else {
            line.to_owned()
        }
    });
    let text: Vec<String> = lines.collect();
    insert(&(text.join("\n") + "\n"), include_str!("completions/marks.zsh"), "if [ \"$funcstack[1]\"")
}

/// Inserts functions before the last occurrence of a line.
fn insert(text: &str, functions: &str, line: &str) -> String {
    let (before, after) = text.split_at(text.rfind(line).unwrap_or(text.len()));
    format!("{before}{functions}{after}")
}

/// Completes marks, and adds the positional arguments, which `clap_complete` leaves out.
fn fish(generated: &str) -> String {
    let is_mark = |line: &str| line.contains(" -l from ") || line.contains(" -l to ");
    let using = |commands: &str| format!("complete -c motionseq -n \"__fish_motionseq_using_subcommand {commands}\"");
    let quoted = |text: &str| text.replace('\\', "\\\\").replace('\'', "\\'");
    let options = generated.lines().map(|line| match line.strip_suffix(" -r").filter(|line| is_mark(line)) {
        Some(line) => format!("{line} -x -a \"(__fish_motionseq_marks)\""),
        None => line.to_owned(),
    });
    let scripts = format!("{} -k -a \"(__fish_complete_suffix .motion)\"", using(&SCRIPT_COMMANDS.join(" ")));
    let codes = Code::ALL
        .iter()
        .map(|code| format!("{} -f -a {} -d '{}'", using("explain"), code.name(), quoted(code.title())));
    let whole = completed();
    let pages = whole.get_subcommands().map(|command| format!("{} -f -a {}", using("man"), command.get_name()));
    let functions = include_str!("completions/marks.fish").to_owned();
    let lines: Vec<String> = options.chain([functions, scripts]).chain(codes).chain(pages).collect();
    lines.join("\n") + "\n"
}
