//! What happens before time 0 on a board that reports the positions of its servos: each servo of the script is read, made to hold where
//! it is, and moved softly to its first position. Nothing moves before every servo has answered.

use super::super::hold::{TRIES, patience};
use super::super::messages::{Cause, Notice, Order, ServoFault, ServoFaultKind, ShortCommand, Why};
use super::{Phase, Player};
use crate::board::{Board, Command, Feedback, Report, ReportItem, ServoSet};
use crate::program::Ease;
use crate::timeline::Timeline;
use crate::units::{Micros, Nanos, byte_time};

/// The time between two frames for a servo.
const STEP: Nanos = Micros::from_millis(20).nanos();
/// The highest speed of an `in-out-sine`, compared with the mean.
const PEAK: f64 = std::f64::consts::FRAC_PI_2;

/// What is left of it.
#[derive(Debug)]
pub(super) struct Start<'t> {
    feedback: Option<&'t Feedback>,
    servos: Vec<Servo>,
    /// How long the soft start takes if nothing needs longer; 0 for none.
    soft: Nanos,
    step: Nanos,
    ease: Ease,
    stage: Stage,
    /// The servo that is asked, how often it was asked, and until when it may answer.
    at: usize,
    tries: u8,
    until: Nanos,
    /// What is wrong with it.
    fault: Option<ServoFaultKind>,
    /// Whether the run pauses once it is done.
    pub(super) pauses: bool,
}

/// A servo of the script.
#[derive(Clone, Copy, Debug)]
struct Servo {
    index: i32,
    /// Its first position in the script.
    first: Option<i32>,
    /// The first values of the settings that it keeps otherwise.
    settings: [Option<i32>; 2],
    /// The most that it moves in a second.
    speed: Option<f64>,
    /// The first of these settings, if the servo keeps it.
    keeps: Option<i32>,
    /// Where it is at the start, and the last target that was sent.
    from: Option<i32>,
    last: Option<i32>,
}

/// What happens next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Mode,
    Settings,
    Position,
    Hold,
    /// Since when, how long it takes, and when the next targets are due after its begin.
    Soft {
        from: Nanos,
        takes: Nanos,
        next: Nanos,
    },
    /// The last frames are on their way to the port.
    Ready,
    Done,
}

impl<'t> Start<'t> {
    /// For a timeline, and the pass that is repeated after it.
    pub(super) fn of(timeline: &'t Timeline, again: Option<&Timeline>) -> Self {
        let board = &timeline.board;
        let feedback = board.feedback.as_ref();
        let soft = timeline.soft.map_or(Nanos::ZERO, Micros::nanos);
        let again_servos = again.map(Timeline::servos).unwrap_or_default();
        let all: ServoSet = timeline.servos().iter().chain(again_servos.iter()).collect();
        let mut servos: Vec<Servo> = all
            .iter()
            .map(|index| Servo {
                index,
                first: None,
                settings: [None; 2],
                speed: None,
                keeps: None,
                from: None,
                last: None,
            })
            .collect();
        let needs_any = feedback.is_some_and(|feedback| feedback.preparation.is_some()) || soft > Nanos::ZERO;
        if !needs_any {
            servos.clear();
        }
        if let Some(feedback) = feedback {
            for event in timeline.events.iter().chain(again.iter().flat_map(|again| &again.events)) {
                let (Some(index), Some(value)) = (event.command.value(0), event.command.value(1)) else { continue };
                let Some(servo) = servos.iter_mut().find(|servo| servo.index == index) else { continue };
                if event.command.verb() == feedback.verb {
                    servo.first.get_or_insert(value);
                }
                let verbs = feedback.preparation.as_ref().map(|preparation| preparation.settings.1);
                let at = verbs.and_then(|verbs| verbs.iter().position(|verb| *verb == event.command.verb()));
                if let Some(setting) = at.and_then(|at| servo.settings.get_mut(at)) {
                    setting.get_or_insert(value);
                }
            }
            let scale = board.verb(feedback.verb).and_then(|verb| verb.moving().first()).map_or(1, |axis| axis.scale);
            for servo in &mut servos {
                let resource = board.occupied(feedback.verb, Some(servo.index)).first();
                let speed = resource.and_then(|resource| timeline.speeds.get(*resource).copied().flatten());
                servo.speed = speed.map(|speed| f64::from(speed) * f64::from(scale));
            }
        }
        let bytes: usize = feedback.map_or(0, |feedback| {
            servos.iter().map(|servo| board.frame_length(&Command::new(feedback.verb, &[servo.index, 0]))).sum()
        });
        let stage = if servos.is_empty() { Stage::Done } else { Stage::Mode };
        Start {
            feedback,
            servos,
            soft,
            // A slow line carries the frames of all servos in half of the time.
            step: STEP.max(byte_time(timeline.baud) * (2 * bytes as u64)),
            ease: Ease::named("in-out-sine").unwrap_or(Ease::LINEAR),
            stage,
            at: 0,
            tries: 0,
            until: Nanos::ZERO,
            fault: None,
            pauses: false,
        }
    }

