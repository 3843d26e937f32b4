//! One command of a script: its row in the table says which function runs it.

use super::super::arguments::{self, Arguments, CommandDuration};
use super::super::cost::{self, Cost};
use super::super::evaluator::Evaluator;
use super::super::motion::Move;
use super::super::scope::Kind;
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::verbs::{self, Parsed};
use super::super::words::{self, Operation, Row, Word};
use super::super::{Action, Mark, Step, expect, gate, limits, lints, say};
use super::{Frame, Walker};
use crate::board::{self, ResourceId, Verb, VerbId};
use crate::diagnostic::{bail, diagnostic, report};
use crate::source::Span;
use crate::syntax::{Argument, Command};

/// A command of the language, and where it is run.
#[derive(Clone, Copy)]
pub(super) struct At<'c, 's> {
    pub(super) row: &'static Row,
    pub(super) command: &'c Command<'s>,
    pub(super) start: Time,
    pub(super) frame: &'c Frame,
}

impl<'c, 's> At<'c, 's> {
    pub(super) fn args<'r, 'd>(self, eval: &'r mut Evaluator<'s, 'd>) -> Option<Arguments<'r, 'c, 's, 'd>> {
        Arguments::new(Word::Row(self.row), self.command, eval)
    }
}

impl<'s, 'd> Walker<'s, 'd> {
    /// Runs a command for each robot that it is for; returns when it has ended.
    pub(super) fn command(&mut self, command: &Command<'s>, start: Time, frame: &Frame) -> Option<Time> {
        if self.eval.robots.is_empty() {
            return self.command_of_robot(command, start, frame);
        }
        frame.robots.among(self.count()).take(1).for_each(|robot| self.switch(robot));
        match words::of_command(self.eval.board, command) {
            Some(Word::Row(row)) if !row.does.is_per_robot() => self.command_of_robot(command, start, frame),
            None if !self.eval.is_known(command.head.text) => self.command_of_robot(command, start, frame),
            _ => self.for_each(frame.robots, |walker| walker.command_of_robot(command, start, frame)),
        }
    }

    /// Runs a command for the current robot.
    fn command_of_robot(&mut self, command: &Command<'s>, start: Time, frame: &Frame) -> Option<Time> {
        let row = match words::of_command(self.eval.board, command) {
            Some(Word::Verb(id, verb)) => return self.verb(command, id, verb, start),
            Some(Word::Row(row)) => row,
            None => {
                self.eval.unknown_command(command, frame.robots);
                return None;
            }
        };
        let at = At { row, command, start, frame };
        match row.does {
            Operation::Wait => self.wait(at),
            Operation::WaitUntil | Operation::WaitGo => self.gate(at),
            Operation::Say => self.say(at),
            Operation::Expect => self.expect(at),
            Operation::Mark => self.mark(at),
            Operation::Repeat => self.repeat(at),
            Operation::Together => self.together(at),
            Operation::Use => self.use_(at),
            Operation::Abort => self.on_abort(at),
            Operation::Let => self.eval.malformed_let(command),
            Operation::Malformed(message, help) => bail!(self.eval, Syntax, command.span, "{message}"; help: "{help}"),
            // A line with a setting is not run as a command.
            Operation::Set(_) => None,
        }
    }

    fn wait(&mut self, at: At<'_, 's>) -> Option<Time> {
        // `wait until` without a condition, where nothing is named `until`.
        if let Some(row) = words::gate(at.command).filter(|_| self.eval.scope.value(words::UNTIL).is_none()) {
            return self.gate(At { row, ..at });
        }
        gate::misspelled(at.command, &mut self.eval)?;
        let mut args = at.args(&mut self.eval)?;
        let value = args.next()?;
        let time = arguments::time(value, args.eval)?;
        args.finish();
        if time < Time::ZERO {
            return self.negative("wait", value.span);
        }
        lints::wait_in_together::check(at.frame.together.is_some(), at.command.span, &mut self.eval);
        Some(at.start.plus(time))
    }

    fn say(&mut self, at: At<'_, 's>) -> Option<Time> {
        let mut args = at.args(&mut self.eval)?;
        let value = args.next()?;
        let text = say::say(value, args.eval);
        args.finish()?;
        let text = text?;
        // The same line is shown once for all robots; one with reports is shown for each.
        let is_first = at.frame.robots.among(self.count()).next() == Some(self.eval.robot);
        if !is_first && !text.is_live() {
            return Some(at.start);
        }
        self.keep(cost::SAY, text.size(), at.command.span)?;
        self.push(at.start, at.command.span, Action::Say(Box::new(text)));
        Some(at.start)
    }

