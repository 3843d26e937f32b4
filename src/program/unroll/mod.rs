//! Walks the tree and gives every command its time.

mod blocks;
mod bounds;
mod commands;
mod files;
mod fixed;
mod phrases;
mod settings;
mod unknown;

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use super::arguments::{self, blank_before_unit};
use super::evaluator::Evaluator;
use super::later::Later;
use super::scope::{self, Scope};
use super::suggest::suggest;
use super::time::Time;
use super::trace::Traces;
use super::value::{Quantity, not_yet};
use super::weight::Weight;
use super::words::{self, Word};
use fixed::Fixed;

use super::{Abort, Options, Program, Settings, Step};
use crate::board::Board;
use crate::diagnostic::{Code, Diagnostics};
use crate::source::{Sources, Span};
use crate::syntax::{
    Block, Expression, If, Line, LineRef, Lines, Lost, Moment, Origin, Part, Start, Statement, Value, ValueKind,
};

/// How many steps of a script that has an error are looked through.
const ENOUGH: u64 = 300_000;

/// How deep blocks and calls may run inside each other.
const MAX_DEPTH: usize = 200;

pub(super) fn unroll<'s, 'd>(
    script: &mut Lines<'s>,
    sources: &'s Sources,
    options: &'d Options,
    diagnostics: &'d mut Diagnostics,
) -> Program {
    let is_readable = !diagnostics.has_errors();
    let eval = Evaluator {
        diagnostics,
        board: &options.board,
        scope: Scope::new(),
        tempo: super::tempo::Tempo::default(),
        random: crate::random::SplitMix::default(),
        varies: false,
        traces: Traces::default(),
        lost: Lost::default(),
        later: Later::new(sources.main()),
    };
    let mut unroll = Unroll {
        eval,
        sources,
        sets: Vec::new(),
        settings: Settings::of(&options.board),
        given: Vec::new(),
        weights: Vec::new(),
        touched: HashSet::new(),
        moves: 0,
        kept: 0,
        counted: HashMap::new(),
        loaded: Vec::new(),
        loading: sources.main_path().map(|path| (path, Span::default())).into_iter().collect(),
        begun: false,
        steps: Vec::new(),
        marks: Vec::new(),
        done: 0,
        sent: 0,
        max_events: options.events,
        exhausted: false,
        too_long: false,
        times_known: is_readable,
        searched: 0,
        unknown: HashSet::new(),
        failed: None,
        abort: None,
        in_abort: false,
        in_phrase: false,
    };
    unroll.read_sets(&options.set);
    let mut frame = Frame { top: true, ..Frame::default() };
    loop {
        let errors = unroll.eval.diagnostics.errors();
        let line = script.next(unroll.eval.diagnostics, &mut unroll.eval.lost);
        // What could not be read may have moved anything.
        unroll.times_known &= unroll.eval.diagnostics.errors() == errors;
        let Some(line) = line else { break };
        unroll.lines(std::iter::once(LineRef::Tree(line)), &mut frame);
    }
    unroll.finish(frame.latest)
}

/// How far a block has run.
#[derive(Default)]
struct Frame {
    /// When it began.
    start: Time,
    /// When the next line starts, if it says nothing else.
    now: Time,
    /// When everything in it so far has ended.
    latest: Time,
    /// In a `together`, when each line starts, if it says nothing else.
    together: Option<Time>,
    /// Whether it is the top level of the script.
    top: bool,
    /// Whether anything but a setting has come.
    begun: bool,
    /// `tempo` and `meter` of this block.
    given: Vec<(&'static str, Span)>,
    /// In a pass of a `repeat`, what its lines do in every pass.
    fixed: Option<Fixed>,
    /// How many blocks and calls it runs inside of.
    depth: usize,
}

impl Frame {
    /// That of a block inside of this one, or of a call.
    fn inside(&self, start: Time) -> Self {
        Frame { start, now: start, latest: start, depth: self.depth + 1, ..Frame::default() }
    }
}

/// A `--set` that stands in for a `let`.
struct Set<'s> {
    name: &'s str,
    value: Expression<'s>,
    span: Span,
    used: bool,
}

