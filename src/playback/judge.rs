//! Judges each `expect`, as a pure function of time and of the reports received.
//!
//! It also keeps the newest report, and measures changes such as the angle that a robot has turned.
//!
//! A report that is old, unreadable or missing never makes an `expect` pass. The board's reports have no checksum, so a report
//! with garbled digits cannot be recognized.

use std::fmt;

use crate::board::{Hundredths, Report};
use crate::program::{Criterion, Measured};
use crate::timeline::Expectation;
use crate::units::{Micros, Nanos};

/// The maximum age of a report.
pub(super) const FRESH: Nanos = Nanos::from_millis(500);

/// The result of one `expect`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// Its index in the timeline's expectations.
    pub expect: usize,
    /// What was found.
    pub found: Found,
}

/// What an `expect` found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Found {
    /// A value that meets the condition.
    Passed(Hundredths),
    /// A value that does not meet the condition.
    Failed(Hundredths),
    /// Only a report that is too old; its age.
    Stale(Nanos),
    /// No report.
    Nothing,
    /// No report during a `within`.
    NothingInTime,
}

/// In words, to follow the condition.
impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Found::Passed(value) | Found::Failed(value) => write!(f, "the board reports {value}"),
            Found::Stale(age) => {
                write!(f, "the newest report is {:.0} ms old, which is more than 500 ms", age.in_millis())
            }
            Found::NothingInTime => {
                f.write_str("the board reported nothing in this time; reports come every 0.1 s from the start")
            }
            Found::Nothing => f.write_str("the board reported nothing yet; the first report takes about 0.1 s"),
        }
    }
}

impl Found {
    /// Whether the `expect` passed.
    pub fn is_passed(self) -> bool {
        matches!(self, Found::Passed(_))
    }
}

/// Measures a value of the reports, or its change since a moment.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Meter {
    /// The last value of what changes.
    last: Option<Hundredths>,
    /// The change so far.
    change: Hundredths,
}

impl Meter {
    /// Takes the next value of the measured quantity, and returns the measured value.
    pub(super) fn read(&mut self, measured: &Measured, value: Hundredths) -> Hundredths {
        let Some(change) = measured.change() else { return value };
        let from = self.last.replace(value).unwrap_or(value);
        self.change = Hundredths(self.change.0.saturating_add(change.between(from, value).0));
        self.change
    }
}

/// An expectation that waits for a value.
#[derive(Clone, Copy, Debug)]
struct Open {
    /// Its index.
    expect: usize,
    meter: Meter,
    /// The newest value received since it began.
    newest: Option<Hundredths>,
}

/// Judges the expectations of a timeline in order of time. Does not allocate after its creation.
#[derive(Debug)]
pub(super) struct Judge<'t> {
    expects: &'t [Expectation],
    /// The first expectation that has not started.
    next: usize,
    /// Expectations that wait for a value.
    open: Vec<Open>,
    /// For each quantity of the board, its newest value, and when that came.
    newest: Vec<Option<(Nanos, Hundredths)>>,
}

impl<'t> Judge<'t> {
    /// For a board with this number of quantities.
    pub(super) fn new(expects: &'t [Expectation], quantities: usize) -> Self {
        Judge { expects, next: 0, open: Vec::with_capacity(expects.len()), newest: vec![None; quantities] }
    }

    /// Reserves room, so that a later pass does not allocate.
    pub(super) fn make_room(&mut self, count: usize) {
        self.open.reserve(count);
    }

    /// Restarts with other expectations; keeps the newest report.
    pub(super) fn restart(&mut self, expects: &'t [Expectation]) {
        self.expects = expects;
        self.next = 0;
        self.open.clear();
    }

