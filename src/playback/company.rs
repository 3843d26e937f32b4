//! Several robots of one script under the real clock: the sessions, one thread each, and the thread that conducts them.
//!
//! A session and its conductor pass fixed-size messages to each other through bounded queues, and wake each other by an event
//! descriptor. While a robot moves, its session only tries to send and to take, which neither allocates nor waits. The conductor has
//! what there is once for all robots: signals, keys, and the lines that open gates.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

use super::conductor::Conductor;
use super::controls::{of_key, of_signal};
use super::go_lines::GoLines;
use super::messages::{Input, Notice, Standing};
use super::os::{self, Bell, Keys, Ready, Signals};
use crate::clock;
use crate::units::Nanos;

/// How many messages fit in a queue. An order is followed within milliseconds.
const ROOM: usize = 256;
/// How many panics end the conductor.
const MAX_PANICS: usize = 10;
/// How often the conductor looks at the keys, at most: this process may be in the foreground again.
const LOOK: Nanos = Nanos::from_millis(100);

/// What one session has of the conductor.
#[derive(Debug)]
pub struct Seat {
    robot: usize,
    orders: Receiver<Input>,
    bell: Bell,
    news: SyncSender<(usize, Standing)>,
    conductor: Bell,
    /// What the conductor heard last, since the last order.
    heard: Option<Standing>,
}

impl Seat {
    /// The next order.
    pub(super) fn take(&mut self) -> Option<Input> {
        let order = match self.orders.try_recv() {
            Ok(order) => order,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => Input::Panicked,
        };
        // The conductor takes it that the standing has changed.
        self.heard = None;
        Some(order)
    }

    pub(super) fn empty(&self) {
        self.bell.empty();
    }

    /// Reports what the player waits for, if that has changed.
    pub(super) fn report(&mut self, standing: Standing) {
        if self.heard == Some(standing) {
            return;
        }
        let news = (self.robot, standing);
        // At the end, there is time to wait for room.
        let is_last = matches!(standing, Standing::Done { .. });
        let is_sent = if is_last { self.news.send(news).is_ok() } else { self.news.try_send(news).is_ok() };
        if is_sent {
            self.heard = Some(standing);
            self.conductor.ring();
        }
    }

    /// Rests until the next order.
    pub(super) fn sleep(&mut self, standing: Standing) -> Input {
        let standing = match standing {
            Standing::Paused { at, next, prepares, .. } => Standing::Paused { at, next, prepares, is_asleep: true },
            other => other,
        };
        loop {
            self.report(standing);
            if let Some(input) = self.take() {
                return input;
            }
            if os::wait([(Some(self.bell.as_fd()), Ready::IN)], None).is_err() {
                return Input::Tick;
            }
            self.empty();
        }
    }
}

impl AsFd for Seat {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.bell.as_fd()
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        if !matches!(self.heard, Some(Standing::Done { .. })) {
            // The others must not wait for a thread that has failed.
            self.report(Standing::Done { is_early: true });
        }
    }
}

/// What the thread has that conducts several robots.
#[derive(Debug)]
#[non_exhaustive]
pub struct Company {
    /// The signals that end the run early.
    pub signals: Signals,
    /// The keys that continue a paused run. Without them, Ctrl-Z ends a run.
    pub keys: Option<Keys>,
    /// The lines that open gates, if they come from standard input.
    pub go: Option<GoLines>,
    conductor: Conductor,
    orders: Vec<(SyncSender<Input>, Bell)>,
    news: Receiver<(usize, Standing)>,
    bell: Bell,
    /// Whether the process is suspended once all robots rest.
    suspends: bool,
    /// The gate that waited for the operator at the last look, and the one for which the lines have ended.
    waited: Option<(u64, usize)>,
    unanswered: Option<(u64, usize)>,
    /// The signal that ended the run, if one did.
    signal: Option<i32>,
    /// Whether the keys are read.
    has_begun: bool,
}

impl Company {
    /// A company of this number of robots, and the seats of their sessions.
    ///
    /// # Errors
    /// If the system refuses a descriptor.
    pub fn new(robots: usize, signals: Signals) -> io::Result<(Self, Vec<Seat>)> {
        let (news, heard) = sync_channel(ROOM);
        let bell = Bell::new()?;
        let (mut orders, mut seats) = (Vec::new(), Vec::new());
        for robot in 0..robots {
            let (order, taken) = sync_channel(ROOM);
            let own = Bell::new()?;
            orders.push((order, own.clone()));
            let (news, conductor) = (news.clone(), bell.clone());
            seats.push(Seat { robot, orders: taken, bell: own, news, conductor, heard: None });
        }
        let conductor = Conductor::new(robots);
        Ok((
            Company {
                signals,
                keys: None,
                go: None,
                conductor,
                orders,
                news: heard,
                bell,
                suspends: false,
                waited: None,
                unanswered: None,
                signal: None,
                has_begun: false,
            },
            seats,
        ))
    }

    /// The signal that ended the run, if one did.
    pub fn signal(&self) -> Option<i32> {
        self.signal
    }

