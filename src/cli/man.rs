//! `motionseq man`: manual pages.

use std::io::{self, Write};

use clap::{Args, Command, CommandFactory};

use super::Cli;
use super::exit::{Exit, TABLE};
use super::output;
use super::screen::Screen;

/// Print a manual page
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq man | man -l -                     # show the page of motionseq\n  motionseq man play > motionseq-play.1        # write the page of one command"
)]
pub(super) struct Man {
    /// Command to describe; without it, motionseq as a whole
    command: Option<String>,
}

/// An environment variable or a file, and what it means.
struct Entry {
    name: &'static str,
    meaning: &'static str,
    /// The commands that use it; empty for all.
    commands: &'static [&'static str],
}

const ENVIRONMENT: [Entry; 4] = [
    Entry {
        name: "MOTIONSEQ_PORT",
        meaning: "The serial port of `play`, if there is no `--port`; `virtual` or empty for the virtual board",
        commands: &["play", "config"],
    },
    Entry {
        name: "GITHUB_WORKSPACE",
        meaning: "The folder that paths in annotations and reports are relative to; otherwise the folder with .git",
        commands: &["check", "test"],
    },
    Entry { name: "NO_COLOR", meaning: "If not empty, messages are not colored", commands: &[] },
    Entry { name: "TERM", meaning: "If `dumb`, messages are not colored and no line is redrawn", commands: &[] },
];

const FILES: [Entry; 5] = [
    Entry {
        name: "motionseq.toml",
        meaning: "The configuration of the scripts in its folder and below",
        commands: &["check", "render", "play", "plot", "test", "diff", "config", "init"],
    },
    Entry {
        name: "NAME.motion",
        meaning: "A script",
        commands: &["check", "render", "play", "plot", "test", "diff", "fmt", "init", "decode", "record"],
    },
    Entry {
        name: "NAME.motion.frames",
        meaning: "The snapshot of the script, which `test --bless` writes",
        commands: &["test", "diff", "decode"],
    },
    Entry {
        name: "NAME.motion.FAULTS.frames",
        meaning: "The frames that are sent when a fault ends the script, for each line `# rehearse: FAULTS`",
        commands: &["test"],
    },
    Entry {
        name: "/dev/serial0",
        meaning: "The serial port of a Raspberry Pi, which the board is plugged onto",
        commands: &["play", "record", "ports"],
    },
];

impl Man {
    /// Prints the page.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let mut whole = Cli::command().disable_help_subcommand(true);
        whole.build();
        let page = match &self.command {
            None => whole,
            Some(name) => match whole.find_subcommand(name).filter(|command| !command.is_hide_set()) {
                Some(command) => command.clone(),
                None => {
                    let all = whole.get_subcommands().filter(|command| !command.is_hide_set());
                    let names: Vec<&str> = all.map(Command::get_name).collect();
                    screen.error(&format!("unknown command `{name}`; the commands are {}", names.join(", ")));
                    return Exit::Usage;
                }
            },
        };
        let written = page_of(&page).and_then(|text| io::stdout().lock().write_all(text.as_bytes()));
        output::exit(written, None, screen)
    }
}

/// The manual page of a command.
fn page_of(command: &Command) -> io::Result<String> {
    let name = command.get_name();
    let man = clap_mangen::Man::new(command.clone())
        .source(concat!("motionseq ", env!("CARGO_PKG_VERSION")))
        .manual("User Commands");
    let mut text = Vec::new();
    man.render_title(&mut text)?;
    man.render_name_section(&mut text)?;
    let usage = command.clone().render_usage().to_string();
    writeln!(text, ".SH SYNOPSIS\n{}", roff(usage.trim_start_matches("Usage: ")))?;
    man.render_description_section(&mut text)?;
    man.render_options_section(&mut text)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut text)?;
    }
    let mut page = cleaned(&String::from_utf8_lossy(&text));

    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let is_block = |paragraph: &&str| paragraph.lines().nth(1).is_some_and(|line| line.starts_with("  "));
    let (blocks, notes): (Vec<&str>, Vec<&str>) = help.split("\n\n").partition(is_block);
    let (examples, tables): (Vec<&str>, Vec<&str>) = blocks.into_iter().partition(|block| block.starts_with("Example"));
    for block in tables {
        page += &verbatim(block);
    }
    if !notes.is_empty() {
        page += ".SH NOTES\n";
        for line in notes.iter().flat_map(|paragraph| paragraph.lines()) {
            page += &(roff(line) + "\n.br\n");
        }
    }
    let is_main = command.has_subcommands();
    page += ".SH EXIT STATUS\n";
    for row in TABLE.iter().filter(|row| is_main || returns(name, row.is_about_ports, row.code)) {
        page += &tagged(row.code, row.meaning);
    }
    for (title, entries) in [("ENVIRONMENT", &ENVIRONMENT[..]), ("FILES", &FILES[..])] {
        let of_command = |entry: &&Entry| is_main || entry.commands.is_empty() || entry.commands.contains(&name);
        let entries: String =
            entries.iter().filter(of_command).map(|entry| tagged(entry.name, entry.meaning)).collect();
        if !entries.is_empty() {
            page += &[".SH ", title, "\n", &entries].concat();
        }
    }
    for block in examples {
        page += &verbatim(block);
    }
    page += ".SH SEE ALSO\n";
    page += &see_also(command);
    Ok(page)
}

