//! Runs the lines of a script: every command gets its time.

mod blocks;
mod cached_lines;
mod commands;
mod files;
mod gates;
mod phrases;
mod robots;
mod settings;
mod starts;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use elsa::FrozenVec;

use super::bounds::Bounds;
use super::evaluator::Evaluator;
use super::lints;
use super::scope;
use super::suggest::suggest;
use super::time::Time;
use super::words::{self, Word};
use cached_lines::CachedLines;
use files::Files;

use super::robots::RobotSet;
use super::{Abort, Mark, Options, Program, Settings, Step};
use crate::board::{Board, ResourceId, Text};
use crate::diagnostic::{Diagnostics, bail, report};
use crate::source::{Sources, Span};
use crate::syntax::{Block, Expression, If, Line, LineRef, Lines, Part, Statement};

/// Runs a script to its end; returns one program for each robot.
pub(super) fn walk<'s>(
    script: &mut Lines<'s>,
    sources: &'s Sources,
    options: &Options,
    diagnostics: &mut Diagnostics,
) -> Vec<Program> {
    let boards = FrozenVec::new();
    let board = boards.push_get(Box::new(Arc::clone(&options.board)));
    let times_known = !diagnostics.has_errors();
    let mut walker = Walker {
        eval: Evaluator::new(diagnostics, board, sources),
        boards: &boards,
        options,
        bounds: Bounds::new(options.events),
        robot: Robot::new(board, options),
        others: Vec::new(),
        order: 0,
        marks: Vec::new(),
        has_gates: false,
        times_known,
        sets: Vec::new(),
        files: Files::of(sources),
        touched: HashSet::new(),
        failed: None,
        in_abort: false,
        is_board_unknown: false,
    };
    walker.read_sets(&options.set);
    let mut frame = Frame { top: true, ..Frame::default() };
    loop {
        let errors = walker.eval.diagnostics.errors();
        let line = script.next(walker.eval.diagnostics, &mut walker.eval.pending.lost);
        // Text that could not be read may have moved anything.
        walker.times_known &= walker.eval.diagnostics.errors() == errors;
        let Some(line) = line else { break };
        walker.eval.pending.read(line);
        if walker.is_board_unknown {
            continue;
        }
        walker.lines(std::iter::once(LineRef::Tree(line)), &mut frame);
    }
    walker.finish(&frame)
}

/// How far a block has run.
#[derive(Default)]
struct Frame {
    /// When it began.
    start: Time,
    /// When the next line starts, if it has no start time.
    now: Time,
    /// When everything in it that was run has ended.
    latest: Time,
    /// In a `together`, when each line starts, if it has no start time.
    together: Option<Time>,
    /// Whether the current line has several parts, which start together.
    joined: bool,
    /// What makes something outside of it run at the same time: `together`, or `;`.
    beside: Option<&'static str>,
    /// The robots that its lines are for.
    robots: RobotSet,
    /// Whether it is the top level of the script.
    top: bool,
    /// Whether it has run anything but settings.
    begun: bool,
    /// Its settings, with their places and their robots.
    given: Vec<(&'static str, Span, RobotSet)>,
    /// In a pass of a `repeat`, what its lines do in every pass.
    cached: Option<CachedLines>,
    /// How many blocks and calls contain it.
    depth: usize,
}

impl Frame {
    /// That of a block inside of this one, or of a call.
    fn inside(&self, start: Time) -> Self {
        let (beside, depth, robots) = (self.beside(), self.depth + 1, self.robots);
        Frame { start, now: start, latest: start, beside, depth, robots, ..Frame::default() }
    }

    /// What makes something else run at the same time as its lines: `together`, or `;`.
    fn beside(&self) -> Option<&'static str> {
        let own = if self.together.is_some() { Some("together") } else { self.joined.then_some(";") };
        self.beside.or(own)
    }
}

/// A `--set` that replaces the value of a `let`.
struct Set<'s> {
    name: &'s str,
    value: Expression<'s>,
    span: Span,
    used: bool,
}

