//! Decides when a closed gate opens, as a pure function of time and of what happened.

use super::judge::{FRESH, Meter};
use crate::board::{Hundredths, Report};
use crate::timeline::Gate;
use crate::units::{Micros, Nanos};

/// How long a player waits at most before it is asked again.
pub(super) const HOUR: Nanos = Micros::SECOND.saturating_mul(3_600).nanos();

/// How a gate ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passage {
    /// Its index in the timeline's gates.
    pub gate: usize,
    /// How long it was closed, in real time, without pauses.
    pub took: Nanos,
    /// Why it ended.
    pub end: GateEnd,
}

/// Why a gate ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GateEnd {
    /// A report matched; its value.
    Matched(Hundredths),
    /// The operator said go.
    Go,
    /// The time limit passed, and the script continues all the same.
    Continued(Option<Seen>),
    /// The reports of other robots matched, or their time limit passed.
    Others,
    /// The time limit passed.
    TimedOut(Option<Seen>),
    /// The board reported nothing, while the drive held.
    Silent,
    /// The lines on standard input ended.
    InputEnded,
    /// The run ended for another reason.
    Stopped,
}

/// The values that a gate saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// The newest.
    pub newest: Hundredths,
    /// The smallest.
    pub least: Hundredths,
    /// The largest.
    pub most: Hundredths,
}

impl GateEnd {
    /// Its word in logs and reports.
    pub fn word(self) -> &'static str {
        match self {
            GateEnd::Matched(_) => "matched",
            GateEnd::Go => "go",
            GateEnd::Others => "others",
            GateEnd::Continued(_) => "continued",
            GateEnd::TimedOut(_) => "timed out",
            GateEnd::Silent => "silent",
            GateEnd::InputEnded => "input ended",
            GateEnd::Stopped => "stopped",
        }
    }

    /// Whether the run continues.
    pub fn is_open(self) -> bool {
        matches!(self, GateEnd::Matched(_) | GateEnd::Go | GateEnd::Continued(_) | GateEnd::Others)
    }
}

impl GateEnd {
    /// Why it ended, with values in this unit.
    pub fn words(self, unit: &str) -> String {
        match self {
            GateEnd::Matched(value) => format!("{value}{unit}"),
            GateEnd::Go => "go".to_owned(),
            GateEnd::Others => "the other robots continue".to_owned(),
            GateEnd::Continued(Some(seen)) | GateEnd::TimedOut(Some(seen)) => seen.words(unit),
            GateEnd::Continued(None) | GateEnd::TimedOut(None) => "nothing came in this time".to_owned(),
            GateEnd::Silent => {
                let limit = FRESH.in_millis();
                format!("the board has reported nothing for {limit} ms while the robot was driving")
            }
            GateEnd::InputEnded => "standard input ended".to_owned(),
            GateEnd::Stopped => "the run was stopped".to_owned(),
        }
    }
}

impl Seen {
    fn words(self, unit: &str) -> String {
        let Seen { newest, least, most } = self;
        if least == most {
            return format!("the value was {newest}{unit}");
        }
        format!("the values were {least}{unit} to {most}{unit}, the last {newest}{unit}")
    }
}

/// Where the value of a report comes from.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// From the report.
    Report,
    /// Nowhere: a rehearsal has not answered yet.
    None,
    /// From a rehearsal.
    Answer(Hundredths),
}

/// A gate that is closed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Closed {
    /// Its index.
    pub(super) gate: usize,
    /// How long it had been closed at `since`.
    before: Nanos,
    /// When it closed, or when the last pause ended, on the clock of the run; `None` in a pause.
    since: Option<Nanos>,
    meter: Meter,
    /// When the last report came, if any.
    heard: Nanos,
    seen: Option<Seen>,
    /// The value of reports.
    source: Source,
    /// Why it opens, once it does.
    opens: Option<GateEnd>,
    /// Whether other robots wait at it, too, so that a match alone does not open it.
    is_shared: bool,
    /// The newest value, if it matches, and the last one that did.
    fits: Option<Hundredths>,
    fitted: Option<Hundredths>,
    /// Whether `fits` has changed.
    has_news: bool,
}

impl Closed {
    pub(super) fn new(gate: usize, now: Nanos, meter: Meter, is_shared: bool) -> Self {
        Closed {
            gate,
            before: Nanos::ZERO,
            since: Some(now),
            meter,
            heard: now,
            seen: None,
            source: Source::Report,
            opens: None,
            is_shared,
            fits: None,
            fitted: None,
            has_news: false,
        }
    }

    /// Until when its own reports open it, if nothing more comes; `None` if they do not. A robot whose reports do not matter is no
    /// obstacle.
    pub(super) fn fits_until(&self, gate: &Gate) -> Option<Nanos> {
        match gate.gate.criterion() {
            Some(_) => self.fits.map(|_| self.heard.saturating_add(FRESH)),
            None => (!gate.gate.is_go()).then_some(Nanos::MAX),
        }
    }

