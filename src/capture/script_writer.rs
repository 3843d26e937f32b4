//! Writes what a program sends as a script.

use std::fmt::Write as _;
use std::sync::Arc;

use super::curve::MoveLimits;
use super::layout::{Layout, Line, duration};
use super::move_search::{EasingTable, PointSeries};
use super::rows::{Received, Row, Run, STILL, Skipped, of_frame, rows, runs};
use super::script_clock::ScriptClock;
use super::script_state::{Channel, ScriptState};
use crate::board::{Board, Command, DefaultLimit, FAMILIES, Item};
use crate::program::Ease;
use crate::units::Micros;

/// A line of this speed, in bits per second, carries the samples of all moves at once: less than
/// 2,500 bytes per second.
const AMPLE: u32 = 38_400;

/// The start of the line that chooses the board. It comes after the first line, which is a comment,
/// and before all settings.
pub(super) const BOARD: &str = "board ";

/// The most items that wait to be written.
const WAITING: usize = 2048;

/// Converts frames and their times to a script. Settled text does not change: the script only
/// grows.
///
/// In exact mode, every frame is sent at its time. Otherwise, times are rounded to milliseconds,
/// repeats that a hold covers are left out, a command and its end are one line, and a run of values
/// that follows an easing is one line.
pub struct ScriptWriter {
    exact: bool,
    easings: EasingTable,
    /// The header, until it is settled.
    header: String,
    clock: ScriptClock,
    layout: Layout,
    waiting: Vec<(Micros, Received)>,
    /// The last run of bytes outside of frames, with its time.
    skipped: Option<(Micros, Skipped)>,
    state: ScriptState,
    frames: u64,
    /// The time of the last line.
    settled: Micros,
    bounds: Bounds,
    /// Whether the line may be too slow for the samples of moves.
    saves_frames: bool,
}

/// The note in the header about default limits, and the `limit` lines that replace it if commands
/// exceed them. Both have the same length, so that they can be replaced in a growing file.
struct Bounds {
    /// The position of the note, in bytes from the start.
    at: usize,
    note: String,
    /// The line for each default limit, and whether a command exceeds it.
    lines: Vec<String>,
    wide: Vec<bool>,
    /// Whether the header was already returned.
    is_settled: bool,
    /// Whether the caller must replace the note.
    is_amended: bool,
}

impl Bounds {
    /// `sign` begins the note, if it does not follow a comment.
    fn new(board: &Board, at: usize, sign: &str) -> Self {
        let most = |limit: &DefaultLimit| board.axis(limit.limited).map_or(0.0, |axis| axis.shown(limit.range.1));
        let mut note = match board.limits.as_slice() {
            [] => String::new(),
            [limit] => format!("{sign} {} is at most {}", capitalized(&board.limited_name(limit.limited)), most(limit)),
            [limit, ..] => {
                let word = board.verb(limit.limited.verb).map(|verb| verb.word.to_string()).unwrap_or_default();
                format!("{sign} Every {word} is at most {}", most(limit))
            }
        };
        let line = |limit: &DefaultLimit| {
            let range = board.range(limit.limited).unwrap_or(limit.range);
            let shown = |value| board.axis(limit.limited).map_or(0.0, |axis| axis.shown(value));
            let (least, most) = (shown(range.0), shown(range.1));
            format!("\nlimit {} {least}..{most}", board.limited_name(limit.limited))
        };
        let lines: Vec<String> = board.limits.iter().map(line).collect();
        let length = note.len().max(lines.iter().map(String::len).sum());
        note.extend(std::iter::repeat_n(' ', length - note.len()));
        Bounds { at, note, wide: vec![false; lines.len()], lines, is_settled: false, is_amended: false }
    }

    /// What replaces the note.
    fn text(&self) -> String {
        if !self.wide.contains(&true) {
            return self.note.clone();
        }
        let wide = self.lines.iter().zip(&self.wide).filter(|(_, is_wide)| **is_wide);
        let mut text: String = wide.map(|(line, _)| line.as_str()).collect();
        text.extend(std::iter::repeat_n(' ', self.note.len().saturating_sub(text.len())));
        text
    }
}

fn capitalized(name: &str) -> String {
    let mut letters = name.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    first + letters.as_str()
}

impl ScriptWriter {
    /// A script without lines; `exact` keeps every frame. `baud` is the speed of the line in bits
    /// per second.
    pub fn new(board: Arc<Board>, exact: bool, baud: u32) -> Self {
        let mut text = format!("# Recorded by motionseq {}", env!("CARGO_PKG_VERSION"));
        text += if exact {
            ": every frame at its time."
        } else {
            ". Repeated commands are left out, and values that follow an easing are one move."
        };
        let is_usual = FAMILIES.first().is_some_and(|family| family.word == board.line);
        if !is_usual {
            let _ = write!(text, "\n{BOARD}{}", board.line);
        }
        let bounds = Bounds::new(&board, text.len(), if is_usual { "" } else { " #" });
        text = text + &bounds.note + if exact { "\nrefresh off\n" } else { "\n" };
        if baud != board.baud {
            let _ = writeln!(text, "baud {baud}");
        }
        text.push('\n');
        ScriptWriter {
            exact,
            easings: EasingTable::new(),
            header: text,
            clock: ScriptClock::new(Arc::clone(&board), exact, baud),
            layout: Layout::new(Arc::clone(&board), exact),
            waiting: Vec::new(),
            skipped: None,
            state: ScriptState::new(board),
            frames: 0,
            settled: Micros::ZERO,
            bounds,
            saves_frames: baud < AMPLE,
        }
    }