/// Whether a command returns an exit code.
fn returns(command: &str, is_about_ports: bool, code: &str) -> bool {
    match command {
        "play" => true,
        "board" | "record" => code != "4" && code != "7",
        "ports" => !is_about_ports && code != "7" || code == "3",
        "test" => !is_about_ports,
        _ => !is_about_ports && code != "7",
    }
}

/// The pages of all commands, or the page of the program.
fn see_also(command: &Command) -> String {
    let bold = |name: &str| format!("\\fB{}\\fR(1)", roff(name));
    if !command.has_subcommands() {
        return bold("motionseq") + "\n";
    }
    let commands = command.get_subcommands().filter(|command| !command.is_hide_set());
    let pages: Vec<String> = commands.map(|command| bold(&format!("motionseq-{}", command.get_name()))).collect();
    pages.join(",\n") + "\n"
}

/// A page as `clap_mangen` writes its sections: with one preamble, headed options as subsections, and code in bold.
fn cleaned(text: &str) -> String {
    let is_preamble = |line: &str| line.starts_with(".ie \\n(.g") || line.starts_with(".el .ds Aq");
    let mut page = String::new();
    for (at, line) in text.lines().enumerate() {
        if at > 1 && is_preamble(line) {
            continue;
        }
        let heading = line.strip_prefix(".SH ").map(|heading| heading.trim_matches('"'));
        match heading {
            Some(heading)
                if heading.ends_with(" OPTIONS") || heading == "PART AND SPEED" || heading == "RESULT FILES" =>
            {
                let (first, rest) = heading.split_at(1);
                page += &[".SS \"", first, &rest.to_lowercase(), "\"\n"].concat();
            }
            None if line.starts_with(".TH ") => page += &(line.replacen(" 1  ", " 1 \"\" ", 1) + "\n"),
            Some("NAME") => page += ".nh\n.ad l\n.SH NAME\n",
            Some("SUBCOMMANDS") => page += ".SH COMMANDS\n",
            _ => page += &(code_in_bold(line) + "\n"),
        }
    }
    page
}

/// A block of help text, such as `Examples:`, as a section that is not reflowed.
fn verbatim(block: &str) -> String {
    let (title, lines) = block.split_once('\n').unwrap_or((block, ""));
    let title = title.trim_end_matches(':').to_uppercase();
    let lines: String = lines.lines().map(|line| roff(line.trim_start_matches("  ")) + "\n").collect();
    format!(".SH {title}\n.nf\n.RS 4\n{lines}.RE\n.fi\n")
}

/// A term and its meaning.
fn tagged(term: &str, meaning: &str) -> String {
    format!(".TP\n\\fB{}\\fR\n{}\n", roff(term), roff(meaning))
}

/// Escapes a line of text.
fn roff(line: &str) -> String {
    let escaped = line.replace('\\', "\\e").replace('-', "\\-").replace('\'', "\\(aq");
    let escaped = if escaped.starts_with('.') { format!("\\&{escaped}") } else { escaped };
    code_in_bold(&escaped)
}

/// Text with `code` in bold.
fn code_in_bold(line: &str) -> String {
    let mut parts = line.split('`');
    let mut text = parts.next().unwrap_or_default().to_owned();
    for (part, font) in parts.zip(["\\fB", "\\fR"].into_iter().cycle()) {
        text += font;
        text += part;
    }
    text
}
