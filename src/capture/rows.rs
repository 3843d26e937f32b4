//! What a program sent, as lines of a script, and the runs of values that may be moves.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::curve::{Axes, Point};
use super::layout::Line;
use super::script_state::{Channel, ScriptState};
use crate::board::{Board, Command, Frame, Hex, Needs, NotACommand, Skip};
use crate::units::Micros;

/// A drive that gets no frame for this time has a silence, which the script mentions. A drive that
/// a program leaves on when it closes its port is stopped after this time.
const SILENCE: Micros = Micros::from_millis(500);
/// The maximum interval between two changes of a value in a move.
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
    /// Bytes outside of frames.
    Skipped(Skipped),
    Note(String),
    /// The program closed its port.
    Closed,
}

/// A run of bytes outside of frames.
#[derive(Clone, Debug)]
pub(super) struct Skipped {
    /// The first of them, and their number.
    first: Vec<u8>,
    count: usize,
    /// The reason for the first of them, and whether it applies to all.
    why: Skip,
    is_uniform: bool,
}

impl Received {
    /// What is sent.
    pub(super) fn command(&self) -> Option<&Command> {
        match self {
            Received::Command(command) | Received::Unknown(_, Some(command), _) => Some(command),
            _ => None,
        }
    }
}

impl Skipped {
    pub(super) fn new(bytes: &[u8], why: Skip) -> Self {
        let mut skipped = Skipped { first: Vec::new(), count: 0, why, is_uniform: true };
        skipped.extend(bytes, why);
        skipped
    }

    pub(super) fn extend(&mut self, bytes: &[u8], why: Skip) {
        self.first.extend(bytes.iter().take(SHOWN.saturating_sub(self.first.len())));
        self.count += bytes.len();
        self.is_uniform &= why == self.why;
    }

    fn words(&self) -> String {
        let Skipped { first, count, why, is_uniform } = self;
        let more = if *count > first.len() { " …" } else { "" };
        let others = if *is_uniform { "" } else { ", and other reasons" };
        format!("skipped {count}, {}{more}: {why}{others}", Hex(first))
    }
}

/// A line of the script; `None` if the item changes nothing.
pub(super) struct Row {
    pub(super) at: Micros,
    pub(super) line: Option<Line>,
    effect: Effect,
}

/// What a row means for the runs of values.
enum Effect {
    /// A value of a channel, the previous value and its time, and whether they are equal.
    Value(Channel, Axes, Option<(Micros, Axes)>, bool),
    /// All earlier values become unknown.
    Break,
    /// The values of the resources of this command end.
    Ends(Command),
    Other,
}

/// A run of values of one channel that may contain moves.
pub(super) struct Run {
    pub(super) channel: Channel,
    pub(super) before: Option<(Micros, Axes)>,
    pub(super) points: Vec<Point>,
    /// The row of each point.
    pub(super) rows: Vec<usize>,
    /// The time of the last change.
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
        if !exact {
            stop_abandoned(state, &mut rows, *at);
            silence(state, received, &mut rows, *at);
        }
        let (line, effect) = row(state, received, exact, *at);
        rows.push(Row { at: *at, line, effect });
    }
    if !exact {
        stop_abandoned(state, &mut rows, now);
    }
    // Stop refreshed resources at the end. The script would otherwise end at its last other line.
    if is_last && !exact {
        for (resource, refreshed, rest) in state.refreshed() {
            rows.push(stop(state, now.max(refreshed + Micros::from_millis(1)), &rest, "the recording ends here"));
            state.stop_refreshing(resource);
        }
    }
    rows
}

/// A row that brings a resource to rest, which the program did not do.
fn stop(state: &ScriptState, at: Micros, rest: &Command, why: &str) -> Row {
    let line = Line::command(&state.board, at, rest.clone()).with_remark(why);
    Row { at, line: Some(line), effect: Effect::Break }
}

/// Stops resources that were active when the program closed its port, unless it continues soon.
fn stop_abandoned(state: &mut ScriptState, rows: &mut Vec<Row>, now: Micros) {
    let Some(stopped) = state.closed.map(|closed| closed + SILENCE).filter(|stopped| *stopped < now) else { return };
    for (_, refreshed, rest) in state.refreshed() {
        if state.closed.is_some_and(|closed| refreshed <= closed) {
            rows.push(stop(state, stopped, &rest, "the program has closed its port"));
            state.set(stopped, &rest);
        }
    }
}

/// Mentions that an active resource got no frame for some time before this one. What a board does
/// then is unknown, so the script keeps it active. A silence much longer than those before is
/// mentioned again.
fn silence(state: &mut ScriptState, received: &Received, rows: &mut Vec<Row>, at: Micros) {
    let Received::Command(command) = received else { return };
    let touched = state.board.touches(command);
    let silent = state.refreshed().into_iter().filter(|(resource, ..)| touched.contains(resource));
    let Some(longest) = silent.map(|(_, refreshed, _)| at - refreshed).max() else { return };
    if longest > SILENCE && longest > state.longest_silence * 2 {
        state.longest_silence = longest;
        let words = format!(
            "no drive frame for {longest}s before this line: what the board does then is unknown; this script keeps driving"
        );
        rows.push(Row { at, line: Some(Line::comment(at, words)), effect: Effect::Other });
    }
}