struct Unroll<'s, 'd> {
    eval: Evaluator<'s, 'd>,
    sources: &'s Sources,
    sets: Vec<Set<'s>>,
    settings: Settings,
    /// Settings that were given, with their places.
    given: Vec<(&'static str, Span)>,
    /// The `if`s whose names were counted as used.
    touched: HashSet<Span>,
    /// Moves so far, and bytes of what is kept besides steps that send something.
    moves: u64,
    kept: u64,
    /// The weights of blocks that were counted.
    counted: HashMap<Span, Weight>,
    /// The weight of each `def`, by its number in the scope.
    weights: Vec<Weight>,
    /// Files that were used, and those that are being read, the script itself first.
    loaded: Vec<PathBuf>,
    loading: Vec<(PathBuf, Span)>,
    /// Whether anything but a setting has come.
    begun: bool,
    steps: Vec<Step>,
    marks: Vec<(String, Time)>,
    /// Lines and passes that were run.
    done: u64,
    /// Steps that send a frame of their own. A move may send nothing, where everything is there already.
    sent: u64,
    max_events: usize,
    /// Whether a bound was reached, so that nothing more is run.
    exhausted: bool,
    too_long: bool,
    /// Whether no error so far can have moved the commands behind it.
    times_known: bool,
    /// How many `def`s were looked at for circles of calls.
    searched: usize,
    /// Words that nothing is called.
    unknown: HashSet<Span>,
    /// The first line that could not be run.
    failed: Option<Span>,
    abort: Option<(Abort, Span)>,
    in_abort: bool,
    in_phrase: bool,
}

impl<'s> Unroll<'s, '_> {
    fn finish(mut self, end: Time) -> Program {
        for set in std::mem::take(&mut self.sets).into_iter().filter(|set| !set.used) {
            let name = set.name;
            let names: Vec<_> = self.eval.scope.names().collect();
            let help = match suggest(name, names.iter().copied()) {
                Some(near) if near != name => format!("did you mean `{near}`?"),
                _ => {
                    "name a `let` of the script itself, outside of all blocks and not of a file that it uses".to_owned()
                }
            };
            let message = format!("the script has no `let {name}` at its top level");
            self.eval.report(Code::UnknownName, set.span, message, help);
        }
        // Whatever could not be run has said why; were that forgotten, it must not pass in silence.
        if let Some(span) = self.failed.filter(|_| !self.eval.diagnostics.has_errors()) {
            self.eval.report(
                Code::Syntax,
                span,
                "this line could not be run",
                "write it in another way, and report this",
            );
        }
        if !self.begun && !self.eval.diagnostics.has_errors() {
            let help = "write a command, such as `servo 1 1500`";
            self.eval.report(Code::EmptyScript, Span::new(0, 0), "the script does nothing", help);
        }
        // A script that does nothing is there for its phrases. What was not run because of an error may have used a name.
        let is_phrases = self.steps.is_empty() && end == Time::ZERO;
        let unused =
            if is_phrases || self.eval.diagnostics.has_errors() { Vec::new() } else { self.eval.scope.unused() };
        for (name, span) in unused {
            let message = format!("nothing uses `{name}`");
            self.eval.report(Code::Unused, span, message, "take it away, or use it");
        }
        Program {
            board: std::sync::Arc::clone(self.eval.board),
            settings: self.settings,
            steps: self.steps,
            end,
            abort: self.abort.map(|(abort, _)| abort),
            marks: self.marks,
            traces: self.eval.traces,
            times_known: self.times_known,
        }
    }

    /// Runs a block of its own from `start` on; gives the time when everything in it has ended.
    fn block(&mut self, block: &Block<'s>, start: Time, together: bool, outer: &Frame) -> Time {
        let mark = self.eval.scope.open();
        let frame = self.body(block, Frame { together: together.then_some(start), ..outer.inside(start) });
        self.eval.scope.close(mark, false);
        frame.latest
    }

    /// The lines of a block, with names in the scope that is open; gives how far they have run.
    fn body(&mut self, block: &Block<'s>, mut frame: Frame) -> Frame {
        let tempo = self.eval.tempo;
        if frame.depth <= MAX_DEPTH {
            self.lines(block.places(), &mut frame);
        } else {
            let help = "call fewer phrases inside each other";
            self.eval.report(
                Code::Nesting,
                block.span,
                format!("blocks and calls run more than {MAX_DEPTH} deep here"),
                help,
            );
            self.exhausted = true;
        }
        self.eval.tempo = tempo;
        frame
    }

    fn lines<'b>(&mut self, lines: impl Iterator<Item = LineRef<'b, 's>>, frame: &mut Frame)
    where
        's: 'b,
    {
        for (place, line) in lines.enumerate() {
            self.done += 1;
            // Behind an error only more errors are looked for, and not for ever.
            self.exhausted |= self.done > ENOUGH && self.eval.diagnostics.has_errors();
            if self.exhausted || !self.within_bounds(line.span()) {
                return;
            }
            if self.line_again(place, line, frame).is_none() {
                self.times_known = false;
                self.failed.get_or_insert(line.span());
            }
            if frame.latest > Time::LONGEST && !self.too_long {
                self.too_long = true;
                let help = "make it shorter; a script is at most 24 hours long";
                self.eval.report(Code::TooLong, line.span(), "the script reaches beyond 24 hours here", help);
            }
        }
    }

