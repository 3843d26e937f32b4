//! One command of a script: its row in the table decides what becomes of it.

use super::super::arguments::{self, Arguments, Lasting, bare_word};
use super::super::motion::Move;
use super::super::time::Time;
use super::super::value::Quantity;
use super::super::verbs::{self, Spoken};
use super::super::weight::{self, Weight};
use super::super::words::{self, Does, Word};
use super::super::{Action, Step, expect, limits, say};
use super::{Frame, Unroll};
use crate::board::{self, Verb, VerbId};
use crate::diagnostic::Code;
use crate::source::Span;
use crate::syntax::Command;

impl<'s, 'd> Unroll<'s, 'd> {
    #[expect(clippy::too_many_lines, reason = "a table of commands")]
    pub(super) fn command(&mut self, command: &Command<'s>, start: Time, frame: &Frame, depth: usize) -> Option<Time> {
        let row = match words::find(self.eval.board, command.head.text) {
            Some(Word::Verb(id, verb)) => return self.verb(command, id, verb, start),
            Some(Word::Row(row)) => row,
            None => {
                self.unknown(command);
                return None;
            }
        };
        match row.does {
            Does::Malformed(message, help) => return self.eval.refuse(Code::Syntax, command.span, message, help),
            Does::Let => {
                let help = self.mended_let(command);
                return self.eval.refuse(Code::Syntax, command.span, "a `let` is a name, `=` and its value", help);
            }
            _ => {}
        }
        let mut args = Arguments::new(Word::Row(row), command, &mut self.eval)?;
        match row.does {
            Does::Wait => {
                let value = args.next()?;
                let time = arguments::time(value, args.eval);
                args.finish();
                let time = time?;
                if time < Time::ZERO {
                    return self.taken_back("wait", value.span);
                }
                if frame.together.is_some() {
                    let help = "write `+TIME` before the line that should start later, such as `+1s stop`";
                    self.eval.report(
                        Code::WaitInTogether,
                        command.span,
                        "a `wait` delays nothing inside `together`",
                        help,
                    );
                }
                Some(start.plus(time))
            }
            Does::Say => {
                let value = args.next()?;
                let text = say::say(value, args.eval);
                args.finish()?;
                let text = text?;
                if !self.keep(weight::SAY, text.len(), command.span) {
                    return None;
                }
                self.push(start, command.span, Action::Say(Box::new(text.into())));
                Some(start)
            }
            Does::Expect => {
                let expect = expect::expect(&mut args)?;
                args.finish()?;
                if self.in_abort {
                    let help = "leave it out: what is sent on abort cannot be ended early";
                    return self.eval.refuse(Code::Abort, command.span, "there is no `expect` in `on abort`", help);
                }
                let length = expect.why.as_ref().map_or(0, String::len);
                // The reason is there twice for a while.
                if !self.keep(weight::EXPECT, 2 * length, command.span) {
                    return None;
                }
                let end = start.plus(expect.within.unwrap_or(Time::ZERO));
                self.push(start, command.span, Action::Expect(Box::new(expect)));
                Some(end)
            }
            Does::Mark => {
                let argument = args.next_argument()?;
                let name = bare_word(argument);
                args.finish()?;
                let Some(name) = name else {
                    return self.eval.refuse(Code::Arguments, argument.span, "a mark is a name", "write `mark bow`");
                };
                if self.in_abort {
                    return self.eval.refuse(
                        Code::Abort,
                        command.span,
                        "there is no mark in `on abort`",
                        "write times: `at 0.5s …`",
                    );
                }
                self.is_free(name)?;
                if let Some(first) = self.eval.scope.hidden_by_mark(name.text) {
                    return self.given_twice(name, first);
                }
                if !self.keep(weight::MARK, name.text.len(), command.span) {
                    return None;
                }
                self.marks.push((name.text.to_owned(), start));
                self.eval.scope.bind(name, Quantity::Moment(start), false);
                Some(start)
            }
            Does::Repeat => self.repeat(command, row, start, depth),
            Does::Together => {
                args.finish()?;
                let block = command.block.as_ref()?;
                Some(self.block(block, start, true, depth))
            }
            Does::Use => {
                let value = args.next()?;
                args.finish()?;
                if !frame.top {
                    return self.top_level("use", command.span);
                }
                self.use_(value, command.span)?;
                Some(start)
            }
            Does::Abort => self.on_abort(command, row, frame, start, depth),
            Does::Set(_) | Does::Let | Does::Malformed(..) | Does::Later => None,
        }
    }

