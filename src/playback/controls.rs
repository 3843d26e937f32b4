//! What signals and keys mean for a run.

use super::messages::{Input, SIGTSTP};
use super::os::Keys;

/// What a signal means: Ctrl-Z suspends only if a key can continue the run.
pub(super) fn of_signal(signal: i32, has_keys: bool) -> Input {
    if signal == SIGTSTP && has_keys { Input::Suspend } else { Input::Signal(signal) }
}

/// What a key means.
pub(super) fn of_key(key: u8, keys: &Keys, is_paused: bool, waits_for_go: bool) -> Input {
    let enter = if keys.enter_steps { Input::Step } else { Input::Resume };
    match (key, is_paused) {
        // A line of input counts only during a pause.
        (b'\n' | b'\r', true) => enter,
        (b'\n' | b'\r' | b'g', false) if waits_for_go => Input::Go,
        _ if !keys.is_single() => Input::Tick,
        (b' ', true) => Input::Resume,
        (b' ', false) => Input::Pause,
        (b's', true) => Input::Step,
        (b'q', _) => Input::Quit,
        (b'?', _) => Input::Help,
        _ => Input::Tick,
    }
}
