//! The warnings that make a script fail.

use std::collections::BTreeSet;
use std::str::FromStr;

use super::{Code, Diagnostics, Severity};

/// The warnings that make a script fail: none, some, or all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Denied(BTreeSet<Code>);

/// The word for all warnings.
const ALL: &str = "warnings";

impl Denied {
    /// All warnings.
    pub fn all() -> Self {
        Denied(Code::ALL.iter().copied().filter(|code| code.severity() == Severity::Warning).collect())
    }

    /// The words that name warnings: `warnings` for all, and each code.
    pub fn names() -> impl Iterator<Item = &'static str> {
        std::iter::once(ALL).chain(Denied::all().0.into_iter().map(Code::name))
    }

    /// These warnings and those of another list.
    #[must_use]
    pub fn and(mut self, other: &Denied) -> Self {
        self.0.extend(&other.0);
        self
    }

    /// Whether any warning is denied.
    pub fn is_any(&self) -> bool {
        !self.0.is_empty()
    }

    /// Whether all warnings are denied.
    pub fn is_all(&self) -> bool {
        *self == Denied::all()
    }

    /// Whether a warning is denied.
    pub fn contains(&self, code: Code) -> bool {
        self.0.contains(&code)
    }

    /// How many of these diagnostics are denied.
    pub fn count(&self, diagnostics: &Diagnostics) -> usize {
        diagnostics.counts().into_iter().filter(|(code, _)| self.0.contains(code)).map(|(_, count)| count).sum()
    }
}

/// One of [`Denied::names`]; the error is empty.
impl FromStr for Denied {
    type Err = ();

    fn from_str(name: &str) -> Result<Self, ()> {
        if name == ALL {
            return Ok(Denied::all());
        }
        let code = Code::named(name).filter(|code| code.severity() == Severity::Warning).ok_or(())?;
        Ok(Denied(BTreeSet::from([code])))
    }
}
