//! A stop that holds: reads where each servo on its way is, and makes that its target.

use std::sync::Arc;

use super::messages::{Order, Stop};
use super::outbox::Outbox;
use crate::board::{Board, Command, Feedback, Replies, ReportDecoder, ReportItem, ServoSet};
use crate::units::Nanos;

/// How often a servo is asked.
pub(super) const TRIES: u8 = 2;

/// How long an answer of this board may take.
pub(super) fn patience(board: &Board) -> Nanos {
    match board.replies {
        Replies::Answers(answers) => answers.patience,
        Replies::None | Replies::Lines(_) => Nanos::ZERO,
    }
}

/// Holds servos, one after another. One that does not answer is asked again after the others, so that it delays none of them.
#[derive(Debug)]
pub(crate) struct Hold {
    board: Arc<Board>,
    decoder: ReportDecoder,
    /// The servos that are still to be held, and those that did not answer yet.
    left: ServoSet,
    silent: ServoSet,
    /// The targets of moves: a servo that is near its own is left alone.
    goals: Vec<Option<i32>>,
    /// The servo that is being asked, and until when it may answer.
    asked: Option<(i32, Nanos)>,
    /// Its answer, as a target.
    target: Option<i32>,
    /// Whether that target is on its way to the port.
    is_set: bool,
    /// Whether the silent servos are asked again.
    is_last: bool,
    /// The servos that did not say where they are.
    missing: ServoSet,
}

impl Hold {
    /// For a board whose stop holds.
    pub(super) fn of(board: &Arc<Board>) -> Option<Self> {
        board.feedback.as_ref()?.holds?;
        Some(Hold {
            board: Arc::clone(board),
            decoder: ReportDecoder::new(board),
            left: ServoSet::default(),
            silent: ServoSet::default(),
            goals: vec![None; 256],
            asked: None,
            target: None,
            is_set: false,
            is_last: false,
            missing: ServoSet::default(),
        })
    }

    /// Begins to hold these servos; `goal` is the target of a servo that has followed a move.
    pub(crate) fn begin(&mut self, servos: ServoSet, goal: impl Fn(i32) -> Option<i32>) {
        (self.left, self.silent, self.missing, self.is_last) =
            (servos, ServoSet::default(), ServoSet::default(), false);
        (0..)
            .zip(&mut self.goals)
            .for_each(|(servo, place)| *place = Some(servo).filter(|_| servos.contains(servo)).and_then(&goal));
        self.ask_again();
    }

    /// Forgets what was asked and what was on its way.
    pub(super) fn ask_again(&mut self) {
        (self.asked, self.target, self.is_set) = (None, None, false);
        self.decoder.give_up();
    }

    /// Takes bytes of the board.
    pub(super) fn hear(&mut self, mut bytes: &[u8]) {
        while let Some(item) = self.decoder.next(&mut bytes) {
            if let ReportItem::Report(report) = item {
                let position = report.values().next();
                self.target = position.and_then(|(_, position)| self.board.target(position)).map(|(target, _)| target);
            }
        }
    }

    /// Whether the awaited answer has come.
    pub(super) fn has_news(&self) -> bool {
        self.asked.is_some() && !self.decoder.is_waiting()
    }

    /// The next frame, in `out`, which must be empty; `None` once every servo is held or did not answer.
    pub(super) fn poll(&mut self, now: Nanos, out: &mut Outbox) -> Option<Order> {
        let Feedback { verb, holds: Some(near), .. } = *self.board.feedback.as_ref()? else { return None };
        loop {
            let Some((servo, until)) = self.asked else {
                if self.left.is_empty() && !self.is_last {
                    (self.left, self.silent, self.is_last) = (self.silent, ServoSet::default(), true);
                }
                let next = self.left.iter().next();
                return next.map(|servo| self.ask(servo, now, out));
            };
            if std::mem::take(&mut self.is_set) {
                self.done(servo);
                continue;
            }
            if let Some(target) = self.target.take() {
                let goal = usize::try_from(servo).ok().and_then(|servo| self.goals.get(servo).copied().flatten());
                if goal.is_some_and(|goal| (goal - target).abs() <= near) {
                    self.done(servo);
                    continue;
                }
                self.is_set = true;
                out.push(|bytes| self.board.encode(&Command::new(verb, &[servo, target]), bytes));
                return Some(Order::Write);
            }
            if self.decoder.is_waiting() && now < until {
                return Some(Order::Wait { until, writable: false });
            }
            let silent = if self.is_last { &mut self.missing } else { &mut self.silent };
            silent.set(servo, true);
            self.done(servo);
        }
    }

    fn done(&mut self, servo: i32) {
        self.left.set(servo, false);
        self.asked = None;
    }

    fn ask(&mut self, servo: i32, now: Nanos, out: &mut Outbox) -> Order {
        if let Some(Feedback { position, .. }) = self.board.feedback {
            let request = Command::new(position, &[servo]);
            out.push(|bytes| self.board.encode(&request, bytes));
            self.decoder.ask(&request);
        }
        self.asked = Some((servo, now.saturating_add(patience(&self.board))));
        Order::Write
    }

    /// Whether the servos hold.
    pub(super) fn stop(&self) -> Stop {
        match (self.left.is_empty() && self.silent.is_empty(), self.missing.is_empty()) {
            (false, _) => Stop::NotSent,
            (true, false) => Stop::NotHeld,
            (true, true) => Stop::Held,
        }
    }

    /// The servos that did not say where they are, or that the port did not reach.
    pub(super) fn missing(&self) -> ServoSet {
        self.missing.iter().chain(self.left.iter()).chain(self.silent.iter()).collect()
    }
}
