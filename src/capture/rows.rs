//! What a program sent, as lines of a script, and the runs of values that may be moves.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::curve::{Axes, Point};
use super::script_state::{Channel, ScriptState};
use crate::board::{Board, Command, Frame, Hex, Needs, NotACommand, Skip};
use crate::units::Micros;

/// A drive that gets no frame for this time counts as stopped, as on the virtual board. What a real
/// board does when frames stop arriving is unknown.
const REFRESH_TIMEOUT: Micros = Micros::from_millis(500);
/// The maximum interval between two values of a move, and between two changes.
const GAP: Micros = Micros::from_millis(100);
pub(super) const STILL: Micros = Micros::from_millis(300);
/// How many values that repeat the previous one may precede a move.
const LEAD: usize = 64;
/// The most bytes shown of a run that belongs to no frame.
pub(super) const SHOWN: usize = 16;

/// An item of the stream.
#[derive(Clone, Debug)]
pub(super) enum Received {
    Command(Command),
    /// A valid frame that is not a command: its bytes, the raw frame that it is, and the reason.
    Unknown(Vec<u8>, Option<Command>, NotACommand),
    /// Bytes outside of frames: the first of them, their number, and the reason.
    Skipped(Vec<u8>, usize, Skip),
    Note(String),
}

/// A line of the script; without a text if the item changes nothing.
pub(super) struct Row {
    pub(super) at: Micros,
    pub(super) text: Option<String>,
    effect: Effect,
}

/// What a row means for the runs of values.
enum Effect {
    /// A value of a channel, the previous value and its time, and whether they are equal.
    Value(Channel, Axes, Option<(Micros, Axes)>, bool),
    /// All earlier values become unknown.
    Break,
    Other,
}

/// A run of values of one channel that may contain moves.
pub(super) struct Run {
    pub(super) channel: Channel,
    pub(super) before: Option<(Micros, Axes)>,
    pub(super) points: Vec<Point>,
    /// The row of each point.
    pub(super) rows: Vec<usize>,
    /// The times of the last value and of the last change.
    received: Micros,
    changed: Micros,
    /// When something else takes over the channel.
    pub(super) until: Micros,
}

/// Converts items to rows; `state` is what the script has set so far. Everything up to `now` has
/// been received.
pub(super) fn rows(
    state: &mut ScriptState,
    waiting: &[(Micros, Received)],
    exact: bool,
    now: Micros,
    is_last: bool,
) -> Vec<Row> {
    let mut rows = Vec::with_capacity(waiting.len());
    for (at, received) in waiting {
        stop_refreshing(state, &mut rows, exact, *at);
        let (text, effect) = row(state, received, exact, *at);
        rows.push(Row { at: *at, text, effect });
    }
    stop_refreshing(state, &mut rows, exact, now);
    // Stop refreshed resources at the end. The script would otherwise end at its last other line.
    if is_last && !exact {
        for (resource, refreshed, rest) in state.refreshed() {
            let text = Some(format!("{}  # the recording ends here", state.board.show(&rest)));
            rows.push(Row { at: now.max(refreshed + Micros::from_millis(1)), text, effect: Effect::Break });
            state.stop_refreshing(resource);
        }
    }
    rows
}

/// Stops resources that get no more frames. The script would refresh them, but the program did not.
fn stop_refreshing(state: &mut ScriptState, rows: &mut Vec<Row>, exact: bool, now: Micros) {
    if exact {
        return;
    }
    for (_, refreshed, rest) in state.refreshed() {
        let stopped = refreshed + REFRESH_TIMEOUT;
        if stopped < now {
            let text = format!("{}  # no drive frame for {REFRESH_TIMEOUT}s", state.board.show(&rest));
            rows.push(Row { at: stopped, text: Some(text), effect: Effect::Break });
            state.set(stopped, &rest);
        }
    }
}

