//! The loop that does what the player orders, under the real clock.
//!
//! It waits for the port and for signals until a millisecond before the deadline, or until the next beat for the guard, then
//! sleeps on the absolute deadline, so nothing drifts. After the first frame it neither allocates, locks, logs nor prints.

use std::os::fd::{AsFd, BorrowedFd};
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::company::Seat;
use super::controls::{of_key, of_signal};
use super::go_lines::GoLines;
use super::guard::{Guard, Heartbeat};
use super::messages::{Cause, Input, Notice, Order, Outcome, Piece, Standing, Stop};
use super::os::{self, Keys, Ready, Signals};
use super::player::Player;
use crate::board::ServoSet;
use crate::clock;
use crate::link::Link;
use crate::source::Lines;
use crate::units::{Micros, Nanos};

/// How long before a deadline the loop stops polling the port.
const CLOSE: Nanos = Nanos::from_millis(1);
/// How long before a deadline the loop spins instead of sleeping: longer than a computer takes to wake, and longer still for a
/// thread with real-time priority, which nothing disturbs. At 200 frames per second the first is 1 % of a processor.
const SPIN: Nanos = Micros(50).nanos();
const REALTIME_SPIN: Nanos = Micros(150).nanos();
/// How many panics end the run.
const MAX_PANICS: usize = 10;
/// The most reads of 256 bytes at once: more than a port buffers.
const MAX_READS: usize = 512;
/// How often the port and the keys are polled if frames are too close together to wait in between.
const LOOK: Nanos = Nanos::from_millis(10);

/// One run of a timeline on a board: everything it needs, created before the first frame.
#[derive(Debug)]
#[non_exhaustive]
pub struct Session<'s, L> {
    /// Decides what is sent, and when.
    pub player: Player<'s>,
    /// The connection to the board.
    pub link: L,
    /// What ends, pauses and continues the run.
    control: Control,
    /// The process that stops the robot if this process cannot.
    pub guard: Option<Guard>,
    /// The keys that continue a paused run. Without them, Ctrl-Z ends a run.
    pub keys: Option<Keys>,
    /// The lines that open gates, if they come from standard input.
    pub go: Option<GoLines>,
    /// The lines of the script, for the guard's messages.
    pub lines: Lines<'s>,
    /// Whether this thread has real-time priority.
    pub realtime: bool,
    /// The gate that waited for the operator after the last order.
    waited_for_go: Option<usize>,
    /// The servos that may be on their way, as in the last heartbeat.
    told: ServoSet,
    /// Time 0 of the run, on the clock of [`now`](super::now).
    start: Nanos,
}

/// What a session obeys, besides its port and its guard.
#[derive(Debug)]
enum Control {
    /// The signals of the system.
    Alone(Signals),
    /// What the conductor of several robots orders.
    Seat(Seat),
}

impl Control {
    /// The descriptor to poll.
    fn descriptor(&self) -> BorrowedFd<'_> {
        match self {
            Control::Alone(signals) => signals.as_fd(),
            Control::Seat(seat) => seat.as_fd(),
        }
    }

    /// Empties what woke the poll.
    fn empty(&self) {
        match self {
            Control::Alone(signals) => signals.empty(),
            Control::Seat(seat) => seat.empty(),
        }
    }
}

impl<'s, L: Link> Session<'s, L> {
    /// A session without guard, keys and real-time priority. Start the guard last: from then on the loop must run.
    pub fn new(player: Player<'s>, link: L, signals: Signals, lines: Lines<'s>) -> Self {
        Session::with(player, link, Control::Alone(signals), lines)
    }

    /// The same for one of several robots of a script.
    pub fn together(player: Player<'s>, link: L, seat: Seat, lines: Lines<'s>) -> Self {
        Session::with(player.together(), link, Control::Seat(seat), lines)
    }

    fn with(player: Player<'s>, link: L, control: Control, lines: Lines<'s>) -> Self {
        Session {
            player,
            link,
            control,
            guard: None,
            keys: None,
            go: None,
            lines,
            realtime: false,
            waited_for_go: None,
            told: ServoSet::default(),
            start: Nanos::ZERO,
        }
    }

    /// A signal that has come, if it ends or suspends the run.
    pub fn signal(&self) -> Option<i32> {
        if let Control::Alone(signals) = &self.control { signals.pending() } else { None }
    }