fn row(state: &mut ScriptState, received: &Received, exact: bool, at: Micros) -> (Option<Line>, Effect) {
    let board = Arc::clone(&state.board);
    let comment = |words: String| Some(Line::comment(at, format!("{at}s: {words}")));
    let line = |command: &Command| Line::command(&board, at, command.clone());
    let command = match received {
        Received::Note(words) => return (comment(words.clone()), Effect::Break),
        Received::Closed => {
            state.closed = Some(at);
            return (None, Effect::Break);
        }
        Received::Skipped(skipped) => return (comment(skipped.words()), Effect::Other),
        Received::Unknown(frame, raw, why) => {
            return match raw.as_ref().filter(|_| exact || !matches!(why, NotACommand::OutOfRange(_))) {
                None => (comment(format!("left out, {}: {why}", Hex(frame))), Effect::Other),
                Some(raw) => {
                    state.raw(raw);
                    (Some(line(raw).with_remark(&why.to_string())), Effect::Break)
                }
            };
        }
        Received::Command(command) => command,
    };
    if board.verb(command.verb()).is_some_and(|verb| !verb.is_in_scripts()) {
        return hidden(state, command, exact, comment);
    }
    if let Some(why) = forbidden(state, command) {
        return (comment(format!("left out, {}: {why}", board.show(command))), Effect::Other);
    }
    if let Some((channel, axes)) = Channel::of(&board, command) {
        let before = state.value(channel);
        let repeats = !exact && state.repeats(channel, axes);
        state.set(at, command);
        return ((!repeats).then(|| line(command)), Effect::Value(channel, axes, before, repeats));
    }
    if board.is_opaque(command) {
        state.raw(command);
        return (Some(line(command)), Effect::Break);
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
            let why = format!("{}, with no `{}` before it", board.show(command), needs.what);
            return (Some(line(&raw).with_remark(&why)), Effect::Break);
        }
        return (Some(line(command)), Effect::Break);
    }
    let has_rest = |resource: &usize| board.rest(*resource).is_some() && state.command(*resource) == Some(command);
    if !exact && occupied.iter().any(has_rest) {
        return (None, Effect::Other);
    }
    state.set(at, command);
    (Some(line(command)), Effect::Ends(command.clone()))
}

/// Why the last command of its resource does not permit a command.
fn forbidden(state: &ScriptState, command: &Command) -> Option<String> {
    let board = &state.board;
    let forbidden = board.verb(command.verb())?.forbidden.as_ref()?;
    let is_after = |last: &Command| (last.verb(), last.value(1)) == (forbidden.after, Some(forbidden.value));
    let is_forbidden = board.occupies(command).iter().any(|resource| state.command(*resource).is_some_and(is_after));
    let index = command.value(0).map(|index| index.to_string()).unwrap_or_default();
    is_forbidden.then(|| forbidden.message.replace("{}", &index))
}

/// The row of a command that no script contains.
fn hidden(
    state: &mut ScriptState,
    command: &Command,
    exact: bool,
    comment: impl Fn(String) -> Option<Line>,
) -> (Option<Line>, Effect) {
    let board = Arc::clone(&state.board);
    for resource in board.occupies(command) {
        state.forget(*resource);
    }
    // The script of the recording sends its own hello, and asks by itself.
    let requests = board.quantities.iter().filter_map(|quantity| quantity.request.as_ref());
    let asks = board.verb(command.verb()).is_some_and(|verb| verb.asks);
    let by_itself = asks || board.hello.iter().chain(&board.goodbye).chain(requests).any(|other| other == command);
    let words = format!("left out, {}: {}", Hex(&board.to_frame(command)), board.show(command));
    let effect = if board.occupies(command).is_empty() { Effect::Other } else { Effect::Break };
    (comment(words).filter(|_| exact || !by_itself), effect)
}

/// Ends a run: something else moves its channel from this time on.
fn end(runs: &mut [Run], run: usize, at: Micros) {
    if let Some(run) = runs.get_mut(run) {
        run.until = at;
    }
}

/// Ends the runs of the channels that do not stay.
fn end_runs(open: &mut BTreeMap<Channel, usize>, runs: &mut [Run], at: Micros, stays: impl Fn(&Channel) -> bool) {
    open.retain(|channel, run| {
        let stays = stays(channel);
        if !stays {
            end(runs, *run, at);
        }
        stays
    });
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
            Effect::Ends(command) => {
                let taken = board.occupies(command);
                let is_free =
                    |channel: &Channel| !channel.resources(board).iter().any(|resource| taken.contains(resource));
                end_runs(&mut open, &mut runs, *at, is_free);
                repeats_of.retain(|channel, _| is_free(channel));
                continue;
            }
            Effect::Break => {
                end_runs(&mut open, &mut runs, *at, |_| false);
                repeats_of.clear();
                continue;
            }
            Effect::Value(channel, axes, before, repeats) => (*channel, *axes, *before, *repeats),
        };
        let stays = |other: &Channel| *other == channel || !other.meets(board, channel);
        end_runs(&mut open, &mut runs, *at, stays);
        repeats_of.retain(|other, _| stays(other));
        let point = Point { at: *at, axes, repeats };
        let run = open.get(&channel).and_then(|run| runs.get_mut(*run));
        let continues = |run: &&mut Run| *at <= run.changed + STILL;
        if let Some(run) = run.filter(continues) {
            run.points.push(point);
            run.rows.push(place);
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
        runs.push(Run { channel, before, points, rows, changed: *at, until: Micros::MAX });
    }
    runs
}

/// What a script contains for a frame, which may be several commands.
pub(super) fn of_frame(board: &Board, frame: Frame<'_>) -> Vec<Received> {
    match board.decode(frame.bytes()) {
        Ok(command) => board.in_script(command).into_iter().map(Received::Command).collect(),
        Err(why) => vec![Received::Unknown(frame.bytes().to_vec(), board.raw(frame.bytes()), why)],
    }
}
