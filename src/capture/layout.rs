//! Lays out lines with absolute times as a script with relative times, as a person would write it.
//!
//! Lines follow each other with a `wait` or `+TIME` between them. A command and its end become one
//! line with `for`. Lines that overlap a move are in a `together`, with one block for each robot
//! part, so that every part can be edited on its own.

use std::fmt::Write as _;
use std::sync::Arc;

use super::script_state::Channel;
use crate::board::{Board, Command, ResourceId};
use crate::units::Micros;

/// After a longer pause, a mark starts the next part.
const PAUSE: Micros = Micros::SECOND;
/// A shorter time between two lines is written before the second of them.
const SHORT: Micros = Micros::from_millis(100);
/// The shortest `for`.
const SHORTEST: Micros = Micros::from_millis(1);
/// The maximum length of a line with several commands, in bytes.
const WIDTH: usize = 100;
/// The most lines that wait for the end of a command.
const PENDING: usize = 1024;

/// One command, move or comment with its time.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) at: Micros,
    /// The duration of a move, or of a command with `for`.
    lasts: Micros,
    what: What,
    text: String,
    /// A comment at the end of the line.
    remark: Option<String>,
}

#[derive(Clone, Debug)]
enum What {
    Comment,
    Command(Command),
    Move(Channel),
}

impl Line {
    pub(super) fn comment(at: Micros, text: String) -> Self {
        Line { at, lasts: Micros::ZERO, what: What::Comment, text, remark: None }
    }

    pub(super) fn command(board: &Board, at: Micros, command: Command) -> Self {
        let text = board.brief(&command).to_string();
        Line { at, lasts: Micros::ZERO, what: What::Command(command), text, remark: None }
    }

    pub(super) fn moving(channel: Channel, at: Micros, lasts: Micros, text: String) -> Self {
        Line { at, lasts, what: What::Move(channel), text, remark: None }
    }

    pub(super) fn with_remark(self, remark: &str) -> Self {
        Line { remark: Some(remark.to_owned()), ..self }
    }

    /// The resources that it can change.
    fn touches<'b>(&self, board: &'b Board) -> &'b [ResourceId] {
        match &self.what {
            What::Comment => &[],
            What::Command(command) => board.touches(command),
            What::Move(channel) => channel.resources(board),
        }
    }

    /// The resource that it keeps active, if `for` can end that. `later` are lines that start
    /// together with it.
    fn holds(&self, board: &Board, later: &[Line]) -> Option<ResourceId> {
        let What::Command(command) = &self.what else { return None };
        let can_end = board.verb(command.verb()).is_some_and(|verb| verb.holds) && board.is_active(command);
        let [resource] = *board.occupies(command) else { return None };
        let is_open = self.lasts == Micros::ZERO && !later.iter().any(|line| line.touches(board).contains(&resource));
        (can_end && is_open && board.rest(resource).is_some()).then_some(resource)
    }

    /// Its text, with the end of a command.
    fn statement(&self) -> String {
        let is_held = self.lasts > Micros::ZERO && matches!(self.what, What::Command(_));
        if is_held { format!("{} for {}", self.text, duration(self.lasts)) } else { self.text.clone() }
    }
}

/// Lines that start together, and the comments before them.
#[derive(Debug, Default)]
struct Moment {
    at: Micros,
    comments: Vec<Line>,
    lines: Vec<Line>,
}

impl Moment {
    fn end(&self) -> Micros {
        self.lines.iter().map(|line| line.at + line.lasts).max().unwrap_or(self.at)
    }
}

/// Groups lines, sorted by time, by their time; and the comments after the last of them.
fn moments(lines: Vec<Line>) -> (Vec<Moment>, Vec<Line>) {
    let mut moments: Vec<Moment> = Vec::new();
    let mut comments = Vec::new();
    for line in lines {
        if matches!(line.what, What::Comment) {
            comments.push(line);
            continue;
        }
        match moments.last_mut().filter(|last| last.at == line.at && comments.is_empty()) {
            Some(last) => last.lines.push(line),
            None => {
                let comments = std::mem::take(&mut comments);
                moments.push(Moment { at: line.at, comments, lines: vec![line] });
            }
        }
    }
    (moments, comments)
}

/// Writes lines in the order of time. What it has written does not change.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    board: Arc<Board>,
    /// Whether a command and its end stay two lines.
    exact: bool,
    text: String,
    /// When the next statement starts, if it says nothing else.
    now: Micros,
    /// The number of the current part.
    part: u32,
    /// The lines whose `for` is not known yet.
    pending: Vec<Line>,
    /// The number of lines with commands.
    pub(super) count: u64,
}

impl Layout {
    pub(super) fn new(board: Arc<Board>, exact: bool) -> Self {
        let (text, pending) = (String::new(), Vec::new());
        Layout { board, exact, text, now: Micros::ZERO, part: 1, pending, count: 0 }
    }

    /// The text since the last call.
    pub(super) fn take_text(&mut self) -> String {
        std::mem::take(&mut self.text)
    }