    /// Plays until the end, or until something ends the run early. Time 0 is `start` on the clock of [`now`](super::now), which must
    /// not be in the future. Notices are passed to `notices` immediately, from the thread that sends, so it must not block.
    ///
    /// Afterwards the terminal is restored, and the guard, if there is one, still waits for its goodbye.
    pub fn play(&mut self, start: Nanos, mut notices: impl FnMut(Notice)) -> Outcome {
        os::wake_exactly();
        self.start = start;
        self.forget_reports();
        // One copy of the code for all callers.
        let mut notices: &mut dyn FnMut(Notice) = &mut notices;
        let outcome = self.wait_for_guards().unwrap_or_else(|| self.outlive_panics(&mut notices));
        if let Control::Seat(seat) = &mut self.control {
            seat.report(Standing::Done { is_early: outcome.cause != Cause::Finished });
        }
        self.keys = None;
        if (outcome.cause, outcome.stop) == (Cause::Panicked, Stop::NotSent) {
            // If the player failed before it stopped the robot, the guard kills it and stops the robot.
            drop(self.guard.take());
        }
        if let Some(guard) = &mut self.guard {
            guard.ended(outcome.at, outcome.place.map(|span| self.lines.place(span)), outcome.stop, outcome.missing);
        }
        if outcome.stop == Stop::NotSent {
            // Bytes that the port never sent must not delay its closing.
            let _ = self.link.discard();
        }
        outcome
    }

    /// Waits until all robots of a script have their guards; returns how the run ends if they never do.
    fn wait_for_guards(&mut self) -> Option<Outcome> {
        loop {
            let Control::Seat(seat) = &mut self.control else { return None };
            seat.report(Standing::Present);
            match seat.take() {
                Some(Input::Tick) => return None,
                Some(input) => {
                    if let Some(cause) = input.end() {
                        return Some(self.player.never_began(cause));
                    }
                }
                None => {
                    let _ = os::wait([(Some(seat.as_fd()), Ready::IN)], Some(LOOK));
                    seat.empty();
                }
            }
            self.beat(true);
        }
    }

    /// Stops the robot even after a panic. A step of the stop that panics again is skipped.
    fn outlive_panics(&mut self, notices: &mut impl FnMut(Notice)) -> Outcome {
        let mut input = Input::Tick;
        for _ in 0..MAX_PANICS {
            match catch_unwind(AssertUnwindSafe(|| self.run(input, notices))) {
                Ok(outcome) => return outcome,
                Err(_) => input = Input::Panicked,
            }
        }
        self.player.give_up(self.time())
    }

    /// The time since the start.
    fn time(&self) -> Nanos {
        clock::now() - self.start
    }

    fn run(&mut self, mut input: Input, notices: &mut impl FnMut(Notice)) -> Outcome {
        let mut look_at = Nanos::ZERO;
        loop {
            if input == Input::Tick {
                input = self.pending();
            }
            let now = clock::now();
            if input == Input::Tick && now >= look_at {
                look_at = now.saturating_add(LOOK);
                input = self.look(now, false, false, notices);
            }
            if input == Input::Tick && self.guard.as_mut().is_some_and(Guard::is_newly_lost) {
                input = Input::Unguarded;
            }
            self.beat(false);
            // Also if deadlines are too close together to poll the port in between. Limited, so that a flood of bytes cannot keep the
            // loop here.
            if input == Input::Tick && self.player.judges_at(self.time()) {
                input = self.read(MAX_READS, notices);
            }
            let order = self.player.poll(self.time(), input, notices);
            self.forget_early_keys();
            self.tell_standing();
            if let Some(outcome) = self.player.outcome() {
                return outcome;
            }
            input = match order {
                // Signals are checked before every write.
                Order::Write => match self.pending() {
                    Input::Tick => {
                        self.tell_moving();
                        self.write(notices)
                    }
                    input => input,
                },
                Order::Halt { discards } => {
                    if discards {
                        // If the port is gone, the stop reports it.
                        let _ = self.link.discard();
                    }
                    // An answer from before must not be taken for one of the stop.
                    self.read(MAX_READS, notices);
                    Input::Tick
                }
                Order::Wait { until, writable } => self.wait(self.start.saturating_add(until), writable, notices),
                Order::Pause { until } => self.pause(self.start.saturating_add(until)),
                Order::Suspend => self.suspend(notices),
                Order::Stay if matches!(self.control, Control::Seat(_)) => self.stay_together(notices),
                Order::Stay => self.stay(notices),
                Order::Done => Input::Tick,
            };
        }
    }

    /// What has come from outside, without waiting.
    fn pending(&mut self) -> Input {
        match &mut self.control {
            Control::Alone(signals) => {
                signals.pending().map_or(Input::Tick, |signal| of_signal(signal, self.keys.is_some()))
            }
            Control::Seat(seat) => seat.take().unwrap_or(Input::Tick),
        }
    }

