//! The hidden command that `play` and `record` start this program again with: the guard of their robot.

use std::io;
use std::os::fd::BorrowedFd;
use std::os::unix::process::CommandExt;
use std::process::Command;

use clap::Args;
use motionseq::playback::{self, Fate, Stop, Ward, guard};

use super::exit::Exit;
use super::run_summary::{closing_line, stop_words};
use super::screen::{PATIENCE, Screen};

/// What stands for this command on the command line.
pub(super) const WORD: &str = "guard-a-player";

/// Starts a guard over an open port.
pub(super) fn start(
    port: BorrowedFd<'_>,
    ward: &Ward,
    with_board: bool,
    screen: &Screen,
) -> io::Result<playback::Guard> {
    // This program once more, also where its file was replaced since it was started.
    let mut program = Command::new("/proc/self/exe");
    program.arg0("motionseq").args([WORD, screen.color_option()]);
    program.args(with_board.then_some("--with-board"));
    playback::Guard::start(program, port, ward)
}

/// Stop the robot of a player that is killed or hangs; only `play` and `record` can start this
#[derive(Debug, Args)]
pub(super) struct Guard {
    /// The board is the player's own, and ends with it
    #[arg(long)]
    with_board: bool,
    /// What the player has added
    #[arg(trailing_var_arg = true)]
    arguments: Vec<String>,
}

impl Guard {
    /// Guards until the player is done, and says what was done in its place if it was not.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match guard(&self.arguments) {
            Ok(None) => Exit::Ok,
            // All was sent, and all that is lost is a summary.
            Ok(Some(guarded)) if (guarded.fate, guarded.stop) == (Fate::DiedAfterEnd, Stop::NotNeeded) => Exit::Ok,
            Ok(Some(guarded)) => {
                let cause = match guarded.fate {
                    Fate::Hung => {
                        format!("motionseq hung for {:.0} ms and was killed", guarded.silence.in_millis())
                    }
                    Fate::DiedAfterEnd => "motionseq was killed before it could say how the run ended".to_owned(),
                    _ => "motionseq was killed".to_owned(),
                };
                let robot = if self.with_board { "the virtual board ended with it" } else { stop_words(guarded.stop) };
                let line = closing_line(&cause, guarded.place, guarded.at, robot);
                if Screen::never_wait().is_ok() {
                    screen.late_error(&line);
                    Screen::is_written(PATIENCE);
                }
                Exit::Failed
            }
            Err(error) => {
                screen.error(&format!("the guard cannot start: {error}"));
                Exit::Usage
            }
        }
    }
}
