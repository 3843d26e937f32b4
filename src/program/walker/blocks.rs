//! Blocks that run in their own way: `repeat` and `on abort`.

use super::super::Abort;
use super::super::arguments;
use super::super::cost::Cost;
use super::super::scope::Kind;
use super::super::time::Time;
use super::super::value::{self, Quantity};
use super::cached_lines::CachedLines;
use super::commands::At;
use super::{Frame, Walker};
use crate::diagnostic::{bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Block, Name};

/// The arguments of `repeat`.
#[derive(Clone, Copy)]
struct Passes<'s> {
    count: u64,
    /// The time from one start to the next, and where it is written.
    every: Option<(Time, Span)>,
    /// The name of the pass's number.
    name: Option<Name<'s>>,
}

impl<'s> Walker<'s, '_> {
    pub(super) fn repeat(&mut self, at: At<'_, 's>) -> Option<Time> {
        let mut args = at.args(&mut self.eval)?;
        let block = at.command.block.as_ref()?;
        let value = args.next()?;
        let count = args.number(value, "a number of passes");
        let every = match args.modified_by("every") {
            None => None,
            Some(every) => {
                let value = args.one(every)?;
                Some((arguments::time(value, args.eval)?, every.span))
            }
        };
        let name = args.modified_by("as").map(|argument| (argument.bare_word(), argument.span));
        args.finish()?;
        let count = count?;
        if count < 0.0 || libm::floor(count) != count {
            bail!(self.eval, NotWhole, value.span, "a block cannot be repeated {count} times";
                help: "write a whole number, 0 or more, or round it: `floor(…)`");
        }
        // A larger number exceeds a bound in any case.
        let passes = value::round(count).map_or(u64::MAX, |count| u64::from(count.unsigned_abs()));
        if let Some((_, span)) = every.filter(|(every, _)| *every <= Time::ZERO) {
            bail!(self.eval, OutOfRange, span, "`every` needs a time greater than zero";
                help: "write a time such as `every 1 beat`");
        }
        let name = match name {
            None => None,
            Some((Some(name), _)) => Some(name),
            Some((None, span)) => {
                bail!(self.eval, InvalidArgument, span, "`as` needs a name"; help: "write `as i`");
            }
        };
        let cost = self.bounds.of_block(block, &self.eval).times(passes);
        let cost = Cost { steps: cost.steps.max(passes), ..cost };
        self.bounds.allow(cost, at.command.head.span.to(value.span), &mut self.eval)?;
        if passes == 0 {
            self.look_through(block);
        }
        self.passes(at, block, Passes { count: passes, every, name })
    }

    /// Runs a block several times.
    fn passes(&mut self, at: At<'_, 's>, block: &Block<'s>, passes: Passes<'s>) -> Option<Time> {
        let Passes { count, every, name } = passes;
        let repeat = at.command.head.span;
        let mut now = at.start;
        // With one pass, there is nothing to reuse. With several robots, a line may add a step to each.
        let mut cached = (count > 1 && self.eval.robots.is_empty()).then(|| CachedLines::new(self.eval.scope.locals()));
        for pass in 0..count {
            self.bounds.done.steps += 1;
            let mark = self.eval.scope.open();
            let number = u32::try_from(pass + 1).unwrap_or(u32::MAX);
            self.eval.traces.enter(repeat, number);
            if let Some(name) = name {
                if pass == 0 {
                    self.eval.is_free(name);
                }
                self.eval.scope.bind(name, Quantity::Number(f64::from(number) - 1.0), Kind::Counter);
            }
            let frame = self.body(block, Frame { cached: cached.take(), ..at.frame.inside(now) });
            let end = frame.latest;
            cached = frame.cached;
            self.eval.traces.leave();
            self.eval.scope.close(mark, true);
            now = match every {
                None => end,
                Some((every, span)) => {
                    let next = at.start.plus(every.times(pass + 1));
                    if end > next {
                        bail!(self.eval, TooLong, span,
                            "pass {number} takes {}, longer than {every}", end.minus(now);
                            help: "make the body shorter, or the time after `every` longer");
                    }
                    next
                }
            };
            if !self.bounds.another(repeat, &mut self.eval) {
                break;
            }
        }
        Some(now)
    }

    /// `on abort { … }`: a small script of its own, from time 0, with all values unknown.
    pub(super) fn on_abort(&mut self, at: At<'_, 's>) -> Option<Time> {
        const LONGEST: Time = Time::from_millis(2_000);
        let mut args = at.args(&mut self.eval)?;
        let word = args.next()?;
        args.word(word, &["abort"])?;
        args.finish()?;
        let span = at.command.head.span.to(word.span);
        if !at.frame.top || !self.eval.scope.main {
            return self.eval.top_level("on abort", span);
        }
        let count = self.count();
        let mut places = Vec::new();
        for robot in at.frame.robots.among(count) {
            self.switch(robot);
            places.extend(self.robot.abort.as_ref().map(|(_, place)| (robot, *place)));
        }
        if let Some((robot, first)) = places.first().copied() {
            let message = match self.eval.robots.get(robot) {
                None => "there is a second `on abort`".to_owned(),
                Some(robot) => format!("there is a second `on abort` for `{}`", robot.text),
            };
            let diagnostic = diagnostic!(Abort, span, "{message}"; help: "keep one of the two");
            let diagnostic = diagnostic.label("again here").related(first, "first here");
            self.eval.push(diagnostic);
            return None;
        }
        let block = at.command.block.as_ref()?;
        // Its frames have a bound of their own.
        let mut steps = Vec::new();
        for robot in 0..count {
            self.switch(robot);
            steps.push(std::mem::take(&mut self.robot.steps));
        }
        let sent = std::mem::take(&mut self.bounds.done.events);
        self.in_abort = true;
        let end = self.block(block, Time::ZERO, false, at.frame);
        self.in_abort = false;
        self.bounds.done.events = sent;
        for (robot, steps) in steps.into_iter().enumerate() {
            self.switch(robot);
            let steps = std::mem::replace(&mut self.robot.steps, steps);
            if at.frame.robots.contains(robot) {
                self.robot.abort = Some((Abort { steps, end }, span));
            }
        }
        if end > LONGEST {
            bail!(self.eval, Abort, span, "`on abort` takes {end}"; help: "make it shorter: at most 2 s");
        }
        Some(at.start)
    }

    /// Reports a command for the drive in `on abort`.
    pub(super) fn drive_in_abort(&mut self, span: Span) {
        report!(self.eval, Abort, span, "a drive command is not allowed in `on abort`";
            help: "remove it: the drive was stopped before `on abort`, and stays stopped");
    }
}
