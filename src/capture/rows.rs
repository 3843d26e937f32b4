//! What a program sends, line by line, and the runs of values in which moves are looked for.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::curve::{Axes, Point};
use super::known::{Known, Thing};
use crate::board::{Board, Command, Frame, Hex, Needs, NotACommand, Skip};

/// Without a drive frame for so long, in microseconds, a drive counts as stopped, as on the virtual board. What the board does when frames
/// stop is unknown.
const FED_US: u64 = 500_000;
/// A move has a value at least so often, in microseconds, and one that changes at least so often.
const GAP_US: u64 = 100_000;
pub(super) const STILL_US: u64 = 300_000;
/// How many values that repeat the one before are looked at where a move may begin.
const LEAD: usize = 64;
/// The most bytes of a run that are shown where they belong to no frame.
pub(super) const SHOWN: usize = 16;

/// What has come, at a time.
#[derive(Clone, Debug)]
pub(super) enum Came {
    Command(Command),
    /// A whole frame that says nothing the board knows, as it is and as the verb that sends any frame, and why.
    Unknown(Vec<u8>, Option<Command>, NotACommand),
    /// Bytes that are no frame: the first of them, and how many.
    Skipped(Vec<u8>, usize, Skip),
    Note(String),
}

/// A line of the script, or none where what came says nothing new.
pub(super) struct Row {
    pub(super) at_us: u64,
    pub(super) text: Option<String>,
    says: Says,
}

/// What a row means for the runs of values.
enum Says {
    /// A value of a thing, what it had before and since when, and whether that is the same.
    Value(Thing, Axes, Option<(u64, Axes)>, bool),
    /// Nothing that was known before holds on.
    Break,
    Other,
}

/// A run of values of one thing, in which moves are looked for.
pub(super) struct Run {
    pub(super) thing: Thing,
    pub(super) before: Option<(u64, Axes)>,
    pub(super) points: Vec<Point>,
    /// The row of each point.
    pub(super) rows: Vec<usize>,
    /// When a value came last, and when one that changed.
    came_us: u64,
    changed_us: u64,
    /// When something else takes its thing over, in microseconds.
    pub(super) until_us: u64,
}

/// What came, as lines; `known` is what the script has said then. The time is that up to which everything has come.
pub(super) fn rows(known: &mut Known, waiting: &[(u64, Came)], exact: bool, now_us: u64, is_last: bool) -> Vec<Row> {
    let mut rows = Vec::with_capacity(waiting.len());
    for (at_us, came) in waiting {
        starve(known, &mut rows, exact, *at_us);
        let (text, says) = row(known, came, exact, *at_us);
        rows.push(Row { at_us: *at_us, text, says });
    }
    starve(known, &mut rows, exact, now_us);
    // What was fed until now stops with the script, which would otherwise end where it was last told something else.
    if is_last && !exact {
        for (resource, fed_us, rest) in known.fed() {
            let text = Some(format!("{}  # the recording ends here", known.board.show(&rest)));
            rows.push(Row { at_us: now_us.max(fed_us + 1_000), text, says: Says::Break });
            known.starve(resource);
        }
    }
    rows
}

/// Stops what got no frames until now: played, the script would feed it, and the program did not.
fn starve(known: &mut Known, rows: &mut Vec<Row>, exact: bool, now_us: u64) {
    if exact {
        return;
    }
    for (_, fed_us, rest) in known.fed() {
        let stopped_us = fed_us.saturating_add(FED_US);
        if stopped_us < now_us {
            let text = format!("{}  # no drive frame came for {}", known.board.show(&rest), Time(FED_US));
            rows.push(Row { at_us: stopped_us, text: Some(text), says: Says::Break });
            known.set(stopped_us, &rest);
        }
    }
}

