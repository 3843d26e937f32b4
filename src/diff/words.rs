//! Describes changes as text.

use std::fmt;

use super::parts::Words;
use super::{Again, Change, Shift, What};
use crate::units::Micros;

impl Change {
    /// Describes the change, with its place in the script if known.
    pub fn words(&self, place: Option<&str>) -> String {
        self.parts(place).to_string()
    }

    /// Describes the change like [`words`](Self::words), in parts. It begins with the robots, as a script names them.
    pub fn parts(&self, place: Option<&str>) -> Words {
        let names = self.robots.join(", ");
        match &self.what {
            What::RobotAdded => Words::from("robot `") + Words::new(names) + "` is added",
            What::RobotRemoved => Words::from("robot `") + Words::old(names) + "` is removed",
            _ if names.is_empty() => self.parts_of_change(place),
            _ => Words::from(names + ": ") + self.parts_of_change(place),
        }
    }

    /// What changed, whatever the robot.
    #[expect(clippy::too_many_lines, reason = "one arm for each kind of change")]
    fn parts_of_change(&self, place: Option<&str>) -> Words {
        let place = place.map(|place| format!(" ({place})")).unwrap_or_default();
        let when = if self.aborts { "on abort, " } else { "" };
        let at = Words::from(format!("{when}at {}{place}: ", secs(self.at)));
        match &self.what {
            What::Shifted { things, by, pause } => {
                let things = if things.is_empty() { "everything".into() } else { things.join(", ") };
                let again = self.again(&format!(", and by another {}", span(Micros(by.step_us.unsigned_abs()))));
                let from = Words::from(format!("{when}from {}{place}: ", secs(self.at)));
                let pause = pause.map(pause_before).unwrap_or_default();
                from + pause + format!("{things} is {}", Later(by.total_us)) + again
            }
            What::Scaled { until, lasts, by } => {
                let everything = format!("everything runs {}", pace(*lasts));
                if until.is_none() && self.at == Micros::ZERO {
                    return Words::from(format!("{when}{everything}"));
                }
                let to = until.map(|until| format!(" to {}", secs(until))).unwrap_or_default();
                let then = until.map(|_| format!(", so the following commands are {}", Later(by.total_us)));
                let words =
                    format!("{when}from {}{to}{place}: {everything}{}", secs(self.at), then.unwrap_or_default());
                Words::from(words) + self.again(", the same")
            }
            What::Changed { from, to, by_us, then } => {
                let moved = by_us.map(|by_us| format!(", and is {}", Later(by_us))).unwrap_or_default();
                let then = then.as_ref().map(|(thing, by)| {
                    let of = thing.as_ref().map(|thing| format!(" of {thing}")).unwrap_or_default();
                    format!(", so the following commands{of} are {}", Later(by.total_us))
                });
                at + between(from, to) + moved + then.unwrap_or_default() + self.again(", the same")
            }
            What::Moved { what, by_us } => at + format!("{what} is {}{}", Later(*by_us), self.again(", the same")),
            What::Gate { from, to } => {
                at + "the gate now waits for "
                    + Words::new(awaited(to))
                    + " instead of "
                    + Words::old(awaited(from))
                    + self.again(", the same")
            }
            What::GateOrder(gate) => at + format!("{gate} is in another place among the lines of this time"),
            What::RobotAdded | What::RobotRemoved => Words::default(),
            What::Added(what) => at + Words::new(what) + " is added" + self.again(", the same"),
            What::Removed(what) => at + Words::old(what) + " is removed" + self.again(", the same"),
            What::Steps { what, from, to } => {
                let takes = if from == to {
                    Words::from(format!("{what} takes other steps"))
                } else {
                    Words::from(format!("{what} takes ")) + Words::change(from.to_string(), to.to_string()) + " steps"
                };
                let more = self.more.map_or(String::new(), |again| match again.count {
                    1 => ", and one more move takes other steps".into(),
                    more => format!(", and {more} more moves take other steps"),
                });
                at + takes + more
            }
            What::Refreshed { from, to } => {
                let interval =
                    |time: &Option<Micros>| time.map_or("off".into(), |time| format!("every {}", span(time)));
                Words::from("drive refresh ") + Words::change(interval(from), interval(to))
            }
            What::Reordered => at + "the frames at this time are sent in another order",
            What::Baud { from, to } => Words::from("overall: baud ") + Words::change(from.to_string(), to.to_string()),
            What::Length { from, to } => {
                Words::from("overall: the script ends at ") + Words::change(secs(*from), secs(*to))
            }
            What::Load { from, to } => {
                let number = |from: u64, to: u64| {
                    let (old, new) = (from.to_string(), to.to_string());
                    if from == to { Words::from(old) } else { Words::change(old, new) }
                };
                let words = Words::from("overall: ") + number(from.0, to.0) + " bytes are sent";
                if from.1 == to.1 {
                    return words;
                }
                words + ", " + number(from.1, to.1) + " in the busiest second"
            }
        }
    }