    /// Whether time 0 of the script has not come yet.
    pub(super) fn is_pending(&self) -> bool {
        self.stage != Stage::Done
    }

    /// The last target of a servo.
    pub(super) fn last(&self, index: i32) -> Option<i32> {
        self.servos.iter().find(|servo| servo.index == index)?.last
    }

    /// Begins again, after a pause.
    pub(super) fn restart(&mut self) {
        if self.is_pending() {
            (self.stage, self.at, self.tries) = (Stage::Mode, 0, 0);
            (self.fault, self.pauses) = (None, false);
        }
    }

    fn servo(&mut self) -> Option<&mut Servo> {
        self.servos.get_mut(self.at)
    }

    /// What the servo must be asked for; `None` if nothing at this stage.
    fn request(&self) -> Option<Command> {
        let feedback = self.feedback?;
        let servo = self.servos.get(self.at)?;
        let preparation = feedback.preparation.as_ref();
        let verb = match self.stage {
            Stage::Mode => preparation?.mode,
            Stage::Settings if servo.settings.contains(&None) => preparation?.settings.0,
            Stage::Position => feedback.position,
            _ => return None,
        };
        Some(Command::new(verb, &[servo.index]))
    }

    /// Continues with the next question, or with the next servo.
    fn advance(&mut self) {
        self.tries = 0;
        self.stage = match self.stage {
            Stage::Mode => Stage::Settings,
            Stage::Settings => Stage::Position,
            Stage::Position => {
                self.at += 1;
                if self.at < self.servos.len() { Stage::Mode } else { Stage::Hold }
            }
            other => other,
        };
    }

    /// Takes an answer.
    pub(super) fn take(&mut self, board: &Board, item: ReportItem, notices: &mut impl FnMut(Notice)) {
        // What comes with error bits does not matter.
        let Some(feedback) = self.feedback.filter(|_| self.fault.is_none()) else { return };
        match (self.stage, item) {
            (_, ReportItem::Flags(_, bits)) => self.fault = Some(ServoFaultKind::Flags(bits)),
            (Stage::Mode, ReportItem::Values([mode, _])) if mode != 0 => self.fault = Some(ServoFaultKind::Mode(mode)),
            (Stage::Mode, ReportItem::Values(_)) => self.advance(),
            (Stage::Settings, ReportItem::Values(values)) => {
                if let Some(servo) = self.servo() {
                    let [kept, others] = [0, 1].map(|at| {
                        let is_set = servo.settings.get(at).copied().flatten().is_some();
                        values.get(at).copied().filter(|_| !is_set)
                    });
                    notices(Notice::Kept { servo: servo.index, values: [kept, others] });
                    servo.keeps = kept;
                }
                self.advance();
            }
            (Stage::Position, ReportItem::Report(report)) => self.take_position((board, feedback), &report),
            _ => {}
        }
    }