    /// Runs a line; `None` where something in it is wrong that may have moved what comes behind.
    fn line(&mut self, line: &Line<'s>, frame: &mut Frame) -> Option<()> {
        if let Some(in_place) = line.parts.iter().find_map(|part| self.setting_in(line, part, frame)) {
            if in_place {
                self.set(line, frame);
            }
            return Some(());
        }
        frame.begun = true;
        self.begun = true;
        let from = frame.together.unwrap_or(frame.now);
        let start = match &line.start {
            None => from,
            Some(start) => self.start(start, line, frame.start, from)?,
        };
        let joined = line.parts.len() > 1;
        if let ([Part { statement: Statement::If(each), robots }], false) = (line.parts.as_slice(), joined)
            && robots.is_empty()
        {
            frame.now = start;
            frame.latest = frame.latest.max(start);
            // In a `together`, every line of the branch starts when the `if` does.
            let together = frame.together;
            frame.together = together.map(|_| start);
            let done = self.branch(each, frame);
            frame.together = together;
            return done;
        }
        // Every part is looked at, so that every mistake in the line is found.
        let mut end = Some(start);
        for part in &line.parts {
            let ended = self.part(part, joined, start, frame);
            end = end.zip(ended).map(|(end, ended)| end.max(ended));
        }
        frame.now = end?;
        frame.latest = frame.latest.max(frame.now);
        Some(())
    }

    /// The branch that is taken stands there as if the `if` and its braces were not written.
    fn branch(&mut self, each: &If<'s>, frame: &mut Frame) -> Option<()> {
        let mut taken = each.otherwise.as_ref();
        for (condition, block) in &each.arms {
            let value = self.eval.expression(condition)?;
            if self.eval.truth(value, condition.span)? {
                taken = Some(block);
                break;
            }
        }
        // What is not taken is not run, but it uses its names. Once is enough.
        if self.touched.insert(each.span) {
            for (condition, block) in &each.arms {
                scope::names_in(condition, &mut |name| self.eval.scope.touch(name));
                scope::names(block, &mut |name| self.eval.scope.touch(name));
                self.check_words(block);
            }
            if let Some(block) = &each.otherwise {
                scope::names(block, &mut |name| self.eval.scope.touch(name));
                self.check_words(block);
            }
        }
        if let Some(block) = taken {
            let names = self.eval.scope.locals();
            self.lines(block.places(), frame);
            // What it has named may hide, in this pass only, what lines behind it use.
            if self.eval.scope.locals() > names {
                frame.fixed = None;
            }
        }
        Some(())
    }

    /// When a line starts.
    fn start(&mut self, start: &Start<'s>, line: &Line<'s>, block: Time, now: Time) -> Option<Time> {
        match start {
            Start::After(value) => {
                self.no_unit_behind(value, line)?;
                let delay = arguments::time(value, &mut self.eval)?;
                if delay < Time::ZERO {
                    return self.taken_back("+", value.span);
                }
                Some(now.plus(delay))
            }
            Start::At(moment) => self.moment(moment, line, block),
        }
    }

    #[expect(clippy::too_many_lines, reason = "one kind of moment after the other")]
    fn moment(&mut self, moment: &Moment<'s>, line: &Line<'s>, block: Time) -> Option<Time> {
        let mut at = match &moment.origin {
            Origin::Bar(count) => {
                let (bar, beat) = &**count;
                let bar_number = self.count_from_one(bar, "a bar")?;
                let beat = match beat {
                    None => Time::ZERO,
                    Some(beat) => {
                        let length = self.eval.tempo.beat();
                        let count = self.count_from_one(beat, "a beat")?;
                        let beats = self.eval.tempo.beats();
                        if count >= f64::from(beats) + 1.0 {
                            let message = format!("there is no beat {count} in a bar of {beats}");
                            return self.eval.refuse(
                                Code::OutOfRange,
                                beat.span,
                                message,
                                "write the next bar, or another `meter`",
                            );
                        }
                        self.eval.exact(length.by_number(count), beat.span)?.minus(length)
                    }
                };
                let length = self.eval.tempo.bar();
                if libm::floor(bar_number) != bar_number {
                    let help = "write a whole number, and the beat behind it: `bar 2 beat 2.5`";
                    return self.eval.refuse(Code::NotWhole, bar.span, "a bar is counted in whole numbers", help);
                }
                let bars = self.eval.exact(length.by_number(bar_number), bar.span)?.minus(length);
                block.plus(bars).plus(beat)
            }
            Origin::Value(value) => {
                if let ValueKind::Word(word) = value.kind
                    && words::find(self.eval.board, word).is_some()
                {
                    let help = format!("for example `at 0.5s {word} …`");
                    return self.eval.refuse(Code::StartTime, value.span, "`at` needs a time before the command", help);
                }
                self.no_unit_behind(value, line)?;
                let origin = match value.kind {
                    ValueKind::Word(word) if !value.negative => self.eval.moment_name(word, value.span)?,
                    _ => self.eval.value(value)?,
                };
                match origin {
                    Quantity::Moment(_) if self.in_abort => {
                        let help = "write a time: `on abort` counts from its own start";
                        return self.eval.refuse(
                            Code::Abort,
                            value.span,
                            "a mark of the script means nothing in `on abort`",
                            help,
                        );
                    }
                    Quantity::Moment(moment) => moment,
                    Quantity::Time(time) => block.plus(time),
                    Quantity::Number(number) => {
                        let message = format!("a time needs a unit, and {number} has none");
                        let help = format!("write `{number}s` for seconds or `{number}ms` for milliseconds");
                        return self.eval.refuse(Code::Unit, value.span, message, help);
                    }
                    other => {
                        let message = format!("a time or a mark is needed here, not {}", other.kind());
                        return self.eval.refuse(
                            Code::Unit,
                            value.span,
                            message,
                            "write a time such as `0.5s`, `bar 2` or the name of a mark",
                        );
                    }
                }
            }
        };
        for (away, value) in &moment.offsets {
            let offset = arguments::time(value, &mut self.eval)?;
            let moved = if *away { at.checked_minus(offset) } else { at.checked_plus(offset) };
            at = self.eval.exact(moved, value.span)?;
        }
        if at < block {
            return self.before_start(moment.span);
        }
        Some(at)
    }

