//! Pauses: the robot is stopped, and the script continues later, or step by step.

use super::super::halt::Halt;
use super::super::messages::{Cause, Input, Notice, Order, SIGTSTP};
use super::{Phase, Player, due};
use crate::timeline::Kind;
use crate::units::Nanos;

impl Player<'_> {
    /// Stops the robot for a pause, without `on abort`.
    pub(super) fn pause(&mut self, time: Nanos, now: Nanos, sleeps: bool) -> Order {
        if let Some(closed) = &mut self.closed {
            closed.pause(now);
        }
        let cause = if sleeps { Cause::Signal(SIGTSTP) } else { Cause::Quit };
        let outcome = self.outcome_at(cause, time);
        self.halt(Phase::Pausing(Halt::new(false, now), time, outcome, sleeps))
    }

    pub(super) fn stand(&mut self, at: Nanos, now: Nanos, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        match (input.end(), input) {
            (Some(cause), _) => self.end_early(cause, now),
            (None, Input::Suspend) => {
                self.resume = None;
                self.pause(at, now, true)
            }
            (None, Input::Pause) if self.resume.take().is_some() => Order::Stay,
            (None, Input::Step) => self.step(None, now, notices),
            (None, Input::StepTo { at, is_gate }) => {
                self.step(Some((at.saturating_sub(self.passed), is_gate)), now, notices)
            }
            (None, Input::Resume) => self.resume((at, now), now, notices),
            (None, Input::ResumeTogether { run, at }) => {
                self.resume = Some((run.saturating_sub(self.passed), at));
                self.stand(at, now, Input::Tick, notices)
            }
            _ => match self.resume {
                Some((_, at)) if now < at => Order::Wait { until: at, writable: false },
                Some(when) => self.resume(when, now, notices),
                None => Order::Stay,
            },
        }
    }

    /// Continues: at a time of the script, which is a time of the run.
    fn resume(&mut self, (at, since): (Nanos, Nanos), now: Nanos, notices: &mut impl FnMut(Notice)) -> Order {
        self.phase = Phase::Playing;
        self.resume = None;
        self.catch_up(now, notices);
        self.set_clock(at, since);
        self.restore(now);
        if let Some(closed) = &mut self.closed {
            closed.resume(now);
        }
        notices(Notice::Resumed { at: at.micros() });
        self.play(now, Input::Tick, notices)
    }

    /// Plays the next step: all commands of the next time that has any, except drive commands, which apply when the run continues.
    /// With other robots, it is the next time of any of them, and whether all are at a gate then.
    fn step(&mut self, common: Option<(Nanos, bool)>, now: Nanos, notices: &mut impl FnMut(Notice)) -> Order {
        if self.start.is_pending() {
            // What happens before time 0 is the first step.
            self.start.pauses = true;
            self.phase = Phase::Playing;
            return self.play(now, Input::Tick, notices);
        }
        self.begin_by_step();
        // A gate is a step, too.
        let Some((at, is_gate)) = common.or_else(|| self.next_step()) else { return Order::Stay };
        if is_gate
            && self.gate_time() == Some(at)
            && let Some(order) = self.step_through_gate(now, notices)
        {
            return order;
        }
        let rest = self.coming();
        let count = rest.iter().take_while(|event| due(event) <= at).count();
        for event in rest.iter().take(count) {
            let index = self.next;
            if self.must_wait_for_torque(&event.command, now, notices) {
                break;
            }
            self.take(event);
            if self.out.is_full() || self.board.is_drive(&event.command) {
                self.note_drive(event, index, now);
                notices(Notice::Withheld { event: index });
                continue;
            }
            self.out.push(|bytes| self.board.encode(&event.command, bytes));
            self.note_servo(event);
            if event.kind == Kind::Auto {
                self.reads.note_sent(&event.command, now);
            }
            self.pending += 1;
            self.last = Some(index);
            notices(Notice::Sent { event: index, late: Nanos::ZERO });
        }
        self.say(at, now, notices);
        self.due = now;
        self.phase = Phase::Stepping(at);
        let gate = self.gates.get(self.next_gate).map(|gate| gate.at.nanos());
        if is_gate && self.closed.is_none() && gate == Some(at) {
            self.close_gate(now, notices);
            // Its time does not count. The next step opens it.
            self.closed.iter_mut().for_each(|closed| closed.pause(now));
        }
        self.stepping(at, now, Input::Tick, notices)
    }

    pub(super) fn stepping(&mut self, at: Nanos, now: Nanos, input: Input, notices: &mut impl FnMut(Notice)) -> Order {
        if let Some(cause) = input.end() {
            return self.end_early(cause, now);
        }
        if input == Input::Suspend {
            return self.pause(at, now, true);
        }
        if let Some(order) = self.write(now, input) {
            return order;
        }
        if let Some(order) = self.enable(now, notices) {
            return order;
        }
        // A servo whose torque is switched on was read first.
        if self.enabling.is_some() || self.coming().first().is_some_and(|event| due(event) <= at) {
            return self.step(Some((at, false)), now, notices);
        }
        self.phase = Phase::Paused(at);
        Order::Stay
    }

    /// Starts paused, at the start of the script.
    #[must_use]
    pub fn paused(mut self) -> Self {
        self.phase = Phase::Paused(Nanos::ZERO);
        self
    }

    /// Restores the state from before the pause. Commands that were queued then may not have reached the robot.
    fn restore(&mut self, now: Nanos) {
        // A stop does not change the torque of a servo.
        for command in self.state.commands(self.board).filter(|command| !self.board.reads_first(command)) {
            self.out.push(|bytes| self.board.encode(command, bytes));
            self.extra += 1;
            self.held.note(self.board, command, true);
        }
        for (_, sent) in &mut self.driven {
            *sent = now;
        }
        self.due = now;
    }
}
