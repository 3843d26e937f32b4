//! What a program sends, line by line, and the runs of values in which moves are looked for.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::curve::{Axes, Point};
use super::script_state::{ScriptState, Channel};
use crate::board::{Board, Command, Frame, Hex, Needs, NotACommand, Skip};
use crate::units::Micros;

/// Without a drive frame for so long a drive counts as stopped, as on the virtual board. What the board does when frames
/// stop is unknown.
const REFRESH_TIMEOUT: Micros = Micros::from_millis(500);
/// A move has a value at least so often, and one that changes at least so often.
const GAP: Micros = Micros::from_millis(100);
pub(super) const STILL: Micros = Micros::from_millis(300);
/// How many values that repeat the one before are looked at where a move may begin.
const LEAD: usize = 64;
/// The most bytes of a run that are shown where they belong to no frame.
pub(super) const SHOWN: usize = 16;

/// What has come, at a time.
#[derive(Clone, Debug)]
pub(super) enum Received {
    Command(Command),
    /// A whole frame that effect nothing the board knows, as it is and as the verb that sends any frame, and why.
    Unknown(Vec<u8>, Option<Command>, NotACommand),
    /// Bytes that are no frame: the first of them, and how many.
    Skipped(Vec<u8>, usize, Skip),
    Note(String),
}

/// A line of the script, or none where what received effect nothing new.
pub(super) struct Row {
    pub(super) at: Micros,
    pub(super) text: Option<String>,
    effect: Effect,
}

/// What a row means for the runs of values.
enum Effect {
    /// A value of a channel, what it had before and since when, and whether that is the same.
    Value(Channel, Axes, Option<(Micros, Axes)>, bool),
    /// Nothing that was state before holds on.
    Break,
    Other,
}

/// A run of values of one channel, in which moves are looked for.
pub(super) struct Run {
    pub(super) channel: Channel,
    pub(super) before: Option<(Micros, Axes)>,
    pub(super) points: Vec<Point>,
    /// The row of each point.
    pub(super) rows: Vec<usize>,
    /// When a value received last, and when one that changed.
    received: Micros,
    changed: Micros,
    /// When something else takes its channel over.
    pub(super) until: Micros,
}

/// What received, as lines; `state` is what the script has said then. The time is that up to which everything has come.
pub(super) fn rows(state: &mut ScriptState, waiting: &[(Micros, Received)], exact: bool, now: Micros, is_last: bool) -> Vec<Row> {
    let mut rows = Vec::with_capacity(waiting.len());
    for (at, received) in waiting {
        stop_refreshing(state, &mut rows, exact, *at);
        let (text, effect) = row(state, received, exact, *at);
        rows.push(Row { at: *at, text, effect });
    }
    stop_refreshing(state, &mut rows, exact, now);
    // What was refreshed until now stops with the script, which would otherwise end where it was last told something else.
    if is_last && !exact {
        for (resource, refreshed, rest) in state.refreshed() {
            let text = Some(format!("{}  # the recording ends here", state.board.show(&rest)));
            rows.push(Row { at: now.max(refreshed + Micros::from_millis(1)), text, effect: Effect::Break });
            state.stop_refreshing(resource);
        }
    }
    rows
}

/// Stops what got no frames until now: played, the script would feed it, and the program did not.
fn stop_refreshing(state: &mut ScriptState, rows: &mut Vec<Row>, exact: bool, now: Micros) {
    if exact {
        return;
    }
    for (_, refreshed, rest) in state.refreshed() {
        let stopped = refreshed + REFRESH_TIMEOUT;
        if stopped < now {
            let text = format!("{}  # no drive frame received for {REFRESH_TIMEOUT}s", state.board.show(&rest));
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
            // A script must say first what it needs.
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

/// From a moment on, the channel of a run is moved by something else.
fn end(runs: &mut [Run], run: usize, at: Micros) {
    if let Some(run) = runs.get_mut(run) {
        run.until = at;
    }
}

/// The runs of values in rows.
pub(super) fn runs(board: &Board, rows: &[Row]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    // The last values of each channel that repeat what it had, with their rows.
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
            // It may have stood repeats_of at its end.
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
