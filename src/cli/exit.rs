//! What the program's exit codes mean.

use std::process::ExitCode;

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Everything went well.
    Ok,
    /// The script is wrong.
    Script,
    /// The command line is wrong, or a result cannot be written.
    Usage,
    /// The port cannot be opened, or was lost.
    Port,
    /// A deadline was missed by more than allowed.
    Late,
    /// Another program uses the port.
    InUse,
    /// The port stopped taking bytes.
    Stalled,
    /// An `expect` of the script failed.
    Expect,
    /// It failed, which is a bug. The code is the one of a Rust program that panics.
    Failed,
    /// A signal ended it.
    Signal(i32),
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
