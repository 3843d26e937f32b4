//! The exit codes of the program.

use std::process::ExitCode;

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Success.
    Ok,
    /// A script is wrong.
    Script,
    /// The command line or the configuration is wrong, or a result cannot be written.
    Usage,
    /// The port cannot be opened, or was lost.
    Port,
    /// A frame was later than allowed.
    Late,
    /// Another program uses the port.
    InUse,
    /// The port stopped accepting bytes.
    Stalled,
    /// An `expect` of the script failed.
    Expect,
    /// A bug. The code is that of a Rust program that panics.
    Failed,
    /// Ended by a signal.
    Signal(i32),
}

/// An exit code and its meaning, for the manual pages.
pub(super) struct Row {
    pub(super) code: &'static str,
    pub(super) meaning: &'static str,
    /// Whether only commands that use a port return it.
    pub(super) is_about_ports: bool,
}

/// Every exit code. docs/cli.md has the same codes.
pub(super) const TABLE: [Row; 10] = [
    row("0", "Success"),
    row("1", "A script is wrong or cannot be read, a test fails, or a comparison finds a difference"),
    row("2", "The command line or motionseq.toml is wrong, or a result file is incomplete"),
    port_row("3", "The port cannot be opened, or was lost"),
    port_row("4", "A frame was later than `--max-late`, and the robot was stopped"),
    port_row("5", "Another program uses the port"),
    port_row("6", "The port stopped accepting bytes"),
    row("7", "An `expect` failed; with `test --play`, nothing else failed"),
    row("101", "A bug in motionseq, or its guard was killed"),
    row("128 + n", "Ended by signal n: 130 for Ctrl-C, 137 if it was killed, also by its guard because it hung"),
];

const fn row(code: &'static str, meaning: &'static str) -> Row {
    Row { code, meaning, is_about_ports: false }
}

const fn port_row(code: &'static str, meaning: &'static str) -> Row {
    Row { code, meaning, is_about_ports: true }
}

impl Exit {
    /// As a number.
    pub(super) fn code(self) -> u8 {
        match self {
            Exit::Ok => 0,
            Exit::Script => 1,
            Exit::Usage => 2,
            Exit::Port => 3,
            Exit::Late => 4,
            Exit::InUse => 5,
            Exit::Stalled => 6,
            Exit::Expect => 7,
            Exit::Failed => 101,
            Exit::Signal(signal) => u8::try_from(signal).unwrap_or(0).saturating_add(128),
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_every_exit_code() {
        let exits = [
            Exit::Ok,
            Exit::Script,
            Exit::Usage,
            Exit::Port,
            Exit::Late,
            Exit::InUse,
            Exit::Stalled,
            Exit::Expect,
            Exit::Failed,
        ];
        let codes: Vec<String> = exits.iter().map(|exit| exit.code().to_string()).collect();
        let rows: Vec<&str> = TABLE.iter().map(|row| row.code).collect();
        assert_eq!(rows, [codes.iter().map(String::as_str).collect(), vec!["128 + n"]].concat());
        assert_eq!(Exit::Signal(2).code(), 130);
    }
}
