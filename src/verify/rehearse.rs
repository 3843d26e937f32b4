//! A whole run on the virtual board under a clock that jumps: the same player, a line that takes its time, no waiting.

use std::sync::Arc;

use crate::board::{Decoder, Item, ReportDecoder, ReportItem};
use crate::faults::{Faults, Faulty};
use crate::playback::{Cause, Input, Notice, Order, Outcome, Player, Verdict};
use crate::sim::{Device, Received, Settings};
use crate::timeline::{Kind, Moment, Timeline};
use crate::units::{Micros, Nanos, byte_time};

/// What is later than this ends a run, as on a real port: only where the port stalls.
const MAX_LATE: Nanos = Nanos::from_millis(50);

/// What became of a rehearsal.
#[derive(Clone, Debug)]
pub struct Rehearsal {
    /// How the run ended.
    pub outcome: Outcome,
    /// What became of each `expect` that was judged.
    pub verdicts: Vec<Verdict>,
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

/// Plays a timeline on a board with these settings and faults.
pub fn rehearse(timeline: &Timeline, settings: Settings, faults: Faults) -> Rehearsal {
    let board = Faulty::new(Device::new(Arc::clone(&timeline.board), settings), faults);
    let mut stall = board.stall();
    let mut line = Line {
        board,
        coming: std::collections::VecDeque::new(),
        busy_until: Nanos::ZERO,
        byte_time: byte_time(timeline.baud),
        timeline,
        given: 0,
        decoder: Decoder::new(&timeline.board),
        aborted: Vec::new(),
        ending: false,
    };
    let mut player = Player::new(timeline, MAX_LATE);
    let mut reports = ReportDecoder::new(timeline.board.codec.replies);
    let mut verdicts = Vec::new();
    let mut now = Nanos::ZERO;
    let mut input = Input::Tick;
    let outcome = loop {
        let mut notice = |notice| {
            if let Notice::Judged(verdict) = notice {
                verdicts.push(verdict);
            }
        };
        let order = player.poll(now, input, &mut notice);
        if let Some(outcome) = player.outcome() {
            break outcome;
        }
        input = match order {
            Order::Write if stall.blocks() => Input::Blocked,
            Order::Write => line.take(now, player.bytes()),
            Order::Discard => {
                line.ending = true;
                stall.discard();
                line.coming.retain(|(arrives, _)| *arrives <= now);
                line.busy_until = now;
                Input::Tick
            }
            Order::Wait { until, .. } => {
                now = line.next().map_or(until, |next| next.min(until)).max(now);
                reports.feed(&line.pass(now), |item| {
                    if let ReportItem::Report(report) = item {
                        player.hear(now, report, &mut notice);
                    }
                });
                if line.board.hangs_up() { Input::HungUp } else { Input::Tick }
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
    Rehearsal { outcome, verdicts, given, aborted, received: board.finish() }
}

impl Line<'_> {
    /// Takes bytes from the player, all of them; some get lost on the line.
    fn take(&mut self, now: Nanos, bytes: &[u8]) -> Input {
        let count = bytes.len();
        let mut rest = bytes;
        let mut expected = Vec::new();
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
