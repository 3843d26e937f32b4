//! Deliberate faults of a virtual board: the list that `--fault` and `# rehearse:` name, and the wrappers that apply them. [`Faulty`]
//! wraps the board and its line, and `Stalling` wraps the link of the player.

mod faulty;
#[cfg(all(feature = "player", target_os = "linux"))]
mod stalling;

use std::fmt;
use std::str::FromStr;

use crate::board::Hundredths;
use crate::sim::{ServoFault, servo_fault};
use crate::units::Micros;

pub use faulty::{Faulty, Stall};
#[cfg(all(feature = "player", target_os = "linux"))]
pub use stalling::Stalling;

/// The start of a fault of one servo.
const SERVO: &str = "servo=";

/// Faults of a rehearsal, as `--fault` and `# rehearse:` name them: `drop=5%,unplug@4s`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// The part of frames and reports that are dropped, 0 to 1.
    pub drop: f64,
    /// The part of frames and reports with one wrong bit, 0 to 1.
    pub garble: f64,
    /// Another voltage of the battery at rest, from a time on.
    pub battery: Option<(Hundredths, Micros)>,
    /// When the board is unplugged.
    pub unplug: Option<Micros>,
    /// When the port stops taking bytes.
    pub stall: Option<Micros>,
    /// Whether the board sends no reports.
    pub silent: bool,
    /// What is wrong with single servos of a bus, by their numbers.
    pub servos: Vec<(u8, ServoFault)>,
    /// The seed of the random numbers.
    pub seed: u64,
    /// As they were written.
    words: String,
}

/// Why a string is not a list of faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown fault `{0}`; write drop=5%, garble=2%, battery=6.5V@3s, unplug@4s, stall@2s, silent or seed=7, each at most once, \
     and for a servo of a bus servo=3:silent, twice, other, sum, late, wheel, lost, error, slow or a position at the start, \
     each at most once for a servo; separated by commas"
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
        // Each kind may be given once.
        let named = self.words.split(',').filter(|other| kind(other.trim()) == kind(word));
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
        } else if let Some(servo) = word.strip_prefix(SERVO) {
            self.servos.push(servo_fault(servo)?);
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

    /// Whether there are no faults.
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

/// The kind of a fault: what comes before its value.
fn kind(word: &str) -> &str {
    match word.strip_prefix(SERVO) {
        Some(_) => word.trim_end_matches(|letter: char| letter.is_ascii_digit()),
        None => word.split(['=', '@']).next().unwrap_or_default(),
    }
}

/// A number of volts from 0 to 100, rounded to hundredths.
pub fn volts(text: &str) -> Option<Hundredths> {
    let hundredths = libm::round(text.parse::<f64>().ok()? * 100.0);
    #[expect(clippy::cast_possible_truncation, reason = "in range")]
    (0.0..=10_000.0).contains(&hundredths).then_some(Hundredths(hundredths as i32))
}

/// A time in a script.
fn moment(text: &str) -> Option<Micros> {
    text.parse().ok().filter(|time| *time <= Micros::DAY)
}

/// `5%` as 0.05.
fn part(text: &str) -> Option<f64> {
    let percent: f64 = text.strip_suffix('%')?.parse().ok()?;
    (0.0..=100.0).contains(&percent).then_some(percent / 100.0)
}