    /// Describes the repetitions.
    fn again(&self, words: &str) -> String {
        let Some(Again { count, last, otherwise, total_us }) = self.more else { return String::new() };
        let words = match &self.what {
            What::Added(_) | What::Removed(_) if otherwise => {
                let frames = if count == 1 { "one more command".into() } else { format!("{count} more commands") };
                return format!(", and {frames} of this line until {}", secs(last));
            }
            _ if otherwise => ", with other values",
            What::Shifted { by, .. } if by.total_us == total_us => ", the same",
            _ => words,
        };
        let then = match &self.what {
            What::Shifted { by, .. } | What::Scaled { by, .. } | What::Changed { then: Some((_, by)), .. }
                if by.total_us != total_us =>
            {
                match total_us {
                    0 => format!(": {}", Later(0)),
                    _ => format!(": {} in total", Later(total_us)),
                }
            }
            _ => String::new(),
        };
        match count {
            1 => format!("{words} once more at {}{then}", secs(last)),
            more => format!("{words} {more} more times until {}{then}", secs(last)),
        }
    }

    /// The key by which changes are combined; `of_one_line` if both belong to one line of the
    /// script.
    pub(super) fn kind(&self, of_one_line: bool) -> (What, bool) {
        let mut what = self.what.clone();
        match &mut what {
            // Whether a lane is back at its old time is a separate change.
            What::Shifted { by, pause, .. } => {
                by.total_us = i64::from(by.total_us == 0);
                *pause = None;
            }
            What::Scaled { until, lasts, by } => {
                *by = Shift { step_us: 0, total_us: 0 };
                *until = until.map(|_| Micros::ZERO);
                *lasts = [Micros(permille(*lasts)), Micros(u64::from(lasts[0] < lasts[1]))];
            }
            What::Changed { from, to, then, .. } => {
                if let Some((_, by)) = then {
                    by.total_us = 0;
                }
                if of_one_line {
                    from.truncate(1);
                    to.truncate(1);
                }
            }
            What::Added(what) | What::Removed(what) if of_one_line => {
                what.truncate(what.find(' ').unwrap_or(what.len()));
            }
            What::Steps { what, from, to } => {
                what.clear();
                (*from, *to) = (0, 0);
            }
            _ => {}
        }
        (what, self.aborts)
    }

    /// Adds another change of the same kind.
    pub(super) fn grow(&mut self, other: &Change) {
        if let (What::Shifted { pause, .. }, What::Shifted { pause: other, .. }) = (&mut self.what, &other.what)
            && pause != other
        {
            *pause = None;
        }
        let differs = match (&self.what, &other.what) {
            (What::Changed { from, to, .. }, What::Changed { from: was, to: is, .. }) => from != was || to != is,
            (What::Added(one) | What::Removed(one), What::Added(two) | What::Removed(two)) => one != two,
            _ => false,
        };
        let total_us = match &other.what {
            What::Shifted { by, .. } | What::Scaled { by, .. } | What::Changed { then: Some((_, by)), .. } => {
                by.total_us
            }
            _ => 0,
        };
        let (count, otherwise) = self.more.map_or((0, false), |again| (again.count, again.otherwise));
        self.more = Some(Again { count: count + 1, last: other.at, otherwise: otherwise || differs, total_us });
    }
}