/// Runs lines and blocks. The evaluator computes their values; the bounds limit how many are run.
struct Walker<'s, 'd> {
    eval: Evaluator<'s, 'd>,
    /// The boards so far: that of the options, and then that of the script.
    #[expect(clippy::redundant_allocation, reason = "a vector of `Arc` would lend the boards themselves")]
    boards: &'d FrozenVec<Box<Arc<Board>>>,
    options: &'d Options,
    bounds: Bounds,
    /// The robot that lines are run for now.
    robot: Robot<'d>,
    /// The other robots, by their numbers.
    others: Vec<Option<Robot<'d>>>,
    /// The place of the next step in the order of unrolling.
    order: u32,
    /// Moments that have a name.
    marks: Vec<Mark>,
    /// Whether any step is a gate.
    has_gates: bool,
    /// Whether all times are right.
    times_known: bool,
    sets: Vec<Set<'s>>,
    files: Files,
    /// The `if`s whose names were counted as used.
    touched: HashSet<Span>,
    /// The first line that could not be run.
    failed: Option<Span>,
    /// Whether `on abort` is being run.
    in_abort: bool,
    /// Whether the line that chooses the board is wrong. Errors about the commands after it would be wrong, too.
    is_board_unknown: bool,
}

/// What one robot has, and what it does.
#[derive(Clone)]
struct Robot<'d> {
    /// Its name, if the script names its robots.
    name: Option<Arc<str>>,
    board: &'d Arc<Board>,
    settings: Settings,
    steps: Vec<Step>,
    /// What is sent when something ends a run early, and its place.
    abort: Option<(Abort, Span)>,
    /// How each resource was used first, and where, if the board distinguishes that.
    uses: HashMap<ResourceId, (Text, Span)>,
}

impl<'d> Robot<'d> {
    fn new(board: &'d Arc<Board>, options: &Options) -> Self {
        let settings = Settings::of(options, board);
        Robot { name: None, board, settings, steps: Vec::new(), abort: None, uses: HashMap::new() }
    }
}