    /// Whether its time limit has passed, and the script continues all the same.
    pub(super) fn has_expired(&self, now: Nanos, gate: &Gate) -> bool {
        gate.gate.continues && self.deadline(gate).is_some_and(|until| now >= until)
    }

    /// All robots continue; returns why.
    pub(super) fn release(&mut self, now: Nanos, gate: &Gate) -> GateEnd {
        let end = match self.fits.or(self.fitted) {
            _ if gate.gate.is_go() => GateEnd::Go,
            _ if self.has_expired(now, gate) && self.fits.is_none() => GateEnd::Continued(self.seen),
            Some(value) => GateEnd::Matched(value),
            None => GateEnd::Others,
        };
        *self.opens.get_or_insert(end)
    }

    /// What has happened was seen.
    pub(super) fn forget_news(&mut self) {
        self.has_news = false;
    }

    /// How long it has been closed.
    pub(super) fn took(&self, now: Nanos) -> Nanos {
        self.before + self.since.map_or(Nanos::ZERO, |since| now.saturating_sub(since))
    }

    /// A pause begins.
    pub(super) fn pause(&mut self, now: Nanos) {
        self.before = self.took(now);
        self.since = None;
        self.fits = None;
    }

    /// A pause has ended.
    pub(super) fn resume(&mut self, now: Nanos) {
        (self.since, self.heard) = (Some(now), now);
    }

    /// From now on, reports have this value instead of their own.
    pub(super) fn answer(&mut self, value: Option<Hundredths>) {
        self.source = value.map_or(Source::None, Source::Answer);
    }

    /// The operator says go, if that is awaited.
    pub(super) fn go(&mut self, gate: &Gate) {
        if gate.gate.is_go() {
            self.opens.get_or_insert(GateEnd::Go);
        }
    }

    /// The lines that say go have ended.
    pub(super) fn end_of_input(&mut self) {
        self.opens.get_or_insert(GateEnd::InputEnded);
    }

    /// Takes a report, and returns the value that counts, if any. In a pause, it opens nothing.
    pub(super) fn hear(&mut self, now: Nanos, gate: &Gate, report: &Report) -> Option<Hundredths> {
        let criterion = gate.gate.criterion()?;
        let value = criterion.measured.of(report)?;
        self.heard = now;
        let measured = self.meter.read(&criterion.measured, value);
        let value = match self.source {
            Source::Report => Some(measured),
            Source::None => None,
            Source::Answer(value) => Some(value),
        };
        let value = value.filter(|_| self.since.is_some())?;
        let (least, most) = self.seen.map_or((value, value), |seen| (seen.least, seen.most));
        self.seen = Some(Seen { newest: value, least: least.min(value), most: most.max(value) });
        // A report after the end of the time limit is too late.
        let fits = criterion.wanted.fits(value) && self.deadline(gate).is_none_or(|until| now <= until);
        if fits && !self.is_shared {
            self.opens.get_or_insert(GateEnd::Matched(value));
        }
        self.has_news |= self.is_shared && (fits || self.fits.is_some());
        self.fits = fits.then_some(value);
        self.fitted = self.fits.or(self.fitted);
        Some(value)
    }

    /// Whether something has happened that ends it.
    pub(super) fn is_ending(&self) -> bool {
        self.opens.is_some() || self.has_news
    }

    /// Why it ends at `now`, if it does. `drives`: whether the drive holds.
    pub(super) fn end(&self, now: Nanos, gate: &Gate, drives: bool) -> Option<GateEnd> {
        if self.opens.is_some() {
            return self.opens;
        }
        if self.silence(gate, drives).is_some_and(|until| now >= until) {
            return Some(GateEnd::Silent);
        }
        // At a shared gate, the robot fails the run whose reports do not match.
        let fits = self.fits_until(gate).is_some_and(|until| now <= until);
        let is_others = self.is_shared && (gate.gate.continues || fits);
        let expired = self.deadline(gate).is_some_and(|until| now >= until) && !is_others;
        let end = if gate.gate.continues { GateEnd::Continued } else { GateEnd::TimedOut };
        expired.then(|| end(self.seen))
    }

    /// When it ends if nothing happens until then, on the clock of the run.
    pub(super) fn due(&self, now: Nanos, gate: &Gate, drives: bool) -> Option<Nanos> {
        // What the others do ends a shared gate whose time limit has passed.
        let deadline = self.deadline(gate).filter(|until| !self.is_shared || *until > now);
        self.silence(gate, drives).into_iter().chain(deadline).min()
    }

    fn deadline(&self, gate: &Gate) -> Option<Nanos> {
        let within = gate.within().map(Micros::nanos)?;
        Some(self.since?.saturating_add(within.saturating_sub(self.before)))
    }

    /// When the silence of the board has been too long.
    fn silence(&self, gate: &Gate, drives: bool) -> Option<Nanos> {
        (drives && gate.gate.criterion().is_some()).then(|| self.heard.saturating_add(FRESH))
    }
}