    /// A bar or a beat, counted from 1.
    fn count_from_one(&mut self, value: &Value<'s>, what: &str) -> Option<f64> {
        match self.eval.value(value)? {
            Quantity::Number(count) if count >= 1.0 => Some(count),
            _ => {
                let help = "write `at bar 1 beat 1` for the very start; a beat may have decimals";
                self.eval.refuse(Code::OutOfRange, value.span, format!("{what} is a bare number, counted from 1"), help)
            }
        }
    }

    /// `at 1 s stop`: the unit was read as a command.
    fn no_unit_behind(&mut self, value: &Value<'s>, line: &Line<'s>) -> Option<()> {
        let head = match line.parts.first().map(|part| &part.statement) {
            Some(Statement::Command(command)) => command.head,
            _ => return Some(()),
        };
        match blank_before_unit(value, head) {
            Some(diagnostic) => {
                self.eval.push(diagnostic);
                None
            }
            None => Some(()),
        }
    }

    /// A delay below zero; `word` is what it is written behind.
    fn taken_back<T>(&mut self, word: &str, span: Span) -> Option<T> {
        let help = "write `at TIME` to start a line at an earlier time";
        self.eval.refuse(Code::OutOfRange, span, format!("time cannot be taken back with `{word}`"), help)
    }

    fn before_start<T>(&mut self, span: Span) -> Option<T> {
        self.eval.refuse(
            Code::StartTime,
            span,
            "nothing starts before its own block",
            "write a time from the start of its block on",
        )
    }

    /// Runs one part of a line; gives the time when it has ended, or `None` where something in it is wrong.
    fn part(&mut self, part: &Part<'s>, joined: bool, start: Time, frame: &Frame) -> Option<Time> {
        if let Some(robot) = part.robots.first() {
            self.eval.push(not_yet(robot.span, "a command for one of several robots"));
            return None;
        }
        if joined && let Some((word, span)) = stands_alone(self.eval.board, &part.statement) {
            let help =
                "give it a line of its own; what `;` joins starts together and takes as long as its longest part";
            return self.eval.refuse(Code::Joined, span, format!("`{word}` cannot be joined to other commands"), help);
        }
        match &part.statement {
            Statement::Block(block) => Some(self.block(block, start, false, frame)),
            Statement::Call(call) => self.call(call, start, frame),
            Statement::Let(each) => self.let_(each).map(|()| start),
            Statement::Def(def) => self.def(def, frame).map(|()| start),
            // Taken care of where the line is run.
            Statement::If(_) => None,
            Statement::Command(command) => self.command(command, start, frame),
        }
    }
}

/// The word of a statement that cannot be joined to others, and its place.
fn stands_alone(board: &Board, statement: &Statement<'_>) -> Option<(&'static str, Span)> {
    match statement {
        Statement::Let(each) => Some(("let", each.span)),
        Statement::If(each) => Some(("if", each.span)),
        Statement::Def(def) => Some(("def", def.span)),
        Statement::Command(command) => match words::find(board, command.head.text)? {
            Word::Row(row) if row.alone => Some((row.name, command.span)),
            _ => None,
        },
        Statement::Block(_) | Statement::Call(_) => None,
    }
}
