//! The hidden command that `play` starts itself again with: the guard of its robot.

use std::sync::mpsc;
use std::time::Duration;

use clap::Args;
use motionseq::playback::guard;

use super::ending::{closing_line, stop_words};
use super::exit::Exit;
use super::screen::Screen;
use super::start_thread;

/// What stands for this command on the command line.
pub(super) const WORD: &str = "guard-a-player";

/// How long it waits for a screen that takes nothing.
const PATIENCE: Duration = Duration::from_secs(2);

/// Stop the robot of a player that is killed or hangs; only `play` can start this
#[derive(Debug, Args)]
pub(super) struct Guard {
    /// The board is the player's own, and ends with it
    #[arg(long)]
    with_board: bool,
    player: i32,
    max_late: u64,
    #[arg(action = clap::ArgAction::Set)]
    realtime: bool,
}

impl Guard {
    /// Guards until the player is done, and says what was done in its place if it was not.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        match guard(self.player, self.max_late, self.realtime) {
            Ok(None) => Exit::Ok,
            Ok(Some(guarded)) => {
                let cause = if guarded.hung {
                    let silent = Duration::from_nanos(self.max_late.saturating_mul(2));
                    format!("motionseq hung for {} ms and was killed", silent.as_millis())
                } else {
                    "motionseq was killed".into()
                };
                let robot = if self.with_board { "the virtual board ended with it" } else { stop_words(guarded.stop) };
                let line = closing_line(&cause, guarded.place, guarded.at_us, robot);
                let (screen, (done, told)) = (*screen, mpsc::channel());
                let is_begun = start_thread("ending", move || {
                    screen.late_error(&line);
                    let _ = done.send(());
                });
                if is_begun.is_ok() {
                    let _ = told.recv_timeout(PATIENCE);
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
