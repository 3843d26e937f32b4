//! How long a beat and a bar are.

use super::Speed;
use super::time::Time;

/// A tempo and a meter: 120 bpm and four beats a bar, unless a script says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tempo {
    beat: Time,
    beats: u32,
}

impl Default for Tempo {
    fn default() -> Self {
        Tempo { beat: Time::from_millis(500), beats: 4 }
    }
}

impl Tempo {
    /// The length of a beat.
    pub fn beat(self) -> Time {
        self.beat
    }

    /// How many beats a bar has.
    pub fn beats(self) -> u32 {
        self.beats
    }

    /// The length of a bar.
    pub(super) fn bar(self) -> Time {
        self.beat.times(u64::from(self.beats))
    }

    /// The same meter at this number of beats per minute; `None` if that is not a tempo.
    pub(super) fn at(self, bpm: f64) -> Option<Tempo> {
        let beat = Time::from_millis(60_000).over_number(bpm)?;
        Some(Tempo { beat, ..self })
    }

    /// The same at another speed.
    pub(super) fn at_speed(self, speed: Speed) -> Tempo {
        Tempo { beat: speed.time(self.beat), ..self }
    }

    /// The same tempo with this number of beats per bar.
    pub(super) fn of(self, beats: u32) -> Tempo {
        Tempo { beats, ..self }
    }
}
