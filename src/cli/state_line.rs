//! What a board is doing, for a status line.

use motionseq::board::{Board, State};

/// The drive at rest; empty if the board has none.
pub(super) fn at_rest(board: &Board) -> String {
    let has_drive = board.resources.iter().any(|resource| resource.refresh.is_some());
    if has_drive { "stopped".to_owned() } else { String::new() }
}

/// The active drive commands.
pub(super) fn drive_words(board: &Board, state: &State) -> String {
    let driving = state.active(board).filter(|(resource, _)| board.needs_refresh(*resource));
    let driving: Vec<String> = driving.map(|(_, command)| board.show(command).to_string()).collect();
    if driving.is_empty() { at_rest(board) } else { driving.join(", ") }
}

/// The other active commands, and the values of resources that have no rest state.
pub(super) fn active_words<'b>(board: &'b Board, state: &'b State) -> impl Iterator<Item = String> + 'b {
    let active =
        state.active(board).filter(|(resource, _)| !board.needs_refresh(*resource)).map(|(_, command)| command);
    let still =
        board.resources.iter().enumerate().filter(|(_, resource)| resource.rest.is_none() && resource.is_exclusive);
    let still = still.filter_map(|(resource, _)| state.last(resource));
    active.chain(still).map(|command| board.show(command).to_string())
}