    fn take_position(&mut self, (board, feedback): (&Board, &Feedback), report: &Report) {
        let Some((_, position)) = report.values().next() else { return };
        let value = board.target(position).filter(|(_, is_inside)| *is_inside).map(|(value, _)| value);
        if value.is_none() && feedback.preparation.is_some() {
            self.fault = Some(ServoFaultKind::Position(position));
            return;
        }
        if let Some(servo) = self.servo() {
            (servo.from, servo.last) = (value, value);
        }
        self.advance();
    }

    /// The frames that make every servo hold where it is, with the settings of the script.
    fn holding(&self) -> impl Iterator<Item = Command> {
        let preparation = self.feedback.and_then(|feedback| Some((feedback.verb, feedback.preparation.as_ref()?)));
        let send = |verb, index, value: Option<i32>| Some(Command::new(verb, &[index, value?]));
        preparation
            .into_iter()
            .flat_map(move |(verb, preparation)| {
                let [first, second] = preparation.settings.1;
                self.servos.iter().flat_map(move |servo| {
                    let [one, two] = servo.settings;
                    let index = servo.index;
                    [
                        send(first, index, one),
                        send(second, index, two),
                        send(verb, index, servo.from),
                        send(preparation.enable, index, Some(1)),
                    ]
                })
            })
            .flatten()
    }

    /// How long the soft start takes, how many servos move, and whether a limit makes it longer; `None` if nothing moves.
    fn soft(&self) -> Option<(Nanos, usize, bool)> {
        let ways = || self.servos.iter().filter_map(|servo| Some((servo, f64::from(servo.first? - servo.from?).abs())));
        let moving = ways().filter(|(_, way)| *way > 0.0).count();
        if moving == 0 || self.soft == Nanos::ZERO {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "a few seconds of nanoseconds fit")]
        let step = self.step.0 as f64 / 1e9;
        let needed = |(servo, way): (&Servo, f64)| {
            // The servo's own speed may be lower than the limit.
            let own = servo.settings.first().copied().flatten().or(servo.keeps).filter(|own| *own > 0).map(f64::from);
            let most = servo.speed.into_iter().chain(own).reduce(f64::min)? * step;
            // Both ends of a step are rounded.
            let most = if most > 2.0 { most - 1.0 } else { most / 2.0 };
            Some(way * PEAK / most * step)
        };
        let seconds = ways().filter_map(needed).fold(0.0, f64::max);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "held in range")]
        let needed = Nanos((seconds * 1e9).clamp(0.0, 1e15) as u64);
        Some((self.soft.max(needed), moving, needed > self.soft))
    }
}

