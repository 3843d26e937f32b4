//! The capacity of the line: when each byte leaves at the line's speed, and which frames leave too
//! late.
//!
//! A byte takes ten bits on the wire (8N1). Frames leave one after another in the order of sending,
//! and none before it is due. The lateness of a frame is measured at the start of its first byte,
//! so a single frame is never late, however slow the line.

use super::{Event, Timeline};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::units::{BITS_A_BYTE, Micros};

/// Ticks per byte, at any baud rate.
const BYTE: u64 = BITS_A_BYTE * 1_000_000;
/// A frame that is later than this is a warning.
pub const LATE: Micros = Micros::from_millis(5);
/// A frame that is later than this is an error.
const FULL: Micros = Micros::from_millis(50);

/// The line and its queue. All times are exact, in ticks of 1/(10⁶ · baud) s: a microsecond is
/// `baud` ticks, a byte ten million.
#[derive(Clone, Debug)]
pub struct Wire {
    baud: u64,
    /// When the last byte so far has left.
    free: u64,
}

/// When a frame leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Departure {
    /// When its first byte starts, in ticks.
    pub begins: u64,
    /// When its last byte has left, in ticks.
    pub left: u64,
}

impl Wire {
    /// An idle line of `baud` bits per second.
    pub fn new(baud: u32) -> Self {
        Wire { baud: u64::from(baud.max(1)), free: 0 }
    }

    /// Converts a time to ticks.
    pub fn ticks(&self, time: Micros) -> u64 {
        time.0.saturating_mul(self.baud)
    }

    /// Converts ticks to microseconds.
    pub(crate) fn in_micros(&self, ticks: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "for pictures")]
        let [ticks, baud] = [ticks as f64, self.baud as f64];
        ticks / baud
    }

    /// Sends a frame of this many bytes that is due at a time. Times must not decrease.
    pub fn send(&mut self, due: Micros, bytes: usize) -> Departure {
        let begins = self.free.max(self.ticks(due));
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
        self.free = begins.saturating_add(bytes.saturating_mul(BYTE));
        Departure { begins, left: self.free }
    }

    /// The bytes per second that the line can carry.
    pub fn capacity(&self) -> u64 {
        self.baud / BITS_A_BYTE
    }
}

/// How busy the line is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Load {
    /// The bytes that leave in each second, from the start of the script.
    pub seconds: Vec<u64>,
    /// The frame that leaves with the greatest delay: its index in the events, and the delay.
    pub worst: Option<(usize, Micros)>,
}

/// When frames leave, and the delay of each, rounded up.
pub(crate) fn departures<'t>(
    timeline: &'t Timeline,
    events: &'t [Event],
) -> impl Iterator<Item = (&'t Event, Departure, Micros)> {
    let mut wire = Wire::new(timeline.baud);
    events.iter().map(move |event| {
        let departure = wire.send(event.at, timeline.board.frame_length(&event.command));
        let late = departure.begins.saturating_sub(wire.ticks(event.at)).div_ceil(wire.baud);
        (event, departure, Micros(late))
    })
}

/// How busy the line is in each second.
pub fn load(timeline: &Timeline) -> Load {
    let mut load = Load::default();
    let second = Wire::new(timeline.baud).ticks(Micros::SECOND);
    for (at, (_, departure, late)) in departures(timeline, &timeline.events).enumerate() {
        if load.worst.is_none_or(|(_, worst)| late > worst) {
            load.worst = Some((at, late));
        }
        for byte in 1..=(departure.left - departure.begins) / BYTE {
            let left = departure.begins.saturating_add(byte * BYTE);
            let at = usize::try_from(left.saturating_sub(1) / second).unwrap_or(usize::MAX);
            // A script lasts at most a day, and frames after its end leave soon.
            if at >= load.seconds.len() {
                load.seconds.resize(at.saturating_add(1), 0);
            }
            if let Some(count) = load.seconds.get_mut(at) {
                *count += 1;
            }
        }
    }
    load
}

/// Reports late frames in one diagnostic at the worst frame.
pub(super) fn check(timeline: &Timeline, diagnostics: &mut Diagnostics) {
    for aborts in [false, true] {
        let mut worst: Option<(&Event, Micros)> = None;
        let mut count = 0_usize;
        for (event, _, late) in departures(timeline, timeline.frames(aborts)) {
            let is_allowed = || late <= FULL && diagnostics.is_allowed(Code::WireLate, event.span);
            if late <= LATE || is_allowed() {
                continue;
            }
            count += 1;
            if worst.is_none_or(|(_, worst)| late > worst) {
                worst = Some((event, late));
            }
        }
        if let Some((event, late)) = worst {
            let diagnostic = too_late(timeline, event, late, count, aborts);
            diagnostics.push(timeline.traces.attach(diagnostic, event.trace));
        }
    }
}

fn too_late(timeline: &Timeline, event: &Event, late: Micros, count: usize, aborts: bool) -> Diagnostic {
    let code = if late > FULL { Code::WireFull } else { Code::WireLate };
    let when = if aborts { " from the stop" } else { "" };
    let late = late.short();
    let more = match count {
        1 => String::new(),
        2 => "; another frame is late too".to_owned(),
        count => format!("; {} more frames are late too", count - 1),
    };
    let message = format!(
        "`{}` is due at {:.6} s{when} but leaves {late} late, because the line is busy{more}",
        timeline.board.show(&event.command),
        event.at
    );
    let help = format!(
        "the line carries {} bytes per second: separate these commands in time, or send fewer frames with a lower `rate` or a longer `refresh`",
        Wire::new(timeline.baud).capacity()
    );
    Diagnostic::new(code, event.span, message, help).label(format!("{late} late"))
}
