//! The hidden command of the guard: the process that stops the robot if `play` or `record` is killed or hangs.

use std::io;
use std::os::fd::BorrowedFd;
use std::os::unix::process::CommandExt;
use std::process::Command;

use clap::Args;
use motionseq::playback::{self, GuardConfig, PlayerFailure, Stop, guard};

use super::exit::Exit;
use super::run_summary::{closing_line, stop_words};
use super::screen::{PATIENCE, Screen};

/// The name of the command.
pub(super) const WORD: &str = "guard-a-player";

/// Starts a guard over an open port.
pub(super) fn start(
    port: BorrowedFd<'_>,
    ward: &GuardConfig,
    with_board: bool,
    screen: &Screen,
) -> io::Result<playback::Guard> {
    // This program again, even if its file was replaced since it started.
    let mut program = Command::new("/proc/self/exe");
    program.arg0("motionseq").args([WORD, screen.color_option()]);
    program.args(with_board.then_some("--with-board"));
    playback::Guard::start(program, port, ward)
}

/// Stop the robot if its player is killed or hangs; started by `play` and `record` only
#[derive(Debug, Args)]
pub(super) struct Guard {
    /// The board is the virtual board of the player, and ends with it
    #[arg(long)]
    with_board: bool,
    /// Arguments added by the player
    #[arg(trailing_var_arg = true)]
    arguments: Vec<String>,
}

impl Guard {
    /// Guards until the player is done; if the player fails, stops the robot and reports it.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match guard(&self.arguments) {
            Ok(None) => Exit::Ok,
            // Everything was sent; only the summary is lost.
            Ok(Some(guarded)) if (guarded.fate, guarded.stop) == (PlayerFailure::DiedAfterEnd, Stop::NotNeeded) => {
                Exit::Ok
            }
            Ok(Some(guarded)) => {
                let cause = match guarded.fate {
                    PlayerFailure::Hung => {
                        format!("motionseq hung for {:.0} ms and was killed", guarded.silence.in_millis())
                    }
                    PlayerFailure::DiedAfterEnd => {
                        "motionseq was killed before it could report the end of the run".to_owned()
                    }
                    _ => "motionseq was killed".to_owned(),
                };
                let words = stop_words(guarded.stop, guarded.missing, &guarded.without_stop);
                let robot = if self.with_board { "the virtual board ended too" } else { &words };
                let line = closing_line(&cause, guarded.place, guarded.at, robot);
                let line = if guarded.robot.is_empty() { line } else { format!("{}: {line}", guarded.robot) };
                if Screen::never_wait().is_ok() {
                    screen.late_error(&line);
                    Screen::is_written(PATIENCE);
                }
                Exit::Failed
            }
            Err(error) => {
                screen.error(&format!("cannot start the guard: {error}"));
                Exit::Usage
            }
        }
    }
}
