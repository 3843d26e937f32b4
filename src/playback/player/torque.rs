//! Servos that are limp, that hold, and that are on their way.

use super::super::hold::{TRIES, patience};
use super::super::messages::{Cause, Notice, Order, ServoFault, ServoFaultKind, Why};
use super::Player;
use crate::board::{Board, Command, Hundredths, Report, ServoSet};
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
    /// Where it says that it is, if that is not a target.
    wrong: Option<Hundredths>,
}

/// The servos that a stop holds: those with a target.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held {
    /// Those whose last command may have been a target.
    servos: ServoSet,
    /// Of these, the ones whose last command was instant, so that they may be far from their targets.
    jumped: ServoSet,
    /// Those whose torque is switched by a frame that the port has not accepted yet.
    leaving: ServoSet,
}

impl Held {
    /// A servo gets a target.
    pub(super) fn add(&mut self, servo: i32, is_instant: bool) {
        self.servos.set(servo, true);
        self.jumped.set(servo, is_instant);
        self.leaving.set(servo, false);
    }

    /// Notes what a command does to a servo.
    pub(super) fn note(&mut self, board: &Board, command: &Command, is_instant: bool) {
        let Some(feedback) = board.feedback.as_ref().filter(|feedback| feedback.holds.is_some()) else { return };
        let Some(servo) = command.value(0) else { return };
        let preparation = feedback.preparation.as_ref();
        if command.verb() == feedback.verb {
            self.add(servo, is_instant);
        } else if preparation.is_some_and(|preparation| preparation.enable == command.verb()) {
            self.leaving.set(servo, true);
        }
    }

    /// The port has accepted all frames.
    pub(super) fn accept(&mut self) {
        for servo in std::mem::take(&mut self.leaving).iter() {
            self.servos.set(servo, false);
        }
    }
}

impl Player<'_> {
    /// The servos that a stop holds.
    pub fn held(&self) -> ServoSet {
        self.held.servos
    }

    /// Whether a stop of the board holds its servos.
    pub(super) fn holds(&self) -> bool {
        self.stops.hold.is_some()
    }

    /// A stop begins. What was prepared or switched on, but not accepted by the port, is done again if the run continues.
    pub(super) fn hold(&mut self) {
        let Player { held, start, state, board, stops, .. } = self;
        let resource = |servo| board.occupied(board.feedback.as_ref()?.verb, Some(servo)).first().copied();
        let last = |servo| state.last(resource(servo)?)?.value(1);
        let goal = |servo: i32| {
            if start.is_pending() { start.last(servo) } else { last(servo).filter(|_| !held.jumped.contains(servo)) }
        };
        stops.begin(held.servos, goal);
        held.leaving = ServoSet::default();
        self.start.restart();
        self.enabling = None;
        self.reads.give_up();
        if let Some(index) = self.switching.take().filter(|_| !self.out.is_empty()) {
            self.next = index;
        }
    }

    /// Notes what an event does to a servo.
    pub(super) fn note_servo(&mut self, event: &Event) {
        self.held.note(self.board, &event.command, event.is_instant || event.kind == Kind::Auto);
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
            self.ask_position(Enabling { servo, tries: 0, until: now, goal: None, wrong: None }, now, notices);
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
        let Some((_, position)) = report.values().next() else { return };
        match (&mut self.enabling, self.board.target(position)) {
            (Some(enabling), Some((goal, true))) => enabling.goal = Some(goal),
            (Some(enabling), _) => enabling.wrong = Some(position),
            (None, _) => {}
        }
    }

    /// Waits for the position of a servo whose torque is being switched on; `None` if it is known, or if there is no such servo.
    pub(super) fn enable(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Order> {
        let asked = self.enabling.filter(|asked| asked.goal.is_none())?;
        self.reads.forget_news();
        if let Some(position) = asked.wrong {
            let fault = ServoFault { servo: asked.servo, kind: ServoFaultKind::Position(position) };
            return Some(self.end_early(Cause::Servo(fault), now));
        }
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