fn row(known: &mut Known, came: &Came, exact: bool, at_us: u64) -> (Option<String>, Says) {
    let board = Arc::clone(&known.board);
    let command = match came {
        Came::Note(words) => return (Some(format!("# {words}")), Says::Break),
        Came::Skipped(first, count, why) => {
            let more = if *count > first.len() { " …" } else { "" };
            return (Some(format!("# skipped {count}, {}{more}: {why}", Hex(first))), Says::Other);
        }
        Came::Unknown(frame, raw, why) => {
            return match raw.as_ref().filter(|_| exact || !matches!(why, NotACommand::OutOfRange(_))) {
                None => (Some(format!("# left out, {}: {why}", Hex(frame))), Says::Other),
                Some(raw) => {
                    known.raw(raw);
                    (Some(format!("{}  # {why}", board.show(raw))), Says::Break)
                }
            };
        }
        Came::Command(command) => command,
    };
    let said = board.show(command).to_string();
    if let Some((thing, axes)) = Thing::of(&board, command) {
        let before = known.value(thing);
        let repeats = !exact && known.repeats(thing, axes);
        known.set(at_us, command);
        return ((!repeats).then_some(said), Says::Value(thing, axes, before, repeats));
    }
    if board.is_opaque(command) {
        known.raw(command);
        return (Some(said), Says::Break);
    }
    let occupied = board.occupies(command);
    if board.is_passing(command) {
        for resource in occupied {
            known.forget(*resource);
        }
        let is_met =
            |needs: &&Needs| known.command(needs.resource).and_then(|command| command.value(0)) == Some(needs.value);
        if let Some(needs) = board.needs(command).filter(|needs| !is_met(needs))
            && let Some(raw) = board.raw(&board.to_frame(command))
        {
            // A script must say first what it needs.
            known.has_raw = true;
            let raw = board.show(&raw);
            return (Some(format!("{raw}  # {said}, with no `{}` before it", needs.what)), Says::Break);
        }
        return (Some(said), Says::Break);
    }
    let has_rest = |resource: &usize| board.rest(*resource).is_some() && known.command(*resource) == Some(command);
    if !exact && occupied.iter().any(has_rest) {
        return (None, Says::Other);
    }
    known.set(at_us, command);
    (Some(said), Says::Other)
}

/// From a moment on, the thing of a run is moved by something else.
fn end(runs: &mut [Run], run: usize, at_us: u64) {
    if let Some(run) = runs.get_mut(run) {
        run.until_us = at_us;
    }
}

/// The runs of values in rows.
pub(super) fn runs(board: &Board, rows: &[Row]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    // The last values of each thing that repeat what it had, with their rows.
    let mut still: BTreeMap<Thing, Vec<(usize, Point)>> = BTreeMap::new();
    let mut open: BTreeMap<Thing, usize> = BTreeMap::new();
    for (at, Row { at_us, says, .. }) in rows.iter().enumerate() {
        let (thing, axes, before, repeats) = match says {
            Says::Other => continue,
            Says::Break => {
                for run in std::mem::take(&mut open).into_values() {
                    end(&mut runs, run, *at_us);
                }
                still.clear();
                continue;
            }
            Says::Value(thing, axes, before, repeats) => (*thing, *axes, *before, *repeats),
        };
        open.retain(|other, run| {
            let stays = *other == thing || !other.meets(board, thing);
            if !stays {
                end(&mut runs, *run, *at_us);
            }
            stays
        });
        still.retain(|other, _| *other == thing || !other.meets(board, thing));
        let point = Point { at_us: *at_us, axes, repeats };
        let run = open.get(&thing).and_then(|run| runs.get_mut(*run));
        let goes_on = |run: &&mut Run| *at_us <= run.came_us + GAP_US && *at_us <= run.changed_us + STILL_US;
        if let Some(run) = run.filter(goes_on) {
            run.points.push(point);
            run.rows.push(at);
            run.came_us = *at_us;
            run.changed_us = if repeats { run.changed_us } else { *at_us };
            continue;
        }
        let still = still.entry(thing).or_default();
        if let Some(run) = open.remove(&thing) {
            end(&mut runs, run, *at_us);
            // It may have stood still at its end.
            if let Some(run) = runs.get(run) {
                let repeats = run.points.iter().rev().take_while(|point| point.repeats).count();
                let from = run.points.len() - repeats;
                still.extend(run.rows.iter().copied().zip(run.points.iter().copied()).skip(from));
            }
        }
        if repeats {
            still.push((at, point));
            continue;
        }
        let lead = std::mem::take(still);
        let far = lead.len().saturating_sub(LEAD);
        let (rows, points) = lead.into_iter().skip(far).chain([(at, point)]).unzip();
        open.insert(thing, runs.len());
        runs.push(Run { thing, before, points, rows, came_us: *at_us, changed_us: *at_us, until_us: u64::MAX });
    }
    runs
}

pub(super) fn of_frame(board: &Board, frame: Frame<'_>) -> Came {
    match board.decode(frame.bytes()) {
        Ok(command) => Came::Command(command),
        Err(why) => Came::Unknown(frame.bytes().to_vec(), board.raw(frame.bytes()), why),
    }
}

/// Microseconds, as a script writes them.
pub(super) struct Time(pub(super) u64);

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, micros) = (self.0 / 1_000_000, self.0 % 1_000_000);
        if micros == 0 {
            return write!(f, "{seconds}s");
        }
        let digits = format!("{micros:06}");
        write!(f, "{seconds}.{}s", digits.trim_end_matches('0'))
    }
}
