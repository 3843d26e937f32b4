//! The messages at the end of a run, for `play`, its guard and `board`.

use motionseq::board::{Board, ON_SILENCE, ServoSet, Simulation, ValueForm, Verb};
use motionseq::playback::{GateEnd, Notice, Passage, Stop};
use motionseq::sim::Received;
use motionseq::timeline::{Gate, Timeline};
use motionseq::units::Micros;

use super::screen::{Screen, plural};

/// Shows what a virtual board received. `name` comes before each line: that of its robot, if there are several.
pub(super) fn board_summary(screen: &Screen, name: &str, board: &Board, received: &Received) {
    let frames = plural(usize::try_from(received.frames).unwrap_or(usize::MAX), "frame");
    screen.note(&format!(
        "{name}the virtual board received {frames} ({} bytes); {}",
        received.bytes,
        described(board, received)
    ));
    let pose = received.pose;
    if (pose.x_cm, pose.y_cm, pose.yaw_deg) != (0.0, 0.0, 0.0) {
        screen.note(&format!(
            "{name}the robot moved {} and {} and turned {}, in nominal units",
            way(pose.x_cm, " cm", ["to the right", "to the left"]),
            way(pose.y_cm, " cm", ["forward", "back"]),
            way(pose.yaw_deg, "°", ["clockwise", "counterclockwise"])
        ));
    }
    if received.lost > 0 {
        let lost = plural(usize::try_from(received.lost).unwrap_or(usize::MAX), "frame");
        screen.note(&match board.simulation {
            Simulation::Servos => {
                format!("{name}{lost} did not reach the servos: an answer was on the line, or --fault")
            }
            _ => format!("{name}--fault: {lost} did not reach the board"),
        });
    }
    if let [servos @ .., last] = received.fell.as_slice() {
        let others = servos.iter().fold(String::new(), |others, servo| format!("{others}{servo}, "));
        screen.note(&match servos {
            [] => format!("{name}servo {last} fell when its torque went off"),
            _ => format!("{name}servos {others}{last} fell when their torque went off"),
        });
    }
    if let Some((at, fault)) = received.first_fault {
        let count = |count, word| plural(usize::try_from(count).unwrap_or(usize::MAX), word);
        let (frames, bytes) = (count(received.not_understood, "frame"), count(received.skipped, "byte"));
        screen.note(&format!("{name}the board ignored {frames} and {bytes}; the first at byte {at}: {fault}"));
    }
}

/// `11.6 cm to the left`.
fn way(value: f64, unit: &str, [ahead, back]: [&str; 2]) -> String {
    format!("{:.1}{unit} {}", value.abs(), if value < 0.0 { back } else { ahead })
}

/// The last state of a board.
fn described(board: &Board, received: &Received) -> String {
    let state = &received.state;
    let mut words = Vec::new();
    for (id, resource) in board.resources.iter().enumerate().rev().filter(|(_, resource)| resource.rest.is_some()) {
        let (name, last) = (&resource.name, state.last(id));
        let is_active = last.is_some_and(|last| board.is_active(last));
        words.push(match last.map(|last| board.show(last)) {
            Some(last) if resource.refresh.is_some() && received.moves => format!("{name} is running: {last}"),
            Some(last) if resource.refresh.is_some() && is_active && board.simulation == Simulation::Mecanum => {
                format!("{name} was left at {last}, and the virtual board stopped by itself; {ON_SILENCE}")
            }
            Some(last) if resource.drives && is_active => format!("{name} was left at {last}"),
            _ if is_active => format!("{name} is {}", resource.activity),
            _ => format!("{name} {}", resource.idle),
        });
    }
    for (id, resource) in
        board.resources.iter().enumerate().filter(|(_, found)| found.rest.is_none() && found.is_exclusive)
    {
        let Some(last) = state.last(id) else { continue };
        let moving = board.verb(last.verb()).map(Verb::moving).unwrap_or_default();
        words.push(match (moving, last.values().last()) {
            ([axis], Some(value)) if axis.takes == ValueForm::Number => {
                // A servo may be on its way to its target.
                let at =
                    if board.feedback.as_ref().is_some_and(|found| found.holds.is_some()) { "set to" } else { "at" };
                let words = format!("{} {at} {} {}", resource.name, axis.shown(*value), axis.unit.symbol());
                words.trim_end().to_owned()
            }
            _ => {
                let shown = board.show(last).to_string();
                let begins_with_name = shown.starts_with(&*resource.name);
                if begins_with_name { shown } else { format!("{}: {shown}", resource.name) }
            }
        });
    }
    if words.is_empty() { "all outputs are off or unknown".to_owned() } else { words.join(", ") }
}