impl Player<'_> {
    /// The next step before time 0; `None` once time 0 has come.
    pub(super) fn prepare(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Order> {
        if !self.start.is_pending() || self.next < self.board.hello.len() {
            return None;
        }
        self.reads.forget_news();
        loop {
            if let Some(kind) = self.start.fault.take() {
                return Some(self.servo_fault(kind, now));
            }
            match self.start.stage {
                Stage::Mode | Stage::Settings | Stage::Position => {
                    if let Some(order) = self.ask_servo(now, notices) {
                        return Some(order);
                    }
                }
                Stage::Hold => {
                    self.start.stage = Stage::Ready;
                    self.has_moved = true;
                    if let Some((takes, servos, is_longer)) = self.start.soft() {
                        notices(Notice::SoftStart { servos, takes, is_longer });
                        self.start.stage = Stage::Soft { from: now, takes, next: Nanos::ZERO };
                    }
                    self.hold_servos(now, notices);
                    if !self.out.is_empty() {
                        return Some(Order::Write);
                    }
                }
                Stage::Soft { from, takes, next } => {
                    if let Some(order) = self.start_softly((from, takes, next), now, notices) {
                        return Some(order);
                    }
                }
                Stage::Ready => {
                    self.start.stage = Stage::Done;
                    self.reads.begin_clock();
                }
                Stage::Done => {
                    if std::mem::take(&mut self.start.pauses) {
                        self.reads.leave_clock();
                        self.phase = Phase::Paused(Nanos::ZERO);
                        return Some(Order::Stay);
                    }
                    return None;
                }
            }
        }
    }

    fn servo_fault(&mut self, kind: ServoFaultKind, now: Nanos) -> Order {
        let servo = self.start.servo().map_or(0, |servo| servo.index);
        self.end_early(Cause::Servo(ServoFault { servo, kind }), now)
    }

    /// Asks the current servo, or waits for its answer; `None` if it need not be asked.
    fn ask_servo(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) -> Option<Order> {
        let Some(request) = self.start.request() else {
            self.start.advance();
            return None;
        };
        if self.start.tries > 0 && self.reads.is_waiting() && now < self.start.until {
            return Some(Order::Wait { until: self.start.until, writable: false });
        }
        if self.start.tries == TRIES {
            return Some(self.servo_fault(ServoFaultKind::Silent, now));
        }
        self.start.tries += 1;
        self.start.until = now.saturating_add(patience(self.board));
        self.reads.ask_for(&request);
        self.send_unscripted(&request, Why::Start, now, notices);
        Some(Order::Write)
    }

    /// Sends a frame that is not of the script.
    pub(super) fn send_unscripted(
        &mut self,
        command: &Command,
        why: Why,
        now: Nanos,
        notices: &mut impl FnMut(Notice),
    ) {
        if self.out.is_empty() {
            self.due = now;
        }
        self.out.push(|bytes| self.board.encode(command, bytes));
        self.extra += 1;
        notices(Notice::Unscripted { why, command: ShortCommand::of(command) });
    }

    fn hold_servos(&mut self, now: Nanos, notices: &mut impl FnMut(Notice)) {
        let Player { start, held, board, out, .. } = self;
        for command in start.holding() {
            out.push(|bytes| board.encode(&command, bytes));
            self.extra += 1;
            notices(Notice::Unscripted { why: Why::Start, command: ShortCommand::of(&command) });
        }
        for servo in start.servos.iter().filter(|servo| servo.from.is_some()) {
            held.add(servo.index, false);
        }
        self.due = now;
    }

    /// Sends the targets of the soft start that are due, and never those before them; `None` once it is over.
    fn start_softly(
        &mut self,
        (from, takes, next): (Nanos, Nanos, Nanos),
        now: Nanos,
        notices: &mut impl FnMut(Notice),
    ) -> Option<Order> {
        let step = self.start.step.0.max(1);
        let passed = now.saturating_sub(from).min(takes);
        let due = Nanos(if passed < takes { passed.0 / step * step } else { takes.0 });
        // After a stall, the servos would jump.
        let late = now.saturating_sub(from.saturating_add(next));
        if late > self.max_late {
            return Some(self.end_early(Cause::Late(late), now));
        }
        #[expect(clippy::cast_precision_loss, reason = "a minute of nanoseconds fits")]
        let (ease, part) = (self.start.ease, due.0 as f64 / takes.0.max(1) as f64);
        let verb = self.start.feedback?.verb;
        for at in 0..self.start.servos.len() {
            let Some(servo) = self.start.servos.get_mut(at) else { continue };
            let (Some(begin), Some(end)) = (servo.from, servo.first) else { continue };
            let target = if due == takes { end } else { ease.between((begin, end), part) };
            if servo.last != Some(target) {
                servo.last = Some(target);
                let command = Command::new(verb, &[servo.index, target]);
                self.send_unscripted(&command, Why::Soft, now, notices);
            }
        }
        let next = Nanos((due.0 + step).min(takes.0));
        self.start.stage = if due == takes { Stage::Ready } else { Stage::Soft { from, takes, next } };
        if !self.out.is_empty() {
            return Some(Order::Write);
        }
        (due < takes).then_some(Order::Wait { until: from.saturating_add(next), writable: false })
    }
}
