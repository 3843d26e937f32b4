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

/// Holds servos, one after another.
#[derive(Debug)]
pub(crate) struct Hold {
    board: Arc<Board>,
    decoder: ReportDecoder,
    /// The servos that are still to be held.
    left: ServoSet,
    /// The servo that is being asked, how often it was asked, and until when it may answer.
    asked: Option<(i32, u8, Nanos)>,
    /// Its answer, as a target.
    target: Option<i32>,
    /// Whether that target is on its way to the port.
    is_set: bool,
    /// The servos that did not say where they are.
    missing: ServoSet,
}

impl Hold {
    /// For a board whose stop holds.
    pub(super) fn of(board: &Arc<Board>) -> Option<Self> {
        board.feedback.as_ref().filter(|feedback| feedback.holds)?;
        Some(Hold {
            board: Arc::clone(board),
            decoder: ReportDecoder::new(board),
            left: ServoSet::default(),
            asked: None,
            target: None,
            is_set: false,
            missing: ServoSet::default(),
        })
    }

    /// Begins to hold these servos.
    pub(crate) fn begin(&mut self, servos: ServoSet) {
        (self.left, self.asked, self.target, self.missing) = (servos, None, None, ServoSet::default());
        self.is_set = false;
        self.decoder.give_up();
    }

    /// Takes bytes of the board.
    pub(super) fn hear(&mut self, mut bytes: &[u8]) {
        let Some(Feedback { value, .. }) = self.board.feedback else { return };
        while let Some(item) = self.decoder.next(&mut bytes) {
            if let ReportItem::Report(report) = item {
                self.target = report.values().next().and_then(|(_, position)| value(position));
            }
        }
    }

    /// Whether the awaited answer has come.
    pub(super) fn has_news(&self) -> bool {
        self.asked.is_some() && !self.decoder.is_waiting()
    }

    /// The next frame, in `out`, which must be empty; `None` once every servo is held or did not answer.
    pub(super) fn poll(&mut self, now: Nanos, out: &mut Outbox) -> Option<Order> {
        let verb = self.board.feedback.as_ref()?.verb;
        loop {
            let Some((servo, tries, until)) = self.asked else {
                let next = self.left.iter().next();
                return next.map(|servo| self.ask(servo, 1, now, out));
            };
            if std::mem::take(&mut self.is_set) {
                self.done(servo);
                continue;
            }
            if let Some(target) = self.target.take() {
                self.is_set = true;
                out.push(|bytes| self.board.encode(&Command::new(verb, &[servo, target]), bytes));
                return Some(Order::Write);
            }
            if self.decoder.is_waiting() && now < until {
                return Some(Order::Wait { until, writable: false });
            }
            if tries < TRIES {
                return Some(self.ask(servo, tries + 1, now, out));
            }
            self.missing.set(servo, true);
            self.done(servo);
        }
    }

    fn done(&mut self, servo: i32) {
        self.left.set(servo, false);
        self.asked = None;
    }

    fn ask(&mut self, servo: i32, tries: u8, now: Nanos, out: &mut Outbox) -> Order {
        if let Some(Feedback { position, .. }) = self.board.feedback {
            let request = Command::new(position, &[servo]);
            out.push(|bytes| self.board.encode(&request, bytes));
            self.decoder.ask(&request);
        }
        self.asked = Some((servo, tries, now.saturating_add(patience(&self.board))));
        Order::Write
    }

    /// Whether the servos hold.
    pub(super) fn stop(&self) -> Stop {
        match (self.left.is_empty(), self.missing.is_empty()) {
            (false, _) => Stop::NotSent,
            (true, false) => Stop::NotHeld,
            (true, true) => Stop::Held,
        }
    }

    /// The servos that did not say where they are, or that the port did not reach.
    pub(super) fn missing(&self) -> ServoSet {
        self.missing.iter().chain(self.left.iter()).collect()
    }
}