    fn expect(&mut self, at: At<'_, 's>) -> Option<Time> {
        let mut args = at.args(&mut self.eval)?;
        let expect = expect::expect(&mut args)?;
        args.finish()?;
        if self.in_abort {
            bail!(self.eval, Abort, at.command.span, "`expect` is not allowed in `on abort`";
                help: "remove it: what is sent on abort cannot be ended early");
        }
        lints::early_expect::check(&expect, at.start, at.command.span, &mut self.eval);
        lints::impossible_condition::check(&expect.criterion, at.command.span, &mut self.eval);
        if expect.within.is_some() {
            lints::brief_condition::check(&expect.criterion, at.command.span, &mut self.eval);
        }
        let length = expect.why.as_ref().map_or(0, String::len);
        // For a while there are two copies of the reason.
        self.keep(cost::EXPECT, 2 * length, at.command.span)?;
        let end = at.start.plus(expect.within.unwrap_or(Time::ZERO));
        self.push(at.start, at.command.span, Action::Expect(Box::new(expect)));
        Some(end)
    }

    fn mark(&mut self, at: At<'_, 's>) -> Option<Time> {
        let mut args = at.args(&mut self.eval)?;
        let argument = args.next_argument()?;
        let name = argument.bare_word();
        if let Some((first, second)) = name.zip(args.next_word()) {
            bail!(self.eval, Name, first.span.to(second.span), "a name has no spaces";
                write: first.span.to(second.span) => "{}_{}", first.text, second.text);
        }
        args.finish()?;
        let Some(name) = name else {
            bail!(self.eval, InvalidArgument, argument.span, "the name of a mark starts with a letter";
                help: "write a name, such as `mark bow`");
        };
        if self.in_abort {
            bail!(self.eval, Abort, at.command.span, "`mark` is not allowed in `on abort`";
                help: "write times: `at 0.5s …`");
        }
        self.eval.is_free(name)?;
        if let Some(first) = self.eval.scope.hidden_by_mark(name.text) {
            return self.eval.given_twice(name, first);
        }
        self.keep(cost::MARK, name.text.len(), at.command.span)?;
        let order = self.order;
        self.marks.push(Mark { name: name.text.to_owned(), at: at.start, span: at.command.span, order });
        self.eval.scope.bind(name, Quantity::Moment(at.start), Kind::Mark);
        Some(at.start)
    }

    fn together(&mut self, at: At<'_, 's>) -> Option<Time> {
        at.args(&mut self.eval)?.finish()?;
        Some(self.block(at.command.block.as_ref()?, at.start, true, at.frame))
    }

    /// A verb of the board: one command, or a move.
    fn verb(&mut self, command: &Command<'s>, id: VerbId, verb: &'d Verb, start: Time) -> Option<Time> {
        let board = self.eval.board;
        let words = command.arguments.iter().filter_map(Argument::bare_word);
        let mut words = words.take_while(|word| !words::is_modifier(word.text));
        let variant = words.find_map(|given| board.variant(id, given.text));
        let (id, verb) = variant.unwrap_or((id, verb));
        let mut args = Arguments::new(Word::Verb(id, verb), command, &mut self.eval)?;
        let parsed = verbs::read(&mut args, id, verb);
        let lasting = args.lasting();
        let complete = args.finish();
        let lasting = lasting.ok()?;
        let (end, span) = (start.plus(lasting.time()), command.span);
        let (Some(parsed), Some(())) = (parsed, complete) else {
            // A wrong value does not move what follows, but what other verbs need is unknown.
            return (!board.is_needed(id)).then_some(end);
        };
        let sent = match (parsed, lasting) {
            (Parsed::Motion(motion), CommandDuration::Over(over, ease)) => {
                let touches = board.occupied(motion.verb, motion.index);
                self.check_use(verb, touches, span)?;
                if self.in_abort && touches.iter().any(|resource| board.drives(*resource)) {
                    self.drive_in_abort(span);
                } else {
                    self.push(start, span, Action::Go(Box::new(Move { motion, over, ease })));
                }
                return Some(end);
            }
            (Parsed::Motion(motion), _) if motion.has_start() => {
                report!(self.eval, MissingArgument, span, "`A -> B` needs a time";
                    help: "write how long the move takes, such as `over 2s`, or only the target");
                return Some(end);
            }
            (Parsed::Motion(motion), _) => motion.target(board)?,
            (Parsed::Command(sent), _) => sent,
        };
        let hold = if let CommandDuration::For(hold) = lasting { Some(hold) } else { None };
        if hold.is_some() && !verb.moves && board.is_rest(&sent) {
            report!(self.eval, UnexpectedArgument, span, "`{}` takes no `for`", board.show(&sent);
                help: "wait on a line of its own: `wait 2s`");
            return Some(end);
        }
        self.check_use(verb, board.occupies(&sent), span)?;
        self.send(start, span, sent, hold);
        Some(end)
    }