/// What a gate waits for: its line without `wait`.
fn awaited(line: &str) -> &str {
    let line = line.strip_prefix("wait ").unwrap_or(line);
    line.strip_prefix("until ").unwrap_or(line)
}

/// `the pause before it is 1.000 s -> 2.000 s, so `.
fn pause_before([old, new]: [Micros; 2]) -> Words {
    match (old, new) {
        (Micros::ZERO, new) => Words::from("a pause of ") + Words::new(span(new)) + " is added before it, so ",
        (old, Micros::ZERO) => Words::from("the pause of ") + Words::old(span(old)) + " before it is removed, so ",
        (old, new) => Words::from("the pause before it is ") + Words::change(span(old), span(new)) + ", so ",
    }
}

/// By how much the speed changes, in tenths of a percent.
fn permille([old, new]: [Micros; 2]) -> u64 {
    let (change, new) = (u128::from(old.0.abs_diff(new.0)), u128::from(new.0.max(1)));
    u64::try_from((change * 1_000 + new / 2) / new).unwrap_or(u64::MAX)
}

/// `4 % faster`: in whole percents from one percent on.
fn pace(lasts: [Micros; 2]) -> String {
    let by = match permille(lasts) {
        0 => "less than 0.1 %".into(),
        tenths @ 1..10 => format!("0.{tenths} %"),
        tenths => format!("{} %", (tenths + 5) / 10),
    };
    format!("{by} {}", if lasts[1] < lasts[0] { "faster" } else { "slower" })
}

/// Whether a part is shown even if it has not changed.
pub(super) fn is_always_shown(part: &str) -> bool {
    part != "ease linear" && !part.starts_with("from ")
}

/// `servo 2 1500 -> 1600 over 500 ms`: unchanged words are not repeated.
fn between(from: &[String], to: &[String]) -> Words {
    let whole =
        |parts: &[String]| parts.iter().filter(|part| is_always_shown(part)).cloned().collect::<Vec<_>>().join(" ");
    if from.len() != to.len() || from.first() != to.first() {
        return Words::change(whole(from), whole(to));
    }
    let change = |(old, new): (&String, &String)| {
        let (word, value) = new.split_once(' ').unwrap_or(("", new));
        match old.split_once(' ') {
            _ if old == new => Words::from(new.as_str()),
            Some((same, was)) if same == word => Words::from(format!("{word} ")) + Words::change(was, value),
            _ => Words::change(old, new),
        }
    };
    let mut pairs = from.iter().zip(to).filter(|(old, new)| old != new || is_always_shown(new));
    let verb = pairs.next().map(change);
    let (values, others): (Vec<_>, Vec<_>) = pairs.partition(|(old, new)| !old.contains(' ') && !new.contains(' '));
    // Several new values are shown together: `wheels 4 4 -4 -4 -> 2 2 -2 -2`.
    let values = if values.iter().filter(|(old, new)| old != new).count() > 1 {
        let (old, new): (Vec<&str>, Vec<&str>) = values.iter().map(|(old, new)| (old.as_str(), new.as_str())).unzip();
        vec![Words::change(old.join(" "), new.join(" "))]
    } else {
        values.into_iter().map(change).collect()
    };
    Words::joined(verb.into_iter().chain(values).chain(others.into_iter().map(change)))
}

/// Seconds with three decimals, or with six if needed.
fn secs(at: Micros) -> String {
    let places = if at.0.is_multiple_of(1_000) { 3 } else { 6 };
    format!("{at:.places$} s")
}

/// A duration in microseconds, milliseconds or seconds, without rounding.
pub(super) fn span(time: Micros) -> String {
    match time {
        Micros(us) if us < 1_000_000 && !us.is_multiple_of(1_000) => format!("{us} us"),
        Micros(us) if us < 1_000_000 => format!("{} ms", time.in_millis()),
        _ => secs(time),
    }
}

/// Displays a shift: `200 ms later`.
struct Later(i64);

impl fmt::Display for Later {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("back at its old time"),
            us => write!(f, "{} {}", span(Micros(us.unsigned_abs())), if us < 0 { "earlier" } else { "later" }),
        }
    }
}
