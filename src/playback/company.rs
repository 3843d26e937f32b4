//! Several robots of one script under the real clock: the sessions, one thread each, and the thread that conducts them.
//!
//! A session and its conductor pass fixed-size messages to each other through bounded queues, and wake each other by an event
//! descriptor. The conductor has what there is once for all robots: signals, keys, and the lines that open gates.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::conductor::Conductor;
use super::controls::{of_key, of_signal};
use super::go_lines::GoLines;
use super::messages::{Input, Notice, Standing};
use super::os::{self, Bell, Keys, Ready, Signals};
use crate::clock;
use crate::units::Nanos;

/// How many messages fit in a queue. An order is followed within milliseconds.
const ROOM: usize = 256;
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
    /// What the conductor heard last.
    heard: Standing,
}

impl Seat {
    /// The next order.
    pub(super) fn take(&mut self) -> Option<Input> {
        self.orders.try_recv().ok()
    }

    pub(super) fn empty(&self) {
        self.bell.empty();
    }

    /// Tells the conductor what the player waits for, if that has changed.
    pub(super) fn tell(&mut self, standing: Standing) {
        if standing != self.heard && self.news.try_send((self.robot, standing)).is_ok() {
            self.heard = standing;
            self.conductor.ring();
        }
    }

    /// Rests until the next order.
    pub(super) fn sleep(&mut self, standing: Standing) -> Input {
        self.tell(standing);
        loop {
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
        if !matches!(self.heard, Standing::Done { .. }) {
            // The others must not wait for a thread that has failed.
            self.tell(Standing::Done { is_early: true });
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
    /// The gate that waited for the operator at the last look.
    waited: Option<(u64, usize)>,
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
            seats.push(Seat { robot, orders: taken, bell: own, news, conductor, heard: Standing::Busy });
        }
        let conductor = Conductor::new(robots);
        let (keys, go) = (None, None);
        Ok((Company { signals, keys, go, conductor, orders, news: heard, bell, suspends: false, waited: None }, seats))
    }

    /// Conducts until all robots have ended; returns the robot that ended early first. Time 0 of the sessions is `start`. `notices`
    /// gets what is true for all robots: pauses, and questions for the keys.
    pub fn conduct(&mut self, start: Nanos, mut notices: impl FnMut(Notice)) -> Option<usize> {
        loop {
            while let Ok((robot, standing)) = self.news.try_recv() {
                self.conductor.hear(robot, standing);
                self.order(start, Input::Tick);
            }
            if self.conductor.is_done() {
                self.keys = None;
                return self.conductor.first_ended();
            }
            if let Some(at) = self.conductor.paused_at() {
                self.rest(at, &mut notices);
            }
            self.forget_early_keys();
            let input = self.look();
            if input == Input::Help {
                notices(Notice::Help);
            }
            if let (Input::Resume | Input::Suspend, Some(keys)) = (input, &mut self.keys) {
                keys.reported = None;
            }
            self.suspends |= input == Input::Suspend;
            self.order(start, input);
        }
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
        if let Some(input) = self.go.as_mut().filter(|_| waits_for_go).and_then(GoLines::take) {
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
            return lines.take().unwrap_or(Input::Tick);
        }
        match (key.is_empty(), &mut self.keys) {
            (false, Some(keys)) => keys.key().map_or(Input::Tick, |key| of_key(key, keys, is_paused, waits_for_go)),
            _ => Input::Tick,
        }
    }
}
