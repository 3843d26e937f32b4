//! `motionseq completions` and `motionseq man`: what shells and `man` want to know.

use std::io::{self, Write};

use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;

use super::Cli;
use super::exit::Exit;
use super::output;
use super::screen::Screen;

/// Print what a shell needs to complete commands and options
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq completions bash > ~/.local/share/bash-completion/completions/motionseq\n  motionseq completions fish > ~/.config/fish/completions/motionseq.fish"
)]
pub(super) struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    /// Prints them.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        // Made in memory first: clap_complete panics where it cannot write.
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut visible(), "motionseq", &mut text);
        output::exit(io::stdout().lock().write_all(&text), None, screen)
    }
}

/// Print a manual page
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  motionseq man | man -l -\n  motionseq man play > motionseq-play.1")]
pub(super) struct Man {
    /// The command that it is about, instead of the whole program
    command: Option<String>,
}

impl Man {
    /// Prints it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let mut whole = Cli::command();
        whole.build();
        let page = match &self.command {
            None => whole,
            Some(name) => match whole.find_subcommand(name).filter(|command| !command.is_hide_set()) {
                Some(command) => command.clone().version(env!("CARGO_PKG_VERSION")),
                None => {
                    let all = whole.get_subcommands().filter(|command| !command.is_hide_set());
                    let names: Vec<&str> = all.map(Command::get_name).collect();
                    screen.error(&format!("there is no command `{name}`; there are {}", names.join(", ")));
                    return Exit::Usage;
                }
            },
        };
        let mut text = Vec::new();
        let written = clap_mangen::Man::new(page).render(&mut text).and_then(|()| io::stdout().lock().write_all(&text));
        output::exit(written, None, screen)
    }
}

/// The command line without what is hidden, which `clap_complete` would offer.
fn visible() -> Command {
    let whole = Cli::command();
    let commands = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    Command::new("motionseq").args(whole.get_arguments().cloned()).subcommands(commands)
}
