//! What a board does, in the words of a line that is drawn again and again.

use motionseq::board::{Board, State};

/// A drive that does not drive.
pub(super) const AT_REST: &str = "stands";

/// What drives, in words.
pub(super) fn drive_words(board: &Board, state: &State) -> String {
    let driving = state.active(board).filter(|(resource, _)| board.needs_refresh(*resource));
    let driving: Vec<String> = driving.map(|(_, command)| board.show(command).to_string()).collect();
    if driving.is_empty() { AT_REST.to_owned() } else { driving.join(", ") }
}

/// What else is active, and the values of the rest.
pub(super) fn active_words<'b>(board: &'b Board, state: &'b State) -> impl Iterator<Item = String> + 'b {
    let active =
        state.active(board).filter(|(resource, _)| !board.needs_refresh(*resource)).map(|(_, command)| command);
    let still =
        board.resources.iter().enumerate().filter(|(_, resource)| resource.rest.is_none() && resource.is_exclusive);
    let still = still.filter_map(|(resource, _)| state.last(resource));
    active.chain(still).map(|command| board.show(command).to_string())
}