    /// A verb of the board: one command, or a move.
    fn verb(&mut self, command: &Command<'s>, id: VerbId, verb: &'d Verb, start: Time) -> Option<Time> {
        let board = self.eval.board;
        let mut args = Arguments::new(Word::Verb(id, verb), command, &mut self.eval)?;
        let spoken = verbs::read(&mut args, id, verb);
        let lasting = args.lasting();
        let complete = args.finish();
        let lasting = lasting.ok()?;
        let (end, span) = (start.plus(lasting.time()), command.span);
        let (Some(spoken), Some(())) = (spoken, complete) else {
            // A wrong value moves nothing behind it, but what other verbs need is not known any more.
            return (!board.is_needed(id)).then_some(end);
        };
        let sent = match (spoken, lasting) {
            (Spoken::Motion(motion), Lasting::Over(over, ease)) => {
                let touches = board.occupied(motion.verb, motion.index);
                if self.in_abort && touches.iter().any(|resource| board.is_fed(*resource)) {
                    self.drive_in_abort(span);
                } else {
                    self.push(start, span, Action::Go(Box::new(Move { motion, over, ease })));
                }
                return Some(end);
            }
            (Spoken::Motion(motion), _) if motion.has_start() => {
                let help = "write how long it takes, such as `over 2s`, or only the value where it goes";
                self.eval.report(Code::Arguments, span, "`A -> B` needs a time", help);
                return Some(end);
            }
            (Spoken::Motion(motion), _) => motion.target(board)?,
            (Spoken::Command(sent), _) => sent,
        };
        let hold = if let Lasting::For(hold) = lasting { Some(hold) } else { None };
        if hold.is_some() && !verb.moves && board.is_rest(&sent) {
            let message = format!("`{}` takes no `for`", board.show(&sent));
            self.eval.report(Code::Arguments, span, message, "give the time a line of its own: `wait 2s`");
            return Some(end);
        }
        self.send(start, span, sent, hold);
        Some(end)
    }

    pub(super) fn send(&mut self, at: Time, span: Span, command: board::Command, hold: Option<Time>) {
        let board = self.eval.board;
        if self.in_abort && board.is_drive(&command) {
            self.drive_in_abort(span);
            return;
        }
        // A stop is never refused.
        let broken = limits::broken(board, &self.settings.limits, &command).filter(|_| !board.is_rest(&command));
        if let Some((limit, value)) = broken {
            let diagnostic = limits::diagnostic(board, limit, value, span);
            self.eval.push(diagnostic);
            return;
        }
        let action = match hold {
            Some(hold) => Action::Hold(Box::new((command, hold))),
            None => Action::Send(command),
        };
        self.push(at, span, action);
    }

    /// Whether something that sends nothing may be kept, with a text so long.
    fn keep(&mut self, bytes: u64, text: usize, span: Span) -> bool {
        let bytes = bytes.saturating_add(text as u64);
        let is_allowed = self.allow_more(Weight { kept: bytes, ..Weight::default() }, span);
        self.kept = self.kept.saturating_add(bytes);
        is_allowed
    }

    pub(super) fn push(&mut self, at: Time, span: Span, action: Action) {
        let trace = self.eval.traces.here();
        let order = u32::try_from(self.steps.len()).unwrap_or(u32::MAX);
        self.moves += u64::from(matches!(action, Action::Go(_)));
        self.sent += u64::from(matches!(action, Action::Send(_) | Action::Hold(_)));
        self.steps.push(Step { at, span, trace, order, action });
    }
}
