//! A whole run on the virtual board under a clock that jumps: the same player, a line that takes its time, no waiting.

use std::collections::VecDeque;
use std::sync::Arc;

use super::answers::{self, Answer, Answers};
use crate::board::{Command, Decoder, Item};
use crate::faults::{Faults, Faulty, Stall};
use crate::playback::{Cause, Conductor, Input, Notice, Order, Outcome, Passage, Player, Verdict};
use crate::sim::{Device, Received, Settings};
use crate::timeline::{Kind, Moment, Timeline};
use crate::units::{Micros, Nanos, byte_time};

/// What is later than this ends a run, as on a real port: only where the port stalls.
const MAX_LATE: Nanos = Nanos::from_millis(50);

/// What became of a rehearsal.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Rehearsal {
    /// How the run ended.
    pub outcome: Outcome,
    /// What became of each `expect` that was judged.
    pub verdicts: Vec<Verdict>,
    /// The gates that closed, and how each ended.
    pub passages: Vec<Passage>,
    /// How many frames of the timeline the port was given, one after another and byte for byte.
    pub given: usize,
    /// What was written to the port after the end of the motion: the stop, `on abort`. Times count from the start of the script.
    pub aborted: Vec<Moment>,
    /// What the board has received.
    pub received: Received,
}

/// The port, the line and the board.
struct Line<'t> {
    board: Faulty,
    /// What is on its way: when it has arrived, and the bytes.
    coming: VecDeque<(Nanos, Vec<u8>)>,
    busy_until: Nanos,
    byte_time: Nanos,
    timeline: &'t Timeline,
    given: usize,
    decoder: Decoder,
    aborted: Vec<Moment>,
    /// Whether the motion has ended, and the stop goes out.
    ending: bool,
}

/// Plays a timeline on a board with these settings and faults. Gates open by these answers, or as the board reports.
pub fn rehearse(timeline: &Timeline, settings: Settings, faults: Faults, answers: &Answers) -> Rehearsal {
    let mut actor = Actor::new(timeline, settings, faults, answers, false);
    let mut now = Nanos::ZERO;
    loop {
        if let Some(outcome) = actor.act(now) {
            return actor.end(now, outcome);
        }
        now = actor.next(now);
        actor.pass(now);
    }
}

/// The same for several robots of one script, each with its faults, which play together.
pub fn rehearse_together(
    timelines: &[Timeline],
    settings: &Settings,
    faults: &[Faults],
    answers: &Answers,
) -> Vec<Rehearsal> {
    let robots = timelines.iter().zip(faults);
    let mut actors: Vec<Actor<'_, '_>> = robots
        .map(|(timeline, faults)| Actor::new(timeline, settings.clone(), faults.clone(), answers, true))
        .collect();
    let mut outcomes: Vec<Option<Outcome>> = vec![None; actors.len()];
    let mut conductor = Conductor::new(actors.len());
    let mut now = Nanos::ZERO;
    while outcomes.iter().any(Option::is_none) {
        for (robot, (actor, outcome)) in actors.iter_mut().zip(&mut outcomes).enumerate() {
            if outcome.is_none() {
                *outcome = actor.act(now);
                conductor.hear(robot, actor.player.standing(now));
            }
        }
        // The operator is one person.
        let goes = actors.iter_mut().map(|actor| std::mem::take(&mut actor.goes)).fold(false, |any, goes| any | goes);
        let input = if goes { Input::Go } else { Input::Tick };
        let mut is_ordered = false;
        conductor.poll(now, input, &mut |robot, input| {
            if let Some(actor) = actors.get_mut(robot) {
                actor.orders.push_back(input);
                is_ordered = true;
            }
        });
        if is_ordered {
            continue;
        }
        let playing = || actors.iter().zip(&outcomes).filter(|(_, outcome)| outcome.is_none());
        now = playing().map(|(actor, _)| actor.next(now)).min().unwrap_or(now);
        for (actor, _) in actors.iter_mut().zip(&outcomes).filter(|(_, outcome)| outcome.is_none()) {
            actor.pass(now);
        }
    }
    let ended = actors.into_iter().zip(outcomes);
    ended.filter_map(|(actor, outcome)| Some(actor.end(now, outcome?))).collect()
}

/// One robot of a rehearsal.
struct Actor<'t, 'a> {
    timeline: &'t Timeline,
    player: Player<'t>,
    line: Line<'t>,
    stall: Stall,
    operator: Operator<'a, 't>,
    verdicts: Vec<Verdict>,
    passages: Vec<Passage>,
    /// What the player gets next, and what it gets after that.
    input: Input,
    orders: VecDeque<Input>,
    /// Until when it waits, and whether nothing wakes it before.
    until: Nanos,
    is_deaf: bool,
    /// Whether the operator says go, for all robots.
    goes: bool,
    is_together: bool,
}

