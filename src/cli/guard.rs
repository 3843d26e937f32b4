//! The hidden command that `play` starts itself again with: the guard of its robot.

use std::time::Duration;

use clap::Args;
use motionseq::playback::guard;

use super::ending::closing_line;
use super::exit::Exit;
use super::screen::Screen;

/// What stands for this command on the command line.
pub(super) const WORD: &str = "guard-a-player";

/// What says that the board is the one that is built in.
const VIRTUAL_FLAG: &str = "virtual";
pub(super) const VIRTUAL: &str = "--virtual";

/// Stop the robot of a player that is killed or hangs; only `play` can start this
#[derive(Debug, Args)]
pub(super) struct Guard {
    /// The board is the player's own, and ends with it
    #[arg(long = VIRTUAL_FLAG)]
    is_virtual: bool,
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
                let line = closing_line(&cause, guarded.place, guarded.at_us, guarded.stop);
                let line = match line.split_once("; stop: ") {
                    Some((what, _)) if self.is_virtual => format!("{what}; the virtual board ended with it"),
                    _ => line,
                };
                screen.late_error(&line);
                Exit::Failed
            }
            Err(error) => {
                screen.error(&format!("the guard cannot start: {error}"));
                Exit::Usage
            }
        }
    }
}