    /// Tells the conductor what the player waits for.
    fn tell_standing(&mut self) {
        let now = self.time();
        if let Control::Seat(seat) = &mut self.control {
            seat.report(self.player.standing(now));
        }
    }

    /// Writes the player's bytes to the port.
    fn write(&mut self, notices: &mut impl FnMut(Notice)) -> Input {
        let bytes = self.player.bytes();
        let result = self.link.write(bytes);
        let taken = result.as_ref().ok().and_then(|count| bytes.get(..*count));
        Piece::all(taken.unwrap_or_default()).for_each(|piece| notices(Notice::Wrote(piece)));
        Input::of_write(result)
    }

    /// Discards keys that were pressed before a gate began to wait for one.
    fn forget_early_keys(&mut self) {
        let gate = self.player.closed_gate().filter(|_| self.player.waits_for_go());
        let has_begun = std::mem::replace(&mut self.waited_for_go, gate) != gate && gate.is_some();
        if let Some(keys) = self.keys.as_ref().filter(|_| has_begun) {
            keys.forget();
        }
    }

    /// Discards reports from before the run.
    fn forget_reports(&mut self) {
        for _ in 0..MAX_READS {
            if !matches!(self.link.read(&mut [0; 256]), Ok(1..)) {
                break;
            }
        }
    }

    /// Reads received reports without waiting, in at most `reads` reads.
    fn read(&mut self, reads: usize, notices: &mut impl FnMut(Notice)) -> Input {
        let mut buffer = [0; 256];
        for _ in 0..reads {
            let bytes = match self.link.read(&mut buffer) {
                Ok(0) => return Input::HungUp,
                Ok(count) => buffer.get(..count).unwrap_or_default(),
                Err(error) => match Input::of_write(Err(error)) {
                    Input::Failed(error) => return Input::Failed(error),
                    _ => break,
                },
            };
            self.player.receive(clock::now() - self.start, bytes, notices);
        }
        Input::Tick
    }

    /// Sends a heartbeat to the guard, if it is due or if there is time for it.
    fn beat(&mut self, has_time: bool) {
        let now = clock::now();
        if self.guard.as_ref().is_some_and(|guard| guard.wants_beat(now, has_time)) {
            self.send_beat(now);
        }
    }

    /// Sends the guard a heartbeat before a frame that changes which servos may be on their way.
    fn tell_moving(&mut self) {
        if self.player.held() != self.told {
            self.send_beat(clock::now());
        }
    }

    fn send_beat(&mut self, now: Nanos) {
        self.told = self.player.held();
        if let Some(guard) = self.guard.as_mut().filter(|guard| guard.descriptor().is_some()) {
            let place = self.player.place().map(|span| self.lines.place(span));
            // The keys of several robots are the conductor's, and every guard can restore the terminal.
            let keys = self.keys.as_ref().map_or(matches!(self.control, Control::Seat(_)), Keys::is_single);
            let at = self.player.run_time(now - self.start).micros();
            guard.beat(now, Heartbeat { at, place, keys, moving: self.told });
        }
    }

    /// When the loop must be awake for the next heartbeat.
    fn next_beat(&self) -> Nanos {
        self.guard.as_ref().map_or(Nanos::MAX, Guard::deadline)
    }

    /// Waits until `deadline` on the clock, or for an input.
    fn wait(&mut self, deadline: Nanos, writable: bool, notices: &mut impl FnMut(Notice)) -> Input {
        loop {
            let left = deadline.saturating_sub(clock::now());
            if left <= CLOSE && !writable {
                close_in(deadline, self.realtime);
                return Input::Tick;
            }
            self.beat(left > CLOSE * 2);
            let until = if writable { deadline } else { deadline - CLOSE };
            let input = self.look(until, writable, false, notices);
            if input != Input::Tick || writable || self.player.has_news() {
                return input;
            }
        }
    }