impl<'t, 'a> Actor<'t, 'a> {
    fn new(
        timeline: &'t Timeline,
        mut settings: Settings,
        faults: Faults,
        answers: &'a Answers,
        is_together: bool,
    ) -> Self {
        settings.baud.get_or_insert(timeline.baud);
        let board = Faulty::new(Device::new(Arc::clone(&timeline.board), settings), faults);
        let player = Player::new(timeline, MAX_LATE);
        Actor {
            timeline,
            player: if is_together { player.together() } else { player },
            stall: board.stall(),
            line: Line::new(board, timeline),
            operator: Operator { answers, asked: Vec::new(), gate: None, answer: None },
            verdicts: Vec::new(),
            passages: Vec::new(),
            input: Input::Tick,
            orders: VecDeque::new(),
            until: Nanos::ZERO,
            is_deaf: false,
            goes: false,
            is_together,
        }
    }

    /// Does everything at `now`; returns how the run ended, once it has.
    fn act(&mut self, now: Nanos) -> Option<Outcome> {
        if self.is_deaf && now < self.until {
            return None;
        }
        loop {
            let timeline = self.timeline;
            let mut unscripted = Vec::new();
            let (verdicts, passages) = (&mut self.verdicts, &mut self.passages);
            let mut notice = |notice| match notice {
                Notice::Judged(verdict) => verdicts.push(verdict),
                Notice::Passed(passage) => passages.push(passage),
                Notice::Refreshed { event } => {
                    unscripted.extend(timeline.events.get(event).map(|event| event.command.clone()));
                }
                Notice::Unscripted { command, .. } => unscripted.push(command.command()),
                Notice::Asked { quantity } => {
                    unscripted
                        .extend(timeline.board.quantities.get(quantity).and_then(|quantity| quantity.request.clone()));
                }
                _ => {}
            };
            let input = match std::mem::replace(&mut self.input, Input::Tick) {
                Input::Tick => self.orders.pop_front().unwrap_or(Input::Tick),
                input => input,
            };
            let order = self.player.poll(now, input, &mut notice);
            self.operator.look(now, timeline, &mut self.player);
            if let Some(outcome) = self.player.outcome() {
                return Some(outcome);
            }
            self.is_deaf = false;
            self.input = match order {
                Order::Write if self.stall.blocks() => Input::Blocked,
                Order::Write => self.line.take(now, self.player.bytes(), &unscripted),
                Order::Halt { discards } => {
                    self.line.ending = true;
                    if discards {
                        self.stall.discard();
                        self.line.coming.retain(|(arrives, _)| *arrives <= now);
                        self.line.busy_until = now;
                    }
                    Input::Tick
                }
                Order::Wait { .. } if !self.orders.is_empty() => Input::Tick,
                Order::Wait { until, .. } | Order::Pause { until } => {
                    (self.until, self.is_deaf) = (until, matches!(order, Order::Pause { .. }));
                    return None;
                }
                // A rehearsal is never paused.
                Order::Suspend | Order::Stay | Order::Done => Input::Panicked,
            };
        }
    }

    /// When something happens next, after `now`.
    fn next(&self, now: Nanos) -> Nanos {
        if self.is_deaf {
            return self.until.max(now);
        }
        let coming = [self.line.next(), self.operator.next()].into_iter().flatten().min();
        coming.unwrap_or(self.until).min(self.until).max(now)
    }

    /// Lets time pass until `now`.
    fn pass(&mut self, now: Nanos) {
        if self.is_deaf {
            if now >= self.until {
                self.line.pass(now);
            }
            return;
        }
        let (verdicts, passages) = (&mut self.verdicts, &mut self.passages);
        let mut notice = |notice| match notice {
            Notice::Judged(verdict) => verdicts.push(verdict),
            Notice::Passed(passage) => passages.push(passage),
            _ => {}
        };
        self.player.receive(now, &self.line.pass(now), &mut notice);
        let input = if self.line.board.hangs_up() { Input::HungUp } else { self.operator.act(now, &mut self.player) };
        if input == Input::Go && self.is_together {
            self.goes = true;
        } else if input != Input::Tick {
            self.input = input;
        }
    }

    fn end(mut self, now: Nanos, outcome: Outcome) -> Rehearsal {
        self.line.pass(now.max(self.line.busy_until));
        let Line { given, aborted, board, .. } = self.line;
        let Actor { verdicts, passages, .. } = self;
        Rehearsal { outcome, verdicts, passages, given, aborted, received: board.finish() }
    }
}

