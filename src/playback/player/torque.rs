//! Servos that are limp, that hold, and that are on their way.

use super::super::hold::{TRIES, patience};
use super::super::messages::{Cause, Notice, Order, ServoFault, ServoFaultKind, Why};
use super::Player;
use crate::board::{Board, Command, Report, ServoSet};
use crate::timeline::{Event, Kind};
use crate::units::Nanos;

/// A servo whose torque is being switched on: its position becomes its target first, so that it does not move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Enabling {
    servo: i32,
    /// How often it was asked, and until when it may answer.
    tries: u8,
    until: Nanos,
    /// Where it is.
    goal: Option<i32>,
}

impl Player<'_> {
    /// The servos that may be on their way.
    pub fn moving(&self) -> ServoSet {
        self.moving
    }

    /// Whether a stop of the board holds its servos.
    pub(super) fn holds(&self) -> bool {
        self.stops.hold.is_some()
    }

    /// Notes what an event does to a servo.
    pub(super) fn note_servo(&mut self, event: &Event) {
        let is_instant = event.is_instant || event.kind == Kind::Auto;
        Self::note_instant(self.board, &mut self.moving, &event.command, is_instant);
    }

    /// Notes whether a servo may be on its way after a command: after an instant one, and not after a step of a move, or once its
    /// torque was switched.
    pub(super) fn note_instant(board: &Board, moving: &mut ServoSet, command: &Command, is_instant: bool) {
        let Some(feedback) = board.feedback.as_ref().filter(|feedback| feedback.holds) else { return };
        let Some(servo) = command.value(0) else { return };
        let preparation = feedback.preparation.as_ref();
        if command.verb() == feedback.verb {
            moving.set(servo, is_instant);
        } else if preparation.is_some_and(|preparation| preparation.enable == command.verb()) {
            moving.set(servo, false);
        }
    }

    /// Whether the servo must be read before a command that switches its torque on. Begins to read it if nothing else is on the way,
    /// and sends its position as its target once it is known.
    pub(super) fn must_wait_for_torque(
        &mut self,
        command: &Command,
        now: Nanos,
        notices: &mut impl FnMut(Notice),
    ) -> bool {
        let (true, Some(servo)) = (self.board.reads_first(command), command.value(0)) else { return false };
        let Some(verb) = self.board.feedback.as_ref().map(|feedback| feedback.verb) else { return false };
        if let Some(Enabling { goal: Some(goal), .. }) = self.enabling.take_if(|asked| asked.servo == servo) {
            self.send_unscripted(&Command::new(verb, &[servo, goal]), Why::Torque, now, notices);
            return false;
        }
        if self.out.is_empty() {
            self.ask_position(Enabling { servo, tries: 0, until: now, goal: None }, now, notices);
        }
        true
    }

    fn ask_position(&mut self, asked: Enabling, now: Nanos, notices: &mut impl FnMut(Notice)) {
        let Some(verb) = self.board.feedback.as_ref().map(|feedback| feedback.position) else { return };
        let request = Command::new(verb, &[asked.servo]);
        self.reads.ask_for(&request);
        self.send_unscripted(&request, Why::Torque, now, notices);
        let until = now.saturating_add(patience(self.board));
        self.enabling = Some(Enabling { tries: asked.tries + 1, until, ..asked });
    }

    /// Takes the position of that servo.
    pub(super) fn take_goal(&mut self, report: &Report) {
        let value = self.board.feedback.as_ref().map(|feedback| feedback.value);
        let position = report.values().next().map(|(_, position)| position);
        if let Some(enabling) = &mut self.enabling {
            enabling.goal = value.zip(position).and_then(|(value, position)| value(position));
        }
    }

    /// Waits for the position of a servo whose torque is being switched on; `None` if it is known, or if there is no such servo.
    pub(super) fn enable(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Order> {
        let asked = self.enabling.filter(|asked| asked.goal.is_none())?;
        self.reads.forget_news();
        if self.reads.is_waiting() && now < asked.until {
            return Some(Order::Wait { until: asked.until, writable: false });
        }
        if asked.tries < TRIES {
            self.ask_position(asked, now, notices);
            return Some(Order::Write);
        }
        self.enabling = None;
        let fault = ServoFault { servo: asked.servo, kind: ServoFaultKind::Silent };
        Some(self.end_early(Cause::Servo(fault), now))
    }
}