    /// Adds lines, sorted by time. No move lasts longer than until the next call. What a later line
    /// may end is written then; `is_last` if nothing follows.
    pub(super) fn add(&mut self, lines: Vec<Line>, is_last: bool) {
        self.pending.extend(lines);
        let all = std::mem::take(&mut self.pending);
        let mut count = all.len();
        if !is_last && !self.exact && all.len() < PENDING {
            count = self.first_open(&all).unwrap_or(count);
        }
        let mut all = all.into_iter();
        let (mut ready, comments) = moments(all.by_ref().take(count).collect());
        let (mut kept, trailing) = moments(all.collect());
        let ends = ready.iter().rev().skip(1).map(Moment::end).max();
        if let (Some(last), Some(next)) = (ready.last_mut(), kept.first_mut())
            && ends.is_none_or(|ends| ends <= last.at)
        {
            join_ends(&self.board, last, next);
        }
        self.pending = kept.into_iter().flat_map(|moment| moment.comments.into_iter().chain(moment.lines)).collect();
        self.pending.extend(trailing);
        self.sequence((ready, comments), 0);
    }

    /// The first line of the last moment, if a later line may be the end of one of its commands.
    fn first_open(&self, lines: &[Line]) -> Option<usize> {
        let last = lines.iter().rposition(|line| !matches!(line.what, What::Comment))?;
        let at = lines.get(last)?.at;
        let first = lines.iter().position(|line| line.at == at)?;
        let (earlier, moment) = lines.split_at_checked(first)?;
        let is_free = earlier.iter().all(|line| line.at + line.lasts <= at);
        let holds = |(at, line): (usize, &Line)| line.holds(&self.board, moment.get(at + 1..).unwrap_or_default());
        (is_free && moment.iter().enumerate().any(|line| holds(line).is_some())).then_some(first)
    }

    /// Waits until a time.
    pub(super) fn wait_until(&mut self, at: Micros) {
        if at > self.now {
            self.line(0, &format!("wait {}", duration(at - self.now)));
            self.now = at;
        }
    }

    fn line(&mut self, depth: usize, text: &str) {
        let indent = 2 * depth;
        let _ = writeln!(self.text, "{:indent$}{text}", "");
    }

    fn comments(&mut self, depth: usize, comments: &[Line]) {
        for comment in comments {
            self.line(depth, &format!("# {}", comment.text));
        }
    }

    /// Writes moments one after another.
    fn sequence(&mut self, (moments, mut trailing): (Vec<Moment>, Vec<Line>), depth: usize) {
        let mut rest = moments.into_iter().peekable();
        while let Some(mut first) = rest.next() {
            let mut end = first.end();
            let mut more = Vec::new();
            while let Some(next) = rest.next_if(|next| next.at < end) {
                end = end.max(next.end());
                more.push(next);
            }
            if more.is_empty()
                && !self.exact
                && let Some(next) = rest.peek_mut()
                && join_ends(&self.board, &mut first, next)
            {
                let comments = std::mem::take(&mut next.comments);
                rest.next();
                let later = rest.peek_mut().map_or(&mut trailing, |next| &mut next.comments);
                drop(later.splice(0..0, comments));
            }
            if more.is_empty() {
                self.moment(&first, depth);
            } else {
                more.insert(0, first);
                self.together(more, depth);
            }
        }
        self.comments(depth, &trailing);
    }

    /// Writes the time before a moment, and its comments. Returns what to write before its line.
    fn gap(&mut self, at: Micros, comments: &[Line], depth: usize) -> String {
        let gap = at - self.now;
        // A comment is where it is closest.
        let early = comments.partition_point(|line| line.at - self.now < at - line.at);
        let (early, late) = comments.split_at_checked(early).unwrap_or((comments, &[]));
        self.comments(depth, early);
        self.now = self.now.max(at);
        let is_first = depth > 0 && self.text.is_empty();
        if gap < SHORT || is_first {
            self.comments(depth, late);
            return if gap == Micros::ZERO { String::new() } else { format!("+{} ", duration(gap)) };
        }
        self.line(depth, &format!("wait {}", duration(gap)));
        if depth == 0 && gap > PAUSE {
            self.part += 1;
            self.text.push('\n');
            self.line(depth, &format!("mark part_{}", self.part));
        }
        self.comments(depth, late);
        String::new()
    }

    fn moment(&mut self, moment: &Moment, depth: usize) {
        let prefix = self.gap(moment.at, &moment.comments, depth);
        self.now = self.now.max(moment.end());
        self.statement(&prefix, &moment.lines, depth);
    }