    /// Polls the port, signals, the guard and, if requested, the keys once, until a time on the clock or the next heartbeat.
    fn look(&mut self, until: Nanos, writable: bool, keys: bool, notices: &mut impl FnMut(Notice)) -> Input {
        if let Control::Seat(seat) = &mut self.control
            && let Some(input) = seat.take()
        {
            // Several orders may have come together.
            return input;
        }
        let is_paused = keys;
        let waits_for_go = !is_paused && self.player.waits_for_go();
        if let Some(input) = self.go.as_mut().filter(|_| waits_for_go).and_then(GoLines::take) {
            return input;
        }
        let timeout = until.min(self.next_beat()).saturating_sub(clock::now());
        let keys = self.keys.as_ref().filter(|single| is_paused || waits_for_go || single.is_single());
        let go = self.go.as_ref().filter(|_| waits_for_go);
        let port = if writable { Ready::IN | Ready::OUT } else { Ready::IN };
        let watched = [
            (Some(self.link.descriptor()), port),
            (Some(self.control.descriptor()), Ready::IN),
            (self.guard.as_ref().and_then(Guard::descriptor), Ready::IN),
            (keys.and_then(Keys::descriptor), Ready::IN),
            (go.and_then(GoLines::descriptor), Ready::IN),
        ];
        let [port, signal, guard, key, go] = match os::wait(watched, Some(timeout)) {
            Ok(ready) => ready,
            Err(error) => return Input::Failed(error.raw_os_error()),
        };
        if !signal.is_empty() {
            self.control.empty();
            match self.pending() {
                Input::Tick => {}
                input => return input,
            }
        }
        if !guard.is_empty()
            && let Some(guard) = &mut self.guard
        {
            guard.lose();
        }
        if self.guard.as_mut().is_some_and(Guard::is_newly_lost) {
            return Input::Unguarded;
        }
        if port.contains(Ready::IN) {
            let input = self.read(1, notices);
            if input != Input::Tick {
                return input;
            }
        }
        if os::is_gone(port) {
            return Input::HungUp;
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

    /// Waits until `deadline` on the clock, ignoring all inputs; sends heartbeats.
    fn pause(&mut self, deadline: Nanos) -> Input {
        while clock::now() < deadline {
            self.beat(false);
            clock::sleep_until(deadline.min(self.next_beat()));
        }
        Input::Tick
    }

    /// The time of the script, now.
    fn script_time(&self) -> Micros {
        self.player.script_time(self.time()).micros()
    }

    /// The robot is paused, and so are the others: waits for what all do next.
    fn stay_together(&mut self, notices: &mut impl FnMut(Notice)) -> Input {
        loop {
            self.beat(true);
            let input = self.look(clock::now().saturating_add(CLOSE * 100), false, false, notices);
            if input != Input::Tick {
                return input;
            }
        }
    }

    /// The robot is stopped: suspends this process until the shell continues it.
    fn suspend(&mut self, notices: &mut impl FnMut(Notice)) -> Input {
        let place = self.player.place().map(|span| self.lines.place(span));
        let (at, run_time) = (self.script_time(), self.player.run_time(self.time()).micros());
        if let Some(guard) = &mut self.guard {
            guard.rest(run_time, place);
        }
        let signals = match &mut self.control {
            Control::Alone(signals) => signals,
            // The conductor suspends the process once all robots rest. Until it is awake, no heartbeat may wake the guard.
            Control::Seat(seat) => return seat.sleep(self.player.standing(clock::now() - self.start)),
        };
        notices(Notice::Sleeping { at });
        // The observer thread, which is suspended too, needs time to show it.
        clock::sleep_until(clock::now().saturating_add(CLOSE * 100));
        if let Some(keys) = &mut self.keys {
            keys.end();
        }
        signals.suspend();
        Input::Tick
    }

    /// Waits for a key that continues the run, and reports the pause once a key can be pressed.
    fn stay(&mut self, notices: &mut impl FnMut(Notice)) -> Input {
        let mut can_continue = false;
        loop {
            self.beat(true);
            let at = self.script_time();
            let keys = self.keys.as_ref().filter(|keys| keys.descriptor().is_some());
            let could_continue = std::mem::replace(&mut can_continue, keys.is_some());
            if let Some(keys) = self.keys.as_mut().filter(|_| can_continue && !could_continue) {
                keys.begin();
                // Discard keys typed before the pause.
                if keys.reported.is_none() {
                    keys.forget();
                }
                // The same pause is not reported again after the help key.
                if keys.reported.replace(at) != Some(at) {
                    notices(Notice::Paused { at });
                }
            }
            // Wakes regularly to check whether this process is in the foreground again.
            let until = clock::now().saturating_add(CLOSE * 100);
            // Reports during a pause are not shown, but the newest one is kept.
            match self.look(until, false, true, notices) {
                Input::Tick => {}
                input => {
                    if let (Input::Resume | Input::Suspend, Some(keys)) = (input, &mut self.keys) {
                        keys.reported = None;
                    }
                    return input;
                }
            }
        }
    }
}

/// Waits during the last millisecond before a deadline.
pub(super) fn close_in(deadline: Nanos, realtime: bool) {
    let spin = if realtime { REALTIME_SPIN } else { SPIN };
    clock::sleep_until(deadline.saturating_sub(spin));
    while clock::now() < deadline {
        std::hint::spin_loop();
    }
}
