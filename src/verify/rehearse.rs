//! A whole run on the virtual board under a clock that jumps: the same player, a line that takes its time, no waiting.

use std::sync::Arc;

use super::answers::{self, Answer, Answers};
use crate::board::{Command, Decoder, Item};
use crate::faults::{Faults, Faulty};
use crate::playback::{Cause, Input, Notice, Order, Outcome, Passage, Player, Verdict};
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
    coming: std::collections::VecDeque<(Nanos, Vec<u8>)>,
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
pub fn rehearse(timeline: &Timeline, mut settings: Settings, faults: Faults, answers: &Answers) -> Rehearsal {
    settings.baud.get_or_insert(timeline.baud);
    let board = Faulty::new(Device::new(Arc::clone(&timeline.board), settings), faults);
    let mut stall = board.stall();
    let mut line = Line::new(board, timeline);
    let mut player = Player::new(timeline, MAX_LATE);
    let (mut verdicts, mut passages) = (Vec::new(), Vec::new());
    let mut operator = Operator { answers, asked: Vec::new(), gate: None, answer: None };
    let mut now = Nanos::ZERO;
    let mut input = Input::Tick;
    let outcome = loop {
        let mut unscripted = Vec::new();
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
        let order = player.poll(now, input, &mut notice);
        operator.look(now, timeline, &mut player);
        if let Some(outcome) = player.outcome() {
            break outcome;
        }
        input = match order {
            Order::Write if stall.blocks() => Input::Blocked,
            Order::Write => line.take(now, player.bytes(), &unscripted),
            Order::Halt { discards } => {
                line.ending = true;
                if discards {
                    stall.discard();
                    line.coming.retain(|(arrives, _)| *arrives <= now);
                    line.busy_until = now;
                }
                Input::Tick
            }
            Order::Wait { until, .. } => {
                now = [line.next(), operator.next()].into_iter().flatten().min().unwrap_or(until).min(until).max(now);
                player.receive(now, &line.pass(now), &mut notice);
                if line.board.hangs_up() { Input::HungUp } else { operator.act(now, &mut player) }
            }
            Order::Pause { until } => {
                now = until.max(now);
                line.pass(now);
                Input::Tick
            }
            // A rehearsal is never paused.
            Order::Suspend | Order::Stay | Order::Done => Input::Panicked,
        };
    };
    line.pass(now.max(line.busy_until));
    let Line { given, aborted, board, .. } = line;
    Rehearsal { outcome, verdicts, passages, given, aborted, received: board.finish() }
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
            coming: std::collections::VecDeque::new(),
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