    /// Writes lines that start together.
    fn statement(&mut self, prefix: &str, lines: &[Line], depth: usize) {
        let joined = lines.iter().map(Line::statement).collect::<Vec<_>>().join("; ");
        if lines.len() > 1 && joined.len() > WIDTH {
            self.line(depth, &format!("{prefix}together {{"));
            for line in lines {
                self.statement("", std::slice::from_ref(line), depth + 1);
            }
            return self.line(depth, "}");
        }
        let remarks = lines.iter().filter_map(|line| line.remark.as_deref()).collect::<Vec<_>>().join("; ");
        let remark = if remarks.is_empty() { String::new() } else { format!("  # {remarks}") };
        self.count += 1;
        self.line(depth, &format!("{prefix}{joined}{remark}"));
    }

    /// Writes moments that overlap: a block for each robot part, or one line for each moment where
    /// that would change the order of commands.
    fn together(&mut self, moments: Vec<Moment>, depth: usize) {
        let begin = moments.first().map_or(self.now, |moment| moment.at);
        let end = moments.iter().map(Moment::end).max().unwrap_or(begin);
        let comments: Vec<Line> = moments.iter().flat_map(|moment| moment.comments.clone()).collect();
        let prefix = self.gap(begin, &comments, depth);
        self.line(depth, &format!("{prefix}together {{"));
        match self.branches(&moments) {
            Some(branches) => {
                for branch in branches {
                    self.branch(branch, begin, depth + 1);
                }
            }
            None => {
                for moment in moments {
                    let start = moment.at - begin;
                    let prefix = if start == Micros::ZERO { String::new() } else { format!("+{} ", duration(start)) };
                    self.statement(&prefix, &moment.lines, depth + 1);
                }
            }
        }
        self.line(depth, "}");
        self.now = end;
    }

    /// Writes a part of a `together` that starts at `begin`.
    fn branch(&mut self, lines: Vec<Line>, begin: Micros, depth: usize) {
        let mut branch = Layout { now: begin, ..Layout::new(Arc::clone(&self.board), self.exact) };
        branch.sequence(moments(lines), depth + 1);
        self.count += branch.count;
        let is_single = branch.text.lines().count() == 1;
        if is_single {
            self.line(depth, branch.text.trim());
        } else {
            self.line(depth, "{");
            self.text += &branch.text;
            self.line(depth, "}");
        }
    }

    /// The lines of overlapping moments for each robot part; `None` for a single part, or if lines
    /// of one moment would be in another order.
    fn branches(&self, moments: &[Moment]) -> Option<Vec<Vec<Line>>> {
        // The part of each resource, and of lines without one. A line joins the parts that it changes.
        let none = self.board.resources.len();
        let mut parts: Vec<usize> = (0..=none).collect();
        let part = |line: &Line, parts: &[usize]| {
            let first = line.touches(&self.board).first();
            parts.get(first.copied().unwrap_or(none)).copied()
        };
        for line in moments.iter().flat_map(|moment| &moment.lines) {
            let own = part(line, &parts)?;
            for resource in line.touches(&self.board) {
                let other = *parts.get(*resource)?;
                parts.iter_mut().filter(|part| **part == other).for_each(|part| *part = own);
            }
        }
        let mut order: Vec<usize> = Vec::new();
        let mut branches: Vec<Vec<Line>> = Vec::new();
        for moment in moments {
            let mut least = 0;
            for line in &moment.lines {
                let own = part(line, &parts)?;
                let place = order.iter().position(|part| *part == own).unwrap_or(order.len());
                if place == order.len() {
                    order.push(own);
                    branches.push(Vec::new());
                }
                if place < least {
                    return None;
                }
                least = place;
                branches.get_mut(place)?.push(line.clone());
            }
        }
        (branches.len() > 1).then_some(branches)
    }
}

/// Gives commands a `for` that ends where the next moment starts, if something there ends them.
/// Returns whether nothing is left of the next moment.
fn join_ends(board: &Board, first: &mut Moment, next: &mut Moment) -> bool {
    if next.at < first.at + SHORTEST {
        return false;
    }
    let mut rest = first.lines.as_mut_slice();
    while let Some((line, later)) = rest.split_first_mut() {
        let held = line.holds(board, later);
        rest = later;
        let Some(resource) = held else { continue };
        let ending = next.lines.iter().position(|line| line.touches(board).contains(&resource));
        let Some((place, What::Command(command))) = ending.and_then(|at| Some((at, &next.lines.get(at)?.what))) else {
            continue;
        };
        if board.rest(resource) == Some(command) {
            // The end of a `for` comes before everything else at its time.
            if place > 0 {
                continue;
            }
            let ended = next.lines.remove(0);
            line.remark = ended.remark.or(line.remark.take());
        } else if board.is_opaque(command) {
            continue;
        }
        line.lasts = next.at - line.at;
    }
    next.lines.is_empty()
}

/// A time as short as a script can write it.
pub(super) fn duration(time: Micros) -> String {
    let [seconds, millis, micros] = [format!("{time}s"), format!("{}ms", time.in_millis()), format!("{}us", time.0)];
    let all = if time < Micros::SECOND { [millis, seconds, micros] } else { [seconds, millis, micros] };
    all.into_iter().min_by_key(String::len).unwrap_or_default()
}