    /// Conducts until all robots have ended; returns the robot that ended early first. Time 0 of the sessions is `start`. `notices`
    /// gets what is true for all robots: pauses, and questions for the keys.
    pub fn conduct(&mut self, start: Nanos, mut notices: impl FnMut(Notice)) -> Option<usize> {
        let mut panics = 0;
        // If the conductor fails again and again, the sessions have long had the order to end.
        while panics < MAX_PANICS {
            match catch_unwind(AssertUnwindSafe(|| self.turn(start, &mut notices))) {
                Ok(true) => {}
                Ok(false) => break,
                Err(_) => {
                    panics += 1;
                    self.order(start, Input::Panicked);
                }
            }
        }
        self.keys = None;
        self.conductor.first_ended()
    }

    /// Does what is next; returns whether there is more to do.
    fn turn(&mut self, start: Nanos, notices: &mut impl FnMut(Notice)) -> bool {
        while let Ok((robot, standing)) = self.news.try_recv() {
            self.conductor.hear(robot, standing);
            if self.conductor.is_assembled() && !std::mem::replace(&mut self.has_begun, true) {
                // The guards have saved the state of the terminal.
                self.keys.iter_mut().for_each(Keys::begin);
            }
            self.order(start, Input::Tick);
        }
        if self.conductor.is_done() {
            return false;
        }
        if let Some(at) = self.conductor.paused_at() {
            self.rest(at, notices);
        }
        self.forget_early_keys();
        let input = self.look();
        if let Input::Signal(signal) = input {
            self.signal.get_or_insert(signal);
        }
        if input == Input::Help {
            notices(Notice::Help);
        }
        if let (Input::Resume | Input::Suspend, Some(keys)) = (input, &mut self.keys) {
            keys.reported = None;
        }
        self.suspends |= input == Input::Suspend;
        self.order(start, input);
        true
    }

    fn order(&mut self, start: Nanos, input: Input) {
        let Company { conductor, orders, .. } = self;
        conductor.poll(clock::now() - start, input, &mut |robot, input| {
            if let Some((order, bell)) = orders.get(robot) {
                // A session that takes no orders has ended, or its guard ends it.
                let _ = order.try_send(input);
                bell.ring();
            }
        });
    }

    /// All robots are paused: suspends the process if that was asked for, and reports the pause once a key can continue it.
    fn rest(&mut self, at: Nanos, notices: &mut impl FnMut(Notice)) {
        let at = at.micros();
        if self.suspends && !self.conductor.is_asleep() {
            return;
        }
        if std::mem::take(&mut self.suspends) {
            notices(Notice::Sleeping { at });
            // The observer thread, which is suspended too, needs time to show it.
            clock::sleep_until(clock::now().saturating_add(LOOK));
            if let Some(keys) = &mut self.keys {
                keys.end();
            }
            self.signals.suspend();
            for (order, bell) in &self.orders {
                let _ = order.try_send(Input::Tick);
                bell.ring();
            }
        }
        let Some(keys) = self.keys.as_mut().filter(|keys| keys.descriptor().is_some()) else { return };
        keys.begin();
        // Keys typed before the pause do not count.
        if keys.reported.is_none() {
            keys.forget();
        }
        if keys.reported.replace(at) != Some(at) {
            notices(Notice::Paused { at });
        }
    }

    /// Discards keys that were pressed before a gate began to wait for one.
    fn forget_early_keys(&mut self) {
        let waits = self.conductor.closed_gate().filter(|_| self.conductor.waits_for_go());
        if let Some(keys) = self.keys.as_ref().filter(|_| waits.is_some() && waits != self.waited) {
            keys.forget();
        }
        self.waited = waits;
    }

    /// Waits for a signal, a key, a line or news.
    fn look(&mut self) -> Input {
        if let Some(signal) = self.signals.pending() {
            return of_signal(signal, self.keys.is_some());
        }
        let (is_paused, waits_for_go) = (self.conductor.paused_at().is_some(), self.conductor.waits_for_go());
        let closed = self.conductor.closed_gate();
        let is_news = waits_for_go && closed != self.unanswered;
        if let Some(input) = self.go.as_mut().filter(|_| is_news).and_then(GoLines::take) {
            if input == Input::GoEnded {
                self.unanswered = closed;
            }
            return input;
        }
        let keys = self.keys.as_ref().filter(|keys| is_paused || waits_for_go || keys.is_single());
        let go = self.go.as_ref().filter(|_| waits_for_go);
        let watched = [
            (Some(self.bell.as_fd()), Ready::IN),
            (Some(self.signals.as_fd()), Ready::IN),
            (keys.and_then(Keys::descriptor), Ready::IN),
            (go.and_then(GoLines::descriptor), Ready::IN),
        ];
        let Ok([news, signal, key, go]) = os::wait(watched, Some(LOOK)) else { return Input::Tick };
        if !news.is_empty() {
            self.bell.empty();
        }
        if !signal.is_empty()
            && let Some(signal) = self.signals.take()
        {
            return of_signal(signal, self.keys.is_some());
        }
        if let Some(lines) = self.go.as_mut().filter(|_| !go.is_empty()) {
            lines.read();
            return Input::Tick;
        }
        match (key.is_empty(), &mut self.keys) {
            (false, Some(keys)) => keys.key().map_or(Input::Tick, |key| of_key(key, keys, is_paused, waits_for_go)),
            _ => Input::Tick,
        }
    }
}
