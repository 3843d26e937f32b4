//! What goes wrong on purpose with a virtual board: the list of faults that `--fault` and `# rehearse:` name, and the wrappers in
//! which they happen. [`Faulty`] is around the board, for all that is on its line, and `Stalling` around the link of whoever plays.

mod faulty;
#[cfg(all(feature = "player", target_os = "linux"))]
mod stalling;

use std::fmt;
use std::str::FromStr;

use crate::board::Hundredths;
use crate::units::Micros;

pub use faulty::{Faulty, Stall};
#[cfg(all(feature = "player", target_os = "linux"))]
pub use stalling::Stalling;

/// Faults of a rehearsal, as `--fault` and `# rehearse:` name them: `drop=5%,unplug@4s`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Of how many frames and reports in a hundred nothing comes.
    pub drop: f64,
    /// In how many frames and reports in a hundred one bit is wrong.
    pub garble: f64,
    /// The battery has another voltage at rest from a time on.
    pub battery: Option<(Hundredths, Micros)>,
    /// The cable is pulled at a time.
    pub unplug: Option<Micros>,
    /// The port takes no bytes from a time on.
    pub stall: Option<Micros>,
    /// The board reports nothing.
    pub silent: bool,
    /// Which random numbers there are.
    pub seed: u64,
    /// How they were named.
    words: String,
}

/// Why a text names no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no fault; write drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent or seed=7, each kind once, with commas between several"
)]
pub struct NotAFault(String);

impl FromStr for Faults {
    type Err = NotAFault;

    fn from_str(text: &str) -> Result<Self, NotAFault> {
        let mut faults = Faults { words: text.trim().to_owned(), ..Faults::default() };
        for word in text.split(',').map(str::trim) {
            faults.add(word).ok_or_else(|| NotAFault(word.to_owned()))?;
        }
        Ok(faults)
    }
}

impl Faults {
    fn add(&mut self, word: &str) -> Option<()> {
        // Of each kind there is one.
        let name = word.split(['=', '@']).next().unwrap_or_default();
        let named = self.words.split(',').filter(|other| other.trim().split(['=', '@']).next() == Some(name));
        if named.count() > 1 {
            return None;
        }
        if word == "silent" {
            self.silent = true;
            return Some(());
        }
        if let Some(time) = word.strip_prefix("unplug@") {
            self.unplug = Some(moment(time)?);
        } else if let Some(time) = word.strip_prefix("stall@") {
            self.stall = Some(moment(time)?);
        } else if let Some(percent) = word.strip_prefix("drop=") {
            self.drop = part(percent)?;
        } else if let Some(percent) = word.strip_prefix("garble=") {
            self.garble = part(percent)?;
        } else if let Some(seed) = word.strip_prefix("seed=") {
            self.seed = seed.parse().ok()?;
        } else {
            let (volts, time) = word.strip_prefix("battery=")?.split_once('V')?;
            let at_rest = self::volts(volts)?;
            let from = match time.strip_prefix('@') {
                Some(time) => moment(time)?,
                None if time.is_empty() => Micros::ZERO,
                None => return None,
            };
            self.battery = Some((at_rest, from));
        }
        Some(())
    }

    /// Whether nothing goes wrong.
    pub fn is_none(&self) -> bool {
        self.words.is_empty()
    }
}

/// As they were named.
impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

/// A number of volts from 0 to 100, rounded to hundredths.
pub fn volts(text: &str) -> Option<Hundredths> {
    let hundredths = libm::round(text.parse::<f64>().ok()? * 100.0);
    #[expect(clippy::cast_possible_truncation, reason = "in range")]
    (0.0..=10_000.0).contains(&hundredths).then_some(Hundredths(hundredths as i32))
}

/// A time of a script.
fn moment(text: &str) -> Option<Micros> {
    text.parse().ok().filter(|time| *time <= Micros::DAY)
}

/// `5%` as a part of one.
fn part(text: &str) -> Option<f64> {
    let percent: f64 = text.strip_suffix('%')?.parse().ok()?;
    (0.0..=100.0).contains(&percent).then_some(percent / 100.0)
}