fn row(state: &mut ScriptState, received: &Received, exact: bool, at: Micros) -> (Option<String>, Effect) {
    let board = Arc::clone(&state.board);
    let command = match received {
        Received::Note(words) => return (Some(format!("# {words}")), Effect::Break),
        Received::Skipped(first, count, why) => {
            let more = if *count > first.len() { " …" } else { "" };
            return (Some(format!("# skipped {count}, {}{more}: {why}", Hex(first))), Effect::Other);
        }
        Received::Unknown(frame, raw, why) => {
            return match raw.as_ref().filter(|_| exact || !matches!(why, NotACommand::OutOfRange(_))) {
                None => (Some(format!("# left out, {}: {why}", Hex(frame))), Effect::Other),
                Some(raw) => {
                    state.raw(raw);
                    (Some(format!("{}  # {why}", board.show(raw))), Effect::Break)
                }
            };
        }
        Received::Command(command) => command,
    };
    let said = board.show(command).to_string();
    if let Some((channel, axes)) = Channel::of(&board, command) {
        let before = state.value(channel);
        let repeats = !exact && state.repeats(channel, axes);
        state.set(at, command);
        return ((!repeats).then_some(said), Effect::Value(channel, axes, before, repeats));
    }
    if board.is_opaque(command) {
        state.raw(command);
        return (Some(said), Effect::Break);
    }
    let occupied = board.occupies(command);
    if board.is_passing(command) {
        for resource in occupied {
            state.forget(*resource);
        }
        let is_met =
            |needs: &&Needs| state.command(needs.resource).and_then(|command| command.value(0)) == Some(needs.value);
        if let Some(needs) = board.needs(command).filter(|needs| !is_met(needs))
            && let Some(raw) = board.raw(&board.to_frame(command))
        {
            // The script must satisfy the precondition first, so send the frame as `raw`.
            state.has_raw = true;
            let raw = board.show(&raw);
            return (Some(format!("{raw}  # {said}, with no `{}` before it", needs.what)), Effect::Break);
        }
        return (Some(said), Effect::Break);
    }
    let has_rest = |resource: &usize| board.rest(*resource).is_some() && state.command(*resource) == Some(command);
    if !exact && occupied.iter().any(has_rest) {
        return (None, Effect::Other);
    }
    state.set(at, command);
    (Some(said), Effect::Other)
}

/// Ends a run: something else moves its channel from this time on.
fn end(runs: &mut [Run], run: usize, at: Micros) {
    if let Some(run) = runs.get_mut(run) {
        run.until = at;
    }
}

/// Finds the runs of values in rows.
pub(super) fn runs(board: &Board, rows: &[Row]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    // The last repeats of each channel's value, with their rows.
    let mut repeats_of: BTreeMap<Channel, Vec<(usize, Point)>> = BTreeMap::new();
    let mut open: BTreeMap<Channel, usize> = BTreeMap::new();
    for (place, Row { at, effect, .. }) in rows.iter().enumerate() {
        let (channel, axes, before, repeats) = match effect {
            Effect::Other => continue,
            Effect::Break => {
                for run in std::mem::take(&mut open).into_values() {
                    end(&mut runs, run, *at);
                }
                repeats_of.clear();
                continue;
            }
            Effect::Value(channel, axes, before, repeats) => (*channel, *axes, *before, *repeats),
        };
        open.retain(|other, run| {
            let stays = *other == channel || !other.meets(board, channel);
            if !stays {
                end(&mut runs, *run, *at);
            }
            stays
        });
        repeats_of.retain(|other, _| *other == channel || !other.meets(board, channel));
        let point = Point { at: *at, axes, repeats };
        let run = open.get(&channel).and_then(|run| runs.get_mut(*run));
        let continues = |run: &&mut Run| *at <= run.received + GAP && *at <= run.changed + STILL;
        if let Some(run) = run.filter(continues) {
            run.points.push(point);
            run.rows.push(place);
            run.received = *at;
            run.changed = if repeats { run.changed } else { *at };
            continue;
        }
        let repeats_of = repeats_of.entry(channel).or_default();
        if let Some(run) = open.remove(&channel) {
            end(&mut runs, run, *at);
            // The run may end with repeats.
            if let Some(run) = runs.get(run) {
                let repeats = run.points.iter().rev().take_while(|point| point.repeats).count();
                let from = run.points.len() - repeats;
                repeats_of.extend(run.rows.iter().copied().zip(run.points.iter().copied()).skip(from));
            }
        }
        if repeats {
            repeats_of.push((place, point));
            continue;
        }
        let lead = std::mem::take(repeats_of);
        let far = lead.len().saturating_sub(LEAD);
        let (rows, points) = lead.into_iter().skip(far).chain([(place, point)]).unzip();
        open.insert(channel, runs.len());
        runs.push(Run { channel, before, points, rows, received: *at, changed: *at, until: Micros::MAX });
    }
    runs
}

pub(super) fn of_frame(board: &Board, frame: Frame<'_>) -> Received {
    match board.decode(frame.bytes()) {
        Ok(command) => Received::Command(command),
        Err(why) => Received::Unknown(frame.bytes().to_vec(), board.raw(frame.bytes()), why),
    }
}
