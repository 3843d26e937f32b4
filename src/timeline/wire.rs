//! The line's budget: when each byte leaves at the line's speed, and what leaves too late.
//!
//! A byte takes ten bits on the wire (8N1). Frames leave one after another in the order of sending; none leaves before
//! it is due. A frame is late by as much as its first byte begins after it is due: however slow the line, one frame alone is
//! not late.

use super::{Event, Timeline};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::units::{BITS_A_BYTE, Micros};

/// How many ticks a byte takes, whatever the baud rate.
const BYTE: u64 = BITS_A_BYTE * 1_000_000;
/// Later than this is a warning.
pub const LATE: Micros = Micros::from_millis(5);
/// Later than this is an error.
const FULL: Micros = Micros::from_millis(50);

/// The line, with what it still has to send. All times are exact, in ticks of 1/(10⁶ · baud) s: a microsecond is as many
/// ticks as the baud rate, a byte ten million.
#[derive(Clone, Debug)]
pub struct Wire {
    baud: u64,
    /// When the last byte so far has left.
    free: u64,
}

/// When a frame leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Departure {
    /// When its first byte begins, in ticks.
    pub begins: u64,
    /// When its last byte has left, in ticks.
    pub left: u64,
}

impl Wire {
    /// An idle line of so many bits a second.
    pub fn new(baud: u32) -> Self {
        Wire { baud: u64::from(baud.max(1)), free: 0 }
    }

    /// A time in ticks.
    pub fn ticks(&self, time: Micros) -> u64 {
        time.0.saturating_mul(self.baud)
    }

    /// Ticks in microseconds.
    pub(crate) fn in_micros(&self, ticks: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "for pictures")]
        let [ticks, baud] = [ticks as f64, self.baud as f64];
        ticks / baud
    }

    /// Sends a frame of so many bytes that is due at a time. Times must not go back.
    pub fn send(&mut self, due: Micros, bytes: usize) -> Departure {
        let begins = self.free.max(self.ticks(due));
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
        self.free = begins.saturating_add(bytes.saturating_mul(BYTE));
        Departure { begins, left: self.free }
    }

    /// Bytes that the line carries in a second.
    pub fn capacity(&self) -> u64 {
        self.baud / BITS_A_BYTE
    }
}

/// What a timeline asks of the line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Load {
    /// Bytes that leave in each second, from the start of the script.
    pub seconds: Vec<u64>,
    /// The frame that begins to leave latest after it is due: its place among the events, and by how much.
    pub worst: Option<(usize, Micros)>,
}

/// When frames leave, sent one after another, and how long after it is due each begins to, rounded up.
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

/// How busy the line is, second by second.
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
            // A script is at most a day long, and what leaves behind its end leaves soon after.
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

/// Reports what leaves too late: summed up, at the worst frame.
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
        2 => "; another frame leaves late, too".to_owned(),
        count => format!("; {} more frames leave late, too", count - 1),
    };
    let message = format!(
        "`{}` is due at {:.6} s{when} and begins to leave {late} later, because the line is busy{more}",
        timeline.board.show(&event.command),
        event.at
    );
    let help = format!(
        "the line carries {} bytes a second: let time pass between these commands, or send less with a lower `rate` or a longer `refresh`",
        Wire::new(timeline.baud).capacity()
    );
    Diagnostic::new(code, event.span, message, help).label(format!("{late} late"))
}
