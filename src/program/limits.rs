//! `limit`: ranges that a script sets for itself, and those that hold where it sets none.

use super::{Settings, project_limits};
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
    project_limits::broken(board, &settings.project_limits, command, span)
        .or_else(|| settings.limits.iter().find_map(|limit| Some(diagnostic(board, limit, value(limit)?, span))))
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