    /// Takes a report received at `now`, on the clock of the run.
    ///
    /// `time` is the time of the script: a report after the end of a `within` is too late.
    pub(super) fn hear(&mut self, time: Nanos, now: Nanos, report: Report, tell: &mut impl FnMut(Verdict)) {
        self.note(now, report);
        let expects = self.expects;
        self.open.retain_mut(|open| {
            let Some(Expectation { expect, until, .. }) = expects.get(open.expect) else { return false };
            let measured = &expect.criterion.measured;
            let Some(value) = measured.of(&report).filter(|_| time <= until.nanos()) else { return true };
            let value = open.meter.read(measured, value);
            open.newest = Some(value);
            let fits = expect.criterion.wanted.fits(value);
            if fits {
                tell(Verdict { expect: open.expect, found: Found::Passed(value) });
            }
            !fits
        });
    }

    /// Takes a report that no expectation waits for.
    pub(super) fn note(&mut self, now: Nanos, report: Report) {
        for (row, value) in report.values() {
            if let Some(newest) = self.newest.get_mut(row) {
                *newest = Some((now, value));
            }
        }
    }

    /// The newest value of a quantity, and when it came.
    fn newest(&self, quantity: usize) -> Option<(Nanos, Hundredths)> {
        self.newest.get(quantity).copied().flatten()
    }

    /// The newest value of a quantity, if it is not too old.
    fn fresh(&self, quantity: usize, now: Nanos) -> Option<Hundredths> {
        self.newest(quantity).filter(|(came, _)| now - *came <= FRESH).map(|(_, value)| value)
    }

    /// The newest values of these quantities that are not too old, if there are any.
    pub(super) fn fresh_report(&self, quantities: impl Iterator<Item = usize>, now: Nanos) -> Option<Report> {
        let mut report = Report::default();
        for row in quantities {
            if let (Some(value), Ok(row)) = (self.fresh(row, now), u16::try_from(row)) {
                report.add(row, value);
            }
        }
        Some(report).filter(|report| report.values().next().is_some())
    }

    /// A meter that begins now.
    pub(super) fn meter(&self, measured: &Measured, now: Nanos) -> Meter {
        let mut meter = Meter::default();
        if let Some(value) = self.fresh(measured.row(), now) {
            meter.read(measured, value);
        }
        meter
    }

    /// Judges what is due of the first `count` expectations: `time` is the time of the script, `now` of the run. Returns the
    /// first failure.
    pub(super) fn poll(
        &mut self,
        count: usize,
        (time, now): (Nanos, Nanos),
        tell: &mut impl FnMut(Verdict),
    ) -> Option<Verdict> {
        let mut failed = None;
        let is_due = |due: &&Expectation| due.at.nanos() <= time;
        while let Some(due) = self.expects.get(self.next).filter(|due| self.next < count && is_due(due)) {
            let at = self.next;
            self.next += 1;
            let Criterion { measured, wanted } = &due.expect.criterion;
            if due.expect.within.is_some() {
                self.open.push(Open { expect: at, meter: self.meter(measured, now), newest: None });
                continue;
            }
            let found = match self.newest(measured.row()) {
                None => Found::Nothing,
                Some((came, _)) if now - came > FRESH => Found::Stale(now - came),
                Some((_, value)) if wanted.fits(value) => Found::Passed(value),
                Some((_, value)) => Found::Failed(value),
            };
            let verdict = Verdict { expect: at, found };
            tell(verdict);
            if !found.is_passed() {
                failed = failed.or(Some(verdict));
            }
        }
        let expects = self.expects;
        self.open.retain(|Open { expect, newest, .. }| {
            let until = expects.get(*expect).map_or(Nanos::ZERO, |due| due.until.nanos());
            if until > time {
                return true;
            }
            let verdict = Verdict { expect: *expect, found: newest.map_or(Found::NothingInTime, Found::Failed) };
            tell(verdict);
            failed = failed.or(Some(verdict));
            false
        });
        failed
    }

    /// When the next of the first `count` expectations is due, in the time of the script.
    pub(super) fn next_due(&self, count: usize) -> Option<Nanos> {
        let next = self.expects.get(self.next).filter(|_| self.next < count).map(|due| due.at);
        let open = self.open.iter().filter_map(|open| self.expects.get(open.expect)).map(|due| due.until);
        open.chain(next).min().map(Micros::nanos)
    }
}
