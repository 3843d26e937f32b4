//! Reads: what a board answers only when it is asked. Requests fill the gaps between frames, one at a time.

use super::super::messages::{Cause, Notice, Order};
use super::{Phase, Player};
use crate::board::{Board, Command, Replies, ReportDecoder, ReportItem};
use crate::timeline::Timeline;
use crate::units::{Nanos, byte_time};

/// How often a quantity is asked for.
const EVERY: Nanos = Nanos::from_millis(100);
/// The least time between two requests.
const APART: Nanos = Nanos::from_millis(5);
/// How long before the next frame the line must be free again.
const GAP: Nanos = Nanos::from_millis(3);
/// How long nothing is asked after a lost answer, so that a late one is not taken for another.
const QUIET: Nanos = Nanos::from_millis(200);
/// How long the first answer of the board may take.
const FIRST: Nanos = Nanos::from_millis(250);

/// What is asked, and what was answered.
#[derive(Debug)]
pub(super) struct Reads {
    decoder: ReportDecoder,
    /// The rows of the quantities to ask for, in turn.
    rows: Vec<usize>,
    turn: usize,
    /// When the next request may be sent, and when a missing answer counts as lost.
    next_at: Nanos,
    lost_at: Nanos,
    /// How long the line carries a request and its answer.
    takes: Nanos,
    /// How long the answer may take otherwise.
    patience: Nanos,
    /// Whether the missing answer is that to the hello of the board.
    is_first: bool,
    /// Whether something came since the last look.
    has_news: bool,
    /// Whether the clock of the script has waited for the first answer.
    holds_clock: bool,
    /// Whether something else than `rows` needs answers.
    is_needed: bool,
}

impl Reads {
    /// For what the expectations, the gates and the `say` lines of a timeline show.
    pub(super) fn of(timeline: &Timeline) -> Self {
        let board = &timeline.board;
        let answers = if let Replies::Answers(answers) = board.replies { Some(answers) } else { None };
        Reads {
            decoder: ReportDecoder::new(board),
            rows: timeline.asked().into_iter().collect(),
            turn: 0,
            next_at: Nanos::ZERO,
            lost_at: Nanos::ZERO,
            takes: byte_time(timeline.baud) * answers.map_or(0, |answers| answers.length),
            patience: answers.map_or(Nanos::ZERO, |answers| answers.patience),
            is_first: false,
            has_news: false,
            holds_clock: false,
            is_needed: timeline.soft.is_some() && !timeline.servos().is_empty(),
        }
    }

    /// A command of the script is sent that the board may answer.
    pub(super) fn note_sent(&mut self, command: &Command, now: Nanos) {
        if self.decoder.has_answer(command) {
            self.decoder.ask(command);
            self.is_first = true;
            self.lost_at = now.saturating_add(FIRST + self.takes);
            self.next_at = now;
        }
    }

    /// Whether the clock of the script waits for the first answer: a script that needs answers moves nothing without one.
    pub(super) fn holds_start(&self) -> bool {
        self.is_first && self.decoder.is_waiting() && self.needs_answers()
    }

    /// Whether the script needs answers of the board.
    fn needs_answers(&self) -> bool {
        self.is_needed || !self.rows.is_empty()
    }

    /// Whether an answer is missing.
    pub(super) fn is_waiting(&self) -> bool {
        self.decoder.is_waiting()
    }

    /// Forgets what has come.
    pub(super) fn forget_news(&mut self) {
        self.has_news = false;
    }

    /// The next answer belongs to this request.
    pub(super) fn ask_for(&mut self, request: &Command) {
        self.decoder.ask(request);
    }

    /// What is asked now is not answered any more.
    pub(super) fn give_up(&mut self) {
        self.decoder.give_up();
    }

    /// Time 0 of the script is now.
    pub(super) fn begin_clock(&mut self) {
        self.holds_clock = true;
    }

    /// The script is paused at its time 0.
    pub(super) fn leave_clock(&mut self) {
        self.holds_clock = false;
    }

    /// Whether the answer to the hello of the board is missing.
    pub(super) fn misses_first(&self) -> Option<Nanos> {
        (self.is_first && self.decoder.is_waiting()).then_some(self.lost_at)
    }

    /// The next request that is due, if there is time before `next_frame`.
    fn due(&self, board: &Board, now: Nanos, next_frame: Option<Nanos>) -> Option<(usize, Command)> {
        let row = *self.rows.get(self.turn)?;
        let is_due = !self.decoder.is_waiting() && now >= self.next_at;
        let has_time = next_frame.is_none_or(|due| due >= now.saturating_add(GAP + self.takes));
        let request = board.quantities.get(row).filter(|_| is_due && has_time)?.request.clone();
        Some((row, request?))
    }

