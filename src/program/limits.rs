//! `limit`: ranges that a script sets for itself, those that hold where it sets none, and those of its project.

use super::Settings;
use super::joints::Joint;
use crate::board::{Board, Command, Limited};
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;

/// One limited range.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What is limited.
    pub limited: Limited,
    /// The smallest value allowed, as a value of the board.
    pub low: f64,
    /// The largest value allowed.
    pub high: f64,
    /// Where the script sets it; `None` for a limit of the board.
    pub span: Option<Span>,
}

impl Limit {
    /// The limits of a script that sets none.
    pub(crate) fn proper(board: &Board) -> Vec<Limit> {
        let limit = |limit: &crate::board::DefaultLimit| Limit {
            limited: limit.limited,
            low: limit.range.0.into(),
            high: limit.range.1.into(),
            span: None,
        };
        board.limits.iter().map(limit).collect()
    }

    /// The line that sets it.
    fn line(&self, board: &Board) -> String {
        let [low, high] = [self.low, self.high].map(|value| shown(board, self.limited, value));
        format!("limit {} {low}..{high}", board.limited_name(self.limited))
    }
}

/// The limits of a script, and the ranges of its joints, for pictures.
pub(crate) fn of_pictures(settings: &Settings) -> Vec<Limit> {
    let mut limits = settings.limits.clone();
    for joint in &settings.joints {
        let Some((low, high)) = joint.range else { continue };
        let limited = joint.limited;
        match limits.iter_mut().find(|limit| limit.limited == limited && limit.span.is_some()) {
            Some(limit) => (limit.low, limit.high) = (limit.low.max(low), limit.high.min(high)),
            None => limits.push(Limit { limited, low, high, span: Some(joint.span) }),
        }
    }
    limits
}

/// A value of the board as a script writes it.
fn shown(board: &Board, limited: Limited, value: f64) -> f64 {
    value / f64::from(board.axis(limited).map_or(1, |axis| axis.scale))
}

/// What is wrong with a command that breaks a limit of the project or of the script, and how to widen the first one that it
/// breaks.
#[inline]
pub(crate) fn broken(board: &Board, settings: &Settings, command: &Command, span: Span) -> Option<Diagnostic> {
    let value = |limit: &Limit| board.outside(limit.limited, (limit.low, limit.high), command);
    // The script cannot widen a limit of the project, so that one is reported first.
    broken_of_project(board, &settings.project_limits, command, span)
        .or_else(|| settings.limits.iter().find_map(|limit| Some(diagnostic(board, limit, value(limit)?, span))))
        .or_else(|| settings.joints.iter().find_map(|joint| broken_of_joint(board, joint, command, span)))
}

/// What is wrong with a command that is outside of the range of a joint.
fn broken_of_joint(board: &Board, joint: &Joint, command: &Command, span: Span) -> Option<Diagnostic> {
    let (low, high) = joint.range?;
    let value = board.outside(joint.limited, (low, high), command)?;
    let unit = board.axis(joint.limited)?.unit;
    let [value, low, high] = [value.into(), low, high].map(|value| shown(board, joint.limited, value));
    let name = &joint.name;
    let message = match (joint.degrees(value, unit), joint.angles(low, high, unit)) {
        (Some(angle), Some((least, most))) => {
            let [angle, least, most] = [angle, least, most].map(|angle| libm::round(angle * 10.0) / 10.0);
            format!(
                "{value} ({angle}deg) is outside of the range {low}..{high} ({least}deg..{most}deg) of the joint `{name}`"
            )
        }
        _ => format!("{value} is outside of the range {low}..{high} of the joint `{name}`"),
    };
    let diagnostic = diagnostic!(Limit, span, "{message}"; help: "stay inside, or widen the range of the joint");
    Some(diagnostic.label("outside the range").related(joint.span, "its joint"))
}

/// What is wrong with a command that is outside of a limit of the project.
fn broken_of_project(board: &Board, limits: &[(Limit, String)], command: &Command, span: Span) -> Option<Diagnostic> {
    if limits.is_empty() {
        return None;
    }
    // The bytes of a raw frame can be those of a command.
    let decoded = board.is_opaque(command).then(|| board.decode(&board.to_frame(command)).ok()).flatten();
    let command = decoded.as_ref().unwrap_or(command);
    limits.iter().find_map(|(limit, place)| {
        let Limit { limited, low, high, .. } = *limit;
        let value = board.outside(limited, (low, high), command)?;
        let [value, low, high] = [value.into(), low, high].map(|value| shown(board, limited, value));
        let name = board.limited_name(limited);
        let diagnostic = diagnostic!(Limit, span,
            "{value} is outside of the limit {low}..{high} of {name}, set in {place}";
            help: "stay inside, or change the limit in {place}");
        Some(diagnostic.label("outside the limit"))
    })
}

fn diagnostic(board: &Board, limit: &Limit, value: i32, span: Span) -> Diagnostic {
    let limited = limit.limited;
    let [low, high, found] = [limit.low, limit.high, value.into()].map(|value| shown(board, limited, value));
    let Some(set) = limit.span else {
        let proper = board.default_limit(limited);
        let [why, unless] = proper.map_or(["", ""], |proper| [&*proper.why, &*proper.unless]);
        let is_above = f64::from(value) > limit.high;
        let wide = if is_above {
            Limit { high: value.into(), ..limit.clone() }
        } else {
            Limit { low: value.into(), ..limit.clone() }
        };
        let name = board.limited_name(limited);
        let message = format!("{found} is outside of the limit {low}..{high} of {name}: {why}");
        let stay = if is_above { format!("at or below {high}") } else { format!("at or above {low}") };
        let help = format!("stay {stay}, or, {unless}, widen the limit: `{}`", wide.line(board));
        return diagnostic!(Limit, span, "{message}"; help: "{help}").label("outside the limit");
    };
    let wide = Limit { low: limit.low.min(value.into()), high: limit.high.max(value.into()), ..limit.clone() };
    diagnostic!(Limit, span, "{found} is outside of the limit {low}..{high}";
        help: "stay inside, or widen the limit: `{}`", wide.line(board))
    .label("outside the limit")
    .related(set, "limited here")
}
