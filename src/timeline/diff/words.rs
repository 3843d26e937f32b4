//! Changes in words.

use std::fmt;

use super::{Change, Shift, What};

impl Change {
    /// The change in words, with the place in the script where that is known.
    pub fn words(&self, place: Option<&str>) -> String {
        let place = place.map(|place| format!(" ({place})")).unwrap_or_default();
        let at = format!("at {}{place}: ", Secs(self.at_us));
        match &self.what {
            What::Shifted { things, by } => {
                let things = if things.is_empty() { "everything".into() } else { things.join(", ") };
                let words = format!("from {} on{place} {things} is {}", Secs(self.at_us), Later(by.step_us));
                match self.more {
                    None => words + &in_all(by),
                    Some(_) => format!("{words}{}: {} in all", self.again(", and again"), Later(by.total_us)),
                }
            }
            What::Changed { from, to, by_us, then } => {
                let moved = if *by_us == 0 { String::new() } else { format!(", {}", Later(*by_us)) };
                let then = then.map(|by| (by, format!(", and what follows is {}", Later(by.step_us))));
                let words = format!("{at}{}{moved}", between(from, to));
                match (then, self.more) {
                    (None, _) => words + &self.again(", and so"),
                    (Some((by, then)), None) => words + &then + &in_all(&by),
                    (Some((by, then)), Some(_)) => {
                        format!("{words}{then}{}: {} in all", self.again(", and so"), Later(by.total_us))
                    }
                }
            }
            What::Moved { what, by_us } => format!("{at}{what} is {}{}", Later(*by_us), self.again(", and so")),
            What::Added(what) => format!("{at}{what} is new{}", self.again(", and so")),
            What::Removed(what) => format!("{at}{what} is gone{}", self.again(", and so")),
            What::Steps { what, from, to } => {
                let steps = if from == to {
                    "gets there by other steps".into()
                } else {
                    format!("gets there in {from} -> {to} steps")
                };
                let more = self.more.map_or(String::new(), |(more, _)| match more {
                    1 => ", and one more move takes other steps".into(),
                    more => format!(", and {more} more moves take other steps"),
                });
                format!("{at}{what} {steps}{more}")
            }
            What::Refreshed { from_us, to_us } => {
                let interval = |us: &Option<u64>| us.map_or("never".into(), |us| format!("every {}", Span(us)));
                format!(
                    "while the drive holds, its frame is sent again {} -> {} (`refresh`)",
                    interval(from_us),
                    interval(to_us)
                )
            }
            What::Reordered => format!("{at}the frames of this time are sent in another order"),
            What::Length { from_us, to_us } => {
                format!("in all: the last frame is sent at {} -> {}", Secs(*from_us), Secs(*to_us))
            }
            What::Load { from, to } => {
                let all =
                    if from.0 == to.0 { format!("{} bytes", to.0) } else { format!("{} -> {} bytes", from.0, to.0) };
                let busiest = if from.1 == to.1 {
                    String::new()
                } else {
                    format!(", in the busiest second {} -> {}", from.1, to.1)
                };
                format!("in all: {all} are sent{busiest}")
            }
        }
    }

    /// How often it is besides.
    fn again(&self, words: &str) -> String {
        match self.more {
            None => String::new(),
            Some((1, last_us)) => format!("{words} once more at {}", Secs(last_us)),
            Some((more, last_us)) => format!("{words} {more} more times until {}", Secs(last_us)),
        }
    }

    /// What must be the same for two changes to be said together.
    pub(super) fn kind(&self) -> What {
        let mut what = self.what.clone();
        match &mut what {
            What::Shifted { by, .. } | What::Changed { then: Some(by), .. } => by.total_us = 0,
            What::Steps { what, from, to } => {
                what.clear();
                (*from, *to) = (0, 0);
            }
            _ => {}
        }
        what
    }

    /// Takes another change of the same kind into this one.
    pub(super) fn grow(&mut self, other: &Change) {
        let by = |what: &What| match what {
            What::Shifted { by, .. } | What::Changed { then: Some(by), .. } => Some(by.total_us),
            _ => None,
        };
        let total = by(&other.what);
        if let (What::Shifted { by, .. } | What::Changed { then: Some(by), .. }, Some(total_us)) =
            (&mut self.what, total)
        {
            by.total_us = total_us;
        }
    }
}

/// Where a shift adds to an earlier one: what both come to.
fn in_all(by: &Shift) -> String {
    if by.step_us == by.total_us { String::new() } else { format!(": {} in all", Later(by.total_us)) }
}

/// `servo 2 1500 -> 1600 over 500 ms`: what is the same is said once.
fn between(from: &[String], to: &[String]) -> String {
    let is_told = |part: &&String| *part != "ease linear";
    let whole = |parts: &[String]| parts.iter().filter(is_told).cloned().collect::<Vec<_>>().join(" ");
    if from.len() != to.len() || from.first() != to.first() {
        return format!("{} -> {}", whole(from), whole(to));
    }
    let pairs = from.iter().zip(to).filter(|(old, new)| old != new || is_told(new));
    let words = pairs.map(|(old, new)| {
        let (word, value) = new.split_once(' ').unwrap_or(("", new));
        match old.split_once(' ') {
            _ if old == new => new.clone(),
            Some((same, was)) if same == word => format!("{word} {was} -> {value}"),
            _ => format!("{old} -> {new}"),
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Seconds to the millisecond, or as exactly as they are.
struct Secs(u64);

impl fmt::Display for Secs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 % 1_000 {
            0 => write!(f, "{}.{:03} s", self.0 / 1_000_000, self.0 / 1_000 % 1_000),
            _ => write!(f, "{}.{:06} s", self.0 / 1_000_000, self.0 % 1_000_000),
        }
    }
}

/// A time that passes: microseconds, milliseconds or seconds.
pub(super) struct Span(pub(super) u64);

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            us if us % 1_000 != 0 && us < 1_000_000 => write!(f, "{us} us"),
            us if us < 1_000_000 => write!(f, "{} ms", us / 1_000),
            us => Secs(us).fmt(f),
        }
    }
}

/// `200 ms later`.
struct Later(i64);

impl fmt::Display for Later {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.0 < 0 { "earlier" } else { "later" };
        write!(f, "{} {word}", Span(self.0.unsigned_abs()))
    }
}
