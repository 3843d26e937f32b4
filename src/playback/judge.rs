//! What becomes of each `expect`, as a pure function of time and of the reports that came.
//!
//! Telemetry is not trusted: a report that is old, unreadable or missing never makes an `expect` pass. The board's reports have no
//! checksum, so one whose digits were garbled is a report like any other.

use std::fmt;

use crate::board::{Hundredths, Report};
use crate::timeline::Expectation;
use crate::units::{Micros, Nanos};

/// How old a report may be to be judged.
const FRESH: Nanos = Nanos::from_millis(500);

/// What became of one `expect`.
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
    /// A value that fits.
    Passed(Hundredths),
    /// A value that does not.
    Failed(Hundredths),
    /// A report so old that it says nothing of now.
    Stale(Nanos),
    /// No report at all.
    Nothing,
    /// No report in the time of a `within`.
    NothingInTime,
}

/// In words, behind what was expected.
impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Found::Passed(value) | Found::Failed(value) => write!(f, "the board reports {value}"),
            Found::Stale(age) => {
                write!(f, "the newest report is {:.0} ms old, and only one of the last 500 ms counts", age.in_millis())
            }
            Found::NothingInTime => {
                f.write_str("the board has reported nothing in this time; it reports every 0.1 s, from the start on")
            }
            Found::Nothing => f.write_str("the board has reported nothing; the first report takes about 0.1 s"),
        }
    }
}

impl Found {
    /// Whether the `expect` holds.
    pub fn is_passed(self) -> bool {
        matches!(self, Found::Passed(_))
    }
}

/// Judges the expectations of a timeline, in the order of time. Allocates nothing once it is made.
#[derive(Debug)]
pub(super) struct Judge<'t> {
    expects: &'t [Expectation],
    /// The first that has not begun.
    next: usize,
    /// Those that wait for a report that fits, with the newest value that came since.
    open: Vec<(usize, Option<Hundredths>)>,
    /// The newest report, and when it came.
    newest: Option<(Nanos, Report)>,
}

impl<'t> Judge<'t> {
    pub(super) fn new(expects: &'t [Expectation]) -> Self {
        Judge { expects, next: 0, open: Vec::with_capacity(expects.len()), newest: None }
    }

    /// Makes room for so many at once, so that a later pass allocates nothing.
    pub(super) fn make_room(&mut self, count: usize) {
        self.open.reserve(count);
    }

    /// Begins again with these; the newest report stays what it is.
    pub(super) fn restart(&mut self, expects: &'t [Expectation]) {
        self.expects = expects;
        self.next = 0;
        self.open.clear();
    }

    /// Takes a report that came at `now`, on the clock of the run.
    ///
    /// `time` is the script's: what comes behind the time of a `within` is too late for it.
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

    /// Takes a report that nothing waits for.
    pub(super) fn note(&mut self, now: Nanos, report: Report) {
        self.newest = Some((now, report));
    }

    /// Judges what is due: `time` is the script's, `now` the run's. Gives the first that fails.
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

    /// When something is due next, in the time of the script.
    pub(super) fn next_due(&self) -> Option<Nanos> {
        let next = self.expects.get(self.next).map(|due| due.at);
        let open = self.open.iter().filter_map(|(at, _)| self.expects.get(*at)).map(|due| due.until);
        open.chain(next).min().map(Micros::nanos)
    }
}
