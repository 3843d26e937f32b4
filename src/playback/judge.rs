//! Judges each `expect`, as a pure function of time and of the reports received.
//!
//! A report that is old, unreadable or missing never makes an `expect` pass. The board's reports have no checksum, so a report
//! with garbled digits cannot be recognized.

use std::fmt;

use crate::board::{Hundredths, Report};
use crate::timeline::Expectation;
use crate::units::{Micros, Nanos};

/// The maximum age of a report.
const FRESH: Nanos = Nanos::from_millis(500);

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
                f.write_str("the board reported nothing in this time; it reports every 0.1 s from the start")
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

/// Judges the expectations of a timeline in order of time. Does not allocate after its creation.
#[derive(Debug)]
pub(super) struct Judge<'t> {
    expects: &'t [Expectation],
    /// The first expectation that has not started.
    next: usize,
    /// Expectations that wait for a value, with the newest value received since.
    open: Vec<(usize, Option<Hundredths>)>,
    /// The newest report and its time.
    newest: Option<(Nanos, Report)>,
}

impl<'t> Judge<'t> {
    pub(super) fn new(expects: &'t [Expectation]) -> Self {
        Judge { expects, next: 0, open: Vec::with_capacity(expects.len()), newest: None }
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
        self.newest = Some((now, report));
        let expects = self.expects;
        self.open.retain_mut(|(at, newest)| {
            let Some(Expectation { expect, until, .. }) = expects.get(*at) else { return false };
            if time > until.nanos() {
                return true;
            }
            let value = expect.measured.of(&report);
            *newest = Some(value);
            let fits = expect.wanted.fits(value);
            if fits {
                tell(Verdict { expect: *at, found: Found::Passed(value) });
            }
            !fits
        });
    }

    /// Takes a report that no expectation waits for.
    pub(super) fn note(&mut self, now: Nanos, report: Report) {
        self.newest = Some((now, report));
    }

    /// Judges what is due: `time` is the time of the script, `now` of the run. Returns the first failure.
    pub(super) fn poll(&mut self, time: Nanos, now: Nanos, tell: &mut impl FnMut(Verdict)) -> Option<Verdict> {
        let mut failed = None;
        while let Some(due) = self.expects.get(self.next).filter(|due| due.at.nanos() <= time) {
            let at = self.next;
            self.next += 1;
            if due.expect.within.is_some() {
                self.open.push((at, None));
                continue;
            }
            let found = match self.newest {
                None => Found::Nothing,
                Some((came, _)) if now - came > FRESH => Found::Stale(now - came),
                Some((_, report)) => {
                    let value = due.expect.measured.of(&report);
                    if due.expect.wanted.fits(value) { Found::Passed(value) } else { Found::Failed(value) }
                }
            };
            let verdict = Verdict { expect: at, found };
            tell(verdict);
            if !found.is_passed() {
                failed = failed.or(Some(verdict));
            }
        }
        let expects = self.expects;
        self.open.retain(|(at, newest)| {
            let until = expects.get(*at).map_or(Nanos::ZERO, |due| due.until.nanos());
            if until > time {
                return true;
            }
            let verdict = Verdict { expect: *at, found: newest.map_or(Found::NothingInTime, Found::Failed) };
            tell(verdict);
            failed = failed.or(Some(verdict));
            false
        });
        failed
    }

    /// When the next expectation is due, in the time of the script.
    pub(super) fn next_due(&self) -> Option<Nanos> {
        let next = self.expects.get(self.next).map(|due| due.at);
        let open = self.open.iter().filter_map(|(at, _)| self.expects.get(*at)).map(|due| due.until);
        open.chain(next).min().map(Micros::nanos)
    }
}