    /// Never send more frames than were received: the line may be slow.
    pub(super) fn save_line(&mut self) {
        self.saves_frames = true;
    }

    /// Widens all default limits, for a header that cannot be replaced later.
    pub fn widen_all(&mut self) {
        self.bounds.wide.fill(true);
        let at = self.bounds.at;
        self.header.replace_range(at..at + self.bounds.note.len(), &self.bounds.text());
    }

    /// Widens the default limits that a command exceeds to the ranges of the board.
    pub fn widen(&mut self, command: &Command) {
        let board = &self.state.board;
        let exceeds = |limit: &DefaultLimit| {
            let (least, most) = limit.range;
            board.outside(limit.limited, (least.into(), most.into()), command).is_some()
        };
        let mut is_new = false;
        for (limit, is_wide) in board.limits.iter().zip(&mut self.bounds.wide) {
            if !*is_wide && exceeds(limit) {
                (*is_wide, is_new) = (true, true);
            }
        }
        if is_new && self.bounds.is_settled {
            self.bounds.is_amended = true;
        } else if is_new {
            let at = self.bounds.at;
            self.header.replace_range(at..at + self.bounds.note.len(), &self.bounds.text());
        }
    }

    /// A replacement in the settled text, if there is one: its position in bytes from the start,
    /// and the new text of the same length.
    pub fn amendment(&mut self) -> Option<(usize, String)> {
        std::mem::take(&mut self.bounds.is_amended).then(|| (self.bounds.at, self.bounds.text()))
    }

