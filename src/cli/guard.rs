//! The hidden command that `play` and `record` start this program again with: the guard of their robot.

use std::io;
use std::num::ParseIntError;
use std::os::fd::BorrowedFd;
use std::os::unix::process::CommandExt;
use std::process::Command;

use clap::Args;
use motionseq::playback::{self, Fate, Stop, Ward, frames, guard};
use motionseq::units::Nanos;

use super::ending::{PATIENCE, closing_line, stop_words};
use super::exit::Exit;
use super::screen::Screen;

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
    player: i32,
    #[arg(value_parser = nanos)]
    max_late: Nanos,
    zeros: usize,
    #[arg(action = clap::ArgAction::Set)]
    realtime: bool,
    stop: String,
}

/// Reads a time as a player hands it over: a number of nanoseconds.
fn nanos(text: &str) -> Result<Nanos, ParseIntError> {
    text.parse().map(Nanos)
}

impl Guard {
    /// Guards until the player is done, and says what was done in its place if it was not.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let Guard { max_late, zeros, realtime, .. } = *self;
        let Some(stop) = frames(&self.stop) else {
            screen.error("the guard cannot start: only a player can start it");
            return Exit::Usage;
        };
        let ward = Ward { max_late, zeros, realtime, stop };
        match guard(self.player, ward) {
            Ok(None) => Exit::Ok,
            // All was sent, and all that is lost is a summary.
            Ok(Some(guarded)) if (guarded.fate, guarded.stop) == (Fate::DiedBehindTheEnd, Stop::NotNeeded) => Exit::Ok,
            Ok(Some(guarded)) => {
                let cause = match guarded.fate {
                    Fate::Hung => {
                        format!("motionseq hung for {:.0} ms and was killed", (max_late * 2).in_millis())
                    }
                    Fate::Died => "motionseq was killed".to_owned(),
                    Fate::DiedBehindTheEnd => "motionseq was killed before it could say how the run ended".to_owned(),
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
