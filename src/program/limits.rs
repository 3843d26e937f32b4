//! `limit`: ranges that a script sets for itself, those that hold where it sets none, and those of its project.

use super::Settings;
use crate::board::{Board, Command, Limited};
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;

/// One limited range.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What is limited.
    pub limited: Limited,
    /// The smallest value allowed.
    pub low: f64,
    /// The largest value allowed.
    pub high: f64,
    /// Where the script sets it; `None` for a limit of the board.
    pub span: Option<Span>,
}

/// A range that a project sets for all of its scripts. A script can only narrow it. It comes as data, because
/// the library reads no configuration file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ProjectLimit {
    /// What is limited.
    pub limited: Limited,
    /// The smallest value allowed, in the unit of the value.
    pub low: f64,
    /// The largest value allowed.
    pub high: f64,
    /// Where the project sets it, for messages: `motionseq.toml:4`.
    pub place: String,
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
        format!("limit {} {}..{}", board.limited_name(self.limited), self.low, self.high)
    }
}

/// What is wrong with a command that breaks a limit of the project or of the script, and how to widen the first one that it
/// breaks.
#[inline]
pub(crate) fn broken(board: &Board, settings: &Settings, command: &Command, span: Span) -> Option<Diagnostic> {
    let value = |limit: &Limit| board.outside(limit.limited, (limit.low, limit.high), command);
    // The script cannot widen a limit of the project, so that one is reported first.
    broken_of_project(board, &settings.project_limits, command, span)
        .or_else(|| settings.limits.iter().find_map(|limit| Some(diagnostic(board, limit, value(limit)?, span))))
}

/// What is wrong with a command that is outside of a limit of the project.
fn broken_of_project(board: &Board, limits: &[ProjectLimit], command: &Command, span: Span) -> Option<Diagnostic> {
    if limits.is_empty() {
        return None;
    }
    // The bytes of a raw frame can be those of a command.
    let decoded = board.is_opaque(command).then(|| board.decode(&board.to_frame(command)).ok()).flatten();
    let command = decoded.as_ref().unwrap_or(command);
    limits.iter().find_map(|limit| {
        let ProjectLimit { limited, low, high, place } = limit;
        let value = board.outside(*limited, (*low, *high), command)?;
        let name = board.limited_name(*limited);
        let diagnostic = diagnostic!(Limit, span,
            "{value} is outside of the limit {low}..{high} of {name}, set in {place}";
            help: "stay inside, or change the limit in {place}");
        Some(diagnostic.label("outside the limit"))
    })
}

fn diagnostic(board: &Board, limit: &Limit, value: i32, span: Span) -> Diagnostic {
    let Limit { limited, low, high, .. } = *limit;
    let Some(set) = limit.span else {
        let (least, most) = board.range(limited).unwrap_or_default();
        let proper = board.default_limit(limited);
        let [why, unless] = proper.map_or(["", ""], |proper| [&*proper.why, &*proper.unless]);
        let is_above = f64::from(value) > high;
        let wide = if is_above {
            Limit { high: f64::from(most), ..limit.clone() }
        } else {
            Limit { low: f64::from(least), ..limit.clone() }
        };
        let name = board.limited_name(limited);
        let message = format!("{value} is outside of the limit {low}..{high} of {name}: {why}");
        let stay = if is_above { format!("at or below {high}") } else { format!("at or above {low}") };
        let help = format!("stay {stay}, or, {unless}, widen the limit: `{}`", wide.line(board));
        return diagnostic!(Limit, span, "{message}"; help: "{help}").label("outside the limit");
    };
    let wide = Limit { low: low.min(value.into()), high: high.max(value.into()), ..limit.clone() };
    diagnostic!(Limit, span, "{value} is outside of the limit {low}..{high}";
        help: "stay inside, or widen the limit: `{}`", wide.line(board))
    .label("outside the limit")
    .related(set, "limited here")
}