impl<'s> Walker<'s, '_> {
    fn finish(mut self, frame: &Frame) -> Vec<Program> {
        std::mem::take(&mut self.eval.pending).complete(self.eval.sources, self.eval.diagnostics);
        for set in self.sets.iter().filter(|set| !set.used) {
            let name = set.name;
            let help = match suggest(name, self.eval.scope.names()) {
                Some(near) if near != name => format!("did you mean `{near}`?"),
                _ => "name a `let` of the main script that is outside of all blocks".to_owned(),
            };
            report!(self.eval, UnknownName, set.span, "the script has no top-level `let {name}`";
                help: "{help}");
        }
        // Whatever could not be run was reported. If that was forgotten, it must still be an error.
        if let Some(span) = self.failed.filter(|_| !self.eval.diagnostics.has_errors()) {
            report!(self.eval, Syntax, span, "this line could not be run";
                help: "write it in another way, and report this error");
        }
        if !frame.begun && !self.eval.diagnostics.has_errors() {
            report!(self.eval, EmptyScript, Span::new(0, 0), "the script sends nothing";
                help: "write a command, such as `servo 1 1500`");
        }
        // A script that sends nothing is a file of phrases. Lines that were not run because of an error may use a name.
        let is_phrases = self.order == 0 && frame.latest == Time::ZERO;
        if !is_phrases && !self.eval.diagnostics.has_errors() {
            lints::unused::check(&mut self.eval);
        }
        self.programs(frame.latest)
    }

    /// Runs a block from `start` on; returns when everything in it has ended.
    fn block(&mut self, block: &Block<'s>, start: Time, together: bool, outer: &Frame) -> Time {
        let mark = self.eval.scope.open();
        let frame = self.body(block, Frame { together: together.then_some(start), ..outer.inside(start) });
        self.eval.scope.close(mark, false);
        frame.latest
    }

    /// Runs the lines of a block in the scope that is open; returns how far they have run.
    fn body(&mut self, block: &Block<'s>, mut frame: Frame) -> Frame {
        let tempo = self.eval.tempo;
        if self.bounds.allow_depth(frame.depth, block.span, &mut self.eval) {
            self.lines(block.places(), &mut frame);
        }
        self.eval.tempo = tempo;
        frame
    }

    fn lines<'b>(&mut self, lines: impl Iterator<Item = LineRef<'b, 's>>, frame: &mut Frame)
    where
        's: 'b,
    {
        for (place, line) in lines.enumerate() {
            if !self.bounds.line(line.span(), &mut self.eval) {
                return;
            }
            if self.run_line(place, line, frame).is_none() {
                self.times_known = false;
                self.failed.get_or_insert(line.span());
            }
            self.bounds.check_length(frame.latest, line.span(), &mut self.eval);
        }
    }

    /// Runs a line; `None` if it has a mistake that may have moved what follows.
    fn line(&mut self, line: &Line<'s>, frame: &mut Frame) -> Option<()> {
        if self.setting(line, frame) {
            return Some(());
        }
        frame.begun = true;
        let from = frame.together.unwrap_or(frame.now);
        let start = match &line.start {
            None => from,
            Some(start) => self.start(start, line, frame.start, from)?,
        };
        let joined = line.parts.len() > 1;
        frame.joined = joined;
        if let ([Part { statement: Statement::If(each), robots }], false) = (line.parts.as_slice(), joined) {
            let outer = self.name_robots(robots, frame)?;
            frame.now = start;
            frame.latest = frame.latest.max(start);
            // In a `together`, every line of the branch starts when the `if` does.
            let together = frame.together;
            frame.together = together.map(|_| start);
            let done = self.branch(each, frame);
            frame.together = together;
            frame.robots = outer;
            return done;
        }
        // Every part is run, so that every mistake in the line is found.
        let mut end = Some(start);
        for part in &line.parts {
            let ended = self.name_robots(&part.robots, frame).and_then(|outer| {
                let ended = self.part(part, joined, start, frame);
                frame.robots = outer;
                ended
            });
            end = end.zip(ended).map(|(end, ended)| end.max(ended));
        }
        frame.now = end?;
        frame.latest = frame.latest.max(frame.now);
        Some(())
    }

    /// Runs the branch that is taken as if the `if` and its braces were not written.
    fn branch(&mut self, each: &If<'s>, frame: &mut Frame) -> Option<()> {
        let mut taken = each.otherwise.as_ref();
        for (condition, block) in &each.arms {
            let value = self.eval.expression(condition)?;
            if self.eval.truth(value, condition.span)? {
                taken = Some(block);
                break;
            }
        }
        // A branch that is not taken uses its names all the same. Once is enough.
        if self.touched.insert(each.span) {
            for (condition, _) in &each.arms {
                scope::names_in(condition, &mut |name| self.eval.scope.touch(name));
            }
            for block in each.blocks() {
                self.look_through(block);
            }
        }
        if let Some(block) = taken {
            let names = self.eval.scope.locals();
            self.lines(block.places(), frame);
            // In this pass only, the names that it gives may hide names that later lines use.
            if self.eval.scope.locals() > names {
                frame.cached = None;
            }
        }
        Some(())
    }

    /// Counts the names of a block that may never run as used, and reports its unknown words.
    fn look_through(&mut self, block: &Block<'s>) {
        scope::names(block, &mut |name| self.eval.scope.touch(name));
        self.eval.check_words(block, self.eval.scope.in_phrase());
    }

    /// Runs one part of a line; returns when it has ended, or `None` if it has a mistake.
    fn part(&mut self, part: &Part<'s>, joined: bool, start: Time, frame: &Frame) -> Option<Time> {
        if let (Some(robot), Some(word)) = (part.robots.first(), word_for_all(&part.statement)) {
            bail!(self.eval, Robots, robot.span, "`{word}` is the same for all robots";
                help: "remove `{}:`", self.eval.robot_names(frame.robots));
        }
        if joined && let Some((word, span)) = must_be_alone(self.eval.board, &part.statement) {
            bail!(self.eval, Joined, span, "`{word}` cannot be joined to other commands";
                help: "write it on a line of its own; `;` is for commands that start together");
        }
        match &part.statement {
            Statement::Block(block) => Some(self.block(block, start, false, frame)),
            Statement::Call(call) => self.call(call, start, frame),
            Statement::Let(each) => self.let_(each).map(|()| start),
            Statement::Def(def) => self.def(def, frame).map(|()| start),
            // Run with its line.
            Statement::If(_) => None,
            Statement::Command(command) => self.command(command, start, frame),
        }
    }
}

/// The word of a statement that is not for single robots.
fn word_for_all(statement: &Statement<'_>) -> Option<&'static str> {
    match statement {
        Statement::Let(_) => Some("let"),
        Statement::Def(_) => Some("def"),
        Statement::Command(command) if words::is_use(command.head.text) => Some("use"),
        _ => None,
    }
}

/// The word of a statement that cannot be joined to others, and its place.
fn must_be_alone(board: &Board, statement: &Statement<'_>) -> Option<(&'static str, Span)> {
    let word = match statement {
        Statement::Let(_) => "let",
        Statement::If(_) => "if",
        Statement::Def(_) => "def",
        Statement::Command(command) => match words::of_command(board, command)? {
            Word::Row(row) if row.alone => row.name,
            _ => return None,
        },
        Statement::Block(_) | Statement::Call(_) => return None,
    };
    Some((word, statement.span()))
}
