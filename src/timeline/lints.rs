//! What compiles and is probably not meant, as far as it takes the whole timeline to see it.

use super::tween::{Part, Walk};
use super::{Event, Timeline};
use crate::board::Command;
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::program::TraceId;
use crate::source::Span;

/// A servo that has less than this many µs of pulse width still to go counts as arrived.
const ARRIVED: u64 = 20;
const MICROS: u64 = 1_000_000;

/// Reports servos that cannot get where they are sent before their next command. `speeds` are those of the four servos, in µs of
/// pulse width a second.
pub(super) fn servo_speed(timeline: &Timeline, speeds: [u32; 4], diagnostics: &mut Diagnostics) {
    let mut servos = speeds.map(|speed| Servo { speed: u64::from(speed), going: None });
    let mut walk = Walk::new(timeline.tweens());
    for event in timeline.events() {
        let begins = !matches!(walk.take(&event.command, event.kind), Part::Further);
        let [pan, tilt, third, fourth] = &mut servos;
        match &event.command {
            Command::Servo { index, pulse } => {
                let servo = match index.get() {
                    1 => pan,
                    2 => tilt,
                    3 => third,
                    _ => fourth,
                };
                servo.told(event, index.get(), pulse.get(), begins, timeline, diagnostics);
            }
            Command::Servos { pan: to, tilt: tilt_to } => {
                pan.told(event, 1, to.get(), begins, timeline, diagnostics);
                tilt.told(event, 2, tilt_to.get(), begins, timeline, diagnostics);
            }
            _ => {}
        }
    }
}

/// A servo that turns at an even speed.
struct Servo {
    /// µs of pulse width a second.
    speed: u64,
    going: Option<Going>,
}

/// Where it is, and where it goes. Pulse widths are in millionths of a µs, so that they stay exact.
struct Going {
    at_us: u64,
    pulse: u64,
    target: u64,
    /// What began it: where it was then, when, and the place in the script.
    from: u64,
    since_us: u64,
    span: Span,
    trace: TraceId,
}

impl Servo {
    /// Takes a frame; `begins` where it is no further step of a move.
    #[expect(clippy::too_many_arguments, reason = "a message and its parts")]
    fn told(
        &mut self,
        event: &Event,
        index: i32,
        pulse: i32,
        begins: bool,
        timeline: &Timeline,
        diagnostics: &mut Diagnostics,
    ) {
        let target = u64::try_from(pulse).unwrap_or(0) * MICROS;
        let Some(going) = &mut self.going else {
            // Nobody knows where it was.
            let (at_us, span, trace) = (event.at_us, event.span, event.trace);
            self.going = Some(Going { at_us, pulse: target, target, from: target, since_us: at_us, span, trace });
            return;
        };
        let way = self.speed.saturating_mul(event.at_us - going.at_us);
        going.pulse = if going.pulse < going.target {
            going.target.min(going.pulse.saturating_add(way))
        } else {
            going.target.max(going.pulse.saturating_sub(way))
        };
        // A move is told where to be all the time, and still has a step to go where its time ends.
        let needed = going.from.abs_diff(going.target);
        let possible = self.speed.saturating_mul(event.at_us - going.since_us);
        // Two commands at one time are told as a clash.
        if begins
            && event.at_us > going.since_us
            && needed > possible
            && going.pulse.abs_diff(going.target) > ARRIVED * MICROS
        {
            let diagnostic = too_fast(going, index, self.speed, event.at_us);
            diagnostics.push(timeline.traces.attach(diagnostic, going.trace).related(event.span, "its next command"));
        }
        (going.at_us, going.target) = (event.at_us, target);
        if begins {
            (going.from, going.since_us) = (going.pulse, event.at_us);
            (going.span, going.trace) = (event.span, event.trace);
        }
    }
}

fn too_fast(going: &Going, index: i32, speed: u64, until_us: u64) -> Diagnostic {
    let (from, to) = (going.from / MICROS, going.target / MICROS);
    let needed = from.abs_diff(to) * 1_000 / speed.max(1);
    let left = (until_us - going.since_us) / 1_000;
    Diagnostic::new(
        Code::ServoSpeed,
        going.span,
        format!(
            "servo {index} needs about {needed} ms from {from} to {to} µs, and its next command comes after {left} ms"
        ),
        format!(
            "give it more time; if it is faster than {speed} µs a second, say so: `limit servo {index} speed {}us`",
            speed * 2
        ),
    )
    .label("does not get there")
}