    /// Reports a resource that the script uses in two ways.
    fn check_use(&mut self, verb: &Verb, resources: &[ResourceId], span: Span) -> Option<()> {
        if verb.uses_as.is_empty() {
            return Some(());
        }
        let board = self.eval.board;
        for resource in resources {
            let limits = self.robot.settings.limits.iter();
            let limited =
                limits.filter(|limit| board.occupied(limit.limited.verb, limit.limited.index).contains(resource));
            let mut limited =
                limited.filter_map(|limit| Some((board.verb(limit.limited.verb)?.uses_as.clone(), limit.span?)));
            let usual = board.resource(*resource).and_then(|found| found.speed);
            let has_speed = self.robot.settings.speeds.get(*resource).is_some_and(|speed| *speed != usual);
            let moving = board.verbs.iter().find(|other| other.moves && !other.uses_as.is_empty());
            if let Some(moving) = moving.filter(|moving| has_speed && moving.uses_as != verb.uses_as) {
                let name = board.resource(*resource).map_or("", |resource| &resource.name);
                let diagnostic = diagnostic!(TwoUses, span, "{name} is used as {}, and has a `limit` for the speed of {}",
                    verb.uses_as, moving.uses_as; help: "remove that `limit`, or use another channel");
                self.eval.push(diagnostic);
                return None;
            }
            let (other, first) = match limited.next_back() {
                Some(limited) => limited,
                None => self.robot.uses.entry(*resource).or_insert_with(|| (verb.uses_as.clone(), span)).clone(),
            };
            if other != verb.uses_as {
                let name = board.resource(*resource).map_or("", |resource| &resource.name);
                let diagnostic = diagnostic!(TwoUses, span, "{name} is used as {} and as {other}", verb.uses_as;
                    help: "use another channel, or the same command for both");
                self.eval.push(diagnostic.label("second use").related(first, "first use"));
                return None;
            }
        }
        Some(())
    }

    pub(super) fn send(&mut self, at: Time, span: Span, command: board::Command, hold: Option<Time>) {
        let board = self.eval.board;
        if self.in_abort && board.is_drive(&command) {
            self.drive_in_abort(span);
            return;
        }
        if self.in_abort && board.reads_first(&command) {
            report!(self.eval, Abort, span, "`{}` is not allowed in `on abort`", board.show(&command);
                help: "remove it: it reads where the servo is, and nothing is read then");
            return;
        }
        // A stop is never refused.
        if let Some(diagnostic) = limits::broken(board, &self.robot.settings, &command, span)
            && !board.is_rest(&command)
        {
            self.eval.push(diagnostic);
            return;
        }
        let action = match hold {
            Some(hold) => Action::Hold(Box::new((command, hold))),
            None => Action::Send(command),
        };
        self.push(at, span, action);
    }

    /// Counts something that sends nothing, with the length of its text; `None` if it exceeds a bound, which is reported.
    pub(super) fn keep(&mut self, bytes: u64, text: usize, span: Span) -> Option<()> {
        let bytes = bytes.saturating_add(text as u64);
        let is_allowed = self.bounds.allow(Cost { kept: bytes, ..Cost::default() }, span, &mut self.eval);
        self.bounds.done.kept = self.bounds.done.kept.saturating_add(bytes);
        is_allowed
    }

    #[inline]
    pub(super) fn push(&mut self, at: Time, span: Span, action: Action) {
        let trace = self.eval.traces.here();
        let order = self.order;
        self.order = self.order.saturating_add(1);
        self.bounds.count(&action);
        self.robot.steps.push(Step { at, span, trace, order, action });
    }
}
