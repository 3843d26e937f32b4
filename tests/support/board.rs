//! Commands of the Raspblock, for tests.

use std::sync::{Arc, LazyLock};

use motionseq::board::{Board, Command, Frame, State, raspblock};

/// The board of tests that name none.
pub(crate) fn board() -> &'static Arc<Board> {
    static BOARD: LazyLock<Arc<Board>> = LazyLock::new(raspblock::board);
    &BOARD
}

/// A command from its word and its values.
pub(crate) fn say(word: &str, values: &[i32]) -> Command {
    board().command_named(word, values).unwrap()
}

pub(crate) fn stop() -> Command {
    say("stop", &[])
}

/// The command of a frame, or the raw frame that it is.
pub(crate) fn decoded(frame: Frame<'_>) -> Command {
    board().decode_or_raw(frame.bytes()).unwrap()
}

/// The state of a board after these commands.
pub(crate) fn state<'c>(commands: impl IntoIterator<Item = &'c Command>) -> State {
    let mut state = State::default();
    commands.into_iter().for_each(|command| state.apply(board(), command));
    state
}

/// Methods of commands that need the Raspblock.
pub(crate) trait OnBoard {
    fn to_frame(&self) -> Vec<u8>;
    fn said(&self) -> String;
    fn is_drive(&self) -> bool;
    fn keeps_driving(&self) -> bool;
}

impl OnBoard for Command {
    fn to_frame(&self) -> Vec<u8> {
        board().to_frame(self)
    }

    fn said(&self) -> String {
        board().show(self).to_string()
    }

    fn is_drive(&self) -> bool {
        board().is_drive(self)
    }

    fn keeps_driving(&self) -> bool {
        board().keeps_driving(self)
    }
}