    /// Adds an item of a decoder with its start time. Times must not decrease.
    pub fn take(&mut self, at: Micros, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                self.frames += 1;
                let mut length = frame.bytes().len();
                for received in of_frame(&self.state.board, frame) {
                    if let Received::Command(command) = &received {
                        self.widen(command);
                    }
                    let at = self.clock.frame(at, received.command(), std::mem::take(&mut length));
                    self.push(at, received);
                }
            }
            // They are part of a stop and have no meaning on their own.
            Item::Skipped { why, .. } if !why.is_wrong() => {}
            Item::Skipped { bytes, why, .. } => match &mut self.skipped {
                Some((_, skipped)) => skipped.extend(bytes, why),
                None => self.skipped = Some((self.clock.time(at), Skipped::new(bytes, why))),
            },
        }
    }

    /// A program opened the port, after another one has closed it.
    pub fn reopened(&mut self, at: Micros) {
        let at = self.clock.time(at);
        self.push(at, Received::Note("a program opened the port again".to_owned()));
    }

    /// The program closed the port.
    pub fn closed(&mut self, at: Micros) {
        let at = self.clock.time(at);
        self.push(at, Received::Closed);
    }

    fn push(&mut self, at: Micros, received: Received) {
        self.waiting.extend(self.skipped.take().map(|(at, skipped)| (at, Received::Skipped(skipped))));
        self.waiting.push((at, received));
        if self.waiting.len() >= WAITING {
            self.write_waiting(self.waiting.len(), at, false);
        }
    }

    /// Writes everything that cannot change any more at this time.
    pub fn settle(&mut self, now: Micros) {
        let now = self.clock.time(now);
        // Wait for values that may belong to a move, and for frames that may be the end.
        let moves = |(at, received): &(Micros, Received)| {
            let is_channel =
                matches!(received, Received::Command(command) if Channel::of(&self.state.board, command).is_some());
            is_channel && *at + STILL >= now
        };
        if self.exact {
            self.write_waiting(self.waiting.len() - self.closing(), now, false);
        } else if !self.waiting.iter().rev().any(moves) {
            self.write_waiting(self.waiting.len(), now, false);
        }
    }

    /// The text that was settled since the last call.
    pub fn settled(&mut self) -> String {
        self.bounds.is_settled = true;
        std::mem::take(&mut self.header) + &self.layout.take_text()
    }

    /// The rest of the script as plain lines, as if it ended here.
    pub fn tail(&self) -> String {
        let skipped = self.skipped.clone().map(|(at, skipped)| (at, Received::Skipped(skipped)));
        let waiting: Vec<_> = self.waiting.iter().cloned().chain(skipped).collect();
        let now = waiting.last().map_or(self.settled, |(at, _)| *at);
        let rows = rows(&mut self.state.clone(), &waiting, self.exact, now, true);
        let mut layout = self.layout.clone();
        layout.add(rows.into_iter().filter_map(|row| row.line).collect(), true);
        layout.take_text()
    }

    /// Ends the script at a time.
    pub fn finish(&mut self, now: Micros) {
        let now = self.clock.time(now);
        self.waiting.extend(self.skipped.take().map(|(at, skipped)| (at, Received::Skipped(skipped))));
        if self.exact {
            self.write_waiting(self.waiting.len() - self.closing(), now, false);
        }
        // A script with `raw` sends both at its end by itself.
        if let (true, true, Some((at, _))) = (self.exact, self.state.has_raw, self.waiting.first()) {
            self.layout.wait_until(*at);
            self.waiting.clear();
        }
        self.write_waiting(self.waiting.len(), now, true);
    }

    /// The number of frames so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The number of settled lines that send them.
    pub fn lines(&self) -> u64 {
        self.layout.count
    }

    /// The number of last frames that bring everything to rest, or everything that is refreshed.
    /// `play` may have sent them to close a script.
    fn closing(&self) -> usize {
        let ending = |needs_refresh: bool| -> Vec<&Command> {
            let rests =
                self.state.board.resources.iter().rev().filter(|resource| resource.refresh.is_some() || !needs_refresh);
            rests.filter_map(|resource| resource.rest.as_ref()).collect()
        };
        let ends_with = |ending: &[&Command]| {
            let last = self.waiting.iter().rev().zip(ending.iter().rev());
            self.waiting.len() >= ending.len()
                && last
                    .into_iter()
                    .all(|((_, received), rest)| matches!(received, Received::Command(command) if command == *rest))
        };
        [ending(false), ending(true)].iter().find(|ending| ends_with(ending)).map_or(0, Vec::len)
    }

    /// Writes the first waiting items; `is_last` if nothing follows.
    fn write_waiting(&mut self, count: usize, now: Micros, is_last: bool) {
        let waiting: Vec<_> = self.waiting.drain(..count).collect();
        let mut rows = rows(&mut self.state, &waiting, self.exact, now, is_last);
        let (mut moves, mut settled) = (Vec::new(), Micros::ZERO);
        if !self.exact {
            // When the last move of each channel ends.
            let mut ended: Vec<(Channel, Micros)> = Vec::new();
            let board = Arc::clone(&self.state.board);
            for mut run in runs(&board, &rows) {
                run.until = if is_last { run.until } else { run.until.min(now) };
                let busy = ended.iter().filter(|(channel, _)| channel.meets(&board, run.channel)).map(|(_, at)| *at);
                let free = busy.chain([self.settled]).max().unwrap_or_default();
                ended.extend(self.write_moves(&run, free, &mut rows, &mut moves).map(|at| (run.channel, at)));
            }
            settled = ended.iter().map(|(_, at)| *at).max().unwrap_or_default();
        }
        self.settled = rows.iter().map(|row| row.at).chain([self.settled, settled]).max().unwrap_or_default();
        let lines = rows.into_iter().enumerate().filter_map(|(place, row)| Some((place, row.line?)));
        let mut lines: Vec<_> = lines.chain(moves).collect();
        lines.sort_by_key(|(place, line)| (line.at, *place));
        self.layout.add(lines.into_iter().map(|(_, line)| line).collect(), is_last);
    }

    /// Removes the rows that moves replace, and adds the lines of the moves, each with the row whose
    /// place it takes. No move starts before `free`. Returns when the last move ends.
    fn write_moves(&self, run: &Run, free: Micros, rows: &mut [Row], lines: &mut Vec<(usize, Line)>) -> Option<Micros> {
        let before = run.before.map(|(since, axes)| (since.max(free), axes));
        let board = &self.state.board;
        let limits =
            MoveLimits { saves_frames: self.saves_frames, ..run.channel.move_limits(board, &self.bounds.wide) };
        let found = self.easings.find_moves(&PointSeries::new(&run.points, run.until, limits), before);
        let ends = found.last().map(|one| one.to_at);
        let mut ended = None;
        for one in found {
            let covered = one.first..=one.last;
            let said = match one.first.checked_sub(1) {
                _ if !one.has_start || ended == Some(one.first) => Some(one.from),
                None => run.before.map(|(_, axes)| axes),
                Some(before) => run.points.get(before).map(|point| point.axes),
            };
            let (Some(end), Some(place)) = (run.points.get(one.last), run.rows.get(*covered.start())) else {
                continue;
            };
            for row in run.rows.get(covered).unwrap_or_default() {
                if let Some(row) = rows.get_mut(*row) {
                    row.line = None;
                }
            }
            let lasts = one.to_at - one.from_at;
            let mut text = run.channel.moved(board, said, one.from, end.axes);
            let _ = write!(text, " over {}", duration(lasts));
            if one.ease != Ease::LINEAR {
                let _ = write!(text, " ease {}", one.ease.name());
            }
            lines.push((*place, Line::moving(run.channel, one.from_at, lasts, text)));
            ended = Some(one.last);
        }
        ends
    }
}