    /// When it wants to be asked again.
    fn wakes_at(&self, now: Nanos) -> Option<Nanos> {
        let at = if self.decoder.is_waiting() { self.lost_at } else { self.next_at };
        (at > now && (self.decoder.is_waiting() || !self.rows.is_empty())).then_some(at)
    }
}

impl Player<'_> {
    /// Takes bytes of the board, received at `now` from the start.
    pub fn receive(&mut self, now: Nanos, mut bytes: &[u8], mut notices: &mut dyn FnMut(Notice)) {
        let notices = &mut notices;
        if matches!(self.phase, Phase::Ending(..) | Phase::Pausing(..)) && self.holds() {
            self.stops.hear(bytes);
            return;
        }
        while let Some(item) = self.reads.decoder.next(&mut bytes) {
            match item {
                ReportItem::Malformed => continue,
                _ if self.start.is_pending() && !self.reads.is_first && matches!(self.phase, Phase::Playing) => {
                    if let ReportItem::Report(report) = item {
                        self.judge.note(now, report);
                    }
                    self.start.take(self.board, item, notices);
                }
                ReportItem::Report(report) if self.enabling.is_some() => self.take_goal(&report),
                ReportItem::Report(report) => self.hear(now, report, notices),
                ReportItem::Errors(bits) => notices(Notice::Errors(bits)),
                ReportItem::Flags(servo, bits) => notices(Notice::Flags { servo, bits }),
                _ => continue,
            }
            self.reads.is_first &= self.reads.decoder.is_waiting();
            self.reads.has_news = true;
        }
    }

    /// Whether something has happened that the player must see at once.
    pub fn has_news(&self) -> bool {
        self.is_gate_ending()
            || self.stops.has_news()
            || self.reads.has_news && (self.reads.needs_answers() || self.start.is_pending() || self.enabling.is_some())
            || self.reads.has_news && self.is_over()
    }

    /// The hello was sent: waits for the answer. Then time 0 of the script is now.
    pub(super) fn wait_for_first(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Order {
        if let Some(cause) = self.miss_answers(now, notices) {
            return self.end_early(cause, now);
        }
        self.reads.holds_clock = true;
        Order::Wait { until: self.reads.lost_at, writable: false }
    }

    /// The time of the script, which begins once the first answer has come.
    pub(super) fn begin(&mut self, time: Nanos, now: Nanos, notices: &mut impl FnMut(Notice)) -> Nanos {
        if !std::mem::take(&mut self.reads.holds_clock) {
            return time;
        }
        self.set_clock(Nanos::ZERO, now);
        notices(Notice::Began);
        Nanos::ZERO
    }

    /// Counts an answer as lost that did not come. That ends a run that needs answers.
    pub(super) fn miss_answers(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Cause> {
        self.reads.has_news = false;
        if !self.reads.decoder.is_waiting() || now < self.reads.lost_at {
            return None;
        }
        self.reads.decoder.give_up();
        self.reads.next_at = now.saturating_add(QUIET);
        if !std::mem::take(&mut self.reads.is_first) {
            return None;
        }
        notices(Notice::Unanswered);
        self.reads.needs_answers().then_some(Cause::Unanswered)
    }

    /// Asks for the next quantity, if no frame is due soon. Returns whether there is something to write.
    pub(super) fn ask(&mut self, now: Nanos, next_frame: Option<Nanos>, notices: &mut impl FnMut(Notice)) -> bool {
        let Some((quantity, request)) = self.reads.due(self.board, now, next_frame) else { return false };
        self.out.push(|bytes| self.board.encode(&request, bytes));
        self.due = now;
        self.extra += 1;
        let count = u64::try_from(self.reads.rows.len()).unwrap_or(u64::MAX).max(1);
        self.reads.turn = (self.reads.turn + 1) % self.reads.rows.len().max(1);
        self.reads.next_at = now.saturating_add(Nanos(EVERY.0 / count).max(APART));
        self.reads.lost_at = now.saturating_add(self.reads.patience + self.reads.takes);
        self.reads.decoder.ask(&request);
        notices(Notice::Asked { quantity });
        true
    }

    /// An order to wait until a time of the run, or until the next request.
    pub(super) fn wait_or_ask(&self, until: Nanos, now: Nanos) -> Order {
        let until = self.reads.wakes_at(now).map_or(until, |at| at.min(until));
        Order::Wait { until, writable: false }
    }
}