/// Answers the gates of a run.
struct Operator<'a, 't> {
    answers: &'a Answers,
    /// The kinds of gates so far, each with its number.
    asked: Vec<(&'t str, usize)>,
    /// The gate that was answered last.
    gate: Option<usize>,
    /// What happens next, and when.
    answer: Option<(Nanos, Answer)>,
}

impl<'t> Operator<'_, 't> {
    /// Chooses an answer for a gate that has closed.
    fn look(&mut self, now: Nanos, timeline: &'t Timeline, player: &mut Player<'_>) {
        let closed = player.closed_gate();
        if closed == self.gate {
            return;
        }
        (self.gate, self.answer) = (closed, None);
        let Some(gate) = closed.and_then(|gate| timeline.gates.get(gate)) else { return };
        let kind = answers::kind(gate);
        let number = match self.asked.iter_mut().find(|(asked, _)| *asked == kind) {
            Some((_, number)) => {
                *number += 1;
                *number
            }
            None => {
                self.asked.push((kind, 0));
                0
            }
        };
        self.answer = self.answers.to(gate, number).map(|answer| match answer {
            Answer::Go(at) => (now + at.nanos(), answer),
            Answer::Value(_, at) => {
                // Until then, the gate sees no value.
                player.answer(None);
                (now + at.nanos(), answer)
            }
        });
    }

    /// When it acts next.
    fn next(&self) -> Option<Nanos> {
        self.answer.map(|(at, _)| at)
    }

    fn act(&mut self, now: Nanos, player: &mut Player<'_>) -> Input {
        match self.answer.take_if(|(at, _)| *at <= now) {
            Some((_, Answer::Go(_))) => Input::Go,
            Some((_, Answer::Value(value, _))) => {
                player.answer(Some(value));
                Input::Tick
            }
            None => Input::Tick,
        }
    }
}

impl<'t> Line<'t> {
    fn new(board: Faulty, timeline: &'t Timeline) -> Self {
        Line {
            board,
            coming: VecDeque::new(),
            busy_until: Nanos::ZERO,
            byte_time: byte_time(timeline.baud),
            timeline,
            given: 0,
            decoder: Decoder::new(&timeline.board),
            aborted: Vec::new(),
            ending: false,
        }
    }

    /// Takes bytes from the player, all of them; some get lost on the line. The frames of `unscripted` commands come first.
    fn take(&mut self, now: Nanos, bytes: &[u8], unscripted: &[Command]) -> Input {
        let count = bytes.len();
        let mut rest = bytes;
        let mut expected = Vec::new();
        for command in unscripted {
            expected.clear();
            self.timeline.board.encode(command, &mut expected);
            rest = rest.strip_prefix(expected.as_slice()).unwrap_or(rest);
        }
        while let Some(event) = self.timeline.events.get(self.given).filter(|_| !self.ending && !rest.is_empty()) {
            expected.clear();
            self.timeline.board.encode(&event.command, &mut expected);
            let Some(behind) = rest.strip_prefix(expected.as_slice()) else { break };
            (self.given, rest) = (self.given + 1, behind);
        }
        let Line { timeline, decoder, aborted, .. } = self;
        decoder.feed(rest, |item| {
            if let Item::Frame(frame) = item {
                let command = timeline.board.decode_or_raw(frame.bytes());
                aborted.extend(command.map(|command| Moment { at: now.micros(), command, kind: Kind::Abort }));
            }
        });
        if self.board.carries() {
            self.busy_until = self.busy_until.max(now) + self.byte_time * count as u64;
            self.coming.push_back((self.busy_until, bytes.to_vec()));
        }
        Input::Wrote(count)
    }

    /// When something happens at the far end next.
    fn next(&self) -> Option<Nanos> {
        let arrives = self.coming.front().map(|(arrives, _)| *arrives);
        let due = self.board.next_due().map(Micros::nanos);
        [arrives, due].into_iter().flatten().min()
    }

    /// Lets time pass at the far end; gives what the board has sent until then.
    fn pass(&mut self, now: Nanos) -> Vec<u8> {
        while let Some((arrives, bytes)) = self.coming.pop_front_if(|(arrives, _)| *arrives <= now) {
            self.board.receive(arrives.micros_up(), &bytes);
        }
        self.board.poll(now.micros());
        self.board.replies()
    }
}

impl Rehearsal {
    /// Whether the robot stands and is silent at the end.
    pub fn is_at_rest(&self, timeline: &Timeline) -> bool {
        self.received.state.at_rest(&timeline.board) && !self.received.moves
    }

    /// Whether the run ended as the script says: everything was sent, and nothing else.
    pub fn is_complete(&self, timeline: &Timeline) -> bool {
        self.outcome.cause == Cause::Finished && self.given == timeline.events.len() && self.aborted.is_empty()
    }
}