/// Whether the robot was stopped, for the end of a closing line; `without_stop` is what a robot does whose board has no stop frame.
pub(super) fn stop_words(stop: Stop, missing: ServoSet, without_stop: &str) -> String {
    match stop {
        Stop::NotDefined | Stop::Held => without_stop.to_owned(),
        Stop::NotHeld => {
            let missing: Vec<String> = missing.iter().map(|servo| servo.to_string()).collect();
            let servos = if missing.len() == 1 { "servo" } else { "servos" };
            format!("{servos} {} did not answer and may still be moving; otherwise, {without_stop}", missing.join(", "))
        }
        Stop::Sent | Stop::NotNeeded => "stop: sent".to_owned(),
        _ => "stop: NOT SENT - cut the power".to_owned(),
    }
}

/// The settings that a servo keeps: `speed 0 and accel 50`.
pub(super) fn kept_words(board: &Board, values: [Option<i32>; 2]) -> Option<String> {
    let verbs = board.feedback.as_ref()?.preparation.as_ref()?.settings.1;
    let kept = verbs.iter().zip(values);
    let kept = kept.filter_map(|(verb, value)| Some(format!("{} {}", board.verb(*verb)?.word, value?)));
    Some(kept.collect::<Vec<_>>().join(" and "))
}

/// What happens to servos before and during a script; `None` for other notices.
pub(super) fn servo_words(board: &Board, notice: Notice) -> Option<String> {
    match notice {
        Notice::Kept { servo, values } => Some(format!("servo {servo} keeps {}", kept_words(board, values)?)),
        Notice::SoftStart { servos, takes, is_longer } => {
            let (servos, takes) = (plural(servos, "servo"), takes.micros());
            let why = if is_longer { ", longer than asked because of the speed of a servo" } else { "" };
            Some(format!("soft start: {servos} to the first positions of the script in {takes:.3} s{why}"))
        }
        Notice::Flags { servo, bits } => Some(format!("servo {servo} reports an error: {}", board.errors(bits))),
        _ => None,
    }
}

/// The cause, the place in the script, the time, and whether the robot was stopped.
pub(super) fn closing_line(cause: &str, place: Option<String>, at: Micros, robot: &str) -> String {
    let place = place.map(|place| format!(" at {place}")).unwrap_or_default();
    format!("{cause}{place}, {at:.3} s into the run; {robot}")
}

/// What a signal that ended a run means.
pub(super) fn signal_name(signal: i32) -> String {
    match signal {
        1 => "the terminal was closed (SIGHUP)".into(),
        2 => "stopped by Ctrl-C".into(),
        3 => "stopped by Ctrl-\\ (SIGQUIT)".into(),
        20 => "stopped by Ctrl-Z (SIGTSTP)".into(),
        15 => "terminated (SIGTERM)".into(),
        other => format!("stopped by signal {other}"),
    }
}

/// How a gate ended: `turned > 90deg after 1.874 s: the board reports 90.12`.
pub(super) fn passage_words(gate: &Gate, passage: Passage) -> String {
    let awaited = match gate.gate.criterion() {
        Some(criterion) => criterion.to_string(),
        None if gate.gate.is_go() => "go".to_owned(),
        None => gate.gate.to_string(),
    };
    let (took, found) = (passage.took.micros(), passage.end.words(gate.gate.unit()));
    match passage.end {
        GateEnd::Go => format!("go after {took:.3} s"),
        GateEnd::Others => format!("{awaited}: continues after {took:.3} s"),
        GateEnd::Matched(_) => format!("{awaited} after {took:.3} s: {found}"),
        GateEnd::Continued(_) => format!("continues without {awaited} after {took:.3} s: {found}"),
        _ => format!("no {awaited} after {took:.3} s: {found}"),
    }
}

/// Whether every robot of a script notices this at the same time, so that it is shown once.
pub(super) fn is_for_all(timeline: &Timeline, notice: Notice) -> bool {
    let has_criterion = |gate: usize| timeline.gates.get(gate).is_some_and(|gate| gate.gate.criterion().is_some());
    match notice {
        Notice::Sleeping { .. }
        | Notice::Paused { .. }
        | Notice::Resumed { .. }
        | Notice::Pass { .. }
        | Notice::Marked { .. }
        | Notice::Help => true,
        Notice::Waiting { gate } => !has_criterion(gate),
        Notice::Passed(passage) => !has_criterion(passage.gate),
        _ => false,
    }
}
